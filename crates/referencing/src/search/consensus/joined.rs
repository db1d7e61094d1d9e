//! Modes of points and edges together.

use std::collections::BTreeSet;

use nalgebra::{Cholesky, Matrix6, U6, Vector3, Vector6};
use seafix_geometry::so3::skew;

use super::{
    edge_terms::EdgeTerms,
    likelihood::{Mode, ln_volume},
    local_maxima::Climb,
    motion::Motion,
    solve6::{factor as factor_of, solve},
};
use crate::solve::likelihood::mixed::MIN_FEATURE_VALUE;

/// Maximum number of rounds of choosing features and fitting.
const ROUNDS: usize = 10;
/// Number of first rounds in which the error of the motion widens the gates of edges.
const LOOSE_ROUNDS: usize = 2;

type Factor = Cholesky<f64, U6>;

/// The ascent to modes of points and edges.
pub(in crate::search) struct Joined<'a> {
    pub(in crate::search) climb: &'a Climb<'a>,
    pub(in crate::search) edges: &'a EdgeTerms<'a>,
    /// Lines that no mode may use.
    pub(in crate::search) taken: &'a BTreeSet<usize>,
}

impl Joined<'_> {
    /// The mode reached from a motion with this information about its centroid.
    ///
    /// `None` if too few features fit, or if the evidence `min` (nats) is out of reach after the first rounds.
    pub(in crate::search) fn near(&self, start: &Motion, information: Option<&Factor>, min: f64) -> Option<Mode> {
        let mut motion = *start;
        let mut covariance = information.map(Cholesky::inverse);
        let mut known: Option<(Vec<usize>, Vec<usize>)> = None;
        for round in 0..ROUNDS {
            let about = motion.apply(&self.climb.prior_terms.centroid);
            let loose = covariance.as_ref().filter(|_| round < LOOSE_ROUNDS).map(|covariance| (covariance, &about));
            let edges = self.edges.choose(&motion, self.taken, loose);
            let points = self.climb.choose_any(&motion);
            if 2 * points.len() + 3 * edges.len() < MIN_FEATURE_VALUE {
                return None;
            }
            let stands = round >= LOOSE_ROUNDS && known.as_ref().is_some_and(|(p, e)| *p == points && *e == edges);
            let (next, factor) = self.fit(&points, &edges, &motion, if stands { 4 } else { 2 })?;
            motion = next;
            if stands {
                return self.mode(points, edges, motion, &factor);
            }
            if round == LOOSE_ROUNDS && self.evidence_bound(&points, &edges, &motion, &factor) < min {
                return None;
            }
            covariance = Some(factor.inverse());
            known = Some((points, edges));
        }
        let (points, edges) = known?;
        let (motion, factor) = self.fit(&points, &edges, &motion, 4)?;
        self.mode(points, edges, motion, &factor)
    }

    /// The approximate evidence of some features, those that no longer fit left out.
    fn evidence_bound(&self, points: &[usize], edges: &[usize], motion: &Motion, factor: &Factor) -> f64 {
        let Climb { terms, prior_terms, .. } = self.climb;
        let of_points: f64 = points.iter().filter_map(|&v| terms.of_pair(v, motion)).sum();
        let of_edge = |&v: &usize| {
            let vertex = &self.edges.vertices[v];
            Some(vertex.residual_gain(&vertex.placed(motion)?.residual).max(0.0))
        };
        let of_edges: f64 = edges.iter().filter_map(of_edge).sum();
        let fractions = terms.ln_fraction[points.len()] + self.edges.ln_fraction[edges.len()];
        of_points + of_edges + fractions + prior_terms.ln_density(motion) + ln_volume(factor)
    }

    /// The mode of some features at their MAP motion; `None` if the prior's box excludes it.
    pub(in crate::search) fn mode(
        &self,
        members: Vec<usize>,
        mut edges: Vec<usize>,
        motion: Motion,
        factor: &Factor,
    ) -> Option<Mode> {
        // The last step may move an edge off its line.
        edges.retain(|&v| self.edges.vertices[v].placed(&motion).is_some());
        let of_edges = self.edges.ln_ratio(&edges, &motion);
        self.climb.mode_with(members, edges, motion, factor, of_edges)
    }

    /// The MAP motion of some features near a start, and the factor of its information.
    pub(in crate::search) fn fit(
        &self,
        points: &[usize],
        edges: &[usize],
        start: &Motion,
        rounds: usize,
    ) -> Option<(Motion, Factor)> {
        let Climb { terms, prior_terms, .. } = self.climb;
        let mut motion = *start;
        let mut factor = None;
        for _ in 0..rounds {
            let about = motion.apply(&prior_terms.centroid);
            let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
            for &v in points {
                let pair = &terms.pairs[v];
                let place = motion.apply(&pair.model);
                let (lever, pull) = (place - about, pair.weight * (pair.cloud - place));
                let s = skew(&lever);
                let sw = s * pair.weight;
                add(&mut h, 0, 0, &(sw * s.transpose()));
                add(&mut h, 0, 3, &sw);
                add(&mut h, 3, 0, &sw.transpose());
                add(&mut h, 3, 3, &pair.weight);
                let turn: Vector3<f64> = lever.cross(&pull);
                g += Vector6::new(turn.x, turn.y, turn.z, pull.x, pull.y, pull.z);
            }
            for &v in edges {
                let vertex = &self.edges.vertices[v];
                let Some(placed) = vertex.placed(&motion) else { continue };
                let j = placed.derivative(&about);
                let weighted = j.transpose() * vertex.weight;
                h += weighted * j;
                g += weighted * placed.residual;
            }
            if let Some(known) = &prior_terms.known {
                h += known.information;
                g -= known.information * prior_terms.step_to(known, &motion);
            }
            let root = factor_of(&h)?;
            let step = solve(&root, &g);
            motion = motion.moved(&step.fixed_rows::<3>(0).into(), &step.fixed_rows::<3>(3).into(), &about);
            factor = Some(root);
        }
        Some((motion, factor?))
    }
}

fn add(h: &mut Matrix6<f64>, row: usize, column: usize, block: &nalgebra::Matrix3<f64>) {
    let mut part = h.fixed_view_mut::<3, 3>(row, column);
    part += block;
}
