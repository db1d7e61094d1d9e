//! Where a fix puts the camera in the world.

use nalgebra::{Matrix3, Matrix4};
use seafix_log::{TargetRecord, TrialHeader};

/// The left camera's place in the world by this fix and the surveyed place of its target (m); NaN where one of the two
/// is missing.
pub(crate) fn estimate(header: &TrialHeader, target: &TargetRecord) -> [f64; 3] {
    let site_from_object =
        header.targets.iter().find(|model| model.id == target.object).and_then(|model| model.site_from_object);
    match (header.world_from_site, site_from_object, target.object_from_camera) {
        (Some(site), Some(object), Some(camera)) => {
            let world_from_camera = matrix(&site) * matrix(&object) * matrix(&camera);
            [world_from_camera[(0, 3)], world_from_camera[(1, 3)], world_from_camera[(2, 3)]]
        }
        _ => [f64::NAN; 3],
    }
}

/// A matrix of its rows.
pub(crate) fn matrix(rows: &[[f64; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|row, column| rows[row][column])
}

/// χ² with three degrees of freedom holds all but 1e-4 below this.
const RARE: f64 = 21.107_513_466;

/// The radius (m) of the ball that holds the true place of the camera with a chance of 99.99 %, by the covariance of the
/// fix: its largest axis in all directions. `None` without a covariance.
pub(crate) fn radius(target: &TargetRecord) -> Option<f64> {
    let covariance = target.covariance?;
    let place = Matrix3::from_fn(|row, column| covariance[row + 3][column + 3]);
    let largest = place.symmetric_eigenvalues().max();
    (largest >= 0.0).then(|| (RARE * largest).sqrt())
}
