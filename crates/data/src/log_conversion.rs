//! Lossless conversion between the inputs of a method and their log records.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix4, Matrix6, Quaternion, UnitQuaternion};
use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_evaluation::{Solved, alert_limit};
use seafix_geometry::{
    Covariance6, Frame, MeasuredLine, MeasuredPoint, NormalOffset, Object, Pixel, Point, StereoPixels, StereoSegments,
    Transform, UncertainPixels, UncertainPoint, World,
};
use seafix_log::{
    AnswerRecord, CloudPoint, EdgePair, ExactPose, Inputs, Line, Offset, ProblemEdge, ProblemRecord, SensorReading,
    SitePoint, TargetModel, TrueState,
};
use seafix_navigation::{Device, Reading};
use seafix_referencing::{
    End, ModelEdge, ModelPoint, Prior, PriorBound, Site, Target,
    problem_file::{CoherenceProblem, ProblemEdges},
};
use seafix_vision::Image;

use crate::sequence::{TrueAnswer, Truth};

/// The log's record of a rigid motion.
pub fn pose<A: Frame, B: Frame>(pose: &Transform<A, B>) -> ExactPose {
    let (q, t) = (pose.rotation(), pose.translation());
    ExactPose { rotation: [q.i, q.j, q.k, q.w], translation: t.into() }
}

/// The rigid motion in a log's record.
pub fn transform<A: Frame, B: Frame>(pose: &ExactPose) -> Transform<A, B> {
    let [x, y, z, w] = pose.rotation;
    Transform::new(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)), pose.translation.into())
}

fn covariance6<A: Frame, B: Frame>(rows: &[[f64; 6]; 6]) -> Covariance6<A, B> {
    Covariance6::new(Matrix6::from_fn(|r, c| rows[r][c]))
}

fn site_points(points: &[(usize, usize)]) -> Vec<SitePoint> {
    points.iter().map(|&(object, point)| SitePoint { object: object as u32, point: point as u32 }).collect()
}

fn indices(points: &[SitePoint]) -> Vec<(usize, usize)> {
    points.iter().map(|point| (point.object as usize, point.point as usize)).collect()
}

fn index_pairs(pairs: &[[u32; 2]]) -> Vec<(usize, usize)> {
    pairs.iter().map(|&[model, cloud]| (model as usize, cloud as usize)).collect()
}

fn matches(pairs: &[(usize, usize)]) -> Vec<[u32; 2]> {
    pairs.iter().map(|&(model, cloud)| [model as u32, cloud as u32]).collect()
}

/// Whether 8 bits represent the images exactly.
pub fn is_exact(frame_data: &FrameData) -> bool {
    let full = |image: &Image| image.pixels().iter().all(|&level| level.fract() == 0.0);
    match frame_data {
        FrameData::Stereo(left, right) => full(left) && full(right),
        FrameData::Points(_) | FrameData::Features(..) => false,
    }
}

/// The log's record of a sensor frame and its cloud, without results.
pub fn inputs(sensor_frame: &SensorFrame, cloud: &[MeasuredPoint], targets: &[Target]) -> Inputs {
    Inputs {
        prior: sensor_frame.prior.map(|prior| (pose(&prior.world_from_camera), rows6(&prior.covariance.matrix))),
        pixel_covariances: cloud
            .iter()
            .filter_map(|point| point.pixels)
            .map(|pixels| std::array::from_fn(|r| std::array::from_fn(|c| pixels.covariance[(r, c)])))
            .collect(),
        names: match &sensor_frame.hints {
            Hints::Labels(names) => Some(site_points(names)),
            _ => None,
        },
        problem: match &sensor_frame.hints {
            Hints::Problem(problem) => targets.first().map(|object| problem_record(object, problem)),
            _ => None,
        },
        truth: None,
        exact_images: false,
        readings: sensor_frame.readings.iter().map(reading).collect(),
    }
}

fn reading(reading: &Reading) -> SensorReading {
    SensorReading {
        device: reading.device.name().to_owned(),
        stamp_ns: reading.stamp_ns,
        value: reading.value.into(),
        covariance: rows3(&reading.covariance),
    }
}

/// The sensor readings in a log's record.
///
/// # Errors
/// The name of an unknown device.
pub fn readings(inputs: &Inputs) -> Result<Vec<Reading>, String> {
    let reading = |message: &SensorReading| {
        let device = Device::named(&message.device)
            .ok_or_else(|| format!("a reading of an unknown device, `{}`", message.device))?;
        let covariance = Matrix3::from_fn(|r, c| message.covariance[r][c]);
        Ok(Reading { device, stamp_ns: message.stamp_ns, value: message.value.into(), covariance })
    };
    inputs.readings.iter().map(reading).collect()
}

fn problem_record(object: &Target, problem: &CoherenceProblem) -> ProblemRecord {
    ProblemRecord {
        model: model(object),
        delta: problem.delta,
        prior: problem.prior.as_ref().and_then(|prior| match prior.bound {
            PriorBound::Box(half) => Some((pose(&prior.object_from_camera), half)),
            PriorBound::Gaussian(_) => None,
        }),
        putative: problem.putative.as_deref().map(matches),
        edges: problem.edges.model.iter().map(|edge| edge_of_problem(edge, &problem.model)).collect(),
        putative_edges: problem.edges.putative.as_deref().map(|pairs| {
            pairs.iter().map(|&(model, line)| EdgePair { model: model as u32, line: line as u32 }).collect()
        }),
    }
}

fn edge_of_problem(edge: &ModelEdge, model: &[ModelPoint]) -> ProblemEdge {
    ProblemEdge {
        ends: edge.places(model).map(|end| end.coords.into()),
        points: edge.ends.map(|end| match end {
            End::Point(index) => Some(index as u32),
            End::At(_) => None,
        }),
    }
}

/// The edges of a problem in a log's record; the lines are those of the frame.
fn edges_of_problem(problem: &ProblemRecord, lines: &[MeasuredLine]) -> ProblemEdges {
    let edge = |(index, edge): (usize, &ProblemEdge)| ModelEdge {
        id: index.to_string(),
        ends: std::array::from_fn(|end| match edge.points[end] {
            Some(point) => End::Point(point as usize),
            None => End::At(Point::from(edge.ends[end])),
        }),
        sigma: 0.0,
        faces: Vec::new(),
    };
    let pairs = |pairs: &Vec<EdgePair>| pairs.iter().map(|pair| (pair.model as usize, pair.line as usize)).collect();
    ProblemEdges {
        model: problem.edges.iter().enumerate().map(edge).collect(),
        lines: lines.to_vec(),
        putative: problem.putative_edges.as_ref().map(pairs),
    }
}

/// The log's record of the truth.
pub fn truth(truth: &Truth, site: &Site) -> TrueState {
    let places = (0..).zip(truth.world_from_object.iter().zip(&site.objects));
    let moved = places.filter(|(_, (place, object))| **place != object.world_from_object);
    TrueState {
        world_from_camera: pose(&truth.world_from_camera),
        moved: moved.map(|(index, (place, _))| (index, place.as_ref().map(pose))).collect(),
        visible: truth.visible.as_deref().map(site_points),
        bound: truth.bound.map(|(object, bound)| (object as u32, rows6(&bound.matrix))),
        answer: truth.answer.as_ref().map(|answer| AnswerRecord {
            pairs: matches(&answer.pairs),
            ideal_rms: answer.rule.ideal_rms,
            is_putative: answer.rule.putative,
        }),
    }
}

/// The cloud in a log's record; `None` if the covariance of a pixel pair is missing.
pub fn cloud(points: &[CloudPoint], inputs: &Inputs) -> Option<Vec<MeasuredPoint>> {
    let mut covariances = inputs.pixel_covariances.iter();
    points
        .iter()
        .map(|point| {
            let covariance = Matrix3::from_fn(|r, c| point.covariance[r][c]);
            let pixels = match point.pixels {
                None => None,
                Some(pixels) => {
                    let rows = covariances.next()?;
                    let [left, right] = [pixels.left, pixels.right].map(|[u, v]| Pixel { u, v });
                    let covariance = Matrix4::from_fn(|r, c| rows[r][c]);
                    Some(UncertainPixels { at: StereoPixels { left, right }, covariance })
                }
            };
            Some(MeasuredPoint { position: UncertainPoint { at: Point::from(point.at), covariance }, pixels })
        })
        .collect()
}

/// The log's record of a measured line.
pub fn line_record(line: &MeasuredLine) -> Line {
    let offset = |offset: &NormalOffset| Offset {
        at: [offset.at.u, offset.at.v],
        normal: offset.normal.into(),
        sigma: offset.sigma,
        texture: offset.texture,
        common: offset.common,
    };
    Line {
        ends: line.ends.map(|end| end.coords.into()),
        covariance: std::array::from_fn(|r| std::array::from_fn(|c| line.offsets[(r, c)])),
        depth: line.depth,
        segments: line
            .segments
            .as_ref()
            .map(|both| [both.left, both.right].map(|segment| segment.each_ref().map(offset))),
    }
}

/// The measured line in a log's record.
pub fn line(record: &Line) -> MeasuredLine {
    let offset = |offset: &Offset| NormalOffset {
        at: Pixel { u: offset.at[0], v: offset.at[1] },
        normal: offset.normal.into(),
        sigma: offset.sigma,
        texture: offset.texture,
        common: offset.common,
    };
    MeasuredLine {
        ends: record.ends.map(Point::from),
        offsets: Matrix4::from_fn(|r, c| record.covariance[r][c]),
        segments: record.segments.as_ref().map(|both| {
            let [left, right] = both.each_ref().map(|segment| segment.each_ref().map(offset));
            StereoSegments { left, right }
        }),
        depth: record.depth,
    }
}

/// The hints in a log's record.
pub fn hints(inputs: &Inputs, cloud: &[MeasuredPoint], lines: &[MeasuredLine]) -> Hints {
    if let Some(names) = &inputs.names {
        return Hints::Labels(indices(names));
    }
    let Some(problem) = &inputs.problem else { return Hints::Nothing };
    let point = |point: &seafix_log::ModelPoint| ModelPoint {
        sigma: point.sigma,
        ..ModelPoint::exact(&*point.id, Point::from(point.at))
    };
    let prior =
        |(pose, half): &(ExactPose, f64)| Prior { object_from_camera: transform(pose), bound: PriorBound::Box(*half) };
    Hints::Problem(Arc::new(CoherenceProblem {
        id: problem.model.id.clone(),
        model: problem.model.points.iter().map(point).collect(),
        cloud: cloud.to_vec(),
        delta: problem.delta,
        prior: problem.prior.as_ref().map(prior),
        putative: problem.putative.as_deref().map(index_pairs),
        edges: edges_of_problem(problem, lines),
    }))
}

/// The prior pose.
pub fn prior(inputs: &Inputs) -> Option<PosePrior> {
    let (pose, covariance) = inputs.prior.as_ref()?;
    Some(PosePrior { world_from_camera: transform(pose), covariance: covariance6(covariance) })
}

/// The truth in a log's record, for objects that were `surveyed`.
pub fn truth_of(state: &TrueState, surveyed: Vec<Option<Transform<World, Object>>>) -> Truth {
    let mut world_from_object = surveyed;
    for (index, place) in &state.moved {
        if let Some(known) = world_from_object.get_mut(*index as usize) {
            *known = place.as_ref().map(transform);
        }
    }
    Truth {
        world_from_camera: transform(&state.world_from_camera),
        world_from_object,
        visible: state.visible.as_deref().map(indices),
        bound: state.bound.as_ref().map(|(object, bound)| (*object as usize, covariance6(bound))),
        answer: state.answer.as_ref().map(|answer| TrueAnswer {
            pairs: index_pairs(&answer.pairs),
            rule: Solved { ideal_rms: answer.ideal_rms, putative: answer.is_putative },
        }),
    }
}

/// The targets, wherever they are.
pub fn model(target: &Target) -> TargetModel {
    let point = |point: &ModelPoint| seafix_log::ModelPoint {
        id: point.id.clone(),
        at: point.at.coords.into(),
        sigma: point.sigma,
    };
    let edge = |edge: &ModelEdge| seafix_log::ModelEdge {
        id: edge.id.clone(),
        ends: edge.places(&target.points).map(|end| end.coords.into()),
    };
    TargetModel {
        id: target.name.clone(),
        site_from_object: None,
        points: target.points.iter().map(point).collect(),
        alert_limit: alert_limit(target.diameter()),
        edges: target.edges.iter().map(edge).collect(),
    }
}

/// The rows of a matrix.
pub fn rows3(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

/// The rows of a matrix.
pub fn rows6(m: &Matrix6<f64>) -> [[f64; 6]; 6] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
