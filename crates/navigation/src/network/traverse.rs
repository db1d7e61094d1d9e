//! A run along a network: key frames are laid on the way, and found again.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};
use seafix_component::in_range;
use seafix_geometry::{Camera, Covariance6, Point, StereoRig, Transform, World};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use super::{
    Candidate, Closed, Fix, Footprint, Glance, KeyFrame, Leg, Network, Recognised, Recogniser, Recognition, Rough,
    Station, Unrecognised, in_world,
};
use crate::{Local, Navigated, Place, StereoPair};

/// When key frames are laid and sought.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct NetworkSettings {
    /// A key frame is laid where those there are cover less than this share of what is in view,
    pub overlap: f64,
    /// or where the pose is known so many times better than at each of those that cover it.
    pub better: f64,
    /// Key frames are sought no sooner than this after the last time (s), and only where no object was fixed,
    pub interval: f64,
    /// and none that was laid less than so much of this run's way ago (m): odometry knows that better.
    pub apart: f64,
    /// A key frame is tried that may cover this share of what is in view.
    pub least_overlap: f64,
    /// Fixes of an object with less time between them are of one visit (s), and only the best of a visit counts: the others
    /// share its errors, of the model, of the light, of the view. The same holds for key frames found again.
    pub visit: f64,
    /// How they are recognised.
    pub recognition: Recognition,
}

impl Default for NetworkSettings {
    fn default() -> Self {
        Self {
            overlap: 0.5,
            better: 2.0,
            interval: 2.0,
            apart: 10.0,
            least_overlap: 0.3,
            visit: 10.0,
            recognition: Recognition::default(),
        }
    }
}

impl NetworkSettings {
    /// What cannot be worked with, as a sentence.
    ///
    /// # Errors
    /// The sentence.
    pub fn check(&self) -> Result<(), String> {
        let share = |name, x: f64| in_range(x > 0.0 && x <= 1.0, name, x, "a share above 0, up to 1");
        share("overlap", self.overlap)?;
        share("least-overlap", self.least_overlap)?;
        in_range(self.better > 1.0, "better", self.better, "a number above 1")?;
        let not_negative = |name, x: f64, what| in_range(x >= 0.0 && x.is_finite(), name, x, what);
        not_negative("interval", self.interval, "a time of 0 or more (s)")?;
        not_negative("apart", self.apart, "a length of 0 or more (m)")?;
        not_negative("visit", self.visit, "a time of 0 or more (s)")?;
        self.recognition.check().map_err(|said| format!("recognition.{said}"))
    }
}

/// What is known of the camera at an instant.
#[derive(Debug, Clone)]
pub struct Here {
    /// When (ns).
    pub stamp_ns: u64,
    /// The navigated pose, where there is one.
    pub navigated: Option<Navigated>,
    /// The rough pose, where there is one.
    pub rough: Option<(Transform<World, Camera>, Covariance6<World, Camera>)>,
}

/// What became of an instant.
#[derive(Debug, Clone, Default)]
pub struct Closure {
    /// The station that was laid as a key frame.
    pub laid: Option<usize>,
    /// What came of the search, where there was one.
    pub sought: Option<Result<Refound, Unrecognised>>,
}

/// A key frame that was found again.
#[derive(Debug, Clone, PartialEq)]
pub struct Refound {
    /// Its station.
    pub station: usize,
    /// How it was recognised.
    pub recognised: Recognised,
    /// The camera relative to an object, by all that the network knows now; `None` where nothing connects them, or where
    /// the loop contradicts the rest of the network and was given up.
    pub navigated: Option<Navigated>,
    /// Whether the loop was given up.
    pub given_up: bool,
}

/// The last fix of an object that counts.
#[derive(Debug, Clone, Copy)]
struct Visit {
    fix: usize,
    sigma: f64,
    seconds: f64,
}

/// The last time a key frame was found again, as long as the vehicle is over it: its points err alike each time, so only
/// the best of a pass counts.
#[derive(Debug, Clone, Copy)]
struct Pass {
    index: usize,
    sigma: f64,
    seconds: f64,
}

/// A fix or a loop must be so much better than the best of its visit or pass to take its place.
const CLEARLY: f64 = 0.8;

/// A run along a network.
#[derive(Debug)]
pub struct Traverse<'a> {
    settings: &'a NetworkSettings,
    recogniser: Recogniser<'a>,
    network: Network,
    /// Of each station, what it shows and at which length of this run's way it was laid; earlier runs' long before.
    footprints: Vec<Option<Footprint>>,
    laid_at: Vec<f64>,
    /// The last station, while the motion since is known.
    last: Option<usize>,
    /// The motion since then.
    since: Local,
    way: f64,
    seconds: f64,
    sought_at: f64,
    /// Points of the last glance: what will be in view near by.
    outline: Vec<Point<Camera>>,
    visits: Vec<Option<Visit>>,
    /// By the key frame's station.
    passes: BTreeMap<usize, Pass>,
}

impl<'a> Traverse<'a> {
    /// Sets out in `network`, empty or laid by an earlier run.
    pub fn begin(settings: &'a NetworkSettings, network: Network, rig: &'a StereoRig, threads: Threads) -> Self {
        let visits = vec![None; network.objects.len()];
        let laid_at = vec![f64::NEG_INFINITY; network.stations.len()];
        let mut traverse = Self {
            settings,
            recogniser: Recogniser::new(&settings.recognition, rig, threads),
            network,
            footprints: Vec::new(),
            laid_at,
            last: None,
            since: still(),
            way: 0.0,
            seconds: 0.0,
            sought_at: f64::NEG_INFINITY,
            outline: Vec::new(),
            visits,
            passes: BTreeMap::new(),
        };
        traverse.lay_out();
        traverse
    }

    /// The network as it is by now.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The network, its loops closed.
    pub fn finish(mut self) -> Network {
        self.network.close();
        self.network
    }

    /// Some time and the motion in it; without a motion a new chain begins.
    pub fn advance(&mut self, seconds: f64, motion: Option<&Local>) {
        self.seconds += seconds;
        match motion {
            Some(motion) => {
                self.way += motion.motion.translation().norm();
                self.since = self.since.then(motion);
            }
            None => self.last = None,
        }
    }

    /// An object stands elsewhere than was believed.
    pub fn displaced(&mut self, object: usize, place: Place) {
        self.network.objects[object].1 = place;
    }

    /// A new instant: its fixes are taken in, a key frame is sought where one may be, and one is laid where there is none.
    pub fn visit(&mut self, pair: &StereoPair<'_>, here: &Here, fixes: &[Navigated]) -> Closure {
        self.visit_by(here, fixes, |recogniser| recogniser.glance(pair))
    }

    /// The same, what is in view being made when it is asked for.
    pub(super) fn visit_by(
        &mut self,
        here: &Here,
        fixes: &[Navigated],
        glance: impl FnOnce(&mut Recogniser<'a>) -> Glance,
    ) -> Closure {
        let mut closure = Closure::default();
        let Some(world) = self.world(here) else { return closure };
        fixes.iter().for_each(|fix| self.fix(here, fix));
        let expected = Footprint::of(&self.outline, &world);
        let seek = fixes.is_empty()
            && self.seconds - self.sought_at >= self.settings.interval
            && (self.outline.is_empty() || self.may_show(&expected, self.sigma(here)).next().is_some());
        if !(seek || self.wanted(&expected, here)) {
            return closure;
        }
        let glance = glance(&mut self.recogniser);
        if glance.cloud.len() < self.settings.recognition.least_points {
            return closure;
        }
        self.outline = glance.places();
        if seek && let Some(sought) = self.seek(&glance, here) {
            self.sought_at = self.seconds;
            closure.sought = Some(sought);
        }
        let Some(world) = self.world(here) else { return closure };
        if self.wanted(&Footprint::of(&self.outline, &world), here) {
            let station = self.station(here);
            self.network.stations[station].keyframe = Some(glance.reduced());
            closure.laid = Some(station);
            self.close();
        }
        closure
    }

    /// Where the camera is, as far as is known.
    fn world(&self, here: &Here) -> Option<Transform<World, Camera>> {
        let by_way = self.last.map(|last| self.network.stations[last].world_from_camera * self.since.motion);
        let by_object = || here.navigated.as_ref().map(|navigated| in_world(navigated, &self.places()).0);
        by_way.or_else(by_object).or_else(|| here.rough.map(|(world, _)| world))
    }

    /// How well: one standard deviation of the position (m).
    fn sigma(&self, here: &Here) -> f64 {
        let position = |matrix: &nalgebra::Matrix6<f64>| matrix.fixed_view::<3, 3>(3, 3).trace().sqrt();
        let by_way =
            self.last.map(|last| self.network.stations[last].sigma.hypot(self.since.covariance.position_sigma()));
        let by_object = here.navigated.as_ref().map(|navigated| position(&in_world(navigated, &self.places()).1));
        let rough = || here.rough.map_or(f64::INFINITY, |(_, covariance)| covariance.position_sigma());
        match (by_way, by_object) {
            (Some(a), Some(b)) => a.min(b),
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => rough(),
        }
    }

    fn places(&self) -> Vec<Place> {
        self.network.objects.iter().map(|(_, place)| *place).collect()
    }

    /// Takes in a fix, if it is the best of its visit.
    fn fix(&mut self, here: &Here, navigated: &Navigated) {
        let sigma = navigated.standing.covariance.position_sigma();
        let visit = self.visits[navigated.object].filter(|visit| self.seconds - visit.seconds <= self.settings.visit);
        if let Some(visit) = visit
            && sigma > CLEARLY * visit.sigma
        {
            self.visits[navigated.object] = Some(Visit { seconds: self.seconds, ..visit });
            return;
        }
        let fix = Fix { station: self.station(here), navigated: navigated.clone() };
        let index = visit.map_or(self.network.fixes.len(), |visit| visit.fix);
        match self.network.fixes.get_mut(index) {
            Some(worse) => *worse = fix,
            None => self.network.fixes.push(fix),
        }
        self.visits[navigated.object] = Some(Visit { fix: index, sigma, seconds: self.seconds });
    }

    /// The station of this instant, laid if there is none yet.
    fn station(&mut self, here: &Here) -> usize {
        if let Some(last) = self.last.filter(|last| self.network.stations[*last].stamp_ns == here.stamp_ns) {
            return last;
        }
        let world_from_camera = self.world(here).expect("asked for before").renormalized();
        let sigma = self.sigma(here);
        let station = self.network.lay(Station { stamp_ns: here.stamp_ns, world_from_camera, sigma, keyframe: None });
        self.footprints.push(None);
        self.laid_at.push(self.way);
        match self.last {
            Some(from) => self.network.legs.push(Leg { from, to: station, motion: self.since }),
            // A chain hangs on something: until an object is fixed or a key frame recognised, on acoustics.
            None => {
                if let Some((world_from_camera, covariance)) = here.rough {
                    self.network.roughs.push(Rough { station, world_from_camera, covariance });
                }
            }
        }
        self.last = Some(station);
        self.since = still();
        station
    }

    /// Key frames that may show what is in view when it is known so well, how much of it they cover at best, and how far
    /// their middle is from where it should be.
    fn may_show(&self, view: &Footprint, sigma: f64) -> impl Iterator<Item = (usize, f64, f64)> {
        /// So many standard deviations off.
        const FAR: f64 = 3.0;
        let each = self.footprints.iter().zip(&self.network.stations).zip(&self.laid_at).enumerate();
        each.filter_map(move |(index, ((footprint, station), laid_at))| {
            let footprint = footprint.as_ref().filter(|_| self.way - laid_at >= self.settings.apart)?;
            let reach = FAR * sigma.hypot(station.sigma);
            let apart: Vector2<f64> = footprint.middle()? - view.middle().unwrap_or_else(Point2::origin);
            let by = apart * f64::min(1.0, reach / apart.norm().max(1e-12));
            let covered = view.moved(by).covered_by(footprint);
            (covered >= self.settings.least_overlap).then_some((index, covered, apart.norm()))
        })
    }

    /// Whether a key frame should be laid.
    fn wanted(&self, view: &Footprint, here: &Here) -> bool {
        let covering = self.footprints.iter().zip(&self.network.stations).filter_map(|(footprint, station)| {
            let share = view.covered_by(footprint.as_ref()?);
            (share >= self.settings.overlap).then_some(station.sigma)
        });
        let best = covering.fold(f64::INFINITY, f64::min);
        best > self.settings.better * self.sigma(here)
    }

    /// Seeks a key frame; `None` where there is nothing to seek.
    fn seek(&mut self, glance: &Glance, here: &Here) -> Option<Result<Refound, Unrecognised>> {
        let world = self.world(here)?;
        let view = Footprint::of(&self.outline, &world);
        self.may_show(&view, self.sigma(here)).next()?;
        let station = self.station(here);
        let closed = self.network.solve()?;
        // Those that cover most of it come first, and of these the nearest.
        let mut near: Vec<(usize, f64, f64)> = self.may_show(&view, self.sigma(here)).collect();
        near.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.2.total_cmp(&b.2)).then(a.0.cmp(&b.0)));
        near.truncate(self.settings.recognition.candidates);
        let near: Vec<(usize, Local)> =
            near.iter().filter_map(|(index, ..)| Some((*index, closed.relative(*index, station)?))).collect();
        let candidates: Vec<Candidate<'_>> = near
            .iter()
            .filter_map(|(index, prior)| {
                let keyframe: &KeyFrame = self.network.stations[*index].keyframe.as_ref()?;
                Some(Candidate { keyframe, prior: *prior })
            })
            .collect();
        if candidates.is_empty() {
            return None;
        }
        let between = |a: usize, b: usize| closed.relative(near[a].0, near[b].0);
        let recognised = match self.recogniser.recognise(glance, &candidates, between) {
            Ok(recognised) => recognised,
            Err(why) => return Some(Err(why)),
        };
        let from = near[recognised.keyframe].0;
        let leg = Leg { from, to: station, motion: recognised.motion };
        let sigma = recognised.motion.covariance.position_sigma();
        let pass = self.passes.get(&from).copied().filter(|pass| self.seconds - pass.seconds <= self.settings.visit);
        if let Some(pass) = pass
            && sigma > CLEARLY * pass.sigma
        {
            self.passes.insert(from, Pass { seconds: self.seconds, ..pass });
            let navigated = self.best(&closed, station, here);
            return Some(Ok(Refound { station: from, recognised, navigated, given_up: false }));
        }
        let before = self.network.loops.clone();
        let index = pass.map_or(before.len(), |pass| pass.index);
        match self.network.loops.get_mut(index) {
            Some(worse) => *worse = leg,
            None => self.network.loops.push(leg),
        }
        let given_up = self.network.solve().is_none_or(|closed| closed.wrong_loops().contains(&index));
        let mut navigated = None;
        if given_up {
            self.network.loops = before;
        } else if let Some(closed) = self.close() {
            self.passes.insert(from, Pass { index, sigma, seconds: self.seconds });
            navigated = self.best(&closed, station, here);
        }
        Some(Ok(Refound { station: from, recognised, navigated, given_up }))
    }

    /// The camera relative to the object that it is navigated by, or to the one it is known best to.
    fn best(&self, closed: &Closed, station: usize, here: &Here) -> Option<Navigated> {
        if let Some(known) = &here.navigated {
            return closed.navigated(known.object, station);
        }
        let all = (0..self.network.objects.len()).filter_map(|object| closed.navigated(object, station));
        let sigma = |navigated: &Navigated| navigated.standing.covariance.position_sigma();
        all.min_by(|a, b| sigma(a).total_cmp(&sigma(b)))
    }

    fn close(&mut self) -> Option<Closed> {
        let closed = self.network.close()?;
        self.lay_out();
        Some(closed)
    }

    /// Lays the footprints where the stations are by now.
    fn lay_out(&mut self) {
        let footprint = |station: &Station| {
            let keyframe = station.keyframe.as_ref()?;
            Some(Footprint::of(&keyframe.places(), &station.world_from_camera))
        };
        self.footprints = self.network.stations.iter().map(footprint).collect();
    }
}

/// No motion, exactly known.
fn still() -> Local {
    Local::new(Transform::identity(), Covariance6::new(nalgebra::Matrix6::zeros()))
}
