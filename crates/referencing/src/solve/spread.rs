//! How far points spread: what tells a line from a plane.

use nalgebra::{Matrix3, Vector3};

use super::Degenerate;
use crate::{Observation, Observations};

/// The centroid of points.
pub(crate) fn centroid(points: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let count = points.len().max(1) as f64;
    points.sum::<Vector3<f64>>() / count
}

/// Second singular value over the first of the points about their centroid: 0 on a line, 1 on a disc.
pub(crate) fn second_ratio(points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> f64 {
    let centre = centroid(points.clone());
    let scatter: Matrix3<f64> = points.map(|p| (p - centre) * (p - centre).transpose()).sum();
    let mut values: [f64; 3] = scatter.symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    if values[2] > 0.0 { (values[1].max(0.0) / values[2]).sqrt() } else { 0.0 }
}

/// Refuses too few points, numbers that are not finite, and points (measured or model) on a line:
/// second extent below `least` of the first.
pub(super) fn check(data: &Observations<'_>, needed: usize, least: f64) -> Result<(), Degenerate> {
    let found = data.points.len();
    if found < needed {
        return Err(Degenerate::TooFew { found, needed });
    }
    if !data.points.iter().all(Observation::is_finite) {
        return Err(Degenerate::NotFinite);
    }
    let model = second_ratio(data.points.iter().map(|point| point.model.coords));
    let measured = second_ratio(data.points.iter().map(|point| point.measured.at.coords));
    let ratio = model.min(measured);
    // Written so that a NaN is refused too.
    if ratio >= least { Ok(()) } else { Err(Degenerate::Collinear { ratio, least }) }
}
