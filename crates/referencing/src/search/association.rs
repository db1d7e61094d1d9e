//! The association graph: candidate pairs as vertices, structural coherence as edges.

use nalgebra::Vector3;
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

impl Association {
    /// The graph of a problem.
    pub(crate) fn of(problem: &Problem<'_>) -> Self {
        let vertices = vertices(problem);
        let mut adjacency = BitMatrix::zeros(vertices.len());
        let mut tests = 0;
        // A cheap necessary condition first, on arrays that lie side by side; the exact test decides.
        let model: Vec<Vector3<f64>> = vertices.iter().map(|pair| problem.model[pair.model].at.coords).collect();
        let cloud: Vec<Vector3<f64>> =
            vertices.iter().map(|pair| problem.cloud[pair.cloud].position.at.coords).collect();
        let reach: Vec<f64> = vertices.iter().map(|&pair| reach(problem, pair)).collect();
        let mut near: Vec<bool> = Vec::new();
        for a in 0..vertices.len() {
            near.clear();
            near.extend((a + 1..vertices.len()).map(|b| {
                let (known, measured) = ((model[b] - model[a]).norm(), (cloud[b] - cloud[a]).norm());
                (known - measured).abs() <= reach[a] + reach[b]
            }));
            tests += near.len() as u64;
            for (step, _) in near.iter().enumerate().filter(|(_, near)| **near) {
                let b = a + 1 + step;
                if problem.coherent(vertices[a], vertices[b]) {
                    adjacency.connect(a, b);
                }
            }
        }
        Self { vertices, adjacency, tests }
    }

    /// The graph of those vertices alone that are to be kept.
    pub(super) fn restricted(&self, keep: impl Fn(Correspondence) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.vertices.len()).filter(|&v| keep(self.vertices[v])).collect();
        let mut place = vec![None; self.vertices.len()];
        kept.iter().enumerate().for_each(|(i, &v)| place[v] = Some(i));
        let mut adjacency = BitMatrix::zeros(kept.len());
        for (i, &v) in kept.iter().enumerate() {
            self.adjacency.ones(v).filter_map(|w| place[w]).filter(|&k| k > i).for_each(|k| adjacency.connect(i, k));
        }
        Self { vertices: kept.iter().map(|&v| self.vertices[v]).collect(), adjacency, tests: 0 }
    }
}

/// A share of a bound of Δ: that of two pairs is at most the sum of theirs, by √(x² + y²) ≤ x + y.
fn reach(problem: &Problem<'_>, pair: Correspondence) -> f64 {
    let bound = match problem.tolerance {
        Tolerance::Fixed(delta) => 0.5 * delta,
        Tolerance::Sigmas(k) => {
            let measured = problem.cloud[pair.cloud].position.covariance.trace().max(0.0).sqrt();
            k * (measured + problem.model[pair.model].sigma)
        }
    };
    bound * (1.0 + 1e-9) + 1e-12
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
