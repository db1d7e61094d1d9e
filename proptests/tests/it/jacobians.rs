//! P46. All analytic derivatives of the geometry against central differences at random arguments.

use std::cell::Cell;

use nalgebra::{Matrix3, Matrix3x6, Matrix4x3, Vector3, Vector6};
use proptest::prelude::*;
use seafix_component::Choice;
use seafix_geometry::{Camera, Covariance6, Frame, Object, Pinhole, Point, Transform, so3};
use seafix_proptests::{
    law,
    poses::{pose, vector},
    rigs::{general, rectified},
    scenes::seen,
    within,
};
use seafix_referencing::SOLVERS;

/// The step of the differences (m, rad).
const STEP: f64 = 1e-5;

/// Points up to 20 m before a camera, up to 45° off its axis.
fn before() -> impl Strategy<Value = Point<Camera>> {
    (0.5..20.0, -0.5..0.5, -0.4..0.4).prop_map(|(z, x, y)| Point::new(x * z, y * z, z))
}

/// ∂pixel/∂p of one camera and of a rig, with every kind of lens: ≤ 1e-6 of the largest.
///
/// Seen to fail when the lens's tangential terms are omitted from the derivative.
#[test]
fn projections() {
    law(512, (prop_oneof![rectified().boxed(), general().boxed()], before()), |(rig, at)| {
        let Some((_, j)) = rig.project_with_jacobian(&at) else { return Ok(()) };
        let mut expected = Matrix4x3::zeros();
        for i in 0..3 {
            let by = |size: f64| rig.project(&(at + Vector3::ith(i, size))).map(|seen| seen.coordinates());
            let (Some(plus), Some(minus)) = (by(STEP), by(-STEP)) else { return Ok(()) };
            expected.set_column(i, &((plus - minus) / (2.0 * STEP)));
        }
        within("rig", (j - expected).amax(), 1e-6 * expected.amax())?;
        one_camera(rig.left(), &at)?;
        one_camera(rig.right(), &(*rig.right_from_left() * at))
    });
}

fn one_camera<F: Frame>(camera: &Pinhole, at: &Point<F>) -> Result<(), TestCaseError> {
    let Some((_, j)) = camera.project_with_jacobian(at) else { return Ok(()) };
    for i in 0..3 {
        let by = |size: f64| camera.project(&(*at + Vector3::ith(i, size)));
        let (Some(plus), Some(minus)) = (by(STEP), by(-STEP)) else { return Ok(()) };
        let expected = [plus.u - minus.u, plus.v - minus.v].map(|difference| difference / (2.0 * STEP));
        within("u", (j[(0, i)] - expected[0]).abs(), 1e-6 * j.amax())?;
        within("v", (j[(1, i)] - expected[1]).abs(), 1e-6 * j.amax())?;
    }
    Ok(())
}

/// The left Jacobian V(φ) of rotations, Exp(φ + δ) ≈ Exp(V δ) Exp(φ): ≤ 1e-8 for angles up to π.
///
/// Seen to fail when the two series are exchanged.
#[test]
fn rotations() {
    law(512, vector(1.8), |phi| {
        prop_assume!(phi.norm() < 3.1);
        let mut expected = Matrix3::zeros();
        for i in 0..3 {
            let by = |size: f64| so3::log(&(so3::exp(&(phi + Vector3::ith(i, size))) * so3::exp(&phi).inverse()));
            expected.set_column(i, &((by(STEP) - by(-STEP)) / (2.0 * STEP)));
        }
        within("V", (so3::left_jacobian(&phi) - expected).amax(), 1e-8)
    });
}

/// The covariance of a point by that of a pose, J Σ Jᵀ with J = ∂(T⁻¹ P)/∂ξ under T · Exp(ξ): ≤ 1e-8 of the largest, at
/// any pose. The solvers' normal equations use the same J.
///
/// Seen to fail when the lever has the other sign.
#[test]
fn points_under_a_pose() {
    let root = prop::collection::vec(-1.0..1.0_f64, 36);
    law(512, (pose::<Object, Camera>(5.0), vector(5.0), root), |(at, point, root)| {
        let root = nalgebra::Matrix6::from_row_slice(&root);
        let covariance = Covariance6::<Object, Camera>::new(root * root.transpose());
        let place = |xi: Vector6<f64>| at.perturbed(&xi).inverse() * Point::<Object>::from(point);
        let mut j = Matrix3x6::zeros();
        for i in 0..6 {
            let by = |size: f64| place(Vector6::ith(i, size)).coords;
            j.set_column(i, &((by(STEP) - by(-STEP)) / (2.0 * STEP)));
        }
        let expected = j * covariance.matrix * j.transpose();
        let message = covariance.of_point(&(at.inverse() * Point::<Object>::from(point)));
        within("J Σ Jᵀ", (message - expected).amax(), 1e-8 * expected.amax())
    });
}

/// Ad(T), the derivative of a perturbation in another frame: ≤ 1e-8 of the largest.
///
/// Seen to fail when the translation's block is on the other side.
#[test]
fn perturbations_across_a_motion() {
    law(512, pose::<Object, Camera>(5.0), |at: Transform<Object, Camera>| {
        let ad = at.adjoint();
        for i in 0..6 {
            let by = |size: f64| (at.perturbed(&Vector6::ith(i, size)) * at.inverse()).log();
            let expected: Vector6<f64> = (by(STEP) - by(-STEP)) / (2.0 * STEP);
            within("Ad", (ad.column(i) - expected).amax(), 1e-8 * ad.amax())?;
        }
        Ok(())
    });
}

/// The sensitivity of a pose to errors of the model, as each solver states it, against the pose of a shifted model: ≤
/// 1e-3 of the largest, for points in view of a rig without noise.
///
/// Seen to fail when the lever of the closed form has the other sign.
#[test]
fn errors_of_the_model() {
    let scenes = Cell::new(0);
    law(16, seen(0.0), |scene| {
        scenes.set(scenes.get() + 1);
        for name in SOLVERS.names() {
            let solver = SOLVERS.build(&Choice::named(name)).unwrap();
            // General-purpose optimisers are slow; only some of the derivatives are tested for them.
            if !solver.to_rounding() && scenes.get() > 2 {
                continue;
            }
            let data = scene.observations();
            let Ok(pose) = solver.solve(&data) else { continue };
            let Ok(errors) = solver.model_errors(&data, &pose) else { continue };
            prop_assert_eq!(errors.len(), data.points.len());
            // A general-purpose optimiser has its own noise in every pose.
            if !solver.to_rounding() {
                continue;
            }
            let largest = errors.iter().map(|h| h.amax()).fold(0.0, f64::max);
            for (k, h) in errors.iter().enumerate() {
                for axis in 0..3 {
                    let by = |fraction: f64| {
                        let mut moved = data.clone();
                        moved.points[k].model.coords[axis] += fraction * data.points[k].model_sigma;
                        solver.solve(&moved).map(|moved| pose.error_to(&moved))
                    };
                    let (Ok(plus), Ok(minus)) = (by(0.02), by(-0.02)) else { continue };
                    within(name, (h.column(axis) - (plus - minus) / 0.04).amax(), 1e-3 * largest)?;
                }
            }
        }
        Ok(())
    });
}
