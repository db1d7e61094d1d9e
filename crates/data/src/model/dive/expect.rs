//! The expected pixels of features in a pair.

use nalgebra::{Matrix3, Matrix3x6, Matrix4, Matrix6};
use seafix_geometry::{Camera, Pixel, Point, StereoRig, Transform, World, so3::skew};

use super::{find::Expectation, trail::Trail};

/// A pose with the uncertainty of its motion from an adjusted pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExpectedPose {
    /// The pose.
    pub(super) world_from_camera: Transform<World, Camera>,
    /// The covariance of ξ in `world_from_camera · Exp(ξ)`; zero for an adjusted pair.
    pub(super) covariance: Matrix6<f64>,
}

/// The distance (px) of a searched feature from the borders: half of a window.
pub(super) const MARGIN: f64 = 8.0;
/// The standard deviation (px) of an expectation beyond those of pose and point: the feature's own pixels.
pub(super) const SLACK: f64 = 0.3;

impl ExpectedPose {
    /// The pose of a pair: its own, or that of the nearest pair with one and the motion from there; `None` without both.
    pub(super) fn of(pair: usize, poses: &[Option<Transform<World, Camera>>], trail: &Trail) -> Option<Self> {
        if let Some(world_from_camera) = poses[pair] {
            return Some(Self { world_from_camera, covariance: Matrix6::zeros() });
        }
        let before = (0..pair).rev().find_map(|other| Some((other, poses[other]?)));
        let after = (pair + 1..poses.len()).find_map(|other| Some((other, poses[other]?)));
        let from = |(other, pose): (usize, Transform<World, Camera>)| {
            let motion = trail.motion(other, pair)?;
            Some(Self { world_from_camera: pose * motion.motion, covariance: motion.covariance.matrix })
        };
        let both = [before.and_then(from), after.and_then(from)];
        both.into_iter().flatten().min_by(|a, b| a.covariance.trace().total_cmp(&b.covariance.trace()))
    }

    /// The expected pixels of a point with the covariance `spread` (m², world axes); `None` outside of an image.
    pub(super) fn sees(&self, rig: &StereoRig, at: &Point<World>, spread: &Matrix3<f64>) -> Option<Expectation> {
        let camera_from_world = self.world_from_camera.inverse();
        let here = camera_from_world * *at;
        if here.coords.z <= 0.0 {
            return None;
        }
        rig.sees(&here, MARGIN)?;
        let (pixels, by_camera) = rig.project_with_jacobian(&here)?;
        let mut of_pose = Matrix3x6::zeros();
        of_pose.fixed_columns_mut::<3>(0).copy_from(&skew(&here.coords));
        of_pose.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
        let turn = camera_from_world.rotation_matrix();
        let in_camera = turn * spread * turn.transpose() + of_pose * self.covariance * of_pose.transpose();
        let covariance = by_camera * in_camera * by_camera.transpose() + Matrix4::identity() * (SLACK * SLACK);
        Some(Expectation { pixels, covariance })
    }

    /// The position of a point in the left image with its standard deviations along u and v (px), inside the image or
    /// not; `None` behind the camera.
    pub(super) fn position(
        &self,
        rig: &StereoRig,
        at: &Point<World>,
        spread: &Matrix3<f64>,
    ) -> Option<(Pixel, [f64; 2])> {
        let camera_from_world = self.world_from_camera.inverse();
        let (pixel, by_camera) = rig.left().project_with_jacobian(&(camera_from_world * *at))?;
        let by = by_camera * camera_from_world.rotation_matrix();
        let covariance = by * spread * by.transpose();
        Some((pixel, [0, 1].map(|k| covariance[(k, k)].sqrt())))
    }
}
