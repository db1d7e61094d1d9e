//! Sub-pixel alignment of matched places between the two images.

use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use seafix_component::in_range;
use seafix_geometry::{Pixel, StereoPixels, UncertainPixels};
use serde::{Deserialize, Serialize};

use crate::{Image, Match, View, Workspace};

/// How the right place of a match is aligned to the left one.
///
/// Both detectors err; the error of the disparity is what the depth suffers from. The window around
/// the left place, T, is laid over the right image, I, by the affine map W(x) = c + A x that minimises
/// Σ w (Ĩ(W(x)) − T̃(x))², where ˜ means: mean subtracted, scaled to unit variance (so this maximises
/// the zero-normalised cross correlation), w a Gaussian. The right place becomes c.
/// Inverse-compositional Gauss–Newton: the derivatives are those of T, computed once.
///
/// Where it does not converge, or ends far from where it began, or the windows remain unlike, the
/// detectors' places stay.
///
/// Source: Baker and Matthews, *Lucas–Kanade 20 years on*, IJCV 2004; interpolation: Keys, *Cubic
/// convolution interpolation*, 1981.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Refine {
    /// Whether to align at all.
    pub refine: bool,
    /// Side of the window (px), odd, 3 to 201.
    pub window: usize,
    /// Whether the window may also be sheared and scaled, as a strongly slanted surface asks for. At the
    /// corners of boxes, with another surface behind, six parameters are noisier than two.
    pub affine: bool,
    /// How far the alignment may move the right place (px).
    pub reach: f64,
    /// The least zero-normalised cross correlation of the aligned windows.
    pub least_correlation: f64,
    /// The greatest number of iterations.
    pub iterations: usize,
}

impl Default for Refine {
    fn default() -> Self {
        Self { refine: true, window: 11, affine: false, reach: 1.5, least_correlation: 0.8, iterations: 20 }
    }
}

impl Refine {
    /// Whether the settings can be.
    ///
    /// # Errors
    /// The setting that is out of its range, its value, and the range.
    pub fn check(&self) -> Result<(), String> {
        let Self { refine: _, window, affine: _, reach, least_correlation, iterations } = *self;
        let odd = window % 2 == 1 && (3..=201).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 3 to 201")?;
        in_range(reach > 0.0 && reach <= 100.0, "reach", reach, "more than 0, at most 100 (px)")?;
        let correlated = (-1.0..=1.0).contains(&least_correlation);
        in_range(correlated, "least-correlation", least_correlation, "a number from -1 to 1")?;
        in_range((1..=1000).contains(&iterations), "iterations", iterations, "a number from 1 to 1000")
    }
}

impl Refine {
    /// Replaces `pixels` by the places of the matched key points, in the order of `matches`, aligned as
    /// these settings say; `sigma` is the error of a place that a detector found (px, each coordinate).
    pub fn align_into(
        &self,
        matches: &[Match],
        left: &View<'_>,
        right: &View<'_>,
        sigma: f64,
        _: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    ) {
        let mut aligner = Aligner::new(self);
        pixels.clear();
        pixels.extend(matches.iter().map(|found| {
            let pair = StereoPixels { left: left.keypoints[found.left].at, right: found.right };
            let aligned = if self.refine { aligner.align(left.image, right.image, &pair) } else { None };
            UncertainPixels::independent(StereoPixels { right: aligned.unwrap_or(pair.right), ..pair }, sigma)
        }));
    }

    /// The places of the matched key points, aligned, in the order of `matches`.
    pub fn align(&self, matches: &[Match], left: &View<'_>, right: &View<'_>, sigma: f64) -> Vec<UncertainPixels> {
        let mut pixels = Vec::new();
        self.align_into(matches, left, right, sigma, &mut Workspace::default(), &mut pixels);
        pixels
    }
}

/// A window's working space, used again for every match.
struct Aligner<'a> {
    settings: &'a Refine,
    half: isize,
    weights: Vec<f64>,
    template: Vec<f64>,
    /// Derivatives of the normalised template by the six parameters: c, then A row by row.
    jacobian: Vec<Vector6<f64>>,
    patch: Vec<f64>,
}

impl<'a> Aligner<'a> {
    fn new(settings: &'a Refine) -> Self {
        let half = (settings.window / 2).min(100) as isize;
        let sigma = (half as f64 + 0.5) / 1.5;
        let side = 2 * half + 1;
        let weight = |x: isize| libm::exp(-0.5 * ((x - half) * (x - half)) as f64 / (sigma * sigma));
        let weights: Vec<f64> = (0..side * side).map(|i| weight(i % side) * weight(i / side)).collect();
        let sum: f64 = weights.iter().sum();
        Self {
            settings,
            half,
            weights: weights.iter().map(|w| w / sum).collect(),
            template: Vec::new(),
            jacobian: Vec::new(),
            patch: Vec::new(),
        }
    }

    /// Steps from the centre of the window, row by row.
    fn steps(&self) -> impl Iterator<Item = Vector2<f64>> + use<> {
        let half = self.half;
        (-half..=half).flat_map(move |y| (-half..=half).map(move |x| Vector2::new(x as f64, y as f64)))
    }

    /// Whether every sample around `at`, with what its interpolation needs, lies in the image.
    fn fits(&self, image: &Image, at: &Vector2<f64>, shape: &Matrix2<f64>) -> bool {
        let half = self.half as f64;
        let x = half * (shape[(0, 0)].abs() + shape[(0, 1)].abs()) + 2.0;
        let y = half * (shape[(1, 0)].abs() + shape[(1, 1)].abs()) + 2.0;
        at.x - x >= 0.0
            && at.y - y >= 0.0
            && at.x + x <= (image.width() - 1) as f64
            && at.y + y <= (image.height() - 1) as f64
    }

    /// Mean subtracted, scaled to unit variance; the scale, or `None` where nothing changes.
    fn normalize(values: &mut [f64], weights: &[f64]) -> Option<f64> {
        let mean: f64 = values.iter().zip(weights).map(|(v, w)| v * w).sum();
        values.iter_mut().for_each(|v| *v -= mean);
        let variance: f64 = values.iter().zip(weights).map(|(v, w)| v * v * w).sum();
        // A grey level is 1; below a hundredth of it there is nothing to align.
        (variance > 1e-4).then(|| {
            let scale = 1.0 / variance.sqrt();
            values.iter_mut().for_each(|v| *v *= scale);
            scale
        })
    }

    fn align(&mut self, left: &Image, right: &Image, pair: &StereoPixels) -> Option<Pixel> {
        let mut shape = Matrix2::identity();
        let centre = Vector2::new(pair.left.u, pair.left.v);
        let start = Vector2::new(pair.right.u, pair.right.v);
        if !self.fits(left, &centre, &shape) {
            return None;
        }
        let hessian = self.prepare(left, &centre)?;
        let inverse = hessian.try_inverse()?;
        let mut at = start;
        let mut converged = false;
        for _ in 0..self.settings.iterations {
            let (gradient, _) = self.compare(right, &at, &shape)?;
            let step = inverse * gradient;
            // W ← W ∘ ΔW⁻¹ with ΔW(x) = δ + (1 + Δ) x.
            let delta = Matrix2::identity() + Matrix2::new(step[2], step[3], step[4], step[5]);
            shape *= delta.try_inverse()?;
            let moved = shape * Vector2::new(step[0], step[1]);
            at -= moved;
            if !((at - start).norm() <= self.settings.reach) {
                return None;
            }
            if moved.norm() < 1e-3 {
                converged = true;
                break;
            }
        }
        let (_, correlation) = self.compare(right, &at, &shape)?;
        (converged && correlation >= self.settings.least_correlation).then_some(Pixel { u: at.x, v: at.y })
    }

    /// The template, its derivatives and JᵀJ.
    fn prepare(&mut self, image: &Image, centre: &Vector2<f64>) -> Option<Matrix6<f64>> {
        self.template.clear();
        self.jacobian.clear();
        for step in self.steps() {
            let (value, gradient) = sample(image, &(centre + step));
            self.template.push(value);
            let (x, y) = if self.settings.affine { (step.x, step.y) } else { (0.0, 0.0) };
            let [gx, gy] = [gradient.x, gradient.y];
            self.jacobian.push(Vector6::new(gx, gy, gx * x, gx * y, gy * x, gy * y));
        }
        let scale = Self::normalize(&mut self.template, &self.weights)?;
        // The mean and the scale of the patch are free: derivatives lose what lies along them.
        let mean: Vector6<f64> = self.jacobian.iter().zip(&self.weights).map(|(j, w)| j * *w).sum();
        self.jacobian.iter_mut().for_each(|j| *j = (*j - mean) * scale);
        let along: Vector6<f64> =
            self.jacobian.iter().zip(&self.weights).zip(&self.template).map(|((j, w), t)| j * (*w * *t)).sum();
        let mut hessian = Matrix6::zeros();
        for ((j, w), t) in self.jacobian.iter_mut().zip(&self.weights).zip(&self.template) {
            *j -= along * *t;
            hessian += *j * j.transpose() * *w;
        }
        if !self.settings.affine {
            (2..6).for_each(|i| hessian[(i, i)] = 1.0);
        }
        Some(hessian)
    }

    /// Jᵀr and the correlation with the right image under W.
    fn compare(&mut self, image: &Image, at: &Vector2<f64>, shape: &Matrix2<f64>) -> Option<(Vector6<f64>, f64)> {
        if !self.fits(image, at, shape) {
            return None;
        }
        let steps = self.steps();
        self.patch.clear();
        self.patch.extend(steps.map(|step| sample(image, &(at + shape * step)).0));
        Self::normalize(&mut self.patch, &self.weights)?;
        let mut gradient = Vector6::zeros();
        let mut correlation = 0.0;
        for (((j, w), t), p) in self.jacobian.iter().zip(&self.weights).zip(&self.template).zip(&self.patch) {
            gradient += j * (w * (p - t));
            correlation += w * p * t;
        }
        Some((gradient, correlation))
    }
}

/// The grey value at a place at least 2 px inside the image and its gradient, by Keys' cubic convolution.
fn sample(image: &Image, at: &Vector2<f64>) -> (f64, Vector2<f64>) {
    let (x, y) = ((at.x as usize).clamp(1, image.width() - 3), (at.y as usize).clamp(1, image.height() - 3));
    let (wx, dx) = keys(at.x - x as f64);
    let (wy, dy) = keys(at.y - y as f64);
    let (mut value, mut gx, mut gy) = (0.0, 0.0, 0.0);
    for i in 0..4 {
        let row = &image.row(y + i - 1)[x - 1..x + 3];
        let (mut along, mut slope) = (0.0, 0.0);
        for j in 0..4 {
            let pixel = f64::from(row[j]);
            along += wx[j] * pixel;
            slope += dx[j] * pixel;
        }
        value += wy[i] * along;
        gx += wy[i] * slope;
        gy += dy[i] * along;
    }
    (value, Vector2::new(gx, gy))
}

/// Keys' weights (a = −1/2) of the four samples around a fraction, and their derivatives.
fn keys(t: f64) -> ([f64; 4], [f64; 4]) {
    let weights = [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ];
    let slopes = [-0.5 + t * (2.0 - 1.5 * t), t * (-5.0 + 4.5 * t), 0.5 + t * (4.0 - 4.5 * t), t * (-1.0 + 1.5 * t)];
    (weights, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Descriptors, Keypoint};

    /// Waves, seen `shift` px further to the right and half of that down, with other light and contrast.
    fn waves(shift: f64, contrast: f64, light: f64) -> Image {
        let value = |i: usize| {
            let (x, y) = ((i % 60) as f64 - shift, (i / 60) as f64 - 0.5 * shift);
            light + contrast * (libm::sin(0.5 * x + 0.2 * y) + libm::cos(0.6 * y - 0.3 * x) + libm::sin(0.9 * x))
        };
        Image::new(60, 60, (0..3600).map(|i| value(i) as f32).collect()).unwrap()
    }

    fn aligned(right: &Image, at: Pixel, start: Pixel, refine: &Refine) -> StereoPixels {
        let left = waves(0.0, 30.0, 120.0);
        let none = Descriptors::default();
        let [l, r] = [at, start].map(|at| [Keypoint { at, response: 1.0, scale: 1.0 }]);
        let view = |image, keypoints| View { image, keypoints, descriptors: &none };
        let found = [Match { left: 0, right: start, distance: 0.0 }];
        let (left, right) = (View { image: &left, keypoints: &l, descriptors: &none }, view(right, &r));
        refine.align(&found, &left, &right, 0.15)[0].at
    }

    #[test]
    fn a_shift_is_found_under_other_light() {
        let right = waves(0.62, 20.0, 80.0);
        for affine in [false, true] {
            let refine = Refine { affine, ..Refine::default() };
            let at = Pixel { u: 30.3, v: 28.8 };
            let pair = aligned(&right, at, Pixel { u: 30.0, v: 29.5 }, &refine);
            assert_eq!(pair.left, at);
            assert!(pair.right.distance(&Pixel { u: 30.92, v: 29.11 }) < 0.03, "{affine}: {pair:?}");
        }
    }

    #[test]
    fn where_it_cannot_align_the_places_stay() {
        let at = Pixel { u: 30.0, v: 30.0 };
        let start = Pixel { u: 30.4, v: 30.1 };
        let right = waves(0.62, 20.0, 80.0);
        let off = Refine { refine: false, ..Refine::default() };
        assert_eq!(aligned(&right, at, start, &off).right, start);
        let flat = Image::new(60, 60, vec![90.0; 3600]).unwrap();
        assert_eq!(aligned(&flat, at, start, &Refine::default()).right, start, "nothing to align to");
        let tiny = Image::new(1, 1, vec![90.0]).unwrap();
        assert_eq!(aligned(&tiny, at, start, &Refine::default()).right, start, "an image too small");
        let border = Pixel { u: 2.0, v: 30.0 };
        assert_eq!(aligned(&right, border, start, &Refine::default()).right, start, "a window cut off");
        let far = Pixel { u: 34.0, v: 30.0 };
        assert_eq!(aligned(&right, at, far, &Refine::default()).right, far, "too far to reach");
    }
}
