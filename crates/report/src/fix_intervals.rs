//! Fix intervals: the growth of the pose error between fixes.

use seafix_log::{NavigationRecord, TruthRecord};

use crate::{navigation_quantity::Counted, place::matrix};

/// The pose error of a navigated frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub(crate) stamp_ns: u64,
    /// Whether the pose is a fix of the same frame.
    pub(crate) fixed: bool,
    /// The true position of the left camera in the world (m).
    pub(crate) camera: [f64; 3],
    /// The position error vector of the camera in the frame of the pose's object (m): estimate less truth.
    pub(crate) off: [f64; 3],
    /// An index that identifies the object to which the pose is relative.
    pub(crate) object: u32,
}

/// The time from a fix to the last frame before the next fix.
///
/// It also ends before the pose is lost, and at the end of the dive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct FixInterval {
    /// The largest position error of the interval less the error at its fix (m).
    pub(crate) amplitude: f64,
    /// The length of the change of the error vector over the interval (m).
    pub(crate) drift: f64,
    /// The true path length of the camera (m).
    pub(crate) path_length: f64,
    /// The duration (s).
    pub(crate) seconds: f64,
}

/// The position error vector of the camera in the frame of the pose's object (m).
///
/// The result is `None` without ground truth or pose.
pub(crate) fn off(truth: Option<&TruthRecord>, record: &NavigationRecord) -> Option<[f64; 3]> {
    let (truth, pose) = (truth?, record.pose.as_ref()?);
    let (_, world_from_object) = truth.world_from_object.iter().find(|(id, _)| *id == pose.object)?;
    let real = matrix(world_from_object).try_inverse()? * matrix(&truth.world_from_camera);
    Some(std::array::from_fn(|k| pose.object_from_camera[k][3] - real[(k, 3)]))
}

/// The pose error of a frame; `None` without a pose or ground truth.
pub(crate) fn step(stamp_ns: u64, truth: Option<&TruthRecord>, record: &NavigationRecord, object: u32) -> Option<Step> {
    let off = off(truth, record)?;
    let camera = truth?.world_from_camera;
    let camera = [camera[0][3], camera[1][3], camera[2][3]];
    Some(Step { stamp_ns, fixed: Counted::Fix.holds(record), camera, off, object })
}

/// The fix intervals of the navigated frames, in order of time.
///
/// A fix followed directly by another fix has none.
pub(crate) fn fix_intervals<'a>(steps: impl Iterator<Item = Option<&'a Step>>) -> Vec<FixInterval> {
    let mut fix_intervals = Vec::new();
    // The open interval: its fix, the previous frame, and the values so far.
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

/// The sum of all drifts divided by the sum of `over`, path length or time.
///
/// The result is `None` if the latter is zero.
pub(crate) fn drift(fix_intervals: &[FixInterval], over: fn(&FixInterval) -> f64) -> Option<f64> {
    let all: f64 = fix_intervals.iter().map(over).sum();
    (all > 0.0).then(|| fix_intervals.iter().map(|fix_interval| fix_interval.drift).sum::<f64>() / all)
}

/// The smallest and the largest drift per metre of single fix intervals; `None` if none has a path.
pub(crate) fn extreme_drifts(fix_intervals: &[FixInterval]) -> Option<[f64; 2]> {
    let moving = fix_intervals.iter().filter(|fix_interval| fix_interval.path_length > 0.0);
    let drifts: Vec<f64> = moving.map(|fix_interval| fix_interval.drift / fix_interval.path_length).collect();
    Some([drifts.iter().copied().reduce(f64::min)?, drifts.iter().copied().reduce(f64::max)?])
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

    /// Two intervals, one of 3 s and 6 m, one of 1 s and 1 m. Frames after a lost pose belong to no interval, and a
    /// lone fix has none.
    ///
    /// Seen to fail where a fix does not end an interval.
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
        assert_eq!(extreme_drifts(&fix_intervals).map(|ends| ends.map(rounded)), Some([0.01, 0.02]));
        assert_eq!(extreme_drifts(&[]), None);
        assert_eq!(drift(&[], |fix_interval| fix_interval.path_length), None);
    }
}
