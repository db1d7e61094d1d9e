//! Several starts, one answer: the likeliest.

use std::cell::RefCell;

use seafix_geometry::{Camera, Object, StereoRig, Transform};

use super::{
    Degenerate,
    descent::{Linearized, NEAR, descend, linearize, settle},
    kabsch,
    roots::roots,
    sightings::Sightings,
};
use crate::Observations;

/// An attitude less certain than this (rad, three axes together) may lie in the wrong valley.
const WEAK: f64 = 0.01;

/// The pose of least cost that is reached from the unweighted fit and, where that leaves a doubt, from the poses
/// that three points allow one camera alone; `starts` in all.
///
/// The first answer is doubted when its attitude is weak or its χ² unlikely: other valleys are then looked into. A valley
/// whose minimum was not reached is no reason to believe in one that is higher.
///
/// # Errors
/// That of the first start, where none leads to a minimum, and that of a start that did not reach its own where that is below
/// all others.
pub(super) fn likeliest(
    data: &Observations<'_>,
    rig: &StereoRig,
    starts: usize,
    sightings: &Sightings<'_>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let points = &data.points;
    let (frozen, live) = (|k: usize, at: &_| sightings.frozen(k, at), |k: usize, at: &_| sightings.live(k, at));
    // The lowest valley whose minimum was not reached, and why.
    let unfinished: RefCell<Option<(f64, Degenerate)>> = RefCell::default();
    let from = |start: &Transform<Object, Camera>| {
        let (near, here) = descend(points, start, NEAR, &frozen)?;
        let here =
            if sightings.weights_move { linearize(points, &near, &live).ok_or(Degenerate::Hidden)? } else { here };
        let cost = here.cost;
        settle(points, near, here, &live).inspect_err(|why| {
            let mut lowest = unfinished.borrow_mut();
            if lowest.as_ref().is_none_or(|(known, _)| cost < *known) {
                *lowest = Some((cost, why.clone()));
            }
        })
    };
    let first = from(&kabsch::fit(points));
    if starts == 1 || first.as_ref().is_ok_and(|(_, all)| is_clear(all, points.len())) {
        return first.map(|(pose, _)| pose);
    }
    let mut best = first.map(|(pose, all)| (all.cost, pose));
    for (pose, all) in roots(data, rig).as_slice().iter().take(starts - 1).filter_map(|root| from(root).ok()) {
        // Two starts in one valley give one cost: of equals the first stands.
        if best.as_ref().is_ok_and(|(least, _)| all.cost >= least * (1.0 - 1e-6)) {
            continue;
        }
        best = Ok((all.cost, pose));
    }
    let (least, pose) = best?;
    match unfinished.into_inner() {
        Some((lower, why)) if lower < least => Err(why),
        _ => Ok(pose),
    }
}

fn is_clear(all: &Linearized, points: usize) -> bool {
    let most = 4.0 * points as f64;
    let likely = all.cost <= most + 5.0 * (2.0 * most).sqrt();
    likely && all.attitude_variance().is_some_and(|variance| variance <= WEAK * WEAK)
}
