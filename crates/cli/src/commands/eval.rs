//! `seafix eval`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum, builder::PossibleValue};
use seafix_evaluation::trajectory::{
    Alignment, Delta, Leg, Pose, Relation, Summary, align, ape, associate, drift, pairs, path_lengths, rpe,
};
use seafix_experiment::trajectory::{Format, Trajectory, Way};
use serde_json::{Value, json};

use crate::{
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    terminal::{print, tell},
    whole,
};

/// Below this share of matched poses the statistics come with a warning.
const MOSTLY: f64 = 0.9;

#[derive(Debug, Args)]
pub(crate) struct Eval {
    /// The trajectory to measure against: TUM, KITTI or EuRoC; or a log (.mcap), for its truth.
    reference: PathBuf,
    /// The trajectory to judge; left out, a way of the log.
    estimate: Option<PathBuf>,
    /// Which way of a log is judged.
    #[arg(long, value_enum, default_value = "odometry")]
    way: LoggedWay,
    /// Lay the estimate on the reference first (Umeyama).
    #[arg(short, long)]
    align: bool,
    /// Correct the scale of the estimate; alone, only the scale.
    #[arg(short, long)]
    scale: bool,
    /// Lay the first matched pose of the estimate on the reference's.
    #[arg(long, conflicts_with = "align")]
    align_origin: bool,
    /// Find the alignment from so many first poses.
    #[arg(long, value_name = "N")]
    n_to_align: Option<usize>,
    /// What of a pose difference counts.
    #[arg(short, long, default_value = "trans_part")]
    relation: Name,
    /// How far apart the poses of a relative error are.
    #[arg(short, long, default_value_t = 1.0)]
    delta: f64,
    /// The unit of the delta: frames, metres, degrees or radians.
    #[arg(short = 'u', long, default_value = "f")]
    delta_unit: Unit,
    /// By which share of the delta a pair of --all-pairs may miss it.
    #[arg(long, default_value_t = 0.1)]
    delta_tol: f64,
    /// Take pairs from every pose on, not only one after the other.
    #[arg(long)]
    all_pairs: bool,
    /// Choose the pairs along the reference instead of the estimate.
    #[arg(long)]
    pairs_from_reference: bool,
    /// Poses further apart in time (s) do not belong together.
    #[arg(long, default_value_t = 0.01)]
    t_max_diff: f64,
    /// Added to the estimate's stamps (s).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    t_offset: f64,
    /// The lengths (m) of the stretches over which drift is taken.
    #[arg(long, value_delimiter = ',', default_value = "5,10,20,40")]
    segments: Vec<f64>,
    /// Write the matched, aligned estimate: `.tum`, `.kitti` or `.csv` (EuRoC).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A relation by its name.
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

/// A way that a log holds.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum LoggedWay {
    /// By odometry alone.
    Odometry,
    /// By the navigated pose and the survey.
    Navigated,
}

impl From<LoggedWay> for Way {
    fn from(way: LoggedWay) -> Self {
        match way {
            LoggedWay::Odometry => Self::Odometry,
            LoggedWay::Navigated => Self::Navigated,
        }
    }
}

fn is_log(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "mcap")
}

fn read(file: &Path, way: Way) -> Result<Trajectory, Failure> {
    let read = if is_log(file) { Trajectory::of_log(file, way) } else { Trajectory::read(file) };
    read.map_err(|fault| Failure::new(INPUT, fault))
}

/// The poses that belong together.
struct Matched {
    reference: Vec<Pose>,
    estimate: Vec<Pose>,
    stamps: Option<Vec<u64>>,
    /// How many poses the two files hold.
    of: (usize, usize),
    /// The share of the reference's time between the first and the last matched pose.
    covered: f64,
}

impl Matched {
    /// The share of the shorter trajectory that found its partner.
    fn share(&self) -> f64 {
        self.reference.len() as f64 / self.of.0.min(self.of.1).max(1) as f64
    }
}

impl Eval {
    pub(crate) fn execute(&self) -> Ended {
        let delta = self.delta()?;
        let mut matched = self.matched()?;
        let alignment = self.alignment(&matched)?;
        if let Some(alignment) = &alignment {
            matched.estimate.iter_mut().for_each(|pose| *pose = alignment.apply(pose));
        }
        let Name(relation) = self.relation;
        let absolute = relation.is_absolute().then(|| ape(&matched.reference, &matched.estimate, relation));
        let along = if self.pairs_from_reference { &matched.reference } else { &matched.estimate };
        let pairs = pairs(along, delta, self.all_pairs, self.delta_tol);
        let found = Found {
            ape: absolute.map(|errors| Summary::of(&errors)),
            rpe: Summary::of(&rpe(&matched.reference, &matched.estimate, &pairs, relation)),
            legs: drift(&matched.reference, &matched.estimate, &self.segments),
            path: path_lengths(&matched.reference).last().copied().unwrap_or(0.0),
            end: end(&matched),
            alignment,
        };
        if matched.covered < MOSTLY {
            let (reference, estimate) = (self.reference.display(), self.estimate().display());
            let covered = 100.0 * matched.covered;
            tell(&format!(
                "warning: {estimate} covers {covered:.1} % of the time of {reference}; errors speak for that part"
            ));
        }
        if matched.share() < MOSTLY {
            let (n, (a, b)) = (matched.reference.len(), matched.of);
            tell(&format!(
                "warning: only {n} poses matched, of {a} in {} and {b} in {}; check --t-offset and --t-max-diff",
                self.reference.display(),
                self.estimate().display()
            ));
        }
        if let Some(file) = &self.out {
            let way = Trajectory { stamps: matched.stamps.clone(), poses: matched.estimate.clone() };
            whole::write(file, way.print(Format::of_name(file)))?;
        }
        print(&if self.json { self.machine(&matched, &found) } else { self.people(&matched, &found) })?;
        Ok(DONE)
    }

    /// The file with what is judged.
    fn estimate(&self) -> &Path {
        self.estimate.as_ref().unwrap_or(&self.reference)
    }

    fn delta(&self) -> Result<Delta, Failure> {
        let refuse = |what: &str| Err(Failure::new(USAGE, format!("--delta {}: {what}", self.delta)));
        if !(self.delta > 0.0 && self.delta.is_finite()) {
            return refuse("give a number above zero");
        }
        if !(self.delta_tol >= 0.0 && self.delta_tol.is_finite()) {
            return Err(Failure::new(USAGE, format!("--delta-tol {}: give a share, zero or above", self.delta_tol)));
        }
        if let Some(wrong) = self.segments.iter().find(|&&length| !(length > 0.0 && length.is_finite())) {
            return Err(Failure::new(USAGE, format!("--segments {wrong}: give lengths above zero, in metres")));
        }
        match self.delta_unit {
            Unit::F if self.delta.fract() != 0.0 => refuse("frames are counted in whole numbers"),
            Unit::F => Ok(Delta::Frames(self.delta as usize)),
            Unit::M => Ok(Delta::Metres(self.delta)),
            Unit::D if self.delta > 180.0 => refuse("an angle is at most 180 degrees"),
            Unit::D => Ok(Delta::Radians(self.delta.to_radians())),
            Unit::R if self.delta > std::f64::consts::PI => refuse("an angle is at most pi"),
            Unit::R => Ok(Delta::Radians(self.delta)),
        }
    }

    fn matched(&self) -> Result<Matched, Failure> {
        let nanoseconds = |name: &str, seconds: f64| {
            let ns = seconds * 1e9;
            if !(ns.abs() < 9e18) {
                return Err(Failure::new(USAGE, format!("{name} {seconds}: give seconds")));
            }
            Ok(ns.round() as i64)
        };
        let tolerance = u64::try_from(nanoseconds("--t-max-diff", self.t_max_diff)?).map_err(|_| {
            Failure::new(USAGE, format!("--t-max-diff {}: give seconds, not negative", self.t_max_diff))
        })?;
        let offset = nanoseconds("--t-offset", self.t_offset)?;
        if self.estimate.is_none() && !is_log(&self.reference) {
            return Err(Failure::new(USAGE, "no trajectory to judge; give ESTIMATE, or a log for both"));
        }
        let (reference, estimate) = (read(&self.reference, Way::True)?, read(self.estimate(), self.way.into())?);
        let of = (reference.poses.len(), estimate.poses.len());
        let refuse = |what: String| {
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
                return refuse(format!(
                    "{} and {} poses, one of them without stamps; give as many poses, or stamps, to both,",
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
            return refuse(format!(
                "only {} of {} and {} poses belong together; check --t-offset and --t-max-diff,",
                belong.len(),
                of.0,
                of.1
            ));
        }
        let (reference, estimate) = belong.iter().map(|&(i, j)| (reference.poses[i], estimate.poses[j])).unzip();
        Ok(Matched { reference, estimate, stamps, of, covered })
    }

    fn alignment(&self, matched: &Matched) -> Result<Option<Alignment>, Failure> {
        if self.align_origin {
            return Ok(Some(Alignment::onto(&matched.reference[0], &matched.estimate[0])));
        }
        if !self.align && !self.scale {
            return Ok(None);
        }
        let n = self.n_to_align.unwrap_or(usize::MAX).min(matched.reference.len());
        let found = align(&matched.reference[..n], &matched.estimate[..n], self.scale).map_err(|why| {
            let (a, b) = (self.reference.display(), self.estimate().display());
            Failure::new(INPUT, format!("no alignment of {b} with {a}: {why}"))
        })?;
        Ok(Some(if self.align { found } else { Alignment { scale: found.scale, ..Alignment::IDENTITY } }))
    }

    fn people(&self, matched: &Matched, found: &Found) -> String {
        let Name(relation) = self.relation;
        let n = matched.reference.len();
        let mut text = format!(
            "matched    {n} poses: {:.1} % of {} in {}, {:.1} % of {} in {}\n",
            100.0 * n as f64 / matched.of.0 as f64,
            matched.of.0,
            self.reference.display(),
            100.0 * n as f64 / matched.of.1 as f64,
            matched.of.1,
            self.estimate().display(),
        );
        text += &match &found.alignment {
            None => "alignment  none\n".to_owned(),
            Some(_) if self.align_origin => "alignment  first pose on first pose\n".to_owned(),
            Some(alignment) if !self.align => format!("alignment  scale only, {:.6}\n", alignment.scale),
            Some(alignment) if self.scale => format!("alignment  similarity, scale {:.6}\n", alignment.scale),
            Some(_) => "alignment  rigid\n".to_owned(),
        };
        text += &format!("path       {:.3} m of reference, {:.4} m apart at its end", found.path, found.end);
        text +=
            &if found.path > 0.0 { format!(" ({:.3} %)\n\n", 100.0 * found.end / found.path) } else { "\n\n".into() };
        text += &format!("{:32}", format!("{} ({})", relation.name(), relation.unit()));
        text += &columns(&["rmse", "mean", "median", "std", "min", "max", "sse", "p95", "pairs"].map(str::to_owned));
        let mut row = |name: String, summary: &Summary| {
            let numbers = [
                summary.rmse,
                summary.mean,
                summary.median,
                summary.std,
                summary.min,
                summary.max,
                summary.sse,
                summary.p95,
            ];
            let mut cells: Vec<String> = numbers.iter().map(|x| significant(*x)).collect();
            cells.push(summary.pairs.to_string());
            text += &format!("{name:32}{}", columns(&cells));
        };
        if let Some(ape) = &found.ape {
            row("APE".to_owned(), ape);
        }
        let unit = match self.delta_unit {
            Unit::F if self.delta == 1.0 => "frame",
            Unit::F => "frames",
            Unit::M => "m",
            Unit::D => "deg",
            Unit::R => "rad",
        };
        let kind = if self.all_pairs { "all pairs" } else { "consecutive" };
        row(format!("RPE over {} {unit}, {kind}", self.delta), &found.rpe);
        let heads = ["mean %", "rms %", "median %", "p95 %", "deg/m", "legs"].map(str::to_owned);
        text += &format!("\n{:32}{}", "drift over", columns(&heads));
        for (length, share, turn) in self.legs(found) {
            let mut cells: Vec<String> =
                [share.mean, share.rmse, share.median, share.p95].iter().map(|x| significant(100.0 * x)).collect();
            cells.push(significant(turn.mean.to_degrees()));
            cells.push(share.pairs.to_string());
            text += &format!("{:32}{}", format!("{length} m"), columns(&cells));
        }
        text
    }

    /// The legs of each length: translation as a share, rotation in rad/m.
    fn legs(&self, found: &Found) -> Vec<(f64, Summary, Summary)> {
        let of = |length: f64| {
            let legs: Vec<&Leg> = found.legs.iter().filter(|leg| leg.length == length).collect();
            let summary = |error: fn(&Leg) -> f64| Summary::of(&legs.iter().map(|leg| error(leg)).collect::<Vec<_>>());
            (length, summary(|leg| leg.translation), summary(|leg| leg.rotation))
        };
        self.segments.iter().map(|&length| of(length)).collect()
    }

    fn machine(&self, matched: &Matched, found: &Found) -> String {
        let legs: Vec<Value> = self
            .legs(found)
            .iter()
            .map(|(length, share, turn)| {
                json!({
                    "length_m": length,
                    "legs": share.pairs,
                    "translation_percent": {
                        "mean": 100.0 * share.mean, "rmse": 100.0 * share.rmse,
                        "median": 100.0 * share.median, "p95": 100.0 * share.p95,
                    },
                    "rotation_deg_per_m": { "mean": turn.mean.to_degrees(), "rmse": turn.rmse.to_degrees() },
                })
            })
            .collect();
        let Name(relation) = self.relation;
        let value = json!({
            "relation": relation.name(),
            "unit": relation.unit(),
            "ape": found.ape.as_ref().map(summary),
            "rpe": summary(&found.rpe),
            "segments": legs,
            "path_m": found.path,
            "end_m": found.end,
            "matched": {
                "poses": matched.reference.len(), "reference": matched.of.0, "estimate": matched.of.1,
                "share": matched.share(), "covered": matched.covered,
            },
            "alignment": found.alignment.as_ref().map(|alignment| json!({
                "matrix": alignment.rows(), "scale": alignment.scale,
            })),
        });
        format!("{value}\n")
    }
}

struct Found {
    ape: Option<Summary>,
    rpe: Summary,
    legs: Vec<Leg>,
    path: f64,
    /// The distance of the last poses (m), the first laid on each other.
    end: f64,
    alignment: Option<Alignment>,
}

/// How far apart two ways end that begin in one pose.
fn end(matched: &Matched) -> f64 {
    let way = |poses: &[Pose]| poses[0].to(&poses[poses.len() - 1]).position;
    (way(&matched.reference) - way(&matched.estimate)).norm()
}

fn summary(of: &Summary) -> Value {
    json!({
        "rmse": of.rmse, "mean": of.mean, "median": of.median, "std": of.std, "min": of.min, "max": of.max,
        "sse": of.sse, "p75": of.p75, "p95": of.p95, "p99": of.p99, "pairs": of.pairs,
    })
}

fn columns(cells: &[String]) -> String {
    cells.iter().map(|cell| format!("{cell:>11}")).collect::<String>() + "\n"
}

/// A number with five significant digits.
fn significant(x: f64) -> String {
    if x.is_nan() {
        "–".to_owned()
    } else if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        let digits = if x == 0.0 { 0 } else { x.abs().log10().floor() as i32 };
        format!("{x:.*}", usize::try_from(4 - digits).unwrap_or(0).min(7))
    } else {
        format!("{x:.4e}")
    }
}
