//! Clutter with a structure of its own: where three of its points lie like the object's, more of them do.

use nalgebra::Vector3;

use super::{
    Motion,
    bits::{intersect, ones},
    graph::Graph,
    likelihood::{Mode, Terms},
};
use crate::{Correspondence, Problem};

/// Poses that are tried, and how many pairs are looked at for each to begin with.
const POSES: usize = 96;
const ATTEMPTS: usize = 4;
/// A pair may be so many of its own standard deviations from a pose that three noisy points give.
const LOOSE: f64 = 2.0;
/// What lies further from three points than this many of their least altitudes is not predicted well enough to count.
const LONG: f64 = 2.5;
/// So many points (expected and found) that evenly spread clutter is believed to explain before any is counted.
const BEFOREHAND: f64 = 2.0;
/// So many times what the densities predict are no accident.
const STRUCTURED: f64 = 4.0;
/// The golden section: steps that meet no period.
const STEP: f64 = 0.618_033_988_749_895;

/// How much oftener points of the cloud lie where a pose of three of them predicts more than if they were spread evenly (ln).
///
/// Clutter on a grid, along an edge or measured twice is not spread evenly about any place; but beside the likeliest pose it
/// can be seen what it does for others. Poses of threes of pairs that contradict that pose are tried, and the points that they
/// find are counted over those that the densities predict. Model points within the tolerance of one of the three stand by
/// themselves: what is measured twice is near there for that reason alone.
/// (An empirical null: Efron, *Large-scale simultaneous hypothesis testing*, 2004.)
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::search) struct Structure {
    /// Of model points away from the three.
    far: f64,
    /// Of model points nearer than twice the tolerance to one of them.
    near: f64,
}

impl Structure {
    pub(in crate::search) fn of(problem: &Problem<'_>, terms: &Terms, graph: &Graph, best: &Mode) -> Self {
        let contradicts = contradicting(terms, graph, best);
        let (mut found, mut expected) = ([0.0; 2], [0.0; 2]);
        for (three, motion) in threes(terms, graph, &contradicts) {
            count(problem, terms, graph, &contradicts, &three, &motion, &mut found, &mut expected);
        }
        let times = |k: usize| libm::log((found[k] + BEFOREHAND) / (expected[k] + BEFOREHAND));
        Self { far: times(0), near: times(1) }
    }

    /// Whether clutter gathers points about its own poses as the object does, and not by accident.
    pub(in crate::search) fn imitates(&self) -> bool {
        self.far > libm::log(STRUCTURED)
    }

    /// ln of how much oftener a pair is met than by its density, where others of the same set were met before.
    pub(in crate::search) fn times(
        &self,
        problem: &Problem<'_>,
        pair: Correspondence,
        before: impl Iterator<Item = Correspondence>,
    ) -> f64 {
        let mut before = before;
        if before.any(|other| is_near(problem, pair, other)) { self.near.max(self.far) } else { self.far }
    }
}

fn is_near(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> bool {
    let step = problem.model[a.model].at.coords - problem.model[b.model].at.coords;
    step.norm() <= 2.0 * problem.delta(a, b)
}

/// The pairs that the pose explains neither itself nor by their cloud point, one bit each.
pub(in crate::search) fn contradicting(terms: &Terms, graph: &Graph, pose: &Mode) -> Vec<u64> {
    let mut taken: Vec<usize> = pose.members.iter().map(|&v| graph.vertices[v].cloud).collect();
    taken.sort_unstable();
    let mut bits = vec![0; graph.vertices.len().div_ceil(64)];
    for (v, pair) in graph.vertices.iter().enumerate() {
        if taken.binary_search(&pair.cloud).is_err() && terms.of_pair(v, &pose.motion).is_none() {
            bits[v / 64] |= 1 << (v % 64);
        }
    }
    bits
}

/// Poses of coherent threes among these pairs, taken evenly.
fn threes(terms: &Terms, graph: &Graph, of: &[u64]) -> Vec<([usize; 3], Motion)> {
    let all: Vec<usize> = ones(of, 0).collect();
    let mut found = Vec::new();
    let (mut row, mut common) = (vec![0; of.len()], vec![0; of.len()]);
    let mut place = 0.0;
    let mut pick = |count: usize| {
        place = (place + STEP) % 1.0;
        ((place * count as f64) as usize).min(count - 1)
    };
    for _ in 0..ATTEMPTS * POSES {
        if found.len() >= POSES || all.is_empty() {
            break;
        }
        let a = all[pick(all.len())];
        let count = intersect(graph.row(a), of, 0, &mut row);
        if count == 0 {
            continue;
        }
        let Some(b) = ones(&row, 0).nth(pick(count)) else { continue };
        let count = intersect(&row, graph.row(b), 0, &mut common);
        if count == 0 {
            continue;
        }
        let Some(c) = ones(&common, 0).nth(pick(count)) else { continue };
        let three = [a, b, c];
        if let Some(motion) = Motion::of_three(three.map(|v| &terms.model[v]), three.map(|v| &terms.cloud[v])) {
            found.push((three, motion));
        }
    }
    found
}

/// Adds the model points that a pose of three finds, and those that the densities predict, away from the three and near them.
#[expect(clippy::too_many_arguments, reason = "they are what a pose is held against")]
fn count(
    problem: &Problem<'_>,
    terms: &Terms,
    graph: &Graph,
    of: &[u64],
    three: &[usize; 3],
    motion: &Motion,
    found: &mut [f64; 2],
    expected: &mut [f64; 2],
) {
    let model = three.map(|v| terms.model[v]);
    let centre: Vector3<f64> = (model[0] + model[1] + model[2]) / 3.0;
    let altitude = super::seeds::altitude(model.each_ref());
    for rank in 0..graph.starts.len() - 1 {
        let vertices = graph.starts[rank]..graph.starts[rank + 1];
        let first = graph.vertices[vertices.start];
        if three.iter().any(|&v| graph.vertices[v].model == first.model) {
            continue;
        }
        let lever = 1.0 + (terms.model[vertices.start] - centre).norm() / altitude;
        if lever > LONG {
            continue;
        }
        let reach = LOOSE * lever;
        let place = motion.apply(&terms.model[vertices.start]);
        let (mut hit, mut volume) = (false, 0.0);
        for v in vertices {
            // ln N(0) = −½ ln det Σ − 3/2 ln 2π gives the ellipsoid's volume.
            if volume == 0.0 {
                let ln_peak = terms.gain[v] + terms.ln_density[first.model];
                let root = libm::exp(-ln_peak - 3.0 * super::likelihood::HALF_LN_2PI);
                volume = 4.0 / 3.0 * std::f64::consts::PI * reach.powi(3) * root;
            }
            let r = terms.cloud[v] - place;
            if of[v / 64] >> (v % 64) & 1 == 1 && r.dot(&(terms.weight[v] * r)) <= reach * reach {
                hit = true;
                break;
            }
        }
        let mean = libm::exp(terms.ln_density[first.model]) * volume;
        let near = three.iter().any(|&v| is_near(problem, first, graph.vertices[v]));
        found[usize::from(near)] += f64::from(u8::from(hit));
        expected[usize::from(near)] += -libm::expm1(-mean);
    }
}
