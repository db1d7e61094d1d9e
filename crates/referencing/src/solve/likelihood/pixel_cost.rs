//! χ² of the pixels as a function of six numbers, for general-purpose optimisers.

use std::cell::RefCell;

use argmin::core::{CostFunction, Error, Gradient};
use nalgebra::{Matrix4, Matrix6, Vector6};
use seafix_geometry::{Camera, Object, StereoRig, Transform};

use crate::{
    observations::{Observation, Observations},
    solve::{
        degeneracy::Degenerate,
        likelihood::normal::{inverse, singular},
    },
};

/// The best evaluated argument: its cost and its six numbers.
#[derive(Debug)]
pub(crate) struct Best(RefCell<(f64, [f64; 6])>);

impl Default for Best {
    fn default() -> Self {
        Self(RefCell::new((f64::INFINITY, [0.0; 6])))
    }
}

impl Best {
    /// The cost and the six numbers; infinite cost and zeros before any evaluation.
    pub(crate) fn seen(&self) -> (f64, [f64; 6]) {
        *self.0.borrow()
    }
}

/// The cost Σ rᵀ S⁻¹ r at `start · Exp(L x)` over the pixel residuals r.
///
/// S = Σ_px + σ_model² J Jᵀ, with J at the measured point. L Lᵀ is the covariance at the start from small steps of its
/// own, so that x is in standard deviations and the cost is equally steep in all directions. The function shares
/// nothing with the solvers that it verifies: projections are the rig's, and the gradient is by central differences.
pub(crate) struct PixelCost<'a> {
    rig: &'a StereoRig,
    points: &'a [Observation],
    weights: Vec<Matrix4<f64>>,
    start: Transform<Object, Camera>,
    scale: Matrix6<f64>,
    best: &'a Best,
}

/// Cost of a pose that puts a point behind a camera.
const UNSEEN: f64 = 1e30;
/// Step (standard deviations) of the gradient's differences, and of the scale's (rad, m).
const STEP: f64 = 1e-4;

impl<'a> PixelCost<'a> {
    /// The cost function about `start`.
    pub(crate) fn of(
        data: &'a Observations<'_>,
        rig: &'a StereoRig,
        start: Transform<Object, Camera>,
        best: &'a Best,
    ) -> Result<Self, Degenerate> {
        let weight = |(index, point): (usize, &Observation)| {
            let (at, model) = (point.measured.at, point.model_sigma * point.model_sigma);
            let (_, j) = rig.project_with_jacobian(&at).ok_or(Degenerate::Hidden { index, depth: at.coords.z })?;
            let pixels = point.pixels.ok_or(Degenerate::NoPixels)?.covariance;
            let noise = pixels + j * j.transpose() * model + Matrix4::identity() * 1e-12;
            noise.try_inverse().ok_or(Degenerate::Noise { index })
        };
        let weights = data.points.iter().enumerate().map(weight).collect::<Result<_, _>>()?;
        let mut cost = Self { rig, points: &data.points, weights, start, scale: Matrix6::identity(), best };
        cost.scale = cost.spread()?;
        Ok(cost)
    }

    /// L of (Σ (∂r)ᵀ S⁻¹ ∂r)⁻¹ = L Lᵀ, by central differences of the projections.
    fn spread(&self) -> Result<Matrix6<f64>, Degenerate> {
        let mut information = Matrix6::zeros();
        for (index, (point, weight)) in self.points.iter().zip(&self.weights).enumerate() {
            let at = |xi: Vector6<f64>| {
                let place = self.start.perturbed(&xi).inverse() * point.model;
                let seen = self.rig.project(&place).ok_or(Degenerate::Hidden { index, depth: place.coords.z })?;
                Ok::<_, Degenerate>(seen.coordinates())
            };
            let mut j = nalgebra::Matrix4x6::zeros();
            for i in 0..6 {
                let xi = Vector6::ith(i, STEP);
                j.set_column(i, &((at(xi)? - at(-xi)?) / (2.0 * STEP)));
            }
            information += j.transpose() * weight * j;
        }
        let covariance = inverse(&information)?;
        Ok(covariance.cholesky().ok_or_else(|| singular(&information))?.l())
    }

    /// The distance of the minimum from the start (standard deviations of the pose): half of the gradient, as χ² is the
    /// square of that distance.
    pub(crate) fn distance(&self) -> f64 {
        0.5 * Vector6::from(self.slope(&[0.0; 6])).norm()
    }

    /// ∂χ²/∂x by central differences.
    fn slope(&self, x: &[f64]) -> [f64; 6] {
        let mut moved = x.to_vec();
        std::array::from_fn(|i| {
            moved[i] = x[i] + STEP;
            let plus = self.chi2(&moved);
            moved[i] = x[i] - STEP;
            let minus = self.chi2(&moved);
            moved[i] = x[i];
            (plus - minus) / (2.0 * STEP)
        })
    }

    /// The pose of six numbers.
    pub(crate) fn pose(&self, x: &[f64]) -> Transform<Object, Camera> {
        self.start.perturbed(&(self.scale * Vector6::from_column_slice(x))).renormalized()
    }

    fn chi2(&self, x: &[f64]) -> f64 {
        let camera_from_object = self.pose(x).inverse();
        let of = |(point, weight): (&Observation, &Matrix4<f64>)| {
            let expected = self.rig.project(&(camera_from_object * point.model))?;
            let r = point.pixels?.at.coordinates() - expected.coordinates();
            Some(r.dot(&(weight * r)))
        };
        self.points.iter().zip(&self.weights).map(of).sum::<Option<f64>>().filter(|c| c.is_finite()).unwrap_or(UNSEEN)
    }
}

impl CostFunction for PixelCost<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Self::Param) -> Result<f64, Error> {
        let cost = self.chi2(x);
        let mut best = self.best.0.borrow_mut();
        if cost < best.0 {
            *best = (cost, std::array::from_fn(|i| x[i]));
        }
        Ok(cost)
    }
}

impl Gradient for PixelCost<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Self::Param) -> Result<Self::Gradient, Error> {
        Ok(self.slope(x).to_vec())
    }
}
