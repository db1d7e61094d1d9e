//! Several starts, one answer: the likeliest.

use seafix_geometry::{Camera, Object, Point, StereoRig, Transform};

use super::{
    descent::{Linearized, Term, descend, linearize, settle},
    kabsch,
    roots::roots,
};
use crate::{Observation, Observations};

/// A tenth of a standard deviation: near enough for weights to be taken anew.
const COARSE: f64 = 1e-2;
/// An attitude less certain than this (rad, three axes together) may lie in the wrong valley.
const WEAK: f64 = 0.01;

/// The pose of least cost that is reached from the unweighted fit and, where that leaves a doubt, from the poses
/// that three points allow the left camera alone; `starts` in all.
///
/// `coarse` has weights that do not depend on the pose and leads near the minimum, `fine` is what is solved.
/// The first answer is doubted when its attitude is weak or its χ² unlikely: other valleys are then looked into.
pub(super) fn likeliest(
    data: &Observations<'_>,
    rig: &StereoRig,
    starts: usize,
    coarse: &impl Fn(&Observation, &Point<Camera>) -> Option<Term>,
    fine: &impl Fn(&Observation, &Point<Camera>) -> Option<Term>,
) -> Option<Transform<Object, Camera>> {
    let points = &data.points;
    let from = |start: &Transform<Object, Camera>| {
        let near = descend(points, start, COARSE, coarse)?;
        let pose = settle(points, &near, fine)?;
        Some((linearize(points, &pose, fine)?, pose))
    };
    let first = from(&kabsch::fit(points));
    if starts == 1 || first.as_ref().is_some_and(|(all, _)| is_clear(all, points.len())) {
        return first.map(|(_, pose)| pose);
    }
    let mut best = first.map(|(all, pose)| (all.cost, pose));
    for (all, pose) in roots(data, rig).as_slice().iter().take(starts - 1).filter_map(from) {
        // Two starts in one valley give one cost: of equals the first stands.
        if best.is_none_or(|(least, _)| all.cost < least * (1.0 - 1e-6)) {
            best = Some((all.cost, pose));
        }
    }
    best.map(|(_, pose)| pose)
}

fn is_clear(all: &Linearized, points: usize) -> bool {
    let most = 4.0 * points as f64;
    let likely = all.cost <= most + 5.0 * (2.0 * most).sqrt();
    likely && all.attitude_variance().is_some_and(|variance| variance <= WEAK * WEAK)
}
