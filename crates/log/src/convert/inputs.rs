//! What a method was given.

use super::{
    fields::{Malformed, flat, matrix, required},
    header::{target_message, target_record},
    line::{edge_pair_messages, edge_pair_records},
};
use crate::{
    proto,
    record::{
        AnswerRecord, ExactPose, FrameRecord, Inputs, ProblemEdge, ProblemRecord, SensorReading, SitePoint, TrueState,
    },
};

/// The message that holds the inputs of `frame`.
pub(crate) fn inputs_message(frame: &FrameRecord, inputs: &Inputs) -> proto::Inputs {
    let Inputs { prior, pixel_covariances, names, problem, truth, exact_images, readings } = inputs;
    proto::Inputs {
        frame: frame.frame,
        stamp_ns: frame.stamp_ns,
        prior: prior.as_ref().map(|(pose, covariance)| proto::PriorPose {
            world_from_camera: Some(pose_message(pose)),
            covariance: flat(covariance),
        }),
        pixel_covariances: pixel_covariances.iter().flat_map(flat).collect(),
        named: names.is_some(),
        names: points_message(names.as_deref()),
        problem: problem.as_ref().map(problem_message),
        truth: truth.as_ref().map(truth_message),
        exact_images: *exact_images,
        readings: readings.iter().map(reading_message).collect(),
    }
}

/// The inputs that `message` holds.
pub(crate) fn inputs_record(message: proto::Inputs) -> Result<Inputs, Malformed> {
    let prior = |prior: proto::PriorPose| {
        let pose = pose_record(required("prior.world_from_camera", prior.world_from_camera)?)?;
        Ok((pose, matrix("prior.covariance", &prior.covariance)?))
    };
    Ok(Inputs {
        prior: message.prior.map(prior).transpose()?,
        pixel_covariances: message
            .pixel_covariances
            .chunks(16)
            .map(|numbers| matrix("pixel_covariances", numbers))
            .collect::<Result<_, _>>()?,
        names: message.named.then(|| points_record(&message.names)),
        problem: message.problem.map(problem_record).transpose()?,
        truth: message.truth.map(truth_record).transpose()?,
        exact_images: message.exact_images,
        readings: message.readings.into_iter().map(reading_record).collect::<Result<_, _>>()?,
    })
}

fn reading_message(reading: &SensorReading) -> proto::SensorReading {
    proto::SensorReading {
        device: reading.device.clone(),
        stamp_ns: reading.stamp_ns,
        value: reading.value.to_vec(),
        covariance: flat(&reading.covariance),
    }
}

fn reading_record(message: proto::SensorReading) -> Result<SensorReading, Malformed> {
    let [value] = matrix("readings.value", &message.value)?;
    let covariance = matrix("readings.covariance", &message.covariance)?;
    Ok(SensorReading { device: message.device, stamp_ns: message.stamp_ns, value, covariance })
}

fn pose_message(pose: &ExactPose) -> proto::ExactPose {
    proto::ExactPose { numbers: pose.rotation.into_iter().chain(pose.translation).collect() }
}

fn pose_record(message: proto::ExactPose) -> Result<ExactPose, Malformed> {
    match message.numbers[..] {
        [x, y, z, w, tx, ty, tz] => Ok(ExactPose { rotation: [x, y, z, w], translation: [tx, ty, tz] }),
        _ => Err(Malformed(format!("an exact pose has {} numbers instead of 7", message.numbers.len()))),
    }
}

fn points_message(points: Option<&[SitePoint]>) -> Vec<proto::SitePoint> {
    points.unwrap_or_default().iter().map(|&SitePoint { object, point }| proto::SitePoint { object, point }).collect()
}

fn points_record(points: &[proto::SitePoint]) -> Vec<SitePoint> {
    points.iter().map(|&proto::SitePoint { object, point }| SitePoint { object, point }).collect()
}

fn matches_message(pairs: &[[u32; 2]]) -> Vec<proto::Match> {
    pairs.iter().map(|&[model, cloud]| proto::Match { model, cloud }).collect()
}

fn matches_record(pairs: &[proto::Match]) -> Vec<[u32; 2]> {
    pairs.iter().map(|&proto::Match { model, cloud }| [model, cloud]).collect()
}

fn problem_message(problem: &ProblemRecord) -> proto::Problem {
    proto::Problem {
        model: Some(target_message(problem.model.clone())),
        delta: problem.delta,
        object_from_camera: problem.prior.as_ref().map(|(pose, _)| pose_message(pose)),
        gate_half: problem.prior.map_or(0.0, |(_, half)| half),
        is_putative: problem.putative.is_some(),
        putative: matches_message(problem.putative.as_deref().unwrap_or_default()),
        edges: problem.edges.iter().map(edge_message).collect(),
        is_putative_edges: problem.putative_edges.is_some(),
        putative_edges: edge_pair_messages(problem.putative_edges.as_deref().unwrap_or_default()),
    }
}

fn problem_record(message: proto::Problem) -> Result<ProblemRecord, Malformed> {
    let half = message.gate_half;
    Ok(ProblemRecord {
        model: target_record(required("problem.model", message.model)?)?,
        delta: message.delta,
        prior: message.object_from_camera.map(|pose| Ok((pose_record(pose)?, half))).transpose()?,
        putative: message.is_putative.then(|| matches_record(&message.putative)),
        edges: message.edges.iter().map(edge_record).collect::<Result<_, _>>()?,
        putative_edges: message.is_putative_edges.then(|| edge_pair_records(&message.putative_edges)),
    })
}

fn edge_message(edge: &ProblemEdge) -> proto::ProblemEdge {
    let [from_point, to_point] = edge.points;
    proto::ProblemEdge { ends: edge.ends.as_flattened().to_vec(), from_point, to_point }
}

fn edge_record(message: &proto::ProblemEdge) -> Result<ProblemEdge, Malformed> {
    let points = [message.from_point, message.to_point];
    Ok(ProblemEdge { ends: matrix("problem.edges.ends", &message.ends)?, points })
}

fn truth_message(truth: &TrueState) -> proto::TrueState {
    let moved = |(object, pose): &(u32, Option<ExactPose>)| proto::TruePlace {
        object: *object,
        world_from_object: pose.as_ref().map(pose_message),
    };
    proto::TrueState {
        world_from_camera: Some(pose_message(&truth.world_from_camera)),
        moved: truth.moved.iter().map(moved).collect(),
        is_visibility_known: truth.visible.is_some(),
        visible: points_message(truth.visible.as_deref()),
        bound: truth
            .bound
            .as_ref()
            .map(|(object, covariance)| proto::Bound { object: *object, covariance: flat(covariance) }),
        answer: truth.answer.as_ref().map(|answer| proto::TrueAnswer {
            pairs: matches_message(&answer.pairs),
            ideal_rms: answer.ideal_rms,
            is_putative: answer.is_putative,
        }),
    }
}

fn truth_record(message: proto::TrueState) -> Result<TrueState, Malformed> {
    let moved = |place: proto::TruePlace| Ok((place.object, place.world_from_object.map(pose_record).transpose()?));
    let bound = |bound: proto::Bound| Ok((bound.object, matrix("bound.covariance", &bound.covariance)?));
    Ok(TrueState {
        world_from_camera: pose_record(required("truth.world_from_camera", message.world_from_camera)?)?,
        moved: message.moved.into_iter().map(moved).collect::<Result<_, _>>()?,
        visible: message.is_visibility_known.then(|| points_record(&message.visible)),
        bound: message.bound.map(bound).transpose()?,
        answer: message.answer.map(|answer| AnswerRecord {
            pairs: matches_record(&answer.pairs),
            ideal_rms: answer.ideal_rms,
            is_putative: answer.is_putative,
        }),
    })
}
