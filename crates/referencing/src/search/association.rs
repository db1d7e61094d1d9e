//! The consistency graph: candidate pairs as vertices, structural coherence as edges.

use std::ops::Range;

use seafix_geometry::Point;

use super::{bitset::BitMatrix, edges::Sites, features::Features, orientation::Sense};
use crate::{
    lanes::{LANES, ones_of},
    problem::{Correspondence, Problem, Tolerance},
};

/// The consistency graph, whose cliques are one-to-one sets of mutually coherent pairs.
///
/// The order of the vertices depends on coordinates alone, so that no answer depends on the order of the cloud.
///
/// Source: Bailey, *et al.*, Data association for mobile robot navigation: a graph theoretic approach, 2000.
#[derive(Debug)]
pub(crate) struct Association {
    /// The candidate pairs, by model point.
    pub(crate) vertices: Vec<Correspondence>,
    /// The coherent pairs of vertices.
    pub(crate) adjacency: BitMatrix,
    /// Number of pair tests spent on the edges.
    pub(crate) pair_tests: u64,
}

impl Association {
    /// The graph of a problem.
    pub(crate) fn of(problem: &Problem<'_>) -> Self {
        let vertices = vertices(problem);
        let mut adjacency = BitMatrix::zeros(vertices.len());
        // A cheap necessary condition first, and a sufficient one; the exact test decides between them.
        let mut sites = Sites::default();
        for &pair in &vertices {
            let (model, cloud) = (problem.model[pair.model].at.coords, problem.cloud[pair.cloud].position.at.coords);
            let (reach, sure) = reach(problem, pair);
            sites.push(&model, &cloud, reach, sure);
        }
        sites.pad();
        let same_cloud = same_cloud(&vertices);
        let (mut comparisons, mut next_model) = (Vec::new(), 0);
        for (a, &pair) in vertices.iter().enumerate() {
            while next_model < vertices.len() && vertices[next_model].model == pair.model {
                next_model += 1;
            }
            let first = next_model / LANES;
            sites.compare(a, first, &mut comparisons);
            // Two pairs of one model point or of one cloud point are never adjacent.
            let same = same_cloud[a].iter().copied().filter(|&b| b >= next_model);
            same.for_each(|b| comparisons[b / LANES - first].near &= !(1 << (b % LANES)));
            if let Some(compare) = comparisons.first_mut() {
                compare.near &= u64::MAX << (next_model % LANES);
            }
            let row = adjacency.row_mut(a);
            for (word, compare) in (first..).zip(&comparisons) {
                let mut edges = compare.near & compare.sure;
                for k in ones_of(0, compare.near & !compare.sure) {
                    let agree = problem.coherent(pair, vertices[word * LANES + k]);
                    edges |= u64::from(agree) << k;
                }
                row[word] = edges;
            }
        }
        adjacency.mirror_upper();
        let count = vertices.len() as u64;
        Self { vertices, adjacency, pair_tests: count * count.saturating_sub(1) / 2 }
    }

    /// The graph of points and edges, numbered as [`Features::numbered`] says; edges agree in one sense.
    pub(super) fn with_edges(features: &Features<'_>, sense: Sense) -> Self {
        let (points, count) = (features.points.len(), features.len());
        let of_points = Self::of(features.problem);
        let mut adjacency = BitMatrix::zeros(count);
        if of_points.vertices == features.points {
            for v in 0..points {
                of_points.adjacency.ones(v).filter(|&w| w > v).for_each(|w| adjacency.connect(v, w));
            }
        } else {
            connect(&mut adjacency, features, sense, 0..points);
        }
        connect(&mut adjacency, features, sense, points..count);
        let tests = count as u64;
        Self {
            vertices: (0..count).map(|v| features.numbered(v)).collect(),
            adjacency,
            pair_tests: tests * tests.saturating_sub(1) / 2,
        }
    }

    /// The subgraph of the vertices to keep.
    pub(super) fn restricted(&self, keep: impl Fn(Correspondence) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.vertices.len()).filter(|&v| keep(self.vertices[v])).collect();
        let mut place = vec![None; self.vertices.len()];
        kept.iter().enumerate().for_each(|(i, &v)| place[v] = Some(i));
        let mut adjacency = BitMatrix::zeros(kept.len());
        for (i, &v) in kept.iter().enumerate() {
            self.adjacency.ones(v).filter_map(|w| place[w]).filter(|&k| k > i).for_each(|k| adjacency.connect(i, k));
        }
        Self { vertices: kept.iter().map(|&v| self.vertices[v]).collect(), adjacency, pair_tests: 0 }
    }
}

/// Connects some vertices with the coherent ones before them.
fn connect(adjacency: &mut BitMatrix, features: &Features<'_>, sense: Sense, of: Range<usize>) {
    for b in of {
        (0..b).filter(|&a| features.coherent(a, b, sense)).for_each(|a| adjacency.connect(a, b));
    }
}

/// Additive parts of bounds of Δ: the Δ of two pairs is at most the sum of the first, and at least that of the second.
pub(super) fn reach(problem: &Problem<'_>, pair: Correspondence) -> (f64, f64) {
    // Distances have rounding errors relative to the coordinates.
    let (known, measured) = (problem.model[pair.model].at, problem.cloud[pair.cloud].position.at);
    let rounding = 1e-13 * known.coords.amax().max(measured.coords.amax());
    let max = problem.fraction_of_delta(pair) * (1.0 + 1e-9) + rounding;
    let min = match problem.tolerance {
        Tolerance::Fixed(delta) => 0.5 * delta * (1.0 - 1e-9) - rounding,
        Tolerance::Sigmas(_) => -1.0,
    };
    (max, min)
}

/// The later vertices of the same cloud point, for each vertex.
fn same_cloud(vertices: &[Correspondence]) -> Vec<Vec<usize>> {
    let mut by_cloud: Vec<usize> = (0..vertices.len()).collect();
    by_cloud.sort_by_key(|&v| (vertices[v].cloud, v));
    let mut same_cloud = vec![Vec::new(); vertices.len()];
    for same in by_cloud.chunk_by(|&a, &b| vertices[a].cloud == vertices[b].cloud) {
        same.iter().enumerate().for_each(|(place, &v)| same_cloud[v] = same[place + 1..].to_vec());
    }
    same_cloud
}

/// The indices of points by their coordinates; among equals the first.
pub(super) fn by_coordinates<F>(points: impl Iterator<Item = Point<F>>) -> Vec<usize> {
    let points: Vec<_> = points.map(|point| point.coords).collect();
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (points[i], points[j]);
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)).then(i.cmp(&j))
    });
    order
}

/// The candidate pairs in the order of their coordinates, model first. Pairs with a coordinate that is not finite are
/// excluded, since they agree with nothing.
pub(super) fn vertices(problem: &Problem<'_>) -> Vec<Correspondence> {
    fn ranks<F>(points: impl Iterator<Item = Point<F>>) -> Vec<usize> {
        let order = by_coordinates(points);
        let mut ranks = vec![0; order.len()];
        order.into_iter().enumerate().for_each(|(rank, i)| ranks[i] = rank);
        ranks
    }
    let model = ranks(problem.model.iter().map(|point| point.at));
    let cloud = ranks(problem.cloud.iter().map(|point| point.position.at));
    let finite = |pair: &Correspondence| {
        problem.model[pair.model].at.is_finite() && problem.cloud[pair.cloud].position.at.is_finite()
    };
    let mut vertices: Vec<_> = problem
        .candidates
        .lists
        .iter()
        .enumerate()
        .flat_map(|(i, list)| list.iter().map(move |&j| Correspondence { model: i, cloud: j }))
        .filter(finite)
        .collect();
    vertices.sort_unstable_by_key(|pair| (model[pair.model], cloud[pair.cloud]));
    vertices
}
