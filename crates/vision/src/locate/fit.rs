//! The fit of a blurred corner to the pixels around a key point.

use nalgebra::{Cholesky, Matrix2, SMatrix, SVector};
use seafix_component::{Settings, in_range};
use seafix_geometry::Pixel;
use serde::{Deserialize, Serialize};

use super::{
    locator::UncertainPixel,
    model::{Model, Normal, PARAMETERS, Pixels, Shape},
    start::{Guess, Start},
};
use crate::{image::Image, keypoint::Keypoint};

/// Settings of the fit of a corner model and of its acceptance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CornerFit {
    /// Side of the square window of the fit (px); odd, 7 to 31.
    pub window: usize,
    /// Maximum distance of the corner from the key point (px).
    pub reach: f64,
    /// Minimum difference between bright and dark (grey levels).
    pub contrast: f64,
    /// Minimum fraction of the window's variance that the model explains; the rest is noise and other structure.
    pub explained: f64,
}

impl Default for CornerFit {
    fn default() -> Self {
        Self { window: 11, reach: 3.5, contrast: 10.0, explained: 0.95 }
    }
}

impl CornerFit {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The invalid setting, its value and its range.
    pub fn check(&self) -> Result<(), String> {
        let Self { window, reach, contrast, explained } = *self;
        let odd = window % 2 == 1 && (7..=31).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 7 to 31")?;
        in_range(reach > 0.0 && reach <= 10.0, "reach", reach, "more than 0, at most 10 (px)")?;
        in_range((0.0..=255.0).contains(&contrast), "contrast", contrast, "a number from 0 to 255 (grey levels)")?;
        in_range((0.0..=1.0).contains(&explained), "explained", explained, "a number from 0 to 1")
    }
}

/// The pixels of a window and its centre in the image.
#[derive(Debug, Default)]
pub(super) struct Fitter {
    pixels: Pixels,
    middle: [usize; 2],
    /// The mean, which is subtracted from the values.
    mean: f64,
    /// The sum of the squared values after that.
    variation: f64,
}

/// The maximum number of steps of the fit in all windows.
const STEPS: usize = 20;
/// The early-exit limit of the sharp-edged first guess.
///
/// Most key points lie in texture and would take most of the time. A candidate is abandoned if its unexplained variance
/// exceeds that of an acceptable fit by this factor.
const SHARP: f64 = 9.0;
/// The early-exit factor of the linear model's prediction for the first step, as [`SHARP`].
const FIRST: f64 = 2.5;
/// The early-exit factor of the linear model's prediction for later steps, as [`SHARP`].
const LATER: f64 = 1.5;
/// The contrast factor of a first guess: blur lowers the contrast below that of the fit.
const PALE: f64 = 0.5;
/// A shape is tried if its guess explains at least this fraction of the other's explained variance.
const WORSE: f64 = 0.7;
/// The step length (px) that ends the fit: the next would be a small part of it.
const SHORT: f64 = 3e-3;
/// The offset (px) of the corner beyond which the window moves to it, once steps are shorter than this.
const ASIDE: f64 = 0.5;
/// The maximum number of moves of the window.
const MOVES: usize = 3;
/// The range of the blur's standard deviation (px).
const BLUR: [f64; 2] = [0.3, 3.0];
/// The sine of the smallest angle between the edges.
const PARALLEL: f64 = 0.3;

impl Fitter {
    /// The corner near `keypoint` with the best fit among `shapes`; `None` if none is accepted.
    pub(super) fn near(
        &mut self,
        settings: &CornerFit,
        shapes: &[Shape],
        image: &Image,
        keypoint: &Keypoint,
    ) -> Option<UncertainPixel> {
        let half = settings.window / 2;
        let near = [keypoint.at.u, keypoint.at.v].map(libm::round);
        let [x, y] = full(near, half + 1, image)?;
        let start = Start::of(image, x, y, half).filter(|start| start.at.norm() <= settings.reach)?;
        let mut guesses = [Guess::NONE; 2];
        guesses.iter_mut().zip(shapes).for_each(|(guess, &shape)| *guess = start.guess(shape));
        let guesses = &mut guesses[..shapes.len()];
        guesses.sort_by(|a, b| b.explained.total_cmp(&a.explained));
        let min = (1.0 - SHARP * (1.0 - settings.explained)).max(WORSE * guesses[0].explained);
        let at = [start.at.x + near[0], start.at.y + near[1]];
        let likely = |guess: &&Guess| guess.explained >= min && guess.contrast() >= PALE * settings.contrast;
        guesses.iter().filter(likely).find_map(|guess| self.fit(settings, image, keypoint, guess.model(at)))
    }

    /// The Gauss–Newton fit, with Levenberg and Marquardt's damping after a step that increases the cost.
    ///
    /// The window follows the corner. The centre of `model` is relative to the image's first pixel.
    fn fit(
        &mut self,
        settings: &CornerFit,
        image: &Image,
        keypoint: &Keypoint,
        mut model: Model,
    ) -> Option<UncertainPixel> {
        let half = settings.window / 2;
        let mut middle = [0.0; 2];
        let mut best = self.evaluate(image, &mut middle, half, &mut model)?;
        let (mut damping, mut moved, mut max) = (0.0, 0, FIRST);
        for _ in 0..STEPS {
            let step = solve(&best, damping)?;
            let promised = best.squares - step.dot(&SVector::from(best.gradient));
            if promised > max * (1.0 - settings.explained) * self.variation {
                return None;
            }
            let mut trial = model;
            trial.at.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += step);
            let sane = trial.at[..2].iter().all(|c| c.abs() <= half as f64)
                && (1.0 / BLUR[1]..=1.0 / BLUR[0]).contains(&trial.at[4])
                && libm::sin(trial.at[2] - trial.at[3]).abs() >= PARALLEL;
            let length = libm::hypot(step[0], step[1]);
            let may_move = moved < MOVES && trial.at[..2].iter().any(|c| c.abs() > ASIDE);
            if sane && length < SHORT && damping == 0.0 && !may_move {
                best.squares = promised;
                return self.judge(settings, keypoint, image.rounding(), &trial, &best);
            }
            let next = if sane { Some(self.pixels.normal(&trial)) } else { None };
            let Some(next) = next.filter(|next| next.squares <= best.squares * (1.0 + 1e-5)) else {
                damping = (damping * 8.0).max(1e-2);
                if damping > 1e4 {
                    return None;
                }
                continue;
            };
            (model, best, damping, max) = (trial, next, damping * 0.2, LATER);
            if damping < 1e-3 {
                damping = 0.0;
            }
            if may_move && length < ASIDE {
                moved += 1;
                model.at[0] += middle[0];
                model.at[1] += middle[1];
                model.at[5] += self.mean;
                best = self.evaluate(image, &mut middle, half, &mut model)?;
            }
        }
        None
    }

    /// Takes the window around the centre of `model`, whose values are then relative to the window's centre and mean.
    fn evaluate(&mut self, image: &Image, middle: &mut [f64; 2], half: usize, model: &mut Model) -> Option<Normal> {
        *middle = [model.at[0], model.at[1]].map(libm::round);
        self.take(image, *middle, half)?;
        model.at[0] -= middle[0];
        model.at[1] -= middle[1];
        model.at[5] -= self.mean;
        Some(self.pixels.normal(model))
    }

    /// The corner, if the fit is accepted.
    fn judge(
        &self,
        settings: &CornerFit,
        keypoint: &Keypoint,
        rounding: f64,
        model: &Model,
        normal: &Normal,
    ) -> Option<UncertainPixel> {
        let [x, y] = self.middle.map(|x| x as f64);
        let at = Pixel { u: x + model.at[0], v: y + model.at[1] };
        let difference = model.at[6].abs() * if model.shape == Shape::Crossing { 2.0 } else { 1.0 };
        let explained = 1.0 - normal.squares / self.variation;
        let believed = at.distance(&keypoint.at) <= settings.reach
            && difference >= settings.contrast
            && explained >= settings.explained;
        let freedom = (settings.window * settings.window - PARAMETERS) as f64;
        let inverse = factor(normal, 0.0)?.inverse();
        // The residual variance is at least that of rounding.
        let covariance = inverse.fixed_view::<2, 2>(0, 0) * (normal.squares / freedom).max(rounding);
        let covariance = Matrix2::new(covariance[(0, 0)], covariance[(0, 1)], covariance[(0, 1)], covariance[(1, 1)]);
        (believed && covariance.trace() < 0.25).then_some(UncertainPixel { at, covariance })
    }

    /// Takes the values of the window around `middle`, less their mean.
    fn take(&mut self, image: &Image, middle: [f64; 2], half: usize) -> Option<()> {
        let [x, y] = full(middle, half, image)?;
        let side = 2 * half + 1;
        self.pixels.shape(half);
        let values = &mut self.pixels.values_mut()[..side * side];
        let mut sum = 0.0;
        for (row, values) in (y - half..).zip(values.chunks_exact_mut(side)) {
            values.copy_from_slice(&image.row(row)[x - half..][..side]);
            sum += f64::from(values.iter().sum::<f32>());
        }
        self.middle = [x, y];
        self.mean = sum / (side * side) as f64;
        let mean = self.mean as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        self.mean = f64::from(mean);
        self.variation = f64::from(values.iter().map(|value| value * value).sum::<f32>());
        Some(())
    }
}

/// The pixel of `at`, if the square of half-side `half` around it lies in the image.
pub(super) fn full(at: [f64; 2], half: usize, image: &Image) -> Option<[usize; 2]> {
    let inside = |x: f64, n: usize| x >= half as f64 && x + half as f64 <= (n - 1) as f64;
    (inside(at[0], image.width()) && inside(at[1], image.height())).then(|| at.map(|x| x as usize))
}

fn factor(normal: &Normal, damping: f64) -> Option<Cholesky<f64, nalgebra::Const<PARAMETERS>>> {
    let mut matrix = SMatrix::<f64, PARAMETERS, PARAMETERS>::from(normal.matrix);
    for i in 0..PARAMETERS {
        matrix[(i, i)] *= 1.0 + damping + 1e-9;
    }
    matrix.cholesky()
}

fn solve(normal: &Normal, damping: f64) -> Option<SVector<f64, PARAMETERS>> {
    factor(normal, damping).map(|factor| factor.solve(&SVector::from(normal.gradient)))
}
