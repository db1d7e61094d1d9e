//! A mission with its site and its trajectory; frames are computed on demand, in any order.

use std::{path::Path, sync::Mutex};

use nalgebra::{Matrix3, Vector3, Vector6};
use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Object, StereoRig, Transform, World};
use seafix_referencing::Site;
use seafix_vision::{Threads, Workspace};

use super::{rig::Cameras, settings::Mission};
use crate::{
    optics::Lamp,
    render::{RenderCamera, Studio, SurfaceTextures},
    scene::{Changes, Scene, SitePlan, wireframe::add_edges},
    sensors::{Readings, SensorNavigation, SensorPrior},
    stream::{Purpose, Stream},
    survey::SurveyErrors,
    vehicle::{Looker, PlannedRoute, RouteKind, Track},
};

/// Stamp of the start of a dive (ns since 1970): November 2023, like the stamps of a real log.
const EPOCH_NS: u64 = 1_700_000_000_000_000_000;
/// Maximum distance of the camera from its route (m); a mission with more is rejected.
const STRAY: f64 = 10.0;
/// Time step of the collision check (s).
const LOOK: f64 = 0.1;

/// A mission with its site and the vehicle's trajectory.
#[derive(Debug)]
pub struct PlannedMission {
    pub(super) settings: Mission,
    pub(super) seed: u64,
    pub(super) dive: u64,
    pub(super) scene: Scene,
    pub(super) cameras: Cameras,
    pub(super) studio: Studio,
    pub(super) track: Track,
    /// Displacement of floating particles by the water since the start, at the track's times (m).
    drifts: Vec<Vector3<f64>>,
    pub(super) body_from_camera: Transform<Body, Camera>,
    /// Sensor readings and the poses that they give.
    navigation: SensorNavigation,
    route: PlannedRoute,
    pub(super) times: Vec<f64>,
    /// Idle rendering workspaces, one for each concurrent renderer.
    memories: Mutex<Vec<Workspace>>,
}

impl Mission {
    /// Plans dive number `dive` of an experiment with this seed. `folder` is the base of relative paths.
    ///
    /// # Errors
    /// All faults of the site, or else the first fault of the settings or of the route. The message of a collision
    /// names the object, the place and the time.
    pub fn plan(&self, seed: u64, dive: u64, folder: &Path) -> Result<PlannedMission, Vec<Fault>> {
        let wrong = |message: String| vec![Fault::new(message, Path::new("the source's settings"))];
        self.check().map_err(wrong)?;
        let site = self.site_plan(folder)?;
        if let Some(name) = self.changes.stranger(&site.site) {
            return Err(wrong(format!(
                "changes.objects = `{name}`; the site has no such object; give the ids of its objects"
            )));
        }
        PlannedMission::new(self, &site, seed, dive).map_err(wrong)
    }
}

impl PlannedMission {
    pub(super) fn new(settings: &Mission, plan: &SitePlan, seed: u64, dive: u64) -> Result<Self, String> {
        let errors = SurveyErrors { model: settings.model_sigma, survey: settings.survey_sigma };
        let mut scene = Scene::new(plan, &settings.changes, errors, seed);
        add_edges(&mut scene, plan, settings.model_sigma, settings.model_edges, seed);
        let cameras = settings.rig.build()?;
        let body_from_camera = mount(settings.rig.ahead_deg, settings.rig.at);
        let studio = build_studio(settings, &cameras, seed, dive);
        let looker = Looker {
            rig: &cameras.nominal,
            body_from_camera,
            parts: parts(&cameras, &studio).into_iter().map(|(_, at)| at).collect(),
        };
        // An inspection is planned on the site as built, because its planner does not know the later changes.
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
                "route.speed = {}; the route takes {last:.0} s, the limit is 7200 s; raise the speed or shorten the \
                 route",
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

    /// The site as a method receives it, with the errors of its survey.
    pub fn site(&self) -> &Site {
        &self.scene.nominal
    }

    /// The rig as a method receives it, with its calibration errors.
    pub fn rig(&self) -> &StereoRig {
        &self.cameras.nominal
    }

    /// The settings of the mission.
    pub fn settings(&self) -> &Mission {
        &self.settings
    }

    /// The true pose of each object of [`site`](Self::site).
    pub fn world_from_object(&self) -> &[Transform<World, Object>] {
        &self.scene.world_from_object
    }

    /// The left camera's pose in the vehicle.
    pub fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.body_from_camera
    }

    /// All readings of the navigation sensors during the dive, with noise and faults, without truth.
    pub fn readings(&self) -> Readings {
        self.navigation.readings()
    }

    /// The vehicle's prior pose from the sensors at a time (s).
    pub(super) fn integrated(&self, time: f64) -> Option<SensorPrior> {
        self.navigation.at(time)
    }

    /// The stamp of a time of the dive (s), in ns since 1970.
    pub fn stamp(&self, time: f64) -> u64 {
        EPOCH_NS + (time * 1e9).round() as u64
    }

    /// The route's vertices: north, east, height above the mean seabed (m), as in
    /// [`Route::waypoints`](crate::vehicle::Route::waypoints).
    pub fn waypoints(&self) -> Vec<[f64; 3]> {
        let depth = self.scene.seabed.depth();
        self.route.places().iter().map(|p| [p.x, p.y, depth - p.z]).collect()
    }

    /// The true positions of the feature points, in the site's order: object, point, world position (m).
    ///
    /// [`site`](Self::site) holds their surveyed positions instead, in the frames of the objects.
    pub fn true_points(&self) -> impl Iterator<Item = (&str, &str, [f64; 3])> {
        let objects = self.scene.nominal.objects.iter().zip(&self.scene.objects);
        objects.flat_map(|(nominal, object)| {
            let points = nominal.points.iter().zip(&object.points);
            points.map(|(point, truth)| (&nominal.id[..], &point.id[..], truth.at.into()))
        })
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
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

    /// The left camera's pose at a time (s).
    pub(super) fn camera(&self, time: f64) -> Transform<World, Camera> {
        self.track.at(time).world_from_body * self.body_from_camera
    }

    /// The left camera's twist at a time, in its own frame (rad/s, m/s).
    pub(super) fn motion(&self, time: f64) -> Vector6<f64> {
        self.body_from_camera.inverse().adjoint() * self.track.at(time).motion
    }

    /// Displacement of floating particles by the water up to a time (s), in metres.
    pub(super) fn drift(&self, time: f64) -> Vector3<f64> {
        let index = (time * Track::RATE).round().max(0.0) as usize;
        self.drifts[index.min(self.drifts.len() - 1)]
    }

    /// Runs `work` with a workspace from the pool and returns the workspace to the pool.
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

    /// Checks that the vehicle follows its route: the thrusters may be too weak for the current or for the speed.
    fn in_transit(&self, time: f64) -> Result<(), String> {
        let (camera, goal) = (self.camera(time).translation(), self.route.at(time).at);
        let off = (camera - goal).norm();
        // A NaN fails this comparison too.
        if off <= STRAY {
            return Ok(());
        }
        Err(format!(
            "vehicle: {off:.1} m off its route after {time:.1} s, at north {:.2}, east {:.2}, depth {:.2} m: its \
             thrusters do not hold it; lower current.speed or route.speed",
            camera.x, camera.y, camera.z
        ))
    }

    /// Checks that vehicle, cameras and lamps keep their clearance.
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
                // A place deep inside a large body has no surface nearby, so the start is also tested for enclosure.
                let near =
                    self.scene.distance(place, clearance.max(1e-6)).is_some() || (k == 0 && self.scene.encloses(place));
                // The path below the seabed or through a thin body between two time steps.
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

/// The parts that need clearance, in the left camera's frame: both cameras, then the lamps.
fn parts(cameras: &Cameras, studio: &Studio) -> Vec<(String, Vector3<f64>)> {
    let lamps = studio.left.lamps.iter().enumerate();
    let right = cameras.right_from_left.inverse().translation();
    [("the left camera".to_owned(), Vector3::zeros()), ("the right camera".to_owned(), right)]
        .into_iter()
        .chain(lamps.map(|(k, lamp)| (format!("lamp {k}"), Vector3::from(lamp.at))))
        .collect()
}

/// The pose of a camera that looks down and `ahead` degrees forward: right in the image is starboard, its lower edge is
/// aft.
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
