//! Run time of the front end of lines for a stereo pair: segments of both images, fit, matching, triangulation.
//!
//! `cargo bench --workspace --bench lines [-- FOLDER…]`: the pairs of `datasets/virtual-sample`, 1024×768 px, or those of other
//! data sets (`dataset.toml` with `frames.csv`), such as a dive of `seafix dive`. Settings are the defaults, with each
//! registered detector of segments. One thread, warm, in processor time, which other programs disturb little; every pair is
//! measured in several turns, and the minimum of a pair counts. The limit is that of the default detector.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

use std::path::{Path, PathBuf};

use cpu_time::ThreadTime;
use seafix::{PipelineSettings, Rig, StereoImages, component::Choice, vision::LineOutput, vision::SEGMENT_DETECTORS};

/// Number of turns of each pair.
const TURNS: usize = 9;
/// Maximum time of the default detector, mean over the pairs (ms).
const LIMIT: f64 = 40.0;

fn main() {
    // Cargo adds `--bench`.
    let mut folders: Vec<PathBuf> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).map(PathBuf::from).collect();
    if folders.is_empty() {
        folders.push(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample"));
    }
    println!("ms a pair on one thread: minimum of {TURNS} turns, over the pairs; median of all turns\n");
    println!("| data | pairs | detector | detection alone | complete: mean | greatest | median | segments | lines |");
    println!("|---|---|---|---|---|---|---|---|---|");
    folders.iter().for_each(|folder| measure(folder));
}

/// Prints the rows of one data set.
fn measure(folder: &Path) {
    let rig = Rig::from_file(folder.join("dataset.toml")).expect("a dataset.toml with a rig");
    let pairs = pairs(folder, &rig);
    let default = PipelineSettings::default();
    for name in SEGMENT_DETECTORS.names() {
        let pipeline = PipelineSettings { segment_detector: Choice::named(name), ..default.clone() };
        let front_end = pipeline.line_front_end().expect("valid defaults");
        let mut output = LineOutput::default();
        let (mut detection, mut minima, mut all) = (0.0, Vec::new(), Vec::new());
        let (mut segments, mut lines) = (0, 0);
        for StereoImages { left, right } in &pairs {
            let mut run = || front_end.run([left, right], &rig.stereo, &mut output);
            run();
            let times: Vec<f64> = (0..TURNS).map(|_| milliseconds(&mut run)).collect();
            minima.push(minimum(&times));
            all.extend(times);
            segments += output.segments().iter().map(|side| side.len()).sum::<usize>();
            lines += output.lines.len();
            let cameras = [(left, rig.stereo.left()), (right, rig.stereo.right())];
            let (mut work, mut found) = (Default::default(), Vec::new());
            let mut detect = || {
                cameras.iter().for_each(|(image, camera)| {
                    front_end.detector.detect_into(image, camera, &mut work, &mut found);
                });
            };
            detection += minimum(&(0..TURNS).map(|_| milliseconds(&mut detect)).collect::<Vec<_>>());
        }
        let n = pairs.len() as f64;
        let mean = minima.iter().sum::<f64>() / n;
        all.sort_by(f64::total_cmp);
        let verdict = match Choice::named(name) == default.segment_detector {
            true if mean <= LIMIT => format!(" (at most {LIMIT}: met)"),
            true => format!(" (at most {LIMIT}: MISSED)"),
            false => String::new(),
        };
        println!(
            "| `{}` | {} | `{name}` | {:.1} | {mean:.1}{verdict} | {:.1} | {:.1} | {:.0} | {:.0} |",
            folder.file_name().unwrap_or(folder.as_os_str()).display(),
            pairs.len(),
            detection / n,
            minima.iter().copied().fold(0.0, f64::max),
            all[all.len() / 2],
            segments as f64 / n,
            lines as f64 / n,
        );
    }
}

/// The pairs of a data set.
fn pairs(folder: &Path, rig: &Rig) -> Vec<StereoImages> {
    let table = std::fs::read_to_string(folder.join("frames.csv")).expect("a frames.csv");
    let mut rows = table.lines().map(|row| row.split(',').map(str::trim).collect::<Vec<_>>());
    let head = rows.next().expect("names of columns");
    let column = |name: &str| head.iter().position(|known| *known == name).expect("columns left and right");
    let (left, right) = (column("left"), column("right"));
    let open = |row: Vec<&str>| {
        StereoImages::open(folder.join(row[left]), folder.join(row[right]), rig).expect("two images of the rig")
    };
    rows.map(open).collect()
}

fn milliseconds(work: &mut impl FnMut()) -> f64 {
    let start = ThreadTime::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

fn minimum(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}
