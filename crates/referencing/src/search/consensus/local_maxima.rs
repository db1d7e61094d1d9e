//! Ascent from a prior motion to the local maximum of the posterior density.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Cholesky, U6, Vector3};

use super::{
    bits::is_set,
    fit::{Linear, fit, fit_on},
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms, ln_volume},
    motion::Motion,
    prior_terms::PriorTerms,
};
use crate::{search::limits::NEEDED, site::model::ModelPoint};

/// Maximum number of rounds of choosing pairs and fitting.
const ROUNDS: usize = 8;
/// Allowance (nats) for pairs that join a set only once its motion is fitted.
const JOINING: f64 = 8.0;
/// Allowance (nats) for large rotations in the prediction of a step. More costs time, less loses modes; the prediction
/// is seldom off by a nat.
const TURNING: f64 = 3.0;

type Factor = Cholesky<f64, U6>;

/// The modes of one problem, by iterated choice of pairs and fit.
pub(in crate::search) struct Climb<'a> {
    pub(in crate::search) model: &'a [ModelPoint],
    pub(in crate::search) terms: &'a PairTerms,
    pub(in crate::search) prior_terms: &'a PriorTerms,
    pub(in crate::search) graph: &'a ConsistencyGraph,
    /// Cloud points that no mode may use.
    pub(in crate::search) taken: &'a BTreeSet<usize>,
    /// Number of pairs compared with a motion so far.
    pub(in crate::search) compared: Cell<u64>,
}

impl<'a> Climb<'a> {
    /// The ascent among these pairs without the cloud points in `taken`.
    pub(in crate::search) fn new(
        model: &'a [ModelPoint],
        (terms, prior_terms, graph): (&'a PairTerms, &'a PriorTerms, &'a ConsistencyGraph),
        taken: &'a BTreeSet<usize>,
    ) -> Self {
        Self { model, terms, prior_terms, graph, taken, compared: Cell::new(0) }
    }

    /// Alternates the choice of pairs and the fit until the choice is stable.
    ///
    /// `None` as soon as the evidence `min` (nats) is out of reach, or if an ascent from the first choice was made
    /// before (`climbed`).
    pub(in crate::search) fn from(
        &self,
        members: &[usize],
        start: &Motion,
        min: f64,
        climbed: impl FnOnce(&[usize]) -> bool,
    ) -> Option<Mode> {
        // Most sets near the pose of three noisy points fit no motion: this is detected before the first step.
        let first = Linear::at(self.terms, self.prior_terms, members, start)?;
        if self.predicted_bound(members, &first) + TURNING < min {
            return None;
        }
        let (mut motion, factor) = fit_on(first, self.terms, self.prior_terms, members, 2)?;
        if self.evidence_bound(members, &motion, &factor) < min {
            return None;
        }
        let mut chosen = self.choose(&motion);
        if chosen.len() < NEEDED || climbed(&chosen) {
            return None;
        }
        let mut stands = chosen == members;
        for _ in 1..ROUNDS {
            if stands {
                break;
            }
            (motion, _) = fit(self.terms, self.prior_terms, &chosen, &motion, 2)?;
            let next = self.choose(&motion);
            if next.len() < NEEDED {
                return None;
            }
            stands = next == chosen;
            chosen = next;
        }
        let (motion, factor) = fit(self.terms, self.prior_terms, &chosen, &motion, 4)?;
        self.mode(chosen, motion, &factor)
    }

    /// The mode reached from a motion.
    pub(in crate::search) fn near(&self, motion: &Motion) -> Option<Mode> {
        let members = self.choose(motion);
        if members.len() < NEEDED {
            return None;
        }
        self.from(&members, motion, f64::NEG_INFINITY, |_| false)
    }

    /// The mode of these pairs (ascending) under their MAP motion; `None` if the prior's box excludes the motion.
    pub(in crate::search) fn mode(&self, members: Vec<usize>, motion: Motion, factor: &Factor) -> Option<Mode> {
        self.mode_with(members, Vec::new(), motion, factor, 0.0)
    }

    /// The mode of these pairs and edges; `of_edges` is the log-likelihood ratio of the edges.
    pub(super) fn mode_with(
        &self,
        members: Vec<usize>,
        edges: Vec<usize>,
        motion: Motion,
        factor: &Factor,
        of_edges: f64,
    ) -> Option<Mode> {
        if !self.prior_terms.holds(&motion, factor) {
            return None;
        }
        let gains: f64 = members.iter().map(|&v| self.terms.residual_gain(v, &motion)).sum();
        let score = gains + self.terms.ln_fraction[members.len()] + self.prior_terms.ln_density(&motion);
        // No posterior exceeds the prior in volume; for nearly collinear points without a prior, the first order would.
        let ln_evidence = score + of_edges + ln_volume(factor).min(-self.prior_terms.ln_peak);
        ln_evidence.is_finite().then_some(Mode {
            members,
            edges,
            motion,
            ln_evidence,
            ln_uniform: ln_evidence,
            ln_clutter_density: 0.0,
        })
    }

    /// Whether each of some pairs may be visible under a motion and is not too far from it.
    pub(in crate::search) fn allows(&self, members: &[usize], motion: &Motion) -> bool {
        let camera = self.sides(motion);
        members.iter().all(|&v| self.terms.of_pair(v, motion).is_some() && self.shows(v, camera.as_ref()))
    }

    /// The camera's position; `None` for a reflected model, whose points have no visible sides.
    fn sides(&self, motion: &Motion) -> Option<Vector3<f64>> {
        (motion.rotation.determinant() > 0.0).then(|| motion.origin())
    }

    /// Whether the model point of a vertex is visible to the camera.
    fn shows(&self, v: usize, camera: Option<&Vector3<f64>>) -> bool {
        camera.is_none_or(|camera| self.model[self.graph.vertices[v].model].shows_itself(camera))
    }

    /// Approximate evidence of the members that remain, with one or two pairs that may join them.
    fn evidence_bound(&self, members: &[usize], motion: &Motion, factor: &Factor) -> f64 {
        let gains = members.iter().filter_map(|&v| self.terms.of_pair(v, motion));
        self.ln_fraction_of(gains) + self.prior_terms.ln_density(motion) + ln_volume(factor) + JOINING
    }

    /// The approximate evidence ([`Self::evidence_bound`]) before the step.
    fn predicted_bound(&self, members: &[usize], linear: &Linear) -> f64 {
        let gains = members.iter().filter_map(|&v| linear.of_pair(self.terms, v));
        self.ln_fraction_of(gains) + linear.ln_density(self.prior_terms) + linear.ln_volume() + JOINING
    }

    /// The sum of the gains and ln B of their number; −∞ if too few remain.
    fn ln_fraction_of(&self, gains: impl Iterator<Item = f64>) -> f64 {
        let (k, sum) = gains.fold((0, 0.0), |(k, sum), gain| (k + 1, sum + gain));
        if k < NEEDED - 1 { f64::NEG_INFINITY } else { sum + self.terms.ln_fraction[k] }
    }

    /// The maximum-likelihood one-to-one set under a motion.
    ///
    /// Greedy: the better of two pairs that share a model point or a cloud point wins, so that a model point that loses
    /// its best pair to another takes its next. The set keeps the number of pairs that maximises the likelihood.
    fn choose(&self, motion: &Motion) -> Vec<usize> {
        self.choose_with_min(NEEDED, motion)
    }

    /// The set of [`choose`](Self::choose) with any number of pairs, as edges may determine the motion.
    pub(in crate::search) fn choose_any(&self, motion: &Motion) -> Vec<usize> {
        self.choose_with_min(0, motion)
    }

    fn choose_with_min(&self, min: usize, motion: &Motion) -> Vec<usize> {
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
        let nothing = if min == 0 { self.terms.ln_fraction[0] } else { f64::NEG_INFINITY };
        let (mut sum, mut max, mut keep) = (0.0, nothing, min.min(best.len()));
        for (k, (gain, _)) in best.iter().enumerate() {
            sum += gain;
            let total = sum + self.terms.ln_fraction[k + 1];
            if k + 1 >= min && total > max {
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
    use crate::{
        candidates::Candidates,
        problem::{Problem, Tolerance},
    };

    /// Two model points 10 cm apart are both nearest to a cloud point between them; the second has another 7 cm beyond.
    ///
    /// Fails if each model point has its best pair only.
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
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("a box");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = PairTerms::of(&problem, &prior_terms, &graph);
        let taken = BTreeSet::new();
        let climb = Climb::new(&model, (&terms, &prior_terms, &graph), &taken);
        let chosen = climb.choose(&Motion { rotation: Matrix3::identity(), translation: Vector3::zeros() });
        let mut pairs: Vec<(usize, usize)> =
            chosen.iter().map(|&v| (graph.vertices[v].model, graph.vertices[v].cloud)).collect();
        pairs.sort_unstable();
        assert_eq!(pairs, [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4)]);
    }
}
