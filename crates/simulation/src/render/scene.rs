//! Rendering of one stereo pair: shadows, both views, exposure, noise.

use std::sync::Arc;

use nalgebra::{Vector3, Vector6};
use seafix_geometry::{Camera, Frame, RightCamera, Transform, World};
use seafix_vision::{Image, Threads, Workspace};

use super::{
    blur::{BlurScratch, Smear, gaussian},
    camera::{RenderCamera, Rolling},
    sensor::{Exposure, Imager, Pattern},
    shadow::{ShadowMap, ShadowView, shadow_camera},
    snow::{Flake, fall, flakes},
    texture::SurfaceTextures,
    view::{Lit, View, ViewScratch},
};
use crate::{
    optics::{Lamp, Water},
    scene::Scene,
};

/// Maximum distance at which bodies are drawn (m).
const FAR: f64 = 25.0;
/// Maximum number of lamps that cast shadows.
const MAX_SHADOWS: usize = 4;

/// The constant part of all frames.
#[derive(Debug)]
pub(crate) struct Studio {
    pub(crate) left: RenderCamera,
    pub(crate) right: RenderCamera,
    pub(crate) water: Water,
    pub(crate) imager: Imager,
    pub(crate) patterns: [Pattern; 2],
    pub(crate) textures: Arc<SurfaceTextures>,
    pub(crate) shadows: bool,
    pub(crate) snow_seed: u32,
    lamp_view: RenderCamera,
}

/// Poses, motion and seeds of one stereo pair.
#[derive(Debug, Clone)]
pub(crate) struct Shot {
    pub(crate) world_from_left: Transform<World, Camera>,
    pub(crate) world_from_right: Transform<World, RightCamera>,
    /// Twist of each camera in its own frame: rotation (rad/s) and translation (m/s).
    pub(crate) motion: [Vector6<f64>; 2],
    /// Displacement of floating particles by the water (m).
    pub(crate) drift: Vector3<f64>,
    /// Seeds of the noise in the left and the right image.
    pub(crate) seeds: [u32; 2],
}

#[derive(Debug, Default)]
struct Scratch {
    sides: [Side; 2],
    bodies: Vec<[Vector3<f64>; 3]>,
    maps: Vec<ShadowMap>,
}

/// Buffers of one camera.
#[derive(Debug, Default)]
struct Side {
    view: ViewScratch,
    image: Vec<f32>,
    depths: Vec<f32>,
    ranges: Vec<f32>,
    flakes: Vec<Flake>,
    scattered: Vec<f32>,
    blur: BlurScratch,
}

impl Studio {
    #[expect(clippy::too_many_arguments, reason = "each is a constant part of the studio")]
    pub(crate) fn new(
        left: RenderCamera,
        right: RenderCamera,
        water: Water,
        imager: Imager,
        textures: Arc<SurfaceTextures>,
        shadows: bool,
        device_seed: u32,
        snow_seed: u32,
    ) -> Self {
        let pattern = |camera_model: &RenderCamera, salt: u32| {
            imager.pattern(camera_model.lens.camera().size(), device_seed ^ salt)
        };
        let patterns = [pattern(&left, 0x1EF7), pattern(&right, 0x0417)];
        let lamp_view = shadow_camera();
        Self { left, right, water, imager, patterns, textures, shadows, snow_seed, lamp_view }
    }

    /// Renders the left and the right image, with their exposure.
    pub(crate) fn render(&self, scene: &Scene, shot: &Shot, work: &mut Workspace) -> (Image, Image, Exposure) {
        let threads = work.threads();
        let scratch: &mut Scratch = work.get();
        let lamps = &self.left.lamps[..self.left.lamps.len().min(if self.shadows { MAX_SHADOWS } else { 0 })];
        self.draw_shadows(scene, shot, lamps, threads, scratch);
        let Scratch { sides: [left, right], maps, .. } = scratch;
        let maps = &maps[..lamps.len()];
        let left_from_right = shot.world_from_left.inverse() * shot.world_from_right;
        threads.join(
            || {
                self.radiance(
                    scene,
                    &self.left,
                    &shot.world_from_left,
                    0,
                    shot,
                    (lamps, maps, Transform::identity()),
                    threads,
                    left,
                )
            },
            || {
                let back = left_from_right.relabel();
                self.radiance(scene, &self.right, &shot.world_from_right, 1, shot, (lamps, maps, back), threads, right);
            },
        );
        let exposure = self.imager.exposed([&left.image, &right.image]);
        let (a, b) = threads.join(
            || self.image(&self.left, 0, shot, exposure, threads, left),
            || self.image(&self.right, 1, shot, exposure, threads, right),
        );
        (a, b, exposure)
    }

    /// Renders the depth maps of the lamps, which move with the left camera.
    fn draw_shadows(&self, scene: &Scene, shot: &Shot, lamps: &[Lamp], threads: Threads, scratch: &mut Scratch) {
        if lamps.is_empty() {
            return;
        }
        let into = shot.world_from_left.inverse();
        let (turn, step) = (into.rotation_matrix(), into.translation());
        scratch.bodies.clear();
        for triangle in &scene.mesh.triangles {
            if triangle.layer == 0 && (triangle.at[0] - shot.world_from_left.translation()).norm() < 10.0 {
                scratch.bodies.push(triangle.at.map(|p| turn * p + step));
            }
        }
        scratch.maps.resize_with(lamps.len().max(scratch.maps.len()), ShadowMap::default);
        let bodies = &scratch.bodies;
        threads.pieces(&mut scratch.maps[..lamps.len()], 1, &mut Vec::<()>::new(), |index, map, ()| {
            map[0].draw(bodies, &lamps[index], &self.lamp_view);
        });
    }

    #[expect(clippy::too_many_arguments, reason = "one side of a pair")]
    fn radiance<F: Frame>(
        &self,
        scene: &Scene,
        camera_model: &RenderCamera,
        world_from_view: &Transform<World, F>,
        side: usize,
        shot: &Shot,
        (lamps, maps, left_from_view): (&[Lamp], &[ShadowMap], Transform<Camera, Camera>),
        threads: Threads,
        scratch: &mut Side,
    ) {
        let motion = shot.motion[side];
        let readout = self.imager.readout_ms * 1e-3;
        let rows = f64::from(camera_model.lens.camera().size()[1]);
        let rolling = (readout > 0.0 && motion != Vector6::zeros()).then(|| Rolling { step: motion * readout, rows });
        let views: Vec<ShadowView> = lamps.iter().map(|lamp| ShadowView::new(lamp, &left_from_view)).collect();
        let lit = Lit { water: &self.water, textures: &self.textures, maps, views: &views };
        let view = View { scene, camera_model, rolling: rolling.as_ref(), far: FAR };
        view.draw(world_from_view, &lit, threads, &mut scratch.view);

        // Light scattered at small angles reaches the camera blurred.
        let [width, _] = camera_model.lens.camera().size().map(|n| n as usize);
        let Side { view: ViewScratch { pixels, .. }, image, depths, ranges, scattered, blur, .. } = scratch;
        let plane = |list: &mut Vec<f32>, k: usize| {
            list.clear();
            list.extend(pixels.iter().map(|p| p[k]));
        };
        plane(image, 0);
        plane(depths, 2);
        plane(ranges, 3);
        let forward = (self.water.small_angle * self.water.b()) as f32;
        if forward > 0.0 && self.water.blur > 0.0 {
            let seen = || ranges.iter().step_by(64).filter(|r| r.is_finite()).map(|r| f64::from(*r));
            let mean = seen().sum::<f64>() / (seen().count().max(1)) as f64;
            super::light::through(ranges, -forward, scattered);
            for (s, direct) in scattered.iter_mut().zip(image.iter()) {
                *s = (*s - 1.0).min(50.0) * direct;
            }
            gaussian(scattered, width, self.water.blur * self.water.c() * mean, threads, blur);
            for (direct, s) in image.iter_mut().zip(scattered.iter()) {
                *direct += s;
            }
        }
        for (value, pixel) in image.iter_mut().zip(pixels.iter()) {
            *value += pixel[1];
        }
        flakes(&self.water, camera_model, world_from_view, &shot.drift, self.snow_seed, &mut scratch.flakes);
        fall(&scratch.flakes, width, &mut scratch.image, &scratch.ranges);
    }

    /// Applies motion blur, lens blur and the sensor.
    fn image(
        &self,
        camera_model: &RenderCamera,
        side: usize,
        shot: &Shot,
        exposure: Exposure,
        threads: Threads,
        scratch: &mut Side,
    ) -> Image {
        let camera = camera_model.lens.camera();
        let [width, height] = camera.size().map(|n| n as usize);
        let step = shot.motion[side] * (exposure.ms * 1e-3);
        let single = |k: usize| std::array::from_fn(|i| step[k + i] as f32);
        let smear = Smear {
            turn: single(0),
            step: single(3),
            focal: camera.focal().map(|x| x as f32),
            principal: camera.principal().map(|x| x as f32),
        };
        let Side { image, depths, blur, .. } = scratch;
        smear.apply(image, depths, width, threads, blur);
        gaussian(image, width, self.imager.blur, threads, blur);
        self.imager.develop(image, exposure, &self.patterns[side], shot.seeds[side], threads);
        Image::new(width, height, image.clone()).expect("every pixel was drawn")
    }

    /// The depth Z (m) of every pixel of the last left image.
    #[cfg(test)]
    pub(crate) fn last_depths(work: &mut Workspace) -> Vec<f32> {
        work.get::<Scratch>().sides[0].depths.clone()
    }

    /// The radiance of every pixel of the last left image, without lens and sensor.
    #[cfg(test)]
    pub(crate) fn left_radiance(&self, scene: &Scene, shot: &Shot, work: &mut Workspace) -> Vec<f32> {
        let threads = work.threads();
        let scratch: &mut Scratch = work.get();
        let lamps = &self.left.lamps[..if self.shadows { self.left.lamps.len() } else { 0 }];
        self.draw_shadows(scene, shot, lamps, threads, scratch);
        let Scratch { sides: [left, _], maps, .. } = scratch;
        let maps = (lamps, &maps[..lamps.len()], Transform::identity());
        self.radiance(scene, &self.left, &shot.world_from_left, 0, shot, maps, threads, left);
        left.image.clone()
    }
}
