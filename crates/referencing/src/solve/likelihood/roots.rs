//! The poses that three points admit for one camera alone (P3P).

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Point, StereoRig, Transform};

use crate::{
    observations::{Observation, Observations},
    solve::{
        closed_form::fit,
        degeneracy::{Degenerate, widest},
        likelihood::p3p,
    },
};

/// Up to eight poses, in order of their cost over the pixels of all points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Roots {
    poses: [Transform<Object, Camera>; 8],
    costs: [f64; 8],
    count: usize,
}

impl Default for Roots {
    fn default() -> Self {
        Self { poses: [Transform::identity(); 8], costs: [f64::INFINITY; 8], count: 0 }
    }
}

impl Roots {
    pub(crate) fn as_slice(&self) -> &[Transform<Object, Camera>] {
        &self.poses[..self.count]
    }

    /// Inserts a pose in the order of costs.
    fn insert(&mut self, pose: Transform<Object, Camera>, cost: f64) {
        let place = self.costs[..self.count].partition_point(|&known| known <= cost);
        if place < 8 {
            self.poses[place..].rotate_right(1);
            self.costs[place..].rotate_right(1);
            (self.poses[place], self.costs[place]) = (pose, cost);
            self.count = (self.count + 1).min(8);
        }
    }
}

/// The P3P poses of the left camera for three widely spread points.
pub(crate) fn roots(data: &Observations<'_>, rig: &StereoRig) -> Roots {
    let mut roots = Roots::default();
    roots.of_camera(data, rig, widest(data), false);
    roots
}

impl Roots {
    /// Adds the P3P poses of these three points for the left or the right camera.
    pub(crate) fn of_camera(&mut self, data: &Observations<'_>, rig: &StereoRig, three: [usize; 3], right: bool) {
        let mut three = three.map(|i| data.points[i]);
        let ray = |point: &Observation| -> Option<Vector3<f64>> {
            let seen = point.pixels?.at;
            let direction = if right { rig.right().normalize(&seen.right) } else { rig.left().normalize(&seen.left) };
            Some(direction?.push(1.0).normalize())
        };
        let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|i| ray(&three[i])) else { return };
        let rays = [a, b, c];
        let left_from_right = rig.right_from_left().inverse();
        for lambda in p3p::distances(&rays, &three.map(|point| point.model.coords)).as_slice() {
            for ((point, ray), distance) in three.iter_mut().zip(&rays).zip(lambda.iter()) {
                let at = ray * *distance;
                point.measured.at = if right { left_from_right * Point::from(at) } else { Point::from(at) };
            }
            let pose = fit(&three);
            if let Ok(cost) = squares(data, rig, &pose) {
                self.insert(pose, cost);
            }
        }
    }
}

/// The unweighted sum of squared pixel residuals (px²).
///
/// # Errors
///
/// The first point out of a camera's view.
pub(crate) fn squares(
    data: &Observations<'_>,
    rig: &StereoRig,
    pose: &Transform<Object, Camera>,
) -> Result<f64, Degenerate> {
    let camera_from_object = pose.inverse();
    let of = |(index, point): (usize, &Observation)| {
        let place = camera_from_object * point.model;
        let expected = rig.project(&place).ok_or(Degenerate::Hidden { index, depth: place.coords.z })?;
        let seen = point.pixels.ok_or(Degenerate::NoPixels)?;
        Ok((seen.at.coordinates() - expected.coordinates()).norm_squared())
    };
    data.points.iter().enumerate().map(of).sum()
}
