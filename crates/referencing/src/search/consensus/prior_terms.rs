//! The prior pose as a probability density over rigid motions.

use nalgebra::{Cholesky, Matrix3, Matrix3x6, Matrix6, U6, Vector3, Vector6};
use seafix_geometry::so3::{log_of_matrix, skew};

use super::{
    gaussian::{HALF_LN_2PI, half_ln_det},
    motion::Motion,
};
use crate::{
    parts::Parts,
    problem::{Prior, PriorBound, Problem},
};

/// Number of standard deviations that a bound of the prior stands for, since bounds are given to hold.
pub(in crate::search) const BOUND_SIGMAS: f64 = 3.0;

/// The prior's terms of a likelihood.
///
/// Motions are compared by η = (φ, τ): the rotation from the prior attitude (rad, camera axes) and the translation of
/// the model's centroid, that of its anchors (m). dφ dτ is the measure of every density here.
pub(in crate::search) struct PriorTerms {
    /// The prior motion; `None` without a prior.
    pub(in crate::search) known: Option<PriorDensity>,
    /// Centroid of the model.
    pub(in crate::search) centroid: Vector3<f64>,
    /// ln of the density at its maximum.
    pub(in crate::search) ln_peak: f64,
    /// The parts of the cloud; `None` with a prior, which has gates of its own.
    pub(in crate::search) parts: Option<Parts>,
}

/// The density of a prior pose, in these coordinates.
pub(in crate::search) struct PriorDensity {
    pub(in crate::search) motion: Motion,
    /// Information on η.
    pub(in crate::search) information: Matrix6<f64>,
    /// Maximum standard deviation of the rotation (rad).
    pub(in crate::search) attitude: f64,
    /// Predicted place of each model point, with its standard deviation along each axis (m).
    pub(in crate::search) places: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Half-size of a box prior along each camera axis (m): the pose must leave every anchor within it.
    pub(in crate::search) half: Option<f64>,
    /// The anchors, object frame, with their predicted places.
    anchors: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl PriorTerms {
    pub(in crate::search) fn of(problem: &Problem<'_>) -> Option<Self> {
        let anchors: Vec<Vector3<f64>> = problem.anchors().iter().map(|anchor| anchor.at.coords).collect();
        let centroid = anchors.iter().sum::<Vector3<f64>>() / anchors.len().max(1) as f64;
        let Some(prior) = problem.prior else {
            // Any attitude (8π² is the volume of SO(3) in this measure), anywhere in the boxes of the candidates'
            // parts.
            let parts = Parts::of(problem);
            let ln_peak = -parts.ln_volume() - libm::log(8.0 * std::f64::consts::PI.powi(2));
            return Some(Self { known: None, centroid, ln_peak, parts: Some(parts) });
        };
        let motion = Motion::of(&prior.object_from_camera.inverse());
        let at = motion.apply(&centroid);
        let covariance = covariance(&anchors, prior, &motion, &at);
        let chol = covariance.cholesky()?;
        let information = chol.inverse();
        let ln_peak = -half_ln_det(&chol) - 6.0 * HALF_LN_2PI;
        let attitude = covariance.fixed_view::<3, 3>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt();
        let places = problem
            .model
            .iter()
            .map(|point| {
                let place = motion.apply(&point.at.coords);
                let spread = spread(&covariance, &(place - at));
                (place, spread.diagonal().map(|variance| (variance + point.sigma * point.sigma).max(0.0).sqrt()))
            })
            .collect();
        let half = match prior.bound {
            PriorBound::Box(half) => Some(half),
            PriorBound::Gaussian(_) => None,
        };
        let anchors = anchors.iter().map(|anchor| (*anchor, motion.apply(anchor))).collect();
        let known = Some(PriorDensity { motion, information, attitude, places, half, anchors });
        Some(Self { known, centroid, ln_peak, parts: None })
    }

    /// η of a motion.
    pub(in crate::search) fn step_to(&self, known: &PriorDensity, motion: &Motion) -> Vector6<f64> {
        let phi = log_of_matrix(&(motion.rotation * known.motion.rotation.transpose()));
        let tau = motion.apply(&self.centroid) - known.motion.apply(&self.centroid);
        Vector6::new(phi.x, phi.y, phi.z, tau.x, tau.y, tau.z)
    }

    /// Whether the prior's box holds every anchor under a motion, up to the motion's error.
    pub(in crate::search) fn holds(&self, motion: &Motion, information: &Cholesky<f64, U6>) -> bool {
        let Some((known, half)) = self.known.as_ref().and_then(|known| Some((known, known.half?))) else { return true };
        let mut covariance = None;
        known.anchors.iter().all(|(anchor, predicted)| {
            let step = motion.apply(anchor) - predicted;
            if step.amax() <= half {
                return true;
            }
            let covariance = covariance.get_or_insert_with(|| information.inverse());
            let lever = skew(&(motion.apply(anchor) - motion.apply(&self.centroid)));
            // x = τ − [lever]× φ.
            let mut j = Matrix3x6::zeros();
            j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-lever);
            j.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
            let spread = (j * *covariance * j.transpose()).diagonal();
            (0..3).all(|axis| step[axis].abs() <= half + BOUND_SIGMAS * spread[axis].max(0.0).sqrt())
        })
    }

    /// ln of the density at a motion.
    pub(in crate::search) fn ln_density(&self, motion: &Motion) -> f64 {
        self.known.as_ref().map_or(self.ln_peak, |known| self.ln_density_of(known, &self.step_to(known, motion)))
    }

    /// ln of the density of η.
    pub(in crate::search) fn ln_density_of(&self, known: &PriorDensity, eta: &Vector6<f64>) -> f64 {
        self.ln_peak - 0.5 * eta.dot(&(known.information * eta))
    }
}

/// Covariance (m²) of the place of a point with this lever about the centroid (m): τ − [lever]× φ to first order.
pub(in crate::search) fn spread(covariance: &Matrix6<f64>, lever: &Vector3<f64>) -> Matrix3<f64> {
    let lever = skew(lever);
    let (turn, mixed) = (covariance.fixed_view::<3, 3>(0, 0), covariance.fixed_view::<3, 3>(0, 3));
    let cross = lever * mixed;
    lever * turn * lever.transpose() + covariance.fixed_view::<3, 3>(3, 3) - cross - cross.transpose()
}

/// Covariance of η.
fn covariance(anchors: &[Vector3<f64>], prior: &Prior, motion: &Motion, at: &Vector3<f64>) -> Matrix6<f64> {
    match &prior.bound {
        PriorBound::Gaussian(xi) => {
            // Exp(−ξ) moves camera coordinates: φ = −φ_ξ, τ = −ρ − φ_ξ × p̄ to first order; signs cancel in Σ.
            let mut j = Matrix6::identity();
            j.fixed_view_mut::<3, 3>(3, 0).copy_from(&-skew(at));
            j * xi.matrix * j.transpose()
        }
        PriorBound::Box(half) => {
            let reach = anchors.iter().map(|anchor| (motion.apply(anchor) - at).norm());
            let reach = reach.fold(0.0, f64::max).max(1e-9);
            let (tau, phi) = (half / BOUND_SIGMAS, half / (BOUND_SIGMAS * reach));
            Matrix6::from_diagonal(&Vector6::new(phi * phi, phi * phi, phi * phi, tau * tau, tau * tau, tau * tau))
        }
    }
}
