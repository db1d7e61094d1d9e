//! Thirteen points seen by the Karmin2 rig, as in METHOD §3.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_geometry::{
    Camera, Object, Pinhole, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels, UncertainPoint,
};
use seafix_referencing::Observation;

/// The rig: 1600×1200 px, f 1348.3 px, baseline 0.25 m.
pub(crate) fn rig() -> StereoRig {
    let camera = Pinhole::new([1600, 1200], [1348.3; 2], [799.5, 599.5], &[]).expect("a camera");
    let right_from_left = Transform::exp(&[0.0, 0.0, 0.0, -0.25, 0.0, 0.0].into());
    StereoRig::new(camera, camera, right_from_left).expect("a rig")
}

/// Points over the common field at 3.25 m ± 10 %, with pixel noise.
///
/// The noise is uniform within ± 0.35 px (σ 0.2) in each pixel coordinate.
pub(crate) fn points(rig: &StereoRig, count: usize) -> Vec<Observation> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let pose = Transform::<Object, Camera>::exp(&[0.4, -1.1, 0.7, 1.5, -2.0, 3.0].into());
    let mut point = || {
        let depth = 3.25 * rng.random_range(0.9..1.1);
        let at = Point::new(rng.random_range(-1.2..1.4), rng.random_range(-1.0..1.0), depth);
        let mut noisy = |p: Pixel| {
            let mut step = || rng.random_range(-0.35..0.35);
            Pixel { u: p.u + step(), v: p.v + step() }
        };
        let seen = rig.project(&at).expect("in view");
        let seen = StereoPixels { left: noisy(seen.left), right: noisy(seen.right) };
        let pixels = UncertainPixels::independent(seen, 0.2);
        let found = rig.triangulate(&pixels).expect("a point");
        let measured = UncertainPoint { at: found.point, covariance: found.covariance };
        Observation { measured, pixels: Some(pixels), model: pose * at, model_sigma: 0.0 }
    };
    (0..count).map(|_| point()).collect()
}

/// Every solver at its defaults, and the variants of the tables.
pub(crate) fn choices() -> Vec<(String, Choice)> {
    let plain = seafix_referencing::SOLVERS.names().map(|name| (name.to_owned(), Choice::named(name)));
    plain
        .chain([
            ("triad, first three".to_owned(), Choice::named("triad").with("choose", "first")),
            ("stereo-reprojection, one start".to_owned(), Choice::named("stereo-reprojection").with("starts", 1)),
        ])
        .collect()
}
