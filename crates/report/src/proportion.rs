//! Confidence intervals of rates.

use seafix_evaluation::{Bootstrap, clopper_pearson, clustered, of_blocks, quantile};
use seafix_log::TrialHeader;

use crate::paired::SEED;

/// The error bounds of recall (mm), four for every factor of two.
const BOUNDS: [f64; 25] = [
    0.78125, 0.9290, 1.1049, 1.3139, 1.5625, 1.8581, 2.2097, 2.6278, 3.125, 3.7163, 4.4194, 5.2556, 6.25, 7.4325,
    8.8388, 10.5112, 12.5, 14.865, 17.6777, 21.0224, 25.0, 29.7302, 35.3553, 42.0448, 50.0,
];

/// Minimum fix rate (%) at which a method counts as not broken down; set before the experiments.
pub(crate) const BORNE: f64 = 95.0;

/// Whether the frames of a trial follow each other on one trajectory, so that neighbours are correlated.
///
/// Frames are independent draws if every frame has another object (the header has no target then) or another layout.
pub(crate) fn is_trajectory(header: &TrialHeader) -> bool {
    !header.targets.is_empty() && !header.configuration.contains("name = \"virtual-layouts\"")
}

/// The number of successive attempts, of `n` in all, that count as one: one for independent draws.
pub(crate) fn block(trajectory: bool, n: usize) -> usize {
    if trajectory { Bootstrap::of(n, SEED).block } else { 1 }
}

/// The 95 % Clopper–Pearson interval of the fraction of events among the attempts, in order of time.
///
/// Independent draws have the exact interval; a trajectory has that for the effective number of attempts.
pub(crate) fn interval(trajectory: bool, events: &[bool]) -> (f64, f64) {
    if trajectory && !events.is_empty() {
        return clustered(events, block(trajectory, events.len()), 0.95);
    }
    clopper_pearson(events.iter().filter(|event| **event).count(), events.len(), 0.95)
}

/// The fraction of events (%), and the ends of its 95 % [`interval`] (%); `None` without events.
pub(crate) fn rate(trajectory: bool, events: &[bool]) -> Option<[f64; 3]> {
    let k = events.iter().filter(|event| **event).count();
    let (low, high) = interval(trajectory, events);
    (!events.is_empty()).then(|| [k as f64 / events.len() as f64, low, high].map(|fraction| 100.0 * fraction))
}

/// The 95 % interval of `k` of `n`, for a log that has only counts of some attempts.
///
/// Their correlation is unknown, so every block of a trajectory counts as one attempt.
pub(crate) fn interval_of_counts(trajectory: bool, k: usize, n: usize) -> (f64, f64) {
    of_blocks(k, n, block(trajectory, n), 0.95)
}

/// The 95 % interval of `k` of `n` attempts of several trials, `sharing` of which have the same frames.
///
/// Attempts at one target of one frame are not independent: those of all trials that share it count as one.
pub(crate) fn interval_of_shared(trajectory: bool, sharing: usize, k: usize, n: usize) -> (f64, f64) {
    of_blocks(k, n, block(trajectory, n / sharing.max(1)) * sharing.max(1), 0.95)
}

/// The 95 % interval of the median: the quantiles at the ends of the interval of one half.
///
/// It assumes nothing about the distribution. The result is `None` without values.
pub(crate) fn median_interval(trajectory: bool, values: &mut [f64]) -> Option<(f64, f64)> {
    let n = values.len();
    if n == 0 {
        return None;
    }
    let low = interval_of_counts(trajectory, n / 2, n).0;
    let high = interval_of_counts(trajectory, n - n / 2, n).1;
    Some((quantile(values, low), quantile(values, high)))
}

/// The error bounds of recall, in mm for printing and in m for comparison.
pub(crate) fn bounds() -> impl Iterator<Item = (f64, f64)> {
    BOUNDS.into_iter().map(|bound| (bound, bound / 1e3))
}

/// The intervals of the fractions of errors (m) up to each of the [`bounds`].
///
/// Recall never falls as the bound grows, so neither may an end of its interval: an end that falls is moved outwards.
pub(crate) fn band(trajectory: bool, errors: &[f64]) -> Vec<(f64, f64)> {
    let below = |bound: f64| errors.iter().map(|error| *error <= bound).collect::<Vec<bool>>();
    let mut band: Vec<(f64, f64)> = bounds().map(|(_, bound)| interval(trajectory, &below(bound))).collect();
    for i in 1..band.len() {
        band[i].1 = band[i].1.max(band[i - 1].1);
    }
    for i in (1..band.len()).rev() {
        band[i - 1].0 = band[i - 1].0.min(band[i].0);
    }
    band
}

/// The name of the intervals of these trials in captions.
pub(crate) fn called<'a>(mut headers: impl Iterator<Item = &'a TrialHeader>) -> &'static str {
    if headers.any(is_trajectory) {
        "95 % intervals (wider where successive frames succeed or fail together)"
    } else {
        "exact 95 % intervals"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four trials over the same 320 frames say no more than 320 frames.
    ///
    /// Seen to fail where all attempts count.
    #[test]
    fn shared_frames_count_once() {
        assert_eq!(interval_of_shared(false, 4, 320, 1280), clopper_pearson(80, 320, 0.95));
        assert_eq!(interval_of_shared(true, 1, 30, 100), interval_of_counts(true, 30, 100));
        assert_eq!(interval_of_shared(true, 2, 60, 200), interval_of_counts(true, 30, 100));
    }

    #[test]
    fn a_median_lies_within_its_interval() {
        // For 100 independent values, Clopper–Pearson of 50 in 100 is [0.398, 0.602].
        let mut values: Vec<f64> = (0..101_u32).map(f64::from).collect();
        let (low, high) = median_interval(false, &mut values).expect("there are values");
        assert!((39.0..41.0).contains(&low) && (60.0..62.0).contains(&high), "{low} {high}");
        let (wider, _) = median_interval(true, &mut values).expect("there are values");
        assert!(wider < low, "neighbours on a trajectory say less");
        assert_eq!(median_interval(false, &mut [3.0]), Some((3.0, 3.0)));
        assert_eq!(median_interval(false, &mut []), None);
    }

    /// Seen to fail where each bound keeps its own interval: the lower end falls from 63 of 64 errors to 64.
    #[test]
    fn a_band_never_falls() {
        let errors: Vec<f64> = (0..64_u32).map(|i| 0.395e-3 * f64::from(i * 27 % 64 + 1)).collect();
        for trajectory in [false, true] {
            let band = band(trajectory, &errors);
            assert!(band.windows(2).all(|two| two[0].0 <= two[1].0 && two[0].1 <= two[1].1), "{band:?}");
            for ((_, bound), (low, high)) in bounds().zip(band) {
                let fraction = errors.iter().filter(|error| **error <= bound).count() as f64 / 64.0;
                assert!(low <= fraction && fraction <= high);
            }
        }
    }
}
