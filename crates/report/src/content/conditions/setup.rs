//! Source, camera and baseline of a run.

use seafix_log::TrialHeader;

use crate::{format::distinct, run::Run};

/// The stereo baseline (m).
pub(crate) fn baseline(header: &TrialHeader) -> f64 {
    let t = header.rig.right_from_left.map(|row| row[3]);
    t[..3].iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A sentence on source, camera, baseline and number of frames.
pub(crate) fn sentence(run: &Run) -> String {
    let rig = &run.header().rig;
    let sources = distinct(run.trials.iter().map(|trial| trial.header.source.clone())).join("; ");
    let frames = distinct(run.trials.iter().map(|trial| trial.count().to_string())).join(" or ");
    format!(
        "Source: {sources}; {} × {} px, f = {:.0} px, baseline {:.2} m; {frames} frames per trial.",
        rig.left.size[0],
        rig.left.size[1],
        rig.left.matrix[0][0],
        baseline(run.header())
    )
}
