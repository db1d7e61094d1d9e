//! Orthogonal directions in the space of the noise, for resampling.

/// A square of `size` rows (a power of two) that resemble draws of standard normal vectors.
///
/// The rows are orthogonal and of length √`size`, so that together they have exactly the unit covariance. The square is
/// H S H of Hadamard's matrix H and signs S (Genz, Monahan, *Stochastic integration rules for infinite regions*, 1998,
/// with the fast rotations of Ailon and Chazelle, *The fast Johnson–Lindenstrauss transform*, 2009). The signs come
/// from a fixed sequence, so that the rows are the same on every machine.
pub(super) struct SigmaDirections {
    size: usize,
    signs: Vec<f64>,
}

/// The size of a square, and the number of squares for at least `pairs` rows of `numbers` numbers.
pub(super) fn rows(numbers: usize, pairs: usize) -> (usize, usize) {
    let size = numbers.max(16).next_power_of_two();
    (size, pairs.div_ceil(size))
}

impl SigmaDirections {
    /// The `block`-th square of this size.
    pub(super) fn new(size: usize, block: u64) -> Self {
        let sign = |k: usize| if mixed((block << 32) + k as u64) & 1 == 0 { 1.0 } else { -1.0 };
        Self { size, signs: (0..2 * size).map(sign).collect() }
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = Vec<f64>> {
        (0..self.size).map(|k| self.row(k))
    }

    /// The k-th row: Hadamard's k-th, rotated twice.
    fn row(&self, k: usize) -> Vec<f64> {
        let mut row: Vec<f64> =
            (0..self.size).map(|j| if (j & k).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }).collect();
        for signs in self.signs.chunks_exact(self.size) {
            row.iter_mut().zip(signs).for_each(|(x, sign)| *x *= sign);
            turn(&mut row);
        }
        row
    }
}

/// Hadamard's matrix over the root of its size, times `x`.
fn turn(x: &mut [f64]) {
    let mut half = 1;
    while half < x.len() {
        for pair in x.chunks_exact_mut(2 * half) {
            let (a, b) = pair.split_at_mut(half);
            for (a, b) in a.iter_mut().zip(b) {
                (*a, *b) = (*a + *b, *a - *b);
            }
        }
        half *= 2;
    }
    let root = (x.len() as f64).sqrt();
    x.iter_mut().for_each(|x| *x /= root);
}

/// The mixing function of Steele and others, *Fast splittable pseudorandom number generators*, 2014.
fn mixed(counter: u64) -> u64 {
    let mut z = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_the_covariance_and_the_tails_of_noise() {
        assert_eq!((rows(3, 128), rows(52, 128), rows(200, 128)), ((16, 8), (64, 2), (256, 1)));
        for (size, block) in [(16, 0), (16, 3), (64, 1)] {
            let rows: Vec<Vec<f64>> = SigmaDirections::new(size, block).rows().collect();
            for i in 0..size {
                for j in 0..size {
                    let product: f64 = (0..size).map(|k| rows[k][i] * rows[k][j]).sum::<f64>() / size as f64;
                    assert!((product - f64::from(u8::from(i == j))).abs() < 1e-12, "{size}: {i} {j}: {product}");
                }
            }
        }
        let all: Vec<f64> =
            (0..8).flat_map(|block| SigmaDirections::new(64, block).rows().flatten().collect::<Vec<_>>()).collect();
        let mean = |power: i32| all.iter().map(|x| x.powi(power)).sum::<f64>() / all.len() as f64;
        assert!((mean(4) - 3.0).abs() < 0.3 && mean(3).abs() < 0.1, "{} {}", mean(4), mean(3));
        assert_ne!(SigmaDirections::new(16, 0).row(1), SigmaDirections::new(16, 1).row(1));
    }
}
