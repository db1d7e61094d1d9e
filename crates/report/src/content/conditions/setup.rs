//! The stereo baseline of a run.

use seafix_log::TrialHeader;

/// The stereo baseline (m).
pub(crate) fn baseline(header: &TrialHeader) -> f64 {
    let t = header.rig.right_from_left.map(|row| row[3]);
    t[..3].iter().map(|x| x * x).sum::<f64>().sqrt()
}
