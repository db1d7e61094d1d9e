//! The places of keys and values in a TOML text.

use std::cell::OnceCell;

use toml::{
    Spanned,
    de::{DeArray, DeTable},
};

use crate::fault::place_at;

/// The part of a setting that is at fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The key: it is unknown, or a key below it is missing.
    Key,
    /// The value.
    Value,
}

/// A TOML text whose keys are looked up by their paths.
///
/// The text is parsed at the first look-up and kept, so that the places of n faults cost one parse: a check that parses
/// anew for each of its faults is quadratic in the size of the file.
#[derive(Debug)]
pub struct Places<'a> {
    text: &'a str,
    document: OnceCell<Spanned<DeTable<'a>>>,
}

impl<'a> Places<'a> {
    /// The places of `text`.
    pub fn of(text: &'a str) -> Self {
        Self { text, document: OnceCell::new() }
    }

    /// The line (from 1) of the key at `path`.
    ///
    /// If the key does not exist, it is the line of the nearest existing table above. Numbers in the path are indices of
    /// arrays: `["object", "2", "id"]`.
    pub fn line(&self, path: &[&str]) -> Option<usize> {
        self.place(path, Part::Key).map(|(_, (line, _))| line)
    }

    /// The position of the key at `path` or of its value.
    ///
    /// The result is (number of existing steps of `path`, (line, column)). The number is smaller than the path's length
    /// if only a table above exists. The position of a table is that of its key. A component given by its bare name
    /// counts as having a `name`.
    pub fn place(&self, path: &[&str], part: Part) -> Option<(usize, (usize, usize))> {
        let document = self.document.get_or_init(|| DeTable::parse_recoverable(self.text).0);
        let mut place = None;
        let mut scalar: Option<usize> = None;
        let mut table = Some(document.get_ref());
        let mut array: Option<&DeArray<'_>> = None;
        for (depth, step) in path.iter().enumerate() {
            let value = if let Some(items) = array {
                step.parse::<usize>().ok().and_then(|k| items.get(k))
            } else {
                table.and_then(|table| table.iter().find(|(key, _)| key.get_ref() == step)).map(|(key, value)| {
                    place = Some((depth + 1, key.span().start));
                    value
                })
            };
            let Some(value) = value else {
                // A bare name, or a value in place of a table.
                if let Some(start) = scalar {
                    place = Some((depth + usize::from(*step == "name"), start));
                }
                break;
            };
            let is_table = value.get_ref().is_table();
            if array.is_some() || (part == Part::Value && !is_table && depth + 1 == path.len()) {
                place = Some((depth + 1, value.span().start));
            }
            (table, array) = (value.get_ref().as_table(), value.get_ref().as_array());
            scalar = (table.is_none() && array.is_none()).then(|| value.span().start);
        }
        place.map(|(depth, offset)| (depth, place_at(self.text, offset)))
    }
}

/// The line of one key; see [`Places::line`].
pub fn line_of(text: &str, path: &[&str]) -> Option<usize> {
    Places::of(text).line(path)
}

/// The position of one key or value; see [`Places::place`].
pub fn place_of(text: &str, path: &[&str], part: Part) -> Option<(usize, (usize, usize))> {
    Places::of(text).place(path, part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_to_its_line() {
        let text = "a = 1\n[b]\nc = 2\n[[d]]\ne = 3\n[[d]]\ne = 4\n";
        assert_eq!(line_of(text, &["b", "c"]), Some(3));
        assert_eq!(line_of(text, &["d", "1", "e"]), Some(7));
        assert_eq!(line_of(text, &["d", "1", "missing"]), Some(6));
        assert_eq!(line_of(text, &["nothing"]), None);
        let table = "é = 1\nb = { ü = 2, c = 'd' }";
        let place = |path: &[&str], part| place_of(table, path, part);
        assert_eq!(place(&["b", "c"], Part::Key), Some((2, (2, 14))));
        assert_eq!(place(&["b", "c"], Part::Value), Some((2, (2, 18))));
        assert_eq!(place(&["b"], Part::Value), Some((1, (2, 1))));
        assert_eq!(place(&["b", "c", "x"], Part::Key), Some((2, (2, 18))));
        assert_eq!(place(&["b", "c", "name"], Part::Value), Some((3, (2, 18))));
        assert_eq!(place(&["b", "x"], Part::Value), Some((1, (2, 1))));
        assert_eq!(place_at("ab\ncé d", 7), (2, 4));
    }
}
