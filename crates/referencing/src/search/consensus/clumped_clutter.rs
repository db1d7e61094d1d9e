//! Clutter that is clumped about the predicted places of the model points.

use nalgebra::Vector3;

use super::prior_terms::{BOUND_SIGMAS, PriorDensity};
use crate::problem::Problem;

/// Number of nested boxes about a predicted place, each half as wide as the previous.
const BOXES: usize = 3;
/// Fraction of a box's volume that the next fills.
const FRACTION: f64 = 0.125;
/// Excess of points in the second box over uniform clutter, in standard deviations, that is significant.
const NO_ACCIDENT: f64 = 4.0;
/// Density ratio in the second box below which clutter counts as uniform.
const CLUMPED: f64 = 2.0;

/// Counts of cloud points by their distance from the predicted places, over all model points.
///
/// The terms of a pose assume uniform clutter about each predicted place, and the clutter about a single place is too
/// little to test that. The counts over all places suffice. If clutter is clumped there, as about a structure where the
/// object was expected, poses near the prediction find fitting points much more often, and each point has less
/// evidence.
pub(super) struct ClumpedClutter {
    /// The number of places about each cloud point by rings, the difference of a box and the next.
    rings: Vec<[usize; BOXES]>,
    /// The sums over all points, and the number of points in any box.
    counts: [usize; BOXES],
    points: usize,
}

/// The excess density of clutter in each ring over the outermost box (nats).
pub(super) struct Excess([f64; BOXES]);

impl ClumpedClutter {
    /// The counts about the model points with candidates. Time O(n M).
    pub(super) fn of(problem: &Problem<'_>, known: &PriorDensity) -> Self {
        let cloud: Vec<Vector3<f64>> = problem.cloud.iter().map(|point| point.position.at.coords).collect();
        let mut rings = vec![[0; BOXES]; cloud.len()];
        for model in (0..known.places.len()).filter(|&model| !problem.candidates.lists[model].is_empty()) {
            let about = About::of(known, model);
            for (rings, at) in rings.iter_mut().zip(&cloud) {
                if let Some(ring) = about.ring(at) {
                    rings[ring] += 1;
                }
            }
        }
        let mut counts = [0; BOXES];
        rings.iter().for_each(|rings| (0..BOXES).for_each(|ring| counts[ring] += rings[ring]));
        let points = rings.iter().filter(|rings| **rings != [0; BOXES]).count();
        Self { rings, counts, points }
    }

    /// The excess if the cloud points of a pose are the object's and all others are clutter.
    pub(super) fn beside(&self, of_pose: &[usize]) -> Excess {
        let (mut counts, mut points) = (self.counts, self.points);
        for &cloud in of_pose {
            let rings = &self.rings[cloud];
            (0..BOXES).for_each(|ring| counts[ring] -= rings[ring]);
            points -= usize::from(*rings != [0; BOXES]);
        }
        let (all, near) = (counts.iter().sum::<usize>() as f64, counts[1..].iter().sum::<usize>() as f64);
        // A point that lies about several places is one event.
        let places_a_point = all / points as f64;
        let expected = FRACTION * all;
        let more = (NO_ACCIDENT * (expected * places_a_point).sqrt()).max((CLUMPED - 1.0) * expected);
        if near - expected <= more {
            return Excess([0.0; BOXES]);
        }
        let volume = |ring: usize| {
            let inner = if ring + 1 < BOXES { FRACTION.powi(ring as i32 + 1) } else { 0.0 };
            FRACTION.powi(ring as i32) - inner
        };
        Excess(std::array::from_fn(|ring| libm::log(counts[ring] as f64 / (all * volume(ring))).max(0.0)))
    }
}

impl Excess {
    /// The excess at the measured place of a model point; zero outside the boxes.
    pub(super) fn about(&self, known: &PriorDensity, model: usize, at: &Vector3<f64>) -> f64 {
        About::of(known, model).ring(at).map_or(0.0, |ring| self.0[ring])
    }
}

/// The boxes about the predicted place of a model point. The first is the gate of the prior, or three standard
/// deviations wide to each side.
struct About {
    place: Vector3<f64>,
    half: Vector3<f64>,
}

impl About {
    fn of(known: &PriorDensity, model: usize) -> Self {
        let (place, spread) = known.places[model];
        Self { place, half: known.half.map_or(spread * BOUND_SIGMAS, Vector3::repeat) }
    }

    /// The ring of a place.
    #[inline]
    fn ring(&self, at: &Vector3<f64>) -> Option<usize> {
        let off = at - self.place;
        // Most places are far: the first axes decide.
        if off.x.abs() > self.half.x || off.y.abs() > self.half.y || off.z.abs() > self.half.z {
            return None;
        }
        let fraction = off.component_div(&self.half).amax();
        (0..BOXES).rev().find(|&ring| fraction <= 0.5f64.powi(ring as i32))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Transform, UncertainPoint};

    use super::*;
    use crate::{
        candidates::Candidates,
        problem::{Prior, PriorBound, Tolerance},
        search::consensus::prior_terms::PriorTerms,
        site::model::ModelPoint,
    };

    const HALF: f64 = 0.4;

    /// The excess by ring for eight points with ten clutter points about each; with `of_pose` the last three belong to
    /// a pose.
    fn excess(mut sampled: impl FnMut(usize) -> Vector3<f64>, of_pose: bool) -> [f64; BOXES] {
        let model: Vec<ModelPoint> =
            (0..8).map(|i| ModelPoint::exact("", Vector3::new(3.0 * i as f64, 0.0, 5.0).into())).collect();
        let measured =
            |at: Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.01), pixels: None };
        let cloud: Vec<MeasuredPoint> =
            (0..80).map(|j| measured(model[j / 10].at.coords + HALF * sampled(j % 10))).collect();
        let candidates = Candidates::from_pairs(8, (0..80).map(|j| (j / 10, j)));
        let prior = Prior {
            object_from_camera: Transform::new(UnitQuaternion::identity(), Vector3::zeros()),
            bound: PriorBound::Box(HALF),
        };
        let (tolerance, prior) = (Tolerance::Fixed(0.04), Some(&prior));
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("a prior");
        let of_pose: Vec<usize> = (0..80).filter(|j| of_pose && j % 10 >= 7).collect();
        let known = prior_terms.known.as_ref().expect("a prior");
        let excess = ClumpedClutter::of(&problem, known).beside(&of_pose);
        let places = [0.7, 0.4, 0.1].map(|off| Vector3::new(off * HALF, 0.0, 0.0) + model[3].at.coords);
        places.map(|at| excess.about(known, 3, &at))
    }

    /// The excess of uniform clutter and of a clump.
    ///
    /// Uniform clutter has no excess, even if a pose takes some of it or if the clump belongs to the pose. Clutter that
    /// lies entirely within the second box is eight times as dense, except for the hole that it leaves in the third.
    ///
    /// Fails if the pose's own points count, and if rings are taken for boxes.
    #[test]
    fn clutter_is_as_dense_as_it_is_generated() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut within = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        assert_eq!(excess(|_| within(1.0), false), [0.0; BOXES]);
        assert_eq!(excess(|k| within(if k < 7 { 1.0 } else { 0.2 }), true), [0.0; BOXES]);
        let [outer, middle, inner] = excess(|_| within(0.5), false);
        assert_eq!(outer, 0.0);
        assert!((middle - 8f64.ln()).abs() < 0.1 && (inner - 8f64.ln()).abs() < 0.7, "{middle} {inner}");
    }

    #[test]
    fn a_cloud_without_clutter_has_no_excess() {
        let none = ClumpedClutter { rings: vec![[1, 0, 0], [0; BOXES]], counts: [1, 0, 0], points: 1 };
        assert_eq!(none.beside(&[0, 1]).0, [0.0; BOXES]);
    }
}
