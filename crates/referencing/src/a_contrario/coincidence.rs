//! Shuffled partners in a cloud that contains the object's own arrangement of points, as a grid does.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Object, Transform};

use super::coordinates::{CONFIDENCE, coordinates};
use crate::{chi_square::chi_square, problem::Problem, site::model::ModelPoint};

/// Number of motions, for each model point, that may map a model onto itself: a ring of n points has 2n, a grid of 27
/// has 24.
const ALIKE: f64 = 2.0;

/// The expected number of sets of `size` pairs or more at one pose, for shuffled partners.
///
/// The pose stands for its symmetric ones too.
///
/// The expectation over all poses assumes that partners are as dense as their neighbours. A shuffle, however, leaves
/// the cloud unchanged. If a pose puts model point i onto cloud points with the fraction q_i of all partners, one of
/// its m_i different partners is there with probability m_i q_i, and the number of such points is a sum of independent
/// ones. Every motion that maps the model onto itself leads to another such pose.
pub(super) fn expected_at(problem: &Problem<'_>, size: usize, object_from_camera: &Transform<Object, Camera>) -> f64 {
    let shuffled = Shuffled::of(problem);
    let camera_from_object = object_from_camera.inverse();
    // P(number of matched points) for the points so far; the last entry is for `size` or more.
    let mut number = vec![0.0; size + 1];
    number[0] = 1.0;
    for (i, point) in problem.model.iter().enumerate() {
        let met = shuffled.meets(i, (camera_from_object * point.at).coords);
        if met > 0.0 {
            number[size] += number[size - 1] * met;
            for k in (0..size).rev() {
                let joined = if k > 0 { number[k - 1] * met } else { 0.0 };
                number[k] = number[k] * (1.0 - met) + joined;
            }
        }
    }
    number[size] * ALIKE * problem.model.len() as f64
}

/// Putative pairs with partners shuffled over an unchanged cloud.
pub(crate) struct Shuffled<'a> {
    partners: Partners<'a>,
    /// Number of times that each cloud point is a partner, and their sum.
    times: Vec<f64>,
    all: f64,
}

impl<'a> Shuffled<'a> {
    pub(crate) fn of(problem: &'a Problem<'a>) -> Self {
        let mut times = vec![0.0_f64; problem.cloud.len()];
        problem.candidates.lists.iter().flatten().for_each(|&j| times[j] += 1.0);
        let (partners, all) = (Partners::of(problem, &times), times.iter().sum());
        Self { partners, times, all }
    }

    /// The probability m q that a partner of a model point lies at its place under a pose.
    ///
    /// m is the number of its partners, and q is the fraction of all partners at that place.
    pub(crate) fn meets(&self, model: usize, place: Vector3<f64>) -> f64 {
        let Problem { model: points, candidates, .. } = self.partners.problem;
        let own = candidates.lists[model].len() as f64;
        if own == 0.0 {
            return 0.0;
        }
        let fraction: f64 = self.partners.near(&points[model], place).map(|j| self.times[j] / self.all).sum();
        (own * fraction).min(1.0)
    }
}

/// The cloud points that are partners.
struct Partners<'a> {
    problem: &'a Problem<'a>,
    /// Their places and indices, by the first coordinate.
    sorted: Vec<(Vector3<f64>, usize)>,
    /// Upper bound of their variance along any direction (m²).
    variance: f64,
    /// Gate of a measured point about its true place (χ²₃).
    far: f64,
}

impl<'a> Partners<'a> {
    fn of(problem: &'a Problem<'a>, times: &[f64]) -> Self {
        let used = (0..times.len()).filter(|&j| times[j] > 0.0);
        let mut sorted: Vec<(Vector3<f64>, usize)> = used.map(|j| (coordinates(&problem.cloud[j]), j)).collect();
        sorted.sort_unstable_by(|(a, i), (b, j)| a.x.total_cmp(&b.x).then(i.cmp(j)));
        let variance = sorted.iter().map(|&(_, j)| problem.cloud[j].position.covariance.trace()).fold(0.0, f64::max);
        Self { problem, sorted, variance, far: chi_square(3, CONFIDENCE) }
    }

    /// The partners that may be measurements of a point at this place.
    fn near(&self, point: &ModelPoint, place: Vector3<f64>) -> impl Iterator<Item = usize> {
        let own = point.sigma * point.sigma;
        let reach = (self.far * (self.variance + own)).sqrt();
        let begin = self.sorted.partition_point(|(at, _)| at.x < place.x - reach);
        let within = self.sorted[begin..].iter().take_while(move |(at, _)| at.x <= place.x + reach);
        within
            .map(move |(at, j)| (at - place, *j))
            .filter(move |(off, j)| {
                off.norm_squared() <= reach * reach && {
                    let noise = self.problem.cloud[*j].position.covariance + Matrix3::identity() * own;
                    noise.cholesky().is_some_and(|factor| off.dot(&factor.solve(off)) <= self.far)
                }
            })
            .map(|(_, j)| j)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    use super::*;
    use crate::{candidates::Candidates, problem::Tolerance};

    /// A cloud that contains the model, with random pairs.
    fn expected(model: &[Vector3<f64>], pairs: usize, size: usize, seed: u64) -> (f64, usize) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let cloud: Vec<MeasuredPoint> = model
            .iter()
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic((*at).into(), 0.01), pixels: None })
            .collect();
        let sampled: Vec<(usize, usize)> =
            (0..pairs).map(|_| (rng.random_range(0..model.len()), rng.random_range(0..model.len()))).collect();
        let candidates = Candidates::from_pairs(model.len(), sampled.iter().copied());
        let points: Vec<ModelPoint> = model.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let tolerance = Tolerance::Fixed(0.04);
        let problem = Problem {
            model: &points,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let met = (0..model.len()).filter(|&i| candidates.lists[i].contains(&i)).count();
        (expected_at(&problem, size, &Transform::identity()), met)
    }

    /// Fails if all partners have the same fraction, and if a point has one partner only.
    #[test]
    fn shuffled_partners_meet_a_pose_as_often_as_is_expected() {
        // No two distances are equal, so that no motion maps the model onto itself.
        let model: Vec<Vector3<f64>> = (0..12)
            .map(f64::from)
            .map(|i| Vector3::new(0.3 * i, 0.011 * i * i * i, 1.7 * (i * i * 0.37).sin()))
            .collect();
        let (mut expected_all, mut met_all) = (0.0, 0);
        for seed in 0..2000 {
            let (mean, met) = expected(&model, 30, 4, seed);
            expected_all += mean / (ALIKE * model.len() as f64);
            met_all += usize::from(met >= 4);
        }
        let (observed, deviation) = (met_all as f64, expected_all.sqrt());
        assert!(observed > 300.0 && (observed - expected_all).abs() < 4.0 * deviation, "{observed} of {expected_all}");
    }

    #[test]
    fn a_grid_is_met_from_every_side() {
        let grid: Vec<Vector3<f64>> =
            (0..27).map(|i| Vector3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9))).collect();
        let (expected, _) = expected(&grid, 150, 9, 1);
        assert!(expected > 1.0, "{expected}");
    }
}
