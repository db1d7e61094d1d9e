//! Pages, filled from the top downwards.

use std::collections::{BTreeMap, BTreeSet};

use pdf_writer::{Content, Name, Str};

use crate::{
    figure::{Anchor, DASHES, Drawing, Ink, Shape, Stroke},
    fonts::Font,
    print::unicode::harmless,
};

/// The size of A4 (pt).
pub(super) const PAGE: [f64; 2] = [595.28, 841.89];
pub(super) const LEFT: f64 = (PAGE[0] - WIDTH) / 2.0;
pub(super) const WIDTH: f64 = 481.89;
const TOP: f64 = PAGE[1] - 56.0;
pub(super) const BOTTOM: f64 = 56.0;

/// The pages so far; the last one is being filled.
pub(super) struct Sheets {
    size: [f64; 2],
    pub(super) pages: Vec<Content>,
    /// The used glyphs of each font with their characters.
    pub(super) glyphs: BTreeMap<Font, BTreeMap<u16, char>>,
    /// The JPEG files with their sizes (px).
    pub(super) pictures: Vec<(Vec<u8>, [u32; 2])>,
    /// The indices of the pictures on each page.
    pub(super) shown: Vec<BTreeSet<usize>>,
    y: f64,
}

impl Sheets {
    pub(super) fn new() -> Self {
        Self { y: TOP, ..Self::of(PAGE) }
    }

    /// A single empty page of this size (pt).
    pub(super) fn of(size: [f64; 2]) -> Self {
        Self {
            size,
            pages: vec![Content::new()],
            glyphs: BTreeMap::new(),
            pictures: Vec::new(),
            shown: vec![BTreeSet::new()],
            y: size[1],
        }
    }

    /// The lower end of the content of the page (pt from the bottom).
    pub(super) fn y(&self) -> f64 {
        self.y
    }

    /// Adds vertical space, except at the top of a page.
    pub(super) fn space(&mut self, height: f64) {
        if self.y < TOP {
            self.y -= height;
        }
    }

    /// Advances by the height of a line.
    pub(super) fn advance(&mut self, height: f64) {
        self.y -= height;
    }

    /// Begins a new page if `height` does not fit on this one.
    ///
    /// An empty page is kept. The result is whether a new page was begun.
    pub(super) fn need(&mut self, height: f64) -> bool {
        let turns = self.y - height < BOTTOM && self.y < TOP;
        if turns {
            self.pages.push(Content::new());
            self.shown.push(BTreeSet::new());
            self.y = TOP;
        }
        turns
    }

    /// Begins a new page, unless this one is empty.
    pub(super) fn next(&mut self) {
        self.need(f64::INFINITY);
    }

    fn page(&mut self) -> &mut Content {
        self.pages.last_mut().expect("there is always a page")
    }

    /// Draws a text with its baseline at a position of the page.
    pub(super) fn words(&mut self, font: Font, size: f64, [x, y]: [f64; 2], text: &str) {
        self.write(font, size, [1.0, 0.0, 0.0, 1.0, x, y], Ink::Text, text);
    }

    fn write(&mut self, font: Font, size: f64, matrix: [f64; 6], ink: Ink, text: &str) {
        let text = harmless(text);
        if text.trim().is_empty() {
            return;
        }
        let loaded = font.loaded();
        let used = self.glyphs.entry(font).or_default();
        let mut bytes = Vec::new();
        for c in text.chars() {
            let glyph = loaded.glyph(c);
            used.entry(glyph).or_insert(c);
            bytes.extend(glyph.to_be_bytes());
        }
        let page = self.page();
        let [r, g, b] = colour(ink);
        page.set_fill_rgb(r, g, b).begin_text();
        page.set_font(Name(format!("F{}", font as usize).as_bytes()), size as f32);
        page.set_text_matrix(matrix.map(rounded)).show(Str(&bytes)).end_text();
    }

    /// Draws a horizontal rule.
    pub(super) fn rule(&mut self, [from, to]: [f64; 2], y: f64, width: f64) {
        let page = self.page();
        page.set_stroke_rgb(0.0, 0.0, 0.0).set_line_width(width as f32).set_dash_pattern([], 0.0);
        page.move_to(rounded(from), rounded(y)).line_to(rounded(to), rounded(y)).stroke();
    }

    /// Draws a drawing below the content, with its left edge at `left`.
    pub(super) fn draw(&mut self, drawing: &Drawing, left: f64) {
        let top = self.y;
        for shape in &drawing.shapes {
            self.shape(shape, left, top);
        }
        self.y -= drawing.size[1];
    }

    fn shape(&mut self, shape: &Shape, left: f64, top: f64) {
        let at = |[x, y]: [f64; 2]| [left + x, top - y];
        match shape {
            Shape::Path { points, closed, fill, stroke } => {
                let page = self.page();
                for (index, point) in points.iter().enumerate() {
                    let [x, y] = at(*point).map(rounded);
                    if index == 0 {
                        page.move_to(x, y)
                    } else {
                        page.line_to(x, y)
                    };
                }
                if *closed {
                    page.close_path();
                }
                paint(page, *fill, *stroke);
            }
            Shape::Circle { centre, radius, fill, stroke } => {
                let ([x, y], r) = (at(*centre), *radius);
                // Four Bézier arcs approximate a circle to 0.03 % with this constant.
                let k = 0.552_284_75 * r;
                let p = |a: f64, b: f64| [rounded(x + a), rounded(y + b)];
                let page = self.page();
                let [sx, sy] = p(r, 0.0);
                page.move_to(sx, sy);
                for [a, b, c] in [
                    [[r, k], [k, r], [0.0, r]],
                    [[-k, r], [-r, k], [-r, 0.0]],
                    [[-r, -k], [-k, -r], [0.0, -r]],
                    [[k, -r], [r, -k], [r, 0.0]],
                ] {
                    let ([ax, ay], [bx, by], [cx, cy]) = (p(a[0], a[1]), p(b[0], b[1]), p(c[0], c[1]));
                    page.cubic_to(ax, ay, bx, by, cx, cy);
                }
                page.close_path();
                paint(page, *fill, *stroke);
            }
            Shape::Words { at: place, text, size, anchor, turned, ink } => {
                let width = Font::Sans.width(text, *size);
                let back = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => width / 2.0,
                    Anchor::End => width,
                };
                let [x, y] = at(*place);
                let matrix =
                    if *turned { [0.0, 1.0, -1.0, 0.0, x, y - back] } else { [1.0, 0.0, 0.0, 1.0, x - back, y] };
                self.write(Font::Sans, *size, matrix, *ink, text);
            }
        }
    }

    /// Draws a JPEG with its left edge, width and height (pt).
    pub(super) fn picture(&mut self, jpeg: &[u8], size: [u32; 2], [left, width, height]: [f64; 3]) {
        self.pictures.push((jpeg.to_vec(), size));
        let index = self.pictures.len() - 1;
        self.shown.last_mut().expect("there is always a page").insert(index);
        self.y -= height;
        let y = self.y;
        let page = self.page();
        page.save_state().transform([width, 0.0, 0.0, height, left, y].map(rounded));
        page.x_object(Name(format!("P{index}").as_bytes())).restore_state();
    }

    /// Draws the page numbers.
    pub(super) fn number(&mut self) {
        let pages = std::mem::take(&mut self.pages);
        for (index, page) in pages.into_iter().enumerate() {
            self.pages.push(page);
            let text = (index + 1).to_string();
            let x = (self.size[0] - Font::Regular.width(&text, 9.0)) / 2.0;
            self.words(Font::Regular, 9.0, [x, BOTTOM - 26.0], &text);
        }
    }
}

fn paint(page: &mut Content, fill: Option<Ink>, stroke: Option<Stroke>) {
    if let Some(ink) = fill {
        let [r, g, b] = colour(ink);
        page.set_fill_rgb(r, g, b);
    }
    if let Some(stroke) = stroke {
        let [r, g, b] = colour(stroke.ink);
        let dash = DASHES[stroke.dash % DASHES.len()].iter().map(|length| *length as f32);
        page.set_stroke_rgb(r, g, b).set_line_width(stroke.width as f32).set_dash_pattern(dash, 0.0);
    }
    match (fill, stroke) {
        (Some(_), Some(_)) => page.fill_nonzero_and_stroke(),
        (Some(_), None) => page.fill_nonzero(),
        (None, Some(_)) => page.stroke(),
        (None, None) => page.end_path(),
    };
}

fn colour(ink: Ink) -> [f32; 3] {
    ink.on_white().map(|part| (f64::from(part) / 255.0 * 1000.0).round() as f32 / 1000.0)
}

/// A length rounded to hundredths of a point, for small files that are equal on every machine.
fn rounded(value: f64) -> f32 {
    ((value * 100.0).round() / 100.0) as f32
}
