//! The covariance of least squares whose weights are not the inverse of the noise.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::{
    observations::{Observation, Observations},
    solve::{
        covariance::resampled,
        degeneracy::Degenerate,
        likelihood::{
            normal::{Normal, inverse},
            stereo_cameras::StereoCameras,
        },
    },
};

/// The sandwich covariance A⁻¹ B A⁻¹ of the minimum of Σ w_k ‖C_k − p_k‖².
///
/// A = Σ w JᵀJ and B = Σ w² Jᵀ S J, with J = \[ \[p\]×, −I \] and S the noise of a point (Huber, *The behavior of
/// maximum likelihood estimates under nonstandard conditions*, 1967). Levers and noise are evaluated at the fitted
/// points p. The measured points are scattered by their noise, which in depth may be as large as the object: they would
/// overstate the levers, and a point moved nearer by noise would appear more precise.
pub(crate) fn covariance(
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
    weight: impl Fn(usize) -> f64,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let (mut a, mut b) = (Normal::default(), Normal::default());
    let camera_from_object = at.inverse();
    let cameras = data.rig.map(StereoCameras::of);
    for (k, point) in data.points.iter().enumerate() {
        let place = (camera_from_object * point.model).coords;
        let w = weight(k);
        a.add(&place, &(Matrix3::identity() * w));
        b.add(&place, &(noise(cameras.as_ref(), point, &place) * (w * w)));
    }
    let bread = inverse(&a.matrix())?;
    Ok(Covariance6::new(bread * b.matrix() * bread))
}

/// Largest standard deviation of the attitude (rad) at which errors are linear in the noise.
const STRAIGHT: f64 = 0.15;

/// The sandwich [`covariance`] if errors are linear in the noise; otherwise, beyond [`STRAIGHT`], the covariance by
/// resampling with `solve`.
pub(crate) fn or_resampled(
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
    weight: impl Fn(usize) -> f64,
    solve: impl Fn(&Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let known = covariance(data, at, weight)?;
    if known.attitude_rms() <= STRAIGHT {
        Ok(known)
    } else {
        resampled::covariance(solve, data, at, resampled::Answer::Straight)
    }
}

/// The covariance (m²) of a point's residual, evaluated at `place`.
fn noise(cameras: Option<&StereoCameras<'_>>, point: &Observation, place: &Vector3<f64>) -> Matrix3<f64> {
    let refitted = || {
        let (_, j) = cameras?.project(place)?;
        (j.transpose() * point.pixels?.covariance.try_inverse()? * j).try_inverse()
    };
    let digits = point.digits();
    let model = Matrix3::identity() * (point.model_sigma * point.model_sigma + digits * digits);
    refitted().unwrap_or(point.measured.covariance) + model
}
