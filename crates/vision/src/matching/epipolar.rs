//! Which pairs of key points the rig allows.

use nalgebra::{Vector2, Vector3};
use seafix_geometry::StereoRig;

use crate::Keypoint;

/// The pairs that see one point within a distance in pixels and limits of depth.
///
/// Source: Hartley and Zisserman, *Multiple View Geometry*, 2nd ed. 2004, eq. 11.9 (Sampson distance).
#[derive(Debug)]
pub(super) struct Band {
    left: Vec<LeftRay>,
    right: Vec<RightRay>,
    /// Translation of right_from_left (m).
    step: Vector3<f64>,
    /// Depth limits in the left camera (m).
    depths: [f64; 2],
}

#[derive(Debug)]
struct LeftRay {
    /// The epipolar line in the right image, scaled to pixels over the band's half width.
    line: Vector3<f64>,
    /// Squared slope of `line`.
    slope: f64,
    /// The ray, (X/Z, Y/Z, 1), in the axes of the right camera.
    turned: Vector3<f64>,
}

#[derive(Debug)]
struct RightRay {
    ray: Vector2<f64>,
    /// Squared slope of the epipolar line in the left image, not scaled.
    slope: f64,
}

impl Band {
    /// The band of half width `px` (px) for points between these depths (m).
    pub(super) fn new(
        left: &[Keypoint],
        right: &[Keypoint],
        rig: &StereoRig,
        px: f64,
        min_depth: f64,
        max_depth: f64,
    ) -> Self {
        let motion = rig.right_from_left();
        let (rotation, step) = (motion.rotation_matrix(), motion.translation());
        let (essential, focal) = (rig.essential(), rig.mean_focal());
        // Where the lens model has no direction the ray is not a number, which no comparison allows.
        let nowhere = Vector2::repeat(f64::NAN);
        let left = left.iter().map(|keypoint| {
            let ray = rig.left().normalize(&keypoint.at).unwrap_or(nowhere).push(1.0);
            let line = essential * ray;
            LeftRay { line: line * (focal / px), slope: line.xy().norm_squared(), turned: rotation * ray }
        });
        let right = right.iter().map(|keypoint| {
            let ray = rig.right().normalize(&keypoint.at).unwrap_or(nowhere);
            RightRay { ray, slope: (essential.transpose() * ray.push(1.0)).xy().norm_squared() }
        });
        Self { left: left.collect(), right: right.collect(), step, depths: [min_depth, max_depth] }
    }

    /// Whether left key point `i` and right key point `j` can see one point.
    pub(super) fn allows(&self, i: usize, j: usize) -> bool {
        let (left, right) = (&self.left[i], &self.right[j]);
        let off = left.line.x * right.ray.x + left.line.y * right.ray.y + left.line.z;
        off * off <= left.slope + right.slope
            && self.depth(left, right).is_some_and(|z| self.depths[0] <= z && z <= self.depths[1])
    }

    /// The depth z in the left camera at which z · turned + step points along the right ray; `None`
    /// behind the right camera or with parallel rays.
    fn depth(&self, left: &LeftRay, right: &RightRay) -> Option<f64> {
        let ray = right.ray.push(1.0);
        let across = ray.cross(&left.turned);
        let z = -across.dot(&ray.cross(&self.step)) / across.norm_squared();
        ((left.turned * z + self.step).dot(&ray) > 0.0).then_some(z)
    }
}
