//! Formatted text as Markdown.

use crate::{document::Span, print::unicode};

/// `text` as Markdown with its emphasis; special characters are escaped.
pub(crate) fn markdown(text: &[Span]) -> String {
    text.iter()
        .map(|span| {
            let plain = escape(span.plain());
            match span {
                Span::Italic(_) => format!("*{plain}*"),
                Span::Bold(_) | Span::Best(_) => format!("**{plain}**"),
                Span::Code(text) => format!("`{}`", text.replace('`', "'")),
                _ => plain,
            }
        })
        .collect()
}

/// A text with all special characters of Markdown escaped.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::new();
    for c in unicode::harmless(text).chars() {
        match c {
            '<' => out += "&lt;",
            '&' => out += "&amp;",
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' => {
                out.push('\\');
                out.push(c);
            }
            '\n' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
