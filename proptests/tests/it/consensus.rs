//! The search by evidence: its probabilities are frequencies.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_evaluation::clopper_pearson;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, so3};
use seafix_proptests::problems::Listed;
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, Mahalanobis, Outcome, PosteriorProbabilities, Problem, RigidConsensus,
    Search, Tolerance, problem_file::CoherenceProblem, rms_apart,
};
use seafix_simulation::families::{Family, Generated, Presence};

/// Maximum difference of equal poses (m, RMS over the model points).
const LIMIT: f64 = 0.08;

/// The posterior probabilities of a generated problem, and whether the most probable pose is right; `None` without a
/// pose.
fn believed(family: Family, seed: u64, number: u64, presence: Presence) -> Option<(PosteriorProbabilities, bool)> {
    let generated = Generated::new(family, seed, number, presence);
    let listed = Listed::new(generated.problem.problem());
    let problem = listed.problem();
    let found = RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0)).ok()?;
    let posterior = found.posterior.expect("it weighs evidence");
    let map_estimate = &posterior.explanations[0].object_from_camera;
    let truth = Transform::from_rows(&generated.truth.t_cam_obj).expect("it is a rigid motion").inverse();
    let right = generated.truth.pose_defined && rms_apart(problem.model, map_estimate, &truth) <= LIMIT;
    Some((posterior.probabilities(problem.model, LIMIT), right))
}

/// Whether the default acceptance and solver give a pose.
fn fixed(family: Family, seed: u64, number: u64, presence: Presence) -> bool {
    let problem = Generated::new(family, seed, number, presence).problem.problem();
    let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let attempt = problem.attempt(&search, &solver, &Acceptance::default(), &mut rng);
    matches!(attempt.outcome, Outcome::Fix(_))
}

/// Points of a grid are collinear in threes, which determine no pose: the most probable pose of most of its points is
/// found nevertheless.
///
/// Seen to fail, in both frames, when model points with equal numbers of candidates are sorted by coordinates, row by
/// row.
#[test]
fn no_pose_is_lost_where_points_stand_in_rows() {
    for number in [19, 217] {
        let (_, right) = believed(Family::E, 21, number, Presence::Present).expect("the search has an answer");
        assert!(right, "frame {number}: another pose is most probable");
    }
}

/// No pose is given without the object: 300 frames at the scale of the paper, some at that of a site, and some with a
/// lattice that continues the object about its place.
///
/// Seen to fail when a small NFA suffices for a pose in gates: it says nothing about a lattice.
#[test]
fn no_object_no_pose() {
    for (family, frames) in [(Family::A, 300), (Family::E, 60), (Family::F, 12)] {
        for number in 0..frames {
            assert!(!fixed(family, 3, number, Presence::Absent), "{family:?} {number}");
        }
    }
}

/// The long form: `cargo test --release -p seafix-proptests consensus::clutter_alone -- --ignored --nocapture`
/// (`CONSENSUS_FRAMES`, 30 000 by default; the family is a).
#[test]
#[ignore = "long: 30 000 frames"]
fn clutter_alone_is_never_fixed() {
    let frames = std::env::var("CONSENSUS_FRAMES").map_or(30_000, |n| n.parse().expect("a number"));
    // Acceptance by stricter and looser settings, before the tests of residuals.
    let believed: Vec<PosteriorProbabilities> = (0..frames)
        .filter_map(|number| believed(Family::A, 5, number, Presence::Absent))
        .map(|(probabilities, _)| probabilities)
        .collect();
    for absence in [1e-2, 1e-3, 1e-4, 5e-5, 2e-5, 1e-5] {
        let accepted = believed.iter().filter(|s| s.absent + s.elsewhere <= absence).count();
        println!("{accepted} of {frames} frames without the object have a posterior of absence of at most {absence:e}");
    }
    let wrong: Vec<u64> = (0..frames).filter(|&number| fixed(Family::A, 5, number, Presence::Absent)).collect();
    let rate = clopper_pearson(wrong.len(), frames as usize, 0.95);
    println!("{} of {frames} frames without the object have a fix, {rate:?}: {wrong:?}", wrong.len());
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// The posterior probability of absence is the frequency of absence, over equally many frames with and without the
/// object, in bins of the probability. The posterior probability of the best pose is the frequency of its being right.
///
/// `cargo test --release -p seafix-proptests consensus::posteriors_are -- --ignored --nocapture`;
/// `CONSENSUS_FAMILIES` (a), `CONSENSUS_FRAMES` (6000) of each kind.
#[test]
#[ignore = "long: 12 000 frames"]
fn posteriors_are_calibrated() {
    let count = std::env::var("CONSENSUS_FRAMES").map_or(6_000, |n| n.parse().expect("a number"));
    let families = std::env::var("CONSENSUS_FAMILIES").unwrap_or_else(|_| "a".to_owned());
    println!("| family | claim | predicted wrong | wrong | frames |\n|---|---|---|---|---|");
    for name in families.chars() {
        let family: Family = name.to_string().parse().expect("a family");
        // The probability of the claim's being wrong, and whether it is.
        let (mut there, mut poses) = (Vec::new(), Vec::new());
        for number in 0..count {
            for presence in [Presence::Present, Presence::Absent] {
                let Some((probabilities, right)) = believed(family, 7, number, presence) else { continue };
                there.push((probabilities.absent, presence == Presence::Absent));
                poses.push((probabilities.absent + probabilities.elsewhere, !right));
            }
        }
        for (what, mut posteriors) in [("the object is there", there), ("the pose", poses)] {
            posteriors.sort_by(|a, b| a.0.total_cmp(&b.0));
            for bin in posteriors.chunk_by(|a, b| decade(a.0) == decade(b.0)) {
                let mean = bin.iter().map(|(posterior, _)| posterior).sum::<f64>() / bin.len() as f64;
                let happened = bin.iter().filter(|(_, wrong)| *wrong).count();
                println!("| {name} | {what} | {mean:.1e} | {happened} | {} |", bin.len());
            }
            // Expected number of wrong claims of a probability of at most a hundredth: the model of the cloud is not
            // exact, and the default acceptance asks for much less.
            let (sure, max) = (1e-2, 0.1);
            let message: Vec<bool> =
                posteriors.iter().filter(|(posterior, _)| *posterior <= sure).map(|(_, wrong)| *wrong).collect();
            let missed = message.iter().filter(|&&missed| missed).count();
            let fraction = missed as f64 / message.len().max(1) as f64;
            println!("{name}, {what}: of {} with a probability of at most {sure}, {missed} were wrong", message.len());
            if family == Family::A {
                assert!(message.len() >= 100, "{what}: {} probabilities are too few", message.len());
                assert!(fraction <= max, "{name}, {what}: {missed} of {} were wrong", message.len());
            } else {
                // At the scale of a site some minutes give only tens of such probabilities, and in f their true
                // frequency is near a tenth, so that a single claim would decide. The test only shows an excess.
                let (low, _) = clopper_pearson(missed, message.len().max(1), 0.95);
                assert!(low <= max, "{name}, {what}: {missed} of {} were wrong", message.len());
            }
        }
    }
}

/// Bins of a probability by its odds, a factor of ten each; all below a millionth are one bin.
fn decade(p: f64) -> i32 {
    let odds = (p.max(1e-7) / (1.0 - p).max(1e-7)).log10();
    odds.round() as i32
}

/// The posterior is right over few generated frames: the true pose is the most probable in nine of ten with five or
/// more visible points, and the answers of the default acceptance are right.
#[test]
fn the_true_pose_is_the_best() {
    let (mut defined, mut right) = (0, 0);
    for number in 0..252 {
        let visible = Generated::new(Family::A, 9, number, Presence::Present).truth.pairs.len();
        if visible < 5 {
            continue;
        }
        defined += 1;
        if let Some((probabilities, found)) = believed(Family::A, 9, number, Presence::Present) {
            right += u32::from(found);
            let answered = || fixed(Family::A, 9, number, Presence::Present);
            assert!(found || !answered(), "number {number}: posterior {probabilities:?}");
        }
    }
    assert!(right * 10 >= defined * 9, "{right} of {defined}");
}

/// The true pose of a self-similar model is not pruned by another pose that is found first and explains nearly as many
/// points.
///
/// Seen to fail (problem 215) when the bounds charge large sets the full cost of their residuals.
#[test]
fn the_true_pose_is_the_largest_probable_in_a_lattice() {
    for number in 208..217 {
        let right = believed(Family::E, 21, number, Presence::Present).is_some_and(|(_, right)| right);
        assert!(right, "number {number}");
    }
}

/// The cloud points of a copy of the object: each visible point again, at another pose.
fn with_copy(generated: &Generated, by: [f64; 3], turned: [f64; 3]) -> CoherenceProblem {
    let mut file = generated.problem.problem();
    let truth: Transform<Camera, Object> =
        Transform::from_rows(&generated.truth.t_cam_obj).expect("it is a rigid motion");
    let centre = truth * Point::from([0.0; 3]);
    let turn = so3::exp(&turned.into());
    // The noise of the copy is that of the object, rotated with it.
    let copy = |&[_, cloud]: &[usize; 2]| {
        let mut point = file.cloud[cloud];
        let lever = point.position.at - centre;
        point.position.at = Point::from(centre.coords + turn * lever + nalgebra::Vector3::from(by));
        point
    };
    let copies: Vec<MeasuredPoint> = generated.truth.pairs.iter().map(copy).collect();
    file.cloud.extend(copies);
    file
}

/// A cloud with two equally visible copies of the object, both within the prior, gets no pose, and never that of the
/// copy.
#[test]
fn two_copies_are_ambiguous() {
    let (mut alone, mut ambiguous, mut tried) = (0, 0, 0);
    for number in 0..126 {
        let generated = Generated::new(Family::A, 13, number, Presence::Present);
        if generated.truth.pairs.len() < 6 {
            continue;
        }
        tried += 1;
        let outcome = |problem: &CoherenceProblem| {
            let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            problem.attempt(&search, &solver, &Acceptance::default(), &mut rng).outcome
        };
        alone += u32::from(matches!(outcome(&generated.problem.problem()), Outcome::Fix(_)));
        // Inside the gates, and at least 9 cm away.
        let half = generated.truth.params.gate.expect("family a has gates");
        let by = [0.2 * half + 0.05, -0.2 * half - 0.05, 0.1 * half];
        let twice = outcome(&with_copy(&generated, by, [0.02, 0.03, -0.02]));
        // A copy that extends beyond its gates may be distinguishable.
        if let Outcome::Fix(reference) = &twice {
            let is_true = |pair: &&Correspondence| generated.truth.pairs.contains(&[pair.model, pair.cloud]);
            let right = reference.pairs.iter().filter(is_true).count();
            assert!(2 * right > reference.pairs.len(), "number {number}: the copy got the fix");
        }
        ambiguous += u32::from(matches!(twice, Outcome::Ambiguous(_)));
    }
    println!("{ambiguous} of {tried} ambiguous; without the copy {alone} fixes");
    assert!(3 * ambiguous > 2 * alone, "{ambiguous} of {alone} fixes without the copy");
    assert!(2 * alone > tried, "{alone} of {tried} have a fix without the copy");
}

/// Candidates outside of the gates, and points that are no candidates, change nothing.
#[test]
fn far_points_change_nothing() {
    for number in 0..40 {
        let file = Generated::new(Family::A, 11, number, Presence::Present).problem.problem();
        let candidates = file.candidates().expect("few enough to list");
        let mut more = file.cloud.clone();
        for k in 0..200 {
            let mut far = more[k % file.cloud.len()];
            far.position.at.coords.x += 1000.0 + k as f64;
            more.push(far);
        }
        let search = |cloud: &[_], candidates: &Candidates| {
            let tolerance = Tolerance::Fixed(file.delta);
            let problem = Problem {
                model: &file.model,
                cloud,
                candidates,
                tolerance,
                prior: file.prior.as_ref(),
                edges: Default::default(),
            };
            RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0))
        };
        assert_eq!(search(&file.cloud, &candidates), search(&more, &candidates), "number {number}");
    }
}

/// Without a prior, a few distant cloud points (false matches) seldom prevent a fix: rate and cost are nearly those
/// without them. 35, 35 and 35 of 40 remain. A part of the loss is the box of near points: it extends by half of the
/// object's length if there are more points, so that the volume of possible poses is larger.
///
/// Seen to fail when the density of clutter is that of the box of all points (9, 0 and 0 of 32 found), and when the
/// rounding error is a fraction of the largest coordinate, so that all distances agree.
#[test]
fn a_few_points_far_away_hide_no_object() {
    let (mut alone, mut beside) = (0, [0; 3]);
    let mut pair_tests = [0; 2];
    for number in 0..150 {
        let generated = Generated::new(Family::A, 17, number, Presence::Present);
        let truth = Transform::from_rows(&generated.truth.t_cam_obj).expect("it is a rigid motion").inverse();
        let file = CoherenceProblem { prior: None, ..generated.problem.problem() };
        let mut fixed = |far: f64| {
            let mut file = file.clone();
            // One in twelve, in all directions.
            for k in 0..file.cloud.len().div_ceil(12) {
                let mut point = file.cloud[k];
                let turn = so3::exp(&nalgebra::Vector3::new(1.1 * k as f64, 0.7, 0.3 * k as f64));
                point.position.at.coords += turn * nalgebra::Vector3::new(far, 0.4 * far, -0.8 * far);
                file.cloud.extend((far > 0.0).then_some(point));
            }
            let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            let attempt = file.attempt(&search, &solver, &Acceptance::default(), &mut rng);
            let Outcome::Fix(fix) = attempt.outcome else { return false };
            pair_tests[usize::from(far > 0.0)] += attempt.pair_tests.expect("the search counts");
            let off = rms_apart(&file.model, &fix.object_from_camera, &truth);
            assert!(off <= LIMIT, "number {number}, points {far} m away: error {off} m");
            true
        };
        if fixed(0.0) {
            alone += 1;
            beside.iter_mut().zip([1e2, 1e5, 1e8]).for_each(|(found, far)| *found += u32::from(fixed(far)));
        }
    }
    println!("{alone} found, of them {beside:?} with distant points; pair tests {pair_tests:?}");
    assert!(alone >= 20, "{alone} are too few");
    assert!(beside.iter().all(|found| 7 * found >= 6 * alone), "{beside:?} of {alone}");
    // Three times as many frames, with a twelfth more points each: a fifth more pairs.
    assert!(pair_tests[1] < 6 * pair_tests[0], "{pair_tests:?} pair tests");
}

/// Distant points do not turn clutter into an object, for any numbers of near and distant points, single or in groups.
///
/// Seen to fail, with 17 of 800 frames, when the density of clutter is that of the box of all points.
#[test]
fn a_few_points_far_away_make_no_object() {
    let mut wrong = Vec::new();
    for number in 0..800 {
        let generated = Generated::new(Family::A, 19, number, Presence::Absent);
        let mut file = CoherenceProblem { prior: None, ..generated.problem.problem() };
        let (near, far) = (3 + number as usize % 7, 1 + number as usize / 7 % 4);
        file.cloud.truncate(near);
        for k in 0..far {
            let mut point = file.cloud[k % near];
            let apart = if number % 2 == 0 { 1.0 } else { 100.0 };
            let step = nalgebra::Vector3::new(0.7, -0.4 * k as f64, 0.3 * (k * k) as f64);
            point.position.at.coords += nalgebra::Vector3::new(150.0, -200.0, 100.0) + apart * step;
            file.cloud.push(point);
        }
        let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let attempt = file.attempt(&search, &solver, &Acceptance::default(), &mut rng);
        if matches!(attempt.outcome, Outcome::Fix(_)) {
            wrong.push(number);
        }
    }
    assert!(wrong.is_empty(), "{} fixes: {wrong:?}", wrong.len());
}
