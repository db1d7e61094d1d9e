use seafix_geometry::{Pixel, Point};

use super::*;

/// A small, fast rig with an object in view: the virtual camera at a quarter of its size.
fn small() -> Dive {
    Dive { frames: 7, rig: VirtualRig { size: [256, 192], focal: 125.0, baseline: 0.25 }, ..Dive::default() }
}

#[test]
fn views_show_feature_points_in_both_images() {
    for distance in [2.0, 3.0, 4.0, 5.0] {
        let dive = Dive { distance, frames: 7, ..Dive::default() }.plan(11, 0).unwrap();
        for frame in dive.frames() {
            let truth = frame.truth();
            let own = truth.visible.iter().filter(|v| v.object == truth.object).count();
            assert!(own >= 5, "{own} at {distance} m, frame {}", frame.index);
            let centroid = dive.scene.bodies[truth.object].centroid();
            assert!(((truth.world_from_camera.translation() - centroid).norm() - distance).abs() < 1e-9);
        }
    }
}

#[test]
fn visible_points_have_the_pixels_of_the_truth() {
    let dive = small().plan(3, 0).unwrap();
    for frame in dive.frames() {
        for seen in &frame.truth().visible {
            let model = dive.site().objects[seen.object].points[seen.point].at;
            let at = frame.truth().world_from_camera.inverse() * (dive.world_from_object()[seen.object] * model);
            let pixels = dive.rig().project(&at).unwrap();
            // The model error of a millimetre is a fraction of these large pixels.
            assert!(pixels.left.distance(&seen.pixels.left) < 0.3);
            assert!((seen.pixels.left.v - seen.pixels.right.v).abs() < 1e-9);
        }
    }
}

#[test]
fn a_frame_is_a_function_of_seed_dive_and_index() {
    let first = small().plan(5, 0).unwrap();
    let longer = Dive { frames: 50, ..small() }.plan(5, 0).unwrap();
    for index in [6, 0, 3] {
        let (a, b) = (first.frame(index), longer.frame(index));
        assert_eq!(a.truth(), b.truth());
        assert_eq!((a.prior, a.stamp_ns), (b.prior, b.stamp_ns));
        assert_eq!(a.points(), b.points());
        assert_eq!(a.render(), b.render());
    }
    let (other_seed, other_dive) = (small().plan(6, 0).unwrap(), small().plan(5, 1).unwrap());
    assert_ne!(first.site(), other_seed.site());
    assert_ne!(first.frame(0).render(), other_seed.frame(0).render());
    assert_eq!(first.site(), other_dive.site());
    assert_ne!(first.frame(0).truth(), other_dive.frame(0).truth());
    assert_ne!(first.frame(0).render(), other_dive.frame(0).render());
}

#[test]
fn threads_change_nothing() {
    let dive = small().plan(5, 0).unwrap();
    let here: Vec<_> = dive.frames().map(|f| (f.render(), f.points())).collect();
    let there: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..dive.len())
            .rev()
            .map(|k| {
                let dive = &dive;
                scope.spawn(move || {
                    let f = dive.frame(k);
                    (f.render(), f.points())
                })
            })
            .collect();
        workers.into_iter().rev().map(|w| w.join().unwrap()).collect()
    });
    assert_eq!(here, there);
}

#[test]
fn prior_poses_err_as_stated() {
    let settings = Dive { frames: 400, distance: 4.0, min_visible: 0, ..small() };
    let dive = settings.plan(2, 0).unwrap();
    let (mut position, mut attitude) = (0.0, 0.0);
    for frame in dive.frames() {
        let (truth, prior) = (frame.truth().world_from_camera, frame.prior.world_from_camera);
        position += (truth.translation() - prior.translation()).norm_squared();
        attitude += prior.error_to(&truth).fixed_rows::<3>(0).norm_squared();
    }
    let sigma = |sum: f64| (sum / 1200.0).sqrt();
    assert!((sigma(position) / 0.1 - 1.0).abs() < 0.07);
    assert!((sigma(attitude) / 0.5f64.to_radians() - 1.0).abs() < 0.07);
}

#[test]
fn stamps_follow_the_rate() {
    let dive = small().plan(2, 0).unwrap();
    let stamps: Vec<_> = dive.frames().map(|f| f.stamp_ns).collect();
    assert!(stamps.windows(2).all(|w| w[1] - w[0] == 100_000_000));
}

#[test]
fn depth_is_what_a_ray_meets() {
    let dive = small().plan(9, 0).unwrap();
    let (mut same, mut all) = (0, 0);
    for frame in dive.frames().take(3) {
        let placed_rig = frame.placed_rig();
        let rendering = Rendering::new(&dive.scene, placed_rig.rig.left(), &placed_rig.world_from_camera);
        let from = placed_rig.world_from_camera.translation();
        for row in (0..192).step_by(3) {
            for column in (0..256).step_by(3) {
                let pixel = Pixel { u: column as f64, v: row as f64 };
                let ray = placed_rig.rig.left().normalize(&pixel).unwrap().push(1.0);
                let cast = dive.scene.hit(&from, &(placed_rig.world_from_camera.rotation() * ray)).unwrap();
                let generated = rendering.depth(column, row).unwrap();
                all += 1;
                same += usize::from((generated / cast - 1.0).abs() < 1e-9);
            }
        }
    }
    assert!(same as f64 >= 0.999 * all as f64, "{same} of {all}");
}

#[test]
fn rows_have_the_radiance_of_each_pixel() {
    let dive = small().plan(9, 0).unwrap();
    for frame in dive.frames().take(3) {
        let placed_rig = frame.placed_rig();
        let rendering = Rendering::new(&dive.scene, placed_rig.rig.left(), &placed_rig.world_from_camera);
        for (place, value) in rendering.radiance().iter().enumerate() {
            let (column, row) = (place % 256, place / 256);
            assert_eq!(value.to_bits(), rendering.pixel(column, row).to_bits(), "{column}, {row}");
        }
    }
}

#[test]
fn left_and_right_image_show_one_scene() {
    // Without noise both cameras see the same grey at a point of a flat surface.
    let quiet = Sensor { noise: 0.0, blur: 0.0, ..Sensor::default() };
    let dive = Dive { sensor: quiet, frames: 2, ..Dive::default() }.plan(9, 0).unwrap();
    for frame in dive.frames() {
        let (left, right) = frame.render();
        let placed_rig = frame.placed_rig();
        let rendering = Rendering::new(&dive.scene, placed_rig.rig.left(), &placed_rig.world_from_camera);
        let other = Rendering::new(
            &dive.scene,
            placed_rig.rig.right(),
            &(placed_rig.world_from_camera * placed_rig.rig.right_from_left().inverse()),
        );
        let mut differences = Vec::new();
        for row in (2..766).step_by(7) {
            for column in (2..1022).step_by(7) {
                let z = rendering.depth(column, row).unwrap();
                let shift = 500.0 * 0.25 / z;
                let there = column as f64 - shift;
                if there < 1.0 {
                    continue;
                }
                let cell = there.floor() as usize;
                if (other.depth(cell, row).unwrap() / z - 1.0).abs() > 0.01 {
                    continue; // occluded for the right camera
                }
                let fraction = (there - cell as f64) as f32;
                let seen = right.row(row)[cell] * (1.0 - fraction) + right.row(row)[cell + 1] * fraction;
                differences.push(f64::from((left.row(row)[column] - seen).abs()));
            }
        }
        differences.sort_by(f64::total_cmp);
        assert!(differences.len() > 10_000);
        assert!(differences[differences.len() / 2] < 2.0, "{}", differences[differences.len() / 2]);
    }
}

/// The common corner of an X mark's two dark squares, by the least-squares saddle point of the grey levels.
fn saddle(image: &Image, near: &Pixel) -> Option<Pixel> {
    // f = a + b x + c y + d x² + e xy + g y² over a window, iterated around its own saddle point.
    let mut at = *near;
    for _ in 0..8 {
        let (mut normal, mut gradient) = (nalgebra::Matrix6::<f64>::zeros(), nalgebra::Vector6::<f64>::zeros());
        for row in (at.v.round() as i64 - 4)..=(at.v.round() as i64 + 4) {
            for column in (at.u.round() as i64 - 4)..=(at.u.round() as i64 + 4) {
                let (x, y) = (column as f64 - at.u, row as f64 - at.v);
                let weight = libm::exp(-0.5 * (x * x + y * y) / 1.5);
                let terms = nalgebra::Vector6::new(1.0, x, y, x * x, x * y, y * y);
                let grey = f64::from(*image.row(usize::try_from(row).ok()?).get(usize::try_from(column).ok()?)?);
                normal += terms * terms.transpose() * weight;
                gradient += terms * (grey * weight);
            }
        }
        let f = normal.try_inverse()? * gradient;
        let determinant = 4.0 * f[3] * f[5] - f[4] * f[4];
        if determinant >= 0.0 {
            return None;
        }
        at.u += (-2.0 * f[5] * f[1] + f[4] * f[2]) / determinant;
        at.v += (f[4] * f[1] - 2.0 * f[3] * f[2]) / determinant;
        if at.distance(near) > 1.5 {
            return None;
        }
    }
    Some(at)
}

/// Whether a feature point is the common corner of two panels.
fn is_x_mark(plan: &crate::blueprint::ObjectPlan, point: usize) -> bool {
    let Some(panel) = plan.points[point].panel else { return false };
    let here = &plan.panels[panel];
    plan.panels.iter().filter(|p| p.carrier == here.carrier && p.outline[0] == here.outline[0]).count() == 2
}

#[test]
fn marks_are_rendered_where_the_truth_has_them() {
    let quiet = Sensor { noise: 0.0, ..Sensor::default() };
    let blueprint = Blueprint::drill_centre();
    let dive = Dive { sensor: quiet, distance: 3.0, frames: 7, ..Dive::default() }.plan(4, 0).unwrap();
    let mut errors = Vec::new();
    for frame in dive.frames() {
        let (left, right) = frame.render();
        for seen in &frame.truth().visible {
            if is_x_mark(&blueprint.objects[seen.object], seen.point) {
                for (image, pixel) in [(&left, seen.pixels.left), (&right, seen.pixels.right)] {
                    errors.extend(saddle(image, &pixel).map(|found| [found.u - pixel.u, found.v - pixel.v]));
                }
            }
        }
    }
    let n = errors.len() as f64;
    assert!(n > 30.0, "{n}");
    for axis in 0..2 {
        let mean = errors.iter().map(|e| e[axis]).sum::<f64>() / n;
        let rms = (errors.iter().map(|e| e[axis] * e[axis]).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 0.02 && rms < 0.08, "axis {axis}: mean {mean}, rms {rms}");
    }
}

#[test]
fn points_are_the_truth_with_pixel_noise() {
    let settings =
        Dive { frames: 40, points: PointNoise { sigma_px: 0.2, found: 1.0, clutter: 60 }, ..Dive::default() };
    let dive = settings.plan(8, 0).unwrap();
    let (mut squares, mut n) = (0.0, 0.0);
    for frame in dive.frames() {
        let points = frame.points();
        for seen in &frame.truth().visible {
            let nearest = points
                .iter()
                .filter_map(|p| Some(p.pixels?.at))
                .min_by(|a, b| a.left.distance(&seen.pixels.left).total_cmp(&b.left.distance(&seen.pixels.left)))
                .unwrap();
            let e = (nearest.left.u - nearest.right.u) - (seen.pixels.left.u - seen.pixels.right.u);
            squares += e * e;
            n += 1.0;
            assert!(nearest.left.distance(&seen.pixels.left) < 1.2);
        }
        assert!(points.iter().all(|p| p.position.at.is_finite() && p.position.covariance.trace() > 0.0));
    }
    let sigma: f64 = squares / n;
    assert!((sigma.sqrt() / (0.2 * 2f64.sqrt()) - 1.0).abs() < 0.12, "{}", sigma.sqrt());
}

#[test]
fn numbers_that_make_no_dive_are_rejected() {
    for (dive, start) in [
        (Dive { distance: f64::NAN, ..small() }, "distance = NaN; "),
        (Dive { tilt_deg: [10.0, 5.0], ..small() }, "tilt-deg[1] = 5; "),
        (Dive { rig: VirtualRig { focal: -1.0, ..VirtualRig::default() }, ..small() }, "rig.focal = -1; "),
        (Dive { points: PointNoise { found: 2.0, ..PointNoise::default() }, ..small() }, "points.found = 2; "),
    ] {
        let message = dive.plan(1, 0).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
    let unknown = toml::from_str::<Dive>("distnce = 3.0").unwrap_err();
    assert!(unknown.message().contains("unknown field"));
    assert_eq!(toml::from_str::<Dive>("").unwrap(), Dive::default());
}

#[test]
fn a_camera_that_points_down_and_aft_is_below() {
    let dive = small().plan(1, 0).unwrap();
    let place = Vector3::new(3.0, -2.0, 39.0);
    let north = dive.aim(&place, [0.0; 2], 0.0, 0.0, 0.0);
    let seen = |p: Vector3<f64>| dive.rig().left().project(&(north.inverse() * Point::from(p))).unwrap();
    let (here, east, aft) = (seen(place), seen(place + Vector3::y() * 0.3), seen(place - Vector3::x() * 0.3));
    assert!(east.u > here.u + 5.0 && (east.v - here.v).abs() < 1e-9);
    assert!(aft.v > here.v + 5.0 && (aft.u - here.u).abs() < 1e-9);
}
