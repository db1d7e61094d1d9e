//! Association and alignment of two trajectories.

use std::path::{Path, PathBuf};

use seafix_data::trajectory::{LoggedTrajectory, Trajectory};
use seafix_evaluation::trajectory::{Alignment, Pose, align, associate, interpolate};

use super::{Eval, SyncMethod, unassociated};
use crate::{
    exit::{Failure, INPUT, USAGE},
    terminal::notify,
};

/// The associated poses of two trajectories.
pub(super) struct Matched {
    pub(super) reference: Vec<Pose>,
    pub(super) estimate: Vec<Pose>,
    pub(super) stamps: Option<Vec<u64>>,
    /// The first index of every section without a break, from 0; motions between sections are unknown.
    pub(super) sections: Vec<usize>,
    /// The numbers of poses of the two files.
    pub(super) of: (usize, usize),
    /// The fraction of the reference's time between the first and the last matched pose.
    pub(super) covered: f64,
    /// A file whose poses have no attitude.
    pub(super) without_attitude: Option<PathBuf>,
}

impl Matched {
    /// The fraction of poses of the shorter trajectory with a partner.
    pub(super) fn fraction(&self) -> f64 {
        self.reference.len() as f64 / self.of.0.min(self.of.1).max(1) as f64
    }

    /// The distance of the last poses (m) of the trajectories with equal first poses; `None` after a break.
    pub(super) fn end(&self) -> Option<f64> {
        let trajectory = |poses: &[Pose]| poses[0].to(&poses[poses.len() - 1]).position;
        (self.sections.len() == 1).then(|| (trajectory(&self.reference) - trajectory(&self.estimate)).norm())
    }

    /// The sections without a break, as ranges of indices.
    pub(super) fn sections(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let ends = self.sections.iter().skip(1).copied().chain([self.reference.len()]);
        self.sections.iter().copied().zip(ends).map(|(from, to)| from..to)
    }
}

fn is_log(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "mcap")
}

fn read(file: &Path, trajectory: LoggedTrajectory, sort_stamps: bool) -> Result<Trajectory, Failure> {
    let read = match sort_stamps {
        _ if is_log(file) => Trajectory::of_log(file, trajectory),
        true => Trajectory::read_repaired(file),
        false => Trajectory::read(file),
    };
    read.map_err(|fault| Failure::new(INPUT, fault))
}

impl Eval {
    pub(super) fn matched(&self) -> Result<Matched, Failure> {
        let nanoseconds = |name: &str, seconds: f64| {
            let ns = seconds * 1e9;
            if !(ns.abs() < 9e18) {
                return Err(Failure::new(USAGE, format!("invalid {name} {seconds}; give seconds")));
            }
            Ok(ns.round() as i64)
        };
        let tolerance = u64::try_from(nanoseconds("--t-max-diff", self.t_max_diff)?).map_err(|_| {
            Failure::new(USAGE, format!("invalid --t-max-diff {}; give seconds of at least zero", self.t_max_diff))
        })?;
        let offset = nanoseconds("--t-offset", self.t_offset)?;
        if self.estimate.is_none() && !is_log(&self.reference) {
            return Err(Failure::new(USAGE, "no trajectory to evaluate; give ESTIMATE, or a log"));
        }
        let (mut reference, estimate) = (
            read(&self.reference, LoggedTrajectory::True, self.sort_stamps)?,
            read(self.estimate(), self.trajectory.into(), self.sort_stamps)?,
        );
        reference.warnings.iter().chain(&estimate.warnings).for_each(|warning| notify(&format!("warning: {warning}")));
        self.cut(&mut reference)?;
        let lacks = |trajectory: &Trajectory, file: &Path| (!trajectory.has_attitude).then(|| file.to_owned());
        let without_attitude = lacks(&reference, &self.reference).or(lacks(&estimate, self.estimate()));
        let of = (reference.poses.len(), estimate.poses.len());
        let input_error = |what: String| {
            let (a, b) = (self.reference.display(), self.estimate().display());
            Err(Failure::new(INPUT, format!("{what} in {a} and {b}")))
        };
        let (belong, stamps) = match (&reference.stamps, &estimate.stamps) {
            (Some(a), Some(b)) => {
                let belong = associate(a, b, tolerance, offset);
                let stamps = belong.iter().map(|&(_, j)| b[j]).collect();
                (belong, Some(stamps))
            }
            (a, b) if of.0 == of.1 => ((0..of.0).map(|i| (i, i)).collect(), a.clone().or_else(|| b.clone())),
            _ => {
                return input_error(format!(
                    "cannot associate {} and {} poses without stamps; give stamps, or equal numbers of poses,",
                    of.0, of.1
                ));
            }
        };
        let covered = match (&reference.stamps, belong.first(), belong.last()) {
            (Some(stamps), Some(first), Some(last)) if stamps.len() > 1 => {
                let span = |from: usize, to: usize| (stamps[to] - stamps[from]) as f64;
                span(first.0, last.0) / span(0, stamps.len() - 1)
            }
            _ => 1.0,
        };
        if belong.len() < 2 {
            let found = format!("only {} of {} and {} poses are associated", belong.len(), of.0, of.1);
            let (Some(a), Some(b)) = (&reference.stamps, &estimate.stamps) else { return input_error(found) };
            let (left, right) = (self.reference.display(), self.estimate().display());
            let why = unassociated::reason(a, b, tolerance, offset);
            return Err(Failure::new(INPUT, format!("{found} in {left} and {right}: {why}")));
        }
        let broken = |before: &(usize, usize), now: &(usize, usize)| {
            let between = |breaks: &[usize], from: usize, to: usize| breaks.iter().any(|&at| from < at && at <= to);
            between(&reference.breaks, before.0, now.0) || between(&estimate.breaks, before.1, now.1)
        };
        let broken = (1..belong.len()).filter(|&k| broken(&belong[k - 1], &belong[k]));
        let sections = std::iter::once(0).chain(broken).collect();
        let mut both: Vec<(Pose, Pose)> =
            belong.iter().map(|&(i, j)| (reference.poses[i], estimate.poses[j])).collect();
        if let (SyncMethod::Interpolation, Some(a), Some(b)) = (self.sync_method, &reference.stamps, &estimate.stamps) {
            // The trajectory with more poses is resampled at the stamps of the other.
            for ((i, j), pair) in belong.iter().zip(&mut both) {
                let (reference_ns, estimate_ns) = (i128::from(a[*i]), i128::from(b[*j]));
                match of.1 > of.0 {
                    true => pair.1 = interpolate(b, &estimate.poses, reference_ns - i128::from(offset)),
                    false => pair.0 = interpolate(a, &reference.poses, estimate_ns + i128::from(offset)),
                }
            }
        }
        let (reference, estimate) = both.into_iter().unzip();
        Ok(Matched { reference, estimate, stamps, sections, of, covered, without_attitude })
    }

    /// Removes the poses of the reference outside the evaluated time.
    fn cut(&self, reference: &mut Trajectory) -> Result<(), Failure> {
        if self.t_start.is_none() && self.t_end.is_none() {
            return Ok(());
        }
        let Some(stamps) = &reference.stamps else {
            return Err(Failure::new(USAGE, "--t-start and --t-end need a reference with stamps"));
        };
        let (start, end) = (self.t_start.unwrap_or(f64::NEG_INFINITY), self.t_end.unwrap_or(f64::INFINITY));
        let seconds = |stamp: &u64| *stamp as f64 * 1e-9;
        let from = stamps.partition_point(|stamp| seconds(stamp) < start);
        let to = stamps.partition_point(|stamp| seconds(stamp) <= end);
        if from >= to {
            let what = format!("no pose of {} between --t-start and --t-end", self.reference.display());
            return Err(Failure::new(
                INPUT,
                format!("{what}; it covers {} to {} s", seconds(&stamps[0]), seconds(&stamps[stamps.len() - 1])),
            ));
        }
        reference.stamps = Some(stamps[from..to].to_vec());
        reference.poses = reference.poses[from..to].to_vec();
        reference.breaks =
            reference.breaks.iter().filter(|at| (from + 1..to).contains(at)).map(|at| at - from).collect();
        Ok(())
    }

    pub(super) fn alignment(&self, matched: &Matched) -> Result<Option<Alignment>, Failure> {
        if self.align_origin {
            return Ok(Some(Alignment::onto(&matched.reference[0], &matched.estimate[0])));
        }
        if !self.align && !self.scale {
            return Ok(None);
        }
        let n = self.n_to_align.unwrap_or(usize::MAX).min(matched.reference.len());
        let found = align(&matched.reference[..n], &matched.estimate[..n], self.scale).map_err(|why| {
            let (a, b) = (self.reference.display(), self.estimate().display());
            Failure::new(INPUT, format!("cannot align {b} with {a}: {why}"))
        })?;
        Ok(Some(if self.align { found } else { Alignment { scale: found.scale, ..Alignment::IDENTITY } }))
    }
}
