//! The inputs of a plan, opened without a run.

use std::collections::HashSet;

use seafix_component::Fault;

use crate::experiment::Plan;

/// Opens every source that the trials of `plan` refer to, once for each setting: data sets, recordings, problems, logs
/// and site files, with all their images.
///
/// Returns the faults and the warnings.
pub fn inputs(plan: &Plan) -> (Vec<Fault>, Vec<Fault>) {
    let (mut seen, mut faults, mut warnings) = (HashSet::new(), Vec::new(), Vec::new());
    for trial in &plan.trials {
        // Seeds draw other samples from the same files.
        if !seen.insert(format!("{:?}", trial.resolved.source)) {
            continue;
        }
        match trial.source.open(trial.resolved.seed, &plan.folder) {
            Ok(sequence) => warnings.extend(sequence.warnings().iter().cloned()),
            Err(more) => faults.extend(more),
        }
    }
    faults.dedup();
    warnings.dedup();
    (faults, warnings)
}
