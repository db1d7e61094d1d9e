//! Least squares over SE(3) with an information matrix per point.

use nalgebra::{Matrix3, Matrix6, Quaternion, SMatrix, UnitQuaternion, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform};

use crate::{
    observations::Observation,
    solve::{
        degeneracy::{Degenerate, converged},
        likelihood::normal::{Normal, inverse, singular},
    },
};

/// The term of one point at the position where a pose puts it, camera axes.
pub(crate) struct Term {
    /// W: the information on that position (1/m²), symmetric.
    pub(crate) information: Matrix3<f64>,
    /// W times the residual (m), the step that the measurement demands.
    pub(crate) pull: Vector3<f64>,
    /// The point's contribution to χ².
    pub(crate) cost: f64,
}

impl Term {
    /// The term of a residual (m) with this information.
    pub(crate) fn of(information: Matrix3<f64>, residual: &Vector3<f64>) -> Self {
        let pull = information * residual;
        Self { information, pull, cost: residual.dot(&pull) }
    }
}

/// The term of a point, by index, at the position where a pose puts it.
pub(crate) type Terms<'a> = &'a dyn Fn(usize, &Vector3<f64>) -> Option<Term>;

/// The sum of all terms at one pose: normal equations of the step ξ in `pose · Exp(ξ)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearized {
    /// Σ Jᵀ W J: the information on ξ.
    normal: Normal,
    /// Σ Jᵀ W r.
    pub(crate) gradient: Vector6<f64>,
    /// χ².
    pub(crate) cost: f64,
}

/// The normal equations at `pose`.
///
/// `term` receives the index of a point and its position p = T⁻¹ P under the pose. Under T · Exp(ξ) that position moves
/// by J ξ, J = \[ \[p\]×, −I \].
///
/// # Errors
///
/// [`Degenerate::Hidden`]: the first point without a term.
#[inline]
pub(crate) fn linearize(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Linearized, Degenerate> {
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let mut normal = Normal::default();
    let (mut torque, mut force, mut cost) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (k, point) in points.iter().enumerate() {
        let at: Vector3<f64> = r.tr_mul(&(point.model.coords - t));
        let message = term(k, &at).ok_or(Degenerate::Hidden { index: k, depth: at.z })?;
        normal.add(&at, &message.information);
        torque -= at.cross(&message.pull);
        force -= message.pull;
        cost += message.cost;
    }
    let gradient = Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
    Ok(Linearized { normal, gradient, cost })
}

/// The effect of each model point's error on the minimum, for one standard deviation.
///
/// With n the pixel errors and e the model errors the minimum satisfies Σ Jᵀ W (J ξ + Rᵀ e + n) = 0, R of the pose, so
/// that ξ = −(Σ JᵀWJ)⁻¹ Σ Jᵀ W Rᵀ e + ….
pub(crate) fn model_errors(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
    let covariance = linearize(points, pose, term)?.covariance()?;
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let of = |(k, point): (usize, &Observation)| {
        let at: Vector3<f64> = r.tr_mul(&(point.model.coords - t));
        let message = term(k, &at).ok_or(Degenerate::Hidden { index: k, depth: at.z })?;
        let pull = message.information * r.transpose() * point.model_sigma;
        let mut errors = SMatrix::<f64, 6, 3>::zeros();
        // −Jᵀ = [ [p]×; I ].
        errors.fixed_view_mut::<3, 3>(0, 0).copy_from(&(at.cross_matrix() * pull));
        errors.fixed_view_mut::<3, 3>(3, 0).copy_from(&pull);
        Ok(covariance * errors)
    };
    points.iter().enumerate().map(of).collect()
}

impl Linearized {
    /// The normal equations with these parts.
    pub(crate) fn from_parts(normal: &Matrix6<f64>, gradient: Vector6<f64>, cost: f64) -> Self {
        Self { normal: Normal::of_matrix(normal), gradient, cost }
    }

    /// The information on ξ as a matrix.
    pub(crate) fn normal(&self) -> Matrix6<f64> {
        self.normal.matrix()
    }

    /// The sum with the terms of `other`.
    pub(crate) fn plus(mut self, other: &Self) -> Self {
        self.normal.join(&other.normal);
        self.gradient += other.gradient;
        self.cost += other.cost;
        self
    }

    /// The sum without the terms of `other`, which it contains.
    pub(crate) fn less(mut self, other: &Self) -> Self {
        self.normal.remove(&other.normal);
        self.gradient -= other.gradient;
        self.cost -= other.cost;
        self
    }

    /// The covariance of ξ.
    ///
    /// # Errors
    ///
    /// A motion that changes no measurement.
    pub(crate) fn covariance(&self) -> Result<Matrix6<f64>, Degenerate> {
        inverse(&self.normal.matrix())
    }

    /// The information on ξ, Σ Jᵀ W J.
    pub(crate) fn information(&self) -> Matrix6<f64> {
        self.normal.matrix()
    }

    /// The squared length of a step in standard deviations: ξᵀ Σ⁻¹ ξ.
    pub(crate) fn away(&self, step: &Vector6<f64>) -> f64 {
        step.dot(&(self.normal.matrix() * step))
    }

    /// tr Σ_φφ (rad²), by the Schur complement of the translation.
    pub(crate) fn attitude_variance(&self) -> Option<f64> {
        let normal = self.normal.matrix();
        let block = |row, column| normal.fixed_view::<3, 3>(row, column).into_owned();
        let (turn, mixed, shift) = (block(0, 0), block(0, 3), block(3, 3));
        let schur = turn - mixed * shift.cholesky()?.solve(&mixed.transpose());
        Some(schur.cholesky()?.inverse().trace())
    }

    /// The step and its decrement gᵀ ξ, the squared length in standard deviations.
    pub(crate) fn step(&self, damping: f64) -> Option<(Vector6<f64>, f64)> {
        let step = self.normal.solve(damping, &self.gradient)?;
        let decrement = self.gradient.dot(&step);
        decrement.is_finite().then_some((step, decrement))
    }

    pub(crate) fn determined(&self, damping: f64) -> Result<(Vector6<f64>, f64), Degenerate> {
        self.step(damping).ok_or_else(|| singular(&self.normal.matrix()))
    }
}

/// Decrement below which no improvement is left: a step of 1e-10 standard deviations.
const NOTHING: f64 = 1e-20;
/// Decrement below which the cost is dominated by rounding; the steps themselves must shrink from there.
pub(crate) const NEAR: f64 = 1e-4;
/// Maximum number of steps of one descent. Six suffice for nearly all problems; a few weak points have a long curved
/// valley, in which Gauss–Newton steps are far too short or too long.
const MAX_STEPS: u64 = 500;

/// The minimum of the cost near `start`, by the Levenberg–Marquardt method.
///
/// It ends at a step shorter than √`near` standard deviations, and returns the pose and its normal equations. The
/// weights of `term` must not depend on the pose, as every step must lower the cost (Marquardt, *An algorithm for
/// least-squares estimation of nonlinear parameters*, 1963).
///
/// # Errors
///
/// A start that puts a point behind a camera, or an undetermined motion.
pub(crate) fn descend(
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

/// The pose at which Gauss–Newton steps vanish, from one near it.
///
/// Returns the pose, and the normal equations at it or one vanishing step before; `here` is `term` at `start`. Each
/// step must be shorter than the last; otherwise steps are halved from there on. If the weights of `term` depend on the
/// pose, the result solves the likelihood equation Σ Jᵀ W r = 0 with the weights of its own answer, which no cost
/// measures.
///
/// # Errors
///
/// As [`descend`], and steps that do not vanish.
pub(crate) fn settle(
    points: &[Observation],
    start: Transform<Object, Camera>,
    here: Linearized,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
    let (mut pose, mut here, mut last, mut fraction) = (start, here, f64::INFINITY, 1.0);
    for taken in 0..MAX_STEPS {
        let (step, decrement) = here.determined(0.0)?;
        if !(decrement < last) {
            // Only rounding is left, or the steps overshoot the minimum.
            let done = converged(taken, last.sqrt());
            if done.is_ok() || fraction < MIN_FRACTION {
                return done.map(|()| (pose, here));
            }
            fraction *= 0.5;
        }
        pose = moved(&pose, &(step * fraction));
        // Steps shrink at least by a constant factor, so a vanishing next step is predictable.
        let rate = if last.is_finite() { decrement / last } else { SHRINK };
        if decrement * rate <= NOTHING {
            return Ok((pose, here));
        }
        last = decrement;
        here = linearize(points, &pose, term)?;
    }
    converged(MAX_STEPS, last.sqrt()).map(|()| (pose, here))
}

/// Fraction of a step below which no progress is expected.
const MIN_FRACTION: f64 = 0.01;
/// Assumed reduction of the first decrement.
const SHRINK: f64 = 1e-2;

/// `pose · Exp(step)` to second order, with an exact rotation.
pub(crate) fn moved(pose: &Transform<Object, Camera>, step: &Vector6<f64>) -> Transform<Object, Camera> {
    // A rotation of more than half a radian exceeds the validity of the normal equations.
    let turn = step.fixed_rows::<3>(0).norm();
    let step = if turn > 0.5 { step * (0.5 / turn) } else { *step };
    let half = step.fixed_rows::<3>(0) * 0.5;
    let shift = step.fixed_rows::<3>(3).into_owned();
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(1.0, half.x, half.y, half.z));
    let step = Transform::<Camera, Camera>::new(rotation, shift + half.cross(&shift));
    (*pose * step).renormalized()
}

/// The minimum by [`descend`], to the precision of the cost, and then by [`settle`].
///
/// # Errors
///
/// As these.
pub(crate) fn minimize(
    points: &[Observation],
    start: &Transform<Object, Camera>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let (pose, here) = descend(points, start, NEAR, term)?;
    Ok(settle(points, pose, here, term)?.0)
}
