//! A joint fix of several objects.

use faer::Mat;
use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use crate::{
    joint::{
        member::{Member, ObjectObservations},
        relative_pose::RelativePose,
        system::{JointState, System, with_edges},
    },
    observations::{Observation, Observations},
    solve::{
        closed_form::fit as least_squares,
        degeneracy::{Degenerate, wide_enough},
    },
};

/// The joint fix of all instants.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFix {
    /// The camera's pose in the site's frame and its covariance, for each instant.
    pub site_from_camera: Vec<(Transform<Object, Camera>, Covariance6<Object, Camera>)>,
    /// The pose of each object in the site's frame and its covariance; zero covariance for an exact pose.
    pub site_from_object: Vec<(Transform<Object, Object>, Covariance6<Object, Object>)>,
    /// χ² of pixels and surveys together.
    pub chi2: f64,
    /// The degrees of freedom of χ².
    pub dof: usize,
    /// The joint covariance of all unknowns.
    covariance: Mat<f64>,
    /// The index of each object's block of six unknowns.
    unknowns: Vec<Option<usize>>,
}

impl JointFix {
    /// The camera's pose relative to an object at one instant, with its covariance.
    ///
    /// The errors of camera and object pose are correlated, and their common part cancels. With T_sc = T̂_sc Exp(ξ) and
    /// T_so = T̂_so Exp(η): T_oc = T̂_oc Exp(ξ − Ad(T̂_co) η) to first order.
    ///
    /// # Panics
    ///
    /// If an index is out of range.
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

/// The pose of the camera in the site from the fix of one object, of several the one under which all features fit best.
fn nearest_start(
    rig: &StereoRig,
    members: &[Member],
    observations: &ObjectObservations,
) -> Option<Transform<Object, Camera>> {
    let groups = with_edges(rig, std::slice::from_ref(observations));
    let system = System::new(rig, members, std::slice::from_ref(observations), &groups).ok()?;
    let places: Vec<_> = members.iter().map(|member| member.site_from_object).collect();
    let starts = observations.poses.iter().map(|(object, pose)| places[*object] * *pose);
    let costs = starts
        .filter_map(|pose| Some((system.cost(&JointState { poses: vec![pose], places: places.clone() }).ok()?, pose)));
    costs.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pose)| pose)
}

/// The maximum-likelihood poses of all instants and objects, from pixels and surveys.
///
/// It minimises Σ rᵀ S⁻¹ r + Σ ηᵀ Σ_survey⁻¹ η by the Levenberg–Marquardt method on the dense normal equations, r being
/// the pixel residuals of points and the offsets of edges. Features of one object that share model places at one instant
/// share their errors. Each instant starts from the unweighted fit of its points, or from the pose of an object if the
/// points determine none, with the objects at their stated poses; a far displaced object
/// is found from there as long as other objects, or most points, are at their stated poses.
///
/// # Errors
///
/// [`Degenerate`], for an instant without a start, with points or edges without pixels, a point
/// behind the camera, or an undetermined motion (a displaced object that no other object relates to the site).
///
/// # Panics
///
/// If the index of an object is out of range.
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
        if object_observations.edges.iter().any(|(_, edge)| edge.measured.segments.is_none()) {
            return Err(Degenerate::NoPixels);
        }
        let in_site = |(object, point): &(usize, Observation)| Observation {
            model: members[*object].site_from_object * point.model,
            ..*point
        };
        let data = Observations {
            points: object_observations.points.iter().map(in_site).collect(),
            edges: Vec::new(),
            rig: Some(rig),
        };
        poses.push(match wide_enough(&data) {
            Ok(()) => least_squares(&data.points),
            Err(why) => nearest_start(rig, members, object_observations).ok_or(why)?,
        });
    }
    if poses.is_empty() {
        return Err(Degenerate::TooFew { found: 0, needed: 3 });
    }
    let start = JointState { poses, places: members.iter().map(|member| member.site_from_object).collect() };
    let groups = with_edges(rig, observations_by_frame);
    let system = System::new(rig, members, observations_by_frame, &groups)?;
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
