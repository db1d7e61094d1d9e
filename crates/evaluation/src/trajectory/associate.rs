//! Association of poses by time.

/// Pairs (reference, estimate) of poses by nearest stamp.
///
/// Each stamp of the shorter trajectory is associated with the nearest one of the longer, the first of equally near
/// ones, if it is within `tolerance_ns`. `offset_ns` is added to the estimate's stamps. Stamps must be in order. As in
/// evo, one pose of the longer trajectory may occur twice.
///
/// ```
/// use seafix_evaluation::trajectory::associate;
///
/// assert_eq!(associate(&[0, 10, 20, 30], &[11, 29], 2, 0), [(1, 0), (3, 1)]);
/// assert_eq!(associate(&[0, 10], &[105], 10, -100), [(0, 0)]);
/// ```
pub fn associate(reference: &[u64], estimate: &[u64], tolerance_ns: u64, offset_ns: i64) -> Vec<(usize, usize)> {
    let shifted: Vec<i128> = estimate.iter().map(|&stamp| i128::from(stamp) + i128::from(offset_ns)).collect();
    let reference: Vec<i128> = reference.iter().map(|&stamp| i128::from(stamp)).collect();
    let near = |stamps: &[i128], stamp: i128| -> Option<usize> {
        let after = stamps.partition_point(|&other| other < stamp);
        let around = after.saturating_sub(1)..stamps.len().min(after + 1);
        let nearest = around.min_by_key(|&i| stamps[i].abs_diff(stamp))?;
        (stamps[nearest].abs_diff(stamp) <= u128::from(tolerance_ns)).then_some(nearest)
    };
    if shifted.len() > reference.len() {
        reference.iter().enumerate().filter_map(|(i, &stamp)| Some((i, near(&shifted, stamp)?))).collect()
    } else {
        shifted.iter().enumerate().filter_map(|(j, &stamp)| Some((near(&reference, stamp)?, j))).collect()
    }
}
