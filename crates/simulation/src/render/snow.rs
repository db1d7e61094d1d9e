//! Marine snow: persistent particles in the water, common to both cameras.

use nalgebra::Vector3;
use seafix_geometry::{Frame, Transform, World};

use super::{camera::RenderCamera, light::Beam, math::mix};
use crate::optics::Water;

/// Side of a cell of space (m).
const CELL: f64 = 0.4;
/// Maximum distance of visible particles (m); backscatter hides farther ones.
const FAR: f64 = 3.5;
/// Minimum distance of a particle (m).
const NEAR: f64 = 0.12;
/// Albedo of a particle.
const ALBEDO: f32 = 0.55;
/// Diameter of the pupil (m).
const APERTURE: f64 = 0.0015;
/// Distance in focus (m).
const FOCUS: f64 = 3.0;

/// A particle before one camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flake {
    pub(super) u: f32,
    pub(super) v: f32,
    /// Standard deviation of its image (px).
    pub(super) sigma: f32,
    /// Area of its image (px²).
    pub(super) area: f32,
    /// Range (m).
    pub(super) range: f32,
    /// Radiance before defocus.
    pub(super) radiance: f32,
}

/// The particles in view of `camera_model`, far ones first. The cells of space drift with the water by `drift` (m).
pub(super) fn flakes<F: Frame>(
    water: &Water,
    camera_model: &RenderCamera,
    world_from_view: &Transform<World, F>,
    drift: &Vector3<f64>,
    seed: u32,
    out: &mut Vec<Flake>,
) {
    out.clear();
    if water.snow <= 0.0 {
        return;
    }
    let beams: Vec<Beam> = camera_model.lamps.iter().map(Beam::of).collect();
    let c = water.c() as f32;
    let view_from_world = world_from_view.inverse();
    let centre = world_from_view.translation() - drift;
    let low = centre.map(|x| ((x - FAR) / CELL).floor() as i64);
    let high = centre.map(|x| ((x + FAR) / CELL).floor() as i64);
    // The number in a cell follows a Poisson distribution, by inversion; each cell has its own stream.
    let mean = water.snow * CELL * CELL * CELL;
    let none = libm::exp(-mean);
    let [width, height] = camera_model.lens.camera().size().map(f64::from);
    let focal = camera_model.lens.camera().focal()[0];
    for i in low.x..=high.x {
        for j in low.y..=high.y {
            for k in low.z..=high.z {
                let corner = Vector3::new(i as f64, j as f64, k as f64) * CELL + drift;
                let middle = view_from_world * seafix_geometry::Point::from(corner + Vector3::repeat(0.5 * CELL));
                let away = middle.coords.xy().norm() - camera_model.reach * middle.coords.z;
                if middle.coords.z < -CELL || away > 0.9 * CELL * (1.0 + camera_model.reach) {
                    continue;
                }
                let key = mix(i as u32, j as u32, mix(k as u32, 0, seed));
                let draw = |n: u32| f64::from(mix(n, 17, key) >> 8) / f64::from(1 << 24);
                let (mut count, mut left, mut term) = (0, draw(0) - none, none);
                while left > 0.0 && count < 1000 {
                    count += 1;
                    term *= mean / f64::from(count);
                    left -= term;
                }
                for n in 0..count {
                    let at = corner + Vector3::new(draw(4 * n + 1), draw(4 * n + 2), draw(4 * n + 3)) * CELL;
                    let p = (view_from_world * seafix_geometry::Point::from(at)).coords;
                    if !(p.z > NEAR && p.z < FAR) {
                        continue;
                    }
                    let Some(pixel) = camera_model.lens.project(&p) else { continue };
                    if !(pixel.u > -20.0 && pixel.v > -20.0 && pixel.u < width + 20.0 && pixel.v < height + 20.0) {
                        continue;
                    }
                    // The radii follow a power law between the two bounds, so small particles prevail.
                    let [small, large] = water.snow_radius;
                    let fraction = draw(4 * n + 4);
                    let radius = small * large / (large - fraction * (large - small));
                    let scale = focal / p.z;
                    let disc = radius * scale;
                    let blur = 0.25 * APERTURE * focal * (1.0 / p.z - 1.0 / FOCUS);
                    let sigma = (0.25 + 0.25 * disc * disc + blur * blur).sqrt();
                    let [x, y, z] = [p.x as f32, p.y as f32, p.z as f32];
                    let light: f32 = beams.iter().map(|beam| beam.flux(x, y, z, c)).sum();
                    out.push(Flake {
                        u: pixel.u as f32,
                        v: pixel.v as f32,
                        sigma: sigma as f32,
                        area: (std::f64::consts::PI * disc * disc) as f32,
                        range: p.norm() as f32,
                        radiance: ALBEDO * std::f32::consts::FRAC_1_PI * light * super::math::exp(-c * p.norm() as f32),
                    });
                }
            }
        }
    }
    out.sort_by(|a, b| b.range.total_cmp(&a.range).then(a.u.total_cmp(&b.u)).then(a.v.total_cmp(&b.v)));
}

/// Blends the particles in front of the image.
pub(super) fn fall(flakes: &[Flake], width: usize, image: &mut [f32], ranges: &[f32]) {
    let height = image.len() / width;
    for flake in flakes {
        let reach = (3.0 * flake.sigma).max(1.0);
        let bound = |x: f32, n: usize| {
            let clamp = |x: f32| x.clamp(0.0, n as f32) as usize;
            clamp((x - reach).ceil())..clamp((x + reach).floor() + 1.0)
        };
        let peak = flake.area / (std::f32::consts::TAU * flake.sigma * flake.sigma);
        let falloff = -0.5 / (flake.sigma * flake.sigma);
        for row in bound(flake.v, height) {
            let dv = row as f32 - flake.v;
            for column in bound(flake.u, width) {
                let place = row * width + column;
                if ranges[place] < flake.range {
                    continue;
                }
                let du = column as f32 - flake.u;
                let cover = (peak * super::math::exp(falloff * (du * du + dv * dv))).min(1.0);
                image[place] += cover * (flake.radiance - image[place]);
            }
        }
    }
}
