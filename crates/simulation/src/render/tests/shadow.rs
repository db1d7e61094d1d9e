//! Shadows lie where straight rays from the lamps put them.

use super::*;
use crate::scene::{BoxBody, ObjectGeometry, Texture};

/// Whether a lamp is visible from a place, the place, and the normal of its surface.
type Met = (bool, Vector3<f64>, Vector3<f64>);

/// The unoccluded fraction of one lamp's light at each pixel of the left image; NaN without incident light.
fn fractions(scene: &Scene, lamp: &Lamp, scale: f64, shot: &Shot) -> Vec<f32> {
    let water = Water { attenuation: 0.0, snow: 0.0, ..Water::default() };
    let image = |shadows| {
        let mut studio = studio(scale, water.clone(), Imager::default(), Port::default(), &[]);
        studio.left = RenderCamera::new(studio.left.lens.clone(), vec![lamp.clone()], &water);
        studio.shadows = shadows;
        studio.left_radiance(scene, shot, &mut Workspace::default())
    };
    let (cast, free) = (image(true), image(false));
    cast.iter().zip(&free).map(|(cast, free)| if *free > 0.0 { cast / free } else { f32::NAN }).collect()
}

#[test]
fn a_lamp_reaches_what_nothing_hides_from_it() {
    // Every pixel is compared with a ray to the lamp, away from the borders of shadows and bodies.
    let mut plan = built_in("drill-centre").unwrap();
    plan.geometry.seabed.texture = Texture::Plain;
    plan.geometry.materials.iter_mut().for_each(|material| material.texture = Texture::Plain);
    let scene = scene(&plan);
    let mut all_dark = 0;
    const SCALE: f64 = 0.5;
    let (width, height) = (512, 384);
    for (object, tilt, lamp) in [
        (2, 0.3, Lamp { at: [-1.6, -0.1, 0.3], aim: [0.1, 0.0, 3.0], ..Lamp::default() }),
        (0, 0.0, Lamp { at: [1.9, 0.4, 0.3], aim: [0.1, 0.0, 3.0], ..Lamp::default() }),
        (4, -0.2, Lamp { at: [0.1, -1.8, 0.2], aim: [0.0, 0.3, 3.0], ..Lamp::default() }),
    ] {
        let shot = shot(above(scene.objects[object].centroid(), 3.0, tilt));
        let fractions = fractions(&scene, &lamp, SCALE, &shot);
        let camera_model = studio(SCALE, Water::default(), Imager::default(), Port::default(), &[]).left;
        let from = (shot.world_from_left * seafix_geometry::Point::from(Vector3::from(lamp.at))).coords;
        let met: Vec<Option<Met>> = (0..width * height)
            .map(|k| {
                let pixel = seafix_geometry::Pixel { u: f64::from(k % width), v: f64::from(k / width) };
                let ray = camera_model.lens.ray(&pixel)?;
                let camera_model = (shot.world_from_left * seafix_geometry::Point::from(ray.from)).coords;
                let along = shot.world_from_left.rotation() * ray.along;
                let body = scene.bvh.hit(&scene.mesh.triangles, &camera_model, &along, f64::INFINITY);
                let t = scene.hit(&camera_model, &along)?;
                let level = -Vector3::z();
                let normal = body.filter(|h| h.t <= t).map_or(level, |h| scene.mesh.triangles[h.triangle].normal());
                let place = camera_model + along * (t - 1e-4);
                // The seabed casts no shadow.
                let free = scene.bvh.hit(&scene.mesh.triangles, &place, &(from - place), 1.0).is_none();
                Some((free, place, normal))
            })
            .collect();
        let (mut lit, mut dark, mut wrong) = (0, 0, Vec::new());
        for (v, u) in (6..height - 6).flat_map(|v| (6..width - 6).map(move |u| (v, u))) {
            let k = (v * width + u) as usize;
            let Some((free, place, normal)) = met[k] else { continue };
            let around = (-4..=4).flat_map(|dv: i32| (-4..=4).map(move |du: i32| (dv, du)));
            // Map pixels of an adjacent surface count as nearer along the seam of two surfaces, which is two pixels
            // wide.
            let even = around
                .map(|(dv, du)| met[((v + dv) * width + u + du) as usize])
                .all(|near| near.is_some_and(|(other, at, _)| other == free && (at - place).dot(&normal).abs() < 0.02));
            if !even || fractions[k].is_nan() {
                continue;
            }
            if free {
                lit += 1
            } else {
                dark += 1
            }
            if (fractions[k] - f32::from(u8::from(free))).abs() > 0.02 {
                wrong.push((u, v, free, fractions[k]));
            }
        }
        println!("object {object}: {lit} lit, {dark} dark, {} wrong, {:?}", wrong.len(), &wrong[..wrong.len().min(8)]);
        assert!(lit > 10_000 && wrong.len() * 1000 <= lit + dark, "{} of {lit} + {dark}", wrong.len());
        all_dark += dark;
    }
    assert!(all_dark > 1000, "{all_dark}");
}

#[test]
fn a_shadow_ends_where_the_line_over_the_edge_meets_the_seabed() {
    // A plate over a flat seabed, rotated against the map's rows and lit from the side; a map pixel is 7 mm wide on the
    // seabed.
    // Regression: lifting places by 6 mm along their normal fails this test, with a mean of 2.2 mm.
    let mut errors = Vec::new();
    for degrees in [0.0, 4.0, 11.0, 23.0, 37.0, 58.0] {
        let mut plan = plain_plan();
        plan.geometry.materials.push(crate::scene::MaterialPlan {
            name: "it".into(),
            albedo: 0.5,
            texture: Texture::Plain,
        });
        plan.geometry.objects.push(ObjectGeometry {
            id: "a".into(),
            boxes: vec![BoxBody {
                centre: [0.2, 0.1, -0.6],
                size: [0.5, 0.4, 0.02],
                turn_deg: [0.0, 0.0, degrees],
                material: "it".into(),
            }],
            ..Default::default()
        });
        let scene = scene(&plan);
        let shot = shot(above(Vector3::new(0.0, 0.0, 40.0), 3.0, 0.0));
        let lamp = Lamp { at: [-1.2, 0.3, 0.0], aim: [0.3, 0.0, 3.0], ..Lamp::default() };
        let fractions = fractions(&scene, &lamp, 1.0, &shot);
        let into = shot.world_from_left.inverse();
        let lens = studio(1.0, Water::default(), Imager::default(), Port::default(), &[]).left.lens;
        let from = (shot.world_from_left * seafix_geometry::Point::from(Vector3::from(lamp.at))).coords;
        // The shadow edges of the upper and of the lower face; those that the lamp sees past belong to the outline.
        let corner = |x: f64, y: f64, z: f64| {
            let (sine, cosine) = libm::sincos(f64::to_radians(degrees));
            let (x, y) = (0.25 * x, 0.2 * y);
            let local = Vector3::new(0.2 + cosine * x - sine * y, 0.1 + sine * x + cosine * y, -0.6 + 0.01 * z);
            let at = (scene.world_from_object[0] * seafix_geometry::Point::from(local)).coords;
            let t = (40.0 - from.z) / (at.z - from.z);
            from + (at - from) * t
        };
        let all: Vec<Vector3<f64>> = [-1.0, 1.0]
            .into_iter()
            .flat_map(|z| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| corner(x, y, z)))
            .collect();
        let pixel = |p: &Vector3<f64>| lens.project(&(into * seafix_geometry::Point::from(*p)).coords).unwrap();
        let grey = |u: f64, v: f64| {
            let (i, j) = (u.floor(), v.floor());
            let at = |i: f64, j: f64| f64::from(fractions[j as usize * 1024 + i as usize]);
            let (fu, fv) = (u - i, v - j);
            (at(i, j) * (1.0 - fu) + at(i + 1.0, j) * fu) * (1.0 - fv)
                + (at(i, j + 1.0) * (1.0 - fu) + at(i + 1.0, j + 1.0) * fu) * fv
        };
        for a in 0..8 {
            for b in a + 1..8 {
                // A side of the outline has all other corners on one side.
                let (p, q) = (all[a], all[b]);
                let along = (q - p).normalize();
                let side = |c: &Vector3<f64>| along.x * (c.y - p.y) - along.y * (c.x - p.x);
                let (low, high) = all.iter().map(side).fold((0.0_f64, 0.0_f64), |(l, h), s| (l.min(s), h.max(s)));
                if low < -1e-9 && high > 1e-9 || (q - p).norm() < 0.2 {
                    continue;
                }
                let out = Vector3::new(along.y, -along.x, 0.0) * if high > 1e-9 { 1.0 } else { -1.0 };
                for k in 4..=36 {
                    let here = p + (q - p) * (f64::from(k) / 40.0);
                    let n = 400;
                    let reach = 0.06;
                    let places =
                        (0..n).map(|i| here + out * (reach * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0)));
                    let mut inner = true;
                    let lit: f64 = places
                        .map(|place| {
                            let at = pixel(&place);
                            let seen = at.u > 2.0 && at.v > 2.0 && at.u < 1020.0 && at.v < 764.0;
                            inner &= seen;
                            if seen { grey(at.u, at.v) } else { 0.0 }
                        })
                        .sum::<f64>()
                        / f64::from(n);
                    // Places that the plate itself hides from the camera are skipped.
                    if inner && lit.is_finite() && (0.2..0.8).contains(&lit) {
                        errors.push(reach * (1.0 - 2.0 * lit));
                    }
                }
            }
        }
    }
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / n;
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    println!("{n} places, mean {:.2} mm, RMS {:.2} mm", mean * 1e3, rms * 1e3);
    assert!(n > 300.0 && mean.abs() < 2e-3 && rms < 4e-3, "{n}: {mean} {rms}");
}
