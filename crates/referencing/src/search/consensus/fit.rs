//! The MAP motion of some pairs, by Gauss–Newton steps.

use nalgebra::{Cholesky, Matrix3, Matrix6, U6, Vector3, Vector6};

use super::{
    gaussian::HALF_LN_2PI,
    likelihood::PairTerms,
    motion::Motion,
    prior_terms::PriorTerms,
    solve6::{factor as factor_of, solve},
};

/// Squared step length (in standard deviations) below which a fit has converged.
const CONVERGED: f64 = 1e-12;

/// The posterior of some pairs, linearised about a motion.
///
/// The step is (φ, τ): a rotation about the model's centroid and a translation.
pub(in crate::search) struct Linear {
    motion: Motion,
    /// The centroid under the motion.
    about: Vector3<f64>,
    /// Difference η of the motion from the prior's.
    eta: Option<Vector6<f64>>,
    /// Cholesky factor of the information H.
    factor: Cholesky<f64, U6>,
    /// The step to the maximum.
    step: Vector6<f64>,
    /// The Newton decrement: the squared step length in standard deviations.
    decrement: f64,
}

impl Linear {
    /// The linearisation; `None` if pairs and prior do not determine the motion.
    pub(in crate::search) fn at(
        terms: &PairTerms,
        prior_terms: &PriorTerms,
        members: &[usize],
        motion: &Motion,
    ) -> Option<Self> {
        let about = motion.apply(&prior_terms.centroid);
        // The lower triangle of H = Σ Jᵀ W J, J = (−[lever]×, I), by blocks of three.
        let (mut turn, mut mixed, mut shift) = ([0.0; 6], [[0.0; 3]; 3], Matrix3::zeros());
        let (mut torque, mut force) = (Vector3::zeros(), Vector3::zeros());
        for &v in members {
            let pair = &terms.pairs[v];
            let (place, w) = (motion.apply(&pair.model), &pair.weight);
            let lever = place - about;
            let pull = w * (pair.cloud - place);
            let sw = crossed(&lever, w);
            // −sw · [lever]×.
            let (x, y, z) = (lever.x, lever.y, lever.z);
            turn[0] += sw[0][2] * y - sw[0][1] * z;
            turn[1] += sw[1][2] * y - sw[1][1] * z;
            turn[2] += sw[2][2] * y - sw[2][1] * z;
            turn[3] += sw[1][0] * z - sw[1][2] * x;
            turn[4] += sw[2][0] * z - sw[2][2] * x;
            turn[5] += sw[2][1] * x - sw[2][0] * y;
            for (sum, row) in mixed.iter_mut().flatten().zip(sw.iter().flatten()) {
                *sum += row;
            }
            shift += w;
            torque += lever.cross(&pull);
            force += pull;
        }
        let mut h = Matrix6::zeros();
        for (at, sum) in [(0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2)].into_iter().zip(turn) {
            h[at] = sum;
        }
        for i in 0..3 {
            for k in 0..3 {
                h[(3 + i, k)] = mixed[k][i];
                h[(3 + i, 3 + k)] = shift[(i, k)];
            }
        }
        let mut g = Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
        let eta = prior_terms.known.as_ref().map(|known| {
            let eta = prior_terms.step_to(known, motion);
            h += known.information;
            g -= known.information * eta;
            eta
        });
        let factor = factor_of(&h)?;
        let step = solve(&factor, &g);
        Some(Self { motion: *motion, about, eta, step, decrement: step.dot(&g), factor })
    }

    /// The motion after the step.
    pub(in crate::search) fn moved(&self) -> Motion {
        self.moved_by(1.0)
    }

    /// The motion after a fraction of the step.
    pub(in crate::search) fn moved_by(&self, fraction: f64) -> Motion {
        let step = self.step * fraction;
        self.motion.moved(&step.fixed_rows::<3>(0).into(), &step.fixed_rows::<3>(3).into(), &self.about)
    }

    /// The decrease of the cost of residuals and prior by the step (nats), to first order.
    pub(in crate::search) fn gained(&self) -> f64 {
        0.5 * self.decrement
    }

    /// Cholesky factor of the information.
    pub(in crate::search) fn factor(&self) -> &Cholesky<f64, U6> {
        &self.factor
    }

    /// Whether the step is negligible.
    fn converged(&self) -> bool {
        self.decrement < CONVERGED
    }

    /// The log-likelihood ratio of pair `v` after the step, to first order; `None` beyond the gate.
    pub(in crate::search) fn of_pair(&self, terms: &PairTerms, v: usize) -> Option<f64> {
        let pair = &terms.pairs[v];
        let place = self.motion.apply(&pair.model);
        let (phi, tau) = (self.step.fixed_rows::<3>(0), self.step.fixed_rows::<3>(3));
        pair.of_residual(&(pair.cloud - place - phi.cross(&(place - self.about)) - tau))
    }

    /// ln of the prior density after the step, to first order.
    pub(in crate::search) fn ln_density(&self, prior_terms: &PriorTerms) -> f64 {
        match (&prior_terms.known, &self.eta) {
            (Some(known), Some(eta)) => prior_terms.ln_density_of(known, &(eta + self.step)),
            _ => prior_terms.ln_peak,
        }
    }

    /// ln of the posterior volume.
    pub(in crate::search) fn ln_volume(&self) -> f64 {
        6.0 * HALF_LN_2PI - libm::log(self.factor.l_dirty().diagonal().product())
    }
}

/// The MAP motion of these pairs near a start, and the factor of its information.
pub(in crate::search) fn fit(
    terms: &PairTerms,
    prior_terms: &PriorTerms,
    members: &[usize],
    start: &Motion,
    rounds: usize,
) -> Option<(Motion, Cholesky<f64, U6>)> {
    let first = Linear::at(terms, prior_terms, members, start)?;
    fit_on(first, terms, prior_terms, members, rounds)
}

/// The fit from a given first linearisation.
pub(in crate::search) fn fit_on(
    first: Linear,
    terms: &PairTerms,
    prior_terms: &PriorTerms,
    members: &[usize],
    rounds: usize,
) -> Option<(Motion, Cholesky<f64, U6>)> {
    let mut linear = first;
    let mut motion = linear.moved();
    for _ in 1..rounds {
        if linear.converged() {
            break;
        }
        linear = Linear::at(terms, prior_terms, members, &motion)?;
        motion = linear.moved();
    }
    Some((motion, linear.factor))
}

/// [lever]× w, row by row, without the products with zeros.
#[inline]
fn crossed(lever: &Vector3<f64>, w: &Matrix3<f64>) -> [[f64; 3]; 3] {
    let (x, y, z) = (lever.x, lever.y, lever.z);
    let row = |a: f64, i: usize, b: f64, k: usize| {
        [a * w[(i, 0)] + b * w[(k, 0)], a * w[(i, 1)] + b * w[(k, 1)], a * w[(i, 2)] + b * w[(k, 2)]]
    };
    [row(-z, 1, y, 2), row(z, 0, -x, 2), row(-y, 0, x, 1)]
}
