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
    fn half_must_be_paired() {
        let file = Path::new("cam0");
        assert_eq!(left_out(4, [4, 4], file), Ok(None));
        assert!(left_out(3, [4, 4], file).unwrap().is_some() && left_out(1, [4, 1], file).is_err());
    }
}
