//! Numbers with keys that identify their source in the logs.

use std::{fmt, sync::Arc};

use crate::{format, run::Trial};

/// The key of a number: enough to compute it again from the logs.
///
/// Its text has the form `median tre_rms of found in mm; /metrics/evaluation; 0..2000000000 ns; 001.mcap`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Key {
    /// The statistic, the quantity, the group of attempts and the unit.
    pub(crate) what: String,
    /// The topic of the messages.
    pub(crate) topic: String,
    /// The first and the last stamp of the messages (ns).
    pub(crate) span: [u64; 2],
    /// The names of the logs; comparisons list first and second alternately.
    pub(crate) logs: Vec<String>,
}

/// A printed number with its key.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Number {
    pub(crate) text: String,
    /// The value before rounding; `None` where it is unknown.
    pub(crate) value: Option<f64>,
    pub(crate) key: Arc<Key>,
}

impl Key {
    /// The key of `what` over one complete log.
    pub(crate) fn of(trial: &Trial, topic: &str, what: impl Into<String>) -> Self {
        Self { what: what.into(), topic: topic.to_owned(), span: trial.span(), logs: vec![trial.file()] }
    }

    /// Parses the text that [`fmt::Display`] writes.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split("; ");
        let (what, topic, span, logs) = (parts.next()?, parts.next()?, parts.next()?, parts.next()?);
        let (from, to) = span.strip_suffix(" ns")?.split_once("..")?;
        let key = Self {
            what: unescape(what),
            topic: unescape(topic),
            span: [from.parse().ok()?, to.parse().ok()?],
            logs: logs.split(", ").map(unescape).collect(),
        };
        parts.next().is_none().then_some(key)
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let logs: Vec<String> = self.logs.iter().map(|log| escape(log)).collect();
        let [from, to] = self.span;
        write!(f, "{}; {}; {from}..{to} ns; {}", escape(&self.what), escape(&self.topic), logs.join(", "))
    }
}

/// `text` with separators and control characters percent-encoded, so that a name cannot end its part of a key.
fn escape(text: &str) -> String {
    let mut written = String::new();
    for c in text.chars() {
        match c {
            ',' | ';' | '%' => written += &format!("%{:02x}", c as u32),
            c if c.is_control() => written += &format!("%{:02x}", c as u32),
            c => written.push(c),
        }
    }
    written
}

fn unescape(text: &str) -> String {
    let mut read = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('%') {
        read += before;
        let code = after.get(..2).and_then(|hex| u32::from_str_radix(hex, 16).ok()).and_then(char::from_u32);
        match code {
            Some(c) => {
                read.push(c);
                rest = &after[2..];
            }
            None => {
                read.push('%');
                rest = after;
            }
        }
    }
    read + rest
}

impl Number {
    /// A value with `decimals` decimals; a dash for `None`.
    pub(crate) fn new(value: Option<f64>, decimals: usize, key: Key) -> Self {
        Self { text: format::number(value, decimals), value, key: Arc::new(key) }
    }

    /// A count.
    pub(crate) fn count(value: usize, key: Key) -> Self {
        Self::new(Some(value as f64), 0, key)
    }

    /// A probability, with an exponent if it is small.
    pub(crate) fn probability(value: f64, key: Key) -> Self {
        Self { text: format::probability(value), value: Some(value), key: Arc::new(key) }
    }

    /// The text of `value` in the format of `text`.
    pub(crate) fn like(text: &str, value: Option<f64>) -> String {
        match value {
            Some(value) if text.contains('e') => format::probability(value),
            _ => format::number(value, text.split_once('.').map_or(0, |(_, decimals)| decimals.len())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_read_as_they_were_written() {
        let key = Key {
            what: "value tre_rms of a; b, 100% c\u{1b} at 3".to_owned(),
            topic: "/metrics/evaluation".to_owned(),
            span: [3, 9],
            logs: vec!["a, b.mcap".to_owned(), "c;d.mcap".to_owned()],
        };
        assert_eq!(Key::parse(&key.to_string()), Some(key));
        assert_eq!(Key::parse("median"), None);
    }
}
