//! The XML form of OpenCV's FileStorage.

use roxmltree::{Document, Node};
use seafix_component::Fault;

use super::{opencv::Storage, text::Source};

/// Whether a text is such a file.
pub(super) fn is_one(text: &str) -> bool {
    text.contains("<opencv_storage>")
}

/// The document of a file.
///
/// # Errors
/// Invalid XML.
pub(super) fn document(source: &Source) -> Result<Document<'_>, Fault> {
    Document::parse(&source.text).map_err(|error| {
        let line = usize::try_from(error.pos().row).ok();
        Fault::new("invalid XML", &source.file).on_line(line).value(error).remedy("correct the file")
    })
}

/// The finite numbers in the text of a node.
pub(super) fn numbers(node: Node<'_, '_>) -> Option<Vec<f64>> {
    any_numbers(node).filter(|numbers| numbers.iter().all(|number| number.is_finite()))
}

/// The numbers in the text of a node; OpenCV writes `.Nan` and `.Inf` for those that are not finite.
fn any_numbers(node: Node<'_, '_>) -> Option<Vec<f64>> {
    node.text()?
        .split_whitespace()
        .map(|word| word.parse().or_else(|_| word.replacen('.', "", 1).parse()).ok())
        .collect()
}

/// Adds the matrices, lists and numbers of the file.
pub(super) fn add(storage: &mut Storage, source: &Source) -> Result<(), Fault> {
    let document = document(source)?;
    for node in document.root_element().children().filter(Node::is_element) {
        let key = node.tag_name().name().to_owned();
        let data = node.children().find(|child| child.has_tag_name("data")).unwrap_or(node);
        match any_numbers(data).filter(|numbers| !numbers.is_empty()) {
            Some(numbers) => drop(storage.numbers.insert(key, numbers)),
            None => {
                drop(storage.words.insert(key, node.text().unwrap_or_default().trim().trim_matches('"').to_owned()))
            }
        }
    }
    Ok(())
}
