//! The runner: every frame of every source through every trial's pipeline, into logs and tables.
//!
//! A run is cut into [`Piece`](cut::Piece)s: some successive frames of one source, led through every trial that shares
//! it. Each piece is made by one thread and stored whole; when all are there they are joined into one log a trial and one
//! table. The cut depends on the plan alone, so the answer depends neither on the number of threads, nor on which
//! machine made which piece, nor on whether the run was interrupted and resumed.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_log::LogError;

mod assemble;
mod estimate;
mod folder;
mod group;
mod kept;
mod merge;
mod options;
mod partition;
mod sharing;
mod store;
mod worker;

pub use estimate::{RunEstimate, estimate};
pub use kept::{Remade, remake};
pub use merge::merge;
pub use options::{Existing, Options, Shard};

use crate::{Plan, manifest::Manifest};
use folder::Claim;
pub(crate) use group::Group;
#[cfg(test)]
pub(crate) use group::open;
use partition::Piece;
use store::Store;

/// Watches a run, and may end it. The runner itself prints nothing.
pub trait Observer: Sync {
    /// The run begins: so many frames over all trials, about so many bytes of log, in this folder.
    fn begins(&self, _frames: usize, _bytes: u64, _folder: &Path) {}
    /// So many of the frames are there already, from before the run was interrupted.
    fn resumes(&self, _frames: usize) {}
    /// A run that was kept is made again, for this reason.
    fn renews(&self, _reason: &str) {}
    /// Something is odd about an input, but not wrong.
    fn warns(&self, _warning: &Fault) {}
    /// One more frame of `trial` is logged.
    fn frame(&self, _trial: &str) {}
    /// Whether the run shall end: each thread then finishes its frame.
    fn stops(&self) -> bool {
        false
    }
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
    /// The observer ended it. What was done is kept.
    #[error("interrupted; go on with `--resume --out {}`, or save what there is with `seafix recover {}`", .0.display(), .0.display())]
    Interrupted(PathBuf),
}

impl RunError {
    /// A file that cannot be written: which, how far it came, why.
    pub(crate) fn unwritable(path: &Path, error: impl std::fmt::Display) -> Self {
        let after =
            std::fs::metadata(path).map_or_else(|_| String::new(), |file| format!(", after {} bytes", file.len()));
        Self::Output(
            Fault::new(format!("cannot write ({error}{after})"), path).remedy("make room on the disk and --resume"),
        )
    }
}

/// A run that is complete, or its shard.
#[derive(Debug)]
pub struct Finished {
    /// Its folder.
    pub folder: PathBuf,
    /// Attempts over all trials and frames; of a shard none are counted.
    pub rows: usize,
    /// Whether it was there already, and nothing was made.
    pub kept: bool,
}

/// Runs `plan` into a folder.
///
/// The answer depends on the plan alone: not on the number of threads, not on earlier runs, not on interruptions.
/// Without times ([`Options::timed`]) two runs of a plan have the same bytes. Logs and tables carry `.partial` until they
/// are complete.
///
/// # Errors
/// [`RunError`]: everything that is wrong with the inputs, before anything is written; or the output
/// that could not be written; or that it was interrupted.
pub fn run(plan: &Plan, options: &Options, observer: &dyn Observer) -> Result<Finished, RunError> {
    folder::inspect(options).map_err(RunError::Output)?;
    let groups = group::open(plan, options.separate)?;
    groups.iter().flat_map(|group| group.sequence.warnings()).for_each(|warning| observer.warns(warning));
    let pieces = partition::cut(&groups);
    let mut manifest =
        Manifest::new(plan, options, &groups, pieces.len()).map_err(|fault| RunError::Input(vec![fault]))?;

    let claim = Claim::new(options, &plan.name, &manifest)?;
    claim.outdated.iter().for_each(|reason| observer.renews(reason));
    let mine: Vec<&Piece> = pieces.iter().filter(|piece| options.takes(piece.number)).collect();
    if let (true, Some(shard)) = (mine.is_empty(), options.shard) {
        let fault = Fault::new("an empty shard", &claim.folder).value(shard);
        observer
            .warns(&fault.remedy(format!("the run has {} pieces; more shards than that make nothing", pieces.len())));
    }
    let frames = |pieces: &[&Piece]| pieces.iter().map(|piece| piece.frames() * groups[piece.group].trials.len()).sum();
    // A shard is what it is made of: one whose pieces were damaged since is made again.
    let full = || mine.iter().all(|piece| Store::of(&claim.folder).sound(piece.number).is_some());
    if let Some(finished) = claim.finished.as_ref().filter(|_| options.shard.is_none() || full()) {
        if options.shard.is_none() {
            Store::of(&claim.folder).remove()?;
        }
        return Ok(Finished { rows: finished.rows, folder: claim.folder, kept: true });
    }
    observer.begins(frames(&mine), partition::bytes(&groups, &mine), &claim.folder);
    // First: a folder without it holds no run.
    manifest.write(&claim.folder, "running")?;
    let store = Store::open(&claim.folder)?;
    let (made, missing): (Vec<&Piece>, Vec<&Piece>) =
        mine.into_iter().partition(|piece| store.sound(piece.number).is_some());
    if !made.is_empty() {
        observer.resumes(frames(&made));
    }
    let pool = options.pool()?;
    let mut done = worker::work(&groups, &missing, &store, &pool, options.timed, observer)?;
    claim.holds()?;
    if done && options.shard.is_some() {
        manifest.write(&claim.folder, "shard")?;
        return Ok(Finished { folder: claim.folder, rows: 0, kept: false });
    }
    if done {
        let pieces = pool.install(|| store.all());
        done = assemble::assemble(&claim.folder, &mut manifest, &pieces, &pool, observer)?;
    }
    claim.holds()?;
    if !done {
        manifest.write(&claim.folder, "interrupted")?;
        return Err(RunError::Interrupted(claim.folder));
    }
    manifest.write(&claim.folder, "finished")?;
    store.remove()?;
    Ok(Finished { folder: claim.folder, rows: manifest.rows, kept: false })
}
