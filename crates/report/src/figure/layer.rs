//! The layers of a panel.

use crate::figure::{
    axis::Scale,
    drawing::{Anchor, Drawing, FONT, Ink, Shape, Stroke},
};

/// A layer of a panel: one kind of mark for many values.
#[derive(Debug, Clone)]
pub(crate) enum Layer {
    /// A line through points.
    Line { series: usize, points: Vec<[f64; 2]> },
    /// Marks at points.
    Marks { series: usize, points: Vec<[f64; 2]>, radius: f64 },
    /// Vertical error bars (x, low, high).
    Whiskers { series: usize, values: Vec<[f64; 3]> },
    /// Horizontal error bars (y, low, high).
    Spans { series: usize, values: Vec<[f64; 3]> },
    /// A filled band between two lines (x, low, high).
    Band { series: usize, values: Vec<[f64; 3]> },
    /// The two border lines of a band without filling (x, low, high).
    Edges { series: usize, values: Vec<[f64; 3]> },
    /// A shaded range of the ordinate over the full width, with a label.
    Range { from: f64, to: f64, note: String },
    /// A thin grey line with a label at its end.
    Guide { points: Vec<[f64; 2]>, note: String, dash: usize },
    /// Box plots: x and half width, then the 5, 25, 50, 75, 95 % quantiles.
    Boxes { series: usize, values: Vec<([f64; 2], [f64; 5])> },
    /// Columns of a histogram: left, right, height.
    Columns { series: usize, values: Vec<[f64; 3]> },
    /// Cells of a heat map at integer coordinates: x, y, value from 0 to 1, label.
    Heat { values: Vec<([f64; 3], String)> },
    /// A thin circle round a point.
    Ring { at: [f64; 2], radius: f64 },
    /// A lightly coloured polygon.
    Area { series: usize, points: Vec<[f64; 2]> },
    /// A thin line between areas.
    Rule { points: Vec<[f64; 2]>, dash: usize },
    /// Lines of text that begin, or `end`, at a point, below it or `up` above it.
    Words { at: [f64; 2], end: bool, up: bool, lines: Vec<String> },
}

/// The line height of text in a panel (pt).
const LEADING: f64 = 8.5;

/// The line style of a series.
pub(super) fn stroke(series: usize) -> Stroke {
    Stroke { ink: Ink::Series(series), width: 1.1, dash: series % 5 }
}

/// Minimum value of a heat map cell with white text; its luminance is below 0.21.
const DARK: f64 = 0.9;

impl Layer {
    /// Whether the layer has data; reference ranges do not count.
    pub(crate) fn draws(&self) -> bool {
        self.reach().next().is_some() && !matches!(self, Self::Range { .. })
    }

    /// Whether the layer is drawn below the grid. Columns are above it, because no grid crosses them.
    pub(super) fn below(&self) -> bool {
        matches!(self, Self::Range { .. } | Self::Band { .. } | Self::Area { .. })
    }

    /// The points that the axes must cover.
    pub(crate) fn reach(&self) -> Box<dyn Iterator<Item = [f64; 2]> + '_> {
        match self {
            Self::Line { points, .. } | Self::Marks { points, .. } => Box::new(points.iter().copied()),
            Self::Whiskers { values, .. } | Self::Band { values, .. } | Self::Edges { values, .. } => {
                Box::new(values.iter().flat_map(|[x, low, high]| [[*x, *low], [*x, *high]]))
            }
            Self::Spans { values, .. } => Box::new(values.iter().flat_map(|[y, low, high]| [[*low, *y], [*high, *y]])),
            Self::Range { from, to, .. } => Box::new([[f64::NAN, *from], [f64::NAN, *to]].into_iter()),
            Self::Boxes { values, .. } => {
                Box::new(values.iter().flat_map(|([x, half], q)| [[x - half, q[0]], [x + half, q[4]], [*x, q[2]]]))
            }
            Self::Columns { values, .. } => {
                Box::new(values.iter().flat_map(|[left, right, height]| [[*left, 0.0], [*right, *height]]))
            }
            Self::Heat { values } => Box::new(values.iter().map(|([x, y, _], _)| [*x, *y])),
            Self::Guide { .. } | Self::Ring { .. } | Self::Area { .. } | Self::Rule { .. } | Self::Words { .. } => {
                Box::new(std::iter::empty())
            }
        }
    }

    /// Draws the layer.
    pub(super) fn draw(&self, drawing: &mut Drawing, x: &Scale, y: &Scale) {
        let place = |[a, b]: [f64; 2]| [x.at(a), y.at(b)];
        match self {
            Self::Line { series, points } => drawing.line(points.iter().copied().map(place), stroke(*series)),
            Self::Marks { series, points, radius } => {
                points.iter().for_each(|&point| drawing.mark(*series, place(point), *radius));
            }
            Self::Whiskers { series, values } => {
                for &[at, low, high] in values {
                    drawing.line([place([at, low]), place([at, high])], bar(*series));
                }
            }
            Self::Spans { series, values } => {
                for &[at, low, high] in values {
                    drawing.line([place([low, at]), place([high, at])], bar(*series));
                }
            }
            Self::Band { series, values } => {
                let upper = values.iter().map(|&[at, _, high]| place([at, high]));
                let lower = values.iter().rev().map(|&[at, low, _]| place([at, low]));
                drawing.area(upper.chain(lower).collect(), Ink::Light(*series));
            }
            Self::Edges { series, values } => {
                for end in [1, 2] {
                    let edge = values.iter().map(|value| place([value[0], value[end]]));
                    drawing.line(edge, Stroke { width: 0.45, ..stroke(*series) });
                }
            }
            Self::Range { from, to, note } => {
                let ([left, right], [low, high]) = (x.interval(), [y.at(*from), y.at(*to)]);
                drawing.rectangle([left, high], [right - left, low - high], Some(Ink::Band), None);
                drawing.words([right - 3.0, high + 8.0], Anchor::End, Ink::Minor, note.clone());
            }
            Self::Guide { points, note, dash } => {
                let seen: Vec<_> = points.iter().filter(|p| y.holds(p[1]) && x.holds(p[0])).copied().collect();
                drawing.line(seen.iter().copied().map(place), Stroke { ink: Ink::Minor, width: 0.7, dash: *dash });
                // The label is placed before the end of the line, where the bars of the last point are.
                if let Some(&near) = seen.get((7 * seen.len() / 8).min(seen.len().saturating_sub(1))) {
                    let [a, b] = place(near);
                    drawing.words([a - 2.0, b - 3.0], Anchor::End, Ink::Minor, note.clone());
                }
            }
            Self::Boxes { series, values } => values.iter().for_each(|value| draw_box(drawing, x, y, *series, *value)),
            Self::Columns { series, values } => {
                for &[left, right, height] in values {
                    let ([a, b], [c, d]) = (place([left, height]), place([right, 0.0]));
                    let edge = Stroke::thin(Ink::Series(*series));
                    drawing.rectangle([a, b], [c - a, d - b], Some(Ink::Light(*series)), Some(edge));
                }
            }
            Self::Heat { values } => {
                for ([a, b, fraction], words) in values {
                    let ([left, top], [right, bottom]) = (place([a - 0.5, b + 0.5]), place([a + 0.5, b - 0.5]));
                    drawing.rectangle([left, top], [right - left, bottom - top], Some(Ink::Heat(*fraction)), None);
                    let ink = if *fraction > DARK { Ink::OnDark } else { Ink::OnPale };
                    let [u, v] = place([*a, *b]);
                    drawing.shapes.push(Shape::Words {
                        at: [u, v + 2.6],
                        text: words.clone(),
                        size: FONT,
                        anchor: Anchor::Middle,
                        turned: false,
                        ink,
                    });
                }
            }
            Self::Ring { at, radius } => {
                let edge = Stroke { ink: Ink::Text, width: 0.8, dash: 0 };
                let centre = place(*at);
                drawing.shapes.push(Shape::Circle { centre, radius: *radius, fill: None, stroke: Some(edge) });
            }
            Self::Area { series, points } => {
                drawing.area(points.iter().copied().map(place).collect(), Ink::Light(*series));
            }
            Self::Rule { points, dash } => {
                let stroke = Stroke { ink: Ink::Minor, width: 0.7, dash: *dash };
                drawing.line(points.iter().copied().map(place), stroke);
            }
            Self::Words { at, end, up, lines } => {
                let [a, b] = place(*at);
                let (a, anchor) = if *end { (a - 3.0, Anchor::End) } else { (a + 3.0, Anchor::Start) };
                let above = if *up { lines.len() as f64 * LEADING + 2.0 } else { 0.0 };
                for (line, text) in (1..).zip(lines) {
                    drawing.words([a, b - above + f64::from(line) * LEADING], anchor, Ink::Text, text.clone());
                }
            }
        }
    }
}

fn bar(series: usize) -> Stroke {
    Stroke { ink: Ink::Series(series), width: 0.8, dash: 0 }
}

fn draw_box(drawing: &mut Drawing, x: &Scale, y: &Scale, series: usize, ([at, half], q): ([f64; 2], [f64; 5])) {
    let edge = bar(series);
    let (left, right, middle) = (x.at(at - half), x.at(at + half), x.at(at));
    let [p5, p25, p50, p75, p95] = q.map(|value| y.at(value));
    drawing.line([[middle, p5], [middle, p25]], edge);
    drawing.line([[middle, p75], [middle, p95]], edge);
    drawing.rectangle([left, p75], [right - left, p25 - p75], Some(Ink::Light(series)), Some(edge));
    drawing.line([[left, p50], [right, p50]], Stroke { width: 1.5, ..edge });
}
