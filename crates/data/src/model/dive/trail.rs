//! The poses of a dive's pairs by an odometry.

use std::collections::HashMap;

use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Transform};
use seafix_navigation::{Odometry, OdometryTrajectory, RelativeMotion, StereoPair};
use seafix_vision::Threads;

use crate::stereo_pairs::StereoPairs;

/// The motions of a dive: the step that leads to each pair from the one before it.
#[derive(Debug, Clone)]
pub(super) struct Trail {
    /// For each pair, the segment of the odometry; `None` for a skipped pair.
    segments: Vec<Option<usize>>,
    /// For each pair, the preceding pair with a pose and the motion from it; `None` at the start of a segment.
    steps: Vec<Option<(usize, RelativeMotion)>>,
}

impl Trail {
    /// A dive of this number of pairs without any known motion.
    pub(super) fn unknown(pairs: usize) -> Self {
        Self { segments: vec![None; pairs], steps: vec![None; pairs] }
    }

    /// The motions of a trajectory over pairs with these stamps (ns).
    pub(super) fn of(trajectory: &OdometryTrajectory, stamps: &[u64]) -> Self {
        let index: HashMap<u64, usize> = stamps.iter().enumerate().map(|(index, stamp)| (*stamp, index)).collect();
        let mut trail = Self::unknown(stamps.len());
        for (number, segment) in trajectory.segments.iter().enumerate() {
            let mut before = None;
            for pose in &segment.poses {
                let Some(&pair) = index.get(&pose.stamp_ns) else { continue };
                trail.segments[pair] = Some(number);
                trail.steps[pair] = before.zip(pose.local);
                before = Some(pair);
            }
        }
        trail
    }

    /// The trail of a dive by an odometry; a pair that cannot be read is skipped, and reported.
    pub(super) fn by_odometry(
        dive: &StereoPairs,
        odometry: &dyn Odometry,
        progress: &mut dyn FnMut(),
    ) -> (Self, Vec<Fault>) {
        let mut session = odometry.begin(&dive.rig, dive.body_from_camera, Threads::Pool);
        let mut unread = Vec::new();
        for (index, &stamp_ns) in dive.stamps().iter().enumerate() {
            match dive.readings(index) {
                Ok(readings) => readings.iter().for_each(|reading| session.sense(reading)),
                Err(fault) => unread.push(fault),
            }
            match dive.pair(index) {
                Ok((left, right)) => {
                    let pair = StereoPair { stamp_ns, left: &left, right: &right };
                    if let Err(error) = session.advance(&pair) {
                        unread.push(Fault::new(error.to_string(), dive.path()));
                    }
                }
                Err(fault) => unread.push(fault),
            }
            progress();
        }
        (Self::of(&session.trajectory(), dive.stamps()), unread)
    }

    /// The number of pairs of the dive.
    pub(super) fn pairs(&self) -> usize {
        self.segments.len()
    }

    /// Whether no pair has a motion.
    pub(super) fn is_unknown(&self) -> bool {
        self.segments.iter().all(Option::is_none)
    }

    /// The motion `from_from_to` with its covariance, for pairs in any order; `None` across a break.
    pub(super) fn motion(&self, from: usize, to: usize) -> Option<RelativeMotion> {
        if from > to {
            let back = self.motion(to, from)?;
            return Some(RelativeMotion::new(back.motion.inverse(), back.covariance.inverse(&back.motion)));
        }
        if self.segments[from].is_none() || self.segments[from] != self.segments[to] {
            return None;
        }
        let mut motion = Transform::<Camera, Camera>::identity();
        let mut covariance = nalgebra::Matrix6::zeros();
        let mut here = to;
        while here != from {
            let (before, step) = self.steps[here].filter(|(before, _)| *before >= from)?;
            // With S the step and M the motion after it, S Exp(ξ) M = S M Exp(Ad(M⁻¹) ξ).
            let carried = motion.inverse().adjoint();
            covariance += carried * step.covariance.matrix * carried.transpose();
            motion = step.motion * motion;
            here = before;
        }
        Some(RelativeMotion::new(motion, Covariance6::new(covariance)))
    }

    /// The segment of a pair; `None` for a skipped one.
    pub(super) fn segment(&self, pair: usize) -> Option<usize> {
        self.segments[pair]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;
    use seafix_geometry::World;
    use seafix_navigation::{Segment, Waypoint};

    #[test]
    fn motions_compose_and_end_at_a_break() {
        let step = |k: f64| {
            let motion = Transform::<Camera, Camera>::exp(&[0.02 * k, -0.01, 0.03, 0.4, 0.1 * k, 0.05].into());
            RelativeMotion::new(motion, Covariance6::isotropic(1e-3 * k, 2e-3))
        };
        let pose =
            |stamp_ns, local| Waypoint { stamp_ns, world_from_camera: Transform::<World, Camera>::identity(), local };
        let segment = |poses| Segment { broken: None, poses };
        let trajectory = OdometryTrajectory {
            // Pair 30 was skipped.
            segments: vec![
                segment(vec![pose(10, None), pose(20, Some(step(1.0))), pose(40, Some(step(2.0)))]),
                segment(vec![pose(50, None)]),
            ],
            ..OdometryTrajectory::default()
        };
        let trail = Trail::of(&trajectory, &[10, 20, 30, 40, 50]);
        let both = trail.motion(0, 3).unwrap();
        assert!(both.motion.error_to(&(step(1.0).motion * step(2.0).motion)).norm() < 1e-15);
        let back = trail.motion(3, 0).unwrap();
        assert!(back.motion.error_to(&both.motion.inverse()).norm() < 1e-15);
        // The covariance is that of small errors of both steps.
        let mut numeric = nalgebra::Matrix6::zeros();
        for (k, axis) in (0..12).map(|k| (k / 6, k % 6)) {
            let one = step(k as f64 + 1.0);
            let xi = Vector6::ith(axis, 1e-6);
            let moved = [step(1.0).motion, step(2.0).motion];
            let mut moved = moved;
            moved[k] = moved[k].perturbed(&xi);
            let by = both.motion.error_to(&(moved[0] * moved[1])) / 1e-6;
            numeric += by * by.transpose() * one.covariance.matrix[(axis, axis)];
        }
        assert!((both.covariance.matrix - numeric).amax() < 1e-9 * numeric.amax() + 1e-11);
        assert!(trail.motion(0, 2).is_none() && trail.motion(0, 4).is_none());
    }
}
