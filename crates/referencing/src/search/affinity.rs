//! The consistency graph with weights for the agreement of each coherent pair of pairs.

use super::{association::Association, grow::max_possible, identification::Rejected};
use crate::problem::Problem;

/// A symmetric matrix over the vertices, zero for incoherent ones; its upper half by rows.
#[derive(Debug)]
pub(super) struct Affinity {
    /// Index of the first entry of each row.
    starts: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f32>,
}

impl Affinity {
    /// Edges with the `weight` of their distance difference over Δ, 0 to 1.
    ///
    /// # Errors
    /// [`Rejected::TooLarge`] for more than `max` edges.
    pub(super) fn of(
        problem: &Problem<'_>,
        graph: &Association,
        max: usize,
        weight: impl Fn(f64) -> f64,
    ) -> Result<Self, Rejected> {
        let count = graph.vertices.len();
        let mut all = Self { starts: vec![0], columns: Vec::new(), weights: Vec::new() };
        for v in 0..count {
            for w in graph.adjacency.ones(v).filter(|&w| w > v) {
                let (a, b) = (graph.vertices[v], graph.vertices[w]);
                let known = problem.model[a.model].at.distance(&problem.model[b.model].at);
                let measured = problem.cloud[a.cloud].position.at.distance(&problem.cloud[b.cloud].position.at);
                let (off, delta) = ((known - measured).abs(), problem.delta(a, b));
                all.columns.push(w as u32);
                all.weights.push(weight(if off > 0.0 { off / delta } else { 0.0 }) as f32);
            }
            if all.columns.len() > max {
                let size = (0..count).map(|v| graph.adjacency.ones(v).filter(|&w| w > v).count()).sum();
                return Err(Rejected::TooLarge { size, what: "coherent pairs", max, bound: max_possible(problem) });
            }
            all.starts.push(all.columns.len());
        }
        Ok(all)
    }

    pub(super) fn edges(&self) -> usize {
        self.columns.len()
    }

    /// Calls `each` with the ends, the smaller first, and the weight of every edge, by rows.
    pub(super) fn each(&self, mut each: impl FnMut(usize, usize, f32)) {
        for (v, ends) in self.starts.windows(2).enumerate() {
            for (&w, &weight) in self.columns[ends[0]..ends[1]].iter().zip(&self.weights[ends[0]..ends[1]]) {
                each(v, w as usize, weight);
            }
        }
    }

    /// M x, and A x with the unweighted graph A.
    pub(super) fn products(&self, x: &[f64], weighted: &mut [f64], plain: &mut [f64]) {
        weighted.fill(0.0);
        plain.fill(0.0);
        for (v, ends) in self.starts.windows(2).enumerate() {
            let (mut row, mut ones) = (0.0, 0.0);
            for (&w, &weight) in self.columns[ends[0]..ends[1]].iter().zip(&self.weights[ends[0]..ends[1]]) {
                let (w, weight) = (w as usize, f64::from(weight));
                row += weight * x[w];
                ones += x[w];
                weighted[w] += weight * x[v];
                plain[w] += x[v];
            }
            weighted[v] += row;
            plain[v] += ones;
        }
    }
}

/// Scales a vector to unit length; false if its length is zero or not finite.
pub(super) fn normalized(x: &mut [f64]) -> bool {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let some = length > 0.0 && length.is_finite();
    if some {
        x.iter_mut().for_each(|x| *x /= length);
    }
    some
}

/// Vertices by descending weight, without those of zero weight; among equals the first.
pub(super) fn by_weight(x: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..x.len()).filter(|&v| x[v] > 0.0).collect();
    order.sort_by(|&v, &w| x[w].total_cmp(&x[v]));
    order
}
