//! The section on failures: the ten worst attempts with their images and their places in the logs.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::{
    content::{
        phrases::{self, Unit},
        sections::missing,
    },
    document::{Block, Cell, Head, Picture, Section, Table, Text, code, text},
    error::ReportError,
    field::Field,
    figure::{Marked, draw_picture},
    format::{counted, decimals, short},
    number::{Key, Number},
    run::{AttemptRow, Frame, Run, Trial},
};

/// The number of listed attempts.
const LISTED: usize = 10;
/// Maximum number of rejected attempts in the list, so that large errors are shown as well.
const REFUSALS: usize = 5;
/// Maximum number of frames of a log whose images are read again; longer logs take too long.
const SEARCHED: usize = 200_000;

/// One attempt in its trial.
type Case<'a> = (usize, &'a Frame, &'a AttemptRow);

/// The picture of the best frame, and the section with the worst attempts.
pub(crate) fn section(run: &Run, small: bool) -> Result<(Option<Block>, Section), ReportError> {
    let worst = worst(run);
    let best = best(run);
    let mut wanted: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
    for (trial, stamp) in best.into_iter().chain(worst.iter().map(|(trial, frame, _)| (*trial, frame.stamp_ns))) {
        wanted.entry(trial).or_default().push(stamp);
    }
    wanted.retain(|trial, _| run.trials[*trial].pictures && run.trials[*trial].frames.len() <= SEARCHED);
    let plotted = wanted.into_par_iter().map(|(trial, stamps)| Ok((trial, draw_picture(&run.trials[trial], &stamps)?)));
    let plotted: Vec<(usize, Vec<Marked>)> = plotted.collect::<Result<_, ReportError>>()?;
    let all = plotted.into_iter().flat_map(|(trial, plotted)| plotted.into_iter().map(move |marked| (trial, marked)));
    let pictures: BTreeMap<(usize, u64), Marked> =
        all.map(|(trial, marked)| ((trial, marked.stamp_ns), marked)).collect();
    let first = best.and_then(|best| pictures.get(&best).map(|marked| best_picture(run, best.0, marked, small)));
    let mut section = Section::new("Failures");
    if worst.is_empty() {
        section.say(text!["The run has no attempt."]);
        return Ok((first, section));
    }
    section.add(Block::Table(table(run, &worst)));
    section.say(text!["What each of them lacked, by the line of the table:"]);
    section.add(Block::Items(worst.iter().enumerate().map(|(place, case)| lacked(run, place + 1, case)).collect()));
    let mut shown: Vec<u64> = Vec::new();
    for (place, (index, frame, row)) in worst.iter().enumerate() {
        // Trials of one source share their frames; each frame is shown once.
        let source = format!("{}{}", run.trials[*index].header.source, frame.stamp_ns);
        let hash = source.bytes().fold(7_u64, |hash, byte| hash.wrapping_mul(131).wrapping_add(u64::from(byte)));
        let Some(marked) = pictures.get(&(*index, frame.stamp_ns)).filter(|_| !shown.contains(&hash)) else { continue };
        shown.push(hash);
        section.add(failure(run, place + 1, (*index, frame, row), marked, small));
    }
    Ok((first, section))
}

/// Wrong fixes by error, then rejected attempts with points in view, then the fixes with the largest errors.
fn worst(run: &Run) -> Vec<Case<'_>> {
    let all = || {
        let trials = run.trials.iter().enumerate();
        trials.flat_map(|(index, trial)| trial.attempts().map(move |(frame, row)| (index, frame, row)))
    };
    let error = |row: &AttemptRow| {
        let errors = [Field::Tre, Field::Fit, Field::Residual].map(|field| row.get(field));
        errors.into_iter().flatten().next().unwrap_or(0.0)
    };
    let max = |cases: Vec<Case<'_>>, n: usize| -> Vec<(usize, u64)> {
        let mut keyed: Vec<(f64, usize, u64)> = cases.iter().map(|(i, f, row)| (error(row), *i, f.number)).collect();
        keyed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        keyed.into_iter().take(n).map(|(_, index, frame)| (index, frame)).collect()
    };
    let pick = |keys: &[(usize, u64)], of: &dyn Fn(&AttemptRow) -> bool| -> Vec<Case<'_>> {
        let chosen = |key: &(usize, u64)| all().find(|(i, frame, row)| (*i, frame.number) == *key && of(row));
        keys.iter().filter_map(chosen).collect()
    };
    let wrong = |row: &AttemptRow| row.wrong();
    let rejected = |row: &AttemptRow| !row.wrong() && !row.found() && row.get(Field::Visible).unwrap_or(0.0) >= 3.0;
    let found = |row: &AttemptRow| row.found();
    let mut cases = pick(&max(all().filter(|(.., row)| wrong(row)).collect(), LISTED), &wrong);
    let mut refusals: Vec<Case<'_>> = all().filter(|(.., row)| rejected(row)).collect();
    // Rejected attempts with many points in view are the least expected.
    let visible = |row: &AttemptRow| row.get(Field::Visible).unwrap_or(0.0);
    refusals.sort_by(|a, b| visible(b.2).total_cmp(&visible(a.2)));
    cases.extend(refusals.into_iter().take(REFUSALS.min(LISTED - cases.len())));
    cases.extend(pick(&max(all().filter(|(.., row)| found(row)).collect(), LISTED - cases.len()), &found));
    cases
}

/// The frame with the most identified points, among frames with images and without a wrong fix.
fn best(run: &Run) -> Option<(usize, u64)> {
    let mut best: Option<(u32, usize, u64)> = None;
    for (index, trial) in run.trials.iter().enumerate().filter(|(_, trial)| trial.pictures) {
        for frame in &trial.frames {
            let points: u32 = trial.attempts_of(frame).filter(|row| row.found()).map(|row| row.points).sum();
            let wrong = trial.attempts_of(frame).any(AttemptRow::wrong);
            // The first frame of several equal ones.
            if !wrong && points > best.map_or(0, |best| best.0) {
                best = Some((points, index, frame.stamp_ns));
            }
        }
    }
    best.map(|(_, index, stamp)| (index, stamp))
}

fn table(run: &Run, worst: &[Case<'_>]) -> Table {
    let columns = [
        ("fit RMS (mm)", Field::Fit, Unit::Millimetres),
        ("TRE (mm)", Field::Tre, Unit::Millimetres),
        ("position error (mm)", Field::Position, Unit::Millimetres),
        ("attitude error (°)", Field::Attitude, Unit::Degrees),
        ("NEES", Field::Nees, Unit::Plain),
    ];
    let digits = columns.map(|(_, field, unit)| {
        decimals(worst.iter().filter_map(|(.., row)| row.get(field)).map(|v| v * unit.scale()))
    });
    let mut heads = vec![Head::words("Log"), Head::numbers("frame"), Head::numbers("stamp (ns)")];
    heads.extend([Head::words("target"), Head::words("outcome"), Head::numbers("points"), Head::numbers("visible")]);
    heads.extend(columns.map(|(name, ..)| Head::numbers(name)));
    let caption = text![
        "The ten worst attempts: wrong fixes, then up to five rejected attempts with the most points in view, then the fixes with the largest TRE. Log and stamp identify the frame."
    ];
    let mut table = Table::new("worst", caption, heads);
    for (index, frame, row) in worst {
        let trial = &run.trials[*index];
        let object = trial.object(row);
        let place = (object, frame.number, frame.stamp_ns);
        let judged = match (row.wrong(), row.found()) {
            (true, _) => "wrong".to_owned(),
            (_, true) if row.wrong.is_none() => "fix, unchecked".to_owned(),
            (_, true) => "fix".to_owned(),
            _ => format!("rejected: {}", trial.reason(row)),
        };
        let as_number =
            |field, unit, digits| phrases::value(trial, place, field, row.get(field), (unit, digits)).into();
        let (number, stamp) = named(trial, frame);
        let mut line: Vec<Cell> = vec![code(trial.file()).into(), number.into(), stamp.into()];
        line.extend([object.to_owned().into(), judged.into()]);
        line.extend([as_number(Field::Identified, Unit::Plain, 0), as_number(Field::Visible, Unit::Plain, 0)]);
        line.extend(columns.iter().zip(digits).map(|((_, field, unit), digits)| as_number(*field, *unit, digits)));
        table.line(false, line);
    }
    table
}

/// The sentence on what the attempt in a line of the table lacked.
fn lacked(run: &Run, place: usize, (index, frame, row): &Case<'_>) -> Text {
    let trial = &run.trials[*index];
    let mut message = text![format!("Line {place}, {}: ", trial.object(row))];
    message.extend(missing::sentence(trial, frame, row));
    message
}

/// The number and the stamp of a frame.
fn named(trial: &Trial, frame: &Frame) -> (Number, Number) {
    let key = |what: &str| Key { span: [frame.stamp_ns; 2], ..Key::of(trial, "/referencing/frame", what) };
    let stamp =
        Number { text: frame.stamp_ns.to_string(), value: Some(frame.stamp_ns as f64), key: key("stamp").into() };
    (Number::count(frame.number as usize, key("frame")), stamp)
}

/// The meaning of the marks of a picture and their counts.
fn marks(trial: &Trial, marked: &Marked) -> Text {
    let count = |what: &str, n: usize| {
        let key = Key { span: [marked.stamp_ns; 2], ..Key::of(trial, "/referencing/frame", format!("marks {what}")) };
        Number::count(n, key)
    };
    let [corners, cloud, candidates, identified, used] = marked.counts;
    text![
        count("corners", corners),
        " key points of the left image and ",
        count("cloud", cloud),
        " matched points (white crosses), ",
        count("candidates", candidates),
        " candidates (blue rings) in the gates of the prior pose (thin frames), ",
        count("identified", identified),
        " identified (black discs), ",
        count("used", used),
        " used by the solver (red rings, the first nine numbered). "
    ]
}

fn best_picture(run: &Run, index: usize, marked: &Marked, small: bool) -> Block {
    let trial = &run.trials[index];
    let mut caption = text!["Left and right image of a fix: "];
    caption.extend(marks(trial, marked));
    let axes = trial.header.axes.iter().map(|axis| format!("{} {}", short(&axis.key), axis.value));
    let axes = axes.collect::<Vec<_>>().join(", ");
    caption.extend(text![
        format!(
            "Targets with a fix: {}. This is the frame with the most identified points, frame {} of ",
            marked.objects.join(", "),
            marked.frame
        ),
        code(trial.file()),
        format!(", stamp {} ns{}{axes}.", marked.stamp_ns, if axes.is_empty() { "" } else { "; " }),
    ]);
    let (scale, quality) = if small { (to_width(marked, 960.0), 75) } else { (1.0, 88) };
    Block::Picture(Picture {
        id: "fix".to_owned(),
        caption,
        alternative: "Left and right image with key points, candidates and identified points".to_owned(),
        jpeg: marked.jpeg(scale, quality),
        size: marked.size(scale),
    })
}

/// The scale, at most 1, at which a picture is at most `width` pixels wide.
fn to_width(marked: &Marked, width: f64) -> f64 {
    (width / f64::from(marked.size(1.0)[0])).min(1.0)
}

fn failure(run: &Run, place: usize, (index, frame, row): Case<'_>, marked: &Marked, small: bool) -> Block {
    let trial = &run.trials[index];
    let mut caption = text![format!("Attempt in line {place} of the table, marks as in the picture of a fix: ")];
    caption.push(format!("target {}, ", trial.object(row)).into());
    caption.extend(missing::sentence(trial, frame, row));
    caption.extend(text![
        format!(" Frame {} of {}, ", frame.number, counted(trial.frames.len(), "logged frame", "logged frames")),
        code(trial.file()),
        format!(", stamp {} ns.", frame.stamp_ns)
    ]);
    let (scale, quality) = if small { (to_width(marked, 600.0), 62) } else { (to_width(marked, 960.0), 78) };
    Block::Picture(Picture {
        id: format!("worst-{place}"),
        caption,
        alternative: format!("Left and right image of the attempt in line {place} of the table of the worst attempts"),
        jpeg: marked.jpeg(scale, quality),
        size: marked.size(scale),
    })
}
