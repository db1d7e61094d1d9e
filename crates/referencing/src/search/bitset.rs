//! Sets of small numbers as bits, and square matrices of them.

/// Bits in a word.
const WORD: usize = 64;

/// Words that hold `count` bits.
fn words(count: usize) -> usize {
    count.div_ceil(WORD)
}

/// A set of numbers below a fixed limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BitSet {
    words: Vec<u64>,
}

impl BitSet {
    /// No number below `limit`.
    pub(crate) fn empty(limit: usize) -> Self {
        Self { words: vec![0; words(limit)] }
    }

    /// Every number below `limit`.
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

    pub(crate) fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    pub(crate) fn len(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The least number at or above `from`.
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

    /// The numbers, ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        ones(&self.words)
    }

    /// Keeps what is also in `row`.
    pub(crate) fn intersect(&mut self, row: &[u64]) {
        self.words.iter_mut().zip(row).for_each(|(word, other)| *word &= other);
    }

    /// Removes what is in `row`, from the word of `from` on.
    pub(crate) fn subtract(&mut self, row: &[u64], from: usize) {
        let first = from / WORD;
        self.words[first..].iter_mut().zip(&row[first..]).for_each(|(word, other)| *word &= !other);
    }

    /// How many of its numbers are also in `row`.
    pub(crate) fn common(&self, row: &[u64]) -> usize {
        let mut count = 0;
        for (word, other) in self.words.iter().zip(row) {
            let both = word & other;
            // Counting ones costs more than seeing that there are none, which is the rule in large graphs.
            if both != 0 {
                count += both.count_ones() as usize;
            }
        }
        count
    }

    /// The numbers that are also in `row`, ascending.
    pub(crate) fn shared<'a>(&'a self, row: &'a [u64]) -> impl Iterator<Item = usize> + 'a {
        self.words.iter().zip(row).enumerate().flat_map(|(index, (word, other))| bits(index, word & other))
    }
}

/// The positions of the ones, ascending.
fn ones(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(index, &word)| bits(index, word))
}

/// The positions of the ones of the word at `index`.
fn bits(index: usize, word: u64) -> impl Iterator<Item = usize> {
    std::iter::successors((word != 0).then_some(word), |rest| {
        let rest = rest & (rest - 1);
        (rest != 0).then_some(rest)
    })
    .map(move |rest| index * WORD + rest.trailing_zeros() as usize)
}

/// A square matrix of bits: the adjacency of a graph.
#[derive(Debug, Clone)]
pub(crate) struct BitMatrix {
    width: usize,
    bits: Vec<u64>,
}

impl BitMatrix {
    /// `size` × `size` zeros.
    pub(crate) fn zeros(size: usize) -> Self {
        Self { width: words(size), bits: vec![0; size * words(size)] }
    }

    /// Sets both (i, j) and (j, i).
    pub(crate) fn connect(&mut self, i: usize, j: usize) {
        self.bits[i * self.width + j / WORD] |= 1 << (j % WORD);
        self.bits[j * self.width + i / WORD] |= 1 << (i % WORD);
    }

    /// Row `i` as words.
    pub(crate) fn row(&self, i: usize) -> &[u64] {
        &self.bits[i * self.width..(i + 1) * self.width]
    }

    /// The columns of the ones of row `i`, ascending.
    pub(crate) fn ones(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        ones(self.row(i))
    }

    /// How many ones row `i` has.
    pub(crate) fn degree(&self, i: usize) -> usize {
        self.row(i).iter().map(|word| word.count_ones() as usize).sum()
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
