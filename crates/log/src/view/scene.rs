//! The model as a scene: a ball and a name a feature point, a line a straight edge.

use crate::{
    proto::{
        Duration,
        foxglove::{
            KeyValuePair, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive,
            TextPrimitive, Vector3, line_primitive::Type,
        },
    },
    record::{TargetModel, TrialHeader},
};

use super::{
    names::object_frame,
    values::{colour, colour_message, timestamp},
};

/// Diameter of the ball that marks a point (m).
const DIAMETER: f64 = 0.03;

/// The width of an edge on the screen (px).
const EDGE_PX: f64 = 3.0;

/// One entity a target, fixed to the target's frame, for as long as the log runs.
pub(crate) fn model_scene(header: &TrialHeader, stamp_ns: u64) -> SceneUpdate {
    let entities = header.targets.iter().enumerate().map(|(index, target)| entity(target, colour(index), stamp_ns));
    SceneUpdate { deletions: Vec::new(), entities: entities.collect() }
}

fn entity(target: &TargetModel, colour: [u8; 3], stamp_ns: u64) -> SceneEntity {
    let at = |[x, y, z]: [f64; 3], up: f64| Pose {
        position: Some(Vector3 { x, y, z: z + up }),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    };
    let size = Vector3 { x: DIAMETER, y: DIAMETER, z: DIAMETER };
    SceneEntity {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: object_frame(&target.id),
        id: target.id.clone(),
        lifetime: Some(Duration::default()),
        frame_locked: true,
        metadata: vec![
            KeyValuePair { key: "points".to_owned(), value: target.points.len().to_string() },
            KeyValuePair { key: "alert_limit_m".to_owned(), value: target.alert_limit.to_string() },
        ],
        spheres: target
            .points
            .iter()
            .map(|point| SpherePrimitive {
                pose: Some(at(point.at, 0.0)),
                size: Some(size),
                color: Some(colour_message(colour)),
            })
            .collect(),
        texts: target
            .points
            .iter()
            .map(|point| TextPrimitive {
                pose: Some(at(point.at, DIAMETER)),
                billboard: true,
                font_size: 12.0,
                scale_invariant: true,
                color: Some(colour_message([255; 3])),
                text: point.id.clone(),
            })
            .collect(),
        lines: edges(target, colour).into_iter().collect(),
        ..SceneEntity::default()
    }
}

/// The straight edges of a target, if it has any.
fn edges(target: &TargetModel, colour: [u8; 3]) -> Option<LinePrimitive> {
    let ends = target.edges.iter().flat_map(|edge| edge.ends);
    (!target.edges.is_empty()).then(|| LinePrimitive {
        r#type: Type::LineList.into(),
        pose: Some(Pose {
            position: Some(Vector3 { x: 0.0, y: 0.0, z: 0.0 }),
            orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        }),
        thickness: EDGE_PX,
        scale_invariant: true,
        points: ends.map(|[x, y, z]| Point3 { x, y, z }).collect(),
        color: Some(colour_message(colour)),
        ..LinePrimitive::default()
    })
}
