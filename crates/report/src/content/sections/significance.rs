//! The section on significance: paired comparisons of trials with tests and intervals.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    content::phrases,
    document::{Block, Cell, Figure, Head, Section, Span, Table, Text, text},
    figure::{Axis, Chart, Layer, Panel},
    format::{decimals, quoted},
    number::{Key, Number},
    paired::{Comparison, MARGIN, MARGIN_RATIO},
    run::{Run, Trial},
};

pub(crate) fn section(run: &Run, comparisons: &[Comparison]) -> Option<Section> {
    if comparisons.is_empty() {
        return None;
    }
    let sure = comparisons.iter().filter(|comparison| comparison.better().is_some()).count();
    let alike = comparisons.iter().filter(|comparison| comparison.equivalent() == Some(true)).count();
    let mut section = Section::new("Significance");
    section.say(text![format!(
        "{} comparison{}: {} significant{}. {} mean that the first has the smaller error. An effect of 1 means a smaller error in every pair, −1 in no pair.{}",
        comparisons.len(),
        if comparisons.len() == 1 { "" } else { "s" },
        match sure {
            0 => "none is".to_owned(),
            1 => "one is".to_owned(),
            _ => format!("{sure} are"),
        },
        match comparisons.len() - sure {
            0 => String::new(),
            rest => {
                let shown = match alike {
                    0 => "none shows".to_owned(),
                    1 => "one shows".to_owned(),
                    n if n == rest => "all show".to_owned(),
                    n => format!("{n} show"),
                };
                format!("; among the {rest} that {} not, {shown} equivalence {}", if rest == 1 { "is" } else { "are" }, margin(comparisons))
            }
        },
        if comparisons[0].over_conditions { "Ratios below one" } else { "Negative differences" },
        if with_the_first_alone(comparisons) { " Each trial is compared with the first only, because a table of all pairs would be too long." } else { "" }
    )]);
    section.add(Block::Table(table(run, comparisons)));
    section.blocks.extend(forest(run, comparisons).map(Block::Figure));
    Some(section)
}

/// The margin of equivalence, in words.
pub(crate) fn margin(comparisons: &[Comparison]) -> String {
    match comparisons.first() {
        Some(first) if first.over_conditions => format!("within a factor of {MARGIN_RATIO}"),
        _ => format!("within {} mm", MARGIN * 1e3),
    }
}

/// Whether the members of some group are compared with its first member only.
fn with_the_first_alone(comparisons: &[Comparison]) -> bool {
    let mut firsts: BTreeMap<&str, (BTreeSet<&str>, BTreeSet<&str>)> = BTreeMap::new();
    for comparison in comparisons {
        let (firsts, seconds) = firsts.entry(&comparison.condition).or_default();
        firsts.insert(&comparison.names[0]);
        seconds.insert(&comparison.names[1]);
    }
    firsts.values().any(|(firsts, seconds)| firsts.len() == 1 && seconds.len() > 1)
}

/// The sentences on the `max` most significant differences, or one sentence that none is significant.
pub(crate) fn sentences(run: &Run, comparisons: &[Comparison], max: usize) -> Vec<Text> {
    let mut sure: Vec<&Comparison> = comparisons.iter().filter(|c| c.better().is_some()).collect();
    sure.sort_by(|a, b| a.holm.total_cmp(&b.holm));
    if sure.is_empty() && !comparisons.is_empty() {
        let what = if comparisons[0].between_conditions { "Frame by frame" } else { "On the same attempts" };
        return vec![text![format!("{what}, no difference of the TRE is significant.")]];
    }
    let as_number =
        |comparison: &Comparison| match comparison.difference.is_finite() && comparison.interval.0.is_finite() {
            true if comparison.interval.1.is_finite() => sentence(run, comparison),
            _ => sentence_of_failures(run, comparison),
        };
    sure.into_iter().take(max).map(as_number).collect()
}

/// The sentence on the number of significant differences beyond the first `max`; `None` without any.
pub(crate) fn others(comparisons: &[Comparison], max: usize) -> Option<Text> {
    let more = comparisons.iter().filter(|comparison| comparison.better().is_some()).count().checked_sub(max + 1)? + 1;
    let are = if more == 1 { "difference is" } else { "differences are" };
    Some(text![format!("{more} more {are} significant; the table of comparisons lists all.")])
}

/// The sentence on a comparison with an infinite difference or interval.
///
/// One of the trials often fails then.
fn sentence_of_failures(run: &Run, comparison: &Comparison) -> Text {
    let [first, second] = &comparison.names;
    let first_is_better = comparison.better() == Some(comparison.first);
    let [better, worse] = if first_is_better { [first, second] } else { [second, first] }.map(|name| quoted(name));
    let as_number = |what: &str, n: usize| Number::new(Some(n as f64), 0, key(run, comparison, what));
    let [own, other] = comparison.alone;
    let alone = [as_number("alone-first", own), as_number("alone-second", other)];
    let counts = if first_is_better { (alone, other) } else { ([alone[1].clone(), alone[0].clone()], own) };
    let ([of_better, of_worse], count_of_worse) = counts;
    let mut message = text![
        format!(
            "{}, errors are smaller or failures fewer with {better} than with {worse}, a significant difference: in ",
            begin(comparison)
        ),
        of_better,
        " of ",
        as_number("pairs", comparison.n),
        format!(" pairs there is a fix only with {better}, in ")
    ];
    match count_of_worse {
        0 => message.push("none".into()),
        _ => message.extend(text![of_worse]),
    }
    message.push(format!(" only with {worse}.").into());
    message
}

fn begin(comparison: &Comparison) -> String {
    match comparison.condition.as_str() {
        "" if comparison.over_conditions => "Over the conditions".to_owned(),
        "" if comparison.between_conditions => "Frame by frame".to_owned(),
        "" => "On the same attempts".to_owned(),
        condition => format!("At {condition}, on the same attempts"),
    }
}

fn sentence(run: &Run, comparison: &Comparison) -> Text {
    let over = comparison.over_conditions;
    let real = |value: f64| if over { value.exp() } else { value * 1e3 };
    let as_number =
        |what: &str, value: f64| Number::new(Some(real(value)), if over { 3 } else { 2 }, key(run, comparison, what));
    let [first, second] = &comparison.names;
    let begin = begin(comparison);
    let (what, sign) = if over { ("the median TRE ratio", "/") } else { ("the median TRE difference", "−") };
    text![
        format!("{begin}, {what} {first} {sign} {second} is "),
        as_number("difference", comparison.difference),
        if over { " [" } else { " mm [" },
        as_number("difference-low", comparison.interval.0),
        ", ",
        as_number("difference-high", comparison.interval.1),
        if over {
            "] (95 % bootstrap interval over conditions)."
        } else {
            "] (95 % bootstrap interval over blocks of frames)."
        }
    ]
}

/// The key of a number of a comparison.
fn key(run: &Run, comparison: &Comparison, what: &str) -> Key {
    let trials: Vec<&Trial> = comparison.logs.iter().map(|&index| &run.trials[index]).collect();
    let over = if comparison.over_conditions { " over conditions" } else { " over attempts" };
    phrases::over(&trials, "/metrics/evaluation", format!("{what} tre_rms{over}"))
}

fn table(run: &Run, comparisons: &[Comparison]) -> Table {
    let over = comparisons[0].over_conditions;
    let digits = decimals(comparisons.iter().map(|c| c.difference.abs() * 1e3));
    let (scale, digits) = if over { (1.0, 3) } else { (1e3, digits.min(3)) };
    let head = if over { "first / second" } else { "first − second (mm)" };
    let within = if over { format!("within {MARGIN_RATIO}×") } else { format!("within {} mm", MARGIN * 1e3) };
    let caption = text![if over {
        "Methods compared over n conditions: median ratio of the median TRE over all attempts, with its 95 % interval; rank-biserial effect (+: the first has the smaller error); Holm-adjusted p of the signed rank test. The last column applies to differences that are not significant: whether equivalence is shown, and the factor that contains the 90 % interval. Bold: significant."
    } else {
        "Paired comparisons on the same attempts: median difference of the TRE (first − second) over pairs that do not both fail, with its 95 % interval; rank-biserial effect (+: the first has the smaller error, 1: in every pair); Holm-adjusted p of the signed rank test. Only one: pairs in which only the first, or only the second, has a fix; McNemar’s p is not adjusted. The last column applies to differences that are not significant: whether equivalence is shown, and the margin (mm) that contains the 90 % interval; McNemar’s test must show no difference either. Bold: significant."
    }];
    let mut heads = vec![Head::words("Condition"), Head::words("first"), Head::words("second"), Head::numbers("n")];
    heads.extend([
        Head::numbers(head),
        Head::numbers("interval"),
        Head::numbers("effect (+: first smaller)"),
        Head::numbers("p (Holm)"),
    ]);
    if over {
        heads.remove(0);
    } else {
        heads.extend([Head::numbers("only one"), Head::numbers("p (McNemar)")]);
    }
    heads.push(Head::numbers(within));
    let mut table = Table::new("comparisons", caption, heads);
    let mut before = None;
    for comparison in comparisons {
        let as_number =
            |what: &str, value: f64, decimals| Number::new(Some(value), decimals, key(run, comparison, what));
        let real = |value: f64| if over { value.exp() } else { value * scale };
        let difference = as_number("difference", real(comparison.difference), digits);
        let (low, high) = comparison.interval;
        let ends = [as_number("difference-low", real(low), digits), as_number("difference-high", real(high), digits)];
        let [low, high] = ends;
        let first = before != Some(&comparison.condition);
        let mut line: Vec<Cell> = Vec::new();
        if !over {
            line.push(if first { comparison.condition.clone() } else { String::new() }.into());
        }
        line.extend([comparison.names[0].clone().into(), comparison.names[1].clone().into()]);
        line.push(as_number("pairs", comparison.n as f64, 0).into());
        line.push(if comparison.better().is_some() { Span::Best(difference).into() } else { difference.into() });
        line.push(Cell { text: text!["[", low, ", ", high, "]"], minor: true, ..Cell::default() });
        line.push(as_number("effect", comparison.effect, 2).into());
        line.push(holm(run, comparisons, comparison).into());
        if !over {
            let alone = [("alone-first", comparison.alone[0]), ("alone-second", comparison.alone[1])];
            let [a, b] = alone.map(|(what, n)| as_number(what, n as f64, 0));
            line.push(Cell { text: text![a, "/", b], ..Cell::default() });
            line.push(Number::probability(comparison.mcnemar, key(run, comparison, "mcnemar")).into());
        }
        line.push(match comparison.margin.zip(comparison.equivalent()) {
            None => "".into(),
            Some((margin, shown)) => {
                let margin = as_number("margin", real(margin), if over { 3 } else { digits.max(2) });
                Cell { text: text![if shown { "yes, " } else { "not shown, " }, margin], ..Cell::default() }
            }
        });
        table.line(first && before.is_some(), line);
        before = Some(&comparison.condition);
    }
    table
}

/// The Holm-adjusted p; its key names the logs of the complete family, those of this comparison first.
fn holm(run: &Run, comparisons: &[Comparison], own: &Comparison) -> Number {
    let others = comparisons.iter().filter(|other| other.names != own.names || other.condition != own.condition);
    let family: Vec<usize> = own.logs.iter().chain(others.flat_map(|other| &other.logs)).copied().collect();
    let trials: Vec<&Trial> = family.iter().map(|&index| &run.trials[index]).collect();
    let over = if own.over_conditions { "conditions" } else { "attempts" };
    let what = format!("holm tre_rms over {over} in families of {}", own.logs.len());
    Number::probability(own.holm, phrases::over(&trials, "/metrics/evaluation", what))
}

/// The forest plot of the intervals; `None` for fewer than two comparisons or more than fit.
fn forest(run: &Run, comparisons: &[Comparison]) -> Option<Figure> {
    if comparisons.len() < 2 || comparisons.len() > 40 {
        return None;
    }
    let over = comparisons[0].over_conditions;
    let real = |value: f64| if over { value.exp() } else { value * 1e3 };
    let n = comparisons.len();
    let place = |index: usize| (n - 1 - index) as f64;
    let name = |c: &Comparison| {
        let condition = if c.condition.is_empty() { String::new() } else { format!("{}: ", c.condition) };
        format!("{condition}{} – {}", c.names[0], c.names[1])
    };
    let names = comparisons.iter().rev().map(name);
    let finite =
        |index: usize| [comparisons[index].interval.0, comparisons[index].interval.1].iter().all(|v| v.is_finite());
    let seen = || (0..n).filter(|&index| finite(index));
    let of = |sure: bool| {
        let own: Vec<usize> = seen().filter(|&index| comparisons[index].better().is_some() == sure).collect();
        let spans = own.iter().map(|&index| {
            let c = &comparisons[index];
            [place(index), real(c.interval.0), real(c.interval.1)]
        });
        let marks = own.iter().map(|&index| [real(comparisons[index].difference), place(index)]);
        let series = if sure { 1 } else { 6 };
        [
            Layer::Spans { series, values: spans.collect() },
            Layer::Marks { series, points: marks.collect(), radius: 2.0 },
        ]
    };
    let none = if over { 1.0 } else { 0.0 };
    let zero = Layer::Guide { points: vec![[none, -0.5], [none, n as f64 - 0.5]], note: String::new(), dash: 0 };
    let label = if over { "ratio of the median TRE" } else { "median TRE difference (mm)" };
    let panel = Panel {
        x: if over { Axis::logarithmic(label) } else { Axis::linear(label) },
        y: Axis { range: Some([-0.6, n as f64 - 0.4]), ..Axis::named("", names.collect()) },
        layers: [zero].into_iter().chain(of(false)).chain(of(true)).collect(),
        ..Panel::default()
    };
    let shape = ((n as f64 * 11.0 + 34.0) / 482.0).clamp(0.14, 1.1);
    let chart = Chart { panels: vec![panel], columns: 1, page: true, shape, legend: Vec::new() };
    let heads = [Head::words("comparison"), Head::numbers("difference"), Head::numbers("low"), Head::numbers("high")];
    let mut data = Table::new("forest", text!["The data of the figure of comparisons."], heads.to_vec());
    for comparison in comparisons {
        let as_number = |what: &str, value: f64| Number::new(Some(real(value)), 4, key(run, comparison, what)).into();
        let name = name(comparison);
        let (low, high) = comparison.interval;
        data.line(
            false,
            vec![
                name.into(),
                as_number("difference", comparison.difference),
                as_number("difference-low", low),
                as_number("difference-high", high),
            ],
        );
    }
    let caption = text![
        "Comparisons with their 95 % intervals. Coloured squares are significant after Holm’s adjustment, grey ones are not. Left of the line the first has the smaller error."
    ];
    Some(Figure { id: "forest".to_owned(), caption, drawing: chart.draw()?, data })
}
