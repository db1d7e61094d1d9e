//! Charts: panels with axes and layers, and a legend.

use crate::{
    figure::{
        axis::{Axis, Scale},
        drawing::{Anchor, Drawing, FONT, Ink, Stroke},
        layer::{self, Layer},
    },
    fonts::width_of,
};

/// The width of a column and of a page of a journal (pt): 85 mm and 170 mm.
const COLUMN: f64 = 85.0 * 72.0 / 25.4;
const PAGE: f64 = 170.0 * 72.0 / 25.4;

/// The approximate room left of a plot area (pt).
const ROOM: f64 = 46.0;
/// The line height of wrapped names, in units of the font size.
const LEADING: f64 = 1.1;

/// A chart: rows of panels with a legend below.
#[derive(Debug, Default)]
pub(crate) struct Chart {
    pub(crate) panels: Vec<Panel>,
    /// The number of panels in a row.
    pub(crate) columns: usize,
    /// Whether the chart is as wide as a page instead of a column.
    pub(crate) page: bool,
    /// The ratio of height to width of a panel; 0 means 0.72.
    pub(crate) shape: f64,
    /// The entries of the legend.
    pub(crate) legend: Vec<Entry>,
}

/// An entry of the legend.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) name: String,
    /// The index of the series.
    pub(crate) series: usize,
    pub(crate) line: bool,
    pub(crate) mark: bool,
}

/// A panel: a pair of axes with layers.
#[derive(Debug, Default)]
pub(crate) struct Panel {
    /// The condition of the panel.
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) layers: Vec<Layer>,
    /// Whether both axes have the same scale.
    pub(crate) equal: bool,
}

impl Chart {
    /// The drawing; `None` without any data.
    pub(crate) fn draw(&self) -> Option<Drawing> {
        let any = self.panels.iter().flat_map(|panel| &panel.layers).any(Layer::draws);
        if !any {
            return None;
        }
        let mut drawing = self.on(if self.page { PAGE } else { COLUMN }, self.columns);
        drawing.narrow = self.page.then(|| Box::new(self.on(COLUMN, 1)));
        Some(drawing)
    }

    /// The drawing on a sheet of this width (pt), with `columns` panels in a row.
    fn on(&self, width: f64, columns: usize) -> Drawing {
        let columns = columns.clamp(1, self.panels.len().max(1));
        let cell = width / columns as f64;
        let shape = if self.shape > 0.0 { self.shape } else { 0.72 };
        let titled = self.panels.iter().any(|panel| !panel.title.is_empty());
        let mut height = cell * shape + if titled { FONT * 1.7 } else { 0.0 };
        if self.page && width < PAGE {
            // Narrow panels are as tall as wide ones, with at least two lines for every name of the vertical axis.
            let lines = self.panels.iter().map(|panel| panel.y.names.len()).max().unwrap_or(0);
            height = height.max(cell * 0.6).max(lines as f64 * FONT * 2.7 + FONT * 4.0);
        }
        // Names of the horizontal axis with more than two lines enlarge the drawing instead of shrinking the plot area.
        let lines = self.panels.iter().filter(|panel| !panel.x.names.is_empty());
        let lines = lines.map(|panel| panel.below(panel.x.ends([].into_iter()), cell - ROOM).lines());
        height += FONT * (lines.fold(2.0, f64::max) - 2.0);
        let mut drawing = Drawing::default();
        for (index, panel) in self.panels.iter().enumerate() {
            let (column, row) = (index % columns, index / columns);
            panel.draw(&mut drawing, [column as f64 * cell, row as f64 * height], [cell, height], titled);
        }
        let below = self.panels.len().div_ceil(columns) as f64 * height;
        drawing.size = [width, self.legend(&mut drawing, width, below)];
        drawing
    }

    /// Draws the legend in as many columns as fit, and gives the lower end of the drawing.
    fn legend(&self, drawing: &mut Drawing, width: f64, top: f64) -> f64 {
        if self.legend.is_empty() {
            return top;
        }
        let widest = self.legend.iter().map(|entry| width_of(&entry.name, FONT)).fold(0.0, f64::max);
        let columns = ((width - 8.0) / (widest + 34.0)).floor().clamp(1.0, self.legend.len() as f64) as usize;
        let rows = self.legend.len().div_ceil(columns);
        let step = (width - 8.0) / columns as f64;
        for (index, entry) in self.legend.iter().enumerate() {
            let (row, column) = (index % rows, index / rows);
            let x = 8.0 + column as f64 * step;
            let y = top + 9.0 + row as f64 * 11.0;
            if entry.line {
                drawing.line([[x, y], [x + 20.0, y]], layer::stroke(entry.series));
            }
            if entry.mark {
                drawing.mark(entry.series, [x + 10.0, y], 2.2);
            }
            drawing.words([x + 25.0, y + 2.6], Anchor::Start, Ink::Text, entry.name.clone());
        }
        top + 9.0 + rows as f64 * 11.0
    }
}

impl Entry {
    pub(crate) fn both(name: impl Into<String>, series: usize) -> Self {
        Self { name: name.into(), series, line: true, mark: true }
    }

    pub(crate) fn line(name: impl Into<String>, series: usize) -> Self {
        Self { mark: false, ..Self::both(name, series) }
    }

    pub(crate) fn mark(name: impl Into<String>, series: usize) -> Self {
        Self { line: false, ..Self::both(name, series) }
    }
}

impl Panel {
    fn draw(&self, drawing: &mut Drawing, [x, y]: [f64; 2], [width, height]: [f64; 2], titled: bool) {
        let values = |which: usize| self.layers.iter().flat_map(move |layer| layer.reach()).map(move |p| p[which]);
        let (mut x_ends, mut y_ends) = (self.x.ends(values(0)), self.y.ends(values(1)));
        let top = y + if titled { FONT * 1.7 } else { 4.0 };
        // The room left of the plot area fits the longest name of the vertical axis.
        let probe = Scale::new(self.y.clone(), y_ends, [0.0, height]);
        let label = probe.ticks().iter().map(|&tick| width_of(&probe.label(tick), FONT)).fold(0.0, f64::max);
        // Names that would take most of the width are placed above their ticks.
        let room = height / self.y.names.len().max(1) as f64 > 2.2 * FONT;
        let above = !self.y.names.is_empty() && label > 0.4 * width && room;
        let left = x + if above { 0.0 } else { label } + 7.0 + if self.y.label.is_empty() { 2.0 } else { FONT * 1.6 };
        let mut right = x + width - 7.0;
        // Half of the last label of the horizontal axis extends beyond the plot area.
        let across = Scale::new(self.x.clone(), x_ends, [left, right]);
        let ends = across.ticks().into_iter().map(|tick| across.at(tick) + width_of(&across.label(tick), FONT) / 2.0);
        let beyond = if self.x.names.is_empty() { ends.fold(right, f64::max) - (x + width - 1.0) } else { 0.0 };
        right -= beyond.max(0.0);
        let below = self.below(x_ends, right - left);
        let bottom =
            y + height - 6.0 - FONT * (below.lines() + 0.4) - if self.x.label.is_empty() { 0.0 } else { FONT * 1.4 };
        if self.equal {
            equalise(&mut x_ends, &mut y_ends, (right - left) / (bottom - top));
        }
        let scale_x = Scale::new(self.x.clone(), x_ends, [left, right]);
        let scale_y = Scale::new(self.y.clone(), y_ends, [bottom, top]);

        for layer in self.layers.iter().filter(|layer| layer.below()) {
            layer.draw(drawing, &scale_x, &scale_y);
        }
        for tick in scale_y.ticks() {
            let at = scale_y.at(tick);
            drawing.line([[left, at], [right, at]], Stroke::thin(Ink::Grid));
            let (place, anchor) = if above {
                ([left + 2.0, at - 0.9 * FONT], Anchor::Start)
            } else {
                ([left - 4.0, at + 2.6], Anchor::End)
            };
            drawing.words(place, anchor, Ink::Text, scale_y.label(tick));
        }
        for (index, tick) in scale_x.ticks().into_iter().enumerate() {
            let at = scale_x.at(tick);
            drawing.line([[at, bottom], [at, top]], Stroke::thin(Ink::Grid));
            match &below {
                Below::Levels(levels) => {
                    let level = (index % levels) as f64;
                    drawing.words([at, bottom + FONT * (1.3 + level)], Anchor::Middle, Ink::Text, scale_x.label(tick));
                }
                Below::Wrapped(names) => {
                    for (line, words) in names.get(index).into_iter().flatten().enumerate() {
                        let place = [at, bottom + FONT * (1.3 + LEADING * line as f64)];
                        drawing.words(place, Anchor::Middle, Ink::Text, words.clone());
                    }
                }
                Below::Upright(length) => {
                    let place = [at + 0.35 * FONT, bottom + FONT * 0.6 + length / 2.0];
                    drawing.turned(place, Ink::Text, scale_x.label(tick));
                }
            }
        }
        for layer in self.layers.iter().filter(|layer| !layer.below()) {
            layer.draw(drawing, &scale_x, &scale_y);
        }
        drawing.line([[left, top], [left, bottom], [right, bottom]], Stroke { ink: Ink::Text, width: 0.7, dash: 0 });
        let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
        drawing.words([middle[0], y + height - 5.0], Anchor::Middle, Ink::Text, self.x.label.clone());
        drawing.turned([x + FONT, middle[1]], Ink::Text, self.y.label.clone());
        drawing.words([left, y + FONT * 1.1], Anchor::Start, Ink::Text, self.title.clone());
    }

    /// The arrangement of the labels of the horizontal axis without overlaps.
    ///
    /// Names are wrapped, or turned upright if a word is too long; numbers are staggered in levels.
    fn below(&self, ends: [f64; 2], width: f64) -> Below {
        const MAX: usize = 6;
        let scale = Scale::new(self.x.clone(), ends, [0.0, width]);
        let ticks = scale.ticks();
        if !self.x.names.is_empty() {
            let room = width / (ends[1] - ends[0]) - 4.0;
            let names: Vec<Vec<String>> = self.x.names.iter().map(|name| wrapped(name, room)).collect();
            let fits = names.iter().flatten().all(|line| width_of(line, FONT) <= room);
            let longest = self.x.names.iter().map(|name| width_of(name, FONT)).fold(0.0, f64::max);
            return if fits { Below::Wrapped(names) } else { Below::Upright(longest) };
        }
        let half = |tick: f64| width_of(&scale.label(tick), FONT) / 2.0;
        let apart = |a: f64, b: f64| scale.at(b) - scale.at(a) >= half(a) + half(b) + 3.0;
        let free = |levels: usize| ticks.iter().zip(ticks.iter().skip(levels)).all(|(&a, &b)| apart(a, b));
        Below::Levels((1..MAX).find(|&levels| free(levels)).unwrap_or(MAX))
    }
}

/// The arrangement of labels below an axis.
enum Below {
    /// Numbers, staggered in this many levels.
    Levels(usize),
    /// Names, each wrapped into lines.
    Wrapped(Vec<Vec<String>>),
    /// Names turned by 90°, with the length of the longest (pt).
    Upright(f64),
}

impl Below {
    /// The height in lines of the font size.
    fn lines(&self) -> f64 {
        match self {
            Self::Levels(levels) => *levels as f64,
            Self::Wrapped(names) => {
                let max = names.iter().map(Vec::len).max().unwrap_or(1).max(1);
                1.0 + LEADING * (max - 1) as f64
            }
            Self::Upright(length) => length / FONT + 0.2,
        }
    }
}

/// A name wrapped into lines of at most `room` (pt); a single longer word exceeds it.
fn wrapped(name: &str, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in name.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width_of(&format!("{line} {word}"), FONT) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Widens one of both ranges so that both axes have the same scale.
fn equalise(x: &mut [f64; 2], y: &mut [f64; 2], aspect: f64) {
    let extend = |ends: &mut [f64; 2], to: f64| {
        let more = (to - (ends[1] - ends[0])).max(0.0) / 2.0;
        *ends = [ends[0] - more, ends[1] + more];
    };
    let (width, height) = (x[1] - x[0], y[1] - y[0]);
    extend(x, height * aspect);
    extend(y, width / aspect);
}
