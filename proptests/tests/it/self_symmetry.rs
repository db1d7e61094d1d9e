//! Every search: an answer whose points may be other points of the model is ambiguous, unless something decides.

use nalgebra::{Matrix6, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_evaluation::clopper_pearson;
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_proptests::{
    cases,
    views::{View, any_turn, anywhere, exact_model},
};
use seafix_referencing::{
    Acceptance, Candidates, Kabsch, MaxPWrong, ModelPoint, Outcome, Prior, PriorBound, Problem, RejectionReason,
    SEARCHES, Tolerance, compute_fix, rms_apart,
};
use seafix_simulation::{Purpose, Stream};

const SIGMA: f64 = 0.002;

/// Models with a self-symmetry: a grid, a long grid, a box of points; edges in metres.
fn models() -> [Vec<Point<Object>>; 3] {
    let grid = |[a, b, c]: [u32; 3], [x, y, z]: [f64; 3]| {
        let steps = |n: u32, step: f64| (0..n).map(move |i| f64::from(i) * step);
        let at = steps(a, x).flat_map(|x| steps(b, y).flat_map(move |y| steps(c, z).map(move |z| Point::new(x, y, z))));
        at.collect()
    };
    [grid([4, 4, 1], [0.4, 0.4, 0.0]), grid([5, 2, 1], [0.3, 0.7, 0.0]), grid([2, 2, 2], [1.0, 0.6, 0.8])]
}

/// The answer of each search for a completely visible model, 3 m before the camera, rotated by an angle, with this
/// prior.
fn answers(
    model: &[ModelPoint],
    turn: Vector3<f64>,
    prior: Option<f64>,
) -> Vec<(&'static str, Outcome, Transform<Object, Camera>)> {
    let camera_from_object = Transform::<Camera, Object>::new(so3::exp(&turn), Vector3::new(-0.5, -0.4, 3.0));
    let mut wave = (1_u32..).map(|k| f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 23) - 1.0);
    let cloud: Vec<MeasuredPoint> = model
        .iter()
        .map(|point| {
            let noise = Vector3::from_fn(|_, _| SIGMA * wave.next().unwrap_or(0.0));
            let at = Point::from((camera_from_object * point.at).coords + noise);
            MeasuredPoint { position: UncertainPoint::isotropic(at, SIGMA), pixels: None }
        })
        .collect();
    let truth = camera_from_object.inverse();
    let prior = prior.map(|sigma| {
        let covariance = Covariance6::new(Matrix6::identity() * sigma * sigma);
        Prior { object_from_camera: truth, bound: PriorBound::Gaussian(covariance) }
    });
    let candidates = Candidates::all(model.len(), cloud.len());
    let problem = Problem {
        model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Sigmas(3.0),
        prior: prior.as_ref(),
        edges: Default::default(),
    };
    let answer = |name| {
        let search = SEARCHES.build(&Choice::named(name)).expect("it is listed");
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let attempt = compute_fix(&problem, &*search, &Kabsch::default(), &Acceptance::default(), None, &mut rng);
        (name, attempt.outcome, truth)
    };
    SEARCHES.names().map(answer).collect()
}

fn model(points: &[Point<Object>], normal: Option<Vector3<f64>>) -> Vec<ModelPoint> {
    let point = |(k, at): (usize, &Point<Object>)| ModelPoint { normal, ..ModelPoint::exact(format!("p{k}"), *at) };
    points.iter().enumerate().map(point).collect()
}

/// P34. Nothing distinguishes the symmetric poses of a model: no search may choose one.
///
/// Seen to fail, by `gnc-tls` first, when alternative readings of a fix are not examined.
#[test]
fn a_symmetric_model_is_not_fixed_without_a_prior() {
    for points in models() {
        for turn in [Vector3::new(0.1, 0.2, -0.3), Vector3::new(-0.3, 0.1, 1.4)] {
            for (name, outcome, _) in answers(&model(&points, None), turn, None) {
                assert!(!matches!(outcome, Outcome::Fix(_)), "{name}: {} points, {outcome:?}", points.len());
            }
        }
    }
}

/// A prior that excludes the other poses decides.
///
/// Seen to fail when an alternative counts regardless of its probability and its distance from the prior.
#[test]
fn a_prior_decides_between_the_poses_of_a_symmetric_model() {
    let turn = Vector3::new(0.1, 0.2, -0.3);
    let right = |outcome: &Outcome, truth: &Transform<Object, Camera>| match outcome {
        Outcome::Fix(reference) => reference.object_from_camera.error_to(truth).amax() < 0.02,
        _ => false,
    };
    for points in models() {
        let reported = answers(&model(&points, None), turn, Some(0.02));
        let found = reported.iter().filter(|(_, outcome, truth)| right(outcome, truth)).count();
        assert!(found > 3, "{} points: {found} searches found the right pose", points.len());
        for (name, outcome, truth) in &reported {
            assert!(right(outcome, truth) || !matches!(outcome, Outcome::Fix(_)), "{name}: {outcome:?}");
        }
    }
}

/// Every pose is tested for the visible side of its points, with and without a prior.
///
/// Seen to fail when all sides count as visible.
#[test]
fn no_pose_shows_points_from_behind() {
    let solid =
        [[0.0, 0.9, 0.0], [0.4, 0.5, 0.3], [-0.4, 0.4, 0.1], [0.1, -0.8, 0.4], [0.5, -0.1, -0.2], [-0.6, -0.3, 0.2]];
    let solid = solid.map(Point::from);
    let reported = |normal| answers(&model(&solid, Some(normal)), Vector3::new(0.1, 0.2, -0.3), None);
    let rejected = reported(Vector3::z()).into_iter().filter_map(|(_, outcome, _)| match outcome {
        Outcome::Rejected(RejectionReason::Behind { point, angle, max }) => Some((point, angle, max)),
        _ => None,
    });
    let rejected: Vec<_> = rejected.collect();
    assert!(!rejected.is_empty() && rejected.iter().all(|(_, angle, max)| angle > max), "{rejected:?}");
    let found = |normal| {
        reported(normal)
            .into_iter()
            .filter(|(_, outcome, _)| matches!(outcome, Outcome::Fix(_)))
            .map(|(name, ..)| name)
            .collect()
    };
    let (front, behind): (Vec<_>, Vec<_>) = (found(-Vector3::z()), found(Vector3::z()));
    assert!(front.len() > 5 && behind.is_empty(), "{front:?}, {behind:?}");
}

/// A flat model that a flip maps onto itself: only the visible side of its points decides.
///
/// Seen to fail when all sides count as visible, and when alternative readings of a fix are not examined.
#[test]
fn the_visible_side_decides_between_a_flat_model_and_its_flip() {
    let kite = [[0.0, 0.9], [0.4, 0.5], [-0.4, 0.5], [0.0, -0.8], [0.2, -0.1], [-0.2, -0.1]];
    let kite = kite.map(|[x, y]| Point::new(x, y, 0.0));
    let turn = Vector3::new(0.1, 0.2, -0.3);
    let found = |normal| {
        let reported = answers(&model(&kite, normal), turn, None);
        let fixed = reported.iter().filter_map(|(name, outcome, truth)| match outcome {
            Outcome::Fix(fix) => Some((*name, fix.object_from_camera.error_to(truth).amax() < 0.05)),
            _ => None,
        });
        fixed.collect::<Vec<_>>()
    };
    assert_eq!(found(None), []);
    let seen = found(Some(-Vector3::z()));
    assert!(!seen.is_empty() && seen.iter().all(|(_, right)| *right), "{seen:?}");
}

/// A grid of three points a side, 25 cm apart, and its measurements in the same order.
fn seen_grid(rng: &mut ChaCha8Rng) -> (Vec<ModelPoint>, Vec<MeasuredPoint>) {
    let steps = || (0..3).map(|i| 0.25 * f64::from(i));
    let grid = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| Point::new(x, y, z))));
    let model = model(&grid.collect::<Vec<_>>(), None);
    let camera_from_object =
        Transform::<Camera, Object>::new(so3::exp(&Vector3::new(0.7, -0.4, 1.1)), Vector3::z() * 4.0);
    let measured = |point: &ModelPoint| {
        let noise = Vector3::from_fn(|_, _| 0.01 * (rng.random_range(-1.0..1.0) + rng.random_range(-1.0..1.0)));
        let at = Point::from((camera_from_object * point.at).coords + noise);
        MeasuredPoint { position: UncertainPoint::isotropic(at, 0.01), pixels: None }
    };
    let cloud = model.iter().map(measured).collect();
    (model, cloud)
}

/// The answer of a search for putative pairs of a grid.
fn of_grid(rng: &mut ChaCha8Rng, pairs: &[(usize, usize)], name: &str) -> Outcome {
    let (model, cloud) = seen_grid(rng);
    let candidates = Candidates::from_pairs(model.len(), pairs.iter().copied());
    let tolerance = Tolerance::Fixed(0.042_426);
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance,
        prior: None,
        edges: Default::default(),
    };
    let search = SEARCHES.build(&Choice::named(name)).expect("it is listed");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    compute_fix(&problem, &*search, &Kabsch::default(), &Acceptance::default(), None, &mut rng).outcome
}

/// Model and cloud are grids, and putative pairs are random: no search may accept the pose on which many pairs agree.
///
/// Seen to fail, with a third of these frames, when the NFA assumes the density of partners only.
#[test]
fn pairs_generated_over_a_grid_are_not_fixed() {
    generated_over_a_grid(5);
}

#[test]
#[ignore = "long: 100 frames"]
fn pairs_generated_over_a_grid_are_not_fixed_in_many_frames() {
    generated_over_a_grid(100);
}

fn generated_over_a_grid(frames: u64) {
    for seed in 0..frames {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let pairs: Vec<_> = (0..150).map(|_| (rng.random_range(0..27), rng.random_range(0..27))).collect();
        for name in SEARCHES.names() {
            let outcome = of_grid(&mut rng.clone(), &pairs, name);
            assert!(!matches!(outcome, Outcome::Fix(_)), "{name}, frame {seed}: {outcome:?}");
        }
    }
}

/// The same with pairs of corners with corners, edges with edges and faces with faces, as appearance would propose.
/// Half of the points agree with every symmetry of the grid, and the default reports that none is distinguished. Right
/// pairs among equally many of these are distinguished, and right pairs alone are not in doubt.
///
/// Seen to fail, with one frame in six, when no alternative pose is examined.
#[test]
fn pairs_generated_among_alike_points_are_not_fixed() {
    let kind = |i: usize| [i % 3, i / 3 % 3, i / 9].iter().filter(|&&step| step == 1).count();
    let mut answered = [0; 3];
    for seed in 0..40 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let alike = |rng: &mut ChaCha8Rng, i: usize| {
            let all: Vec<usize> = (0..27).filter(|&k| kind(k) == kind(i)).collect();
            all[rng.random_range(0..all.len())]
        };
        let mut generated = |count: usize| -> Vec<(usize, usize)> {
            let models: Vec<usize> = (0..count).map(|_| rng.random_range(0..27)).collect();
            models.into_iter().map(|i| (i, alike(&mut rng, i))).collect()
        };
        let truth: Vec<(usize, usize)> = (0..27).map(|i| (i, i)).collect();
        let cases = [generated(150), [&truth[..], &generated(27)].concat(), truth];
        for (pairs, answered) in cases.iter().zip(&mut answered) {
            let outcome = of_grid(&mut ChaCha8Rng::seed_from_u64(seed), pairs, "rigid-consensus");
            *answered += u32::from(matches!(outcome, Outcome::Fix(_)));
        }
    }
    assert!(answered[0] == 0 && answered[1] >= 20 && answered[2] == 40, "{answered:?} of 40");
}

/// Eight points that a half-turn maps onto each other except for one with an offset of up to five standard deviations,
/// among twenty points of clutter; and the camera's pose.
fn nearly_symmetric(stream: &mut Stream) -> View {
    let sigma = 0.01;
    let mut points = Vec::new();
    for _ in 0..4 {
        let at = anywhere(stream, [0.8, 0.8, 0.5]);
        points.extend([at, Vector3::new(-at.x, -at.y, at.z)]);
    }
    points[0] += stream.normal3(1.0).normalize() * sigma * stream.between(1.0, 5.0);
    let camera_from_object = Transform::new(any_turn(stream), Vector3::z() * 3.0);
    View::of(stream, exact_model(&points), camera_from_object, 0..8, sigma).among(stream, 20, 3.0, [1.5; 3])
}

/// The default search's probability of the right orientation of a nearly symmetric model is calibrated, and no
/// protection level is given if the probability of the wrong one exceeds the stated risk; 500 frames.
///
/// Answers are accepted here with a probability of being wrong of up to 0.3, so that there are wrong ones to count.
///
/// Seen to fail when the level ignores alternative poses: 17 of 445 fixes exceed it.
#[test]
fn a_nearly_symmetric_model_is_the_right_orientation_as_often_as_is_stated() {
    let frames = u64::from(cases(4000));
    let acceptance = Acceptance { max_p_wrong: MaxPWrong::Number(0.3), ..Acceptance::default() };
    let (mut answered, mut protected, mut wrong, mut beyond) = (0, 0, 0, 0);
    let (mut expected, mut variance) = (0.0, 0.0);
    let mut by_default = [0; 2];
    for seed in 0..frames {
        let mut stream = Stream::new(seed, 0, 0, Purpose::View);
        let view = nearly_symmetric(&mut stream);
        let attempt = view.attempt(0.05, &acceptance);
        let Outcome::Fix(fix) = &attempt.outcome else { continue };
        let [p_absent, p_wrong] = [attempt.p_absent, attempt.p_wrong].map(|p| p.expect("the search gives it"));
        // Levels cover single wrong matches by themselves.
        let misidentified = fix.integrity.misidentified.expect("the search gives it");
        assert!((p_absent..=p_wrong).contains(&misidentified), "{misidentified} {p_absent} {p_wrong}");
        // The object is always there.
        let elsewhere = (p_wrong - p_absent) / (1.0 - p_absent);
        let is_wrong = rms_apart(&view.model, &fix.object_from_camera, &view.truth) > 0.3;
        answered += 1;
        wrong += usize::from(is_wrong);
        expected += elsewhere;
        variance += elsewhere * (1.0 - elsewhere);
        if Acceptance::default().max_p_wrong.allows(p_wrong) {
            by_default[usize::from(is_wrong)] += 1;
        }
        let Some(level) = fix.integrity.protection else { continue };
        assert!(p_wrong < acceptance.risk, "frame {seed}: {p_wrong} with a level");
        protected += 1;
        let off = (fix.object_from_camera.translation() - view.truth.translation()).norm();
        beyond += usize::from(off > level.position);
    }
    println!(
        "{answered} of {frames} answered, {wrong} in the wrong orientation, {expected:.1} ± {:.1} expected; {protected} with a level, \
         {beyond} beyond it; by default {} right and {} wrong",
        variance.sqrt(),
        by_default[0],
        by_default[1]
    );
    assert!(answered > frames / 2 && expected > 4.0, "too few");
    // Alternatives count in the search and in the reading of the points: up to twice as often as they are wrong.
    let (min, max) = (0.5 * expected - 3.0 * variance.sqrt(), expected + 3.0 * variance.sqrt());
    assert!((min..=max).contains(&(wrong as f64)), "{wrong} wrong, {min:.1} to {max:.1} expected");
    let (min, _) = clopper_pearson(beyond, protected, 0.99);
    assert!(min <= acceptance.risk, "{beyond} of {protected} fixes are beyond their level");
}

/// A body whose points have alternatives nearer than the alert limit; the points of one side are in view among ten of
/// clutter; and the camera's pose. It is a thin plate with the points of one face repeated on the other, or a wedge
/// with the points repeated and slightly rotated.
fn near_duplicate(stream: &mut Stream, wedge: bool) -> View {
    let count = stream.rng().random_range(5..9);
    let near: Vec<_> = (0..count).map(|_| anywhere(stream, [0.5, 0.4, if wedge { 0.4 } else { 0.1 }])).collect();
    let copy = if wedge {
        let turn = so3::exp(&(stream.normal3(1.0).normalize() * stream.between(0.03, 0.06)));
        Transform::<Object, Object>::new(turn, Vector3::zeros())
    } else {
        Transform::new(so3::exp(&Vector3::zeros()), Vector3::z() * stream.between(0.025, 0.045))
    };
    let far: Vec<_> = near.iter().map(|at| (copy * Point::from(*at)).coords).collect();
    let camera_from_object = Transform::new(any_turn(stream), Vector3::z() * 3.0);
    let first = count * stream.rng().random_range(0..2);
    let view = View::of(stream, exact_model(&[near, far].concat()), camera_from_object, first..first + count, 0.001);
    view.among(stream, 10, 3.0, [1.5; 3])
}

/// A fix whose points may be the alternatives with nearly the same pose is given, and its level covers both; 150 frames
/// of a plate and 150 of a wedge.
///
/// Seen to fail when levels ignore alternatives within the alert limit: 12 of 113 exceed them.
#[test]
fn levels_hold_of_symmetric_sets_within_the_alert_limit() {
    let frames = u64::from(cases(1200));
    let acceptance = Acceptance::default();
    for (name, wedge) in [("plate", false), ("wedge", true)] {
        let (mut answered, mut protected, mut copies, mut beyond) = (0_usize, 0, 0, 0);
        for seed in 0..frames {
            let mut stream = Stream::new(seed, 1 + u64::from(wedge), 0, Purpose::View);
            let view = near_duplicate(&mut stream, wedge);
            let Outcome::Fix(fix) = view.outcome(0.006, &acceptance) else { continue };
            answered += 1;
            let truth = view.truth;
            let off = fix.object_from_camera.error_to(&truth);
            copies += usize::from(off.fixed_rows::<3>(0).norm() > 0.01 || off.fixed_rows::<3>(3).norm() > 0.015);
            let Some(level) = fix.integrity.protection else { continue };
            protected += 1;
            let apart = (fix.object_from_camera.translation() - truth.translation()).norm();
            let turned = fix.object_from_camera.rotation().angle_to(&truth.rotation());
            beyond += usize::from(apart > level.position || turned > level.attitude);
        }
        println!(
            "{name}: {answered} of {frames} answered, {copies} of them the alternative; {protected} with a level, {beyond} beyond it"
        );
        let (min, _) = clopper_pearson(beyond, protected, 0.99);
        // The levels of position and attitude have that risk each.
        assert!(min <= 2.0 * acceptance.risk, "{name}: {beyond} of {protected} fixes are beyond a level");
        assert!(protected as u64 > frames / 8 && copies > 5, "{name}: too few");
    }
}

/// A flange of bolts with an invisible point that breaks its symmetry, and a prior pose within whose bound all of the
/// model lies: a pose drawn uniformly among those.
fn bolts(stream: &mut Stream, count: u32, half: f64) -> View {
    let radius = 0.4;
    let bolt = |k: u32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(count)).sin_cos();
        Vector3::new(radius * cos, radius * sin, 0.0)
    };
    let points: Vec<_> = (0..count).map(bolt).chain([Vector3::new(0.2, 0.05, 0.1)]).collect();
    let camera_from_object = Transform::new(any_turn(stream), Vector3::z() * 4.0);
    let view = View::of(stream, exact_model(&points), camera_from_object, 0..8, 0.005);
    let view = view.among(stream, 30, 4.0, [1.2; 3]);
    view.before(half, || [anywhere(stream, [1.2 * half / radius + 0.1; 3]), anywhere(stream, [half; 3])])
}

/// A prior pose decides between the orientations of a symmetric object if its bound excludes the others, and not if
/// noise alone carries a measured point across: 300 frames each of 12 bolts and of 8.
///
/// Seen to fail, with 4 of 152 answers for 12 bolts, when each point must be a candidate by itself.
#[test]
fn noise_at_the_edge_of_a_prior_decides_between_no_poses() {
    let frames = u64::from(cases(2400));
    for (count, half) in [(12, 0.3), (8, 0.35)] {
        let (mut answered, mut ambiguous, mut wrong) = (0, 0, 0);
        for seed in 0..frames {
            let mut stream = Stream::new(seed, 3, u64::from(count), Purpose::View);
            let view = bolts(&mut stream, count, half);
            match view.outcome(0.02, &Acceptance::default()) {
                Outcome::Fix(fix) => {
                    answered += 1;
                    // Bolt i is cloud point i.
                    wrong += u64::from(fix.pairs.iter().filter(|pair| pair.model == pair.cloud).count() < 3);
                }
                Outcome::Ambiguous(_) => ambiguous += 1,
                _ => {}
            }
        }
        println!(
            "{count} bolts: {answered} of {frames} answered, {wrong} in the wrong orientation, {ambiguous} ambiguous"
        );
        assert!(answered > frames / 3 && ambiguous > frames / 6, "too few");
        assert_eq!(wrong, 0, "{count} bolts");
    }
}

/// An object of two modules of eight points, a metre apart, with four points more. The second module and two of the
/// four are in view. Appearance proposes, for the points of the module, the other module's with this probability, and
/// twenty random pairs more.
fn modules(stream: &mut Stream, mistaken: f64) -> (View, Candidates) {
    let first: Vec<_> = (0..8).map(|_| anywhere(stream, [0.3; 3])).collect();
    let second: Vec<_> = first.iter().map(|at| at + Vector3::x()).collect();
    let others: Vec<_> = (0..4).map(|_| anywhere(stream, [0.8; 3])).collect();
    let camera_from_object = Transform::new(any_turn(stream), Vector3::z() * 4.0);
    let seen: Vec<usize> = (8..18).collect();
    let model = exact_model(&[first, second, others].concat());
    let view = View::of(stream, model, camera_from_object, seen.iter().copied(), 0.01);
    let view = view.among(stream, 30, 4.0, [1.0; 3]);
    let mut pairs = Vec::new();
    for (cloud, &model) in seen.iter().enumerate() {
        let like = model < 16 && stream.unit() < mistaken;
        pairs.push((if like { model - 8 } else { model }, cloud));
    }
    let mut below = |count: usize| stream.rng().random_range(0..count);
    pairs.extend((0..20).map(|_| (below(20), below(40))));
    let candidates = Candidates::from_pairs(20, pairs);
    (view, candidates)
}

/// Putative pairs of a repeated module that appearance cannot distinguish: at most one answer in a hundred takes it for
/// the other. Most frames without confusion are answered. 300 frames each.
///
/// Seen to fail, with 5 of 61 answers, when alternative readings are limited to proposed points.
#[test]
fn proposals_do_not_decide_between_modules_that_look_alike() {
    let frames = u64::from(cases(2400));
    let count = |mistaken: f64| {
        let (mut right, mut wrong) = (0_usize, 0_usize);
        for seed in 0..frames {
            let mut stream = Stream::new(seed, 4, 0, Purpose::View);
            let (view, candidates) = modules(&mut stream, mistaken);
            if let Outcome::Fix(fix) = view.outcome_of(&candidates, 0.0424, &Acceptance::default()) {
                let off = rms_apart(&view.model, &fix.object_from_camera, &view.truth) > 0.3;
                *(if off { &mut wrong } else { &mut right }) += 1;
            }
        }
        println!("mistaken with {mistaken}: {right} right and {wrong} wrong of {frames}");
        (right, wrong)
    };
    let (right, wrong) = count(0.5);
    let (min, _) = clopper_pearson(wrong, right + wrong, 0.99);
    assert!(min <= 0.01, "{wrong} of {} the other module", right + wrong);
    let (right, wrong) = count(0.0);
    assert!(right as u64 > frames * 9 / 10 && wrong == 0, "{right} right, {wrong} wrong");
}
