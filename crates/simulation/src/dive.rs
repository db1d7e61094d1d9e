//! A dive over the virtual site: settings, plan and frames.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Settings;
use seafix_geometry::{
    BadCamera, BadRig, Camera, MeasuredPoint, Object, Pinhole, StereoPixels, StereoRig, Transform, World, so3,
};
use seafix_referencing::Site;
use seafix_vision::Image;
use serde::{Deserialize, Serialize};

use crate::{
    blueprint::Blueprint,
    points::{PlacedRig, PointNoise},
    sensor::Sensor,
    stream::{Purpose, Stream},
    survey::{SurveyErrors, survey},
    virtual_render::Rendering,
    virtual_scene::VirtualScene,
};

/// Stamp of the start of a dive (ns since 1970): November 2023, like the stamps of a real log.
const EPOCH_NS: u64 = 1_700_000_000_000_000_000;
/// Minimum distance of a feature point from the image border when views are chosen (px).
const VIEW_MARGIN: f64 = 24.0;
/// Number of random views from which one is chosen.
const VIEW_TRIALS: usize = 100;
/// Minimum height of the cameras above everything beneath them (m).
const CLEARANCE: f64 = 0.4;

/// The settings of a dive over the virtual site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Dive {
    /// Number of frames, from 1 to 1 000 000; consecutive frames view consecutive objects. The default is ten of each
    /// of the seven objects.
    pub frames: usize,
    /// Distance from the left camera to the object's centroid (m), from 1 to 30.
    pub distance: f64,
    /// Minimum and maximum angle between optical axis and vertical (degrees), from 0 to 40.
    pub tilt_deg: [f64; 2],
    /// Maximum offset of the object's centroid from the view's centre (tangent of the angle), from 0 to 1.
    pub off_centre: f64,
    /// Number of the object's feature points that a view should show in both images. A view with fewer is taken only if
    /// no random view shows enough.
    pub min_visible: usize,
    /// Frame rate (Hz), from 0.001 to 10 000. The default is the paper's.
    pub rate: f64,
    /// Standard deviation of the prior position on each world axis (m), from 0 to 100.
    pub prior_position: f64,
    /// Standard deviation of the prior attitude about each camera axis (degrees), from 0 to 45.
    pub prior_attitude_deg: f64,
    /// Standard deviation of each coordinate of a model point (m), from 0 to 0.1.
    pub model_sigma: f64,
    /// Standard deviation of each surveyed world coordinate of a base point (m), from 0 to 0.2.
    pub survey_sigma: f64,
    /// The stereo rig.
    pub rig: VirtualRig,
    /// Lens and sensor of both cameras.
    pub sensor: Sensor,
    /// Measurement noise of frames that hold points.
    pub points: PointNoise,
}

impl Default for Dive {
    fn default() -> Self {
        Self {
            frames: 70,
            distance: 3.0,
            tilt_deg: [0.0, 15.0],
            off_centre: 0.1,
            min_visible: 6,
            rate: 10.0,
            prior_position: 0.1,
            prior_attitude_deg: 0.5,
            model_sigma: 0.001,
            survey_sigma: 0.01,
            rig: VirtualRig::default(),
            sensor: Sensor::default(),
            points: PointNoise::default(),
        }
    }
}

/// Two equal cameras side by side with parallel axes. The defaults are the paper's virtual camera; the paper gives no
/// baseline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct VirtualRig {
    /// Width and height of the images (px), from 16 to 8192 each.
    pub size: [u32; 2],
    /// Focal length (px).
    pub focal: f64,
    /// Distance between the cameras (m), from 0.001 to 5.
    pub baseline: f64,
}

impl Default for VirtualRig {
    fn default() -> Self {
        Self { size: [1024, 768], focal: 500.0, baseline: 0.25 }
    }
}

impl VirtualRig {
    /// Builds the rig; the principal points are the image centres.
    ///
    /// # Errors
    /// [`BadDive`] for an invalid camera or rig.
    pub fn build(&self) -> Result<StereoRig, BadDive> {
        let principal = self.size.map(|n| 0.5 * (f64::from(n) - 1.0));
        let camera = Pinhole::new(self.size, [self.focal; 2], principal, &[])?;
        let step = Transform::new(UnitQuaternion::identity(), Vector3::new(-self.baseline, 0.0, 0.0));
        Ok(StereoRig::new(camera, camera, step)?)
    }
}

/// An invalid dive setting.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadDive {
    /// A number outside its range.
    #[error("{name} = {value}; {remedy}")]
    Value {
        /// The setting's key.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The valid range, as a request.
        remedy: &'static str,
    },
    /// No layout is visible in both images.
    #[error(
        "cannot place {points} points at {distance} m: no layout lies in both images; give a distance from 1 to 10 m"
    )]
    Layout {
        /// Number of points.
        points: usize,
        /// Mean depth of the points (m).
        distance: f64,
    },
    /// An invalid camera.
    #[error("rig: {0}")]
    Camera(#[from] BadCamera),
    /// An invalid rig.
    #[error("rig: {0}")]
    Rig(#[from] BadRig),
}

/// The prior pose of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedPrior {
    /// The left camera's pose, with the prior's error.
    pub world_from_camera: Transform<World, Camera>,
    /// Standard deviation of the position on each world axis (m).
    pub position_sigma: f64,
    /// Standard deviation of the attitude about each camera axis (rad).
    pub attitude_sigma: f64,
}

/// A feature point that both cameras see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisiblePoint {
    /// Index of the object in the site.
    pub object: usize,
    /// Index of the point in its object.
    pub point: usize,
    /// True pixels of the point.
    pub pixels: StereoPixels,
}

/// The truth of a frame, which no method receives.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameTruth {
    /// Index of the object that the view was chosen for.
    pub object: usize,
    /// The left camera's pose.
    pub world_from_camera: Transform<World, Camera>,
    /// The feature points of all objects that are inside both images and not occluded.
    pub visible: Vec<VisiblePoint>,
}

impl Dive {
    /// Plans dive number `dive` of an experiment with this seed.
    ///
    /// The site, its survey and the seabed depend on the seed alone, so all dives of an experiment visit the same
    /// place. Views, prior poses and noise differ between dives.
    ///
    /// # Errors
    /// [`BadDive`] with the invalid setting.
    pub fn plan(&self, seed: u64, dive: u64) -> Result<PlannedDive, BadDive> {
        self.check()?;
        let rig = self.rig.build()?;
        let blueprint = Blueprint::drill_centre();
        let scene = VirtualScene::new(&blueprint, seed);
        let errors = SurveyErrors { model: self.model_sigma, survey: self.survey_sigma };
        let (site, world_from_object) = survey(&blueprint, &scene, errors, seed);
        Ok(PlannedDive { settings: self.clone(), seed, dive, rig, scene, site, world_from_object })
    }

    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// The first setting outside its range.
    pub fn check(&self) -> Result<(), BadDive> {
        let fail = |name, value, remedy| Err(BadDive::Value { name, value, remedy });
        let within = |name, value: f64, low: f64, high: f64, remedy| {
            if value >= low && value <= high { Ok(()) } else { fail(name, value, remedy) }
        };
        within("frames", self.frames as f64, 1.0, 1e6, "give 1 to 1000000 frames")?;
        within("distance", self.distance, 1.0, 30.0, "give metres, from 1 to 30")?;
        let [low, high] = self.tilt_deg;
        within("tilt-deg[0]", low, 0.0, 40.0, "give degrees, from 0 to 40")?;
        within("tilt-deg[1]", high, low, 40.0, "give degrees, from the minimum angle to 40")?;
        within("off-centre", self.off_centre, 0.0, 1.0, "give a tangent from 0 to 1")?;
        within("rate", self.rate, 1e-3, 1e4, "give hertz, from 0.001 to 10000")?;
        within("prior-position", self.prior_position, 0.0, 100.0, "give metres, from 0 to 100")?;
        within("prior-attitude-deg", self.prior_attitude_deg, 0.0, 45.0, "give degrees, from 0 to 45")?;
        within("model-sigma", self.model_sigma, 0.0, 0.1, "give metres, from 0 to 0.1")?;
        within("survey-sigma", self.survey_sigma, 0.0, 0.2, "give metres, from 0 to 0.2")?;
        if !(self.rig.focal > 0.0 && self.rig.focal.is_finite()) {
            fail("rig.focal", self.rig.focal, "give a positive number of pixels")?;
        }
        within("rig.baseline", self.rig.baseline, 1e-3, 5.0, "give metres, from 0.001 to 5")?;
        for n in self.rig.size {
            within("rig.size", f64::from(n), 16.0, 8192.0, "give pixels, from 16 to 8192")?;
        }
        within("sensor.blur", self.sensor.blur, 0.0, 20.0, "give pixels, from 0 to 20")?;
        within("sensor.noise", self.sensor.noise, 0.0, 255.0, "give grey levels, from 0 to 255")?;
        within("sensor.white", self.sensor.white, 0.0, 1e6, "give a grey level, zero or more")?;
        within("points.sigma-px", self.points.sigma_px, 0.0, 20.0, "give pixels, from 0 to 20")?;
        let max = PointNoise::MAX_CLUTTER as f64;
        within("points.clutter", self.points.clutter as f64, 0.0, max, "give a number of points, from 0 to 100000")?;
        within("points.found", self.points.found, 0.0, 1.0, "give a fraction, from 0 to 1")
    }
}

/// A dive with its site and seabed; frames are computed on demand, in any order.
#[derive(Debug, Clone)]
pub struct PlannedDive {
    settings: Dive,
    seed: u64,
    dive: u64,
    rig: StereoRig,
    scene: VirtualScene,
    site: Site,
    world_from_object: Vec<Transform<World, Object>>,
}

impl PlannedDive {
    /// The site as a method receives it, with the errors of its survey.
    pub fn site(&self) -> &Site {
        &self.site
    }

    /// The rig.
    pub fn rig(&self) -> &StereoRig {
        &self.rig
    }

    /// The settings of the dive.
    pub fn settings(&self) -> &Dive {
        &self.settings
    }

    /// The true pose of each object: the least-squares fit of its model points to their true places.
    pub fn world_from_object(&self) -> &[Transform<World, Object>] {
        &self.world_from_object
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        self.settings.frames
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Frame number `index`, a function of settings, seed, dive and index alone.
    pub fn frame(&self, index: usize) -> DiveFrame<'_> {
        let object = index % self.scene.bodies.len();
        let placed_rig = self.view(object, &mut self.stream(index, Purpose::View));
        let world_from_camera = placed_rig.world_from_camera;
        let truth = FrameTruth { object, world_from_camera, visible: self.visible(&placed_rig) };
        let interval = 1e9 / self.settings.rate;
        DiveFrame {
            dive: self,
            index,
            stamp_ns: EPOCH_NS + (index as f64 * interval).round() as u64,
            prior: self.prior_pose(&world_from_camera, &mut self.stream(index, Purpose::Prior)),
            truth,
        }
    }

    /// All frames, in order.
    pub fn frames(&self) -> impl Iterator<Item = DiveFrame<'_>> {
        (0..self.len()).map(|index| self.frame(index))
    }

    fn stream(&self, frame: usize, purpose: Purpose) -> Stream {
        Stream::new(self.seed, self.dive, frame as u64, purpose)
    }

    /// The first random view that shows enough points of an object, or else the best one.
    fn view(&self, object: usize, stream: &mut Stream) -> PlacedRig<'_> {
        let body = &self.scene.bodies[object];
        let wanted = self.settings.min_visible.min(body.points.len());
        let mut best: Option<(usize, PlacedRig<'_>)> = None;
        for _ in 0..VIEW_TRIALS {
            let placed_rig = PlacedRig { rig: &self.rig, world_from_camera: self.look_at(&body.centroid(), stream) };
            if !placed_rig.places().iter().all(|at| at.z < self.scene.summit(at, 1.0) - CLEARANCE) {
                continue;
            }
            let shown = body.points.iter().filter(|p| placed_rig.see(&self.scene, p, VIEW_MARGIN).is_some()).count();
            if best.is_none_or(|(max, _)| shown > max) {
                best = Some((shown, placed_rig));
            }
            if shown >= wanted {
                break;
            }
        }
        best.map_or_else(
            // Distances below about 1 m leave no room above an object: take the vertical view.
            || PlacedRig { rig: &self.rig, world_from_camera: self.aim(&body.centroid(), [0.0; 2], 0.0, 0.0, 0.0) },
            |(_, placed_rig)| placed_rig,
        )
    }

    /// A random view of a place.
    fn look_at(&self, place: &Vector3<f64>, stream: &mut Stream) -> Transform<World, Camera> {
        let turn = std::f64::consts::TAU;
        let [low, high] = self.settings.tilt_deg.map(f64::to_radians);
        let (heading, about, tilt) = (stream.between(0.0, turn), stream.between(0.0, turn), stream.between(low, high));
        let off = [(); 2].map(|()| self.settings.off_centre * stream.between(-1.0, 1.0));
        self.aim(place, off, heading, about, tilt)
    }

    /// The view with this heading, tilted by `tilt` about the direction `about` of the image plane. It shows `place` at
    /// the offset `off` (tangents) from the centre of the common field of view.
    fn aim(
        &self,
        place: &Vector3<f64>,
        off: [f64; 2],
        heading: f64,
        about: f64,
        tilt: f64,
    ) -> Transform<World, Camera> {
        // Straight down with heading north: the image's right is east, its lower edge is aft.
        let down = so3::exp(&(Vector3::z() * (heading + std::f64::consts::FRAC_PI_2)));
        let (sine, cosine) = libm::sincos(about);
        let rotation = down * so3::exp(&Vector3::new(tilt * cosine, tilt * sine, 0.0));
        let distance = self.settings.distance;
        let middle = 0.5 * self.rig.baseline() / distance;
        let seen = Vector3::new(off[0] + middle, off[1], 1.0).normalize() * distance;
        Transform::new(rotation, place - rotation * seen)
    }

    fn visible(&self, placed_rig: &PlacedRig<'_>) -> Vec<VisiblePoint> {
        let mut all = Vec::new();
        for (object, body) in self.scene.bodies.iter().enumerate() {
            for (point, corner) in body.points.iter().enumerate() {
                all.extend(placed_rig.see(&self.scene, corner, 0.0).map(|pixels| VisiblePoint {
                    object,
                    point,
                    pixels,
                }));
            }
        }
        all
    }

    /// The prior pose: T_true = T_prior · Exp(ξ), with the attitude error about the camera's axes and the position
    /// error along the world's.
    fn prior_pose(&self, truth: &Transform<World, Camera>, stream: &mut Stream) -> SimulatedPrior {
        let (position_sigma, attitude_sigma) =
            (self.settings.prior_position, self.settings.prior_attitude_deg.to_radians());
        let turn = so3::exp(&-stream.normal3(attitude_sigma));
        let step = stream.normal3(position_sigma);
        let world_from_camera = Transform::new(truth.rotation() * turn, truth.translation() - step);
        SimulatedPrior { world_from_camera, position_sigma, attitude_sigma }
    }
}

/// One frame of a dive: the data for a method, and apart from them the truth.
#[derive(Debug, Clone)]
pub struct DiveFrame<'a> {
    dive: &'a PlannedDive,
    /// Frame number in the dive.
    pub index: usize,
    /// Time of the exposure (ns since 1970).
    pub stamp_ns: u64,
    /// The prior pose.
    pub prior: SimulatedPrior,
    truth: FrameTruth,
}

impl DiveFrame<'_> {
    /// Renders the left and the right image, a function of the frame alone.
    pub fn render(&self) -> (Image, Image) {
        let placed_rig = self.placed_rig();
        let world_from_right = placed_rig.world_from_camera * placed_rig.rig.right_from_left().inverse();
        let scene = &self.dive.scene;
        let left = Rendering::new(scene, placed_rig.rig.left(), &placed_rig.world_from_camera).radiance();
        let right = Rendering::new(scene, placed_rig.rig.right(), &world_from_right).radiance();
        let expose = |radiance, camera: &Pinhole, purpose| {
            let [width, height] = camera.size().map(|n| n as usize);
            let pixels = self.dive.settings.sensor.expose(radiance, width, self.dive.stream(self.index, purpose));
            Image::new(width, height, pixels).expect("the rasteriser fills every pixel")
        };
        (
            expose(left, placed_rig.rig.left(), Purpose::LeftImage),
            expose(right, placed_rig.rig.right(), Purpose::RightImage),
        )
    }

    /// Measured points of the same view: visible corners with the feature points among them, and clutter.
    pub fn points(&self) -> Vec<MeasuredPoint> {
        let mut stream = self.dive.stream(self.index, Purpose::Points);
        self.placed_rig().measure(&self.dive.scene, &self.dive.settings.points, &mut stream)
    }

    /// The truth, for evaluation only.
    pub fn truth(&self) -> &FrameTruth {
        &self.truth
    }

    fn placed_rig(&self) -> PlacedRig<'_> {
        PlacedRig { rig: &self.dive.rig, world_from_camera: self.truth.world_from_camera }
    }
}

#[cfg(test)]
mod tests;
