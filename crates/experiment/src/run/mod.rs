//! The runner: every frame of every source through every trial's pipeline, into logs and tables.
//!
//! A run is divided into [`Piece`](partition::Piece)s: some successive frames of one source, processed by every trial
//! that shares it. One thread computes a piece, which is stored when it is complete. All pieces are then joined into
//! one log for each trial and one table. The partition depends on the plan alone, so that results do not depend on the
//! number of threads, on the machines, or on interruptions.

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

/// An observer of a run that may stop it. The runner itself prints nothing.
pub trait Observer: Sync {
    /// Reports the start: the number of frames over all trials, the approximate size of the logs, and the folder.
    fn begins(&self, _frames: usize, _bytes: u64, _folder: &Path) {}
    /// Reports the number of frames kept from before an interruption.
    fn resumes(&self, _frames: usize) {}
    /// Reports that an existing run is repeated, and the reason.
    fn renews(&self, _reason: &str) {}
    /// Reports a warning about an input.
    fn warns(&self, _warning: &Fault) {}
    /// Reports that one more frame of `trial` is logged.
    fn frame(&self, _trial: &str) {}
    /// Whether to stop the run; each thread then finishes its frame.
    fn stops(&self) -> bool {
        false
    }
}

/// An observer without output.
#[derive(Debug, Clone, Copy)]
pub struct Silent;
impl Observer for Silent {}

/// The reason why a run was not finished.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Invalid inputs; nothing was written.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Input(Vec<Fault>),
    /// An output that cannot be written.
    #[error("{0}")]
    Output(Fault),
    /// A log that cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An interruption by the observer; the finished part is kept.
    #[error("interrupted; resume with `--resume --out {}`, or recover the finished part with `seafix recover {}`", .0.display(), .0.display())]
    Interrupted(PathBuf),
}

impl RunError {
    /// The fault of a file that cannot be written, with the number of bytes written before.
    pub(crate) fn unwritable(path: &Path, error: impl std::fmt::Display) -> Self {
        let after =
            std::fs::metadata(path).map_or_else(|_| String::new(), |file| format!(", after {} bytes", file.len()));
        Self::Output(
            Fault::new(format!("cannot write ({error}{after})"), path).remedy("free some disk space and use --resume"),
        )
    }
}

/// A complete run or shard.
#[derive(Debug)]
pub struct Finished {
    /// The folder.
    pub folder: PathBuf,
    /// The number of attempts over all trials and frames; zero for a shard.
    pub rows: usize,
    /// Whether the run existed already and nothing was computed.
    pub kept: bool,
}

/// Runs `plan` into a folder.
///
/// The results depend on the plan alone: not on the number of threads, on earlier runs, or on interruptions. Without
/// durations ([`Options::timed`]) two runs of a plan have the same bytes. Logs and tables have the extension `.partial`
/// until they are complete.
///
/// # Errors
/// [`RunError`]: all faults of the inputs, before anything is written; an output that cannot be written; an
/// interruption.
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
        observer.warns(&fault.remedy(format!("the run has {} pieces; use at most as many shards", pieces.len())));
    }
    let frames = |pieces: &[&Piece]| pieces.iter().map(|piece| piece.frames() * groups[piece.group].trials.len()).sum();
    // A shard whose pieces have been damaged since is computed again.
    let full = || mine.iter().all(|piece| Store::of(&claim.folder).sound(piece.number).is_some());
    if let Some(finished) = claim.finished.as_ref().filter(|_| options.shard.is_none() || full()) {
        if options.shard.is_none() {
            Store::of(&claim.folder).remove()?;
        }
        return Ok(Finished { rows: finished.rows, folder: claim.folder, kept: true });
    }
    observer.begins(frames(&mine), partition::bytes(&groups, &mine), &claim.folder);
    // The manifest is written first: a folder without it holds no run.
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
