//! Changes of the site since its survey: displaced, overgrown or silted objects, and occluders.

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use seafix_geometry::{Object, Transform, World, so3};
use seafix_referencing::Site;
use serde::{Deserialize, Serialize};

use crate::stream::{Purpose, Stream};

/// Changes of the site since its survey.
///
/// Magnitudes are exact and directions are sampled from the seed. All zero is the site as surveyed. Studies use a shift
/// up to 0.5 m, settlement up to 0.10 m, tilt up to 3°, heading up to 5° (usual installation tolerances), rounding up
/// to 5 cm and silt up to 15 cm.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Changes {
    /// Ids of the changed objects; an empty list stands for all.
    pub objects: Vec<String>,
    /// Horizontal displacement in a random direction (m), from 0 to 10.
    pub shift: f64,
    /// Depth by which an object has sunk (m), from 0 to 2.
    pub settlement: f64,
    /// Tilt in a random direction (degrees), from 0 to 45.
    pub tilt_deg: f64,
    /// Rotation about the vertical with a random sign (degrees), from 0 to 180.
    pub heading_deg: f64,
    /// Fraction of the surfaces that marine growth covers, from 0 to 1.
    pub growth: f64,
    /// Radius of the rounded edges of boxes (m), from 0 to 0.2.
    pub rounding: f64,
    /// Height of the silt around each object (m), from 0 to 1.
    pub silt: f64,
    /// Number of occluders around each object (hoses on the seabed, floating weed), from 0 to 200.
    pub occluders: usize,
}

impl Changes {
    pub(crate) fn check(&self) -> Result<(), String> {
        for (name, value, max) in [
            ("shift", self.shift, 10.0),
            ("settlement", self.settlement, 2.0),
            ("tilt-deg", self.tilt_deg, 45.0),
            ("heading-deg", self.heading_deg, 180.0),
            ("growth", self.growth, 1.0),
            ("rounding", self.rounding, 0.2),
            ("silt", self.silt, 1.0),
            ("occluders", self.occluders as f64, 200.0),
        ] {
            let range = format!("a number from 0 to {max}");
            in_range(value >= 0.0 && value <= max, &format!("changes.{name}"), value, &range)?;
        }
        Ok(())
    }

    /// Whether the object of this name changes.
    pub(crate) fn concern(&self, id: &str) -> bool {
        self.objects.is_empty() || self.objects.iter().any(|name| name == id)
    }

    /// The first of `objects` that the site does not have.
    pub(crate) fn stranger(&self, site: &Site) -> Option<&str> {
        self.objects.iter().map(String::as_str).find(|id| site.object(id).is_none())
    }

    /// The new pose of an object that stood at `pose` with its points' centroid at `centre` (world).
    pub(crate) fn moved(
        &self,
        pose: &Transform<World, Object>,
        centre: &Vector3<f64>,
        seed: u64,
        index: u64,
    ) -> Transform<World, Object> {
        if self.shift == 0.0 && self.settlement == 0.0 && self.tilt_deg == 0.0 && self.heading_deg == 0.0 {
            return *pose;
        }
        let mut stream = Stream::new(seed, 0, index, Purpose::Changes);
        let mut direction = || {
            let (sine, cosine) = libm::sincos(stream.between(0.0, std::f64::consts::TAU));
            Vector3::new(cosine, sine, 0.0)
        };
        let (aside, about) = (direction(), direction());
        let sign = if stream.unit() < 0.5 { -1.0 } else { 1.0 };
        let turn = so3::exp(&(about * self.tilt_deg.to_radians()))
            * so3::exp(&(Vector3::z() * (sign * self.heading_deg.to_radians())));
        let step = aside * self.shift + Vector3::z() * self.settlement;
        Transform::new(turn * pose.rotation(), centre + turn * (pose.translation() - centre) + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_move_by_what_is_stated() {
        let pose = Transform::<World, Object>::exp(&[0.1, 0.2, 0.3, 4.0, 5.0, 40.0].into());
        let centre = Vector3::new(4.5, 5.5, 39.0);
        let changes = Changes { shift: 0.3, settlement: 0.05, tilt_deg: 2.0, heading_deg: 4.0, ..Changes::default() };
        let moved = changes.moved(&pose, &centre, 1, 0);
        let now = moved * (pose.inverse() * seafix_geometry::Point::from(centre));
        let step = now.coords - centre;
        assert!((step.z - 0.05).abs() < 1e-12 && (step.xy().norm() - 0.3).abs() < 1e-12);
        let turned = moved.rotation() * pose.rotation().inverse();
        let up = turned * Vector3::z();
        assert!((libm::acos(up.z).to_degrees() - 2.0).abs() < 1e-9);
        assert_eq!(Changes::default().moved(&pose, &centre, 1, 0), pose);
        assert_ne!(moved, changes.moved(&pose, &centre, 1, 1));
    }

    #[test]
    fn magnitudes_have_ranges() {
        let message = Changes { silt: f64::NAN, ..Changes::default() }.check().unwrap_err();
        assert_eq!(message, "changes.silt = NaN; give a number from 0 to 1");
        assert!(Changes::default().check().is_ok());
    }
}
