//! The current of the water.

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

use crate::stream::{Purpose, Stream};

/// Von Kármán's constant.
const KARMAN: f64 = 0.41;
/// The height above the seabed for which the current is given (m).
const REFERENCE: f64 = 3.0;

/// A current with a logarithmic mean profile and slow horizontal fluctuations.
///
/// The mean follows the law of the wall, u(z) = u*/κ ln(z/z₀), scaled to `speed` 3 m above the seabed. The fluctuation
/// of each horizontal axis is an Ornstein–Uhlenbeck process, x' = x e^(−dt/τ) + σ √(1 − e^(−2dt/τ)) n, exact for any
/// step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Current {
    /// Mean speed 3 m above the seabed (m/s), from 0 to 5.
    pub speed: f64,
    /// Direction of the flow, from north over east (degrees), from −360 to 360.
    pub towards_deg: f64,
    /// Roughness height z₀ (m), from 0 to 0.2; 0 gives the same current at all heights.
    pub roughness: f64,
    /// Standard deviation of the fluctuation on each horizontal axis (m/s), from 0 to 2.
    pub sigma: f64,
    /// Time constant τ of the fluctuation (s), from 0.001 to 1 000 000.
    pub tau: f64,
}

impl Default for Current {
    fn default() -> Self {
        Self { speed: 0.0, towards_deg: 60.0, roughness: 0.003, sigma: 0.0, tau: 120.0 }
    }
}

impl Current {
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("current.{name}"), x, &format!("a number from {low} to {high}"))
        };
        within("speed", self.speed, 0.0, 5.0)?;
        within("towards-deg", self.towards_deg, -360.0, 360.0)?;
        within("roughness", self.roughness, 0.0, 0.2)?;
        within("sigma", self.sigma, 0.0, 2.0)?;
        within("tau", self.tau, 1e-3, 1e6)
    }

    /// The velocity (north, east, down) at a height above the seabed, with the given fluctuation.
    pub(crate) fn velocity(&self, height: f64, fluctuation: &Vector3<f64>) -> Vector3<f64> {
        let fraction = if self.roughness > 0.0 {
            let log = |z: f64| libm::log(z.max(self.roughness * 1.001) / self.roughness) / KARMAN;
            log(height) / log(REFERENCE)
        } else {
            1.0
        };
        let (sine, cosine) = libm::sincos(self.towards_deg.to_radians());
        Vector3::new(cosine, sine, 0.0) * (self.speed * fraction) + fluctuation
    }
}

/// The state of the fluctuation.
#[derive(Debug)]
pub(crate) struct Fluctuation {
    stream: Stream,
    pub(crate) now: Vector3<f64>,
    sigma: f64,
    tau: f64,
}

impl Fluctuation {
    pub(crate) fn new(current: &Current, seed: u64, dive: u64) -> Self {
        let mut stream = Stream::new(seed, dive, 0, Purpose::Current);
        let now = Vector3::new(stream.normal(), stream.normal(), 0.0) * current.sigma;
        Self { stream, now, sigma: current.sigma, tau: current.tau }
    }

    pub(crate) fn step(&mut self, dt: f64) {
        if self.sigma > 0.0 {
            let keep = libm::exp(-dt / self.tau);
            let spread = self.sigma * (1.0 - keep * keep).sqrt();
            self.now = self.now * keep + Vector3::new(self.stream.normal(), self.stream.normal(), 0.0) * spread;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_does_not_depend_on_the_step() {
        // Regression: noise of one size for all steps fails this test.
        let current = Current { sigma: 0.1, tau: 2.0, ..Current::default() };
        for dt in [0.1, 1.0, 10.0] {
            let mut process = Fluctuation::new(&current, 3, 0);
            let n = 60_000;
            let (mut squares, mut together) = (0.0, 0.0);
            for _ in 0..n {
                let before = process.now;
                process.step(dt);
                squares += process.now.norm_squared() / 2.0;
                together += before.dot(&process.now) / 2.0;
            }
            let variance = squares / f64::from(n);
            // About n dt/(2 τ) independent samples: 3 % at the smallest step.
            assert!((variance / 0.01 - 1.0).abs() < 0.09, "{dt}: {variance}");
            assert!((together / squares - libm::exp(-dt / 2.0)).abs() < 0.02, "{dt}");
        }
    }

    #[test]
    fn the_current_is_slower_near_the_seabed() {
        let current = Current { speed: 0.4, towards_deg: 90.0, ..Current::default() };
        let at = |height| current.velocity(height, &Vector3::zeros()).y;
        assert!((at(3.0) - 0.4).abs() < 1e-12 && at(0.5) < at(1.0) && at(1.0) < 0.4);
        // Law of the wall: equal ratios of height give equal differences of speed.
        assert!(((at(2.0) - at(1.0)) - (at(1.0) - at(0.5))).abs() < 1e-12);
        assert_eq!(Current { roughness: 0.0, ..current }.velocity(0.1, &Vector3::zeros()).y, 0.4);
    }
}
