//! Sets of small numbers as bit masks, and square bit matrices.

use crate::lanes::{LANES as WORD, ones_of};

/// The number of words for `count` bits.
fn words(count: usize) -> usize {
    count.div_ceil(WORD)
}

/// A set of numbers below a fixed limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BitSet {
    words: Vec<u64>,
}

impl BitSet {
    /// The empty set of numbers below `limit`.
    pub(crate) fn empty(limit: usize) -> Self {
        Self { words: vec![0; words(limit)] }
    }

    /// The set of all numbers below `limit`.
    pub(crate) fn full(limit: usize) -> Self {
        let mut set = Self { words: vec![u64::MAX; words(limit)] };
        if let Some(last) = set.words.last_mut().filter(|_| !limit.is_multiple_of(WORD)) {
            *last = (1 << (limit % WORD)) - 1;
        }
        set
    }

    pub(crate) fn insert(&mut self, number: usize) {
        self.words[number / WORD] |= 1 << (number % WORD);
    }

    pub(crate) fn remove(&mut self, number: usize) {
        self.words[number / WORD] &= !(1 << (number % WORD));
    }

    pub(super) fn has(&self, number: usize) -> bool {
        self.words[number / WORD] >> (number % WORD) & 1 == 1
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    pub(crate) fn len(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The smallest member at or above `from`.
    pub(crate) fn next(&self, from: usize) -> Option<usize> {
        let mut index = from / WORD;
        let mut word = self.words.get(index)? & (u64::MAX << (from % WORD));
        loop {
            if word != 0 {
                return Some(index * WORD + word.trailing_zeros() as usize);
            }
            index += 1;
            word = *self.words.get(index)?;
        }
    }

    /// The members, ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        ones(&self.words)
    }

    /// The words of the mask.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Removes every number below `from`.
    pub(super) fn drop_below(&mut self, from: usize) {
        let full_words = (from / WORD).min(self.words.len());
        self.words[..full_words].fill(0);
        if let Some(word) = self.words.get_mut(full_words) {
            *word &= u64::MAX << (from % WORD);
        }
    }

    /// Intersects with `row`.
    pub(crate) fn intersect(&mut self, row: &[u64]) {
        self.words.iter_mut().zip(row).for_each(|(word, other)| *word &= other);
    }

    /// Removes the members of `row`, from the word of `from` on.
    pub(crate) fn subtract(&mut self, row: &[u64], from: usize) {
        let first = from / WORD;
        self.words[first..].iter_mut().zip(&row[first..]).for_each(|(word, other)| *word &= !other);
    }

    /// The number of members in common with `row`.
    pub(crate) fn common(&self, row: &[u64]) -> usize {
        let mut count = 0;
        for (word, other) in self.words.iter().zip(row) {
            let both = word & other;
            // Counting ones costs more than a test for zero, which is the rule in large graphs.
            if both != 0 {
                count += both.count_ones() as usize;
            }
        }
        count
    }
}

/// The number of neighbours in `members` of each vertex of `of`.
pub(super) fn degrees(adjacency: &BitMatrix, members: &BitSet, of: &[usize], degrees: &mut Vec<usize>) {
    let first = members.words.iter().position(|&word| word != 0).unwrap_or(0);
    let last = members.words.iter().rposition(|&word| word != 0).map_or(first, |last| last + 1);
    degrees.clear();
    count(&adjacency.bits, adjacency.width, first, &members.words[first..last], of, degrees);
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512bw+avx512dq+avx512vpopcntdq",
    "x86_64+avx2+bmi1+bmi2+popcnt"
))]
fn count(bits: &[u64], width: usize, first: usize, members: &[u64], of: &[usize], degrees: &mut Vec<usize>) {
    for &v in of {
        let row = &bits[v * width + first..][..members.len()];
        let shared: u64 = members.iter().zip(row).map(|(a, b)| u64::from((a & b).count_ones())).sum();
        degrees.push(shared as usize);
    }
}

/// The positions of the ones, ascending.
fn ones(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(index, &word)| ones_of(index * WORD, word))
}

/// Transposes 64 × 64 bits by swapping halves, quarters and so on across the diagonal.
fn transpose(block: &mut [u64; WORD]) {
    let (mut step, mut mask) = (WORD / 2, u64::MAX >> (WORD / 2));
    while step > 0 {
        let mut k = 0;
        while k < WORD {
            let swap = ((block[k] >> step) ^ block[k + step]) & mask;
            block[k] ^= swap << step;
            block[k + step] ^= swap;
            k = (k + step + 1) & !step;
        }
        step /= 2;
        mask ^= mask << step;
    }
}

/// A square bit matrix: the adjacency of a graph.
#[derive(Debug, Clone, Default)]
pub(crate) struct BitMatrix {
    width: usize,
    bits: Vec<u64>,
}

impl BitMatrix {
    /// The zero matrix of `size` × `size`.
    pub(crate) fn zeros(size: usize) -> Self {
        Self { width: words(size), bits: vec![0; size * words(size)] }
    }

    /// Sets (i, j) and (j, i).
    pub(crate) fn connect(&mut self, i: usize, j: usize) {
        self.bits[i * self.width + j / WORD] |= 1 << (j % WORD);
        self.bits[j * self.width + i / WORD] |= 1 << (i % WORD);
    }

    /// Row `i` as mutable words.
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [u64] {
        &mut self.bits[i * self.width..(i + 1) * self.width]
    }

    /// Sets (j, i) for every (i, j), i < j; the part below the diagonal must be zero before.
    pub(super) fn mirror_upper(&mut self) {
        let size = self.bits.len() / self.width.max(1);
        for rows in 0..self.width {
            for columns in rows..self.width {
                let (first, count) = (rows * WORD, WORD.min(size - rows * WORD));
                let mut block = [0; WORD];
                (0..count).for_each(|k| block[k] = self.bits[(first + k) * self.width + columns]);
                if block == [0; WORD] {
                    continue;
                }
                transpose(&mut block);
                let (first, count) = (columns * WORD, WORD.min(size - columns * WORD));
                (0..count).for_each(|k| self.bits[(first + k) * self.width + rows] |= block[k]);
            }
        }
    }

    /// Row `i` as words.
    pub(crate) fn row(&self, i: usize) -> &[u64] {
        &self.bits[i * self.width..(i + 1) * self.width]
    }

    /// The columns of the ones of row `i`, ascending.
    pub(crate) fn ones(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        ones(self.row(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_of_numbers_across_words() {
        let mut set = BitSet::empty(130);
        [0, 63, 64, 129].into_iter().for_each(|number| set.insert(number));
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 63, 64, 129]);
        assert_eq!((set.next(1), set.next(65), set.len()), (Some(63), Some(129), 4));
        set.remove(129);
        assert_eq!(set.next(65), None);
        assert_eq!(BitSet::full(130).len(), 130);
        assert_eq!(BitSet::full(128).len(), 128);
    }

    #[test]
    fn the_upper_half_is_mirrored() {
        for size in [0, 1, 63, 64, 65, 200] {
            let (mut half, mut full_words) = (BitMatrix::zeros(size), BitMatrix::zeros(size));
            for i in 0..size {
                for j in (i + 1..size).filter(|j| (i * 31 + j * 17) % 7 < 2) {
                    half.row_mut(i)[j / WORD] |= 1 << (j % WORD);
                    full_words.connect(i, j);
                }
            }
            half.mirror_upper();
            assert_eq!(half.bits, full_words.bits, "{size}");
        }
    }

    #[test]
    fn a_matrix_is_symmetric() {
        let mut matrix = BitMatrix::zeros(70);
        matrix.connect(3, 69);
        assert_eq!(matrix.ones(3).collect::<Vec<_>>(), [69]);
        assert_eq!(matrix.ones(69).collect::<Vec<_>>(), [3]);
        let mut set = BitSet::full(70);
        assert_eq!(set.common(matrix.row(3)), 1);
        set.intersect(matrix.row(3));
        assert_eq!(set.iter().collect::<Vec<_>>(), [69]);
        set.subtract(matrix.row(3), 69);
        assert!(set.is_empty());
    }
}
