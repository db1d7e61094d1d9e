//! The supported ROS 2 messages.

use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector3};
use seafix_geometry::{Frame, Transform};

use super::cdr::{Cdr, Read};

/// The time of capture (ns) and the coordinate frame of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Stamped {
    pub stamp_ns: u64,
    pub frame: String,
}

/// A rigid motion as ROS writes it, `parent_from_child`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    pub translation: Vector3<f64>,
    pub rotation: UnitQuaternion<f64>,
}

impl Pose {
    /// The rigid motion as a typed transform.
    pub(crate) fn transform<A: Frame, B: Frame>(&self) -> Transform<A, B> {
        Transform::new(self.rotation, self.translation)
    }
}

/// `sensor_msgs/Image`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image<'a> {
    pub size: [u32; 2],
    pub encoding: String,
    pub is_bigendian: bool,
    pub step: u32,
    pub data: &'a [u8],
}

/// `sensor_msgs/CompressedImage`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CompressedImage<'a> {
    pub format: String,
    pub data: &'a [u8],
}

/// `sensor_msgs/CameraInfo`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CameraInfo {
    pub header: Stamped,
    pub size: [u32; 2],
    pub model: String,
    pub d: Vec<f64>,
    pub k: [f64; 9],
    pub r: [f64; 9],
    pub p: [f64; 12],
    pub binning: [u32; 2],
    /// The offset x, y, height and width of the part of the sensor that was read.
    pub region: [u32; 4],
}

impl CameraInfo {
    /// Whether both describe the same camera, regardless of their stamps.
    pub(crate) fn is_of_one_camera_with(&self, other: &Self) -> bool {
        let bits = |info: &Self| -> Vec<u64> {
            info.d.iter().chain(&info.k).chain(&info.r).chain(&info.p).map(|number| number.to_bits()).collect()
        };
        let rest = |info: &Self| (info.size, info.model.clone(), info.binning, info.region);
        rest(self) == rest(other) && bits(self) == bits(other)
    }
}

/// The types of messages with a pose.
pub(crate) const POSES: [&str; 3] =
    ["nav_msgs/Odometry", "geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped"];

/// A message of one of the types [`POSES`], without the velocity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PoseMessage {
    pub header: Stamped,
    /// The frame whose pose it is; empty if the type has none.
    pub child: String,
    pub pose: Pose,
    /// The covariance of the position, then of the rotation about the axes of the header's frame.
    pub covariance: Option<Matrix6<f64>>,
}

/// A transform of `tf2_msgs/TFMessage`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChildPose {
    pub header: Stamped,
    pub child: String,
    pub pose: Pose,
}

fn header(cdr: &mut Cdr<'_>) -> Read<Stamped> {
    let (seconds, nanos) = (cdr.i32()?, cdr.u32()?);
    if seconds < 0 || nanos >= 1_000_000_000 {
        return Err(format!("a stamp of {seconds} s and {nanos} ns at byte 4"));
    }
    Ok(Stamped { stamp_ns: seconds as u64 * 1_000_000_000 + u64::from(nanos), frame: cdr.string()? })
}

/// The header at the beginning of every message except tf's.
pub(crate) fn stamp(message: &[u8]) -> Read<Stamped> {
    header(&mut Cdr::new(message)?)
}

fn pose(cdr: &mut Cdr<'_>) -> Read<Pose> {
    let [tx, ty, tz, x, y, z, w] = cdr.f64s::<7>()?;
    let quaternion = Quaternion::new(w, x, y, z);
    if let Some(number) = [tx, ty, tz, x, y, z, w].into_iter().find(|number| !number.is_finite()) {
        return Err(format!(
            "a pose with {number} in it: position [{tx}, {ty}, {tz}], quaternion [{x}, {y}, {z}, {w}]"
        ));
    }
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        return Err(format!("a pose whose quaternion has the length {:.6}", quaternion.norm()));
    }
    Ok(Pose { translation: [tx, ty, tz].into(), rotation: UnitQuaternion::new_normalize(quaternion) })
}

impl<'a> Image<'a> {
    pub(crate) fn decode(message: &'a [u8]) -> Read<Self> {
        let mut cdr = Cdr::new(message)?;
        header(&mut cdr)?;
        let (height, width) = (cdr.u32()?, cdr.u32()?);
        let (encoding, is_bigendian) = (cdr.string()?, cdr.u8()? != 0);
        let (step, data) = (cdr.u32()?, cdr.bytes()?);
        cdr.end()?;
        Ok(Self { size: [width, height], encoding, is_bigendian, step, data })
    }
}

impl<'a> CompressedImage<'a> {
    pub(crate) fn decode(message: &'a [u8]) -> Read<Self> {
        let mut cdr = Cdr::new(message)?;
        header(&mut cdr)?;
        let (format, data) = (cdr.string()?, cdr.bytes()?);
        cdr.end()?;
        Ok(Self { format, data })
    }
}

impl CameraInfo {
    pub(crate) fn decode(message: &[u8]) -> Read<Self> {
        let mut cdr = Cdr::new(message)?;
        let header = header(&mut cdr)?;
        let (height, width, model) = (cdr.u32()?, cdr.u32()?, cdr.string()?);
        let d = (0..cdr.length(8)?).map(|_| cdr.f64()).collect::<Read<_>>()?;
        let (k, r, p) = (cdr.f64s()?, cdr.f64s()?, cdr.f64s()?);
        let binning = [cdr.u32()?, cdr.u32()?];
        let region = [cdr.u32()?, cdr.u32()?, cdr.u32()?, cdr.u32()?];
        cdr.u8()?;
        cdr.end()?;
        Ok(Self { header, size: [width, height], model, d, k, r, p, binning, region })
    }
}

impl PoseMessage {
    /// Decodes a message of the type `kind`.
    pub(crate) fn decode(message: &[u8], kind: &str) -> Read<Self> {
        let mut cdr = Cdr::new(message)?;
        let header = header(&mut cdr)?;
        let is_odometry = kind == "nav_msgs/Odometry";
        let child = if is_odometry { cdr.string()? } else { String::new() };
        let pose = pose(&mut cdr)?;
        let covariance = match kind {
            "geometry_msgs/PoseStamped" => None,
            _ => Some(Matrix6::from_row_slice(&cdr.f64s::<36>()?)),
        };
        if is_odometry {
            cdr.f64s::<42>()?;
        }
        cdr.end()?;
        Ok(Self { header, child, pose, covariance })
    }
}

/// The transforms of a `tf2_msgs/TFMessage`.
pub(crate) fn transforms(message: &[u8]) -> Read<Vec<ChildPose>> {
    /// The minimum size: a header with an empty name, an empty child name, and seven numbers.
    const MIN: usize = 8 + 5 + 5 + 56;
    let mut cdr = Cdr::new(message)?;
    let count = cdr.length(MIN)?;
    let one = |cdr: &mut Cdr<'_>| Ok(ChildPose { header: header(cdr)?, child: cdr.string()?, pose: pose(cdr)? });
    let transforms = (0..count).map(|_| one(&mut cdr)).collect::<Read<_>>()?;
    cdr.end()?;
    Ok(transforms)
}
