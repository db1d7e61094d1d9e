//! A prior judged by fixes, where nothing else speaks against it.
//!
//! A wide prior meets matches by chance wherever it leads, so that counts of matches cannot tell a right prior from a
//! wrong one. A fix can: it is accepted with a stated probability of being wrong. Where the given prior has none, the
//! known mistakes are undone one by one, and the one with fixes explains it.

use std::path::Path;

use seafix::{Localizer, Outcome, PosePrior, Rig, StereoImages};
use seafix_component::Fault;
use seafix_referencing::Site;

use super::poses::mistakes;

/// The minimum number of pairs with a fix. The default acceptance is wrong once in 50 000 fixes, two agree.
const FEW: usize = 2;

/// The fault of a prior with which no pair has a fix, if each of the pairs has one after a known mistake is undone.
pub(crate) fn fixes_fault(site: &Site, rig: &Rig, pairs: &[(StereoImages, PosePrior)], file: &Path) -> Option<Fault> {
    let localizer = Localizer::new(site, rig).ok().filter(|_| pairs.len() >= FEW)?;
    let has_fix = |images: &StereoImages, prior: &PosePrior| {
        let outcomes = localizer.localize(images, prior).unwrap_or_default();
        outcomes.iter().any(|target| matches!(target.outcome, Outcome::Fix(_)))
    };
    if pairs.iter().any(|(images, prior)| has_fix(images, prior)) {
        return None;
    }
    let mistake = mistakes(&rig.body_from_camera).into_iter().find(|mistake| {
        pairs.iter().all(|(images, prior)| {
            let world_from_camera = (mistake.undo)(&prior.world_from_camera);
            has_fix(images, &PosePrior { world_from_camera, ..*prior })
        })
    })?;
    let n = pairs.len();
    let fault = Fault::new("poses of the prior that give no fix", file);
    let value = format!("a fix in 0 of {n} pairs as given, in {n} {}", mistake.name);
    Some(fault.value(value).remedy(mistake.remedy))
}
