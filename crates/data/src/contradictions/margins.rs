//! How far sound data sets stay below the thresholds.

use std::path::{Path, PathBuf};

use seafix_vision::matches_by_appearance;

use super::{
    evidence::{MeasuredPair, confirmed},
    pixels::{cell_difference, residual},
    poses::{View, distance_ratios, mistakes},
};
use crate::dataset::Dataset;

/// Prints the numbers that `check` compares with its thresholds, for the folders in `SEAFIX_SOURCES` (separated by `:`).
#[test]
#[ignore = "table"]
#[allow(clippy::print_stdout, reason = "a table")]
fn margins() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample");
    let named = std::env::var("SEAFIX_SOURCES").unwrap_or_default();
    let folders = named.split(':').filter(|name| !name.is_empty()).map(PathBuf::from);
    println!(
        "source, matches, px off the lines, cells differ %, ratio of distances (points), confirmed as given, by a mistake"
    );
    for folder in folders.chain([sample]) {
        let dataset = Dataset::open(&folder).unwrap();
        let step = dataset.frames.len().div_ceil(8).max(1);
        let frames = || dataset.frames.iter().enumerate().step_by(step);
        let pairs: Vec<_> = frames().map(|(index, frame)| (index, dataset.pair(frame).unwrap())).collect();
        let inspected: Vec<_> = pairs
            .iter()
            .map(|(index, (left, right))| (*index, matches_by_appearance(left, right, &dataset.rig)))
            .collect();
        let seen: Vec<_> = inspected.iter().flat_map(|(_, seen)| seen.clone()).collect();
        let cells = pairs.iter().map(|(_, (left, _))| cell_difference(left).0).fold(0.0, f64::max);
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        print!("{name}, {}, {:.3}, {:.2}", seen.len(), residual(&seen, &dataset.rig), 100.0 * cells);
        let Some(site) = &dataset.site else {
            println!();
            continue;
        };
        let view = View::new(site, &dataset.objects, &dataset.rig, dataset.body_from_camera);
        let measured: Vec<_> = inspected.iter().map(|(index, seen)| MeasuredPair::new(&view, *index, seen)).collect();
        let truths: Vec<_> = dataset.frames.iter().map(|frame| frame.truth).collect();
        let posed: Vec<_> = inspected.into_iter().filter_map(|(index, seen)| Some((truths[index]?, seen))).collect();
        let ratios = distance_ratios(&view, &posed);
        let given = confirmed(&view, &measured, &truths, &|pose| *pose, 0.0);
        let all = mistakes(&view.body_from_camera);
        let other =
            all.iter().map(|mistake| confirmed(&view, &measured, &truths, &*mistake.undo, 0.0)).fold(0.0, f64::max);
        println!(", {:.4} ({}), {given}, {other}", ratios.get(ratios.len() / 2).unwrap_or(&f64::NAN), ratios.len());
    }
}
