//! The sum over the subsets of a mode's members that are the object's.

/// Maximum number of members excluded at once; the contribution of larger exclusions is neglected.
const MAX_LEFT_OUT: usize = 1024;

/// ln Σ_V B(|V|) Π_{i∈V} r_i over the subsets V of the members of a mode.
///
/// r_i = exp(`gains`[i]) is the likelihood ratio of each member. B (`ln_fraction`) is the probability of one visible
/// set of this size. A pair that fits is the object's, or clutter that happens to be there. If r ≫ n, nearly all of the
/// sum is the set of all members; a pair with a ratio of about one has no information either way.
pub(super) fn ln_visible(gains: &[f64], ln_fraction: &[f64]) -> f64 {
    // Coefficients of Π_i (r_i + z), each factor divided by the greater of its two: z counts the excluded members.
    let mut left_out = vec![1.0];
    let mut ln_scale = 0.0;
    for &gain in gains {
        let (in_set, out) = if gain > 0.0 { (1.0, libm::exp(-gain)) } else { (libm::exp(gain), 1.0) };
        ln_scale += gain.max(0.0);
        left_out.push(0.0);
        for j in (1..left_out.len()).rev() {
            left_out[j] = left_out[j] * in_set + left_out[j - 1] * out;
        }
        left_out[0] *= in_set;
        left_out.truncate(MAX_LEFT_OUT + 1);
        let max = left_out.iter().copied().fold(0.0, f64::max);
        if max > 0.0 && !(1e-200..1e200).contains(&max) {
            left_out.iter_mut().for_each(|c| *c /= max);
            ln_scale += libm::log(max);
        }
    }
    let terms: Vec<f64> =
        left_out.iter().enumerate().map(|(j, &c)| libm::log(c) + ln_fraction[gains.len() - j]).collect();
    let max = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !max.is_finite() {
        return max;
    }
    ln_scale + max + libm::log(terms.iter().map(|term| libm::exp(term - max)).sum())
}

#[cfg(test)]
mod tests {
    use super::{super::fractions::ln_fraction, *};

    fn fractions(n: usize) -> Vec<f64> {
        (0..=n).map(|k| ln_fraction(k, n)).collect()
    }

    /// The same sum, set by set.
    fn by_sets(gains: &[f64], ln_fraction: &[f64]) -> f64 {
        let of_set = |set: u32| {
            let members = gains.iter().enumerate().filter(|(i, _)| set >> i & 1 == 1);
            libm::exp(members.map(|(_, gain)| gain).sum::<f64>() + ln_fraction[set.count_ones() as usize])
        };
        libm::log((0..1 << gains.len()).map(of_set).sum())
    }

    #[test]
    fn it_is_the_sum_over_all_sets() {
        let fractions = fractions(12);
        for gains in [&[][..], &[3.0], &[7.0, -2.0, 0.5, 0.0], &[-40.0, 30.0, 5.0, 5.0, 5.0, -1.0, 2.0]] {
            let (found, expected) = (ln_visible(gains, &fractions), by_sets(gains, &fractions));
            assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0), "{gains:?}: {found}, {expected}");
        }
    }

    #[test]
    fn uninformative_points_change_little_and_certain_ones_decide() {
        let fractions = fractions(50);
        let sure = vec![40.0; 20];
        let product = 800.0 + fractions[20];
        assert!((ln_visible(&sure, &fractions) - product).abs() < 1e-9);
        // Ten more in dense clutter cost the probability that they are hidden and clutter is there, and not their
        // deficit.
        let with = |gain: f64| ln_visible(&[&sure[..], &[gain; 10]].concat(), &fractions);
        assert!((with(-30.0) - product).abs() < 1e-9);
        assert!(with(0.0) > with(-30.0) && with(0.0) < with(1.0));
    }

    #[test]
    fn thousands_neither_overflow_nor_vanish() {
        let fractions = fractions(5000);
        let all = ln_visible(&vec![9.0; 2500], &fractions);
        let expected = 9.0 * 2500.0 + fractions[2500];
        assert!(all > expected && all < expected + 2.0, "{all}, {expected}");
        assert!(ln_visible(&vec![-2.0; 2500], &fractions).is_finite());
    }
}
