//! The coherence test for 64 pairs of vertices at a time.

use nalgebra::Vector3;

use crate::lanes::{LANES, packed};

/// The vertices by column: model place, cloud place and tolerance.
///
/// The columns are padded to complete words with places that agree with no distance.
#[derive(Debug, Default)]
pub(super) struct Sites {
    /// Model x, y, z and cloud x, y, z.
    at: [Vec<f64>; 6],
    /// The vertex' part of the largest distance difference that may be coherent (m).
    reach: Vec<f64>,
    /// The vertex' part of the largest distance difference that is coherent in any case (m); negative if there is none.
    sure: Vec<f64>,
}

/// The results of one comparison with 64 vertices, a bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct EdgeBits {
    /// The distances may agree.
    pub(super) near: u64,
    /// The distances agree.
    pub(super) sure: u64,
}

impl Sites {
    /// Adds a vertex. Two distances may agree only if their difference is at most the sum of the `reach` of both
    /// vertices, and they do agree if it is at most the sum of `sure`.
    pub(super) fn push(&mut self, model: &Vector3<f64>, cloud: &Vector3<f64>, reach: f64, sure: f64) {
        for (column, &x) in self.at.iter_mut().zip(model.iter().chain(cloud.iter())) {
            column.push(x);
        }
        self.reach.push(reach);
        self.sure.push(sure);
    }

    /// Pads the last word.
    pub(super) fn pad(&mut self) {
        let full = self.reach.len().next_multiple_of(LANES);
        self.at.iter_mut().for_each(|column| column.resize(full, f64::NAN));
        self.reach.resize(full, f64::NAN);
        self.sure.resize(full, f64::NAN);
    }

    /// Compares vertex `a` with the vertices of word `from` and of all later words.
    pub(super) fn compare(&self, a: usize, from: usize, comparisons: &mut Vec<EdgeBits>) {
        compare(&self.at.each_ref().map(Vec::as_slice), &self.reach, &self.sure, a, from, comparisons);
    }
}

/// Compares distances without a square root.
///
/// For squared distances A and B in model and cloud, |√A − √B| ≤ r ⇔ A + B ≤ r² or (A − B)² ≤ r² (2 (A + B) − r²).
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn compare(at: &[&[f64]; 6], reach: &[f64], sure: &[f64], a: usize, from: usize, comparisons: &mut Vec<EdgeBits>) {
    let [mx, my, mz, cx, cy, cz] = at.map(|column| column[from * LANES..].as_chunks::<LANES>().0);
    let (reach_of, sure_of) =
        (reach[from * LANES..].as_chunks::<LANES>().0, sure[from * LANES..].as_chunks::<LANES>().0);
    let here = at.map(|column| column[a]);
    let (my_reach, my_sure) = (reach[a], sure[a]);
    comparisons.clear();
    for word in 0..mx.len() {
        let (mx, my, mz, cx, cy, cz) = (&mx[word], &my[word], &mz[word], &cx[word], &cy[word], &cz[word]);
        let (reach, sure) = (&reach_of[word], &sure_of[word]);
        let (mut near, mut certain) = ([0u8; LANES], [0u8; LANES]);
        for k in 0..LANES {
            let (x, y, z) = (mx[k] - here[0], my[k] - here[1], mz[k] - here[2]);
            let known = x * x + y * y + z * z;
            let (x, y, z) = (cx[k] - here[3], cy[k] - here[4], cz[k] - here[5]);
            let measured = x * x + y * y + z * z;
            let (sum, difference) = (known + measured, known - measured);
            let (twice, square) = (2.0 * sum, difference * difference);
            let r = my_reach + reach[k];
            let r2 = r * r;
            near[k] = u8::from((sum <= r2) | (square <= r2 * (twice - r2)));
            let s = my_sure + sure[k];
            let s2 = s * s;
            certain[k] = u8::from((s > 0.0) & ((sum <= s2) | (square <= s2 * (twice - s2))));
        }
        comparisons.push(EdgeBits { near: packed(&near), sure: packed(&certain) });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_within_reach_are_near_and_surely_within_are_sure() {
        // On a line: model at 0 and four times at 10, cloud at 0, 10.5, 10.9, 11.5 and NaN; reach 0.5 and sure 0.3
        // each.
        let mut sites = Sites::default();
        for (known, measured) in [(0.0, 0.0), (10.0, 10.5), (10.0, 10.9), (10.0, 11.5), (10.0, f64::NAN)] {
            sites.push(&Vector3::new(known, 0.0, 0.0), &Vector3::new(0.0, measured, 0.0), 0.5, 0.3);
        }
        sites.pad();
        let mut comparisons = Vec::new();
        sites.compare(0, 0, &mut comparisons);
        assert_eq!(comparisons, [EdgeBits { near: 0b00111, sure: 0b00011 }]);
    }
}
