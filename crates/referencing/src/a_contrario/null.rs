//! The null model: the distribution of candidates if none of them is true.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::MeasuredPoint;

use super::{
    coordinates::{coordinates, shuffled},
    sample::spread_sample,
    sequence::QuasiRandom,
};
use crate::{
    chi_square::chi_square,
    parts::Parts,
    problem::{Correspondence, Prior, PriorBound, Problem},
};

/// Confidence of the gates of a Gaussian prior, the default of [`crate::Gate`].
const CONFIDENCE: f64 = 0.99;
/// Number of nearest points that define a local density; maximum number of points searched.
const NEAREST: usize = 4;
const MAX_SAMPLED: usize = 200;
/// Minimum length (m).
const MIN: f64 = 1e-9;

/// The distribution of the candidates of a model point by chance.
pub(super) enum Null<'a> {
    /// Anywhere in its gate.
    Gates(Vec<GateVolume>),
    /// Anywhere in a box of these lengths, with the cloud's density about the set ([`Parts`]).
    Box(Vector3<f64>),
    /// At any partner.
    Shuffled(Vec<&'a MeasuredPoint>),
}

/// A box about the predicted place of a model point.
#[derive(Clone, Copy)]
pub(super) struct GateVolume {
    pub(super) centre: Vector3<f64>,
    pub(super) half: Vector3<f64>,
    ln_volume: f64,
    /// The density of its candidates relative to that of [`Null::ln_scale`].
    pub(super) relative_density: f64,
}

impl<'a> Null<'a> {
    pub(super) fn of(problem: &Problem<'a>, about: &[Correspondence]) -> Self {
        let lists = &problem.candidates.lists;
        if let Some(prior) = problem.prior {
            return Self::Gates(gates(problem, prior));
        }
        if !shuffled(problem) {
            let parts = Parts::of(problem);
            let about = about.first().map(|pair| pair.cloud).or_else(|| parts.in_largest());
            let lengths = about.map_or(Vector3::zeros(), |about| parts.as_dense(about));
            return Self::Box(lengths.add_scalar(MIN));
        }
        let mut partners: Vec<usize> = lists.iter().flatten().copied().collect();
        spread_sample(problem.cloud, &mut partners, MAX_SAMPLED);
        Self::Shuffled(partners.into_iter().map(|j| &problem.cloud[j]).collect())
    }

    /// ln of the density of a candidate that the sampled densities omit.
    pub(super) fn ln_scale(&self) -> f64 {
        match self {
            Self::Gates(gates) => {
                -gates.first().map_or(0.0, |first| first.ln_volume + libm::log(first.relative_density))
            }
            Self::Box(lengths) => -libm::log(lengths.product()),
            Self::Shuffled(_) => 0.0,
        }
    }
}

/// The box of each model point. For a Gaussian prior's ellipsoid (c − p)ᵀ S⁻¹ (c − p) ≤ χ² it has the same volume and
/// proportions.
fn gates(problem: &Problem<'_>, prior: &Prior) -> Vec<GateVolume> {
    let camera_from_object = prior.object_from_camera.inverse();
    let gate = |(point, list): (&crate::site::model::ModelPoint, &Vec<usize>)| {
        let centre = camera_from_object * point.at;
        let half = match &prior.bound {
            PriorBound::Box(half) => Vector3::repeat(*half),
            PriorBound::Gaussian(covariance) => {
                let own = point.sigma * point.sigma;
                let noise = list.iter().map(|&j| problem.cloud[j].position.covariance).sum::<Matrix3<f64>>();
                let noise = noise / list.len().max(1) as f64;
                let s = covariance.of_point(&centre) + noise + Matrix3::identity() * own;
                let axes = s.diagonal().map(|variance| variance.max(0.0).sqrt());
                let volume = 4.0 / 3.0 * std::f64::consts::PI * chi_square(3, CONFIDENCE).powf(1.5);
                let ellipsoid = volume * s.determinant().max(0.0).sqrt();
                axes * libm::cbrt(ellipsoid / (8.0 * axes.product()).max(f64::MIN_POSITIVE))
            }
        };
        let half = half.add_scalar(MIN);
        GateVolume { centre: centre.coords, half, ln_volume: libm::log(8.0 * half.product()), relative_density: 1.0 }
    };
    let mut gates: Vec<GateVolume> = problem.model.iter().zip(&problem.candidates.lists).map(gate).collect();
    let scale = mean_ln_volume(&gates);
    for gate in gates.iter_mut().filter(|gate| gate.ln_volume != scale) {
        gate.relative_density = libm::exp(scale - gate.ln_volume);
    }
    gates
}

fn mean_ln_volume(gates: &[GateVolume]) -> f64 {
    match gates.iter().map(|gate| gate.ln_volume).reduce(f64::max) {
        Some(max) if gates.iter().all(|gate| gate.ln_volume == max) => max,
        _ => gates.iter().map(|gate| gate.ln_volume).sum::<f64>() / gates.len().max(1) as f64,
    }
}

/// The density (1/m³) of one point of `cloud` about a place: (q − 1)/(N · volume to the q-th nearest).
pub(super) fn density(cloud: &[&MeasuredPoint], at: &Vector3<f64>) -> f64 {
    let q = NEAREST.min(cloud.len());
    if q < 2 {
        return 0.0;
    }
    let mut nearest = [f64::INFINITY; NEAREST];
    for point in cloud {
        let square = (coordinates(point) - at).norm_squared();
        if square < nearest[q - 1] {
            let place = nearest[..q - 1].iter().position(|&near| square < near).unwrap_or(q - 1);
            nearest[place..q].rotate_right(1);
            nearest[place] = square;
        }
    }
    let radius = nearest[q - 1].sqrt().max(MIN);
    (q - 1) as f64 / (cloud.len() as f64 * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3))
}

/// The place of one of the cloud points.
pub(super) fn any(cloud: &[&MeasuredPoint], sequence: &mut QuasiRandom) -> Vector3<f64> {
    coordinates(cloud[sequence.below(cloud.len())])
}
