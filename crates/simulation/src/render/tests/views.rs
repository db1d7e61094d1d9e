//! Both images of a pair show the same scene, and each pixel shows the body that its ray meets.

use super::{view::View, *};
use crate::scene::Bvh;

#[test]
fn depths_of_the_two_images_agree() {
    // Every point of the left image that is visible in the right one has the right camera's depth there. A point
    // occluded for the right camera lies behind the visible surface, never before it.
    let scene = scene(&built_in("drill-centre").unwrap());
    let studio = studio(0.5, Water::default(), Imager::default(), Port::default(), &[]);
    for (object, tilt) in [(2, 0.3), (0, 0.0), (4, -0.2)] {
        let pose = above(scene.objects[object].centroid(), 3.0, tilt);
        let left = shot(pose);
        let mut right = left.clone();
        right.world_from_left = (left.world_from_right).relabel();
        let depths = |shot: &Shot| {
            let mut work = Workspace::default();
            studio.left_radiance(&scene, shot, &mut work);
            Studio::last_depths(&mut work)
        };
        let (ours, theirs) = (depths(&left), depths(&right));
        let (mut same, mut hidden, mut all) = (0, 0, 0);
        for v in 0..384_usize {
            for u in 0..512_usize {
                let z = f64::from(ours[v * 512 + u]);
                // f b / Z, in pixels of half the size.
                let there = u as f64 - 250.0 * 0.25 / z;
                if !z.is_finite() || !(1.0..=510.0).contains(&there) {
                    continue;
                }
                let (k, t) = (there as usize, there.fract());
                let (a, b) = (f64::from(theirs[v * 512 + k]), f64::from(theirs[v * 512 + k + 1]));
                if (a - b).abs() > 0.05 {
                    continue; // between two bodies
                }
                // Inverse depth is linear over a plane.
                let seen = 1.0 / ((1.0 - t) / a + t / b);
                all += 1;
                same += usize::from((seen / z - 1.0).abs() < 2e-3);
                hidden += usize::from(seen < z * (1.0 - 2e-3));
            }
        }
        assert!(all > 100_000 && same + hidden >= all - all / 1000, "{object}: {same} + {hidden} of {all}");
        assert!(same * 100 >= all * 95, "{object}: {same} of {all}");
    }
}

#[test]
fn pixels_show_the_body_that_their_ray_meets() {
    // Away from edges, rasteriser and ray caster agree on the body at every pixel. Regression:
    // giving paint the layer of its plate fails this test.
    let scene = scene(&built_in("drill-centre").unwrap());
    // Paint lies in the plane of its plate, where a ray meets both, so it is searched for separately.
    let (paint, bodies): (Vec<_>, Vec<_>) = scene.mesh.triangles.iter().cloned().partition(|t| t.layer > 0);
    let trees = [Bvh::new(&bodies), Bvh::new(&paint)];
    let flat = Port { kind: PortKind::Flat, ..Port::default() };
    let dome = Port { kind: PortKind::Dome, offset: [0.002, 0.001, 0.004], ..Port::default() };
    for (port, distortion) in
        [(Port::default(), &[][..]), (Port::default(), &[-0.12, 0.02, 1e-3, -5e-4]), (flat, &[]), (dome, &[])]
    {
        let kind = port.kind;
        let studio = studio(0.25, Water::default(), Imager::default(), port, distortion);
        let camera_model = &studio.left;
        for (object, tilt) in [(2, 0.3), (0, 0.0), (4, -0.2)] {
            let pose = above(scene.objects[object].centroid(), 3.0, tilt);
            let met = |index: usize| {
                let pixel = seafix_geometry::Pixel { u: (index % 256) as f64, v: (index / 256) as f64 };
                let ray = camera_model.lens.ray(&pixel)?;
                let from = (pose * seafix_geometry::Point::from(ray.from)).coords;
                let along = pose.rotation() * ray.along;
                let body = trees[0].hit(&bodies, &from, &along, f64::INFINITY).map(|h| (h.t, bodies[h.triangle].skin));
                let seabed = scene.seabed.hit(&from, &along).map(|t| (t, scene.seabed_skin));
                let nearest = body.into_iter().chain(seabed).min_by(|a, b| a.0.total_cmp(&b.0))?;
                let painted = trees[1].hit(&paint, &from, &along, nearest.0 * (1.0 + 1e-4));
                Some(painted.map_or(nearest.1, |h| paint[h.triangle].skin))
            };
            let rays: Vec<Option<u32>> = (0..256 * 192).map(met).collect();
            let seen = View { scene: &scene, camera_model, rolling: None, far: 25.0 }.skins(&pose);
            let inner = (1..191).flat_map(|v| (1..255).map(move |u| v * 256 + u));
            let even = |k: usize| [k - 257, k - 256, k - 255, k - 1, k + 1, k + 255, k + 256, k + 257].map(|n| rays[n]);
            let inner: Vec<usize> = inner.filter(|&k| even(k).iter().all(|skin| *skin == rays[k])).collect();
            let wrong = inner.iter().filter(|&&k| rays[k].is_some() && seen[k] != rays[k]).count();
            assert!(inner.len() > 35_000 && wrong == 0, "{kind:?} {object}: {wrong} of {}", inner.len());
            let bodies = rays.iter().collect::<std::collections::BTreeSet<_>>().len();
            assert!(bodies > 15, "{bodies} bodies in view");
        }
    }
}
