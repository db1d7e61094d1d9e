//! Two cameras and a point in view of both.

use std::cell::Cell;

use nalgebra::Vector4;
use proptest::{prelude::*, test_runner::TestCaseResult};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_geometry::{Camera, Pinhole, Pixel, Point, StereoPixels, StereoRig, UncertainPixels};
use seafix_proptests::{
    law, not_idle,
    rigs::{general, point_at, rectified, seen_by_left},
    within,
};
use seafix_vision::{TRIANGULATORS, Triangulator};

/// The error of an exact projection (px): rounding.
const EXACT: f64 = 1e-9;

/// All registered triangulators, with names.
fn triangulators() -> Vec<(&'static str, Box<dyn Triangulator>)> {
    let named = |name| (name, TRIANGULATORS.build(&Choice::named(name)).expect("the defaults are settings"));
    TRIANGULATORS.names().map(named).collect()
}

/// P48 for one rig and these points; counts the points in view of both cameras.
fn returns_to_the_point(rig: &StereoRig, places: &[(f64, f64, f64)], seen: &Cell<u32>) -> TestCaseResult {
    for point in places.iter().filter_map(|&place| point_at(rig, place)) {
        let Some(pixels) = rig.sees(&point, 0.0) else { continue };
        let exact = UncertainPixels::independent(pixels, EXACT);
        for (name, triangulator) in triangulators() {
            let failed = |error: String| TestCaseError::fail(format!("{name}: {error}"));
            let found = triangulator.point(rig, &exact).map_err(|error| failed(error.to_string()))?;
            within(&format!("{name}: distance (m)"), found.point.distance(&point), 1e-9)?;
            let again = rig.project(&found.point).ok_or_else(|| failed("not in view again".to_owned()))?;
            within(&format!("{name}: left (px)"), again.left.distance(&pixels.left), 1e-9)?;
            within(&format!("{name}: right (px)"), again.right.distance(&pixels.right), 1e-9)?;
            within(&format!("{name}: residual (px)"), found.disagreement.sqrt() * EXACT, 1e-9)?;
        }
        seen.set(seen.get() + 1);
    }
    Ok(())
}

/// P48. Projection, then triangulation: ≤ 1e-9 m for Z ≤ 20 m and f b ≥ 50 px m; reprojection ≤ 1e-9 px; rectified
/// rigs, all triangulators.
///
/// Seen to fail with the right camera displaced the other way in the ray's closest approach, with the cosine's square
/// in it, where nearly parallel rays cancel, and with the linear equations solved only once.
#[test]
fn triangulation_undoes_projection() {
    let seen = Cell::new(0);
    let cases = law(512, (rectified(), prop::collection::vec(seen_by_left(), 8)), |(rig, places)| {
        returns_to_the_point(&rig, &places, &seen)
    });
    not_idle("points seen", seen.get(), cases, 1);
}

/// P48 for general rigs: any displacement across the axis, rotated cameras, lens distortion of 4, 5 and 8 coefficients.
///
/// Seen to fail when the slope of the radial distortion is omitted from its derivative, and when undistortion ends
/// after one step.
#[test]
fn triangulation_undoes_projection_for_any_rig() {
    let seen = Cell::new(0);
    let cases = law(512, (general(), prop::collection::vec(seen_by_left(), 8)), |(rig, places)| {
        returns_to_the_point(&rig, &places, &seen)
    });
    not_idle("points seen", seen.get(), cases, 1);
}

/// P49. Exact projections into a rectified pair are on one row: |v_left − v_right| ≤ 1e-9 px.
///
/// Seen to fail when the right camera's rows are 1e-8 px off.
#[test]
fn rectified_projections_lie_on_one_row() {
    let seen = Cell::new(0);
    let cases = law(512, (rectified(), prop::collection::vec(seen_by_left(), 8)), |(rig, places)| {
        for point in places.iter().filter_map(|&place| point_at(&rig, place)) {
            let Some(pixels) = rig.sees(&point, 0.0) else { continue };
            within("rows apart (px)", (pixels.left.v - pixels.right.v).abs(), 1e-9)?;
            seen.set(seen.get() + 1);
        }
        Ok(())
    });
    not_idle("points seen", seen.get(), cases, 1);
}

/// P49. Exact projections into any rig satisfy the epipolar constraint: each undistorted direction is within 1e-9 px of
/// the line E x of the other, lines of unit normal, scaled by the mean focal length; so is the Sampson distance.
///
/// Seen to fail when the essential matrix is transposed, and when undistortion ends after two steps.
#[test]
fn exact_projections_meet_the_epipolar_constraint() {
    let seen = Cell::new(0);
    let cases = law(512, (general(), prop::collection::vec(seen_by_left(), 8)), |(rig, places)| {
        for point in places.iter().filter_map(|&place| point_at(&rig, place)) {
            let Some(pixels) = rig.sees(&point, 0.0) else { continue };
            let (Some(l), Some(r)) = (rig.left().normalize(&pixels.left), rig.right().normalize(&pixels.right)) else {
                return Err(TestCaseError::fail("a projection has no direction"));
            };
            let (l, r) = (l.push(1.0), r.push(1.0));
            for (line, at) in [(rig.essential() * l, r), (rig.essential().transpose() * r, l)] {
                let slope = line.xy().norm();
                // Near an epipole every direction is near every line, and none is certain.
                if slope > 1e-3 {
                    within("off the line (px)", rig.mean_focal() * line.dot(&at).abs() / slope, 1e-9)?;
                }
            }
            let sampson = rig.epipolar_distance(&pixels).ok_or_else(|| TestCaseError::fail("no distance"))?;
            within("Sampson (px)", sampson, 1e-9)?;
            seen.set(seen.get() + 1);
        }
        Ok(())
    });
    not_idle("points seen", seen.get(), cases, 1);
}

/// P50. An accepted point of any two pixels is before both cameras; in a rectified rig only positive disparities are
/// accepted, and then Z = f b / d, to a relative 1e-9, for any difference of the rows.
///
/// Seen to fail when the test of the sign is omitted, and when the baseline is 1e-8 longer.
#[test]
fn accepted_points_lie_before_the_cameras() {
    let accepted = Cell::new(0);
    let places = (0.0..=1.0, 0.0..=1.0, -0.3..0.6, -0.01..0.01);
    let cases = law(512, (rectified(), general(), prop::collection::vec(places, 8)), |(flat, any, places)| {
        for &(across, down, disparity, rows) in &places {
            for (rig, rectified) in [(&flat, true), (&any, false)] {
                let [width, height] = rig.left().size().map(f64::from);
                let left = Pixel { u: across * width, v: down * height };
                let right = Pixel { u: left.u - disparity * width, v: left.v + rows * height };
                let at = StereoPixels { left, right };
                let Ok(found) = rig.triangulate(&UncertainPixels::independent(at, 0.1)) else { continue };
                prop_assert!(found.point.coords.z > 0.0, "behind the left camera");
                prop_assert!((*rig.right_from_left() * found.point).coords.z > 0.0, "behind the right camera");
                if rectified {
                    let d = left.u - right.u;
                    prop_assert!(d > 0.0, "a disparity of {d} px");
                    let z = rig.left().focal()[0] * rig.baseline() / d;
                    within("Z off f b / d (relative)", (found.point.coords.z / z - 1.0).abs(), 1e-9)?;
                }
                accepted.set(accepted.get() + 1);
            }
        }
        Ok(())
    });
    not_idle("points accepted", accepted.get(), cases, 1);
}

/// P51. Depth grows with falling disparity in a rectified pair.
///
/// Seen to fail when the inverse of the depth is returned.
#[test]
fn depth_grows_as_disparity_falls() {
    let compared = Cell::new(0);
    let pairs = (0.1..=0.9, 0.0..=1.0, 0.005..0.6, 1e-6..0.1);
    let cases = law(512, (rectified(), pairs), |(rig, (across, down, disparity, less))| {
        let [width, height] = rig.left().size().map(f64::from);
        let depth = |disparity: f64| {
            let left = Pixel { u: across * width, v: down * height };
            let at = StereoPixels { left, right: Pixel { u: left.u - disparity * width, ..left } };
            rig.triangulate(&UncertainPixels::independent(at, 0.1)).map(|found| found.point.coords.z)
        };
        if let (Ok(near), Ok(far)) = (depth(disparity), depth(disparity * (1.0 - less))) {
            prop_assert!(far > near, "{near} m, then {far} m");
            compared.set(compared.get() + 1);
        }
        Ok(())
    });
    not_idle("pairs compared", compared.get(), cases, 2);
}

/// P51. The predicted σ_Z of triangulation agrees with that of 20 000 draws of pixels with σ = 0.3 px, known to 0.5 %,
/// within 3 %, Z ≤ 5 m, for rectified and general rigs.
///
/// Seen to fail when the covariance is a tenth too small.
#[test]
fn predicted_depth_noise_is_that_of_many_draws() {
    const SIGMA: f64 = 0.3;
    const DRAWS: u32 = 20_000;
    let triangulators = triangulators();
    let tried = Cell::new(0);
    let place = (0.2..=0.8, 0.2..=0.8, 1.0..=5.0);
    law(4, (rectified(), general(), place, any::<u64>()), |(flat, any, place, seed)| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Box and Muller.
        let mut normal = || {
            let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random::<f64>());
            (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
        };
        for rig in [flat, any] {
            let Some(exact) = point_at(&rig, place).and_then(|point| rig.sees(&point, 5.0)) else { continue };
            for (name, triangulator) in &triangulators {
                let predicted = triangulator
                    .point(&rig, &UncertainPixels::independent(exact, SIGMA))
                    .map_err(|error| TestCaseError::fail(format!("{name}: {error}")))?
                    .covariance[(2, 2)]
                    .sqrt();
                let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
                for _ in 0..DRAWS {
                    let noise = Vector4::from_fn(|_, _| SIGMA * normal());
                    let left = Pixel { u: exact.left.u + noise[0], v: exact.left.v + noise[1] };
                    let right = Pixel { u: exact.right.u + noise[2], v: exact.right.v + noise[3] };
                    let at = StereoPixels { left, right };
                    if let Ok(found) = triangulator.point(&rig, &UncertainPixels::independent(at, SIGMA)) {
                        let off = found.point.coords.z - place.2;
                        (count, sum, squares) = (count + 1.0, sum + off, squares + off * off);
                    }
                }
                prop_assert_eq!(count, f64::from(DRAWS), "every draw gives a point");
                let generated = (squares / count - (sum / count) * (sum / count)).sqrt();
                within(
                    &format!("{name}: σ_Z drawn over predicted, less 1"),
                    (generated / predicted - 1.0).abs(),
                    0.03,
                )?;
            }
            tried.set(tried.get() + 1);
        }
        Ok(())
    });
    assert!(tried.get() >= 4, "{} layouts", tried.get());
}

/// P52. Undistortion inverts distortion where the lens model is monotonic: a direction and a pixel are reproduced, ≤
/// 1e-9 px; without distortion both are the pinhole's u = f x + c, so that no error can hide in both.
///
/// Seen to fail when undistortion ends after two steps, and when it uses another principal point.
#[test]
fn undistorting_undoes_distorting() {
    let seen = Cell::new(0);
    let cases = law(512, (general(), prop::collection::vec((0.0..=1.0, 0.0..=1.0), 8)), |(rig, places)| {
        let camera = rig.left();
        let ([width, height], [fx, fy], [cx, cy]) = (camera.size().map(f64::from), camera.focal(), camera.principal());
        let plain = Pinhole::new(camera.size(), [fx, fy], [cx, cy], &[]).expect("a camera without its lens");
        for &(across, down) in &places {
            let pixel = Pixel { u: across * width, v: down * height };
            let by_hand = [(pixel.u - cx) / fx, (pixel.v - cy) / fy];
            let straight = plain.normalize(&pixel).ok_or_else(|| TestCaseError::fail("a pinhole has no limit"))?;
            within("pinhole (px)", fx * (straight.x - by_hand[0]).hypot(straight.y - by_hand[1]), 1e-9)?;
            let Some(direction) = camera.normalize(&pixel) else { continue };
            let ahead = Point::<Camera>::from(direction.push(1.0) * 2.0);
            let again = camera.project(&ahead).ok_or_else(|| TestCaseError::fail("not in view again"))?;
            within("pixel (px)", again.distance(&pixel), 1e-9)?;
            let back = camera.normalize(&again).ok_or_else(|| TestCaseError::fail("no direction"))?;
            within("direction (px)", fx.max(fy) * (back - direction).norm(), 1e-9)?;
            if camera.distortion().shortest().is_empty() {
                within("no lens (px)", fx * (direction - straight).norm(), 1e-9)?;
            }
            seen.set(seen.get() + 1);
        }
        Ok(())
    });
    not_idle("pixels", seen.get(), cases, 1);
}
