//! The number of false alarms of a mode with edges.

use std::collections::BTreeSet;

use seafix_geometry::{Camera, Object, Transform};

use super::{
    edge_terms::{EdgeTerms, EdgeVertex},
    graph::ConsistencyGraph,
    joined::Joined,
    likelihood::{Mode, PairTerms},
    local_maxima::Climb,
    motion::Motion,
    prior_terms::PriorTerms,
    resembling,
};
use crate::{problem::Problem, search::features::FeatureSet};

/// What speaks for a set that a search counted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Counted {
    /// ln of the number of false alarms.
    pub(crate) ln_nfa: f64,
    /// ln of the evidence of the pose against clutter alone.
    pub(crate) ln_evidence: f64,
    /// ln of the evidence of another structure of the object's kind, likewise.
    pub(crate) ln_resembling: f64,
}

/// Number of steps from the pose of a set to that with its prior.
const STEPS: usize = 4;

/// The gates: χ² of four and of three degrees of freedom at 50, 75, 90 and 99 %.
const GATES: [[f64; 2]; 4] = [[3.357, 2.366], [5.385, 4.108], [7.779, 6.251], [13.277, 11.345]];

/// The expected number of poses within the prior that as many features of clutter fit as well.
///
/// Null: the directions of the lines are as they are; their offsets, and the points, are uniform in their gates. The
/// prior holds √(|H|/|H₀|) distinct poses, H the information at the mode and H₀ that of the prior. At one pose, model
/// feature i has a fitting partner with the probability p_i = 1 − exp(−ρ_i V_i), ρ_i the density of its clutter and V_i
/// the volume of its gate; the number that fit is a sum of independent trials. Four gates are tried, so that a set that
/// fits well counts more, and their number multiplies the least of their values. `None` without a prior.
pub(in crate::search) fn ln_nfa(joined: &Joined<'_>, mode: &Mode) -> Option<f64> {
    let known = joined.climb.prior_terms.known.as_ref()?;
    let (_, factor) = joined.fit(&mode.members, &mode.edges, &mode.motion, 1)?;
    let half_ln_det = |l: nalgebra::Matrix6<f64>| libm::log(l.diagonal().product());
    let ln_poses = (half_ln_det(factor.l()) - half_ln_det(known.information.cholesky()?.l())).max(0.0);
    let of_gate = |gate: [f64; 2]| ln_poses + ln_tail(&probabilities(joined, gate), fitting(joined, mode, gate));
    let min = GATES.into_iter().map(of_gate).fold(f64::INFINITY, f64::min);
    Some(min + libm::log(GATES.len() as f64))
}

/// [`ln_nfa`] of a set with edges that a search counted, about a pose of the set, and the evidence (nats) of the set.
///
/// Pairs that the prior's largest rotation excludes do not count. `None` without a prior, and for a set that fits no
/// motion.
pub(crate) fn of_counted(
    problem: &Problem<'_>,
    set: &FeatureSet,
    camera_from_object: &Transform<Camera, Object>,
) -> Option<Counted> {
    let prior_terms = PriorTerms::of(problem)?;
    prior_terms.known.as_ref()?;
    let graph = ConsistencyGraph::of(problem, &prior_terms);
    let terms = PairTerms::of(problem, &prior_terms, &graph);
    let edges = EdgeTerms::of(problem, &prior_terms)?;
    let none = BTreeSet::new();
    let climb = Climb::new(problem.model, (&terms, &prior_terms, &graph), &none);
    let joined = Joined { climb: &climb, edges: &edges, taken: &none };
    let points = (0..graph.vertices.len()).filter(|&v| set.points.binary_search(&graph.vertices[v]).is_ok());
    let members: Vec<usize> = points.collect();
    let of_edges = (0..edges.vertices.len()).filter(|&v| set.edges.binary_search(&edges.vertices[v].pair).is_ok());
    let of_edges: Vec<usize> = of_edges.collect();
    let (motion, factor) = joined.fit(&members, &of_edges, &Motion::of(camera_from_object), STEPS)?;
    let mode = joined.mode(members, of_edges, motion, &factor)?;
    let ln_resembling = resembling::ln_evidence(&joined, &mode).unwrap_or(f64::NEG_INFINITY);
    Some(Counted { ln_nfa: ln_nfa(&joined, &mode)?, ln_evidence: mode.ln_evidence, ln_resembling })
}

/// The number of members of a mode within a gate.
fn fitting(joined: &Joined<'_>, mode: &Mode, [of_edges, of_points]: [f64; 2]) -> usize {
    let EdgeTerms { vertices, .. } = joined.edges;
    let terms = joined.climb.terms;
    let edges = mode.edges.iter().filter(|&&v| {
        let placed = vertices[v].placed(&mode.motion);
        placed.is_some_and(|placed| placed.residual.dot(&(vertices[v].weight * placed.residual)) <= of_edges)
    });
    let points = mode.members.iter().filter(|&&v| {
        let pair = &terms.pairs[v];
        pair.distance(&(pair.cloud - mode.motion.apply(&pair.model))) <= of_points
    });
    edges.count() + points.count()
}

/// The probability of a partner within a gate by chance, for each model feature with candidates.
fn probabilities(joined: &Joined<'_>, [of_edges, of_points]: [f64; 2]) -> Vec<f64> {
    use std::f64::consts::PI;
    // The volume of a gate times the density at its peak.
    let edge_gate = of_edges * of_edges / 8.0;
    let point_gate = 4.0 * PI / 3.0 * libm::pow(of_points / (2.0 * PI), 1.5);
    let EdgeTerms { vertices, .. } = joined.edges;
    let mut all = Vec::new();
    let mut first = 0;
    while first < vertices.len() {
        let edge = vertices[first].pair.model;
        let end = first + vertices[first..].iter().take_while(|vertex| vertex.pair.model == edge).count();
        let of = |vertex: &EdgeVertex| edge_gate * libm::exp(-vertex.gain);
        let mean = vertices[first..end].iter().map(of).sum::<f64>() / (end - first) as f64;
        all.push(1.0 - libm::exp(-mean));
        first = end;
    }
    let (terms, graph) = (joined.climb.terms, joined.climb.graph);
    for rank in 0..graph.starts.len() - 1 {
        let gain = terms.pairs[graph.starts[rank]].gain;
        all.push(1.0 - libm::exp(-point_gate * libm::exp(-gain)));
    }
    all
}

/// ln of the probability that at least `count` of independent trials succeed.
fn ln_tail(trials: &[f64], count: usize) -> f64 {
    // The distribution up to `count`, the last entry for that many or more.
    let mut distribution = vec![0.0; count + 1];
    distribution[0] = 1.0;
    for p in trials {
        for k in (0..=count).rev() {
            let stays = if k == count { distribution[k] } else { distribution[k] * (1.0 - p) };
            distribution[k] = stays + if k > 0 { distribution[k - 1] * p } else { 0.0 };
        }
    }
    libm::log(distribution[count])
}

#[cfg(test)]
mod tests {
    use super::ln_tail;

    #[test]
    fn the_tail_is_that_of_the_binomial_distribution() {
        // 1 − (0.9⁴ + 4 · 0.1 · 0.9³) = 0.0523.
        assert!((ln_tail(&[0.1; 4], 2) - 0.0523_f64.ln()).abs() < 1e-12);
        assert_eq!(ln_tail(&[0.1; 4], 0), 0.0);
        assert_eq!(ln_tail(&[0.1; 4], 5), f64::NEG_INFINITY);
        assert!((ln_tail(&[0.5, 1.0], 2) - 0.5_f64.ln()).abs() < 1e-15);
    }
}
