//! A run, as its logs have it.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use hmac_sha256::Hash as Sha256;
use rayon::prelude::*;
use seafix_evaluation::lever_arm_error;
use seafix_log::{
    ELSEWHERE, FrameRecord, LogError, Outcome, Reader, Region, SharedStages, TargetRecord, Totals, TrialHeader,
};

use crate::{
    Field, ReportError, disparity,
    fix_intervals::{self, Step},
    lever,
    navigation_quantity::{Counted, NavigationQuantity},
    place,
    points_of_interest::{self, PoiQuantity},
};

/// All trials of a run, in the order of their names.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) trials: Vec<Trial>,
    /// Whether the trials come from several runs, the first axis saying which.
    pub(crate) joined: bool,
}

/// One trial without what is large: no images, no clouds.
#[derive(Debug)]
pub(crate) struct Trial {
    pub(crate) path: PathBuf,
    /// What the log is called: its file, with its run before it where there are several.
    pub(crate) label: String,
    pub(crate) header: TrialHeader,
    pub(crate) frames: Vec<Frame>,
    /// What all frames add up to, logged or not; `None` where the log does not say.
    pub(crate) totals: Option<Totals>,
    /// What the log lacks, where it was saved of one that was not whole.
    pub(crate) lacks: Option<String>,
    /// Whether images were looked at, or no frame at all; without images the points came as they are.
    pub(crate) images: bool,
    /// Whether the log has its images.
    pub(crate) pictures: bool,
    /// The errors of the disparities of correctly identified points, where truth tells: their squares' sum (px²) and
    /// how many there are.
    pub(crate) disparity: (f64, usize),
    /// What searches and solvers the rows name.
    pub(crate) named: [String; 2],
    /// The stages that it shares with other trials in some frame.
    pub(crate) shared: SharedStages,
    /// SHA-256 of all results but the times.
    pub(crate) digest: Vec<u8>,
    rows: Vec<AttemptRow>,
    poi: Vec<Inspected>,
    words: Vec<String>,
}

/// One frame of a trial.
#[derive(Debug)]
pub(crate) struct Frame {
    pub(crate) number: u64,
    pub(crate) stamp_ns: u64,
    /// Where the left camera really was in the world (m).
    pub(crate) truth: Option<[f64; 3]>,
    /// Times of the stages that serve all targets, in the order of [`crate::StageTimeSummary`] (ms); NaN where none.
    pub(crate) times: [f64; 7],
    rows: (u32, u32),
    /// What the navigator knew, where the trial navigates.
    pub(crate) navigated: Option<Box<NavigatedFrame>>,
    poi: (u32, u32),
}

/// A point of interest in view of a frame.
#[derive(Debug)]
pub(crate) struct Inspected {
    name: u32,
    values: [f64; PoiQuantity::ALL.len()],
}

/// What a navigator knew after a frame.
#[derive(Debug)]
pub(crate) struct NavigatedFrame {
    /// Where the navigated pose and the survey put the left camera in the world, and where the first fix carried by odometry
    /// alone does (m); NaN where unknown.
    pub(crate) places: [[f64; 3]; 2],
    /// What was told of objects that stand elsewhere than surveyed.
    pub(crate) displaced: Vec<String>,
    /// What it says of the growth of the error; `None` without a pose or truth.
    pub(crate) step: Option<Step>,
    counted: [bool; Counted::ALL.len()],
    values: [f64; NavigationQuantity::ALL.len()],
}

/// One attempt at one target.
#[derive(Debug)]
pub(crate) struct AttemptRow {
    pub(crate) outcome: Outcome,
    pub(crate) wrong: Option<bool>,
    pub(crate) points: u32,
    /// Where the left camera is in the world by this fix and the survey (m); NaN where unknown.
    pub(crate) estimate: [f64; 3],
    /// How far the fix has the centroid of the points that it used from its place (m); NaN where unknown.
    displacement: f64,
    object: u32,
    reason: u32,
    values: [f64; Field::ALL.len()],
}

impl Run {
    /// Reads every `*.mcap` in `folder`.
    pub(crate) fn read(folder: &Path) -> Result<Self, ReportError> {
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
        // What is wrong with the first of them is told first.
        let trials: Vec<_> = paths.into_par_iter().map(Trial::read).collect();
        let trials: Vec<Trial> = trials.into_iter().collect::<Result<_, _>>()?;
        // Tables have one set of columns, so all logs must be of one experiment.
        let keys = |trial: &Trial| trial.header.axes.iter().map(|axis| axis.key.clone()).collect::<Vec<_>>();
        if let Some(other) = trials.iter().find(|trial| keys(trial) != keys(&trials[0])) {
            return Err(ReportError::Mixed { first: trials[0].path.clone(), other: other.path.clone() });
        }
        Ok(Self { trials, joined: false })
    }

    /// The header of the first trial: what all trials share is read there.
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
            named: Default::default(),
            shared: SharedStages::default(),
            digest: Vec::new(),
            rows: Vec::new(),
            poi: Vec::new(),
            words: vec![String::new()],
        };
        let mut digest = Sha256::new();
        let mut places = HashMap::from([(String::new(), 0)]);
        reader.for_each_frame(|mut frame| {
            frame.targets.iter_mut().for_each(|target| place::limit(&trial.header, target));
            trial.take(&frame, &mut places);
            results(&mut digest, &frame);
        })?;
        trial.digest = digest.finalize().to_vec();
        // A detector is named where there were images, logged or not.
        trial.images = trial.frames.is_empty() || trial.header.components.iter().any(|c| c.stage == "detector");
        trial.pictures = reader.has_images();
        trial.totals = reader.totals().cloned();
        trial.lacks = reader.recovered().map(str::to_owned);
        trial.frames.shrink_to_fit();
        trial.rows.shrink_to_fit();
        trial.poi.shrink_to_fit();
        Ok(trial)
    }

    /// Takes in a frame; `places` are those of the words that are known.
    fn take(&mut self, frame: &FrameRecord, places: &mut HashMap<String, u32>) {
        for error in disparity::errors(&self.header, frame) {
            self.disparity.0 += error * error;
            self.disparity.1 += 1;
        }
        let first = self.rows.len() as u32;
        for target in &frame.targets {
            if self.rows.is_empty() {
                self.named = [target.search.clone(), target.solver.clone()];
            }
            let [object, reason] = [&target.object, &target.reason].map(|word| self.word(word, places));
            self.rows.push(AttemptRow {
                outcome: target.outcome,
                wrong: target.evaluation.wrong,
                points: target.pairs.len() as u32,
                estimate: place::estimate(&self.header, target),
                displacement: lever::displacement(&self.header, frame.truth.as_ref(), target),
                object,
                reason,
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
                    displaced: record.events.iter().filter(|event| event.contains(ELSEWHERE)).cloned().collect(),
                    step,
                    counted: Counted::ALL.map(|counted| counted.holds(record)),
                    values: std::array::from_fn(|index| NavigationQuantity::ALL[index].of(record).unwrap_or(f64::NAN)),
                })
            }),
            poi: (poi_quantity, self.poi.len() as u32),
        });
    }

    /// The place of `word` among those known.
    fn word(&mut self, word: &str, places: &mut HashMap<String, u32>) -> u32 {
        if let Some(place) = places.get(word) {
            return *place;
        }
        let place = self.words.len() as u32;
        self.words.push(word.to_owned());
        places.insert(word.to_owned(), place);
        place
    }

    /// The name of the log.
    pub(crate) fn file(&self) -> String {
        self.label.clone()
    }

    /// That the log is not whole, where it is not.
    pub(crate) fn lacking(&self) -> Option<String> {
        let lost = self.lacks.as_ref()?;
        Some(format!("{} was saved of a log that was not whole; lost: {lost}", self.file()))
    }

    /// The first and the last stamp of the log (ns).
    pub(crate) fn span(&self) -> [u64; 2] {
        [self.frames.first(), self.frames.last()].map(|frame| frame.map_or(0, |frame| frame.stamp_ns))
    }

    /// How many frames it has, logged or not.
    pub(crate) fn count(&self) -> usize {
        self.totals.as_ref().map_or(self.frames.len(), |totals| totals.frames as usize)
    }

    /// Of so many frames one is logged whatever came of it.
    pub(crate) fn every(&self) -> u64 {
        self.totals.as_ref().map_or(1, |totals| totals.every.max(1))
    }

    /// The frames that were logged whatever came of them: all, or a fair sample of many.
    pub(crate) fn sample(&self) -> impl Iterator<Item = &Frame> {
        let every = self.every();
        self.frames.iter().filter(move |frame| frame.number.is_multiple_of(every))
    }

    /// The attempts of `frame`.
    pub(crate) fn attempts_of(&self, frame: &Frame) -> impl Iterator<Item = &AttemptRow> {
        self.rows[frame.rows.0 as usize..frame.rows.1 as usize].iter().filter(|row| row.object != 0)
    }

    /// Every attempt of every frame of the sample.
    pub(crate) fn attempts(&self) -> impl Iterator<Item = (&Frame, &AttemptRow)> {
        self.sample().flat_map(|frame| self.attempts_of(frame).map(move |row| (frame, row)))
    }

    /// What an attempt's target is called.
    pub(crate) fn object(&self, row: &AttemptRow) -> &str {
        self.words.get(row.object as usize).map_or("", String::as_str)
    }

    /// Each point of interest in view of each frame of the sample.
    pub(crate) fn views(&self) -> impl Iterator<Item = &Inspected> {
        self.sample().flat_map(|frame| &self.poi[frame.poi.0 as usize..frame.poi.1 as usize])
    }

    /// What a point of interest is called, with its object.
    pub(crate) fn point(&self, point: &Inspected) -> &str {
        self.words.get(point.name as usize).map_or("", String::as_str)
    }

    /// Why an attempt was refused: the word for it, or its outcome.
    pub(crate) fn reason(&self, row: &AttemptRow) -> &str {
        match self.words.get(row.reason as usize).map_or("", String::as_str) {
            "" => row.outcome.name(),
            word => word,
        }
    }

    /// What the trial's search and solver are called.
    pub(crate) fn method(&self) -> [String; 2] {
        let of_stage = |stage: &str| self.header.components.iter().find(|c| c.stage == stage).map(|c| c.name.clone());
        [
            of_stage("search").unwrap_or_else(|| self.named[0].clone()),
            of_stage("solver").unwrap_or_else(|| self.named[1].clone()),
        ]
    }
}

impl NavigatedFrame {
    /// The value of a quantity; `None` where nothing is known.
    pub(crate) fn get(&self, quantity: NavigationQuantity) -> Option<f64> {
        Some(self.values[quantity as usize]).filter(|value| !value.is_nan())
    }

    /// Whether its frame is one of these.
    pub(crate) fn is(&self, counted: Counted) -> bool {
        self.counted[counted as usize]
    }
}

impl Inspected {
    /// The value of a quantity; `None` where nothing is known.
    pub(crate) fn get(&self, quantity: PoiQuantity) -> Option<f64> {
        Some(self.values[quantity as usize]).filter(|value| !value.is_nan())
    }
}

impl AttemptRow {
    /// The value of one of its quantities; `None` where nothing is known.
    pub(crate) fn get(&self, field: Field) -> Option<f64> {
        Some(self.values[field as usize]).filter(|value| !value.is_nan())
    }

    /// A fix that is not known to be wrong.
    pub(crate) fn found(&self) -> bool {
        self.outcome == Outcome::Fix && self.wrong != Some(true)
    }

    /// A fix beyond the alert limit.
    pub(crate) fn wrong(&self) -> bool {
        self.outcome == Outcome::Fix && self.wrong == Some(true)
    }

    /// The region of the Stanford diagram that a fix is in, where its error and its limit are known.
    pub(crate) fn region(&self) -> Option<Region> {
        let (error, limit) = (self.get(Field::Position)?, self.get(Field::Limit)?);
        (self.outcome == Outcome::Fix).then(|| Region::of(error, self.get(Field::Level), limit))
    }

    /// Its error at a lever arm of this length (m); `None` where it is not known.
    pub(crate) fn at_arm(&self, arm: f64) -> Option<f64> {
        let angle = self.get(Field::Attitude)?;
        (!self.displacement.is_nan()).then(|| lever_arm_error(self.displacement, angle, arm))
    }

    /// What a comparison takes for its error: infinity where there is none, or a wrong one.
    pub(crate) fn error_or_failure(&self, field: Field) -> f64 {
        if self.found() { self.get(field).unwrap_or(f64::INFINITY) } else { f64::INFINITY }
    }
}

/// That the run's manifest, if it has one, is of a format that is known, a later minor version only adding, and that a finished
/// run has all its logs.
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

/// Everything that came of the attempts of `frame`, bit by bit; times alone are left out.
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
