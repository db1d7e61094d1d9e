//! The header of a trial.

use super::{
    fields::{Malformed, flat, matrix, matrix_if_any, required},
    line::{edge_message, edge_record},
};
use crate::{
    proto,
    record::{Axis, CameraRecord, Component, ModelPoint, RigRecord, TargetModel, TrialHeader},
};

/// The message that holds `header`.
pub(crate) fn header_message(header: &TrialHeader) -> proto::TrialHeader {
    let TrialHeader {
        run,
        trial,
        title,
        question,
        command,
        axes,
        components,
        configuration,
        site,
        source,
        rig,
        body_from_camera,
        world_from_site,
        targets,
        prior_position_sigma,
        prior_attitude_sigma,
        pixel_sigma,
        seeds,
        versions,
    } = header.clone();
    proto::TrialHeader {
        run,
        trial,
        title,
        question,
        command,
        axes: axes.into_iter().map(|Axis { key, value }| proto::Axis { key, value }).collect(),
        components: components.into_iter().map(component_message).collect(),
        configuration,
        site,
        source,
        rig: Some(proto::Rig {
            left: Some(camera_message(rig.left)),
            right: Some(camera_message(rig.right)),
            right_from_left: flat(&rig.right_from_left),
            right_from_left_rotation: rig.right_from_left_rotation.map(Vec::from).unwrap_or_default(),
            rectified: rig.rectified,
        }),
        body_from_camera: flat(&body_from_camera),
        world_from_site: world_from_site.as_ref().map(flat).unwrap_or_default(),
        targets: targets.into_iter().map(target_message).collect(),
        prior_position_sigma,
        prior_attitude_sigma,
        pixel_sigma,
        seeds: seeds.into_iter().map(|(name, value)| proto::Seed { name, value }).collect(),
        versions: versions.into_iter().map(|(name, value)| proto::Version { name, value }).collect(),
    }
}

fn component_message(component: Component) -> proto::Component {
    let Component { stage, name, summary, source, settings } = component;
    let settings = settings.into_iter().map(|(key, value)| proto::Setting { key, value }).collect();
    proto::Component { stage, name, summary, source, settings }
}

fn camera_message(camera: CameraRecord) -> proto::Camera {
    let [width, height] = camera.size;
    let (matrix, equidistant) = (flat(&camera.matrix), camera.equidistant);
    proto::Camera { width, height, matrix, distortion: camera.distortion, equidistant }
}

pub(super) fn target_message(target: TargetModel) -> proto::Target {
    let point = |ModelPoint { id, at: [x, y, z], sigma }| proto::ModelPoint { id, x, y, z, sigma };
    proto::Target {
        site_from_object: target.site_from_object.as_ref().map(flat).unwrap_or_default(),
        points: target.points.into_iter().map(point).collect(),
        id: target.id,
        alert_limit: target.alert_limit,
        edges: target.edges.into_iter().map(edge_message).collect(),
    }
}

/// The header that `message` holds.
pub(crate) fn header_record(message: proto::TrialHeader) -> Result<TrialHeader, Malformed> {
    let rig = required("rig", message.rig)?;
    Ok(TrialHeader {
        run: message.run,
        trial: message.trial,
        title: message.title,
        question: message.question,
        command: message.command,
        axes: message.axes.into_iter().map(|proto::Axis { key, value }| Axis { key, value }).collect(),
        components: message.components.into_iter().map(component_record).collect(),
        configuration: message.configuration,
        site: message.site,
        source: message.source,
        rig: RigRecord {
            left: camera_record(required("rig.left", rig.left)?)?,
            right: camera_record(required("rig.right", rig.right)?)?,
            right_from_left: matrix("rig.right_from_left", &rig.right_from_left)?,
            right_from_left_rotation: matrix_if_any::<1, 4>("rig.rotation", &rig.right_from_left_rotation)?
                .map(|[q]| q),
            rectified: rig.rectified,
        },
        body_from_camera: matrix("body_from_camera", &message.body_from_camera)?,
        world_from_site: matrix_if_any("world_from_site", &message.world_from_site)?,
        targets: message.targets.into_iter().map(target_record).collect::<Result<_, _>>()?,
        prior_position_sigma: message.prior_position_sigma,
        prior_attitude_sigma: message.prior_attitude_sigma,
        pixel_sigma: message.pixel_sigma,
        seeds: message.seeds.into_iter().map(|seed| (seed.name, seed.value)).collect(),
        versions: message.versions.into_iter().map(|version| (version.name, version.value)).collect(),
    })
}

fn component_record(message: proto::Component) -> Component {
    let proto::Component { stage, name, summary, source, settings } = message;
    let settings = settings.into_iter().map(|setting| (setting.key, setting.value)).collect();
    Component { stage, name, summary, source, settings }
}

fn camera_record(message: proto::Camera) -> Result<CameraRecord, Malformed> {
    Ok(CameraRecord {
        size: [message.width, message.height],
        matrix: matrix("camera.matrix", &message.matrix)?,
        distortion: message.distortion,
        equidistant: message.equidistant,
    })
}

pub(super) fn target_record(message: proto::Target) -> Result<TargetModel, Malformed> {
    let point = |proto::ModelPoint { id, x, y, z, sigma }| ModelPoint { id, at: [x, y, z], sigma };
    Ok(TargetModel {
        site_from_object: matrix_if_any("target.site_from_object", &message.site_from_object)?,
        points: message.points.into_iter().map(point).collect(),
        id: message.id,
        alert_limit: message.alert_limit,
        edges: message.edges.into_iter().map(edge_record).collect::<Result<_, _>>()?,
    })
}
