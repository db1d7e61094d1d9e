//! The section on navigation: the error of the navigated pose from fix to fix.

use seafix_log::displaced_object;

use crate::{
    content::{
        conditions::columns,
        figures::sawtooth,
        phrases::{self, Unit},
    },
    document::{Block, Head, Section, Table, Text, text},
    fix_intervals::{drift, extreme_drifts, fix_intervals},
    navigation_quantity::{Counted, NavigationQuantity},
    number::{Key, Number},
    rms,
    run::{Run, Trial},
    summary::RunSummary,
};

/// Whether a trial has a navigator.
pub(crate) fn navigates(trial: &Trial) -> bool {
    trial.sample().any(|frame| frame.navigated.is_some())
}

/// The section; `None` where no trial has a navigator.
pub(crate) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    if !run.trials.iter().any(navigates) {
        return None;
    }
    let caption = text![
        "Error of the navigated pose relative to the object of the last fix, over all frames with a pose. Fix due: frames at which the policy asked for a fix. Fixes: frames with a fix. Lost: frames without an odometry step. The last three columns show odometry alone from the first fix until it is lost or the dive ends."
    ];
    let mut above = columns::blank(summary, 5);
    above.extend([Head::over(4, "position error (mm)"), Head::over(1, "TRE (mm)"), Head::over(1, "NEES")]);
    above.push(Head::over(3, "odometry only: position error (mm)"));
    let mut below = columns::heads(summary);
    below.extend(["frames", "with pose", "fix due", "fixes", "lost"].map(Head::numbers));
    below.extend(["RMS", "median", "p95", "max"].map(Head::numbers));
    below.extend(["p95", "mean", "median", "p95", "at the end"].map(Head::numbers));
    let mut table = Table { id: "navigation".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        if !navigates(trial) {
            continue;
        }
        let mut line = columns::cells(row);
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
        table.line(columns::breaks(summary, index), line);
    }
    let figure = sawtooth::figure(run).map(Block::Figure);
    let saw = saw(run, summary).map(Block::Table);
    Some(Section::new("Navigation").with([Block::Table(table)]).with(figure).with(saw))
}

/// The table of error growth between fixes; `None` without fix intervals or without ground truth.
fn saw(run: &Run, summary: &RunSummary) -> Option<Table> {
    let caption = text![
        "Error growth between fixes. A fix interval runs from a fix to the last frame before the next fix, before the pose is lost, or before the dive ends. Amplitude: the largest position error of an interval less the error at its fix. Drift: the length of the change of the error vector over an interval, in the object’s frame; the sum over all intervals is divided by the camera’s true path length and by time."
    ];
    let mut above = columns::blank(summary, 3);
    above.extend([Head::over(3, "amplitude (mm)"), Head::over(2, "drift")]);
    let mut below = columns::heads(summary);
    below.extend(["intervals", "path (m)", "time (s)", "median", "p95", "max", "mm/m", "mm/s"].map(Head::numbers));
    let mut table = Table { id: "saw".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let fix_intervals = fix_intervals(
            trial.sample().filter_map(|frame| frame.navigated.as_ref()).map(|navigated| navigated.step.as_ref()),
        );
        if fix_intervals.is_empty() {
            continue;
        }
        let number = |what: &str, value: Option<f64>, (unit, decimals): (Unit, usize)| {
            let suffix = if unit == Unit::Millimetres { " in mm" } else { "" };
            let key = Key::of(trial, "/referencing/frame", format!("intervals {what} of navigated{suffix}"));
            Number::new(value.map(|value| value * unit.scale()), decimals, key)
        };
        let mut line = columns::cells(row);
        line.push(number("count", Some(fix_intervals.len() as f64), (Unit::Plain, 0)).into());
        line.push(
            number(
                "path-length",
                Some(fix_intervals.iter().map(|fix_interval| fix_interval.path_length).sum()),
                (Unit::Plain, 1),
            )
            .into(),
        );
        line.push(
            number(
                "seconds",
                Some(fix_intervals.iter().map(|fix_interval| fix_interval.seconds).sum()),
                (Unit::Plain, 1),
            )
            .into(),
        );
        let mut amplitudes: Vec<f64> = fix_intervals.iter().map(|fix_interval| fix_interval.amplitude).collect();
        for (name, p) in [("median", 0.5), ("q95", 0.95), ("greatest", 1.0)] {
            let value = seafix_evaluation::quantile(&mut amplitudes, p);
            line.push(number(&format!("{name} amplitude"), Some(value), (Unit::Millimetres, 1)).into());
        }
        line.push(
            number(
                "drift-per-metre",
                drift(&fix_intervals, |fix_interval| fix_interval.path_length),
                (Unit::Millimetres, 2),
            )
            .into(),
        );
        line.push(
            number(
                "drift-per-second",
                drift(&fix_intervals, |fix_interval| fix_interval.seconds),
                (Unit::Millimetres, 2),
            )
            .into(),
        );
        table.line(columns::breaks(summary, index), line);
    }
    (!table.lines.is_empty()).then_some(table)
}

/// The sentences on trials with a navigator, one for each.
///
/// `name` gives the name of the trial at an index.
pub(crate) fn sentences(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let trials = run.trials.iter().enumerate().filter(|(_, trial)| navigates(trial));
    let sentence = |(index, trial): (usize, &Trial)| {
        let metres = |name: &str, quantity| statistic(trial, name, quantity, Unit::Millimetres);
        text![
            format!("{}: the camera position error relative to the object of the last fix is ", name(index)),
            metres("rms", NavigationQuantity::Position),
            " mm RMS (",
            metres("last", NavigationQuantity::Position),
            " mm at the last of the ",
            count(trial, Counted::Navigated),
            " frames with a pose, of ",
            count(trial, Counted::NavigationQuantity),
            " frames), below ",
            metres("q95", NavigationQuantity::Position),
            " mm in 95 % of these frames and at most ",
            metres("greatest", NavigationQuantity::Position),
            " mm. The dive has ",
            count(trial, Counted::Fix),
            " frames with a fix; the policy asked for one at ",
            count(trial, Counted::Tried),
            " frames. Odometry alone from the first fix, over ",
            reached(trial),
            " frames until it is lost or the dive ends, has a position error of ",
            metres("rms", NavigationQuantity::AlonePosition),
            " mm RMS (",
            metres("last", NavigationQuantity::AlonePosition),
            " mm at the last of them). The mean NEES is ",
            statistic(trial, "mean", NavigationQuantity::Nees, Unit::Plain),
            " (6 for a consistent covariance)."
        ]
    };
    let mut message: Vec<Text> = trials.map(sentence).collect();
    if message.len() > 1 {
        message.extend(min(run, name));
        message.push(text!["Each trial is a single dive; these numbers do not include the variation between dives."]);
    }
    message.extend(displaced(run, name));
    message
}

/// A sentence on the trial with the smallest RMS position error.
///
/// The result is `None` where trials have different numbers of poses.
fn min(run: &Run, name: &dyn Fn(usize) -> String) -> Option<Text> {
    let rms = |trial: &Trial| -> (usize, f64) {
        let errors = trial.sample().filter_map(|frame| frame.navigated.as_ref()?.get(NavigationQuantity::Position));
        let (n, square) = errors.fold((0, 0.0), |(n, sum), error| (n + 1, sum + error * error));
        (n, (square / n as f64).sqrt())
    };
    let all: Vec<(usize, &Trial)> = run.trials.iter().enumerate().filter(|(_, trial)| navigates(trial)).collect();
    let known: Vec<(usize, f64)> = all.iter().map(|(_, trial)| rms(trial)).collect();
    let comparable = known.iter().all(|(n, rms)| *n == known[0].0 && rms.is_finite());
    let min = (0..all.len()).min_by(|&a, &b| known[a].1.total_cmp(&known[b].1)).filter(|_| comparable)?;
    let (index, trial) = all[min];
    let rms = statistic(trial, "rms", NavigationQuantity::Position, Unit::Millimetres);
    Some(text![format!("Smallest camera position error: {}, ", name(index)), rms, " mm RMS."])
}

/// One sentence for every trial on the displaced objects that it reported, if any trial reported one.
///
/// The first event of each object is quoted from the log.
fn displaced(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let first_events = |trial: &Trial| -> Vec<String> {
        let mut objects: Vec<&str> = Vec::new();
        let mut quoted = Vec::new();
        for frame in trial.sample() {
            for event in frame.navigated.iter().flat_map(|navigated| &navigated.displaced) {
                let object = displaced_object(event).unwrap_or(event);
                if !objects.contains(&object) {
                    objects.push(object);
                    quoted.push(format!("at frame {}, “{event}”", frame.number));
                }
            }
        }
        quoted
    };
    let all: Vec<(usize, Vec<String>)> = run
        .trials
        .iter()
        .enumerate()
        .filter(|(_, trial)| navigates(trial))
        .map(|(index, trial)| (index, first_events(trial)))
        .collect();
    if all.iter().all(|(_, quoted)| quoted.is_empty()) {
        return Vec::new();
    }
    let sentence = |(index, quoted): (usize, Vec<String>)| {
        let what = if quoted.is_empty() { "none".to_owned() } else { quoted.join("; ") };
        text![format!("{}: objects reported away from their surveyed pose: {}.", name(index), what)]
    };
    all.into_iter().map(sentence).collect()
}

/// The number of frames with a pose by odometry alone from the first fix.
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

/// The drift between fixes (mm per metre of path), its smallest and its largest value over single fix intervals, and the
/// number of these; `None` for fewer than two fix intervals.
pub(crate) fn drift_per_metre(trial: &Trial) -> Option<[Number; 4]> {
    let steps = trial.sample().filter_map(|frame| frame.navigated.as_ref()).map(|navigated| navigated.step.as_ref());
    let intervals = fix_intervals(steps);
    let all = drift(&intervals, |interval| interval.path_length).filter(|_| intervals.len() > 1)?;
    let [smallest, largest] = extreme_drifts(&intervals)?;
    let number = |what: &str, value: f64, decimals| {
        let key = Key::of(trial, "/referencing/frame", format!("intervals {what} of navigated"));
        Number::new(Some(value), decimals, key)
    };
    let drift = |what: &str, value: f64| {
        let key = Key::of(trial, "/referencing/frame", format!("intervals {what} of navigated in mm"));
        Number::new(Some(value * Unit::Millimetres.scale()), 2, key)
    };
    let count = number("count", intervals.len() as f64, 0);
    Some([
        drift("drift-per-metre", all),
        drift("smallest-drift-per-metre", smallest),
        drift("largest-drift-per-metre", largest),
        count,
    ])
}

/// The root mean square of a quantity over the frames of a part of a trial (mm), with the ends of its 95 % interval.
pub(crate) fn rms(trial: &Trial, quantity: NavigationQuantity, span: [u64; 2]) -> [Number; 3] {
    let interval = rms::over_frames(&over(trial, quantity, span));
    let ends = [("rms-low", interval.map(|ends| ends.0)), ("rms-high", interval.map(|ends| ends.1))];
    let unit = (Unit::Millimetres, 1);
    let [low, high] = ends.map(|(name, value)| phrases::navigated_over(trial, span, name, quantity, value, unit));
    [statistic_over(trial, span, "rms", quantity, Unit::Millimetres), low, high]
}

/// The values of a quantity from the first to the last stamp of a part of a trial (ns).
fn over(trial: &Trial, quantity: NavigationQuantity, [from, to]: [u64; 2]) -> Vec<f64> {
    let frames = trial.sample().filter(|frame| (from..=to).contains(&frame.stamp_ns));
    frames.filter_map(|frame| frame.navigated.as_ref()?.get(quantity)).collect()
}

/// A statistic of a quantity over the frames that have it.
pub(crate) fn statistic(trial: &Trial, name: &str, quantity: NavigationQuantity, unit: Unit) -> Number {
    statistic_over(trial, trial.span(), name, quantity, unit)
}

/// A statistic of a quantity over the frames of a part of a trial that have it.
pub(crate) fn statistic_over(
    trial: &Trial,
    span: [u64; 2],
    name: &str,
    quantity: NavigationQuantity,
    unit: Unit,
) -> Number {
    let mut values = over(trial, quantity, span);
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
    phrases::navigated_over(trial, span, name, quantity, value, (unit, 1))
}
