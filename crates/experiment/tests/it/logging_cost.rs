//! The cost of logging, printed without assertions because clocks differ.

use std::{fs, path::Path, time::Instant};

use seafix_experiment::{Options, Plan, Silent, run};
use seafix_log::{Writer, read};
use tempfile::TempDir;

/// Measures the time of logging. The frames of the sample (1024×768) are logged at each level of images, read back, and
/// written again to the disk. Printed are milliseconds a frame, their fraction of a frame's time at 10 Hz, and the time
/// of the pipeline.
///
/// `cargo test --release -p seafix-experiment logging_cost:: -- --ignored --nocapture`
#[test]
#[ignore = "table"]
fn the_cost_of_logging_at_ten_frames_a_second() {
    const REPEATS: usize = 5;
    const FRAME_MS: f64 = 100.0;
    let folder = TempDir::new().unwrap();
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample").canonicalize().unwrap();
    let file = folder.path().join("e.toml");
    let source = format!(
        "question = 'What does logging cost?'\nsource = {{ name = 'dataset', path = '{}' }}\n",
        sample.display()
    );
    for images in ["none", "thumbnails", "all"] {
        fs::write(&file, format!("{source}log.images = '{images}'\n")).unwrap();
        let plan = Plan::read(&file, &[]).unwrap();
        let out = folder.path().join(images);
        run(&plan, &Options::into(&out), &Silent).unwrap();
        let log = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap();
        let again = folder.path().join("again.mcap");
        let mut spent = Vec::new();
        for _ in 0..REPEATS {
            let begun = Instant::now();
            let mut writer = Writer::create(&again, &log.header).unwrap();
            log.frames.iter().for_each(|frame| writer.frame(frame).unwrap());
            writer.finish().unwrap();
            spent.push(begun.elapsed().as_secs_f64() * 1e3 / log.frames.len() as f64);
        }
        spent.sort_by(f64::total_cmp);
        let method = |frame: &seafix_log::FrameRecord| {
            let shared = &frame.times;
            let stages = [
                shared.detect_ms,
                shared.locate_ms,
                shared.describe_ms,
                shared.match_ms,
                shared.refine_ms,
                shared.triangulate_ms,
            ];
            let targets = frame
                .targets
                .iter()
                .flat_map(|target| [target.times.candidates_ms, target.times.search_ms, target.times.solve_ms]);
            stages.into_iter().chain(targets).flatten().sum::<f64>()
        };
        let method = log.frames.iter().map(method).sum::<f64>() / log.frames.len() as f64;
        let (median, bytes) = (spent[REPEATS / 2], fs::metadata(&again).unwrap().len() / log.frames.len() as u64);
        println!(
            "images {images:10}: {median:6.2} ms a frame, {:4.1} % of a frame's time at 10 Hz; the pipeline {method:.1} ms; {bytes} bytes a frame",
            100.0 * median / FRAME_MS
        );
    }
}
