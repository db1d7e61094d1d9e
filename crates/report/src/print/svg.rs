//! Drawings as SVG: inside a page, coloured by its style, and as standalone files.

use std::fmt::Write;

use crate::figure::{Anchor, DASHES, Drawing, Ink, Shape, Stroke};

/// The colouring of a drawing: literal colours, or classes coloured by the style of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Colours {
    Fixed,
    Classes,
}

/// A standalone SVG file, with its size in millimetres.
pub(crate) fn standalone(drawing: &Drawing) -> String {
    let [width, height] = drawing.size.map(|points| points * 25.4 / 72.0);
    let size = format!("width=\"{}mm\" height=\"{}mm\"", c(width), c(height));
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", svg(drawing, &size, Colours::Fixed))
}

/// An inline SVG element of a page.
pub(super) fn inline(drawing: &Drawing, class: &str) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    svg(drawing, &format!("role=\"img\"{class}"), Colours::Classes)
}

fn svg(drawing: &Drawing, attributes: &str, colours: Colours) -> String {
    let [width, height] = drawing.size.map(c);
    let family = match colours {
        Colours::Fixed => " font-family=\"Liberation Sans, Arimo, Helvetica, Arial, sans-serif\"",
        Colours::Classes => "",
    };
    let mut out =
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" {attributes}{family}>");
    for shape in &drawing.shapes {
        draw(&mut out, shape, colours);
    }
    out + "</svg>"
}

/// A coordinate with two decimals and no trailing zeros, the same on every machine.
fn c(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn draw(out: &mut String, shape: &Shape, colours: Colours) {
    // Writing to a string does not fail.
    let _ = match shape {
        Shape::Path { points, closed, fill, stroke } => {
            let mut path = String::new();
            for (index, [x, y]) in points.iter().enumerate() {
                path.push(if index == 0 { 'M' } else { 'L' });
                path += &format!("{} {}", c(*x), c(*y));
            }
            if *closed {
                path.push('Z');
            }
            write!(out, "<path d=\"{path}\"{}/>", paint(*fill, *stroke, colours))
        }
        Shape::Circle { centre: [x, y], radius, fill, stroke } => {
            let paint = paint(*fill, *stroke, colours);
            write!(out, "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{paint}/>", c(*x), c(*y), c(*radius))
        }
        Shape::Words { text, .. } if text.is_empty() => Ok(()),
        Shape::Words { at: [x, y], text, size, anchor, turned, ink } => {
            let place = if *turned {
                format!("transform=\"translate({} {}) rotate(-90)\"", c(*x), c(*y))
            } else {
                format!("x=\"{}\" y=\"{}\"", c(*x), c(*y))
            };
            let anchor = match anchor {
                Anchor::Start => "",
                Anchor::Middle => " text-anchor=\"middle\"",
                Anchor::End => " text-anchor=\"end\"",
            };
            let paint = paint(Some(*ink), None, colours);
            write!(out, "<text {place} font-size=\"{}\"{anchor}{paint}>{}</text>", c(*size), escape(text))
        }
    };
}

fn paint(fill: Option<Ink>, stroke: Option<Stroke>, colours: Colours) -> String {
    let mut attributes = String::new();
    let mut classes = Vec::new();
    match (fill, fill.and_then(|ink| class(ink, "f")).filter(|_| colours == Colours::Classes)) {
        (_, Some(class)) => classes.push(class),
        (Some(ink), None) => attributes += &format!(" fill=\"{}\"", hex(ink)),
        (None, None) => attributes += " fill=\"none\"",
    }
    if let Some(stroke) = stroke {
        match class(stroke.ink, "s").filter(|_| colours == Colours::Classes) {
            Some(class) => classes.push(class),
            None => attributes += &format!(" stroke=\"{}\"", hex(stroke.ink)),
        }
        attributes += &format!(" stroke-width=\"{}\"", c(stroke.width));
        let dash = DASHES[stroke.dash % DASHES.len()];
        if !dash.is_empty() {
            let dash: Vec<String> = dash.iter().map(|length| c(*length)).collect();
            attributes += &format!(" stroke-dasharray=\"{}\"", dash.join(" "));
        }
    }
    if !classes.is_empty() {
        attributes += &format!(" class=\"{}\"", classes.join(" "));
    }
    attributes
}

/// The class of an ink whose colour differs between light and dark pages.
fn class(ink: Ink, of: &str) -> Option<String> {
    Some(match ink {
        Ink::Text => format!("{of}t"),
        Ink::Minor => format!("{of}m"),
        Ink::Grid => format!("{of}g"),
        Ink::Band => format!("{of}b"),
        Ink::Paper => format!("{of}p"),
        Ink::Series(index) => format!("{of}{}", index % 7),
        Ink::Light(index) => format!("{of}l{}", index % 7),
        Ink::Heat(_) | Ink::OnPale | Ink::OnDark => return None,
    })
}

fn hex(ink: Ink) -> String {
    let [r, g, b] = ink.on_white();
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The style of the classes for light and dark pages.
pub(super) fn style() -> String {
    let rules = |dark: bool| {
        let mut inks = vec![Ink::Text, Ink::Minor, Ink::Grid, Ink::Band, Ink::Paper];
        inks.extend((0..7).flat_map(|index| [Ink::Series(index), Ink::Light(index)]));
        let mut style = String::new();
        for ink in inks {
            let [r, g, b] = if dark { on_black(ink) } else { ink.on_white() };
            for (of, property) in [("f", "fill"), ("s", "stroke")] {
                let class = class(ink, of).unwrap_or_default();
                let _ = write!(style, "svg .{class}{{{property}:#{r:02x}{g:02x}{b:02x}}}");
            }
        }
        style
    };
    format!("{}@media screen and (prefers-color-scheme: dark){{{}}}", rules(false), rules(true))
}

/// The colour on a dark page, lighter for equal contrast.
fn on_black(ink: Ink) -> [u8; 3] {
    use crate::figure::{PALETTE, mix};
    let sheet = [21, 23, 26];
    match ink {
        Ink::Text => [222, 222, 222],
        Ink::Minor => [160, 160, 160],
        Ink::Grid => [55, 58, 62],
        Ink::Band => [52, 48, 38],
        Ink::Series(index) => {
            mix(PALETTE[index % PALETTE.len()], [255; 3], if index % 7 == 0 || index % 7 == 6 { 0.35 } else { 0.12 })
        }
        Ink::Light(index) => mix(sheet, PALETTE[index % PALETTE.len()], 0.4),
        _ => sheet,
    }
}

/// A text escaped for elements and attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}
