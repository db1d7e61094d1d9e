//! The figures of the probability of a wrong answer: found objects over false answers, and its reliability.

use crate::{
    content::{
        figures::layout::{caption, figure},
        front::is_absent,
        phrases,
    },
    document::{Cell, Figure, Head, Table, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::{distinct, short},
    number::Number,
    proportion,
    run::{AttemptRow, Run, Trial},
    summary::{Row, RunSummary},
};

/// Maximum number of methods and of conditions.
const MAX: usize = 9;
/// The limits of `p_wrong` in the table of found objects.
const LIMITS: [f64; 6] = [1e-5, 1e-4, 1e-3, 1e-2, 2e-2, 0.1];
/// The presets strict, balanced and permissive, which the figure marks.
const PRESETS: [f64; 3] = [1e-5, 1e-3, 2e-2];
/// The largest rate of false answers (%) in the figure.
const MAX_FALSE: f64 = 10.0;
/// The ends of the classes of `p_wrong`.
const ENDS: [f64; 6] = [0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5];
/// The ends of both axes of the reliability; smaller values are drawn at the lower end.
const LOWEST: f64 = 1e-5;

/// The trials of one method under one condition, at the largest limit of the probability.
struct Group<'a> {
    condition: String,
    method: String,
    present: Vec<&'a Trial>,
    absent: Vec<&'a Trial>,
}

/// The groups of a run with frames without the object; empty for any other.
fn groups<'a>(run: &'a Run, summary: &RunSummary) -> Vec<Group<'a>> {
    let several = summary.rows.iter().any(|row| row.search != summary.rows[0].search);
    let method = |row: &Row| if several { row.search.clone() } else { row.method() };
    let condition = |row: &Row| {
        let others = row.conditions().filter(|axis| !matches!(short(&axis.key), "absent" | "max-p-wrong"));
        others.map(|axis| axis.value.clone()).collect::<Vec<_>>().join(", ")
    };
    let limit = |row: &Row| {
        let axis = row.axes.iter().find(|axis| short(&axis.key) == "max-p-wrong");
        axis.map_or_else(String::new, |axis| axis.value.clone())
    };
    let rows = || summary.rows.iter().zip(&run.trials);
    let answers = |name: &str| {
        let own = rows().filter(|(row, _)| limit(row) == name);
        own.flat_map(|(_, trial)| trial.attempts()).filter(|(_, row)| p_wrong(row).is_some()).count()
    };
    let Some(largest) = distinct(summary.rows.iter().map(limit)).into_iter().max_by_key(|name| answers(name)) else {
        return Vec::new();
    };
    let mut groups: Vec<Group<'_>> = Vec::new();
    for (row, trial) in rows().filter(|(row, _)| limit(row) == largest) {
        let (condition, method) = (condition(row), method(row));
        let known = groups.iter().position(|group| group.condition == condition && group.method == method);
        let place = known.unwrap_or_else(|| {
            groups.push(Group { condition, method, present: Vec::new(), absent: Vec::new() });
            groups.len() - 1
        });
        let group = &mut groups[place];
        if is_absent(row) { &mut group.absent } else { &mut group.present }.push(trial);
    }
    groups.retain(|group| !group.absent.is_empty() && !group.present.is_empty());
    groups
}

/// The probability that the pose of a fix is wrong, as stated; `None` without a fix.
fn p_wrong(row: &AttemptRow) -> Option<f64> {
    row.get(Field::PWrong).filter(|_| row.found() || row.wrong())
}

/// The figure of found objects over answered frames without the object, along the limit of `p_wrong`.
///
/// A receiver operating characteristic: each condition has a panel, each method a line, each preset a mark.
pub(super) fn roc(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let groups = groups(run, summary);
    let names = distinct(groups.iter().map(|group| group.method.clone()));
    let conditions = distinct(groups.iter().map(|group| group.condition.clone()));
    if groups.is_empty() || names.len() > MAX || conditions.len() > MAX {
        return None;
    }
    let heads = [Head::words("condition"), Head::words("method"), Head::numbers("p_wrong at most")].into_iter();
    let heads = heads.chain(["found (%)", "without the object (%)"].map(Head::numbers)).collect();
    let mut data = Table::new("roc", text!["The data of the figure of found objects over false answers."], heads);
    let mut panels = Vec::new();
    for condition in &conditions {
        let mut layers = Vec::new();
        for group in groups.iter().filter(|group| group.condition == *condition) {
            let of = |trials: &[&Trial], counts: fn(&AttemptRow) -> bool| -> Vec<Option<f64>> {
                let rows = trials.iter().flat_map(|trial| trial.attempts());
                rows.map(|(_, row)| row.get(Field::PWrong).filter(|_| counts(row))).collect()
            };
            let (present, absent) = (of(&group.present, AttemptRow::found), of(&group.absent, AttemptRow::wrong));
            let percent = |all: &[Option<f64>], limit: f64| {
                let within = all.iter().flatten().filter(|p| **p <= limit).count();
                100.0 * within as f64 / all.len().max(1) as f64
            };
            let at = |limit: f64| [percent(&absent, limit), percent(&present, limit)];
            let mut limits: Vec<f64> = present.iter().chain(&absent).copied().flatten().collect();
            limits.sort_by(f64::total_cmp);
            limits.dedup();
            // Steps from the smallest limit: a false answer moves to the right before an object is found above it.
            let mut points = vec![at(LIMITS[0])];
            for [x, y] in limits.into_iter().filter(|limit| *limit > LIMITS[0]).map(at) {
                let [_, before] = points[points.len() - 1];
                if x > MAX_FALSE {
                    points.push([MAX_FALSE, before]);
                    break;
                }
                points.extend([[x, before], [x, y]]);
            }
            let series = names.iter().position(|name| *name == group.method).unwrap_or(0);
            let marks = PRESETS.map(at).into_iter().filter(|at| at[0] <= MAX_FALSE).collect();
            layers.push(Layer::Line { series, points });
            layers.push(Layer::Marks { series, points: marks, radius: 2.2 });
            for limit in LIMITS {
                let number = |(trials, what, value): (&[&Trial], &str, f64)| -> Cell {
                    let what = format!("percent {what}p_wrong<={limit} of attempted");
                    Number::new(Some(value), 1, phrases::over(trials, "/metrics/evaluation", what)).into()
                };
                let [without, with] = at(limit);
                let rates = [(&group.present[..], "", with), (&group.absent[..], "wrong ", without)].map(number);
                let named = [condition.clone().into(), group.method.clone().into(), limit.to_string().into()];
                data.line(false, named.into_iter().chain(rates).collect());
            }
        }
        panels.push(Panel {
            title: condition.clone(),
            x: Axis::linear("answers without the object (%)").within([-0.2, MAX_FALSE]),
            y: Axis::linear("found (%)"),
            layers,
            equal: false,
        });
    }
    let legend = names.iter().enumerate().map(|(index, name)| Entry::both(name.clone(), index)).collect();
    let columns = if panels.len() == 4 { 2 } else { panels.len().min(3) };
    let shape = if columns == 1 { 0.5 } else { 0.62 };
    let chart = Chart { panels, columns, page: true, shape, legend };
    let message = "Right fixes in percent of the attempts with the object in view, over answered frames without the object, along the limit of the stated probability that the pose is wrong (receiver operating characteristic). Marks are the presets strict, balanced and permissive, upwards; lines begin at strict.";
    figure("roc", caption(message), &chart, data)
}

/// The figure of the fraction of wrong fixes over the stated probability, one panel a method.
///
/// A reliability diagram: on the diagonal, fixes that are stated to be wrong with a probability p are wrong in a
/// fraction p of cases. Frames with and without the object count alike.
pub(super) fn reliability(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let groups = groups(run, summary);
    let names = distinct(groups.iter().map(|group| group.method.clone()));
    if groups.is_empty() || names.len() > MAX {
        return None;
    }
    let heads = [Head::words("method"), Head::numbers("from"), Head::numbers("to")].into_iter();
    let heads = heads.chain(["fixes", "mean p_wrong", "wrong (%)", "low (%)", "high (%)"].map(Head::numbers));
    let mut data = Table::new("reliability", text!["The data of the reliability diagram."], heads.collect());
    let mut panels = Vec::new();
    for (series, name) in names.iter().enumerate() {
        let own = groups.iter().filter(|group| group.method == *name);
        let trials: Vec<&Trial> = own.flat_map(|group| group.present.iter().chain(&group.absent)).copied().collect();
        let fixes: Vec<(f64, bool)> = trials
            .iter()
            .flat_map(|trial| trial.attempts())
            .filter_map(|(_, row)| Some((p_wrong(row)?, row.wrong())))
            .collect();
        let (mut marks, mut whiskers) = (Vec::new(), Vec::new());
        for ends in ENDS.windows(2) {
            let inside = |p: f64| (ends[0] == 0.0 || p > ends[0]) && p <= ends[1];
            let own: Vec<(f64, bool)> = fixes.iter().copied().filter(|(p, _)| inside(*p)).collect();
            if own.is_empty() {
                continue;
            }
            let events: Vec<bool> = own.iter().map(|(_, wrong)| *wrong).collect();
            let mean = own.iter().map(|(p, _)| p).sum::<f64>() / own.len() as f64;
            let wrong = events.iter().filter(|wrong| **wrong).count() as f64 / own.len() as f64;
            let (low, high) = proportion::interval(false, &events);
            marks.push([mean.max(LOWEST), wrong.max(LOWEST)]);
            whiskers.push([mean.max(LOWEST), low.max(LOWEST), high]);
            let key = |what: &str| {
                let what = format!("{what} p_wrong from {} to {} of fixes", ends[0], ends[1]);
                phrases::over(&trials, "/metrics/evaluation", what)
            };
            let mut cells: Vec<Cell> =
                vec![name.clone().into(), ends[0].to_string().into(), ends[1].to_string().into()];
            cells.push(Number::count(own.len(), key("count")).into());
            cells.push(Number::probability(mean, key("mean")).into());
            let rates = [("percent", wrong), ("low", low), ("high", high)];
            cells.extend(rates.map(|(what, value)| Cell::from(Number::new(Some(100.0 * value), 2, key(what)))));
            data.line(false, cells);
        }
        let axis = |label: &str| {
            let decades = vec![1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0];
            Axis::logarithmic(label).at(decades).within([LOWEST, 1.0])
        };
        let line = |factor: f64| {
            let ends = [LOWEST / factor.min(1.0), 1.0 / factor.max(1.0)];
            ends.map(|p| [p, p * factor]).to_vec()
        };
        let mut layers: Vec<Layer> =
            [(1.0, 2), (0.3, 1), (2.0, 1)].map(|(factor, dash)| Layer::Rule { points: line(factor), dash }).into();
        layers.push(Layer::Whiskers { series, values: whiskers });
        layers.push(Layer::Marks { series, points: marks, radius: 2.2 });
        let (x, y) = (axis("stated probability"), axis("wrong"));
        panels.push(Panel { title: name.clone(), x, y, layers, equal: false });
    }
    let chart = Chart { columns: panels.len().min(3), page: panels.len() > 1, shape: 0.8, panels, legend: Vec::new() };
    let message = "Reliability: the fraction of wrong fixes over their mean stated probability, in classes of the probability, over frames with and without the object; 95 % Clopper–Pearson intervals. The dotted line is exact; the dashed ones are 0.3 and 2 times the probability. Values below 1e-5 are drawn there.";
    figure("reliability", caption(message), &chart, data)
}
