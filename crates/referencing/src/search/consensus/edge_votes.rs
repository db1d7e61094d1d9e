//! Votes of features for displacements of the prior.

use nalgebra::{Matrix6, Vector3};

use super::{joined::Joined, prior_terms::PriorDensity};
use crate::{edge_candidates::OVERLAP, search::consensus::local_maxima::Climb};

/// Half-size of the grid, in standard deviations of the prior along each axis; 3.5 leave out 0.05 % of the priors an axis.
const EXTENT: f64 = 3.5;
/// Maximum number of cells.
const MAX_CELLS: f64 = 2e6;
/// Maximum number of displacements that are followed; tried with 12 on ten rendered pairs and drawn boxes only.
const PEAKS: usize = 12;
/// Distance (cells) from the centre of a cell up to which a displacement votes for it.
const REACH: f64 = 1.5;
/// Minimum size of a cell (m).
const MIN_CELL: f64 = 0.01;

/// The votes of the cells of a grid over displacements (m, camera axes).
///
/// The error of a prior displaces all predicted features alike, up to its attitude's error (a Hough transform, Ballard
/// 1981). A candidate pair of points votes for one displacement, one of edges for those along its line that leave an
/// overlap; both for the neighbouring cells too. A feature votes once in a cell, and with ln 1/q, q being the fraction of
/// the cells that it votes for: the sum is the evidence against votes at random.
pub(in crate::search) struct Votes {
    /// The size of a cell (m): the displacement of the farthest feature by the prior's attitude error, or more.
    cell: f64,
    /// Number of cells on either side of zero, along each axis.
    half: [i32; 3],
    score: Vec<f32>,
}

impl Votes {
    /// The votes of some pairs of edges and of points; `None` if the prior's information is singular.
    ///
    /// `work` counts the votes.
    pub(in crate::search) fn of(
        joined: &Joined<'_>,
        prior: &PriorDensity,
        pairs: &[Vec<usize>; 2],
        work: &mut u64,
    ) -> Option<Self> {
        let mut votes = Self::empty(joined, prior, &prior.information.cholesky()?.inverse());
        votes.count(joined, prior, pairs, work);
        Some(votes)
    }

    fn empty(joined: &Joined<'_>, prior: &PriorDensity, covariance: &Matrix6<f64>) -> Self {
        let Climb { terms, prior_terms, .. } = joined.climb;
        let extent = [3, 4, 5].map(|k| EXTENT * covariance[(k, k)].sqrt());
        let lever = |p: &Vector3<f64>| (p - prior_terms.centroid).norm();
        let of_points = terms.pairs.iter().map(|pair| lever(&pair.model));
        let of_edges = joined.edges.vertices.iter().flat_map(|vertex| &vertex.model).map(lever);
        let radius = of_points.chain(of_edges).fold(0.0, f64::max);
        let count = |cell: f64| -> f64 { extent.iter().map(|extent| 2.0 * (extent / cell).ceil() + 1.0).product() };
        let mut cell = (prior.attitude * radius).max(MIN_CELL);
        while count(cell) > MAX_CELLS {
            cell *= 1.2;
        }
        let half = extent.map(|extent| (extent / cell).ceil() as i32);
        let count = count(cell) as usize;
        Self { cell, half, score: vec![0.0; count] }
    }

    fn index(&self, at: [i32; 3]) -> Option<usize> {
        let mut index = 0;
        for (at, half) in at.iter().zip(&self.half) {
            if at.abs() > *half {
                return None;
            }
            index = index * (2 * *half as usize + 1) + (at + half) as usize;
        }
        Some(index)
    }

    /// The displacements with most votes, at least two cells from each other, the best first; the prior's density is added.
    pub(in crate::search) fn peaks(&self, prior: &PriorDensity) -> Vec<Vector3<f64>> {
        let density = prior.information.fixed_view::<3, 3>(3, 3);
        let value = |index: usize| {
            let off = self.centre(index);
            f64::from(self.score[index]) - 0.5 * off.dot(&(density * off))
        };
        let voted: Vec<usize> = (0..self.score.len()).filter(|&index| self.score[index] > 0.0).collect();
        let values: Vec<f64> = voted.iter().map(|&index| value(index)).collect();
        let mut found: Vec<Vector3<f64>> = Vec::new();
        while found.len() < PEAKS {
            let mut best: Option<(f64, Vector3<f64>)> = None;
            for (&index, &value) in voted.iter().zip(&values) {
                if best.is_some_and(|(max, _)| value <= max) {
                    continue;
                }
                let at = self.centre(index);
                if found.iter().all(|other| (at - other).amax() > REACH * self.cell) {
                    best = Some((value, at));
                }
            }
            let Some((_, at)) = best else { break };
            found.push(at);
        }
        found
    }

    /// The pairs of edges and of points among these that vote for a displacement.
    pub(in crate::search) fn voters(
        &self,
        joined: &Joined<'_>,
        prior: &PriorDensity,
        [edges, points]: &[Vec<usize>; 2],
        at: &Vector3<f64>,
    ) -> [Vec<usize>; 2] {
        let near = |displacement: Vector3<f64>| (displacement - at).amax() <= REACH * self.cell;
        let edges = edges.iter().copied().filter(|&v| displacements_of_edge(joined, prior, v, self.cell).any(near));
        let points = points.iter().copied().filter(|&v| near(displacement_of_point(joined, prior, v)));
        [edges.collect(), points.collect()]
    }

    /// The displacement at the centre of a cell.
    fn centre(&self, index: usize) -> Vector3<f64> {
        let [y_size, z_size] = [1, 2].map(|axis| 2 * self.half[axis] as usize + 1);
        let at = [index / (y_size * z_size), index / z_size % y_size, index % z_size];
        Vector3::from_fn(|k, _| f64::from(at[k] as i32 - self.half[k]) * self.cell)
    }

    /// Adds the votes of these pairs, feature by feature.
    fn count(&mut self, joined: &Joined<'_>, prior: &PriorDensity, [edges, points]: &[Vec<usize>; 2], work: &mut u64) {
        let (vertices, pairs) = (&joined.edges.vertices, &joined.climb.graph.vertices);
        let mut ballot = Ballot { last: vec![0; self.score.len()], feature: 0, cells: Vec::new() };
        for of_one in points.chunk_by(|&a, &b| pairs[a].model == pairs[b].model) {
            let displacements = of_one.iter().map(|&v| displacement_of_point(joined, prior, v));
            self.add(displacements, &mut ballot, work);
        }
        for of_one in edges.chunk_by(|&a, &b| vertices[a].pair.model == vertices[b].pair.model) {
            let cell = self.cell;
            let displacements = of_one.iter().flat_map(|&v| displacements_of_edge(joined, prior, v, cell));
            self.add(displacements, &mut ballot, work);
        }
    }

    /// Adds the votes of one feature: the cells of its displacements and their neighbours, each once.
    fn add(&mut self, displacements: impl Iterator<Item = Vector3<f64>>, ballot: &mut Ballot, work: &mut u64) {
        ballot.feature += 1;
        for displacement in displacements {
            let at = [0, 1, 2].map(|k| (displacement[k] / self.cell).round() as i32);
            if self.index(at).is_none() {
                continue;
            }
            for step in 0..27 {
                let beside = [at[0] + step / 9 - 1, at[1] + step / 3 % 3 - 1, at[2] + step % 3 - 1];
                let Some(index) = self.index(beside) else { continue };
                if ballot.last[index] != ballot.feature {
                    ballot.last[index] = ballot.feature;
                    ballot.cells.push(index);
                }
            }
        }
        *work += ballot.cells.len() as u64;
        let weight = libm::log(self.score.len() as f64 / ballot.cells.len().max(1) as f64) as f32;
        ballot.cells.drain(..).for_each(|index| self.score[index] += weight);
    }
}

/// The working memory of a count.
struct Ballot {
    /// The last feature that voted for a cell.
    last: Vec<u32>,
    feature: u32,
    /// The cells of this feature.
    cells: Vec<usize>,
}

/// The displacement of the prior that a pair of points asks for.
fn displacement_of_point(joined: &Joined<'_>, prior: &PriorDensity, v: usize) -> Vector3<f64> {
    let pair = &joined.climb.terms.pairs[v];
    pair.cloud - prior.motion.apply(&pair.model)
}

/// The displacements, about a cell (m) from each other, at which an edge overlaps the line of its pair.
fn displacements_of_edge(
    joined: &Joined<'_>,
    prior: &PriorDensity,
    v: usize,
    cell: f64,
) -> impl Iterator<Item = Vector3<f64>> + use<> {
    let vertex = &joined.edges.vertices[v];
    let [from, to] = vertex.model.each_ref().map(|end| prior.motion.apply(end));
    let [a, b] = vertex.line.ends;
    let (edge, line) = ((to - from).norm(), vertex.line.length());
    let slide = 0.5 * (edge + line) - OVERLAP * edge.min(line);
    let (middle, along) = (0.5 * (a + b - from - to), vertex.line.direction);
    let steps = (slide / cell).ceil().max(1.0);
    (-(steps as i32)..=steps as i32).map(move |step| middle + along * (slide * f64::from(step) / steps))
}
