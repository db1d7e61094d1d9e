//! The settings of a mission.

use std::path::{Path, PathBuf};

use seafix_component::{Fault, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::rig::RigPlan;
use crate::{
    optics::{Lamp, Water},
    points::PointNoise,
    render::Imager,
    scene::{BUILT_IN, Changes, RandomSite, SitePlan, built_in},
    sensors::{DeviceFault, Sensors},
    vehicle::{Current, Route, Vehicle},
};

/// Maximum duration of a mission (s).
const LONGEST: f64 = 7200.0;

/// Source of the prior pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum PriorKind {
    /// The true pose plus normally distributed errors, independent in each frame.
    #[default]
    Sampled,
    /// Dead reckoning from the navigation sensors: acoustic positions, Doppler log, attitude, depth.
    Sensors,
}

/// The settings of a mission. A factor of magnitude 0 gives the same bits as no factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mission {
    /// The site: `drill-centre`, `karmin2`, `random`, or the path of NAME.site.toml with NAME.geometry.toml beside it.
    pub site: String,
    /// Whether frames hold clouds of noisy points instead of images.
    pub as_points: bool,
    /// Number of stereo pairs, from 1 to 1 000 000.
    pub frames: usize,
    /// Frame rate (Hz), from 0 to 10 000; 0 spaces the pairs evenly over the complete route. The default is the
    /// paper's.
    pub rate: f64,
    /// Time of the first pair after the start of the dive (s), from 0 to 7200.
    pub start: f64,
    /// Source of the prior pose.
    pub prior: PriorKind,
    /// Standard deviation of the sampled prior position on each world axis (m), from 0 to 100. Applies to `sampled`
    /// priors.
    pub prior_position: f64,
    /// Standard deviation of the sampled prior attitude about each camera axis (degrees), from 0 to 180. Applies to
    /// `sampled` priors.
    pub prior_attitude_deg: f64,
    /// Standard deviation of each coordinate of a model point (m), from 0 to 0.05.
    pub model_sigma: f64,
    /// Files of object models that methods receive instead of surveyed ones, such as those of `seafix model`: sites whose
    /// objects and points have the ids of the simulated ones. A folder stands for its `*.toml` files. An object keeps the
    /// points that its model has.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<String>,
    /// Fraction of the straight edges of the objects that the site lists, from 0 to 1.
    pub model_edges: f64,
    /// Standard deviation of each surveyed world coordinate of a base point (m), from 0 to 1.
    pub survey_sigma: f64,
    /// Minimum distance of cameras, lamps and vehicle from every surface (m), from 0 to 10; a nearer route is rejected.
    pub clearance: f64,
    /// Whether lamps cast shadows; at most four lamps do.
    pub shadows: bool,
    /// Parameters of the site `random`.
    pub random: RandomSite,
    /// Changes of the site since its survey.
    pub changes: Changes,
    /// The stereo rig.
    pub rig: RigPlan,
    /// The image sensor of both cameras.
    pub imager: Imager,
    /// Optical properties of the water.
    pub water: Water,
    /// The lamps, at most 16; an empty list stands for [`Lamp::pair`].
    pub lamps: Vec<Lamp>,
    /// The planned route.
    pub route: Route,
    /// The vehicle and its controller.
    pub vehicle: Vehicle,
    /// The current.
    pub current: Current,
    /// The navigation sensors.
    pub sensors: Sensors,
    /// Faults of cameras and navigation sensors.
    pub faults: Vec<DeviceFault>,
    /// Measurement noise of frames that hold points.
    pub points: PointNoise,
}

impl Default for Mission {
    fn default() -> Self {
        Self {
            site: BUILT_IN[0].0.to_owned(),
            as_points: false,
            frames: 70,
            rate: 10.0,
            start: 0.0,
            prior: PriorKind::Sampled,
            prior_position: 0.1,
            prior_attitude_deg: 0.5,
            model_sigma: 0.001,
            models: Vec::new(),
            model_edges: 1.0,
            survey_sigma: 0.01,
            clearance: 0.3,
            shadows: true,
            random: RandomSite::default(),
            changes: Changes::default(),
            rig: RigPlan::default(),
            imager: Imager::default(),
            water: Water::default(),
            lamps: Vec::new(),
            route: Route::default(),
            vehicle: Vehicle::default(),
            current: Current::default(),
            sensors: Sensors::default(),
            faults: Vec::new(),
            points: PointNoise::default(),
        }
    }
}

impl Mission {
    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// The first setting outside its range: `name = value; give range`.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, name, x, &format!("a number from {low} to {high}"))
        };
        within("frames", self.frames as f64, 1.0, 1e6)?;
        within("rate", self.rate, 0.0, 1e4)?;
        within("start", self.start, 0.0, LONGEST)?;
        let end = self.start + if self.rate > 0.0 { self.frames as f64 / self.rate } else { 0.0 };
        in_range(end <= LONGEST, "frames / rate", format!("{end} s"), "a mission of two hours at most")?;
        in_range(self.rate > 0.0 || self.route.speed > 0.0, "rate", 0.0, "a rate or a route.speed above 0")?;
        within("prior-position", self.prior_position, 0.0, 100.0)?;
        within("prior-attitude-deg", self.prior_attitude_deg, 0.0, 180.0)?;
        within("model-sigma", self.model_sigma, 0.0, 0.05)?;
        within("model-edges", self.model_edges, 0.0, 1.0)?;
        within("survey-sigma", self.survey_sigma, 0.0, 1.0)?;
        within("clearance", self.clearance, 0.0, 10.0)?;
        within("points.sigma-px", self.points.sigma_px, 0.0, 20.0)?;
        within("points.found", self.points.found, 0.0, 1.0)?;
        within("points.clutter", self.points.clutter as f64, 0.0, PointNoise::MAX_CLUTTER as f64)?;
        self.random.check()?;
        self.changes.check()?;
        self.rig.check()?;
        self.imager.check()?;
        self.water.check()?;
        in_range(self.lamps.len() <= 16, "lamps", self.lamps.len(), "at most 16 lamps")?;
        self.lamps.iter().enumerate().try_for_each(|(k, lamp)| lamp.check(k))?;
        self.route.check()?;
        self.vehicle.check()?;
        self.current.check()?;
        self.sensors.check()?;
        self.faults.iter().enumerate().try_for_each(|(k, fault)| fault.check(k))
    }

    /// The files of the given models with their names in the settings; a relative path starts at `folder`, and a folder
    /// stands for its `*.toml` files.
    ///
    /// # Errors
    /// A folder that cannot be read, or without such files.
    pub fn model_files(&self, folder: &Path) -> Result<Vec<(String, PathBuf)>, Vec<Fault>> {
        let mut files = Vec::new();
        for name in &self.models {
            let path = folder.join(name);
            if !path.is_dir() {
                files.push((name.clone(), path));
                continue;
            }
            let fault = |what: &str| vec![Fault::new(what, &path).remedy("give a folder with sites, NAME.toml")];
            let entries =
                path.read_dir().map_err(|error| fault(&format!("cannot read the folder of models ({error})")))?;
            let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
            let mut names: Vec<String> = names.filter(|name| name.ends_with(".toml")).collect();
            if names.is_empty() {
                return Err(fault("a folder without models"));
            }
            names.sort_unstable();
            files.extend(names.into_iter().map(|file| (format!("{name}/{file}"), path.join(file))));
        }
        Ok(files)
    }

    /// Loads the site with its given models; a relative path starts at `folder`.
    pub(super) fn site_plan(&self, folder: &Path) -> Result<SitePlan, Vec<Fault>> {
        let files: Vec<PathBuf> = self.model_files(folder)?.into_iter().map(|(_, path)| path).collect();
        self.site_without_models(folder)?.with_models(&files)
    }

    fn site_without_models(&self, folder: &Path) -> Result<SitePlan, Vec<Fault>> {
        if let Some(plan) = built_in(&self.site) {
            return Ok(plan);
        }
        if self.site == "random" {
            return Ok(self.random.plan());
        }
        if !self.site.ends_with(".toml") {
            let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
            let remedy = format!("give {}, random, or a file NAME.site.toml", names.join(", "));
            return Err(vec![
                Fault::new(format!("unknown site `{}`", self.site), Path::new("source.site")).remedy(remedy),
            ]);
        }
        SitePlan::read(&folder.join(&self.site))
    }
}
