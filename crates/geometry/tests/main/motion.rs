//! Tests of transforms, covariances and frames by hand.

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector6};
use seafix_geometry::{
    Body, Camera, Covariance6, NotRigid, Object, Point, Transform, UncertainPoint, World,
    row_vector::{self, BodyAtFix, BodyAtStart, H},
    so3, triad,
};

/// A rotation by 90° about z, then a translation by (1, 2, 3).
fn quarter<A: seafix_geometry::Frame, B: seafix_geometry::Frame>() -> Transform<A, B> {
    Transform::from_rows(&[[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
        .unwrap()
}

#[test]
fn rows_are_those_of_the_file() {
    let t = quarter::<Object, Camera>();
    let rows = t.rows();
    let wanted = [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]];
    assert!(rows.as_flattened().iter().zip(wanted.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-15), "{rows:?}");
    assert!((t * Point::new(1.0, 0.0, 0.0)).distance(&Point::new(1.0, 3.0, 3.0)) < 1e-15);
    assert!((t.inverse().translation() - Vector3::new(-2.0, 1.0, -3.0)).norm() < 1e-15);
    assert_eq!((Transform::<Object, Object>::identity() * t), t);
    assert_eq!(t.relabel::<World, Body>().rows(), rows);
    assert!(t.is_finite() && !Transform::<Object, Camera>::new(t.rotation(), Vector3::x() * f64::NAN).is_finite());
    assert!((t.renormalized().rotation().norm() - 1.0).abs() < 1e-16);
}

#[test]
fn a_matrix_is_taken_to_its_tolerance_and_no_farther() {
    let with = |row: usize, column: usize, off: f64| {
        let mut m = Matrix4::identity();
        m[(row, column)] += off;
        Transform::<Object, Camera>::from_matrix(&m)
    };
    // A stretch by ε deviates from orthonormality by 2ε.
    assert!(with(0, 0, 0.49e-6).is_ok());
    assert!(matches!(with(0, 0, 0.51e-6), Err(NotRigid::NotOrthonormal(off)) if (off - 1.02e-6).abs() < 1e-10));
    // A shear by ε deviates by ε.
    assert!(with(0, 1, 0.99e-6).is_ok());
    assert!(matches!(with(0, 1, 1.01e-6), Err(NotRigid::NotOrthonormal(_))));
    assert!(matches!(with(0, 1, -1.01e-6), Err(NotRigid::NotOrthonormal(_))));
    for column in 0..4 {
        assert!(with(3, column, 0.99e-9).is_ok() && with(3, column, -0.99e-9).is_ok());
        assert!(matches!(with(3, column, 1.01e-9), Err(NotRigid::LastRow(_))), "{column}");
        assert!(matches!(with(3, column, -1.01e-9), Err(NotRigid::LastRow(_))), "{column}");
    }
    assert!(matches!(with(2, 1, f64::INFINITY), Err(NotRigid::NotFinite { row: 2, column: 1, .. })));
    assert!(matches!(with(3, 3, f64::NAN), Err(NotRigid::NotFinite { row: 3, column: 3, .. })));
    let mirrored = Transform::<Object, Camera>::from_matrix(&Matrix4::from_diagonal(&[1.0, 1.0, -1.0, 1.0].into()));
    assert_eq!(mirrored, Err(NotRigid::Reflection(-1.0)));
    // A rotation with a deviation below the tolerance still yields a unit quaternion.
    assert!((with(0, 0, 0.4e-6).unwrap().rotation().norm() - 1.0).abs() < 1e-15);
}

#[test]
fn an_error_is_the_motion_that_is_missing() {
    let (estimate, xi) = (quarter::<Object, Camera>(), Vector6::new(0.1, -0.2, 0.3, 1.0, 2.0, -3.0));
    assert!((estimate.error_to(&estimate.perturbed(&xi)) - xi).norm() < 1e-14);
    // A rotation by π has a logarithm; its translation is V's: 2/π of it to the side.
    let half = Transform::<Object, Camera>::new(so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::PI)), Vector3::x());
    let log = half.log();
    assert!((log.fixed_rows::<3>(3) - Vector3::new(0.0, -std::f64::consts::FRAC_PI_2, 0.0)).norm() < 1e-14, "{log}");
}

/// Independent errors of 0.1 rad and 3 m for each axis; a point at (0, 0, 3) moves sideways by 0.1 · 3 in addition.
#[test]
fn a_covariance_by_hand() {
    let covariance = Covariance6::<Object, Camera>::isotropic(0.1, 3.0);
    let wanted = Matrix6::from_diagonal(&Vector6::new(0.01, 0.01, 0.01, 9.0, 9.0, 9.0));
    assert!((covariance.matrix - wanted).amax() < 1e-16);
    assert!((covariance.attitude_sigma() - 0.1).abs() < 1e-15);
    assert!((covariance.position_sigma() - 3.0).abs() < 1e-15);
    assert!((covariance.attitude_rms() - 0.1 * 3f64.sqrt()).abs() < 1e-15);
    assert!((covariance.position_rms() - 3.0 * 3f64.sqrt()).abs() < 1e-15);
    let at = covariance.of_point(&Point::new(0.0, 0.0, 3.0));
    assert!((at - Matrix3::from_diagonal(&Vector3::new(9.09, 9.09, 9.0))).amax() < 1e-14);
    let point = UncertainPoint::isotropic(Point::<Camera>::origin(), 3.0);
    assert_eq!(point.covariance, Matrix3::identity() * 9.0);
    let uneven = Covariance6::<Object, Camera>::new(Matrix6::from_fn(|i, j| if (i, j) == (0, 1) { 2.0 } else { 0.0 }));
    assert_eq!((uneven.matrix[(0, 1)], uneven.matrix[(1, 0)]), (1.0, 1.0));
}

/// A rotation about z and a translation along x by the same noise a may cancel at a point.
///
/// The point at (0, d, 0) moves by a (d − 1) along x, by Exp(−ξ). With the sign of either part of J inverted it would
/// move by a (d + 1).
#[test]
fn a_turn_and_a_step_may_cancel_at_a_point() {
    let xi = Vector6::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
    let covariance = Covariance6::<Object, Camera>::new(xi * xi.transpose() * 0.01);
    assert!(covariance.of_point(&Point::new(0.0, 1.0, 0.0)).amax() < 1e-17);
    let at = covariance.of_point(&Point::new(0.0, -1.0, 0.0));
    assert!((at - Matrix3::from_diagonal(&Vector3::new(0.04, 0.0, 0.0))).amax() < 1e-16);
}

/// Seen from the other frame, a rotation about a distant origin is a translation: σ about z gives d σ along y, fully
/// correlated.
#[test]
fn a_covariance_from_the_other_side() {
    let t = Transform::<Object, Camera>::new(so3::exp(&Vector3::zeros()), Vector3::new(3.0, 0.0, 0.0));
    let mut matrix = Matrix6::zeros();
    matrix[(2, 2)] = 0.01;
    let back = Covariance6::<Object, Camera>::new(matrix).inverse(&t);
    let mut wanted = Matrix6::zeros();
    // Ad ξ = (φ, t × φ): (0, 0, 1) gives (0, −3, 0).
    (wanted[(2, 2)], wanted[(4, 4)], wanted[(2, 4)], wanted[(4, 2)]) = (0.01, 0.09, -0.03, -0.03);
    assert!((back.matrix - wanted).amax() < 1e-16, "{}", back.matrix);
}

#[test]
fn three_points_in_a_line_define_no_frame() {
    let at = |y: f64| {
        triad::<World, Object>(&Point::origin(), &Point::new(2.0, y, 0.0), &Point::new(4.0, 0.0, 0.0))
            .map_err(|e| e.sine)
    };
    assert!(at(2.2e-9).is_ok() && at(-2.2e-9).is_ok());
    let sine = at(1.8e-9).unwrap_err();
    assert!((sine - 0.9e-9).abs() < 1e-15, "{sine}");
    let p = Point::<World>::new(1.0, 1.0, 1.0);
    let found = triad::<World, Object>(&p, &p, &Point::new(4.0, 0.0, 0.0)).unwrap_err();
    assert_eq!((found.sine, found.min), (0.0, 1e-9));
}

/// P1 = (1, 1, 1), P3 along y and P2 along x from it: x = (0, 1, 0), z = (1, 0, 0) × (0, 1, 0), y = z × x = (−1, 0, 0).
#[test]
fn the_paper_s_frame_by_hand() {
    let [p1, p2, p3] = [[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [1.0, 5.0, 1.0]].map(Point::<World>::from);
    let frame = triad::<World, Object>(&p1, &p2, &p3).unwrap();
    let axes = Matrix3::from_columns(&[Vector3::y(), -Vector3::x(), Vector3::z()]);
    assert!((frame.rotation_matrix() - axes).amax() < 1e-15);
    assert_eq!(frame.translation(), Vector3::new(1.0, 1.0, 1.0));
    let h = row_vector::eq1(&p1, &p2, &p3).unwrap();
    assert!((h.matrix - frame.matrix().transpose()).amax() < 1e-15);
    assert!(h.apply(&Point::new(4.0, 0.0, 0.0)).distance(&p3) < 1e-15);
    assert!(h.inverse().apply(&p2).distance(&Point::new(0.0, -2.0, 0.0)) < 1e-15);
    assert!(row_vector::eq1(&p1, &p2, &p2).is_err());
}

/// The paper's equations equal products of column-convention transforms.
#[test]
fn the_paper_s_equations_are_chains() {
    let t = |k: f64| Vector6::new(0.1 * k, -0.2, 0.05 * k, 1.0, k, -0.5);
    let (now_from_start, world_from_start, world_from_object) = (
        Transform::<Body, BodyAtStart>::exp(&t(1.0)),
        Transform::<World, BodyAtStart>::exp(&t(2.0)),
        Transform::<World, Object>::exp(&t(3.0)),
    );
    let h = row_vector::eq2(&H::from(now_from_start), &H::from(world_from_start), &H::from(world_from_object));
    let columns = world_from_object.inverse() * world_from_start * now_from_start.inverse();
    assert!((h.transform().matrix() - columns.matrix()).amax() < 1e-14);

    let [c, p] =
        [[[0.0, 0.0, 3.0], [1.0, -1.0, 3.0], [2.0, 0.5, 3.5]], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.5, 0.5, 3.0]]];
    let (c, p) = (c.map(Point::<Body>::from), p.map(Point::<Object>::from));
    let (body, object) = (row_vector::eq3(&c).unwrap(), row_vector::eq4(&p).unwrap());
    assert!(body.inverse().apply(&c[0]).distance(&Point::origin()) < 1e-14);
    assert!(object.inverse().apply(&p[0]).distance(&Point::origin()) < 1e-14);
    let direct = row_vector::eq5(&body, &object);
    assert!(direct.apply(&c[0]).distance(&p[0]) < 1e-14, "the origins coincide");
    let along = (direct.apply(&c[2]) - p[0]).cross(&(p[2] - p[0]));
    assert!(along.norm() < 1e-13, "the x axes coincide");
    assert!(row_vector::eq3(&[c[0], c[1], c[1]]).is_err() && row_vector::eq4(&[p[0], p[1], p[1]]).is_err());

    let (now_from_fix, object_from_fix) =
        (Transform::<Body, BodyAtFix>::exp(&t(1.5)), Transform::<Object, BodyAtFix>::exp(&t(0.5)));
    let carried = row_vector::eq6(&H::from(now_from_fix), &H::from(object_from_fix));
    let columns = object_from_fix * now_from_fix.inverse();
    assert!((carried.transform().matrix() - columns.matrix()).amax() < 1e-14);
    assert!(
        ((H::from(now_from_start) * H::<Body, Body>::from(Transform::identity())).matrix
            - now_from_start.matrix().transpose())
        .amax()
            < 1e-15
    );
}

#[test]
fn points_have_differences_and_names() {
    let (a, b) = (Point::<Camera>::new(1.0, 2.0, 3.0), Point::new(0.0, 4.0, 1.0));
    assert_eq!(a - b, Vector3::new(1.0, -2.0, 2.0));
    assert_eq!(a.distance(&b), 3.0);
    assert_eq!(b + Vector3::new(1.0, -2.0, 2.0), a);
    assert_eq!(format!("{a:?}"), "Camera(1, 2, 3)");
    assert!(a.is_finite() && !Point::<Camera>::new(0.0, f64::NAN, 0.0).is_finite());
    let t = Transform::<Object, Camera>::new(so3::exp(&Vector3::zeros()), a.coords);
    assert_eq!(format!("{t:?}"), "Object_from_Camera { t: [1, 2, 3], q_xyzw: [0, 0, 0, 1] }");
}
