//! The sampled Gaussian, in the same bits on every platform.

/// One half of a sampled Gaussian of standard deviation `sigma` (px): the weight of the centre, then
/// of each step away from it; the whole kernel, both halves, sums to one. It ends at 3 `sigma`.
pub(crate) fn half_kernel(sigma: f64) -> Vec<f32> {
    let radius = libm::ceil(3.0 * sigma.max(0.0)) as usize;
    let weight = |i: usize| {
        let step = i as f64 / sigma;
        if i == 0 { 1.0 } else { libm::exp(-0.5 * step * step) }
    };
    let sum = 1.0 + 2.0 * (1..=radius).map(weight).sum::<f64>();
    (0..=radius).map(|i| (weight(i) / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_sums_to_one_and_falls() {
        for sigma in [0.0, 0.3, 1.0, 2.5] {
            let half = half_kernel(sigma);
            let sum = half[0] + 2.0 * half[1..].iter().sum::<f32>();
            assert!((sum - 1.0).abs() < 1e-6, "{sigma}: {sum}");
            assert!(half.windows(2).all(|w| w[0] > w[1]));
        }
    }
}
