//! The SURF descriptor, upright, at given key points.

use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{Descriptor, Descriptors, integral::Integral};
use crate::{Image, Keypoint, Workspace};

/// SURF's 64 numbers, upright: sums of Haar wavelet responses around the key point.
///
/// The square window of 20 s around the key point is cut into 4×4 sub-regions. In each, at 5×5 places
/// one s apart, a Haar wavelet of 2 s gives dx and dy, weighted by a Gaussian of 3.3 s about the key
/// point; the sub-region contributes Σ dx, Σ dy, Σ |dx|, Σ |dy|. The vector is scaled to unit length:
/// brightness offset and contrast drop out. Where nothing changes it is zero.
///
/// The wavelets are integrated exactly at the key point's fraction of a pixel; beyond the border the
/// outermost pixels continue. The cameras of a rig stand upright to each other, so no orientation is sought.
///
/// Source: Bay, Tuytelaars and Van Gool, *SURF: speeded up robust features*, ECCV 2006;
/// Bay, Ess, Tuytelaars and Van Gool, CVIU 2008.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Surf {
    /// s, the step between wavelets (px): the window is 20 s wide. 0: the key point's own scale.
    pub scale: f64,
}

impl Default for Surf {
    fn default() -> Self {
        Self { scale: 1.5 }
    }
}

impl Component for Surf {
    const NAME: &'static str = "surf";
    const SUMMARY: &'static str = "upright SURF: 64 sums of Haar wavelets around the key point";
    const SOURCE: &'static str = "Bay, Tuytelaars and Van Gool, SURF: speeded up robust features, ECCV 2006";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

/// Sub-regions along a side.
const REGIONS: usize = 4;
/// Wavelets along the side of a sub-region.
const SAMPLES: usize = 5;
/// Wavelets along the side of the window.
const SIDE: usize = REGIONS * SAMPLES;
/// Edges of wavelets along the side: each spans two steps and neighbours overlap by one.
const EDGES: usize = SIDE + 2;
/// Numbers in the descriptor.
const LENGTH: usize = REGIONS * REGIONS * 4;

impl Descriptor for Surf {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], _: &mut Workspace, described: &mut Descriptors) {
        let integral = Integral::of(image);
        // The Gaussian in steps of s is the same for all key points.
        let weights: [f64; SIDE] = std::array::from_fn(|i| {
            let step = i as f64 - 0.5 * (SIDE - 1) as f64;
            libm::exp(-0.5 * step * step / (3.3 * 3.3))
        });
        let rows = described.numbers_mut(keypoints.len(), LENGTH).chunks_exact_mut(LENGTH);
        for (row, keypoint) in rows.zip(keypoints) {
            let step = if self.scale > 0.0 { self.scale } else { f64::from(keypoint.scale) };
            row.copy_from_slice(&describe(&integral, keypoint, step, &weights));
        }
    }
}

fn describe(integral: &Integral, keypoint: &Keypoint, step: f64, weights: &[f64; SIDE]) -> [f32; LENGTH] {
    let [width, height] = integral.size();
    // The centre of the first pixel is (0, 0), its outer edge −1/2; the integral counts from the edge.
    let edge = |centre: f64, i: usize| centre + 0.5 + (i as f64 - 0.5 * (EDGES - 1) as f64) * step;
    let columns: [_; EDGES] = std::array::from_fn(|i| Integral::cell(edge(keypoint.at.u, i), width));
    let rows: [_; EDGES] = std::array::from_fn(|i| Integral::cell(edge(keypoint.at.v, i), height));
    let lattice: [[f64; EDGES]; EDGES] =
        std::array::from_fn(|j| std::array::from_fn(|i| integral.to(columns[i], rows[j])));

    let mut sums = [[0.0; 4]; REGIONS * REGIONS];
    for j in 0..SIDE {
        let [top, middle, bottom] = [&lattice[j], &lattice[j + 1], &lattice[j + 2]];
        for i in 0..SIDE {
            // Sums over the left and right, upper and lower halves of the wavelet.
            let left = (bottom[i + 1] - bottom[i]) - (top[i + 1] - top[i]);
            let right = (bottom[i + 2] - bottom[i + 1]) - (top[i + 2] - top[i + 1]);
            let upper = (middle[i + 2] - middle[i]) - (top[i + 2] - top[i]);
            let lower = (bottom[i + 2] - bottom[i]) - (middle[i + 2] - middle[i]);
            let weight = weights[i] * weights[j];
            let (dx, dy) = (weight * (right - left), weight * (lower - upper));
            let sum = &mut sums[(j / SAMPLES) * REGIONS + i / SAMPLES];
            sum[0] += dx;
            sum[1] += dy;
            sum[2] += dx.abs();
            sum[3] += dy.abs();
        }
    }
    let norm = sums.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
    // Differences of integrals leave rounding errors of 1e-9 grey levels where nothing changes.
    let scale = if norm > 1e-6 * step * step { 1.0 / norm } else { 0.0 };
    std::array::from_fn(|i| (sums[i / 4][i % 4] * scale) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    fn image(f: impl Fn(f64, f64) -> f64) -> Image {
        let pixels = (0..80 * 60).map(|i| f(f64::from(i % 80), f64::from(i / 80)) as f32).collect();
        Image::new(80, 60, pixels).unwrap()
    }

    fn waves(x: f64, y: f64) -> f64 {
        (100.0 + 40.0 * libm::sin(0.31 * x + 0.1 * y) + 30.0 * libm::cos(0.23 * y - 0.05 * x * x / 10.0)).round()
    }

    fn at(u: f64, v: f64) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.5 }
    }

    #[test]
    fn a_ramp_has_only_its_own_derivative() {
        let described = Surf { scale: 1.0 }.describe(&image(|x, _| x), &[at(40.0, 30.0)]);
        for region in described.numbers().unwrap().row(0).chunks_exact(4) {
            assert!(region[0] > 0.0 && region[0] == region[2], "{region:?}");
            assert!(region[1].abs() < 1e-6 && region[3] < 1e-6, "{region:?}");
        }
        // The middle regions weigh more than the outer ones, and left equals right.
        let region = |i: usize| described.numbers().unwrap().row(0)[4 * i];
        assert!(region(5) > region(4) && region(4) > region(0));
        assert!((region(4) - region(7)).abs() < 1e-6);
    }

    #[test]
    fn the_norm_is_one_or_nothing_changes() {
        let points = [at(40.0, 30.0), at(0.0, 0.0), at(79.0, 59.0), at(-3.0, 70.0), at(12.3, 45.6)];
        let described = Surf::default().describe(&image(waves), &points);
        assert_eq!(described.len(), points.len());
        for i in 0..points.len() {
            let norm = described.numbers().unwrap().row(i).iter().map(|x| x * x).sum::<f32>();
            assert!((norm - 1.0).abs() < 1e-5, "{i}: {norm}");
        }
        let flat = Surf::default().describe(&image(|_, _| 137.0), &points);
        assert!((0..points.len()).all(|i| flat.numbers().unwrap().row(i).iter().all(|x| *x == 0.0)));
    }

    #[test]
    fn light_and_contrast_drop_out() {
        let points = [at(40.2, 30.7), at(3.0, 2.0)];
        let a = Surf::default().describe(&image(waves), &points);
        let b = Surf::default().describe(&image(|x, y| 0.5 * waves(x, y) + 64.0), &points);
        for i in 0..points.len() {
            let furthest = a
                .numbers()
                .unwrap()
                .row(i)
                .iter()
                .zip(b.numbers().unwrap().row(i))
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(furthest < 1e-6, "{i}: {furthest}");
        }
    }

    #[test]
    fn scale_zero_is_the_key_point_s_own() {
        let own = Surf { scale: 0.0 }.describe(&image(waves), &[at(40.0, 30.0)]);
        assert_eq!(own, Surf { scale: 1.5 }.describe(&image(waves), &[at(40.0, 30.0)]));
    }

    #[test]
    fn no_key_point_no_descriptor() {
        let one = Image::new(1, 1, vec![3.0]).unwrap();
        assert!(Surf::default().describe(&one, &[]).is_empty());
        assert_eq!(Surf::default().describe(&one, &[at(0.0, 0.0)]).len(), 1);
    }
}
