//! The parsers of foreign bytes.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix::{PipelineSettings, Rig};
use seafix_component::{Choice, Marker, Ownership, read_text};
use seafix_data::{
    ModelByHand,
    dataset::{Cameras, Dataset},
    source::{SOURCES, check_recording},
    trajectory::Trajectory,
};
use seafix_experiment::{Options, Plan, Replay, Silent, check_run, merge};
use seafix_io::{
    ImageLimits,
    calibration::{self, Given},
    image::declared_size,
    read_image,
};
use seafix_log::{Reader, Recording, recover};
use seafix_navigation::{PoseGraph, Recognition};
use seafix_referencing::{Site, TargetKind, problem_file};
use seafix_simulation::scene::SitePlan;
use seafix_vision::Image;

/// A parser with its corpus.
#[derive(Debug, Clone, Copy)]
pub struct Parser {
    /// The name: that of the folder in the corpus.
    pub name: &'static str,
    /// The place of the file in the folder that is parsed.
    file: &'static str,
    /// Parses the file in a folder.
    parse: fn(&Path),
}

impl Parser {
    /// Fills an empty folder with the files beside the parsed one.
    ///
    /// # Errors
    /// A file that cannot be copied.
    pub fn prepare(&self, folder: &Path) -> std::io::Result<()> {
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("beside").join(self.name);
        copy(&beside, folder)?;
        match folder.join(self.file).parent() {
            Some(parent) => fs::create_dir_all(parent),
            None => Ok(()),
        }
    }

    /// Parses `bytes` in a prepared folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn parse(&self, folder: &Path, bytes: &[u8]) -> std::io::Result<()> {
        fs::write(folder.join(self.file), bytes)?;
        (self.parse)(folder);
        Ok(())
    }
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from).into_iter().flatten() {
        let entry = entry?;
        let here = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &here)?;
        } else {
            fs::copy(entry.path(), here)?;
        }
    }
    Ok(())
}

/// All parsers, sorted by name.
///
/// An input takes 5 ms or less, so that 200 000 take a quarter of an hour. Time is spent on what repeats: the points of
/// a site beside the parsed file, the bodies of a geometry, the trials of an experiment. The corpus has two of each.
pub const PARSERS: &[Parser] = &[
    Parser { name: "calibration", file: "a.yaml", parse: foreign_calibration },
    Parser { name: "dataset", file: "dataset.toml", parse: check_dataset },
    Parser { name: "dataset-frames", file: "frames.csv", parse: check_dataset },
    Parser { name: "dataset-visibility", file: "visibility.csv", parse: check_dataset },
    Parser { name: "euroc-camera", file: "mav0/cam0/sensor.yaml", parse: euroc },
    Parser { name: "euroc-images", file: "mav0/cam0/data.csv", parse: euroc },
    Parser { name: "experiment", file: "e.toml", parse: experiment },
    Parser { name: "geometry", file: "a.geometry.toml", parse: geometry },
    Parser { name: "image", file: "image", parse: image },
    Parser { name: "kitti-calibration", file: "calib.txt", parse: kitti },
    Parser { name: "kitti-times", file: "times.txt", parse: kitti },
    Parser { name: "log", file: "a.mcap", parse: log },
    Parser { name: "manifest", file: "manifest.json", parse: manifest },
    Parser { name: "marker", file: ".seafix-run", parse: marker },
    Parser { name: "marks", file: "marks.csv", parse: marks },
    Parser { name: "piece", file: "pieces/000000/seal.json", parse: manifest },
    Parser { name: "pose-graph", file: "a.pose-graph", parse: pose_graph },
    Parser { name: "problem", file: "a.json", parse: problem },
    Parser { name: "recording", file: "a.mcap", parse: recording },
    Parser { name: "recording-folder", file: "metadata.yaml", parse: recording_folder },
    Parser { name: "recover", file: "a.mcap", parse: recovered },
    Parser { name: "site", file: "a.site.toml", parse: site },
    Parser { name: "trajectory", file: "a.tum", parse: trajectory },
];

fn limits() -> ImageLimits {
    ImageLimits { pixels: 1 << 20, bytes: 16 << 20 }
}

/// Any calibration of another program, alone and beside its partner. The end of its name decides whether it is YAML.
fn foreign_calibration(folder: &Path) {
    let given = Given { size: Some([64, 48]), unit: 1.0 };
    let yaml = folder.join("a.yaml");
    let text = folder.join("a.txt");
    if fs::copy(&yaml, &text).is_err() {
        return;
    }
    let beside = |name: &str| folder.join(name);
    for files in [
        vec![yaml.clone()],
        vec![yaml, beside("ros.yaml")],
        vec![text.clone()],
        vec![text.clone(), beside("rigs.txt")],
        vec![beside("cameras.txt"), text],
    ] {
        let _ = calibration::read(&files, given);
    }
}

fn check_dataset(folder: &Path) {
    let _ = Dataset::open(folder);
    let _ = Dataset::open_repaired(folder);
}

fn euroc(folder: &Path) {
    let _ = Dataset::open_euroc(folder);
}

fn kitti(folder: &Path) {
    let _ = Dataset::open_kitti(folder, Cameras::default());
}

fn experiment(folder: &Path) {
    let _ = Plan::read(&folder.join("e.toml"), &[]);
}

fn geometry(folder: &Path) {
    let _ = SitePlan::read(&folder.join("a.site.toml"));
}

fn image(folder: &Path) {
    let path = folder.join("image");
    let size = declared_size(&path).unwrap_or([8, 6]);
    for bits in [8, 12] {
        let _ = read_image(&path, size, bits, limits());
    }
}

fn log(folder: &Path) {
    let path = folder.join("a.mcap");
    if let Ok(mut reader) = Reader::open(&path) {
        let _ = reader.by_ref().try_for_each(|frame| frame.map(drop));
    }
    if let Ok(reader) = Reader::open(&path) {
        let _ = reader.without_images().bare().for_each_frame(drop);
    }
    let _ = Replay::default().plan(&path);
}

fn manifest(folder: &Path) {
    let _ = check_run(folder);
    let merged = folder.join("merged");
    let _ = merge(&[folder.to_owned()], &Options::into(&merged), &Silent);
    if let Ok(Some(marker)) = Marker::read(&merged) {
        let _ = marker.remove(&merged);
    }
}

fn marker(folder: &Path) {
    if let Ok(Ownership::Ours(marker)) = Ownership::of(folder, "run") {
        let _ = marker.stranger(folder);
    }
}

fn marks(folder: &Path) {
    const SIZE: [usize; 2] = [8, 6];
    let file = folder.join("marks.csv");
    let image = |turn: usize| {
        let pixels = (0..SIZE[0] * SIZE[1]).map(|k| ((k * 37 + turn) % 256) as f32 / 255.0).collect();
        Image::new(SIZE[0], SIZE[1], pixels)
    };
    if let (Ok(left), Ok(right)) = (image(0), image(11))
        && let Ok(rig) = Rig::from_file(folder)
        && let Ok(front_end) = PipelineSettings::default().front_end()
        && let Ok(text) = read_text(&file)
    {
        let object = "marked".to_owned();
        let by_hand = ModelByHand { front_end: &front_end, reach: 4.0, mark_sigma: 1.0, object, base: None };
        let _ = by_hand.model([&left, &right], &rig.stereo, &text, &file);
    }
}

fn pose_graph(folder: &Path) {
    let path = folder.join("a.pose-graph");
    if let Ok(text) = read_text(&path) {
        let _ = PoseGraph::read(&path, &text, &Recognition::default());
    }
}

fn problem(folder: &Path) {
    let path = folder.join("a.json");
    if let Ok(problem) = problem_file::read(&path) {
        let _ = problem.warnings(&path);
        let _ = problem.candidates();
    }
}

fn recording(folder: &Path) {
    let path = folder.join("a.mcap");
    if let Ok(recording) = Recording::open(&path, |_| true) {
        let entries: Vec<_> = recording.entries().to_vec();
        entries.iter().take(64).for_each(|entry| drop(recording.message(entry)));
    }
    let _ = check_recording(&path, limits());
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let choice = Choice::named("mcap").with("path", text(path)).with("site", text(folder.join("site.toml")));
    let source = SOURCES.build(&choice).ok().and_then(|source| source.open(1, folder).ok());
    if let Some(sequence) = source {
        (0..sequence.frames().min(3)).for_each(|index| drop(sequence.sensor_frame(index)));
    }
}

fn recording_folder(folder: &Path) {
    let _ = check_recording(folder, limits());
}

fn recovered(folder: &Path) {
    let to = folder.join("saved.mcap");
    if recover(&folder.join("a.mcap"), &to).is_ok() {
        let _ = fs::remove_file(to);
    }
}

fn site(folder: &Path) {
    let path = folder.join("a.site.toml");
    if let Ok(text) = read_text(&path)
        && let Ok(site) = Site::parse(&text, &path)
    {
        for kind in [TargetKind::Object, TargetKind::Site] {
            let _ = site.targets(kind);
        }
    }
}

fn trajectory(folder: &Path) {
    let path = folder.join("a.tum");
    let _ = Trajectory::read(&path);
    let _ = Trajectory::read_repaired(&path);
}
