//! Least squares over SE(3) where every point speaks by an information matrix.

use nalgebra::{Matrix3, Matrix6, Quaternion, SMatrix, UnitQuaternion, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform};

use super::{
    Degenerate, converged,
    normal::{Normal, inverse, singular},
};
use crate::Observation;

/// What one point says of the place where a pose puts it, camera axes.
pub(crate) struct Term {
    /// W: the information on that place (1/m²), symmetric.
    pub(crate) information: Matrix3<f64>,
    /// W times the step (m) by which the measurement would have it moved.
    pub(crate) pull: Vector3<f64>,
    /// The point's share of χ².
    pub(crate) cost: f64,
}

impl Term {
    /// What a residual (m) of this information says.
    pub(super) fn of(information: Matrix3<f64>, residual: &Vector3<f64>) -> Self {
        let pull = information * residual;
        Self { information, pull, cost: residual.dot(&pull) }
    }
}

/// All terms at one pose: normal equations of the step ξ in `pose · Exp(ξ)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linearized {
    /// Σ Jᵀ W J: the information on ξ.
    normal: Normal,
    /// Σ Jᵀ W r.
    pub(super) gradient: Vector6<f64>,
    /// χ².
    pub(super) cost: f64,
}

/// The normal equations at `pose`.
///
/// `term` is given the number of a point and the place p = T⁻¹ P where the pose puts it. Under T · Exp(ξ) that place
/// moves by J ξ, J = \[ \[p\]×, −I \].
///
/// # Errors
/// [`Degenerate::Hidden`]: the first point whose term has no value.
#[inline]
pub(super) fn linearize(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Linearized, Degenerate> {
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let mut normal = Normal::default();
    let (mut torque, mut force, mut cost) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (k, point) in points.iter().enumerate() {
        let at: Vector3<f64> = r.tr_mul(&(point.model.coords - t));
        let said = term(k, &at).ok_or(Degenerate::Hidden { index: k, depth: at.z })?;
        normal.add(&at, &said.information);
        torque -= at.cross(&said.pull);
        force -= said.pull;
        cost += said.cost;
    }
    let gradient = Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
    Ok(Linearized { normal, gradient, cost })
}

/// What each model point's error makes of the minimum: with n of the pixels and e of the model the terms ask
/// Σ Jᵀ W (J ξ + Rᵀ e + n) = 0, R that of the pose, so that ξ = −(Σ JᵀWJ)⁻¹ Σ Jᵀ W Rᵀ e + …, a standard deviation of e each.
pub(super) fn model_errors(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
    let covariance = linearize(points, pose, term)?.covariance()?;
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let of = |(k, point): (usize, &Observation)| {
        let at: Vector3<f64> = r.tr_mul(&(point.model.coords - t));
        let said = term(k, &at).ok_or(Degenerate::Hidden { index: k, depth: at.z })?;
        let pull = said.information * r.transpose() * point.model_sigma;
        let mut errors = SMatrix::<f64, 6, 3>::zeros();
        // −Jᵀ = [ [p]×; I ].
        errors.fixed_view_mut::<3, 3>(0, 0).copy_from(&(at.cross_matrix() * pull));
        errors.fixed_view_mut::<3, 3>(3, 0).copy_from(&pull);
        Ok(covariance * errors)
    };
    points.iter().enumerate().map(of).collect()
}

impl Linearized {
    /// With the terms of `other` besides.
    pub(super) fn plus(mut self, other: &Self) -> Self {
        self.normal.join(&other.normal);
        self.gradient += other.gradient;
        self.cost += other.cost;
        self
    }

    /// What is left when the terms of `other`, which are among them, are left out.
    pub(super) fn less(mut self, other: &Self) -> Self {
        self.normal.remove(&other.normal);
        self.gradient -= other.gradient;
        self.cost -= other.cost;
        self
    }

    /// The covariance of ξ.
    ///
    /// # Errors
    /// Some motion changes nothing that was measured.
    pub(super) fn covariance(&self) -> Result<Matrix6<f64>, Degenerate> {
        inverse(&self.normal.matrix())
    }

    /// The square of the length of a step in standard deviations: ξᵀ Σ⁻¹ ξ.
    pub(super) fn away(&self, step: &Vector6<f64>) -> f64 {
        step.dot(&(self.normal.matrix() * step))
    }

    /// tr Σ_φφ (rad²), by the Schur complement of the translation.
    pub(super) fn attitude_variance(&self) -> Option<f64> {
        let normal = self.normal.matrix();
        let block = |row, column| normal.fixed_view::<3, 3>(row, column).into_owned();
        let (turn, mixed, shift) = (block(0, 0), block(0, 3), block(3, 3));
        let schur = turn - mixed * shift.cholesky()?.solve(&mixed.transpose());
        Some(schur.cholesky()?.inverse().trace())
    }

    /// The step and its decrement gᵀ ξ: the square of its length in standard deviations.
    pub(super) fn step(&self, damping: f64) -> Option<(Vector6<f64>, f64)> {
        let step = self.normal.solve(damping, &self.gradient)?;
        let decrement = self.gradient.dot(&step);
        decrement.is_finite().then_some((step, decrement))
    }

    fn determined(&self, damping: f64) -> Result<(Vector6<f64>, f64), Degenerate> {
        self.step(damping).ok_or_else(|| singular(&self.normal.matrix()))
    }
}

/// Below this decrement a step is a ten-thousandth of a millionth of a standard deviation: nothing is left to gain.
const NOTHING: f64 = 1e-20;
/// Below this decrement the cost has no digits left that could tell better from worse; the steps themselves
/// must shrink then.
pub(super) const NEAR: f64 = 1e-4;
/// Steps of one descent. Half a dozen are enough of nearly all; few weak points lie in a long curved valley, where Gauss's and
/// Newton's steps are too short or too long by nearly all of themselves.
const MAX_STEPS: u64 = 500;

/// The least cost reached from `start` by Levenberg's and Marquardt's damped steps, to where a step is shorter than
/// √`near` standard deviations. The weights of `term` must not depend on the pose: every step must lower the cost.
/// (Marquardt, *An algorithm for least-squares estimation of nonlinear parameters*, 1963.) The pose and the normal
/// equations there.
///
/// # Errors
/// The start puts a point behind a camera, or a motion is undetermined.
pub(super) fn descend(
    points: &[Observation],
    start: &Transform<Object, Camera>,
    near: f64,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
    let here = linearize(points, start, term)?;
    let (mut pose, mut here, mut damping) = (*start, here, 0.0);
    for _ in 0..MAX_STEPS {
        let (step, decrement) = here.determined(damping)?;
        if damping == 0.0 && decrement <= near {
            break;
        }
        let next = moved(&pose, &step);
        match linearize(points, &next, term).ok().filter(|next| next.cost < here.cost) {
            Some(better) => {
                (pose, here) = (next, better);
                damping = if damping > 1e-5 { damping * 0.1 } else { 0.0 };
            }
            None if damping > 1e8 => break,
            None => damping = f64::max(1e-4, damping * 10.0),
        }
    }
    Ok((pose, here))
}

/// The pose at which the steps vanish, from one near it: Gauss's and Newton's steps, of which each must be
/// shorter than the last, or from there on only half as much of them is taken. Where the weights of `term` depend on the pose it solves the likelihood's equation
/// Σ Jᵀ W r = 0 with the weights of its own answer, which no cost measures. `here` is `term` at `start`. The pose, and
/// the normal equations at it or one vanishing step before.
///
/// # Errors
/// As [`descend`], and steps that do not shrink to nothing.
pub(super) fn settle(
    points: &[Observation],
    start: Transform<Object, Camera>,
    here: Linearized,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
    let (mut pose, mut here, mut last, mut fraction) = (start, here, f64::INFINITY, 1.0);
    for taken in 0..MAX_STEPS {
        let (step, decrement) = here.determined(0.0)?;
        if !(decrement < last) {
            // Rounding is all that is left, or the steps lead beyond the minimum.
            let done = converged(taken, last.sqrt());
            if done.is_ok() || fraction < MIN_FRACTION {
                return done.map(|()| (pose, here));
            }
            fraction *= 0.5;
        }
        pose = moved(&pose, &(step * fraction));
        // Steps shrink by a constant factor at least: that the next is nothing is known before it is taken.
        let rate = if last.is_finite() { decrement / last } else { SHRINK };
        if decrement * rate <= NOTHING {
            return Ok((pose, here));
        }
        last = decrement;
        here = linearize(points, &pose, term)?;
    }
    converged(MAX_STEPS, last.sqrt()).map(|()| (pose, here))
}

/// With so small a share of the steps nothing is to be hoped for.
const MIN_FRACTION: f64 = 0.01;
/// By how much the first decrement is taken to fall.
const SHRINK: f64 = 1e-2;

/// `pose · Exp(step)` to second order, a rotation to the last digit.
fn moved(pose: &Transform<Object, Camera>, step: &Vector6<f64>) -> Transform<Object, Camera> {
    // A turn of more than half a radian leaves what the normal equations know.
    let turn = step.fixed_rows::<3>(0).norm();
    let step = if turn > 0.5 { step * (0.5 / turn) } else { *step };
    let half = step.fixed_rows::<3>(0) * 0.5;
    let shift = step.fixed_rows::<3>(3).into_owned();
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(1.0, half.x, half.y, half.z));
    let step = Transform::<Camera, Camera>::new(rotation, shift + half.cross(&shift));
    (*pose * step).renormalized()
}

/// [`descend`] to where the cost can no longer tell, then [`settle`].
///
/// # Errors
/// As these.
pub(super) fn minimize(
    points: &[Observation],
    start: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let (pose, here) = descend(points, start, NEAR, term)?;
    Ok(settle(points, pose, here, term)?.0)
}
