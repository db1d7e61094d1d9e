//! Errors of trajectories: invariances and inequalities.

use nalgebra::Vector6;
use proptest::prelude::*;
use seafix_evaluation::trajectory::{Alignment, Delta, Pose, Relation, Summary, align, ape, drift, pairs, rpe};
use seafix_geometry::{Camera, Transform, World};
use seafix_proptests::{
    law,
    poses::{pose, vector},
    within,
};

/// The extent of a walk (m).
const REACH: f64 = 100.0;

fn plain(transform: &Transform<World, Camera>) -> Pose {
    Pose { rotation: transform.rotation_matrix(), position: transform.translation() }
}

fn moved(motion: &Transform<World, World>, path: &[Pose]) -> Vec<Pose> {
    let motion = Pose { rotation: motion.rotation_matrix(), position: motion.translation() };
    path.iter().map(|pose| motion.then(pose)).collect()
}

/// A trajectory and an estimate of it: every pose has errors of up to 0.2 rad and 2 m on each axis, the scale of a
/// tenth.
fn paths() -> impl Strategy<Value = (Vec<Pose>, Vec<Pose>)> {
    let step = (pose::<World, Camera>(REACH), vector(0.2), vector(2.0));
    (proptest::collection::vec(step, 4..40), 0.9..1.1).prop_map(|(steps, scale)| {
        let estimate = |(truth, turn, shift): &(Transform<World, Camera>, _, _)| {
            let mut xi = Vector6::zeros();
            xi.fixed_rows_mut::<3>(0).copy_from(turn);
            xi.fixed_rows_mut::<3>(3).copy_from(shift);
            let off = plain(&truth.perturbed(&xi));
            Pose { position: off.position * scale, ..off }
        };
        (steps.iter().map(|(truth, ..)| plain(truth)).collect(), steps.iter().map(estimate).collect())
    })
}

fn aligned(reference: &[Pose], estimate: &[Pose], with_scale: bool) -> Vec<Pose> {
    let alignment = align(reference, estimate, with_scale).expect("positions in space");
    estimate.iter().map(|pose| alignment.apply(pose)).collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// P68. A trajectory has no error against itself: distances exactly 0, rotations to rounding.
///
/// Seen to fail when the relative pose takes the rotation without its transpose.
#[test]
fn a_path_is_at_no_distance_from_itself() {
    law(256, paths(), |(path, _)| {
        within("ape", Summary::of(&ape(&path, &path, Relation::Translation)).max, 0.0)?;
        within("turn", Summary::of(&ape(&path, &path, Relation::AngleRad)).max, 1e-15)?;
        let every = pairs(&path, Delta::Frames(1), true, 0.0);
        within("rpe", Summary::of(&rpe(&path, &path, &every, Relation::Translation)).max, 1e-12)?;
        let segments = drift(&path, &path, &[5.0, 50.0]);
        within("drift", segments.iter().map(|segment| segment.translation).fold(0.0, f64::max), 1e-12)
    });
}

/// P68. The error after alignment is invariant under a rigid motion of the estimate: ≤ 1e-9.
///
/// Seen to fail when the translation of the alignment ignores the scale.
#[test]
fn an_alignment_takes_any_motion_back() {
    law(256, (paths(), pose::<World, World>(REACH)), |((reference, estimate), motion)| {
        for with_scale in [false, true] {
            let error = |estimate: &[Pose]| ape(&reference, &aligned(&reference, estimate, with_scale), Relation::Full);
            within("change", largest_difference(&error(&estimate), &error(&moved(&motion, &estimate))), 1e-9)?;
        }
        Ok(())
    });
}

/// P68. Relative errors and drift are invariant under a motion of the estimate from the left: ≤ 1e-12 of the extent.
///
/// Seen to fail when a relative pose is taken in the frame of the world.
#[test]
fn relative_errors_know_no_origin() {
    law(256, (paths(), pose::<World, World>(REACH)), |((reference, estimate), motion)| {
        let motioned = moved(&motion, &estimate);
        let every = pairs(&reference, Delta::Frames(1), true, 0.0);
        for relation in [Relation::Full, Relation::Translation, Relation::AngleRad, Relation::PointDistance] {
            let error = |estimate: &[Pose]| rpe(&reference, estimate, &every, relation);
            within(relation.name(), largest_difference(&error(&estimate), &error(&motioned)), 1e-12 * REACH)?;
        }
        Ok(())
    });
}

/// P68. Alignment with more degrees of freedom fits better: RMS of similarity ≤ rigid ≤ none.
///
/// Seen to fail when the rotation of the alignment is inverted.
#[test]
fn more_freedom_fits_better() {
    law(256, paths(), |(reference, estimate)| {
        let rmse = |estimate: &[Pose]| Summary::of(&ape(&reference, estimate, Relation::Translation)).rmse;
        let (raw, rigid) = (rmse(&estimate), rmse(&aligned(&reference, &estimate, false)));
        let similar = rmse(&aligned(&reference, &estimate, true));
        within("rigid over raw", rigid / raw, 1.0 + 1e-12)?;
        within("similar over rigid", similar / rigid, 1.0 + 1e-12)
    });
}

/// Alignment of the first poses leaves the first without error, for any rest.
///
/// Seen to fail when the motion is applied from the right.
#[test]
fn the_first_pose_is_placed_on_the_first() {
    law(256, paths(), |(reference, estimate)| {
        let alignment = Alignment::onto(&reference[0], &estimate[0]);
        let first = [alignment.apply(&estimate[0])];
        within("first", ape(&reference[..1], &first, Relation::Full)[0], 1e-12 * REACH)
    });
}
