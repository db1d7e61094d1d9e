//! Upper bounds of the posterior volume relative to the prior.

use super::{gaussian::HALF_LN_2PI, graph::ConsistencyGraph, likelihood::PairTerms, prior_terms::PriorTerms};
use crate::site::model::ModelPoint;

/// Maximum number of model points for which triples are listed; beyond, the information bound is zero.
const MAX_POINTS: usize = 64;

/// ln of the posterior volume of k pairs times the maximum prior density, k = 0…n: an upper bound, at most zero.
///
/// About their weighted centroid the information of points with isotropic weights w_i consists of a block for the
/// translation and one for the rotation: det H = W³ det (tr(C) I − C), W = Σ w_i and C = Σ w_i l_i l_iᵀ. With the
/// elementary symmetric functions e of the eigenvalues of C, det (tr(C) I − C) = e₁e₂ − e₃ ≥ ⁸⁄₉ e₁e₂, where
///
/// W e₁ = Σ_{i<j} w_i w_j |p_i − p_j|²,  W e₂ = Σ_{i<j<l} w_i w_j w_l |(p_j − p_i) × (p_l − p_i)|².
///
/// For k points these are at least the sums of the smallest terms of as many pairs and triples. With a prior of
/// information P, det^⅙ (P + H) ≥ det^⅙ P + det^⅙ H (Minkowski).
pub(super) fn ln_posterior_volume(
    model: &[ModelPoint],
    (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
) -> Vec<f64> {
    let ranks = graph.starts.len() - 1;
    let mut ln_posterior_volume = vec![0.0; ranks + 1];
    if ranks > MAX_POINTS {
        return ln_posterior_volume;
    }
    let at: Vec<_> = (0..ranks).map(|i| model[graph.vertices[graph.starts[i]].model].at.coords).collect();
    let greatest =
        |i: usize| (graph.starts[i]..graph.starts[i + 1]).map(|v| terms.pairs[v].variance).fold(0.0, f64::max);
    let weights: Vec<f64> = (0..ranks).map(|i| 1.0 / greatest(i)).collect();
    let (mut twos, mut threes) = (Vec::new(), Vec::new());
    for l in 0..ranks {
        for j in 0..l {
            let (side, both) = (at[l] - at[j], weights[l] * weights[j]);
            twos.push(both * side.norm_squared());
            threes.extend((0..j).map(|i| both * weights[i] * (at[i] - at[j]).cross(&side).norm_squared()));
        }
    }
    let (mut of_one, mut of_two, mut of_three) = (Smallest::of(&weights), Smallest::of(&twos), Smallest::of(&threes));
    for (k, bound) in ln_posterior_volume.iter_mut().enumerate().skip(3) {
        let (twos, threes) = (k * (k - 1) / 2, k * (k - 1) * (k - 2) / 6);
        // det H = W³ · ⁸⁄₉ · (W e₁/W) · (W e₂/W).
        let determinant = 8.0 / 9.0 * of_one.sum(k) * of_two.sum(twos) * of_three.sum(threes);
        let ln_determinant = libm::log(determinant);
        // The prior in units of its own volume: ln p at the maximum is −½ ln det Σ − 3 ln 2π.
        let ln_prior = -2.0 * (prior_terms.ln_peak + 6.0 * HALF_LN_2PI);
        *bound = match &prior_terms.known {
            Some(_) => -3.0 * libm::log1p(libm::exp((ln_determinant + ln_prior) / 6.0)),
            None => (-0.5 * (ln_determinant + ln_prior)).min(0.0),
        };
    }
    ln_posterior_volume
}

/// Number of low bits that a group ignores: eight groups between a power of two and the next.
const GROUPED: u32 = f64::MANTISSA_DIGITS - 1 - 3;

/// Sums of the smallest of some non-negative numbers, by groups of nearly equal ones: at most the exact sums, and at
/// least eight ninths of them.
struct Smallest {
    first: u64,
    /// Number of remaining members of each group.
    groups: Vec<usize>,
    at: usize,
    taken: usize,
    sum: f64,
}

impl Smallest {
    fn of(numbers: &[f64]) -> Self {
        let group = |x: &f64| x.to_bits() >> GROUPED;
        let first = numbers.iter().map(group).min().unwrap_or(0);
        let last = numbers.iter().map(group).max().unwrap_or(0);
        let mut groups = vec![0; (last - first) as usize + 1];
        numbers.iter().for_each(|x| groups[(group(x) - first) as usize] += 1);
        Self { first, groups, at: 0, taken: 0, sum: 0.0 }
    }

    /// The sum of the `count` smallest; `count` must not decrease between calls and not exceed the number of values.
    fn sum(&mut self, count: usize) -> f64 {
        while self.taken < count && self.at < self.groups.len() {
            let some = self.groups[self.at].min(count - self.taken);
            self.sum += some as f64 * f64::from_bits((self.first + self.at as u64) << GROUPED);
            self.groups[self.at] -= some;
            self.taken += some;
            self.at += usize::from(self.groups[self.at] == 0);
        }
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Covariance6, MeasuredPoint, Transform, UncertainPoint};

    use super::*;
    use crate::{
        candidates::Candidates,
        problem::{Prior, PriorBound, Problem, Tolerance},
        search::consensus::{fit::Linear, motion::Motion},
    };

    /// The posterior volume of every set of a few points, with a prior and without, is below its bound.
    ///
    /// Fails with four times the determinant, and with points of twice the precision.
    #[test]
    fn no_set_of_points_leaves_more_open() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut closest = f64::INFINITY;
        for round in 0..60 {
            let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
            let model: Vec<ModelPoint> = (0..8).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
            let shift = Vector3::new(0.2, -0.1, 3.0);
            let sigmas: Vec<f64> = (0..8).map(|_| 0.02 + 0.015 * place(1.0).x).collect();
            let measured = |i: usize| UncertainPoint::isotropic((model[i].at.coords + shift).into(), sigmas[i]);
            let cloud: Vec<MeasuredPoint> =
                (0..8).map(|i| MeasuredPoint { position: measured(i), pixels: None }).collect();
            let candidates = Candidates::from_pairs(8, (0..8).map(|i| (i, i)));
            let bound = PriorBound::Gaussian(Covariance6::isotropic(0.05, 0.1));
            let prior = Prior { object_from_camera: Transform::new(UnitQuaternion::identity(), -shift), bound };
            let prior = (round % 2 == 0).then_some(&prior);
            let tolerance = Tolerance::Sigmas(3.0);
            let problem = Problem {
                model: &model,
                cloud: &cloud,
                candidates: &candidates,
                tolerance,
                prior,
                edges: Default::default(),
            };
            let prior_terms = PriorTerms::of(&problem).expect("a box");
            let graph = ConsistencyGraph::of(&problem, &prior_terms);
            let terms = PairTerms::of(&problem, &prior_terms, &graph);
            let max = ln_posterior_volume(&model, (&terms, &prior_terms, &graph));
            let motion = Motion { rotation: nalgebra::Matrix3::identity(), translation: shift };
            for set in 0u32..1 << 8 {
                let members: Vec<usize> = (0..8).filter(|v| set >> v & 1 == 1).collect();
                if members.len() < 3 {
                    continue;
                }
                let linear = Linear::at(&terms, &prior_terms, &members, &motion).expect("three points");
                let filled = prior_terms.ln_peak + linear.ln_volume();
                assert!(filled <= max[members.len()] + 1e-9, "{filled} of {} at most", max[members.len()]);
                closest = closest.min(max[members.len()] - filled);
            }
        }
        assert!(closest < 0.5, "for all points the bound is tight up to the grouping: {closest}");
    }

    #[test]
    fn sums_of_the_smallest_are_no_more_than_that() {
        let numbers: Vec<f64> = (0..500).map(|i| f64::from((i * 7919) % 1009) * 0.37).collect();
        let mut sorted = numbers.clone();
        sorted.sort_by(f64::total_cmp);
        let mut smallest = Smallest::of(&numbers);
        for count in [0, 1, 5, 5, 80, 499, 500] {
            let (sum, exact) = (smallest.sum(count), sorted[..count].iter().sum::<f64>());
            assert!(sum <= exact + 1e-9 && sum >= 8.0 / 9.0 * exact - 1e-9, "{count}: {sum} of {exact}");
        }
    }
}
