//! All small association graphs, and points that realise them.
//!
//! A search takes points, not a graph. Two pairs agree if the difference D − d of their two distances is within Δ² = k²
//! nᵀ (Σ_a + Σ_b) n, with n the direction between the cloud points a and b. [`Posts`] chooses the covariances Σ_a =
//! s·I + Σ_b λ_ab n nᵀ: fifteen numbers λ for the fifteen pairs of six cloud points, in which all Δ² are linear. Each
//! Δ² is thus set five per cent above or below (D − d)², so that any set of pairs of cloud points agrees. The six
//! points are pairs of posts at the corners of a triangle; the model is a tetrahedron or an octahedron whose opposite
//! corners are such a pair. All covariances are then positive definite. They are so large that no four points
//! distinguish an image from its reflection.

use std::collections::HashSet;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};
use seafix_referencing::{Candidates, Correspondence, ModelPoint, Tolerance};

use crate::problems::Planted;

/// Maximum number of vertices.
pub const MAX: usize = 6;
/// Number of pairs of them.
const PAIRS: usize = MAX * (MAX - 1) / 2;
/// Maximum number of model points with equal distances.
const TETRAHEDRON: usize = 4;

/// The index of a pair; pairs of the first points come first.
fn pair(a: usize, b: usize) -> usize {
    let (low, high) = (a.min(b), a.max(b));
    high * (high - 1) / 2 + low
}

/// All pairs of the first `n` numbers.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(|b| (0..b).map(move |a| (a, b)))
}

/// An association graph: candidate pairs, and the agreement of cloud points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    /// The model point of each vertex.
    pub models: Vec<usize>,
    /// The cloud point of each vertex.
    pub clouds: Vec<usize>,
    /// The agreement of pairs of cloud points, one bit each.
    agree: u16,
}

impl Graph {
    /// Whether two vertices are adjacent: different model points, and different cloud points that agree.
    pub fn adjacent(&self, v: usize, w: usize) -> bool {
        let apart = self.models[v] != self.models[w] && self.clouds[v] != self.clouds[w];
        apart && self.agree >> pair(self.clouds[v], self.clouds[w]) & 1 == 1
    }

    /// Whether all cloud points agree.
    pub fn all_agree(&self) -> bool {
        pairs(self.models.len())
            .all(|(v, w)| self.models[v] == self.models[w] || self.clouds[v] == self.clouds[w] || self.adjacent(v, w))
    }

    /// The number of model points.
    pub fn model_points(&self) -> usize {
        self.models.iter().max().map_or(0, |max| max + 1)
    }

    /// The candidate pair of a vertex.
    pub fn correspondence(&self, v: usize) -> Correspondence {
        Correspondence { model: self.models[v], cloud: self.clouds[v] }
    }

    /// All cliques by enumeration of subsets, each in the order of the model points; largest first, ties in order.
    pub fn cliques(&self) -> Vec<Vec<Correspondence>> {
        let n = self.models.len();
        let sorted = |set: Vec<usize>| {
            let mut set: Vec<_> = set.into_iter().map(|v| self.correspondence(v)).collect();
            set.sort_unstable();
            set
        };
        let mut cliques: Vec<Vec<Correspondence>> = (0..1usize << n)
            .map(|subset| (0..n).filter(|v| subset >> v & 1 == 1).collect::<Vec<_>>())
            .filter(|set| set.iter().all(|&v| set.iter().all(|&w| v == w || self.adjacent(v, w))))
            .map(sorted)
            .collect();
        cliques.sort_unstable_by(|a, b| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
        cliques
    }

    /// The edges, and the pairs of vertices with a common cloud point, one bit for each pair of vertices.
    fn key(&self) -> (u16, u16) {
        let bits = |of: &dyn Fn(usize, usize) -> bool| {
            pairs(self.models.len()).filter(|&(v, w)| of(v, w)).fold(0, |bits, (v, w)| bits | 1 << pair(v, w))
        };
        (bits(&|v, w| self.adjacent(v, w)), bits(&|v, w| self.clouds[v] == self.clouds[w]))
    }

    /// Whether all agreeing cloud points belong to vertices of different model points.
    fn is_sparing(&self) -> bool {
        let used = |bit: &usize| {
            let of =
                |v: usize, w: usize| self.clouds[v] != self.clouds[w] && pair(self.clouds[v], self.clouds[w]) == *bit;
            pairs(self.models.len()).any(|(v, w)| self.models[v] != self.models[w] && of(v, w))
        };
        (0..PAIRS).filter(|bit| self.agree >> bit & 1 == 1).all(|bit| used(&bit))
    }
}

/// A class of graphs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// Every vertex has its own cloud point: all graphs.
    Own,
    /// Some vertices share a cloud point; up to four model points.
    Shared,
}

/// The graphs on `n` vertices with every assignment to model points, up to renaming of model points, and, unless
/// `labelled`, up to renaming of vertices.
pub fn graphs(n: usize, which: Which, labelled: bool) -> Vec<Graph> {
    let mut all = Vec::new();
    for models in partitions(n).into_iter().filter(|models| in_blocks(models)) {
        let (own, mut seen) = ((0..n).collect::<Vec<usize>>(), HashSet::new());
        let renamings = renamings(&models);
        let clouds = match which {
            Which::Own => vec![own],
            Which::Shared if models.iter().all(|&model| model < TETRAHEDRON) => {
                let distinct =
                    |clouds: &Vec<usize>| pairs(n).all(|(v, w)| models[v] != models[w] || clouds[v] != clouds[w]);
                partitions(n).into_iter().filter(|clouds| *clouds != own && distinct(clouds)).collect()
            }
            Which::Shared => continue,
        };
        for clouds in clouds {
            let points = clouds.iter().max().map_or(0, |max| max + 1);
            for agree in 0..1u16 << pairs(points).count() {
                let graph = Graph { models: models.clone(), clouds: clouds.clone(), agree };
                if !graph.is_sparing() || (!labelled && seen.contains(&graph.key())) {
                    continue;
                }
                if !labelled {
                    let (edges, same_cloud) = graph.key();
                    seen.extend(renamings.iter().map(|to| (renamed(edges, to), renamed(same_cloud, to))));
                }
                all.push(graph);
            }
        }
    }
    all
}

/// All partitions of `n` elements, as the part of each element; parts are numbered in order of appearance.
fn partitions(n: usize) -> Vec<Vec<usize>> {
    (0..n).fold(vec![Vec::new()], |shorter, _| {
        let with_one_more = |parts: Vec<usize>| {
            let next = parts.iter().max().map_or(0, |max| max + 1);
            (0..=next).map(move |part| [parts.as_slice(), &[part]].concat())
        };
        shorter.into_iter().flat_map(with_one_more).collect()
    })
}

/// Whether parts are consecutive and of decreasing size: one partition of each kind.
fn in_blocks(parts: &[usize]) -> bool {
    let size = |part: usize| parts.iter().filter(|&&other| other == part).count();
    parts.is_sorted() && parts.windows(2).all(|two| size(two[0]) >= size(two[1]))
}

/// The permutations of vertices that preserve the groups of equal model points.
fn renamings(models: &[usize]) -> Vec<Vec<usize>> {
    let n = models.len();
    let orders = (0..n).fold(vec![Vec::new()], |shorter: Vec<Vec<usize>>, _| {
        let longer = |order: Vec<usize>| {
            let free = (0..n).filter(|v| !order.contains(v)).collect::<Vec<_>>();
            free.into_iter().map(move |v| [order.as_slice(), &[v]].concat())
        };
        shorter.into_iter().flat_map(longer).collect()
    });
    let keeps = |to: &Vec<usize>| pairs(n).all(|(v, w)| (models[v] == models[w]) == (models[to[v]] == models[to[w]]));
    orders.into_iter().filter(keeps).collect()
}

fn renamed(bits: u16, to: &[usize]) -> u16 {
    let set = pairs(to.len()).filter(|&(v, w)| bits >> pair(v, w) & 1 == 1);
    set.fold(0, |bits, (v, w)| bits | 1 << pair(to[v], to[w]))
}

/// The distance of adjacent corners of the model (m).
const SIDE: f64 = 40.0;
/// The cloud points (m).
const POSTS: [[f64; 3]; MAX] =
    [[6.0, 0.0, 3.0], [6.0, 0.0, -3.0], [-3.0, 5.0, 3.0], [-3.0, 5.0, -3.0], [-3.0, -5.0, 3.0], [-3.0, -5.0, -3.0]];
/// Relative margin of Δ² above or below the squared difference of distances.
const MARGIN: f64 = 0.05;
/// The factor k: so small that the standard deviations, of the order SIDE / k, hide every reflection.
const SIGMAS: f64 = 0.01;
/// A tolerance Δ with which all distances agree (m).
pub const ANY: f64 = 1e3;
/// Number of rotations that [`Posts::realised`] applies to model and cloud.
pub const TURNS: usize = 6;

/// The construction of points for a graph.
#[derive(Debug)]
pub struct Posts {
    /// The λ of all pairs for each Δ² that increases by 1 m².
    lambdas: SMatrix<f64, PAIRS, PAIRS>,
}

impl Default for Posts {
    /// # Panics
    /// Never: the six points are such that the system is regular.
    fn default() -> Self {
        let posts = POSTS.map(Vector3::from);
        let all: Vec<(usize, usize)> = pairs(MAX).collect();
        let direction = |(a, b): (usize, usize)| (posts[b] - posts[a]).normalize();
        let effect = SMatrix::<f64, PAIRS, PAIRS>::from_fn(|i, j| {
            let (p, q) = (all[i], all[j]);
            let common = [p.0, p.1].iter().filter(|point| [q.0, q.1].contains(point)).count();
            common as f64 * direction(p).dot(&direction(q)).powi(2)
        });
        Self { lambdas: effect.try_inverse().expect("a regular system") }
    }
}

impl Posts {
    /// Points with this graph; model and cloud are each rotated in one of [`TURNS`] ways, so that they come in other
    /// orders.
    pub fn realised(&self, graph: &Graph, [model, cloud]: [usize; 2]) -> Planted {
        let count = graph.model_points();
        let corners: Vec<Vector3<f64>> = (0..MAX).map(octahedron).collect();
        let at = |model: usize| match graph.models.iter().position(|&other| other == model) {
            Some(first) if count > TETRAHEDRON => corners[first],
            _ => tetrahedron(model),
        };
        let posts = POSTS.map(|at| turned(cloud, Vector3::from(at)));
        let wanted = SVector::<f64, PAIRS>::from_iterator(pairs(MAX).map(|(a, b)| {
            let known = if count > TETRAHEDRON { (corners[b] - corners[a]).norm() } else { SIDE };
            let off = known - (posts[b] - posts[a]).norm();
            let margin = if graph.agree >> pair(a, b) & 1 == 1 { MARGIN } else { -MARGIN };
            off * off * (1.0 + margin)
        }));
        let sphere = 0.42 * wanted.mean();
        let lambdas = self.lambdas * wanted.add_scalar(-2.0 * sphere);
        let covariance = |v: usize| {
            let own = pairs(MAX).filter(|&(a, b)| a == v || b == v).map(|(a, b)| {
                let n = (posts[b] - posts[a]).normalize();
                n * n.transpose() * lambdas[pair(a, b)]
            });
            own.fold(Matrix3::identity() * sphere, |sum, one| sum + one) / (SIGMAS * SIGMAS)
        };
        let points = graph.clouds.iter().max().map_or(0, |max| max + 1);
        let measured = |v: usize| MeasuredPoint {
            position: UncertainPoint { at: Point::from(posts[v]), covariance: covariance(v) },
            pixels: None,
        };
        Planted {
            model: (0..count).map(|i| ModelPoint::exact("", Point::from(turned(model, at(i))))).collect(),
            cloud: (0..points).map(measured).collect(),
            candidates: Candidates::from_pairs(
                count,
                (0..graph.models.len()).map(|v| (graph.models[v], graph.clouds[v])),
            ),
            tolerance: Tolerance::Sigmas(SIGMAS),
            truth: Vec::new(),
            pose: crate::searches::nowhere(),
        }
    }
}

/// A corner of an octahedron; 0 and 1, 2 and 3, 4 and 5 are opposite.
fn octahedron(corner: usize) -> Vector3<f64> {
    let mut at = Vector3::zeros();
    at[corner / 2] = SIDE / 2f64.sqrt() * if corner.is_multiple_of(2) { 1.0 } else { -1.0 };
    at
}

/// A corner of a tetrahedron.
fn tetrahedron(corner: usize) -> Vector3<f64> {
    let sign = |bits: usize| if bits >> corner & 1 == 0 { 1.0 } else { -1.0 };
    Vector3::new(sign(0b1100), sign(0b1010), sign(0b0110)) * (SIDE / 8f64.sqrt())
}

/// One of six rotations or reflections about the origin.
fn turned(turn: usize, at: Vector3<f64>) -> Vector3<f64> {
    let sign = if turn < 3 { 1.0 } else { -1.0 };
    Vector3::from_fn(|axis, _| sign * at[(axis + turn) % 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn graphs_are_counted() {
        // OEIS A000110: partitions; A000088: graphs.
        assert_eq!((0..=MAX).map(|n| partitions(n).len()).collect::<Vec<_>>(), [1, 1, 2, 5, 15, 52, 203]);
        let singles = |n: usize| graphs(n, Which::Own, false).iter().filter(|graph| graph.model_points() == n).count();
        assert_eq!((0..=MAX).map(singles).collect::<Vec<_>>(), [1, 1, 2, 4, 11, 34, 156]);
    }
}
