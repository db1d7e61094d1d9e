//! Line plots as SVG: a logarithmic axis of errors over a linear one of conditions.

use maud::{Markup, html};

use super::PALETTE;
use crate::format;

/// A figure of panels side by side that share their axes.
pub(crate) struct Plot {
    /// Name and unit of the abscissa.
    pub(crate) x_label: String,
    /// Places of its ticks.
    pub(crate) x_ticks: Vec<f64>,
    /// The panels.
    pub(crate) panels: Vec<Panel>,
    /// Whether values are joined by lines.
    pub(crate) lines: bool,
}

/// One panel.
pub(crate) struct Panel {
    /// Name and unit of the ordinate.
    pub(crate) y_label: String,
    /// A shaded range, and what it is.
    pub(crate) band: Option<([f64; 2], &'static str)>,
    /// What is drawn.
    pub(crate) series: Vec<Series>,
}

/// One line of a panel.
pub(crate) struct Series {
    /// What the legend calls it.
    pub(crate) name: String,
    /// Its values.
    pub(crate) values: Vec<Value>,
}

/// One value with its spread.
#[derive(Clone, Copy)]
pub(crate) struct Value {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

const DASHES: [&str; 4] = ["", "7 4", "2 3", "9 3 2 3"];
const WIDTH: f64 = 376.0;
const HEIGHT: f64 = 250.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 44.0;

/// Coordinates with two decimals: the same text on every machine.
pub(super) fn c(value: f64) -> String {
    format!("{value:.2}")
}

/// Draws `plot`; `None` where there is nothing to draw.
pub(crate) fn plot(plot: &Plot) -> Option<Markup> {
    let values = || plot.panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.values);
    let bands = plot.panels.iter().filter_map(|panel| panel.band).flat_map(|(range, _)| range);
    let ys: Vec<f64> =
        values().flat_map(|value| [value.low, value.y, value.high]).chain(bands).filter(|y| *y > 0.0).collect();
    values().next()?;
    let scale = Scale::of(plot, &ys);
    let width = WIDTH * plot.panels.len() as f64;
    let mut names: Vec<&str> = Vec::new();
    for series in plot.panels.iter().flat_map(|panel| &panel.series) {
        if !names.contains(&series.name.as_str()) {
            names.push(&series.name);
        }
    }
    let legend_rows = names.len().div_ceil(2) as f64;
    let height = HEIGHT + 18.0 * legend_rows;
    Some(html! {
        svg class="plot" xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (c(width)) " " (c(height)) } role="img" {
            @for (index, panel) in plot.panels.iter().enumerate() {
                g transform={ "translate(" (c(WIDTH * index as f64)) " 0)" } { (draw(plot, panel, &scale, &names)) }
            }
            @for (index, name) in names.iter().enumerate() {
                @let (column, row) = (index % 2, index / 2);
                g transform={ "translate(" (c(LEFT + column as f64 * width / 2.0)) " " (c(HEIGHT + 12.0 + 18.0 * row as f64)) ")" } {
                    @if plot.lines {
                        line x1="0" y1="0" x2="30" y2="0" stroke=(colour(index)) stroke-width="1.6" stroke-dasharray=(DASHES[index % DASHES.len()]) {}
                    }
                    (mark(index, 15.0, 0.0))
                    text x="38" y="4" { (name) }
                }
            }
        }
    })
}

/// From quantities to places in a panel.
struct Scale {
    x: [f64; 2],
    y: [f64; 2],
}

impl Scale {
    fn of(plot: &Plot, ys: &[f64]) -> Self {
        let xs = plot.panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.values).map(|v| v.x);
        let xs: Vec<f64> = xs.chain(plot.x_ticks.iter().copied()).collect();
        let range =
            |values: &[f64]| values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
        let [first, last] = range(&xs);
        let margin = if last > first { 0.08 * (last - first) } else { 0.5 };
        let [low, high] = if ys.is_empty() { [0.1, 1.0] } else { range(ys) };
        Self { x: [first - margin, last + margin], y: [(low * 0.8).log10(), (high * 1.25).log10()] }
    }

    fn x(&self, x: f64) -> f64 {
        LEFT + (x - self.x[0]) / (self.x[1] - self.x[0]) * (WIDTH - LEFT - RIGHT)
    }

    /// Values that are not positive stand on the lower edge.
    fn y(&self, y: f64) -> f64 {
        let share = if y > 0.0 { (y.log10() - self.y[0]) / (self.y[1] - self.y[0]) } else { 0.0 };
        HEIGHT - BOTTOM - share.clamp(0.0, 1.0) * (HEIGHT - TOP - BOTTOM)
    }

    /// 1, 2, 5 of every decade in view; the tens alone where there are many decades.
    fn y_ticks(&self) -> Vec<f64> {
        let steps: &[f64] = if self.y[1] - self.y[0] > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let decades = self.y[0].floor() as i32..=self.y[1].ceil() as i32;
        let ticks = decades.flat_map(|decade| steps.iter().map(move |step| step * 10f64.powi(decade)));
        ticks.filter(|tick| (self.y[0]..=self.y[1]).contains(&tick.log10())).collect()
    }
}

fn draw(plot: &Plot, panel: &Panel, scale: &Scale, names: &[&str]) -> Markup {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    let dodge = |index: usize| 5.0 * (index as f64 - (names.len() as f64 - 1.0) / 2.0);
    html! {
        @if let Some(([low, high], name)) = panel.band {
            rect x=(c(LEFT)) y=(c(scale.y(high))) width=(c(right - LEFT)) height=(c(scale.y(low) - scale.y(high))) fill="#e9e4d4" {}
            text class="note" x=(c(LEFT + 6.0)) y=(c(scale.y(high) + 13.0)) { (name) }
        }
        @for tick in scale.y_ticks() {
            line class="grid" x1=(c(LEFT)) x2=(c(right)) y1=(c(scale.y(tick))) y2=(c(scale.y(tick))) {}
            text x=(c(LEFT - 7.0)) y=(c(scale.y(tick) + 4.0)) text-anchor="end" { (tick_text(tick)) }
        }
        @for &tick in &plot.x_ticks {
            line class="grid" x1=(c(scale.x(tick))) x2=(c(scale.x(tick))) y1=(c(TOP)) y2=(c(bottom)) {}
            text x=(c(scale.x(tick))) y=(c(bottom + 16.0)) text-anchor="middle" { (tick_text(tick)) }
        }
        path class="axes" d={ "M" (c(LEFT)) " " (c(TOP)) "V" (c(bottom)) "H" (c(right)) } {}
        text x=(c((LEFT + right) / 2.0)) y=(c(bottom + 34.0)) text-anchor="middle" { (plot.x_label) }
        text transform={ "translate(14 " (c((TOP + bottom) / 2.0)) ") rotate(-90)" } text-anchor="middle" { (panel.y_label) }
        @for series in &panel.series {
            @let index = names.iter().position(|name| *name == series.name).unwrap_or(0);
            @let place = |value: &Value| (scale.x(value.x) + if plot.lines { dodge(index) } else { 0.0 }, scale.y(value.y));
            @if plot.lines {
                path fill="none" stroke=(colour(index)) stroke-width="1.6" stroke-dasharray=(DASHES[index % DASHES.len()])
                    d=(series.values.iter().enumerate().map(|(i, value)| {
                        let (x, y) = place(value);
                        format!("{}{} {}", if i == 0 { 'M' } else { 'L' }, c(x), c(y))
                    }).collect::<String>()) {}
            }
            @for value in &series.values {
                @let (x, y) = place(value);
                @if value.high > value.low {
                    line x1=(c(x)) x2=(c(x)) y1=(c(scale.y(value.low))) y2=(c(scale.y(value.high))) stroke=(colour(index)) stroke-width="1" {}
                }
                (mark(index, x, y))
            }
        }
    }
}

fn colour(index: usize) -> &'static str {
    PALETTE[index % PALETTE.len()]
}

/// Another shape for every series: circle, square, triangle, diamond.
pub(super) fn mark(index: usize, x: f64, y: f64) -> Markup {
    let fill = colour(index);
    html! {
        @match index % 4 {
            0 => { circle cx=(c(x)) cy=(c(y)) r="3.6" fill=(fill) {} }
            1 => { rect x=(c(x - 3.2)) y=(c(y - 3.2)) width="6.4" height="6.4" fill=(fill) {} }
            2 => { path d={ "M" (c(x)) " " (c(y - 4.4)) "l4.2 7.4h-8.4z" } fill=(fill) {} }
            _ => { path d={ "M" (c(x)) " " (c(y - 4.6)) "l4.2 4.6l-4.2 4.6l-4.2 -4.6z" } fill=(fill) {} }
        }
    }
}

/// A tick without needless zeros.
pub(super) fn tick_text(tick: f64) -> String {
    let text = format!("{tick:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format::number(text.parse().ok(), text.split_once('.').map_or(0, |(_, decimals)| decimals.len()))
}
