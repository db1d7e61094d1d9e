//! The file format `seafix-pose-graph/2`: a pose graph as text.
//!
//! UTF-8 text with one JSON object per line. The first line (`head`) names the format and the settings that made the
//! key frames; the last (`end`) states the number of lines between them, so that a truncated file is recognised.
//! Between them stand the lines `object`, `node`, `edge`, `fix`, `prior` and `loop`, each kind in its order. References
//! are indices from 0. Matrices are lists of rows; the numbers of a key frame are base64 of little-endian values.

use std::path::Path;

use base64::{Engine, engine::general_purpose::STANDARD};
use nalgebra::{Matrix3, Matrix6, SVector, Vector4};
use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Frame, Object, Pixel, Point, Transform, UncertainPoint, World};
use seafix_vision::{Descriptors, Keypoint, Table};
use serde::{Deserialize, Serialize};

use super::{
    FixEdge, OdometryEdge, PoseGraph, PoseNode, PriorPose, drift::Drift, keyframe::KeyFrame, recognition::Recognition,
};
use crate::{
    chain::ObjectPose,
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedError, CorrelatedSensitivities},
    navigated::{Navigated, ObjectPlacement},
    odometry_trajectory::RelativeMotion,
};

const FORMAT: &str = "seafix-pose-graph/2";

type Rows4 = [[f64; 4]; 4];
type Rows6 = [[f64; 6]; 6];

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum Line {
    Head(Box<Head>),
    Object(RawObject),
    Node(RawPoseNode),
    Edge(RawOdometryEdge),
    Fix(RawFix),
    Prior(RawPriorPose),
    Loop(RawOdometryEdge),
    End(usize),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    format: String,
    recognition: Recognition,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawObject {
    name: String,
    world_from_object: Rows4,
    covariance: Rows6,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPoseNode {
    stamp_ns: u64,
    world_from_camera: Rows4,
    sigma: f64,
    keyframe: Option<RawKeyFrame>,
}

/// The arrays of a key frame in base64.
///
/// For each point: x, y, z (m) and the components xx, xy, xz, yy, yz, zz of its covariance (m²) as 64-bit floats; u and
/// v as 64-bit floats, response and scale as 32-bit floats; the descriptor as 32-bit floats or 64-bit words.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKeyFrame {
    count: usize,
    kind: Kind,
    points: String,
    keypoints: String,
    descriptors: String,
}

#[derive(Serialize, Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Numbers,
    Bits,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOdometryEdge {
    from: usize,
    to: usize,
    motion: Rows4,
    covariance: Rows6,
    /// Absent if the error is independent of all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    correlated: Option<RawCorrelatedError>,
}

/// The fields of `CorrelatedError`, under the same names.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCorrelatedError {
    by: [[f64; CORRELATED]; 6],
    keep: [f64; CORRELATED],
    with: [[f64; CORRELATED]; 6],
    before: RawCorrelatedCovariance,
    after: RawCorrelatedCovariance,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCorrelatedCovariance {
    independent: [f64; 4],
    held: Rows6,
}

impl RawCorrelatedError {
    fn of(correlated: &CorrelatedError) -> Self {
        let rows = |sensitivities: &CorrelatedSensitivities| {
            std::array::from_fn(|row| std::array::from_fn(|k| sensitivities[(row, k)]))
        };
        let spread = |spread: &CorrelatedCovariance| RawCorrelatedCovariance {
            independent: spread.independent.into(),
            held: rows6(&spread.held),
        };
        Self {
            by: rows(&correlated.by),
            keep: correlated.keep.into(),
            with: rows(&correlated.with),
            before: spread(&correlated.before),
            after: spread(&correlated.after),
        }
    }

    fn cooked(&self) -> Result<CorrelatedError, Wrong> {
        let sensitivities = |rows: &[[f64; CORRELATED]; 6]| CorrelatedSensitivities::from_fn(|row, k| rows[row][k]);
        let spread = |raw: &RawCorrelatedCovariance| {
            let independent = Vector4::from(raw.independent);
            let wrong = || ("invalid variances", format!("{:?}", raw.independent), "give numbers of at least 0");
            match independent.iter().all(|x| x.is_finite() && *x >= 0.0) {
                true => Ok(CorrelatedCovariance { independent, held: finite(&raw.held)? }),
                false => Err(wrong()),
            }
        };
        let (by, keep, with) = (sensitivities(&self.by), SVector::from(self.keep), sensitivities(&self.with));
        Ok(CorrelatedError { by, keep, with, before: spread(&self.before)?, after: spread(&self.after)? })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFix {
    pose_node: usize,
    object: usize,
    object_from_camera: Rows4,
    covariance: Rows6,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPriorPose {
    pose_node: usize,
    world_from_camera: Rows4,
    covariance: Rows6,
}

impl PoseGraph {
    /// The text of a pose-graph file; `recognition` holds the settings that made the key frames.
    pub fn text(&self, recognition: &Recognition) -> String {
        let head = Head { format: FORMAT.to_owned(), recognition: recognition.clone() };
        let mut lines = vec![Line::Head(Box::new(head))];
        lines.extend(self.objects.iter().map(|(name, place)| {
            Line::Object(RawObject {
                name: name.clone(),
                world_from_object: place.world_from_object.rows(),
                covariance: rows6(&place.covariance.matrix),
            })
        }));
        lines.extend(self.pose_nodes.iter().map(|pose_node| {
            Line::Node(RawPoseNode {
                stamp_ns: pose_node.stamp_ns,
                world_from_camera: pose_node.world_from_camera.rows(),
                sigma: pose_node.sigma,
                keyframe: pose_node.keyframe.as_ref().map(raw),
            })
        }));
        let odometry_edge = |odometry_edge: &OdometryEdge| RawOdometryEdge {
            from: odometry_edge.from,
            to: odometry_edge.to,
            motion: odometry_edge.motion.motion.rows(),
            covariance: rows6(&odometry_edge.motion.covariance.matrix),
            correlated: odometry_edge.motion.correlated.as_ref().map(RawCorrelatedError::of),
        };
        lines.extend(self.odometry_edges.iter().map(|one| Line::Edge(odometry_edge(one))));
        lines.extend(self.fixes.iter().map(|fix| {
            Line::Fix(RawFix {
                pose_node: fix.pose_node,
                object: fix.navigated.object,
                object_from_camera: fix.navigated.object_pose.object_from_camera.rows(),
                covariance: rows6(&fix.navigated.object_pose.covariance.matrix),
            })
        }));
        lines.extend(self.prior_poses.iter().map(|prior_pose| {
            Line::Prior(RawPriorPose {
                pose_node: prior_pose.pose_node,
                world_from_camera: prior_pose.world_from_camera.rows(),
                covariance: rows6(&prior_pose.covariance.matrix),
            })
        }));
        lines.extend(self.loops.iter().map(|one| Line::Loop(odometry_edge(one))));
        lines.push(Line::End(lines.len() - 1));
        let mut text = String::new();
        for line in &lines {
            text += &serde_json::to_string(line).expect("plain numbers and names");
            text.push('\n');
        }
        text
    }

    /// The pose graph in the text of a file.
    ///
    /// # Errors
    /// The first [`Fault`]: an invalid line, a reference to a missing line, a missing end, or key frames described with
    /// other settings than `recognition` (their descriptors would not match).
    pub fn read(file: &Path, text: &str, recognition: &Recognition) -> Result<Self, Fault> {
        let mut pose_graph = Self::default();
        let mut end = None;
        let count = text.lines().count();
        for (index, text) in text.lines().enumerate() {
            let at = |what: &str| Fault::new(what, file).on_line(index + 1);
            let line: Line = serde_json::from_str(text).map_err(|error| {
                let message = error.to_string();
                let message = message.split(" at line ").next().unwrap_or_default().to_owned();
                let cut = if index + 1 == count { "; is the file cut off?" } else { "" };
                at("invalid line of a pose graph")
                    .value(message)
                    .remedy(format!("write the file again with `write-file = true`{cut}"))
            })?;
            if (index == 0) != matches!(line, Line::Head(_)) {
                return Err(at("the first line, and no other, must name the format")
                    .remedy(format!("give a file of format {FORMAT}")));
            }
            if end.is_some() {
                return Err(at("line after the end").remedy("store each pose graph in a file of its own"));
            }
            if let Line::End(lines) = line {
                end = Some(lines);
                if lines + 2 != index + 1 {
                    return Err(at("missing lines")
                        .value(format!("{} of {lines}", index - 1))
                        .remedy("copy the complete file"));
                }
                continue;
            }
            pose_graph.take(line, recognition).map_err(|(what, value, remedy)| at(what).value(value).remedy(remedy))?;
        }
        match end {
            Some(_) => Ok(pose_graph),
            None => Err(Fault::new("missing end line", file).on_line(count).remedy("copy the complete file")),
        }
    }

    /// Adds the content of a line; the error holds what is wrong, the value and the remedy.
    fn take(&mut self, line: Line, recognition: &Recognition) -> Result<(), (&'static str, String, &'static str)> {
        match line {
            Line::Head(head) => {
                let Head { format, recognition: added } = *head;
                if format != FORMAT {
                    return Err(("unknown format", format, "give a file of format seafix-pose-graph/2"));
                }
                if let Some(key) = added.described_unlike(recognition) {
                    return Err((
                        "key frames were described with other settings than those of this pipeline",
                        key.to_owned(),
                        "use the settings that the pose graph was made with, or make it again",
                    ));
                }
            }
            Line::Object(object) => {
                if self.objects.iter().any(|(name, _)| *name == object.name) {
                    return Err(("duplicate object name", object.name, "give each object its own name"));
                }
                let place = ObjectPlacement {
                    world_from_object: pose::<World, Object>(&object.world_from_object)?,
                    covariance: Covariance6::new(finite(&object.covariance)?),
                };
                self.objects.push((object.name, place));
            }
            Line::Node(pose_node) => {
                if !(pose_node.sigma >= 0.0) {
                    return Err((
                        "invalid standard deviation",
                        pose_node.sigma.to_string(),
                        "give a length of at least 0 (m)",
                    ));
                }
                let keyframe = pose_node.keyframe.as_ref().map(cooked).transpose()?;
                let world_from_camera = pose(&pose_node.world_from_camera)?;
                self.add_node(PoseNode {
                    stamp_ns: pose_node.stamp_ns,
                    world_from_camera,
                    sigma: pose_node.sigma,
                    keyframe,
                });
            }
            Line::Edge(odometry_edge) => {
                let odometry_edge = self.odometry_edge(&odometry_edge)?;
                self.odometry_edges.push(odometry_edge);
            }
            Line::Loop(odometry_edge) => {
                let odometry_edge = self.odometry_edge(&odometry_edge)?;
                self.loops.push(odometry_edge);
            }
            Line::Fix(fix) => {
                let pose_node = among(fix.pose_node, self.pose_nodes.len())?;
                let object = among(fix.object, self.objects.len())?;
                let covariance = Covariance6::new(covariance(&fix.covariance)?);
                let object_pose = ObjectPose::new(pose(&fix.object_from_camera)?, covariance);
                self.fixes.push(FixEdge { pose_node, navigated: Navigated { object, object_pose } });
            }
            Line::Prior(prior_pose) => {
                let pose_node = among(prior_pose.pose_node, self.pose_nodes.len())?;
                let covariance = Covariance6::new(covariance(&prior_pose.covariance)?);
                self.prior_poses.push(PriorPose {
                    pose_node,
                    world_from_camera: pose(&prior_pose.world_from_camera)?,
                    covariance,
                });
            }
            Line::End(_) => unreachable!("handled by the caller"),
        }
        Ok(())
    }

    fn odometry_edge(&self, raw: &RawOdometryEdge) -> Result<OdometryEdge, (&'static str, String, &'static str)> {
        let (from, to) = (among(raw.from, self.pose_nodes.len())?, among(raw.to, self.pose_nodes.len())?);
        if from == to {
            return Err(("edge from a pose node to itself", from.to_string(), "name two nodes"));
        }
        let covariance = Covariance6::new(covariance(&raw.covariance)?);
        let correlated = raw.correlated.as_ref().map(RawCorrelatedError::cooked).transpose()?;
        let motion = RelativeMotion { motion: pose(&raw.motion)?, covariance, correlated };
        if let Some(correlated) = &correlated
            && Drift::of(&motion, correlated).is_err()
        {
            let value = format!("from node {from} to {to}");
            return Err(("correlated errors contradict the motion's covariance", value, "copy the complete file"));
        }
        Ok(OdometryEdge { from, to, motion })
    }
}

impl Recognition {
    /// The first setting in which the key points and descriptors of two recognitions differ.
    fn described_unlike(&self, other: &Self) -> Option<&'static str> {
        if self.filters != other.filters {
            return Some("filters");
        }
        let parts = [
            ("detector", &self.detector, &other.detector),
            ("locator", &self.locator, &other.locator),
            ("descriptor", &self.descriptor, &other.descriptor),
        ];
        parts.iter().find(|(_, a, b)| a != b).map(|(name, ..)| *name)
    }
}

type Wrong = (&'static str, String, &'static str);

fn among(index: usize, count: usize) -> Result<usize, Wrong> {
    let wrong = || ("reference to a missing or later line", format!("{index} of {count}"), "copy the complete file");
    if index < count { Ok(index) } else { Err(wrong()) }
}

fn pose<A: Frame, B: Frame>(rows: &Rows4) -> Result<Transform<A, B>, Wrong> {
    Transform::from_rows(rows)
        .map_err(|error| ("not a rigid transform", error.to_string(), "give a rotation matrix and a translation"))
}

fn finite(rows: &Rows6) -> Result<Matrix6<f64>, Wrong> {
    let matrix = Matrix6::from_fn(|row, column| rows[row][column]);
    let sound = matrix.iter().all(|x| x.is_finite()) && (0..6).all(|k| matrix[(k, k)] >= 0.0);
    let wrong = || ("invalid covariance", format!("diagonal {:?}", matrix.diagonal().as_slice()), "give variances");
    if sound { Ok(matrix) } else { Err(wrong()) }
}

fn covariance(rows: &Rows6) -> Result<Matrix6<f64>, Wrong> {
    let matrix = finite(rows)?;
    let wrong = || ("invalid covariance", "not positive definite".to_owned(), "give a covariance of full rank");
    if matrix.cholesky().is_some() { Ok(matrix) } else { Err(wrong()) }
}

fn rows6(matrix: &Matrix6<f64>) -> Rows6 {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// The row and column of the six stored components of a covariance.
const UPPER: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

fn raw(keyframe: &KeyFrame) -> RawKeyFrame {
    let points = keyframe.points.iter().flat_map(|point| {
        let at = [point.at.coords.x, point.at.coords.y, point.at.coords.z];
        at.into_iter().chain(UPPER.map(|place| point.covariance[place]))
    });
    let points: Vec<u8> = points.flat_map(f64::to_le_bytes).collect();
    let mut keypoints = Vec::new();
    for keypoint in &keyframe.keypoints {
        keypoints.extend([keypoint.at.u, keypoint.at.v].iter().flat_map(|x| x.to_le_bytes()));
        keypoints.extend([keypoint.response, keypoint.scale].iter().flat_map(|x| x.to_le_bytes()));
    }
    let (kind, descriptors): (Kind, Vec<u8>) = match &keyframe.descriptors {
        Descriptors::Numbers(table) => (Kind::Numbers, table.values().iter().flat_map(|x| x.to_le_bytes()).collect()),
        Descriptors::Bits(table) => (Kind::Bits, table.values().iter().flat_map(|x| x.to_le_bytes()).collect()),
    };
    RawKeyFrame {
        count: keyframe.points.len(),
        kind,
        points: STANDARD.encode(points),
        keypoints: STANDARD.encode(keypoints),
        descriptors: STANDARD.encode(descriptors),
    }
}

/// The bytes encoded in base64: `count` records of `size` bytes.
fn pieces(text: &str, size: usize, count: usize) -> Result<Vec<u8>, Wrong> {
    let wrong = |value: String| ("corrupt key frame", value, "copy the complete file");
    let bytes = STANDARD.decode(text).map_err(|error| wrong(error.to_string()))?;
    if count.checked_mul(size) == Some(bytes.len()) {
        Ok(bytes)
    } else {
        Err(wrong(format!("{} bytes for {count} points of {size}", bytes.len())))
    }
}

fn cooked(raw: &RawKeyFrame) -> Result<KeyFrame, Wrong> {
    let doubles = |bytes: &[u8]| -> Vec<f64> {
        bytes.chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().expect("eight bytes"))).collect()
    };
    let wrong = |value: &str| ("corrupt key frame", value.to_owned(), "copy the complete file");
    let numbers = doubles(&pieces(&raw.points, 72, raw.count)?);
    let points: Vec<UncertainPoint<Camera>> = numbers
        .chunks_exact(9)
        .map(|nine| {
            let mut covariance = Matrix3::zeros();
            for ((row, column), value) in UPPER.into_iter().zip(&nine[3..]) {
                (covariance[(row, column)], covariance[(column, row)]) = (*value, *value);
            }
            UncertainPoint { at: Point::new(nine[0], nine[1], nine[2]), covariance }
        })
        .collect();
    if !numbers.iter().all(|x| x.is_finite()) {
        return Err(wrong("a coordinate is not finite"));
    }
    let bytes = pieces(&raw.keypoints, 24, raw.count)?;
    let single = |four: &[u8]| f32::from_le_bytes(four.try_into().expect("four bytes"));
    let keypoints: Vec<Keypoint> = bytes
        .chunks_exact(24)
        .map(|one| {
            let at = doubles(&one[..16]);
            Keypoint { at: Pixel { u: at[0], v: at[1] }, response: single(&one[16..20]), scale: single(&one[20..]) }
        })
        .collect();
    let bytes = STANDARD.decode(&raw.descriptors).map_err(|error| wrong(&error.to_string()))?;
    let width = match raw.kind {
        Kind::Numbers => 4,
        Kind::Bits => 8,
    };
    if raw.count == 0 || bytes.is_empty() || !bytes.len().is_multiple_of(raw.count * width) {
        return Err(wrong("the descriptors do not fill one row for each point"));
    }
    let length = bytes.len() / (raw.count * width);
    let descriptors = match raw.kind {
        Kind::Numbers => {
            let values: Vec<f32> = bytes.chunks_exact(4).map(single).collect();
            if !values.iter().all(|x| x.is_finite()) {
                return Err(wrong("a descriptor is not finite"));
            }
            Descriptors::Numbers(Table::new(length, values))
        }
        Kind::Bits => {
            let word = |eight: &[u8]| u64::from_le_bytes(eight.try_into().expect("eight bytes"));
            Descriptors::Bits(Table::new(length, bytes.chunks_exact(8).map(word).collect()))
        }
    };
    Ok(KeyFrame { points, keypoints, descriptors })
}

#[cfg(test)]
mod tests;
