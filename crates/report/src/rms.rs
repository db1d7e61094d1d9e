//! Intervals of root mean squares.

use seafix_evaluation::{Bootstrap, block_length};

use crate::paired::SEED;

/// Minimum number of frames with an interval: shorter series have no autocorrelation to choose blocks by.
const MIN: usize = 10;

/// The 95 % interval of the root mean square of errors over successive frames, in their unit.
///
/// It is the percentile interval of the circular block [`Bootstrap`] with the [`block_length`] of the squared errors. It
/// covers the variation within the dive, not that between dives. The result is `None` for fewer than ten frames.
pub(crate) fn over_frames(errors: &[f64]) -> Option<(f64, f64)> {
    let n = errors.len();
    if n < MIN {
        return None;
    }
    let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
    let blocks = Bootstrap { block: block_length(&squares), ..Bootstrap::of(n, SEED) };
    let mean = |at: &[usize]| at.iter().map(|&i| squares[i]).sum::<f64>() / n as f64;
    let (low, high) = blocks.interval(n, 0.95, mean);
    Some((low.sqrt(), high.sqrt()))
}

/// The 95 % interval of the root mean square `rms` of the errors of `n` fixes, in their unit.
///
/// The mean square of n independent errors has the relative standard error c/√n, where c is the ratio of the standard
/// deviation of the squares to their mean, here over the logged errors: the ends are rms √(1 ± 1.96 c/√n). Every block of
/// successive fixes of a trajectory counts as one. The result is `None` for fewer than two logged errors.
pub(crate) fn over_fixes(rms: f64, n: u64, trajectory: bool, logged: &[f64]) -> Option<(f64, f64)> {
    let squares = || logged.iter().map(|error| error * error);
    let count = logged.len() as f64;
    let mean = squares().sum::<f64>() / count;
    let variance = squares().map(|square| (square - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let block = if trajectory { Bootstrap::of(n as usize, SEED).block } else { 1 };
    let half = NORMAL * variance.sqrt() / mean * (block as f64 / n as f64).sqrt();
    let [low, high] = [1.0 - half, 1.0 + half].map(|factor| rms * factor.max(0.0).sqrt());
    (logged.len() > 1 && half.is_finite()).then_some((low, high))
}

/// The 97.5 % quantile of the normal distribution.
const NORMAL: f64 = 1.959_963_984_540_054;

#[cfg(test)]
mod tests {
    use super::*;

    /// 600 errors of 0 or 2 cm in runs of 20 frames, half of each on the average: the mean square is 2 cm², and that of
    /// 30 independent runs has a standard error of 2/√30 cm².
    ///
    /// Seen to fail with blocks of ⌈n^⅓⌉ frames, whose interval is half as wide.
    #[test]
    fn runs_of_equal_errors_count_once() {
        // Fifteen runs of each kind, without a period.
        let runs: u32 = 0b01_1010_0110_1110_0010_1100_1001_0110;
        let errors: Vec<f64> = (0..600).map(|i| 0.02 * f64::from(runs >> (i / 20) & 1)).collect();
        let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / 600.0;
        assert_eq!(runs.count_ones(), 15);
        let (low, high) = over_frames(&errors).expect("600 frames have an interval");
        let half = 1.96 * 2e-4 / 30_f64.sqrt();
        let [expected_low, expected_high] = [mean_square - half, mean_square + half].map(f64::sqrt);
        assert!((low - expected_low).abs() < 0.15 * expected_low, "{low} {expected_low}");
        assert!((high - expected_high).abs() < 0.1 * expected_high, "{high} {expected_high}");
        assert_eq!(over_frames(&[0.01; 9]), None);
        let (low, high) = over_frames(&[0.01; 20]).expect("20 frames have an interval");
        assert!((low - 0.01).abs() < 1e-12 && (high - 0.01).abs() < 1e-12, "{low} {high}");
    }

    /// Normal errors of one axis: squares of mean 1 and variance 2.
    ///
    /// Seen to fail where the errors take the place of their squares.
    #[test]
    fn independent_fixes_have_the_interval_of_a_mean_square() {
        // ±√3 and 0 with probabilities 1/6, 1/6 and 2/3 have the first five moments of a normal distribution.
        let errors: Vec<f64> = (0..600).map(|i| [3_f64.sqrt(), -(3_f64.sqrt()), 0.0, 0.0, 0.0, 0.0][i % 6]).collect();
        let (low, high) = over_fixes(1.0, 10_000, false, &errors).expect("there are fixes");
        let half = 1.959_963_984_540_054 * 2_f64.sqrt() / 100.0;
        assert!((low - (1.0 - half).sqrt()).abs() < 1e-4 && (high - (1.0 + half).sqrt()).abs() < 1e-4, "{low} {high}");
        let wider = over_fixes(1.0, 10_000, true, &errors).expect("there are fixes");
        assert!(wider.0 < low && high < wider.1, "successive frames say less");
        assert_eq!(over_fixes(1.0, 1, false, &[1.0]), None);
    }
}
