//! Errors of an object's surface and their relations.

use proptest::prelude::*;
use seafix_evaluation::{mean_distance, mean_nearest_distance, symmetric_distance};
use seafix_geometry::{Camera, Object, Transform};
use seafix_proptests::{law, points::point, poses::pose, within};

/// P69. ADD ≥ ADI; MSSD ≥ ADD if the identity is the only symmetry; MSSD with more symmetries ≤ with fewer; the truth
/// has the error 0.
///
/// Seen to fail when ADI uses the farthest point, and when MSSD uses the worst symmetry.
#[test]
fn errors_of_a_surface_keep_their_order() {
    let poses = (pose::<Object, Camera>(10.0), pose::<Object, Camera>(10.0));
    let points = proptest::collection::vec(point::<Object>(2.0), 1..40);
    let symmetries = proptest::collection::vec(pose::<Object, Object>(1.0), 0..6);
    law(256, (poses, points, symmetries, 0..6_usize), |((estimate, truth), points, symmetries, few)| {
        let add = mean_distance(&estimate, &truth, &points).unwrap();
        let adi = mean_nearest_distance(&estimate, &truth, &points).unwrap();
        let mssd = |symmetries: &[Transform<Object, Object>]| {
            symmetric_distance(&estimate, &truth, &points, symmetries).unwrap()
        };
        prop_assert!(adi <= add + 1e-12, "{adi} {add}");
        prop_assert!(mssd(&[]) >= add - 1e-12, "{} {add}", mssd(&[]));
        prop_assert!(mssd(&symmetries) <= mssd(&symmetries[..few.min(symmetries.len())]));
        within("ADD of the truth", mean_distance(&truth, &truth, &points).unwrap(), 1e-12)?;
        within("ADI of the truth", mean_nearest_distance(&truth, &truth, &points).unwrap(), 1e-12)?;
        within("MSSD of the truth", symmetric_distance(&truth, &truth, &points, &symmetries).unwrap(), 1e-12)
    });
}
