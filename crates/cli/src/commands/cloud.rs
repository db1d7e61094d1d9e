//! `seafix cloud`.

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::ThreadPoolBuilder;
use seafix::{FrameData, PipelineSettings};
use seafix_component::{Choice, Fault};
use seafix_data::dataset::{partners_remedy, strangers, swap_fault};
use seafix_experiment::changed_pipeline;
use seafix_geometry::StereoRig;
use seafix_vision::{EpipolarCheck, FrontEnd, FrontEndOutput, Image, Keypoint, Regions, Sides, StageTimes, Threads};
use serde_json::{Value, json};

use super::{
    cloud_input::{CloudInput, CloudPair},
    set::built,
};
use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, INPUT, OUTPUT, USAGE},
    ply,
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Cloud {
    #[command(flatten)]
    input: CloudInput,
    /// The detector [default: the pipeline's].
    #[arg(long)]
    detector: Option<String>,
    /// The descriptor [default: the pipeline's].
    #[arg(long)]
    descriptor: Option<String>,
    /// The matcher [default: the pipeline's].
    #[arg(long)]
    matcher: Option<String>,
    /// Maximum number of key points in an image [default: the detector's].
    #[arg(long)]
    features: Option<u32>,
    /// Change a setting of the pipeline: a dotted key and a TOML value, `detector.sigma=1.5`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Number of repetitions, for the statistics of times.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeat: u32,
    /// Number of threads; the cloud does not depend on it.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Print one JSON object with all points and the times of the stages.
    #[arg(long)]
    json: bool,
    /// Write the cloud to this PLY file.
    #[arg(long, value_name = "CLOUD.ply")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
}

impl Cloud {
    pub(crate) fn execute(&self) -> Ended {
        let base = self.base()?;
        let (pipeline, stages) = built(&self.set, |set| changed_pipeline(&base, set), PipelineSettings::build)?;
        let front_end = pipeline.front_end().map_err(|error| Failure::new(USAGE, error))?;
        let CloudPair { images: [left, right], names, rig, rig_file, warnings } = self.input.read()?;
        let sides = Sides::of_images(&left, &right, &rig);
        if let Some(fault) = swap_fault(sides, &names[0]) {
            return Err(Failure::new(INPUT, fault));
        }
        let epipolar_check = epipolar_warning(EpipolarCheck::of_images(&left, &right, &rig), &rig, &rig_file);
        let pool = ThreadPoolBuilder::new()
            .num_threads(usize::from(self.threads))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot start threads: {error}")))?;
        let (mut look, times) = pool.install(|| self.make(&front_end, &left, &right, &rig));
        let warnings: Vec<Fault> = warnings
            .into_iter()
            .chain(epipolar_check)
            .chain(blind(&look, &names, [&left, &right]))
            .chain(strangers(sides, &names[0]).or_else(|| nothing(&front_end, &look, [&left, &right], &rig, &names[0])))
            .collect();
        warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        // A pipeline adds corners that no key point has, and replaces key points by better corners.
        let complete = stages.cloud(&FrameData::Stereo(left.clone(), right), &rig, &[], &[Regions::NONE; 2]);
        let corners = complete.points().iter().filter(|point| !look.cloud.contains(point)).count();
        look.cloud = complete.points().to_vec();
        if let Some(path) = &self.out {
            AtomicFile::begin(path, self.replacing, &self.input.files())?.finish(ply::ply(&look.cloud, &left))?;
        }
        let pipeline = pipeline.resolved().map_err(|error| Failure::new(USAGE, error))?;
        print(&if self.json {
            self.json(&names, &look, &times, &pipeline, &warnings)
        } else {
            self.text(&look, corners, &times)
        })?;
        Ok(DONE)
    }

    /// The default pipeline with the components that flags name.
    fn base(&self) -> Result<PipelineSettings, Failure> {
        let mut pipeline = PipelineSettings::default();
        let choose = |choice: &mut Choice, name: &Option<String>| {
            if let Some(name) = name {
                *choice = Choice::named(name);
            }
        };
        choose(&mut pipeline.detector, &self.detector);
        choose(&mut pipeline.descriptor, &self.descriptor);
        choose(&mut pipeline.matcher, &self.matcher);
        if let Some(features) = self.features {
            pipeline.detector = pipeline.detector.with("features", i64::from(features));
        }
        // An unknown name is reported before an error of `--set`.
        pipeline.front_end().map_err(|error| Failure::new(USAGE, error))?;
        Ok(pipeline)
    }

    fn make(
        &self,
        front_end: &FrontEnd,
        left: &Image,
        right: &Image,
        rig: &StereoRig,
    ) -> (FrontEndOutput, Vec<StageTimes>) {
        let mut look = FrontEndOutput::new(if self.threads > 1 { Threads::Pool } else { Threads::One });
        let times = (0..self.repeat).map(|_| {
            front_end.run(left, right, rig, &mut look);
            look.times
        });
        let times = times.collect();
        (look, times)
    }

    /// The output as text: counts, and the times of the stages.
    fn text(&self, look: &FrontEndOutput, corners: usize, times: &[StageTimes]) -> String {
        let [left, right] = look.keypoints().map(<[_]>::len);
        let depths = look.cloud.iter().map(|point| point.position.at.coords.z);
        let (near, far) = depths.fold((f64::INFINITY, 0.0_f64), |(near, far), z| (near.min(z), far.max(z)));
        let depth = if look.cloud.is_empty() { String::new() } else { format!(", {near:.2} to {far:.2} m deep") };
        let (matches, points) = (look.matches.len(), look.cloud.len());
        let corners = match corners {
            0 => String::new(),
            corners => format!(", {corners} of them corners of outlines and edges"),
        };
        let mut text = format!("{left} and {right} key points, {matches} matches, {points} points{corners}{depth}\n");
        text += &format!("{:12}{:>10}{:>12}\n", "stage", "min ms", "median ms");
        for (stage, [min, median]) in summary(times) {
            text += &format!("{stage:12}{min:10.2}{median:12.2}\n");
        }
        text + &format!(
            "{} {}, {} {}\n",
            self.repeat,
            plural(self.repeat, "repeat"),
            self.threads,
            plural(self.threads, "thread")
        )
    }

    /// The output as JSON: one object.
    fn json(
        &self,
        names: &[PathBuf; 2],
        look: &FrontEndOutput,
        times: &[StageTimes],
        pipeline: &PipelineSettings,
        warnings: &[Fault],
    ) -> String {
        let points: Vec<Value> = look.cloud.iter().map(point).collect();
        let times: serde_json::Map<String, Value> = summary(times)
            .into_iter()
            .map(|(stage, [min, median])| (stage.to_owned(), json!({ "min": min, "median": median })))
            .collect();
        let value = json!({
            "left": name(&names[0]),
            "right": name(&names[1]),
            "keypoints": look.keypoints().map(<[_]>::len),
            "matches": look.matches.len(),
            "points": points,
            "times_ms": times,
            "repeats": self.repeat,
            "threads": self.threads,
            "warnings": warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "pipeline": {
                "filters": pipeline.filters,
                "detector": pipeline.detector,
                "locator": pipeline.locator,
                "descriptor": pipeline.descriptor,
                "matcher": pipeline.matcher,
                "refinement": pipeline.refinement,
                "triangulator": pipeline.triangulator,
                "edge-corners": pipeline.edge_corners,
                "outline-corners": pipeline.outline_corners,
            },
        });
        value.to_string() + "\n"
    }
}

/// A warning for each image without key points.
fn blind(look: &FrontEndOutput, names: &[PathBuf; 2], images: [&Image; 2]) -> Vec<Fault> {
    let of = |((file, image), found): ((&PathBuf, &Image), &[Keypoint])| {
        let (min, max) = image.pixels().iter().fold((f32::MAX, f32::MIN), |(a, b), &p| (a.min(p), b.max(p)));
        found.is_empty().then(|| {
            let [width, height] = [image.width(), image.height()];
            Fault::new("an image without a key point", file)
                .value(format!("{width} x {height} px, grey levels from {min} to {max}"))
                .remedy("check the image, and lower the threshold of the detector")
        })
    };
    names.iter().zip(images).zip(look.keypoints()).filter_map(of).collect()
}

/// A warning for a rig that contradicts its images.
fn epipolar_warning(off: EpipolarCheck, rig: &StereoRig, file: &Path) -> Option<Fault> {
    let lines = if rig.is_rectified() {
        "the same rows"
    } else if rig.is_rectified_upright() {
        "the same columns"
    } else {
        "their epipolar lines"
    };
    off.contradict().then(|| {
        let EpipolarCheck { matches, near, rms_px } = off;
        Fault::new("the images contradict the rig", file)
            .value(format!(
                "{near} of {matches} matches are within {} px of {lines}, RMS {rms_px:.1} px",
                EpipolarCheck::NEAR
            ))
            .remedy("give the calibration of these images; images that are not rectified need their own rig")
    })
}

/// A warning for key points without a triangulated point, with the result for exchanged images.
fn nothing(
    front_end: &FrontEnd,
    look: &FrontEndOutput,
    [left, right]: [&Image; 2],
    rig: &StereoRig,
    file: &Path,
) -> Option<Fault> {
    let [in_left, in_right] = look.keypoints().map(<[_]>::len);
    if !look.cloud.is_empty() || in_left == 0 || in_right == 0 {
        return None;
    }
    let mut exchanged = FrontEndOutput::new(Threads::One);
    front_end.run(right, left, rig, &mut exchanged);
    let (matches, points) = (exchanged.matches.len(), exchanged.cloud.len());
    Some(
        Fault::new("key points, but no triangulated point", file)
            .value(format!(
                "{in_left} and {in_right} key points, {} matches; with left and right exchanged {matches} matches, \
                 {points} points",
                look.matches.len()
            ))
            .remedy(partners_remedy(points, 2 * points > matches)),
    )
}

/// The minimum and median time (ms) of every stage and of their sum, `total`.
fn summary(times: &[StageTimes]) -> Vec<(&'static str, [f64; 2])> {
    let stages: Vec<Vec<(&'static str, f64)>> = times.iter().map(StageTimes::stages).collect();
    let of = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        let middle = all.len() / 2;
        [all[0], if all.len().is_multiple_of(2) { 0.5 * (all[middle - 1] + all[middle]) } else { all[middle] }]
    };
    let full = |stages: &Vec<(&str, f64)>| stages.iter().map(|(_, ms)| ms).sum();
    let names = stages[0].iter().enumerate();
    let each = names.map(|(index, (name, _))| (*name, of(stages.iter().map(|all| all[index].1).collect())));
    each.chain([("total", of(stages.iter().map(full).collect()))]).collect()
}

fn point(point: &seafix_geometry::MeasuredPoint) -> Value {
    let covariance: Vec<Vec<f64>> =
        point.position.covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let pixels = point.pixels.map(|pixels| {
        let rows: Vec<Vec<f64>> = pixels.covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
        (pixels.at, rows)
    });
    let (at, pixel_covariance) = pixels.unzip();
    json!({
        "left": at.map(|at| [at.left.u, at.left.v]),
        "right": at.map(|at| [at.right.u, at.right.v]),
        "position": <[f64; 3]>::from(point.position.at.coords),
        "covariance": covariance,
        "pixel_covariance": pixel_covariance,
    })
}

fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn plural(count: impl Into<u32>, word: &str) -> String {
    if count.into() == 1 { word.to_owned() } else { format!("{word}s") }
}
