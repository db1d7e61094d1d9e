//! Paragraphs, broken greedily into lines.

use crate::{document::Span, fonts::Font, print::pdf::sheet::Sheets};

/// The style of a text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    pub(super) size: f64,
    pub(super) align: Align,
    pub(super) left: f64,
    pub(super) width: f64,
    /// The font of plain text.
    pub(super) font: Font,
}

/// The alignment of a paragraph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Both,
    Centre,
    Right,
}

/// The line height in units of the font size.
pub(super) const LEADING: f64 = 1.25;

/// A run of characters in one font.
#[derive(Debug, Clone)]
struct Piece {
    text: String,
    font: Font,
    size: f64,
    /// The offset above the baseline (pt), negative below.
    rise: f64,
}

/// A word: pieces without a line break between them.
type Word = Vec<Piece>;

/// Sets a paragraph, over several pages if necessary.
pub(super) fn set(sheets: &mut Sheets, text: &[Span], style: Style) {
    set_hanging(sheets, text, style, 0.0);
}

/// Sets a paragraph whose first line begins `hanging` (pt) to the left.
pub(super) fn set_hanging(sheets: &mut Sheets, text: &[Span], style: Style, hanging: f64) {
    let lines = broken(words(text, style), style, hanging);
    let last = lines.len().saturating_sub(1);
    for (index, line) in lines.iter().enumerate() {
        sheets.need(style.size * LEADING);
        sheets.advance(style.size * LEADING);
        let y = sheets.y() + 0.28 * style.size;
        let hang = if index == 0 { hanging } else { 0.0 };
        let style = Style { left: style.left - hang, width: style.width + hang, ..style };
        let style =
            if index == last && style.align == Align::Both { Style { align: Align::Left, ..style } } else { style };
        draw(sheets, line, style, y);
    }
}

/// The number of lines of a paragraph.
pub(super) fn lines(text: &[Span], style: Style) -> usize {
    broken(words(text, style), style, 0.0).len()
}

/// Draws the lines of a table cell from `top` downwards.
pub(super) fn set_at(sheets: &mut Sheets, text: &[Span], style: Style, top: f64) {
    for (index, line) in broken(words(text, style), style, 0.0).iter().enumerate() {
        let y = top - style.size * LEADING * (index + 1) as f64 + 0.28 * style.size;
        draw(sheets, line, style, y);
    }
}

/// The width of a text on a single line (pt).
pub(super) fn natural(text: &[Span], style: Style) -> f64 {
    let words = words(text, style);
    words.iter().map(width).sum::<f64>() + blank(style) * words.len().saturating_sub(1) as f64
}

fn blank(style: Style) -> f64 {
    style.font.width(" ", style.size)
}

fn width(word: &Word) -> f64 {
    word.iter().map(|piece| piece.font.width(&piece.text, piece.size)).sum()
}

fn words(text: &[Span], style: Style) -> Vec<Word> {
    let mut words: Vec<Word> = vec![Vec::new()];
    for span in text {
        let plain = |font| Piece { text: String::new(), font, size: style.size, rise: 0.0 };
        let piece = match span {
            Span::Plain(_) | Span::Number(_) => plain(style.font),
            Span::Italic(_) => plain(Font::Italic),
            Span::Bold(_) | Span::Best(_) => plain(Font::Bold),
            Span::Code(_) => Piece { size: 0.84 * style.size, ..plain(Font::Mono) },
            Span::Sub(_) => Piece { size: 0.7 * style.size, rise: -0.16 * style.size, ..plain(style.font) },
            Span::Sup(_) => Piece { size: 0.7 * style.size, rise: 0.36 * style.size, ..plain(style.font) },
        };
        for (index, part) in span.plain().split([' ', '\n', '\t']).enumerate() {
            if index > 0 && words.last().is_some_and(|word| !word.is_empty()) {
                words.push(Vec::new());
            }
            if !part.is_empty() {
                let word = words.last_mut().expect("there is always a word");
                word.push(Piece { text: part.to_owned(), ..piece.clone() });
            }
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

fn broken(words: Vec<Word>, style: Style, hanging: f64) -> Vec<Vec<Word>> {
    let mut lines: Vec<Vec<Word>> = vec![Vec::new()];
    let (mut used, blank) = (-hanging, blank(style));
    for word in words.into_iter().flat_map(|word| fitting(word, style.width)) {
        let more = width(&word);
        let empty = lines.last().is_some_and(Vec::is_empty);
        let needed = if empty { more } else { blank + more };
        if !empty && used + needed > style.width + 1e-6 {
            lines.push(Vec::new());
            used = more;
        } else {
            used += needed;
        }
        lines.last_mut().expect("there is always a line").push(word);
    }
    lines
}

/// A word cut into parts of at most `max` (pt).
fn fitting(word: Word, max: f64) -> Vec<Word> {
    if width(&word) <= max {
        return vec![word];
    }
    let (mut parts, mut part, mut used): (Vec<Word>, Word, f64) = (Vec::new(), Vec::new(), 0.0);
    for piece in word {
        let mut text = String::new();
        for c in piece.text.chars() {
            let more = piece.font.width(c.encode_utf8(&mut [0; 4]), piece.size);
            if used + more > max && used > 0.0 {
                part.push(Piece { text: std::mem::take(&mut text), ..piece.clone() });
                parts.push(std::mem::take(&mut part));
                used = 0.0;
            }
            text.push(c);
            used += more;
        }
        part.push(Piece { text, ..piece });
    }
    parts.push(part);
    parts
}

fn draw(sheets: &mut Sheets, line: &[Word], style: Style, y: f64) {
    let words: f64 = line.iter().map(width).sum();
    let gaps = line.len().saturating_sub(1) as f64;
    let natural = words + gaps * blank(style);
    let (mut x, gap) = match style.align {
        Align::Left => (style.left, blank(style)),
        Align::Both if gaps > 0.0 => (style.left, (style.width - words) / gaps),
        Align::Both => (style.left, blank(style)),
        Align::Centre => (style.left + (style.width - natural) / 2.0, blank(style)),
        Align::Right => (style.left + style.width - natural, blank(style)),
    };
    for word in line {
        for piece in word {
            sheets.words(piece.font, piece.size, [x, y + piece.rise], &piece.text);
            x += piece.font.width(&piece.text, piece.size);
        }
        x += gap;
    }
}
