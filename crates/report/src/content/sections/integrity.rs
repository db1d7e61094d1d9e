//! The section on integrity: errors against protection levels, and the availability of fixes.

use seafix_log::{Outcome, Region};

use crate::{
    content::{
        conditions::columns,
        figures::layout,
        phrases::{self, Unit},
    },
    document::{Block, Cell, Figure, Head, Section, Table, Text, text},
    field::Field,
    figure::{Axis, Chart, Entry, Layer, Panel},
    format::{distinct, trimmed},
    number::Number,
    run::{AttemptRow, Frame, Run, Trial},
    summary::{Row, RunSummary},
};

/// Maximum number of marks, each for fixes within their protection level and beyond; more hide each other.
const MARKS: usize = 1200;
/// Maximum number of series in the diagram; more methods are merged into one.
const SERIES: usize = 7;

/// The section; `None` without ground truth or without protection levels.
pub(crate) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    let judged = |row: &Row| row.regions.is_some_and(|regions| regions.iter().any(|count| *count > 0));
    if !summary.rows.iter().any(judged) {
        return None;
    }
    let mut section = Section::new("Integrity");
    section.say(message(run));
    section.add(Block::Table(table(run, summary)));
    section.blocks.extend(stanford(run, summary).map(Block::Figure));
    Some(section)
}

/// The paragraph that defines protection level, alert limit and regions.
fn message(run: &Run) -> Text {
    let risks = distinct(run.trials.iter().filter_map(risk).map(|risk| format!("{risk:e}").replace('-', "−")));
    let risk = match &risks[..] {
        [risk] => format!("a probability of {risk} per fix"),
        _ => "the integrity risk of its configuration".to_owned(),
    };
    text![format!(
        "Every fix has a protection level p: a radius that the camera position error e exceeds with at most {risk}, wrong matches included. A fix has no level if it depends on a point that no other point can check. A fix may be used if its level is within the alert limit a of its target. A fix is available if e ≤ p ≤ a, misleading if p < e ≤ a, hazardously misleading if p ≤ a < e, and not available if a < p, for any error."
    )]
}

/// The integrity risk in the configuration of a trial.
fn risk(trial: &Trial) -> Option<f64> {
    let table = trial.header.configuration.parse::<toml::Table>().ok()?;
    table.get("pipeline")?.get("acceptance")?.get("risk")?.as_float()
}

/// The regions in the order of the table, with the heads of their columns.
const COLUMNS: [(Region, &str); 6] = [
    (Region::Available, "Available"),
    (Region::Misleading, "Misleading"),
    (Region::Hazardous, "Hazardously misleading"),
    (Region::Unavailable, "unavailable"),
    (Region::UnavailableMisleading, "and misleading"),
    (Region::Unprotected, "no level"),
];

fn table(run: &Run, summary: &RunSummary) -> Table {
    let caption = text![
        "Integrity: available, misleading and hazardously misleading fixes among n attempts, in % with 95 % intervals. Not available: counts of the fixes whose protection level exceeds the alert limit with an error within the level, of those with an error beyond it, and of fixes without a level. The remaining attempts were rejected."
    ];
    let mut above = columns::blank(summary, 1);
    above.extend(COLUMNS[..3].iter().map(|(_, name)| Head::over(3, *name)));
    above.push(Head::over(3, "Not available"));
    let mut below = columns::heads(summary);
    below.push(Head::numbers("n"));
    below.extend((0..3).flat_map(|_| ["count", "%", "interval"].map(Head::numbers)));
    below.extend(COLUMNS[3..].iter().map(|(_, name)| Head::numbers(*name)));
    let mut table = Table { id: "integrity".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let Some(regions) = row.regions else { continue };
        let mut line = columns::cells(row);
        line.push(phrases::count(trial, "attempted", row.attempted).into());
        for (place, (region, _)) in COLUMNS.into_iter().enumerate() {
            let (group, k) = (region.name(), regions[region as usize]);
            line.push(phrases::count(trial, group, k).into());
            if place < 3 {
                let decimals = if region == Region::Available { 1 } else { 3 };
                let of = (k, row.attempted);
                let [fraction, low, high] =
                    ["percent", "low", "high"].map(|what| phrases::rate(trial, what, group, of, decimals));
                line.push(fraction.into());
                line.push(Cell { text: text!["[", low, ", ", high, "]"], minor: true, ..Cell::default() });
            }
        }
        table.line(columns::breaks(summary, index), line);
    }
    table
}

/// A fix with its position error, protection level and alert limit (m).
struct Mark<'a> {
    series: usize,
    trial: &'a Trial,
    frame: &'a Frame,
    row: &'a AttemptRow,
    values: [f64; 3],
}

impl Mark<'_> {
    fn region(&self) -> Region {
        let [error, level, limit] = self.values;
        Region::of(error, Some(level), limit)
    }
}

/// The protection level of the position over its error: the diagram of Stanford's integrity monitors, with its regions.
fn stanford(run: &Run, summary: &RunSummary) -> Option<Figure> {
    let mut names = distinct(run.trials.iter().map(|trial| trial.method().join(" + ")));
    let apart = names.len() <= SERIES;
    let series = |trial: &Trial| if apart { layout::series(&names, &trial.method().join(" + ")) } else { 0 };
    let mut marks = Vec::new();
    for trial in &run.trials {
        let series = series(trial);
        for (frame, row) in trial.attempts().filter(|(_, row)| row.outcome == Outcome::Fix) {
            let values = [Field::Position, Field::Level, Field::Limit].map(|field| row.get(field).unwrap_or(f64::NAN));
            if values.iter().all(|value| *value > 0.0) {
                marks.push(Mark { series, trial, frame, row, values });
            }
        }
    }
    let n = marks.len();
    if n == 0 {
        return None;
    }
    if !apart {
        names = vec!["fixes".to_owned()];
    }
    let limits = distinct(marks.iter().map(|mark| mark.values[2].to_string()));
    // With several alert limits, errors and levels are divided by the limit of their target.
    let one = limits.len() == 1;
    let generated_in = |mark: &Mark<'_>| {
        let [error, level, limit] = mark.values;
        if one { [error * 1e3, level * 1e3] } else { [error / limit, level / limit] }
    };
    let limit = if one { marks[0].values[2] * 1e3 } else { 1.0 };
    let of = |axis: usize| marks.iter().map(move |mark| generated_in(mark)[axis]);
    let min = [0, 1].map(|axis| 0.8 * of(axis).fold(limit / 20.0, f64::min));
    let max = 1.25 * of(0).chain(of(1)).fold(limit * 6.0, f64::max);
    let fractions = Regions::of(summary);
    let mut layers = fractions.layers(min, max, limit);

    let misleads = |mark: &Mark<'_>| mark.values[0] > mark.values[1];
    let beyond = marks.iter().filter(|mark| misleads(mark)).count();
    let every = (n - beyond).div_ceil(MARKS).max(1);
    let every_beyond = beyond.div_ceil(MARKS).max(1);
    let heads = [Head::words("series"), Head::numbers("frame"), Head::words("target"), Head::words("region")];
    let heads = heads.into_iter().chain(["error (mm)", "level (mm)", "alert limit (mm)"].map(Head::numbers));
    let mut data = Table::new("stanford", text!["The data of the Stanford diagram."], heads.collect());
    let mut points = vec![Vec::new(); names.len()];
    let mut seen = [0_usize; 2];
    for mark in &marks {
        let place = usize::from(misleads(mark));
        seen[place] += 1;
        if !(seen[place] - 1).is_multiple_of([every, every_beyond][place]) {
            continue;
        }
        points[mark.series].push(generated_in(mark));
        let &Mark { trial, frame, row, .. } = mark;
        let place = (trial.object(row), frame.number, frame.stamp_ns);
        let as_number = |field| phrases::value(trial, place, field, row.get(field), (Unit::Millimetres, 3)).into();
        let mut line: Vec<Cell> = vec![
            names[mark.series].clone().into(),
            phrases::frame(trial, frame.number, frame.stamp_ns).into(),
            trial.object(row).to_owned().into(),
            mark.region().name().into(),
        ];
        line.extend([Field::Position, Field::Level, Field::Limit].map(as_number));
        data.line(false, line);
    }
    layers.extend(points.into_iter().enumerate().map(|(series, points)| Layer::Marks { series, points, radius: 1.3 }));
    let labels = match one {
        true => ["position error (mm)", "protection level (mm)"],
        false => ["position error / alert limit", "protection level / alert limit"],
    };
    let panel = Panel {
        x: Axis::logarithmic(labels[0]).within([min[0], max]),
        y: Axis::logarithmic(labels[1]).within([min[1], max]),
        layers,
        ..Panel::default()
    };
    let entry = |(index, name): (usize, &String)| Entry::mark(name.clone(), index);
    let legend = if names.len() > 1 { names.iter().enumerate().map(entry).collect() } else { Vec::new() };
    let chart = Chart { panels: vec![panel], columns: 1, page: false, shape: 0.95, legend };
    let mut message = text![format!(
        "Stanford diagram: protection level over camera position error, {}. ",
        if one {
            format!("with an alert limit of {} mm", trimmed(limit))
        } else {
            "both divided by the alert limit of the target".to_owned()
        }
    )];
    message.extend(fractions.message(run));
    let thinned = match (every, every_beyond) {
        (1, 1) => "Every fix has a mark. ".to_owned(),
        (_, 1) => format!("Marks: one in {every} fixes with an error within the level, and every fix beyond it. "),
        _ => format!("Marks: one in {every} fixes with an error within the level, one in {every_beyond} beyond it. "),
    };
    message.extend(text![thinned]);
    layout::figure("stanford", message, &chart, data)
}

/// The number of fixes of all trials in each region of the Stanford diagram.
struct Regions {
    /// The counts in the order of [`Region::ALL`]; `None` if a log lacks them.
    counts: Option<[usize; Region::ALL.len()]>,
}

impl Regions {
    fn of(summary: &RunSummary) -> Self {
        let known: Option<Vec<_>> =
            summary.rows.iter().filter(|row| row.attempted > 0).map(|row| row.regions).collect();
        let sum =
            |known: Vec<[usize; 6]>| std::array::from_fn(|region| known.iter().map(|counts| counts[region]).sum());
        Self { counts: known.map(sum) }
    }

    /// The printed fraction of a region among all fixes with a protection level.
    fn fraction(&self, region: Region) -> String {
        let Some(counts) = &self.counts else { return String::new() };
        let all: usize = counts.iter().sum::<usize>() - counts[Region::Unprotected as usize];
        let fraction = 100.0 * counts[region as usize] as f64 / all.max(1) as f64;
        match counts[region as usize] {
            0 => "0 %".to_owned(),
            _ if fraction < 0.05 => "< 0.1 %".to_owned(),
            _ => format!("{fraction:.1} %"),
        }
    }

    /// The layers with the regions, their names and fractions, and the lines between them.
    fn layers(&self, [left, low]: [f64; 2], high: f64, limit: f64) -> Vec<Layer> {
        let a = limit;
        // The diagonal enters the panel at (d, d).
        let d = left.max(low);
        let areas: [(usize, Vec<[f64; 2]>); 5] = [
            (2, vec![[left, d], [d, d], [a, a], [left, a]]),
            (5, vec![[d, d], [a, a], [a, low], [d, low]]),
            (1, vec![[a, low], [high, low], [high, a], [a, a]]),
            (6, vec![[left, a], [a, a], [high, high], [left, high]]),
            (3, vec![[a, a], [high, a], [high, high]]),
        ];
        let mut layers: Vec<Layer> = areas.into_iter().map(|(series, points)| Layer::Area { series, points }).collect();
        let line = |points: [[f64; 2]; 2], dash| Layer::Rule { points: points.into(), dash };
        layers.extend([
            line([[d, d], [high, high]], 0),
            line([[left, a], [high, a]], 1),
            line([[a, low], [a, high]], 1),
        ]);
        let word = |at: [f64; 2], end: bool, up: bool, name: &str, region: Region| Layer::Words {
            at,
            end,
            up,
            lines: [name.to_owned(), self.fraction(region)].into_iter().filter(|line| !line.is_empty()).collect(),
        };
        layers.extend([
            word([left, high], false, false, "not available", Region::Unavailable),
            word([left, a], false, false, "available", Region::Available),
            word([a, low], true, true, "misleading", Region::Misleading),
            word([high, low], true, true, "hazardous", Region::Hazardous),
            word([high, a], true, true, "misleading", Region::UnavailableMisleading),
        ]);
        layers
    }

    /// The sentences with the counts of all regions.
    fn message(&self, run: &Run) -> Text {
        let Some(counts) = &self.counts else { return Text::new() };
        let trials: Vec<&Trial> = run.trials.iter().collect();
        let as_number = |region: Region| {
            let key = phrases::over(&trials, "/metrics/evaluation", format!("count {}", region.name()));
            Number::count(counts[region as usize], key)
        };
        text![
            "Counts of fixes: ",
            as_number(Region::Available),
            " available, ",
            as_number(Region::Misleading),
            " misleading, ",
            as_number(Region::Hazardous),
            " hazardously misleading, ",
            as_number(Region::Unavailable),
            " not available, ",
            as_number(Region::UnavailableMisleading),
            " not available and misleading, ",
            as_number(Region::Unprotected),
            " without a level. The fractions in the diagram are of the fixes with a level. "
        ]
    }
}
