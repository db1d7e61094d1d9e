//! The proof that every set as large as the best gives the same pose.

use nalgebra::Vector3;

use super::{association::Association, clique, limits::NEEDED, orientation::Sense};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem, Tolerance},
    solve::closed_form::fit as least_squares,
};

/// Distance from a line (fraction of the model's extent) below which points determine no rotation about it.
const SLIM: f64 = 0.05;

/// Proves that every admissible set as large as `best` or larger gives the motion of `best`; returns the pair tests
/// too.
///
/// More than a third of such a set's pairs fit the rigid motion of `best`, and not all of these are collinear, so that
/// they determine the same motion. A list of the sets would be too long: each point with a second measurement beside it
/// doubles their number. The proof uses the remaining pairs: if the pairs that do not fit the motion of `best` hold no
/// admissible set of h members, a set of k has at least k − h + 1 that do; h = k − max(k/3, l), l the maximum number of
/// collinear fitting model points.
pub(super) fn all_alike(
    problem: &Problem<'_>,
    graph: &Association,
    best: &[Correspondence],
    sense: Sense,
    budget: u64,
) -> (bool, u64) {
    let motion = least_squares(&Observations::of(best, problem.model, problem.cloud, None).points).inverse();
    let fits = |pair: Correspondence| {
        let off = (motion * problem.model[pair.model].at).distance(&problem.cloud[pair.cloud].position.at);
        off <= slack(problem, pair)
    };
    let mut fitting: Vec<usize> = graph.vertices.iter().filter(|&&pair| fits(pair)).map(|pair| pair.model).collect();
    fitting.sort_unstable();
    fitting.dedup();
    let places: Vec<Vector3<f64>> = fitting.iter().map(|&i| problem.model[i].at.coords).collect();
    let shared = (best.len() / 3).max(largest_along_a_line(&places));
    let min = best.len().saturating_sub(shared);
    if shared < NEEDED || min < NEEDED {
        return (false, 0);
    }
    let rest = graph.restricted(|pair| !fits(pair));
    let mut cliques = clique::Search::new(problem, &rest, sense, budget);
    let largest = cliques.run(min, 1);
    (largest.complete && largest.found.is_empty(), budget - cliques.left())
}

/// The maximum distance of a true pair from its place under the motion (m).
pub(super) fn slack(problem: &Problem<'_>, pair: Correspondence) -> f64 {
    match problem.tolerance {
        Tolerance::Fixed(delta) => delta,
        Tolerance::Sigmas(k) => {
            let measured = problem.cloud[pair.cloud].position.covariance.trace().max(0.0).sqrt();
            k * (measured + problem.model[pair.model].sigma)
        }
    }
}

/// The maximum number of points along one line through two of them.
pub(super) fn largest_along_a_line(points: &[Vector3<f64>]) -> usize {
    let extent = points.iter().map(|p| (p - points[0]).norm()).fold(0.0, f64::max);
    let mut max = points.len().min(2);
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate().skip(i + 1) {
            let Some(along) = (b - a).try_normalize(0.0) else { continue };
            // Squared distance from the line, computed once.
            let slim = (SLIM * extent).powi(2);
            let others = points.iter().skip(j + 1).filter(|p| (*p - a).cross(&along).norm_squared() <= slim);
            max = max.max(2 + others.count());
        }
    }
    max
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{candidates::Candidates, site::model::ModelPoint};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    #[test]
    fn points_along_a_line_are_counted() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        assert_eq!(largest_along_a_line(&[]), 0);
        assert_eq!(largest_along_a_line(&[at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]), 2);
        assert_eq!(largest_along_a_line(&[at(0.0, 1.0), at(0.0, 0.0), at(1.0, 0.01), at(2.0, 0.0), at(1.0, 1.0)]), 3);
    }

    /// Twelve points measured exactly, and once more displaced by `shift` (m), each pair a candidate.
    fn proved(shift: f64) -> bool {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let places: Vec<Vector3<f64>> = (0..12).map(|_| Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))).collect();
        let model: Vec<ModelPoint> = places.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let seen = places.iter().copied().chain(places.iter().map(|at| at + Vector3::new(shift, 0.0, 0.0)));
        let cloud: Vec<MeasuredPoint> = seen
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.005), pixels: None })
            .collect();
        let candidates = Candidates { lists: (0..12).map(|i| vec![i, 12 + i]).collect() };
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(0.02),
            prior: None,
            edges: Default::default(),
        };
        let best: Vec<Correspondence> = (0..12).map(|i| Correspondence { model: i, cloud: i }).collect();
        all_alike(&problem, &Association::of(&problem), &best, Sense::Proper, 100_000).0
    }

    #[test]
    fn measurements_side_by_side_are_alike_and_a_second_object_is_not() {
        assert!(proved(0.01));
        assert!(!proved(0.5), "the object has a second copy");
    }
}
