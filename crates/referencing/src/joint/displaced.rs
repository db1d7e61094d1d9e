//! A joint fix that does not believe a survey against the images.

use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use super::{Glimpse, JointFix, Member, Placement, joint_fix};
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
    /// χ² of pixels and surveys together.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
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

/// One fix over all `glimpses`, the last of which is asked for; surveys that the images contradict at this `confidence`
/// are given up, one object after the other: always that without whose survey χ² is least.
///
/// # Errors
/// As [`joint_fix`], and where the images contradict each other whatever the surveys are.
///
/// # Panics
/// As [`joint_fix`].
pub fn joint_fixes(
    rig: &StereoRig,
    members: &[Member],
    glimpses: &[Glimpse],
    confidence: f64,
) -> Result<JointFixes, Unjoined> {
    let mut members = members.to_vec();
    let mut displaced = Vec::new();
    let mut fix = joint_fix(rig, &members, glimpses)?;
    let seen = |object: usize, glimpse: &Glimpse| glimpse.points.iter().any(|(o, _)| *o == object);
    let limit = |fix: &JointFix| chi_square(fix.freedom.max(1), confidence);
    let contradiction = |fix: &JointFix| Unjoined::Contradiction { chi2: fix.chi2, limit: limit(fix) };
    // Written so that a NaN is refused too.
    while !(fix.chi2 <= limit(&fix)) {
        let held: Vec<usize> = (0..members.len())
            .filter(|&o| members[o].placement != Placement::Displaced && glimpses.iter().any(|g| seen(o, g)))
            .collect();
        // One object must stand where it is said to: nothing else relates the camera to the site.
        if held.len() < 2 {
            return Err(contradiction(&fix));
        }
        let without = |&object: &usize| {
            let mut fewer = members.clone();
            fewer[object].placement = Placement::Displaced;
            Some((object, joint_fix(rig, &fewer, glimpses).ok()?))
        };
        let Some((object, better)) = held.iter().filter_map(without).min_by(|(_, a), (_, b)| a.chi2.total_cmp(&b.chi2))
        else {
            return Err(contradiction(&fix));
        };
        members[object].placement = Placement::Displaced;
        displaced.push(object);
        fix = better;
    }
    let instant = glimpses.len() - 1; // a fix of none is refused above
    let last = &glimpses[instant];
    displaced.sort_unstable();
    Ok(JointFixes {
        object_from_camera: (0..members.len())
            .map(|object| seen(object, last).then(|| fix.object_from_camera(instant, object)))
            .collect(),
        displaced,
        chi2: fix.chi2,
        freedom: fix.freedom,
        chi2_limit: limit(&fix),
    })
}
