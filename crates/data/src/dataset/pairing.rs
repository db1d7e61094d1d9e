//! Pairing of left and right images.

use std::path::Path;

use seafix_component::Fault;

/// The maximum difference of the stamps of a pair (ns).
pub const SAME_INSTANT_NS: u64 = 1_000_000;

/// The pairs (left, right) of indices whose stamps are within `tolerance` (ns) of each other, closest pairs first. Both
/// lists are in order of time.
pub fn pairs(left: &[u64], right: &[u64], tolerance: u64) -> Vec<(usize, usize)> {
    let (mut pairs, mut j) = (Vec::new(), 0);
    for (i, &stamp) in left.iter().enumerate() {
        while right.get(j + 1).is_some_and(|next| next.abs_diff(stamp) < right[j].abs_diff(stamp)) {
            j += 1;
        }
        let nearest_left =
            |other: u64| left.get(i + 1).is_none_or(|next| stamp.abs_diff(other) <= next.abs_diff(other));
        if right.get(j).is_some_and(|&other| other.abs_diff(stamp) <= tolerance && nearest_left(other)) {
            pairs.push((i, j));
            j += 1;
        }
    }
    pairs
}

/// The images without a partner: nothing, a warning, or a fault if they are more than half.
pub fn left_out(pairs: usize, [left, right]: [usize; 2], file: &Path) -> Result<Option<Fault>, Fault> {
    let all = left.max(right);
    let fault = Fault::new("images without a partner in the other camera", file)
        .value(format!("{pairs} pairs of {left} left and {right} right images"));
    match () {
        () if 2 * pairs < all => {
            Err(fault.remedy("at least half must be paired; check that these are the cameras of one rig"))
        }
        () if pairs < all => Ok(Some(fault.remedy("images of a pair have equal stamps; the others are skipped"))),
        () => Ok(None),
    }
}

/// The middle difference of the pairs' stamps (ns) to the nearest of the poses' stamps, in order of time, in words; `None`
/// without poses or pairs.
pub fn clock_offset(pairs: impl Iterator<Item = u64>, poses: impl Iterator<Item = u64>) -> Option<String> {
    let poses: Vec<u64> = poses.collect();
    let mut offsets: Vec<f64> = pairs.filter_map(|stamp| nearest(&poses, stamp)).collect();
    offsets.sort_by(f64::total_cmp);
    let middle = *offsets.get(offsets.len() / 2)? * 1e-9;
    let known = match middle.abs().round() as i64 {
        18 => " (GPS time is 18 s ahead of UTC)",
        19 => " (TAI is 19 s ahead of GPS time)",
        37 => " (TAI is 37 s ahead of UTC)",
        3600..86_400 if (middle.abs() / 900.0).fract() < 0.01 => " (a time zone?)",
        _ => "",
    };
    let side = if middle > 0.0 { "after" } else { "before" };
    Some(format!("the nearest pose is {:.3} s {side} its pair{known}", middle.abs()))
}

/// The difference (ns) of the nearest of `others`, in order of time, to `stamp`.
fn nearest(others: &[u64], stamp: u64) -> Option<f64> {
    let after = others.partition_point(|other| *other < stamp);
    let around = &others[after.saturating_sub(1)..others.len().min(after + 1)];
    around.iter().map(|other| *other as f64 - stamp as f64).min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// The fault of two series of stamps that differ by a constant: two cameras without a common trigger, or two clocks.
///
/// Each left stamp is compared with the nearest right one. The difference is constant if its scatter is below a quarter
/// of the time between frames, so that the nearest is the partner, and if it is below half of that time. Otherwise the
/// stamps are compared in order: clocks that differ by more than a frame.
pub fn constant_offset(left: &[u64], right: &[u64], file: &Path) -> Option<Fault> {
    let mut steps: Vec<f64> = left.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    steps.sort_by(f64::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    let close = Offset::of(left.iter().filter_map(|&stamp| nearest(right, stamp)).collect(), 0.25 * step);
    if let Some(found) = close.filter(|found| found.middle.abs() < 0.5 * step) {
        return Some(found.without_trigger(left.len(), file));
    }
    // As many images, at the same distances of time: the clocks differ, not the cameras.
    let (few, in_order) = (left.len().abs_diff(right.len()), left.iter().zip(right));
    let apart = Offset::of(in_order.map(|(left, right)| *right as f64 - *left as f64).collect(), 0.25 * step);
    apart.filter(|found| few == 0 && found.middle.abs() >= step).map(|found| found.of_clocks(file))
}

/// The differences of stamps (ns), right minus left, that nearly all pairs have in common.
struct Offset {
    middle: f64,
    minimum: f64,
    maximum: f64,
    /// The number of pairs with it.
    pairs: usize,
}

impl Offset {
    /// The common difference of at least three and of nine tenths of all, within `scatter` (ns) of their median.
    fn of(mut all: Vec<f64>, scatter: f64) -> Option<Self> {
        const FEW: usize = 3;
        all.sort_by(f64::total_cmp);
        let middle = *all.get(all.len() / 2)?;
        let near: Vec<f64> = all.iter().copied().filter(|other| (other - middle).abs() <= scatter).collect();
        let sure = near.len() >= FEW && 10 * near.len() >= 9 * all.len();
        sure.then(|| Self { middle, minimum: near[0], maximum: near[near.len() - 1], pairs: near.len() })
    }

    fn without_trigger(&self, all: usize, file: &Path) -> Fault {
        /// A scatter (ns) below this is that of printed digits.
        const SAME: f64 = 5e4;
        let side = if self.middle > 0.0 { "after" } else { "before" };
        let (ms, [low, high]) = (self.middle.abs() * 1e-6, [self.minimum.abs(), self.maximum.abs()]);
        let (low, high) = (low.min(high), low.max(high));
        let value = if self.maximum - self.minimum < SAME {
            format!("the right image is {ms:.1} ms {side} the left one in {} of {all} pairs", self.pairs)
        } else {
            let (low, high) = (low * 1e-6, high * 1e-6);
            format!(
                "the right image is {ms:.1} ms {side} the left one in the median of {} of {all} pairs ({low:.1} to \
                 {high:.1} ms)",
                self.pairs
            )
        };
        // The tolerance covers the scatter too, rounded up to a tenth of a millisecond.
        let tolerance = (high * 1e-5).floor() * 1e-4 + 2e-4;
        Fault::new("cameras without a common trigger", file).value(value).remedy(format!(
            "`tolerance = {tolerance:.4}` (s) pairs them; a point then moves by {ms:.1} mm between the two images for \
             every metre per second of the vehicle"
        ))
    }

    fn of_clocks(&self, file: &Path) -> Fault {
        let side = if self.middle > 0.0 { "after" } else { "before" };
        let value = format!("the right stamps are {:.3} s {side} the left ones in all pairs", self.middle.abs() * 1e-9);
        Fault::new("cameras with different clocks", file).value(value).remedy(
            "correct the stamps of one camera by that time, or let one clock stamp both; a tolerance of that size would \
             pair any images",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_has_its_nearest_partner_or_none() {
        assert_eq!(pairs(&[0, 10, 20], &[0, 10, 20], 1), [(0, 0), (1, 1), (2, 2)]);
        assert_eq!(pairs(&[0, 10, 20, 30], &[9, 31], 2), [(1, 0), (3, 1)]);
        assert_eq!(pairs(&[0, 10, 20], &[15, 16, 17], 2), []);
        // The closer of two left images takes a right image.
        assert_eq!(pairs(&[8, 10], &[10], 5), [(1, 0)]);
        assert_eq!(pairs(&[10, 12], &[10], 5), [(0, 0)]);
        assert_eq!(pairs(&[], &[1], 5), []);
    }

    #[test]
    fn a_constant_offset_is_measured() {
        let left: Vec<u64> = (0..6).map(|k| 1_700_000_000_000_000_000 + k * 100_000_000).collect();
        let later = |shift: u64| left.iter().map(|stamp| stamp + shift).collect::<Vec<u64>>();
        let said = constant_offset(&left, &later(4_000_000), Path::new("a")).unwrap().to_string();
        assert!(said.contains("4.0 ms after the left one in 6 of 6") && said.contains("tolerance = 0.0042"), "{said}");
        let said = constant_offset(&later(7_000_000), &left, Path::new("a")).unwrap().to_string();
        assert!(said.contains("7.0 ms before"), "{said}");
        // More than half a frame: the partner may be the next image.
        assert!(constant_offset(&left, &later(60_000_000), Path::new("a")).is_none());
        // Two computers: the stamps differ by an hour.
        let said = constant_offset(&left, &later(3_600_000_000_000), Path::new("a")).unwrap().to_string();
        assert!(
            said.starts_with("cameras with different clocks in a: the right stamps are 3600.000 s after"),
            "{said}"
        );
        // A trigger by software scatters; the tolerance covers the latest image.
        let scattered: Vec<u64> =
            left.iter().enumerate().map(|(k, stamp)| stamp + 3_000_000 + 700_000 * (k as u64 % 3)).collect();
        let said = constant_offset(&left, &scattered, Path::new("a")).unwrap().to_string();
        assert!(said.contains("(3.0 to 4.4 ms)") && said.contains("tolerance = 0.0046"), "{said}");
        let mixed: Vec<u64> = left.iter().enumerate().map(|(k, stamp)| stamp + 9_000_000 * k as u64).collect();
        assert!(constant_offset(&left, &mixed, Path::new("a")).is_none());
    }

    #[test]
    fn half_must_be_paired() {
        let file = Path::new("cam0");
        assert_eq!(left_out(4, [4, 4], file), Ok(None));
        assert!(left_out(3, [4, 4], file).unwrap().is_some() && left_out(1, [4, 1], file).is_err());
    }
}
