//! The settings of a mission.

use std::path::Path;

use seafix_component::{Fault, in_range};
use serde::{Deserialize, Serialize};

use super::{PlannedMission, RigPlan};
use crate::{
    optics::{Lamp, Water},
    points::PointNoise,
    render::Imager,
    scene::{BUILT_IN, Changes, RandomSite, SitePlan, built_in},
    sensors::{DeviceFault, Sensors},
    vehicle::{Current, Route, Vehicle},
};

/// The longest mission (s).
const LONGEST: f64 = 7200.0;

/// Where the rough pose of a frame comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PriorKind {
    /// The truth with an error of the given standard deviations.
    #[default]
    Sampled,
    /// The navigation sensors: acoustic fixes, Doppler log, attitude, depth.
    Sensors,
}

/// A mission's settings. Every factor at magnitude 0 is the same, bit for bit, as the factor left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mission {
    /// `drill-centre`, `karmin2`, `random`, or the path of a NAME.site.toml with NAME.geometry.toml beside it.
    pub site: String,
    /// Whether the method gets clouds of noisy points instead of images.
    pub as_points: bool,
    /// Stereo pairs.
    pub frames: usize,
    /// Stereo pairs a second; 0 spreads them evenly over the whole way.
    pub rate: f64,
    /// When the first is taken (s).
    pub start: f64,
    /// Where the rough pose comes from.
    pub prior: PriorKind,
    /// Standard deviation of the drawn rough pose's position, each world axis (m).
    pub prior_position: f64,
    /// Standard deviation of the rough pose's attitude, each camera axis (degrees).
    pub prior_attitude_deg: f64,
    /// Standard deviation of each coordinate of the model's points (m).
    pub model_sigma: f64,
    /// Standard deviation of each surveyed world coordinate of base points (m).
    pub survey_sigma: f64,
    /// No part of the vehicle may come nearer to anything than this (m).
    pub clearance: f64,
    /// Whether lamps throw shadows.
    pub shadows: bool,
    /// The site that `random` draws.
    pub random: RandomSite,
    /// What has changed since the survey.
    pub changes: Changes,
    /// The cameras.
    pub rig: RigPlan,
    /// The image sensors.
    pub imager: Imager,
    /// The water.
    pub water: Water,
    /// The lamps; none given is the usual pair.
    pub lamps: Vec<Lamp>,
    /// The way.
    pub route: Route,
    /// The vehicle.
    pub vehicle: Vehicle,
    /// The current.
    pub current: Current,
    /// The navigation sensors.
    pub sensors: Sensors,
    /// Devices that fail.
    pub faults: Vec<DeviceFault>,
    /// The same mission as points.
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
    /// Whether the settings describe a mission.
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
        in_range(self.rate > 0.0 || self.route.speed > 0.0, "rate", 0.0, "frames a second, or the route a speed")?;
        within("prior-position", self.prior_position, 0.0, 100.0)?;
        within("prior-attitude-deg", self.prior_attitude_deg, 0.0, 180.0)?;
        within("model-sigma", self.model_sigma, 0.0, 0.05)?;
        within("survey-sigma", self.survey_sigma, 0.0, 1.0)?;
        within("clearance", self.clearance, 0.0, 10.0)?;
        within("points.sigma-px", self.points.sigma_px, 0.0, 20.0)?;
        within("points.found", self.points.found, 0.0, 1.0)?;
        self.random.check()?;
        self.changes.check()?;
        self.rig.check()?;
        self.imager.check()?;
        self.water.check()?;
        in_range(self.lamps.len() <= 16, "lamps", self.lamps.len(), "16 at most")?;
        self.lamps.iter().enumerate().try_for_each(|(k, lamp)| lamp.check(k))?;
        self.route.check()?;
        self.vehicle.check()?;
        self.current.check()?;
        self.sensors.check()?;
        self.faults.iter().enumerate().try_for_each(|(k, fault)| fault.check(k))
    }

    /// The site; a relative path starts from `folder`.
    fn site_plan(&self, folder: &Path) -> Result<SitePlan, Vec<Fault>> {
        if let Some(plan) = built_in(&self.site) {
            return Ok(plan);
        }
        if self.site == "random" {
            return Ok(self.random.plan());
        }
        if !self.site.ends_with(".toml") {
            let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
            let remedy = format!("there are {}, random, and files NAME.site.toml", names.join(", "));
            return Err(vec![
                Fault::new(format!("no site is called `{}`", self.site), Path::new("source.site")).remedy(remedy),
            ]);
        }
        SitePlan::read(&folder.join(&self.site))
    }

    /// The mission number `dive` of the experiment with this seed.
    ///
    /// # Errors
    /// Everything that is wrong with the site, or the first thing that is wrong with the settings or
    /// the way: a route through an object is refused with place and time.
    pub fn plan(&self, seed: u64, dive: u64, folder: &Path) -> Result<PlannedMission, Vec<Fault>> {
        let wrong = |message: String| vec![Fault::new(message, Path::new("the source's settings"))];
        self.check().map_err(wrong)?;
        let site = self.site_plan(folder)?;
        if let Some(name) = self.changes.stranger(&site.site) {
            return Err(wrong(format!("changes.objects = `{name}`; the site has no such object")));
        }
        PlannedMission::new(self, &site, seed, dive).map_err(wrong)
    }
}
