//! Every search: clutter that resembles the object gets no fix.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_component::Choice;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_proptests::clutter_patterns::{ClutterPattern, scene};
use seafix_referencing::{
    Acceptance, Attempt, Candidates, Gate, Mahalanobis, MaxPWrong, ModelPoint, Outcome, Prior, PriorBound, Problem,
    SEARCHES, Search, Tolerance, candidates, compute_fix, rms_apart,
};

/// Numbers of answers and wrong ones over the scenes.
fn answered(
    name: &str,
    max_p_wrong: MaxPWrong,
    clutter_pattern: ClutterPattern,
    visible: usize,
    scenes: u64,
) -> (usize, usize) {
    let search = SEARCHES.build(&Choice::named(name)).expect("it is listed");
    let acceptance = Acceptance { max_p_wrong, ..Acceptance::default() };
    let (mut answers, mut wrong) = (0, 0);
    for seed in 0..scenes {
        let scene = scene(clutter_pattern, visible, seed);
        let problem = scene.problem();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let attempt = compute_fix(&problem, &*search, &Mahalanobis::default(), &acceptance, None, &mut rng);
        if let Outcome::Fix(fix) = attempt.outcome {
            answers += 1;
            wrong += usize::from(
                visible == 0 || rms_apart(problem.model, &fix.object_from_camera, &scene.planted.pose) > 0.05,
            );
        }
    }
    (answers, wrong)
}

#[test]
#[ignore = "table"]
fn what_structured_clutter_are_answered() {
    let names = std::env::var("IMITATION_SEARCHES").unwrap_or_else(|_| "rigid-consensus".to_owned());
    let scenes = std::env::var("IMITATION_SCENES").map_or(300, |n| n.parse().expect("a number"));
    for name in names.split(',') {
        for clutter_pattern in ClutterPattern::ALL {
            for visible in [0, 5, 8, 10] {
                println!(
                    "{name} {clutter_pattern:?} visible {visible}: {:?} of {scenes}",
                    answered(name, MaxPWrong::Balanced, clutter_pattern, visible, scenes)
                );
            }
        }
    }
}

/// Clutter of the lattice that continues the object, of points measured twice, and clumped about the predicted
/// positions is not taken for the object.
///
/// At a limit of 1e-3 two fixes in 160 scenes have a probability of 1 %, three of 0.06 %. At `strict` there is none.
#[test]
fn clutter_that_resembles_the_object_is_not_fixed() {
    for (clutter_pattern, scenes, accidents) in
        [(ClutterPattern::Gaps, 32, 0), (ClutterPattern::Doubles, 160, 0), (ClutterPattern::Clumped, 160, 2)]
    {
        let count = |max_p_wrong| answered("rigid-consensus", max_p_wrong, clutter_pattern, 0, scenes).0;
        assert_eq!(count(MaxPWrong::Strict), 0, "{clutter_pattern:?}");
        assert!(count(MaxPWrong::Balanced) <= accidents, "{clutter_pattern:?}");
    }
}

/// The measurements of an object with `n` points and of its surroundings; in m, noise 1 cm.
struct Shown {
    points: Vec<Vector3<f64>>,
    camera_from_object: Transform<Camera, Object>,
    /// Half-size of the gates; `None` without a prior.
    half: Option<f64>,
    cloud: Vec<Vector3<f64>>,
}

impl Shown {
    fn new(n: usize, half: Option<f64>, place: &mut impl FnMut(f64) -> Vector3<f64>) -> Self {
        let points = (0..n).map(|_| place(0.75)).collect();
        let at = Vector3::new(0.0, 0.0, 4.0) + place(0.5);
        Self { points, camera_from_object: Transform::new(so3::exp(&place(1.8)), at), half, cloud: Vec::new() }
    }

    /// The first `count` of its points, moved in the object's frame, with noise.
    fn shows(
        &mut self,
        count: usize,
        moved: impl Fn(&Vector3<f64>) -> Vector3<f64>,
        mut error: impl FnMut() -> Vector3<f64>,
    ) {
        let seen = self.points.iter().take(count).map(|at| self.camera_from_object * Point::from(moved(at)));
        self.cloud.extend(seen.map(|at| at.coords + error()));
    }

    fn attempt(&self, search: &dyn Search, acceptance: &Acceptance) -> Attempt {
        let model: Vec<ModelPoint> = self.points.iter().map(|at| ModelPoint::exact("P", Point::from(*at))).collect();
        let measured = |at: &Vector3<f64>| MeasuredPoint {
            position: UncertainPoint::isotropic(Point::from(*at), 0.01),
            pixels: None,
        };
        let cloud: Vec<MeasuredPoint> = self.cloud.iter().map(measured).collect();
        let object_from_camera = self.camera_from_object.inverse();
        let prior = self.half.map(|half| Prior { object_from_camera, bound: PriorBound::Box(half) });
        let prior = prior.as_ref();
        let candidates = candidates(&model, &cloud, prior, &Gate::default(), None);
        let tolerance = Tolerance::Fixed(0.0424);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior,
            edges: Default::default(),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        compute_fix(&problem, search, &Mahalanobis::default(), acceptance, None, &mut rng)
    }
}

/// An object a twentieth or a tenth larger or smaller is rarely answered, since four or five of its points are within
/// noise of the model's. No search answers with a set whose probability of being wrong, or whose NFA,
/// exceeds `acceptance.max_p_wrong`.
///
/// Seen to fail when the NFA is not tested for searches by evidence.
#[test]
fn a_random_set_is_no_answer() {
    let acceptance = Acceptance::default();
    // These reach their budget, which takes seconds.
    let enumerates = |name: &&str| ["complete-enumeration", "structural-coherence"].contains(name);
    for name in SEARCHES.names().filter(|name| !enumerates(name)) {
        let search = SEARCHES.build(&Choice::named(name)).expect("it is listed");
        let mut answers = 0;
        for seed in 0..60 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
            let mut shown = Shown::new(8, Some(0.5), &mut place);
            let scale = [0.9, 0.95, 1.05, 1.1][seed as usize % 4];
            shown.shows(8, |at| at * scale, || place(0.017));
            (0..3).for_each(|_| shown.shows(8, |at| *at, || place(0.5)));
            let attempt = shown.attempt(&*search, &acceptance);
            if matches!(attempt.outcome, Outcome::Fix(_)) {
                answers += 1;
                let expected = attempt.nfa.expect("a search found it");
                let odds = acceptance.max_p_wrong.value() / (1.0 - acceptance.max_p_wrong.value());
                assert!(expected <= odds, "{name} {seed}: NFA {expected}");
                let p_wrong = attempt.p_wrong.expect("a search found it");
                assert!(acceptance.max_p_wrong.allows(p_wrong), "{name} {seed}: {p_wrong}");
            }
        }
        assert!(answers < 12, "{name}: {answers} of 60");
    }
}

/// A smaller second copy of the object is reported: its points would suffice for acceptance by themselves.
///
/// Seen to fail when no second copy is accepted.
#[test]
fn a_smaller_copy_is_not_passed_over() {
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let points: Vec<Vector3<f64>> = (0..20).map(|_| place(1.0)).collect();
        let poses =
            [-1.6, 1.6].map(|x| Transform::<Camera, Object>::new(so3::exp(&place(0.5)), Vector3::new(x, 0.0, 6.0)));
        let seen = points.iter().map(|at| (0, at)).chain(points.iter().take(12).map(|at| (1, at)));
        let cloud: Vec<MeasuredPoint> = seen
            .map(|(copy, at)| (poses[copy] * Point::from(*at)).coords + place(0.01))
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(Point::from(at), 0.006), pixels: None })
            .collect();
        let model: Vec<ModelPoint> = points.iter().map(|at| ModelPoint::exact("P", Point::from(*at))).collect();
        let candidates = Candidates::all(model.len(), cloud.len());
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(0.04),
            prior: None,
            edges: Default::default(),
        };
        let search = SEARCHES.build(&Choice::named("rigid-consensus")).expect("it is listed");
        let attempt = compute_fix(&problem, &*search, &Mahalanobis::default(), &Acceptance::default(), None, &mut rng);
        match attempt.outcome {
            Outcome::Ambiguous(all) => assert_eq!((all[0].pairs.len(), all[1].pairs.len()), (20, 12), "{seed}"),
            other => panic!("{seed}: {other:?}"),
        }
    }
}

/// The number of answered frames with `seen` of an object's `n` points in view beside a complete copy, 35 cm away,
/// among `times` as many points of clutter.
fn passed_over((n, seen): (usize, usize), times: usize, half: Option<f64>, frames: u64) -> usize {
    let search = SEARCHES.build(&Choice::named("rigid-consensus")).expect("it is listed");
    let answered = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let mut shown = Shown::new(n, half, &mut place);
        let step = place(1.0).normalize() * 0.35;
        shown.shows(seen, |at| *at, || place(0.017));
        shown.shows(n, |at| at + step, || place(0.017));
        (0..times).for_each(|_| shown.shows(n, |at| *at, || place(0.6)));
        matches!(shown.attempt(&*search, &Acceptance::default()).outcome, Outcome::Fix(_))
    };
    (0..frames).filter(|&seed| answered(seed)).count()
}

/// A copy of ten points among a hundred of clutter is reported as well: the complete one beside it is found at once,
/// which does not shorten the search for the partial one.
///
/// Seen to fail, with 21 of 60, when a quarter of the effort for the complete copy is spent on parts, without a
/// minimum.
#[test]
fn half_a_copy_among_clutter_is_not_passed_over() {
    assert_eq!(passed_over((20, 10), 5, Some(0.6), 60), 0);
}

#[test]
#[ignore = "table"]
fn how_often_copies_are_passed_over() {
    for (n, seen) in [(20, 8), (20, 10), (20, 14), (50, 12), (50, 20), (50, 30)] {
        for (half, times) in [(Some(0.6), 5), (Some(0.6), 20), (None, 2), (None, 10)] {
            let passed = passed_over((n, seen), times, half, 60);
            println!(
                "{seen} of {n} points in view, {times} times as many of clutter, half-size of gates {half:?}: {passed} of 60"
            );
        }
    }
}

/// An answer has an alternative wherever three pairs support one: it is elsewhere and explains less.
///
/// Seen to fail when the alternative may be the answer itself.
#[test]
fn answers_are_held_against_a_pose_elsewhere() {
    let (mut answers, mut held) = (0, 0);
    for name in SEARCHES.names() {
        let search = SEARCHES.build(&Choice::named(name)).expect("it is listed");
        for seed in 0..4 {
            let scene = scene(ClutterPattern::Edges, 14, seed);
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let problem = scene.problem();
            let attempt =
                compute_fix(&problem, &*search, &Mahalanobis::default(), &Acceptance::default(), None, &mut rng);
            let Outcome::Fix(fix) = &attempt.outcome else { continue };
            answers += 1;
            if let Some(other) = &attempt.runner_up {
                held += 1;
                let apart = rms_apart(problem.model, &fix.object_from_camera, &other.object_from_camera);
                assert!(apart > 0.05 && attempt.margin().is_some_and(|margin| margin > 0.0), "{name} {seed}: {apart}");
            }
        }
    }
    println!("{held} of {answers} answers have a runner-up");
    assert!(answers > 20 && held > answers / 2, "{held} of {answers}");
}
