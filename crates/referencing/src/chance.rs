//! How many sets as large as the one found chance alone would give.

use crate::{Correspondence, Problem};

/// Pairs of candidates looked at for the chance that two agree.
const MOST_SAMPLED: u64 = 200_000;
/// Above this many terms the sum over subsets is bounded instead of computed.
const MOST_TERMS: usize = 200_000;

/// The expected number of admissible sets of `found.len()` pairs or more if no candidate were true:
///
/// E_k = Σ over k-subsets of model points of Π |list_i| · q^(3k−6), k ≥ 3.
///
/// k points have 3k − 6 independent distances, each agreeing by chance with probability q; the rest
/// then agree by themselves. (Of the two places that three distances leave for a fourth point,
/// orientation refuses one.) q is measured: the share of coherent ones among the pairs of candidates
/// outside the found set. A-contrario acceptance after Moisan and Stival, *A probabilistic
/// criterion to detect rigid point matches*, 2004.
pub(crate) fn expected_sets(problem: &Problem<'_>, found: &[Correspondence]) -> f64 {
    let k = found.len();
    if k < 3 {
        return f64::INFINITY;
    }
    let q = agreement(problem, found);
    let ln = ln_products(problem, k) + (3 * k - 6) as f64 * q.ln();
    ln.exp()
}

/// ln Σ over k-subsets of Π |list_i|: the elementary symmetric polynomial e_k of the list lengths.
fn ln_products(problem: &Problem<'_>, k: usize) -> f64 {
    let lengths: Vec<f64> =
        problem.candidates.lists.iter().filter(|list| !list.is_empty()).map(|list| list.len() as f64).collect();
    let n = lengths.len();
    if k > n {
        return f64::NEG_INFINITY;
    }
    if n * k > MOST_TERMS {
        // Maclaurin's inequality: e_k ≤ C(n, k) · mean^k.
        let mean = lengths.iter().sum::<f64>() / n as f64;
        let choose: f64 = (0..k).map(|i| ((n - i) as f64 / (i + 1) as f64).ln()).sum();
        return choose + k as f64 * mean.ln();
    }
    // e_j of the first i lengths, as logarithms: e_j ← e_j + length · e_{j−1}.
    let mut e = vec![f64::NEG_INFINITY; k + 1];
    e[0] = 0.0;
    for length in lengths {
        for j in (1..=k).rev() {
            e[j] = ln_sum(e[j], e[j - 1] + length.ln());
        }
    }
    e[k]
}

/// ln(eᵃ + eᵇ).
fn ln_sum(a: f64, b: f64) -> f64 {
    let (high, low) = (a.max(b), a.min(b));
    if high == f64::NEG_INFINITY { high } else { high + (low - high).exp().ln_1p() }
}

/// The share of coherent pairs among candidates of different model points and cloud points, those of
/// the found set left out; one agreeing pair is assumed beyond those seen, so that few say little.
fn agreement(problem: &Problem<'_>, found: &[Correspondence]) -> f64 {
    let others: Vec<Correspondence> = problem
        .candidates
        .lists
        .iter()
        .enumerate()
        .flat_map(|(model, list)| list.iter().map(move |&cloud| Correspondence { model, cloud }))
        .filter(|pair| found.binary_search(pair).is_err())
        .collect();
    let n = others.len() as u64;
    let all = n * n.saturating_sub(1) / 2;
    let (mut agreeing, mut looked_at) = (1.0, 2.0);
    let mut look = |a: Correspondence, b: Correspondence| {
        if a.model != b.model && a.cloud != b.cloud {
            looked_at += 1.0;
            agreeing += f64::from(u8::from(problem.coherent(a, b)));
        }
    };
    if all <= MOST_SAMPLED {
        for (index, &a) in others.iter().enumerate() {
            others[..index].iter().for_each(|&b| look(a, b));
        }
    } else {
        // Steps by the golden section and by √2 of the range visit it evenly, without a random number.
        let place = |i: u64, step: f64| (((i as f64 * step).fract() * n as f64) as usize).min(others.len() - 1);
        for i in 0..MOST_SAMPLED {
            look(others[place(i, 0.618_033_988_749_894_8)], others[place(i, 0.414_213_562_373_095_1)]);
        }
    }
    agreeing / looked_at
}
