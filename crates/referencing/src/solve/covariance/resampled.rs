//! The covariance by resampling, for answers that derivatives do not describe.

use nalgebra::{Matrix2, Matrix3, Matrix4, Matrix6, Matrix6x2, Vector3, Vector4, Vector6};
use seafix_geometry::{
    Camera, Covariance6, Object, Pixel, StereoPixels, StereoRig, Transform, UncertainPixels, UncertainPoint,
};

use crate::{
    observations::{Observation, Observations},
    solve::{
        closed_form::distance,
        covariance::sigma_directions::{SigmaDirections, rows},
        degeneracy::Degenerate,
        likelihood::{normal::singular, pixel_terms::PIXEL_FLOOR},
    },
};

/// The parametric bootstrap covariance: the mean of ξξᵀ over answers `at · Exp(ξ)` to resampled noise.
///
/// It follows Efron and Tibshirani, *An introduction to the bootstrap*, 1993. It includes bias, and the effect of
/// losses with corners on noise of their size, which no derivative at one draw describes. The draws are rows of
/// [`SigmaDirections`], as many as `answer` requires, and their negatives: for an answer linear in the noise they give
/// the exact covariance. A point that the noise does not explain is kept at its measured position, so that it stays
/// excluded, or pulls, as before; all others are placed by the pose.
///
/// # Errors
///
/// [`Degenerate::Scattered`] if more than one of ten draws has no answer.
pub(crate) fn covariance(
    solve: impl Fn(&Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>,
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
    answer: Answer,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let all: Vec<Source> =
        data.points.iter().enumerate().map(|(k, p)| Source::of(k, p, data.rig, at)).collect::<Result<_, _>>()?;
    let numbers = all.iter().map(Source::numbers).sum();
    let (size, blocks) = rows(numbers, answer.pairs());
    let mut answers: Vec<[Option<Vector6<f64>>; 2]> = Vec::with_capacity(size * blocks);
    let mut moved = data.clone();
    for block in 0..blocks {
        for row in SigmaDirections::new(size, block as u64).rows() {
            answers.push([1.0, -1.0].map(|sign| {
                let mut noise = row.iter().map(|z| sign * z);
                let shown = all.iter().zip(&mut moved.points).try_for_each(|(source, point)| {
                    *point = source.draw(data.rig, &mut noise)?;
                    Some(())
                });
                shown.and_then(|()| solve(&moved).ok()).map(|answer| at.error_to(&answer))
            }));
        }
    }
    let answered = answers.iter().flatten().flatten().count();
    let sampled = 2 * size * blocks;
    if answered * 10 < sampled * 9 {
        return Err(Degenerate::Scattered { answered, sampled });
    }
    let sum: Matrix6<f64> = answers.iter().flatten().flatten().map(|xi| xi * xi.transpose()).sum();
    let scale = match answer {
        Answer::Straight => 1.0,
        Answer::Bent => left_out(&answers, &sum).ok_or_else(|| singular(&sum))?,
    };
    Ok(Covariance6::new(sum * (scale / answered as f64)))
}

/// The linearity of the answer in the noise, which determines the number of draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    /// Nearly linear: the draws give the covariance almost exactly.
    Straight,
    /// Nonlinear everywhere: the covariance is that of a sample.
    ///
    /// The inverse of a sample covariance is too large, more so for small samples and long tails; a leave-one-out
    /// factor corrects it.
    Bent,
}

impl Answer {
    /// The number of draws, each with its negative.
    fn pairs(self) -> usize {
        match self {
            Self::Straight => 128,
            Self::Bent => 512,
        }
    }
}

/// The leave-one-out mean of ξᵀ Σ⁻¹ ξ / 6 over all answers.
///
/// Σ is the covariance of all draws except ξ and its negative, and `sum` is Σ ξξᵀ of all. With U the two answers of a
/// pair and S their sum without them, Uᵀ S⁻¹ U follows from G, the same form for all: G (1 − G)⁻¹.
fn left_out(answers: &[[Option<Vector6<f64>>; 2]], sum: &Matrix6<f64>) -> Option<f64> {
    let of_all = sum.cholesky()?;
    let count = answers.iter().flatten().flatten().count() as f64;
    let mut squares = 0.0;
    for pair in answers {
        let [a, b] = pair.map(Option::unwrap_or_default);
        let pair = Matrix6x2::from_columns(&[a, b]);
        let g = pair.transpose() * of_all.solve(&pair);
        squares += (g * (Matrix2::identity() - g).try_inverse()?).trace() * (count - 2.0);
    }
    Some(squares / (6.0 * count))
}

/// Residual (standard deviations of its point) with a probability of 1e-6 for noise along one axis.
///
/// A pose that weights all axes alike leaves residuals across the others that a χ² test would reject.
const UNLIKELY: f64 = 8.5;

/// A point without its noise, and the noise.
#[expect(clippy::large_enum_variant, reason = "one a point, and bare points are the fewer")]
enum Source {
    Seen { point: Observation, at: Vector4<f64>, pixels: UncertainPixels, root: Matrix4<f64> },
    Bare { point: Observation, at: Vector3<f64>, root: Matrix3<f64> },
}

impl Source {
    fn of(
        index: usize,
        point: &Observation,
        rig: Option<&StereoRig>,
        pose: &Transform<Object, Camera>,
    ) -> Result<Self, Degenerate> {
        let point = *point;
        let place = pose.inverse() * point.model;
        let likely = distance(&point, pose) <= UNLIKELY;
        let why = Degenerate::Noise { index };
        if let (Some(pixels), Some(rig)) = (point.pixels, rig) {
            let shown = rig.project(&place).filter(|_| likely).unwrap_or(pixels.at).coordinates();
            let noise = pixels.covariance + Matrix4::identity() * (PIXEL_FLOOR * PIXEL_FLOOR);
            let root = noise.cholesky().ok_or(why)?.l();
            return Ok(Self::Seen { point, at: shown, pixels, root });
        }
        let digits = point.digits();
        let noise = point.measured.covariance + Matrix3::identity() * (digits * digits);
        let root = noise.cholesky().ok_or(why)?.l();
        let at = if likely { place.coords } else { point.measured.at.coords };
        Ok(Self::Bare { point, at, root })
    }

    fn point(&self) -> &Observation {
        match self {
            Self::Seen { point, .. } | Self::Bare { point, .. } => point,
        }
    }

    /// The number of random numbers of its noise.
    fn numbers(&self) -> usize {
        let measured = if matches!(self, Self::Seen { .. }) { 4 } else { 3 };
        measured + if self.point().model_sigma > 0.0 { 3 } else { 0 }
    }

    /// The point with other noise; `None` if it cannot be triangulated.
    fn draw(&self, rig: Option<&StereoRig>, noise: &mut impl Iterator<Item = f64>) -> Option<Observation> {
        let mut next = || noise.next().unwrap_or(0.0);
        let mut sampled = *self.point();
        match self {
            Self::Seen { at, pixels, root, .. } => {
                let [ul, vl, ur, vr] = (at + root * Vector4::from_fn(|_, _| next())).into();
                let shown = StereoPixels { left: Pixel { u: ul, v: vl }, right: Pixel { u: ur, v: vr } };
                let seen = UncertainPixels { at: shown, ..*pixels };
                let found = rig?.triangulate(&seen).ok()?;
                sampled.measured = UncertainPoint { at: found.point, covariance: found.covariance };
                sampled.pixels = Some(seen);
            }
            Self::Bare { at, root, .. } => {
                sampled.measured.at = (at + root * Vector3::from_fn(|_, _| next())).into();
            }
        }
        if sampled.model_sigma > 0.0 {
            sampled.model = sampled.model + Vector3::from_fn(|_, _| next()) * sampled.model_sigma;
        }
        Some(sampled)
    }
}
