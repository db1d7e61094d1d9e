//! All pairs of a block of left and a panel of right descriptors.

use multiversion::multiversion;

use super::keys::{COLUMNS, Keys, Three, count_of_key, key_of_count, key_of_number, number_of_key};
use crate::describe::Table;

/// The number of left descriptors that are compared at once: their sums fit in registers and do not wait for each
/// other.
const ROWS: usize = 6;
/// The number of left descriptors in a block: the range of a key's position, in groups of [`ROWS`].
const BLOCK: usize = 252;
/// The maximum number of right descriptors in a piece: the range of a key's position in panels.
pub(super) const MAX: usize = COLUMNS * super::keys::PLACES;

/// The result of one piece of the right descriptors against all left ones.
#[derive(Debug, Default)]
pub(super) struct Piece {
    pub(super) left: Vec<Three>,
    numbers: Vec<[f32; COLUMNS]>,
    words: Vec<[u64; COLUMNS]>,
    lengths: Vec<[f32; COLUMNS]>,
    rows: Vec<Keys>,
}

pub(super) fn squared_length(row: &[f32]) -> f32 {
    row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() as f32
}

impl Piece {
    /// Compares all left descriptors, of squared lengths `lengths`, with the right ones from `first` on.
    ///
    /// The squared distance is |a|² + |b|² − 2 a·b.
    pub(super) fn euclid(
        &mut self,
        [left, right]: [&Table<f32>; 2],
        lengths: &[f32],
        first: usize,
        of_right: &mut [Three],
    ) {
        let Self { left: of_left, numbers, lengths: right_lengths, rows, .. } = self;
        let length = right.length();
        // Panels of sixteen, number by number, padded with infinitely distant descriptors.
        numbers.clear();
        numbers.resize(of_right.len().div_ceil(COLUMNS) * length, [0.0; COLUMNS]);
        right_lengths.clear();
        right_lengths.resize(of_right.len().div_ceil(COLUMNS), [f32::INFINITY; COLUMNS]);
        for c in 0..of_right.len() {
            let (panel, lane, row) = (c / COLUMNS, c % COLUMNS, right.row(first + c));
            right_lengths[panel][lane] = squared_length(row);
            let numbers = &mut numbers[panel * length..][..length];
            numbers.iter_mut().zip(row).for_each(|(column, value)| column[lane] = -2.0 * value);
        }
        let work = |block: std::ops::Range<usize>, panel: usize, rows: &mut [Keys]| {
            let numbers = &numbers[panel * length..][..length];
            let left = &left.values()[block.start * length..block.end * length];
            euclid(left, &lengths[block], numbers, &right_lengths[panel], panel as i32, rows)
        };
        blocks(lengths.len(), first, of_right, of_left, rows, number_of_key, work);
    }

    /// Compares binary descriptors in the same way by their Hamming distance.
    pub(super) fn hamming(&mut self, [left, right]: [&Table<u64>; 2], first: usize, of_right: &mut [Three]) {
        let Self { left: of_left, words, rows, .. } = self;
        let length = right.length();
        words.clear();
        words.resize(of_right.len().div_ceil(COLUMNS) * length, [0; COLUMNS]);
        for c in 0..of_right.len() {
            let words = &mut words[c / COLUMNS * length..][..length];
            words.iter_mut().zip(right.row(first + c)).for_each(|(column, word)| column[c % COLUMNS] = *word);
        }
        let full = of_right.len();
        let work = |block: std::ops::Range<usize>, panel: usize, rows: &mut [Keys]| {
            let words = &words[panel * length..][..length];
            let left = &left.values()[block.start * length..block.end * length];
            hamming(left, words, full - panel * COLUMNS, panel as i32, rows)
        };
        blocks(left.len(), first, of_right, of_left, rows, count_of_key, work);
    }
}

/// Compares each block of left descriptors with each panel of right ones.
fn blocks(
    n: usize,
    first: usize,
    of_right: &mut [Three],
    of_left: &mut Vec<Three>,
    rows: &mut Vec<Keys>,
    read: fn(i32) -> f32,
    work: impl Fn(std::ops::Range<usize>, usize, &mut [Keys]) -> Keys,
) {
    of_left.clear();
    of_left.resize(n, Three::NONE);
    for start in (0..n).step_by(BLOCK) {
        let block = start..(start + BLOCK).min(n);
        rows.clear();
        rows.resize(block.len(), Keys::NONE);
        for (panel, of_panel) in of_right.chunks_mut(COLUMNS).enumerate() {
            let columns = work(block.clone(), panel, rows);
            for (lane, three) in of_panel.iter_mut().enumerate() {
                columns.merge_into(three, lane, read, |row| start + row);
            }
        }
        for (three, keys) in of_left[block].iter_mut().zip(&*rows) {
            for lane in 0..COLUMNS {
                keys.merge_into(three, lane, read, |panel| first + panel * COLUMNS + lane);
            }
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn euclid(
    left: &[f32],
    lengths: &[f32],
    panel: &[[f32; COLUMNS]],
    right_lengths: &[f32; COLUMNS],
    number: i32,
    rows: &mut [Keys],
) -> Keys {
    let (n, length) = (rows.len(), panel.len());
    let mut columns = Keys::NONE;
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
            let [mut of_row, mut of_columns] = [[0; COLUMNS]; 2];
            for c in 0..COLUMNS {
                let squared = (lengths[i] + right_lengths[c]) + products[c];
                of_row[c] = key_of_number(squared, number);
                of_columns[c] = key_of_number(squared, i as i32);
            }
            rows[i].offer(&of_row);
            columns.offer(&of_columns);
        }
    }
    columns
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn hamming(left: &[u64], panel: &[[u64; COLUMNS]], full: usize, number: i32, rows: &mut [Keys]) -> Keys {
    let mut columns = Keys::NONE;
    for ((i, row), keys) in left.chunks_exact(panel.len()).enumerate().zip(rows) {
        let mut counts = [0_u64; COLUMNS];
        for (word, column) in row.iter().zip(panel) {
            counts.iter_mut().zip(column).for_each(|(count, other)| *count += u64::from((word ^ other).count_ones()));
        }
        let [mut of_row, mut of_columns] = [[i32::MAX; COLUMNS]; 2];
        for c in 0..COLUMNS {
            of_row[c] = if c < full { key_of_count(counts[c], number) } else { i32::MAX };
            of_columns[c] = key_of_count(counts[c], i as i32);
        }
        keys.offer(&of_row);
        columns.offer(&of_columns);
    }
    columns
}
