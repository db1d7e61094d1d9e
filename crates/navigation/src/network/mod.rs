//! Reference points where no object is: key frames laid on the way, found again, and joined in a graph.

mod drift;
mod file;
mod footprint;
mod graph;
mod keyframe;
mod recognise;
#[cfg(test)]
mod tests;
mod traverse;

use std::collections::BTreeMap;

use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Transform, World};

use crate::{Local, Navigated, Place, Standing};

pub use footprint::Footprint;
pub use graph::{Graph, NoCovariance, Solved};
pub use keyframe::{Glance, KeyFrame};
pub use recognise::{Candidate, Recognised, Recogniser, Recognition, Unrecognised};
pub use traverse::{Closure, Here, NetworkSettings, Refound, Traverse};

/// A place on the way that is a node of the graph.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// When the camera was there (ns).
    pub stamp_ns: u64,
    /// Where that is, as known by now.
    pub world_from_camera: Transform<World, Camera>,
    /// How well its position is known: one standard deviation over the three axes together (m).
    pub sigma: f64,
    /// What it looks like there, where that was kept.
    pub keyframe: Option<KeyFrame>,
}

/// The motion between two stations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// The station where it begins.
    pub from: usize,
    /// The station where it ends.
    pub to: usize,
    /// `from_from_to`. Legs that follow each other share errors that [last](crate::Lasting): the Doppler log's scale, the
    /// gyro's bias.
    pub motion: Local,
}

/// A fix of an object, taken at a station.
#[derive(Debug, Clone, PartialEq)]
pub struct Fix {
    /// The station.
    pub station: usize,
    /// Where the camera was relative to the object.
    pub navigated: Navigated,
}

/// A pose of a station from elsewhere: acoustics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rough {
    /// The station.
    pub station: usize,
    /// Its pose.
    pub world_from_camera: Transform<World, Camera>,
    /// The covariance of that.
    pub covariance: Covariance6<World, Camera>,
}

/// Stations, what lies between them, and the objects of the site they hang on: all that is needed to say where every
/// key frame is, and how well that is known.
///
/// It may be laid by one run and go on in another: what two runs have in common, objects and key frames that were found
/// again, joins them in one graph.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Network {
    /// Names and places of the objects.
    pub objects: Vec<(String, Place)>,
    /// The stations, in order of being laid.
    pub stations: Vec<Station>,
    /// What odometry measured between successive ones.
    pub legs: Vec<Leg>,
    /// Fixes of objects.
    pub fixes: Vec<Fix>,
    /// Poses from elsewhere.
    pub roughs: Vec<Rough>,
    /// Key frames found again: `from` is the key frame.
    pub loops: Vec<Leg>,
}

/// The graph of a network at its most likely poses.
#[derive(Debug, Clone)]
pub struct Closed {
    solved: Solved,
    objects: usize,
    /// The factor of each loop.
    loops: Vec<usize>,
    fixes: Vec<usize>,
    /// Of a station, the node of errors that last.
    lasting: BTreeMap<usize, usize>,
}

impl Network {
    /// A network without stations, at a site with these objects.
    pub fn new(objects: Vec<(String, Place)>) -> Self {
        Self { objects, ..Self::default() }
    }

    /// Lays a station; its number.
    pub fn lay(&mut self, station: Station) -> usize {
        self.stations.push(station);
        self.stations.len() - 1
    }

    /// The most likely poses of all stations and objects, every measurement taken into account. Fixes and loops may be
    /// wrong: those that contradict the rest are given up.
    ///
    /// An object without a survey covariance stands exactly. Errors of the odometry that last are estimated along with the
    /// poses, from leg to leg as long as one begins where the other ends; a new chain knows nothing of them.
    ///
    /// `None` where the equations have no solution.
    pub fn solve(&self) -> Option<Closed> {
        let mut graph = Graph::default();
        for (_, place) in &self.objects {
            let pose = place.world_from_object.relabel();
            let node = graph.node(pose);
            if graph.prior(node, pose, &place.covariance.matrix).is_err() {
                graph.hold(node);
            }
        }
        let first = self.objects.len();
        for station in &self.stations {
            graph.node(station.world_from_camera);
        }
        let mut lasting = BTreeMap::new();
        for leg in &self.legs {
            let before = lasting.get(&leg.from).copied();
            if let Some(after) = graph.drifting(first + leg.from, first + leg.to, &leg.motion, before).ok()? {
                lasting.insert(leg.to, after);
            }
        }
        for rough in &self.roughs {
            graph.prior(first + rough.station, rough.world_from_camera, &rough.covariance.matrix).ok()?;
        }
        let mut fixes = Vec::new();
        for fix in &self.fixes {
            let Standing { object_from_camera, covariance, .. } = fix.navigated.standing;
            let motion = Local::new(object_from_camera.relabel(), Covariance6::new(covariance.matrix));
            fixes.push(graph.between(fix.navigated.object, first + fix.station, &motion, true).ok()?);
        }
        let mut loops = Vec::new();
        for leg in &self.loops {
            loops.push(graph.between(first + leg.from, first + leg.to, &leg.motion, true).ok()?);
        }
        Some(Closed { solved: graph.solve()?, objects: first, loops, fixes, lasting })
    }

    /// Closes its loops: every station moves to its most likely pose. What was found; `None` where the equations have no
    /// solution, and nothing moves.
    pub fn close(&mut self) -> Option<Closed> {
        let closed = self.solve()?;
        for (index, station) in self.stations.iter_mut().enumerate() {
            station.world_from_camera = *closed.station(index);
            station.sigma = closed.covariance(index).position_sigma();
        }
        Some(closed)
    }

    /// The stations that are key frames.
    pub fn keyframes(&self) -> impl Iterator<Item = (usize, &Station, &KeyFrame)> {
        self.stations
            .iter()
            .enumerate()
            .filter_map(|(index, station)| Some((index, station, station.keyframe.as_ref()?)))
    }
}

impl Closed {
    /// Where a station is.
    pub fn station(&self, station: usize) -> &Transform<World, Camera> {
        self.solved.pose(self.objects + station)
    }

    /// How well that is known.
    pub fn covariance(&self, station: usize) -> Covariance6<World, Camera> {
        self.solved.covariance(self.objects + station)
    }

    /// The motion from one station to another, with what both errors have in common taken into account.
    pub fn relative(&self, from: usize, to: usize) -> Option<Local> {
        self.solved.relative(self.objects + from, self.objects + to)
    }

    /// A station relative to an object. `None` where nothing connects them.
    pub fn navigated(&self, object: usize, station: usize) -> Option<Navigated> {
        let to = self.objects + station;
        let Local { motion, covariance, .. } = self.solved.relative(object, to)?;
        let standing = Standing::new(motion.relabel(), Covariance6::new(covariance.matrix));
        let shares = self.lasting.get(&station).map(|lasting| self.solved.shares(object, to, *lasting));
        Some(Navigated { object, standing: Standing { shares: shares.unwrap_or(standing.shares), ..standing } })
    }

    /// The loops that were given up: they contradict the rest.
    pub fn wrong_loops(&self) -> Vec<usize> {
        self.given_up(&self.loops)
    }

    /// The fixes that were given up.
    pub fn wrong_fixes(&self) -> Vec<usize> {
        self.given_up(&self.fixes)
    }

    fn given_up(&self, factors: &[usize]) -> Vec<usize> {
        let wrong = |(index, factor): (usize, &usize)| self.solved.given_up(*factor).then_some(index);
        factors.iter().enumerate().filter_map(wrong).collect()
    }
}

/// The covariance of the pose `world_from_camera` of a camera that is known relative to an object.
pub(crate) fn in_world(navigated: &Navigated, places: &[Place]) -> (Transform<World, Camera>, Matrix6<f64>) {
    let place = &places[navigated.object];
    let here = navigated.standing.object_from_camera;
    let adjoint = here.inverse().adjoint();
    let survey = adjoint * place.covariance.matrix * adjoint.transpose();
    (place.world_from_object * here, navigated.standing.covariance.matrix + survey)
}
