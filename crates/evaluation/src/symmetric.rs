//! Pose errors that symmetric objects do not inflate: MSSD and MSPD of the BOP benchmark.
//!
//! Source: Hodaň, Sundermeyer, Drost, Labbé, Brachmann, Michel, Rother and Matas, *BOP challenge 2020 on 6D object
//! localization*, 2020.

use seafix_geometry::{Camera, Object, Pinhole, Point, Transform};

/// The maximum symmetry-aware surface distance (m): min over symmetries S of max over points x of ‖P̂x − P·S·x‖.
///
/// P is camera_from_object. The identity is always among the symmetries. `None` without points.
pub fn mssd(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    model: &[Point<Object>],
    symmetries: &[Transform<Object, Object>],
) -> Option<f64> {
    min_of_max(estimate, truth, model, symmetries, |a, b| Some(a.distance(b)))
}

/// The maximum symmetry-aware projection distance (px) in the image of `camera`: min over symmetries S of max over points
/// x of ‖π(P̂x) − π(P·S·x)‖.
///
/// `None` without points, or if a point has no projection under every symmetry.
pub fn mspd(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    model: &[Point<Object>],
    symmetries: &[Transform<Object, Object>],
    camera: &Pinhole,
) -> Option<f64> {
    min_of_max(estimate, truth, model, symmetries, |a, b| Some(camera.project(a)?.distance(&camera.project(b)?)))
}

fn min_of_max(
    estimate: &Transform<Object, Camera>,
    truth: &Transform<Object, Camera>,
    model: &[Point<Object>],
    symmetries: &[Transform<Object, Object>],
    distance: impl Fn(&Point<Camera>, &Point<Camera>) -> Option<f64>,
) -> Option<f64> {
    let (estimated, true_pose) = (estimate.inverse(), truth.inverse());
    let max_under = |symmetry: &Transform<Object, Object>| {
        let errors = model.iter().map(|x| distance(&(estimated * *x), &(true_pose * (*symmetry * *x))));
        errors.collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::max)
    };
    let identity = Transform::identity();
    std::iter::once(&identity).chain(symmetries).filter_map(max_under).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    /// A square of 2 m, seen from 4 m, estimated after a quarter turn about its normal and a shift of 3 mm.
    #[test]
    fn a_quarter_turn_of_a_square_is_no_error() {
        let square: Vec<Point<Object>> =
            [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]| Point::new(x, y, 0.0)).to_vec();
        let quarter = Transform::<Object, Object>::new(
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2),
            Vector3::zeros(),
        );
        let truth = Transform::<Object, Camera>::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -4.0));
        let shift = Transform::<Object, Object>::new(UnitQuaternion::identity(), Vector3::new(0.003, 0.0, 0.0));
        let estimate = quarter * shift * truth;
        assert!((mssd(&estimate, &truth, &square, &[]).unwrap() - 2.0).abs() < 0.01);
        // P̂ = P·S⁻¹ up to the shift: the inverse turn is the symmetry.
        let symmetries = [quarter.inverse()];
        assert!((mssd(&estimate, &truth, &square, &symmetries).unwrap() - 0.003).abs() < 1e-12);
        let camera = Pinhole::new([1000, 1000], [800.0, 800.0], [500.0, 500.0], &[]).unwrap();
        let shown = mspd(&estimate, &truth, &square, &symmetries, &camera).unwrap();
        assert!((shown - 800.0 * 0.003 / 4.0).abs() < 1e-9, "{shown}");
        assert_eq!(mssd(&estimate, &truth, &[], &symmetries), None);
    }
}
