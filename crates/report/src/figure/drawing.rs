//! Drawings: the shapes that every printer of figures supports.

/// A drawing in points (1/72 inch), with y downwards.
#[derive(Debug, Default)]
pub(crate) struct Drawing {
    pub(crate) size: [f64; 2],
    pub(crate) shapes: Vec<Shape>,
    /// A variant of half the width with panels below each other, for drawings as wide as a page.
    pub(crate) narrow: Option<Box<Drawing>>,
}

/// A shape of a drawing.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    /// A polyline, or an area if it is closed and filled.
    Path {
        points: Vec<[f64; 2]>,
        closed: bool,
        fill: Option<Ink>,
        stroke: Option<Stroke>,
    },
    Circle {
        centre: [f64; 2],
        radius: f64,
        fill: Option<Ink>,
        stroke: Option<Stroke>,
    },
    /// A text with its anchor `at` on the baseline.
    Words {
        at: [f64; 2],
        text: String,
        size: f64,
        anchor: Anchor,
        turned: bool,
        ink: Ink,
    },
}

/// The colour of a shape, by its role.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ink {
    /// The colour of text and axes: black on a light page, white on a dark one.
    Text,
    /// The colour of less important text.
    Minor,
    Grid,
    /// The colour of a shaded reference range.
    Band,
    /// The colour of a series, from a palette safe for colour-blind readers.
    Series(usize),
    /// The colour of a light area of a series.
    Light(usize),
    /// The colour of a cell of a heat map, from 0 (pale) to 1 (dark).
    Heat(f64),
    /// The colour of the sheet.
    Paper,
    /// The colour of text on a pale cell of a heat map.
    OnPale,
    /// The colour of text on a dark cell of a heat map.
    OnDark,
}

/// The style of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stroke {
    pub(crate) ink: Ink,
    pub(crate) width: f64,
    /// The index into [`DASHES`].
    pub(crate) dash: usize,
}

/// The alignment of a text relative to its anchor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// The dash patterns of lines (pt), which are distinguishable in print without colour.
pub(crate) const DASHES: [&[f64]; 5] = [&[], &[5.0, 2.5], &[1.2, 1.8], &[6.0, 2.0, 1.2, 2.0], &[3.0, 1.5]];

/// The palette of Okabe and Ito (2008), safe for colour-blind readers, ordered so that neighbours differ in lightness.
pub(crate) const PALETTE: [[u8; 3]; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 180, 233], [230, 159, 0], [90, 90, 90]];

impl Ink {
    /// The RGB colour on white paper, 0 to 255.
    pub(crate) fn on_white(self) -> [u8; 3] {
        match self {
            Self::Text => [34, 34, 34],
            Self::Minor => [110, 110, 110],
            Self::Grid => [222, 222, 222],
            Self::Band => [236, 231, 217],
            Self::Series(index) => PALETTE[index % PALETTE.len()],
            Self::Light(index) => mix([255; 3], PALETTE[index % PALETTE.len()], 0.22),
            Self::Heat(fraction) => mix([246, 246, 240], PALETTE[0], fraction.clamp(0.0, 1.0)),
            Self::Paper | Self::OnDark => [255; 3],
            Self::OnPale => [34, 34, 34],
        }
    }
}

pub(crate) fn mix(from: [u8; 3], to: [u8; 3], fraction: f64) -> [u8; 3] {
    std::array::from_fn(|i| (f64::from(from[i]) * (1.0 - fraction) + f64::from(to[i]) * fraction).round() as u8)
}

impl Stroke {
    pub(crate) fn thin(ink: Ink) -> Self {
        Self { ink, width: 0.5, dash: 0 }
    }
}

impl Drawing {
    pub(crate) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, stroke: Stroke) {
        let points: Vec<_> = points.into_iter().collect();
        self.shapes.push(Shape::Path { points, closed: false, fill: None, stroke: Some(stroke) });
    }

    pub(crate) fn area(&mut self, points: Vec<[f64; 2]>, fill: Ink) {
        self.shapes.push(Shape::Path { points, closed: true, fill: Some(fill), stroke: None });
    }

    pub(crate) fn rectangle(&mut self, [x, y]: [f64; 2], [w, h]: [f64; 2], fill: Option<Ink>, stroke: Option<Stroke>) {
        let points = vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
        self.shapes.push(Shape::Path { points, closed: true, fill, stroke });
    }

    pub(crate) fn words(&mut self, at: [f64; 2], anchor: Anchor, ink: Ink, text: impl Into<String>) {
        self.shapes.push(Shape::Words { at, text: text.into(), size: FONT, anchor, turned: false, ink });
    }

    pub(crate) fn turned(&mut self, at: [f64; 2], ink: Ink, text: impl Into<String>) {
        let text = text.into();
        self.shapes.push(Shape::Words { at, text, size: FONT, anchor: Anchor::Middle, turned: true, ink });
    }

    /// Draws the mark of a series: circle, square, triangle, diamond, then the same shapes hollow.
    pub(crate) fn mark(&mut self, index: usize, [x, y]: [f64; 2], radius: f64) {
        let ink = Ink::Series(index);
        let hollow = index % 8 >= 4;
        let fill = Some(if hollow { Ink::Paper } else { ink });
        let stroke = hollow.then_some(Stroke { ink, width: 0.9, dash: 0 });
        let r = radius;
        let points = match index % 4 {
            0 => {
                self.shapes.push(Shape::Circle { centre: [x, y], radius, fill, stroke });
                return;
            }
            1 => vec![[x - r, y - r], [x + r, y - r], [x + r, y + r], [x - r, y + r]],
            2 => vec![[x, y - 1.3 * r], [x + 1.2 * r, y + 0.9 * r], [x - 1.2 * r, y + 0.9 * r]],
            _ => vec![[x, y - 1.4 * r], [x + 1.4 * r, y], [x, y + 1.4 * r], [x - 1.4 * r, y]],
        };
        self.shapes.push(Shape::Path { points, closed: true, fill, stroke });
    }
}

/// The font size in figures (pt).
pub(crate) const FONT: f64 = 7.5;
