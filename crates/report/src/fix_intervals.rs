//! The teeth of the saw: what happens between a fix and the next.

use seafix_log::{NavigationRecord, TruthRecord};

use crate::{navigation_quantity::Counted, place::matrix};

/// A navigated frame, as far as it says how the error grows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub(crate) stamp_ns: u64,
    /// Whether its pose rests on a fix of its own instant.
    pub(crate) fixed: bool,
    /// Where the left camera really is in the world (m).
    pub(crate) camera: [f64; 3],
    /// From where the camera really is to where the pose has it, in the frame of the pose's object (m).
    pub(crate) off: [f64; 3],
    /// The object that the pose is relative to, by any number of its own.
    pub(crate) object: u32,
}

/// From a fix to the last frame before the next one, before the pose is lost or the dive ends.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct FixInterval {
    /// The greatest error in it less the one at its fix (m).
    pub(crate) amplitude: f64,
    /// How far the error moved from its fix to its end, as a vector (m).
    pub(crate) drift: f64,
    /// How far the camera really went (m).
    pub(crate) path_length: f64,
    /// How long it took (s).
    pub(crate) seconds: f64,
}

/// Where a pose has the camera, less where it is, in the frame of its object; `None` without truth or pose.
pub(crate) fn off(truth: Option<&TruthRecord>, record: &NavigationRecord) -> Option<[f64; 3]> {
    let (truth, pose) = (truth?, record.pose.as_ref()?);
    let (_, world_from_object) = truth.world_from_object.iter().find(|(id, _)| *id == pose.object)?;
    let real = matrix(world_from_object).try_inverse()? * matrix(&truth.world_from_camera);
    Some(std::array::from_fn(|k| pose.object_from_camera[k][3] - real[(k, 3)]))
}

/// The step of a frame; `None` where it has no pose or no truth.
pub(crate) fn step(stamp_ns: u64, truth: Option<&TruthRecord>, record: &NavigationRecord, object: u32) -> Option<Step> {
    let off = off(truth, record)?;
    let camera = truth?.world_from_camera;
    let camera = [camera[0][3], camera[1][3], camera[2][3]];
    Some(Step { stamp_ns, fixed: Counted::Fix.holds(record), camera, off, object })
}

/// The teeth of the navigated frames in order of time; a fix that is followed by another, or by none, has none.
pub(crate) fn fix_intervals<'a>(steps: impl Iterator<Item = Option<&'a Step>>) -> Vec<FixInterval> {
    let mut fix_intervals = Vec::new();
    // The fix, the frame before, and the tooth so far.
    let mut open: Option<(&Step, &Step, FixInterval)> = None;
    for step in steps {
        open = match (open, step) {
            (Some((fix, before, fix_interval)), Some(step)) if !step.fixed && step.object == fix.object => {
                let fix_interval = FixInterval {
                    amplitude: fix_interval.amplitude.max(norm(step.off) - norm(fix.off)),
                    drift: distance(step.off, fix.off),
                    path_length: fix_interval.path_length + distance(step.camera, before.camera),
                    seconds: (step.stamp_ns - fix.stamp_ns) as f64 * 1e-9,
                };
                Some((fix, step, fix_interval))
            }
            (last, step) => {
                fix_intervals.extend(last.map(|(.., fix_interval)| fix_interval));
                step.filter(|step| step.fixed).map(|fix| (fix, fix, FixInterval::default()))
            }
        };
    }
    fix_intervals.extend(open.map(|(.., fix_interval)| fix_interval));
    fix_intervals.retain(|fix_interval| fix_interval.seconds > 0.0);
    fix_intervals
}

/// What the error drifts over the sum of all ways, or of all times; `None` where that is nothing.
pub(crate) fn drift(fix_intervals: &[FixInterval], over: fn(&FixInterval) -> f64) -> Option<f64> {
    let all: f64 = fix_intervals.iter().map(over).sum();
    (all > 0.0).then(|| fix_intervals.iter().map(|fix_interval| fix_interval.drift).sum::<f64>() / all)
}

fn norm(a: [f64; 3]) -> f64 {
    distance(a, [0.0; 3])
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: u64, fixed: bool, x: f64, off: f64) -> Option<Step> {
        let stamp_ns = second * 1_000_000_000;
        Some(Step { stamp_ns, fixed, camera: [x, 0.0, 0.0], off: [0.0, off, 0.0], object: 0 })
    }

    /// Two teeth, of 3 s and 6 m and of 1 s and 1 m; what follows a lost pose belongs to none, nor does a fix by itself.
    ///
    /// Seen to fail where a fix ends no tooth.
    #[test]
    fn a_saw_has_the_fix_intervals_between_its_fixes() {
        let steps = [
            at(0, false, 0.0, 9.0),
            at(1, true, 0.0, 0.01),
            at(2, false, 2.0, 0.04),
            at(3, false, 4.0, -0.08),
            at(4, false, 6.0, -0.05),
            at(5, true, 7.0, 0.02),
            at(6, true, 8.0, 0.03),
            at(7, false, 9.0, 0.01),
            None,
            at(9, false, 11.0, 5.0),
            at(10, true, 12.0, 0.0),
        ];
        let fix_intervals = fix_intervals(steps.iter().map(Option::as_ref));
        let rounded = |x: f64| (x * 1e9).round() / 1e9;
        let found: Vec<[f64; 4]> =
            fix_intervals.iter().map(|t| [t.amplitude, t.drift, t.path_length, t.seconds].map(rounded)).collect();
        assert_eq!(found, [[0.07, 0.06, 6.0, 3.0], [0.0, 0.02, 1.0, 1.0]]);
        assert_eq!(
            drift(&fix_intervals, |fix_interval| fix_interval.path_length).map(rounded),
            Some(rounded(0.08 / 7.0))
        );
        assert_eq!(drift(&fix_intervals, |fix_interval| fix_interval.seconds).map(rounded), Some(0.02));
        assert_eq!(drift(&[], |fix_interval| fix_interval.path_length), None);
    }
}
