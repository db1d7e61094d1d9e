//! The section on inspection: the error of the points of interest.

use crate::{
    content::{
        conditions::columns,
        phrases::{self, Unit},
    },
    document::{Block, Head, Section, Table, Text, text},
    format::distinct,
    number::{Key, Number},
    points_of_interest::PoiQuantity,
    proportion,
    run::{Run, Trial},
    summary::RunSummary,
};

/// The topic of the numbers.
const TOPIC: &str = "/metrics/inspection";

/// The section; `None` where no point of interest comes into view.
pub(crate) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    let seen = |trial: &Trial| distinct(trial.views().map(|point| trial.point(point).to_owned()));
    if run.trials.iter().all(|trial| trial.views().next().is_none()) {
        return None;
    }
    let caption = text![
        "Error of each point of interest in the frame of the left camera: the estimated position (by the navigated pose, or by the frame’s fix without navigation) against the true one. Points of other objects than that of the pose are placed by the survey. In view: frames with the point inside both images; occlusion is not considered. With a pose: frames at which the vehicle has a pose; the errors are over these. NEES: 3 for a consistent covariance."
    ];
    let mut above = columns::blank(summary, 1);
    above.extend([
        Head::over(2, "frames"),
        Head::over(1, "range (m)"),
        Head::over(3, "error (mm)"),
        Head::over(1, "NEES"),
    ]);
    let mut below = columns::heads(summary);
    below.push(Head::words("point"));
    below.extend(["in view", "with a pose", "median", "median", "p95", "max", "mean"].map(Head::numbers));
    let mut table = Table { id: "inspection".to_owned(), caption, heads: vec![above, below], lines: Vec::new() };
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let mut names = seen(trial);
        names.sort();
        for (place, name) in names.iter().enumerate() {
            let own = || trial.views().filter(|point| trial.point(point) == name);
            let count = Key::of(trial, TOPIC, format!("count views at the point {name}"));
            let mut line = columns::cells(row);
            line.push(name.clone().into());
            line.push(Number::count(own().count(), count).into());
            let all = |quantity| own().filter_map(move |point| point.get(quantity)).collect::<Vec<f64>>();
            let message = |statistic, quantity, unit, decimals| {
                number(trial, name, statistic, quantity, all(quantity), (unit, decimals))
            };
            line.push(message("sampled", PoiQuantity::Error, Unit::Plain, 0).into());
            line.push(message("median", PoiQuantity::Range, Unit::Plain, 2).into());
            for statistic in ["median", "q95", "greatest"] {
                line.push(message(statistic, PoiQuantity::Error, Unit::Millimetres, 1).into());
            }
            line.push(message("mean", PoiQuantity::Nees, Unit::Plain, 1).into());
            table.line(place == 0 && columns::breaks(summary, index), line);
        }
    }
    Some(Section::new("Inspection").with([Block::Table(table)]))
}

/// One sentence for every inspection: the points of interest with the smallest and the largest median error.
///
/// `name` gives the name of the trial at an index.
pub(crate) fn sentences(run: &Run, name: &dyn Fn(usize) -> String) -> Vec<Text> {
    let trials = run.trials.iter().enumerate().filter(|(_, trial)| inspects(trial));
    let sentence = |(index, trial): (usize, &Trial)| {
        let as_number = |point: &str| {
            let of = |statistic| error(trial, point, statistic);
            let views = number(trial, point, "sampled", PoiQuantity::Error, errors(trial, point), (Unit::Plain, 0));
            text![of("median"), " mm (median; ", of("q95"), " mm in 95 % of ", views, " views)"]
        };
        let [best, worst] = extremes(trial)?;
        let mut message =
            text![format!("{}: errors of the points of interest are smallest at {best} with ", name(index))];
        message.extend(as_number(&best));
        message.push(format!(", and largest at {worst} with ").into());
        message.extend(as_number(&worst));
        message.push(".".into());
        Some(message)
    };
    trials.filter_map(sentence).collect()
}

/// Whether the vehicle of a trial inspects points of interest.
pub(crate) fn inspects(trial: &Trial) -> bool {
    trial.header.configuration.contains("kind = \"inspection\"")
}

/// The points of interest in view of any frame.
pub(crate) fn points(trial: &Trial) -> Vec<String> {
    distinct(trial.views().map(|point| trial.point(point).to_owned()))
}

/// The points of interest with the smallest and the largest median error; `None` for fewer than two.
pub(crate) fn extremes(trial: &Trial) -> Option<[String; 2]> {
    let points = points(trial);
    let median = |point: &String| {
        let mut errors = errors(trial, point);
        (!errors.is_empty()).then(|| seafix_evaluation::quantile(&mut errors, 0.5))
    };
    let mut known: Vec<(f64, &String)> = points.iter().filter_map(|point| Some((median(point)?, point))).collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(b.1)));
    let [(_, best), .., (_, worst)] = known[..] else { return None };
    Some([best.clone(), worst.clone()])
}

/// The median error at one point of interest (mm), and the ends of its 95 % interval.
pub(crate) fn median(trial: &Trial, point: &str) -> [Number; 3] {
    let interval = proportion::median_interval(proportion::is_trajectory(&trial.header), &mut errors(trial, point));
    // Medians of few tenths of a millimetre need two decimals to differ from the ends of their intervals.
    let unit = (Unit::Millimetres, 2);
    let of = |name: &str, value| phrases::poi(trial, name, (PoiQuantity::Error, point), value, unit);
    [
        number(trial, point, "median", PoiQuantity::Error, errors(trial, point), unit),
        of("median-low", interval.map(|ends| ends.0)),
        of("median-high", interval.map(|ends| ends.1)),
    ]
}

/// A statistic of the error at one point of interest (mm).
fn error(trial: &Trial, point: &str, statistic: &str) -> Number {
    number(trial, point, statistic, PoiQuantity::Error, errors(trial, point), (Unit::Millimetres, 1))
}

/// The errors of all views of one point of interest (m).
fn errors(trial: &Trial, point: &str) -> Vec<f64> {
    let own = trial.views().filter(|seen| trial.point(seen) == point);
    own.filter_map(|seen| seen.get(PoiQuantity::Error)).collect()
}

/// A statistic of a quantity of one point of interest.
fn number(
    trial: &Trial,
    point: &str,
    statistic: &str,
    quantity: PoiQuantity,
    mut values: Vec<f64>,
    (unit, decimals): (Unit, usize),
) -> Number {
    let n = values.len();
    let value = match statistic {
        "sampled" => Some(n as f64),
        "greatest" => values.iter().copied().reduce(f64::max),
        _ if n == 0 => None,
        "mean" => Some(values.iter().sum::<f64>() / n as f64),
        "median" => Some(seafix_evaluation::quantile(&mut values, 0.5)),
        _ => Some(seafix_evaluation::quantile(&mut values, 0.95)),
    };
    phrases::poi(trial, statistic, (quantity, point), value, (unit, decimals))
}
