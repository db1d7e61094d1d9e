//! The error of a fix at lever arms from the centroid of its points.

use nalgebra::{Matrix4, Vector3};
use seafix_log::{TargetRecord, TrialHeader, TruthRecord};

use crate::place::matrix;

/// The lengths of the lever arms (m).
pub(crate) const ARMS: [f64; 3] = [1.0, 2.0, 5.0];

/// The error motion E of a fix in the object's frame, and the centroid of its points.
///
/// The centroid is that of the points that the fix used. E maps true to estimated positions. `None` if the log lacks
/// the pose, the ground truth or the points.
pub(crate) fn misplaced(
    header: &TrialHeader,
    truth: Option<&TruthRecord>,
    target: &TargetRecord,
) -> Option<(Matrix4<f64>, Vector3<f64>)> {
    let estimate = matrix(target.object_from_camera.as_ref()?);
    let truth = truth?;
    let (_, world_from_object) = truth.world_from_object.iter().find(|(id, _)| *id == target.object)?;
    let camera_from_object = matrix(&truth.world_from_camera).try_inverse()? * matrix(world_from_object);
    let points = &header.targets.iter().find(|model| model.id == target.object)?.points;
    let used =
        target.used.iter().map(|&place| Some(points.get(target.pairs.get(place as usize)?.model as usize)?.at.into()));
    let used: Vec<Vector3<f64>> = used.collect::<Option<_>>()?;
    let centroid = used.iter().sum::<Vector3<f64>>() / used.len() as f64;
    (!used.is_empty()).then_some((estimate * camera_from_object, centroid))
}

/// The error of a fix at the centroid of its points (m); NaN where unknown.
pub(crate) fn displacement(header: &TrialHeader, truth: Option<&TruthRecord>, target: &TargetRecord) -> f64 {
    misplaced(header, truth, target)
        .map_or(f64::NAN, |(e, centroid)| (e.transform_point(&centroid.into()).coords - centroid).norm())
}
