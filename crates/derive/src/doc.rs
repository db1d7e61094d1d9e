//! The documentation comment of a field as plain text.

use syn::{Attribute, Expr, ExprLit, Lit, Meta};

/// The text of the documentation comment: paragraphs joined by spaces, without links.
pub(crate) fn documentation(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("doc") => match &pair.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    });
    let words: Vec<String> =
        lines.flat_map(|line| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>()).collect();
    unlinked(&words.join(" "))
}

/// The text with `[words](target)` and `` [`Name`] `` replaced by the words. A link to a field names its key.
fn unlinked(text: &str) -> String {
    let Some(open) = text.find('[') else { return text.to_owned() };
    let (before, rest) = text.split_at(open);
    let Some((words, after)) = rest[1..].split_once(']') else { return text.to_owned() };
    if let Some((target, after)) = after.strip_prefix('(').and_then(|after| after.split_once(')')) {
        let words = if target.starts_with("Self::") { words.replace('_', "-") } else { words.to_owned() };
        return format!("{before}{words}{}", unlinked(after));
    }
    if words.starts_with('`') && words.ends_with('`') {
        return format!("{before}{words}{}", unlinked(after));
    }
    format!("{before}[{}", unlinked(&rest[1..]))
}
