//! The figure of precision and recall of identified points along the distance tolerance.

use seafix_log::Outcome;

use crate::{
    content::{
        conditions::axes,
        figures::layout::{caption, figure, series},
        phrases,
    },
    document::{Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::{distinct, headed, short, trimmed},
    number::{Key, Number},
    run::{AttemptRow, Run, Trial},
    summary::{Row, RunSummary},
};

/// Maximum number of methods, and of conditions, in the figure.
const MAX: usize = 7;

/// The points that the fixes of a trial identified.
pub(crate) struct Identified {
    /// The correct pairs among those of fixes.
    pub(crate) precision: f64,
    /// The correct pairs of fixes among the visible points of all attempts.
    pub(crate) recall: f64,
}

impl Identified {
    /// The fractions; `None` without a fix, where precision is undefined, or without visible points.
    pub(crate) fn of(trial: &Trial) -> Option<Self> {
        // A rejected attempt has no correspondences, but its visible points count.
        let sum = |field: Field, of: fn(&AttemptRow) -> bool| -> f64 {
            trial.attempts().filter(|(_, row)| of(row)).filter_map(|(_, row)| row.get(field)).sum()
        };
        let fixed = |row: &AttemptRow| row.outcome == Outcome::Fix;
        let (correct, identified) = (sum(Field::Correct, fixed), sum(Field::Identified, fixed));
        let visible = sum(Field::Visible, |_| true);
        let known = visible > 0.0 && identified > 0.0;
        known.then(|| Self { precision: correct / identified, recall: correct / visible })
    }

    /// The harmonic mean of precision and recall.
    pub(crate) fn f1(&self) -> f64 {
        2.0 * self.recall * self.precision / (self.recall + self.precision).max(f64::MIN_POSITIVE)
    }
}

/// The figure of precision over recall of identified points along the tolerance Δ.
///
/// Every method has a line, every condition a panel. A ring marks the tolerance with the largest F1 score.
pub(crate) fn precision_recall(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let key = axes::keys(summary).into_iter().find(|key| key.contains("tolerance"))?;
    let condition = |row: &Row| {
        let others = row.conditions().filter(|axis| axis.key != key);
        others.map(|axis| format!("{} {}", short(&axis.key), axis.value)).collect::<Vec<_>>().join(", ")
    };
    let conditions = distinct(summary.rows.iter().map(condition));
    let names = distinct(summary.rows.iter().map(Row::method));
    if names.len() > MAX || conditions.len() > MAX {
        return None;
    }
    let heads = [Head::words("condition"), Head::words("method"), Head::numbers(headed(&key))].into_iter();
    let heads = heads.chain(["recall", "precision"].map(Head::numbers)).collect();
    let mut data = Table::new("precision-recall", text!["The data of the figure of precision over recall."], heads);
    let mut panels = Vec::new();
    for title in &conditions {
        let (mut layers, mut rings, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        for name in &names {
            let mut points: Vec<(f64, [f64; 2])> = Vec::new();
            let rows = summary.rows.iter().zip(&run.trials);
            for (row, trial) in rows.filter(|(row, _)| condition(row) == *title && row.method() == *name) {
                let tolerance = axes::on(row, &key)?;
                let Some(Identified { precision, recall }) = Identified::of(trial) else { continue };
                points.push((tolerance, [recall, precision]));
                let as_number = |over: &str, value| {
                    let what = format!("sum correct_pairs by {over}");
                    Number::new(Some(value), 4, Key::of(trial, "/metrics/evaluation", what)).into()
                };
                let at = phrases::axis(trial, &key, Some(tolerance)).into();
                let ends = [as_number("visible", recall), as_number("identified of fixes", precision)];
                data.line(false, [title.clone().into(), name.clone().into(), at].into_iter().chain(ends).collect());
            }
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let f1 = |[recall, precision]: [f64; 2]| Identified { precision, recall }.f1();
            let best = points.iter().copied().max_by(|a, b| f1(a.1).total_cmp(&f1(b.1)));
            let index = series(&names, name);
            let best = best.filter(|(_, at)| f1(*at) > 0.0);
            rings.extend(best.map(|(_, at)| Layer::Ring { at, radius: 4.2 }));
            let ends = [best.as_ref(), points.first(), points.last()];
            ends.into_iter().flatten().for_each(|&(tolerance, at)| note(&mut notes, trimmed(tolerance), at));
            let line: Vec<[f64; 2]> = points.into_iter().map(|(_, point)| point).collect();
            layers.push(Layer::Line { series: index, points: line.clone() });
            layers.push(Layer::Marks { series: index, points: line, radius: 2.0 });
        }
        layers.extend(rings);
        layers.extend(notes.into_iter().map(|(at, words)| Layer::Words {
            at,
            end: at[0] > 0.5,
            up: at[0] > 0.5,
            lines: vec![words.join(", ")],
        }));
        panels.push(Panel {
            title: title.clone(),
            x: Axis::linear("recall of visible points").within([-0.03, 1.03]),
            y: Axis::linear("precision"),
            layers,
            ..Panel::default()
        });
    }
    // All panels have the same scale, with room for text above.
    let reached = panels.iter().flat_map(|panel| &panel.layers).flat_map(Layer::reach).map(|point| point[1]);
    let room = 0.15 * (1.0 - reached.fold(0.9, f64::min));
    panels.iter_mut().for_each(|panel| panel.y.range = Some([1.0 - room / 0.15 - room, 1.0 + room]));
    let legend = names.iter().enumerate().map(|(index, name)| Entry::both(name.clone(), index)).collect();
    let page = panels.len() > 1;
    let columns = if panels.len() == 4 { 2 } else { panels.len().min(3) };
    let chart = Chart { panels, columns, page, shape: if columns == 2 { 0.62 } else { 0.8 }, legend };
    let message = format!(
        "Precision of the points that fixes identified, over recall of the visible points of all attempts including rejected ones, along {}. The numbers are its smallest and largest value with a fix, at the ends of each line, and its value with the largest F1 score on these frames, marked by a ring.",
        headed(&key)
    );
    figure("precision-recall", caption(&message), &chart, data)
}

/// Adds a label at a point, or extends the label of a near point that it would overlap.
fn note(notes: &mut Vec<([f64; 2], Vec<String>)>, word: String, at: [f64; 2]) {
    let near = |known: &[f64; 2]| (known[0] - at[0]).abs() < 0.16 && (known[1] - at[1]).abs() < 0.12;
    match notes.iter_mut().find(|(known, _)| near(known)) {
        Some((_, words)) if words.contains(&word) => {}
        Some((_, words)) => words.push(word),
        None => notes.push((at, vec![word])),
    }
}
