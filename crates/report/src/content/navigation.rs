//! The way from fix to fix: how far off the navigated pose was.

use super::{
    phrases::{self, Unit},
    results,
};
use crate::{
    Key, Number, RunSummary,
    document::{Block, Head, Section, Table, Text, text},
    fix_intervals::{drift, fix_intervals},
    navigation_quantity::{Counted, NavigationQuantity},
    run::{Run, Trial},
};

/// Whether a trial navigates.
fn sails(trial: &Trial) -> bool {
    trial.sample().any(|frame| frame.navigated.is_some())
}

/// The section, where any trial navigates.
pub(super) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    if !run.trials.iter().any(sails) {
        return None;
    }
    let caption = text![
        "The navigated pose, relative to the object of the last fix, at every frame that has one. Tried, fixed: frames at which a fix was due, and those with one; lost: frames to which the odometry knew no motion. The last three columns: the first fix, carried along by odometry alone, until that is lost or the dive ends."
    ];
    let mut above = results::blank(summary, 5);
    above.extend([Head::over(4, "position error (mm)"), Head::over(1, "TRE (mm)"), Head::over(1, "NEES")]);
    above.push(Head::over(3, "without further fixes: position error (mm)"));
    let mut below = results::heads(summary);
    below.extend(["frames", "with pose", "tried", "fixed", "lost"].map(Head::numbers));
    below.extend(["rms", "median", "p95", "most"].map(Head::numbers));
    below.extend(["p95", "mean", "median", "p95", "at the end"].map(Head::numbers));
    let mut table = Table { id: "navigation".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        if !sails(trial) {
            continue;
        }
        let mut line = results::cells(row);
        for counted in [Counted::NavigationQuantity, Counted::Navigated, Counted::Tried, Counted::Fix, Counted::Lost] {
            line.push(count(trial, counted).into());
        }
        for name in ["rms", "median", "q95", "greatest"] {
            line.push(statistic(trial, name, NavigationQuantity::Position, Unit::Millimetres).into());
        }
        line.push(statistic(trial, "q95", NavigationQuantity::Tre, Unit::Millimetres).into());
        line.push(statistic(trial, "mean", NavigationQuantity::Nees, Unit::Plain).into());
        for name in ["median", "q95", "last"] {
            line.push(statistic(trial, name, NavigationQuantity::AlonePosition, Unit::Millimetres).into());
        }
        table.line(results::breaks(summary, index), line);
    }
    let figure = super::figures::sawtooth(run).map(Block::Figure);
    let saw = saw(run, summary).map(Block::Table);
    Some(Section::new("Navigation").with([Block::Table(table)]).with(figure).with(saw))
}

/// How the error grows between fixes; nothing where no trial has a stretch without them, or truth.
fn saw(run: &Run, summary: &RunSummary) -> Option<Table> {
    let caption = text![
        "The teeth of the saw: stretches from a fix to the last frame before the next, before the pose is lost or the dive ends. Amplitude: the greatest error (m3, position) of a tooth less the one at its fix. Drift: how far the error moved, as a vector in the frame of the object, from the fix to the end of the tooth; the sum of all teeth by their way, that of the camera by the truth, and by their time."
    ];
    let mut above = results::blank(summary, 3);
    above.extend([Head::over(3, "amplitude (mm)"), Head::over(2, "drift")]);
    let mut below = results::heads(summary);
    below.extend(["intervals", "path (m)", "time (s)", "median", "p95", "most", "mm/m", "mm/s"].map(Head::numbers));
    let mut table = Table { id: "saw".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let fix_intervals = fix_intervals(
            trial.sample().filter_map(|frame| frame.navigated.as_ref()).map(|navigated| navigated.step.as_ref()),
        );
        if fix_intervals.is_empty() {
            continue;
        }
        let as_number = |what: &str, value: Option<f64>, (unit, decimals): (Unit, usize)| {
            let suffix = if unit == Unit::Millimetres { " in mm" } else { "" };
            let key = Key::of(trial, "/referencing/frame", format!("teeth {what} of navigated{suffix}"));
            Number::new(value.map(|value| value * unit.scale()), decimals, key)
        };
        let mut line = results::cells(row);
        line.push(as_number("count", Some(fix_intervals.len() as f64), (Unit::Plain, 0)).into());
        line.push(
            as_number(
                "path-length",
                Some(fix_intervals.iter().map(|fix_interval| fix_interval.path_length).sum()),
                (Unit::Plain, 1),
            )
            .into(),
        );
        line.push(
            as_number(
                "seconds",
                Some(fix_intervals.iter().map(|fix_interval| fix_interval.seconds).sum()),
                (Unit::Plain, 1),
            )
            .into(),
        );
        let mut amplitudes: Vec<f64> = fix_intervals.iter().map(|fix_interval| fix_interval.amplitude).collect();
        for (name, p) in [("median", 0.5), ("q95", 0.95), ("greatest", 1.0)] {
            let value = seafix_evaluation::quantile(&mut amplitudes, p);
            line.push(as_number(&format!("{name} amplitude"), Some(value), (Unit::Millimetres, 1)).into());
        }
        line.push(
            as_number(
                "drift-per-metre",
                drift(&fix_intervals, |fix_interval| fix_interval.path_length),
                (Unit::Millimetres, 2),
            )
            .into(),
        );
        line.push(
            as_number(
                "drift-per-second",
                drift(&fix_intervals, |fix_interval| fix_interval.seconds),
                (Unit::Millimetres, 2),
            )
            .into(),
        );
        table.line(results::breaks(summary, index), line);
    }
    (!table.lines.is_empty()).then_some(table)
}

/// A sentence a trial that navigates; `name` says what the trial at a place is called. That it is one dive is said once.
pub(super) fn sentences(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let trials = run.trials.iter().enumerate().filter(|(_, trial)| sails(trial));
    let sentence = |(index, trial): (usize, &Trial)| {
        let metres = |name: &str, quantity| statistic(trial, name, quantity, Unit::Millimetres);
        text![
            format!("{}: the camera’s position, relative to the object of its last fix, errs by ", name(index)),
            metres("rms", NavigationQuantity::Position),
            " mm (RMS) and by ",
            metres("last", NavigationQuantity::Position),
            " mm at the last of the ",
            count(trial, Counted::Navigated),
            " frames with a pose of ",
            count(trial, Counted::NavigationQuantity),
            ", by less than ",
            metres("q95", NavigationQuantity::Position),
            " mm in 95 % of them and at most by ",
            metres("greatest", NavigationQuantity::Position),
            " mm, with fixes at ",
            count(trial, Counted::Fix),
            " frames (due by the policy at ",
            count(trial, Counted::Tried),
            "); the first fix, carried on by odometry alone over ",
            reached(trial),
            " frames, until it is lost or the dive ends, errs by ",
            metres("rms", NavigationQuantity::AlonePosition),
            " mm (RMS) and by ",
            metres("last", NavigationQuantity::AlonePosition),
            " mm at the last of them; the mean NEES is ",
            statistic(trial, "mean", NavigationQuantity::Nees, Unit::Plain),
            " (6 for an honest covariance)."
        ]
    };
    let mut said: Vec<Text> = trials.map(sentence).collect();
    if said.len() > 1 {
        said.extend(min(run, name));
        said.push(text!["Each of these is one dive: how much another would differ is not in these numbers."]);
    }
    said.extend(displaced(run, name));
    said
}

/// Which trial errs least, where all that navigate know as many poses.
fn min(run: &Run, name: &dyn Fn(usize) -> String) -> Option<Text> {
    let rms = |trial: &Trial| -> (usize, f64) {
        let errors = trial.sample().filter_map(|frame| frame.navigated.as_ref()?.get(NavigationQuantity::Position));
        let (n, square) = errors.fold((0, 0.0), |(n, sum), error| (n + 1, sum + error * error));
        (n, (square / n as f64).sqrt())
    };
    let all: Vec<(usize, &Trial)> = run.trials.iter().enumerate().filter(|(_, trial)| sails(trial)).collect();
    let known: Vec<(usize, f64)> = all.iter().map(|(_, trial)| rms(trial)).collect();
    let comparable = known.iter().all(|(n, rms)| *n == known[0].0 && rms.is_finite());
    let min = (0..all.len()).min_by(|&a, &b| known[a].1.total_cmp(&known[b].1)).filter(|_| comparable)?;
    let (index, trial) = all[min];
    let rms = statistic(trial, "rms", NavigationQuantity::Position, Unit::Millimetres);
    Some(text![format!("Of these, {} errs least: ", name(index)), rms, " mm (RMS)."])
}

/// Which objects each trial told to stand elsewhere than surveyed, where any did: in the words of its log, the first time.
fn displaced(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let as_number = |trial: &Trial| -> Vec<String> {
        let mut objects: Vec<&str> = Vec::new();
        let mut as_number = Vec::new();
        for frame in trial.sample() {
            for event in frame.navigated.iter().flat_map(|navigated| &navigated.displaced) {
                let object = event.split(" stands ").next().unwrap_or(event);
                if !objects.contains(&object) {
                    objects.push(object);
                    as_number.push(format!("at frame {}, “{event}”", frame.number));
                }
            }
        }
        as_number
    };
    let all: Vec<(usize, Vec<String>)> = run
        .trials
        .iter()
        .enumerate()
        .filter(|(_, trial)| sails(trial))
        .map(|(index, trial)| (index, as_number(trial)))
        .collect();
    if all.iter().all(|(_, as_number)| as_number.is_empty()) {
        return Vec::new();
    }
    let sentence = |(index, as_number): (usize, Vec<String>)| {
        let what = if as_number.is_empty() {
            "that no object stands elsewhere than surveyed".to_owned()
        } else {
            as_number.join("; ")
        };
        text![format!("{}: the navigator told {}.", name(index), what)]
    };
    all.into_iter().map(sentence).collect()
}

/// How many frames the first fix is carried on to by odometry alone.
fn reached(trial: &Trial) -> Number {
    let known = trial.sample().filter_map(|frame| frame.navigated.as_ref()?.get(NavigationQuantity::AlonePosition));
    let reached = known.count() as f64;
    phrases::navigated(trial, "sampled", NavigationQuantity::AlonePosition, Some(reached), (Unit::Plain, 0))
}

fn count(trial: &Trial, counted: Counted) -> Number {
    let n =
        trial.sample().filter_map(|frame| frame.navigated.as_ref()).filter(|navigated| navigated.is(counted)).count();
    Number::count(n, Key::of(trial, "/referencing/frame", format!("count {}", counted.name())))
}

fn statistic(trial: &Trial, name: &str, quantity: NavigationQuantity, unit: Unit) -> Number {
    let mut values: Vec<f64> = trial.sample().filter_map(|frame| frame.navigated.as_ref()?.get(quantity)).collect();
    let n = values.len() as f64;
    let value = match name {
        "last" => values.last().copied(),
        "greatest" => values.iter().copied().reduce(f64::max),
        _ if values.is_empty() => None,
        "mean" => Some(values.iter().sum::<f64>() / n),
        "rms" => Some((values.iter().map(|v| v * v).sum::<f64>() / n).sqrt()),
        "median" => Some(seafix_evaluation::quantile(&mut values, 0.5)),
        _ => Some(seafix_evaluation::quantile(&mut values, 0.95)),
    };
    phrases::navigated(trial, name, quantity, value, (unit, 1))
}
