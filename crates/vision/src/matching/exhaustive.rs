//! Exact nearest neighbours among all pairs of descriptors.

mod blocks;
mod keys;

use blocks::{MAX, Piece, squared_length};
use keys::Three;

use super::{
    metric::Metric,
    nearest::{Nearest, Two},
};
use crate::workspace::Threads;

/// The working memory of the comparison.
#[derive(Debug, Default)]
pub(super) struct Exhaustive {
    left: Vec<Three>,
    right: Vec<Three>,
    /// The squared lengths of the left descriptors.
    lengths: Vec<f32>,
    pieces: Vec<Piece>,
}

/// The factor of the largest truncation of a key.
const LOST: f32 = 1.0 + 1.0 / 32768.0;

impl Exhaustive {
    /// Replaces `nearest` by the nearest neighbours among all pairs.
    ///
    /// Numbers are compared by |a|² + |b|² − 2 a·b, in blocks that stay in registers. If rounding of that form could
    /// change the nearest or the second, differences are summed instead; so are the final distances of both. The result
    /// equals that of [`Metric::squared`] for every pair to the last bit, whatever the machine or its threads.
    pub(super) fn compare(&mut self, metric: &Metric<'_>, threads: Threads, nearest: &mut Nearest) {
        let [n, m] = match metric {
            Metric::Euclid([a, b]) => [a.len(), b.len()],
            Metric::Hamming([a, b]) => [a.len(), b.len()],
        };
        nearest.reset(n, m);
        if n == 0 || m == 0 {
            return;
        }
        let Self { left, right, lengths, pieces } = self;
        right.clear();
        right.resize(m, Three::NONE);
        // The result does not depend on the size; few pieces, since each traverses all left descriptors.
        let size = match threads {
            Threads::One => MAX,
            Threads::Pool => m.div_ceil(2 * rayon::current_num_threads()).clamp(64, MAX),
        };
        let margin = match *metric {
            Metric::Euclid([a, b]) => {
                lengths.clear();
                lengths.extend((0..n).map(|i| squared_length(a.row(i))));
                threads.pieces(right, size, pieces, |index, of_right, piece| {
                    piece.euclid([a, b], lengths, index * size, of_right);
                });
                let longest = |lengths: &mut dyn Iterator<Item = f32>| lengths.fold(0.0, f32::max);
                let (a_max, b_max) =
                    (longest(&mut lengths.iter().copied()), longest(&mut (0..m).map(|j| squared_length(b.row(j)))));
                // The products of n numbers have an error of at most n + 4 roundings of |a|² + |b|², ε/2 each; the
                // differences, in eight sums, of n/4 + 12. Both count for the second and for the third.
                (1.25 * a.length() as f32 + 20.0) * f32::EPSILON * (a_max + b_max)
            }
            Metric::Hamming(tables) => {
                threads.pieces(right, size, pieces, |index, of_right, piece| {
                    piece.hamming(tables, index * size, of_right);
                });
                0.0
            }
        };
        left.clear();
        left.resize(n, Three::NONE);
        for piece in pieces.iter().take(m.div_ceil(size)) {
            left.iter_mut().zip(&piece.left).for_each(|(all, one)| all.merge(one));
        }
        for (i, (two, three)) in nearest.left.iter_mut().zip(&*left).enumerate() {
            settle(two, three, margin, m, |j| metric.squared(i, j));
        }
        for (j, (two, three)) in nearest.right.iter_mut().zip(&*right).enumerate() {
            settle(two, three, margin, n, |i| metric.squared(i, j));
        }
    }
}

/// Finds the nearest two by their exact distances, or keeps them if the third is farther beyond doubt.
fn settle(two: &mut Two, three: &Three, margin: f32, count: usize, squared: impl Fn(usize) -> f32) {
    if three.value[2] > LOST * three.value[1] + margin || margin == 0.0 {
        let found = three.index.iter().filter(|&&index| index != u32::MAX);
        found.for_each(|&index| two.offer(index as usize, squared(index as usize)));
    } else {
        (0..count).for_each(|index| two.offer(index, squared(index)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::{Descriptors, Table};

    /// The definition, pair by pair.
    fn one_by_one(metric: &Metric<'_>, n: usize, m: usize) -> Nearest {
        let mut nearest = Nearest::default();
        nearest.reset(n, m);
        (0..n).for_each(|i| (0..m).for_each(|j| nearest.offer(i, j, metric.squared(i, j))));
        nearest
    }

    fn is_exact(left: &Descriptors, right: &Descriptors, memory: &mut Exhaustive) {
        let metric = Metric::of(left, right).unwrap();
        let expected = one_by_one(&metric, left.len(), right.len());
        for threads in [Threads::One, Threads::Pool] {
            let mut nearest = Nearest::default();
            memory.compare(&metric, threads, &mut nearest);
            assert_eq!((&nearest.left, &nearest.right), (&expected.left, &expected.right));
        }
    }

    const SIZES: [(usize, usize); 10] =
        [(0, 3), (3, 0), (1, 1), (1, 2), (2, 8), (13, 21), (40, 7), (70, 1100), (600, 40), (3, 4500)];

    #[test]
    fn numbers_are_compared_exactly() {
        let mut memory = Exhaustive::default();
        for (n, m) in SIZES {
            for length in [1, 5, 64] {
                let table = |count: usize, seed: usize, modulus: usize, far: f32| {
                    let value = |i: usize| ((i * 7919 + seed) % modulus) as f32 * 0.0137 + far;
                    Descriptors::Numbers(Table::new(length, (0..count * length).map(value).collect()))
                };
                is_exact(&table(n, 3, 9973, 0.0), &table(m, 50, 9973, 0.0), &mut memory);
                // Many equal distances, and many that differ by less than the products resolve.
                is_exact(&table(n, 1, 3, 0.0), &table(m, 2, 3, 0.0), &mut memory);
                is_exact(&table(n, 3, 9973, 3e4), &table(m, 50, 9973, 3e4), &mut memory);
                is_exact(&table(n, 3, 9973, 3e19), &table(m, 50, 9973, -3e19), &mut memory);
            }
        }
    }

    #[test]
    fn bits_are_compared_exactly() {
        let mut memory = Exhaustive::default();
        for (n, m) in SIZES {
            for words in [1, 4, 5] {
                let table = |count: usize, seed: u64, mask: u64| {
                    let word = |i: usize| (i as u64 + seed).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(17) & mask;
                    Descriptors::Bits(Table::new(words, (0..count * words).map(word).collect()))
                };
                is_exact(&table(n, 3, u64::MAX), &table(m, 9, u64::MAX), &mut memory);
                is_exact(&table(n, 3, 3), &table(m, 9, 3), &mut memory);
            }
        }
    }
}
