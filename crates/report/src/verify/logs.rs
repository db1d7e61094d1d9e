//! The logs of a run for verification, each read once.

use std::{
    cell::RefCell,
    collections::HashMap,
    path::{Path, PathBuf},
    rc::Rc,
};

use seafix_log::{
    FrameTimes, NavigationRecord, Outcome, PointOfInterest, Reader, TargetRecord, Totals, TrialHeader, TruthRecord,
};

use crate::{
    disparity,
    error::ReportError,
    fix_intervals::{self, Step},
    lever,
    paired::Statistics,
    place,
};

/// The logs of a run that have been read.
pub(super) struct Logs {
    folder: PathBuf,
    read: HashMap<String, Log>,
}

/// A log without clouds, candidates and images.
pub(super) struct Log {
    pub(super) header: TrialHeader,
    pub(super) frames: Vec<Seen>,
    pub(super) totals: Option<Totals>,
    /// The sum of the squared disparity errors (px²), and their number.
    pub(super) disparity: (f64, usize),
    /// The comparisons that begin with this log, cached because a table prints many numbers of each.
    pub(super) compared: RefCell<HashMap<String, Rc<(usize, Statistics)>>>,
}

/// A frame of a log.
pub(super) struct Seen {
    pub(super) number: u64,
    pub(super) stamp_ns: u64,
    pub(super) times: FrameTimes,
    pub(super) truth: Option<[f64; 3]>,
    pub(super) navigation: Option<Box<NavigationRecord>>,
    /// The camera positions in the world (m), navigated and by odometry only from the first fix.
    pub(super) carried: [[f64; 3]; 2],
    /// The pose error for fix intervals.
    pub(super) step: Option<Step>,
    pub(super) poi: Vec<PointOfInterest>,
    /// The counts of key points, cloud points, candidates, identified points, used points.
    pub(super) marks: [usize; 5],
    pub(super) rows: Vec<Row>,
}

/// An attempt.
pub(super) struct Row {
    pub(super) record: TargetRecord,
    /// The number of candidates of all model points together.
    pub(super) candidates: usize,
    /// The camera position in the world by the fix (m).
    pub(super) at: [f64; 3],
    /// The error at each lever arm (m); NaN where unknown.
    pub(super) arms: [f64; 3],
}

impl Logs {
    pub(super) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), read: HashMap::new() }
    }

    /// The log of this name, read if necessary; `None` if the folder has no such file.
    pub(super) fn get(&mut self, name: &str) -> Result<Option<&Log>, ReportError> {
        if !self.read.contains_key(name) {
            // A key may name files of this folder only.
            if name.contains(['/', '\\']) || !self.folder.join(name).is_file() {
                return Ok(None);
            }
            self.read.insert(name.to_owned(), Log::read(&self.folder.join(name))?);
        }
        Ok(self.read.get(name))
    }
}

impl Logs {
    /// The log of this name, if it has been read.
    pub(super) fn known(&self, name: &str) -> Option<&Log> {
        self.read.get(name)
    }
}

impl Log {
    fn read(path: &Path) -> Result<Self, ReportError> {
        let mut reader = Reader::open(path)?.without_images().without_inputs().bare();
        let header = reader.header().clone();
        let (mut frames, mut disparity) = (Vec::new(), (0.0, 0));
        while let Some(frame) = reader.next().transpose()? {
            for error in disparity::errors(&header, &frame) {
                disparity = (disparity.0 + error * error, disparity.1 + 1);
            }
            let fixes = || frame.targets.iter().filter(|row| row.outcome == Outcome::Fix);
            let mut candidates: Vec<u32> = frame.targets.iter().flat_map(|row| row.candidates.concat()).collect();
            candidates.sort_unstable();
            candidates.dedup();
            let marks = [
                frame.key_points.len(),
                frame.cloud.len(),
                candidates.len(),
                fixes().map(|row| row.pairs.len()).sum(),
                fixes().map(|row| row.used.len()).sum(),
            ];
            let rows = frame.targets.into_iter().filter(TargetRecord::attempted).map(|mut row| {
                let lists = std::mem::take(&mut row.candidates);
                let arms = lever::ARMS.map(|arm| moved(&header, frame.truth.as_ref(), &row, arm));
                (row.pairs, row.used, row.alternatives) = Default::default();
                place::limit(&header, &mut row);
                let at = place::estimate(&header, &row);
                Row { record: row, candidates: lists.iter().map(Vec::len).sum(), at, arms }
            });
            let carried = frame.navigation.as_deref().map_or([[f64::NAN; 3]; 2], |known| {
                [&known.pose, &known.odometry_only].map(|pose| place::carried(&header, pose.as_ref()))
            });
            let step = frame.navigation.as_deref().and_then(|record| {
                let object = &record.pose.as_ref()?.object;
                let known = header.targets.iter().position(|target| target.id == *object)?;
                fix_intervals::step(frame.stamp_ns, frame.truth.as_ref(), record, known as u32)
            });
            frames.push(Seen {
                step,
                carried,
                number: frame.frame,
                stamp_ns: frame.stamp_ns,
                times: frame.times,
                navigation: frame.navigation,
                poi: frame.poi,
                truth: frame
                    .truth
                    .as_ref()
                    .map(|truth| truth.world_from_camera.map(|row| row[3]))
                    .map(|[x, y, z, _]| [x, y, z]),
                marks,
                rows: rows.collect(),
            });
        }
        let totals = reader.totals().cloned();
        Ok(Self { header, frames, totals, disparity, compared: RefCell::default() })
    }

    /// The frames with this stamp, by binary search: stamps never decrease.
    pub(super) fn at(&self, stamp_ns: u64) -> impl Iterator<Item = &Seen> {
        let first = self.frames.partition_point(|frame| frame.stamp_ns < stamp_ns);
        self.frames[first..].iter().take_while(move |frame| frame.stamp_ns == stamp_ns)
    }

    /// The frames within the stamps that are logged for any outcome.
    ///
    /// Their numbers are multiples of the decimation factor.
    pub(super) fn sample(&self, [from, to]: [u64; 2]) -> impl Iterator<Item = &Seen> {
        let every = self.totals.as_ref().map_or(1, |totals| totals.every.max(1));
        self.frames.iter().filter(move |frame| frame.number % every == 0 && (from..=to).contains(&frame.stamp_ns))
    }
}

/// The RMS error (m) of six points at a lever arm from the centroid, along the axes.
///
/// Their mean square equals that over a sphere.
fn moved(header: &TrialHeader, truth: Option<&TruthRecord>, row: &TargetRecord, arm: f64) -> f64 {
    let judged = lever::misplaced(header, truth, row).filter(|_| row.evaluation.attitude_error.is_some());
    let Some((e, centroid)) = judged else { return f64::NAN };
    let ends = (0..6).map(|k| {
        let mut end = centroid;
        end[k / 2] += if k % 2 == 0 { arm } else { -arm };
        (e.transform_point(&end.into()).coords - end).norm_squared()
    });
    (ends.sum::<f64>() / 6.0).sqrt()
}
