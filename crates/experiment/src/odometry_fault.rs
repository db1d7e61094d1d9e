//! Simulated failures of an odometry, applied between odometry and navigator.

use nalgebra::Vector3;
use seafix_component::Settings;
use seafix_geometry::{Transform, so3};
use seafix_navigation::RelativeMotion;
use seafix_simulation::{Purpose, Stream, sensors::FaultKind};
use serde::{Deserialize, Serialize};

/// The interval of motions that a slow odometry gives: every fifth.
const SLOW: u64 = 5;

/// A temporary failure of the odometry, named as in PX4's failure injection. Motions are missing (`off`, `slow`,
/// `intermittent`) or wrong (`stuck`, `garbage`, `wrong`, `delayed`), with unchanged covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct OdometryFault {
    /// The kind of failure.
    pub kind: FaultKind,
    /// The time of its beginning since the first frame (s).
    pub from: f64,
    /// The time of its end (s), not before `from`; with the same value it never acts.
    pub to: f64,
    /// The delay (s), or the probability of a loss.
    #[serde(default = "half")]
    pub amount: f64,
}

fn half() -> f64 {
    0.5
}

impl OdometryFault {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first number outside its range: `name = value; give range`.
    pub(crate) fn check(&self, index: usize) -> Result<(), String> {
        self.kind.check((self.from, self.to), self.amount, index)
    }

    fn acts(&self, time: f64) -> bool {
        time >= self.from && time < self.to
    }
}

/// The motions of an odometry with their faults.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    /// The time of each pair (s since the first) and the odometry's motion to it, in order of time.
    found: Vec<(f64, Option<RelativeMotion>)>,
}

impl Motions {
    /// The motion to the pair at `time` (s since the first frame) that the navigator receives.
    pub(crate) fn passed(
        &mut self,
        faults: &[OdometryFault],
        time: f64,
        motion: Option<RelativeMotion>,
    ) -> Option<RelativeMotion> {
        if faults.is_empty() {
            return motion;
        }
        self.found.push((time, motion));
        let index = self.found.len() as u64 - 1;
        faults.iter().enumerate().filter(|(_, fault)| fault.acts(time)).fold(motion, |motion, (n, fault)| {
            let mut stream = Stream::new(0, n as u64, index, Purpose::Faults);
            let as_at = |time: f64| self.found.iter().rev().find(|(at, _)| *at <= time).and_then(|(_, motion)| *motion);
            match fault.kind {
                FaultKind::Off => None,
                FaultKind::Slow => motion.filter(|_| index.is_multiple_of(SLOW)),
                FaultKind::Intermittent => motion.filter(|_| stream.unit() >= fault.amount),
                FaultKind::Stuck => self.found.iter().rev().find(|(at, _)| *at < fault.from).and_then(|(_, m)| *m),
                FaultKind::Delayed => as_at(time - fault.amount),
                FaultKind::Garbage => {
                    let turn = so3::exp(&stream.normal3(0.5));
                    motion.map(|local| RelativeMotion { motion: Transform::new(turn, stream.normal3(1.0)), ..local })
                }
                FaultKind::Wrong => motion.map(|local| {
                    // A scale error of 20 % and a slow rotation, as of a rig that was hit.
                    let turn = so3::exp(&Vector3::new(0.0, 0.002, 0.002)) * local.motion.rotation();
                    RelativeMotion { motion: Transform::new(turn, local.motion.translation() * 1.2), ..local }
                }),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use seafix_geometry::Covariance6;

    use super::*;

    /// The k-th motion, k metres long.
    fn motion(k: u32) -> Option<RelativeMotion> {
        let motion = Transform::new(UnitQuaternion::identity(), Vector3::new(f64::from(k), 0.0, 0.0));
        Some(RelativeMotion::new(motion, Covariance6::isotropic(1e-3, 1e-3)))
    }

    /// The lengths of one minute's motions at 1 Hz. The odometry fails from 20 to 40 s.
    fn lengths(kind: FaultKind, amount: f64, to: f64) -> Vec<Option<f64>> {
        let faults = [OdometryFault { kind, from: 20.0, to, amount }];
        let mut motions = Motions::default();
        let mut pass = |k| motions.passed(&faults, f64::from(k), motion(k));
        (0..60).map(|k| pass(k).map(|local| local.motion.translation().norm())).collect()
    }

    #[test]
    fn odometry_fails_as_configured_and_only_then() {
        let sound: Vec<Option<f64>> = (0..60).map(|k| Some(f64::from(k))).collect();
        for kind in [
            FaultKind::Off,
            FaultKind::Stuck,
            FaultKind::Garbage,
            FaultKind::Wrong,
            FaultKind::Slow,
            FaultKind::Delayed,
            FaultKind::Intermittent,
        ] {
            let failed = lengths(kind, 0.5, 40.0);
            assert_eq!((&failed[..20], &failed[40..]), (&sound[..20], &sound[40..]), "{kind:?}");
            assert_ne!(failed, sound, "{kind:?}");
            // P72: a fault without duration has no effect.
            assert_eq!(lengths(kind, 0.5, 20.0), sound, "{kind:?}");
        }
        let at = |kind, amount, k: usize| lengths(kind, amount, 40.0)[k];
        assert_eq!(at(FaultKind::Off, 0.0, 30), None);
        assert_eq!(at(FaultKind::Stuck, 0.0, 30), Some(19.0));
        assert_eq!(at(FaultKind::Delayed, 3.0, 30), Some(27.0));
        assert!((at(FaultKind::Wrong, 0.0, 30).unwrap() - 36.0).abs() < 1e-12);
        assert_eq!((at(FaultKind::Slow, 0.0, 30), at(FaultKind::Slow, 0.0, 31)), (Some(30.0), None));
        let lost = lengths(FaultKind::Intermittent, 0.5, 40.0).iter().filter(|length| length.is_none()).count();
        assert!((4..17).contains(&lost), "{lost}");
        // P72: a delay of zero has no effect.
        assert_eq!(lengths(FaultKind::Delayed, 0.0, 40.0), sound);
        assert_eq!(lengths(FaultKind::Intermittent, 0.0, 40.0), sound);
    }

    #[test]
    fn numbers_that_make_no_fault_are_rejected() {
        let fault = OdometryFault { kind: FaultKind::Intermittent, from: 0.0, to: 1.0, amount: 1.5 };
        assert_eq!(fault.check(0).unwrap_err(), "faults[0].amount = 1.5; give a number from 0 to 1");
        assert!(OdometryFault { from: f64::NAN, ..fault }.check(3).unwrap_err().starts_with("faults[3].from = NaN"));
    }
}
