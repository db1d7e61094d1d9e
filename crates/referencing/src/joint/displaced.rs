//! Joint fixes that reject surveys in contradiction to the images.

use seafix_geometry::StereoRig;

use super::{
    fix::{JointFix, joint_fix},
    member::{Member, ObjectObservations, Placement},
};
use crate::{chi_square::chi_square, joint::relative_pose::RelativePose, solve::degeneracy::Degenerate};

/// The camera poses of the last instant relative to each object that it observed.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFixes {
    /// The camera's pose relative to each object; `None` for objects that the last instant did not observe.
    pub object_from_camera: Vec<Option<RelativePose>>,
    /// The indices of displaced objects, whose surveys were rejected.
    pub displaced: Vec<usize>,
    /// The indices of objects with too few features for a pose that contradict the rest; these were excluded.
    pub left_out: Vec<usize>,
    /// χ² of pixels and surveys together.
    pub chi2: f64,
    /// The degrees of freedom of χ².
    pub dof: usize,
    /// The limit of χ², which a correct fix exceeds with probability one minus the confidence.
    pub chi2_limit: f64,
}

/// The reason for the absence of a joint fix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unjoined {
    /// The points determine no joint fix.
    #[error(transparent)]
    Degenerate(#[from] Degenerate),
    /// The images contradict each other even without the surveys.
    #[error(
        "contradictory images: pixels and surveys have χ² = {chi2:.1}, the limit is {limit:.1}, whichever surveys are \
         rejected"
    )]
    Contradiction {
        /// χ² with the remaining surveys.
        chi2: f64,
        /// The limit, which a correct fix exceeds with probability one minus the confidence.
        limit: f64,
    },
}

/// One fix over all `observations_by_frame`; the result describes the last instant.
///
/// Surveys that contradict the images at this `confidence` are rejected one after the other: always the survey whose
/// rejection minimises χ². An object whose features cannot determine its pose in any instant, such as two points, loses
/// these instead of its survey.
///
/// # Errors
///
/// Those of [`joint_fix`], and images that contradict each other without the surveys.
///
/// # Panics
///
/// As [`joint_fix`].
pub fn joint_fixes(
    rig: &StereoRig,
    members: &[Member],
    observations_by_frame: &[ObjectObservations],
    confidence: f64,
) -> Result<JointFixes, Unjoined> {
    let (mut members, mut observations_by_frame) = (members.to_vec(), observations_by_frame.to_vec());
    let (mut displaced, mut left_out) = (Vec::new(), Vec::new());
    let mut fix = joint_fix(rig, &members, &observations_by_frame)?;
    let suffices = |object: usize, observations_by_frame: &[ObjectObservations]| {
        observations_by_frame.iter().any(|observations| observations.suffices(object))
    };
    let limit = |fix: &JointFix| chi_square(fix.dof.max(1), confidence);
    // A NaN is rejected as well.
    while !(fix.chi2 <= limit(&fix)) {
        let seen = (0..members.len()).filter(|&o| members[o].placement != Placement::Displaced);
        let (held, weak): (Vec<usize>, Vec<usize>) = seen
            .filter(|&o| observations_by_frame.iter().any(|observations| observations.shows(o)))
            .partition(|&o| suffices(o, &observations_by_frame));
        // One object must keep its stated pose, as nothing else relates the camera to the site.
        let given_up = if held.len() < 2 { Vec::new() } else { held };
        let without = |&object: &usize| {
            let (mut members, mut observations_by_frame) = (members.clone(), observations_by_frame.clone());
            if suffices(object, &observations_by_frame) {
                members[object].placement = Placement::Displaced;
            } else {
                observations_by_frame.iter_mut().for_each(|observations| observations.remove(object));
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
    let instant = observations_by_frame.len() - 1; // an empty list is rejected above
    let last = &observations_by_frame[instant];
    displaced.sort_unstable();
    left_out.sort_unstable();
    Ok(JointFixes {
        object_from_camera: (0..members.len())
            .map(|object| last.shows(object).then(|| fix.object_from_camera(instant, object)))
            .collect(),
        displaced,
        left_out,
        chi2: fix.chi2,
        dof: fix.dof,
        chi2_limit: limit(&fix),
    })
}
