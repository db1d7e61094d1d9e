//! Tests of the bootstrap: interval ends, uniform resampling, medians of many values.

use seafix_evaluation::{Bootstrap, median, quantile};

use crate::numbers;

const SCIPY: &str = include_str!("../fixtures/probability.txt");

/// The statistics 0, 1, … 100 have the quantiles 100 α/2 and 100 (1 − α/2).
#[test]
fn the_ends_leave_half_of_alpha_each() {
    let bootstrap = Bootstrap { resamples: 101, block: 1, seed: 9 };
    let counted = |confidence: f64| {
        let mut sampled = -1.0;
        bootstrap.interval(5, confidence, |_| {
            sampled += 1.0;
            sampled
        })
    };
    for (confidence, low) in [(0.9, 5.0), (0.5, 25.0), (0.98, 1.0), (0.0, 50.0), (1.0, 0.0)] {
        let found = counted(confidence);
        assert!((found.0 - low).abs() < 1e-11 && (found.1 - (100.0 - low)).abs() < 1e-11, "{confidence}: {found:?}");
    }
    let none = bootstrap.interval(0, 0.9, |_| 0.0);
    assert!(none.0.is_nan() && none.1.is_nan());
    let once = Bootstrap { resamples: 0, block: 0, seed: 1 };
    assert_eq!(once.interval(1, 0.9, |at| at[0] as f64 + 7.0), (7.0, 7.0), "at least one resample and one block");
    let mut sampled = 0;
    once.interval(3, 0.9, |_| {
        sampled += 1;
        0.0
    });
    assert_eq!(sampled, 1);
}

/// Every index is drawn equally often, at each position in a block: 20 000 draws of each of 5 indices have σ = 126.
#[test]
fn every_place_is_generated_alike() {
    let mut counts = [[0_i32; 5]; 5];
    Bootstrap { resamples: 20_000, block: 3, seed: 11 }.interval(5, 0.9, |places| {
        assert_eq!(places.len(), 5);
        for (i, &place) in places.iter().enumerate() {
            counts[i][place] += 1;
        }
        0.0
    });
    assert!(counts.as_flattened().iter().all(|count| (count - 4000).abs() < 300), "{counts:?}");
}

/// 10 000 resamples here, 200 000 in SciPy; the values are about 0.1 apart.
#[test]
fn scipy_has_the_same_interval() {
    let values = numbers(SCIPY, "values");
    let bootstrap = Bootstrap { resamples: 10_000, block: 1, seed: 4 };
    let mean = |at: &[usize]| at.iter().map(|&i| values[i]).sum::<f64>() / at.len() as f64;
    let (low, high) = bootstrap.interval(values.len(), 0.9, mean);
    let wanted = numbers(SCIPY, "mean interval 0.9");
    assert!((low - wanted[0]).abs() < 0.02 && (high - wanted[1]).abs() < 0.02, "{low} {high}");
    assert_eq!(
        [bootstrap.median(&values, 0.9).0, bootstrap.median(&values, 0.9).1],
        numbers(SCIPY, "median interval 0.9")[..]
    );
}

#[test]
fn blocks_are_as_long_as_the_literature_states() {
    let block = |n: usize| Bootstrap::of(n, 1).block;
    // ⌈n^⅓⌉ up to 400^{3/2} = 8000 values, ⌈n/400⌉ above.
    assert_eq!([block(1), block(8), block(9), block(27), block(28)], [1, 2, 3, 3, 4]);
    assert_eq!([block(8000), block(8001), block(8800), block(8801)], [20, 21, 22, 23]);
    assert_eq!((Bootstrap::of(9, 6).resamples, Bootstrap::of(9, 6).seed), (10_000, 6));
}

/// From 20 001 values on, the interval is found by bisection.
///
/// Its ends are order statistics of the resamples' medians: the ⌈αR/2⌉-th and the ⌈(1 − α/2)R⌉-th of R. The blocks
/// divide the number of values or leave a remainder.
#[test]
fn the_median_of_many_is_that_of_the_resamples_in_order() {
    for (n, block) in [(20_001, 1000), (20_004, 5001), (20_003, 7), (20_001, 60_000)] {
        // Distinct, scattered values.
        let values: Vec<f64> = (0..n).map(|i| (i * 7919 % 20_011) as f64).collect();
        let bootstrap = Bootstrap { resamples: 5, block, seed: 2 };
        let mut medians = Vec::new();
        let sampled = Bootstrap { block: block.min(n), ..bootstrap };
        sampled.interval(n, 0.9, |at| {
            let mut resample: Vec<f64> = at.iter().map(|&i| values[i]).collect();
            medians.push(*resample.select_nth_unstable_by(n.div_ceil(2) - 1, f64::total_cmp).1);
            0.0
        });
        medians.sort_by(f64::total_cmp);
        for (confidence, ends) in [(0.5, [1, 3]), (0.9, [0, 4]), (0.0, [2, 2])] {
            let wanted = (medians[ends[0]], medians[ends[1]]);
            assert_eq!(bootstrap.median(&values, confidence), wanted, "{n} {block} {confidence}");
        }
    }
    // 20 000 values are still sorted: the mean of two neighbours may be an end.
    let values: Vec<f64> = (0..20_000).map(f64::from).collect();
    let bootstrap = Bootstrap { resamples: 4, block: 500, seed: 2 };
    let mut medians = Vec::new();
    bootstrap.interval(20_000, 0.9, |at| {
        medians.push(median(&mut at.iter().map(|&i| values[i]).collect::<Vec<_>>()));
        0.0
    });
    let wanted = (quantile(&mut medians, 0.25), quantile(&mut medians, 0.75));
    assert_eq!(bootstrap.median(&values, 0.5), wanted);
}
