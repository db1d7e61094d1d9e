//! A part of the object displaced against the rest: its evidence, and the pose of the rest.

use nalgebra::{Cholesky, Matrix3, Matrix3x6, Matrix6, U6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform, so3::skew};

use crate::solve::likelihood::leave_out::Deletions;

/// The normal equations of a displacement η of some of the points, beside the pose ξ.
///
/// The points of the part measure ξ + η, the rest ξ. With N = N_R + N_P the information of rest and part, g the pull
/// of the part at the maximum-likelihood pose of all points, and a prior η ~ N(0, Q),
///
/// S = N_P − N_P N⁻¹ N_P, K = (S + Q⁻¹)⁻¹, η̂ = K g, ξ̂ = −N⁻¹ N_P η̂, Σ_ξ = N⁻¹ + N⁻¹ N_P K N_P N⁻¹,
///
/// and the Bayes factor against a rigid object is exp(½ gᵀ K g) / √det(I + Q S). Q gives every point of the part a
/// displacement of `sigma` along each axis: as a common shift, and as a rotation about the part's centroid.
pub(crate) struct MovedPart {
    covariance: Matrix6<f64>,
    /// N⁻¹ N_P.
    influence: Matrix6<f64>,
    schur: Matrix6<f64>,
    pull: Vector6<f64>,
    /// σ² Q⁻¹.
    spread: Matrix6<f64>,
    /// The derivative of the centroid's position by η.
    lever: Matrix3x6<f64>,
}

/// The estimate of a displacement, and its consequence for the pose.
pub(crate) struct Displaced {
    /// The natural logarithm of the Bayes factor against a rigid object.
    pub(crate) ln_bayes: f64,
    /// The step ξ̂ from the pose of all points.
    pub(crate) step: Vector6<f64>,
    /// The displacement of the part's centroid (m), camera axes.
    pub(crate) shift: Vector3<f64>,
    /// The factor of K⁻¹.
    root: Cholesky<f64, U6>,
}

/// Minimum radius of a part, as a fraction of its distance from the camera; a smaller part has no rotation of its own.
const MIN_RADIUS: f64 = 1e-3;

impl Deletions<'_> {
    /// The maximum-likelihood pose of all points.
    pub(crate) fn pose(&self) -> &Transform<Object, Camera> {
        &self.pose
    }

    /// The normal equations of a displacement of these points; `None` if the points together determine no pose.
    pub(crate) fn moved_part(&self, part: &[usize]) -> Option<MovedPart> {
        let covariance = self.all.covariance().ok()?;
        let (mut own, mut pull) = (Matrix6::zeros(), Vector6::zeros());
        for &k in part {
            own += self.each[k].information();
            pull += self.each[k].gradient;
        }
        let influence = covariance * own;
        let from_object = self.pose.inverse();
        let places = || part.iter().map(|&k| (from_object * Point::from(self.places[k])).coords);
        let count = part.len().max(1) as f64;
        let centre = places().sum::<Vector3<f64>>() / count;
        let square = places().map(|at| (at - centre).norm_squared()).sum::<f64>() / count;
        let mut lever = Matrix3x6::zeros();
        lever.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&centre));
        lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        let mut spread = lever.transpose() * lever;
        let mut turn = spread.fixed_view_mut::<3, 3>(0, 0);
        turn += Matrix3::identity() * square.max(MIN_RADIUS * MIN_RADIUS * centre.norm_squared());
        Some(MovedPart { covariance, influence, schur: own - own * influence, pull, spread, lever })
    }
}

impl MovedPart {
    /// The estimate under a prior displacement of `sigma` (m, each axis); `None` without a finite answer.
    pub(crate) fn displaced(&self, sigma: f64) -> Option<Displaced> {
        let prior = self.spread / (sigma * sigma);
        let root = (self.schur + prior).cholesky()?;
        let of_prior = prior.cholesky()?;
        let ln_det = |l: &Matrix6<f64>| l.diagonal().iter().map(|x| libm::log(*x)).sum::<f64>();
        let motion = root.solve(&self.pull);
        let ln_bayes = 0.5 * self.pull.dot(&motion) + ln_det(of_prior.l_dirty()) - ln_det(root.l_dirty());
        let step = -(self.influence * motion);
        ln_bayes.is_finite().then(|| Displaced { ln_bayes, step, shift: self.lever * motion, root })
    }

    /// The covariance of the pose under a displacement.
    pub(crate) fn covariance(&self, under: &Displaced) -> Covariance6<Object, Camera> {
        Covariance6::new(self.covariance + self.influence * under.root.solve(&self.influence.transpose()))
    }

    /// The standard deviation (m, three axes together) of [`Displaced::shift`].
    pub(crate) fn shift_sigma(&self, under: &Displaced) -> f64 {
        (self.lever * under.root.solve(&self.lever.transpose())).trace().max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        observations::{Observation, Observations},
        solve::{mahalanobis::Mahalanobis, solver::Solver},
    };
    use seafix_geometry::UncertainPoint;

    const SIGMA: f64 = 2e-3;

    /// Nine points, three of them displaced by `shift` (m).
    fn seen(shift: f64) -> (Observations<'static>, Transform<Object, Camera>) {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -3.0].into());
        let points = (0..9).map(|k| {
            let (a, b) = (f64::from(k) * 1.3, f64::from(k * k % 5) * 0.4);
            let at = Point::new(a.sin(), b - 0.7, 0.5 * (a * 0.7).cos());
            let off = Vector3::new(0.6, -0.8, 0.0) * if k < 3 { shift } else { 0.0 };
            Observation {
                measured: UncertainPoint::isotropic(pose.inverse() * at + off, SIGMA),
                pixels: None,
                model: at,
                model_sigma: 0.0,
            }
        });
        (Observations { points: points.collect(), edges: Vec::new(), rig: None }, pose)
    }

    /// With a wide prior the pose under a displacement is the pose of the rest, and so is its covariance.
    #[test]
    fn a_free_part_leaves_the_pose_of_the_rest() {
        let (data, truth) = seen(4e-3);
        let all = Deletions::of(&data).unwrap();
        let part = all.moved_part(&[0, 1, 2]).unwrap();
        let under = part.displaced(1e3).unwrap();
        let rest = Observations { points: data.points[3..].to_vec(), edges: Vec::new(), rig: None };
        let witness = Mahalanobis::default();
        let expected = witness.covariance(&rest, &truth).unwrap();
        let off = truth.error_to(&all.pose().perturbed(&under.step));
        let far = truth.error_to(all.pose());
        assert!(off.norm() < 0.02 * far.norm(), "{off} {far}");
        let found = part.covariance(&under).matrix;
        assert!((found - expected.matrix).amax() < 0.02 * expected.matrix.amax());
        assert!((under.shift.norm() - 4e-3).abs() < 2e-4, "{}", under.shift);
    }

    /// The Bayes factor is the ratio of the marginal likelihoods: χ² and determinant of the stacked residuals with and
    /// without the covariance J Q Jᵀ of the displacement, projected beside the pose.
    #[test]
    fn the_bayes_factor_is_that_of_the_marginal_likelihoods() {
        let (data, _) = seen(2e-2);
        let all = Deletions::of(&data).unwrap();
        let sigma = 5e-3;
        let part = [0, 1, 2];
        let found = all.moved_part(&part).unwrap().displaced(sigma).unwrap();
        let rows = 3 * data.points.len();
        let (mut j, mut r) = (nalgebra::DMatrix::zeros(rows, 6), nalgebra::DVector::zeros(rows));
        for (k, point) in data.points.iter().enumerate() {
            let at = (all.pose().inverse() * point.model).coords;
            j.view_mut((3 * k, 0), (3, 3)).copy_from(&skew(&at));
            j.view_mut((3 * k, 3), (3, 3)).copy_from(&-Matrix3::identity());
            r.rows_mut(3 * k, 3).copy_from(&(point.measured.at.coords - at));
        }
        let moved = all.moved_part(&part).unwrap();
        let q = moved.spread.try_inverse().unwrap() * (sigma * sigma);
        let q = nalgebra::DMatrix::from_column_slice(6, 6, q.as_slice());
        // The pose has a prior so wide that it cancels.
        let wide = nalgebra::DMatrix::<f64>::identity(6, 6) * 1e2;
        let mut of_part = j.clone();
        of_part.rows_mut(9, rows - 9).fill(0.0);
        let noise = nalgebra::DMatrix::identity(rows, rows) * (SIGMA * SIGMA) + &j * &wide * j.transpose();
        let ln = |covariance: &nalgebra::DMatrix<f64>| {
            let root = covariance.clone().cholesky().unwrap();
            -0.5 * r.dot(&root.solve(&r)) - root.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
        };
        let expected = ln(&(&noise + &of_part * q * of_part.transpose())) - ln(&noise);
        assert!((found.ln_bayes - expected).abs() < 1e-2, "{} {expected}", found.ln_bayes);
        assert!(found.ln_bayes > 0.0, "{}", found.ln_bayes);
    }
}
