//! `seafix eval`.

mod matched;
mod output;
mod sites;
mod unassociated;

use matched::Matched;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum, builder::PossibleValue};
use seafix_data::{
    trajectory::{Format, LoggedTrajectory, Trajectory},
    trajectory_fault,
};
use seafix_evaluation::trajectory::{
    Alignment, Delta, DriftSegment, Plane, Relation, Summary, ape, drift, drift_of_positions, pairs, path_lengths, rpe,
};

use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    terminal::{notify, print},
};

/// Minimum fraction of matched poses; a smaller one causes a warning.
const MOSTLY: f64 = 0.9;

#[derive(Debug, Args)]
pub(crate) struct Eval {
    /// The reference trajectory: TUM, KITTI or EuRoC, or a log (.mcap) for its truth; or a site (.toml), to compare the
    /// points of another one with it.
    reference: PathBuf,
    /// The estimated trajectory [default: a trajectory of the log], or the other site.
    estimate: Option<PathBuf>,
    /// The evaluated trajectory of a log.
    #[arg(long, value_enum, default_value = "odometry")]
    trajectory: TrajectoryArgument,
    /// Align the estimate with the reference first (Umeyama).
    #[arg(short, long)]
    align: bool,
    /// Correct the scale of the estimate; without --align, only the scale.
    #[arg(short, long)]
    scale: bool,
    /// Align the first matched poses.
    #[arg(long, conflicts_with = "align")]
    align_origin: bool,
    /// Align with the first N poses only.
    #[arg(long, value_name = "N")]
    n_to_align: Option<usize>,
    /// The measured part of a pose difference.
    #[arg(short, long, default_value = "trans_part")]
    relation: Name,
    /// Distance of the two poses of a relative error.
    #[arg(short, long, default_value_t = 1.0)]
    delta: f64,
    /// Unit of the delta: frames, metres, degrees or radians.
    #[arg(short = 'u', long, default_value = "f")]
    delta_unit: Unit,
    /// Tolerance of the delta with --all-pairs, as a fraction.
    #[arg(long, default_value_t = 0.1)]
    delta_tol: f64,
    /// Use a pair from every pose, not only consecutive pairs.
    #[arg(long)]
    all_pairs: bool,
    /// Choose pairs along the reference instead of the estimate.
    #[arg(long)]
    pairs_from_reference: bool,
    /// Maximum difference of associated stamps (s).
    #[arg(long, default_value_t = 0.01)]
    t_max_diff: f64,
    /// Association of the poses in time.
    #[arg(long, value_enum, default_value = "nearest-time")]
    sync_method: SyncMethod,
    /// First time of the reference (s); earlier poses are not evaluated.
    #[arg(long, allow_negative_numbers = true)]
    t_start: Option<f64>,
    /// Last time of the reference (s); later poses are not evaluated.
    #[arg(long, allow_negative_numbers = true)]
    t_end: Option<f64>,
    /// Project both trajectories into a plane of the reference, after the alignment.
    #[arg(long, value_enum, value_name = "PLANE")]
    project_to_plane: Option<PlaneArgument>,
    /// Sort lines by time and keep the first of each stamp; by default unsorted lines are an error.
    #[arg(long)]
    sort_stamps: bool,
    /// Offset that is added to the estimate's stamps (s).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    t_offset: f64,
    /// Path lengths (m) of the drift segments.
    #[arg(long, value_delimiter = ',', default_value = "5,10,20,40")]
    segments: Vec<f64>,
    /// Write the matched, aligned estimate to this file: `.tum`, `.kitti` or `.csv` (EuRoC).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A relation with its name on the command line.
#[derive(Debug, Clone, Copy)]
struct Name(Relation);

impl ValueEnum for Name {
    fn value_variants<'a>() -> &'a [Self] {
        const NAMES: [Name; 7] = {
            let mut names = [Name(Relation::Full); 7];
            let mut i = 0;
            while i < 7 {
                names[i] = Name(Relation::ALL[i]);
                i += 1;
            }
            names
        };
        &NAMES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Unit {
    /// Frames.
    F,
    /// Metres of path.
    M,
    /// Degrees.
    D,
    /// Radians.
    R,
}

/// The association of two trajectories in time.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum SyncMethod {
    /// Each pose of the shorter trajectory with the nearest one of the longer.
    #[value(alias = "nearest_time")]
    NearestTime,
    /// The same poses, with those of the longer trajectory interpolated at the stamps of the shorter one.
    Interpolation,
}

/// A coordinate plane.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum PlaneArgument {
    Xy,
    Xz,
    Yz,
}

impl From<PlaneArgument> for Plane {
    fn from(plane: PlaneArgument) -> Self {
        match plane {
            PlaneArgument::Xy => Self::Xy,
            PlaneArgument::Xz => Self::Xz,
            PlaneArgument::Yz => Self::Yz,
        }
    }
}

/// A trajectory of a log.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum TrajectoryArgument {
    /// By odometry only.
    Odometry,
    /// By the navigated pose and the survey.
    Navigated,
}

impl From<TrajectoryArgument> for LoggedTrajectory {
    fn from(trajectory: TrajectoryArgument) -> Self {
        match trajectory {
            TrajectoryArgument::Odometry => Self::Odometry,
            TrajectoryArgument::Navigated => Self::Navigated,
        }
    }
}

/// The errors of a trajectory.
struct Errors {
    ape: Option<Summary>,
    rpe: Summary,
    segments: Vec<DriftSegment>,
    path: f64,
    /// The distance of the last poses (m) after alignment of the first; `None` after a break.
    end: Option<f64>,
    alignment: Option<Alignment>,
    /// The relation of the relative error.
    relation: Relation,
}

/// The relations of the absolute and of the relative error.
struct Measures {
    ape: Option<Relation>,
    rpe: Relation,
}

/// A count as text: `once`, `2 times`.
fn times(count: usize) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

impl Eval {
    pub(crate) fn execute(&self) -> Ended {
        if sites::is_site(&self.reference) {
            return sites::execute(&self.reference, self.estimate.as_deref(), self.json);
        }
        let delta = self.delta()?;
        let mut matched = self.matched()?;
        let measures = self.measures(&matched)?;
        if let [0] = matched.sections[..] {
            let has_attitude = matched.without_attitude.is_none();
            let fault = trajectory_fault(&matched.reference, &matched.estimate, has_attitude, self.estimate());
            fault.iter().for_each(|fault| notify(&format!("warning: {fault}")));
        }
        let alignment = self.alignment(&matched)?;
        if let Some(alignment) = &alignment {
            matched.estimate.iter_mut().for_each(|pose| *pose = alignment.apply(pose));
        }
        if let Some(plane) = self.project_to_plane {
            let plane = Plane::from(plane);
            matched.reference.iter_mut().chain(&mut matched.estimate).for_each(|pose| *pose = plane.project(pose));
        }
        let absolute = measures.ape.map(|relation| ape(&matched.reference, &matched.estimate, relation));
        let along = if self.pairs_from_reference { &matched.reference } else { &matched.estimate };
        // Motions across a break are unknown and not evaluated.
        let (mut both, mut segments) = (Vec::new(), Vec::new());
        for section in matched.sections() {
            let from = section.start;
            let own = pairs(&along[section.clone()], delta, self.all_pairs, self.delta_tol);
            both.extend(own.into_iter().map(|(i, j)| (from + i, from + j)));
            let (reference, estimate) = (&matched.reference[section.clone()], &matched.estimate[section]);
            let own = match matched.without_attitude {
                None => drift(reference, estimate, &self.segments),
                Some(_) => drift_of_positions(reference, estimate, &self.segments),
            };
            segments.extend(own.into_iter().map(|segment| DriftSegment {
                from: from + segment.from,
                to: from + segment.to,
                ..segment
            }));
        }
        let found = Errors {
            ape: absolute.map(|errors| Summary::of(&errors)),
            rpe: Summary::of(&rpe(&matched.reference, &matched.estimate, &both, measures.rpe)),
            segments,
            path: path_lengths(&matched.reference).last().copied().unwrap_or(0.0),
            end: if matched.without_attitude.is_none() { matched.end() } else { None },
            alignment,
            relation: measures.rpe,
        };
        if matched.sections.len() > 1 {
            notify(&format!(
                "warning: the trajectory is broken {}; RPE and drift are computed between the breaks, and APE is valid only if \
                 the rig did not move in them",
                times(matched.sections.len() - 1)
            ));
        }
        if matched.covered < MOSTLY {
            let (reference, estimate) = (self.reference.display(), self.estimate().display());
            let covered = 100.0 * matched.covered;
            notify(&format!(
                "warning: {estimate} covers {covered:.1} % of the time of {reference}; errors are those of that part"
            ));
        }
        if matched.fraction() < MOSTLY {
            let (n, (a, b)) = (matched.reference.len(), matched.of);
            notify(&format!(
                "warning: only {n} poses matched, of {a} in {} and {b} in {}; check --t-offset and --t-max-diff",
                self.reference.display(),
                self.estimate().display()
            ));
        }
        if let Some(file) = &self.out {
            let breaks = matched.sections[1..].to_vec();
            let trajectory = Trajectory {
                stamps: matched.stamps.clone(),
                poses: matched.estimate.clone(),
                breaks,
                has_attitude: true,
                warnings: Vec::new(),
            };
            let inputs = [&*self.reference, self.estimate()];
            let file_out = AtomicFile::begin(file, self.replacing, &inputs)?;
            file_out.finish(trajectory.print(Format::of_name(file)))?;
        }
        print(&if self.json { self.json(&matched, &found) } else { self.text(&matched, &found) })?;
        Ok(DONE)
    }

    /// The relations that the attitudes of the two files allow.
    fn measures(&self, matched: &Matched) -> Result<Measures, Failure> {
        let Name(relation) = self.relation;
        let ape = relation.is_absolute().then_some(relation);
        let Some(file) = &matched.without_attitude else { return Ok(Measures { ape, rpe: relation }) };
        let usage_error = |what: &str| {
            let remedy = "positions allow trans_part (APE), point_distance and point_distance_error_ratio";
            Err(Failure::new(INPUT, format!("no attitude in {}: {what}; {remedy}", file.display())))
        };
        if self.align_origin {
            return usage_error("--align-origin needs one; use --align");
        }
        if matches!(self.delta_unit, Unit::D | Unit::R) {
            return usage_error("a --delta of an angle needs one; give frames or metres");
        }
        match relation {
            Relation::Translation => {
                notify(&format!("warning: no attitude in {}: the RPE is that of point_distance", file.display()));
                Ok(Measures { ape, rpe: Relation::PointDistance })
            }
            Relation::PointDistance | Relation::PointDistanceRatio => Ok(Measures { ape, rpe: relation }),
            _ => usage_error(&format!("{} needs one", relation.name())),
        }
    }

    /// The file of the estimate.
    fn estimate(&self) -> &Path {
        self.estimate.as_ref().unwrap_or(&self.reference)
    }

    fn delta(&self) -> Result<Delta, Failure> {
        let usage_error = |what: &str| Err(Failure::new(USAGE, format!("invalid --delta {}: {what}", self.delta)));
        if !(self.delta > 0.0 && self.delta.is_finite()) {
            return usage_error("give a number above zero");
        }
        if !(self.delta_tol >= 0.0 && self.delta_tol.is_finite()) {
            return Err(Failure::new(
                USAGE,
                format!("invalid --delta-tol {}; give a fraction of at least zero", self.delta_tol),
            ));
        }
        if let Some(wrong) = self.segments.iter().find(|&&length| !(length > 0.0 && length.is_finite())) {
            return Err(Failure::new(USAGE, format!("invalid --segments {wrong}; give lengths above zero, in metres")));
        }
        match self.delta_unit {
            Unit::F if self.delta.fract() != 0.0 => usage_error("give a whole number of frames"),
            Unit::F => Ok(Delta::Frames(self.delta as usize)),
            Unit::M => Ok(Delta::Metres(self.delta)),
            Unit::D if self.delta > 180.0 => usage_error("give an angle of at most 180 degrees"),
            Unit::D => Ok(Delta::Radians(self.delta.to_radians())),
            Unit::R if self.delta > std::f64::consts::PI => usage_error("give an angle of at most pi"),
            Unit::R => Ok(Delta::Radians(self.delta)),
        }
    }
}
