//! Computation of pieces, each by one thread.

use std::sync::{
    Mutex,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use rayon::ThreadPool;
use seafix_component::Fault;
use seafix_log::{FrameRecord, FrameTimes, TargetTimes, Writer};
use seafix_referencing::ObjectObservations;

use crate::{
    results::Table,
    run::{
        group::Group,
        observer::Observer,
        outcome::RunError,
        partition::Piece,
        store::{Draft, Output, Store},
    },
};

/// Computes all `pieces`; `false` if the observer stopped it.
pub(super) fn work(
    groups: &[Group<'_>],
    pieces: &[&Piece],
    store: &Store,
    pool: &ThreadPool,
    timed: bool,
    observer: &dyn Observer,
) -> Result<bool, RunError> {
    let (next, halted, failure) = (AtomicUsize::new(0), AtomicBool::new(false), Mutex::new(None));
    let stops = || halted.load(Ordering::Relaxed) || observer.stops();
    pool.scope(|scope| {
        for _ in 0..pool.current_num_threads().min(pieces.len()) {
            scope.spawn(|_| {
                while let Some(piece) = pieces.get(next.fetch_add(1, Ordering::Relaxed)).filter(|_| !stops()) {
                    match make(&groups[piece.group], piece, store, timed, observer, &stops) {
                        Ok(true) => {}
                        Ok(false) => break,
                        Err(error) => {
                            halted.store(true, Ordering::Relaxed);
                            failure.lock().expect("no thread panics while it holds this").get_or_insert(error);
                        }
                    }
                }
            });
        }
    });
    match failure.into_inner().expect("no thread panics while it holds this") {
        Some(error) => Err(error),
        None => Ok(!observer.stops() || pieces.iter().all(|piece| store.has(piece.number))),
    }
}

/// Computes one piece; `false` if it was stopped. Its logs are then closed after the last frame.
fn make(
    group: &Group<'_>,
    piece: &Piece,
    store: &Store,
    timed: bool,
    observer: &dyn Observer,
    stops: &dyn Fn() -> bool,
) -> Result<bool, RunError> {
    let input = |fault: Fault| RunError::Input(vec![fault]);
    let draft = Draft::begin(store, piece.number)?;
    let mut outputs = Vec::with_capacity(group.trials.len());
    for (trial, header) in group.trials.iter().zip(&group.headers) {
        let log = Writer::piece(&draft.log(&trial.name), header)?;
        outputs.push(Output {
            trial: trial.name.clone(),
            log,
            thinned: piece.thinned(),
            table: Table::default(),
            pose_graph: None,
        });
    }
    let back = group.window_length();
    let mut sessions = group.sessions();
    let mut observations_by_frame: Vec<Vec<ObjectObservations>> = Vec::new();
    for index in piece.first.saturating_sub(back)..piece.first {
        observations_by_frame.push(group.observe(index, &mut sessions).map_err(input)?.observations_by_frame);
    }
    for index in piece.first..piece.end {
        if stops() {
            draft.abandon(outputs)?;
            return Ok(false);
        }
        let mut group_frame = group.observe(index, &mut sessions).map_err(input)?;
        observations_by_frame.push(std::mem::take(&mut group_frame.observations_by_frame));
        let mut kept = vec![false; outputs.len()];
        let (records, levels) = group.record(index, group_frame, &observations_by_frame, |which, record| {
            kept[which] = outputs[which].thinned.keeps(record);
            kept[which]
        });
        observations_by_frame.drain(..observations_by_frame.len().saturating_sub(back));
        for (((mut record, output), kept), trial) in records.into_iter().zip(&mut outputs).zip(kept).zip(&group.trials)
        {
            if !timed {
                forget_times(&mut record);
            }
            if kept {
                output.log.frame_with(&record, levels.pngs(trial.resolved.log.images))?;
            }
            output.table.add(&output.trial, &record);
            observer.frame(&output.trial);
        }
    }
    for (output, pose_graph) in outputs.iter_mut().zip(sessions.pose_graphs()) {
        output.pose_graph = pose_graph;
    }
    draft.seal(piece.first, piece.end, outputs)?;
    Ok(true)
}

/// Removes the durations, which differ from run to run.
fn forget_times(record: &mut FrameRecord) {
    record.times = FrameTimes::default();
    record.targets.iter_mut().for_each(|target| target.times = TargetTimes::default());
}
