//! Camera faults.

use seafix_vision::{Image, Threads};

use super::{plan::PlannedMission, rig::RigPlan, settings::Mission};
use crate::sensors::{DeviceFault, FaultKind, FaultyDevice};

/// A mission of twelve frames at 5 Hz; the fault is active from the fifth to the tenth.
fn planned(faults: Vec<DeviceFault>) -> PlannedMission {
    let rig = RigPlan { size: [64, 48], focal: 31.0, ..RigPlan::default() };
    super::tests::planned(&Mission { frames: 12, rate: 5.0, start: 3.0, rig, faults, ..Mission::default() })
}

fn images(plan: &PlannedMission) -> Vec<(Image, Image)> {
    let pair = |index| {
        let (left, right, _) = plan.instant(index).render(Threads::One);
        (left, right)
    };
    (0..plan.len()).map(pair).collect()
}

fn failing(kind: FaultKind, amount: f64) -> Vec<(Image, Image)> {
    images(&planned(vec![DeviceFault { device: FaultyDevice::Images, kind, from: 3.95, to: 4.95, amount }]))
}

#[test]
fn cameras_fail_as_reported() {
    let sound = images(&planned(Vec::new()));
    let black = |image: &Image| image.pixels().iter().all(|grey| *grey == 0.0);
    for (kind, amount) in [
        (FaultKind::Off, 0.0),
        (FaultKind::Stuck, 0.0),
        (FaultKind::Garbage, 0.0),
        (FaultKind::Wrong, 0.0),
        (FaultKind::Slow, 0.0),
        (FaultKind::Delayed, 0.4),
        (FaultKind::Intermittent, 0.5),
    ] {
        let failed = failing(kind, amount);
        let acting = 5..10;
        for k in 0..12 {
            if !acting.contains(&k) {
                assert!(failed[k] == sound[k], "{kind:?} acts at frame {k}");
            }
        }
        let each = |is: &dyn Fn(usize) -> bool| assert!(acting.clone().all(is), "{kind:?}");
        match kind {
            FaultKind::Off => each(&|k| black(&failed[k].0) && black(&failed[k].1)),
            FaultKind::Stuck => each(&|k| failed[k] == sound[5]),
            FaultKind::Garbage => {
                each(&|k| failed[k].0 != failed[k].1 && failed[k] != failed[k - 1]);
                // A uniform distribution over all levels has a mean of 127.5 and a standard deviation of 74.
                let pixels = failed[6].0.pixels();
                let mean = pixels.iter().sum::<f32>() / pixels.len() as f32;
                assert!((mean - 127.5).abs() < 5.0, "{mean}");
            }
            FaultKind::Wrong => each(&|k| (&failed[k].0, &failed[k].1) == (&sound[k].1, &sound[k].0)),
            FaultKind::Slow => each(&|k| failed[k] == sound[k - k % 5]),
            // The view of two frames ago with new noise: nearer to that view than to the current one.
            FaultKind::Delayed => each(&|k| {
                let far = |other: &Image| {
                    let pixels = failed[k].0.pixels().iter().zip(other.pixels());
                    pixels.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
                };
                far(&sound[k - 2].0) < 0.7 * far(&sound[k].0)
            }),
            FaultKind::Intermittent => {
                each(&|k| failed[k] == sound[k] || black(&failed[k].0));
                let lost = acting.clone().filter(|k| black(&failed[*k].0)).count();
                assert!((1..5).contains(&lost), "{lost}");
            }
        }
    }
}

#[test]
fn the_truth_does_not_fail() {
    // Stamps, poses and visible points do not change with the camera fault, because they are the evaluation's truth.
    let fault =
        DeviceFault { device: FaultyDevice::Images, kind: FaultKind::Delayed, from: 0.0, to: 99.0, amount: 0.4 };
    let (sound, failed) = (planned(Vec::new()), planned(vec![fault]));
    for index in 0..12 {
        let (a, b) = (sound.instant(index), failed.instant(index));
        assert_eq!((a.stamp_ns, a.prior, a.truth()), (b.stamp_ns, b.prior, b.truth()));
    }
}

#[test]
fn points_fail_as_images_do() {
    let points = |kind, amount| {
        let faults = vec![DeviceFault { device: FaultyDevice::Images, kind, from: 3.95, to: 4.95, amount }];
        let plan = planned(faults);
        (0..12).map(|k| plan.instant(k).points()).collect::<Vec<_>>()
    };
    let sound: Vec<_> = (0..12).map(|k| planned(Vec::new()).instant(k).points()).collect();
    assert!(sound.iter().all(|points| points.len() > 10));
    assert!(points(FaultKind::Delayed, 0.0) == sound && points(FaultKind::Intermittent, 0.0) == sound);
    for k in 5..10 {
        assert!(points(FaultKind::Off, 0.0)[k].is_empty() && points(FaultKind::Wrong, 0.0)[k].is_empty());
        assert!(points(FaultKind::Stuck, 0.0)[k] == sound[5] && points(FaultKind::Slow, 0.0)[k] == sound[5]);
        let garbage = &points(FaultKind::Garbage, 0.0)[k];
        assert!(garbage.len() > 10 && *garbage != sound[k]);
    }
}
