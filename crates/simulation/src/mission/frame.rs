//! One instant of a mission: the data for a method, and apart from them the truth.

use nalgebra::{Matrix6, Vector6};
use seafix_geometry::{
    Camera, Covariance6, MeasuredPoint, Pixel, Point, StereoPixels, Transform, UncertainPixels, UncertainPoint, World,
    so3,
};
use seafix_vision::{Image, Threads};

use super::{capture::CaptureState, plan::PlannedMission, settings::PriorKind};
use crate::{
    dive::VisiblePoint,
    render::{Exposure, Rolling, Shot},
    scene::ScenePoint,
    sensors::SensorPrior,
    stream::{Purpose, Stream},
};

/// One instant of a mission.
#[derive(Debug, Clone)]
pub struct Instant<'a> {
    pub(super) mission: &'a PlannedMission,
    /// Frame number in the mission.
    pub index: usize,
    /// Time of the exposure (ns since 1970).
    pub stamp_ns: u64,
    /// The prior pose and its covariance; `None` before the first acoustic position.
    pub prior: Option<(Transform<World, Camera>, Covariance6<World, Camera>)>,
    pub(super) time: f64,
    truth: InstantTruth,
}

/// The truth of an instant, which no method receives.
#[derive(Debug, Clone, PartialEq)]
pub struct InstantTruth {
    /// The left camera's pose at the middle of the exposure.
    pub world_from_camera: Transform<World, Camera>,
    /// The feature points of all objects that are inside both images and not occluded.
    pub visible: Vec<VisiblePoint>,
}

impl PlannedMission {
    /// Frame number `index`, a function of settings, seed, dive and index alone.
    pub fn instant(&self, index: usize) -> Instant<'_> {
        Instant::new(self, index, self.times[index])
    }
}

impl<'a> Instant<'a> {
    pub(super) fn new(mission: &'a PlannedMission, index: usize, time: f64) -> Self {
        let world_from_camera = mission.camera(time);
        let prior = match mission.settings.prior {
            PriorKind::Sampled => Some(prior_pose(mission, index, &world_from_camera)),
            PriorKind::Sensors => mission.integrated(time).map(|prior_pose| from_sensors(mission, &prior_pose)),
        };
        let stamp_ns = mission.stamp(time);
        let empty = InstantTruth { world_from_camera, visible: Vec::new() };
        let mut instant = Self { mission, index, stamp_ns, prior, time, truth: empty };
        instant.truth.visible = instant.visible();
        instant
    }

    /// The truth, for evaluation only.
    pub fn truth(&self) -> &InstantTruth {
        &self.truth
    }

    /// Renders the left and the right image, a function of the instant alone; the bytes do not depend on `threads`.
    pub fn render(&self, threads: Threads) -> (Image, Image, Exposure) {
        match self.capture() {
            CaptureState::Current => self.sound(threads),
            CaptureState::Earlier(then) => then.sound(threads),
            CaptureState::Swapped => {
                let (left, right, exposure) = self.sound(threads);
                (right, left, exposure)
            }
            CaptureState::Dark => self.without_light(&mut || 0.0),
            CaptureState::Garbage(mut stream) => self.without_light(&mut || (stream.bits() >> 56) as f32),
        }
    }

    /// Renders the images of intact cameras.
    fn sound(&self, threads: Threads) -> (Image, Image, Exposure) {
        let shot = self.shot();
        self.mission.with_memory(threads, |work| self.mission.studio.render(&self.mission.scene, &shot, work))
    }

    /// Builds two images from generated grey levels, without a scene.
    fn without_light(&self, level: &mut dyn FnMut() -> f32) -> (Image, Image, Exposure) {
        let [width, height] = self.mission.cameras.lens.camera().size().map(|n| n as usize);
        let mut image = || {
            let pixels = (0..width * height).map(|_| level()).collect();
            Image::new(width, height, pixels).expect("width × height pixels were generated")
        };
        let left = image();
        (left, image(), Exposure { ms: 0.0, gain: 0.0 })
    }

    /// Time of the right exposure (s), which differs from the left by the synchronisation error.
    fn right_time(&self) -> f64 {
        self.time + self.mission.settings.imager.sync_ms * 1e-3
    }

    fn shot(&self) -> Shot {
        let mission = self.mission;
        let seed = |purpose| mission.stream(self.index, purpose).bits() as u32;
        let right_from_left = mission.cameras.right_from_left;
        let right = self.right_time();
        Shot {
            world_from_left: self.truth.world_from_camera,
            world_from_right: mission.camera(right) * right_from_left.inverse(),
            motion: [mission.motion(self.time), right_from_left.adjoint() * mission.motion(right)],
            drift: mission.drift(self.time),
            seeds: [seed(Purpose::LeftImage), seed(Purpose::RightImage)],
        }
    }

    /// The pixels of a feature point that both cameras see.
    fn see(&self, shot: &Shot, point: &ScenePoint) -> Option<StereoPixels> {
        let pixels = self.project_visible(shot, &Point::from(point.at))?;
        let scene = &self.mission.scene;
        let seen = [shot.world_from_left.translation(), shot.world_from_right.translation()];
        seen.iter().all(|from| scene.sees(from, point)).then_some(pixels)
    }

    /// The pixels of a place inside both images, occluded or not.
    fn project_visible(&self, shot: &Shot, place: &Point<World>) -> Option<StereoPixels> {
        let studio = &self.mission.studio;
        let camera = self.mission.cameras.lens.camera();
        let readout = self.mission.settings.imager.readout_ms * 1e-3;
        let rows = f64::from(camera.size()[1]);
        let rolling = |motion: Vector6<f64>| (readout > 0.0).then(|| Rolling { step: motion * readout, rows });
        let left = (shot.world_from_left.inverse() * *place).coords;
        let left = studio.left.project(&left, rolling(shot.motion[0]).as_ref())?;
        let right = (shot.world_from_right.inverse() * *place).coords;
        let right = studio.right.project(&right, rolling(shot.motion[1]).as_ref())?;
        (camera.contains(&left, 0.0) && camera.contains(&right, 0.0)).then_some(StereoPixels { left, right })
    }

    fn visible(&self) -> Vec<VisiblePoint> {
        let shot = self.shot();
        let mut all = Vec::new();
        for (object, known) in self.mission.scene.objects.iter().enumerate() {
            for (point, place) in known.points.iter().enumerate() {
                all.extend(self.see(&shot, place).map(|pixels| VisiblePoint { object, point, pixels }));
            }
        }
        all
    }

    /// Measured points of the same view, without rendering.
    ///
    /// Visible feature points carry the noise of the settings. Clutter points are added, all are triangulated with the
    /// nominal rig, and their order is random.
    pub fn points(&self) -> Vec<MeasuredPoint> {
        match self.capture() {
            CaptureState::Current => self.sound_points(),
            CaptureState::Earlier(then) => then.sound_points(),
            // Swapped images give negative disparities, which no point before the cameras has.
            CaptureState::Dark | CaptureState::Swapped => Vec::new(),
            CaptureState::Garbage(stream) => self.any_points(stream),
        }
    }

    /// Points from random pixel pairs; their number equals the clutter's.
    fn any_points(&self, mut stream: Stream) -> Vec<MeasuredPoint> {
        let noise = &self.mission.settings.points;
        let [width, height] = self.mission.cameras.lens.camera().size().map(|n| f64::from(n - 1));
        let mut pair = || {
            let (left, v) = (stream.between(0.0, width), stream.between(0.0, height));
            let right = Pixel { u: stream.between(0.0, left), v };
            StereoPixels { left: Pixel { u: left, v }, right }
        };
        let pairs: Vec<_> = (0..noise.clutter).map(|_| pair()).collect();
        pairs.into_iter().filter_map(|pixels| self.triangulated(pixels)).collect()
    }

    /// The triangulation of a pixel pair by the nominal rig.
    fn triangulated(&self, seen: StereoPixels) -> Option<MeasuredPoint> {
        // A covariance of zero would claim an exact measurement.
        let pixels = UncertainPixels::independent(seen, self.mission.settings.points.sigma_px.max(1e-3));
        let found = self.mission.cameras.nominal.triangulate(&pixels).ok()?;
        let position = UncertainPoint { at: found.point, covariance: found.covariance };
        Some(MeasuredPoint { position, pixels: Some(pixels) })
    }

    /// Measures the points of intact cameras.
    fn sound_points(&self) -> Vec<MeasuredPoint> {
        let mission = self.mission;
        let noise = &mission.settings.points;
        let mut stream = mission.stream(self.index, Purpose::Points);
        let shot = self.shot();
        let mut pixels: Vec<StereoPixels> = Vec::new();
        for seen in &self.truth.visible {
            if stream.unit() < noise.found {
                pixels.push(seen.pixels);
            }
        }
        let [width, height] = mission.cameras.lens.camera().size().map(|n| f64::from(n - 1));
        for _ in 0..noise.clutter {
            let pixel = Pixel { u: stream.between(0.0, width), v: stream.between(0.0, height) };
            let Some(ray) = mission.cameras.lens.ray(&pixel) else { continue };
            let from = (shot.world_from_left * Point::<Camera>::from(ray.from)).coords;
            let Some(place) = mission.scene.seen(&from, &(shot.world_from_left.rotation() * ray.along)) else {
                continue;
            };
            if mission.scene.clear(&shot.world_from_right.translation(), &place.coords) {
                pixels.extend(self.project_visible(&shot, &place));
            }
        }
        for k in (1..pixels.len()).rev() {
            pixels.swap(k, stream.below(k + 1));
        }
        let measure = |exact: &StereoPixels| {
            let mut disturbed = |p: &Pixel| Pixel {
                u: p.u + noise.sigma_px * stream.normal(),
                v: p.v + noise.sigma_px * stream.normal(),
            };
            let seen = StereoPixels { left: disturbed(&exact.left), right: disturbed(&exact.right) };
            self.triangulated(seen)
        };
        pixels.iter().filter_map(measure).collect()
    }
}

/// A sampled prior pose: T_true = T_prior · Exp(ξ), with the attitude error about the camera's axes and the position
/// error along the world's.
fn prior_pose(
    mission: &PlannedMission,
    index: usize,
    truth: &Transform<World, Camera>,
) -> (Transform<World, Camera>, Covariance6<World, Camera>) {
    let settings = &mission.settings;
    let mut stream = mission.stream(index, Purpose::Prior);
    let (position, attitude) = (settings.prior_position, settings.prior_attitude_deg.to_radians());
    let turn = so3::exp(&-stream.normal3(attitude));
    let step = stream.normal3(position);
    let world_from_camera = Transform::new(truth.rotation() * turn, truth.translation() - step);
    // A covariance of zero would claim an exact pose.
    (world_from_camera, Covariance6::isotropic(attitude.max(1e-6), position.max(1e-6)))
}

/// The camera's prior pose from the vehicle's.
fn from_sensors(
    mission: &PlannedMission,
    prior_pose: &SensorPrior,
) -> (Transform<World, Camera>, Covariance6<World, Camera>) {
    let world_from_camera = prior_pose.world_from_body * mission.body_from_camera;
    // The translation part ρ of the covariance is expressed in the camera's frame.
    let turn = world_from_camera.rotation_matrix();
    let mut covariance = Matrix6::from_diagonal_element(prior_pose.attitude * prior_pose.attitude);
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn.transpose() * prior_pose.position * turn));
    (world_from_camera, Covariance6::new(covariance))
}
