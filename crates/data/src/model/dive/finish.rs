//! The site and the report of an adjusted dive.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use nalgebra::{DMatrix, Matrix3, Vector3};
use seafix_component::{Fault, nearest};
use seafix_geometry::{Camera, Object, Point, Transform, World};
use seafix_referencing::{End, ModelEdge, ModelPoint, Site, SiteObject};
use seafix_vision::LineFrontEnd;

use super::{
    best_views::{Shown, pictures},
    built::{DiveEdge, DiveModel, DivePoint},
    edges::{EdgeSearch, FoundEdge},
    expect::SLACK,
    find::Found,
    gather::{Feature, Gathered},
    halves::halves,
    parallax::largest_angle,
    settle::{Key, Scene, Settled},
    start::Marked,
    trail::Trail,
};
use crate::{
    model::{
        adjust::{CalibrationSigma, PointSpread},
        by_hand::{GRAIN, MIN_SINE, ModelByHand, ONE_POINT},
        frame::{ObjectFrame, inner, relative_sigmas},
    },
    stereo_pairs::StereoPairs,
};

/// An adjusted dive.
pub(super) struct Finish<'a> {
    pub(super) by_hand: &'a ModelByHand<'a>,
    pub(super) calibration: &'a CalibrationSigma,
    pub(super) corner_sigma: f64,
    pub(super) edges: Option<&'a LineFrontEnd>,
    pub(super) dive: &'a StereoPairs,
    pub(super) marked: &'a [Marked],
    /// The features that were searched for, in the order of `marked`.
    pub(super) features: &'a [Feature],
    pub(super) trail: &'a Trail,
    pub(super) scene: &'a Scene,
    pub(super) gathered: &'a Gathered,
    pub(super) settled: &'a Settled<'a>,
    /// Features that only the pair of their mark observes.
    pub(super) alone: &'a BTreeSet<usize>,
    pub(super) halves: bool,
    pub(super) pictures: bool,
    pub(super) file: &'a Path,
}

/// The largest angle (rad) between lines of sight below which a point is known as from one place: 2°.
const LITTLE_PARALLAX: f64 = 0.035;
/// The half angle (rad) of the cone about an axis in which a camera sees that side of the object.
const SIDE: f64 = std::f64::consts::FRAC_PI_4;

impl Finish<'_> {
    /// The model; `warnings` are those of its search.
    pub(super) fn model(&self, mut warnings: Vec<Fault>) -> Result<DiveModel, Fault> {
        let Settled { adjustment, pairs, features, excess, .. } = self.settled;
        if features.len() < 3 {
            return Err(Fault::new("fewer than three points remain", self.file)
                .value(features.len())
                .remedy("mark more features of the object; see the reasons with --json"));
        }
        let undetermined = |_| Fault::new("the marks determine no model", self.file).remedy("mark more features");
        let mut spread = adjustment.spread(excess, self.calibration).map_err(undetermined)?;
        self.add_common(&mut spread);
        let points = &adjustment.points;
        let free = inner(points, &spread.total());
        let base = self.base(&free)?;
        let line = |error: seafix_geometry::Collinear| {
            Fault::new(error.to_string(), self.file).remedy("choose other base points with --base")
        };
        let frame = ObjectFrame::on(points, base).map_err(line)?;
        let covariance = frame.covariance(&spread.total());
        let sigmas = relative_sigmas(&free);
        let at = |k: usize| Point::<Object>::from(frame.points[k].coords.map(|x| (x / GRAIN).round() * GRAIN));
        let mut made: Vec<DivePoint> = (0..features.len())
            .map(|k| {
                let own = covariance.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
                self.point(k, at(k), own, sigmas[k])
            })
            .collect();
        if self.pictures {
            let shown: Vec<Shown> = (0..features.len()).map(|k| self.shown(k, &free)).collect();
            let all = pictures(self.dive, self.scene, &shown);
            made.iter_mut().zip(all).for_each(|(point, pictures)| point.pictures = pictures);
        }
        let of_site =
            |point: &DivePoint| ModelPoint { sigma: rounded(point.sigma), ..ModelPoint::exact(&point.id, point.at) };
        let site_points: Vec<ModelPoint> = made.iter().map(of_site).collect();
        let found = self.edges.map(|front_end| self.found_edges(front_end, &frame.world_from_object, &site_points));
        let model_edge = |(k, edge): (usize, &FoundEdge)| ModelEdge {
            id: format!("edge-{}", k + 1),
            ends: edge.ends,
            sigma: if edge.ends.iter().any(|end| matches!(end, End::At(_))) { rounded(edge.sigma) } else { 0.0 },
            faces: Vec::new(),
        };
        let dive_edge = |(k, edge): (usize, &FoundEdge)| DiveEdge {
            id: format!("edge-{}", k + 1),
            sigma: edge.sigma,
            scatter: edge.scatter,
            pairs: edge.pairs.iter().map(|pair| self.stamp(*pair)).collect(),
            in_view: edge.in_view,
        };
        if found.as_ref().is_some_and(Vec::is_empty) {
            warnings.push(
                Fault::new("no straight edge in three pairs", self.file)
                    .remedy("mark features on all sides of the object, or omit --edges"),
            );
        }
        let model_edges = found.iter().flatten().enumerate().map(model_edge).collect();
        let edges = found.as_ref().map(|found| found.iter().enumerate().map(dive_edge).collect());
        let object = SiteObject {
            id: self.by_hand.object.clone(),
            base,
            base_in_world: None,
            survey_sigma: 0.0,
            world_from_object: None,
            points: site_points,
            edges: model_edges,
            interest: Vec::new(),
        };
        let site = Site { name: self.by_hand.object.clone(), frame: 0, objects: vec![object], warnings: Vec::new() };
        warnings.extend(self.warnings(&made));
        let disagreements = adjustment.disagreements(excess).map_err(undetermined)?;
        let of_motions = adjustment.disagreement_of_motions().map_err(undetermined)?;
        let pixels: BTreeMap<Key, _> = self.gathered.seen.iter().map(|(key, found)| (*key, found.pixels)).collect();
        Ok(DiveModel {
            site,
            points: made,
            edges,
            given_up: self.given_up(),
            pairs: self.dive.stamps().len(),
            used: pairs.iter().map(|pair| self.stamp(*pair)).collect(),
            excess: DiveModel::excess_of(excess),
            chi2: disagreements.iter().sum::<f64>() + of_motions,
            dof: adjustment.dof(),
            motions: adjustment.motions.len(),
            sides: self.sides(&frame.world_from_object, &frame.points),
            halves: self.halves.then(|| halves(&self.dive.rig, self.trail, self.scene, &pixels, pairs)).flatten(),
            warnings,
        })
    }

    /// The straight edges near the points.
    fn found_edges(
        &self,
        front_end: &LineFrontEnd,
        world_from_object: &Transform<World, Object>,
        points: &[ModelPoint],
    ) -> Vec<FoundEdge> {
        let object_from_world = world_from_object.inverse();
        let view = |pair: &usize| Some((*pair, object_from_world * self.scene.poses[*pair]?));
        let views: Vec<_> = self.settled.pairs.iter().filter_map(view).collect();
        let common_px = self.corner_sigma;
        EdgeSearch { front_end, dive: self.dive, views: &views, points, slack_px: SLACK, common_px }.edges()
    }

    fn stamp(&self, pair: usize) -> u64 {
        self.dive.stamps()[pair]
    }

    /// Adds the errors that all observations of a point have in common: more pairs do not reduce them.
    ///
    /// A mark without a corner displaces the point on its surface, taken as parallel to the image: σ z/f in both
    /// directions across the view. The place that a locator calls a corner differs from the physical one by σ z/f in all
    /// directions, with the mean depth z of the observations.
    fn add_common(&self, spread: &mut PointSpread) {
        let focal = self.dive.rig.mean_focal();
        for (k, feature) in self.settled.features.iter().enumerate() {
            let at = self.settled.adjustment.points[k];
            let depth = |pose: &Transform<World, Camera>| (pose.inverse() * at).coords.z;
            let added = if self.features[*feature].corner {
                let observations = self.settled.adjustment.observations.iter().filter(|seen| seen.point == k);
                let depths: Vec<f64> =
                    observations.map(|seen| depth(&self.settled.adjustment.poses[seen.view])).collect();
                let mean = depths.iter().sum::<f64>() / depths.len() as f64;
                Matrix3::identity() * (self.corner_sigma * mean / focal).powi(2)
            } else {
                let Some(pose) = self.scene.poses[self.marked[*feature].marks[0].pair] else { continue };
                let axis = pose.rotation_matrix() * Vector3::z();
                let sigma = self.by_hand.mark_sigma * depth(&pose) / focal;
                (Matrix3::identity() - axis * axis.transpose()) * (sigma * sigma)
            };
            let mut own = spread.noise.fixed_view_mut::<3, 3>(3 * k, 3 * k);
            own += added;
        }
    }

    /// The base points by name, or the triangle with the largest ratio of area to its points' errors.
    fn base(&self, free: &DMatrix<f64>) -> Result<[usize; 3], Fault> {
        let id = |k: usize| self.marked[self.settled.features[k]].id.as_str();
        let count = self.settled.features.len();
        let at = |k: usize| self.settled.adjustment.points[k].coords;
        let base = match &self.by_hand.base {
            Some(names) => {
                let mut base = [0; 3];
                for (place, name) in base.iter_mut().zip(names) {
                    *place = (0..count).find(|k| id(*k) == name).ok_or_else(|| {
                        let near = nearest(name, (0..count).map(id)).map(|near| format!("did you mean `{near}`?"));
                        Fault::new("a base point is not among the points", self.file)
                            .value(format!("`{name}`"))
                            .remedy(near.unwrap_or_else(|| "name three of the points".to_owned()))
                    })?;
                }
                base
            }
            None => {
                let all = (0..count).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [k, j, i])));
                let variance = |k: usize| free.fixed_view::<3, 3>(3 * k, 3 * k).trace();
                let worth = |[i, j, k]: &[usize; 3]| {
                    let area = (at(*j) - at(*i)).cross(&(at(*k) - at(*i))).norm();
                    area / (variance(*i) + variance(*j) + variance(*k)).sqrt()
                };
                all.max_by(|a, b| worth(a).total_cmp(&worth(b))).expect("there are three points")
            }
        };
        let (a, b) = (at(base[1]) - at(base[0]), at(base[2]) - at(base[0]));
        let sine = a.cross(&b).norm() / (a.norm() * b.norm());
        if sine >= MIN_SINE {
            return Ok(base);
        }
        Err(Fault::new("the base points are nearly on a line", self.file)
            .value(format!("{}: sine {sine:.3}, at least {MIN_SINE} is needed", base.map(id).join(", ")))
            .remedy("mark a point off their line, or choose others with --base"))
    }

    fn point(&self, k: usize, at: Point<Object>, covariance: Matrix3<f64>, sigma: f64) -> DivePoint {
        let feature = self.settled.features[k];
        let observed: Vec<(usize, &Found)> = self
            .settled
            .adjustment
            .observations
            .iter()
            .filter(|observation| observation.point == k)
            .map(|observation| {
                let pair = self.settled.pairs[observation.view];
                (pair, &self.gathered.seen[&(pair, feature)])
            })
            .collect();
        let missed = self.gathered.missed.iter().filter(|(key, _)| key.1 == feature);
        let missed = missed.map(|(key, (_, why))| (self.stamp(key.0), why.to_string()));
        let against = self.settled.contradicting.iter().filter(|(key, _)| key.1 == feature);
        let against = against.map(|(key, chi2)| (self.stamp(key.0), format!("contradicts the others: χ² {chi2:.0}")));
        let mut rejected: Vec<(u64, String)> = missed.chain(against).collect();
        rejected.sort_unstable();
        let marked = &self.marked[feature];
        let mut lines: Vec<usize> = marked.marks.iter().map(|mark| mark.mark.mark.line).collect();
        lines.sort_unstable();
        let rays = observed.iter().filter_map(|(pair, _)| {
            Some(self.scene.poses[*pair]?.translation() - self.settled.adjustment.points[k].coords)
        });
        DivePoint {
            id: marked.id.clone(),
            corner: self.features[feature].corner,
            lines,
            at,
            covariance,
            sigma,
            parallax: largest_angle(&rays.collect::<Vec<_>>()),
            observations: observed.iter().map(|(pair, found)| (self.stamp(*pair), found.pixels.at)).collect(),
            rejected,
            pictures: Vec::new(),
        }
    }

    /// A point with its uncertainty relative to the others, and the pairs that observe it.
    fn shown(&self, k: usize, free: &DMatrix<f64>) -> Shown {
        let observations = &self.settled.adjustment.observations;
        let own = observations.iter().filter(|observation| observation.point == k);
        Shown {
            at: self.settled.adjustment.points[k],
            covariance: free.fixed_view::<3, 3>(3 * k, 3 * k).into_owned(),
            pairs: own.map(|observation| self.settled.pairs[observation.view]).collect(),
        }
    }

    /// The features without a point, with the reason.
    fn given_up(&self) -> Vec<(String, String)> {
        let reason = |index: usize| {
            if self.settled.given_up.contains(&index) {
                return "most of its observations contradict each other: it moves, or several features were taken for it";
            }
            if self.alone.contains(&index) {
                return "few of the pairs where it was expected show it, all from one direction: mark it in another pair";
            }
            if self.marked[index].marks[0].measured.is_none() {
                return "its mark has no match in the right image, and no corner of other pairs lies on its line of sight";
            }
            "nothing connects the pair of its mark with those of the others"
        };
        let gone = (0..self.marked.len()).filter(|index| self.settled.features.binary_search(index).is_err());
        gone.map(|index| (self.marked[index].id.clone(), reason(index).to_owned())).collect()
    }

    fn warnings(&self, points: &[DivePoint]) -> Vec<Fault> {
        let mut warnings = Vec::new();
        for (id, why) in self.given_up() {
            let line = self.marked.iter().find(|feature| feature.id == id).map(|f| f.marks[0].mark.mark.line);
            let fault = Fault::new("a mark without a point", self.file).on_line(line).value(format!("`{id}`"));
            warnings.push(fault.remedy(why));
        }
        let flat: Vec<&str> =
            points.iter().filter(|point| point.parallax < LITTLE_PARALLAX).map(|point| point.id.as_str()).collect();
        if !flat.is_empty() {
            warnings.push(
                Fault::new("points with less than 2° between their lines of sight", self.file)
                    .value(flat.join(", "))
                    .remedy("their depth is that of a single pair; pass the object on another path"),
            );
        }
        for (k, one) in points.iter().enumerate() {
            if let Some(other) = points[..k].iter().find(|other| other.at.distance(&one.at) < ONE_POINT) {
                warnings.push(
                    Fault::new("two points at one place", self.file)
                        .on_line(one.lines.first().copied())
                        .value(format!("`{}` and `{}`", one.id, other.id))
                        .remedy("delete one of them"),
                );
            }
        }
        warnings
    }

    /// The sides of the object that a pair has seen: from within 45° of an axis.
    fn sides(
        &self,
        world_from_object: &Transform<World, Object>,
        points: &[Point<Object>],
    ) -> [(&'static str, bool); 6] {
        let centre = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / points.len() as f64;
        let object_from_world = world_from_object.inverse();
        let rays: Vec<Vector3<f64>> = self
            .settled
            .pairs
            .iter()
            .filter_map(|pair| {
                Some((object_from_world * Point::from(self.scene.poses[*pair]?.translation())).coords - centre)
            })
            .collect();
        let seen = |axis: Vector3<f64>| rays.iter().any(|ray| ray.angle(&axis) <= SIDE);
        [
            ("+x", Vector3::x()),
            ("-x", -Vector3::x()),
            ("+y", Vector3::y()),
            ("-y", -Vector3::y()),
            ("+z", Vector3::z()),
            ("-z", -Vector3::z()),
        ]
        .map(|(name, axis)| (name, seen(axis)))
    }
}

/// A standard deviation (m) to the resolution of written coordinates, and never zero.
fn rounded(sigma: f64) -> f64 {
    (sigma / GRAIN).ceil() * GRAIN
}
