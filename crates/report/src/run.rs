//! A run, as its logs have it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_log::{FrameRecord, FrameTimes, LogError, Reader, TargetRecord, Totals, TrialHeader};

use crate::{ReportError, disparity};

/// All trials of a run, in the order of their names.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) trials: Vec<Trial>,
}

/// One trial without what is large: no images, no clouds.
#[derive(Debug)]
pub(crate) struct Trial {
    pub(crate) path: PathBuf,
    pub(crate) header: TrialHeader,
    pub(crate) frames: Vec<Frame>,
    /// What all frames add up to, logged or not; `None` where the log does not say.
    pub(crate) totals: Option<Totals>,
    /// Whether the log has images, or no frame at all; without images the points came as they are.
    pub(crate) images: bool,
    /// The errors of the disparities of correctly identified points (px), where truth tells.
    pub(crate) disparity_errors: Vec<f64>,
}

/// One frame of a trial.
#[derive(Debug)]
pub(crate) struct Frame {
    pub(crate) number: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) targets: Vec<TargetRecord>,
    pub(crate) times: FrameTimes,
}

impl Run {
    /// Reads every `*.mcap` in `folder`.
    pub(crate) fn read(folder: &Path) -> Result<Self, ReportError> {
        let io = |source| ReportError::Io { doing: "read", path: folder.to_owned(), source };
        let mut paths = Vec::new();
        for entry in fs::read_dir(folder).map_err(io)? {
            let path = entry.map_err(io)?.path();
            if path.extension().is_some_and(|extension| extension == "mcap") {
                paths.push(path);
            }
        }
        paths.sort();
        if paths.is_empty() {
            return Err(ReportError::NoLogs(folder.to_owned()));
        }
        let trials: Vec<Trial> = paths.into_iter().map(Trial::read).collect::<Result<_, _>>()?;
        // Tables have one set of columns, so all logs must be of one experiment.
        let keys = |trial: &Trial| trial.header.axes.iter().map(|axis| axis.key.clone()).collect::<Vec<_>>();
        if let Some(other) = trials.iter().find(|trial| keys(trial) != keys(&trials[0])) {
            return Err(ReportError::Mixed { first: trials[0].path.clone(), other: other.path.clone() });
        }
        Ok(Self { trials })
    }

    /// The header of the first trial: what all trials share is read there.
    pub(crate) fn header(&self) -> &TrialHeader {
        &self.trials[0].header
    }
}

impl Trial {
    fn read(path: PathBuf) -> Result<Self, LogError> {
        let mut reader = Reader::open(&path)?.without_images();
        let (mut frames, mut disparity_errors) = (Vec::new(), Vec::new());
        while let Some(frame) = reader.next().transpose()? {
            disparity_errors.extend(disparity::errors(reader.header(), &frame));
            let FrameRecord { frame: number, stamp_ns, targets, times, .. } = frame;
            frames.push(Frame { number, stamp_ns, targets, times });
        }
        let images = reader.has_images() || frames.is_empty();
        let totals = reader.totals().cloned();
        Ok(Self { path, header: reader.header().clone(), images, frames, totals, disparity_errors })
    }

    /// The name of the log.
    pub(crate) fn file(&self) -> String {
        self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    /// How many frames it has, logged or not.
    pub(crate) fn count(&self) -> usize {
        self.totals.as_ref().map_or(self.frames.len(), |totals| totals.frames as usize)
    }

    /// The frames that were logged whatever came of them: all, or a fair sample of many.
    pub(crate) fn sample(&self) -> impl Iterator<Item = &Frame> {
        let every = self.totals.as_ref().map_or(1, |totals| totals.every.max(1));
        self.frames.iter().filter(move |frame| frame.number.is_multiple_of(every))
    }

    /// Every attempt of every frame of the sample.
    pub(crate) fn attempts(&self) -> impl Iterator<Item = (&Frame, &TargetRecord)> {
        self.sample()
            .flat_map(|frame| frame.targets.iter().map(move |target| (frame, target)))
            .filter(|(_, target)| target.attempted())
    }

    /// What the trial's search and solver are called.
    pub(crate) fn method(&self) -> [String; 2] {
        let of_stage = |stage: &str| self.header.components.iter().find(|c| c.stage == stage).map(|c| c.name.clone());
        let row = self.frames.iter().flat_map(|frame| &frame.targets).next();
        let of_row = |name: fn(&TargetRecord) -> &String| row.map(name).cloned().unwrap_or_default();
        [
            of_stage("search").unwrap_or_else(|| of_row(|row| &row.search)),
            of_stage("solver").unwrap_or_else(|| of_row(|row| &row.solver)),
        ]
    }
}
