//! The number of false alarms (NFA) of a set: an a-contrario test.
//!
//! # Null model
//!
//! No candidate is true. Each candidate of a model point lies anywhere in its gate; without a prior, anywhere in the
//! cloud's box with the density of the set's part of the cloud ([`Parts`](crate::parts::Parts)); the partners of
//! putative pairs are shuffled. All are independent ([`Null`]). Then
//!
//! NFA = Σ_{j ≥ k} Σ over j-subsets S of model points of Π_{i∈S} m_i · P(S),
//!
//! with m_i candidates of model point i and the probability P(S) that one candidate of each forms a set that is
//! coherent, not mirrored, and no worse: its χ² per degree of freedom is at most that of the set found.
//!
//! # The probability that j points fit
//!
//! The clouds that a rigid motion of S produces exactly are a surface of dimension 6 in the 3j coordinates of j points.
//! Those that fit within χ² ≤ R² are its tube of radius R in whitened coordinates (Weyl 1939), and to first order in R
//! over the set's extent
//!
//! P(S) = ∫ √det H · Π_i ρ_i(T p_i) dT · |{e ⟂ surface: ‖e‖ ≤ R, every distance within its tolerance}|,
//!
//! H = Σ_i J_iᵀ W J_i the information matrix of the motion, ρ_i the density of the candidates of i. The surface has
//! proper motions only, so that mirror images do not count. If S is nearly collinear, the noise bounds the rotation
//! about the line from below ([`shape`]). The integral over translations is exact: the overlap of the gates, displaced
//! by the rotation. Rotations, subsets and directions of e are sampled from fixed sequences, of the points in a
//! canonical order: the answer is a function of the problem and does not depend on the numbering of its points.
//!
//! The density of shuffled partners is that of their neighbours, which ignores the regularity of a cloud. Partners
//! about the pose found are therefore counted as well ([`coincidence`]), and the greater number holds.
//!
//! Source: a-contrario acceptance after Moisan and Stival, *A probabilistic criterion to detect rigid point matches*,
//! 2004; the volume of tubes after Weyl, *On the volume of tubes*, 1939.

pub(crate) mod absence;
pub(crate) mod coincidence;
pub(crate) mod coordinates;
mod null;
pub(crate) mod sample;
mod sequence;
mod shape;
mod subsets;

use std::{cell::OnceCell, cmp::Ordering};

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Transform};

use crate::{
    chi_square::chi_square,
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::{kabsch::Kabsch, likelihood, solver::Solver},
};
use coincidence::expected_at;
use null::Null;
use sequence::QuasiRandom;
use shape::{Noise, Shape};
use subsets::Subsets;

/// Fraction of the sum below which the terms of larger sets are neglected.
const NEGLIGIBLE: f64 = 0.03;
/// Maximum number of sizes beyond that of the set found.
const MAX_SIZES: usize = 16;
/// Number of samples for each model point, with its limits; maximum number of point pairs in all samples.
const SAMPLES_A_POINT: usize = 4;
const MAX_SAMPLES: usize = 250;
const MIN_SAMPLES: usize = 16;
const MAX_WORK: usize = 8_000;
/// Expectations that are not refined: after the minimum number of samples, and after the first two.
const IMPOSSIBLE: f64 = 1e-7;
const HOPELESS: f64 = 1e-30;
const FIRST_SAMPLES: usize = 2;

/// The NFA of a set of this size: the expected number of sets that pass the χ² test.
///
/// It counts one-to-one sets of `found.len()` pairs or more if no candidate is true. Infinite below three pairs; NaN
/// for a NaN covariance.
pub(crate) fn expected_sets(problem: &Problem<'_>, found: &[Correspondence]) -> f64 {
    if found.len() < 3 {
        return f64::INFINITY;
    }
    let anywhere = expected_about(problem, found, found.len(), chi_square(3 * found.len() - 6, CONFIDENCE));
    AContrario::of(problem, found).beside(anywhere)
}

/// The expected number of random sets with at most the residual of `found`.
///
/// For each size, at most a fraction ε of the frames without the object has a set with a number below ε.
pub fn expected_sets_as_good(problem: &Problem<'_>, found: &[Correspondence]) -> f64 {
    AContrario::of(problem, found).sets_as_good()
}

/// The NFAs of a set, each computed on demand and once.
pub(crate) struct AContrario<'a> {
    problem: &'a Problem<'a>,
    found: &'a [Correspondence],
    best: OnceCell<(f64, Option<Transform<Object, Camera>>)>,
    at_their_pose: OnceCell<f64>,
    as_good: OnceCell<f64>,
}

impl<'a> AContrario<'a> {
    pub(crate) fn of(problem: &'a Problem<'a>, found: &'a [Correspondence]) -> Self {
        let (best, at_their_pose, as_good) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Self { problem, found, best, at_their_pose, as_good }
    }

    /// See [`expected_sets_as_good`].
    pub(crate) fn sets_as_good(&self) -> f64 {
        *self.as_good.get_or_init(|| match self.found.len() {
            0..3 => f64::INFINITY,
            size => self.beside(expected_about(self.problem, self.found, size, self.best().0)),
        })
    }

    /// The NFA at the pose of these putative pairs and at its symmetric poses; zero for other pairs.
    pub(crate) fn at_their_pose(&self) -> f64 {
        *self.at_their_pose.get_or_init(|| match self.best() {
            (_, Some(pose)) if shuffled(self.problem) => expected_at(self.problem, self.found.len(), &pose),
            _ => 0.0,
        })
    }

    /// The maximum of the numbers over all poses and about this one.
    fn beside(&self, anywhere: f64) -> f64 {
        // A NaN remains NaN.
        if anywhere < 1.0 { anywhere.max(self.at_their_pose()) } else { anywhere }
    }

    /// The minimum χ² of the pairs over rigid motions, and the motion.
    fn best(&self) -> (f64, Option<Transform<Object, Camera>>) {
        *self.best.get_or_init(|| best(self.problem, self.found))
    }
}

/// The number of false alarms: the expected number of admissible one-to-one sets no worse than a given one, if no
/// candidate were true.
///
/// A set is no worse if it has `size` pairs or more, and a χ² per degree of freedom of at most `chi2`/(3·size − 6).
pub fn nfa(problem: &Problem<'_>, size: usize, chi2: f64) -> f64 {
    expected_about(problem, &[], size, chi2)
}

/// The NFA with the cloud's density about these pairs; without pairs, the density of its largest part.
fn expected_about(problem: &Problem<'_>, pairs: &[Correspondence], size: usize, chi2: f64) -> f64 {
    if size < 3 {
        return f64::INFINITY;
    }
    let noise = Noise::of(problem);
    if chi2.is_nan() || noise.is_nan() {
        return f64::NAN;
    }
    let frame = Frame { null: Null::of(problem, pairs), noise, order: order(problem), shared: shared(problem) };
    let available = problem.candidates.with_candidates();
    let (mut sum, mut last) = (0.0, 0.0_f64);
    for j in (size..=available).take(MAX_SIZES) {
        let halved = (j - size).min(3);
        let term = expected_of_size(problem, &frame, j, chi2 * dof(j) / dof(size), halved);
        sum += term;
        // Only once the terms decrease: among many candidates larger sets may be more numerous.
        if term.is_nan() || (term <= NEGLIGIBLE * sum && term <= last.max(f64::MIN_POSITIVE)) {
            break;
        }
        if j == size && term == 0.0 {
            break;
        }
        last = term;
    }
    sum
}

fn dof(size: usize) -> f64 {
    (3 * size - 6) as f64
}

/// The data common to sets of all sizes.
struct Frame<'a> {
    null: Null<'a>,
    noise: Noise,
    order: Vec<usize>,
    /// See [`shared`].
    shared: f64,
}

/// The model points in a canonical order, independent of their numbers and of the object's axes: by distance from the
/// centroid.
///
/// Distances equal to seven digits (sums in another order may differ in the last) are ordered by the length of the
/// lists, then by the coordinates.
fn order(problem: &Problem<'_>) -> Vec<usize> {
    let at = |i: usize| problem.model[i].at.coords;
    let count = problem.model.len();
    let centroid = (0..count).map(at).sum::<Vector3<f64>>() / count.max(1) as f64;
    let distance = |i: usize| (at(i) - centroid).norm_squared() as f32;
    let mut order: Vec<(f32, usize, usize)> =
        (0..count).map(|i| (distance(i), problem.candidates.lists[i].len(), i)).collect();
    order.sort_unstable_by(|(near, few, a), (far, many, b)| {
        let places = || at(*a).iter().zip(&at(*b)).map(|(x, y)| x.total_cmp(y)).fold(Ordering::Equal, Ordering::then);
        near.total_cmp(far).then(few.cmp(many)).then_with(places).then(a.cmp(b))
    });
    order.into_iter().map(|(_, _, i)| i).collect()
}

/// The expected number of such sets of exactly `size` pairs.
fn expected_of_size(problem: &Problem<'_>, frame: &Frame<'_>, size: usize, chi2: f64, halved: usize) -> f64 {
    let lengths = frame.order.iter().map(|&i| (i, problem.candidates.lists[i].len()));
    let mut subsets = Subsets::new(lengths, size);
    let pairs = size * (size - 1) / 2;
    let wanted = (SAMPLES_A_POINT * problem.candidates.with_candidates()).min(MAX_SAMPLES) >> halved;
    let samples = wanted.min(MAX_WORK / pairs).max(MIN_SAMPLES);
    let mut sequence = QuasiRandom::new(samples);
    let mut shape = Shape::new(problem, &frame.null, &frame.noise, size, chi2);
    // A candidate that two model points share can serve only one of them.
    let apart = pairs as f64 * libm::log1p(-frame.shared);
    let ln_scale = subsets.ln_tuples() + shape.ln_scale() + apart;
    let (mut sum, mut taken) = (0.0, 0);
    while taken < samples {
        sum += shape.fit_probability(subsets.next(&mut sequence), &mut sequence);
        taken += 1;
        // The size of a negligible expectation need not be accurate.
        let expected = libm::exp(ln_scale) * sum;
        let hopeless = taken == FIRST_SAMPLES && sum > 0.0 && expected < HOPELESS;
        if hopeless || (taken == MIN_SAMPLES && expected < IMPOSSIBLE) {
            break;
        }
    }
    if sum == 0.0 && halved == 0 {
        // An object that fills the cloud's box fits it for hardly any rotation, but was measured there: one sample
        // barely fits.
        sum = shape.barely_fits(subsets.next(&mut sequence), &mut sequence);
    }
    libm::exp(ln_scale + libm::log(sum / taken as f64))
}

/// The probability that the candidates of two different model points are the same cloud point.
fn shared(problem: &Problem<'_>) -> f64 {
    let lists = &problem.candidates.lists;
    let mut lists_of = vec![0.0_f64; problem.cloud.len()];
    lists.iter().flatten().for_each(|&j| lists_of[j] += 1.0);
    let same: f64 = lists_of.iter().map(|count| count * (count - 1.0)).sum();
    let (all, own) = lists.iter().map(|list| list.len() as f64).fold((0.0, 0.0), |(a, o), m| (a + m, o + m * m));
    let different = all * all - own;
    if different > 0.0 { (same / different).min(0.999) } else { 0.0 }
}

/// The minimum χ² of the pairs over rigid motions, and the motion; infinite for pairs that determine none.
fn best(problem: &Problem<'_>, pairs: &[Correspondence]) -> (f64, Option<Transform<Object, Camera>>) {
    let data = Observations::of(pairs, problem.model, problem.cloud, None);
    if data.points.iter().any(|point| !point.is_finite()) {
        return (f64::NAN, None);
    }
    match (Kabsch { min_ratio: 0.0 }).solve(&data) {
        Ok(start) => {
            let best = likelihood::maximum(&data, &start);
            (best.cost, Some(best.pose))
        }
        Err(_) => (f64::INFINITY, None),
    }
}

#[cfg(test)]
mod tests;

use coordinates::{CONFIDENCE, shuffled};
