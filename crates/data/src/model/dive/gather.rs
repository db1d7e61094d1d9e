//! The search for all features in all pairs that may show them.

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use rayon::prelude::*;
use seafix_component::Fault;
use seafix_geometry::{Pixel, Point, World};
use seafix_vision::Image;

use super::{
    expect::ExpectedPose,
    find::{Appearance, Expectation, Finder, Found, Missed},
    settle::{Key, Scene},
    template::Template,
    trail::Trail,
};
use crate::stereo_pairs::StereoPairs;

/// A feature that is searched for.
#[derive(Debug, Clone)]
pub(super) struct Feature {
    /// Whether it is a corner, located by itself in every image; otherwise its first mark's surroundings define it.
    pub(super) corner: bool,
    /// Its surroundings in some pairs; the first is that of its first mark.
    pub(super) templates: Vec<Template>,
    /// The covariance of its position (m², world axes).
    pub(super) spread: Matrix3<f64>,
}

/// The result of the searches: what was found, and why the rest was not.
#[derive(Debug, Clone, Default)]
pub(super) struct Gathered {
    /// The features found.
    pub(super) seen: BTreeMap<Key, Found>,
    /// The reasons of the others, with the place where they were expected.
    pub(super) missed: BTreeMap<Key, (Pixel, Missed)>,
}

/// A searched feature, where it was expected, and the result.
type Searched = (Key, Pixel, Result<Found, Missed>);

/// A displacement (px) of the expected place by which a new search begins elsewhere.
const ELSEWHERE: f64 = 1.0;

impl Gathered {
    /// Whether a feature that is expected at `place` is still to be searched for.
    fn sought(&self, key: &Key, place: Pixel) -> bool {
        let missed = self.missed.get(key).is_some_and(|(at, _)| at.distance(&place) < ELSEWHERE);
        !self.seen.contains_key(key) && !missed
    }

    /// Searches for the `features` with the indices `known` in all pairs of the dive whose poses are known; returns the
    /// number of new findings.
    ///
    /// A pair is read only if it may show a feature that it was not searched for at that place before. Pairs are
    /// independent, so the result does not depend on the number of threads.
    pub(super) fn gather(
        &mut self,
        dive: &StereoPairs,
        finder: &Finder<'_>,
        trail: &Trail,
        scene: &Scene,
        features: &[Feature],
        known: &[usize],
    ) -> (usize, Vec<Fault>) {
        let search = |pair: usize| -> Option<Result<Vec<Searched>, Fault>> {
            let pose = ExpectedPose::of(pair, &scene.poses, trail)?;
            let expected: Vec<(usize, Expectation)> = known
                .iter()
                .filter_map(|&index| {
                    let expectation = pose.sees(finder.rig, &scene.features[index], &features[index].spread)?;
                    self.sought(&(pair, index), expectation.pixels.left).then_some((index, expectation))
                })
                .collect();
            if expected.is_empty() {
                return None;
            }
            Some(dive.pair(pair).map(|(left, right)| {
                let search = |(index, expectation): &(usize, Expectation)| {
                    let feature = &features[*index];
                    let appearance = appearance(feature, &scene.features[*index], &pose, scene);
                    let found = find(finder, [&left, &right], feature, expectation, appearance);
                    ((pair, *index), expectation.pixels.left, found)
                };
                expected.iter().map(search).collect()
            }))
        };
        let results: Vec<_> = (0..dive.stamps().len()).into_par_iter().map(search).collect();
        let (mut count, mut unread) = (0, Vec::new());
        for result in results.into_iter().flatten() {
            match result {
                Err(fault) => unread.push(fault),
                Ok(all) => {
                    for (key, place, found) in all {
                        match found {
                            Ok(found) => {
                                self.missed.remove(&key);
                                self.seen.insert(key, found);
                                count += 1;
                            }
                            Err(why) => {
                                self.missed.insert(key, (place, why));
                            }
                        }
                    }
                }
            }
        }
        (count, unread)
    }
}

fn find(
    finder: &Finder<'_>,
    images: [&Image; 2],
    feature: &Feature,
    expectation: &Expectation,
    appearance: Option<Appearance<'_>>,
) -> Result<Found, Missed> {
    if feature.corner {
        return finder.corner(images, expectation, appearance);
    }
    finder.patch(images, expectation, appearance.ok_or(Missed::Unlike)?)
}

/// The template whose direction of view is nearest to that of the pair.
fn appearance<'a>(
    feature: &'a Feature,
    at: &Point<World>,
    pose: &ExpectedPose,
    scene: &Scene,
) -> Option<Appearance<'a>> {
    let there_from_world = pose.world_from_camera.inverse();
    let ray = pose.world_from_camera.translation() - at.coords;
    let view = |template: &'a Template| {
        let world_from_here = scene.poses[template.pair]?;
        let angle = ray.angle(&(world_from_here.translation() - at.coords));
        let here = world_from_here.inverse() * *at;
        Some((angle, Appearance { template, here, there_from_here: there_from_world * world_from_here }))
    };
    let views = feature.templates.iter().filter_map(view);
    views.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, appearance)| appearance)
}
