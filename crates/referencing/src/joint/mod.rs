//! One fix over everything in view: several objects, several instants, one rig.
//!
//! A site's objects are known each by itself, and where they stand to each other by a survey. Its error is the same for all
//! points of an object and for all instants: six numbers an object, shared, not noise of every point. Poses and those
//! six are therefore estimated together, and the survey is an observation like the pixels. An object of which one or two
//! points are in view has no fix of its own, but its survey makes an observation of them all the same: they are sought
//! where the others put them.

mod displaced;
mod gather;
mod system;
#[cfg(test)]
mod tests;

use faer::Mat;
use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use crate::{
    Degenerate, Observation, Observations,
    solve::{least_squares, wide_enough},
};
pub use displaced::{JointFixes, RelativePose, Unjoined, joint_fixes};
pub use gather::{Gathered, Unadded, gather};
use system::{JointState, System};

/// What is known of where an object stands in the site's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one an object: a survey's thirty-six numbers are little beside its points"
)]
pub enum Placement {
    /// It stands where it is said to: of the object whose frame is the site's, by definition.
    Exact,
    /// It stands there with this covariance of η in `site_from_object_true = site_from_object · Exp(η)`.
    Surveyed(Covariance6<Object, Object>),
    /// It may have been displaced: nothing but the images say where it stands.
    Displaced,
}

/// An object of the site.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Member {
    /// Where it is said to stand: its frame in the site's.
    pub site_from_object: Transform<Object, Object>,
    /// How well that is known.
    pub placement: Placement,
}

/// What one instant saw: points with the index of their object, model places in that object's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectObservations {
    /// The points.
    pub points: Vec<(usize, Observation)>,
}

impl ObjectObservations {
    /// Adds points of an object.
    pub fn see(&mut self, object: usize, data: &Observations<'_>) {
        self.points.extend(data.points.iter().map(|point| (object, *point)));
    }

    /// How many points of an object it has.
    pub fn count(&self, object: usize) -> usize {
        self.points.iter().filter(|(o, _)| *o == object).count()
    }
}

/// The fix of all instants.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFix {
    /// The pose of each instant: the camera in the site's frame, and its covariance.
    pub site_from_camera: Vec<(Transform<Object, Camera>, Covariance6<Object, Camera>)>,
    /// Where each object stands, and how well that is now known; a covariance of nought where it is exact.
    pub site_from_object: Vec<(Transform<Object, Object>, Covariance6<Object, Object>)>,
    /// χ² of pixels and surveys together.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub dof: usize,
    /// The covariance of all unknowns together.
    covariance: Mat<f64>,
    /// For each object the block of its six unknowns.
    unknowns: Vec<Option<usize>>,
}

impl JointFix {
    /// The camera of an instant relative to an object, with its covariance: both err together, and what they share
    /// cancels.
    ///
    /// With T_sc = T̂_sc Exp(ξ) and T_so = T̂_so Exp(η): T_oc = T̂_oc Exp(ξ − Ad(T̂_co) η) to first order.
    ///
    /// # Panics
    /// When an index is out of range.
    pub fn object_from_camera(&self, instant: usize, object: usize) -> RelativePose {
        let (site_from_camera, own) = &self.site_from_camera[instant];
        let pose = self.site_from_object[object].0.inverse() * *site_from_camera;
        let Some(place) = self.unknowns[object] else { return (pose, *own) };
        let block = |a: usize, b: usize| Matrix6::from_fn(|i, j| self.covariance[(6 * a + i, 6 * b + j)]);
        let ad = pose.inverse().adjoint();
        let shared = ad * block(place, instant);
        let all = own.matrix + ad * block(place, place) * ad.transpose() - shared - shared.transpose();
        (pose, Covariance6::new(all))
    }
}

/// The most likely poses of all instants and places of all objects, from the pixels that `rig` saw and the surveys:
/// least Σ rᵀ S⁻¹ r + Σ ηᵀ Σ_survey⁻¹ η, by Levenberg's and Marquardt's steps on the dense normal equations.
///
/// Each instant starts from the unweighted fit of its points, their objects standing where they are said to; an object
/// displaced by much is found from there as long as others, or most points, stand still.
///
/// # Errors
/// [`Degenerate`]: an instant with fewer than three points or with points on a line, points without pixels, a point behind
/// the camera, or a motion that nothing determines (a displaced object that nobody else's place relates to the site).
///
/// # Panics
/// When the index of an object is out of range.
pub fn joint_fix(
    rig: &StereoRig,
    members: &[Member],
    observations_by_frame: &[ObjectObservations],
) -> Result<JointFix, Degenerate> {
    let mut poses = Vec::with_capacity(observations_by_frame.len());
    for object_observations in observations_by_frame {
        if object_observations.points.iter().any(|(_, point)| point.pixels.is_none()) {
            return Err(Degenerate::NoPixels);
        }
        let in_site = |(object, point): &(usize, Observation)| Observation {
            model: members[*object].site_from_object * point.model,
            ..*point
        };
        let data = Observations { points: object_observations.points.iter().map(in_site).collect(), rig: Some(rig) };
        wide_enough(&data)?;
        poses.push(least_squares(&data.points));
    }
    if poses.is_empty() {
        return Err(Degenerate::TooFew { found: 0, needed: 3 });
    }
    let start = JointState { poses, places: members.iter().map(|member| member.site_from_object).collect() };
    let system = System::new(rig, members, observations_by_frame)?;
    let (state, chi2) = system.minimize(start)?;
    let covariance = system.covariance(&state)?;
    let block = |at: Option<usize>| {
        at.map_or_else(Matrix6::zeros, |b| Matrix6::from_fn(|i, j| covariance[(6 * b + i, 6 * b + j)]))
    };
    Ok(JointFix {
        site_from_camera: (0..observations_by_frame.len())
            .map(|f| (state.poses[f], Covariance6::new(block(Some(f)))))
            .collect(),
        site_from_object: (0..members.len())
            .map(|o| (state.places[o], Covariance6::new(block(system.unknown(o)))))
            .collect(),
        chi2,
        dof: system.dof(),
        unknowns: (0..members.len()).map(|o| system.unknown(o)).collect(),
        covariance,
    })
}
