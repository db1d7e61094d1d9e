//! Exact nearest neighbours among all pairs of descriptors.

use multiversion::multiversion;

use super::{
    metric::Metric,
    nearest::{Nearest, Two},
};
use crate::{Table, Threads};

/// Right descriptors compared at once.
const COLUMNS: usize = 16;
/// Left descriptors compared at once: so many sums stay in registers and none waits for the one before.
const ROWS: usize = 6;
/// Right descriptors in one piece of work.
const PIECE: usize = 512;

/// The memory of the comparison.
#[derive(Debug, Default)]
pub(super) struct Exhaustive {
    left: Vec<Three>,
    right: Vec<Three>,
    /// Squared lengths of the left descriptors.
    lengths: Vec<f32>,
    pieces: Vec<Piece>,
}

/// What one piece of the right descriptors makes of all left ones.
#[derive(Debug, Default)]
struct Piece {
    left: Vec<Three>,
    numbers: Vec<[f32; COLUMNS]>,
    words: Vec<[u64; COLUMNS]>,
}

/// The nearest two of those seen so far and the distances of the nearest three.
#[derive(Debug, Clone, Copy)]
struct Three {
    index: [u32; 2],
    value: [f32; 3],
}

impl Three {
    const NONE: Self = Self { index: [u32::MAX; 2], value: [f32::INFINITY; 3] };

    /// Of equals the first offered stays.
    fn offer(&mut self, index: u32, value: f32) {
        let [first, second, third] = self.value;
        // Most are further than all three.
        if value >= third {
            return;
        }
        if value < first {
            *self = Self { index: [index, self.index[0]], value: [value, first, second] };
        } else if value < second {
            *self = Self { index: [self.index[0], index], value: [first, value, second] };
        } else if value < third {
            self.value[2] = value;
        }
    }

    /// As if all that the other saw had been offered: its third can be no more than third.
    fn merge(&mut self, other: &Self) {
        (0..2).for_each(|k| self.offer(other.index[k], other.value[k]));
        self.value[2] = self.value[2].min(other.value[2]);
    }
}

impl Exhaustive {
    /// Replaces `nearest` by the nearest among all pairs.
    ///
    /// Numbers are compared by |a|² + |b|² − 2 a·b, in blocks that stay in registers. Where that form's rounding could
    /// change who is nearest or second, differences are summed instead; so are the distances of those two. The
    /// answer is that of [`Metric::squared`] for every pair, to the last bit, whatever the machine or its threads.
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
        let margin = match metric {
            Metric::Euclid([a, b]) => {
                lengths.clear();
                lengths.extend((0..n).map(|i| squared_length(a.row(i))));
                threads.pieces(right, PIECE, pieces, |index, piece, scratch| {
                    euclid(a, b, lengths, index * PIECE, piece, scratch);
                });
                let longest = |lengths: &mut dyn Iterator<Item = f32>| lengths.fold(0.0, f32::max);
                let (a_most, b_most) =
                    (longest(&mut lengths.iter().copied()), longest(&mut (0..m).map(|j| squared_length(b.row(j)))));
                // Twice what both forms together err by, at most so many roundings of |a|² + |b|².
                4.0 * (a.length() + 16) as f32 * f32::EPSILON * (a_most + b_most)
            }
            Metric::Hamming([a, b]) => {
                threads.pieces(right, PIECE, pieces, |index, piece, scratch| {
                    hamming(a, b, index * PIECE, piece, scratch);
                });
                0.0
            }
        };
        left.clear();
        left.resize(n, Three::NONE);
        for piece in pieces.iter().take(m.div_ceil(PIECE)) {
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

/// The nearest two by their exact distances: the two that were found where the third is beyond doubt further.
fn settle(two: &mut Two, three: &Three, margin: f32, count: usize, squared: impl Fn(usize) -> f32) {
    if three.value[2] > three.value[1] + margin || margin == 0.0 {
        let found = three.index.iter().filter(|&&index| index != u32::MAX);
        found.for_each(|&index| two.offer(index as usize, squared(index as usize)));
    } else {
        (0..count).for_each(|index| two.offer(index, squared(index)));
    }
}

fn squared_length(row: &[f32]) -> f32 {
    row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() as f32
}

/// The nearest of all left descriptors among a piece of the right ones, and the other way round.
fn euclid(
    left: &Table<f32>,
    right: &Table<f32>,
    lengths: &[f32],
    first: usize,
    piece: &mut [Three],
    scratch: &mut Piece,
) {
    scratch.left.clear();
    scratch.left.resize(left.len(), Three::NONE);
    for (panel, of_panel) in piece.chunks_mut(COLUMNS).enumerate() {
        let first = first + panel * COLUMNS;
        // Sixteen right descriptors, number by number; a panel that is not full is filled up with what is
        // infinitely far.
        let mut right_lengths = [f32::INFINITY; COLUMNS];
        scratch.numbers.clear();
        scratch.numbers.resize(right.length(), [0.0; COLUMNS]);
        for c in 0..of_panel.len() {
            let row = right.row(first + c);
            right_lengths[c] = squared_length(row);
            scratch.numbers.iter_mut().zip(row).for_each(|(column, value)| column[c] = *value);
        }
        let mut lanes = Lanes::NONE;
        euclid_panel(left.values(), lengths, &scratch.numbers, &right_lengths, first, &mut scratch.left, &mut lanes);
        of_panel.iter_mut().enumerate().for_each(|(c, three)| *three = lanes.get(c));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn euclid_panel(
    left: &[f32],
    lengths: &[f32],
    panel: &[[f32; COLUMNS]],
    right_lengths: &[f32; COLUMNS],
    first: usize,
    found: &mut [Three],
    lanes: &mut Lanes,
) {
    let (n, length) = (found.len(), panel.len());
    let mut kept = *lanes;
    for start in (0..n).step_by(ROWS) {
        let row = |r: usize| &left[(start + r).min(n - 1) * length..][..panel.len()];
        let [a0, a1, a2, a3, a4, a5] = [row(0), row(1), row(2), row(3), row(4), row(5)];
        let [mut s0, mut s1, mut s2, mut s3, mut s4, mut s5] = [[0.0_f32; COLUMNS]; ROWS];
        for (k, column) in panel.iter().enumerate() {
            let [x0, x1, x2, x3, x4, x5] = [a0[k], a1[k], a2[k], a3[k], a4[k], a5[k]];
            s0.iter_mut().zip(column).for_each(|(sum, y)| *sum += x0 * y);
            s1.iter_mut().zip(column).for_each(|(sum, y)| *sum += x1 * y);
            s2.iter_mut().zip(column).for_each(|(sum, y)| *sum += x2 * y);
            s3.iter_mut().zip(column).for_each(|(sum, y)| *sum += x3 * y);
            s4.iter_mut().zip(column).for_each(|(sum, y)| *sum += x4 * y);
            s5.iter_mut().zip(column).for_each(|(sum, y)| *sum += x5 * y);
        }
        for (i, products) in (start..n).zip([s0, s1, s2, s3, s4, s5]) {
            let mut values = products;
            for (value, length) in values.iter_mut().zip(right_lengths) {
                *value = (lengths[i] + length) - 2.0 * *value;
            }
            offer(i, &values, first, &mut found[i], &mut kept);
        }
    }
    *lanes = kept;
}

/// As [`euclid`], for bits.
fn hamming(left: &Table<u64>, right: &Table<u64>, first: usize, piece: &mut [Three], scratch: &mut Piece) {
    scratch.left.clear();
    scratch.left.resize(left.len(), Three::NONE);
    for (panel, of_panel) in piece.chunks_mut(COLUMNS).enumerate() {
        let first = first + panel * COLUMNS;
        scratch.words.clear();
        scratch.words.resize(right.length(), [0; COLUMNS]);
        for c in 0..of_panel.len() {
            scratch.words.iter_mut().zip(right.row(first + c)).for_each(|(column, word)| column[c] = *word);
        }
        let mut lanes = Lanes::NONE;
        hamming_panel(left.values(), &scratch.words, of_panel.len(), first, &mut scratch.left, &mut lanes);
        of_panel.iter_mut().enumerate().for_each(|(c, three)| *three = lanes.get(c));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn hamming_panel(
    left: &[u64],
    panel: &[[u64; COLUMNS]],
    full: usize,
    first: usize,
    found: &mut [Three],
    lanes: &mut Lanes,
) {
    let mut kept = *lanes;
    for (i, row) in left.chunks_exact(panel.len()).enumerate() {
        let mut counts = [0_u64; COLUMNS];
        for (word, column) in row.iter().zip(panel) {
            counts.iter_mut().zip(column).for_each(|(count, other)| *count += u64::from((word ^ other).count_ones()));
        }
        let mut values = [f32::INFINITY; COLUMNS];
        for (c, (value, count)) in values.iter_mut().zip(counts).enumerate() {
            *value = if c < full { count as u32 as f32 } else { f32::INFINITY };
        }
        offer(i, &values, first, &mut found[i], &mut kept);
    }
    *lanes = kept;
}

/// Left descriptor `i` is this far from the right ones from `first` on.
#[inline(always)]
fn offer(i: usize, values: &[f32; COLUMNS], first: usize, found: &mut Three, lanes: &mut Lanes) {
    // Seldom true, for either side, once some have been seen.
    let pairs = values.iter().zip(&lanes.value[2]);
    if pairs.fold(0, |any, (value, furthest)| any | u32::from(value < furthest)) != 0 {
        lanes.offer(i as u32, values);
    }
    let furthest = found.value[2];
    if values.iter().fold(0, |any, &value| any | u32::from(value < furthest)) != 0 {
        values.iter().enumerate().for_each(|(c, &value)| found.offer((first + c) as u32, value));
    }
}

/// [`Three`] for each of a panel's right descriptors.
#[derive(Debug, Clone, Copy)]
struct Lanes {
    index: [[u32; COLUMNS]; 2],
    value: [[f32; COLUMNS]; 3],
}

impl Lanes {
    const NONE: Self = Self { index: [[u32::MAX; COLUMNS]; 2], value: [[f32::INFINITY; COLUMNS]; 3] };

    fn get(&self, c: usize) -> Three {
        Three { index: self.index.map(|lane| lane[c]), value: self.value.map(|lane| lane[c]) }
    }

    #[inline(always)]
    fn offer(&mut self, index: u32, values: &[f32; COLUMNS]) {
        let [index0, index1] = &mut self.index;
        let [value0, value1, value2] = &mut self.value;
        for (c, &value) in values.iter().enumerate() {
            let (first, second, third) = (value < value0[c], value < value1[c], value < value2[c]);
            let rest = if third { value } else { value2[c] };
            value2[c] = if second { value1[c] } else { rest };
            let rest = if second { value } else { value1[c] };
            value1[c] = if first { value0[c] } else { rest };
            value0[c] = if first { value } else { value0[c] };
            let rest = if second { index } else { index1[c] };
            index1[c] = if first { index0[c] } else { rest };
            index0[c] = if first { index } else { index0[c] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Descriptors;

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

    const SIZES: [(usize, usize); 8] = [(0, 3), (3, 0), (1, 1), (1, 2), (2, 8), (13, 21), (40, 7), (70, 1100)];

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
                // Many that are equal, and many that differ by less than the products can tell.
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
