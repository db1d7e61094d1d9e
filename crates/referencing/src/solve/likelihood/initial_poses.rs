//! Several initial poses: the maximum-likelihood pose and its alternatives.

use std::cell::RefCell;

use nalgebra::{Matrix3, UnitQuaternion, UnitVector3, Vector3};
use seafix_geometry::{Camera, Object, StereoRig, Transform};

use crate::{
    observations::{Observation, Observations},
    solve::{
        closed_form::fit,
        degeneracy::{Degenerate, widest},
        likelihood::{
            descent::{Linearized, NEAR, descend, linearize, settle},
            pixel_terms::PixelTerms,
            roots::roots,
        },
    },
};

/// An alternative pose that explains the same points nearly as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlternativePose {
    /// The pose.
    pub pose: Transform<Object, Camera>,
    /// The excess of its χ² over the answer's; negative if its χ² is smaller.
    pub worse: f64,
}

/// Standard deviation of the attitude (rad, three axes together) above which the minimum may be a wrong one.
const WEAK: f64 = 0.01;

/// Default of the maximum number of initial poses: the unweighted fit and the four P3P poses of one camera.
pub(crate) const STARTS: usize = 5;

/// The pose of smallest cost over several initial poses.
///
/// The first initial pose is the unweighted fit. If its answer has a weak attitude or an improbable χ², the P3P poses
/// of one camera and the mirror image of the answer serve as further initial poses, `starts` and one in total. A
/// minimum that was not reached is no evidence for a higher one.
///
/// # Errors
///
/// The error of the first initial pose if none leads to a minimum, and that of an unreached minimum with a cost below
/// all others.
pub(crate) fn maximum_likelihood(
    data: &Observations<'_>,
    rig: &StereoRig,
    starts: usize,
    pixel_terms: &PixelTerms<'_>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let points = &data.points;
    // The smallest cost of an unreached minimum, with its error.
    let unfinished: RefCell<Option<(f64, Degenerate)>> = RefCell::default();
    let from = |start: &Transform<Object, Camera>| {
        minimum(points, start, pixel_terms, |cost, why| {
            let mut lowest = unfinished.borrow_mut();
            if lowest.as_ref().is_none_or(|(known, _)| cost < *known) {
                *lowest = Some((cost, why.clone()));
            }
        })
    };
    let first = from(&fit(points));
    if starts == 1 || first.as_ref().is_ok_and(|(_, all)| is_clear(all, points.len())) {
        return first.map(|(pose, _)| pose);
    }
    let turned = first.as_ref().ok().and_then(|(pose, _)| mirrored(points, pose));
    let mut best = first.map(|(pose, all)| (all.cost, pose));
    let others = roots(data, rig);
    for start in others.as_slice().iter().take(starts - 1).chain(&turned) {
        let Ok((pose, all)) = from(start) else { continue };
        // Two initial poses near one minimum give equal costs: the first is kept.
        if best.as_ref().is_ok_and(|(min, _)| all.cost >= min * (1.0 - 1e-6)) {
            continue;
        }
        best = Ok((all.cost, pose));
    }
    let (min, pose) = best?;
    match unfinished.into_inner() {
        Some((lower, why)) if lower < min => Err(why),
        _ => Ok(pose),
    }
}

/// Other minima whose χ² exceeds that of `at` by at most `max`, outside its covariance.
///
/// They are sought if [`maximum_likelihood`] doubts its first answer, from the P3P poses of either camera and from the
/// mirror image; a solver with one initial pose returns none.
pub(crate) fn alternatives(
    data: &Observations<'_>,
    rig: &StereoRig,
    starts: usize,
    pixel_terms: &PixelTerms<'_>,
    at: &Transform<Object, Camera>,
    max: f64,
) -> Vec<AlternativePose> {
    /// χ²₆ at 95 %: the limit of a minimum's covariance.
    const CONTAINED: f64 = 12.591_587_243_743_977;
    let points = &data.points;
    let live = |k: usize, place: &_| pixel_terms.live(k, place);
    let Ok(here) = linearize(points, at, &live) else { return Vec::new() };
    if starts == 1 || is_clear(&here, points.len()) {
        return Vec::new();
    }
    let mut found: Vec<AlternativePose> = Vec::new();
    let mut others = roots(data, rig);
    others.of_camera(data, rig, widest(data), true);
    for start in others.as_slice().iter().chain(&mirrored(points, at)) {
        let Ok((pose, all)) = minimum(points, start, pixel_terms, |_, _| ()) else { continue };
        let worse = all.cost - here.cost;
        let known = found.iter().any(|other| all.away(&pose.error_to(&other.pose)) < 1.0);
        if worse <= max && !known && here.away(&at.error_to(&pose)) > CONTAINED {
            found.push(AlternativePose { pose, worse });
        }
    }
    found
}

/// The minimum near `start` and its normal equations; `unfinished` receives the lowest cost and the error of an
/// unreached one.
fn minimum(
    points: &[Observation],
    start: &Transform<Object, Camera>,
    pixel_terms: &PixelTerms<'_>,
    unfinished: impl FnOnce(f64, &Degenerate),
) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
    let live = |k: usize, at: &_| pixel_terms.live(k, at);
    let (near, here) = descend(points, start, NEAR, &|k, at: &_| pixel_terms.frozen(k, at))?;
    let here = if pixel_terms.weights_move { linearize(points, &near, &live)? } else { here };
    let cost = here.cost;
    settle(points, near, here, &live).inspect_err(|why| unfinished(cost, why))
}

/// The pose with the opposite tilt: the points' best-fit plane is mirrored in the plane across the line of sight to
/// their centroid.
///
/// A distant flat object looks alike at opposite tilts, and depth alone decides (Oberkampf, DeMenthon and Davis,
/// *Iterative pose estimation using coplanar feature points*, 1996).
fn mirrored(points: &[Observation], pose: &Transform<Object, Camera>) -> Option<Transform<Object, Camera>> {
    let camera_from_object = pose.inverse();
    let place = |point: &Observation| (camera_from_object * point.model).coords;
    let centre = points.iter().map(place).sum::<Vector3<f64>>() / points.len() as f64;
    let from_centre = points.iter().map(|point| place(point) - centre);
    let scatter: Matrix3<f64> = from_centre.map(|off| off * off.transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let ray = centre.try_normalize(1e-9)?;
    let normal = if normal.dot(&ray) < 0.0 { -normal } else { normal };
    let axis = UnitVector3::try_new(normal.cross(&ray), 1e-9)?;
    let turn = UnitQuaternion::from_axis_angle(&axis, 2.0 * normal.angle(&ray));
    let moved = Transform::<Camera, Camera>::new(turn, centre - turn * centre);
    Some(*pose * moved.inverse())
}

fn is_clear(all: &Linearized, points: usize) -> bool {
    let max = 4.0 * points as f64;
    let likely = all.cost <= max + 5.0 * (2.0 * max).sqrt();
    likely && all.attitude_variance().is_some_and(|variance| variance <= WEAK * WEAK)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Point, UncertainPoint};

    /// A square tilted by 20° about the camera's x axis: its mirror image is tilted by −20° at the same position.
    #[test]
    fn the_mirror_image_tilts_in_the_other_direction_about_the_same_centre() {
        let corners = [(0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)];
        let point = |(x, y): (f64, f64)| {
            let model = Point::new(x, y, 0.0);
            let measured = UncertainPoint::isotropic(Point::origin(), 1.0);
            Observation { measured, pixels: None, model, model_sigma: 0.0 }
        };
        let points = corners.map(point);
        let tilted = |angle: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle);
            Transform::<Object, Camera>::new(turn, -(turn * Vector3::new(0.0, 0.0, 4.0)))
        };
        let (pose, other) = (tilted(0.35), tilted(-0.35));
        assert!(mirrored(&points, &pose).unwrap().error_to(&other).norm() < 1e-9);
        assert!(mirrored(&points, &tilted(0.0)).is_none(), "seen from the front it is its own mirror image");
    }
}
