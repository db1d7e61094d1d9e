//! What a run would take, by a few of its frames.

use std::time::{Duration, Instant};

use super::{RunError, cut, group};
use crate::Plan;

/// What a run would take.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Frames of each trial, in the order of the plan's trials.
    pub frames: Vec<usize>,
    /// About so many bytes of log; while they are joined, twice as many lie on the disk.
    pub bytes: u64,
    /// About so long for one thread.
    pub work: Duration,
    /// So many frames of each source were tried.
    pub tried: usize,
}

/// Frames of each source that are tried.
const TRIED: usize = 3;

/// What `plan` would take: leads a few frames of every source through its trials and writes nothing.
///
/// # Errors
/// Everything that is wrong with the inputs.
pub fn estimate(plan: &Plan) -> Result<Estimate, RunError> {
    let groups = group::open(plan)?;
    let pieces = cut::cut(plan, &groups);
    let input = |fault| RunError::Input(vec![fault]);
    let mut work = Duration::ZERO;
    for group in &groups {
        let (count, mut voyages) = (group.passage.frames(), group.voyages());
        let first = Instant::now();
        let tried = TRIED.min(count);
        for k in 0..tried {
            // The first frames where one follows from the other, else some over the whole way.
            let index = if group.navigates() { k } else { k * (count - 1) / (tried - 1).max(1) };
            let looked = group.look(index.min(count - 1), &mut voyages).map_err(input)?;
            group.record(index.min(count - 1), looked, &[], |_, _| true);
        }
        work += first.elapsed().mul_f64(count as f64 / tried.max(1) as f64);
    }
    let frames = plan.trials.iter().map(|trial| {
        let own = groups.iter().find(|group| group.trials.iter().any(|other| std::ptr::eq(*other, trial)));
        own.map_or(0, |group| group.passage.frames())
    });
    let bytes = cut::bytes(&groups, &pieces.iter().collect::<Vec<_>>());
    Ok(Estimate { frames: frames.collect(), bytes, work, tried: TRIED })
}
