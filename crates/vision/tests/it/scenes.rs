//! A textured tilted plane, seen by a rig of any kind.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Pinhole, Pixel, Point, StereoPixels, StereoRig, Transform};
use seafix_vision::Image;

const SIZE: [usize; 2] = [320, 240];
/// The normal and the offset (m) of the plane n·p = offset, in the left camera.
const NORMAL: Vector3<f64> = Vector3::new(-0.2, 0.1, 1.0);
const OFFSET: f64 = 2.0;

/// A rig with the right camera displaced by `step` (m) and rotated by `turn` (rad), f = 300 px.
pub(crate) fn rig(step: [f64; 3], turn: [f64; 3], lens: &[f64]) -> StereoRig {
    let camera = Pinhole::new(SIZE.map(|n| n as u32), [300.0, 301.0], [158.0, 121.0], lens).expect("a valid camera");
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    StereoRig::new(camera, camera, Transform::new(rotation, rotation * -Vector3::from(step))).expect("a valid rig")
}

/// The intersection of the plane with the ray from `origin` in the direction `d`.
fn hit(origin: Vector3<f64>, d: Vector3<f64>) -> Vector3<f64> {
    origin + d * ((OFFSET - NORMAL.dot(&origin)) / NORMAL.dot(&d))
}

/// The pixels of the plane's point that the left camera sees at `left`.
pub(crate) fn truth(rig: &StereoRig, left: Pixel) -> Option<StereoPixels> {
    let ray = rig.left().normalize(&left)?.push(1.0);
    rig.project(&Point::from(hit(Vector3::zeros(), ray)))
}

pub(crate) fn hash(x: i64, y: i64) -> f64 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 13)).wrapping_mul(0x297A_2D39);
    f64::from(h >> 8) / f64::from(1 << 24)
}

/// Smooth noise on a lattice, −1 to 1.
fn noise(x: f64, y: f64) -> f64 {
    let smooth = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    let (i, j) = (x.floor(), y.floor());
    let (u, v) = (smooth(x - i), smooth(y - j));
    let at = |a: i64, b: i64| hash(i as i64 + a, j as i64 + b);
    let row = |b: i64| at(0, b) + u * (at(1, b) - at(0, b));
    2.0 * (row(0) + v * (row(1) - row(0))) - 1.0
}

/// A texture with cells of about 9 and 4 px, −1 to 1.
fn texture(x: f64, y: f64) -> f64 {
    0.6 * noise(x / 0.06, y / 0.06) + 0.4 * noise(x / 0.027 + 50.0, y / 0.027)
}

/// Both images in 8 bits: texture of ±`contrast` around 110 grey levels, with uniform noise of ±`grain`.
pub(crate) fn images(rig: &StereoRig, contrast: f64, grain: f64) -> [Image; 2] {
    painted(rig, contrast, grain, texture)
}

/// Both images of a plane tiled with squares of `side` (m) of the texture.
pub(crate) fn tiled(rig: &StereoRig, side: f64) -> [Image; 2] {
    painted(rig, 60.0, 1.0, |x, y| texture(x.rem_euclid(side), y.rem_euclid(side)))
}

fn painted(rig: &StereoRig, contrast: f64, grain: f64, paint: impl Fn(f64, f64) -> f64) -> [Image; 2] {
    let back = rig.right_from_left().inverse();
    let cameras = [
        (rig.left(), Vector3::zeros(), UnitQuaternion::identity()),
        (rig.right(), back.translation(), back.rotation()),
    ];
    let mut side = 0;
    cameras.map(|(camera, origin, rotation)| {
        side += 1;
        let pixel = |i: usize| {
            let at = Pixel { u: (i % SIZE[0]) as f64, v: (i / SIZE[0]) as f64 };
            let Some(direction) = camera.normalize(&at) else { return 0.0 };
            let p = hit(origin, rotation * direction.push(1.0));
            let grain = grain * (2.0 * hash(i as i64 + 7, 1000 * side) - 1.0);
            (110.0 + contrast * paint(p.x, p.y) + grain).round().clamp(0.0, 255.0) as f32
        };
        Image::new(SIZE[0], SIZE[1], (0..SIZE[0] * SIZE[1]).map(pixel).collect()).expect("width × height pixels")
    })
}
