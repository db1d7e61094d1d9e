//! Triangulation of matched segments.

use nalgebra::{Matrix4, Vector3};
use seafix_component::{Settings, in_range};
use seafix_geometry::{
    Camera, MeasuredLine, NormalOffset, Pinhole, Point, StereoRig, StereoSegments, Transform, across,
};
use serde::{Deserialize, Serialize};

use super::{
    fit::FittedSegment,
    overlap::{Epipolar, between},
};

/// The settings of the triangulation of segments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LineRules {
    /// Angle to the epipolar lines (degrees) below which a line's depth is not measured; above 0, at most 45.
    pub flat_deg: f64,
    /// Maximum standard deviation of a measured depth, as a fraction of the depth.
    pub max_relative_sigma: f64,
    /// Maximum depth (m).
    pub max_depth: f64,
}

impl Default for LineRules {
    fn default() -> Self {
        Self { flat_deg: 6.0, max_relative_sigma: 0.1, max_depth: 20.0 }
    }
}

/// The distance (px) from an epipolar line up to which the ends of flat segments correspond.
const ENDS: f64 = 3.0;
/// The standard deviation of an unmeasured depth, as a fraction of the depth.
const UNMEASURED: f64 = 0.3;

impl LineRules {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The name, value and valid range of a wrong setting.
    pub fn check(&self) -> Result<(), String> {
        in_range(self.flat_deg > 0.0 && self.flat_deg <= 45.0, "flat-deg", self.flat_deg, "above 0, at most 45")?;
        let relative = self.max_relative_sigma > 0.0 && self.max_relative_sigma <= 1.0;
        in_range(relative, "max-relative-sigma", self.max_relative_sigma, "above 0, at most 1")?;
        in_range(self.max_depth > 0.0 && self.max_depth.is_finite(), "max-depth", self.max_depth, "above 0")
    }

    /// The line of two matched segments; `None` if they have no common part in front of both cameras.
    ///
    /// It is the intersection of the two planes through the cameras and the segments, and ends where the common part
    /// does. The covariance of its offsets is (Jᵀ Σ⁻¹ J)⁻¹, with J the derivative of the four measured offsets by those
    /// of the ends and Σ their covariance. A line close to the epipolar lines has the depths at which the segments' ends
    /// correspond, with a standard deviation of three tenths of the depth.
    pub fn line(&self, rig: &StereoRig, left: &FittedSegment, right: &FittedSegment) -> Option<MeasuredLine> {
        let sine = libm::sin(self.flat_deg.to_radians());
        let overlap = Epipolar::new(rig).overlap(&left.ends, &right.ends, sine, ENDS)?;
        if overlap.depths.iter().any(|&z| z > self.max_depth) {
            return None;
        }
        let mut depth = overlap.sine >= sine;
        let ends = [0, 1].map(|end| {
            let ray = between(&left.ends, overlap.left[end]).push(1.0);
            Point::<Camera>::from(ray * overlap.depths[end])
        });
        let direction = (ends[1] - ends[0]).try_normalize(1e-9)?;
        let normals = across(&direction);
        let segments = StereoSegments { left: left.offsets, right: right.offsets };
        let mut information = information(rig, &ends, &normals, &segments)?;
        let range = 0.5 * (ends[0].coords.norm() + ends[1].coords.norm());
        if !depth {
            information += Matrix4::identity() / (UNMEASURED * range).powi(2);
        }
        let mut offsets = information.try_inverse()?;
        let spread = (0..4).map(|i| offsets[(i, i)]).fold(0.0, f64::max).sqrt();
        if depth && !(spread <= self.max_relative_sigma * range) {
            depth = false;
            information += Matrix4::identity() / (UNMEASURED * range).powi(2);
            offsets = information.try_inverse()?;
        }
        offsets = 0.5 * (offsets + offsets.transpose());
        offsets.iter().all(|x| x.is_finite()).then_some(MeasuredLine { ends, offsets, segments: Some(segments), depth })
    }
}

/// Jᵀ Σ⁻¹ J of the four measured offsets, by the offsets of the ends along `normals`.
fn information(
    rig: &StereoRig,
    ends: &[Point<Camera>; 2],
    normals: &[Vector3<f64>; 2],
    segments: &StereoSegments,
) -> Option<Matrix4<f64>> {
    let left = |offset| derivative::<Camera>(rig.left(), &Transform::identity(), ends, normals, offset);
    let right = |offset| derivative(rig.right(), rig.right_from_left(), ends, normals, offset);
    let ([a, b], [c, d]) = (&segments.left, &segments.right);
    let j = Matrix4::from_columns(&[left(a)?, left(b)?, right(c)?, right(d)?]);
    Some(j * segments.covariance().cholesky()?.solve(&j.transpose()))
}

/// The derivative of a measured offset by the offsets of the ends.
fn derivative<F: seafix_geometry::Frame>(
    camera: &Pinhole,
    camera_from_left: &Transform<F, Camera>,
    ends: &[Point<Camera>; 2],
    normals: &[Vector3<f64>; 2],
    offset: &NormalOffset,
) -> Option<nalgebra::Vector4<f64>> {
    // The place on the line that is seen at the offset's pixel.
    let ray = camera.normalize(&offset.at)?.push(1.0);
    let [a, b] = ends.map(|end| (*camera_from_left * end).coords);
    let step = b - a;
    let across = ray.cross(&step.cross(&ray));
    let along = -across.dot(&a) / across.dot(&step);
    let (_, j) = camera.project_with_jacobian(&Point::<F>::from(a + step * along))?;
    let row = (j.transpose() * offset.normal).transpose() * camera_from_left.rotation_matrix();
    let by = normals.map(|normal| (row * normal).x);
    Some(nalgebra::Vector4::new((1.0 - along) * by[0], (1.0 - along) * by[1], along * by[0], along * by[1]))
}
