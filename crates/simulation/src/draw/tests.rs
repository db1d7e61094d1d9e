use nalgebra::{UnitQuaternion, Vector3, Vector6};
use seafix_geometry::{Camera, Pinhole, RightCamera, Transform, World};
use seafix_vision::{Image, Threads, Workspace};

use super::*;
use crate::{
    field::{Changes, Field, SitePlan, built_in},
    optics::{Lamp, Lens, Port, PortKind, Water},
    survey::SurveyErrors,
};

pub(super) fn field(plan: &SitePlan) -> Field {
    Field::new(plan, &Changes::default(), SurveyErrors { model: 0.0, survey: 0.0 }, 3)
}

pub(super) fn studio(
    field: &Field,
    scale: f64,
    water: Water,
    imager: Imager,
    port: Port,
    distortion: &[f64],
) -> Studio {
    let size = [1024.0, 768.0].map(|n| (n * scale) as u32);
    let principal = size.map(|n| 0.5 * (f64::from(n) - 1.0));
    let camera = Pinhole::new(size, [500.0 * scale; 2], principal, distortion).unwrap();
    let baseline = 0.25;
    let lamps = Lamp::pair(baseline);
    let there = lamps
        .iter()
        .map(|lamp| {
            let shift = |p: [f64; 3]| [p[0] - baseline, p[1], p[2]];
            Lamp { at: shift(lamp.at), aim: shift(lamp.aim), ..lamp.clone() }
        })
        .collect();
    let left = Eye::new(Lens::new(camera, port.clone()), lamps, &water);
    let right = Eye::new(Lens::new(camera, port), there, &water);
    let looks = Looks::new(field.mesh.skins.iter().map(|s| s.texture), 5);
    Studio::new(left, right, water, imager, looks, true, 1, 2)
}

/// The camera `height` above a place, looking down with the top of the image to the north, tilted by `tilt`.
pub(super) fn above(place: Vector3<f64>, height: f64, tilt: f64) -> Transform<World, Camera> {
    let down = seafix_geometry::so3::exp(&(Vector3::z() * std::f64::consts::FRAC_PI_2))
        * seafix_geometry::so3::exp(&(Vector3::x() * tilt));
    Transform::new(down, place - down * Vector3::new(0.125, 0.0, height))
}

pub(super) fn shot(pose: Transform<World, Camera>) -> Shot {
    let left_from_right =
        Transform::<Camera, RightCamera>::new(UnitQuaternion::identity(), Vector3::new(0.25, 0.0, 0.0));
    Shot {
        world_from_left: pose,
        world_from_right: pose * left_from_right,
        motion: [Vector6::zeros(); 2],
        drift: Vector3::zeros(),
        seeds: [11, 12],
    }
}

fn save(name: &str, image: &Image) {
    let mut bytes = format!("P5\n{} {}\n255\n", image.width(), image.height()).into_bytes();
    bytes.extend(image.to_u8());
    std::fs::write(format!("/tmp/dive/{name}.pgm"), bytes).unwrap();
}

#[test]
#[ignore = "a look at the images and the time they take"]
fn gallery() {
    let field = field(&built_in("drill-centre").unwrap());
    for (name, c, object, height, tilt) in
        [("a", 0.15, 2, 3.0, 0.35), ("b", 0.4, 0, 3.0, 0.0), ("c", 0.05, 5, 4.5, 0.6)]
    {
        let water = Water { attenuation: c, ..Water::default() };
        let begin = std::time::Instant::now();
        let studio = studio(&field, 1.0, water, Imager::default(), Port::default(), &[]);
        println!("setup {:?}", begin.elapsed());
        let shot = shot(above(field.objects[object].centroid(), height, tilt));
        let mut work = Workspace::new(Threads::Pool);
        for _ in 0..4 {
            let begin = std::time::Instant::now();
            let (left, right, exposure) = studio.render(&field, &shot, &mut work);
            println!("{name}: {:?} {exposure:?}", begin.elapsed());
            save(&format!("{name}-left"), &left);
            save(&format!("{name}-right"), &right);
        }
    }
}

/// A studio of a quarter of the size: quick, and still an image.
fn small(field: &Field, water: Water) -> Studio {
    studio(field, 0.25, water, Imager::default(), Port::default(), &[])
}

#[test]
fn the_rasteriser_sees_what_a_ray_meets() {
    // Straight, with distortion, and through ports: depth against the bounding-volume hierarchy.
    let field = field(&built_in("drill-centre").unwrap());
    let flat = Port { kind: PortKind::Flat, ..Port::default() };
    let dome = Port { kind: PortKind::Dome, offset: [0.002, 0.001, 0.004], ..Port::default() };
    for (port, distortion) in
        [(Port::default(), &[][..]), (Port::default(), &[-0.12, 0.02, 1e-3, -5e-4]), (flat, &[]), (dome, &[])]
    {
        let kind = port.kind;
        let studio = studio(&field, 0.25, Water::default(), Imager::default(), port, distortion);
        let pose = above(field.objects[2].centroid(), 3.0, 0.3);
        let mut work = Workspace::default();
        studio.left_radiance(&field, &shot(pose), &mut work);
        let depths = Studio::last_depths(&mut work);
        let (mut same, mut all) = (0, 0);
        for row in (0..192).step_by(2) {
            for column in (0..256).step_by(2) {
                let pixel = seafix_geometry::Pixel { u: f64::from(column), v: f64::from(row) };
                let ray = studio.left.lens.ray(&pixel).unwrap();
                let from = pose * seafix_geometry::Point::from(ray.from);
                let Some(t) = field.hit(&from.coords, &(pose.rotation() * ray.along)) else { continue };
                let z = ray.from.z + t;
                all += 1;
                same += usize::from((f64::from(depths[(row * 256 + column) as usize]) / z - 1.0).abs() < 1e-5);
            }
        }
        assert!(f64::from(same as u32) >= 0.999 * f64::from(all), "{kind:?}: {same} of {all}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let field = field(&built_in("drill-centre").unwrap());
    let studio = small(&field, Water { attenuation: 0.4, ..Water::default() });
    let mut shot = shot(above(field.objects[1].centroid(), 2.5, 0.2));
    shot.motion = [Vector6::new(0.01, 0.02, 0.1, 0.4, 0.1, 0.0); 2];
    let alone = studio.render(&field, &shot, &mut Workspace::default());
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut work = Workspace::new(Threads::Pool);
        for _ in 0..2 {
            assert_eq!(pool.install(|| studio.render(&field, &shot, &mut work)), alone);
        }
    }
}

#[test]
fn factors_of_magnitude_zero_are_factors_left_out() {
    let field = field(&built_in("drill-centre").unwrap());
    let pose = above(field.objects[3].centroid(), 3.0, 0.0);
    let quiet = Imager { automatic: false, ..Imager::default() };
    let image = |water: Water, imager: Imager| {
        let studio = studio(&field, 0.125, water, imager, Port::default(), &[]);
        studio.render(&field, &shot(pose), &mut Workspace::default()).0
    };
    let clear = Water { attenuation: 0.0, snow: 0.0, small_angle: 0.0, albedo: 0.0, ..Water::default() };
    let base = image(clear.clone(), quiet.clone());
    // Without attenuation nothing else of the water shows.
    assert_eq!(image(Water { attenuation: 0.0, snow: 0.0, ..Water::default() }, quiet.clone()), base);
    assert_eq!(image(Water { level: "none".into(), snow: 0.0, ..Water::default() }, quiet.clone()), base);
    // A rolling shutter and an exposure show nothing while nothing moves.
    assert_eq!(image(clear.clone(), Imager { readout_ms: 20.0, ..quiet.clone() }), base);
    assert_ne!(image(Water { attenuation: 0.1, snow: 0.0, ..Water::default() }, quiet), base);
}

#[test]
fn a_refused_port_of_water_is_the_pinhole() {
    let field = field(&built_in("drill-centre").unwrap());
    let pose = above(field.objects[3].centroid(), 3.0, 0.1);
    let radiance = |port: Port| {
        let studio = studio(&field, 0.25, Water::default(), Imager::default(), port, &[]);
        studio.left_radiance(&field, &shot(pose), &mut Workspace::default())
    };
    let ideal = radiance(Port::default());
    let same = |other: Vec<f32>| {
        let far = ideal.iter().zip(&other).filter(|(a, b)| (*a - *b).abs() > 0.02 * a.max(1e-3)).count();
        assert!(far * 200 < ideal.len(), "{far} of {} pixels differ", ideal.len());
    };
    // The rays begin at the port instead of in the pupil: a few centimetres less of water.
    same(radiance(Port {
        kind: PortKind::Flat,
        glass: 1.0,
        water: 1.0,
        thickness: 0.0,
        distance: 0.0,
        ..Port::default()
    }));
    same(radiance(Port { kind: PortKind::Dome, radius: 0.01, thickness: 0.0, ..Port::default() }));
}
