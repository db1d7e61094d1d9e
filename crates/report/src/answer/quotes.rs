//! Text with quoted parts, in which separators do not separate.

/// The parts of `text` between separators outside double quotes, trimmed.
pub(super) fn split<'a>(text: &'a str, separator: &str) -> Vec<&'a str> {
    let mut parts = Vec::new();
    let (mut start, mut at) = (0, 0);
    let mut quoted = false;
    while let Some(c) = text[at..].chars().next() {
        quoted ^= c == '"';
        if !quoted && text[at..].starts_with(separator) {
            parts.push(text[start..at].trim());
            at += separator.len();
            start = at;
        } else {
            at += c.len_utf8();
        }
    }
    parts.push(text[start..].trim());
    parts
}

/// The two parts of `text` around its first separator outside double quotes.
pub(super) fn split_once<'a>(text: &'a str, separator: &str) -> Option<(&'a str, &'a str)> {
    let before = *split(text, separator).first()?;
    let end = before.as_ptr() as usize - text.as_ptr() as usize + before.len();
    let (_, after) = text[end..].split_once(separator)?;
    Some((before, after.trim()))
}

/// A value without its quotes.
pub(super) fn unquoted(text: &str) -> &str {
    text.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen to fail where quotes are ignored.
    #[test]
    fn quotes_hide_separators() {
        assert_eq!(split(r#"a="x, y", b=z"#, ","), [r#"a="x, y""#, "b=z"]);
        assert_eq!(split("", ","), [""]);
        assert_eq!(split_once(r#" "a: b": c: d"#, ":"), Some((r#""a: b""#, "c: d")));
        assert_eq!(split_once("median", ":"), None);
        assert_eq!(unquoted(r#""a, b""#), "a, b");
    }
}
