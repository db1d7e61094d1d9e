//! The candidate pairs of points and of edges of one problem, as vertices of one graph.

use std::cmp::Ordering;

use nalgebra::Vector3;

use super::{
    association::vertices,
    directed_edge::{DirectedEdge, directed_edges_agree, point_agrees_along},
    handedness::{self, Feature},
    orientation::Sense,
};
use crate::{
    problem::{Correspondence, Problem},
    solve::likelihood::mixed::MIN_FEATURE_VALUE,
    space_line::SpaceLine,
};

/// A candidate pair of a model edge and a measured line, in one of two directions.
#[derive(Debug, Clone)]
pub(super) struct EdgePair {
    /// The model edge and the measured line.
    pub(super) pair: Correspondence,
    /// Both, with the direction.
    pub(super) directed: DirectedEdge,
    /// The standard deviations (m) of the model's ends.
    pub(super) sigma: f64,
    /// Whether the line has a measured depth; only such a line fixes a pose.
    pub(super) depth: bool,
}

/// The points and edges of a set, each in the order of the model.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct FeatureSet {
    /// The pairs of points.
    pub(crate) points: Vec<Correspondence>,
    /// The pairs of edges: model edge and measured line.
    pub(crate) edges: Vec<Correspondence>,
}

impl FeatureSet {
    /// The number of features.
    pub(crate) fn len(&self) -> usize {
        self.points.len() + self.edges.len()
    }
}

/// Whether this number of points and edges can determine a pose.
pub(super) fn enough(points: usize, edges: usize) -> bool {
    2 * points + 3 * edges >= MIN_FEATURE_VALUE
}

/// The vertices: the pairs of points, then the pairs of edges, twice each, once for each direction.
///
/// The order depends on coordinates alone, as that of the points ([`vertices`]).
#[derive(Debug, Clone)]
pub(super) struct Features<'a> {
    pub(super) problem: &'a Problem<'a>,
    /// The pairs of points.
    pub(super) points: Vec<Correspondence>,
    /// The pairs of edges, those of one model edge together.
    pub(super) edges: Vec<EdgePair>,
}

impl<'a> Features<'a> {
    /// All candidate pairs.
    pub(super) fn of(problem: &'a Problem<'a>) -> Self {
        let crate::problem::Edges { model, lines, candidates } = problem.edges;
        let prepared: Vec<Option<SpaceLine>> = lines.iter().map(SpaceLine::of).collect();
        let model_ends: Vec<_> = model.iter().map(|edge| edge.places(problem.model).map(|end| end.coords)).collect();
        let line_ends: Vec<_> = lines.iter().map(|line| line.ends.map(|end| end.coords)).collect();
        let (model_ranks, line_ranks) = (ranks(&model_ends), ranks(&line_ends));
        let mut edges = Vec::new();
        for (i, list) in candidates.iter().enumerate() {
            let sigma = model[i].sigmas(problem.model).into_iter().fold(0.0, f64::max);
            for (&j, reversed) in list.iter().flat_map(|j| [(j, false), (j, true)]) {
                let Some(line) = prepared[j] else { continue };
                let [from, to] = model_ends[i];
                // Relative to the coordinates, so that the order of the ends does not matter.
                let opposite = reversed != (ordered(&model_ends[i]) != ordered(&line_ends[j]));
                let ends = if opposite { [to, from] } else { [from, to] };
                let Some(directed) = DirectedEdge::of(ends, line) else { continue };
                let pair = Correspondence { model: i, cloud: j };
                let key = (model_ranks[i], line_ranks[j], reversed);
                edges.push((key, EdgePair { pair, directed, sigma, depth: lines[j].depth }));
            }
        }
        edges.sort_by_key(|(key, _)| *key);
        Self { problem, points: vertices(problem), edges: edges.into_iter().map(|(_, edge)| edge).collect() }
    }

    /// The vertices to keep.
    pub(super) fn filtered(&self, keep: impl Fn(&Self, usize) -> bool) -> Self {
        let points = (0..self.points.len()).filter(|&v| keep(self, v)).map(|v| self.points[v]);
        let edges = (self.points.len()..self.len()).filter(|&v| keep(self, v));
        let edges = edges.filter_map(|v| self.edge(v).cloned());
        Self { problem: self.problem, points: points.collect(), edges: edges.collect() }
    }

    /// The number of vertices.
    pub(super) fn len(&self) -> usize {
        self.points.len() + self.edges.len()
    }

    /// The edge of a vertex; `None` for a pair of points.
    pub(super) fn edge(&self, vertex: usize) -> Option<&EdgePair> {
        vertex.checked_sub(self.points.len()).map(|k| &self.edges[k])
    }

    /// The pair of a vertex in one numbering: points first, then edges; cloud points first, then lines.
    pub(super) fn numbered(&self, vertex: usize) -> Correspondence {
        match self.edge(vertex) {
            None => self.points[vertex],
            Some(EdgePair { pair, .. }) => Correspondence {
                model: self.problem.model.len() + pair.model,
                cloud: self.problem.cloud.len() + pair.cloud,
            },
        }
    }

    /// The set of some vertices.
    pub(super) fn set(&self, vertices: &[usize]) -> FeatureSet {
        let mut set = FeatureSet::default();
        for &v in vertices {
            match self.edge(v) {
                None => set.points.push(self.points[v]),
                Some(edge) => set.edges.push(edge.pair),
            }
        }
        set.points.sort_unstable();
        set.edges.sort_unstable();
        set
    }

    /// The number of model features with a candidate, and of those of points.
    pub(super) fn available(&self) -> (usize, usize) {
        let points = self.points.chunk_by(|a, b| a.model == b.model).count();
        (points + self.edges.chunk_by(|a, b| a.pair.model == b.pair.model).count(), points)
    }

    /// Upper bound of the size of a set: one feature each of model and measurements.
    pub(super) fn max_possible(&self) -> usize {
        let mut measured: Vec<usize> = (0..self.len()).map(|v| self.numbered(v).cloud).collect();
        measured.sort_unstable();
        measured.dedup();
        self.available().0.min(measured.len())
    }

    /// Whether two vertices are coherent: different features whose distances and angles agree, in the given sense.
    pub(super) fn coherent(&self, a: usize, b: usize, sense: Sense) -> bool {
        let sigmas = self.problem.sigmas();
        let along = |point: Correspondence, edge: &EdgePair| {
            let (known, seen) = (&self.problem.model[point.model], &self.problem.cloud[point.cloud].position);
            point_agrees_along(&known.at.coords, (&seen.at.coords, &seen.covariance), &edge.directed, sigmas)
        };
        match (self.edge(a), self.edge(b)) {
            (None, None) => self.problem.coherent(self.points[a], self.points[b]),
            (None, Some(edge)) => along(self.points[a], edge),
            (Some(edge), None) => along(self.points[b], edge),
            (Some(one), Some(other)) => {
                one.pair.model != other.pair.model
                    && one.pair.cloud != other.pair.cloud
                    && directed_edges_agree(&one.directed, &other.directed, sigmas, sense)
            }
        }
    }

    /// Whether three vertices contradict the sense; points alone never do.
    pub(super) fn rejects(&self, three: [usize; 3], sense: Sense) -> bool {
        if three.iter().all(|&v| v < self.points.len()) {
            return false;
        }
        let feature = |v: usize| match self.edge(v) {
            Some(edge) => Feature::Edge(&edge.directed),
            None => {
                let Correspondence { model, cloud } = self.points[v];
                let seen = &self.problem.cloud[cloud].position;
                Feature::Point(self.problem.model[model].at.coords, seen.at.coords, &seen.covariance)
            }
        };
        handedness::rejects(three.map(feature), sense)
    }
}

/// Whether the first of two places comes before the second.
fn ordered(ends: &[Vector3<f64>; 2]) -> bool {
    compared(&ends[0], &ends[1]) != Ordering::Greater
}

fn compared(a: &Vector3<f64>, b: &Vector3<f64>) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
}

/// The place of each item in the order of coordinates; among equals the first.
fn ranks(all: &[[Vector3<f64>; 2]]) -> Vec<usize> {
    let canonical = |ends: &[Vector3<f64>; 2]| if ordered(ends) { *ends } else { [ends[1], ends[0]] };
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&i, &k| {
        let ([a, b], [c, d]) = (canonical(&all[i]), canonical(&all[k]));
        compared(&a, &c).then_with(|| compared(&b, &d)).then(i.cmp(&k))
    });
    let mut ranks = vec![0; all.len()];
    order.into_iter().enumerate().for_each(|(rank, i)| ranks[i] = rank);
    ranks
}
