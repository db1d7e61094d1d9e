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
    let ln = ln_products(problem, k) + (3 * k - 6) as f64 * libm::log(q);
    libm::exp(ln)
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
        let choose: f64 = (0..k).map(|i| libm::log((n - i) as f64 / (i + 1) as f64)).sum();
        return choose + k as f64 * libm::log(mean);
    }
    // e_j of the first i lengths, as logarithms: e_j ← e_j + length · e_{j−1}.
    let mut e = vec![f64::NEG_INFINITY; k + 1];
    e[0] = 0.0;
    for length in lengths {
        for j in (1..=k).rev() {
            e[j] = ln_sum(e[j], e[j - 1] + libm::log(length));
        }
    }
    e[k]
}

/// ln(eᵃ + eᵇ).
fn ln_sum(a: f64, b: f64) -> f64 {
    let (high, low) = (a.max(b), a.min(b));
    if high == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Candidates, ModelPoint, Tolerance};
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    /// Points on a line: model and cloud; distances decide who agrees.
    fn model(at: &[f64]) -> Vec<ModelPoint> {
        at.iter().map(|&x| ModelPoint::exact("", Point::new(x, 0.0, 0.0))).collect()
    }

    fn cloud(at: &[f64]) -> Vec<MeasuredPoint> {
        at.iter()
            .map(|&x| MeasuredPoint { position: UncertainPoint::isotropic(Point::new(x, 0.0, 0.0), 0.0), pixels: None })
            .collect()
    }

    #[test]
    fn three_lists_of_two() {
        // No pair agrees: cloud distances are far from the model's. Pairs of different model and cloud
        // points: 3 · 4 = 12, so q = (0 + 1) / (12 + 2) and E_3 = 2³ q³.
        let (model, cloud) = (model(&[0.0, 1.0, 3.0]), cloud(&[0.0, 100.0, 1000.0, 5000.0, 20000.0, 90000.0]));
        let candidates = Candidates { lists: vec![vec![0, 1], vec![2, 3], vec![4, 5]] };
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(0.1),
            prior: None,
        };
        let nothing = [Correspondence { model: 9, cloud: 0 }; 3];
        assert!((expected_sets(&problem, &nothing) / (8.0 / 14f64.powi(3)) - 1.0).abs() < 1e-12);
        assert_eq!(expected_sets(&problem, &nothing[..2]), f64::INFINITY);
    }

    #[test]
    fn subsets_are_weighed_by_their_lists() {
        // e_3 of (1, 2, 3, 4) = 6 + 8 + 12 + 24.
        let (model, cloud) = (model(&[0.0, 1.0, 3.0, 7.0]), cloud(&[0.0; 4]));
        let candidates = Candidates { lists: (1..=4).map(|length| (0..length).collect()).collect() };
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(0.1),
            prior: None,
        };
        assert!((ln_products(&problem, 3).exp() - 50.0).abs() < 1e-9);
        assert_eq!(ln_products(&problem, 5), f64::NEG_INFINITY);
    }

    #[test]
    fn the_expectation_is_what_clutter_shows() {
        // No object: five independent points in a box about each of six predictions; the sets of four
        // that are coherent and unmirrored, counted one by one.
        let places =
            [[0.0, 0.0, 0.0], [1.3, 0.0, 0.0], [0.3, -0.9, 0.0], [0.8, 0.6, 0.5], [-0.4, 0.7, 0.9], [0.1, -0.3, 1.2]];
        let model: Vec<ModelPoint> = places.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let (mut expected, mut counted) = (0.0, 0.0);
        for _ in 0..150 {
            let cloud: Vec<MeasuredPoint> = (0..30)
                .map(|j| Vector3::from(places[j / 5]) + Vector3::from_fn(|_, _| rng.random_range(-0.25..0.25)))
                .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.01), pixels: None })
                .collect();
            let candidates = Candidates { lists: (0..6).map(|i| (5 * i..5 * i + 5).collect()).collect() };
            let tolerance = Tolerance::Fixed(0.03);
            let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None };
            expected += expected_sets(&problem, &[Correspondence { model: 9, cloud: 99 }; 4]);
            let pairs: Vec<Correspondence> = (0..30).map(|cloud| Correspondence { model: cloud / 5, cloud }).collect();
            let agree = |a: usize, b: usize| problem.coherent(pairs[a], pairs[b]);
            for a in 0..30 {
                for b in (a + 1..30).filter(|&b| agree(a, b)) {
                    for c in (b + 1..30).filter(|&c| agree(a, c) && agree(b, c)) {
                        for d in (c + 1..30).filter(|&d| agree(a, d) && agree(b, d) && agree(c, d)) {
                            let four = [a, b, c, d].map(|i| pairs[i]);
                            counted += f64::from(u8::from(!crate::search::mirrored(&problem, four)));
                        }
                    }
                }
            }
        }
        let ratio = counted / expected;
        assert!((0.5..2.0).contains(&ratio), "{counted} counted, {expected} expected");
    }
}
