//! A mission whose site is built and whose way is gone; frames are made when asked for, in any order.

use std::sync::Mutex;

use nalgebra::{Matrix3, Vector3, Vector6};
use seafix_geometry::{Body, Camera, Object, StereoRig, Transform, World};
use seafix_referencing::Site;
use seafix_vision::{Threads, Workspace};

use super::{Instant, Mission, rig::Cameras};
use crate::{
    optics::Lamp,
    render::{RenderCamera, Studio, SurfaceTextures},
    scene::{Changes, Scene, SitePlan},
    sensors::{Readings, SensorNavigation, SensorPrior},
    stream::{Purpose, Stream},
    survey::SurveyErrors,
    vehicle::{Looker, PlannedRoute, RouteKind, Track},
};

/// The first stamp: some time in 2023, so that stamps look like those of a real log.
const EPOCH_NS: u64 = 1_700_000_000_000_000_000;
/// A vehicle farther off its route than this (m) does not dive it.
const STRAY: f64 = 10.0;
/// Seconds between two looks for collisions.
const LOOK: f64 = 0.1;

/// A planned mission.
#[derive(Debug)]
pub struct PlannedMission {
    pub(super) settings: Mission,
    pub(super) seed: u64,
    pub(super) dive: u64,
    pub(super) scene: Scene,
    pub(super) cameras: Cameras,
    pub(super) studio: Studio,
    pub(super) track: Track,
    /// How far the water has carried what floats in it, at the track's times (m).
    drifts: Vec<Vector3<f64>>,
    pub(super) body_from_camera: Transform<Body, Camera>,
    /// What the sensors say, and where the route leads.
    navigation: SensorNavigation,
    route: PlannedRoute,
    pub(super) times: Vec<f64>,
    /// Memories of rendering, one for each that renders at once.
    memories: Mutex<Vec<Workspace>>,
}

impl PlannedMission {
    pub(super) fn new(settings: &Mission, plan: &SitePlan, seed: u64, dive: u64) -> Result<Self, String> {
        let errors = SurveyErrors { model: settings.model_sigma, survey: settings.survey_sigma };
        let scene = Scene::new(plan, &settings.changes, errors, seed);
        let cameras = settings.rig.build()?;
        let body_from_camera = mount(settings.rig.ahead_deg, settings.rig.at);
        let studio = build_studio(settings, &cameras, seed, dive);
        let looker = Looker {
            rig: &cameras.nominal,
            body_from_camera,
            parts: parts(&cameras, &studio).into_iter().map(|(_, at)| at).collect(),
        };
        // An inspection is planned by the site as it was built, which the changes of the field are not known to.
        let built = (settings.route.kind == RouteKind::Inspection).then(|| {
            let exact = SurveyErrors { model: 0.0, survey: 0.0 };
            Scene::new(plan, &Changes::default(), exact, seed)
        });
        let route = PlannedRoute::new(&settings.route, built.as_ref().unwrap_or(&scene), &looker)?;
        let last = settings.start
            + if settings.rate > 0.0 {
                (settings.frames - 1) as f64 / settings.rate
            } else {
                route.length() / settings.route.speed
            };
        if last > 7200.0 {
            return Err(format!(
                "route.speed = {}; the way takes {last:.0} s, two hours are the most",
                settings.route.speed
            ));
        }
        let n = settings.frames;
        let span = last - settings.start;
        let times = (0..n)
            .map(|k| {
                let even = if n > 1 { span * k as f64 / (n - 1) as f64 } else { 0.0 };
                settings.start + if settings.rate > 0.0 { k as f64 / settings.rate } else { even }
            })
            .collect();
        let place = body_from_camera.translation();
        let (track, drifts) =
            settings.vehicle.travel(&route, last + 0.2, &place, &scene.seabed, &settings.current, (seed, dive));
        let until = last + 0.1;
        let navigation =
            SensorNavigation::new(&settings.sensors, &settings.faults, &track, &scene, until, (seed, dive));
        let planned = Self {
            settings: settings.clone(),
            seed,
            dive,
            scene,
            cameras,
            studio,
            track,
            drifts,
            body_from_camera,
            navigation,
            route,
            times,
            memories: Mutex::new(Vec::new()),
        };
        planned.collision(last)?;
        Ok(planned)
    }

    /// The site as a method knows it.
    pub fn site(&self) -> &Site {
        &self.scene.nominal
    }

    /// The rig that a method is told.
    pub fn rig(&self) -> &StereoRig {
        &self.cameras.nominal
    }

    /// The settings it was planned with.
    pub fn settings(&self) -> &Mission {
        &self.settings
    }

    /// Truth: where each object of the told site is.
    pub fn world_from_object(&self) -> &[Transform<World, Object>] {
        &self.scene.world_from_object
    }

    /// Where the left camera sits in the vehicle.
    pub fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.body_from_camera
    }

    /// What the navigation sensors say during the whole dive, faults included; no truth is in it.
    pub fn readings(&self) -> Readings {
        self.navigation.readings()
    }

    /// The rough pose of the vehicle that the sensors give at a time (s).
    pub(super) fn integrated(&self, time: f64) -> Option<SensorPrior> {
        self.navigation.at(time)
    }

    /// The stamp of a time of the dive (s): ns since 1970.
    pub fn stamp(&self, time: f64) -> u64 {
        EPOCH_NS + (time * 1e9).round() as u64
    }

    /// The places that the route leads through: north, east, height above the mean bed (m), as
    /// [`Route::waypoints`](crate::vehicle::Route::waypoints) has them.
    pub fn waypoints(&self) -> Vec<[f64; 3]> {
        let depth = self.scene.seabed.depth();
        self.route.places().iter().map(|p| [p.x, p.y, depth - p.z]).collect()
    }

    /// Where the feature points truly are, in the order of the site: object, point, place in the world (m).
    ///
    /// The site has them as they were surveyed, in the frames of their objects.
    pub fn true_points(&self) -> impl Iterator<Item = (&str, &str, [f64; 3])> {
        let objects = self.scene.nominal.objects.iter().zip(&self.scene.objects);
        objects.flat_map(|(nominal, object)| {
            let points = nominal.points.iter().zip(&object.points);
            points.map(|(point, truth)| (&nominal.id[..], &point.id[..], truth.at.into()))
        })
    }

    /// How many frames it has.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether it has no frame.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// Frame number `index`, a function of settings, seed, dive and index alone.
    pub fn instant(&self, index: usize) -> Instant<'_> {
        Instant::new(self, index, self.times[index])
    }

    /// The time of a frame (s).
    pub(super) fn time(&self, index: usize) -> f64 {
        self.times[index]
    }

    /// The first frame at or after a time (s).
    pub(super) fn first_after(&self, time: f64) -> usize {
        self.times.partition_point(|t| *t < time).min(self.times.len() - 1)
    }

    pub(super) fn stream(&self, frame: usize, purpose: Purpose) -> Stream {
        Stream::new(self.seed, self.dive, frame as u64, purpose)
    }

    /// The left camera in the world at a time (s).
    pub(super) fn camera(&self, time: f64) -> Transform<World, Camera> {
        self.track.at(time).world_from_body * self.body_from_camera
    }

    /// The motion of the left camera at a time, in its own frame (rad/s, m/s).
    pub(super) fn motion(&self, time: f64) -> Vector6<f64> {
        self.body_from_camera.inverse().adjoint() * self.track.at(time).motion
    }

    /// How far the water has carried what floats in it by a time (s).
    pub(super) fn drift(&self, time: f64) -> Vector3<f64> {
        let index = (time * Track::RATE).round().max(0.0) as usize;
        self.drifts[index.min(self.drifts.len() - 1)]
    }

    /// Lends a memory to `work` and takes it back.
    pub(super) fn with_memory<T>(&self, threads: Threads, work: impl FnOnce(&mut Workspace) -> T) -> T {
        let kept = self.memories.lock().ok().and_then(|mut all| {
            let fits = all.iter().position(|memory| memory.threads() == threads);
            fits.map(|index| all.swap_remove(index))
        });
        let mut memory = kept.unwrap_or_else(|| Workspace::new(threads));
        let result = work(&mut memory);
        if let Ok(mut all) = self.memories.lock() {
            all.push(memory);
        }
        result
    }

    /// Whether the vehicle is near the place where its route has it: thrusters too weak for the current or for the speed let it go.
    fn in_transit(&self, time: f64) -> Result<(), String> {
        let (camera, goal) = (self.camera(time).translation(), self.route.at(time).at);
        let off = (camera - goal).norm();
        // Written so that a NaN is refused too.
        if off <= STRAY {
            return Ok(());
        }
        Err(format!(
            "vehicle: {off:.1} m off its route after {time:.1} s, at north {:.2}, east {:.2}, depth {:.2} m: its thrusters do not hold \
             it; lower current.speed or route.speed",
            camera.x, camera.y, camera.z
        ))
    }

    /// Whether the vehicle, its cameras or its lamps come too near to anything.
    fn collision(&self, last: f64) -> Result<(), String> {
        let clearance = self.settings.clearance;
        let mut parts = parts(&self.cameras, &self.studio);
        parts.push(("the vehicle".to_owned(), self.body_from_camera.inverse().translation()));
        let places = |time: f64| {
            let camera = self.camera(time);
            parts.iter().map(|(_, p)| camera.rotation() * p + camera.translation()).collect::<Vec<_>>()
        };
        let mut before: Option<Vec<Vector3<f64>>> = None;
        for k in 0..=(last / LOOK).ceil() as usize {
            let time = k as f64 * LOOK;
            let now = places(time);
            self.in_transit(time)?;
            for (i, place) in now.iter().enumerate() {
                // In the middle of a large body no surface is near.
                let near =
                    self.scene.distance(place, clearance.max(1e-6)).is_some() || (k == 0 && self.scene.encloses(place));
                // Below the bed, or through a thin body between two looks.
                let along = before.as_ref().map(|all| place - all[i]);
                let through = along.zip(before.as_ref()).is_some_and(|(along, all)| {
                    along.norm() > 0.0 && self.scene.bvh.hit(&self.scene.mesh.triangles, &all[i], &along, 1.0).is_some()
                });
                if near || through {
                    let nearest = self
                        .scene
                        .objects
                        .iter()
                        .zip(&self.scene.nominal.objects)
                        .min_by(|a, b| {
                            let to = |o: &crate::scene::SceneObject| (o.centroid() - place).norm();
                            to(a.0).total_cmp(&to(b.0))
                        })
                        .map_or("nothing", |(_, nominal)| nominal.id.as_str());
                    return Err(format!(
                        "route: {} comes within {clearance} m of something near `{nearest}` after {time:.1} s, at \
                         north {:.2}, east {:.2}, depth {:.2} m; raise route.altitude or lower clearance",
                        parts[i].0, place.x, place.y, place.z
                    ));
                }
            }
            before = Some(now);
        }
        Ok(())
    }
}

/// What must not touch anything, in the left camera's frame: both cameras, then the lamps.
fn parts(cameras: &Cameras, studio: &Studio) -> Vec<(String, Vector3<f64>)> {
    let lamps = studio.left.lamps.iter().enumerate();
    let right = cameras.right_from_left.inverse().translation();
    [("the left camera".to_owned(), Vector3::zeros()), ("the right camera".to_owned(), right)]
        .into_iter()
        .chain(lamps.map(|(k, lamp)| (format!("lamp {k}"), Vector3::from(lamp.at))))
        .collect()
}

/// The cameras look down and `ahead` degrees forward: right in the image is starboard, its lower edge is aft.
fn mount(ahead: f64, at: [f64; 3]) -> Transform<Body, Camera> {
    let (sine, cosine) = libm::sincos(ahead.to_radians());
    let forward = Vector3::new(sine, 0.0, cosine);
    let axes = Matrix3::from_columns(&[Vector3::y(), forward.cross(&Vector3::y()), forward]);
    Transform::from_axes(&axes, at.into())
}

fn build_studio(settings: &Mission, cameras: &Cameras, seed: u64, dive: u64) -> Studio {
    let lamps = if settings.lamps.is_empty() { Lamp::pair(settings.rig.baseline) } else { settings.lamps.clone() };
    let place = |p: [f64; 3]| -> [f64; 3] {
        (cameras.right_from_left * seafix_geometry::Point::<Camera>::from(p)).coords.into()
    };
    let there = lamps.iter().map(|l| Lamp { at: place(l.at), aim: place(l.aim), ..l.clone() }).collect();
    let water = settings.water.clone();
    let left = RenderCamera::new(cameras.lens.clone(), lamps, &water);
    let right = RenderCamera::new(cameras.lens.clone(), there, &water);
    let bits = |purpose| Stream::new(seed, dive, 0, purpose).bits() as u32;
    let texture = Stream::new(seed, 0, 0, Purpose::Texture).bits() as u32;
    let textures = SurfaceTextures::shared(texture);
    Studio::new(
        left,
        right,
        water,
        settings.imager.clone(),
        textures,
        settings.shadows,
        bits(Purpose::FaultyDevice),
        bits(Purpose::Snow),
    )
}
