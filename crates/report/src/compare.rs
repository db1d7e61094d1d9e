//! Comparison of several runs on the same data.

use std::path::{Path, PathBuf};

use seafix_log::Axis;

use crate::{
    content,
    error::ReportError,
    format::{self, distinct},
    forms::Forms,
    origin,
    paired::{self, Comparison},
    print,
    run::{Run, Trial},
    summary::RunSummary,
    terminal::wrapped,
    write::{claim, write},
};

/// The result of a comparison of runs.
#[derive(Debug)]
pub struct Compared {
    /// The results of all runs and their differences, as text for a terminal.
    pub table: String,
    /// The path of the page, if an output folder was given.
    pub page: Option<PathBuf>,
    /// Whether any difference is significant.
    pub differ: bool,
}

/// Compares runs on the same data: equal source, seeds, cameras, site, targets and alert limits.
///
/// A replay has the data of the run whose log it reads, if this log can be read; it is compared with the trials of the
/// same data.
/// `force` compares runs on different data, with a notice. The page is written to `out`, if given. The table has at
/// most `width` columns, if given.
///
/// # Errors
/// [`ReportError::Incomparable`] with the differences, unless `force`; [`ReportError`] when a log cannot be read or the
/// page cannot be written.
pub fn compare(
    folders: &[PathBuf],
    force: bool,
    out: Option<&Path>,
    width: Option<usize>,
) -> Result<Compared, ReportError> {
    let mut runs: Vec<Run> = folders.iter().map(|folder| Run::read(folder)).collect::<Result<_, _>>()?;
    let replays: Vec<bool> = runs.iter_mut().map(origin::restore).collect();
    let names = names(folders);
    let mut forced = String::new();
    for (index, (folder, name)) in folders.iter().zip(&names).enumerate().skip(1) {
        // A replay of one trial has the data of this trial only.
        let [first, other] = match replays[0] || replays[index] {
            true => common(&runs[0], &runs[index]),
            false => [&runs[0], &runs[index]].map(|run| run.trials.iter().collect()),
        };
        let differences = differences(&first, &other);
        if differences.is_empty() {
            continue;
        }
        if !force {
            return Err(ReportError::Incomparable { first: folders[0].clone(), other: folder.clone(), differences });
        }
        let differences = differences.join(", ");
        forced += &format!("{} and {} have different data: {differences}.\n", printed(&names[0]), printed(name));
    }
    let keys = distinct(runs.iter().flat_map(|run| run.header().axes.iter().map(|axis| axis.key.clone())));
    for (run, name) in runs.iter_mut().zip(&names) {
        for trial in &mut run.trials {
            joined(trial, name, &keys);
        }
    }
    let mut run = Run { trials: runs.into_iter().flat_map(|run| run.trials).collect(), joined: true };
    let title = names.join(" and ");
    for trial in &mut run.trials {
        trial.header.title = format!("comparison of {title}");
        trial.header.run.clone_from(&title);
        trial.header.command = format!("seafix compare {}", names.join(" "));
    }
    let summary = RunSummary::of(&run);
    let comparisons = paired::comparisons(&run, &summary);
    let page = out.map(|folder| {
        let document = content::document(&run, &summary, false, None)?;
        claim(folder, "comparison", PAGE)?;
        write(folder, PAGE, print::html(&document, Forms { latex: false, pdf: false, ..Forms::ALL }).as_bytes())
    });
    Ok(Compared {
        table: {
            let results = width.map_or_else(|| summary.to_string(), |width| format!("{summary:width$}"));
            let message =
                [same(&run, &names), forced, lengths(&run, &names, &comparisons), lines(&comparisons)].concat();
            let message: Vec<String> = message.lines().map(|line| wrapped(line, width, 2)).collect();
            format!("{results}\n\n{}\n", message.join("\n"))
        },
        page: page.transpose()?,
        differ: comparisons.iter().any(|comparison| comparison.better().is_some()),
    })
}

/// The file name of the page.
const PAGE: &str = "compare.html";

/// The names of the folders, or their paths if two names are equal.
fn names(folders: &[PathBuf]) -> Vec<String> {
    let name =
        |folder: &PathBuf| folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let short: Vec<String> = folders.iter().map(name).collect();
    let unique = short.iter().all(|one| short.iter().filter(|other| *other == one).count() == 1);
    if unique { short } else { folders.iter().map(|folder| folder.display().to_string()).collect() }
}

/// Gives a trial of a joined run the axes of all runs.
///
/// The first axis is the name of its own run.
fn joined(trial: &mut Trial, name: &str, keys: &[String]) {
    let of = |key: &String| {
        let value = trial.header.axes.iter().find(|axis| axis.key == *key).map(|axis| axis.value.clone());
        Axis { key: key.clone(), value: value.unwrap_or_else(|| "–".to_owned()) }
    };
    let own = keys.iter().map(of);
    let axes = [Axis { key: "run".to_owned(), value: name.to_owned() }].into_iter().chain(own).collect();
    trial.label = format!("{name}/{}", trial.label);
    trial.header.axes = axes;
}

/// The trials of two runs that have partners on the same data; all trials of both if none has.
fn common<'a>(first: &'a Run, other: &'a Run) -> [Vec<&'a Trial>; 2] {
    let data = |run: &Run| run.trials.iter().map(|trial| paired::data(trial, true)).collect::<Vec<_>>();
    let both = [data(first), data(other)];
    let partners = |run: &'a Run, theirs: &[String]| -> Vec<&'a Trial> {
        run.trials.iter().filter(|trial| theirs.contains(&paired::data(trial, true))).collect()
    };
    let found = [partners(first, &both[1]), partners(other, &both[0])];
    if found[0].is_empty() { [first, other].map(|run| run.trials.iter().collect()) } else { found }
}

/// The differences that make two runs incomparable, one line each.
fn differences(first: &[&Trial], other: &[&Trial]) -> Vec<String> {
    let mut found = Vec::new();
    let mut say = |what: &str, own: Vec<String>, its: Vec<String>| {
        let only = |a: &[String], b: &[String]| a.iter().filter(|line| !b.contains(line)).cloned().collect::<Vec<_>>();
        let (left, right) = (only(&own, &its), only(&its, &own));
        if !left.is_empty() || !right.is_empty() {
            let more = left.len().max(right.len()) - 1;
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let show = |lines: &[String]| lines.first().map_or_else(|| "–".to_owned(), String::clone);
            found.push(format!("{what}: {} against {}{more}", show(&left), show(&right)));
        }
    };
    let of =
        |trials: &[&Trial], lines: fn(&Trial) -> Vec<String>| distinct(trials.iter().flat_map(|trial| lines(trial)));
    let mut both = |what: &str, lines: fn(&Trial) -> Vec<String>| say(what, of(first, lines), of(other, lines));
    both("source", |trial| vec![trial.header.source.clone()]);
    both("settings of the source", |trial| {
        let table = trial.header.configuration.parse::<toml::Table>().unwrap_or_default();
        let source = table.get("source").and_then(|source| source.as_table()).cloned().unwrap_or_default();
        source.into_iter().map(|(key, value)| format!("{key} = {value}")).collect()
    });
    both("seeds", |trial| trial.header.seeds.iter().map(|(name, seed)| format!("{name} {seed}")).collect());
    both("cameras", |trial| {
        let rig = &trial.header.rig;
        let side = |camera: &seafix_log::CameraRecord| {
            let lens = if camera.equidistant { "equidistant " } else { "" };
            format!(
                "{} × {} px, f = {} px, {lens}{:?}",
                camera.size[0], camera.size[1], camera.matrix[0][0], camera.distortion
            )
        };
        vec![side(&rig.left), side(&rig.right), format!("right from left {:?}", rig.right_from_left)]
    });
    both("targets", |trial| {
        let target = |target: &seafix_log::TargetModel| {
            format!("{} with {} points, alert limit {} m", target.id, target.points.len(), target.alert_limit)
        };
        trial.header.targets.iter().map(target).collect()
    });
    both("site", |trial| trial.header.site.lines().map(str::to_owned).collect());
    found
}

/// The notices of runs with bitwise identical results, whose comparison is meaningless.
fn same(run: &Run, names: &[String]) -> String {
    let of = |name: &String| -> Vec<&[u8]> {
        let own = run.trials.iter().filter(|trial| trial.header.axes[0].value == *name);
        own.map(|trial| &trial.digest[..]).collect()
    };
    let alike = names.iter().skip(1).filter(|name| of(name) == of(&names[0]));
    alike
        .map(|name| format!("{} and {} have bitwise identical results.\n", printed(&names[0]), printed(name)))
        .collect()
}

/// The notice on the compared attempts of runs with different lengths; empty for runs of one length.
fn lengths(run: &Run, names: &[String], comparisons: &[Comparison]) -> String {
    let of = |name: &String| {
        let own = run.trials.iter().filter(|trial| trial.header.axes[0].value == *name);
        distinct(own.map(|trial| trial.count().to_string())).join(" or ")
    };
    let lengths: Vec<String> = names.iter().map(of).collect();
    if lengths.iter().all(|length| *length == lengths[0]) {
        return String::new();
    }
    let long =
        names.iter().zip(&lengths).map(|(name, frames)| format!("{} has {frames} frames per trial", printed(name)));
    let of = |index: usize| &run.trials[index].header.axes[0].value;
    let n = || comparisons.iter().filter(|c| of(c.first) != of(c.second)).map(|comparison| comparison.n);
    let what = match (n().min(), n().max()) {
        (Some(min), Some(max)) if min < max => {
            format!("each comparison uses the {min} to {max} attempts at the same frame and target in both")
        }
        (Some(n), _) => format!("the comparison uses the {n} attempts at the same frame and target in both"),
        _ => "no two of their trials have the same frames, so no comparison is made".to_owned(),
    };
    format!("{}: {what}.\n", long.collect::<Vec<_>>().join(", "))
}

/// A name with control characters replaced by blanks.
fn printed(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The comparisons, one line each.
fn lines(comparisons: &[Comparison]) -> String {
    if comparisons.is_empty() {
        return "No two trials have the same frames, so no comparison is made.\n".to_owned();
    }
    let mut text = String::from(
        "Median TRE difference, first − second, on the same attempts; failures count as infinite errors; p Holm-adjusted.\n",
    );
    for c in comparisons {
        let real = |value: f64| if c.over_conditions { value.exp() } else { value * 1e3 };
        let [middle, low, high] = [c.difference, c.interval.0, c.interval.1].map(|v| format::number(Some(real(v)), 3));
        let unit = if c.over_conditions { "times" } else { "mm" };
        let sure = if c.better().is_some() { "significant" } else { "not significant" };
        let condition = if c.condition.is_empty() { String::new() } else { format!("{}: ", c.condition) };
        let line = format!(
            "{condition}{} – {}: {middle} {unit} [{low}, {high}], n {}, p {}, {sure}",
            c.names[0],
            c.names[1],
            c.n,
            format::probability(c.holm)
        );
        text.extend(line.chars().map(|sign| if sign.is_control() { ' ' } else { sign }));
        text.push('\n');
    }
    text
}
