//! `seafix odometry`.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;
use rayon::ThreadPoolBuilder;
use seafix_component::{Choice, Fault};
use seafix_data::{StereoPairs, dataset::tum};
use seafix_experiment::changed;
use seafix_io::ImageLimits;
use seafix_navigation::{
    Lost, ODOMETRIES, Odometry, OdometryOutcome, OdometryTrajectory, RangeOffset, Segment, StereoPair,
};
use seafix_vision::{RightCameraRotation, Threads};
use serde_json::{Value, json};

use super::{
    pair_source::{PairSource, turned, with_readings},
    set::built,
};
use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, INPUT, OUTPUT, USAGE},
    terminal::{Progress, notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct OdometryCommand {
    /// The folder of a data set, a recording of ROS 2 (an MCAP file or a folder of rosbag2) or the log of a trial with
    /// its images; site and truth are not used.
    pairs: PathBuf,
    #[command(flatten)]
    pair_source: PairSource,
    /// Write the poses world_from_camera to this file in TUM's format; the world frame is the first left camera.
    #[arg(long, value_name = "FILE.tum")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
    /// The odometry component.
    #[arg(long, default_value = "stereo", value_name = "NAME")]
    odometry: String,
    /// Change a setting of the odometry: a dotted key and a TOML value, `detector.features=2000`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Sort pairs by time and keep the first of each stamp; by default unsorted pairs are an error.
    #[arg(long)]
    sort_stamps: bool,
    /// Do not correct the rotation of the right camera or the offset of the disparities, even if images or motion
    /// contradict the rig.
    #[arg(long)]
    keep_rig: bool,
    /// Number of threads; poses do not depend on it.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Print one JSON object with all poses, skipped pairs and times.
    #[arg(long)]
    json: bool,
}

/// Median fraction of landmarks that agree with the motion; a smaller one causes a warning.
const LITTLE_AGREEMENT: f64 = 0.45;

/// The result of the odometry over all pairs.
struct Estimate {
    trajectory: OdometryTrajectory,
    /// Stamps of the pairs that the odometry received.
    given: Vec<u64>,
    /// Stamps of the pairs with unreadable images, with the faults.
    unread: Vec<(u64, Fault)>,
    /// Time of the odometry (ms), without reading of files.
    odometry_ms: f64,
    /// The offset of the rig's disparities that the motion revealed.
    range_offset: Option<RangeOffset>,
}

impl OdometryCommand {
    pub(crate) fn execute(&self) -> Ended {
        let (odometry, settings) = self.build()?;
        let mut pairs = self.pair_source.open(&self.pairs, self.sort_stamps, ImageLimits::default())?;
        pairs.warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        with_readings(&pairs, &*odometry, &self.odometry)?;
        let pool = ThreadPoolBuilder::new()
            .num_threads(usize::from(self.threads))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot start threads: {error}")))?;
        // An output that cannot be written is reported before the work.
        let begin = |path| AtomicFile::begin(path, self.replacing, &[&self.pairs]);
        let out = self.out.as_deref().map(begin).transpose()?;
        if let Some(fault) = pairs.swapped() {
            return Err(Failure::new(INPUT, fault));
        }
        let right_camera_rotation =
            if self.keep_rig || odometry.needs_readings() { None } else { pairs.right_camera_rotation() };
        if let Some(found) = &right_camera_rotation {
            pairs.rig = found.rig;
        }
        let mut estimate = pool.install(|| self.estimate(&*odometry, &pairs))?;
        let range_offset = estimate.range_offset;
        if let Some(found) = range_offset.filter(|found| found.corrected) {
            // The first pairs preceded the correction.
            pairs.rig = pairs.rig.with_range_offset(found.pixels);
            estimate = pool.install(|| self.estimate(&*odometry, &pairs))?;
        }
        if let Some(fault) = estimate.motionless(pairs.path()) {
            return Err(Failure::new(INPUT, fault));
        }
        let reported = right_camera_rotation.as_ref().map(turned);
        let reported = reported.into_iter().chain(range_offset.as_ref().map(offset));
        let warnings: Vec<String> = reported.chain(estimate.warnings()).collect();
        warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        if let Some(out) = out {
            out.finish(poses(&estimate.trajectory))?;
        }
        print(&if self.json {
            json(&estimate, right_camera_rotation.as_ref(), range_offset.as_ref(), &warnings, &settings)
        } else {
            text(&estimate)
        })?;
        Ok(DONE)
    }

    /// The odometry and its complete settings.
    fn build(&self) -> Result<(Box<dyn Odometry>, Choice), Failure> {
        let usage = |error| Failure::new(USAGE, error);
        let choice = ODOMETRIES.resolve(&Choice::named(&self.odometry)).map_err(usage)?;
        let kept = self.keep_rig && choice.settings.contains_key("correct-range-offset");
        let kept = kept.then(|| "correct-range-offset=false".to_owned());
        let set: Vec<String> = self.set.iter().cloned().chain(kept).collect();
        let change = |set: &[String]| changed(&choice.settings, "--set", set, "detector.features=2000");
        let (_, made) = built(&set, change, |settings| {
            let choice = ODOMETRIES.resolve(&Choice { settings: settings.clone(), ..choice.clone() })?;
            ODOMETRIES.build(&choice).map(|odometry| (odometry, choice))
        })?;
        Ok(made)
    }

    /// Processes all readable pairs.
    fn estimate(&self, odometry: &dyn Odometry, pairs: &StereoPairs) -> Result<Estimate, Failure> {
        let threads = if self.threads > 1 { Threads::Pool } else { Threads::One };
        let mut session = odometry.begin(&pairs.rig, pairs.body_from_camera, threads);
        let progress = Progress::new();
        progress.expect(pairs.stamps().len());
        let (mut given, mut unread, mut odometry_ms) = (Vec::new(), Vec::new(), 0.0);
        let mut printed = HashSet::new();
        for (index, &stamp_ns) in pairs.stamps().iter().enumerate() {
            let readings = pairs.readings(index).map_err(|fault| Failure::new(INPUT, fault))?;
            readings.iter().for_each(|reading| session.sense(reading));
            match pairs.pair(index) {
                Err(fault) => {
                    let warning = format!("warning: {fault}");
                    if !printed.contains(&warning) {
                        notify(&warning);
                        printed.insert(warning);
                    }
                    unread.push((stamp_ns, fault));
                }
                Ok((left, right)) => {
                    let pair = StereoPair { stamp_ns, left: &left, right: &right };
                    let start = Instant::now();
                    session.advance(&pair).map_err(|error| Failure::new(INPUT, error))?;
                    odometry_ms += start.elapsed().as_secs_f64() * 1e3;
                    given.push(stamp_ns);
                }
            }
            progress.step("");
        }
        progress.end();
        // A sequence with less than half of its pairs is not evaluated.
        if given.len() < unread.len() {
            let fault = Fault::new("fewer than half of the stereo pairs can be read", pairs.path())
                .value(format!("{} of {}", given.len(), given.len() + unread.len()))
                .remedy("restore the images named above, or remove their lines");
            return Err(Failure::new(INPUT, fault));
        }
        let range_offset = session.range_offset();
        Ok(Estimate { trajectory: session.trajectory(), given, unread, odometry_ms, range_offset })
    }
}

/// The warning of an offset of the disparities.
fn offset(found: &RangeOffset) -> String {
    let RangeOffset { pixels, sigma, windows, corrected } = found;
    let done = match corrected {
        true => "was corrected (`--keep-rig` prevents it)",
        false => "was not corrected",
    };
    format!(
        "the motion contradicts the rig: its disparities have an offset of {pixels:.2} ± {sigma:.2} px ({windows} windows of \
         key frames), which {done}; calibrate again, since other parameters may be wrong too"
    )
}

impl Estimate {
    /// The stamps of skipped pairs with reasons, in order of time.
    fn left_out(&self) -> Vec<(u64, String)> {
        let skipped = self.given.iter().zip(&self.trajectory.outcomes).filter_map(|(stamp, outcome)| match outcome {
            OdometryOutcome::Skipped(lost) => Some((*stamp, lost.to_string())),
            OdometryOutcome::Began | OdometryOutcome::Followed { .. } => None,
        });
        let unread = self.unread.iter().map(|(stamp, fault)| (*stamp, fault.to_string()));
        let mut all: Vec<_> = skipped.chain(unread).collect();
        all.sort_unstable();
        all
    }

    /// The fault of a sequence without a motion: number of pairs and most frequent cause.
    fn motionless(&self, folder: &Path) -> Option<Fault> {
        let outcomes = &self.trajectory.outcomes;
        if outcomes.iter().any(|outcome| matches!(outcome, OdometryOutcome::Followed { .. })) {
            return None;
        }
        let (poses, pairs) = (self.trajectory.waypoints().count(), self.given.len() + self.unread.len());
        let fault = Fault::new("no motion can be computed", folder);
        let counts = format!("{} from {}", counted(poses, "pose"), counted(pairs, "stereo pair"));
        let skipped = |outcome: &OdometryOutcome| match outcome {
            OdometryOutcome::Skipped(lost) => Some(lost.clone()),
            OdometryOutcome::Began | OdometryOutcome::Followed { .. } => None,
        };
        let breaks = self.trajectory.segments.iter().filter_map(|segment| segment.broken.clone());
        let reasons: Vec<Lost> = outcomes.iter().filter_map(skipped).chain(breaks).collect();
        let alike =
            |a: &Lost| reasons.iter().filter(|b| std::mem::discriminant(a) == std::mem::discriminant(b)).count();
        // A pair that starts a segment is not skipped, although no motion leads to it.
        let reported = |a: &Lost| {
            let same = |b: &Lost| std::mem::discriminant(a) == std::mem::discriminant(b);
            let out = outcomes.iter().filter_map(skipped).filter(same).count();
            match alike(a) - out {
                0 => format!("{out} skipped"),
                breaks => format!("{} without a motion", out + breaks),
            }
        };
        // The first cause of the most frequent kind.
        let max = reasons.iter().rev().max_by_key(|lost| alike(lost));
        let unread = self.unread.len();
        Some(match max {
            Some(lost) if alike(lost) >= unread => {
                fault.value(format!("{counts}; {}: {lost}", reported(lost))).remedy(match lost {
                    Lost::Still { .. } => "mask parts of the vehicle in the images",
                    Lost::Jump { .. } => "check the stamps of the pairs, and that the rig is the one that took them",
                    _ => "check the images and that the rig is the one that took them",
                })
            }
            _ if unread > 0 => {
                fault.value(format!("{counts}; {unread} cannot be read")).remedy("restore the images named above")
            }
            _ => fault.value(counts).remedy("a motion needs at least two stereo pairs"),
        })
    }

    /// Warnings about the complete trajectory.
    fn warnings(&self) -> Vec<String> {
        let agreement = self.trajectory.agreement().filter(|fraction| *fraction < LITTLE_AGREEMENT);
        let message = |fraction: f64| {
            format!(
                "only {:.0} % of the landmarks agree with the motion (median over the pairs): a part of the vehicle may be in \
                 view, or the cameras may not be synchronised",
                100.0 * fraction
            )
        };
        agreement.map(message).into_iter().collect()
    }

    /// The minimum and mean number of landmarks tracked in a pair, and the mean number searched for; `None` without
    /// landmarks.
    fn landmarks(&self) -> Option<[f64; 3]> {
        let followed: Vec<(usize, usize)> = self.trajectory.outcomes.iter().filter_map(of_followed).collect();
        let count = followed.len() as f64;
        let min = followed.iter().map(|(_, found)| *found).min()?;
        let mean = |pick: fn(&(usize, usize)) -> usize| followed.iter().map(pick).sum::<usize>() as f64 / count;
        Some([min as f64, mean(|one| one.1), mean(|one| one.0)])
    }

    fn pairs_a_second(&self) -> f64 {
        1e3 * self.given.len() as f64 / self.odometry_ms
    }
}

fn of_followed(outcome: &OdometryOutcome) -> Option<(usize, usize)> {
    match outcome {
        OdometryOutcome::Followed { sought, found } if *sought > 0 => Some((*sought, *found)),
        OdometryOutcome::Followed { .. } | OdometryOutcome::Began | OdometryOutcome::Skipped(_) => None,
    }
}

/// The poses in TUM's format, in order of time, with a comment before every segment after a break.
fn poses(trajectory: &OdometryTrajectory) -> String {
    let mut text = "# world_from_camera, the world is the first left camera: seconds tx ty tz qx qy qz qw\n".to_owned();
    for segment in &trajectory.segments {
        if let Some(why) = &segment.broken {
            text += &format!("# broken: the motion to this pose is unknown ({why})\n");
        }
        let stamped: Vec<_> = segment.poses.iter().map(|pose| (pose.stamp_ns, pose.world_from_camera)).collect();
        text += &tum::print(&stamped);
    }
    text
}

/// `1 pair`, `2 pairs`.
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// The output as text: length, speed, breaks and skipped pairs.
fn text(estimate: &Estimate) -> String {
    let trajectory = &estimate.trajectory;
    let poses = trajectory.waypoints().count();
    let pairs = estimate.given.len() + estimate.unread.len();
    let (poses, pairs) = (counted(poses, "pose"), counted(pairs, "stereo pair"));
    let mut text = format!("{poses} of {pairs} over {:.2} m", trajectory.length());
    text += &format!(", {:.1} pairs a second\n", estimate.pairs_a_second());
    if let Some([min, found, sought]) = estimate.landmarks() {
        text += &format!("{found:.0} of {sought:.0} landmarks tracked in a pair (mean), at least {min:.0}\n");
    }
    for segment in trajectory.segments.iter().filter(|segment| segment.broken.is_some()) {
        text += &format!("broken before {}: {}\n", seconds(segment.poses[0].stamp_ns), why(segment));
    }
    let left_out = estimate.left_out();
    if !left_out.is_empty() {
        text += &format!("{} skipped\n", counted(left_out.len(), "pair"));
    }
    for (stamp, why) in &left_out {
        text += &format!("  {}: {why}\n", seconds(*stamp));
    }
    let count = estimate.given.len() as f64;
    let stages: Vec<String> = trajectory.times.iter().map(|(stage, ms)| format!("{stage} {:.1}", ms / count)).collect();
    text + &format!("ms a pair: {}\n", stages.join(", "))
}

/// The output for programs: one JSON object.
fn json(
    estimate: &Estimate,
    right_camera_rotation: Option<&RightCameraRotation>,
    range_offset: Option<&RangeOffset>,
    warnings: &[String],
    settings: &Choice,
) -> String {
    let trajectory = &estimate.trajectory;
    let count = estimate.given.len() as f64;
    let segments: Vec<Value> = trajectory.segments.iter().map(segment).collect();
    let left_out: Vec<Value> =
        estimate.left_out().into_iter().map(|(stamp_ns, why)| json!({ "stamp_ns": stamp_ns, "why": why })).collect();
    let times: serde_json::Map<String, Value> =
        trajectory.times.iter().map(|(stage, ms)| ((*stage).to_owned(), json!(ms / count))).collect();
    let value = json!({
        "pairs": estimate.given.len() + estimate.unread.len(),
        "poses": trajectory.waypoints().count(),
        "length": trajectory.length(),
        "segments": segments,
        "left_out": left_out,
        "landmarks": estimate.landmarks().map(|[min, found, sought]| json!({ "min": min, "found": found, "sought": sought })),
        "agreement": trajectory.agreement(),
        "right_camera_rotation": right_camera_rotation.map(|found| json!({
            "turn_deg": found.turn.map(f64::to_degrees),
            "right_from_left": found.rig.right_from_left().rows(),
            "pairs": found.pairs,
            "agree": found.agree,
            "given_px": found.given_px,
            "left_px": found.left_px,
        })),
        "range_offset": range_offset.map(|found| json!({
            "pixels": found.pixels,
            "sigma": found.sigma,
            "windows": found.windows,
            "corrected": found.corrected,
        })),
        "warnings": warnings,
        "pairs_a_second": estimate.pairs_a_second(),
        "times_ms": times,
        "odometry": settings,
    });
    value.to_string() + "\n"
}

fn segment(segment: &Segment) -> Value {
    let poses = segment.poses.iter().map(|pose| {
        let covariance = pose.local.map(|local| {
            local.covariance.matrix.row_iter().map(|row| row.iter().copied().collect()).collect::<Vec<Vec<f64>>>()
        });
        json!({
            "stamp_ns": pose.stamp_ns,
            "world_from_camera": pose.world_from_camera.rows(),
            "earlier_from_later": pose.local.map(|local| local.motion.rows()),
            "covariance": covariance,
        })
    });
    json!({ "broken": segment.broken.as_ref().map(ToString::to_string), "poses": poses.collect::<Vec<_>>() })
}

fn why(segment: &Segment) -> String {
    segment.broken.as_ref().map_or_else(String::new, ToString::to_string)
}

fn seconds(stamp_ns: u64) -> String {
    format!("{}.{:09} s", stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000)
}
