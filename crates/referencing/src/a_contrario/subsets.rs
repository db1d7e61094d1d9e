//! Random subsets of model points with the weight Π m_i of their candidates.

use super::sequence::QuasiRandom;

/// Maximum size of the table of symmetric polynomials.
const MAX_TERMS: usize = 100_000;
/// Interval width below which a number of the sequence has no digits left.
const SPENT: f64 = 1e-6;

/// A sampler of subsets of `size` of the model points with candidates.
pub(super) struct Subsets {
    size: usize,
    /// Model points with their number of candidates relative to the mean.
    points: Vec<(usize, f64)>,
    /// e_j of the points from i on, at [i·(size + 1) + j]; empty for equal weights.
    table: Vec<f64>,
    ln_tuples: f64,
    set: Vec<usize>,
}

impl Subsets {
    /// A sampler for model points with these numbers of candidates; the samples depend on the order of the points.
    pub(super) fn new(lengths: impl Iterator<Item = (usize, usize)>, size: usize) -> Self {
        let mut points: Vec<(usize, f64)> = lengths.filter(|&(_, m)| m > 0).map(|(i, m)| (i, m as f64)).collect();
        let n = points.len();
        let mean = points.iter().map(|(_, m)| m).sum::<f64>() / n.max(1) as f64;
        points.iter_mut().for_each(|(_, m)| *m /= mean);
        let alike = points.iter().all(|&(_, m)| m == 1.0) || n * (size + 1) > MAX_TERMS;
        let ln_choose: f64 = (0..size).map(|i| libm::log((n.saturating_sub(i)) as f64 / (i + 1) as f64)).sum();
        let mut sampled = Self {
            size,
            points,
            table: Vec::new(),
            // For unequal lists too many for the table, Maclaurin's inequality: e_k ≤ C(n, k) · mean^k.
            ln_tuples: ln_choose + size as f64 * libm::log(mean),
            set: Vec::with_capacity(size),
        };
        if !alike {
            sampled.fill(n, mean);
        }
        sampled
    }

    /// e_j(i…) = e_j(i+1…) + m_i · e_{j−1}(i+1…).
    fn fill(&mut self, n: usize, mean: f64) {
        let width = self.size + 1;
        let mut table = vec![0.0; (n + 1) * width];
        table[n * width] = 1.0;
        for i in (0..n).rev() {
            table[i * width] = 1.0;
            for j in 1..width {
                table[i * width + j] = table[(i + 1) * width + j] + self.points[i].1 * table[(i + 1) * width + j - 1];
            }
        }
        let all = table[self.size];
        if all.is_finite() && all > 0.0 {
            self.ln_tuples = libm::log(all) + self.size as f64 * libm::log(mean);
            self.table = table;
        }
    }

    /// ln Σ over subsets of Π m_i.
    pub(super) fn ln_tuples(&self) -> f64 {
        self.ln_tuples
    }

    /// The next subset, in the order of the points.
    pub(super) fn next(&mut self, sequence: &mut QuasiRandom) -> &[usize] {
        self.set.clear();
        let mut u = sequence.even();
        let n = self.points.len();
        if self.table.is_empty() {
            while self.set.len() < self.size.min(n) {
                let next = sequence.below(n);
                if !self.set.contains(&next) {
                    self.set.push(next);
                }
            }
            self.set.sort_unstable();
            self.set.iter_mut().for_each(|place| *place = self.points[*place].0);
            return &self.set;
        }
        // One number decodes the subset: each inclusion takes its fraction of the interval.
        let (width, mut digits) = (self.size + 1, 1.0);
        for i in 0..n {
            let left = self.size - self.set.len();
            if left == 0 {
                break;
            }
            let included = self.points[i].1 * self.table[(i + 1) * width + left - 1] / self.table[i * width + left];
            if u < included {
                self.set.push(self.points[i].0);
                u /= included;
                digits *= included;
            } else {
                u = (u - included) / (1.0 - included);
                digits *= 1.0 - included;
            }
            if digits < SPENT {
                (u, digits) = (sequence.unit(), 1.0);
            }
        }
        &self.set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_weighted_by_their_lists() {
        // e_3 of (1, 2, 3, 4) = 6 + 8 + 12 + 24.
        let mut subsets = Subsets::new([1, 2, 3, 0, 4].into_iter().enumerate(), 3);
        assert!((subsets.ln_tuples().exp() - 50.0).abs() < 1e-9);
        let mut sequence = QuasiRandom::new(0);
        let last = (0..5000).filter(|_| subsets.next(&mut sequence) == [1, 2, 4]).count();
        assert!((last as f64 / 5000.0 - 24.0 / 50.0).abs() < 0.01, "{last}");
        assert_eq!(Subsets::new([1, 1].into_iter().enumerate(), 3).ln_tuples(), f64::NEG_INFINITY);
    }

    #[test]
    fn lists_of_one_length_are_generated_evenly() {
        let mut subsets = Subsets::new([7; 5].into_iter().enumerate(), 2);
        assert!((subsets.ln_tuples().exp() - 490.0).abs() < 1e-9);
        let mut sequence = QuasiRandom::new(0);
        let first = (0..5000).filter(|_| subsets.next(&mut sequence) == [0, 1]).count();
        assert!((first as f64 / 5000.0 - 0.1).abs() < 0.015, "{first}");
    }
}
