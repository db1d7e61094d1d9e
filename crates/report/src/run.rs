//! A run, read from its logs.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use hmac_sha256::Hash as Sha256;
use rayon::prelude::*;
use seafix_evaluation::lever_arm_error;
use seafix_log::{
    FrameRecord, LogError, Outcome, Reader, Region, SharedStages, TargetRecord, Totals, TrialHeader, displaced_object,
    unchanged,
};

use crate::{
    disparity,
    error::ReportError,
    field::Field,
    fix_intervals::{self, Step},
    lever,
    navigation_quantity::{Counted, NavigationQuantity},
    place,
    points_of_interest::{self, PoiQuantity},
    scale_error::ScaleErrors,
};

/// The trials of a run, sorted by file name.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) trials: Vec<Trial>,
    /// Whether the trials come from several runs; their first axis is the run then.
    pub(crate) joined: bool,
}

/// One trial without its images and clouds.
#[derive(Debug)]
pub(crate) struct Trial {
    pub(crate) path: PathBuf,
    /// The printed name of the log: its file name, preceded by its run if there are several.
    pub(crate) label: String,
    pub(crate) header: TrialHeader,
    pub(crate) frames: Vec<Frame>,
    /// The totals over all frames, logged or not; `None` if the log has none.
    pub(crate) totals: Option<Totals>,
    /// The lost part of a log that was recovered from an incomplete one.
    pub(crate) lacks: Option<String>,
    /// Whether the trial uses images; without images its source provides the points. True without any frame.
    pub(crate) images: bool,
    /// Whether the log contains the images.
    pub(crate) pictures: bool,
    /// The sum of the squared disparity errors of correctly identified points (px²), and their number.
    pub(crate) disparity: (f64, usize),
    /// The scale and depth errors of its fixes.
    pub(crate) scale_errors: ScaleErrors,
    /// The names of search and solver in the first row.
    pub(crate) named: [String; 2],
    /// The stages shared with other trials in any frame.
    pub(crate) shared: SharedStages,
    /// The SHA-256 of all results except times.
    pub(crate) digest: Vec<u8>,
    rows: Vec<AttemptRow>,
    poi: Vec<Inspected>,
    words: Vec<String>,
    /// The sentences of rows without a fix; the first is empty.
    explanations: Vec<Box<str>>,
}

/// A frame of a trial.
#[derive(Debug)]
pub(crate) struct Frame {
    pub(crate) number: u64,
    pub(crate) stamp_ns: u64,
    /// The true position of the left camera in the world (m).
    pub(crate) truth: Option<[f64; 3]>,
    /// The times (ms) of the stages common to all targets; NaN without one.
    ///
    /// Their order is that of [`crate::StageTimeSummary`].
    pub(crate) times: [f64; 7],
    rows: (u32, u32),
    /// The navigated pose, for a trial with a navigator.
    pub(crate) navigated: Option<Box<NavigatedFrame>>,
    poi: (u32, u32),
}

/// A point of interest in view of a frame.
#[derive(Debug)]
pub(crate) struct Inspected {
    name: u32,
    values: [f64; PoiQuantity::ALL.len()],
}

/// The state of the navigator after a frame.
#[derive(Debug)]
pub(crate) struct NavigatedFrame {
    /// The positions of the left camera in the world (m), navigated and by odometry only.
    ///
    /// Odometry starts at the first fix. Both use the survey; unknown positions are NaN.
    pub(crate) places: [[f64; 3]; 2],
    /// The events that report objects away from their surveyed pose.
    pub(crate) displaced: Vec<String>,
    /// The pose error for fix intervals; `None` without a pose or ground truth.
    pub(crate) step: Option<Step>,
    counted: [bool; Counted::ALL.len()],
    values: [f64; NavigationQuantity::ALL.len()],
}

/// An attempt at one target.
#[derive(Debug)]
pub(crate) struct AttemptRow {
    pub(crate) outcome: Outcome,
    pub(crate) wrong: Option<bool>,
    pub(crate) points: u32,
    /// The position of the left camera in the world (m) by fix and survey; NaN where unknown.
    pub(crate) estimate: [f64; 3],
    /// The error of the fix at the centroid of its used points (m); NaN where unknown.
    displacement: f64,
    object: u32,
    reason: u32,
    /// The index of its sentence.
    explanation: u32,
    values: [f64; Field::ALL.len()],
}

impl Run {
    /// Reads every `*.mcap` in `folder`, and checks it against the manifest.
    pub(crate) fn read(folder: &Path) -> Result<Self, ReportError> {
        let run = Self::read_as_it_is(folder)?;
        run.trials.par_iter().try_for_each(|trial| unchanged(&trial.path))?;
        Ok(run)
    }

    /// Reads every `*.mcap` in `folder`, changed or not.
    pub(crate) fn read_as_it_is(folder: &Path) -> Result<Self, ReportError> {
        let io = |source| ReportError::Io { doing: "read", path: folder.to_owned(), source };
        if folder.is_file() {
            return Err(ReportError::NoLogs(folder.to_owned()));
        }
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
        known_manifest(folder)?;
        // The error of the first faulty log is the one that is reported.
        let trials: Vec<_> = paths.into_par_iter().map(Trial::read).collect();
        let trials: Vec<Trial> = trials.into_iter().collect::<Result<_, _>>()?;
        // Tables have one set of columns, so all logs must belong to one experiment.
        let keys = |trial: &Trial| trial.header.axes.iter().map(|axis| axis.key.clone()).collect::<Vec<_>>();
        if let Some(other) = trials.iter().find(|trial| keys(trial) != keys(&trials[0])) {
            return Err(ReportError::Mixed { first: trials[0].path.clone(), other: other.path.clone() });
        }
        Ok(Self { trials, joined: false })
    }

    /// The header of the first trial, for values that all trials share.
    pub(crate) fn header(&self) -> &TrialHeader {
        &self.trials[0].header
    }
}

impl Trial {
    fn read(path: PathBuf) -> Result<Self, LogError> {
        let mut reader = Reader::open(&path)?.without_images().without_inputs().bare();
        let mut trial = Self {
            label: path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            path,
            header: reader.header().clone(),
            frames: Vec::new(),
            totals: None,
            lacks: None,
            images: false,
            pictures: false,
            disparity: (0.0, 0),
            scale_errors: ScaleErrors::default(),
            named: Default::default(),
            shared: SharedStages::default(),
            digest: Vec::new(),
            rows: Vec::new(),
            poi: Vec::new(),
            words: vec![String::new()],
            explanations: vec![Box::default()],
        };
        let mut digest = Sha256::new();
        let mut places = HashMap::from([(String::new(), 0)]);
        reader.for_each_frame(|mut frame| {
            frame.targets.iter_mut().for_each(|target| place::limit(&trial.header, target));
            trial.take(&frame, &mut places);
            results(&mut digest, &frame);
        })?;
        trial.digest = digest.finalize().to_vec();
        // A header names a detector if the trial uses images, logged or not.
        trial.images = trial.frames.is_empty() || trial.header.components.iter().any(|c| c.stage == "detector");
        trial.pictures = reader.has_images();
        trial.totals = reader.totals().cloned();
        trial.lacks = reader.recovered().map(str::to_owned);
        trial.frames.shrink_to_fit();
        trial.rows.shrink_to_fit();
        trial.poi.shrink_to_fit();
        Ok(trial)
    }

    /// Adds a frame; `places` maps known words to their indices.
    fn take(&mut self, frame: &FrameRecord, places: &mut HashMap<String, u32>) {
        for error in disparity::errors(&self.header, frame) {
            self.disparity.0 += error * error;
            self.disparity.1 += 1;
        }
        let first = self.rows.len() as u32;
        for target in &frame.targets {
            self.scale_errors.add(target);
            if self.rows.is_empty() {
                self.named = [target.search.clone(), target.solver.clone()];
            }
            let [object, reason] = [&target.object, &target.reason].map(|word| self.word(word, places));
            let explanation = self.explain(target);
            self.rows.push(AttemptRow {
                outcome: target.outcome,
                wrong: target.evaluation.wrong,
                points: target.pairs.len() as u32,
                estimate: place::estimate(&self.header, target),
                displacement: lever::displacement(&self.header, frame.truth.as_ref(), target),
                object,
                reason,
                explanation,
                values: values(target),
            });
        }
        let poi_quantity = self.poi.len() as u32;
        for point in &frame.poi {
            let name = self.word(&points_of_interest::name(point), places);
            let values = PoiQuantity::ALL.map(|quantity| quantity.of(point).unwrap_or(f64::NAN));
            self.poi.push(Inspected { name, values });
        }
        let step = frame.navigation.as_deref().and_then(|record| {
            let object = self.word(&record.pose.as_ref()?.object, places);
            fix_intervals::step(frame.stamp_ns, frame.truth.as_ref(), record, object)
        });
        let times = &frame.times;
        self.shared.front_end |= times.shared.front_end;
        self.shared.search |= times.shared.search;
        self.shared.odometry |= times.shared.odometry;
        self.frames.push(Frame {
            number: frame.frame,
            stamp_ns: frame.stamp_ns,
            truth: frame.truth.as_ref().map(|truth| truth.world_from_camera).map(|m| [m[0][3], m[1][3], m[2][3]]),
            times: [
                times.detect_ms,
                times.locate_ms,
                times.describe_ms,
                times.match_ms,
                times.refine_ms,
                times.triangulate_ms,
                times.odometry_ms,
            ]
            .map(|time| time.unwrap_or(f64::NAN)),
            rows: (first, self.rows.len() as u32),
            navigated: frame.navigation.as_deref().map(|record| {
                Box::new(NavigatedFrame {
                    places: [&record.pose, &record.odometry_only]
                        .map(|pose| place::carried(&self.header, pose.as_ref())),
                    displaced: record
                        .events
                        .iter()
                        .filter(|event| displaced_object(event).is_some())
                        .cloned()
                        .collect(),
                    step,
                    counted: Counted::ALL.map(|counted| counted.holds(record)),
                    values: std::array::from_fn(|index| NavigationQuantity::ALL[index].of(record).unwrap_or(f64::NAN)),
                })
            }),
            poi: (poi_quantity, self.poi.len() as u32),
        });
    }

    /// The index of the sentence of a row without a fix; zero for a fix.
    ///
    /// The row of a frame without an attempt often repeats the sentence of the row before it.
    fn explain(&mut self, target: &TargetRecord) -> u32 {
        if target.outcome == Outcome::Fix || target.explanation.is_empty() {
            return 0;
        }
        if self.explanations.last().is_none_or(|last| **last != *target.explanation) {
            self.explanations.push(target.explanation.as_str().into());
        }
        (self.explanations.len() - 1) as u32
    }

    /// The index of `word`, which is added if it is new.
    fn word(&mut self, word: &str, places: &mut HashMap<String, u32>) -> u32 {
        if let Some(place) = places.get(word) {
            return *place;
        }
        let place = self.words.len() as u32;
        self.words.push(word.to_owned());
        places.insert(word.to_owned(), place);
        place
    }

    /// The printed name of the log.
    pub(crate) fn file(&self) -> String {
        self.label.clone()
    }

    /// A sentence on the lost part of a recovered log; `None` for a complete log.
    pub(crate) fn lacking(&self) -> Option<String> {
        let lost = self.lacks.as_ref()?;
        Some(format!("{}: recovered from an incomplete log; lost: {lost}", self.file()))
    }

    /// The first and the last stamp of the log (ns).
    pub(crate) fn span(&self) -> [u64; 2] {
        [self.frames.first(), self.frames.last()].map(|frame| frame.map_or(0, |frame| frame.stamp_ns))
    }

    /// The number of frames, logged or not.
    pub(crate) fn count(&self) -> usize {
        self.totals.as_ref().map_or(self.frames.len(), |totals| totals.frames as usize)
    }

    /// The decimation factor k: frames whose number is a multiple of k are logged for any outcome.
    pub(crate) fn every(&self) -> u64 {
        self.totals.as_ref().map_or(1, |totals| totals.every.max(1))
    }

    /// The frames that are logged for any outcome: all frames, or an unbiased sample of a decimated log.
    pub(crate) fn sample(&self) -> impl Iterator<Item = &Frame> {
        let every = self.every();
        self.frames.iter().filter(move |frame| frame.number.is_multiple_of(every))
    }

    /// The rows of `frame`: its attempts, or one row that states why it has none.
    pub(crate) fn rows_of(&self, frame: &Frame) -> impl Iterator<Item = &AttemptRow> {
        self.rows[frame.rows.0 as usize..frame.rows.1 as usize].iter()
    }

    /// The attempts of `frame`.
    pub(crate) fn attempts_of(&self, frame: &Frame) -> impl Iterator<Item = &AttemptRow> {
        self.rows_of(frame).filter(|row| row.is_attempt())
    }

    /// Every attempt of every frame of the sample.
    pub(crate) fn attempts(&self) -> impl Iterator<Item = (&Frame, &AttemptRow)> {
        self.sample().flat_map(|frame| self.attempts_of(frame).map(move |row| (frame, row)))
    }

    /// The name of an attempt's target.
    pub(crate) fn object(&self, row: &AttemptRow) -> &str {
        self.words.get(row.object as usize).map_or("", String::as_str)
    }

    /// Each point of interest in view of each frame of the sample.
    pub(crate) fn views(&self) -> impl Iterator<Item = &Inspected> {
        self.sample().flat_map(|frame| &self.poi[frame.poi.0 as usize..frame.poi.1 as usize])
    }

    /// The name of a point of interest, with its object.
    pub(crate) fn point(&self, point: &Inspected) -> &str {
        self.words.get(point.name as usize).map_or("", String::as_str)
    }

    /// The reason why an attempt was rejected, or its outcome if the log has no reason.
    pub(crate) fn reason(&self, row: &AttemptRow) -> &str {
        match self.words.get(row.reason as usize).map_or("", String::as_str) {
            "" => row.outcome.name(),
            word => word,
        }
    }

    /// The logged sentence of a row without a fix: reason, numbers and remedy; empty for a fix.
    pub(crate) fn explanation(&self, row: &AttemptRow) -> &str {
        self.explanations.get(row.explanation as usize).map_or("", |sentence| &**sentence)
    }

    /// The names of the trial's search and solver.
    pub(crate) fn method(&self) -> [String; 2] {
        let of_stage = |stage: &str| self.header.components.iter().find(|c| c.stage == stage).map(|c| c.name.clone());
        [
            of_stage("search").unwrap_or_else(|| self.named[0].clone()),
            of_stage("solver").unwrap_or_else(|| self.named[1].clone()),
        ]
    }
}

impl NavigatedFrame {
    /// The value of a quantity; `None` where it is unknown.
    pub(crate) fn get(&self, quantity: NavigationQuantity) -> Option<f64> {
        Some(self.values[quantity as usize]).filter(|value| !value.is_nan())
    }

    /// Whether the frame belongs to a counted group.
    pub(crate) fn is(&self, counted: Counted) -> bool {
        self.counted[counted as usize]
    }
}

impl Inspected {
    /// The value of a quantity; `None` where it is unknown.
    pub(crate) fn get(&self, quantity: PoiQuantity) -> Option<f64> {
        Some(self.values[quantity as usize]).filter(|value| !value.is_nan())
    }
}

impl AttemptRow {
    /// The value of a quantity; `None` where it is unknown.
    pub(crate) fn get(&self, field: Field) -> Option<f64> {
        Some(self.values[field as usize]).filter(|value| !value.is_nan())
    }

    /// Whether the row is an attempt at a target.
    pub(crate) fn is_attempt(&self) -> bool {
        self.object != 0
    }

    /// Whether the attempt is a fix that is not known to be wrong.
    pub(crate) fn found(&self) -> bool {
        self.outcome == Outcome::Fix && self.wrong != Some(true)
    }

    /// Whether the attempt is a wrong fix, with a TRE beyond the alert limit.
    pub(crate) fn wrong(&self) -> bool {
        self.outcome == Outcome::Fix && self.wrong == Some(true)
    }

    /// The region of a fix in the Stanford diagram; `None` without its error or its alert limit.
    pub(crate) fn region(&self) -> Option<Region> {
        let (error, limit) = (self.get(Field::Position)?, self.get(Field::Limit)?);
        (self.outcome == Outcome::Fix).then(|| Region::of(error, self.get(Field::Level), limit))
    }

    /// The error at a lever arm of length `arm` (m); `None` where it is unknown.
    pub(crate) fn at_arm(&self, arm: f64) -> Option<f64> {
        let angle = self.get(Field::Attitude)?;
        (!self.displacement.is_nan()).then(|| lever_arm_error(self.displacement, angle, arm))
    }

    /// The error for comparisons: infinite for a rejected attempt or a wrong fix.
    pub(crate) fn error_or_failure(&self, field: Field) -> f64 {
        if self.found() { self.get(field).unwrap_or(f64::INFINITY) } else { f64::INFINITY }
    }
}

/// Checks the manifest of a run, if it has one.
///
/// Its major format must be known, and a finished run must have all its logs.
fn known_manifest(folder: &Path) -> Result<(), ReportError> {
    const KNOWN: &str = "seafix-manifest/2";
    let path = folder.join("manifest.json");
    let manifest: Option<serde_json::Value> =
        fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
    match manifest.as_ref().and_then(|manifest| manifest["format"].as_str()) {
        Some(found) if found != KNOWN && !found.starts_with("seafix-manifest/2.") => {
            return Err(ReportError::Newer { path, found: found.to_owned(), known: KNOWN });
        }
        _ => {}
    }
    let Some(manifest) = manifest.filter(|manifest| manifest["state"] == "finished") else { return Ok(()) };
    let logs = manifest["trials"].as_array().into_iter().flatten().filter_map(|trial| trial["log"].as_str());
    match logs.into_iter().find(|log| !folder.join(log).is_file()) {
        Some(log) => Err(ReportError::Gone { path, log: log.to_owned() }),
        None => Ok(()),
    }
}

fn values(target: &TargetRecord) -> [f64; Field::ALL.len()] {
    std::array::from_fn(|index| Field::ALL[index].of(target).unwrap_or(f64::NAN))
}

/// Adds all results of the attempts of `frame`, except times, to the digest.
fn results(digest: &mut Sha256, frame: &FrameRecord) {
    digest.update(frame.frame.to_le_bytes());
    digest.update(frame.stamp_ns.to_le_bytes());
    for target in &frame.targets {
        for word in [&target.object, &target.search, &target.solver, &target.reason] {
            digest.update((word.len() as u64).to_le_bytes());
            digest.update(word.as_bytes());
        }
        digest.update(target.outcome.name().as_bytes());
        for pair in &target.pairs {
            digest.update(pair.model.to_le_bytes());
            digest.update(pair.cloud.to_le_bytes());
        }
        let pose = target.object_from_camera.iter().flatten().flatten();
        let covariance = target.covariance.iter().flatten().flatten();
        let fields = Field::ALL.iter().filter(|field| field.topic() != "/metrics/timing");
        let fields: Vec<f64> = fields.map(|field| field.of(target).unwrap_or(f64::NAN)).collect();
        for value in pose.chain(covariance).chain(&fields) {
            digest.update(value.to_bits().to_le_bytes());
        }
    }
}
