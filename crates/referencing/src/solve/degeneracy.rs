//! Degenerate configurations of points: the error that names them, and the tests for them.

use nalgebra::{Matrix3, Vector3};
use seafix_component::in_range;

use crate::observations::{Observation, Observations};

/// Geometry that determines no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Degenerate {
    /// Fewer points than the solver needs.
    #[error("too few points: {found} found, the solver needs {needed}")]
    TooFew {
        /// The number of points.
        found: usize,
        /// The number that the solver needs.
        needed: usize,
    },
    /// The points are (nearly) collinear, so the rotation about their line is undetermined.
    #[error("nearly collinear points: their second extent is {ratio:.2e} of the first, at least {min:.2e} is needed")]
    Collinear {
        /// The ratio of second to first singular value.
        ratio: f64,
        /// The smallest accepted ratio.
        min: f64,
    },
    /// A measured point lies behind the left camera.
    #[error("point behind the camera: point {index} has a depth of {depth:.3} m")]
    Behind {
        /// The index of the point.
        index: usize,
        /// The depth (m), zero or less.
        depth: f64,
    },
    /// All points are too far away for the baseline.
    #[error(
        "points too far away for the baseline: the best distance has a relative error of {fraction:.2}, \
         at most {max:.2} is accepted"
    )]
    Far {
        /// The smallest relative standard deviation of a distance.
        fraction: f64,
        /// The largest accepted value.
        max: f64,
    },
    /// The solver needs pixels and a rig, and at least one is missing.
    #[error("no pixels or no rig: the solver needs both")]
    NoPixels,
    /// Measured points and model differ in scale.
    #[error(
        "wrong scale: the model is {scale:.4} times as large as the measured points, a deviation of {max} is \
        accepted"
    )]
    Scale {
        /// The scale of the best similarity.
        scale: f64,
        /// The largest accepted deviation from one.
        max: f64,
    },
    /// The normal equations are singular: a motion changes no measurement.
    #[error(
        "undetermined motion: the smallest eigenvalue of the information, scaled to a unit diagonal, is \
         {fraction:.1e}, \
         more than the rounding error of {min:.1e} is needed"
    )]
    Singular {
        /// The smallest eigenvalue of the scaled information.
        fraction: f64,
        /// The smallest eigenvalue above rounding.
        min: f64,
    },
    /// A coordinate is not finite.
    #[error("invalid point: a coordinate is not finite")]
    NotFinite,
    /// The covariance of a point is not finite or not invertible.
    #[error("invalid noise of point {index}: its covariance must be finite and positive definite")]
    Noise {
        /// The index of the point.
        index: usize,
    },
    /// A pose of the iteration puts a point out of a camera's view.
    #[error(
        "hidden point: a pose of the iteration puts point {index} at a depth of {depth:.3} m, out of a camera's \
        view"
    )]
    Hidden {
        /// The index of the point.
        index: usize,
        /// The depth in the left camera (m).
        depth: f64,
    },
    /// Too few resampled problems have a solution to estimate a covariance.
    #[error("no covariance: only {answered} of {sampled} resampled problems have a solution, nine of ten are needed")]
    Scattered {
        /// The number of resampled problems with a solution.
        answered: usize,
        /// The number of resampled problems.
        sampled: usize,
    },
    /// An iteration ended before its minimum.
    #[error("no convergence: after {steps} steps the minimum is {off:.2e} standard deviations away, {max} is accepted")]
    Unconverged {
        /// The number of steps.
        steps: u64,
        /// The distance of the minimum (standard deviations of the pose).
        off: f64,
        /// The largest accepted distance.
        max: f64,
    },
    /// A solver outside this library rejects the geometry, in its own words.
    #[error("{0}")]
    Stated(String),
}

impl Degenerate {
    /// The remedy in one phrase.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFew { .. } => "bring more of the object into view",
            Self::Collinear { .. } => "identify points farther from a common line",
            Self::Behind { .. } => "check the triangulation",
            Self::Far { .. } => "move closer or use a longer baseline",
            Self::NoPixels => "use `mahalanobis` for points alone",
            Self::Scale { .. } => "check baseline, focal length and survey",
            Self::Singular { .. } | Self::Scattered { .. } => "identify more points",
            Self::NotFinite => "check the coordinates of model and cloud",
            Self::Noise { .. } => "check the point covariances",
            Self::Hidden { .. } | Self::Unconverged { .. } => "use the solver `mahalanobis`",
            Self::Stated(_) => "see the description of the solver",
        }
    }
}

/// Largest distance (standard deviations of the pose) from the minimum at the end of an iteration.
///
/// It adds at most 1 in 20 000 to the error.
const CONVERGED: f64 = 0.01;

/// Rejects a pose farther from its minimum than [`CONVERGED`]; a NaN is rejected as well.
pub(crate) fn converged(steps: u64, off: f64) -> Result<(), Degenerate> {
    if off <= CONVERGED { Ok(()) } else { Err(Degenerate::Unconverged { steps, off, max: CONVERGED }) }
}

/// Checks that the setting `key` is a fraction from 0 to below 1.
pub(crate) fn fraction(key: &str, value: f64) -> Result<(), String> {
    in_range((0.0..1.0).contains(&value), key, value, "a fraction from 0 to below 1")
}

/// The centroid of points.
pub(crate) fn centroid(points: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let count = points.len().max(1) as f64;
    points.sum::<Vector3<f64>>() / count
}

/// Three distant model points: the farthest from the centroid, the farthest from that, and the farthest from the line
/// through both.
pub(crate) fn widest(data: &Observations<'_>) -> [usize; 3] {
    let at = |i: usize| data.points[i].model.coords;
    let centre = data.points.iter().map(|point| point.model.coords).sum::<Vector3<f64>>() / data.points.len() as f64;
    let farthest = |measure: &dyn Fn(usize) -> f64| {
        let better = |best: usize, i: usize| if measure(i) > measure(best) { i } else { best };
        (0..data.points.len()).fold(0, better)
    };
    let first = farthest(&|i| (at(i) - centre).norm_squared());
    let second = farthest(&|i| (at(i) - at(first)).norm_squared());
    let along = at(second) - at(first);
    let third = farthest(&|i| along.cross(&(at(i) - at(first))).norm_squared());
    [first, second, third]
}

/// Σ (p − p̄)(p − p̄)ᵀ.
fn scatter(points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> Matrix3<f64> {
    let centre = centroid(points.clone());
    let mut scatter = Matrix3::zeros();
    for p in points {
        scatter += (p - centre) * (p - centre).transpose();
    }
    scatter
}

/// A sufficient test of the ratio of second to first extent, without eigenvalues.
///
/// With the eigenvalues l₁ ≥ l₂ ≥ l₃ of the scatter, l₂/l₁ ≥ (l₁l₂ + l₁l₃ + l₂l₃) / 2(l₁ + l₂ + l₃)²; the ratio is at
/// least `min` if that bound is.
fn clearly_wide(points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone, min: f64) -> bool {
    let s = scatter(points);
    let minor = |i: usize, j: usize| s[(i, i)] * s[(j, j)] - s[(i, j)] * s[(i, j)];
    minor(0, 1) + minor(0, 2) + minor(1, 2) > 4.0 * min * min * s.trace() * s.trace()
}

/// Ratio of second to first extent below which points are collinear.
pub(crate) const ON_A_LINE: f64 = 1e-3;

/// The ratio of second to first singular value of the points about their centroid: 0 on a line, 1 on a disc.
pub(crate) fn second_ratio(points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> f64 {
    let scatter = scatter(points);
    let mut values: [f64; 3] = scatter.symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    if values[2] > 0.0 { (values[1].max(0.0) / values[2]).sqrt() } else { 0.0 }
}

/// Rejects too few points, and coordinates and noise that are not finite.
pub(crate) fn finite(data: &Observations<'_>, needed: usize) -> Result<(), Degenerate> {
    let found = data.points.len();
    if found < needed {
        return Err(Degenerate::TooFew { found, needed });
    }
    if !data.points.iter().all(Observation::is_finite) {
        return Err(Degenerate::NotFinite);
    }
    let noise = data.points.iter().position(|point| !point.has_finite_noise());
    noise.map_or(Ok(()), |index| Err(Degenerate::Noise { index }))
}

/// Rejects as [`finite`] does and, with a rig, points behind the camera or too far away.
pub(crate) fn seen(data: &Observations<'_>, needed: usize) -> Result<(), Degenerate> {
    // One pass accepts valid points, which are the rule: a number that is not finite leaves no finite sum.
    let (mut sum, mut front) = (0.0, true);
    for point in &data.points {
        let (seen, known) = (&point.measured.at.coords, &point.model.coords);
        sum += (seen.x + seen.y + seen.z) + (known.x + known.y + known.z);
        sum += point.measured.covariance.trace() + point.model_sigma;
        front &= seen.z > 0.0;
    }
    if data.points.len() < needed || !sum.is_finite() {
        finite(data, needed)?;
    }
    if data.rig.is_some() {
        if !front {
            in_front(data)?;
        }
        near(data)?;
    }
    Ok(())
}

/// Rejects as [`seen`] does, and collinear points, measured or model: second extent below `min` of the first.
pub(crate) fn check(data: &Observations<'_>, needed: usize, min: f64) -> Result<(), Degenerate> {
    seen(data, needed)?;
    let model = data.points.iter().map(|point| point.model.coords);
    let measured = data.points.iter().map(|point| point.measured.at.coords);
    if clearly_wide(model.clone(), min) && clearly_wide(measured.clone(), min) {
        return Ok(());
    }
    let ratio = second_ratio(model).min(second_ratio(measured));
    // A NaN is rejected as well.
    if ratio >= min { Ok(()) } else { Err(Degenerate::Collinear { ratio, min }) }
}

/// Rejects geometry without a pose: fewer than three points, numbers that are not finite, collinear points and, with a
/// rig, points behind the camera or too far away.
pub(crate) fn wide_enough(data: &Observations<'_>) -> Result<(), Degenerate> {
    check(data, 3, 1e-3)
}

/// Largest relative standard deviation of a distance; the parallax of farther points is within three standard
/// deviations of zero.
const FAR: f64 = 1.0 / 3.0;

/// Rejects points too far away to measure even one distance to [`FAR`]: the two views then coincide.
fn near(data: &Observations<'_>) -> Result<(), Degenerate> {
    // The standard deviation along the line of sight over its length; σ_d / d for a rectified rig.
    let square = |point: &Observation| {
        let (at, covariance) = (&point.measured.at.coords, &point.measured.covariance);
        let length = at.norm_squared();
        at.dot(&(covariance * at)) / (length * length)
    };
    let mut best = f64::INFINITY;
    for point in &data.points {
        best = best.min(square(point));
        if best <= FAR * FAR {
            return Ok(());
        }
    }
    Err(Degenerate::Far { fraction: best.sqrt(), max: FAR })
}

/// Rejects points measured behind the left camera; a rig cannot have seen them.
fn in_front(data: &Observations<'_>) -> Result<(), Degenerate> {
    let behind = data.points.iter().position(|point| !(point.measured.at.coords.z > 0.0));
    behind.map_or(Ok(()), |index| Err(Degenerate::Behind { index, depth: data.points[index].measured.at.coords.z }))
}
