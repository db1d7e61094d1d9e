//! YAML in memory that its text bounds.

use yaml_rust2::{Event, ScanError, Yaml, YamlLoader, parser::Parser};

/// The maximum number of nodes that aliases may add. The files of cameras have none or a few.
const MAX_ALIASED: usize = 10_000;

/// The maximum depth of nested nodes; the reader of a document calls itself once for each.
const MAX_DEPTH: usize = 64;

/// The documents of a YAML text.
///
/// An alias repeats the node of its anchor, so that a few lines of aliases of aliases may stand for any amount of memory.
/// The repeated nodes are counted before anything is loaded.
///
/// # Errors
/// Invalid YAML, too many repeated nodes, or too many nested ones: the message and its line (from 1).
pub(crate) fn load(text: &str) -> Result<Vec<Yaml>, (String, usize)> {
    let message = |error: ScanError| (error.info().to_owned(), error.marker().line());
    let (mut count, mut parser) = (Count::default(), Parser::new_from_str(text));
    loop {
        let (event, place) = parser.next_token().map_err(message)?;
        if event == Event::StreamEnd {
            return YamlLoader::load_from_str(text).map_err(message);
        }
        count.take(&event).map_err(|what| (what.to_owned(), place.line()))?;
    }
}

/// The number of nodes of a text with its aliases.
#[derive(Default)]
struct Count {
    /// The open nodes: the number of the anchor (0 without one) and of nodes so far.
    open: Vec<(usize, usize)>,
    /// The number of nodes of each anchor, by its number.
    anchors: Vec<usize>,
    aliased: usize,
}

impl Count {
    fn add(&mut self, nodes: usize) {
        if let Some((_, count)) = self.open.last_mut() {
            *count = count.saturating_add(nodes);
        }
    }

    fn anchor(&mut self, number: usize, nodes: usize) {
        if number > 0 {
            // The parser numbers anchors in order.
            self.anchors.resize(self.anchors.len().max(number + 1), 0);
            self.anchors[number] = nodes;
        }
    }

    /// Counts an event; the error is the message.
    fn take(&mut self, event: &Event) -> Result<(), &'static str> {
        match *event {
            Event::Scalar(_, _, anchor, _) => {
                self.anchor(anchor, 1);
                self.add(1);
            }
            Event::SequenceStart(anchor, _) | Event::MappingStart(anchor, _) => {
                self.open.push((anchor, 1));
                if self.open.len() > MAX_DEPTH {
                    return Err("too many nested values");
                }
            }
            Event::SequenceEnd | Event::MappingEnd => {
                let (anchor, nodes) = self.open.pop().unwrap_or_default();
                self.anchor(anchor, nodes);
                self.add(nodes);
            }
            Event::Alias(anchor) => {
                let nodes = self.anchors.get(anchor).copied().unwrap_or(0);
                self.aliased = self.aliased.saturating_add(nodes);
                self.add(nodes);
                if self.aliased > MAX_ALIASED {
                    return Err("aliases that repeat too many values");
                }
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails without the count: each line repeats the one before ten times, which needs some gigabytes.
    #[test]
    fn aliases_of_aliases_are_not_expanded() {
        let mut text = "a0: &a0 [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]\n".to_owned();
        for k in 1..12 {
            let again = vec![format!("*a{}", k - 1); 10].join(", ");
            text += &format!("a{k}: &a{k} [{again}]\n");
        }
        let (what, line) = load(&text).unwrap_err();
        // 110, 1110 and 11 110 values are repeated in the lines 2, 3 and 4.
        assert_eq!((&what[..], line), ("aliases that repeat too many values", 4));
        // A reader that calls itself for each level would end the program.
        for nested in ["[".repeat(200) + &"]".repeat(200), "- ".repeat(1_000_000)] {
            assert!(load(&nested).unwrap_err().0.contains("nested"));
        }
    }

    #[test]
    fn a_few_aliases_are_read() {
        let documents = load("size: &size [752, 480]\nleft: *size\nright: *size\n").unwrap();
        assert_eq!(documents[0]["right"][1].as_i64(), Some(480));
    }
}
