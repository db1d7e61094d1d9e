//! The points of a target that may be in view under the prior, and the image regions of their gates.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Pinhole, Pixel, Point, StereoRig};
use seafix_referencing::{ModelEdge, ModelPoint, Prior, PriorBound, Target};
use seafix_vision::{Disc, Regions};

/// The minimum cosine between normal and line of sight; below it a point is seen from behind.
const BACK: f64 = -0.2;
/// The number of standard deviations by which a prediction may be wrong: the radius of the χ²₃ gate of 99 % is 3.37.
const SIGMAS: f64 = 3.4;
/// The margin of a region (px), for the distance between a detector's peak and the corner, and for the neighbours whose
/// density the tests of absence compare.
const MARGIN: f64 = 8.0;

/// The points of a target that may be in view, and are not seen from behind: [`SIGMAS`] standard deviations of the
/// prediction reach the viewing cones of both cameras.
///
/// `None` if there are fewer than three. Without a prior, every point may be in view.
pub(crate) fn in_view(points: &[ModelPoint], prior: Option<&Prior>, rig: &StereoRig) -> Option<Vec<bool>> {
    let Some(prior) = prior else { return Some(vec![true; points.len()]) };
    let mask = visible(points, prior, rig);
    (mask.iter().filter(|may_be| **may_be).take(3).count() == 3).then_some(mask)
}

/// The points that may be in view, as [`in_view`].
pub(crate) fn visible(points: &[ModelPoint], prior: &Prior, rig: &StereoRig) -> Vec<bool> {
    let camera_from_object = prior.object_from_camera.inverse();
    let faces = |point: &ModelPoint| {
        point.normal.is_none_or(|normal| {
            let ray = prior.object_from_camera.translation() - point.at.coords;
            normal.normalize().dot(&ray.normalize()) > BACK
        })
    };
    let cameras = [ViewingCone::of(rig.left()), ViewingCone::of(rig.right())];
    let may_be = |point: &ModelPoint| {
        let at = camera_from_object * point.at;
        let in_cones = || {
            let reach = SIGMAS * spread(prior, &at);
            cameras[0].meets(&at.coords, reach) && cameras[1].meets(&(*rig.right_from_left() * at).coords, reach)
        };
        faces(point) && (rig.sees(&at, 0.0).is_some() || in_cones())
    };
    points.iter().map(may_be).collect()
}

/// The edges that may be in view, and are not seen from behind: some place on the edge may be.
///
/// Without a prior, every edge may be in view.
pub(crate) fn edges_in_view(target: &Target, prior: Option<&Prior>, rig: &StereoRig) -> Vec<bool> {
    /// Places on an edge that are examined.
    const PLACES: usize = 7;
    let Some(prior) = prior else { return vec![true; target.edges.len()] };
    let camera = prior.object_from_camera.translation();
    let of = |edge: &ModelEdge| {
        if !edge.faces.is_empty() && !edge.shows_itself(&target.points, &camera) {
            return false;
        }
        let [from, to] = edge.places(&target.points);
        let along = to - from;
        let places: Vec<ModelPoint> =
            (0..PLACES).map(|k| ModelPoint::exact("", from + along * ((k as f64 + 0.5) / PLACES as f64))).collect();
        visible(&places, prior, rig).contains(&true)
    };
    target.edges.iter().map(of).collect()
}

/// The regions of the left and the right image that contain the gates of the points in view, for the points of each
/// target and its prior.
pub(crate) fn regions<'a>(
    targets: impl Iterator<Item = (&'a [ModelPoint], &'a Prior)>,
    rig: &StereoRig,
) -> [Regions; 2] {
    let mut discs = [Vec::new(), Vec::new()];
    for (points, prior) in targets {
        let Some(mask) = in_view(points, Some(prior), rig) else { continue };
        let camera_from_object = prior.object_from_camera.inverse();
        for (point, _) in points.iter().zip(mask).filter(|(_, may_be)| *may_be) {
            let at = camera_from_object * point.at;
            let spread = SIGMAS * spread(prior, &at);
            let seen = rig.project(&at);
            let mut add = |side: usize, camera: &Pinhole, at: &Vector3<f64>, seen: Option<Pixel>| {
                // A point that may lie at the camera may lie anywhere in the image.
                let known = seen.filter(|_| at.z > spread);
                let radius = known.map_or(f64::INFINITY, |_| reach(camera, at, spread) + MARGIN);
                discs[side].push(Disc { centre: known.unwrap_or(Pixel { u: 0.0, v: 0.0 }), radius });
            };
            add(0, rig.left(), &at.coords, seen.map(|seen| seen.left));
            add(1, rig.right(), &(*rig.right_from_left() * at).coords, seen.map(|seen| seen.right));
        }
    }
    discs.map(Regions::new)
}

/// The largest standard deviation (m) of the predicted place `at`.
fn spread(prior: &Prior, at: &Point<Camera>) -> f64 {
    match &prior.bound {
        PriorBound::Gaussian(covariance) => covariance.of_point(at).symmetric_eigenvalues().max().max(0.0).sqrt(),
        PriorBound::Box(half) => *half / 3.0,
    }
}

/// The distance (px) from the projection of `at` within which its point lies, for an error of at most `off` (m) < z.
///
/// A displacement δ moves the projection by f (δ_xy − δ_z (x, y)/z)/(z + δ_z).
fn reach(camera: &Pinhole, at: &Vector3<f64>, off: f64) -> f64 {
    let [fx, fy] = camera.focal();
    fx.max(fy) * off * at.norm() / (at.z * (at.z - off))
}

/// The directions that a camera sees, bounded by four planes through its centre.
struct ViewingCone {
    /// The smallest and the largest x/z and y/z.
    bounds: [[f64; 2]; 2],
}

impl ViewingCone {
    fn of(camera: &Pinhole) -> Self {
        let [width, height] = camera.size().map(|n| f64::from(n) - 1.0);
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        // With distortion the middle of a side may lie farther out than its ends.
        for [u, v] in [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 0.5], [1.0, 0.5], [0.0, 1.0], [0.5, 1.0], [1.0, 1.0]] {
            let Some(ray) = camera.normalize(&Pixel { u: u * width, v: v * height }) else {
                // The lens model ends inside the image: no plane bounds the view.
                return Self { bounds: [[f64::NEG_INFINITY, f64::INFINITY]; 2] };
            };
            for (bounds, tangent) in bounds.iter_mut().zip([ray.x, ray.y]) {
                *bounds = [bounds[0].min(tangent), bounds[1].max(tangent)];
            }
        }
        Self { bounds }
    }

    /// Whether a ball of this radius (m) about `at` reaches the cone.
    fn meets(&self, at: &Vector3<f64>, radius: f64) -> bool {
        let beside = |x: f64, [min, max]: [f64; 2]| {
            let outside =
                |over: f64, tangent: f64| tangent.is_finite() && over > radius * (1.0 + tangent * tangent).sqrt();
            outside(min * at.z - x, min) || outside(x - max * at.z, max)
        };
        at.z > -radius && !beside(at.x, self.bounds[0]) && !beside(at.y, self.bounds[1])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use seafix_geometry::{Covariance6, Transform};

    use super::*;

    /// A rig of 400×300 px with f = 500 px and a baseline of 0.2 m.
    fn rig() -> StereoRig {
        let camera = Pinhole::new([400, 300], [500.0; 2], [199.5, 149.5], &[]).unwrap();
        let step = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.2, 0.0, 0.0));
        StereoRig::new(camera, camera, step).unwrap()
    }

    /// Four points in a square of 0.4 m, `x` m to the right at a depth of 2 m.
    fn target(x: f64) -> Vec<ModelPoint> {
        let corner = |i: usize| Point::new(x + 0.4 * (i % 2) as f64, 0.4 * (i / 2) as f64 - 0.2, 2.0);
        (0..4).map(|i| ModelPoint::exact("", corner(i))).collect()
    }

    fn prior(sigma: f64) -> Prior {
        let bound = PriorBound::Gaussian(Covariance6::isotropic(1e-6, sigma));
        Prior { object_from_camera: Transform::new(UnitQuaternion::identity(), Vector3::zeros()), bound }
    }

    /// The right border of the left image is at x = 0.8 m, that of the object at x = 1 to 1.4 m. Fails if the mean alone
    /// decides.
    #[test]
    fn an_object_is_attempted_where_three_points_may_be_in_view() {
        let attempted = |x: f64, sigma: f64| in_view(&target(x), Some(&prior(sigma)), &rig()).is_some();
        assert!(attempted(0.1, 0.01) && !attempted(1.0, 0.01));
        // Two points are 0.19 m from the cone, two 0.56 m: 1.9 and 5.6 standard deviations of 0.1 m.
        assert!(!attempted(1.0, 0.1) && attempted(1.0, 0.2));
        // Nothing in view is 3.4 m from an object 40 m beside the camera.
        assert!(!attempted(40.0, 1.0));
        assert_eq!(in_view(&target(40.0), None, &rig()), Some(vec![true; 4]));
    }

    /// Fails to first order, f/z · δ: nearer points move more.
    #[test]
    fn a_region_contains_the_gate_in_both_images() {
        let (rig, target, sigma) = (rig(), target(0.1), 0.1);
        let regions = regions([(&target[..], &prior(sigma))].into_iter(), &rig);
        for point in &target {
            for k in 0..60 {
                // Stereographic coordinates of points all over the sphere.
                let (a, b) = (0.7 * f64::from(k % 8) - 2.4, 0.9 * f64::from(k / 8) - 3.1);
                let direction = Vector3::new(2.0 * a, 2.0 * b, 1.0 - a * a - b * b) / (1.0 + a * a + b * b);
                let at = Point::from(point.at.coords + 3.36 * sigma * direction);
                let seen = rig.project(&at).expect("in front of the cameras");
                assert!(regions[0].contains(&seen.left) && regions[1].contains(&seen.right), "{direction}");
            }
        }
        assert!(!regions[0].contains(&Pixel { u: 5.0, v: 150.0 }));
    }
}
