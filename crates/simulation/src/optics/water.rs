//! Optical properties of the water: attenuation and scattering.

use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

/// Names of waters and their attenuation coefficients at 530 nm (1/m).
pub const WATERS: [(&str, f64); 7] = [
    ("none", 0.0),
    ("deep-clear", 0.05),
    ("clear", 0.15),
    ("shelf", 0.3),
    ("coastal", 0.6),
    ("harbour", 1.0),
    ("turbid", 1.5),
];

/// The water in the single-scattering model, for one wavelength.
///
/// Light is attenuated by exp(−c r), with c = a + b for absorption and scattering. The fraction `1 − isotropic` of the
/// scattered light follows Henyey and Greenstein (1941) with mean cosine `forwardness`; the rest is isotropic, because
/// the Henyey–Greenstein function alone underestimates backscatter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Water {
    /// Beam attenuation coefficient c (1/m), from 0 to 20. The default is the water `clear`.
    pub attenuation: f64,
    /// Name of a water, which overrides `attenuation`: `none`, `deep-clear`, `clear`, `shelf`, `coastal`, `harbour`,
    /// `turbid`. An empty name overrides nothing.
    pub level: String,
    /// Single-scattering albedo b/c, from 0 to 1.
    pub albedo: f64,
    /// Mean cosine g of the scattering angle, from −0.99 to 0.99.
    pub forwardness: f64,
    /// Fraction of the scattered light that is isotropic, from 0 to 1.
    pub isotropic: f64,
    /// Fraction of the light scattered at small angles, from 0 to 1; the camera receives it blurred.
    pub small_angle: f64,
    /// Standard deviation of the small-angle blur (px) per unit of c·range, from 0 to 5.
    pub blur: f64,
    /// Daylight at the seabed as a multiple of a lamp's irradiance at 1 m, from 0 to 1000.
    pub ambient: f64,
    /// Number of marine snow particles per cubic metre, from 0 to 5000.
    pub snow: f64,
    /// Minimum and maximum radius of a particle (m), from 0.00001 to 0.01.
    pub snow_radius: [f64; 2],
}

impl Default for Water {
    fn default() -> Self {
        Self {
            attenuation: 0.15,
            level: String::new(),
            albedo: 0.8,
            forwardness: 0.924,
            isotropic: 0.02,
            small_angle: 0.3,
            blur: 0.8,
            ambient: 0.0,
            snow: 30.0,
            snow_radius: [0.0003, 0.0015],
        }
    }
}

impl Water {
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("water.{name}"), x, &format!("a number from {low} to {high}"))
        };
        within("attenuation", self.attenuation, 0.0, 20.0)?;
        within("albedo", self.albedo, 0.0, 1.0)?;
        within("forwardness", self.forwardness, -0.99, 0.99)?;
        within("isotropic", self.isotropic, 0.0, 1.0)?;
        within("small-angle", self.small_angle, 0.0, 1.0)?;
        within("blur", self.blur, 0.0, 5.0)?;
        within("ambient", self.ambient, 0.0, 1e3)?;
        within("snow", self.snow, 0.0, 5000.0)?;
        within("snow-radius[0]", self.snow_radius[0], 1e-5, 0.01)?;
        within("snow-radius[1]", self.snow_radius[1], self.snow_radius[0], 0.01)?;
        let known = self.level.is_empty() || WATERS.iter().any(|(name, _)| *name == self.level);
        let names: Vec<&str> = WATERS.iter().map(|(name, _)| *name).collect();
        in_range(known, "water.level", format!("`{}`", self.level), &format!("one of {}", names.join(", ")))
    }

    /// The beam attenuation coefficient c (1/m).
    pub fn c(&self) -> f64 {
        let named = WATERS.iter().find(|(name, _)| *name == self.level);
        named.map_or(self.attenuation, |(_, c)| *c)
    }

    /// The scattering coefficient b (1/m).
    pub fn b(&self) -> f64 {
        self.albedo * self.c()
    }

    /// The phase function (1/sr) at the scattering angle with this cosine; its integral over the sphere is 1.
    pub fn phase(&self, cosine: f64) -> f64 {
        let g = self.forwardness;
        let root = (1.0 + g * g - 2.0 * g * cosine).max(1e-12).sqrt();
        let henyey = (1.0 - g * g) / (root * root * root);
        ((1.0 - self.isotropic) * henyey + self.isotropic) / (4.0 * std::f64::consts::PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_function_integrates_to_one() {
        // Regression: losing a tenth of the isotropic fraction fails this test.
        for (g, isotropic) in [(0.924, 0.02), (0.0, 0.0), (-0.5, 0.3), (0.9, 0.0)] {
            let water = Water { forwardness: g, isotropic, ..Water::default() };
            let n = 200_000;
            let sum: f64 = (0..n)
                .map(|k| water.phase(-1.0 + 2.0 * (f64::from(k) + 0.5) / f64::from(n)) * 2.0 / f64::from(n))
                .sum();
            assert!((sum * 2.0 * std::f64::consts::PI - 1.0).abs() < 1e-6, "{g}: {sum}");
        }
    }

    #[test]
    fn waters_have_names_and_ranges() {
        assert_eq!(Water { level: "coastal".into(), ..Water::default() }.c(), 0.6);
        assert_eq!(Water::default().c(), 0.15);
        let message = Water { level: "mud".into(), ..Water::default() }.check().unwrap_err();
        assert!(message.starts_with("water.level = `mud`; give one of none, "), "{message}");
        assert!(Water { attenuation: f64::NAN, ..Water::default() }.check().is_err());
    }
}
