//! An answer depends on the problem and on nothing else.

use std::collections::BTreeMap;

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use seafix_referencing::{
    Acceptance, Attempt, Correspondence, Mahalanobis, Outcome, RigidConsensus, problem_file::CoherenceProblem,
};
use seafix_simulation::families::{Family, Generated, Presence};

/// A permutation of the points of a problem: the new index k has the old point order[k].
struct Order {
    models: Vec<usize>,
    clouds: Vec<usize>,
}

impl Order {
    fn any(problem: &CoherenceProblem, rng: &mut ChaCha8Rng) -> Self {
        let mut shuffled = |n: usize| {
            let mut order: Vec<usize> = (0..n).collect();
            order.shuffle(rng);
            order
        };
        Self { models: shuffled(problem.model.len()), clouds: shuffled(problem.cloud.len()) }
    }

    fn of(&self, problem: &CoherenceProblem) -> CoherenceProblem {
        let place = |order: &[usize], old: usize| order.iter().position(|&one| one == old).expect("a permutation");
        let pair = |&(i, j): &(usize, usize)| (place(&self.models, i), place(&self.clouds, j));
        CoherenceProblem {
            model: self.models.iter().map(|&i| problem.model[i].clone()).collect(),
            cloud: self.clouds.iter().map(|&j| problem.cloud[j]).collect(),
            putative: problem.putative.as_ref().map(|pairs| pairs.iter().map(pair).collect()),
            ..problem.clone()
        }
    }

    /// The pairs by their old indices.
    fn back(&self, pairs: &[Correspondence]) -> Vec<Correspondence> {
        let old =
            |pair: &Correspondence| Correspondence { model: self.models[pair.model], cloud: self.clouds[pair.cloud] };
        let mut pairs: Vec<Correspondence> = pairs.iter().map(old).collect();
        pairs.sort_unstable();
        pairs
    }
}

fn attempt(problem: &CoherenceProblem) -> Attempt {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    problem.attempt(&RigidConsensus::default(), &Mahalanobis::default(), &Acceptance::default(), &mut rng)
}

/// P24 for the complete answer: its pairs, what is proved of it, and its NFA do not depend on the order of the points.
///
/// Seen to fail when the samples of the NFA depend on the indices of the points.
#[test]
fn the_order_of_the_points_changes_no_answer() {
    in_other_orders(2, 200, 1);
}

#[test]
#[ignore = "long: 112 problems, each in two other orders"]
fn no_order_of_the_points_changes_an_answer() {
    in_other_orders(8, 500, 2);
}

/// Tests problems of each family with and without the object, the first ones up to a number of points, each in several
/// other orders.
fn in_other_orders(problems: usize, max_points: usize, orders: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(24);
    let mut outcomes = BTreeMap::new();
    for family in Family::ALL {
        for presence in [Presence::Present, Presence::Absent] {
            let generated = (0..40).map(|number| Generated::new(family, 24, number, presence).problem.problem());
            for problem in generated.filter(|problem| problem.cloud.len() <= max_points).take(problems) {
                let first = attempt(&problem);
                *outcomes.entry(first.outcome.reason().unwrap_or("fix")).or_insert(0) += 1;
                for _ in 0..orders {
                    let order = Order::any(&problem, &mut rng);
                    let again = attempt(&order.of(&problem));
                    let name = format!("{} ({presence:?})", problem.id);
                    assert_eq!(first.outcome.reason(), again.outcome.reason(), "{name}");
                    if let (Outcome::Fix(one), Outcome::Fix(other)) = (&first.outcome, &again.outcome) {
                        assert_eq!(one.pairs, order.back(&other.pairs), "{name}");
                        let apart = one.object_from_camera.inverse() * other.object_from_camera;
                        assert!(apart.translation().norm() < 1e-9 && apart.rotation().angle() < 1e-9, "{name}");
                    }
                    assert_eq!(
                        (first.optimal, first.consensus_bound),
                        (again.optimal, again.consensus_bound),
                        "{name}"
                    );
                    match (first.nfa, again.nfa) {
                        (Some(one), Some(other)) => {
                            assert!((one - other).abs() <= 1e-6 * one, "{name}: {one}, {other}");
                        }
                        (one, other) => assert_eq!(one, other, "{name}"),
                    }
                }
            }
        }
    }
    assert!(outcomes.len() > 2 && outcomes["fix"] > problems, "{outcomes:?}");
}
