//! Exact nearest and second nearest neighbours between two sets of descriptors.

use crate::Table;

/// For every descriptor of either side, the nearest on the other side and the distance of the second.
#[derive(Debug)]
pub(super) struct Nearest {
    left: Vec<Two>,
    right: Vec<Two>,
}

/// The nearest of those seen so far and the squared distances of the nearest two.
#[derive(Debug, Clone, Copy)]
struct Two {
    index: usize,
    squared: f32,
    second: f32,
}

/// Two descriptors that are each other's nearest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mutual {
    pub(super) left: usize,
    pub(super) right: usize,
    /// Their squared distance.
    pub(super) squared: f32,
    /// The squared distance from either to any other, the least.
    pub(super) second: f32,
}

impl Two {
    const NONE: Self = Self { index: usize::MAX, squared: f32::INFINITY, second: f32::INFINITY };

    /// Of equals the first offered stays.
    fn offer(&mut self, index: usize, squared: f32) {
        if squared < self.squared {
            *self = Self { index, squared, second: self.squared };
        } else if squared < self.second {
            self.second = squared;
        }
    }
}

/// Left and right descriptors compared at once.
const ROWS: usize = 2;
const COLUMNS: usize = 8;

impl Nearest {
    /// Of so many left and right descriptors, none compared yet.
    pub(super) fn none(left: usize, right: usize) -> Self {
        Self { left: vec![Two::NONE; left], right: vec![Two::NONE; right] }
    }

    /// Left descriptor `i` and right descriptor `j` are this far apart.
    pub(super) fn offer(&mut self, i: usize, j: usize, squared: f32) {
        self.left[i].offer(j, squared);
        self.right[j].offer(i, squared);
    }

    /// Among all pairs: blocks of a few left and eight right descriptors stay in registers. Every sum
    /// runs in the descriptor's order, so the distances are those of [`squared`] to the last bit.
    pub(super) fn of_all(left: &Table<f32>, right: &Table<f32>) -> Self {
        let mut nearest = Self::none(left.len(), right.len());
        if left.is_empty() || right.is_empty() {
            return nearest;
        }
        let length = right.length();
        // Panels of eight right descriptors, number by number; the last one is filled up with zeros.
        let panels: Vec<Vec<[f32; COLUMNS]>> = (0..right.len())
            .step_by(COLUMNS)
            .map(|first| {
                let value = |k: usize, j: usize| if j < right.len() { right.row(j)[k] } else { 0.0 };
                (0..length).map(|k| std::array::from_fn(|c| value(k, first + c))).collect()
            })
            .collect();
        for first in (0..left.len()).step_by(ROWS) {
            let rows: [&[f32]; ROWS] = std::array::from_fn(|r| left.row((first + r).min(left.len() - 1)));
            for (panel, values) in panels.iter().enumerate() {
                let squared = block(rows, values);
                for (i, squared) in (first..left.len()).zip(squared) {
                    for (j, squared) in (panel * COLUMNS..right.len()).zip(squared) {
                        nearest.offer(i, j, squared);
                    }
                }
            }
        }
        nearest
    }

    /// The pairs that are each other's nearest, in the order of the left side.
    pub(super) fn mutual(&self) -> impl Iterator<Item = Mutual> + '_ {
        self.left.iter().enumerate().filter_map(|(left, two)| {
            let back = self.right.get(two.index)?;
            let mutual = Mutual { left, right: two.index, squared: two.squared, second: two.second.min(back.second) };
            (back.index == left).then_some(mutual)
        })
    }
}

/// The squared Euclidean distance.
pub(super) fn squared(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a - b).fold(0.0, |sum, d| sum + d * d)
}

/// Squared distances between the rows and the columns of a panel.
fn block(rows: [&[f32]; ROWS], panel: &[[f32; COLUMNS]]) -> [[f32; COLUMNS]; ROWS] {
    let mut sums = [[0.0; COLUMNS]; ROWS];
    let [a, b] = rows.map(|row| &row[..panel.len()]);
    for (k, values) in panel.iter().enumerate() {
        for (sum, value) in sums[0].iter_mut().zip(values) {
            let d = a[k] - value;
            *sum += d * d;
        }
        for (sum, value) in sums[1].iter_mut().zip(values) {
            let d = b[k] - value;
            *sum += d * d;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_and_second_by_hand() {
        let left = Table::new(1, vec![0.0, 5.0, 5.5]);
        let right = Table::new(1, vec![5.1, 0.5, 9.0]);
        let pairs: Vec<_> = Nearest::of_all(&left, &right).mutual().map(|m| (m.left, m.right, m.second)).collect();
        assert_eq!(pairs.len(), 2);
        assert_eq!((pairs[0].0, pairs[0].1), (0, 1));
        assert!((pairs[0].2 - 20.25).abs() < 1e-4, "from right 1 the second is left 1");
        assert_eq!((pairs[1].0, pairs[1].1), (1, 0));
        assert!((pairs[1].2 - 0.16).abs() < 1e-4, "from right 0 the second is left 2");
    }

    #[test]
    fn blocks_give_the_same_bits() {
        for (n, m) in [(1, 1), (2, 8), (13, 21), (40, 7)] {
            let values = |n: usize, seed: usize| (0..n * 5).map(|i| ((i * 37 + seed) % 101) as f32 * 0.013).collect();
            let (left, right) = (Table::new(5, values(n, 3)), Table::new(5, values(m, 50)));
            let bits = |nearest: Nearest| -> Vec<_> {
                nearest.mutual().map(|m| (m.left, m.right, m.squared.to_bits(), m.second.to_bits())).collect()
            };
            let mut one_by_one = Nearest::none(n, m);
            for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
                one_by_one.offer(i, j, super::squared(left.row(i), right.row(j)));
            }
            assert_eq!(bits(Nearest::of_all(&left, &right)), bits(one_by_one));
        }
    }
}
