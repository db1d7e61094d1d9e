//! Correction for multiple tests.

/// Holm's adjustment of p-values for the size of their family.
///
/// The adjusted values are in the order of `p`. With p₍₁₎ ≤ … ≤ p₍ₘ₎ the adjusted p₍ᵢ₎ is the maximum over j ≤ i of
/// min(1, (m − j + 1) p₍ⱼ₎). If all claims with an adjusted value below α are accepted, the probability that any of
/// them is false is at most α.
///
/// Source: Holm, *A simple sequentially rejective multiple test procedure*, 1979.
///
/// ```
/// assert_eq!(seafix_evaluation::holm(&[0.01, 0.04, 0.03]), [0.03, 0.06, 0.06]);
/// ```
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut largest: f64 = 0.0;
    for (place, index) in order.into_iter().enumerate() {
        largest = largest.max(((p.len() - place) as f64 * p[index]).min(1.0));
        adjusted[index] = largest;
    }
    adjusted
}
