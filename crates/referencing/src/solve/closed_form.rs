//! The closed-form fit of points with one weight each, and the scalar noise that gives the weights.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Object, Transform};

use crate::observations::Observation;

/// The least-squares motion of three or more points that are not collinear.
pub(crate) fn fit(points: &[Observation]) -> Transform<Object, Camera> {
    fit_weighted(points, |_| 1.0)
}

/// The motion that minimises Σ w_k ‖P_k − C_k H‖², w_k = `weight(k)`; some weight must be positive.
pub(crate) fn fit_weighted(points: &[Observation], weight: impl Fn(usize) -> f64) -> Transform<Object, Camera> {
    let (mut model, mut measured, mut all) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (k, point) in points.iter().enumerate() {
        let w = weight(k);
        model += point.model.coords * w;
        measured += point.measured.at.coords * w;
        all += w;
    }
    let (model, measured) = (model / all, measured / all);
    let mut m = Matrix3::zeros();
    for (k, point) in points.iter().enumerate() {
        m += (point.model.coords - model) * weight(k) * (point.measured.at.coords - measured).transpose();
    }
    let rotation = Transform::<Object, Camera>::from_axes(&rotation_of(&m), Vector3::zeros()).rotation();
    Transform::new(rotation, model - rotation * measured)
}

/// The rotation R that maximises tr(Rᵀ M); any of them for points on a line, which have many.
///
/// One-sided Jacobi (Hestenes, 1958): rotations from the right make the columns of M orthogonal, M V = U S, without the
/// loss of precision of MᵀM in the weaker directions. The two stronger columns of U and V are kept and the third is
/// their cross product, so that det R = +1 by construction.
fn rotation_of(m: &Matrix3<f64>) -> Matrix3<f64> {
    let mut a = [0, 1, 2].map(|k| m.column(k).into_owned());
    let mut v = [Vector3::x(), Vector3::y(), Vector3::z()];
    for _ in 0..MAX_SWEEPS {
        let mut turned = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (alpha, beta, gamma) = (a[p].norm_squared(), a[q].norm_squared(), a[p].dot(&a[q]));
            if gamma * gamma <= ORTHOGONAL * ORTHOGONAL * alpha * beta {
                continue;
            }
            turned = true;
            let zeta = (beta - alpha) / (2.0 * gamma);
            let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let c = 1.0 / (1.0 + t * t).sqrt();
            let s = c * t;
            (a[p], a[q]) = (a[p] * c - a[q] * s, a[p] * s + a[q] * c);
            (v[p], v[q]) = (v[p] * c - v[q] * s, v[p] * s + v[q] * c);
        }
        if !turned {
            break;
        }
    }
    let size = [0, 1, 2].map(|k| a[k].norm_squared());
    let weakest = (0..3).fold(0, |min, k| if size[k] < size[min] { k } else { min });
    // Cyclic order: the third is the cross product of the two after it.
    let (i, j) = ((weakest + 1) % 3, (weakest + 2) % 3);
    let (u1, u2) = axes(&a[i], &a[j]);
    u1 * v[i].transpose() + u2 * v[j].transpose() + u1.cross(&u2) * v[i].cross(&v[j]).transpose()
}

/// The directions of two orthogonal columns; for a column without length any direction across the other.
fn axes(a: &Vector3<f64>, b: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let (long, short) = (a.norm_squared().max(b.norm_squared()), a.norm_squared().min(b.norm_squared()));
    if short > LENGTHLESS * long {
        return (a.normalize(), b.normalize());
    }
    let across = |u: &Vector3<f64>| u.cross(&Vector3::ith(u.iamin(), 1.0)).normalize();
    if a.norm_squared() >= b.norm_squared() {
        let u = a.try_normalize(0.0).unwrap_or_else(Vector3::x);
        (u, across(&u))
    } else {
        let u = b.normalize();
        (across(&u), u)
    }
}

/// The squared length of a column, as a fraction of the longer one's, that is rounding alone.
const LENGTHLESS: f64 = 1e-30;
/// Cosine below which two columns count as orthogonal.
const ORTHOGONAL: f64 = 1e-15;
/// Maximum number of sweeps; three or four suffice, as convergence is quadratic.
const MAX_SWEEPS: usize = 30;

/// The mean variance of a residual along an axis (m²).
pub(crate) fn variance(point: &Observation) -> f64 {
    point.noise().trace() / 3.0
}

/// The residual in standard deviations of its point, one number for all axes.
///
/// With the full covariance the weights would belong to another sum than the minimised one, and the iteration might not
/// converge.
pub(crate) fn distance(point: &Observation, pose: &Transform<Object, Camera>) -> f64 {
    point.residual(pose).norm() / variance(point).sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use seafix_geometry::UncertainPoint;

    use super::*;

    /// Two points on the x axis rotated by α and two on the y axis rotated by −β, with weights 1 and 2: the best angle
    /// is atan((2 sin α − 4 sin β) / (2 cos α + 4 cos β)).
    #[test]
    fn weights_are_those_of_the_sum() {
        let (alpha, beta) = (0.3_f64, 0.1_f64);
        let turned = |x: f64, y: f64, angle: f64| {
            let (s, c) = angle.sin_cos();
            Vector3::new(c * x - s * y, s * x + c * y, 0.0)
        };
        let point = |model: Vector3<f64>, measured: Vector3<f64>| Observation {
            measured: UncertainPoint::isotropic((measured + Vector3::new(0.2, -0.4, 3.0)).into(), 0.01),
            pixels: None,
            model: (model + Vector3::new(5.0, -7.0, 1.0)).into(),
            model_sigma: 0.0,
        };
        let places = [(1.0, 0.0, -alpha), (-1.0, 0.0, -alpha), (0.0, 1.0, beta), (0.0, -1.0, beta)];
        let points = places.map(|(x, y, angle)| point(Vector3::new(x, y, 0.0), turned(x, y, angle)));
        let weights = [1.0, 1.0, 2.0, 2.0];
        let angle = (2.0 * alpha.sin() - 4.0 * beta.sin()).atan2(2.0 * alpha.cos() + 4.0 * beta.cos());
        let found = fit_weighted(&points, |k| weights[k]);
        let expected = Transform::<Object, Camera>::new(
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle),
            Vector3::new(5.0, -7.0, 1.0) - turned(0.2, -0.4, angle) - Vector3::z() * 3.0,
        );
        assert!(expected.error_to(&found).amax() < 1e-14, "{}", expected.error_to(&found));
    }

    /// tr(Rᵀ M) of the best rotation is s₁ + s₂ ± s₃: the trace of a diagonal M, or with a negative determinant the two
    /// largest values minus the smallest.
    #[test]
    fn the_rotation_maximises_the_trace() {
        let turn = |angles: [f64; 3]| seafix_geometry::so3::exp(&angles.into()).to_rotation_matrix().into_inner();
        let (u, v) = (turn([0.4, -0.3, 1.1]), turn([-0.7, 2.0, 0.2]));
        for (values, max) in [
            ([3.0, 2.0, 1.0], 6.0),
            ([1.0, 3.0, 2.0], 6.0),
            ([2.0, 1.0, 3.0], 6.0),
            ([3.0, 2.0, -1.0], 4.0),
            ([-1.0, 3.0, 2.0], 4.0),
            ([3.0, -1.0, 2.0], 4.0),
            ([5.0, 4.0, 0.0], 9.0),
            ([1.0, 1.0, 1.0], 3.0),
            ([1e6, 1.0, 1e-6], 1_000_001.000_001),
        ] {
            let m = u * Matrix3::from_diagonal(&values.into()) * v.transpose();
            let r = rotation_of(&m);
            assert!((r.transpose() * m).trace() / max - 1.0 > -1e-14, "{values:?}: {}", (r.transpose() * m).trace());
            assert!((r.transpose() * r - Matrix3::identity()).amax() < 1e-14, "{values:?}");
            assert!((r.determinant() - 1.0).abs() < 1e-14, "{values:?}");
        }
        // Points on a line, along an axis and oblique, and no points.
        let line = u.column(0) * v.column(1).transpose();
        for m in [Matrix3::from_diagonal(&Vector3::new(0.0, 2.0, 0.0)), line, line * 1e-9, Matrix3::zeros()] {
            let r = rotation_of(&m);
            assert!((r.transpose() * r - Matrix3::identity()).amax() < 1e-14 && r.determinant() > 0.0, "{m}: {r}");
            assert!((r.transpose() * m).trace() >= m.norm() * (1.0 - 1e-14), "{m}: {r}");
        }
    }
}
