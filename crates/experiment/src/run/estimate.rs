//! Estimates of a run's time and space from a sample of its frames.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use seafix_component::Fault;
use seafix_log::Writer;

use crate::{
    experiment::Plan,
    results::Table,
    run::{group, outcome::RunError, partition},
};

/// The estimated time and space of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunEstimate {
    /// The number of frames of each trial, in the order of the plan's trials.
    pub frames: Vec<usize>,
    /// The approximate size of logs and results (bytes); twice as much is needed while they are joined.
    pub bytes: u64,
    /// The approximate time of one thread, writing included.
    pub work: Duration,
    /// The lower limit of the time for any number of threads: the longest piece.
    pub longest: Duration,
    /// The number of sampled frames over all sources.
    pub tried: usize,
    /// The time for the sampled frames.
    pub spent: Duration,
}

impl RunEstimate {
    /// The approximate time with this number of threads.
    pub fn on(&self, threads: usize) -> Duration {
        self.work.div_f64(threads.max(1) as f64).max(self.longest)
    }
}

/// The minimum number of sampled frames of each source; the first one is slow.
const MIN: usize = 4;
/// The maximum time of all samples together, divided evenly among the sources.
const LONGEST: Duration = Duration::from_secs(20);

/// Estimates `plan` from a sample of every source's frames. Logs are written to the system's temporary folder and
/// removed. Trials share stages unless they are measured `separate`ly.
///
/// # Errors
/// All faults of the inputs, and a temporary folder that cannot be written.
pub fn estimate(plan: &Plan, separate: bool) -> Result<RunEstimate, RunError> {
    let groups = group::open(plan, separate)?;
    let pieces = partition::cut(&groups);
    let input = |fault: Fault| RunError::Input(vec![fault]);
    let place = Scratch::new()?;
    let mut estimate = RunEstimate {
        frames: Vec::new(),
        bytes: 0,
        work: Duration::ZERO,
        longest: Duration::ZERO,
        tried: 0,
        spent: Duration::ZERO,
    };
    for (number, group) in groups.iter().enumerate() {
        let (count, mut sessions) = (group.sequence.frames(), group.sessions());
        let mut writers = Vec::new();
        for (trial, header) in group.headers.iter().enumerate() {
            writers.push(Writer::create(&place.0.join(format!("{trial}.mcap")), header)?);
        }
        let mut table = Table::default();
        let budget = LONGEST.div_f64(groups.len() as f64);
        let (begun, mut warm) = (Instant::now(), Vec::new());
        let (mut tried, mut failures) = (0, 0);
        while tried < count && (tried < MIN || begun.elapsed() < budget) {
            let first = Instant::now();
            let index = place_of(tried, count, group.navigates());
            let group_frame = group.observe(index, &mut sessions).map_err(input)?;
            let (records, levels) = group.record(index, group_frame, &[], |_, _| true);
            for (which, (record, writer)) in records.iter().zip(&mut writers).enumerate() {
                // Sampled frames are out of order, but stamps in logs must not decrease.
                let record = seafix_log::FrameRecord { stamp_ns: tried as u64, ..record.clone() };
                failures += usize::from(crate::log_decimation::failed(&record));
                let trial = group.trials[which];
                writer.frame_with(&record, levels.pngs(trial.resolved.log.images))?;
                table.add(&trial.name, &record);
            }
            tried += 1;
            warm.push(first.elapsed());
        }
        drop(sessions);
        let closing = Instant::now();
        for writer in writers {
            writer.finish()?;
        }
        let written = place.bytes();
        let empty = place.empty(group)?;
        // The additional cost of the first frame, such as the allocation of memory, occurs once.
        let all: Duration = warm.iter().sum();
        let cold = if tried > 1 { warm[0] } else { Duration::ZERO };
        let a_frame = (all - cold).div_f64((tried - usize::from(tried > 1)).max(1) as f64)
            + closing.elapsed().div_f64(tried.max(1) as f64);
        let trials = group.trials.len() as f64;
        let fraction = failures as f64 / (tried as f64 * trials).max(1.0);
        let logged: f64 =
            pieces.iter().filter(|piece| piece.group == number).map(|piece| piece.expected(fraction)).sum();
        let frame_bytes = written.saturating_sub(empty) as f64 / tried.max(1) as f64;
        // A Parquet file has the same rows in a third of the size.
        let rows = table.text.len() as f64 * 4.0 / 3.0 / tried.max(1) as f64;
        estimate.bytes += (empty as f64 + frame_bytes * logged + rows * count as f64) as u64;
        estimate.work += cold + a_frame.mul_f64(count as f64);
        let longest =
            pieces.iter().filter(|piece| piece.group == number).map(partition::Piece::frames).max().unwrap_or(0);
        estimate.longest = estimate.longest.max(a_frame.mul_f64(longest as f64));
        estimate.tried += tried;
        estimate.spent += begun.elapsed();
    }
    estimate.frames = plan
        .trials
        .iter()
        .map(|trial| {
            let own = groups.iter().find(|group| group.trials.iter().any(|other| std::ptr::eq(*other, trial)));
            own.map_or(0, |group| group.sequence.frames())
        })
        .collect();
    Ok(estimate)
}

/// The index of the k-th sampled frame: the next one for a navigated sequence, otherwise spread over all.
fn place_of(k: usize, count: usize, navigates: bool) -> usize {
    if navigates {
        return k;
    }
    // A step without a common divisor visits every index once.
    let step = (1..).map(|n| (count * 618 / 1000).max(1) + n - 1).find(|step| divisor(*step, count) == 1).unwrap_or(1);
    (k * step) % count
}

fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

/// A temporary folder, removed when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self, RunError> {
        // The name is tried until it is new: an existing folder belongs to someone else.
        for number in 0..1000 {
            let folder = std::env::temp_dir().join(format!("seafix-{}-{number}", std::process::id()));
            match fs::create_dir(&folder) {
                Ok(()) => return Ok(Self(folder)),
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(RunError::unwritable(&folder, error)),
            }
        }
        Err(RunError::unwritable(&std::env::temp_dir(), "no free name for a temporary folder"))
    }

    /// The size of the logs in it (bytes).
    fn bytes(&self) -> u64 {
        let files = fs::read_dir(&self.0).into_iter().flatten().flatten();
        files.filter_map(|file| Some(file.metadata().ok()?.len())).sum()
    }

    /// The size of the logs of a group without frames (bytes).
    fn empty(&self, group: &group::Group<'_>) -> Result<u64, RunError> {
        for (trial, header) in group.headers.iter().enumerate() {
            Writer::create(&self.0.join(format!("{trial}.mcap")), header)?.finish()?;
        }
        let bytes = self.bytes();
        for trial in 0..group.headers.len() {
            let _ = fs::remove_file(self.0.join(format!("{trial}.mcap")));
        }
        Ok(bytes)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_is_tried_once() {
        for count in [1, 2, 3, 7, 20, 100, 1000] {
            let mut seen: Vec<usize> = (0..count).map(|k| place_of(k, count, false)).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
        }
        assert_eq!([0, 1, 2].map(|k| place_of(k, 3, true)), [0, 1, 2]);
    }
}
