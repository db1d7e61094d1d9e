//! The runner: every frame of every source through every trial's pipeline, into logs and tables.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use seafix_component::Fault;
use seafix_log::{FrameRecord, LogError, Writer};
use seafix_referencing::{Glimpse, Target};
use seafix_simulation::{Purpose, Stream};

use crate::{
    Plan, Sighting, Trial,
    dataset::sha256,
    judge::judge,
    manifest::{Git, Input, Machine, Manifest, TrialEntry},
    record,
    results::{Part, Row, join},
    source::{Eyes, Passage, Sight},
    thin::Thinned,
};

/// Watches a run. The runner itself prints nothing.
pub trait Observer: Sync {
    /// The run begins: so many frames over all trials, about so many bytes of log, in this folder.
    fn begins(&self, _frames: usize, _bytes: u64, _folder: &Path) {}
    /// Something is odd about an input, but not wrong.
    fn warns(&self, _warning: &Fault) {}
    /// One more frame of `trial` is logged.
    fn frame(&self, _trial: &str) {}
}

/// Watches nothing.
#[derive(Debug, Clone, Copy)]
pub struct Silent;
impl Observer for Silent {}

/// Why a run could not be finished.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The inputs are wrong; nothing was written.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Input(Vec<Fault>),
    /// The output cannot be written.
    #[error("{0}")]
    Output(Fault),
    /// A log cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
}

/// A run that is complete.
#[derive(Debug)]
pub struct Finished {
    /// Its folder.
    pub folder: PathBuf,
    /// Attempts over all trials and frames.
    pub rows: usize,
}

/// The trials that see the same passage: they share its frames, so that they are compared on the
/// same noise.
struct Group<'a> {
    passage: Box<dyn Passage>,
    trials: Vec<&'a Trial>,
    /// What each trial searches for.
    targets: Vec<Vec<Target>>,
    /// About how much log (bytes) one frame takes.
    frame_bytes: u64,
}

/// Runs `plan` into the folder `out`, or into the next free folder below `runs`.
///
/// The answer depends on the plan alone: not on the number of threads, not on earlier runs. Logs and
/// tables carry `.partial` until they are complete.
///
/// # Errors
/// [`RunError`]: everything that is wrong with the inputs, before anything is written; or the output
/// that could not be written.
pub fn run(plan: &Plan, out: Option<&Path>, threads: usize, observer: &dyn Observer) -> Result<Finished, RunError> {
    let groups = open(plan)?;
    groups.iter().flat_map(|group| group.passage.warnings()).for_each(|warning| observer.warns(warning));
    let folder = make_folder(out, &plan.name).map_err(RunError::Output)?;
    let frames = groups.iter().map(|group| group.passage.frames() * group.trials.len()).sum();
    observer.begins(frames, groups.iter().map(|group| expected_bytes(plan, group)).sum(), &folder);

    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| RunError::Output(Fault::new(format!("no threads ({error})"), Path::new("the machine"))))?;
    let (mut parts, mut rows) = (BTreeMap::new(), 0);
    for group in &groups {
        run_group(plan, group, &folder, &pool, observer, &mut parts)?;
    }
    // Groups finish in the order of their sources; the table is in the order of the trials.
    let parts: Vec<Part> = plan.trials.iter().filter_map(|trial| parts.remove(&trial.name)).collect();
    parts.iter().for_each(|part| rows += part.rows);
    write_tables(&folder, parts)?;
    write_manifest(plan, &groups, &folder, threads)?;
    Ok(Finished { folder, rows })
}

/// Opens every source once and checks what it needs.
fn open(plan: &Plan) -> Result<Vec<Group<'_>>, RunError> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut faults = Vec::new();
    for trial in &plan.trials {
        let same = |other: &Trial| {
            other.resolved.source == trial.resolved.source && other.resolved.seed == trial.resolved.seed
        };
        if let Some(group) = groups.iter_mut().find(|group| same(group.trials[0])) {
            group.trials.push(trial);
            continue;
        }
        match trial.source.open(trial.resolved.seed, &plan.folder) {
            Ok(passage) => match frame_bytes(&*passage) {
                Ok(frame_bytes) => {
                    groups.push(Group { passage, trials: vec![trial], targets: Vec::new(), frame_bytes });
                }
                Err(fault) => faults.push(fault),
            },
            Err(more) => faults.extend(more),
        }
    }
    for group in &mut groups {
        for trial in &group.trials {
            match group.passage.site().targets(trial.stages.settings().target) {
                Ok(targets) => group.targets.push(targets),
                Err(error) => faults.push(Fault::new(error.to_string(), Path::new(group.passage.name()))),
            }
        }
    }
    faults.dedup();
    if faults.is_empty() { Ok(groups) } else { Err(RunError::Input(faults)) }
}

fn run_group(
    plan: &Plan,
    group: &Group<'_>,
    folder: &Path,
    pool: &rayon::ThreadPool,
    observer: &dyn Observer,
    parts: &mut BTreeMap<String, Part>,
) -> Result<(), RunError> {
    let passage = &*group.passage;
    let mut outputs = Vec::new();
    for (trial, targets) in group.trials.iter().zip(&group.targets) {
        let header = record::header(plan, trial, passage, targets, folder);
        outputs.push(Output {
            trial,
            log: Writer::create(&folder.join(format!("{}.mcap", trial.name)), &header)?,
            thinned: thinned(plan, group),
            part: Part::create(folder, &trial.name).map_err(|error| unwritable(folder, &error))?,
        });
    }
    let mut glimpses: Vec<Vec<Glimpse>> = Vec::new();
    let back = group.trials.iter().map(|trial| trial.stages.looks_back()).max().unwrap_or(0);
    // A few images a thread at a time, or some hundred clouds: enough to keep all busy, few enough to keep in memory.
    let batch = if passage.images() { 2 } else { 128 } * pool.current_num_threads();
    for first in (0..passage.frames()).step_by(batch) {
        let last = passage.frames().min(first + batch);
        let looked: Result<Vec<Looked>, Fault> =
            pool.install(|| (first..last).into_par_iter().map(|index| look(group, index)).collect());
        let mut looked = looked.map_err(|fault| RunError::Input(vec![fault]))?;
        // What joint fixes look back on: the glimpses of the frames before this batch, then its own.
        let before = glimpses.len();
        glimpses.extend(looked.iter_mut().map(|looked| std::mem::take(&mut looked.glimpses)));
        let done: Vec<Vec<FrameRecord>> = pool.install(|| {
            let frames = looked.into_par_iter().enumerate();
            frames.map(|(k, looked)| record(group, first + k, looked, &glimpses[..=before + k])).collect()
        });
        glimpses.drain(..glimpses.len().saturating_sub(back));
        for records in done {
            for (record, output) in records.iter().zip(&mut outputs) {
                if output.thinned.keeps(record) {
                    output.log.frame(record)?;
                }
                for row in Row::of(&output.trial.name, record) {
                    output.part.add(row).map_err(|error| unwritable(folder, &error))?;
                }
                observer.frame(&output.trial.name);
            }
        }
    }
    for Output { trial, mut log, thinned, mut part } in outputs {
        log.totals(&thinned.totals)?;
        log.finish()?;
        part.close().map_err(|error| unwritable(folder, &error))?;
        parts.insert(trial.name.clone(), part);
    }
    Ok(())
}

/// What one trial writes.
struct Output<'a> {
    trial: &'a Trial,
    log: Writer,
    thinned: Thinned,
    part: Part,
}

/// All logs of point-level trials together stay below this (bytes).
const MOST_LOG: u64 = 900_000_000;

/// Which frames of each of a group's trials are logged: all that have images.
fn thinned(plan: &Plan, group: &Group<'_>) -> Thinned {
    let frames = group.passage.frames();
    match group.passage.images() {
        true => Thinned::new(frames, 1, u64::MAX),
        false => Thinned::new(frames, group.frame_bytes, MOST_LOG / plan.trials.len() as u64),
    }
}

fn unwritable(folder: &Path, error: &str) -> RunError {
    RunError::Output(Fault::new(format!("cannot write the results ({error})"), folder).remedy("make room on the disk"))
}

/// What every trial of a group made of one frame, each object by itself.
struct Looked {
    sight: Sight,
    sightings: Vec<Sighting>,
    /// Of each trial, what a joint fix takes from it.
    glimpses: Vec<Glimpse>,
}

/// One frame through every trial of its group. The sight is made once; every trial does all of its
/// own work on it, so that times are its own.
fn look(group: &Group<'_>, index: usize) -> Result<Looked, Fault> {
    let rig = group.passage.rig();
    let sight = group.passage.sight(index)?;
    let (mut sightings, mut glimpses) = (Vec::new(), Vec::new());
    for (trial, targets) in group.trials.iter().zip(&group.targets) {
        let mut stream = Stream::new(trial.resolved.seed, 0, index as u64, Purpose::Search);
        let sighting = trial.stages.reference(&sight, targets, rig, stream.rng());
        glimpses.push(trial.stages.glimpse(&sighting, targets, rig));
        sightings.push(sighting);
    }
    Ok(Looked { sight, sightings, glimpses })
}

/// The records of one frame, a trial each: what is solved together is joined, then truth is asked. `glimpses` are those
/// of the frames before, the last of them the frame's own.
fn record(group: &Group<'_>, index: usize, looked: Looked, glimpses: &[Vec<Glimpse>]) -> Vec<FrameRecord> {
    let passage = &*group.passage;
    let truth = passage.truth(index);
    let sightings = looked.sightings.into_iter().enumerate();
    sightings
        .zip(group.trials.iter().zip(&group.targets))
        .map(|((which, mut sighting), (trial, targets))| {
            if let Some((own, before)) = glimpses.split_last() {
                let back = before.len().saturating_sub(trial.stages.looks_back());
                let before: Vec<&Glimpse> = before[back..].iter().map(|all| &all[which]).collect();
                trial.stages.join(&mut sighting, &before, &own[which], targets, passage.rig());
            }
            let mut record = record::frame(index, &looked.sight, &sighting, trial, targets);
            if let Some(truth) = &truth {
                let kind = trial.stages.settings().target;
                judge(&mut record, &sighting, truth, passage.site(), targets, kind, passage.rig());
            }
            record
        })
        .collect()
}

/// About how much log a group writes: images, losslessly compressed to some 0.7 of their size, are
/// nearly all of it where there are any.
fn expected_bytes(plan: &Plan, group: &Group<'_>) -> u64 {
    thinned(plan, group).most(group.passage.frames()) * group.frame_bytes * group.trials.len() as u64
}

/// About how much log (bytes) one frame of a passage takes, by its first.
fn frame_bytes(passage: &dyn Passage) -> Result<u64, Fault> {
    const CLOUD_BYTES: f64 = 150e3;
    if passage.images() {
        let pixels = [passage.rig().left(), passage.rig().right()]
            .map(|camera| f64::from(camera.size()[0]) * f64::from(camera.size()[1]));
        return Ok((0.7 * (pixels[0] + pixels[1]) + CLOUD_BYTES) as u64);
    }
    let points = match passage.sight(0)?.eyes {
        Eyes::Points(cloud) => cloud.len(),
        Eyes::Pair(..) => 0,
    };
    // As measured on logs of 3 to 50 points, and a little more.
    Ok(4000 + 350 * points as u64)
}

/// The folder of the run: new, or empty.
fn make_folder(out: Option<&Path>, name: &str) -> Result<PathBuf, Fault> {
    let failed = |path: &Path, error: std::io::Error| {
        Fault::new(format!("cannot make the output folder ({error})"), path)
            .remedy("choose another with --out, or make room and rights for it")
    };
    if let Some(out) = out {
        if out.exists() {
            let mut entries = fs::read_dir(out).map_err(|error| failed(out, error))?;
            if entries.next().is_some() {
                return Err(Fault::new("the output folder is not empty", out).remedy("choose a new one with --out"));
            }
        }
        fs::create_dir_all(out).map_err(|error| failed(out, error))?;
        return Ok(out.to_owned());
    }
    let runs = Path::new("runs");
    fs::create_dir_all(runs).map_err(|error| failed(runs, error))?;
    for number in 1.. {
        let folder = runs.join(if number == 1 { name.to_owned() } else { format!("{name}-{number}") });
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(failed(&folder, error)),
        }
    }
    unreachable!("some number is free")
}

/// Writes a file under a `.partial` name and renames it when it is on the disk.
fn complete(path: &Path, write: impl FnOnce(&Path) -> Result<(), String>) -> Result<(), RunError> {
    let partial = PathBuf::from(format!("{}.partial", path.display()));
    write(&partial).and_then(|()| fs::rename(&partial, path).map_err(|error| error.to_string())).map_err(|error| {
        RunError::Output(Fault::new(format!("cannot write ({error})"), path).remedy("make room on the disk"))
    })
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    complete(path, |partial| {
        use std::io::Write;
        let mut file = fs::File::create(partial).map_err(|error| error.to_string())?;
        file.write_all(bytes).and_then(|()| file.sync_all()).map_err(|error| error.to_string())
    })
}

fn write_tables(folder: &Path, parts: Vec<Part>) -> Result<(), RunError> {
    for table in ["results.csv", "results.parquet"] {
        complete(&folder.join(table), |partial| join(&parts, partial))?;
    }
    parts.into_iter().try_for_each(Part::remove).map_err(|error| unwritable(folder, &error))
}

fn write_manifest(plan: &Plan, groups: &[Group<'_>], folder: &Path, threads: usize) -> Result<(), RunError> {
    let input = |fault: Fault| RunError::Input(vec![fault]);
    let mut inputs = Vec::new();
    for group in groups {
        let files: BTreeMap<String, String> = group.passage.inputs().map_err(input)?.into_iter().collect();
        inputs.push(Input { source: group.passage.name().to_owned(), files });
    }
    let frames = |trial: &Trial| {
        let group = groups.iter().find(|group| group.trials.iter().any(|other| other.name == trial.name));
        group.map_or(0, |group| group.passage.frames())
    };
    let resolved = |experiment: &crate::Experiment| {
        toml::to_string(experiment).expect("a resolved experiment is a table of plain values")
    };
    let mut outputs = BTreeMap::new();
    for name in plan
        .trials
        .iter()
        .map(|trial| format!("{}.mcap", trial.name))
        .chain(["results.csv".into(), "results.parquet".into()])
    {
        outputs.insert(name.clone(), sha256(&folder.join(&name)).map_err(RunError::Output)?);
    }
    let manifest = Manifest {
        format: "seafix-manifest/1",
        state: "finished",
        question: plan.experiment.question.clone(),
        seafix: env!("CARGO_PKG_VERSION"),
        git: Git::here(),
        machine: Machine::here(),
        threads,
        seeds: BTreeMap::from([("experiment".to_owned(), plan.experiment.seed)]),
        experiment: resolved(&plan.experiment),
        trials: plan
            .trials
            .iter()
            .map(|trial| TrialEntry {
                name: trial.name.clone(),
                log: format!("{}.mcap", trial.name),
                frames: frames(trial),
                configuration: resolved(&trial.resolved),
            })
            .collect(),
        inputs,
        outputs,
    };
    let text = serde_json::to_string_pretty(&manifest).expect("a manifest is plain data") + "\n";
    write_bytes(&folder.join("manifest.json"), text.as_bytes())
}
