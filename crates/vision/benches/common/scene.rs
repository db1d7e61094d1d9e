//! Images, and views of a textured plane.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Pinhole, Pixel, StereoRig, Transform};
use seafix_vision::Image;

/// The image of a pixel under a homography.
pub(crate) fn map(h: &Matrix3<f64>, at: Pixel) -> Pixel {
    let p = h * Vector3::new(at.u, at.v, 1.0);
    Pixel { u: p.x / p.z, v: p.y / p.z }
}

/// The view of `base` of this `size` through the homography `base_from_image`, in 8 bits.
///
/// Each pixel is the mean of `samples`² points in it, more than one if the image is smaller than the base, by Keys'
/// cubic convolution. The base is mirrored at its border, so that no edge appears there.
pub(crate) fn render(base: &Image, size: [usize; 2], base_from_image: &Matrix3<f64>, samples: usize) -> Image {
    let step = |i: usize| (i as f64 + 0.5) / samples as f64 - 0.5;
    let pixel = |x: usize, y: usize| {
        let mut sum = 0.0;
        for j in 0..samples {
            for i in 0..samples {
                let at = Pixel { u: x as f64 + step(i), v: y as f64 + step(j) };
                sum += cubic(base, map(base_from_image, at));
            }
        }
        eight_bits(sum / (samples * samples) as f64)
    };
    let [width, height] = size;
    let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
    Image::new(width, height, pixels).expect("width × height pixels")
}

/// The value rounded to 8 bits.
pub(crate) fn eight_bits(value: f64) -> f32 {
    value.round().clamp(0.0, 255.0) as f32
}

fn cubic(image: &Image, at: Pixel) -> f64 {
    let (x, y) = (at.u.floor(), at.v.floor());
    let (wx, wy) = (keys(at.u - x), keys(at.v - y));
    let columns: [usize; 4] = std::array::from_fn(|i| mirrored(x as i64 + i as i64 - 1, image.width()));
    let mut sum = 0.0;
    for (j, wy) in wy.iter().enumerate() {
        let row = image.row(mirrored(y as i64 + j as i64 - 1, image.height()));
        let along: f64 = columns.iter().zip(&wx).map(|(&column, wx)| wx * f64::from(row[column])).sum();
        sum += wy * along;
    }
    sum
}

/// The weights of Keys' cubic convolution, a = −1/2.
fn keys(t: f64) -> [f64; 4] {
    [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ]
}

fn mirrored(i: i64, n: usize) -> usize {
    let period = 2 * n as i64;
    let i = i.rem_euclid(period);
    (if i < n as i64 { i } else { period - 1 - i }) as usize
}

/// Stones of many sizes under uneven light, a substitute for a photograph.
pub(crate) fn stones(size: [usize; 2]) -> Image {
    let hash = |x: i64, y: i64, octave: u64| {
        let mut h =
            (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F) ^ octave;
        h = (h ^ (h >> 31)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (h ^ (h >> 29)) as f64 / u64::MAX as f64
    };
    let noise = |x: f64, y: f64, octave: u64| {
        let (i, j) = (x.floor(), y.floor());
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        let (a, b) = (smooth(x - i), smooth(y - j));
        let corner = |di: i64, dj: i64| hash(i as i64 + di, j as i64 + dj, octave);
        (corner(0, 0) * (1.0 - a) + corner(1, 0) * a) * (1.0 - b) + (corner(0, 1) * (1.0 - a) + corner(1, 1) * a) * b
    };
    let pixel = |x: usize, y: usize| {
        let octaves =
            (1..=6).map(|o| (noise(x as f64 / f64::from(1 << o), y as f64 / f64::from(1 << o), o) - 0.5) * 2.0);
        // Ridges between the stones make corners, as light and shade do.
        eight_bits(128.0 + octaves.map(|n| 45.0 * (0.5 - n.abs())).sum::<f64>())
    };
    let pixels = (0..size[0] * size[1]).map(|i| pixel(i % size[0], i / size[0])).collect();
    Image::new(size[0], size[1], pixels).expect("width × height pixels")
}

/// A rectified rig with a baseline of 0.25 m and the field of view of a dive camera.
pub(crate) fn rig(size: [usize; 2]) -> StereoRig {
    let [width, height] = size.map(|n| n as f64);
    let focal = 0.8 * width;
    let size = size.map(|n| n as u32);
    let camera =
        Pinhole::new(size, [focal, focal], [0.5 * (width - 1.0), 0.5 * (height - 1.0)], &[]).expect("a camera");
    let mut right_from_left = nalgebra::Matrix4::identity();
    right_from_left[(0, 3)] = -0.25;
    StereoRig::new(camera, camera, Transform::from_matrix(&right_from_left).expect("a shift")).expect("a rig")
}

/// The homography between the images of [`rig`] by a plane 4 m away, tilted by 25° about an oblique axis.
pub(crate) fn right_from_left(rig: &StereoRig) -> Matrix3<f64> {
    let [focal, _] = rig.left().focal();
    let [cx, cy] = rig.left().principal();
    let (tilt, roll) = (25.0_f64.to_radians(), 60.0_f64.to_radians());
    let n = Vector3::new(tilt.sin() * roll.cos(), tilt.sin() * roll.sin(), tilt.cos());
    // The disparity is f b / z, and 1/z = n · ray / (n · centre).
    let scale = rig.baseline() / (4.0 * n.z);
    let row = Vector3::new(n.x, n.y, n.z * focal - n.x * cx - n.y * cy) * scale;
    Matrix3::new(1.0 - row.x, -row.y, -row.z, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
}

/// Both views of a plane textured with `base`, mirrored at its border; `scale` pixels to one of the base.
pub(crate) fn stereo(base: &Image, size: [usize; 2], scale: f64) -> [Image; 2] {
    let base_from_left = Matrix3::new(1.0 / scale, 0.0, 0.0, 0.0, 1.0 / scale, 0.0, 0.0, 0.0, 1.0);
    let h = right_from_left(&rig(size)).try_inverse().expect("an invertible homography");
    [base_from_left, base_from_left * h].map(|from| render(base, size, &from, 1))
}
