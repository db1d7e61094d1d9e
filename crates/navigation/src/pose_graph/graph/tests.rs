use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

use super::*;

/// An approximately normal random number: the sum of twelve uniform ones.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.next_u32() as f64 / u32::MAX as f64).sum::<f64>() - 6.0
}

fn noise(rng: &mut ChaCha8Rng, sigma: &[f64; 6]) -> Vector6<f64> {
    Vector6::from_fn(|k, _| sigma[k] * normal(rng))
}

const EDGE_STEPS: [f64; 6] = [1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.01];
const LOOP: [f64; 6] = [2e-3, 2e-3, 2e-3, 0.01, 0.01, 0.02];
const FIX: [f64; 6] = [3e-3, 3e-3, 3e-3, 0.02, 0.02, 0.02];

fn covariance(sigma: &[f64; 6]) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::from_fn(|k, _| sigma[k] * sigma[k]))
}

fn local(motion: Pose, sigma: &[f64; 6]) -> RelativeMotion {
    RelativeMotion::new(motion.relabel(), Covariance6::new(covariance(sigma)))
}

/// Two rounds of twelve edges each; every edge turns by thirty degrees.
fn rounds() -> Vec<Pose> {
    let odometry_edge = Pose::exp(&[0.02, 0.01, std::f64::consts::TAU / 12.0, 1.0, 0.0, 0.05].into());
    let mut path = vec![Pose::exp(&[0.1, -0.2, 0.3, 5.0, 6.0, 7.0].into())];
    for k in 0..24 {
        let step = if k % 6 == 5 { Pose::exp(&(odometry_edge.log() * 0.9)) } else { odometry_edge };
        let here = *path.last().unwrap() * step.relabel();
        path.push(here);
    }
    path
}

struct Simulated {
    graph: FactorGraph,
    truth: Vec<Pose>,
    loops: Vec<usize>,
}

/// The simulated graph of both rounds with noise times `scale`: a prior of the first pose, odometry, and `loops`
/// loops.
fn sampled(seed: u64, scale: f64, loops: usize) -> Simulated {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let truth = rounds();
    let mut graph = FactorGraph::default();
    let mut measured =
        |motion: Pose, sigma: &[f64; 6]| local(motion.perturbed(&(noise(&mut rng, sigma) * -scale)), sigma);
    let start = measured(truth[0], &FIX);
    let mut here: Pose = start.motion.relabel();
    graph.node(here);
    graph.prior(0, here, &covariance(&FIX)).unwrap();
    for k in 1..truth.len() {
        let odometry_edge = measured((truth[k - 1].inverse() * truth[k]).relabel(), &EDGE_STEPS);
        here = here * odometry_edge.motion.relabel();
        graph.node(here);
        graph.between(k - 1, k, &odometry_edge, false).unwrap();
    }
    let mut numbers = Vec::new();
    for k in 0..loops {
        let (a, b) = (k * 3 % 12, 12 + k * 3 % 12);
        let found = measured((truth[a].inverse() * truth[b]).relabel(), &LOOP);
        numbers.push(graph.between(a, b, &found, true).unwrap());
    }
    Simulated { graph, truth, loops: numbers }
}

#[test]
fn exact_measurements_give_the_exact_poses_from_a_disturbed_start() {
    let Simulated { mut graph, truth, .. } = sampled(1, 0.0, 4);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for node in &mut graph.nodes {
        node.pose = node.pose.perturbed(&noise(&mut rng, &[0.05, 0.05, 0.05, 0.3, 0.3, 0.3]));
    }
    let solved = graph.solve().unwrap();
    for (k, truth) in truth.iter().enumerate() {
        assert!(solved.pose(k).error_to(truth).norm() < 1e-9, "{k}: {}", solved.pose(k).error_to(truth).norm());
    }
}

#[test]
fn jacobians_are_those_of_small_steps() {
    let Simulated { graph, .. } = sampled(3, 3.0, 2);
    let factor = &graph.factors[graph.factors.len() - 1];
    let from = factor.from.unwrap();
    let r = graph.residual(factor);
    let slope = right_jacobian_inverse(&r);
    let to_from_from = graph.nodes[factor.to].pose.inverse() * graph.nodes[from].pose;
    for (node, by) in [(factor.to, slope), (from, -slope * to_from_from.adjoint())] {
        for k in 0..6 {
            let moved = |step: f64| {
                let mut graph = graph.clone();
                let mut xi = Vector6::zeros();
                xi[k] = step;
                graph.nodes[node].pose = graph.nodes[node].pose.perturbed(&xi);
                graph.residual(factor)
            };
            let measured = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((measured - by.column(k)).norm() < 1e-7, "{node} {k}");
        }
    }
}

#[test]
fn pose_errors_are_consistent_with_the_graph() {
    let draws = 400;
    let (mut sums, mut relative) = ([0.0; 25], 0.0);
    for seed in 0..draws {
        let Simulated { graph, truth, .. } = sampled(100 + seed, 1.0, 4);
        let solved = graph.solve().unwrap();
        for (k, sum) in sums.iter_mut().enumerate() {
            let error = solved.pose(k).error_to(&truth[k]);
            *sum += error.dot(&(solved.covariance(k).matrix.try_inverse().unwrap() * error));
        }
        let local = solved.relative(3, 21).unwrap();
        let error = local.motion.error_to(&(truth[3].inverse() * truth[21]));
        relative += error.dot(&(local.covariance.matrix.try_inverse().unwrap() * error));
    }
    // The mean of 400 samples of χ²₆ has a standard deviation of √(12/400).
    let bound = 4.0 * (12.0 / draws as f64).sqrt();
    for (k, sum) in sums.iter().enumerate() {
        assert!((sum / draws as f64 - 6.0).abs() < bound, "{k}: {}", sum / draws as f64);
    }
    assert!((relative / draws as f64 - 6.0).abs() < bound, "relative: {}", relative / draws as f64);
}

#[test]
fn a_loop_never_makes_a_pose_less_certain() {
    for seed in 0..20 {
        let before = sampled(500 + seed, 1.0, 0).graph.solve().unwrap();
        let after = sampled(500 + seed, 1.0, 4).graph.solve().unwrap();
        for k in 0..25 {
            // Both covariances refer to their own estimate; the two frames differ slightly.
            let gain = before.covariance(k).matrix - after.covariance(k).matrix;
            let size = before.covariance(k).matrix.norm();
            assert!(gain.symmetric_eigenvalues().min() > -1e-2 * size, "{seed} {k}");
            assert!(after.covariance(k).position_rms() <= before.covariance(k).position_rms() * 1.001);
        }
    }
}

#[test]
fn a_wrong_loop_is_given_up_and_moves_nothing() {
    let mut wrong = 0;
    for seed in 0..1000 {
        let Simulated { mut graph, truth, loops } = sampled(2000 + seed, 1.0, 3);
        let right = graph.clone().solve().unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(9000 + seed);
        // A wrong loop, half a metre to two metres off.
        let mut off = noise(&mut rng, &[0.1, 0.1, 0.3, 1.0, 1.0, 0.3]);
        let length = off.fixed_rows::<3>(3).norm();
        off.fixed_rows_mut::<3>(3).scale_mut(length.clamp(0.5, 2.0) / length);
        let between: Pose = (truth[9].inverse() * truth[21]).relabel();
        let injected = graph.between(9, 21, &local(between.perturbed(&off), &LOOP), true).unwrap();
        let solved = graph.solve().unwrap();
        let kept = loops.iter().all(|one| !solved.given_up(*one));
        let moved = solved.pose(21).error_to(right.pose(21));
        let still = moved.fixed_rows::<3>(3).norm() < right.covariance(21).position_rms();
        wrong += usize::from(!(solved.given_up(injected) && kept && still));
    }
    assert!(wrong <= 1, "{wrong} of 1000");
}

#[test]
fn parts_without_a_place_are_known_relative_to_their_first() {
    let mut graph = FactorGraph::default();
    let step = Pose::exp(&[0.0, 0.0, 0.1, 1.0, 0.0, 0.0].into());
    for _ in 0..4 {
        graph.node(Pose::identity());
    }
    graph.between(0, 1, &local(step, &EDGE_STEPS), false).unwrap();
    graph.between(2, 3, &local(step, &EDGE_STEPS), false).unwrap();
    let solved = graph.solve().unwrap();
    let found = solved.relative(2, 3).unwrap();
    assert!((found.motion.matrix() - step.matrix()).amax() < 1e-12);
    assert!((found.covariance.matrix - covariance(&EDGE_STEPS)).amax() < 1e-12);
    assert_eq!(solved.relative(0, 3), None);
    assert!(FactorGraph::default().solve().is_some());
    assert_eq!(FactorGraph::default().clone().prior(0, step, &Matrix6::zeros()), Err(NoCovariance));
}
