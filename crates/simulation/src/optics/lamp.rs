//! Lamps that move with the vehicle.

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

/// A lamp on the vehicle.
///
/// The intensity at the angle θ to the axis is `power`·cosᵐ θ, and 0 beyond 90°. The exponent m gives half the
/// intensity at half the beam width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Lamp {
    /// Position in the left camera's frame (m), from −100 to 100 each.
    pub at: [f64; 3],
    /// Point on the lamp's axis in the left camera's frame (m), from −100 to 100 each.
    pub aim: [f64; 3],
    /// Intensity along the axis as a multiple of a usual lamp's, from 0 to 1000.
    pub power: f64,
    /// Full width of the beam at half the intensity (degrees), from 5 to 170.
    pub beam_deg: f64,
}

impl Default for Lamp {
    fn default() -> Self {
        Self { at: [0.0, -0.5, 0.0], aim: [0.125, 0.0, 3.0], power: 1.0, beam_deg: 110.0 }
    }
}

impl Lamp {
    /// The usual pair: 0.6 m outside of either camera, directed at the centre of the common view 3 m ahead.
    pub fn pair(baseline: f64) -> Vec<Self> {
        let aim = [0.5 * baseline, 0.0, 3.0];
        [-0.6, baseline + 0.6].map(|x| Self { at: [x, -0.1, -0.05], aim, ..Self::default() }).to_vec()
    }

    pub(crate) fn check(&self, index: usize) -> Result<(), String> {
        let name = |key: &str| format!("lamps[{index}].{key}");
        let finite = self.at.iter().chain(&self.aim).all(|x| x.abs() <= 100.0);
        in_range(finite, &name("at"), format!("{:?} to {:?}", self.at, self.aim), "coordinates from -100 to 100 m")?;
        let length = (Vector3::from(self.aim) - Vector3::from(self.at)).norm();
        in_range(length > 1e-3, &name("aim"), format!("{:?}", self.aim), "a point more than 1 mm from the lamp")?;
        in_range(self.power >= 0.0 && self.power <= 1e3, &name("power"), self.power, "a number from 0 to 1000")?;
        let beam = self.beam_deg;
        in_range((5.0..=170.0).contains(&beam), &name("beam-deg"), beam, "degrees from 5 to 170")
    }

    /// The unit vector of the axis.
    pub(crate) fn axis(&self) -> Vector3<f64> {
        (Vector3::from(self.aim) - Vector3::from(self.at)).normalize()
    }

    /// The exponent m of the beam.
    pub(crate) fn exponent(&self) -> f64 {
        libm::log(0.5) / libm::log(libm::cos(0.5 * self.beam_deg.to_radians()))
    }

    /// The intensity in the direction with this cosine to the axis.
    pub fn intensity(&self, cosine: f64) -> f64 {
        if cosine > 0.0 { self.power * libm::pow(cosine, self.exponent()) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_light_is_left_at_half_the_beam() {
        let lamp = Lamp { beam_deg: 100.0, power: 3.0, ..Lamp::default() };
        assert_eq!(lamp.intensity(1.0), 3.0);
        assert!((lamp.intensity(libm::cos(50f64.to_radians())) - 1.5).abs() < 1e-12);
        assert_eq!(lamp.intensity(-0.1), 0.0);
    }
}
