//! Why the poses of two trajectories have no partners, and which option gives them some.

use seafix_evaluation::trajectory::associate;

/// What the stamps of a reference and an estimate (ns, increasing) show, and the option that associates their poses.
pub(super) fn reason(reference: &[u64], estimate: &[u64], tolerance: u64, offset: i64) -> String {
    let (Some((a, z)), Some((b, y))) = (ends(reference), ends(estimate)) else {
        return "check both files".to_owned();
    };
    if estimate.iter().enumerate().all(|(k, &stamp)| stamp == (b + k as u64 * 1_000_000_000)) && (b <= 1_000_000_000) {
        return format!(
            "the stamps of the estimate count its rows ({}, {}, …): give it times",
            seconds(b),
            seconds(b + 1_000_000_000)
        );
    }
    let shifted = i128::from(b) + i128::from(offset);
    if shifted > i128::from(z) || i128::from(y) + i128::from(offset) < i128::from(a) {
        let spans = format!(
            "the reference is from {} to {} s, the estimate from {} to {} s",
            seconds(a),
            seconds(z),
            seconds(b),
            seconds(y)
        );
        // Both may begin together; otherwise no offset is known.
        let between = i64::try_from(i128::from(a) - i128::from(b));
        let found = between.map_or(0, |between| associate(reference, estimate, tolerance, between).len());
        return match between {
            Ok(between) if found >= 2 => format!(
                "{spans}; if both begin together, `--t-offset {}` associates {found} poses",
                signed_seconds(between)
            ),
            _ => format!("{spans}; check --t-offset and --t-max-diff"),
        };
    }
    let nearest = |stamp: u64| {
        let stamp = i128::from(stamp) + i128::from(offset);
        let at = reference.partition_point(|&other| i128::from(other) < stamp);
        let around = reference[at.saturating_sub(1)..(at + 1).min(reference.len())].iter();
        around.map(|&other| (i128::from(other) - stamp).unsigned_abs()).min().unwrap_or(u128::MAX)
    };
    let mut distances: Vec<u128> = estimate.iter().map(|&stamp| nearest(stamp)).collect();
    distances.sort_unstable();
    let middle = distances[distances.len() / 2] as f64 * 1e-9;
    format!(
        "the nearest stamps are {middle:.3} s apart (median), more than --t-max-diff; check --t-offset, or raise \
         --t-max-diff"
    )
}

fn ends(stamps: &[u64]) -> Option<(u64, u64)> {
    Some((*stamps.first()?, *stamps.last()?))
}

/// A time in seconds to the last nanosecond, without trailing zeros.
fn seconds(ns: u64) -> String {
    let text = format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn signed_seconds(ns: i64) -> String {
    format!("{}{}", if ns < 0 { "-" } else { "" }, seconds(ns.unsigned_abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    /// Fails if the offset is that of the estimate to the reference, or if its digits are those of a double.
    #[test]
    fn the_option_that_helps_is_named() {
        let reference: Vec<u64> = (0..40).map(|k| 1_403_636_579 * S + 763_555_584 + k * S / 10).collect();
        let relative: Vec<u64> = (0..40).map(|k| k * S / 10).collect();
        let said = reason(&reference, &relative, S / 100, 0);
        assert!(said.contains("`--t-offset 1403636579.763555584` associates 40 poses"), "{said}");
        let zone: Vec<u64> = reference.iter().map(|stamp| stamp + 7200 * S).collect();
        let said = reason(&reference, &zone, S / 100, 0);
        assert!(said.contains("`--t-offset -7200` associates 40 poses"), "{said}");
        let rows: Vec<u64> = (0..40).map(|k| k * S).collect();
        assert!(
            reason(&reference, &rows, S / 100, 0).starts_with("the stamps of the estimate count its rows (0, 1, …)")
        );
        let between: Vec<u64> = reference.iter().map(|stamp| stamp + S / 20).collect();
        let said = reason(&reference, &between, S / 100, 0);
        assert!(said.starts_with("the nearest stamps are 0.050 s apart"), "{said}");
    }
}
