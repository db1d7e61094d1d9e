//! The maximum clique of points and edges.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Transform};

use super::maximum_clique::MaximumClique;
use crate::{
    edge_coherence::PARALLEL,
    problem::Problem,
    search::{
        alike::largest_along_a_line,
        association::Association,
        clique::{self, MAX_ORIENTED},
        feature_pose::fitted,
        features::{FeatureSet, Features, enough},
        identification::{Identification, Rejected},
        limits::NEEDED,
        orientation::Sense,
    },
};

/// Maximum number of sets of the largest size that are compared: each has a fit of its own.
///
/// A millisecond each at worst. A set with edges comes in both directions where only angles of 90° fix them.
const MAX_TIES: usize = 64;
/// Maximum number of rounds of fitting and exchanging members.
const MAX_ROUNDS: usize = 8;

/// The answer to a problem with edges.
pub(super) fn search(settings: &MaximumClique, problem: &Problem<'_>) -> Result<Identification, Rejected> {
    let features = Features::of(problem).filtered(|all, v| all.edge(v).is_none_or(|edge| edge.depth));
    let (with_candidates, of_points) = features.available();
    if with_candidates < NEEDED || !enough(of_points, with_candidates - of_points) {
        return Err(Rejected::TooFewFeatures { points: of_points, edges: with_candidates - of_points });
    }
    if features.len() > settings.max_pairs {
        let bound = features.max_possible();
        return Err(Rejected::TooLarge {
            size: features.len(),
            what: "candidate pairs",
            max: settings.max_pairs,
            bound,
        });
    }
    let budget = settings.budget;
    let sense = if settings.orientation { Sense::Proper } else { Sense::Any };
    let graph = Association::with_edges(&features, sense);
    // The rest is for the proof that equally large sets are alike.
    let fraction = budget - budget / 4;
    let mut cliques = clique::Search::with_edges(&features, &graph, sense, fraction);
    let largest = cliques.run(1, MAX_TIES);
    let size = largest.found.first().map_or(0, Vec::len);
    let mut pair_tests = graph.pair_tests + (fraction - cliques.left());
    if size < NEEDED {
        return Err(match largest.complete {
            true => Rejected::NoConsensus { best: size, needed: NEEDED },
            false => Rejected::Budget { budget, best: size, bound: largest.bound, pair_tests },
        });
    }
    let image = match settings.orientation {
        true => larger_image(&features, size, cliques.left()),
        false => None,
    };
    if let Some(best) = image.filter(|_| size == NEEDED && largest.complete) {
        return Err(Rejected::Mirrored { best, proved: true });
    }
    let ties = polished(&features, &graph, largest.found);
    let best = &ties[0];
    let set = features.set(&best.vertices);
    let mut alternatives: Vec<FeatureSet> = ties.iter().map(|tie| features.set(&tie.vertices)).collect();
    alternatives.sort_by_cached_key(|other| (common(other, &set), other.clone()));
    alternatives.dedup();
    alternatives.retain(|other| *other != set);
    let (mut all, mut decided) = (largest.all, largest.all);
    if let Some(pose) = best.pose.filter(|_| !all || alternatives.len() > settings.alternatives) {
        let left = budget - fraction + cliques.left();
        let (alike, spent) = all_alike(&features, &best.vertices, &pose, sense, left);
        pair_tests += spent;
        if alike {
            decided = true;
            all = all && alternatives.len() <= settings.alternatives;
            alternatives.truncate(settings.alternatives);
        }
    }
    // Only the first members of a large set are tested for mirror images.
    let tested = !settings.orientation || size <= MAX_ORIENTED;
    let undecided = image
        .map(|best| Rejected::Mirrored { best, proved: false })
        .or_else(|| (!decided).then_some(Rejected::Budget { budget, best: size, bound: largest.bound, pair_tests }));
    let (alternatives, alternative_edges) = alternatives.into_iter().map(|other| (other.points, other.edges)).unzip();
    Ok(Identification {
        pairs: set.points,
        edges: set.edges,
        alternatives,
        alternative_edges,
        alternatives_complete: all && tested,
        optimal: largest.complete && tested,
        consensus_bound: largest.bound,
        pair_tests,
        undecided,
        posterior: None,
    })
}

/// The size of a mirror image of the model with more features than the best set, whose coherence is that of the image.
fn larger_image(features: &Features<'_>, size: usize, budget: u64) -> Option<usize> {
    let graph = Association::with_edges(features, Sense::Mirrored);
    let images = clique::Search::with_edges(features, &graph, Sense::Mirrored, budget.max(1)).run(size + 1, 1);
    images.found.first().map(Vec::len)
}

/// The number of common pairs of two sets.
fn common(one: &FeatureSet, other: &FeatureSet) -> usize {
    let points = one.points.iter().filter(|pair| other.points.binary_search(pair).is_ok()).count();
    points + one.edges.iter().filter(|pair| other.edges.binary_search(pair).is_ok()).count()
}

/// A clique with its pose.
struct Fitted {
    vertices: Vec<usize>,
    /// `None` for a set that determines no pose.
    pose: Option<Transform<Object, Camera>>,
    cost: f64,
}

/// The cliques, that of the lowest cost first, each with the members of least residual that keep it a clique.
///
/// Two images of one edge a few millimetres apart both agree with the others; the ties would be a product of such choices.
fn polished(features: &Features<'_>, graph: &Association, cliques: Vec<Vec<usize>>) -> Vec<Fitted> {
    let mut ties: Vec<Fitted> = cliques
        .into_iter()
        .map(|vertices| {
            let found = fitted(features.problem, &features.set(&vertices), None);
            let (pose, cost) = found.map_or((None, f64::INFINITY), |(pose, cost)| (Some(pose), cost));
            Fitted { vertices, pose, cost }
        })
        .collect();
    for tie in &mut ties {
        for _ in 0..MAX_ROUNDS {
            let Some(pose) = tie.pose else { break };
            let vertices = exchanged(features, graph, &tie.vertices, &pose);
            if vertices == tie.vertices {
                break;
            }
            let Some((pose, cost)) = fitted(features.problem, &features.set(&vertices), Some(&pose)) else { break };
            if !(cost < tie.cost) {
                break;
            }
            *tie = Fitted { vertices, pose: Some(pose), cost };
        }
    }
    // Costs that differ by rounding only are equal; then the order of the vertices decides.
    let rank = |tie: &Fitted| (tie.cost * 1e6).round();
    ties.sort_by(|a, b| rank(a).total_cmp(&rank(b)).then_with(|| a.vertices.cmp(&b.vertices)));
    ties
}

/// A clique in which each member in turn is replaced by the candidate of its model feature that is nearest to its place
/// under the pose and adjacent to all other members.
fn exchanged(
    features: &Features<'_>,
    graph: &Association,
    clique: &[usize],
    pose: &Transform<Object, Camera>,
) -> Vec<usize> {
    let mut members = clique.to_vec();
    for k in 0..members.len() {
        let own = members[k];
        let model = graph.vertices[own].model;
        let fits = |v: usize| (0..members.len()).all(|i| i == k || graph.adjacency.ones(v).any(|w| w == members[i]));
        let mut best = (features.fraction(pose, own), own);
        for v in (0..graph.vertices.len()).filter(|&v| v != own && graph.vertices[v].model == model) {
            let fraction = features.fraction(pose, v);
            if fraction < best.0 && fits(v) {
                best = (fraction, v);
            }
        }
        members[k] = best.1;
    }
    members.sort_unstable();
    members
}

/// The proof that every admissible set as large as the best has its pose, as `alike.rs` has it for points; with the work.
///
/// A set that shares more than h members with the pose has the pose, h the number of fitting features that determine
/// none: those along one line together with one family of parallel edges, which bounds both.
fn all_alike(
    features: &Features<'_>,
    best: &[usize],
    pose: &Transform<Object, Camera>,
    sense: Sense,
    budget: u64,
) -> (bool, u64) {
    let fits = |all: &Features<'_>, v: usize| all.fraction(pose, v) <= 1.0;
    let fitting: Vec<usize> = (0..features.len()).filter(|&v| fits(features, v)).collect();
    let set = features.set(&fitting);
    let mut models: Vec<usize> = set.points.iter().map(|pair| pair.model).collect();
    models.dedup();
    let places: Vec<Vector3<f64>> = models.iter().map(|&i| features.problem.model[i].at.coords).collect();
    let mut directions: Vec<(usize, Vector3<f64>)> =
        fitting.iter().filter_map(|&v| features.edge(v)).map(|edge| (edge.pair.model, edge.directed.along)).collect();
    directions.dedup_by_key(|(model, _)| *model);
    let undetermined = largest_along_a_line(&places) + largest_family(&directions);
    let common = (best.len() / 3).max(undetermined);
    let min = best.len().saturating_sub(common);
    if common < NEEDED || min < NEEDED {
        return (false, 0);
    }
    let rest = features.filtered(|all, v| !fits(all, v));
    let graph = Association::with_edges(&rest, sense);
    let mut cliques = clique::Search::with_edges(&rest, &graph, sense, budget);
    let largest = cliques.run(min, 1);
    (largest.complete && largest.found.is_empty(), budget - cliques.left())
}

/// The maximum number of directions that are parallel to one of them.
fn largest_family(directions: &[(usize, Vector3<f64>)]) -> usize {
    let parallel = |d: &Vector3<f64>| directions.iter().filter(|(_, e)| d.cross(e).norm() <= PARALLEL).count();
    directions.iter().map(|(_, d)| parallel(d)).max().unwrap_or(0)
}
