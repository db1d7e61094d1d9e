//! Sums that are identical on any machine.

/// The number of partial sums, added in a fixed order; the compiler keeps them in wide registers.
const LANES: usize = 16;

#[inline(always)]
fn fold(lanes: [f32; LANES]) -> f32 {
    let mut lanes = lanes;
    let mut half = LANES / 2;
    while half > 0 {
        for i in 0..half {
            lanes[i] += lanes[i + half];
        }
        half /= 2;
    }
    lanes[0]
}

/// The sum Σ a b; the lengths are equal and a multiple of 8.
#[inline(always)]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    let (wide_a, wide_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let (rest_a, rest_b) = (wide_a.remainder(), wide_b.remainder());
    for (a, b) in wide_a.zip(wide_b) {
        for i in 0..LANES {
            lanes[i] += a[i] * b[i];
        }
    }
    for (i, (a, b)) in rest_a.iter().zip(rest_b).enumerate() {
        lanes[i] += a * b;
    }
    fold(lanes)
}

/// The sum Σ a b c; the lengths are equal and a multiple of 8.
#[inline(always)]
pub(super) fn dot3(a: &[f32], b: &[f32], c: &[f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    let (wide_a, wide_b, wide_c) = (a.chunks_exact(LANES), b.chunks_exact(LANES), c.chunks_exact(LANES));
    let (rest_a, rest_b, rest_c) = (wide_a.remainder(), wide_b.remainder(), wide_c.remainder());
    for ((a, b), c) in wide_a.zip(wide_b).zip(wide_c) {
        for i in 0..LANES {
            lanes[i] += a[i] * b[i] * c[i];
        }
    }
    for (i, ((a, b), c)) in rest_a.iter().zip(rest_b).zip(rest_c).enumerate() {
        lanes[i] += a * b * c;
    }
    fold(lanes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_have_their_remainder() {
        let a: Vec<f32> = (0..40).map(|i| i as f32).collect();
        let squares: f32 = (0..40).map(|i| (i * i) as f32).sum();
        assert_eq!(dot(&a, &a), squares);
        assert_eq!(dot3(&a, &a, &[2.0; 40]), 2.0 * squares);
        assert_eq!(dot(&a[..8], &a[..8]), 140.0);
    }
}
