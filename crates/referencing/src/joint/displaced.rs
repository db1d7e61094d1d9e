//! A joint fix that does not believe a survey against the images.

use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use super::{JointFix, Member, ObjectObservations, Placement, joint_fix};
use crate::{Degenerate, candidates::chi_square};

/// The camera relative to an object, and its covariance.
pub type RelativePose = (Transform<Object, Camera>, Covariance6<Object, Camera>);

/// The fixes of the last instant, relative to each object it saw.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFixes {
    /// For each object the camera's pose relative to it; `None` of objects that the last instant did not see.
    pub object_from_camera: Vec<Option<RelativePose>>,
    /// The objects that do not stand where they were surveyed, by their indices.
    pub displaced: Vec<usize>,
    /// The objects of one or two points that contradict the rest, by their indices: their points take no part.
    pub left_out: Vec<usize>,
    /// χ² of pixels and surveys together.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub dof: usize,
    /// What χ² exceeds with one minus the confidence.
    pub chi2_limit: f64,
}

/// Why there is no joint fix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unjoined {
    /// The points determine none.
    #[error(transparent)]
    Degenerate(#[from] Degenerate),
    /// No surveys that are given up reconcile the images.
    #[error(
        "pixels and surveys together have χ² = {chi2:.1}; at most {limit:.1} is likely, whichever surveys are given up"
    )]
    Contradiction {
        /// χ² with the surveys that were left.
        chi2: f64,
        /// What a true fix exceeds with one minus the confidence.
        limit: f64,
    },
}

/// One fix over all `observations_by_frame`, the last of which is asked for; surveys that the images contradict at this `confidence`
/// are given up, one object after the other: always that without whose survey χ² is least. An object of which no glimpse
/// has three points cannot say where it stands itself: instead of its survey its points are given up.
///
/// # Errors
/// As [`joint_fix`], and where the images contradict each other whatever the surveys are.
///
/// # Panics
/// As [`joint_fix`].
pub fn joint_fixes(
    rig: &StereoRig,
    members: &[Member],
    observations_by_frame: &[ObjectObservations],
    confidence: f64,
) -> Result<JointFixes, Unjoined> {
    /// Points that say where an object stands.
    const ENOUGH: usize = 3;
    let (mut members, mut observations_by_frame) = (members.to_vec(), observations_by_frame.to_vec());
    let (mut displaced, mut left_out) = (Vec::new(), Vec::new());
    let mut fix = joint_fix(rig, &members, &observations_by_frame)?;
    let max = |object: usize, observations_by_frame: &[ObjectObservations]| {
        observations_by_frame.iter().map(|g| g.count(object)).max().unwrap_or(0)
    };
    let limit = |fix: &JointFix| chi_square(fix.dof.max(1), confidence);
    // Written so that a NaN is refused too.
    while !(fix.chi2 <= limit(&fix)) {
        let seen = (0..members.len()).filter(|&o| members[o].placement != Placement::Displaced);
        let (held, weak): (Vec<usize>, Vec<usize>) = seen
            .filter(|&o| max(o, &observations_by_frame) > 0)
            .partition(|&o| max(o, &observations_by_frame) >= ENOUGH);
        // One object must stand where it is said to: nothing else relates the camera to the site.
        let given_up = if held.len() < 2 { Vec::new() } else { held };
        let without = |&object: &usize| {
            let (mut members, mut observations_by_frame) = (members.clone(), observations_by_frame.clone());
            if max(object, &observations_by_frame) < ENOUGH {
                observations_by_frame
                    .iter_mut()
                    .for_each(|object_observations| object_observations.points.retain(|(o, _)| *o != object));
            } else {
                members[object].placement = Placement::Displaced;
            }
            let fix = joint_fix(rig, &members, &observations_by_frame).ok()?;
            Some((object, members, observations_by_frame, fix))
        };
        let best = given_up.iter().chain(&weak).filter_map(without).min_by(|a, b| a.3.chi2.total_cmp(&b.3.chi2));
        let Some((object, fewer, left, better)) = best else {
            return Err(Unjoined::Contradiction { chi2: fix.chi2, limit: limit(&fix) });
        };
        if fewer[object].placement == Placement::Displaced { &mut displaced } else { &mut left_out }.push(object);
        (members, observations_by_frame, fix) = (fewer, left, better);
    }
    let instant = observations_by_frame.len() - 1; // a fix of none is refused above
    let last = &observations_by_frame[instant];
    displaced.sort_unstable();
    left_out.sort_unstable();
    Ok(JointFixes {
        object_from_camera: (0..members.len())
            .map(|object| (last.count(object) > 0).then(|| fix.object_from_camera(instant, object)))
            .collect(),
        displaced,
        left_out,
        chi2: fix.chi2,
        dof: fix.dof,
        chi2_limit: limit(&fix),
    })
}
