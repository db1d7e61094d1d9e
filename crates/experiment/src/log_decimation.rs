//! Decimation of logs: the choice of frames when all would be too many.

use seafix_log::{FrameRecord, Outcome, Totals};

/// A filter for logged frames: every k-th frame, and every failure within a budget. It also accumulates the totals of
/// all frames.
#[derive(Debug)]
pub(crate) struct Thinned {
    pub(crate) totals: Totals,
    failures: u64,
}

impl Thinned {
    /// Logs every frame whose index is a multiple of `every`, and at most `failures` others.
    pub(crate) fn new(every: u64, failures: u64) -> Self {
        Self { totals: Totals { every, ..Totals::default() }, failures }
    }

    /// Counts a frame and returns whether it is logged.
    pub(crate) fn keeps(&mut self, frame: &FrameRecord) -> bool {
        self.totals.add(frame);
        if frame.frame.is_multiple_of(self.totals.every) {
            return true;
        }
        if !failed(frame) {
            return false;
        }
        let room = self.failures > 0;
        if room {
            self.failures -= 1;
        } else {
            self.totals.failures_left_out += 1;
        }
        room
    }
}

/// Whether a target of a frame has no fix or a wrong one.
pub(crate) fn failed(frame: &FrameRecord) -> bool {
    let failed =
        |target: &seafix_log::TargetRecord| target.outcome != Outcome::Fix || target.evaluation.wrong == Some(true);
    frame.targets.iter().any(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_log::{Evaluation, TargetRecord};

    fn frame(number: u64, wrong: bool) -> FrameRecord {
        let mut target = TargetRecord::rejected("object", "search", "solver", "");
        target.outcome = Outcome::Fix;
        target.evaluation = Evaluation {
            wrong: Some(wrong),
            tre_rms: Some(2.0),
            position_error: Some(3.0),
            tre_crlb: Some(1.0),
            position_crlb: Some(1.0),
            nees: Some(6.0),
            ..Evaluation::default()
        };
        FrameRecord { frame: number, targets: vec![target], ..FrameRecord::default() }
    }

    #[test]
    fn few_frames_are_all_kept() {
        let mut thinned = Thinned::new(1, 0);
        assert!((0..5).all(|number| thinned.keeps(&frame(number, number == 3))));
        assert_eq!((thinned.totals.frames, thinned.totals.wrong, thinned.totals.every), (5, 1, 1));
    }

    #[test]
    fn of_many_every_kth_is_kept_and_failures_within_the_budget() {
        let mut thinned = Thinned::new(20, 5);
        // Kept are frames 0, 20, 40, 60, 80, and the first five wrong ones of the others.
        let kept: Vec<u64> = (0..100).filter(|&number| thinned.keeps(&frame(number, number % 10 == 1))).collect();
        assert_eq!(kept, [0, 1, 11, 20, 21, 31, 40, 41, 60, 80]);
        let totals = &thinned.totals;
        assert_eq!((totals.frames, totals.wrong, totals.found, totals.failures_left_out), (100, 10, 90, 5));
        assert_eq!((totals.judged, totals.tre_squares, totals.position_squares), (100, 400.0, 900.0));
        assert_eq!(
            (totals.bounded, totals.tre_crlb_squares, totals.nees_sum, totals.nees_within),
            (100, 100.0, 600.0, 100)
        );
    }
}
