//! Local density of clutter: in dense clutter some points fit any pose.

use super::{
    clumped_clutter::ClumpedClutter,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    line_density::{Densities, LineDensity, NEAR},
    prior_terms::PriorTerms,
    visible::ln_visible,
};
use crate::{
    a_contrario::{coordinates::shuffled, sample::spread_sample},
    ablation::SearchMechanism,
    problem::{Correspondence, Problem},
};

/// Number of cloud points from which the fractions of structured clutter are estimated.
const SAMPLE: usize = 64;
/// Number of rounds of that estimate; it changes by less than a hundredth afterwards.
const ROUNDS: usize = 20;
/// Maximum number of members whose density is computed; the others of a larger set have their mean excess.
const MAX_MEMBERS: usize = 64;
/// Ratio of the density k/V_k by the k-th neighbour, whose reciprocal has no bias, to (k − 1)/V_k, which has none
/// itself.
///
/// A pose's evidence is a product of reciprocal densities. Without the object its expectation is at most one only if
/// E[1/ρ̂] ≤ 1/ρ for each factor, and V_k is the sum of k exponential volumes: E[V_k] = k/ρ.
const RECIPROCAL: f64 = NEAR as f64 / (NEAR - 1) as f64;
/// Maximum ratio of the density at the centre of a clump to its mean over the ball through the third neighbour.
///
/// In a Gaussian clump of m points the ball has the radius at which χ²₃ reaches the probability 3/m. The ratio is 1.4
/// for 13 points, 1.7 for eight, and 2.25 for five, the fewest of a clump.
const PEAK: f64 = 2.25;
/// Ratio of the densities within the third and within the sixteenth neighbour above which a point lies in a clump.
///
/// It is exceeded in uniform clutter at one point in 80.
const CLUMP: f64 = 4.0;
/// Distance (standard deviations) below which two points may be one place measured twice.
const SYMMETRIC: f64 = 5.0;

/// The local density of the cloud about its points.
///
/// The terms of a pose assume uniform clutter in each gate. On the edges of a box or in clumps, a pose finds fitting
/// points much more often, and each has less evidence. Clutter is therefore a mixture of uniform points, of points on
/// lines and of points in clumps, ρ = Σ_m w_m ρ_m ([`LineDensity`]). The frame determines the fractions w: those that
/// maximise the likelihood of its own points, each predicted by the others (stacked density estimation, Smyth and
/// Wolpert 1999, by expectation maximisation). Clumps about the predicted
/// places of all model points are counted together ([`ClumpedClutter`]); the denser of both holds.
#[derive(Default)]
pub(in crate::search) struct ClutterDensity {
    lines: Option<Lines>,
    /// The clutter about the predicted places.
    clumped_clutter: Option<ClumpedClutter>,
    /// A distance (m) and the fraction of candidates with another so near; `None` until it is needed.
    duplicates: Option<(f64, f64)>,
    /// The mechanisms left out.
    without: Vec<SearchMechanism>,
}

/// The densities along lines and in clumps, and the fractions of clutter that have them.
struct Lines {
    density: LineDensity,
    fractions: [f64; 2],
}

impl ClutterDensity {
    /// The density without these mechanisms.
    pub(in crate::search) fn without(mechanisms: &[SearchMechanism]) -> Self {
        Self { without: mechanisms.to_vec(), ..Self::default() }
    }

    fn with(&self, mechanism: SearchMechanism) -> bool {
        !self.without.contains(&mechanism)
    }

    /// Recomputes the evidence of a mode with the local clutter density about each of its points.
    ///
    /// The cloud points in `other` are those of another object, and no clutter.
    ///
    /// A point in dense clutter may contribute negatively; it is then rather clutter than the object's. The evidence is
    /// summed over the subsets of members that are the object's ([`ln_visible`]).
    pub(in crate::search) fn weigh(
        &mut self,
        problem: &Problem<'_>,
        (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
        mode: &mut Mode,
        other: &[usize],
    ) {
        let excess = self.excesses(problem, (terms, prior_terms, graph), mode, other);
        let even: Vec<f64> = mode.members.iter().map(|&v| terms.residual_gain(v, &mode.motion)).collect();
        let gain = |at: usize| match self.with(SearchMechanism::AllCandidates) {
            true => any_of(terms, graph, mode.members[at], mode, even[at]),
            false => even[at],
        };
        let dense: Vec<f64> = (0..even.len()).map(|at| gain(at) - excess[at]).collect();
        let of_pose = mode.ln_evidence - even.iter().sum::<f64>() - terms.ln_fraction[even.len()];
        let sum = |gains: &[f64]| match self.with(SearchMechanism::Subsets) {
            true => ln_visible(gains, &terms.ln_fraction),
            false => gains.iter().sum::<f64>() + terms.ln_fraction[gains.len()],
        };
        let (even, dense) = (sum(&even), sum(&dense));
        mode.ln_evidence = of_pose + dense;
        mode.ln_clutter_density = even - dense;
    }

    /// The excess density (nats) of clutter over uniform clutter about each of the mode's points; `other` as in
    /// [`weigh`](Self::weigh).
    pub(super) fn excesses(
        &mut self,
        problem: &Problem<'_>,
        (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
        mode: &Mode,
        other: &[usize],
    ) -> Vec<f64> {
        let members: Vec<usize> = mode.members.iter().map(|&v| graph.vertices[v].cloud).collect();
        let no_clutter = [&members, other].concat();
        let known = prior_terms.known.as_ref().filter(|_| self.with(SearchMechanism::ClumpedClutter));
        let clumped = known.map(|known| {
            let clumped_clutter = self.clumped_clutter.get_or_insert_with(|| ClumpedClutter::of(problem, known));
            (known, clumped_clutter.beside(&no_clutter))
        });
        let mut is_clutter = vec![true; problem.cloud.len()];
        no_clutter.iter().for_each(|&j| is_clutter[j] = false);
        let every = members.len().div_ceil(MAX_MEMBERS).max(1);
        let excess: Vec<f64> = (0..members.len())
            .step_by(every)
            .map(|at| {
                let v = mode.members[at];
                let Correspondence { model, cloud } = graph.vertices[v];
                let place = &problem.cloud[cloud].position.at.coords;
                let excess = match self.with(SearchMechanism::LocalDensity) {
                    true => self.excess(problem, (terms, graph), v, &is_clutter),
                    false => 0.0,
                };
                let clumped = clumped.as_ref().map(|(known, clumped)| clumped.about(known, model, place));
                let duplicate = match self.with(SearchMechanism::Duplicates) {
                    true => self.duplicate(problem, terms, graph, v, &members[..at]),
                    false => None,
                };
                // Sparser clutter than the gate's counts in favour of a point, unless one of these is found.
                [clumped, duplicate].into_iter().flatten().filter(|of| *of > 0.0).fold(excess, f64::max)
            })
            .collect();
        let mean = excess.iter().sum::<f64>() / excess.len().max(1) as f64;
        (0..members.len()).map(|at| if at.is_multiple_of(every) { excess[at / every] } else { mean }).collect()
    }

    /// ln ρ/ρ_even at the cloud point of a vertex, with the cloud points that are clutter.
    fn excess(
        &mut self,
        problem: &Problem<'_>,
        (terms, graph): (&PairTerms, &ConsistencyGraph),
        v: usize,
        is_clutter: &[bool],
    ) -> f64 {
        let lines = self.lines.get_or_insert_with(|| Lines::of(problem, (terms, graph), is_clutter));
        let cloud = graph.vertices[v].cloud;
        let Densities { along, near, wide } = lines.density.at(cloud, |j| !is_clutter[j]);
        let max = if self.without.contains(&SearchMechanism::ClumpPeak) { 1.0 } else { PEAK };
        let peak = (near / (CLUMP * wide).max(f64::MIN_POSITIVE)).clamp(1.0, max);
        let density = [along, peak * RECIPROCAL * near];
        let even = even(problem, (terms, graph), &lines.density, v);
        libm::log1p(density.iter().zip(lines.fractions).map(|(density, w)| w * (density / even - 1.0)).sum())
    }

    /// The excess density (nats) of a point measured beside an earlier member.
    ///
    /// The second of two points a few standard deviations apart is as frequent as candidates have another so near.
    /// Putative pairs: a point beside r earlier members is matched beside one of them with the probability 1 − (1 −
    /// g)^r, where g is the fraction of neighbouring pairs of points that are matched to neighbouring points.
    /// Descriptors of overlapping neighbourhoods are alike, and so are their wrong matches.
    fn duplicate(
        &mut self,
        problem: &Problem<'_>,
        terms: &PairTerms,
        graph: &ConsistencyGraph,
        v: usize,
        before: &[usize],
    ) -> Option<f64> {
        let pair = graph.vertices[v];
        let seen = &problem.cloud[pair.cloud].position;
        let reach = SYMMETRIC * (seen.covariance.trace() / 3.0).sqrt();
        let beside = before.iter().filter(|&&j| problem.cloud[j].position.at.distance(&seen.at) <= reach).count();
        if beside == 0 {
            return None;
        }
        let putative = shuffled(problem);
        let fraction = match self.duplicates {
            Some((of, fraction)) if of == reach => fraction,
            _ if putative => neighbours_matched(problem, reach),
            _ => duplicates(problem, reach),
        };
        self.duplicates = Some((reach, fraction));
        let fraction = if putative { 1.0 - (1.0 - fraction).powi(beside as i32) } else { fraction };
        let volume = 4.0 / 3.0 * std::f64::consts::PI * reach.powi(3);
        Some(libm::log(fraction / volume) - terms.ln_density_about(v, pair.model))
    }
}

impl Lines {
    fn of(problem: &Problem<'_>, (terms, graph): (&PairTerms, &ConsistencyGraph), is_clutter: &[bool]) -> Self {
        let mut density = LineDensity::of(problem);
        // The vertices of each cloud point; that of the first model point represents them.
        let mut of_cloud: Vec<Option<usize>> = vec![None; problem.cloud.len()];
        for (v, pair) in graph.vertices.iter().enumerate() {
            if is_clutter[pair.cloud]
                && of_cloud[pair.cloud].is_none_or(|known| graph.vertices[known].model > pair.model)
            {
                of_cloud[pair.cloud] = Some(v);
            }
        }
        let mut sample: Vec<usize> = (0..of_cloud.len()).filter(|&j| of_cloud[j].is_some()).collect();
        spread_sample(problem.cloud, &mut sample, SAMPLE);
        let ratios: Vec<[f64; 2]> = sample
            .iter()
            .filter_map(|&j| Some((j, of_cloud[j]?)))
            .map(|(j, v)| {
                let even = even(problem, (terms, graph), &density, v);
                let Densities { along, near, .. } = density.at(j, |other| !is_clutter[other]);
                [along / even, near / even]
            })
            .filter(|ratios| ratios.iter().all(|ratio| ratio.is_finite()))
            .collect();
        let mut fractions = [1.0 / 3.0; 2];
        for _ in 0..ROUNDS {
            // A uniform prior of the fractions: one more point that is a third of each kind.
            let mut sums = [1.0 / 3.0; 2];
            for ratios in &ratios {
                let of: [f64; 2] = std::array::from_fn(|m| fractions[m] * ratios[m]);
                let all = 1.0 - fractions.iter().sum::<f64>() + of.iter().sum::<f64>();
                (0..2).for_each(|m| sums[m] += of[m] / all);
            }
            fractions = sums.map(|sum| sum / (ratios.len() + 1) as f64);
        }
        Self { density, fractions }
    }
}

/// The density (1/m³) of cloud points about a vertex if clutter is uniform; without a prior that of all candidates.
fn even(problem: &Problem<'_>, (terms, graph): (&PairTerms, &ConsistencyGraph), of: &LineDensity, v: usize) -> f64 {
    let Correspondence { model, .. } = graph.vertices[v];
    let own = terms.ln_density_about(v, model);
    libm::exp(match problem.prior {
        Some(_) => own,
        // Candidates given without a prior: the other points of the cloud are at random distances.
        None => own + libm::log(of.len() as f64 / problem.candidates.lists[model].len().max(1) as f64),
    })
}

/// ln of the likelihood ratio of a member's model point over all its candidates: Σ_j r_ij over those near its place.
///
/// r_ij is the ratio of candidate j, and `own` is ln of the member's. The best of several candidates in dense clutter
/// is near by chance; only the sum has the expectation one without an object.
fn any_of(terms: &PairTerms, graph: &ConsistencyGraph, v: usize, mode: &Mode, own: f64) -> f64 {
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

/// The fraction of pairs of model points within `reach` (m) whose partners are within `reach` too.
fn neighbours_matched(problem: &Problem<'_>, reach: f64) -> f64 {
    let lists = problem.candidates.lists.iter().enumerate();
    let mut all: Vec<Correspondence> = lists
        .flat_map(|(model, list)| list.iter().map(move |&cloud| Correspondence { model, cloud }))
        .filter(|pair| problem.model[pair.model].at.coords.x.is_finite())
        .collect();
    let at = |pair: &Correspondence| &problem.model[pair.model].at;
    all.sort_by(|a, b| at(a).coords.x.total_cmp(&at(b).coords.x).then(a.cmp(b)));
    let (mut near, mut both) = (0u64, 0u64);
    for (i, a) in all.iter().enumerate() {
        let next = all[i + 1..].iter().take_while(|b| at(b).coords.x - at(a).coords.x <= reach);
        for b in next.filter(|b| a.model != b.model && a.cloud != b.cloud && at(a).distance(at(b)) <= reach) {
            near += 1;
            both += u64::from(problem.measured(a.cloud, b.cloud) <= reach);
        }
    }
    both as f64 / near.max(1) as f64
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::search::consensus::motion::Motion;
    use crate::{candidates::Candidates, problem::Tolerance, site::model::ModelPoint};

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
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("no prior to reject");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = PairTerms::of(&problem, &prior_terms, &graph);
        let motion = Motion { rotation: Matrix3::identity(), translation: Vector3::zeros() };
        let gain = |v: &usize| terms.residual_gain(*v, &motion);
        let nearest = (0..cloud.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).expect("a candidate");
        let mode = Mode {
            members: vec![nearest],
            edges: Vec::new(),
            motion,
            ln_evidence: 0.0,
            ln_uniform: 0.0,
            ln_clutter_density: 0.0,
        };
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
