//! The marks of a simulated operator.

use std::path::Path;

use seafix_data::{SimulatedOperator, dataset::Dataset};

use super::arguments::Model;
use crate::{
    atomic_file::AtomicFile,
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    terminal::print,
};

/// Writes the table of marks of the object `--id`, from the truth of the data set.
pub(super) fn execute(model: &Model, error: f64) -> Ended {
    if !(0.0..=100.0).contains(&error) {
        return Err(Failure::new(USAGE, format!("invalid --true-marks {error}: give a number from 0 to 100 px")));
    }
    let inputs: [&Path; 1] = [&model.left];
    let out = model.out.as_deref().map(|path| AtomicFile::begin(path, model.replacing, &inputs)).transpose()?;
    let dataset = Dataset::open(&model.left).map_err(|faults| Failure::faults(INPUT, &faults))?;
    let operator = SimulatedOperator { error, seed: model.dive.marks_seed };
    let table = operator.marks(&dataset, &model.id).map_err(|fault| Failure::new(INPUT, fault))?;
    match out {
        Some(file) => {
            let count = table.lines().count() - 1;
            file.finish(&table)?;
            print(&format!("{count} marks of `{}`\n", model.id))?;
        }
        None => print(&table)?,
    }
    Ok(DONE)
}
