//! What all frames of a trial add up to, logged or not.

use std::collections::BTreeMap;

use super::{frame::FrameRecord, region::Region, target::Outcome};

/// Sums over every frame of a trial, of which the log may hold a part.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Totals {
    /// The decimation k: every frame whose number is a multiple of k is logged.
    pub every: u64,
    /// Frames with a failure that were not logged, because there are too many.
    pub failures_left_out: u64,
    /// Frames.
    pub frames: u64,
    /// Frames with a fix of at least one target.
    pub fix_frames: u64,
    /// Frames with a wrong fix of at least one target.
    pub wrong_frames: u64,
    /// Attempts.
    pub attempted: u64,
    /// Fixes that are not known to be wrong.
    pub found: u64,
    /// Fixes beyond the alert limit.
    pub wrong: u64,
    /// Fixes that no truth could judge.
    pub unjudged: u64,
    /// The reasons of attempts without a fix, and their numbers.
    pub reasons: BTreeMap<String, u64>,
    /// Fixes that truth could judge, wrong ones included.
    pub judged: u64,
    /// The sum of the squared TRE over them (m²).
    pub tre_squares: f64,
    /// Sum of the squared errors of the position (m²).
    pub position_squares: f64,
    /// Those of them that have a bound.
    pub bounded: u64,
    /// The sum of the squared bounds of the TRE over those (m²).
    pub tre_crlb_squares: f64,
    /// Sum of the squared bounds on the position (m²).
    pub position_crlb_squares: f64,
    /// Sum of the normalised errors squared.
    pub nees_sum: f64,
    /// The number of fixes in that sum.
    pub nees_count: u64,
    /// The number of these fixes with a NEES below the 95 % quantile of χ²₆.
    pub nees_within: u64,
    /// Fixes whose error, protection level and alert limit are known, by their region in the order of [`Region::ALL`]; `None`
    /// in logs that are older than these.
    pub regions: Option<[u64; Region::ALL.len()]>,
}

/// χ²₆ at 95 %.
const NINETY_FIVE: f64 = 12.591_587_243_743_977;

impl Totals {
    /// Adds a frame.
    pub fn add(&mut self, frame: &FrameRecord) {
        let fixes = || frame.targets.iter().filter(|target| target.outcome == Outcome::Fix);
        self.frames += 1;
        self.fix_frames += u64::from(fixes().next().is_some());
        self.wrong_frames += u64::from(fixes().any(|fix| fix.evaluation.wrong == Some(true)));
        for target in frame.targets.iter().filter(|target| target.attempted()) {
            self.attempted += 1;
            if target.evaluation.alert_limit.is_some() {
                self.regions.get_or_insert_default();
            }
            if target.outcome != Outcome::Fix {
                let reason = if target.reason.is_empty() { target.outcome.name() } else { &target.reason };
                *self.reasons.entry(reason.to_owned()).or_default() += 1;
                continue;
            }
            if let Some(region) = target.region() {
                self.regions.get_or_insert_default()[region as usize] += 1;
            }
            let fix = &target.evaluation;
            match fix.wrong {
                Some(true) => self.wrong += 1,
                known => {
                    self.found += 1;
                    self.unjudged += u64::from(known.is_none());
                }
            }
            if let (Some(tre), Some(position)) = (fix.tre_rms, fix.position_error) {
                self.judged += 1;
                self.tre_squares += tre * tre;
                self.position_squares += position * position;
                if let (Some(tre), Some(position)) = (fix.tre_crlb, fix.position_crlb) {
                    self.bounded += 1;
                    self.tre_crlb_squares += tre * tre;
                    self.position_crlb_squares += position * position;
                }
            }
            if let Some(nees) = fix.nees {
                self.nees_sum += nees;
                self.nees_count += 1;
                self.nees_within += u64::from(nees <= NINETY_FIVE);
            }
        }
    }

    /// Adds what other frames of the same trial add up to.
    pub fn merge(&mut self, other: &Self) {
        self.every = other.every;
        self.failures_left_out += other.failures_left_out;
        self.frames += other.frames;
        self.fix_frames += other.fix_frames;
        self.wrong_frames += other.wrong_frames;
        self.attempted += other.attempted;
        self.found += other.found;
        self.wrong += other.wrong;
        self.unjudged += other.unjudged;
        for (reason, count) in &other.reasons {
            *self.reasons.entry(reason.clone()).or_default() += count;
        }
        self.judged += other.judged;
        self.tre_squares += other.tre_squares;
        self.position_squares += other.position_squares;
        self.bounded += other.bounded;
        self.tre_crlb_squares += other.tre_crlb_squares;
        self.position_crlb_squares += other.position_crlb_squares;
        self.nees_sum += other.nees_sum;
        self.nees_count += other.nees_count;
        self.nees_within += other.nees_within;
        for (sum, count) in self.regions.iter_mut().zip(&other.regions).flat_map(|(sum, own)| sum.iter_mut().zip(own)) {
            *sum += count;
        }
        self.regions = self.regions.or(other.regions);
    }

    /// Attempts that gave no fix.
    pub fn rejected(&self) -> u64 {
        self.reasons.values().sum()
    }
}
