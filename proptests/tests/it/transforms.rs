//! Rigid motions: composition, inversion, and representations of rotations.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector6};
use proptest::prelude::*;
use seafix_geometry::{Body, Camera, Object, Site, Transform, World, row_vector::H, so3};
use seafix_proptests::{
    law,
    points::point,
    poses::{pose, rotation, turn, vector},
    within,
};

/// Maximum coordinate (m).
const REACH: f64 = 100.0;

fn off_identity(m: &Matrix4<f64>) -> f64 {
    (m - Matrix4::identity()).amax()
}

fn off_orthonormal(r: &Matrix3<f64>) -> f64 {
    (r.transpose() * r - Matrix3::identity()).amax().max((r.determinant() - 1.0).abs())
}

/// P1. `H_ab H_bc H_ca` = I: max |entry − I| ≤ 1e-12 (1 + L), L the largest translation (m), in row vectors and in
/// columns.
///
/// Seen to fail when row products multiply in the other order.
#[test]
fn going_round_leads_home() {
    law(512, (pose::<World, Body>(REACH), pose::<World, Camera>(REACH), pose::<World, Object>(REACH)), |(a, b, c)| {
        let (b_from_a, c_from_b, a_from_c) = (b.inverse() * a, c.inverse() * b, a.inverse() * c);
        let longest =
            b_from_a.translation().norm().max(c_from_b.translation().norm()).max(a_from_c.translation().norm());
        let limit = 1e-12 * (1.0 + longest);
        let round = H::from(b_from_a) * H::from(c_from_b) * H::from(a_from_c);
        within("rows", off_identity(&round.matrix), limit)?;
        within("columns", off_identity(&(a_from_c * c_from_b * b_from_a).matrix()), limit)
    });
}

/// P2. H H⁻¹ = I and (H⁻¹)⁻¹ = H: ≤ 1e-12 (1 + L), in rows and in columns.
///
/// Seen to fail when the inverse keeps the sign of the translation.
#[test]
fn an_inverse_undoes() {
    law(512, pose::<Object, Camera>(REACH), |t| {
        let limit = 1e-12 * (1.0 + t.translation().norm());
        let h = H::from(t);
        within("H H⁻¹", off_identity(&(h * h.inverse()).matrix), limit)?;
        within("H⁻¹ H", off_identity(&(h.inverse() * h).matrix), limit)?;
        within("(H⁻¹)⁻¹", (h.inverse().inverse().matrix - h.matrix).amax(), limit)?;
        within("T T⁻¹", off_identity(&(t * t.inverse()).matrix()), limit)?;
        within("(T⁻¹)⁻¹", (t.inverse().inverse().matrix() - t.matrix()).amax(), limit)
    });
}

/// P3. The rotation of every constructor of a motion: |RᵀR − I| ≤ 1e-13 and |det R − 1| ≤ 1e-13.
///
/// Seen to fail when the quaternion of an input matrix is not normalised.
#[test]
fn rotations_stay_rotations() {
    let perturbed = prop::array::uniform9(-1e-9..=1e-9f64);
    law(512, (pose::<Object, Camera>(REACH), pose::<Camera, Body>(REACH), vector(3.0), perturbed), |(a, b, phi, e)| {
        let mut moved = a.matrix();
        let noise = Matrix3::from_row_slice(&e);
        moved.fixed_view_mut::<3, 3>(0, 0).copy_from(&(a.rotation_matrix() + noise));
        let taken_in = Transform::<Object, Camera>::from_matrix(&moved);
        let xi = Vector6::new(phi.x, phi.y, phi.z, 1.0, 2.0, 3.0);
        for (what, r) in [
            ("product", (a * b).rotation_matrix()),
            ("inverse", a.inverse().rotation_matrix()),
            ("exp", Transform::<Object, Camera>::exp(&xi).rotation_matrix()),
            ("from a matrix", taken_in.expect("noise of 1e-9 is accepted").rotation_matrix()),
            ("rows", (H::from(b) * H::from(a)).transform().rotation_matrix()),
        ] {
            within(what, off_orthonormal(&r), 1e-13)?;
        }
        Ok(())
    });
}

/// P3. The same after 1 000 000 compositions with re-normalisation: ≤ 1e-12.
///
/// Seen to fail when re-normalisation does nothing.
#[test]
fn a_million_compositions_stay_a_rotation() {
    law(2, prop::collection::vec(rotation(), 16), |steps| {
        let steps: Vec<_> =
            steps.into_iter().map(|r| Transform::<Body, Body>::new(r, [0.1, 0.0, 0.0].into())).collect();
        let mut chain = Transform::<Body, Body>::identity();
        for i in 0..1_000_000 {
            chain = (chain * steps[i % steps.len()]).renormalized();
        }
        within("after a million", off_orthonormal(&chain.rotation_matrix()), 1e-12)
    });
}

/// P4. The row form p H equals the column form Hᵀ p: ≤ 1e-12.
///
/// Seen to fail when H is the column matrix itself, not its transpose.
#[test]
fn rows_and_columns_agree() {
    law(512, (pose::<Object, Camera>(REACH), point::<Camera>(REACH)), |(object_from_camera, p)| {
        let rows = H::<Camera, Object>::from(object_from_camera);
        within("p H − T p", (rows.apply(&p) - object_from_camera * p).amax(), 1e-12)?;
        let column = rows.matrix.transpose() * p.coords.push(1.0);
        within("p H − Hᵀ p", (rows.apply(&p).coords - column.xyz()).amax(), 1e-12)?;
        within("inverse conversion", (rows.transform().matrix() - object_from_camera.matrix()).amax(), 1e-12)
    });
}

/// P5. Quaternion → matrix → quaternion and matrix → quaternion → matrix: ≤ 1e-14; q and −q give the
/// same matrix bit for bit.
///
/// Seen to fail when the input matrix is transposed.
#[test]
fn quaternions_and_matrices_agree() {
    law(1024, rotation(), |q| {
        let motion = Transform::<Object, Camera>::new(q, [0.0; 3].into());
        let back = Transform::<Object, Camera>::from_matrix(&motion.matrix()).expect("a rotation is rigid");
        let difference = |sign: f64| (back.rotation().coords - q.coords * sign).amax();
        within("quaternion", difference(1.0).min(difference(-1.0)), 1e-14)?;
        within("matrix", (back.matrix() - motion.matrix()).amax(), 1e-14)?;
        let negative =
            Transform::<Object, Camera>::new(UnitQuaternion::new_unchecked(-q.into_inner()), [0.0; 3].into());
        prop_assert_eq!(negative.rotation_matrix(), motion.rotation_matrix());
        Ok(())
    });
}

/// P6. exp(log(R)) = R for angles in \[0, π\]: ≤ 1e-12, and ≤ 1e-7 within 1e-6 of π.
///
/// Seen to fail when the logarithm of −q is used directly: its length exceeds π.
#[test]
fn exp_undoes_log() {
    let angles = prop_oneof![
        8 => 0.0..=PI,
        1 => Just(0.0),
        1 => Just(PI),
        1 => PI - 1e-6..=PI,
        1 => 0.0..=1e-6,
        1 => 0.5e-4..=2e-4,
    ];
    law(1024, (turn(angles), any::<bool>()), |(r, negated)| {
        let r = if negated { UnitQuaternion::new_unchecked(-r.into_inner()) } else { r };
        let phi = so3::log(&r);
        let back = so3::exp(&phi).to_rotation_matrix().into_inner();
        let limit = if so3::angle(&r) > PI - 1e-6 { 1e-7 } else { 1e-12 };
        within("exp(log(R)) − R", (back - r.to_rotation_matrix().into_inner()).amax(), limit)?;
        within("|log(R)|", phi.norm(), PI * (1.0 + f64::EPSILON))
    });
}

/// P6 for motions: Exp(Log(T)) = T with rotation ≤ 1e-12 (1e-7 within 1e-6 of π) and translation ≤ the same times (1 +
/// L).
///
/// Seen to fail when the translation of Exp is not multiplied by the left Jacobian.
#[test]
fn exp_undoes_log_of_motions() {
    law(512, pose::<Object, Camera>(REACH), |t| {
        let back = Transform::<Object, Camera>::exp(&t.log());
        let limit = if so3::angle(&t.rotation()) > PI - 1e-6 { 1e-7 } else { 1e-12 };
        within("rotation", (back.rotation_matrix() - t.rotation_matrix()).amax(), limit)?;
        let length = t.translation().norm();
        within("translation", (back.translation() - t.translation()).norm(), limit * (1.0 + length))
    });
}

/// P6. angle(R) ≥ 0, ≤ π, no NaN, also when the trace leaves \[−1, 3\] by rounding.
///
/// Seen to fail when the angle is the arc cosine of the trace.
#[test]
fn an_angle_is_an_angle() {
    let angles = prop_oneof![Just(0.0), Just(PI), 0.0..1e-7, PI - 1e-7..=PI, 0.0..=PI];
    let rounding = prop::array::uniform9(-1e-7..=1e-7f64);
    law(1024, (turn(angles.clone()), rounding, prop_oneof![Just(0.0), Just(1.0), Just(1e-8)]), |(r, e, scale)| {
        let mut moved = Matrix4::identity();
        let matrix = r.to_rotation_matrix().into_inner() + Matrix3::from_row_slice(&e) * scale;
        moved.fixed_view_mut::<3, 3>(0, 0).copy_from(&matrix);
        let taken_in = Transform::<Site, Site>::from_matrix(&moved).expect("rounding of 1e-7 is accepted").rotation();
        for q in [r, taken_in, r * r.inverse(), r * r] {
            let angle = so3::angle(&q);
            prop_assert!((0.0..=PI).contains(&angle), "{angle}");
            prop_assert!(so3::log(&q).iter().all(|x| x.is_finite()));
        }
        within("angle by R", (so3::angle(&taken_in) - so3::angle(&r)).abs(), 1e-6)
    });
}
