//! Solved problems and wrong answers for several settings of the acceptance.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_evaluation::Solved;
use seafix_geometry::{Camera, Object, Point, Transform};
use seafix_proptests::problems::Listed;
use seafix_referencing::{Acceptance, Attempt, Mahalanobis, MaxPWrong, Outcome, RigidConsensus, Search, judge};
use seafix_simulation::families::{Family, Generated, Presence};

/// The result of one generated problem.
struct Tried {
    /// Whether the problem has a solution.
    defined: bool,
    /// The probability that a pose is wrong which passes all other tests; 1 of any other.
    p_wrong: f64,
    /// The reason of the rejection by the default settings; `None` if they accept.
    refused: Option<&'static str>,
    right: bool,
    /// Whether the most probable pose is right, accepted or not.
    map_estimate: bool,
}

fn tried(family: Family, seed: u64, number: u64, presence: Presence) -> Tried {
    let generated = Generated::new(family, seed, number, presence);
    let listed = Listed::new(generated.problem.problem());
    let (file, problem) = (&listed.file, listed.problem());
    let truth =
        Transform::<Camera, Object>::from_rows(&generated.truth.t_cam_obj).expect("it is a rigid motion").inverse();
    let rule = Solved { ideal_rms: generated.truth.ideal_tre_rms, putative: file.putative.is_some() };
    let at: Vec<Point<Object>> = file.model.iter().map(|point| point.at).collect();
    let acceptance = Acceptance { max_p_wrong: MaxPWrong::Number(1.0), ..Acceptance::default() };
    let found = RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0));
    let posterior = found.as_ref().ok().and_then(|found| found.posterior.clone()).unwrap_or_default();
    let map_estimate =
        posterior.explanations.first().is_some_and(|best| rule.holds(&best.object_from_camera, &truth, &at));
    let (mut p_wrong, mut right) = (1.0, false);
    let solver = Mahalanobis::default();
    let by_default = judge(&problem, found.clone(), &solver, &Acceptance::default(), None);
    let refused = by_default.outcome.reason();
    let attempt = judge(&problem, found, &solver, &acceptance, None);
    // If every probability is accepted, any second pose is a copy, so the default's answer is judged as it is.
    let answers = [by_default, attempt].into_iter().find(|attempt| matches!(attempt.outcome, Outcome::Fix(_)));
    if let Some(Attempt { outcome: Outcome::Fix(reference), p_wrong: Some(stated), .. }) = answers {
        p_wrong = stated;
        right = rule.holds(&reference.object_from_camera, &truth, &at);
    }
    Tried { defined: generated.truth.pose_defined, p_wrong, refused, right, map_estimate }
}

/// Numbers of solved (of those with a solution), wrong (of the answers with the object present), and answered problems
/// without the object, for several values of `acceptance.max-p-wrong`.
///
/// `cargo test --release -p seafix-proptests acceptance:: -- --ignored --nocapture`; `ACCEPTANCE_FAMILIES` (abcdefg),
/// `ACCEPTANCE_PRESENT` (252) and `ACCEPTANCE_ABSENT` (252) frames of each family, `ACCEPTANCE_SEED` (21),
/// `ACCEPTANCE_PAIRS`, the maximum number of candidate pairs of a problem, `ACCEPTANCE_STEP`, the step of the problems'
/// numbers (3: those of 500 points in b, f and g).
#[test]
#[ignore = "table"]
fn what_is_solved_depends_on_what_is_believed() {
    let variable = |name: &str, default: &str| std::env::var(name).unwrap_or_else(|_| default.to_owned());
    let number = |name: &str, default: &str| -> u64 { variable(name, default).parse().expect("a number") };
    let (present, absent, seed) =
        (number("ACCEPTANCE_PRESENT", "252"), number("ACCEPTANCE_ABSENT", "252"), number("ACCEPTANCE_SEED", "21"));
    let (max, step) = (number("ACCEPTANCE_PAIRS", "4000000"), number("ACCEPTANCE_STEP", "1"));
    println!(
        "| family | accepted | solved % | wrong of answers | absent frames answered | most probable right % |\n|---|---|---|---|---|---|"
    );
    for name in variable("ACCEPTANCE_FAMILIES", "abcdefg").chars() {
        let letter = name.to_string();
        let family = Family::ALL.into_iter().find(|family| family.letter() == letter).expect("a family");
        let small = |k: &u64| {
            let problem = Generated::new(family, seed, *k, Presence::Present).problem.problem();
            problem.candidates().is_ok_and(|candidates| candidates.pairs() as u64 <= max)
        };
        let all = |count: u64, presence: Presence| -> Vec<Tried> {
            (0..)
                .step_by(step as usize)
                .filter(small)
                .take(count as usize)
                .map(|k| tried(family, seed, k, presence))
                .collect()
        };
        let (with, without) = (all(present, Presence::Present), all(absent, Presence::Absent));
        let defined = with.iter().filter(|one| one.defined).count();
        let map_estimate = with.iter().filter(|one| one.defined && one.map_estimate).count();
        let row = |what: String, answered: &dyn Fn(&Tried) -> bool| {
            let given: Vec<&Tried> = with.iter().filter(|one| answered(one)).collect();
            let right = given.iter().filter(|one| one.right).count();
            let false_answers = without.iter().filter(|one| answered(one)).count();
            println!(
                "| {name} | {what} | {:.1} | {}/{} | {false_answers}/{} | {:.1} |",
                100.0 * right as f64 / defined.max(1) as f64,
                given.len() - right,
                given.len(),
                without.len(),
                100.0 * map_estimate as f64 / defined.max(1) as f64,
            );
        };
        row("default".to_owned(), &|one| one.refused.is_none());
        for max in [0.5, 0.1, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 1e-4, 1e-5] {
            row(format!("{max:.0e}"), &|one| one.p_wrong <= max);
        }
        // The unsolved problems with a solution: reasons, with the most probable pose right and wrong.
        let mut reasons: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
        for one in with.iter().filter(|one| one.defined && !(one.refused.is_none() && one.right)) {
            reasons.entry(one.refused.unwrap_or("answered")).or_default()[usize::from(!one.map_estimate)] += 1;
        }
        println!("{name}, of {defined} not solved (most probable pose right, wrong): {reasons:?}");
    }
}
