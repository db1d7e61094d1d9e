//! A single point far from the others determines the pose only if it is right.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Transform};
use seafix_proptests::{
    cases,
    views::{View, any_turn, anywhere, exact_model},
};
use seafix_referencing::{Acceptance, Outcome, RejectionReason, rms_apart};
use seafix_simulation::{Purpose, Stream};

const SIGMA: f64 = 0.005;
const DELTA: f64 = 4.0 * SIGMA;
const GATE: f64 = 0.3;

/// A panel of ten points, 30 cm wide, on an object of three metres with forty more points. Eight points of the panel
/// are in view, `far` of the rest, and 200 points of clutter about the panel, two metres before the camera; with a
/// prior pose, or without one among 100 points.
fn panel(number: u64, far: usize, prior: bool) -> View {
    let mut stream = Stream::new(number, 0, 0, Purpose::View);
    let stream = &mut stream;
    let middle = anywhere(stream, [0.75; 3]);
    let mut at: Vec<Vector3<f64>> = (0..10).map(|_| middle + anywhere(stream, [0.15, 0.15, 0.045])).collect();
    at.extend((0..40).map(|_| anywhere(stream, [1.5; 3])));
    let turn = any_turn(stream);
    let camera_from_object = Transform::<Camera, _>::new(turn, Vector3::z() * 2.0 - turn * middle);
    let seen = (0..8).chain(10..10 + far);
    let view = View::of(stream, exact_model(&at), camera_from_object, seen, SIGMA);
    let view = view.among(stream, if prior { 200 } else { 100 }, 2.0, [1.2; 3]);
    let error = || [stream.normal3(0.02), anywhere(stream, [0.5 * GATE; 3])];
    if prior { view.before(GATE, error) } else { view }
}

/// A panel alone does not determine the far points of its object, nor does clutter near one of them: wrong matches put no
/// pose off, with a prior pose and without.
///
/// The test of precision takes two standard deviations, so that a right pose of a panel may exceed the alert limit in one
/// case of twenty, and half as much again in one of 370.
///
/// Seen to fail when the covariance of all points decides, 12 of 107 fixes with a prior pose exceeding the limit, and
/// when no two points are left out at once, with an error of 0.163 m.
#[test]
fn one_accidental_far_point_makes_no_pose() {
    for (prior, frames) in [(true, cases(512)), (false, cases(192))] {
        let (mut answered, mut beyond, mut rejected) = (0, 0, 0);
        for number in 0..frames.into() {
            let view = panel(number, 0, prior);
            match view.outcome(DELTA, &Acceptance::default()) {
                Outcome::Fix(fix) => {
                    answered += 1;
                    let limit = Acceptance::default().alert_limit;
                    let off = rms_apart(&view.model, &fix.object_from_camera, &view.truth);
                    beyond += u64::from(off > limit);
                    assert!(off < 1.5 * limit, "frame {number}: {off}");
                }
                Outcome::Rejected(RejectionReason::InfluentialPairs { .. }) => rejected += 1,
                _ => {}
            }
        }
        println!(
            "prior {prior}: {answered} of {frames} answered, {beyond} beyond the limit, {rejected} depend on a point"
        );
        assert!(10 * rejected > frames, "too few to tell");
        assert!(20 * beyond <= answered, "{beyond} of {answered}");
    }
}

/// Points over the complete object determine its pose, and few of them are rejected.
///
/// Seen to fail when every pose is taken to depend on a single point.
#[test]
fn far_points_that_bear_each_other_out_make_one() {
    let off = |number: u64| {
        let view = panel(number, 6, true);
        match view.outcome(DELTA, &Acceptance::default()) {
            Outcome::Fix(fix) => Some(rms_apart(&view.model, &fix.object_from_camera, &view.truth)),
            _ => None,
        }
    };
    let found: Vec<f64> = (0..30).filter_map(off).collect();
    println!("{} of 30 answered", found.len());
    assert!(found.len() >= 27 && found.iter().all(|&off| off < 0.03), "{found:?}");
}
