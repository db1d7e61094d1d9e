//! The Cramér–Rao bound of a pose estimate.

use nalgebra::{Matrix4, Matrix4x3, Matrix4x6, Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, Point, StereoRig, Transform};

/// A model point with the covariances of its pixels and of its model coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Its true position.
    pub at: Point<Object>,
    /// Standard deviation of each of its coordinates in the model (m).
    pub model_sigma: f64,
    /// Covariance of (u left, v left, u right, v right) (px²).
    pub pixels: Matrix4<f64>,
}

/// The Cramér–Rao bound: the minimum covariance of an unbiased estimate of the pose from these points.
///
/// It is the inverse of the Fisher information Σ Jᵀ S⁻¹ J, with J the derivative of a point's four pixel coordinates by
/// ξ and S the covariance of pixel noise and projected model error. `None` if a point is not visible or the points
/// determine no pose.
///
/// Derivatives are central differences of the projection, so that the bound shares no code with an estimator.
pub fn cramer_rao(
    rig: &StereoRig,
    object_from_camera: &Transform<Object, Camera>,
    points: &[Seen],
) -> Option<Covariance6<Object, Camera>> {
    const STEP: f64 = 1e-5;
    let project = |pose: &Transform<Object, Camera>, point: &Point<Object>| {
        Some(rig.project(&(pose.inverse() * *point))?.coordinates())
    };
    if points.len() < 3 {
        return None; // the rotation about their line is undetermined
    }
    let mut information = Matrix6::zeros();
    for point in points {
        let mut by_pose = Matrix4x6::zeros();
        for i in 0..6 {
            let xi = Vector6::ith(i, STEP);
            let plus = project(&object_from_camera.perturbed(&xi), &point.at)?;
            let minus = project(&object_from_camera.perturbed(&-xi), &point.at)?;
            by_pose.set_column(i, &((plus - minus) / (2.0 * STEP)));
        }
        let mut by_model = Matrix4x3::zeros();
        for i in 0..3 {
            let step = Vector3::ith(i, STEP);
            let plus = project(object_from_camera, &(point.at + step))?;
            let minus = project(object_from_camera, &(point.at + -step))?;
            by_model.set_column(i, &((plus - minus) / (2.0 * STEP)));
        }
        let noise = point.pixels + by_model * by_model.transpose() * (point.model_sigma * point.model_sigma);
        information += by_pose.transpose() * noise.try_inverse()? * by_pose;
    }
    Some(Covariance6::new(information.cholesky()?.inverse()))
}

/// The bound of the target registration error (m): RMS over `model` of a transferred point's standard deviation.
pub fn transfer_bound(
    bound: &Covariance6<Object, Camera>,
    object_from_camera: &Transform<Object, Camera>,
    model: &[Point<Object>],
) -> f64 {
    let camera_from_object = object_from_camera.inverse();
    let sum: f64 = model.iter().map(|point| bound.of_point(&(camera_from_object * *point)).trace()).sum();
    (sum / model.len() as f64).sqrt()
}

/// The relative nonlinearity of the projection within the bound.
///
/// It is the RMS of the nonlinear remainder π(T Exp(ξ)) − π(T) − J ξ of the pixels π, divided by the RMS of J ξ, both
/// whitened, over twelve ξ: √6 times each column of the bound's Cholesky factor, with both signs. A small value (0.1) means that the bound's Gaussian
/// describes the poses nearby; it does not exclude a distant local minimum. `None` if one of these poses does not see a
/// point.
///
/// Source: Bates and Watts, *Relative curvature measures of nonlinearity*, 1980.
pub fn nonlinearity(
    rig: &StereoRig,
    object_from_camera: &Transform<Object, Camera>,
    points: &[Seen],
    bound: &Covariance6<Object, Camera>,
) -> Option<f64> {
    const SMALL: f64 = 1e-4;
    let root = bound.matrix.cholesky()?.l();
    let (mut bent, mut straight) = (0.0, 0.0);
    for point in points {
        let whitened = point.pixels.cholesky()?.inverse();
        let project = |xi: &Vector6<f64>| {
            let pose = object_from_camera.perturbed(xi);
            Some(rig.project(&(pose.inverse() * point.at))?.coordinates())
        };
        let here = project(&Vector6::zeros())?;
        for i in 0..6 {
            let xi = root.column(i) * 6f64.sqrt();
            let linear = (project(&(xi * SMALL))? - project(&(xi * -SMALL))?) / (2.0 * SMALL);
            for sign in [1.0, -1.0] {
                let left = project(&(xi * sign))? - here - linear * sign;
                bent += left.dot(&(whitened * left));
                straight += linear.dot(&(whitened * linear));
            }
        }
    }
    Some((bent / straight).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pinhole;

    /// Many points on a distant ring about the axis: with known attitude the lateral position has σ_px/√(2n) in pixels;
    /// with unknown attitude it is less accurate.
    #[test]
    fn depth_has_the_covariance_of_disparity_and_scale() {
        let camera = Pinhole::new([1000, 1000], [500.0, 500.0], [499.5, 499.5], &[]).unwrap();
        let right_from_left = Transform::exp(&Vector6::new(0.0, 0.0, 0.0, -0.25, 0.0, 0.0));
        let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
        let pose = Transform::<Object, Camera>::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, -4.0));
        let (n, radius, sigma) = (16, 1.0, 0.2);
        let seen = |k: i32| {
            let (sine, cosine) = (f64::from(k) * std::f64::consts::TAU / f64::from(n)).sin_cos();
            let at = Point::new(radius * cosine, radius * sine, 0.0);
            Seen { at, model_sigma: 0.0, pixels: Matrix4::identity() * sigma * sigma }
        };
        let points: Vec<Seen> = (0..n).map(seen).collect();
        let bound = cramer_rao(&rig, &pose, &points).unwrap();
        // By symmetry the depth is correlated only with the rotation about y, through the right camera's offset. Its
        // own information: in each camera a point moves by f r/z² per metre of depth, with r its distance from that
        // camera's axis.
        let information: f64 = points
            .iter()
            .map(|p| {
                let square = |x: f64| (x * x + p.at.coords.y.powi(2)) * (500.0 / 16.0_f64).powi(2);
                (square(p.at.coords.x) + square(p.at.coords.x - 0.25)) / (sigma * sigma)
            })
            .sum();
        let alone = 1.0 / bound.matrix.try_inverse().unwrap()[(5, 5)];
        assert!((alone * information - 1.0).abs() < 1e-6);
        assert!(bound.matrix[(5, 5)] >= alone);
        let tre = transfer_bound(&bound, &pose, &points.iter().map(|p| p.at).collect::<Vec<_>>());
        assert!(tre > 0.0 && tre < 0.01, "{tre}");
        assert!(
            cramer_rao(&rig, &pose, &points[..2]).is_none(),
            "two points leave the rotation about their line undetermined"
        );
        // The remainder is of second order and grows with the noise.
        let bent = nonlinearity(&rig, &pose, &points, &bound).unwrap();
        let louder: Vec<Seen> = points.iter().map(|p| Seen { pixels: p.pixels * 4.0, ..*p }).collect();
        let twice = nonlinearity(&rig, &pose, &louder, &Covariance6::new(bound.matrix * 4.0)).unwrap();
        assert!(bent > 1e-5 && bent < 1e-2 && (twice / bent - 2.0).abs() < 1e-2, "{bent} {twice}");
    }
}
