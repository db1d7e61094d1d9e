//! Partition of a run into pieces, determined by the plan alone.

use crate::{log_decimation::Thinned, run::group::Group};

/// A sequence of successive frames of one source, processed by every trial that shares the source. It is the unit of
/// work of a thread, of loss after an interruption, and of shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    /// The index in the run.
    pub(super) number: usize,
    /// The index of the source's group of trials.
    pub(super) group: usize,
    /// The first frame.
    pub(super) first: usize,
    /// The frame after the last.
    pub(super) end: usize,
    /// The decimation factor k: frames whose index is a multiple of k are always logged.
    every: u64,
    /// The number of failures that are logged in addition.
    failures: u64,
}

impl Piece {
    /// The number of frames of each trial.
    pub(super) fn frames(&self) -> usize {
        self.end - self.first
    }

    /// The same piece with at most its first `frames` frames, at least one.
    pub(super) fn shortened(&self, frames: usize) -> Self {
        Self { end: self.end.min(self.first + frames.max(1)), ..*self }
    }

    /// The filter for its logged frames.
    pub(super) fn thinned(&self) -> Thinned {
        Thinned::new(self.every, self.failures)
    }

    /// The number of logged frames of each trial if the fraction `failing` fails.
    pub(super) fn expected(&self, failing: f64) -> f64 {
        let regular = (self.end as u64).div_ceil(self.every) - (self.first as u64).div_ceil(self.every);
        let others = self.frames() as f64 - regular as f64;
        regular as f64 + (others * failing).min(self.failures as f64)
    }

    /// The maximum number of logged frames of each trial.
    fn logged(&self) -> u64 {
        let regular = (self.end as u64).div_ceil(self.every) - (self.first as u64).div_ceil(self.every);
        (regular + self.failures).min(self.frames() as u64)
    }
}

/// The limit of all logs without images together (bytes).
const MAX_LOG: u64 = 900_000_000;

/// The pieces of a run, source by source.
pub(super) fn cut(groups: &[Group<'_>]) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    let points = groups.iter().filter(|group| !group.sequence.images());
    let max =
        level(points.map(|group| (group.sequence.frames() as u64 * group.frame_bytes, group.trials.len() as u64)));
    for (place, group) in groups.iter().enumerate() {
        let frames = group.sequence.frames();
        let size = size(group, groups.len());
        let count = frames.div_ceil(size).max(1);
        let (every, failures) = match group.sequence.images() {
            true => (1, 0),
            false => thinning(frames as u64, group.frame_bytes, max),
        };
        for k in 0..count {
            // The budget of logged failures is divided evenly, so that pieces are independent of each other.
            let fraction = |k: usize| failures * k as u64 / count as u64;
            let (first, end) = ((k * size).min(frames), ((k + 1) * size).min(frames));
            let failures = fraction(k + 1) - fraction(k);
            pieces.push(Piece { number: pieces.len(), group: place, first, end, every, failures });
        }
    }
    pieces
}

/// The maximum size (bytes) of a trial's log for which all logs together stay below [`MAX_LOG`]; large logs use the
/// space that small ones leave. For each group, `groups` has the size of a trial's complete log and the number of
/// trials.
fn level(groups: impl Iterator<Item = (u64, u64)>) -> u64 {
    let mut groups: Vec<(u64, u64)> = groups.collect();
    groups.sort_unstable();
    let (mut left, mut trials) = (MAX_LOG, groups.iter().map(|(_, trials)| trials).sum::<u64>());
    for (bytes, own) in groups {
        if bytes > left / trials.max(1) {
            return left / trials;
        }
        left -= bytes * own;
        trials -= own;
    }
    u64::MAX
}

/// The number of frames of a piece of `group`, one of `groups`. It is small enough for some dozen pieces, which keep
/// all threads busy and whose rows fit into memory. It is large enough to make the header of every file and the window
/// of joint fixes negligible.
fn size(group: &Group<'_>, groups: usize) -> usize {
    /// The maximum number of rows over all trials.
    const ROWS: usize = 32_768;
    let frames = group.sequence.frames();
    if group.navigates() {
        // A navigation session carries its state from frame to frame, so that its source is one piece.
        return frames.max(1);
    }
    let (min, max) = if group.sequence.images() { (1, 8) } else { (16, 8192) };
    let size = (frames / pieces(groups)).clamp(min, max).min(ROWS / group.trials.len().min(ROWS)).max(1);
    size.max(4 * group.window_length())
}

/// The maximum number of pieces of each group: 64, or fewer if all groups together have more than 256.
fn pieces(groups: usize) -> usize {
    (256 / groups.max(1)).clamp(2, 64)
}

/// The decimation of a log to at most `max` bytes. A log of `frames` frames with about `bytes` each keeps all frames,
/// or every k-th in one half and failures in the other.
fn thinning(frames: u64, bytes: u64, max: u64) -> (u64, u64) {
    let fit = (max / bytes.max(1)).max(2);
    if frames <= fit { (1, 0) } else { (frames.div_ceil(fit / 2), fit / 2) }
}

/// The approximate size (bytes) of the logs of these pieces.
pub(super) fn bytes(groups: &[Group<'_>], pieces: &[&Piece]) -> u64 {
    let of = |piece: &&Piece| {
        let group = &groups[piece.group];
        piece.logged() * group.frame_bytes * group.trials.len() as u64
    };
    pieces.iter().map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_groups_are_cut_into_fewer_pieces_each() {
        assert_eq!([1, 4, 12, 72, 500].map(pieces), [64, 64, 21, 3, 2]);
    }

    #[test]
    fn large_logs_take_what_small_ones_leave() {
        assert_eq!(level([(400_000_000, 2), (30_000_000, 3)].into_iter()), u64::MAX);
        assert_eq!(level([(500_000_000, 2), (100_000_000, 1)].into_iter()), 400_000_000);
        assert_eq!(level([(u64::MAX / 4, 3)].into_iter()), 300_000_000);
        assert_eq!(level(std::iter::empty()), u64::MAX);
    }

    #[test]
    fn few_frames_are_all_logged_and_many_within_the_budget() {
        assert_eq!(thinning(5, 100, 1000), (1, 0));
        assert_eq!(thinning(100, 100, 1000), (20, 5));
        let piece = |first, end, failures| Piece { number: 0, group: 0, first, end, every: 20, failures };
        // Frames 0, 20, 40, 60, 80, and five failures.
        assert_eq!(
            (piece(0, 100, 5).expected(0.0), piece(0, 100, 5).expected(0.02), piece(0, 100, 5).expected(1.0)),
            (5.0, 6.9, 10.0)
        );
        assert_eq!((piece(0, 100, 5).logged(), piece(1, 20, 3).logged(), piece(41, 45, 9).logged()), (10, 3, 4));
    }
}
