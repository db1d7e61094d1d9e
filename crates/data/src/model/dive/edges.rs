//! The straight edges of an object, from the lines of all adjusted pairs.
//!
//! A track collects the lines of many pairs that lie on one line in space. Each line measures the offsets of the track's
//! ends across it, and least squares adds them up. The outline of a pipe and the border of a shadow move with the
//! camera, so their tracks end after a few pairs; an edge of the body stays.

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use seafix_geometry::{Camera, Object, Point, Transform};
use seafix_referencing::{End, ModelPoint};
use seafix_vision::{LineFrontEnd, LineOutput};

use super::{
    edge_track::{Fitted, Track, distinct, follow},
    edge_view::View,
    parallax::largest_angle,
};
use crate::stereo_pairs::StereoPairs;

/// The search for edges.
pub(super) struct EdgeSearch<'a> {
    /// The measurement of lines in a pair.
    pub(super) front_end: &'a LineFrontEnd,
    /// The pairs.
    pub(super) dive: &'a StereoPairs,
    /// The adjusted pairs with their poses.
    pub(super) views: &'a [(usize, Transform<Object, Camera>)],
    /// The points.
    pub(super) points: &'a [ModelPoint],
    /// The distance (px) of a line in a pair from its edge, beyond the noise.
    pub(super) slack_px: f64,
    /// The distance (px) of an edge from the physical one, in common to all pairs.
    pub(super) common_px: f64,
}

/// An edge of the object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FoundEdge {
    /// The ends.
    pub(super) ends: [End; 2],
    /// The standard deviation (m) of an end that is a place.
    pub(super) sigma: f64,
    /// χ² of its lines per degree of freedom.
    pub(super) scatter: f64,
    /// The pairs that show the edge.
    pub(super) pairs: Vec<usize>,
    /// The number of pairs with both ends in view.
    pub(super) in_view: usize,
}

// The numbers below were chosen on orbits about seven objects of one simulator, at 3 m and 4.5 m.

/// The minimum number of pairs that show an edge.
const PAIRS: usize = 3;
/// The minimum fraction of the pairs with both ends in view that show the edge.
const SHOWN: f64 = 0.5;
/// The minimum angle (rad) between the views of an edge, about the edge: an outline moves in between.
const PARALLAX: f64 = 0.35;
/// The largest standard deviation of an edge, as a multiple of their median: lines of an outline scatter more.
const MOVES: f64 = 2.5;
/// The maximum number of edges, that of an object in a site.
const MAX_EDGES: usize = 500;
/// The minimum length (m): twice that of an edge in a site.
const MIN_LENGTH: f64 = 0.04;
/// The distance of an edge from the marked points, as a fraction of their largest distance.
const REGION: f64 = 0.25;

impl EdgeSearch<'_> {
    /// The edges near the points, those that most pairs show first.
    ///
    /// In a first pass over the pairs, lines that no track explains begin tracks. The second pass measures the edges found
    /// so, over their complete length.
    pub(super) fn edges(&self) -> Vec<FoundEdge> {
        let views: Vec<View> = self.views.par_iter().map(|view| self.view(view)).collect();
        let slack = self.slack_px / self.dive.rig.mean_focal();
        let mut tracks = Vec::new();
        for view in &views {
            follow(&mut tracks, view, slack, |line| self.is_near(line));
        }
        let enough = tracks.iter().filter(|track: &&Track| track.pairs() >= PAIRS);
        let mut tracks = distinct(enough.filter_map(Track::fitted).collect(), slack);
        for view in &views {
            follow(&mut tracks, view, slack, |_| false);
        }
        let fitted = tracks.iter().filter(|track| track.pairs() >= PAIRS).filter_map(Track::fitted);
        let fitted: Vec<Fitted> = fitted.filter(|edge| self.is_shown(edge, &views)).collect();
        let mut sigmas: Vec<f64> = fitted.iter().map(|edge| edge.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let Some(median) = sigmas.get(sigmas.len() / 2) else { return Vec::new() };
        let mut kept: Vec<&Fitted> = Vec::new();
        for edge in fitted.iter().filter(|edge| edge.sigma <= MOVES * median) {
            // The second pass may have moved two edges onto one line.
            if kept.len() < MAX_EDGES && kept.iter().all(|other| edge.part_on(other, slack).is_none()) {
                kept.push(edge);
            }
        }
        kept.into_iter().map(|edge| self.edge(edge, &views)).collect()
    }

    /// The lines of one pair; none if its images cannot be read.
    fn view(&self, (pair, object_from_camera): &(usize, Transform<Object, Camera>)) -> View {
        let mut output = LineOutput::default();
        if let Ok((left, right)) = self.dive.pair(*pair) {
            self.front_end.run([&left, &right], &self.dive.rig, &mut output);
        }
        View::new(*pair, *object_from_camera, &output.lines)
    }

    /// Whether a line (object frame) lies near the marked points.
    fn is_near(&self, ends: &[Vector3<f64>; 2]) -> bool {
        let reach = REGION * self.size();
        let near = |end: &Vector3<f64>| self.points.iter().any(|point| (point.at.coords - end).norm() <= reach);
        near(&ends[0]) && near(&ends[1]) && (ends[1] - ends[0]).norm() >= MIN_LENGTH
    }

    /// The largest distance of two points (m).
    fn size(&self) -> f64 {
        let pairs = self.points.iter().enumerate().flat_map(|(k, a)| self.points[..k].iter().map(move |b| (a, b)));
        pairs.map(|(a, b)| a.at.distance(&b.at)).fold(0.0, f64::max)
    }

    /// Whether an edge is near the points, and enough pairs from different directions show it.
    fn is_shown(&self, found: &Fitted, views: &[View]) -> bool {
        let shows = views.iter().filter(|view| found.pairs.contains(&view.pair));
        let rays: Vec<Vector3<f64>> = shows.map(|view| view.ray_across(&found.ends)).collect();
        let count = found.pairs.len();
        count >= PAIRS
            && count as f64 >= SHOWN * self.in_view(found, views) as f64
            && self.is_near(&found.ends)
            && largest_angle(&rays) >= PARALLAX
    }

    /// The number of pairs with both ends in view.
    fn in_view(&self, found: &Fitted, views: &[View]) -> usize {
        views.iter().filter(|view| view.shows(&found.ends, &self.dive.rig)).count()
    }

    fn edge(&self, found: &Fitted, views: &[View]) -> FoundEdge {
        let common = self.common_px / self.dive.rig.mean_focal() * found.depth;
        let sigma = Vector2::new(found.sigma, common).norm();
        let points = found.ends.map(|end| self.point_at(end, sigma));
        // A point that is less known than the edge is long names neither end.
        let named = points[0] != points[1];
        let end = |k: usize| match points[k].filter(|_| named) {
            Some(index) => End::Point(index),
            None => End::At(Point::from(found.ends[k])),
        };
        FoundEdge {
            ends: [end(0), end(1)],
            sigma,
            scatter: found.scatter,
            pairs: found.pairs.clone(),
            in_view: self.in_view(found, views),
        }
    }

    /// The point at an end.
    fn point_at(&self, end: Vector3<f64>, sigma: f64) -> Option<usize> {
        let near = |index: &usize| {
            let point = &self.points[*index];
            (point.at.coords - end).norm() <= 3.0 * Vector2::new(point.sigma, sigma).norm()
        };
        (0..self.points.len()).find(near)
    }
}
