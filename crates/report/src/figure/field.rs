//! Many small plots that share both axes, each logarithmic: a whole field at a glance.

use maud::{Markup, html};

use super::{
    PALETTE,
    plot::{c, mark, tick_text},
};

/// Small plots side by side and below each other.
pub(crate) struct Field {
    /// Name and unit of the abscissa.
    pub(crate) x_label: String,
    /// Name and unit of the ordinate.
    pub(crate) y_label: String,
    /// Places of the ticks on the abscissa.
    pub(crate) x_ticks: Vec<f64>,
    /// What each series is called; the last is a limit, drawn as a black line without marks.
    pub(crate) names: Vec<String>,
    /// How many plots a row has.
    pub(crate) columns: usize,
    /// The plots.
    pub(crate) cells: Vec<Cell>,
}

/// One of the plots.
pub(crate) struct Cell {
    /// Its conditions, a line each.
    pub(crate) title: [String; 2],
    /// The values (x, y) of each series, in the order of the names.
    pub(crate) series: Vec<Vec<[f64; 2]>>,
}

const SIDE: [f64; 2] = [136.0, 118.0];
const MARGIN: [f64; 2] = [46.0, 34.0];
const TITLE: f64 = 30.0;

/// From quantities to places in a plot.
struct Scale {
    x: [f64; 2],
    y: [f64; 2],
}

impl Scale {
    fn x(&self, x: f64) -> f64 {
        (x.log10() - self.x[0]) / (self.x[1] - self.x[0]) * (SIDE[0] - 10.0)
    }

    fn y(&self, y: f64) -> f64 {
        TITLE + (self.y[1] - y.log10()) / (self.y[1] - self.y[0]) * (SIDE[1] - TITLE - 4.0)
    }

    fn decades(&self) -> impl Iterator<Item = f64> {
        let [low, high] = self.y;
        (low.ceil() as i32..=high.floor() as i32).map(|decade| 10f64.powi(decade))
    }
}

/// Draws `field`; `None` where there is nothing positive to draw.
pub(crate) fn field(field: &Field) -> Option<Markup> {
    let values =
        || field.cells.iter().flat_map(|cell| cell.series.iter().flatten()).filter(|[x, y]| *x > 0.0 && *y > 0.0);
    values().next()?;
    let range = |of: usize, margin: f64| {
        let logs = values().map(|value| value[of].log10());
        let [low, high] = logs.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        [low - margin, high + margin]
    };
    let scale = Scale { x: range(0, 0.08), y: range(1, 0.1) };
    let rows = field.cells.len().div_ceil(field.columns);
    let width = MARGIN[0] + SIDE[0] * field.columns as f64;
    let below = SIDE[1] * rows as f64;
    let last = field.names.len() - 1;
    Some(html! {
        svg class="plot" xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (c(width)) " " (c(below + MARGIN[1] + 26.0)) } role="img" {
            @for (index, cell) in field.cells.iter().enumerate() {
                @let (column, row) = (index % field.columns, index / field.columns);
                @let lowest = index + field.columns >= field.cells.len();
                g transform={ "translate(" (c(MARGIN[0] + SIDE[0] * column as f64)) " " (c(SIDE[1] * row as f64)) ")" } {
                    (draw(field, cell, &scale, column == 0, lowest))
                }
            }
            text x=(c(MARGIN[0] + (width - MARGIN[0]) / 2.0)) y=(c(below + 28.0)) text-anchor="middle" { (field.x_label) }
            text transform={ "translate(11 " (c(below / 2.0)) ") rotate(-90)" } text-anchor="middle" { (field.y_label) }
            @for (index, name) in field.names.iter().enumerate() {
                @let step = (width - MARGIN[0]) / field.names.len() as f64;
                g transform={ "translate(" (c(MARGIN[0] + step * index as f64)) " " (c(below + MARGIN[1] + 14.0)) ")" } {
                    line x1="0" y1="0" x2="26" y2="0" stroke=(colour(index, last)) stroke-width=(if index == last { "1" } else { "1.4" }) {}
                    @if index != last { (mark(index, 13.0, 0.0)) }
                    text x="33" y="4" { (name) }
                }
            }
        }
    })
}

fn draw(field: &Field, cell: &Cell, scale: &Scale, first: bool, lowest: bool) -> Markup {
    let [right, bottom] = [SIDE[0] - 10.0, SIDE[1] - 4.0];
    let last = field.names.len() - 1;
    html! {
        text x="2" y="11" font-size="10.5" { (cell.title[0]) }
        text x="2" y="24" font-size="10.5" { (cell.title[1]) }
        @for tick in scale.decades() {
            line class="grid" x1="0" x2=(c(right)) y1=(c(scale.y(tick))) y2=(c(scale.y(tick))) {}
            @if first { text x="-5" y=(c(scale.y(tick) + 4.0)) text-anchor="end" { (tick_text(tick)) } }
        }
        @for &tick in &field.x_ticks {
            line class="grid" x1=(c(scale.x(tick))) x2=(c(scale.x(tick))) y1=(c(TITLE)) y2=(c(bottom)) {}
            @if lowest { text x=(c(scale.x(tick))) y=(c(bottom + 13.0)) text-anchor="middle" font-size="10.5" { (tick_text(tick)) } }
        }
        path class="axes" d={ "M0 " (c(TITLE)) "V" (c(bottom)) "H" (c(right)) } {}
        @for (index, values) in cell.series.iter().enumerate() {
            @let seen: Vec<&[f64; 2]> = values.iter().filter(|[x, y]| *x > 0.0 && *y > 0.0).collect();
            path fill="none" stroke=(colour(index, last)) stroke-width=(if index == last { "1" } else { "1.4" })
                d=(seen.iter().enumerate().map(|(i, [x, y])| {
                    format!("{}{} {}", if i == 0 { 'M' } else { 'L' }, c(scale.x(*x)), c(scale.y(*y)))
                }).collect::<String>()) {}
            @if index != last {
                @for [x, y] in seen { (mark(index, scale.x(*x), scale.y(*y))) }
            }
        }
    }
}

fn colour(index: usize, last: usize) -> &'static str {
    if index == last { "#000000" } else { PALETTE[index % (PALETTE.len() - 1)] }
}
