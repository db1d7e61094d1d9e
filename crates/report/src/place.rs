//! Camera positions in the world from fixes and the survey.

use nalgebra::Matrix4;
use seafix_log::{NavigatedRecord, TargetRecord, TrialHeader};

/// The position of the left camera in the world (m) by a fix and the survey.
///
/// It is NaN without either.
pub(crate) fn estimate(header: &TrialHeader, target: &TargetRecord) -> [f64; 3] {
    let camera = target.object_from_camera.as_ref();
    camera.map_or([f64::NAN; 3], |camera| in_world(header, &target.object, camera))
}

/// The position of the left camera in the world (m) by a navigated pose and the survey.
///
/// It is NaN without either.
pub(crate) fn carried(header: &TrialHeader, pose: Option<&NavigatedRecord>) -> [f64; 3] {
    pose.map_or([f64::NAN; 3], |pose| in_world(header, &pose.object, &pose.object_from_camera))
}

/// The position in the world (m) of a camera, from its pose relative to a surveyed object.
///
/// It is NaN without a survey.
fn in_world(header: &TrialHeader, object: &str, object_from_camera: &[[f64; 4]; 4]) -> [f64; 3] {
    let site_from_object =
        header.targets.iter().find(|model| model.id == object).and_then(|model| model.site_from_object);
    match (header.world_from_site, site_from_object) {
        (Some(site), Some(object)) => {
            let world_from_camera = matrix(&site) * matrix(&object) * matrix(object_from_camera);
            [world_from_camera[(0, 3)], world_from_camera[(1, 3)], world_from_camera[(2, 3)]]
        }
        _ => [f64::NAN; 3],
    }
}

/// The matrix with these rows.
pub(crate) fn matrix(rows: &[[f64; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|row, column| rows[row][column])
}

/// Sets the alert limit of a fix from its target, for older logs.
pub(crate) fn limit(header: &TrialHeader, target: &mut TargetRecord) {
    if target.evaluation.alert_limit.is_none() && target.evaluation.position_error.is_some() {
        let model = header.targets.iter().find(|model| model.id == target.object);
        target.evaluation.alert_limit = model.map(|model| model.alert_limit);
    }
}
