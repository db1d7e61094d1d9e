//! Second-order weights of the consistency graph.

use super::{affinity::Affinity, association::Association, identification::Rejected};
use crate::problem::Problem;

/// Minimum number of vertices that take part, whatever their clustering coefficients are.
const FEW: usize = 50;
/// Mean weight above which a graph is dense.
const DENSE: f64 = 3.0;
/// Number of factors of the threshold of the clustering coefficients, tried from the greatest, and the step between them.
const FACTORS: usize = 200;
const STEP: f64 = 0.05;
/// Number of bins of Otsu's histogram.
const BINS: usize = 100;

/// The symmetric weights w_ab Σ_c w_ac w_bc, with the clustering coefficient of each vertex.
pub(super) struct SecondOrder {
    starts: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    /// Numerator and denominator of each clustering coefficient.
    clustering: Vec<(f64, f64)>,
    /// Number of products.
    pub(super) work: u64,
    /// Whether the budget ended the computation.
    pub(super) ended: bool,
}

impl SecondOrder {
    /// The weights of a graph.
    ///
    /// # Errors
    /// [`Rejected::TooLarge`] for more than `max` edges.
    pub(super) fn of(problem: &Problem<'_>, graph: &Association, max: usize, budget: u64) -> Result<Self, Rejected> {
        let affinity = Affinity::of(problem, graph, max, |off| 1.0 - off * off)?;
        let count = graph.vertices.len();
        let mut degree = vec![0; count];
        affinity.each(|v, w, _| [v, w].into_iter().for_each(|end| degree[end] += 1));
        let mut starts = vec![0];
        degree.iter().for_each(|degree| starts.push(starts[starts.len() - 1] + degree));
        let (mut columns, mut first) = (vec![0; starts[count]], vec![0.0; starts[count]]);
        let mut filled = starts.clone();
        // Rows arrive in ascending order, so that the columns of each row are ascending too.
        affinity.each(|v, w, weight| {
            for (row, column) in [(v, w), (w, v)] {
                (columns[filled[row]], first[filled[row]]) = (column as u32, f64::from(weight));
                filled[row] += 1;
            }
        });
        let mut all = Self {
            starts,
            columns,
            weights: first.clone(),
            clustering: vec![(0.0, 0.0); count],
            work: 0,
            ended: false,
        };
        all.raise(&first, budget);
        Ok(all)
    }

    /// Computes the second order and the clustering coefficients from the first-order weights.
    fn raise(&mut self, first: &[f64], budget: u64) {
        let count = self.count();
        let mut dense = vec![0.0; count];
        for v in 0..count {
            let row = self.starts[v]..self.starts[v + 1];
            row.clone().for_each(|k| dense[self.columns[k] as usize] = first[k]);
            for k in row.clone() {
                let w = self.columns[k] as usize;
                let other = self.starts[w]..self.starts[w + 1];
                self.work += other.len() as u64;
                let common: f64 = other.map(|l| first[l] * dense[self.columns[l] as usize]).sum();
                self.weights[k] = first[k] * common;
            }
            row.for_each(|k| dense[self.columns[k] as usize] = 0.0);
            if self.work >= budget {
                self.ended = true;
                return;
            }
        }
        let roots: Vec<f64> = self.weights.iter().map(|weight| libm::cbrt(*weight)).collect();
        for v in 0..count {
            let row = self.starts[v]..self.starts[v + 1];
            row.clone().for_each(|k| dense[self.columns[k] as usize] = roots[k]);
            let mut twice = 0.0;
            for k in row.clone() {
                let w = self.columns[k] as usize;
                let other = self.starts[w]..self.starts[w + 1];
                self.work += other.len() as u64;
                twice += roots[k] * other.map(|l| roots[l] * dense[self.columns[l] as usize]).sum::<f64>();
            }
            let degree = row.len() as f64;
            self.clustering[v] = (0.5 * twice, 0.5 * degree * (degree - 1.0));
            row.for_each(|k| dense[self.columns[k] as usize] = 0.0);
            if self.work >= budget {
                self.ended = true;
                return;
            }
        }
    }

    /// Number of vertices.
    pub(super) fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of a vertex with their weights.
    pub(super) fn row(&self, v: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let row = self.starts[v]..self.starts[v + 1];
        row.map(|k| (self.columns[k] as usize, self.weights[k]))
    }

    /// The vertices that take part: all, or those of large clustering coefficients in a dense graph.
    pub(super) fn clustered(&self) -> Vec<bool> {
        let of = |&(above, below): &(f64, f64)| if below > 0.0 { above / below } else { 0.0 };
        let each: Vec<f64> = self.clustering.iter().map(of).collect();
        let mean = each.iter().sum::<f64>() / each.len().max(1) as f64;
        let (above, below) = self.clustering.iter().fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
        let (total, otsu) = (if below > 0.0 { above / below } else { 0.0 }, otsu(&each));
        let mut sorted = each.clone();
        sorted.sort_unstable_by(|a, b| b.total_cmp(a));
        if each.len() <= FEW || !(otsu.min(mean).min(total) > DENSE) {
            return vec![true; each.len()];
        }
        let threshold = |factor: usize| STEP * factor as f64 * otsu.max(total);
        let factor = (1..=FACTORS).rev().find(|&factor| threshold(factor) <= sorted[FEW - 1]);
        each.iter().map(|&one| factor.is_none_or(|factor| one > threshold(factor))).collect()
    }
}

/// The threshold that separates values best into two classes (Otsu 1979).
fn otsu(values: &[f64]) -> f64 {
    let max = values.iter().copied().fold(0.0, f64::max);
    if !(max > 0.0) {
        return 0.0;
    }
    let mut histogram = [0usize; BINS];
    values.iter().for_each(|value| histogram[((value / max * BINS as f64) as usize).min(BINS - 1)] += 1);
    let all = values.len() as f64;
    let mean: f64 = histogram.iter().enumerate().map(|(bin, &count)| bin as f64 * count as f64).sum::<f64>() / all;
    let (mut below, mut sum, mut best) = (0.0, 0.0, (0.0, 0));
    for (bin, &count) in histogram.iter().enumerate() {
        below += count as f64 / all;
        sum += bin as f64 * count as f64 / all;
        let between = (mean * below - sum).powi(2) / (below * (1.0 - below));
        if between > best.0 {
            best = (between, bin);
        }
    }
    (best.1 + 1) as f64 / BINS as f64 * max
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_classes_are_separated() {
        let values: Vec<f64> = (0..40).map(|k| if k < 30 { 1.0 + 0.01 * f64::from(k) } else { 7.0 }).collect();
        assert!((1.3..7.0).contains(&otsu(&values)), "{}", otsu(&values));
        assert_eq!(otsu(&[0.0, 0.0]), 0.0);
    }
}
