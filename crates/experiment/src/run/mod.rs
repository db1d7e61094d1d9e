//! The runner: every frame of every source through every trial's pipeline, into logs and tables.
//!
//! A run is divided into [`Piece`](partition::Piece)s: some successive frames of one source, processed by every trial
//! that shares it. One thread computes a piece, which is stored when it is complete. All pieces are then joined into
//! one log for each trial and one table. The partition depends on the plan alone, so that results do not depend on the
//! number of threads, on the machines, or on interruptions.

use seafix_component::Fault;

mod assemble;
mod estimate;
mod folder;
mod group;
mod identity;
mod inputs;
mod kept;
mod lock;
pub(crate) mod manifest;
mod merge;
mod observer;
mod open_inputs;
mod options;
mod outcome;
mod partition;
mod setting_sentence;
mod sharing;
mod store;
mod worker;

pub use estimate::{RunEstimate, estimate};
pub use identity::{SHARED, SharedPart, components};
pub use kept::{Remade, remake};
pub use manifest::{changed_outputs, check_run, is_run, kept_identity};
pub use merge::merge;
pub use observer::{Observer, Silent};
pub use open_inputs::inputs;
pub use options::{Existing, Options, Shard};
pub use outcome::{Finished, RunError};

use crate::experiment::Plan;
use folder::Claim;
use manifest::Manifest;
use partition::Piece;
use store::Store;

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
    folder::input_inside(options, plan.inputs()).map_err(RunError::Output)?;
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
            Store::of(&claim.folder).remove(&claim.marker)?;
        }
        return Ok(Finished { rows: finished.rows, folder: claim.folder, kept: true });
    }
    observer.begins(frames(&mine), partition::bytes(&groups, &mine), &claim.folder);
    // The manifest is written first: a folder without it holds no run.
    manifest.write(&claim.folder, "running")?;
    let store = Store::open(&claim.folder, claim.marker.clone())?;
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
    store.remove(&claim.marker)?;
    Ok(Finished { folder: claim.folder, rows: manifest.rows, kept: false })
}
