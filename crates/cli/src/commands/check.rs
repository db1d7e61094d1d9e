//! `seafix check`.

use std::path::{Path, PathBuf};

use seafix_component::Fault;
use seafix_experiment::{Plan, dataset, read_text};
use seafix_referencing::{Site, problem_file};

use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, INPUT},
    terminal::print,
};

pub(crate) fn execute(paths: &[PathBuf]) -> Ended {
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        return Err(Failure::new(INPUT, format!("no such file or folder: {}", missing.display())));
    }
    let mut found = false;
    for path in paths {
        let (faults, warnings) = examine(path);
        let mut text: String = faults.iter().map(|fault| format!("fault: {fault}\n")).collect();
        text += &warnings.iter().map(|warning| format!("warning: {warning}\n")).collect::<String>();
        if faults.is_empty() {
            text += &format!("{}: in order\n", path.display());
        }
        print(&text)?;
        found |= !faults.is_empty();
    }
    Ok(if found { FINDINGS } else { DONE })
}

/// The faults and warnings of one file or folder, by what it is.
fn examine(path: &Path) -> (Vec<String>, Vec<Fault>) {
    let lines = |faults: Vec<Fault>| faults.iter().map(ToString::to_string).collect();
    if path.extension().is_some_and(|extension| extension == "mcap") {
        return (log(path).err().map(|error| error.to_string()).into_iter().collect(), Vec::new());
    }
    let (faults, warnings) = read(path);
    (lines(faults), warnings)
}

/// Reads a log from end to end, a frame at a time.
fn log(path: &Path) -> Result<(), seafix_log::LogError> {
    seafix_log::Reader::open(path)?.try_for_each(|frame| frame.map(|_| ()))
}

fn read(path: &Path) -> (Vec<Fault>, Vec<Fault>) {
    let faults = |result: Result<(), Vec<Fault>>| (result.err().unwrap_or_default(), Vec::new());
    if path.is_dir() && !path.join("dataset.toml").exists() {
        let what = Fault::new("a folder without a dataset.toml", path);
        return (vec![what.remedy("name a data set, or the files of the folder one by one")], Vec::new());
    }
    if path.is_dir() {
        return dataset::check(path);
    }
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("json") => faults(problem_file::read(path).map(|_| ()).map_err(|fault| vec![fault])),
        _ => match read_text(path) {
            Err(fault) => (vec![fault], Vec::new()),
            Ok(text) => match format(&text).as_deref() {
                Some(format) if format.starts_with("seafix-site/") => match Site::parse(&text, path) {
                    Ok(site) => (Vec::new(), site.warnings),
                    Err(faults) => (faults, Vec::new()),
                },
                Some(format) if format.starts_with("seafix-dataset/") => {
                    dataset::check(path.parent().unwrap_or(Path::new(".")))
                }
                _ => faults(Plan::read(path, &[]).map(|_| ())),
            },
        },
    }
}

/// The `format` that a TOML text says it has.
fn format(text: &str) -> Option<String> {
    toml::from_str::<toml::Table>(text).ok()?.get("format")?.as_str().map(str::to_owned)
}
