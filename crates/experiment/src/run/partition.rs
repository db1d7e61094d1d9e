//! How a run is cut into pieces: by the plan alone.

use super::group::Group;
use crate::log_decimation::Thinned;

/// Some successive frames of one source, led through every trial that shares it: what one thread makes at a time, what a
/// kill costs at most, and what shards are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    /// Its place in the run.
    pub(super) number: usize,
    /// The place of its source's group of trials.
    pub(super) group: usize,
    /// Its first frame.
    pub(super) first: usize,
    /// The frame behind its last.
    pub(super) end: usize,
    /// Of so many frames one is logged, whatever came of it.
    every: u64,
    /// So many failures are logged besides.
    failures: u64,
}

impl Piece {
    /// How many frames, for each trial.
    pub(super) fn frames(&self) -> usize {
        self.end - self.first
    }

    /// The same with at most its first `frames` frames, one at least.
    pub(super) fn shortened(&self, frames: usize) -> Self {
        Self { end: self.end.min(self.first + frames.max(1)), ..*self }
    }

    /// Which of its frames are logged.
    pub(super) fn thinned(&self) -> Thinned {
        Thinned::new(self.every, self.failures)
    }

    /// How many frames are logged of each trial where this share of them fails.
    pub(super) fn expected(&self, failing: f64) -> f64 {
        let regular = (self.end as u64).div_ceil(self.every) - (self.first as u64).div_ceil(self.every);
        let others = self.frames() as f64 - regular as f64;
        regular as f64 + (others * failing).min(self.failures as f64)
    }

    /// How many frames at most are logged of each trial.
    fn logged(&self) -> u64 {
        let regular = (self.end as u64).div_ceil(self.every) - (self.first as u64).div_ceil(self.every);
        (regular + self.failures).min(self.frames() as u64)
    }
}

/// All logs of point-level trials together stay below this (bytes).
const MAX_LOG: u64 = 900_000_000;

/// The pieces of a run, source after source.
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
            // The failures that may be logged are dealt out evenly, so that pieces know nothing of each other.
            let fraction = |k: usize| failures * k as u64 / count as u64;
            let (first, end) = ((k * size).min(frames), ((k + 1) * size).min(frames));
            let failures = fraction(k + 1) - fraction(k);
            pieces.push(Piece { number: pieces.len(), group: place, first, end, every, failures });
        }
    }
    pieces
}

/// The most (bytes) that a trial's log may have, so that all together stay below [`MAX_LOG`]: what small ones leave, large ones
/// take. Of each group what a whole log of one of its trials would have, and how many trials there are.
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

/// How many frames a piece of `group`, one of `groups`, has: few enough that some dozen pieces keep all threads busy and
/// that their rows fit into memory, many enough that their files, each of which begins with all that is the same for its
/// trial, are no burden, and that what joint fixes look back on is little beside.
fn size(group: &Group<'_>, groups: usize) -> usize {
    /// The most rows, over all trials.
    const ROWS: usize = 32_768;
    let frames = group.sequence.frames();
    if group.navigates() {
        // What is known after a frame is carried to the next: one piece.
        return frames.max(1);
    }
    let (min, max) = if group.sequence.images() { (1, 8) } else { (16, 8192) };
    let size = (frames / pieces(groups)).clamp(min, max).min(ROWS / group.trials.len().min(ROWS)).max(1);
    size.max(4 * group.window_length())
}

/// Into how many pieces each of so many groups is cut at most: 64, or so many that all groups together have 256.
fn pieces(groups: usize) -> usize {
    (256 / groups.max(1)).clamp(2, 64)
}

/// Of `frames` frames of about `bytes` each, what a log of at most `max` bytes holds: all, or every k-th in half of it
/// and failures in the other half.
fn thinning(frames: u64, bytes: u64, max: u64) -> (u64, u64) {
    let fit = (max / bytes.max(1)).max(2);
    if frames <= fit { (1, 0) } else { (frames.div_ceil(fit / 2), fit / 2) }
}

/// About how much log (bytes) some pieces write.
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
