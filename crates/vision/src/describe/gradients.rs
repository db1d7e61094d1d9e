//! Gradients in a rotated window around a key point, and their dominant direction.

use super::sample::bilinear;
use crate::{detect::Keypoint, scale_space::Octave};

/// The number of cells along a side.
pub(super) const CELLS: usize = 4;
/// The number of samples along the side of a cell.
const PER_CELL: usize = 4;
/// The number of gradients along a side, including half a cell on either side that the outermost cells share.
pub(super) const SIDE: usize = (CELLS + 1) * PER_CELL;
/// The number of directions of a histogram.
pub(super) const DIRECTIONS: usize = 8;
/// The spacing of the gradients (σ); a cell is 3σ wide.
pub(super) const STEP: f64 = 3.0 / PER_CELL as f64;
/// The number of gradients along the side of the window for the direction: 4.5 σ on either side.
const AROUND: usize = 19;
/// The spacing of the gradients in that window (σ).
const AROUND_STEP: f64 = 0.5;
/// The standard deviation of that window's Gaussian (σ).
const AROUND_SIGMA: f64 = 1.5;
/// The number of bins of the direction's histogram.
const BINS: usize = 36;

/// The weights common to all key points.
pub(super) struct Window {
    /// The weight of a sample for each cell along one axis, including the Gaussian.
    pub(super) cells: [[f32; CELLS]; SIDE],
    /// The Gaussian of the direction's window along one axis.
    around: [f32; AROUND],
}

impl Window {
    pub(super) fn new() -> Self {
        let gaussian = |steps: f64, sigma: f64| libm::exp(-0.5 * steps * steps / (sigma * sigma));
        let cells = std::array::from_fn(|i| {
            let steps = i as f64 - 0.5 * (SIDE - 1) as f64;
            let cell = steps / PER_CELL as f64 + 0.5 * (CELLS - 1) as f64;
            let weight = gaussian(steps, (CELLS / 2 * PER_CELL) as f64);
            std::array::from_fn(|c| (weight * (1.0 - (cell - c as f64).abs()).max(0.0)) as f32)
        });
        let around =
            std::array::from_fn(|i| gaussian(i as f64 - 0.5 * (AROUND - 1) as f64, AROUND_SIGMA / AROUND_STEP) as f32);
        Self { cells, around }
    }
}

/// The position of a key point in its scale-space level.
pub(super) struct LevelPosition<'a> {
    pixels: &'a [f32],
    width: usize,
    at: [f32; 2],
    /// The scale σ (px of the octave).
    sigma: f64,
}

impl<'a> LevelPosition<'a> {
    /// The position of a key point; the levels begin at row `first` of the octave.
    pub(super) fn new(
        levels: &'a Octave,
        (octave, first): (i32, usize),
        level: usize,
        keypoint: &Keypoint,
        scale: f64,
    ) -> Self {
        let pixel = libm::exp2(f64::from(octave));
        let at = [(keypoint.at.u / pixel) as f32, (keypoint.at.v / pixel - first as f64) as f32];
        Self { pixels: levels.level(level), width: levels.width(), at, sigma: scale.max(0.1) / pixel }
    }

    /// The brightness at the corners of a grid of squares, `step` σ wide and rotated to `direction`.
    pub(super) fn grid<const N: usize>(&self, step: f64, direction: [f32; 2]) -> [[f32; N]; N] {
        let step = (step * self.sigma) as f32;
        let [cos, sin] = direction.map(|part| part * step);
        let middle = 0.5 * (N - 1) as f32;
        std::array::from_fn(|j| {
            let y = j as f32 - middle;
            std::array::from_fn(|i| {
                let x = i as f32 - middle;
                let [u, v] = self.at;
                bilinear(self.pixels, self.width, u + (cos * x - sin * y), v + (sin * x + cos * y))
            })
        })
    }

    /// The dominant direction (cosine, sine) of the gradients around the key point.
    pub(super) fn direction(&self, window: &Window) -> [f32; 2] {
        let corners: [[f32; AROUND + 1]; AROUND + 1] = self.grid(AROUND_STEP, [1.0, 0.0]);
        let mut histogram = [0.0_f32; BINS];
        for (j, pair) in corners.windows(2).enumerate() {
            let (magnitude, turn) = gradients::<{ AROUND + 1 }, AROUND>(&pair[0], &pair[1]);
            for i in 0..AROUND {
                let bin = turn[i] * BINS as f32;
                let low = (bin as usize).min(BINS - 1);
                let (weight, rest) = (magnitude[i] * window.around[i] * window.around[j], bin - low as f32);
                histogram[low] += weight * (1.0 - rest);
                histogram[(low + 1) % BINS] += weight * rest;
            }
        }
        let at = |i: usize| histogram[i % BINS];
        let smooth: [f32; BINS] = std::array::from_fn(|i| {
            let i = i + BINS;
            (at(i - 2) + at(i + 2)) * (1.0 / 16.0) + (at(i - 1) + at(i + 1)) * (4.0 / 16.0) + at(i) * (6.0 / 16.0)
        });
        let peak = (1..BINS).fold(0, |best, i| if smooth[i] > smooth[best] { i } else { best });
        let [left, here, right] = [peak + BINS - 1, peak, peak + 1].map(|i| f64::from(smooth[i % BINS]));
        // The vertex of the parabola through the peak and its neighbours.
        let bend = left - 2.0 * here + right;
        let part = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
        let (sin, cos) = libm::sincos((peak as f64 + part) * (std::f64::consts::TAU / BINS as f64));
        [cos as f32, sin as f32]
    }
}

/// The magnitudes and directions (in turns, 0 to 1) of the gradients in the squares between two rows of corners.
#[inline(always)]
pub(super) fn gradients<const C: usize, const N: usize>(upper: &[f32; C], lower: &[f32; C]) -> ([f32; N], [f32; N]) {
    let (mut magnitude, mut turn) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        let (falling, rising) = (lower[i + 1] - upper[i], upper[i + 1] - lower[i]);
        let (x, y) = (falling + rising, falling - rising);
        magnitude[i] = (x * x + y * y).sqrt();
        turn[i] = turn_of(x, y);
    }
    (magnitude, turn)
}

/// The angle of (x, y) in turns, 0 to 1, accurate to 1.3e-5, by operations that are exact on every machine.
#[inline(always)]
fn turn_of(x: f32, y: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let (small, great) = if a < b { (a, b) } else { (b, a) };
    // The angle of a zero gradient is zero.
    let t = small / (great + f32::MIN_POSITIVE);
    let s = t * t;
    // atan t / 2π with minimax error on 0 to 1.
    let eighth = t * (0.159_029_8 + s * (-0.051_116_57 + s * (0.023_278_67 - s * 0.006_204_87)));
    let quarter = if a < b { 0.25 - eighth } else { eighth };
    let half = if x < 0.0 { 0.5 - quarter } else { quarter };
    if y < 0.0 { 1.0 - half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_those_of_atan2() {
        for i in -1000..=1000 {
            for (x, y) in [(1.0, i as f32 * 0.01), (-1.0, i as f32 * 0.01), (i as f32 * 0.003, 2.0)] {
                let expected = libm::atan2(f64::from(y), f64::from(x)).rem_euclid(std::f64::consts::TAU);
                let away = (f64::from(turn_of(x, y)) - expected / std::f64::consts::TAU).abs();
                assert!(away.min(1.0 - away) < 1.4e-5, "{x}, {y}: {away}");
            }
        }
        assert_eq!(turn_of(0.0, 0.0), 0.0);
    }
}
