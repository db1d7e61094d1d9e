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

/// The fault of two series of stamps that differ by a constant: two cameras without a common trigger.
///
/// Each left stamp is compared with the nearest right one. The difference is constant if its scatter is below a tenth of
/// the difference and of the time between frames, and if it is below half of that time; otherwise `None`.
pub fn constant_offset(left: &[u64], right: &[u64], file: &Path) -> Option<Fault> {
    /// The minimum number of pairs.
    const FEW: usize = 3;
    let nearest = |stamp: u64| {
        let after = right.partition_point(|other| *other < stamp);
        let around = &right[after.saturating_sub(1)..right.len().min(after + 1)];
        around.iter().map(|other| *other as f64 - stamp as f64).min_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    let mut offsets: Vec<f64> = left.iter().filter_map(|&stamp| nearest(stamp)).collect();
    let mut steps: Vec<f64> = left.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    if offsets.len() < FEW {
        return None;
    }
    offsets.sort_by(f64::total_cmp);
    steps.sort_by(f64::total_cmp);
    let (offset, step) = (offsets[offsets.len() / 2], steps[steps.len() / 2]);
    let limit = 0.1 * offset.abs().min(step);
    let near = offsets.iter().filter(|other| (**other - offset).abs() <= limit).count();
    if offset.abs() >= 0.5 * step || 10 * near < 9 * offsets.len() || near < FEW {
        return None;
    }
    let ms = offset.abs() * 1e-6;
    let side = if offset > 0.0 { "after" } else { "before" };
    let value = format!("the right image is {ms:.1} ms {side} the left one in {near} of {} pairs", left.len());
    // The tolerance covers the scatter too, rounded up to a tenth of a millisecond.
    let maximum = offsets
        .iter()
        .filter(|other| (**other - offset).abs() <= limit)
        .fold(0.0, |maximum: f64, o| maximum.max(o.abs()));
    let tolerance = (maximum * 1e-5).floor() * 1e-4 + 2e-4;
    let fault = Fault::new("cameras without a common trigger", file).value(value);
    Some(fault.remedy(format!(
        "`tolerance = {tolerance:.4}` (s) pairs them; a point then moves by {:.1} mm between the two images for every \
         metre per second of the vehicle",
        ms
    )))
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
        assert!(constant_offset(&left, &later(60_000_000), Path::new("a")).is_none());
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
