//! Proposals of features that an operator may mark.

mod candidates;
mod choose;
mod confirm;

use std::collections::BTreeMap;

use rayon::prelude::*;
use seafix_component::Fault;
use seafix_geometry::{Camera, Pixel, Transform, World};
use seafix_navigation::Odometry;
use seafix_vision::{FrontEnd, Image};

use self::{
    candidates::{Corner, candidates, corners},
    choose::{chosen, objects},
    confirm::{Confirmed, confirmed},
};
use super::{
    find::Finder,
    picture::{HALF, Picture, cut},
    trail::Trail,
};
use crate::stereo_pairs::StereoPairs;

/// The search for features worth a mark.
#[derive(Debug)]
pub struct Proposer<'a> {
    /// The front end.
    pub front_end: &'a FrontEnd,
    /// The odometry of the dive; `None` to propose what the pair with the most corners shows alone.
    pub odometry: Option<&'a dyn Odometry>,
    /// The radius (px) within which a corner is searched around its expected position.
    pub reach: f64,
    /// The maximum number of proposals.
    pub count: usize,
}

/// A proposed feature in the pair that shows it best.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The name: a letter for its object and a number, the best first.
    pub id: String,
    /// The stamp of the pair (ns).
    pub stamp_ns: u64,
    /// The position in the left image.
    pub left: Pixel,
    /// The number of examined pairs that show it where it is expected.
    pub views: usize,
    /// The largest angle between two of its lines of sight (rad).
    pub parallax: f64,
    /// The standard deviation of a coordinate (m), with the poses as exact.
    pub sigma: f64,
    /// Its surroundings; `None` if the image is no longer readable.
    pub picture: Option<Picture>,
}

/// Number of examined pairs: more add next to nothing to features that five of them must show.
const EXAMINED: usize = 120;
/// Number of candidates for each proposal that are searched for in all pairs: those that most pairs detect.
const CANDIDATES: usize = 20;
/// Minimum number of examined pairs that show a proposal.
const MIN_VIEWS: usize = 5;
/// Minimum parallax of a proposal (rad): 15°.
const MIN_PARALLAX: f64 = 0.26;
/// Maximum standard deviation of a proposal's coordinate (m).
const MAX_SIGMA: f64 = 2e-3;

impl Proposer<'_> {
    /// The proposals, the best of each object first; faults of unreadable pairs beside them.
    pub fn propose(&self, dive: &StereoPairs, progress: &mut dyn FnMut()) -> (Vec<Proposal>, Vec<Fault>) {
        let (trail, unread) = match self.odometry {
            Some(odometry) => Trail::by_odometry(dive, odometry, progress),
            None => (Trail::unknown(dive.stamps().len()), Vec::new()),
        };
        let poses = match self.odometry {
            Some(_) => largest_segment(&trail),
            None => (0..dive.stamps().len()).map(|pair| (pair, Transform::identity())).collect(),
        };
        let step = poses.len().div_ceil(EXAMINED).max(1);
        let mut examined: Vec<(usize, Transform<World, Camera>)> = poses.into_iter().step_by(step).collect();
        let mut corners: Vec<Vec<Corner>> =
            examined.par_iter().map(|(pair, pose)| corners(self.front_end, dive, *pair, pose)).collect();
        if self.odometry.is_none() {
            // No pair knows where another one is: the one with the most corners stands alone.
            let best = (0..corners.len()).rev().max_by_key(|index| corners[*index].len());
            (examined, corners) = best.map(|best| (examined[best], corners.swap_remove(best))).into_iter().unzip();
        }
        let mut candidates = candidates(corners);
        candidates.truncate(CANDIDATES * self.count);
        let finder = Finder { front_end: self.front_end, rig: &dive.rig, reach: self.reach };
        let mut features = confirmed(&finder, dive, &trail, &examined, &candidates);
        features.retain(|feature| self.odometry.is_none() || feature.is_good());
        (self.named(dive, &chosen(features, self.count)), unread)
    }

    /// The names of the proposals, with their pictures.
    fn named(&self, dive: &StereoPairs, chosen: &[Confirmed]) -> Vec<Proposal> {
        let mut images: BTreeMap<usize, Option<Image>> = BTreeMap::new();
        let mut count: BTreeMap<usize, usize> = BTreeMap::new();
        let objects = objects(chosen);
        let propose = |(feature, object): (&Confirmed, usize)| {
            let number = count.entry(object).or_insert(0);
            *number += 1;
            let (pair, left) = feature.clearest(dive);
            let image = images.entry(pair).or_insert_with(|| dive.pair(pair).ok().map(|pair| pair.0));
            let picture = image.as_ref().and_then(|image| {
                let (image, place) = cut(image, left, HALF)?;
                Some(Picture { stamp_ns: dive.stamps()[pair], image, place, sigma: [0.0; 2] })
            });
            Proposal {
                id: format!("{}{number}", letter(object)),
                stamp_ns: dive.stamps()[pair],
                left,
                views: feature.pairs.len(),
                parallax: feature.parallax,
                sigma: feature.sigma,
                picture,
            }
        };
        chosen.iter().zip(objects).map(propose).collect()
    }
}

/// The name of an object's proposals: A to Z, then A1 to Z1 and so on.
fn letter(object: usize) -> String {
    let first = char::from(b'A' + (object % 26) as u8);
    if object < 26 { first.to_string() } else { format!("{first}{}-", object / 26) }
}

/// The poses of the segment with the largest number of pairs; its first pair is the world.
fn largest_segment(trail: &Trail) -> Vec<(usize, Transform<World, Camera>)> {
    let mut segments: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    (0..trail.pairs()).for_each(|pair| {
        if let Some(segment) = trail.segment(pair) {
            segments.entry(segment).or_default().push(pair);
        }
    });
    let Some(pairs) = segments.into_values().rev().max_by_key(Vec::len) else { return Vec::new() };
    let mut pose = Transform::identity();
    let mut poses = vec![(pairs[0], pose)];
    for two in pairs.windows(2) {
        let Some(step) = trail.motion(two[0], two[1]) else { break };
        pose = pose * step.motion;
        poses.push((two[1], pose));
    }
    poses
}

impl Confirmed {
    fn is_good(&self) -> bool {
        self.pairs.len() >= MIN_VIEWS && self.sigma <= MAX_SIGMA && self.parallax >= MIN_PARALLAX
    }

    /// The pair that shows it nearest to the middle of its image, with its place there.
    fn clearest(&self, dive: &StereoPairs) -> (usize, Pixel) {
        let [u, v] = dive.rig.left().principal();
        let off = |place: &Pixel| place.distance(&Pixel { u, v });
        *self.pairs.iter().min_by(|a, b| off(&a.1).total_cmp(&off(&b.1))).expect("a pair shows it")
    }
}
