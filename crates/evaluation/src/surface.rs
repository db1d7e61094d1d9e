//! Errors of object poses as benchmarks define them: ADD, ADI, MSSD and MSPD.
//!
//! They are distances of surface points under the error transform E of [`transfer_rms`](crate::transfer_rms). A
//! symmetric object has several correct poses.

use seafix_geometry::{Camera, Object, Pinhole, Point, Transform};

/// ADD: the mean of ‖E·p − p‖ over the points (m); `None` without points.
///
/// Source: Hinterstoisser et al., *Model based training, detection and pose estimation of texture-less 3D objects in
/// heavily cluttered scenes*, ACCV 2012.
pub fn mean_distance(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    points: &[Point<Object>],
) -> Option<f64> {
    let e = *estimate * truth.inverse();
    mean(points.iter().map(|p| (e * *p).distance(p)))
}

/// ADI: the mean of min_q ‖E·p − q‖ over the points (m), for symmetric objects; `None` without points.
///
/// Source: Hinterstoisser et al., 2012.
pub fn mean_nearest_distance(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    points: &[Point<Object>],
) -> Option<f64> {
    let e = *estimate * truth.inverse();
    let nearest = |p: &Point<Object>| {
        let at = e * *p;
        points.iter().map(|q| at.distance(q)).fold(f64::INFINITY, f64::min)
    };
    mean(points.iter().map(nearest))
}

/// MSSD: the minimum over the symmetries S of the maximum ‖E·S·p − p‖ over the points (m); `None` without points.
///
/// `symmetries` holds the object's symmetries without the identity.
///
/// Source: Hodaň et al., *BOP challenge 2020 on 6D object localization*, ECCV workshops 2020.
pub fn symmetric_distance(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    points: &[Point<Object>],
    symmetries: &[Transform<Object, Object>],
) -> Option<f64> {
    let e = *estimate * truth.inverse();
    let greatest =
        |moved: Transform<Object, Object>| points.iter().map(|p| (moved * *p).distance(p)).fold(0.0, f64::max);
    let plain = (!points.is_empty()).then(|| greatest(e))?;
    Some(symmetries.iter().map(|symmetry| greatest(e * *symmetry)).fold(plain, f64::min))
}

/// MSPD: the minimum over the symmetries S of the maximum ‖π(P̂·p) − π(P·S·p)‖ over the points (px), P camera_from_object
/// and π the projection into the image of `camera`.
///
/// `symmetries` holds the object's symmetries without the identity. `None` without points, or if every symmetry puts a
/// point where the camera has no image of it.
///
/// Source: Hodaň et al., 2020.
pub fn symmetric_projection_distance(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    points: &[Point<Object>],
    symmetries: &[Transform<Object, Object>],
    camera: &Pinhole,
) -> Option<f64> {
    let (estimated, true_pose) = (estimate.inverse(), truth.inverse());
    let greatest = |symmetry: &Transform<Object, Object>| {
        let shown = |p: &Point<Object>| {
            let (a, b) = (estimated * *p, true_pose * (*symmetry * *p));
            Some(camera.project(&a)?.distance(&camera.project(&b)?))
        };
        points.iter().map(shown).collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::max)
    };
    let identity = Transform::identity();
    std::iter::once(&identity).chain(symmetries).filter_map(greatest).reduce(f64::min)
}

fn mean(distances: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = distances.fold((0_usize, 0.0), |(n, sum), d| (n + 1, sum + d));
    (n > 0).then(|| sum / n as f64)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use seafix_geometry::so3;

    use super::*;

    #[test]
    fn a_square_turned_by_a_quarter_is_wrong_only_where_that_is_no_symmetry() {
        let points = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]| Point::new(x, y, 0.0));
        let truth = Transform::<Object, Camera>::identity();
        let quarter = Transform::<Object, Object>::new(
            so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2)),
            Vector3::zeros(),
        );
        let estimate = quarter * truth;
        // Each corner is one side (2 m) away from its own position and at that of another corner.
        assert!((mean_distance(&estimate, &truth, &points).unwrap() - 2.0).abs() < 1e-12);
        assert!(mean_nearest_distance(&estimate, &truth, &points).unwrap() < 1e-12);
        assert!((symmetric_distance(&estimate, &truth, &points, &[]).unwrap() - 2.0).abs() < 1e-12);
        assert!(symmetric_distance(&estimate, &truth, &points, &[quarter.inverse()]).unwrap() < 1e-12);
        assert_eq!(symmetric_distance(&estimate, &truth, &[], &[quarter]), None);
        assert_eq!(mean_distance(&estimate, &truth, &[]), None);
        assert_eq!(mean_nearest_distance(&estimate, &truth, &[]), None);
    }

    /// A square of 2 m, seen from 4 m with f = 800 px, estimated after a quarter turn about its normal and a shift of 3 mm.
    #[test]
    fn a_shift_of_a_symmetric_square_is_its_projection() {
        let points = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]| Point::new(x, y, 0.0));
        let turn = so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let quarter = Transform::<Object, Object>::new(turn, Vector3::zeros());
        let truth = Transform::<Object, Camera>::new(so3::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, -4.0));
        let shift = Transform::<Object, Object>::new(so3::exp(&Vector3::zeros()), Vector3::new(0.003, 0.0, 0.0));
        let estimate = quarter * shift * truth;
        let camera = Pinhole::new([1000, 1000], [800.0, 800.0], [500.0, 500.0], &[]).unwrap();
        let distance = |symmetries: &[Transform<Object, Object>]| {
            symmetric_projection_distance(&estimate, &truth, &points, symmetries, &camera).unwrap()
        };
        assert!((distance(&[quarter.inverse()]) - 800.0 * 0.003 / 4.0).abs() < 1e-9);
        assert!(distance(&[]) > 300.0);
    }
}
