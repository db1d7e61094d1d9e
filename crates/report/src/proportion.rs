//! How sure a share of the attempts is.

use seafix_evaluation::{Bootstrap, clopper_pearson, clustered, of_blocks};
use seafix_log::TrialHeader;

use crate::paired::SEED;

/// Bounds of the errors of recall (mm): four a factor of two.
const BOUNDS: [f64; 25] = [
    0.78125, 0.9290, 1.1049, 1.3139, 1.5625, 1.8581, 2.2097, 2.6278, 3.125, 3.7163, 4.4194, 5.2556, 6.25, 7.4325,
    8.8388, 10.5112, 12.5, 14.865, 17.6777, 21.0224, 25.0, 29.7302, 35.3553, 42.0448, 50.0,
];

/// Whether the frames of a trial follow each other on one way. They do not where every frame brings an object of its own,
/// so that the header can name none, nor where every frame draws one of many layouts: then each is a draw by itself.
pub(crate) fn is_trajectory(header: &TrialHeader) -> bool {
    !header.targets.is_empty() && !header.configuration.contains("name = \"virtual-layouts\"")
}

/// The 95 % interval of the share of events among the attempts, in order of time: of a trajectory, whose neighbours hang
/// together, that of the effective number of attempts, of independent draws the exact one of Clopper and Pearson.
pub(crate) fn interval(trajectory: bool, events: &[bool]) -> (f64, f64) {
    if trajectory && !events.is_empty() {
        return clustered(events, Bootstrap::of(events.len(), SEED).block, 0.95);
    }
    clopper_pearson(events.iter().filter(|event| **event).count(), events.len(), 0.95)
}

/// The 95 % interval of `k` of `n` where only some attempts of a trajectory are known one by one and the others are counted:
/// how they hang together is not known, and every block is one trial.
pub(crate) fn interval_of_counts(trajectory: bool, k: usize, n: usize) -> (f64, f64) {
    let block = if trajectory { Bootstrap::of(n, SEED).block } else { 1 };
    of_blocks(k, n, block, 0.95)
}

/// The bounds of recall, in mm as they are printed and in m as they are compared.
pub(crate) fn bounds() -> impl Iterator<Item = (f64, f64)> {
    BOUNDS.into_iter().map(|bound| (bound, bound / 1e3))
}

/// The intervals of the shares of errors (m) up to each of the [`bounds`].
///
/// The share cannot fall with the bound. An end that does is moved outwards: what is not sure of a greater bound is not surer
/// of a smaller one.
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

/// What a caption calls the intervals of these trials.
pub(crate) fn called<'a>(mut headers: impl Iterator<Item = &'a TrialHeader>) -> &'static str {
    if headers.any(is_trajectory) {
        "95 % intervals (of the effective number of attempts)"
    } else {
        "exact 95 % intervals"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen to fail where each bound has an interval of its own: from 63 of 64 to all its lower end falls.
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
