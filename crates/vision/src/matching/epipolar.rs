//! The pairs of key points that the rig admits.

use nalgebra::{Vector2, Vector3};
use seafix_geometry::StereoRig;

use super::grid::Grid;
use crate::detect::Keypoint;

/// The limits of an admissible pair of key points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// The half-width of the epipolar band (px, Sampson distance).
    pub(super) px: f64,
    /// The minimum and the maximum depth in the left camera (m).
    pub(super) depths: [f64; 2],
}

/// The index of admissible pairs: within a Sampson distance (px) and limits of depth.
///
/// A grid holds the right key points by their undistorted directions, in which epipolar lines are straight, so a query
/// visits only points beside a line. This holds for any displacement of the cameras, even with epipoles in the images.
///
/// Source: Hartley and Zisserman, *Multiple View Geometry*, 2nd ed. 2004, eq. 11.9 (Sampson distance).
#[derive(Debug, Default)]
pub(super) struct Band {
    left: Vec<LeftRay>,
    right: Vec<RightRay>,
    grid: Grid,
    /// The translation of right_from_left (m).
    step: Vector3<f64>,
    /// The depth limits in the left camera (m).
    depths: [f64; 2],
    /// The largest squared slope of the right rays.
    steepest: f64,
}

#[derive(Debug)]
struct LeftRay {
    /// The epipolar line in the right image, scaled to pixels over the band's half-width.
    line: Vector3<f64>,
    /// The squared slope of `line`.
    slope: f64,
    /// The ray (X/Z, Y/Z, 1) in the axes of the right camera.
    turned: Vector3<f64>,
}

#[derive(Debug)]
struct RightRay {
    ray: Vector2<f64>,
    /// The squared slope of the epipolar line in the left image, unscaled.
    slope: f64,
}

impl Band {
    /// Replaces the key points.
    pub(super) fn fill(&mut self, left: &[Keypoint], right: &[Keypoint], rig: &StereoRig, limits: &Limits) {
        let motion = rig.right_from_left();
        let (rotation, essential) = (motion.rotation_matrix(), rig.essential());
        let (scale, transposed) = (rig.mean_focal() / limits.px, essential.transpose());
        (self.step, self.depths) = (motion.translation(), limits.depths);
        // Outside the range of the lens model the ray is NaN, which fails every comparison.
        let nowhere = Vector2::repeat(f64::NAN);
        self.left.clear();
        self.left.extend(left.iter().map(|keypoint| {
            let ray = rig.left().normalize(&keypoint.at).unwrap_or(nowhere).push(1.0);
            let line = essential * ray;
            LeftRay { line: line * scale, slope: line.xy().norm_squared(), turned: rotation * ray }
        }));
        self.right.clear();
        self.right.extend(right.iter().map(|keypoint| {
            let ray = rig.right().normalize(&keypoint.at).unwrap_or(nowhere);
            RightRay { ray, slope: (transposed * ray.push(1.0)).xy().norm_squared() }
        }));
        self.steepest = self.right.iter().map(|right| right.slope).fold(0.0, f64::max);
        self.grid.fill(self.right.iter().map(|right| right.ray.into()));
    }

    /// Visits each right key point that is admissible for left key point `i`, in arbitrary order.
    pub(super) fn visit(&self, i: usize, mut visit: impl FnMut(usize)) {
        let left = &self.left[i];
        if left.slope.is_finite() {
            let half = (left.slope + self.steepest).sqrt();
            self.grid.along_line(left.line.into(), half, |j| {
                if self.allows(i, j) {
                    visit(j);
                }
            });
        }
    }

    /// Whether left key point `i` and right key point `j` may see one point.
    pub(super) fn allows(&self, i: usize, j: usize) -> bool {
        let (left, right) = (&self.left[i], &self.right[j]);
        let off = left.line.x * right.ray.x + left.line.y * right.ray.y + left.line.z;
        off * off <= left.slope + right.slope
            && self.depth(left, right).is_some_and(|z| self.depths[0] <= z && z <= self.depths[1])
    }

    /// The depth z in the left camera at which z · turned + step lies along the right ray.
    ///
    /// `None` behind the right camera or for parallel rays.
    fn depth(&self, left: &LeftRay, right: &RightRay) -> Option<f64> {
        let ray = right.ray.push(1.0);
        let across = ray.cross(&left.turned);
        let z = -across.dot(&ray.cross(&self.step)) / across.norm_squared();
        ((left.turned * z + self.step).dot(&ray) > 0.0).then_some(z)
    }
}
