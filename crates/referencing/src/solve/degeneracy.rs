//! Tests for degenerate configurations of points.

use nalgebra::{Matrix3, Vector3};
use seafix_component::in_range;

use crate::{
    observations::{Observation, Observations},
    solve::Degenerate,
};

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
