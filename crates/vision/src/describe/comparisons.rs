//! The comparisons of brightness of BRIEF and ORB.

use std::sync::OnceLock;

use multiversion::multiversion;

use super::{
    cells::{Cells, Grid},
    descriptor::Descriptors,
    halves::Halves,
};
use crate::{detect::Keypoint, image::Image, workspace::Workspace};

/// The settings that distinguish the descriptors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settings {
    /// The step of the pattern (px); 0: half the key point's own scale.
    pub(super) scale: f64,
    /// Whether the pattern is rotated to the orientation of its surroundings.
    pub(super) turned: bool,
}

/// The number of comparisons.
const BITS: usize = 256;
/// The largest distance of a point from the centre (steps).
const RADIUS: usize = 15;
/// The number of points along a side.
const SIDE: usize = 2 * RADIUS + 1;
/// The number of cells along the side of the square that smooths a point.
const SMOOTH: usize = 5;
/// The number of cells along a side.
const CELLS: usize = SIDE + SMOOTH - 1;
/// The length of a column of cells in memory.
const LANES: usize = 40;
/// The number of key points in a piece of the work.
const PIECE: usize = 64;

/// The working memory of the descriptors.
#[derive(Debug, Default)]
struct Scratch {
    halves: Halves,
    /// The buffer of each piece.
    pieces: Vec<Vec<f32>>,
}

/// Replaces `described` by the bits of each key point.
pub(super) fn describe(
    settings: &Settings,
    image: &Image,
    keypoints: &[Keypoint],
    work: &mut Workspace,
    described: &mut Descriptors,
) {
    let pattern = pattern();
    let words = BITS / 64;
    let rows = described.bits_mut(keypoints.len(), words);
    let step = |point: &Keypoint| if settings.scale > 0.0 { settings.scale } else { 0.5 * f64::from(point.scale) };
    let threads = work.threads();
    let Scratch { halves, pieces } = work.get();
    if settings.turned {
        halves.fill(image, keypoints.iter().map(step).fold(0.0, f64::max));
    }
    threads.pieces(rows, PIECE * words, pieces, |index, rows, scratch| {
        for (row, keypoint) in rows.chunks_exact_mut(words).zip(&keypoints[index * PIECE..]) {
            let step = step(keypoint);
            let mut cells = [[0.0; LANES]; CELLS];
            Grid::new(keypoint.at, step).upright(image, scratch, &mut cells);
            if settings.turned {
                let along = towards_centroid(&cells);
                let (grid, pixels, width) = halves.at(image, keypoint.at, step);
                grid.turned(pixels, width, along, scratch, &mut cells);
            }
            let places = smooth(&cells);
            for (word, pairs) in row.iter_mut().zip(pattern.chunks_exact(64)) {
                *word = 0;
                for (bit, &[a, b]) in pairs.iter().enumerate() {
                    *word |= u64::from(places[usize::from(a)] < places[usize::from(b)]) << bit;
                }
            }
        }
    });
}

/// The direction (cos, sin) from the centre to the centroid of brightness within the radius; (1, 0) if undefined.
fn towards_centroid(cells: &Cells<CELLS, LANES>) -> [f64; 2] {
    let margin = (SMOOTH - 1) / 2;
    let offset = |i: usize| i as i32 - RADIUS as i32;
    let mut moments = [0.0_f64; 2];
    for x in 0..SIDE {
        for y in 0..SIDE {
            let [dx, dy] = [offset(x), offset(y)];
            if dx * dx + dy * dy <= (RADIUS * RADIUS) as i32 {
                let grey = f64::from(cells[x + margin][y + margin]);
                moments[0] += f64::from(dx) * grey;
                moments[1] += f64::from(dy) * grey;
            }
        }
    }
    let length = (moments[0] * moments[0] + moments[1] * moments[1]).sqrt();
    // The condition is false for NaN too.
    if length > 0.0 && length < f64::INFINITY { moments.map(|moment| moment / length) } else { [1.0, 0.0] }
}

/// The sums over the squares around all points, column by column.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn smooth(cells: &Cells<CELLS, LANES>) -> [f32; SIDE * SIDE] {
    let mut places = [0.0; SIDE * SIDE];
    for (x, places) in places.chunks_exact_mut(SIDE).enumerate() {
        let mut columns = [0.0; CELLS];
        for cells in &cells[x..x + SMOOTH] {
            for (sum, cell) in columns.iter_mut().zip(cells) {
                *sum += cell;
            }
        }
        for (y, place) in places.iter_mut().enumerate() {
            for step in 0..SMOOTH {
                *place += columns[y + step];
            }
        }
    }
    places
}

/// The compared pairs of points, drawn once from a Gaussian of SIDE/5 steps and rounded.
///
/// Points outside the circle and pairs of a point with itself are drawn again.
fn pattern() -> &'static [[u16; 2]; BITS] {
    static PATTERN: OnceLock<[[u16; 2]; BITS]> = OnceLock::new();
    PATTERN.get_or_init(|| {
        let mut counter = 0;
        let mut place = || loop {
            let [x, y] = gaussian(counter).map(|x| libm::round(x * SIDE as f64 / 5.0) as i32);
            counter += 1;
            if x * x + y * y <= (RADIUS * RADIUS) as i32 {
                let index = (x + RADIUS as i32) * SIDE as i32 + y + RADIUS as i32;
                return index as u16;
            }
        };
        std::array::from_fn(|_| {
            loop {
                let pair = [place(), place()];
                if pair[0] != pair[1] {
                    return pair;
                }
            }
        })
    })
}

/// Two standard normal numbers of this index (Box and Muller).
fn gaussian(index: u64) -> [f64; 2] {
    let [a, b] = [2 * index, 2 * index + 1].map(|i| (mixed(i) >> 11) as f64 / (1_u64 << 53) as f64);
    let radius = (-2.0 * libm::log(1.0 - a)).sqrt();
    let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * b);
    [radius * cos, radius * sin]
}

/// 64 random bits of a counter by SplitMix64 from the seed 0x5EAF_1C50.
///
/// Source: Steele, Lea and Flood, *Fast splittable pseudorandom number generators*, 2014.
fn mixed(counter: u64) -> u64 {
    let z = 0x5EAF_1C50_u64.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::{brief::Brief, descriptor::Descriptor, orb::Orb};
    use seafix_geometry::Pixel;

    fn image(f: impl Fn(f64, f64) -> f64) -> Image {
        let pixels = (0..80 * 80).map(|i| f(f64::from(i % 80), f64::from(i / 80)) as f32).collect();
        Image::new(80, 80, pixels).unwrap()
    }

    fn bits(descriptor: &dyn Descriptor, image: &Image) -> Vec<bool> {
        let at = Keypoint { at: Pixel { u: 40.3, v: 39.6 }, response: 1.0, scale: 2.0 };
        let described = descriptor.describe(image, &[at]);
        let words = described.bits().unwrap().row(0);
        (0..BITS).map(|i| words[i / 64] >> (i % 64) & 1 == 1).collect()
    }

    /// The column and the row of a point.
    fn place(index: u16) -> [i32; 2] {
        [i32::from(index) / SIDE as i32, i32::from(index) % SIDE as i32]
    }

    #[test]
    fn the_pattern_is_a_gaussian_within_the_circle() {
        let places: Vec<[i32; 2]> = pattern().iter().flatten().map(|&p| place(p).map(|x| x - 15)).collect();
        assert!(places.iter().all(|[x, y]| x * x + y * y <= 225));
        for axis in 0..2 {
            let mean = places.iter().map(|p| f64::from(p[axis])).sum::<f64>() / 512.0;
            let square = places.iter().map(|p| f64::from(p[axis] * p[axis])).sum::<f64>() / 512.0;
            // The circle truncates the Gaussian of 6.2 at 2.4 standard deviations.
            assert!(mean.abs() < 0.8 && (square.sqrt() - 5.6).abs() < 0.4, "{mean} {}", square.sqrt());
        }
        assert_eq!(mixed(0), mixed(0));
        assert_ne!(pattern()[0], pattern()[1]);
    }

    #[test]
    fn a_bit_states_which_place_is_the_darker() {
        let ramp = bits(&Brief::default(), &image(|x, _| 2.0 * x));
        for (bit, &[a, b]) in ramp.iter().zip(pattern()) {
            if place(a)[0] != place(b)[0] {
                assert_eq!(*bit, place(a)[0] < place(b)[0]);
            }
        }
        assert!(bits(&Brief::default(), &image(|_, _| 99.9)).iter().all(|bit| !bit));
    }

    #[test]
    fn turned_the_ramp_s_direction_drops_out() {
        // Brightness rises towards its centroid: the first axis.
        for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8], [0.28, -0.96]] {
            let turned = bits(&Orb::default(), &image(|u, v| 120.0 + x * u + y * v));
            for (bit, &[a, b]) in turned.iter().zip(pattern()) {
                if place(a)[0] != place(b)[0] {
                    assert_eq!(*bit, place(a)[0] < place(b)[0], "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn scale_zero_is_half_the_key_point_s_own() {
        let waves = image(|x, y| 100.0 + 50.0 * libm::sin(0.3 * x) + 40.0 * libm::cos(0.23 * y + 0.1 * x));
        assert_eq!(bits(&Brief { scale: 0.0 }, &waves), bits(&Brief { scale: 1.0 }, &waves));
        assert_ne!(bits(&Brief { scale: 2.0 }, &waves), bits(&Brief { scale: 1.0 }, &waves));
    }
}
