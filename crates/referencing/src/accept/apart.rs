//! The distance between two poses of a model.

use seafix_geometry::{Camera, Object, Transform};

use crate::site::model::ModelPoint;

/// The RMS distance (m) between the model points as two poses place them.
pub fn rms_apart(model: &[ModelPoint], a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> f64 {
    let (a, b) = (a.inverse(), b.inverse());
    let sum: f64 = model.iter().map(|point| (a * point.at - b * point.at).norm_squared()).sum();
    (sum / model.len().max(1) as f64).sqrt()
}
