//! Local density of clutter: in dense clutter some points fit any pose.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{
    clumped_clutter::ClumpedClutter,
    graph::ConsistencyGraph,
    likelihood::{Mode, Terms},
    prior_terms::PriorTerms,
    visible::ln_visible,
};
use crate::{Correspondence, Problem};

/// Number of neighbours that define the density about a point, and number of neighbours looked up.
const NEIGHBOURS: usize = 3;
const MAX_NEIGHBOURS: usize = 8;
/// Ratio to the expected density up to which it may be random: uniform clutter exceeds it at one point in 25.
const DENSE: f64 = 4.0;

/// Distance (standard deviations) below which two points may be one place measured twice.
const SYMMETRIC: f64 = 5.0;

/// The local density of the cloud about its points.
///
/// The terms of a pose assume uniform clutter in each gate. On the edges of a box or in clumps, a pose finds fitting
/// points much more often, and each has less evidence.
#[derive(Default)]
pub(in crate::search) struct ClutterDensity {
    /// The nearest neighbours of the cloud points looked up, by squared distance (m²), ascending.
    nearest: BTreeMap<usize, Vec<(f64, usize)>>,
    /// The cloud points that count as clutter.
    counted: Option<Counted>,
    /// The clutter about the predicted places.
    clumped_clutter: Option<ClumpedClutter>,
    /// A distance (m) and the fraction of candidates with another so near; `None` until it is needed.
    duplicates: Option<(f64, f64)>,
}

impl ClutterDensity {
    /// Recomputes the evidence of a mode with the local clutter density about each of its points.
    ///
    /// The density is that about the point, or that about the predicted places of all model points
    /// ([`ClumpedClutter`]). A point in dense clutter may contribute negatively; it is then rather clutter than the
    /// object's. The evidence is summed over the subsets of members that are the object's ([`ln_visible`]).
    pub(in crate::search) fn weigh(
        &mut self,
        problem: &Problem<'_>,
        (terms, prior_terms, graph): (&Terms, &PriorTerms, &ConsistencyGraph),
        mode: &mut Mode,
    ) {
        let members: Vec<usize> = mode.members.iter().map(|&v| graph.vertices[v].cloud).collect();
        let even: Vec<f64> = mode.members.iter().map(|&v| terms.residual_gain(v, &mode.motion)).collect();
        let known = prior_terms.known.as_ref();
        let excess = known.map(|known| {
            let clumped_clutter = self.clumped_clutter.get_or_insert_with(|| ClumpedClutter::of(problem, known));
            (known, clumped_clutter.beside(&members))
        });
        let dense: Vec<f64> = (0..members.len())
            .map(|at| {
                let v = mode.members[at];
                let clutter_density = self.cost(problem, terms, graph, v, &members);
                let Correspondence { model, cloud } = graph.vertices[v];
                let place = &problem.cloud[cloud].position.at.coords;
                let clumped = excess.as_ref().map_or(0.0, |(known, excess)| excess.about(known, model, place));
                let duplicate = self.duplicate(problem, terms, graph, v, &members[..at]);
                any_of(terms, graph, v, mode, even[at]) - clutter_density.max(duplicate).max(clumped)
            })
            .collect();
        let of_pose = mode.ln_evidence - even.iter().sum::<f64>() - terms.ln_fraction[even.len()];
        let (even, dense) = (ln_visible(&even, &terms.ln_fraction), ln_visible(&dense, &terms.ln_fraction));
        mode.ln_evidence = of_pose + dense;
        mode.ln_clutter_density = even - dense;
    }

    /// The excess density (nats) of a point measured beside an earlier member. The second of two points a few standard
    /// deviations apart is as frequent as candidates have another so near.
    fn duplicate(
        &mut self,
        problem: &Problem<'_>,
        terms: &Terms,
        graph: &ConsistencyGraph,
        v: usize,
        before: &[usize],
    ) -> f64 {
        let pair = graph.vertices[v];
        let seen = &problem.cloud[pair.cloud].position;
        let reach = SYMMETRIC * (seen.covariance.trace() / 3.0).sqrt();
        if !before.iter().any(|&j| problem.cloud[j].position.at.distance(&seen.at) <= reach) {
            return 0.0;
        }
        let fraction = match self.duplicates {
            Some((of, fraction)) if of == reach => fraction,
            _ => duplicates(problem, reach),
        };
        self.duplicates = Some((reach, fraction));
        let volume = 4.0 / 3.0 * std::f64::consts::PI * reach.powi(3);
        (libm::log(fraction / volume) - terms.ln_density_about(v, pair.model)).max(0.0)
    }

    /// The excess density about the cloud point of a vertex over the expected (nats).
    fn cost(
        &mut self,
        problem: &Problem<'_>,
        terms: &Terms,
        graph: &ConsistencyGraph,
        v: usize,
        members: &[usize],
    ) -> f64 {
        let pair = graph.vertices[v];
        let counted = self.counted.get_or_insert_with(|| Counted::of(problem));
        let place = &problem.cloud[pair.cloud].position.at.coords;
        let nearest = self.nearest.entry(pair.cloud).or_insert_with(|| counted.nearest(pair.cloud, place));
        let Some(&(square, _)) = nearest.iter().filter(|(_, j)| !members.contains(j)).nth(NEIGHBOURS - 1) else {
            return 0.0;
        };
        // Points nearer than the noise are one place.
        let noise = problem.cloud[pair.cloud].position.covariance.trace() / 3.0;
        let volume = 4.0 / 3.0 * std::f64::consts::PI * square.max(noise).max(f64::MIN_POSITIVE).powf(1.5);
        // For candidates given without a prior, the other points of the cloud are at random distances.
        let even = match problem.prior {
            Some(_) => terms.ln_density_about(v, pair.model),
            None => {
                let own = problem.candidates.lists[pair.model].len().max(1);
                terms.ln_density_about(v, pair.model) + libm::log(counted.points.len() as f64 / own as f64)
            }
        };
        let times = libm::log(NEIGHBOURS as f64 / volume) - even;
        if times > libm::log(DENSE) { times } else { 0.0 }
    }
}

/// ln of the likelihood ratio of a member's model point over all its candidates: Σ_j r_ij over those near its place.
///
/// r_ij is the ratio of candidate j, and `own` is ln of the member's. The best of several candidates in dense clutter
/// is near by chance; only the sum has the expectation one without an object.
fn any_of(terms: &Terms, graph: &ConsistencyGraph, v: usize, mode: &Mode, own: f64) -> f64 {
    let rank = graph.rank[v] as usize;
    let others = (graph.starts[rank]..graph.starts[rank + 1]).filter(|&other| other != v);
    let fractions = others.filter_map(|other| terms.of_pair(other, &mode.motion)).map(|gain| libm::exp(gain - own));
    own + libm::log1p(fractions.sum())
}

/// The fraction of the candidates that have another within `reach` (m). Points that are no candidates do not count.
fn duplicates(problem: &Problem<'_>, reach: f64) -> f64 {
    let mut all: Vec<usize> = problem.candidates.lists.iter().flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    let at = |j: usize| &problem.cloud[j].position.at;
    all.sort_by(|&a, &b| at(a).coords.x.total_cmp(&at(b).coords.x));
    let mut duplicate = vec![false; all.len()];
    for (i, &a) in all.iter().enumerate() {
        let next = all[i + 1..].iter().take_while(|&&b| at(b).coords.x - at(a).coords.x <= reach);
        for (k, &b) in next.enumerate() {
            if at(a).distance(at(b)) <= reach {
                (duplicate[i], duplicate[i + 1 + k]) = (true, true);
            }
        }
    }
    duplicate.iter().filter(|duplicate| **duplicate).count() as f64 / all.len() as f64
}

/// The cloud points that are clutter unless they are the object's: without a prior the candidates, else all.
struct Counted {
    points: Vec<usize>,
    /// Their coordinates by axis.
    places: [Vec<f64>; 3],
    /// Their squared distances from a place (m²).
    squares: Vec<f64>,
}

impl Counted {
    fn of(problem: &Problem<'_>) -> Self {
        let mut points: Vec<usize> = match problem.prior {
            Some(_) => (0..problem.cloud.len()).collect(),
            None => problem.candidates.lists.iter().flatten().copied().collect(),
        };
        points.sort_unstable();
        points.dedup();
        let column = |axis: usize| points.iter().map(|&j| problem.cloud[j].position.at.coords[axis]).collect();
        let places = std::array::from_fn(column);
        Self { places, squares: vec![0.0; points.len()], points }
    }

    /// The nearest neighbours of a cloud point with their squared distances.
    fn nearest(&mut self, of: usize, at: &Vector3<f64>) -> Vec<(f64, usize)> {
        squares(&self.places, at, &mut self.squares);
        let mut nearest: Vec<(f64, usize)> = Vec::with_capacity(MAX_NEIGHBOURS + 1);
        let mut farthest = f64::INFINITY;
        for (&square, &j) in self.squares.iter().zip(&self.points) {
            // Negated comparison: NaN is skipped, and every finite distance passes while few are known.
            if !(square < farthest) || j == of {
                continue;
            }
            let place = nearest.partition_point(|(known, _)| *known <= square);
            nearest.insert(place, (square, j));
            nearest.truncate(MAX_NEIGHBOURS);
            if nearest.len() == MAX_NEIGHBOURS {
                farthest = nearest[MAX_NEIGHBOURS - 1].0;
            }
        }
        nearest
    }
}

/// The squared distances of some places from one.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn squares([x, y, z]: &[Vec<f64>; 3], at: &Vector3<f64>, squares: &mut [f64]) {
    for (square, ((x, y), z)) in squares.iter_mut().zip(x.iter().zip(y).zip(z)) {
        let (x, y, z) = (x - at.x, y - at.y, z - at.z);
        *square = x * x + y * y + z * z;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::{super::Motion, *};
    use crate::{Candidates, ModelPoint, Tolerance};

    const SIGMA: f64 = 0.1;
    const HALF: f64 = 1.0;

    /// The likelihood ratios of the nearest candidate and of all candidates, for one model point at the origin.
    fn ratios(places: &[Vector3<f64>]) -> (f64, f64) {
        let measured = |at: &Vector3<f64>| MeasuredPoint {
            position: UncertainPoint::isotropic((*at).into(), SIGMA),
            pixels: None,
        };
        let cloud: Vec<MeasuredPoint> = places.iter().map(measured).collect();
        let model = [ModelPoint::exact("a", [0.0; 3].into())];
        let candidates = Candidates::all(1, cloud.len());
        let tolerance = Tolerance::Sigmas(4.0);
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None };
        let prior_terms = PriorTerms::of(&problem).expect("no prior to reject");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = Terms::of(&problem, &prior_terms, &graph);
        let motion = Motion { rotation: Matrix3::identity(), translation: Vector3::zeros() };
        let gain = |v: &usize| terms.residual_gain(*v, &motion);
        let nearest = (0..cloud.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).expect("a candidate");
        let mode = Mode { members: vec![nearest], motion, ln_evidence: 0.0, ln_even: 0.0, ln_clutter_density: 0.0 };
        let own = gain(&nearest);
        (libm::exp(own), libm::exp(any_of(&terms, &graph, nearest, &mode, own)))
    }

    /// Fails if only the nearest counts, and if the member counts twice.
    #[test]
    fn without_an_object_the_ratio_of_whichever_candidate_is_one_on_average() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let frames = 4000;
        let (mut nearest, mut whichever) = (0.0, 0.0);
        for _ in 0..frames {
            // Two corners fix the bounding box of the candidates.
            let mut places = vec![Vector3::repeat(-HALF), Vector3::repeat(HALF)];
            places.extend((0..200).map(|_| Vector3::from_fn(|_, _| rng.random_range(-HALF..HALF))));
            let (of_nearest, of_any) = ratios(&places);
            nearest += of_nearest / f64::from(frames);
            whichever += of_any / f64::from(frames);
        }
        // 200 of the 202 are random; the standard deviation of the mean is .015.
        assert!((whichever - 1.0).abs() < 0.06, "{whichever}");
        assert!(nearest < 0.9, "{nearest}");
    }
}
