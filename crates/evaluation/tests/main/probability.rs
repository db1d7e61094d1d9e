//! Tests of significance tests, intervals and quantiles against SciPy and NumPy.

use seafix_evaluation::{
    clopper_pearson, clustered, holm, mcnemar, median, of_blocks, quantile, recall_area, signed_rank,
};

use crate::{names, near, numbers};

const SCIPY: &str = include_str!("../fixtures/probability.txt");

/// The test fails with a continuity correction of 1, and with the tie correction added.
#[test]
fn scipy_has_the_same_signed_rank() {
    let mut samples = 0;
    for name in names(SCIPY, "differences ") {
        let pairs: Vec<(f64, f64)> =
            numbers(SCIPY, &format!("differences {name}")).into_iter().map(|d| (d, 0.0)).collect();
        let found = signed_rank(&pairs);
        let wanted = numbers(SCIPY, &format!("signed rank {name}"));
        assert_eq!(found.differing as f64, wanted[0], "{name}");
        assert!((found.p / wanted[1] - 1.0).abs() < 1e-9, "{name}: {}, expected {}", found.p, wanted[1]);
        assert!((found.effect - wanted[2]).abs() < 1e-14, "{name}: {}, expected {}", found.effect, wanted[2]);
        samples += 1;
    }
    assert_eq!(samples, 9);
}

#[test]
fn scipy_has_the_same_intervals_of_rates() {
    let mut rates = 0;
    for name in names(SCIPY, "clopper pearson ") {
        let words: Vec<&str> = name.split(' ').collect();
        let (k, n) = (words[0].parse().unwrap(), words[1].parse().unwrap());
        let (low, high) = clopper_pearson(k, n, words[2].parse().unwrap());
        near(&[low, high], &numbers(SCIPY, &format!("clopper pearson {name}")), 1e-9, name);
        rates += 1;
    }
    assert_eq!(rates, 27);
    for name in names(SCIPY, "blocks ") {
        let words: Vec<usize> = name.split(' ').map(|word| word.parse().unwrap()).collect();
        let (low, high) = of_blocks(words[0], words[1], words[2], 0.95);
        near(&[low, high], &numbers(SCIPY, &format!("blocks {name}")), 1e-9, name);
    }
}

/// The test fails with 4/runs for 2/runs.
#[test]
fn correlated_trials_have_korn_and_graubard_s_interval() {
    let mut rows = 0;
    for name in names(SCIPY, "events ") {
        let row = numbers(SCIPY, &format!("events {name}"));
        let events: Vec<bool> = row[1..].iter().map(|&event| event == 1.0).collect();
        let (low, high) = clustered(&events, row[0] as usize, 0.95);
        near(&[low, high], &numbers(SCIPY, &format!("clustered {name}")), 1e-9, name);
        rows += 1;
    }
    assert_eq!(rows, 8);
}

#[test]
fn scipy_has_the_same_p_of_two_rates() {
    for name in names(SCIPY, "mcnemar ") {
        let words: Vec<usize> = name.split(' ').map(|word| word.parse().unwrap()).collect();
        let wanted = numbers(SCIPY, &format!("mcnemar {name}"))[0];
        let found = mcnemar(words[0], words[1]);
        assert!((found / wanted - 1.0).abs() < 1e-9, "{name}: {found}, expected {wanted}");
        assert_eq!(mcnemar(words[1], words[0]), found);
    }
    assert_eq!(mcnemar(0, 0), 1.0);
}

/// R's manual: `p.adjust(c(0.01, 0.02, 0.03, 0.04, 0.05), "holm")` is 0.05, 0.08, 0.09, 0.09, 0.09.
#[test]
fn holm_by_hand() {
    near(&holm(&[0.01, 0.02, 0.03, 0.04, 0.05]), &[0.05, 0.08, 0.09, 0.09, 0.09], 1e-15, "rising");
    near(&holm(&[0.6, 0.001, 0.3, 0.02]), &[0.6, 0.004, 0.6, 0.06], 1e-15, "mixed");
    assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0], "at most one");
    assert_eq!(holm(&[0.04]), [0.04]);
    assert!(holm(&[]).is_empty());
}

#[test]
fn numpy_has_the_same_quantiles() {
    let values = numbers(SCIPY, "values");
    for name in names(SCIPY, "quantile ") {
        let found = quantile(&mut values.clone(), name.parse().unwrap());
        let wanted = numbers(SCIPY, &format!("quantile {name}"))[0];
        assert!((found - wanted).abs() < 1e-14, "{name}: {found}, expected {wanted}");
    }
    assert_eq!(median(&mut values.clone()), numbers(SCIPY, "quantile 0.5")[0]);
    assert_eq!(median(&mut [4.0, 1.0, 3.0, 8.0]), 3.5);
    // Quantiles outside [0, 1] are the end values.
    assert_eq!([quantile(&mut [1.0, 2.0], -0.1), quantile(&mut [1.0, 2.0], 1.1)], [1.0, 2.0]);
    assert_eq!([quantile(&mut [1.0, 2.0], -2.5), quantile(&mut [1.0, 2.0], 2.5)], [1.0, 2.0]);
    let infinite = f64::INFINITY;
    assert_eq!(median(&mut [1.0, infinite]), infinite);
    assert_eq!(median(&mut [-infinite, 1.0]), -infinite);
    assert_eq!(quantile(&mut [1.0, 2.0, infinite], 0.5), 2.0, "an exact order statistic needs no neighbour");
    assert_eq!(median(&mut [infinite, infinite]), infinite);
}

#[test]
fn recall_by_hand() {
    // Contributions of 1 and 0.75, and of 0 at the bound and beyond.
    assert_eq!(recall_area(&[0.0, 0.5, 2.0, 3.0, f64::INFINITY], 2.0), 1.75 / 5.0);
}

/// Two differences of equal size and a larger one: ranks 1.5, 1.5, 3.
#[test]
fn ranks_by_hand() {
    let found = signed_rank(&[(1.0, 2.0), (2.0, 1.0), (0.0, 5.0)]);
    // W₊ = 1.5: three of the eight sign combinations have a rank sum of at most 1.5 on one side (0, 1.5, 1.5), hence p
    // = 2 · 3/8.
    assert_eq!((found.differing, found.p), (3, 0.75));
    assert!((found.effect - (4.5 - 1.5) / 6.0).abs() < 1e-15);
    // An infinite difference is a single difference, whatever its sign.
    let found = signed_rank(&[(f64::INFINITY, 1.0), (0.0, 1.0)]);
    assert_eq!((found.differing, found.p), (2, 1.0));
    assert!((found.effect + 1.0 / 3.0).abs() < 1e-15);
    // Three of the four sign combinations are at least as extreme; the p-value stays at most one.
    assert_eq!(signed_rank(&[(1.0, 2.0), (2.0, 1.0)]).p, 1.0);
    let nothing = signed_rank(&[(1.0, 1.0)]);
    assert_eq!((nothing.differing, nothing.p, nothing.effect), (0, 1.0, 0.0));
}
