//! Navigation between fixes: consistent, bounded, and robust against a wrong fix or a displaced object.

use nalgebra::Matrix6;
use proptest::prelude::*;
use seafix_component::Choice;
use seafix_evaluation::clopper_pearson;
use seafix_geometry::{Camera, Covariance6, Object, World};
use seafix_navigation::{
    ConsiderStates, Event, EveryFrame, FUSIONS, Fuse, Fusion, Interval, Navigated, Navigator, ObjectPlacement,
    ObjectPose, POLICIES, Policy, Situation, State,
};
use seafix_proptests::{cases, law, navigation_scenario::NavigationScenario, poses::pose, within};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Every policy asks for a fix before the first one, with an object in view.
///
/// Seen to fail with the comparison of the interval inverted.
#[test]
fn without_a_fix_every_policy_wants_one() {
    let none = Situation { seconds: f64::INFINITY, metres: f64::INFINITY, sigma: f64::INFINITY, in_view: true };
    for name in POLICIES.names() {
        assert!(POLICIES.build(&Choice::named(name)).unwrap().due(&none), "{name}");
    }
}

/// A policy that asks for a fix still asks when the fix is older, the path longer and the pose less certain.
///
/// Seen to fail with the comparison of the interval inverted.
#[test]
fn a_policy_does_not_change_its_mind() {
    let number = || prop_oneof![Just(0.0), 0.0..100.0];
    law(
        512,
        (number(), number(), 0.0..1.0, number(), number(), 0.0..1.0, any::<bool>()),
        |(t, s, g, dt, ds, dg, v)| {
            let now = Situation { seconds: t, metres: s, sigma: g, in_view: v };
            let later = Situation { seconds: t + dt, metres: s + ds, sigma: g + dg, in_view: v };
            for name in POLICIES.names() {
                let policy = POLICIES.build(&Choice::named(name)).unwrap();
                prop_assert!(!policy.due(&now) || policy.due(&later), "{name}");
            }
            Ok(())
        },
    );
}

/// The fusion of two poses does not depend on the frame of the object: T ↦ A T on both sides.
///
/// Seen to fail when the innovation is taken in the frame of the object.
#[test]
fn a_fusion_knows_no_origin() {
    let near = (pose::<Object, Camera>(5.0), proptest::array::uniform6(-3e-3..3e-3), pose::<Object, Object>(50.0));
    law(256, near, |(known, off, moved)| {
        let at =
            |object_from_camera, sigma| ObjectPose::new(object_from_camera, Covariance6::isotropic(0.5 * sigma, sigma));
        let fixed = known.perturbed(&off.into());
        for name in FUSIONS.names() {
            let fusion = FUSIONS.build(&Choice::named(name)).unwrap();
            let one = fusion.take(&at(known, 0.01), &at(fixed, 0.02));
            let two = fusion.take(&at(moved * known, 0.01), &at(moved * fixed, 0.02));
            let (Ok(one), Ok(two)) = (one, two) else {
                prop_assert!(false, "{name} rejects a consistent fix");
                return Ok(());
            };
            let apart = (moved * one.object_from_camera).error_to(&two.object_from_camera);
            within(name, apart.norm(), 1e-10)?;
            within(name, (one.covariance.matrix - two.covariance.matrix).amax(), 1e-14)?;
        }
        Ok(())
    });
}

/// P10. A pose passed to another object through the world and back is unchanged; exact surveys add no covariance.
///
/// Seen to fail when the two surveyed poses are exchanged.
#[test]
fn passing_there_and_back_changes_nothing() {
    let place = pose::<World, Object>(50.0);
    law(256, (pose::<Object, Camera>(5.0), place, pose::<World, Object>(50.0)), |(start, a, b)| {
        let exact =
            |world_from_object| ObjectPlacement { world_from_object, covariance: Covariance6::new(Matrix6::zeros()) };
        let places = [exact(a), exact(b)];
        let known = ObjectPose::new(start, Covariance6::isotropic(1e-3, 1e-2));
        let there = Navigated { object: 0, object_pose: known.clone() }.passed_to(1, &places);
        let world = a * start;
        within("there", (b * there.object_pose.object_from_camera).error_to(&world).norm(), 1e-10)?;
        let back = there.passed_to(0, &places).object_pose;
        within("back", back.object_from_camera.error_to(&start).norm(), 1e-10)?;
        within("covariance", (back.covariance.matrix - known.covariance.matrix).amax(), 1e-14)
    });
}

/// Mean NEES over dives and instants; each dive's mean counts once for the interval.
fn consistency(dives: u32, steps: usize) -> (f64, f64) {
    let (scenario, policy, fusion) = (NavigationScenario::default(), Interval { seconds: 20.0 }, Fuse::default());
    let mut means = Vec::new();
    for number in 0..dives.into() {
        let mut sailing = scenario.set_out(number);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
        let mut sum = 0.0;
        for step in 0..steps {
            let local = sailing.step();
            navigator.advance(1.0, Some(&local));
            if navigator.due(true) {
                navigator.fix(&sailing.fix((step / 30) % scenario.objects));
            }
            sum += sailing.nees(navigator.pose().expect("the first instant has a fix"));
        }
        means.push(sum / steps as f64);
    }
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// The navigated pose has consistent errors: the mean NEES of six degrees of freedom is within 4 of its own standard
/// errors of 6.
///
/// Seen to fail when a change of object ignores the survey.
#[test]
fn the_navigated_pose_has_a_consistent_covariance() {
    let dives = cases(100);
    let (mean, error) = consistency(dives, 300);
    println!("NEES over {dives} dives of 300 s: {mean:.3} ± {error:.3}");
    assert!((mean - 6.0).abs() < 4.0 * error, "{mean} ± {error}");
}

/// NEES over dives past three objects and back, with fixes by points: the mean of all dives and instants, and the
/// fraction of instants at which the mean of the dives is within its 95 % bounds.
fn navigated_errors(dives: u32, policy: &dyn Policy, fusion: &dyn Fusion, consider_states: bool) -> (f64, f64) {
    const STEPS: usize = 160;
    let scenario = NavigationScenario { objects: 3, meander: 0.0, ..NavigationScenario::default() };
    let mut sums = [0.0; STEPS];
    for number in 0..dives.into() {
        let mut sailing = scenario.set_out(number);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), policy, fusion);
        for (step, sum) in sums.iter_mut().enumerate() {
            if step == STEPS / 2 {
                sailing.turn_about();
            }
            let local = sailing.step();
            navigator.advance(1.0, Some(&local));
            let mut fixes: Vec<Navigated> =
                (0..scenario.objects).filter_map(|object| sailing.observe(object)).collect();
            if !consider_states {
                fixes.iter_mut().for_each(|fix| {
                    fix.object_pose = fix.object_pose.clone().with_consider_states(ConsiderStates::default())
                });
            }
            if step == 0 || navigator.due(!fixes.is_empty()) {
                fixes.iter().for_each(|fix| drop(navigator.fix(fix)));
            }
            *sum += sailing.nees(navigator.pose().expect("the first object is in view at first"));
        }
    }
    let n = f64::from(dives);
    let all = ChiSquared::new(6.0 * n).expect("a positive number of degrees of freedom");
    let bounds = [0.025, 0.975].map(|p| all.inverse_cdf(p));
    let within = sums.iter().filter(|sum| **sum >= bounds[0] && **sum <= bounds[1]).count();
    (sums.iter().sum::<f64>() / STEPS as f64 / n, within as f64 / STEPS as f64)
}

/// Common errors of a model are learned from no fix, however frequent, and the surveys' errors of a change of object
/// cancel on the return. The mean NEES of `fuse` and of the paper's `replace` is within its 95 % bounds for every
/// policy and for fixes every frame, every 10 s and every 40 s, and at nine instants of ten. With the shared errors
/// known, `fuse` is not overconfident even with the most fixes; with fixes taken as independent it is, by far.
///
/// Seen to fail when the fixes' correlation by the model's errors is ignored: 28 instead of 6 with a fix every frame.
#[test]
fn what_a_model_has_wrong_is_not_learned_from_many_fixes() {
    let dives = cases(100);
    // 95 % bounds of a mean of χ² of six degrees of freedom.
    let bound = 1.96 * (12.0 / f64::from(dives)).sqrt();
    let intervals = [0.0, 10.0, 40.0].map(|seconds| Choice::named("interval").with("seconds", seconds));
    for choice in POLICIES.names().map(Choice::named).chain(intervals) {
        let policy = POLICIES.build(&choice).unwrap();
        for name in ["fuse", "replace"] {
            let fusion = FUSIONS.build(&Choice::named(name)).unwrap();
            let (mean, within) = navigated_errors(dives, &*policy, &*fusion, true);
            println!("{choice:?} {name}: NEES {mean:.2}, within its bounds at {within:.2} of the instants");
            assert!((mean - 6.0).abs() < bound && within >= 0.9, "{choice:?} {name}: {mean} {within}");
        }
    }
    let (alone, _) = navigated_errors(dives, &EveryFrame::default(), &Fuse::default(), false);
    println!("taken as independent: NEES {alone:.2}");
    assert!(alone > 12.0, "{alone}");
}

/// Mean NEES at the end of dives that stay at one object, with a fix a second for a minute.
fn stayed(dives: u32, fusion: &str, shared: f64) -> f64 {
    let scenario = NavigationScenario { objects: 1, shared, ..NavigationScenario::default() };
    let (policy, fusion) = (Interval { seconds: 1.0 }, FUSIONS.build(&Choice::named(fusion)).expect("it is listed"));
    let mut sum = 0.0;
    for number in 0..dives.into() {
        let mut sailing = scenario.set_out(number);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &*fusion);
        for _ in 0..60 {
            navigator.advance(1.0, Some(&sailing.step()));
            navigator.fix(&sailing.fix(0));
        }
        sum += sailing.nees(navigator.pose().expect("it has fixes"));
    }
    sum / f64::from(dives)
}

/// Covariance intersection is never overconfident with unknown correlations of the fixes of an object; `fuse` takes the
/// fixes as independent and is overconfident.
///
/// Seen to fail when the intersection weights both with one.
#[test]
fn shared_errors_do_not_add_up_to_certainty() {
    let dives = cases(100);
    for shared in [0.0, 0.5, 0.9] {
        let (intersected, fused) = (stayed(dives, "intersect", shared), stayed(dives, "fuse", shared));
        println!(
            "NEES after a minute, fraction {shared} of the variance shared: intersect {intersected:.1}, fuse {fused:.1}"
        );
        // Six on average, plus three standard errors.
        assert!(intersected < 6.0 + 3.0 * (12.0 / f64::from(dives)).sqrt(), "{shared}: {intersected}");
        assert!(shared == 0.0 || fused > 12.0, "{shared}: {fused}");
    }
}

/// A fix of another object that is far less accurate than the carried pose leaves the pose at its object.
///
/// Seen to fail when every fix changes the object.
#[test]
fn a_poor_observation_moves_no_pose() {
    let scenario = NavigationScenario { survey: (0.02, 0.05), ..NavigationScenario::default() };
    let mut sailing = scenario.set_out(0);
    let (policy, fusion) = (Interval { seconds: 1.0 }, FUSIONS.build(&Choice::named("intersect")).unwrap());
    let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &*fusion);
    navigator.fix(&sailing.fix(0));
    let before = navigator.pose().unwrap().clone();
    let good = sailing.fix(1);
    let poor = ObjectPose::new(good.object_pose.object_from_camera, Covariance6::isotropic(0.1, 0.5));
    assert_eq!(navigator.fix(&Navigated { object_pose: poor, object: good.object }), Event::LessAccurate);
    assert_eq!(navigator.pose(), Some(&before));
    assert_eq!(navigator.fix(&good), Event::Taken);
    assert_eq!(navigator.pose().unwrap().object, 1);
}

/// Errors over 5 km with a fix every `every` seconds: RMS of the first and of the last third over the dives, and the
/// slope (m per km) with its standard error.
fn far(dives: u64, every: f64, steps: usize) -> (f64, f64, f64, f64) {
    let (scenario, policy, fusion) = (
        NavigationScenario { objects: 1, ..NavigationScenario::default() },
        Interval { seconds: every },
        Fuse::default(),
    );
    let (mut slopes, mut first, mut last) = (Vec::new(), 0.0, 0.0);
    for number in 0..dives {
        let mut sailing = scenario.set_out(number);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for step in 0..steps {
            let local = sailing.step();
            navigator.advance(1.0, Some(&local));
            if navigator.due(true) {
                navigator.fix(&sailing.fix(0));
            }
            // The position error in the camera's surroundings, not about a far origin.
            let known = navigator.pose().expect("the first instant has a fix");
            let error = known.object_pose.object_from_camera.error_to(&sailing.truth(0));
            xs.push(step as f64 * scenario.step * 1e-3);
            ys.push(error.fixed_rows::<3>(3).norm());
        }
        let third = steps / 3;
        let square = |part: &[f64]| part.iter().map(|y| y * y).sum::<f64>() / part.len() as f64;
        first += square(&ys[..third]) / dives as f64;
        last += square(&ys[steps - third..]) / dives as f64;
        let (mx, my) = (xs.iter().sum::<f64>() / steps as f64, ys.iter().sum::<f64>() / steps as f64);
        let sxy: f64 = xs.iter().zip(&ys).map(|(x, y)| (x - mx) * (y - my)).sum();
        let sxx: f64 = xs.iter().map(|x| (x - mx).powi(2)).sum();
        slopes.push(sxy / sxx);
    }
    let n = dives as f64;
    let slope = slopes.iter().sum::<f64>() / n;
    let error = (slopes.iter().map(|s| (s - slope).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    (first.sqrt(), last.sqrt(), slope, error)
}

/// The error does not grow over 5 km with a fix every 40 s: the interval of the slope contains zero. It grows without
/// fixes.
///
/// Seen to fail when later fixes are ignored.
#[test]
fn fixes_bound_the_error_over_any_distance() {
    let steps = (5000.0 / NavigationScenario::default().step) as usize;
    let (first, last, slope, error) = far(20, 40.0, steps);
    println!(
        "fix every 40 s, 5 km: RMS {first:.4} m in the first third, {last:.4} m in the last; slope {slope:.2e} ± {error:.1e} m/km"
    );
    assert!(slope.abs() < 3.0 * error, "{slope} ± {error}");
    let (first, last, slope, error) = far(20, f64::INFINITY, steps);
    println!("one fix, 5 km: RMS {first:.4} m, {last:.4} m; slope {slope:.2e} ± {error:.1e} m/km");
    assert!(slope > 5.0 * error && last > 3.0 * first);
}

/// Without fixes on a straight path the attitude error grows like √n and the position error like n^1.5: twice the path
/// multiplies them by √2 and √8.
///
/// Seen to fail when the covariance is not rotated with the motion.
#[test]
fn dead_reckoning_grows_as_predicted() {
    let scenario = NavigationScenario {
        objects: 1,
        odometry: (1e-4, 0.0),
        fix: (1e-9, 1e-9),
        meander: 0.0,
        ..NavigationScenario::default()
    };
    let spread = |steps: usize| {
        let (mut real, mut message) = ([0.0; 2], [0.0; 2]);
        for number in 0..300 {
            let mut sailing = scenario.set_out(number);
            let mut known = sailing.fix(0);
            for _ in 0..steps {
                known = known.after(&sailing.step());
            }
            let error = known.object_pose.object_from_camera.error_to(&sailing.truth(0));
            real[0] += error.fixed_rows::<3>(0).norm_squared();
            real[1] += error.fixed_rows::<3>(3).norm_squared();
            message[0] += known.object_pose.covariance.attitude_rms().powi(2);
            message[1] += known.object_pose.covariance.position_rms().powi(2);
        }
        (
            [(real[0] / 300.0).sqrt(), (real[1] / 300.0).sqrt()],
            [(message[0] / 300.0).sqrt(), (message[1] / 300.0).sqrt()],
        )
    };
    let ((short, short_said), (long, long_said)) = (spread(400), spread(800));
    for i in 0..2 {
        assert!((short[i] / short_said[i] - 1.0).abs() < 0.15 && (long[i] / long_said[i] - 1.0).abs() < 0.15);
    }
    println!("attitude × {:.3} (√2 = 1.414), position × {:.3} (√8 = 2.828)", long[0] / short[0], long[1] / short[1]);
    assert!((long[0] / short[0] - 2f64.sqrt()).abs() < 0.15 && (long[1] / short[1] - 8f64.sqrt()).abs() < 0.3);
}

/// The number of `dives` dives that reject one wrong fix and keep their pose.
fn unmoved_by_one_wrong_fix(dives: u64) -> u64 {
    let (scenario, policy, fusion) = (NavigationScenario::default(), Interval { seconds: 10.0 }, Fuse::default());
    let mut unmoved = 0;
    for number in 0..dives {
        let mut sailing = scenario.set_out(number);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
        navigator.advance(1.0, Some(&sailing.step()));
        for _ in 0..3 {
            navigator.fix(&sailing.fix(0));
            navigator.advance(1.0, Some(&sailing.step()));
        }
        let before = sailing.off(navigator.pose().expect("fixed"));
        let event = navigator.fix(&sailing.wrong_fix(0, 2.0));
        let after = sailing.off(navigator.pose().expect("fixed"));
        unmoved += u64::from(matches!(event, Event::Doubted(_)) && before == after);
    }
    unmoved
}

/// `fuse` rejects one wrong fix.
///
/// Seen to fail with a gate that accepts everything.
#[test]
fn one_wrong_fix_is_rejected() {
    let unmoved = unmoved_by_one_wrong_fix(2000);
    println!("{unmoved} of 2000 wrong fixes rejected, interval {:?}", clopper_pearson(unmoved as usize, 2000, 0.95));
    assert!(unmoved >= 1998);
}

/// For dives past `objects` objects with each in turn displaced: the number of dives that report it, that leave open
/// which of two is displaced, and of reports that name another.
fn displaced(dives: u64, objects: usize, metres: f64, fusion: Fuse) -> [u64; 3] {
    let (scenario, policy) =
        (NavigationScenario { objects, ..NavigationScenario::default() }, Interval { seconds: 5.0 });
    let (mut reported, mut open, mut false_reports) = (0, 0, 0);
    for number in 0..dives {
        let mut sailing = scenario.set_out(number);
        let moved = (number as usize) % objects;
        // A displaced object is also rotated, however small its shift.
        if metres > 0.0 {
            sailing.displace(moved, metres);
        }
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
        let (mut named, mut disputed) = (false, false);
        for step in 0..30 * objects {
            let local = sailing.step();
            navigator.advance(1.0, Some(&local));
            if navigator.due(true) {
                match navigator.fix(&sailing.fix(step / 30)) {
                    Event::Displaced(found) => {
                        named |= found.object == moved;
                        false_reports += u64::from(found.object != moved || metres == 0.0);
                    }
                    Event::Disputed { objects, .. } => disputed |= objects.contains(&moved),
                    _ => {}
                }
            }
        }
        reported += u64::from(named);
        open += u64::from(disputed && !named);
    }
    [reported, open, false_reports]
}

/// A displaced object is reported, also if it has the first fix, and moves no other object.
///
/// Seen to fail when doubted fixes are forgotten between two fixes, and when the later of two unconfirmed objects is
/// called displaced.
#[test]
fn a_displaced_object_is_reported() {
    for metres in [0.1, 0.2, 0.5] {
        for objects in [3, 5] {
            let [reported, open, false_reports] = displaced(200, objects, metres, Fuse::default());
            let frames = 200 * 30 * objects;
            println!(
                "displaced by {metres} m, {objects} objects: {reported} of 200 reported, {open} left open, {false_reports} \
                 false reports in {frames} frames"
            );
            assert!(1000 * false_reports < frames as u64);
            assert!(reported >= 198);
        }
    }
    let [.., false_reports] = displaced(200, 5, 0.0, Fuse::default());
    println!("nothing displaced: {false_reports} false reports in 30 000 frames");
    assert!(false_reports < 30);
}

/// The two laws above over many dives, for narrow intervals: 999 of 1000 wrong fixes are rejected, and 99 of 100
/// displaced objects reported, with less than one false report in 1000 frames. A displacement of 0.1 m is some five
/// standard deviations of survey and odometry over the route; a gate that one right fix in ten thousand fails would
/// report 98.6 of 100.
#[test]
#[ignore = "long: 50 000 dives"]
fn wrong_fixes_and_displaced_objects_in_many_dives() {
    let unmoved = unmoved_by_one_wrong_fix(20_000);
    let rejected = clopper_pearson(unmoved as usize, 20_000, 0.95);
    println!("{unmoved} of 20 000 wrong fixes rejected, interval {rejected:.5?}");
    assert!(rejected.0 >= 0.999);
    for (objects, metres) in [3, 5].into_iter().flat_map(|objects| [0.1, 0.2, 0.5].map(|metres| (objects, metres))) {
        let [reported, open, false_reports] = displaced(5000, objects, metres, Fuse::default());
        let fraction = clopper_pearson(reported as usize, 5000, 0.95);
        let frames = 5000 * 30 * objects;
        println!(
            "displaced by {metres} m, {objects} objects: {reported} of 5000 reported, interval {fraction:.4?}, {open} left open; \
             {false_reports} false reports in {frames} frames"
        );
        assert!(reported as f64 >= 0.99 * 5000.0);
        assert!(clopper_pearson(false_reports as usize, frames, 0.95).1 < 1e-3);
    }
}

/// Two inconsistent objects without a third: neither is called displaced. The inconsistency is reported, the pose at
/// each is that without the other, and both keep their surveyed poses.
///
/// Seen to fail when the later of two unconfirmed objects is called displaced.
#[test]
fn without_a_third_none_of_two_is_blamed() {
    let (scenario, policy, fusion) = (
        NavigationScenario { objects: 2, ..NavigationScenario::default() },
        Interval { seconds: 5.0 },
        Fuse::default(),
    );
    let mut n_reported = 0;
    for number in 0..200 {
        let mut sailing = scenario.set_out(number);
        sailing.displace(number as usize % 2, 0.3);
        let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
        let mut disputed = 0;
        for step in 0..120 {
            if step == 60 {
                sailing.turn_about();
            }
            navigator.advance(1.0, Some(&sailing.step()));
            if navigator.due(true) {
                let event = navigator.fix(&sailing.fix(usize::from((30..90).contains(&step))));
                assert!(!matches!(event, Event::Displaced(_)), "dive {number}, step {step}: {event:?}");
                disputed += u64::from(matches!(event, Event::Disputed { .. }));
                let off = sailing.off(navigator.pose().expect("it has fixes"));
                assert!(off < 0.1 || matches!(event, Event::Doubted(_)), "dive {number}, step {step}: {off} m");
            }
        }
        assert_eq!(navigator.places(), sailing.surveyed);
        assert!(disputed == 0 || navigator.is_disputed(0) && navigator.is_disputed(1));
        n_reported += u64::from(disputed == 1);
    }
    println!("{n_reported} of 200 reported once");
    assert!(n_reported >= 198);
}

/// A lost odometry carries nothing across, and the log has the reason.
///
/// Seen to fail when the last fix survives a break.
#[test]
fn a_break_is_no_motion() {
    let (scenario, policy, fusion) = (NavigationScenario::default(), Interval { seconds: 5.0 }, Fuse::default());
    let mut sailing = scenario.set_out(0);
    let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
    assert_eq!(navigator.state(), State::Prior);
    assert!(navigator.due(true) && navigator.state() == State::Searching);
    navigator.fix(&sailing.fix(0));
    navigator.advance(1.0, Some(&sailing.step()));
    assert_eq!(navigator.state(), State::DeadReckoning);
    navigator.advance(1.0, None);
    assert_eq!((navigator.state(), navigator.pose()), (State::Prior, None));
    let states: Vec<State> = navigator.changes().iter().map(|change| change.to).collect();
    assert_eq!(states, [State::Searching, State::Fixed, State::DeadReckoning, State::Prior]);
    assert!(navigator.changes().iter().all(|change| !change.why.is_empty()));
}

/// The state is `searching` exactly while a fix is due and an object should be in view without a fix, also after dead
/// reckoning. Images without a motion leave the pose unchanged, and the fix stays due.
///
/// Seen to fail when only a prior pose can search.
#[test]
fn the_state_is_the_configured_one() {
    use State::{DeadReckoning, Fixed, Searching};
    let (scenario, policy, fusion) = (NavigationScenario::default(), Interval { seconds: 1.5 }, Fuse::default());
    let mut sailing = scenario.set_out(0);
    let mut navigator = Navigator::new(sailing.surveyed.clone(), &policy, &fusion);
    assert!(!navigator.due_without_motion(0.0, false) || navigator.state() == State::Prior);
    navigator.fix(&sailing.fix(0));
    assert!(
        !navigator.due_without_motion(1.0, true) && navigator.state() == State::DeadReckoning,
        "a fix of another instant"
    );
    assert!(
        navigator.due_without_motion(2.0, true)
            && navigator.state() == State::DeadReckoning
            && navigator.pose().is_some()
    );
    let mut states = Vec::new();
    for (in_view, fixed) in [(true, false), (true, false), (true, false), (false, false), (true, false), (true, true)] {
        navigator.advance(1.0, Some(&sailing.step()));
        navigator.due(in_view);
        if fixed {
            navigator.fix(&sailing.fix(0));
        }
        states.push(navigator.state());
    }
    assert_eq!(states, [DeadReckoning, Searching, Searching, DeadReckoning, Searching, Fixed]);
    // Each change is reported once, from the previous state.
    let changes = navigator.changes();
    assert!(changes.windows(2).all(|two| two[0].to == two[1].from && !two[1].why.is_empty()), "{changes:?}");
}
