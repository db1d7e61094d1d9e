//! The association graph: candidate pairs as vertices, structural coherence as edges.

use seafix_geometry::Point;

use super::bitset::BitMatrix;
use crate::{Correspondence, Problem, Tolerance};

/// A clique of this graph is a set of pairs that are all coherent with each other, each model point
/// and each cloud point used at most once. Vertices stand in an order that depends on coordinates
/// alone, so that no answer depends on the order in which the cloud came.
///
/// Source: Bailey, *et al.*, Data association for mobile robot navigation: a graph theoretic
/// approach, 2000.
#[derive(Debug)]
pub(crate) struct Association {
    /// The candidate pairs, by model point.
    pub(crate) vertices: Vec<Correspondence>,
    /// Which pairs are coherent.
    pub(crate) adjacency: BitMatrix,
    /// Pair tests spent on the edges.
    pub(crate) tests: u64,
}

/// Cloud distances are tabulated up to this many points (2 MiB).
const MOST_TABULATED: usize = 512;

impl Association {
    /// The graph of a problem.
    pub(crate) fn of(problem: &Problem<'_>) -> Self {
        let vertices = vertices(problem);
        let mut adjacency = BitMatrix::zeros(vertices.len());
        let mut tests = 0;
        let quick = Quick::of(problem);
        // Ranges of vertices of one model point.
        let mut groups: Vec<std::ops::Range<usize>> = Vec::new();
        for (index, vertex) in vertices.iter().enumerate() {
            match groups.last_mut().filter(|group| vertices[group.start].model == vertex.model) {
                Some(group) => group.end = index + 1,
                None => groups.push(index..index + 1),
            }
        }
        for (g, first) in groups.iter().enumerate() {
            for second in &groups[g + 1..] {
                let known = problem.model[vertices[first.start].model]
                    .at
                    .distance(&problem.model[vertices[second.start].model].at);
                tests += (first.len() * second.len()) as u64;
                for a in first.clone() {
                    for b in second.clone() {
                        let (v, w) = (vertices[a], vertices[b]);
                        if quick.may_agree(problem, known, v, w) && problem.coherent(v, w) {
                            adjacency.connect(a, b);
                        }
                    }
                }
            }
        }
        Self { vertices, adjacency, tests }
    }
}

/// A cheap necessary condition of coherence; the exact test decides.
struct Quick {
    /// Distances of the cloud, row by row, where they fit.
    table: Vec<f64>,
    /// An upper bound of each cloud point's standard deviation in any direction; empty for a fixed Δ.
    sigma: Vec<f64>,
    fixed: f64,
}

impl Quick {
    fn of(problem: &Problem<'_>) -> Self {
        let at = |j: usize| problem.cloud[j].position.at;
        let count = problem.cloud.len();
        let table = if count <= MOST_TABULATED {
            (0..count).flat_map(|j| (0..count).map(move |l| at(j).distance(&at(l)))).collect()
        } else {
            Vec::new()
        };
        let (sigma, fixed) = match problem.tolerance {
            Tolerance::Fixed(delta) => (Vec::new(), delta),
            Tolerance::Sigmas(k) => {
                let bound =
                    |point: &seafix_geometry::MeasuredPoint| k * point.position.covariance.trace().max(0.0).sqrt();
                (problem.cloud.iter().map(bound).collect(), 0.0)
            }
        };
        Self { table, sigma, fixed }
    }

    fn may_agree(&self, problem: &Problem<'_>, known: f64, v: Correspondence, w: Correspondence) -> bool {
        let measured = if self.table.is_empty() {
            problem.cloud[v.cloud].position.at.distance(&problem.cloud[w.cloud].position.at)
        } else {
            self.table[v.cloud * problem.cloud.len() + w.cloud]
        };
        let reach = match problem.tolerance {
            Tolerance::Fixed(_) => self.fixed,
            Tolerance::Sigmas(k) => {
                // √(a² + b²) ≤ a + b, so this is at least Δ.
                self.sigma[v.cloud]
                    + self.sigma[w.cloud]
                    + k * (problem.model[v.model].sigma + problem.model[w.model].sigma)
            }
        };
        (known - measured).abs() <= reach * (1.0 + 1e-9) + 1e-12
    }
}

/// The candidate pairs in the order of their coordinates, model first.
fn vertices(problem: &Problem<'_>) -> Vec<Correspondence> {
    fn ranks<F>(points: impl Iterator<Item = Point<F>>) -> Vec<usize> {
        let points: Vec<_> = points.map(|point| point.coords).collect();
        let mut order: Vec<usize> = (0..points.len()).collect();
        let key = |i: usize| points[i];
        order.sort_by(|&i, &j| {
            let (a, b) = (key(i), key(j));
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)).then(i.cmp(&j))
        });
        let mut ranks = vec![0; points.len()];
        order.into_iter().enumerate().for_each(|(rank, i)| ranks[i] = rank);
        ranks
    }
    let model = ranks(problem.model.iter().map(|point| point.at));
    let cloud = ranks(problem.cloud.iter().map(|point| point.position.at));
    let mut vertices: Vec<_> = problem
        .candidates
        .lists
        .iter()
        .enumerate()
        .flat_map(|(i, list)| list.iter().map(move |&j| Correspondence { model: i, cloud: j }))
        .collect();
    vertices.sort_by_key(|pair| (model[pair.model], cloud[pair.cloud]));
    vertices
}
