//! The true stereo rig, and the rig that a method receives.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::{Settings, in_range};
use seafix_geometry::{Camera, Pinhole, RightCamera, StereoRig, Transform, so3};
use serde::{Deserialize, Serialize};

use crate::optics::{Lens, Port, PortKind};

/// The distance at which cameras behind ports are calibrated (m).
pub const CALIBRATION_RANGE: f64 = 3.0;

/// The medium in which the focal length is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum FocalIn {
    /// Air: the lens alone, without its port.
    #[default]
    Air,
    /// Water: the effective focal length behind the flat port.
    Water,
}

/// Two equal cameras side by side, tilted forward from straight down. The defaults are the paper's virtual camera; the
/// paper gives no baseline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RigPlan {
    /// Width and height of the images (px), from 16 to 8192 each.
    pub size: [u32; 2],
    /// Focal length (px), from 1 to 100 000.
    pub focal: f64,
    /// Medium of `focal`: `air`, or `water` for a camera behind a flat port.
    pub focal_in: FocalIn,
    /// Distance between the cameras (m), from 0.001 to 100.
    pub baseline: f64,
    /// Brown's distortion coefficients: k1 k2 p1 p2 \[k3 \[k4 k5 k6\]\].
    pub distortion: Vec<f64>,
    /// Position of the left camera in the body frame, whose origin is the centre of gravity: forward, starboard, down
    /// (m), from −10 to 10 each.
    pub at: [f64; 3],
    /// Angle by which the cameras look forward of straight down (degrees), from −60 to 60.
    pub ahead_deg: f64,
    /// The port of both cameras.
    pub port: Port,
    /// Errors of the calibration that a method receives.
    pub error: CalibrationError,
}

impl Default for RigPlan {
    fn default() -> Self {
        Self {
            size: [1024, 768],
            focal: 500.0,
            focal_in: FocalIn::Air,
            baseline: 0.25,
            distortion: Vec::new(),
            at: [0.0; 3],
            ahead_deg: 15.0,
            port: Port::default(),
            error: CalibrationError::default(),
        }
    }
}

/// Calibration errors: differences between the rig that a method receives and the true rig.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CalibrationError {
    /// Relative error of both focal lengths (0.001 is 0.1 %), from −0.5 to 0.5.
    pub focal: f64,
    /// Error of the right camera's principal point (px), from −100 to 100 each.
    pub principal: [f64; 2],
    /// Error of the baseline (m), up to half of the baseline either way.
    pub baseline: f64,
    /// Rotation error of the right camera about its x, y, z axes (degrees): pitch, vergence, roll; from −10 to 10 each.
    pub turn_deg: [f64; 3],
}

/// The true cameras and the nominal rig, which a method receives.
#[derive(Debug, Clone)]
pub(crate) struct Cameras {
    pub(crate) lens: Lens,
    pub(crate) right_from_left: Transform<RightCamera, Camera>,
    pub(crate) nominal: StereoRig,
}

impl RigPlan {
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("rig.{name}"), x, &format!("a number from {low} to {high}"))
        };
        for n in self.size {
            within("size", f64::from(n), 16.0, 8192.0)?;
        }
        within("focal", self.focal, 1.0, 1e5)?;
        within("baseline", self.baseline, 1e-3, 100.0)?;
        within("ahead-deg", self.ahead_deg, -60.0, 60.0)?;
        self.at.iter().try_for_each(|x| within("at", *x, -10.0, 10.0))?;
        within("error.focal", self.error.focal, -0.5, 0.5)?;
        for x in self.error.principal {
            within("error.principal", x, -100.0, 100.0)?;
        }
        within("error.baseline", self.error.baseline, -0.5 * self.baseline, 0.5 * self.baseline)?;
        for x in self.error.turn_deg {
            within("error.turn-deg", x, -10.0, 10.0)?;
        }
        self.port.check().map_err(|message| format!("rig.{message}"))?;
        self.build().map(|_| ())
    }

    /// Builds the true cameras and the nominal rig.
    pub(crate) fn build(&self) -> Result<Cameras, String> {
        let principal = self.size.map(|n| 0.5 * (f64::from(n) - 1.0));
        let flat = self.port.kind == PortKind::Flat;
        let in_water = flat && self.focal_in == FocalIn::Water;
        if in_water {
            // Behind a flat port no ray in the water exceeds the critical angle.
            let angle = libm::atan(principal[0].hypot(principal[1]) / self.focal).to_degrees();
            let critical = libm::asin(1.0 / self.port.water).to_degrees();
            let remedy = format!("a half field of view of less than {critical:.1} degrees, or a dome");
            in_range(angle < critical, "rig.focal", format!("{} ({angle:.1} degrees)", self.focal), &remedy)?;
        }
        let focal = if in_water { self.focal / self.port.water } else { self.focal };
        let camera = Pinhole::new(self.size, [focal; 2], principal, &self.distortion)
            .map_err(|error| format!("rig: {error}"))?;
        let lens = Lens::new(camera, self.port.clone());
        if let Some(pixel) = lens.blind() {
            // A distortion model can fold back before the image border, and a port can reflect all light there.
            let what = match self.distortion.as_slice() {
                [] => format!("rig.port = {:?}", self.port),
                numbers => format!("rig.distortion = {numbers:?}"),
            };
            let (u, v) = (pixel.u, pixel.v);
            return Err(format!(
                "{what} (no ray at pixel ({u:.0}, {v:.0})); give a lens and a port that pass light to the \
                 middle of each side"
            ));
        }
        let angle = lens.half_diagonal().to_degrees();
        in_range(!flat || angle < 80.0, "rig.focal", format!("{focal} ({angle:.1} degrees)"), "less than 80 degrees")?;
        let right_from_left = Transform::new(UnitQuaternion::identity(), Vector3::new(-self.baseline, 0.0, 0.0));
        let nominal = self.nominal(&lens, &right_from_left)?;
        Ok(Cameras { lens, right_from_left, nominal })
    }

    fn nominal(&self, lens: &Lens, right_from_left: &Transform<RightCamera, Camera>) -> Result<StereoRig, String> {
        let bad = |error: &dyn std::fmt::Display| format!("rig: {error}");
        let exact = lens.calibrated(CALIBRATION_RANGE).map_err(|error| bad(&error))?;
        let error = &self.error;
        let off = |shift: [f64; 2]| {
            let focal = exact.focal().map(|f| f * (1.0 + error.focal));
            let [cx, cy] = exact.principal();
            let principal = [cx + shift[0], cy + shift[1]];
            Pinhole::new(exact.size(), focal, principal, exact.distortion().shortest()).map_err(|error| bad(&error))
        };
        let turn = so3::exp(&Vector3::from(error.turn_deg.map(f64::to_radians)));
        let step = right_from_left.translation() * (1.0 + error.baseline / self.baseline);
        let placed = Transform::new(turn * right_from_left.rotation(), turn * step);
        StereoRig::new(off([0.0; 2])?, off(error.principal)?, placed).map_err(|error| bad(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Point;

    #[test]
    fn without_errors_the_reported_rig_is_the_true_one() {
        let cameras = RigPlan { distortion: vec![-0.1, 0.02, 0.0, 0.0], ..RigPlan::default() }.build().unwrap();
        assert_eq!(cameras.nominal.left(), cameras.lens.camera());
        assert_eq!(cameras.nominal.right_from_left(), &cameras.right_from_left);
        assert_eq!(cameras.nominal.baseline(), 0.25);
    }

    #[test]
    fn calibration_errors_show_as_the_geometry_predicts() {
        let nominal = |error| RigPlan { error, ..RigPlan::default() }.build().unwrap().nominal;
        let truth = nominal(CalibrationError::default());
        let place = Point::<Camera>::new(0.125, 0.0, 3.0);
        let v = |rig: &StereoRig| rig.project(&place).unwrap().right;
        // A pitch of 0.01° gives 0.087 px of vertical disparity at the image centre; an equal vergence gives as much
        // horizontal disparity.
        let pitched = nominal(CalibrationError { turn_deg: [0.01, 0.0, 0.0], ..CalibrationError::default() });
        assert!(((v(&pitched).v - v(&truth).v).abs() - 0.0873).abs() < 1e-3);
        let verged = nominal(CalibrationError { turn_deg: [0.0, 0.01, 0.0], ..CalibrationError::default() });
        assert!(((v(&verged).u - v(&truth).u).abs() - 0.0873).abs() < 1e-3);
        assert_eq!(nominal(CalibrationError { baseline: 0.001, ..CalibrationError::default() }).baseline(), 0.251);
    }

    #[test]
    fn a_field_that_no_flat_port_has_is_rejected_with_its_angle() {
        let flat = Port { kind: PortKind::Flat, ..Port::default() };
        let plan = RigPlan { port: flat, focal_in: FocalIn::Water, ..RigPlan::default() };
        let message = plan.check().unwrap_err();
        assert!(
            message.starts_with("rig.focal = 500 (52.0 degrees); give a half field of view of less than 48.3"),
            "{message}"
        );
        assert!(RigPlan { focal: 700.0, ..plan.clone() }.check().is_ok());
        assert!(RigPlan { focal_in: FocalIn::Air, ..plan }.check().is_ok());
    }
}
