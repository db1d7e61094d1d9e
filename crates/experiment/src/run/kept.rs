//! Verification of a stored run by repetition of a part.

use std::{
    collections::HashSet,
    fs::{self, File},
    io::{Read as _, Seek as _, SeekFrom},
    path::Path,
};

use seafix_component::{Fault, Marker};
use seafix_log::{FrameRecord, Reader, unchanged};

use crate::{
    experiment::Plan,
    results::{Axes, Table, TrialRows, column, csv_end, without},
    run::{
        folder as run_folder, group,
        manifest::{self, Manifest},
        observer::Observer,
        options::Options,
        outcome::RunError,
        partition::{self, Piece},
        store::{Sealed, Store},
        worker,
    },
};

/// A repeated part of a stored run.
#[derive(Debug)]
pub struct Remade {
    /// The number of frames over all trials.
    pub frames: usize,
    /// The trials whose rows or frames differ, with the differences.
    pub differing: Vec<String>,
}

/// Repeats one piece of the run in `folder` and compares it with the stored bytes. At most `frames` of its frames are
/// repeated. The identity of the run selects the piece. The folder in `options` must not exist.
///
/// # Errors
/// [`RunError`]: a folder without a complete run of `plan`, inputs that cannot be read, an output that cannot be
/// written, or an interruption by the observer.
pub fn remake(
    plan: &Plan,
    folder: &Path,
    frames: usize,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Remade, RunError> {
    let input = |fault: Fault| RunError::Input(vec![fault]);
    let kept = Manifest::read(folder).map_err(input)?;
    let groups = group::open(plan, false)?;
    let pieces = partition::cut(&groups);
    let manifest = Manifest::new(plan, options, &groups, pieces.len()).map_err(input)?;
    if !kept.stands_for(&manifest, folder) {
        let fault = Fault::new("the stored run is outdated", &folder.join(manifest::NAME));
        return Err(input(fault.value(kept.outdated(&manifest)).remedy("`seafix publish` repeats it")));
    }
    let chosen = u64::from_str_radix(&kept.identity[..16], 16).unwrap_or(0) % pieces.len() as u64;
    let piece = pieces[chosen as usize].shortened(frames);
    let group = &groups[piece.group];
    let marker = run_folder::marker(&manifest);
    let scratch = Scratch::new(options.out.as_deref().unwrap_or(folder), &marker)?;
    observer.begins(piece.frames() * group.trials.len(), partition::bytes(&groups, &[&piece]), scratch.0);
    let store = Store::open(scratch.0, marker.clone())?;
    if !worker::work(&groups, &[&piece], &store, &options.pool()?, false, observer)? {
        return Err(RunError::Interrupted(folder.to_owned()));
    }
    let lost = || RunError::Output(Fault::new("a piece that was not stored correctly", scratch.0));
    let sealed = store.sound(piece.number).ok_or_else(lost)?;
    let results = folder.join("results.csv");
    let changed = |path: &Path| unchanged(path).map_err(|error| input(Fault::new(error.to_string(), path)));
    changed(&results)?;
    let table =
        fs::read_to_string(&results).map_err(|error| input(Fault::new(format!("cannot read ({error})"), &results)))?;
    let (head, lines) = table.split_once('\n').unwrap_or((&table, ""));
    let place = column(head, SENTENCE);
    let lines: HashSet<String> = lines.lines().map(|line| without(line, place)).collect();
    let own = column(&Table::head(&Axes::default()), SENTENCE);
    let axes = kept.axis_columns();
    let mut differing = Vec::new();
    for trial in &group.trials {
        let name = &trial.name;
        let values = kept.trials.iter().find(|other| other.name == *name).map(|other| &other.values);
        let end = values.map_or_else(String::new, |values| csv_end(&axes.cells(values)));
        let made = rows(&sealed, name).map_err(|error| RunError::unwritable(scratch.0, error))?;
        if !made.lines().all(|line| lines.contains(&(without(line, own) + &end))) {
            differing.push(format!("{name}: rows of {}", frame_range(group, &piece)));
        }
        changed(&folder.join(format!("{name}.mcap")))?;
        let (made, log) = (Reader::open(&sealed.log(name))?, Reader::open(&folder.join(format!("{name}.mcap")))?);
        if !in_log(made, log)? {
            differing.push(format!("{name}: logged frames among {}", frame_range(group, &piece)));
        }
    }
    Ok(Remade { frames: piece.frames() * group.trials.len(), differing })
}

/// The column of sentences. They follow from the other columns, and better words are no other result.
const SENTENCE: &str = "explanation";

/// A temporary folder, removed with the listed files when dropped.
struct Scratch<'a>(&'a Path, &'a Marker);

impl<'a> Scratch<'a> {
    /// An existing folder belongs to someone else and is rejected.
    fn new(path: &'a Path, marker: &'a Marker) -> Result<Self, RunError> {
        fs::create_dir(path).map(|()| Self(path, marker)).map_err(|error| RunError::unwritable(path, error))
    }
}

impl Drop for Scratch<'_> {
    fn drop(&mut self) {
        let _ = self.1.remove(self.0);
    }
}

fn frame_range(group: &group::Group<'_>, piece: &Piece) -> String {
    let number = |index: usize| group.sequence.number(index);
    format!("frames {} to {}", number(piece.first), number(piece.end.max(piece.first + 1) - 1))
}

/// The rows of a trial as text.
fn rows(sealed: &Sealed, trial: &str) -> std::io::Result<String> {
    let Some(TrialRows { csv, text: (start, length), .. }) = sealed.rows_of(trial) else {
        return Ok(String::new());
    };
    let (mut file, mut text) = (File::open(csv)?, String::new());
    file.seek(SeekFrom::Start(start))?;
    file.take(length).read_to_string(&mut text)?;
    Ok(text)
}

/// Whether the frames of `made` equal those with the same numbers in `log`.
fn in_log(made: Reader, mut log: Reader) -> Result<bool, RunError> {
    for frame in made {
        let frame = frame?;
        loop {
            match log.next().transpose()? {
                None => return Ok(false),
                Some(other) if other.frame < frame.frame => {}
                Some(other) if same(&frame, &other) => break,
                Some(_) => return Ok(false),
            }
        }
    }
    Ok(true)
}

/// Equality in which NaN equals NaN, and sentences are not compared.
fn same(a: &FrameRecord, b: &FrameRecord) -> bool {
    let silent = |frame: &FrameRecord| {
        let mut frame = frame.clone();
        frame.targets.iter_mut().for_each(|target| target.explanation.clear());
        frame
    };
    let (a, b) = (silent(a), silent(b));
    a == b || format!("{a:?}") == format!("{b:?}")
}
