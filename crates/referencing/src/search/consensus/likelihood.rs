//! The likelihood ratio of a pose against clutter alone.

use std::cmp::Ordering;

use nalgebra::{Cholesky, Matrix3, Matrix6, U6, Vector3};
use seafix_geometry::{Camera, UncertainPoint, so3::skew};

use super::{
    edge_terms::EdgeTerms, fit::fit, fractions::fractions, graph::ConsistencyGraph, motion::Motion,
    prior_terms::PriorTerms, solve6::factor as factor_of,
};
use crate::search::consensus::gaussian::{HALF_LN_2PI, half_ln_det};
use crate::{
    parts::Parts,
    problem::{Correspondence, Problem, Tolerance},
};

/// Gate of a pair about its place under the pose (χ²₃).
const FAR: f64 = 25.0;

/// Number of Gauss–Newton rounds of a pose of some members of a mode.
const REFIT_ROUNDS: usize = 4;

/// Rounding error of a coordinate relative to the greatest.
const ROUNDING: f64 = 1e-9;

/// The likelihood term of one pair.
#[derive(Clone, Copy)]
pub(in crate::search) struct Term {
    /// The measured place.
    pub(in crate::search) cloud: Vector3<f64>,
    /// The place in the model.
    pub(in crate::search) model: Vector3<f64>,
    /// The inverse covariance of the measurement.
    pub(in crate::search) weight: Matrix3<f64>,
    /// Upper bound of the variance of the error along any direction (m²).
    pub(in crate::search) variance: f64,
    /// ln of the likelihood ratio at zero residual.
    pub(in crate::search) gain: f64,
}

impl Term {
    /// ln of the likelihood ratio with this residual (m); `None` beyond the gate.
    #[inline]
    pub(in crate::search) fn of_residual(&self, r: &Vector3<f64>) -> Option<f64> {
        let d2 = self.distance(r);
        (d2 <= FAR).then_some(self.gain - 0.5 * d2)
    }

    /// χ² of a residual (m).
    #[inline]
    pub(in crate::search) fn distance(&self, r: &Vector3<f64>) -> f64 {
        r.dot(&(self.weight * r))
    }
}

/// The likelihood terms of a problem's pairs.
///
/// A true pair contributes ln N(c − p; 0, Σ) − ln ρ to the log-likelihood ratio against clutter, with the density ρ
/// (1/m³) of cloud points about the predicted place of the model point. The number of visible points is unknown: all
/// numbers from 0 to n are equally probable, and one set of k has the probability B(k) = k! (n − k)! / (n + 1)!.
pub(in crate::search) struct PairTerms {
    /// The term of each vertex.
    pub(in crate::search) pairs: Vec<Term>,
    /// ln of the density of cloud points about each predicted place; without a prior, that of the complete cloud.
    pub(in crate::search) ln_density: Vec<f64>,
    /// The excess density of each vertex's part over the cloud (nats), without a prior; empty with one.
    excess: Vec<f64>,
    /// ln of the posterior volumes of 0…n points, for points with the average position and covariance of the
    /// candidates.
    pub(in crate::search) ln_volume: Vec<f64>,
    /// ln B(k), k = 0…n.
    pub(in crate::search) ln_fraction: Vec<f64>,
}

impl PairTerms {
    pub(in crate::search) fn of(problem: &Problem<'_>, prior_terms: &PriorTerms, graph: &ConsistencyGraph) -> Self {
        // A model point for which a matcher proposed no partner could not be identified if it were visible, nor any without
        // measured points.
        let n = match problem.prior {
            Some(_) if problem.cloud.is_empty() => 0,
            Some(_) => problem.candidates.lists.len(),
            None => graph.starts.len() - 1,
        };
        let ln_density = densities(problem, prior_terms);
        let count = graph.vertices.len();
        let of_parts = |parts: &Parts| graph.vertices.iter().map(|pair| parts.ln_excess(pair.cloud)).collect();
        let excess = prior_terms.parts.as_ref().map_or_else(Vec::new, of_parts);
        let pairs = Vec::with_capacity(count);
        let mut terms = Self { pairs, ln_density, excess, ln_volume: Vec::new(), ln_fraction: fractions(n) };
        let turned = prior_terms.known.as_ref().map_or(Matrix3::identity(), |known| known.motion.rotation);
        // A point without noise counts as good as a twenty-fifth of its part of the tolerance.
        let min = match problem.tolerance {
            Tolerance::Fixed(delta) => (0.02 * delta).powi(2),
            Tolerance::Sigmas(_) => (ROUNDING * extent(problem)).powi(2),
        };
        // The average information of one pair on the motion: Jᵀ W J (about the centroid).
        let mut average = Matrix6::zeros();
        // Many pairs share a covariance: the last inverse is kept.
        let mut last: Option<(Matrix3<f64>, Matrix3<f64>, f64, f64)> = None;
        for (v, pair) in graph.vertices.iter().enumerate() {
            let (seen, known) = (&problem.cloud[pair.cloud].position, &problem.model[pair.model]);
            let own = known.sigma * known.sigma + min;
            let noise = seen.covariance + Matrix3::identity() * own;
            let (weight, ln_peak, variance) = match last {
                Some((of, weight, ln_peak, variance)) if of == noise => (weight, ln_peak, variance),
                _ => {
                    let (weight, ln_peak) = peak(&noise);
                    (weight, ln_peak, noise.symmetric_eigenvalues().max())
                }
            };
            last = Some((noise, weight, ln_peak, variance));
            let gain = ln_peak - terms.ln_density_about(v, pair.model);
            terms.pairs.push(Term { cloud: seen.at.coords, model: known.at.coords, weight, variance, gain });
            average += information(&(turned * (known.at.coords - prior_terms.centroid)), &weight);
        }
        average /= count.max(1) as f64;
        terms.ln_volume = volumes(&average, prior_terms, graph.starts.len() - 1);
        terms
    }

    /// ln of the density of clutter about a vertex of a model point.
    pub(in crate::search) fn ln_density_about(&self, v: usize, model: usize) -> f64 {
        self.ln_density[model] + self.excess.get(v).copied().unwrap_or(0.0)
    }

    /// The log-likelihood ratio of one pair under a pose, without a gate.
    pub(in crate::search) fn residual_gain(&self, v: usize, motion: &Motion) -> f64 {
        let pair = &self.pairs[v];
        pair.gain - 0.5 * pair.distance(&(pair.cloud - motion.apply(&pair.model)))
    }

    /// The log-likelihood ratio of one pair under a pose; `None` beyond the gate.
    pub(in crate::search) fn of_pair(&self, v: usize, motion: &Motion) -> Option<f64> {
        let pair = &self.pairs[v];
        pair.of_residual(&(pair.cloud - motion.apply(&pair.model)))
    }
}

/// ln posterior volumes 3 ln 2π − ½ ln det (P + k H₁) for k = 0…n; H₁ is the average information of one pair.
fn volumes(average: &Matrix6<f64>, prior_terms: &PriorTerms, n: usize) -> Vec<f64> {
    let of = |h: Matrix6<f64>| factor_of(&h).map_or(f64::INFINITY, |chol| ln_volume(&chol));
    match &prior_terms.known {
        Some(known) => (0..=n).map(|k| of(known.information + average * k as f64)).collect(),
        None => {
            let one = of(*average);
            (0..=n).map(|k| one - 3.0 * libm::log(k.max(1) as f64)).collect()
        }
    }
}

/// The greatest coordinate of the model (m).
fn extent(problem: &Problem<'_>) -> f64 {
    problem.model.iter().map(|point| point.at.coords.amax()).fold(f64::MIN_POSITIVE, f64::max)
}

/// The information of a measurement and ln of its density at zero; zero information without a covariance.
fn peak(noise: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    match noise.cholesky() {
        Some(chol) => {
            let ln_peak = -half_ln_det(&chol) - 3.0 * HALF_LN_2PI;
            (chol.inverse(), ln_peak)
        }
        None => (Matrix3::zeros(), f64::NEG_INFINITY),
    }
}

/// ln ρ about each model point.
fn densities(problem: &Problem<'_>, prior_terms: &PriorTerms) -> Vec<f64> {
    let lists = &problem.candidates.lists;
    let Some(known) = &prior_terms.known else {
        let ln_volume = prior_terms.parts.as_ref().map_or(f64::INFINITY, Parts::ln_full);
        return lists.iter().map(|list| libm::log(list.len().max(1) as f64) - ln_volume).collect();
    };
    let column = |axis: usize| problem.cloud.iter().map(|point| point.position.at.coords[axis]).collect::<Vec<f64>>();
    let (x, y, z) = (column(0), column(1), column(2));
    known
        .places
        .iter()
        .map(|(place, spread)| {
            // A box prior bounds the candidates: beyond its gate their density may be another.
            let half = known.half.map_or(spread * super::prior_terms::BOUND_SIGMAS, Vector3::repeat);
            let count = inside((&x, &y, &z), place, &half);
            libm::log(count.max(1) as f64)
                - (half * 2.0).iter().map(|side| libm::log(side.max(f64::MIN_POSITIVE))).sum::<f64>()
        })
        .collect()
}

/// The number of places in a box of these half-sizes about another.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn inside((x, y, z): (&[f64], &[f64], &[f64]), place: &Vector3<f64>, half: &Vector3<f64>) -> u64 {
    // No closures: they are not compiled for the same target.
    let mut count = 0;
    for ((x, y), z) in x.iter().zip(y).zip(z) {
        let near = ((x - place.x).abs() <= half.x) & ((y - place.y).abs() <= half.y) & ((z - place.z).abs() <= half.z);
        count += u64::from(near);
    }
    count
}

/// ln of the density of a measurement given its place in the model, whose coordinates have a variance (m²); `None`
/// beyond the gate.
pub(in crate::search) fn ln_measured(
    seen: &UncertainPoint<Camera>,
    variance: f64,
    place: &Vector3<f64>,
) -> Option<f64> {
    let r = seen.at.coords - place;
    let noise = seen.covariance + Matrix3::identity() * variance;
    let far = FAR * noise.trace();
    // χ² is at least r²/tr Σ.
    let (weight, ln_peak) = (r.norm_squared() <= far).then(|| peak(&noise))?;
    let d2 = r.dot(&(weight * r));
    (d2 <= FAR).then_some(ln_peak - 0.5 * d2)
}

/// A pose with its pairs: a local maximum of the posterior density.
#[derive(Debug, Clone)]
pub(in crate::search) struct Mode {
    /// Vertices, ascending.
    pub(in crate::search) members: Vec<usize>,
    /// The vertices of edges, ascending.
    pub(in crate::search) edges: Vec<usize>,
    pub(in crate::search) motion: Motion,
    /// ln of the evidence ratio against absence by Laplace's approximation: the likelihood ratio and the prior density
    /// at the maximum, times the posterior volume (2π)³/√det H.
    pub(in crate::search) ln_evidence: f64,
    /// The evidence under uniform clutter.
    pub(in crate::search) ln_uniform: f64,
    /// The evidence lost to dense clutter (nats).
    pub(in crate::search) ln_clutter_density: f64,
}

impl Mode {
    /// The order by falling evidence; modes of equal evidence are ordered by their members and edges.
    pub(in crate::search) fn by_evidence(&self, other: &Self) -> Ordering {
        (other.ln_evidence.total_cmp(&self.ln_evidence))
            .then_with(|| self.members.cmp(&other.members))
            .then_with(|| self.edges.cmp(&other.edges))
    }

    /// The pairs, in the order of the model points.
    pub(in crate::search) fn pairs(&self, graph: &ConsistencyGraph) -> Vec<Correspondence> {
        let mut pairs: Vec<Correspondence> = self.members.iter().map(|&v| graph.vertices[v]).collect();
        pairs.sort_unstable();
        pairs
    }

    /// The pairs of edges, in the order of the model.
    pub(in crate::search) fn edge_pairs(&self, edges: &EdgeTerms<'_>) -> Vec<Correspondence> {
        let mut pairs: Vec<Correspondence> = self.edges.iter().map(|&v| edges.vertices[v].pair).collect();
        pairs.sort_unstable();
        pairs
    }

    /// The pairs in ascending order of their residuals.
    pub(in crate::search) fn closest_first(&self, terms: &PairTerms, graph: &ConsistencyGraph) -> Vec<Correspondence> {
        let mut members: Vec<(f64, usize)> =
            self.members.iter().map(|&v| (terms.pairs[v].gain - terms.residual_gain(v, &self.motion), v)).collect();
        members.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        members.into_iter().map(|(_, v)| graph.vertices[v]).collect()
    }

    /// ln evidence of some members alone, without the probability of their number; zero if they determine no pose.
    pub(in crate::search) fn ln_evidence_of(
        &self,
        terms: &PairTerms,
        prior_terms: &PriorTerms,
        members: &[usize],
    ) -> f64 {
        if members.len() < 3 && prior_terms.known.is_none() {
            return 0.0;
        }
        self.refitted(terms, prior_terms, members).map_or(0.0, |(ln_evidence, ..)| ln_evidence)
    }

    /// The evidence (ln) of some members alone, without the probability of their number; their pose, and the Cholesky
    /// factor of its information. `None` if they determine no pose.
    pub(super) fn refitted(
        &self,
        terms: &PairTerms,
        prior_terms: &PriorTerms,
        members: &[usize],
    ) -> Option<(f64, Motion, Cholesky<f64, U6>)> {
        let (motion, factor) = fit(terms, prior_terms, members, &self.motion, REFIT_ROUNDS)?;
        let gains: f64 = members.iter().map(|&v| terms.residual_gain(v, &motion)).sum();
        Some((gains + prior_terms.ln_density(&motion) + ln_volume(&factor), motion, factor))
    }

    /// Whether a vertex is a member.
    pub(in crate::search) fn holds(&self, v: usize) -> bool {
        self.members.binary_search(&v).is_ok()
    }
}

/// Jᵀ W J of a point with this lever about the centroid.
fn information(lever: &Vector3<f64>, w: &Matrix3<f64>) -> Matrix6<f64> {
    let s = skew(lever);
    let sw = s * w;
    let mut h = Matrix6::zeros();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&(sw * s.transpose()));
    h.fixed_view_mut::<3, 3>(0, 3).copy_from(&sw);
    h.fixed_view_mut::<3, 3>(3, 0).copy_from(&sw.transpose());
    h.fixed_view_mut::<3, 3>(3, 3).copy_from(w);
    h
}

/// ln of the volume of a posterior with this information: (2π)³/√det H.
pub(in crate::search) fn ln_volume(information: &Cholesky<f64, U6>) -> f64 {
    6.0 * HALF_LN_2PI - half_ln_det(information)
}
