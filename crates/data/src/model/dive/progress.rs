//! The search for marked features in all pairs, in turn with the adjustment, until nothing new is found.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use seafix_component::Fault;
use seafix_geometry::{Point, Transform, UncertainPixels};

use super::{
    expect::ExpectedPose,
    find::Finder,
    gather::{Feature, Gathered},
    parallax::largest_angle,
    recover::{MarkRay, recovered},
    relocate::relocate,
    settle::{HELD, Key, Scene, Settled, settle},
    start::{Located, Marked},
    trail::Trail,
};
use crate::{
    model::{adjust::CalibrationSigma, frame::inner},
    stereo_pairs::StereoPairs,
};

/// The maximum number of searches; later ones find next to nothing.
const ROUNDS: usize = 5;

/// The number of pairs that must miss a feature of one observation before it is given up: one may be occluded.
const SEVERAL: usize = 2;
/// The inverse of the fraction of its pairs that must observe a feature, unless they see it from several directions.
const FEW: usize = 4;
/// The angle (rad) between lines of sight within which a wrong depth changes the expected places little: 10°.
const ONE_DIRECTION: f64 = 0.17;

/// The progress of a search: the model so far.
pub(super) struct Progress<'a> {
    pub(super) trail: Trail,
    pub(super) scene: Scene,
    pub(super) features: Vec<Feature>,
    pub(super) gathered: Gathered,
    /// Whether the position of each feature is known.
    known: Vec<bool>,
    finder: Finder<'a>,
    /// Pairs that cannot be read, and marks that nothing connects.
    pub(super) warnings: Vec<Fault>,
}

impl<'a> Progress<'a> {
    /// The marks that one segment of the odometry, or one pair, connects: the world is the camera of the first of them.
    pub(super) fn begin(marked: &[Marked], trail: Trail, finder: Finder<'a>, unread: Vec<Fault>) -> Self {
        let mut counts: BTreeMap<(Option<usize>, usize), usize> = BTreeMap::new();
        // A pair without an odometry is a group of its own.
        let group = |pair: usize| trail.segment(pair).map_or((None, pair), |segment| (Some(segment), 0));
        let all = || marked.iter().flat_map(|feature| &feature.marks);
        all().for_each(|mark| *counts.entry(group(mark.pair)).or_default() += 1);
        let best = counts.iter().rev().max_by_key(|(_, count)| **count).map(|(group, _)| *group);
        let origin = all().map(|mark| mark.pair).filter(|pair| Some(group(*pair)) == best).min().unwrap_or(0);
        let mut poses = vec![None; trail.pairs()];
        poses[origin] = Some(Transform::identity());
        let features = marked.iter().map(|feature| Feature {
            corner: feature.marks[0].corner,
            templates: feature.marks.iter().map(|mark| mark.template.clone()).collect(),
            spread: Matrix3::zeros(),
        });
        let scene = Scene { poses, features: vec![Point::origin(); marked.len()] };
        let mut gathered = Gathered::default();
        for (index, feature) in marked.iter().enumerate() {
            // A feature that its mark defines has one such mark; others are guesses of the same place.
            let corner = feature.marks[0].corner;
            let defining = feature.marks.iter().enumerate().filter(|(k, mark)| *k == 0 || corner && mark.corner);
            for (mark, (found, _)) in defining.filter_map(|(_, mark)| Some((mark, mark.measured?))) {
                gathered.seen.insert((mark.pair, index), found);
            }
        }
        let known = vec![false; marked.len()];
        let features = features.collect();
        let mut state = Self { trail, scene, features, gathered, known, finder, warnings: unread };
        state.place(marked);
        state
    }

    /// Places the features whose first mark lies in a pair with a pose.
    fn place(&mut self, marked: &[Marked]) {
        for (index, feature) in marked.iter().enumerate().filter(|(index, _)| !self.known[*index]).collect::<Vec<_>>() {
            let placed = feature.marks.iter().find_map(|mark| {
                Some((ExpectedPose::of(mark.pair, &self.scene.poses, &self.trail)?, mark.measured?.1))
            });
            let Some((pose, point)) = placed else { continue };
            let turn = pose.world_from_camera.rotation_matrix();
            self.scene.features[index] = pose.world_from_camera * point.at;
            self.features[index].spread = turn * point.covariance * turn.transpose();
            self.known[index] = true;
        }
    }

    /// Searches and adjusts until nothing new is found.
    pub(super) fn rounds(
        &mut self,
        dive: &'a StereoPairs,
        marked: &[Marked],
        file: &Path,
    ) -> Result<Settled<'a>, Vec<Fault>> {
        let (mut tried, mut recovering) = (vec![0; dive.stamps().len()], true);
        for round in 1.. {
            self.place(marked);
            let (found, unread) = self.gather(dive);
            self.warnings.extend(unread);
            let settled = self.settle(dive, file)?;
            let located = self.relocate(dive, &mut tried);
            if (found == 0 && located == 0) || round >= ROUNDS {
                if std::mem::take(&mut recovering) && self.recover(dive, &settled, marked) > 0 {
                    continue;
                }
                return self.complete(settled, marked, file);
            }
        }
        unreachable!("the last round returns")
    }

    fn gather(&mut self, dive: &StereoPairs) -> (usize, Vec<Fault>) {
        let places = self.places();
        self.gathered.gather(dive, &self.finder, &self.trail, &self.scene, &self.features, &places)
    }

    /// The features with a known position.
    fn places(&self) -> Vec<usize> {
        (0..self.known.len()).filter(|index| self.known[*index]).collect()
    }

    /// Adjusts, and keeps the poses of the adjusted pairs alone.
    fn settle(&mut self, dive: &'a StereoPairs, file: &Path) -> Result<Settled<'a>, Vec<Fault>> {
        let pairs: Vec<usize> = self.gathered.seen.keys().map(|key| key.0).collect();
        let expected = |pair: usize| ExpectedPose::of(pair, &self.scene.poses, &self.trail);
        let poses: Vec<_> = pairs.iter().map(|pair| (*pair, expected(*pair))).collect();
        for (pair, pose) in poses {
            self.scene.poses[pair] = pose.map(|pose| pose.world_from_camera);
        }
        let seen = self.pixels();
        let undetermined = |_| {
            let fault = Fault::new("the marks determine no model", file);
            vec![fault.remedy("mark at least three features that are not on a line in one pair")]
        };
        let settled = settle(&dive.rig, &self.trail, &mut self.scene, &seen).map_err(undetermined)?;
        for pair in 0..self.scene.poses.len() {
            if settled.pairs.binary_search(&pair).is_err() {
                self.scene.poses[pair] = None;
            }
        }
        let exact = CalibrationSigma { pixels: 0.0, baseline: 0.0 };
        let spread = settled.adjustment.spread(&settled.excess, &exact).map_err(undetermined)?;
        let own = inner(&settled.adjustment.points, &spread.noise);
        for (point, feature) in settled.features.iter().enumerate() {
            self.features[*feature].spread = own.fixed_view::<3, 3>(3 * point, 3 * point).into_owned();
        }
        Ok(settled)
    }

    fn pixels(&self) -> BTreeMap<Key, UncertainPixels> {
        self.gathered.seen.iter().map(|(key, found)| (*key, found.pixels)).collect()
    }

    /// Finds the poses of pairs that no odometry connects, at most twice each; returns their number.
    ///
    /// One pair connects its complete segment. Pairs that the odometry skipped are unusable.
    fn relocate(&mut self, dive: &StereoPairs, tried: &mut [usize]) -> usize {
        let known = self.places();
        if known.len() < HELD {
            return 0;
        }
        let usable = |pair: usize| self.trail.is_unknown() || self.trail.segment(pair).is_some();
        let lost = |pair: usize| ExpectedPose::of(pair, &self.scene.poses, &self.trail).is_none();
        let pairs: Vec<usize> =
            (0..tried.len()).filter(|pair| usable(*pair) && tried[*pair] < 2 && lost(*pair)).collect();
        pairs.iter().for_each(|pair| tried[*pair] += 1);
        let pose = |pair: &usize| {
            let (left, right) = dive.pair(*pair).ok()?;
            relocate(&self.finder, [&left, &right], &self.scene, &self.features, &known)
        };
        let poses: Vec<_> = pairs.par_iter().map(pose).collect();
        let mut count = 0;
        for (pair, pose) in pairs.into_iter().zip(poses) {
            // Another pair of the same segment may have connected it.
            let lost = ExpectedPose::of(pair, &self.scene.poses, &self.trail).is_none();
            if let Some(pose) = pose.filter(|_| lost) {
                self.scene.poses[pair] = Some(pose);
                count += 1;
            }
        }
        count
    }

    /// Finds corners for marks that have none, or whose point the other pairs do not show; returns their number.
    fn recover(&mut self, dive: &StereoPairs, settled: &Settled<'_>, marked: &[Marked]) -> usize {
        let alone = self.unconfirmed(settled);
        let posed = |mark: &&Located| self.scene.poses[mark.pair].is_some();
        let lines =
            marked.iter().enumerate().filter(|(index, _)| !self.features[*index].corner || alone.contains(index));
        let lines: Vec<MarkRay> = lines
            .filter_map(|(feature, marked)| {
                let mark = marked.marks.iter().find(posed)?;
                Some(MarkRay { feature, pair: mark.pair, mark: mark.mark.mark.left })
            })
            .collect();
        let known: Vec<usize> = self.places().into_iter().filter(|feature| !alone.contains(feature)).collect();
        let found = recovered(&self.finder, dive, &self.scene, &known, &lines);
        for (feature, corner) in &found {
            self.features[*feature].corner = true;
            self.features[*feature].spread = corner.covariance;
            self.scene.features[*feature] = corner.at;
            self.known[*feature] = true;
            self.gathered.seen.retain(|key, _| key.1 != *feature);
            self.gathered.missed.retain(|key, _| key.1 != *feature);
        }
        found.len()
    }

    /// The features that few of their pairs observe, all from nearly one direction: neighbours agree about a wrong depth.
    pub(super) fn unconfirmed(&self, settled: &Settled<'_>) -> BTreeSet<usize> {
        let few = |feature: usize| {
            let seen = settled.adjustment.observations.iter().filter(|seen| settled.features[seen.point] == feature);
            let at = self.scene.features[feature].coords;
            let rays: Vec<Vector3<f64>> =
                seen.map(|seen| settled.adjustment.poses[seen.view].translation() - at).collect();
            let against = settled.contradicting.keys().filter(|key| key.1 == feature);
            let missed = self.gathered.missed.keys().filter(|key| key.1 == feature);
            let all = rays.len() + against.count() + missed.count();
            let few = rays.len() == 1 && all > SEVERAL || FEW * rays.len() < all;
            few && largest_angle(&rays) < ONE_DIRECTION
        };
        settled.features.iter().copied().filter(|feature| few(*feature)).collect()
    }

    /// Adjusts without these features.
    pub(super) fn without(
        &mut self,
        features: &BTreeSet<usize>,
        dive: &'a StereoPairs,
        file: &Path,
    ) -> Result<Settled<'a>, Vec<Fault>> {
        self.gathered.seen.retain(|key, _| !features.contains(&key.1));
        features.iter().for_each(|feature| self.known[*feature] = false);
        self.settle(dive, file)
    }

    /// The adjustment, with the faults of the marks that nothing connects with it.
    ///
    /// # Errors
    /// These faults, if they are as many as the other features: then it is open which ones are the object.
    fn complete(&mut self, settled: Settled<'a>, marked: &[Marked], file: &Path) -> Result<Settled<'a>, Vec<Fault>> {
        let measured = |feature: &Marked| feature.marks[0].measured.is_some();
        let apart = marked.iter().enumerate().filter(|(index, feature)| !self.known[*index] && measured(feature));
        let faults: Vec<Fault> = apart
            .map(|(_, feature)| {
                let mark = &feature.marks[0].mark.mark;
                let where_marked = match self.trail.segment(feature.marks[0].pair) {
                    Some(segment) => format!("segment {} of the odometry", segment + 1),
                    None => "a pair without an odometry".to_owned(),
                };
                Fault::new("a mark that nothing connects with the others", file)
                    .on_line(mark.line)
                    .value(format!("`{}` in {where_marked}", feature.id))
                    .remedy("mark three features of the others in this pair as well")
            })
            .collect();
        if 2 * faults.len() >= marked.len() {
            return Err(faults);
        }
        self.warnings.extend(faults);
        Ok(settled)
    }
}
