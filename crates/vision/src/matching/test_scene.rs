//! The scenes of the matchers' tests.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Pinhole, Pixel, Point, StereoRig, Transform};

use super::matcher::{Match, Matcher, View};
use crate::{
    describe::{Descriptors, Table},
    detect::Keypoint,
    image::Image,
};

/// A rig with the right camera displaced by `step` (m) and rotated by `turn` (rad).
pub(super) fn rig(step: Vector3<f64>, turn: Vector3<f64>) -> StereoRig {
    let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[-0.05, 0.01, 0.001, 0.0]).unwrap();
    let rotation = UnitQuaternion::from_scaled_axis(turn);
    StereoRig::new(camera, camera, Transform::new(rotation, rotation * -step)).unwrap()
}

pub(super) fn numbers(seed: u32) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    }
}

pub(super) fn keypoints(pixels: &[Pixel]) -> Vec<Keypoint> {
    pixels.iter().map(|&at| Keypoint { at, response: 1.0, scale: 1.0 }).collect()
}

pub(super) fn unit(values: Vec<f32>, length: usize) -> Descriptors {
    let unit = values.chunks_exact(length).flat_map(|v| {
        let norm = v.iter().map(|x| x * x).sum::<f32>().sqrt();
        v.iter().map(move |x| x / norm)
    });
    Descriptors::Numbers(Table::new(length, unit.collect()))
}

pub(super) fn matched(
    matcher: &dyn Matcher,
    left: (&[Pixel], &Descriptors),
    right: (&[Pixel], &Descriptors),
    rig: &StereoRig,
) -> Vec<Match> {
    let image = Image::new(1, 1, vec![0.0]).unwrap();
    let (l, r) = (keypoints(left.0), keypoints(right.0));
    matcher.matches(
        &View { image: &image, keypoints: &l, descriptors: left.1 },
        &View { image: &image, keypoints: &r, descriptors: right.1 },
        rig,
    )
}

/// The index of the right pixel of a match.
pub(super) fn index(right: &[Pixel], found: &Match) -> usize {
    right.iter().position(|at| *at == found.right).unwrap()
}

/// The pixels of points at random depths in both images, with random descriptors.
///
/// The right ones are noisy and in reverse order.
pub(super) fn scene(n: usize, rig: &StereoRig) -> (Vec<Pixel>, Vec<Pixel>, Descriptors, Descriptors) {
    let mut next = numbers(7);
    let (mut left, mut right, mut a, mut b) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    while left.len() < n {
        let z = 1.0 + 4.0 * f64::from(next());
        let point = Point::new(z * (f64::from(next()) - 0.5), z * (f64::from(next()) - 0.5), z);
        let Some(seen) = rig.sees(&point, 5.0) else { continue };
        left.push(seen.left);
        right.insert(0, seen.right);
        let d: Vec<f32> = (0..16).map(|_| next() - 0.5).collect();
        b.splice(0..0, d.iter().map(|x| x + 0.2 * (next() - 0.5)).collect::<Vec<_>>());
        a.extend(d);
    }
    (left, right, unit(a, 16), unit(b, 16))
}
