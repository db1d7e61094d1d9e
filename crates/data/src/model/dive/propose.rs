//! Proposals of features that an operator may mark.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use seafix_component::Fault;
use seafix_geometry::{Camera, Pixel, Point, Transform, World};
use seafix_navigation::Odometry;
use seafix_vision::{FrontEnd, FrontEndOutput, Image};

use super::{
    picture::{HALF, Picture, cut},
    plane::Plane,
    trail::Trail,
};
use crate::stereo_pairs::StereoPairs;

/// The search for features worth a mark.
#[derive(Debug)]
pub struct Proposer<'a> {
    /// The front end.
    pub front_end: &'a FrontEnd,
    /// The odometry of the dive.
    pub odometry: &'a dyn Odometry,
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
    /// The number of examined pairs that show it.
    pub views: usize,
    /// The largest angle between two of its lines of sight (rad).
    pub parallax: f64,
    /// The standard deviation of a coordinate (m).
    pub sigma: f64,
    /// Its surroundings; `None` for an image that cannot be read again.
    pub picture: Option<Picture>,
}

/// Number of examined pairs: more add next to nothing to features that five of them must show.
const EXAMINED: usize = 120;
/// Minimum number of examined pairs that show a proposal.
const MIN_VIEWS: usize = 5;
/// Minimum parallax of a proposal (rad): 15°.
const MIN_PARALLAX: f64 = 0.26;
/// Maximum standard deviation of a proposal's coordinate (m).
const MAX_SIGMA: f64 = 2e-3;
/// The variance (px²) of a corner's position that tells a fitted corner from a detector's maximum.
const FITTED: f64 = 0.25;
/// The drift of an odometry (m) over the pairs that show one feature.
const DRIFT: f64 = 5e-3;
/// The 99 % quantile of χ² with three degrees of freedom.
const GATE: f64 = 11.345;
/// The largest distance (m) between a feature's positions in two pairs.
const NEAR: f64 = 0.05;
/// Minimum distance (m) between two proposals.
const APART: f64 = 0.04;
/// Distance (m) between features that belong to different objects.
const OBJECTS_APART: f64 = 2.0;
/// Distance from the seabed's plane, in standard deviations of the feature and of the bed, of a feature on an object.
const OFF_SEABED: f64 = 4.0;

/// A corner of one pair.
#[derive(Debug, Clone, Copy)]
struct Corner {
    pair: usize,
    left: Pixel,
    world: Point<World>,
    covariance: Matrix3<f64>,
    centre: Vector3<f64>,
}

/// Corners of several pairs at one place.
#[derive(Debug, Clone)]
struct Track {
    corners: Vec<Corner>,
    at: Point<World>,
    information: Matrix3<f64>,
}

impl Proposer<'_> {
    /// The proposals, the best of each object first; faults of unreadable pairs beside them.
    pub fn propose(&self, dive: &StereoPairs, progress: &mut dyn FnMut()) -> (Vec<Proposal>, Vec<Fault>) {
        let (trail, unread) = Trail::by_odometry(dive, self.odometry, progress);
        let poses = largest_segment(&trail);
        let step = poses.len().div_ceil(EXAMINED).max(1);
        let examined: Vec<(usize, Transform<World, Camera>)> = poses.into_iter().step_by(step).collect();
        let corners: Vec<Vec<Corner>> =
            examined.par_iter().map(|(pair, pose)| self.corners(dive, *pair, pose)).collect();
        let mut tracks: Vec<Track> = Vec::new();
        corners.iter().for_each(|corners| join(&mut tracks, corners));
        let seabed = Plane::through(&tracks.iter().map(|track| track.at.coords).collect::<Vec<_>>());
        tracks.retain(|track| track.is_good() && seabed.as_ref().is_none_or(|seabed| off(track, seabed)));
        tracks.sort_by(|a, b| a.sigma().total_cmp(&b.sigma()));
        let mut chosen: Vec<Track> = Vec::new();
        for track in tracks {
            if chosen.len() < self.count && chosen.iter().all(|other| other.at.distance(&track.at) >= APART) {
                chosen.push(track);
            }
        }
        (self.named(dive, &chosen), unread)
    }

    /// The fitted corners of a pair, in the world.
    fn corners(&self, dive: &StereoPairs, pair: usize, pose: &Transform<World, Camera>) -> Vec<Corner> {
        let Ok((left, right)) = dive.pair(pair) else { return Vec::new() };
        let mut output = FrontEndOutput::default();
        self.front_end.run(&left, &right, &dive.rig, &mut output);
        let turn = pose.rotation_matrix();
        let corner = |point: &seafix_geometry::MeasuredPoint| {
            let pixels = point.pixels?;
            (pixels.covariance[(0, 0)] < FITTED).then(|| Corner {
                pair,
                left: pixels.at.left,
                world: *pose * point.position.at,
                covariance: turn * point.position.covariance * turn.transpose() + Matrix3::identity() * (DRIFT * DRIFT),
                centre: pose.translation(),
            })
        };
        output.cloud.iter().filter_map(corner).collect()
    }

    /// The names of the proposals, with their pictures.
    fn named(&self, dive: &StereoPairs, chosen: &[Track]) -> Vec<Proposal> {
        let mut images: BTreeMap<usize, Option<Image>> = BTreeMap::new();
        let mut count: BTreeMap<usize, usize> = BTreeMap::new();
        let objects = objects(chosen);
        let propose = |(track, object): (&Track, usize)| {
            let number = count.entry(object).or_insert(0);
            *number += 1;
            let corner = track.clearest(dive);
            let image = images.entry(corner.pair).or_insert_with(|| dive.pair(corner.pair).ok().map(|pair| pair.0));
            let picture = image.as_ref().and_then(|image| {
                let (image, place) = cut(image, corner.left, HALF)?;
                Some(Picture { stamp_ns: dive.stamps()[corner.pair], image, place, sigma: [0.0; 2] })
            });
            Proposal {
                id: format!("{}{number}", letter(object)),
                stamp_ns: dive.stamps()[corner.pair],
                left: corner.left,
                views: track.corners.len(),
                parallax: track.parallax(),
                sigma: track.sigma(),
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

/// Adds the corners of one pair to the tracks: each to the nearest one, or as a track of its own.
fn join(tracks: &mut Vec<Track>, corners: &[Corner]) {
    let before = tracks.len();
    for corner in corners {
        let distance = |track: &Track| -> Option<f64> {
            let step = corner.world - track.at;
            if step.norm() > NEAR || track.corners.last().is_some_and(|last| last.pair == corner.pair) {
                return None;
            }
            let spread = corner.covariance + track.information.try_inverse()?;
            let chi2 = step.dot(&spread.cholesky()?.solve(&step));
            (chi2 <= GATE).then_some(chi2)
        };
        let near = (0..before).filter_map(|index| Some((distance(&tracks[index])?, index)));
        let Some(information) = corner.covariance.try_inverse() else { continue };
        match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, index)) => {
                let track = &mut tracks[index];
                let sum = track.information + information;
                let moved = information * (corner.world - track.at);
                if let Some(step) = sum.try_inverse().map(|inverse| inverse * moved) {
                    track.at = track.at + step;
                    track.information = sum;
                    track.corners.push(*corner);
                }
            }
            None => tracks.push(Track { corners: vec![*corner], at: corner.world, information }),
        }
    }
}

impl Track {
    /// The standard deviation of a coordinate (m).
    fn sigma(&self) -> f64 {
        self.information.try_inverse().map_or(f64::INFINITY, |covariance| (covariance.trace() / 3.0).sqrt())
    }

    fn parallax(&self) -> f64 {
        let rays: Vec<Vector3<f64>> = self.corners.iter().map(|corner| corner.centre - self.at.coords).collect();
        let pairs = rays.iter().enumerate().flat_map(|(k, a)| rays[..k].iter().map(move |b| a.angle(b)));
        pairs.fold(0.0, f64::max)
    }

    fn is_good(&self) -> bool {
        self.corners.len() >= MIN_VIEWS && self.sigma() <= MAX_SIGMA && self.parallax() >= MIN_PARALLAX
    }

    /// The corner nearest to the middle of its image.
    fn clearest(&self, dive: &StereoPairs) -> &Corner {
        let [u, v] = dive.rig.left().principal();
        let off = |corner: &Corner| corner.left.distance(&Pixel { u, v });
        self.corners.iter().min_by(|a, b| off(a).total_cmp(&off(b))).expect("a track has a corner")
    }
}

/// Whether a feature lies off the seabed.
fn off(track: &Track, seabed: &Plane) -> bool {
    seabed.distance(&track.at.coords).abs() > OFF_SEABED * (track.sigma().powi(2) + seabed.sigma.powi(2)).sqrt()
}

/// The object of each track: clusters of features, numbered by the order of their best one.
fn objects(tracks: &[Track]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..tracks.len()).collect();
    for a in 0..tracks.len() {
        for b in 0..a {
            if tracks[a].at.distance(&tracks[b].at) < OBJECTS_APART && group[a] != group[b] {
                let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|own| **own == from).for_each(|own| *own = to);
            }
        }
    }
    let mut first: Vec<usize> = group.clone();
    first.sort_unstable();
    first.dedup();
    group.iter().map(|own| first.binary_search(own).expect("it is one of them")).collect()
}
