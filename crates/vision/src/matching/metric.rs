//! The distance between two descriptors.

use crate::describe::{Descriptors, Table};

/// The comparable descriptors of two views: of one kind and one length.
#[derive(Debug, Clone, Copy)]
pub(super) enum Metric<'a> {
    /// The Euclidean distance.
    Euclid([&'a Table<f32>; 2]),
    /// The Hamming distance: the number of differing bits.
    Hamming([&'a Table<u64>; 2]),
}

impl<'a> Metric<'a> {
    /// The metric of two views; `None` for descriptors of different kinds or lengths.
    pub(super) fn of(left: &'a Descriptors, right: &'a Descriptors) -> Option<Self> {
        match (left, right) {
            (Descriptors::Numbers(a), Descriptors::Numbers(b)) => {
                (a.length() == b.length()).then_some(Self::Euclid([a, b]))
            }
            (Descriptors::Bits(a), Descriptors::Bits(b)) => (a.length() == b.length()).then_some(Self::Hamming([a, b])),
            _ => None,
        }
    }

    /// The squared distance of left descriptor `i` and right descriptor `j`.
    ///
    /// It is Euclidean for numbers. For n bits with Hamming distance h it is 4 h / n, the squared distance of the unit
    /// vectors whose signs they are.
    pub(super) fn squared(&self, i: usize, j: usize) -> f32 {
        match self {
            Self::Euclid([a, b]) => squared(a.row(i), b.row(j)),
            Self::Hamming([a, b]) => 4.0 / bits(a) * differing(a.row(i), b.row(j)) as f32,
        }
    }

    /// The distance in the descriptors' own measure: Euclidean or Hamming.
    pub(super) fn distance(&self, squared: f32) -> f32 {
        match self {
            Self::Euclid(_) => squared.sqrt(),
            Self::Hamming([a, _]) => (0.25 * bits(a) * squared).round(),
        }
    }

    /// The ratio of squared distances for a ratio of distances in the descriptors' own measure.
    pub(super) fn squared_ratio(&self, ratio: f64) -> f32 {
        match self {
            Self::Euclid(_) => (ratio * ratio) as f32,
            Self::Hamming(_) => ratio as f32,
        }
    }
}

fn bits(table: &Table<u64>) -> f32 {
    64.0 * table.length() as f32
}

/// The number of differing bits.
pub(super) fn differing(a: &[u64], b: &[u64]) -> u32 {
    a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum()
}

/// The squared Euclidean distance, summed in eight lanes and these pairwise: identical on every machine.
pub(super) fn squared(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut lanes = [0.0_f32; 8];
    for (a, b) in a.iter().zip(b) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += (a - b) * (a - b);
        }
    }
    for ((lane, a), b) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
        *lane += (a - b) * (a - b);
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_by_hand() {
        let numbers = |values: &[f32]| Descriptors::Numbers(Table::new(values.len(), values.to_vec()));
        let [a, b] = [numbers(&[3.0, 0.0, 1.0]), numbers(&[0.0, 4.0, 1.0])];
        let metric = Metric::of(&a, &b).unwrap();
        assert_eq!((metric.squared(0, 0), metric.distance(25.0)), (25.0, 5.0));
        let long: Vec<f32> = (0..19).map(|i| i as f32).collect();
        assert_eq!(squared(&long, &[0.0; 19]), 2109.0);

        let bits = |word| Descriptors::Bits(Table::new(2, vec![word, 0]));
        let [a, b] = [bits(0b1011), bits(0b0001)];
        let metric = Metric::of(&a, &b).unwrap();
        assert_eq!((metric.squared(0, 0), metric.distance(metric.squared(0, 0))), (4.0 * 2.0 / 128.0, 2.0));
        assert!(Metric::of(&a, &numbers(&[0.0, 0.0])).is_none(), "kinds differ");
        assert!(Metric::of(&numbers(&[0.0]), &numbers(&[0.0, 0.0])).is_none(), "lengths differ");
    }
}
