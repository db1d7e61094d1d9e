//! Distance residuals: lower bounds of the residual cost from distances alone.

use nalgebra::Vector3;

use super::likelihood::Term;

/// Relative allowance for second-order terms in the variance of a distance; it also keeps collinear places regular.
const CURVED: f64 = 0.1;

/// Residual (nats) that is tolerated: a pair near the right one may cause it and is replaced once the pose is fitted.
const PASSES: f64 = 3.0;

/// The reduction of a set's bound by its distance residual (nats).
#[inline]
pub(in crate::search) fn lost_to(distance_residual: f64) -> f64 {
    (distance_residual - PASSES).max(0.0)
}

/// A side of a triangle of pairs: the distance of two pairs, with its error and direction.
#[derive(Clone, Copy)]
pub(in crate::search) struct Side {
    /// Measured minus model distance (m).
    length_error: f64,
    /// Direction from the first measured place to the second.
    along: Vector3<f64>,
    /// Variance of the distance error (m²).
    variance: f64,
}

impl Side {
    #[inline]
    pub(in crate::search) fn of(a: &Term, b: &Term) -> Self {
        let apart = b.cloud - a.cloud;
        let measured = apart.norm();
        Self {
            length_error: measured - (b.model - a.model).norm(),
            along: apart / measured,
            variance: (1.0 + CURVED) * (a.variance + b.variance),
        }
    }
}

/// ½ χ² of the distance of two pairs: a lower bound of their residual cost under any pose (nats).
#[inline]
pub(in crate::search) fn residual_of_two(a: &Term, b: &Term) -> f64 {
    let side = Side::of(a, b);
    0.5 * side.length_error * side.length_error / side.variance
}

/// ½ χ² of the three distances of three pairs: dᵀ (J Σ Jᵀ)⁻¹ d / 2, J the derivative of the distances by the places.
///
/// A lower bound of their residual cost under any pose (nats), for errors that are small relative to the distances.
#[inline]
pub(in crate::search) fn residual_of_three([a, b, c]: [&Term; 3], [ab, ac, bc]: [&Side; 3]) -> f64 {
    let (aa, bb, cc) = (ab.variance, ac.variance, bc.variance);
    let of_a = a.variance * ab.along.dot(&ac.along);
    let of_b = -b.variance * ab.along.dot(&bc.along);
    let of_c = c.variance * ac.along.dot(&bc.along);
    let (p, q, r) = (bb * cc - of_c * of_c, of_b * of_c - of_a * cc, of_a * of_c - of_b * bb);
    let determinant = aa * p + of_a * q + of_b * r;
    let (x, y, z) = (ab.length_error, ac.length_error, bc.length_error);
    let square = x * x * p
        + y * y * (aa * cc - of_b * of_b)
        + z * z * (aa * bb - of_a * of_a)
        + 2.0 * (x * y * q + x * z * r + y * z * (of_a * of_b - aa * of_c));
    let distance_residual = 0.5 * square / determinant;
    // Coincident places have no direction: no information.
    if distance_residual.is_finite() { distance_residual.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::{
        observations::Observations,
        problem::Correspondence,
        site::model::ModelPoint,
        solve::{kabsch::Kabsch, solver::Solver},
    };

    const SIGMA: f64 = 0.01;

    /// ½ χ² of the best pose of these measured places with equal isotropic noise.
    fn min_residual(model: &[Vector3<f64>; 3], cloud: &[Vector3<f64>; 3]) -> f64 {
        let points = model.map(|at| ModelPoint::exact("", at.into()));
        let measured =
            cloud.map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), SIGMA), pixels: None });
        let pairs = [0, 1, 2].map(|i| Correspondence { model: i, cloud: i });
        let pose = Kabsch::default().solve(&Observations::of(&pairs, &points, &measured, None)).expect("three points");
        let residual = |i: usize| (pose * measured[i].position.at).distance(&points[i].at);
        (0..3).map(|i| residual(i).powi(2)).sum::<f64>() / (2.0 * SIGMA * SIGMA)
    }

    /// Fails with the opposite sign of the second point's part, and with the variance of one point only.
    #[test]
    fn the_residual_of_three_is_the_smallest_residual_but_for_what_is_curved() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut sampled = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let mut compared = 0;
        for _ in 0..2000 {
            let model: [Vector3<f64>; 3] = std::array::from_fn(|_| sampled(2.0));
            let (along, across) = (model[1] - model[0], model[2] - model[0]);
            let sides = [along.norm(), across.norm(), (along - across).norm()];
            let longest = sides.into_iter().fold(0.0, f64::max);
            let flat = along.cross(&across).norm() / (longest * longest);
            if sides.into_iter().any(|side| side < 0.5) || flat < 0.1 {
                continue;
            }
            let cloud = model.map(|at| at + sampled(3.0 * SIGMA));
            let term = |i: usize| Term {
                cloud: cloud[i],
                model: model[i],
                weight: Matrix3::identity() / (SIGMA * SIGMA),
                variance: SIGMA * SIGMA,
                gain: 0.0,
            };
            let [a, b, c] = [0, 1, 2].map(term);
            let [ab, ac, bc] = [Side::of(&a, &b), Side::of(&a, &c), Side::of(&b, &c)];
            let distance_residual = residual_of_three([&a, &b, &c], [&ab, &ac, &bc]);
            let min = min_residual(&model, &cloud);
            // In a flat triangle the distances are correlated, and the allowance for curvature costs more of χ².
            let fraction = if flat < 0.5 { 0.0 } else { 0.8 };
            assert!(
                distance_residual <= min + 0.02 && distance_residual >= fraction * min - 0.1,
                "{distance_residual} of {min}, altitude {flat}"
            );
            let of_side = |side: Side| 0.5 * side.length_error * side.length_error / side.variance;
            assert!(
                [ab, ac, bc].into_iter().all(|side| of_side(side) <= distance_residual + 1e-9),
                "a single side has a larger residual"
            );
            compared += 1;
        }
        assert!(compared > 1000, "{compared}");
    }

    #[test]
    fn places_that_coincide_or_lie_on_a_line_cost_a_number() {
        let term = |x: f64, known: f64| Term {
            cloud: Vector3::new(x, 0.0, 0.0),
            model: Vector3::new(known, 0.0, 0.0),
            weight: Matrix3::identity(),
            variance: 1.0,
            gain: 0.0,
        };
        let distance_residual = |places: [(f64, f64); 3]| {
            let [a, b, c] = places.map(|(x, known)| term(x, known));
            residual_of_three([&a, &b, &c], [&Side::of(&a, &b), &Side::of(&a, &c), &Side::of(&b, &c)])
        };
        assert_eq!(distance_residual([(0.0, 0.0), (0.0, 1.0), (2.0, 3.0)]), 0.0);
        // The end point is one σ too far: a third of χ² remains, the rest is shared.
        let along = distance_residual([(0.0, 0.0), (1.0, 1.0), (4.0, 3.0)]);
        assert!((0.0..1.0 / 3.0).contains(&along) && along > 0.1, "{along}");
    }
}
