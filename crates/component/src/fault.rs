//! Faults in files, as one-line messages.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use crate::{suggest::nearest, words::plain};

/// A fault in an input file: description, place, value and remedy.
///
/// It is printed as `what in file:line:column: value; remedy`, in one line for every input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The description of the fault.
    pub what: String,
    /// The file.
    pub file: PathBuf,
    /// The line, from 1, if it is known.
    pub line: Option<usize>,
    /// The column (characters, from 1), if it is known.
    pub column: Option<u32>,
    /// The invalid value; empty if there is none.
    pub value: String,
    /// The remedy; empty if there is none.
    pub remedy: String,
}

impl Fault {
    /// A fault with the description `what` in `file`.
    pub fn new(what: impl Into<String>, file: &Path) -> Self {
        let (value, remedy) = (String::new(), String::new());
        Self { what: what.into(), file: file.to_owned(), line: None, column: None, value, remedy }
    }

    /// The fault with its line (from 1), if one is known.
    #[must_use]
    pub fn on_line(mut self, line: impl Into<Option<usize>>) -> Self {
        self.line = line.into();
        self
    }

    /// The fault with its line and column (from 1), if they are known.
    #[must_use]
    pub fn at(mut self, place: Option<(usize, usize)>) -> Self {
        self.line = place.map(|(line, _)| line);
        self.column = place.and_then(|(_, column)| u32::try_from(column).ok());
        self
    }

    /// The fault with the invalid value.
    #[must_use]
    pub fn value(mut self, value: impl fmt::Display) -> Self {
        self.value = value.to_string();
        self
    }

    /// The fault with its remedy.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = remedy.into();
        self
    }

    /// The fault that the TOML parser found in `text`, the content of `file`.
    ///
    /// For an unknown key the remedy is the nearest known one.
    pub fn in_toml(file: &Path, text: &str, error: &toml::de::Error) -> Self {
        let place = error.span().filter(|_| !text.is_empty()).map(|span| place_at(text, span.start));
        let message = error.message().trim_end();
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        match quoted.split_first() {
            Some((key, known)) if message.starts_with("unknown field") => Self::new("unknown key", file)
                .at(place)
                .value(format!("`{key}`"))
                .remedy(match nearest(key, known.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("there are {}", known.join(", ")),
                }),
            _ => Self::new(plain(message), file)
                .at(place)
                .value(error.span().and_then(|span| text.get(span)).unwrap_or_default()),
        }
    }
}

/// Maximum length of a printed value (characters): a page of a terminal, 24 lines of 80.
///
/// A message itself is never shortened; a value may be a line of a damaged file of any length.
const LONGEST_VALUE: usize = 24 * 80;

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = format!("{} in {}", self.what, self.file.display());
        if let Some(line) = self.line {
            text += &format!(":{line}");
        }
        if let Some(column) = self.column {
            text += &format!(":{column}");
        }
        if !self.value.is_empty() {
            let short: String = self.value.chars().take(LONGEST_VALUE).collect();
            let more = if self.value.chars().nth(LONGEST_VALUE).is_some() { "…" } else { "" };
            text += &format!(": {short}{more}");
        }
        if !self.remedy.is_empty() {
            text += &format!("; {}", self.remedy);
        }
        // Names come from files: control characters must neither move the cursor nor start a line.
        f.write_str(&text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>())
    }
}

impl std::error::Error for Fault {}

/// The line (from 1) of the byte at `offset`.
pub fn line_at(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// The line and column (characters, from 1) of the byte at `offset`.
pub fn place_at(text: &str, offset: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
    // Continuation bytes of UTF-8 do not count as characters.
    (line_at(text, offset), 1 + before[start..].iter().filter(|&&b| b & 0xC0 != 0x80).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_key_names_line_and_nearest() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[expect(dead_code, reason = "only its keys matter")]
        struct Experiment {
            question: String,
            seed: u64,
        }
        let text = "question = 'why'\nsede = 3\n";
        let error = toml::from_str::<Experiment>(text).unwrap_err();
        let fault = Fault::in_toml(Path::new("e.toml"), text, &error);
        assert_eq!(fault.to_string(), "unknown key in e.toml:2:1: `sede`; did you mean `seed`?");
    }

    #[test]
    fn control_characters_do_not_reach_the_terminal() {
        let fault = Fault::new("bad name", Path::new("f")).value("\u{1b}[2J\nx");
        assert_eq!(fault.to_string(), "bad name in f:  [2J x");
        let long = Fault::new("bad name", Path::new("f")).value("é".repeat(LONGEST_VALUE + 1)).to_string();
        assert_eq!(long, format!("bad name in f: {}…", "é".repeat(LONGEST_VALUE)));
    }
}
