//! Clutter that is bunched about the places where the prior expects the model points.

use nalgebra::Vector3;

use super::prior_terms::{BOUND_SIGMAS, Known};
use crate::Problem;

/// Boxes about a predicted place, each half as wide as the one before.
const BOXES: usize = 3;
/// The share of a box that the next one fills.
const FRACTION: f64 = 0.125;
/// So many more points within the second box than evenly spread clutter has there, in standard deviations, are no accident;
const NO_ACCIDENT: f64 = 4.0;
/// and where it is less than so many times as dense there, it is as even as clutter is.
const CLUMPED: f64 = 2.0;

/// How many cloud points lie how near to the predicted places, of all model points together.
///
/// The terms of a pose take clutter to be spread evenly about each predicted place, and the clutter about any one place is too little to
/// tell. About all of them together it is enough: where it is bunched there, as about a structure that is where the object was
/// expected, poses near the prediction find points that fit well much more often, and each says less.
pub(super) struct ClumpedClutter {
    /// About how many predicted places each cloud point lies, by rings: what a box holds and the next one does not.
    rings: Vec<[usize; BOXES]>,
    /// The sum of all, and how many points lie about any.
    counts: [usize; BOXES],
    points: usize,
}

/// By how much clutter is denser in each ring than in all of them (nats).
pub(super) struct Excess([f64; BOXES]);

impl ClumpedClutter {
    /// About the model points that have candidates. Time O(n M).
    pub(super) fn of(problem: &Problem<'_>, known: &Known) -> Self {
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

    /// Where the cloud points of a pose are the object's and all others are clutter.
    pub(super) fn beside(&self, of_pose: &[usize]) -> Excess {
        let (mut counts, mut points) = (self.counts, self.points);
        for &cloud in of_pose {
            let rings = &self.rings[cloud];
            (0..BOXES).for_each(|ring| counts[ring] -= rings[ring]);
            points -= usize::from(*rings != [0; BOXES]);
        }
        let (all, near) = (counts.iter().sum::<usize>() as f64, counts[1..].iter().sum::<usize>() as f64);
        // A point that lies about several places is one accident.
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
    /// About a place where a model point was measured; none outside the boxes.
    pub(super) fn about(&self, known: &Known, model: usize, at: &Vector3<f64>) -> f64 {
        About::of(known, model).ring(at).map_or(0.0, |ring| self.0[ring])
    }
}

/// The boxes about the predicted place of a model point. The first is that of a prior's shell, or as wide as three standard deviations.
struct About {
    place: Vector3<f64>,
    half: Vector3<f64>,
}

impl About {
    fn of(known: &Known, model: usize) -> Self {
        let (place, spread) = known.places[model];
        Self { place, half: known.half.map_or(spread * BOUND_SIGMAS, Vector3::repeat) }
    }

    /// The ring that a place lies in.
    #[inline]
    fn ring(&self, at: &Vector3<f64>) -> Option<usize> {
        let off = at - self.place;
        // Most are far: that is known by the first axes.
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
    use crate::{Candidates, ModelPoint, Prior, PriorBound, Tolerance, search::consensus::prior_terms::PriorTerms};

    const HALF: f64 = 0.4;

    /// The excess by ring of eight points, ten pieces of clutter drawn about the predicted place of each; the last three of each are a pose's
    /// if it is said so.
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
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior };
        let prior_terms = PriorTerms::of(&problem).expect("a prior");
        let of_pose: Vec<usize> = (0..80).filter(|j| of_pose && j % 10 >= 7).collect();
        let known = prior_terms.known.as_ref().expect("a prior");
        let excess = ClumpedClutter::of(&problem, known).beside(&of_pose);
        let places = [0.7, 0.4, 0.1].map(|off| Vector3::new(off * HALF, 0.0, 0.0) + model[3].at.coords);
        places.map(|at| excess.about(known, 3, &at))
    }

    /// Evenly spread clutter has none, whether a pose has some of it or what is bunched is the pose's; of clutter all within the
    /// second box that is eight times as dense, but for the hole that it leaves in the third.
    ///
    /// Seen to fail where the pose's own points count, and where rings are taken for boxes.
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
