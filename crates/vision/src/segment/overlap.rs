//! The epipolar overlap of two segments.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Vector2, Vector3};
use seafix_geometry::StereoRig;

/// The epipolar geometry of a rig, for the directions of segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Epipolar {
    essential: Matrix3<f64>,
    rotation: Matrix3<f64>,
    step: Vector3<f64>,
    focal: f64,
}

/// The parts of two segments that may see the same part of one line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overlap {
    /// The positions of the common part on the left segment, 0 at its first end and 1 at its second.
    pub(super) left: [f64; 2],
    /// The corresponding positions on the right segment.
    pub(super) right: [f64; 2],
    /// The depths of both ends in the left camera (m).
    pub(super) depths: [f64; 2],
    /// The smaller sine of the angle between a segment and its epipolar line.
    pub(super) sine: f64,
}

impl Overlap {
    /// The inverse depth in the middle (1/m).
    pub(super) fn inverse_depth(&self) -> f64 {
        0.5 * (1.0 / self.depths[0] + 1.0 / self.depths[1])
    }

    /// The common part as a fraction of the shorter segment.
    pub(super) fn fraction(&self) -> f64 {
        (self.left[1] - self.left[0]).max(self.right[1] - self.right[0])
    }
}

/// The pairs of segments that may be one line.
pub(super) struct PairRules {
    /// Minimum sine of the angle to the epipolar lines at which segments are cut along them.
    pub(super) sine: f64,
    /// The range of depths (m).
    pub(super) depths: RangeInclusive<f64>,
    /// Minimum common part, as a fraction of the shorter segment.
    pub(super) min_overlap: f64,
}

/// The point at the position s between two directions.
pub(super) fn between(ends: &[Vector2<f64>; 2], s: f64) -> Vector2<f64> {
    ends[0] + (ends[1] - ends[0]) * s
}

impl Epipolar {
    pub(super) fn new(rig: &StereoRig) -> Self {
        let motion = rig.right_from_left();
        Self {
            essential: *rig.essential(),
            rotation: motion.rotation_matrix(),
            step: motion.translation(),
            focal: rig.mean_focal(),
        }
    }

    /// The depth in the left camera at which the rays of both directions are nearest; `None` behind a camera.
    pub(super) fn depth(&self, left: &Vector2<f64>, right: &Vector2<f64>) -> Option<f64> {
        let (turned, ray) = (self.rotation * left.push(1.0), right.push(1.0));
        let across = ray.cross(&turned);
        let z = -across.dot(&ray.cross(&self.step)) / across.norm_squared();
        (z > 0.0 && (turned * z + self.step).dot(&ray) > 0.0).then_some(z)
    }

    /// The distance of two directions from the epipolar constraint (px, Sampson).
    fn distance(&self, left: &Vector2<f64>, right: &Vector2<f64>) -> f64 {
        let (l, r) = (left.push(1.0), right.push(1.0));
        let (on_right, on_left) = (self.essential * l, self.essential.transpose() * r);
        let slope = on_right.xy().norm_squared() + on_left.xy().norm_squared();
        (self.focal * r.dot(&on_right) / slope.sqrt()).abs()
    }

    /// The common part of two segments that may be one line.
    pub(super) fn possible(
        &self,
        left: &[Vector2<f64>; 2],
        right: &[Vector2<f64>; 2],
        rules: &PairRules,
    ) -> Option<Overlap> {
        /// The distance (px) from an epipolar line up to which ends correspond.
        const ENDS: f64 = 3.0;
        self.overlap(left, right, rules.sine, ENDS).filter(|overlap| {
            overlap.depths.iter().all(|z| rules.depths.contains(z)) && overlap.fraction() >= rules.min_overlap
        })
    }

    /// The common part of two segments whose brighter sides agree; `None` without one.
    ///
    /// Each end is carried to the other image where its epipolar line meets the segment. Close to the epipolar lines
    /// (a sine below `sine`) the lines meet anywhere; there the ends themselves correspond, if they lie within `px` of
    /// each other's epipolar lines.
    pub(super) fn overlap(
        &self,
        left: &[Vector2<f64>; 2],
        right: &[Vector2<f64>; 2],
        sine: f64,
        px: f64,
    ) -> Option<Overlap> {
        let transposed = self.essential.transpose();
        let meet = |essential: &Matrix3<f64>, from: &Vector2<f64>, onto: &[Vector2<f64>; 2]| {
            let line = essential * from.push(1.0);
            let w = onto[1] - onto[0];
            let slope = line.xy().dot(&w);
            (-line.dot(&onto[0].push(1.0)) / slope, slope.abs() / (line.xy().norm() * w.norm()))
        };
        let on_right = [0, 1].map(|end| meet(&self.essential, &left[end], right));
        let on_left = [0, 1].map(|end| meet(&transposed, &right[end], left));
        let minimum = on_right.iter().chain(&on_left).map(|meeting| meeting.1).fold(1.0, f64::min);
        if minimum < sine {
            let near = [0, 1].iter().all(|&end| self.distance(&left[end], &right[end]) < px);
            let depths = [self.depth(&left[0], &right[0])?, self.depth(&left[1], &right[1])?];
            return near.then_some(Overlap { left: [0.0, 1.0], right: [0.0, 1.0], depths, sine: minimum });
        }
        let clip = |a: f64, b: f64| (a < b).then_some([a.max(0.0), b.min(1.0)]).filter(|[a, b]| a < b);
        let l = clip(on_left[0].0, on_left[1].0)?;
        clip(on_right[0].0, on_right[1].0)?;
        let r = l.map(|s| meet(&self.essential, &between(left, s), right).0);
        let depth = |end: usize| self.depth(&between(left, l[end]), &between(right, r[end]));
        Some(Overlap { left: l, right: r, depths: [depth(0)?, depth(1)?], sine: minimum })
    }
}
