//! The search that weighs evidence: what it believes is what happens.

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

/// Poses within this (m, RMS over the model points) are one.
const LIMIT: f64 = 0.08;

/// The believed shares of one drawn problem, and whether the likeliest pose is the true one; `None` where nothing
/// was found.
fn believed(family: Family, seed: u64, number: u64, presence: Presence) -> Option<(PosteriorProbabilities, bool)> {
    let generated = Generated::new(family, seed, number, presence);
    let listed = Listed::new(generated.problem.problem());
    let problem = listed.problem();
    let found = RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0)).ok()?;
    let posterior = found.posterior.expect("it weighs evidence");
    let map_estimate = &posterior.explanations[0].object_from_camera;
    let truth = Transform::from_rows(&generated.truth.t_cam_obj).expect("it was made of a rigid motion").inverse();
    let right = generated.truth.pose_defined && rms_apart(problem.model, map_estimate, &truth) <= LIMIT;
    Some((posterior.probabilities(problem.model, LIMIT), right))
}

/// Whether the object is believed to be somewhere, by the default acceptance and solver.
fn fixed(family: Family, seed: u64, number: u64, presence: Presence) -> bool {
    let problem = Generated::new(family, seed, number, presence).problem.problem();
    let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let attempt = problem.attempt(&search, &solver, &Acceptance::default(), &mut rng);
    matches!(attempt.outcome, Outcome::Fix(_))
}

/// Points of a grid stand in rows, and three in a row fix no pose: the likeliest pose of most of its points is found all the same.
///
/// Seen to fail, in both frames, where model points with as many candidates stand in the order of their coordinates, row by row.
#[test]
fn no_pose_is_lost_where_points_stand_in_rows() {
    for number in [19, 217] {
        let (_, right) = believed(Family::E, 21, number, Presence::Present).expect("something is found");
        assert!(right, "frame {number}: the likeliest pose is another");
    }
}

/// Where the object is not there, no pose is given: 300 frames at the paper's scale, some at a site's, and some where the
/// lattice that the object is a part of goes on about its place.
///
/// Seen to fail when few expected chance sets are enough for a pose in shells: of a lattice they say nothing.
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
    // What stricter and looser settings would accept, before the tests of the residuals.
    let believed: Vec<PosteriorProbabilities> = (0..frames)
        .filter_map(|number| believed(Family::A, 5, number, Presence::Absent))
        .map(|(probabilities, _)| probabilities)
        .collect();
    for absence in [1e-2, 1e-3, 1e-4, 5e-5, 2e-5, 1e-5] {
        let doubt = Acceptance::default().doubt;
        let accepted =
            believed.iter().filter(|s| s.absent <= absence && s.elsewhere <= doubt * (1.0 - s.absent)).count();
        println!("absence {absence:e}: {accepted} of {frames} frames without the object would be accepted");
    }
    let wrong: Vec<u64> = (0..frames).filter(|&number| fixed(Family::A, 5, number, Presence::Absent)).collect();
    let rate = clopper_pearson(wrong.len(), frames as usize, 0.95);
    println!("{} of {frames} frames without the object were referenced, {rate:?}: {wrong:?}", wrong.len());
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// The believed probability of absence is the frequency of absence: frames with and without the object, one each,
/// in bins of the belief; and the believed probability of the likeliest pose is how often it is the true one.
///
/// `cargo test --release -p seafix-proptests consensus::beliefs_are -- --ignored --nocapture`; `CONSENSUS_FAMILIES` (a),
/// `CONSENSUS_FRAMES` (6000) of each kind.
#[test]
#[ignore = "long: 12 000 frames"]
fn posteriors_are_calibrated() {
    let count = std::env::var("CONSENSUS_FRAMES").map_or(6_000, |n| n.parse().expect("a number"));
    let families = std::env::var("CONSENSUS_FAMILIES").unwrap_or_else(|_| "a".to_owned());
    println!("| family | what | believed wrong | happened | frames |\n|---|---|---|---|---|");
    for name in families.chars() {
        let family: Family = name.to_string().parse().expect("a family");
        // How probable it is called that what is claimed is wrong, and whether it is.
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
            // Of those called wrong with a hundredth at most, so many may be: the cloud is not what the model takes it
            // for in everything, and the default acceptance asks for much less.
            let (sure, max) = (1e-2, 0.1);
            let said: Vec<bool> =
                posteriors.iter().filter(|(posterior, _)| *posterior <= sure).map(|(_, wrong)| *wrong).collect();
            let missed = said.iter().filter(|&&missed| missed).count();
            let fraction = missed as f64 / said.len().max(1) as f64;
            println!("{name}, {what}: of {} called wrong with {sure} at most {missed} were", said.len());
            if family == Family::A {
                assert!(said.len() >= 100, "{what}: {} beliefs are no test", said.len());
                assert!(fraction <= max, "{name}, {what}: {missed} of {} were wrong", said.len());
            } else {
                // At a site's scale minutes give some tens of such beliefs, and in f their true share is near the
                // tenth: one more wrong or less would decide. What so few can show is that it is more than that.
                let (low, _) = clopper_pearson(missed, said.len().max(1), 0.95);
                assert!(low <= max, "{name}, {what}: {missed} of {} were wrong", said.len());
            }
        }
    }
}

/// Bins of a probability by its odds, a factor of ten each; all below a millionth are one.
fn decade(p: f64) -> i32 {
    let odds = (p.max(1e-7) / (1.0 - p).max(1e-7)).log10();
    odds.round() as i32
}

/// What is believed of few drawn frames is right: the true pose is the likeliest in nine of ten where five points or
/// more are visible, and the answers that the default acceptance gives are right.
#[test]
fn the_true_pose_is_the_largest_probable() {
    let (mut defined, mut right) = (0, 0);
    for number in 0..252 {
        let visible = Generated::new(Family::A, 9, number, Presence::Present).truth.pairs.len();
        if visible < 5 {
            continue;
        }
        defined += 1;
        if let Some((probabilities, found)) = believed(Family::A, 9, number, Presence::Present) {
            right += u32::from(found);
            let acceptance = Acceptance::default();
            let certain = probabilities.absent <= acceptance.absence && probabilities.elsewhere <= acceptance.doubt;
            assert!(found || !certain, "number {number}: believed {probabilities:?}");
        }
    }
    assert!(right * 10 >= defined * 9, "{right} of {defined}");
}

/// Nor is it pruned by a pose elsewhere of a self-similar model that is found before it and explains nearly as many points.
///
/// Seen to fail (of number 215) where the bounds take residuals to cost large sets all that they do.
#[test]
fn the_true_pose_is_the_largest_probable_in_a_lattice() {
    for number in 208..217 {
        let right = believed(Family::E, 21, number, Presence::Present).is_some_and(|(_, right)| right);
        assert!(right, "number {number}");
    }
}

/// The cloud points of a copy of the object: each visible point once more, where another pose has it.
fn with_copy(generated: &Generated, by: [f64; 3], turned: [f64; 3]) -> CoherenceProblem {
    let mut file = generated.problem.problem();
    let truth: Transform<Camera, Object> =
        Transform::from_rows(&generated.truth.t_cam_obj).expect("it is a rigid motion");
    let centre = truth * Point::from([0.0; 3]);
    let turn = so3::exp(&turned.into());
    // The noise of the copy is that of the object, turned with it.
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

/// Where the cloud holds the object twice, equally visible, and the prior allows both, no pose is given; and never that of
/// the copy.
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
        // Into the shells, and 9 cm or more off.
        let half = generated.truth.params.gate.expect("family a has shells");
        let by = [0.2 * half + 0.05, -0.2 * half - 0.05, 0.1 * half];
        let twice = outcome(&with_copy(&generated, by, [0.02, 0.03, -0.02]));
        // Where the copy reaches out of its shells the object may still be told from it.
        if let Outcome::Fix(reference) = &twice {
            let is_true = |pair: &&Correspondence| generated.truth.pairs.contains(&[pair.model, pair.cloud]);
            let right = reference.pairs.iter().filter(is_true).count();
            assert!(2 * right > reference.pairs.len(), "number {number}: a copy was taken for the object");
        }
        ambiguous += u32::from(matches!(twice, Outcome::Ambiguous(_)));
    }
    println!("{ambiguous} of {tried} ambiguous; without the copy {alone} referenced");
    assert!(3 * ambiguous > 2 * alone, "{ambiguous} of {alone} that would be referenced without the copy");
    assert!(2 * alone > tried, "{alone} of {tried} would be referenced without the copy");
}

/// Candidates beyond the shells and points that are no candidates change nothing.
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
            let problem = Problem { model: &file.model, cloud, candidates, tolerance, prior: file.prior.as_ref() };
            RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0))
        };
        assert_eq!(search(&file.cloud, &candidates), search(&more, &candidates), "number {number}");
    }
}

/// Without a prior a few cloud points far away, wrong matches of what is distant, keep no object from being found: it is as
/// often as without them, and costs as much; but for those just believed, as the box of what is near reaches half of the object's
/// length farther where it is not all there is (30, 30 and 30 of 32: for a pose in three times the volume one is absent with 4.5e-5
/// instead of 1.6e-5, the other as with two points 40 cm outside its box and no far ones).
///
/// Seen to fail where clutter is as thin as the box of all points is large (9, 0 and 0 of 32 are found), and where rounding
/// is a share of the farthest coordinate, so that every distance agrees.
#[test]
fn a_few_points_far_away_hide_no_object() {
    let (mut alone, mut beside) = (0, [0; 3]);
    let mut pair_tests = [0; 2];
    for number in 0..150 {
        let generated = Generated::new(Family::A, 17, number, Presence::Present);
        let truth = Transform::from_rows(&generated.truth.t_cam_obj).expect("it was made of a rigid motion").inverse();
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
            assert!(off <= LIMIT, "number {number}, points {far} m away: {off} m off");
            true
        };
        if fixed(0.0) {
            alone += 1;
            beside.iter_mut().zip([1e2, 1e5, 1e8]).for_each(|(found, far)| *found += u32::from(fixed(far)));
        }
    }
    println!("{alone} found, of them {beside:?} beside points far away; pair tests {pair_tests:?}");
    assert!(alone >= 20, "{alone} are too few to tell");
    assert!(beside.iter().all(|found| 10 * found >= 9 * alone), "{beside:?} of {alone}");
    // Three times as many frames, of a twelfth more points each: a fifth more pairs.
    assert!(pair_tests[1] < 6 * pair_tests[0], "{pair_tests:?} pair tests");
}

/// Nor do they make one of clutter, however few points are near and however many far, each by itself or in a group.
///
/// Seen to fail, with 17 of 800 frames, where clutter is as thin as the box of all points is large.
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
    assert!(wrong.is_empty(), "{} referenced: {wrong:?}", wrong.len());
}
