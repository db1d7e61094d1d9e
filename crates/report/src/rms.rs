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

    /// Errors of 0 or 2 cm in a hundred runs of 20 frames: the mean square of 4 p cm² has the standard error of a hundred
    /// independent runs, 4 √(p (1 − p)/100) cm².
    #[test]
    fn runs_of_equal_errors_count_once() {
        let large = |run: u64| (run * run * 40_503 + 12_345) % 65_537 > 32_768;
        let errors: Vec<f64> = (0..2000).map(|i| if large(i / 20) { 0.02 } else { 0.0 }).collect();
        let p = (0..100).filter(|run| large(*run)).count() as f64 / 100.0;
        let (low, high) = over_frames(&errors).expect("2000 frames have an interval");
        let half = 0.5 * (high * high - low * low);
        let expected = 1.96 * 4e-4 * (p * (1.0 - p) / 100.0).sqrt();
        assert!((half / expected - 1.0).abs() < 0.15, "{half} {expected}");
        assert!(low * low < 4e-4 * p && 4e-4 * p < high * high, "{low} {high}");
        assert_eq!(over_frames(&[0.01; 9]), None);
        let (low, high) = over_frames(&[0.01; 20]).expect("20 frames have an interval");
        assert!((low - 0.01).abs() < 1e-12 && (high - 0.01).abs() < 1e-12, "{low} {high}");
    }

    /// Errors of 1 and 2 in turn: the squares have mean 5/2 and standard deviation 3/2.
    #[test]
    fn independent_fixes_have_the_interval_of_a_mean_square() {
        let errors: Vec<f64> = (0..1000).map(|i| f64::from(i % 2 + 1)).collect();
        let (low, high) = over_fixes(1.0, 10_000, false, &errors).expect("there are fixes");
        let half = 1.96 * 0.6 / 100.0_f64;
        assert!((low - (1.0 - half).sqrt()).abs() < 1e-5 && (high - (1.0 + half).sqrt()).abs() < 1e-5, "{low} {high}");
        let wider = over_fixes(1.0, 10_000, true, &errors).expect("there are fixes");
        assert!(wider.0 < low && high < wider.1, "successive frames say less");
        assert_eq!(over_fixes(1.0, 1, false, &[1.0]), None);
    }
}
