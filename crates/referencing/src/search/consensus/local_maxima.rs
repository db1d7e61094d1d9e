//! From a rough motion to the maximum of the posterior near it.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Cholesky, U6, Vector3};

use super::{
    Motion,
    bits::is_set,
    fit::{Linear, fit, fit_on},
    graph::ConsistencyGraph,
    likelihood::{Mode, Terms, ln_volume},
    prior_terms::PriorTerms,
};
use crate::ModelPoint;

/// Rounds of choosing pairs and fitting.
const ROUNDS: usize = 8;
/// What pairs may bring that join a set only when its motion is fitted (nats).
const JOINING: f64 = 8.0;
/// What turns that are not small may hide of a motion's worth (nats). More costs time, less loses modes: what the step foretells
/// is seldom a nat off.
const TURNING: f64 = 3.0;
/// The least set that a pose can come from.
const MIN: usize = 3;

type Factor = Cholesky<f64, U6>;

/// Finds the modes of one problem.
pub(in crate::search) struct Climb<'a> {
    pub(in crate::search) model: &'a [ModelPoint],
    pub(in crate::search) terms: &'a Terms,
    pub(in crate::search) prior_terms: &'a PriorTerms,
    pub(in crate::search) graph: &'a ConsistencyGraph,
    /// Cloud points that no mode may use.
    pub(in crate::search) taken: &'a BTreeSet<usize>,
    /// Pairs compared with a motion so far.
    pub(in crate::search) compared: Cell<u64>,
}

impl Climb<'_> {
    /// Chooses pairs and fits in turn until the choice stands.
    ///
    /// `None` as soon as no evidence of `min` (nats) is in sight, or where the first choice is one that was `climbed` from before.
    pub(in crate::search) fn from(
        &self,
        members: &[usize],
        start: &Motion,
        min: f64,
        climbed: impl FnOnce(&[usize]) -> bool,
    ) -> Option<Mode> {
        // What fitted three noisy points roughly mostly fits no motion: that is seen at once.
        let first = Linear::at(self.terms, self.prior_terms, members, start)?;
        if self.foreseen(members, &first) + TURNING < min {
            return None;
        }
        let (mut motion, factor) = fit_on(first, self.terms, self.prior_terms, members, 2)?;
        if self.promise(members, &motion, &factor) < min {
            return None;
        }
        let mut chosen = self.choose(&motion);
        if chosen.len() < MIN || climbed(&chosen) {
            return None;
        }
        let mut stands = chosen == members;
        for _ in 1..ROUNDS {
            if stands {
                break;
            }
            (motion, _) = fit(self.terms, self.prior_terms, &chosen, &motion, 2)?;
            let next = self.choose(&motion);
            if next.len() < MIN {
                return None;
            }
            stands = next == chosen;
            chosen = next;
        }
        let (motion, factor) = fit(self.terms, self.prior_terms, &chosen, &motion, 4)?;
        self.mode(chosen, motion, &factor)
    }

    /// These pairs, ascending, under their most likely motion; `None` where it is none that a prior's box allows.
    pub(in crate::search) fn mode(&self, members: Vec<usize>, motion: Motion, factor: &Factor) -> Option<Mode> {
        if !self.prior_terms.holds(self.model, &motion, factor) {
            return None;
        }
        let gains: f64 = members.iter().map(|&v| self.terms.residual_gain(v, &motion)).sum();
        let score = gains + self.terms.ln_fraction[members.len()] + self.prior_terms.ln_density(&motion);
        // No posterior fills more than the prior: of points nearly in a row, without one, the first order says that.
        let ln_evidence = score + ln_volume(factor).min(-self.prior_terms.ln_peak);
        ln_evidence.is_finite().then_some(Mode {
            members,
            motion,
            ln_evidence,
            ln_even: ln_evidence,
            ln_clutter_density: 0.0,
        })
    }

    /// Whether each of some pairs may be seen under a motion, and is not too far from it.
    pub(in crate::search) fn allows(&self, members: &[usize], motion: &Motion) -> bool {
        let camera = self.sides(motion);
        members.iter().all(|&v| self.terms.of_pair(v, motion).is_some() && self.shows(v, camera.as_ref()))
    }

    /// Where the camera is; `None` for the image of a model, which has no sides.
    fn sides(&self, motion: &Motion) -> Option<Vector3<f64>> {
        (motion.rotation.determinant() > 0.0).then(|| motion.origin())
    }

    /// Whether the model point of a vertex shows itself to the camera.
    fn shows(&self, v: usize, camera: Option<&Vector3<f64>>) -> bool {
        camera.is_none_or(|camera| self.model[self.graph.vertices[v].model].shows_itself(camera))
    }

    /// About the evidence of those members that stay, and of one or two pairs that may join them.
    fn promise(&self, members: &[usize], motion: &Motion, factor: &Factor) -> f64 {
        let gains = members.iter().filter_map(|&v| self.terms.of_pair(v, motion));
        self.ln_fraction_of(gains) + self.prior_terms.ln_density(motion) + ln_volume(factor) + JOINING
    }

    /// The same before the step is made.
    fn foreseen(&self, members: &[usize], linear: &Linear) -> f64 {
        let gains = members.iter().filter_map(|&v| linear.of_pair(self.terms, v));
        self.ln_fraction_of(gains) + linear.ln_density(self.prior_terms) + linear.ln_volume() + JOINING
    }

    /// What pairs gain, with the share of their number; nothing where too few of them are left.
    fn ln_fraction_of(&self, gains: impl Iterator<Item = f64>) -> f64 {
        let (k, sum) = gains.fold((0, 0.0), |(k, sum), gain| (k + 1, sum + gain));
        if k < MIN - 1 { f64::NEG_INFINITY } else { sum + self.terms.ln_fraction[k] }
    }

    /// The likeliest one-to-one set under a motion: of pairs that share a model point or a cloud point the better, so that a model point
    /// that loses its best pair to another has its next, and of these as many as the likelihood gains by.
    fn choose(&self, motion: &Motion) -> Vec<usize> {
        self.compared.set(self.compared.get() + self.graph.vertices.len() as u64);
        let starts = &self.graph.starts;
        let mut best: Vec<(f64, usize)> = Vec::with_capacity(starts.len());
        let camera = self.sides(motion);
        for i in 0..starts.len() - 1 {
            if !self.shows(starts[i], camera.as_ref()) {
                continue;
            }
            let place = motion.apply(&self.model[self.graph.vertices[starts[i]].model].at.coords);
            for v in starts[i]..starts[i + 1] {
                let pair = &self.terms.pairs[v];
                if let Some(gain) = pair.of_residual(&(pair.cloud - place))
                    && !self.taken.contains(&self.graph.vertices[v].cloud)
                {
                    best.push((gain, v));
                }
            }
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut clouds = vec![0; self.graph.clouds.div_ceil(64)];
        let mut ranks = vec![0; starts.len().div_ceil(64)];
        best.retain(|&(_, v)| {
            let (cloud, rank) = (self.graph.vertices[v].cloud, self.graph.rank[v] as usize);
            let first = !is_set(&clouds, cloud) && !is_set(&ranks, rank);
            if first {
                clouds[cloud / 64] |= 1u64 << (cloud % 64);
                ranks[rank / 64] |= 1u64 << (rank % 64);
            }
            first
        });
        let (mut sum, mut max, mut keep) = (0.0, f64::NEG_INFINITY, MIN.min(best.len()));
        for (k, (gain, _)) in best.iter().enumerate() {
            sum += gain;
            let total = sum + self.terms.ln_fraction[k + 1];
            if k + 1 >= MIN && total > max {
                (max, keep) = (total, k + 1);
            }
        }
        let mut members: Vec<usize> = best[..keep].iter().map(|&(_, v)| v).collect();
        members.sort_unstable();
        members
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::{Candidates, Problem, Tolerance};

    /// Two model points 10 cm apart are both nearest to a cloud point between them; the second has another 7 cm beyond.
    ///
    /// Seen to fail where each model point has but its best pair.
    #[test]
    fn a_model_point_that_loses_its_best_pair_to_another_has_its_next() {
        let places = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [1.0, 0.0, 0.2], [0.0, 1.0, -0.3], [-0.8, -0.5, 0.4]];
        let model: Vec<ModelPoint> = places.iter().map(|at| ModelPoint::exact("", Vector3::from(*at).into())).collect();
        let seen = [[0.04, 0.0, 0.0], [0.17, 0.0, 0.0], [1.0, 0.0, 0.2], [0.0, 1.0, -0.3], [-0.8, -0.5, 0.4]];
        let measured = |at: &[f64; 3]| UncertainPoint::isotropic(Vector3::from(*at).into(), 0.03);
        let cloud: Vec<MeasuredPoint> =
            seen.iter().map(|at| MeasuredPoint { position: measured(at), pixels: None }).collect();
        let candidates = Candidates::all(5, 5);
        let tolerance = Tolerance::Fixed(0.2);
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None };
        let prior_terms = PriorTerms::of(&problem).expect("a box");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = Terms::of(&problem, &prior_terms, &graph);
        let (taken, compared) = (BTreeSet::new(), Cell::new(0));
        let climb =
            Climb { model: &model, terms: &terms, prior_terms: &prior_terms, graph: &graph, taken: &taken, compared };
        let chosen = climb.choose(&Motion { rotation: Matrix3::identity(), translation: Vector3::zeros() });
        let mut pairs: Vec<(usize, usize)> =
            chosen.iter().map(|&v| (graph.vertices[v].model, graph.vertices[v].cloud)).collect();
        pairs.sort_unstable();
        assert_eq!(pairs, [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4)]);
    }
}
