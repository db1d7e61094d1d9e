//! `seafix check`.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
};

use seafix_component::{Fault, counted, decoded, read_text, undecodable};
use seafix_data::{
    dataset,
    source::{check_recording, is_recording},
    trajectory::Trajectory,
};
use seafix_experiment::{Plan, check_run, inputs, is_run};
use seafix_io::{
    ImageLimits,
    calibration::{self, Given},
};
use seafix_log::{LogError, Reader, Recording, unchanged};
use seafix_referencing::{Site, TargetKind, problem_file};
use seafix_simulation::scene::SitePlan;

use super::convert;
use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, INPUT},
    publication,
    terminal::print,
};

/// The maximum number of listed motions of a target, and of listed points that exclude one.
const MAX_NOTED: usize = 5;

pub(crate) fn execute(paths: &[PathBuf], limits: ImageLimits) -> Ended {
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        return Err(Failure::new(INPUT, format!("no such file or folder: {}", missing.display())));
    }
    let mut found = false;
    let mut files = Vec::new();
    paths.iter().for_each(|path| gather(path, &mut files));
    for path in &files {
        let panicked =
            |message| Examined { faults: vec![undecodable(path, message).to_string()], ..Examined::default() };
        let examined = decoded(|| Ok(examine(path, limits)), panicked).unwrap_or_else(|panicked| panicked);
        let Examined { faults, warnings, note } = examined;
        let mut text: String = faults.iter().map(|fault| format!("fault: {fault}\n")).collect();
        text += &warnings.iter().map(|warning| format!("warning: {warning}\n")).collect::<String>();
        text += &note;
        text += &of_site(path);
        if faults.is_empty() {
            text += &format!("{}: in order\n", path.display());
        }
        print(&text)?;
        found |= !faults.is_empty();
    }
    Ok(if found { FINDINGS } else { DONE })
}

/// Adds the files to check at `path`: itself, or the files of known formats in a folder that is no data set,
/// recursively and sorted by name.
fn gather(path: &Path, files: &mut Vec<PathBuf>) {
    let before = files.len();
    let entries = if path.is_dir() && !dataset::is_one(path) && !is_recording(path) {
        std::fs::read_dir(path).ok()
    } else {
        None
    };
    let mut entries: Vec<PathBuf> =
        entries.into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
    entries.sort();
    // A run is checked by its manifest and logs; report and pieces derive from them.
    let run = path.is_dir() && is_run(path);
    if run {
        files.push(path.to_owned());
        entries.retain(|entry| entry.extension().is_some_and(|end| end == "mcap"));
    }
    for entry in entries {
        let name = entry.to_string_lossy();
        let known = [".toml", ".json", ".mcap", ".mcap.zstd", ".mcap.zst"].iter().any(|end| name.ends_with(end))
            && !name.ends_with(".truth.json");
        // Links are not followed: they may be circular.
        let is_link = entry.is_symlink();
        match entry.is_dir() {
            true if dataset::is_one(&entry) || is_recording(&entry) => files.push(entry),
            true if !is_link => {
                let here = files.len();
                gather(&entry, files);
                // A folder without a known file is not listed.
                let other = files[here..].first().is_some_and(|first| *first == entry) && !is_run(&entry);
                other.then(|| files.truncate(here));
            }
            false if known => files.push(entry),
            _ => {}
        }
    }
    if files.len() == before {
        files.push(path.to_owned());
    }
}

/// The result of checking a file or folder.
#[derive(Default)]
struct Examined {
    faults: Vec<String>,
    warnings: Vec<Fault>,
    /// A summary of the contents of a recording.
    note: String,
}

/// The faults and warnings of one file or folder, by its format.
fn examine(path: &Path, limits: ImageLimits) -> Examined {
    let lines = |faults: Vec<Fault>| faults.iter().map(ToString::to_string).collect();
    let recording = || {
        let (faults, warnings, reported) = check_recording(path, limits);
        let note = if reported.is_empty() { reported } else { format!("note: {reported}\n") };
        Examined { faults: lines(faults), warnings, note }
    };
    if is_recording(path) {
        return recording();
    }
    if is_mcap(path) {
        return match log(path) {
            Ok(warning) => Examined { warnings: warning.into_iter().collect(), ..Examined::default() },
            // An intact file without a trial header is a recording.
            Err(LogError::Foreign { .. }) if !is_of_a_trial(path) => recording(),
            // A compressed recording is read, a compressed log is not.
            Err(LogError::NotMcap { .. }) if begins_with(path, &[ZSTD]) && !is_of_a_trial(path) => recording(),
            Err(error) => Examined { faults: vec![error.to_string()], ..Examined::default() },
        };
    }
    // The words of a calibration may stand in a trajectory too, as CAMERA_ID in COLMAP's images; poses do not stand in
    // any other file.
    let trajectory = path.is_file().then(|| Trajectory::read(path));
    if let Some(Ok(found)) = trajectory {
        return Examined { note: trajectory_note(&found), warnings: found.warnings, ..Examined::default() };
    }
    if calibration::is_calibration(path) {
        return match calibration::read(&[path.to_owned()], Given::default()) {
            Ok(found) => {
                let note = format!("note: {}\n", convert::summary(&found));
                Examined { note, warnings: found.warning.into_iter().collect(), ..Examined::default() }
            }
            Err(fault) => Examined { faults: vec![fault.to_string()], ..Examined::default() },
        };
    }
    if let Some(Err(fault)) = trajectory.filter(|_| is_table(path)) {
        return Examined { faults: vec![fault.to_string()], ..Examined::default() };
    }
    let (faults, warnings) = read(path, limits);
    Examined { faults: lines(faults), warnings, note: String::new() }
}

/// Whether a file is a table of poses by its name: no other file that `check` knows is called so.
fn is_table(path: &Path) -> bool {
    let known = ["tum", "kitti", "csv", "tsv", "txt", "xlsx", "xls"];
    path.is_file() && path.extension().is_some_and(|end| known.iter().any(|known| end == *known))
}

/// A summary of a trajectory.
fn trajectory_note(found: &Trajectory) -> String {
    let length: f64 = found.poses.windows(2).map(|pair| (pair[1].position - pair[0].position).norm()).sum();
    let time = match found.stamps.as_deref() {
        Some([first, .., last]) => format!(" over {:.1} s", (last - first) as f64 * 1e-9),
        _ => String::new(),
    };
    let attitude = if found.has_attitude { "" } else { ", positions without attitude" };
    format!(
        "note: a trajectory of {}{time}, {length:.2} m long{attitude}; `seafix eval` compares it with another\n",
        counted(found.poses.len(), "pose")
    )
}

/// The first bytes of MCAP and of Zstandard.
const MCAP: &[u8] = b"\x89MCAP";
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

/// Whether a file begins with one of some byte sequences of at most eight bytes.
fn begins_with(path: &Path, known: &[&[u8]]) -> bool {
    let mut start = Vec::new();
    // Reading a pipe would consume its beginning.
    let file = path.is_file().then(|| std::fs::File::open(path).ok()).flatten();
    let read = file.is_some_and(|file| file.take(8).read_to_end(&mut start).is_ok());
    read && known.iter().any(|known| start.starts_with(known))
}

/// Whether a file is MCAP, by its name or its first bytes; it may be compressed.
fn is_mcap(path: &Path) -> bool {
    begins_with(path, &[MCAP, ZSTD]) || path.extension().is_some_and(|extension| extension == "mcap")
}

/// Reads all frames of a log; the result is a warning for a log that `seafix recover` saved.
fn log(path: &Path) -> Result<Option<Fault>, LogError> {
    unchanged(path)?;
    let mut reader = Reader::open(path)?;
    reader.by_ref().try_for_each(|frame| frame.map(|_| ()))?;
    Ok(reader.recovered().map(|lost| {
        let fault = Fault::new(format!("a log recovered from an incomplete one ({lost})"), path);
        fault.remedy("results lack the lost frames")
    }))
}

/// Whether an MCAP file has the header of a trial.
fn is_of_a_trial(path: &Path) -> bool {
    let own = |topic: &seafix_log::Topic| topic.schema == "seafix.v2.TrialHeader";
    match Recording::open(path, |_| false) {
        Ok(recording) => recording.topics().iter().any(own),
        // What is compressed and damaged is more probably a recording.
        Err(_) => !begins_with(path, &[ZSTD]),
    }
}

fn read(path: &Path, limits: ImageLimits) -> (Vec<Fault>, Vec<Fault>) {
    let faults = |result: Result<(), Vec<Fault>>| (result.err().unwrap_or_default(), Vec::new());
    if path.is_dir() {
        return if is_run(path) { (check_run(path), Vec::new()) } else { dataset::check(path, limits) };
    }
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("json") if path.file_name().is_some_and(|name| name == "manifest.json") => {
            (check_run(folder_of(path)), Vec::new())
        }
        Some("json") => match problem_file::read(path) {
            Ok(problem) => (Vec::new(), problem.warnings(path)),
            Err(fault) => (vec![fault], Vec::new()),
        },
        _ => match read_text(path) {
            // What is no text may still be a known file at the wrong place.
            Err(fault) => (Plan::read(path, &[]).err().unwrap_or_else(|| vec![fault]), Vec::new()),
            Ok(text) => match format(&text).as_deref() {
                Some(format) if format.starts_with("seafix-site/") => match Site::parse(&text, path) {
                    Ok(site) => (Vec::new(), site.warnings),
                    Err(faults) => (faults, Vec::new()),
                },
                Some(format) if format.starts_with("seafix-dataset/") => dataset::check(folder_of(path), limits),
                Some(format) if format.starts_with("seafix-geometry/") => faults(geometry(path)),
                Some(format) if format.starts_with("seafix-reports/") => faults(publication::read(path).map(|_| ())),
                _ => match Plan::read(path, &[]) {
                    Ok(plan) => inputs(&plan),
                    Err(faults) => (faults, Vec::new()),
                },
            },
        },
    }
}

/// The folder of a file; that of a bare name is the current one.
fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// A geometry file is checked together with its site file.
fn geometry(path: &Path) -> Result<(), Vec<Fault>> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(stem) = name.strip_suffix(".geometry.toml") else {
        let remedy = "name it NAME.geometry.toml, beside its NAME.site.toml";
        return Err(vec![Fault::new("not the name of a geometry file", path).remedy(remedy)]);
    };
    SitePlan::read(&path.with_file_name(format!("{stem}.site.toml"))).map(|_| ())
}

/// Notes on a site: points without normals, and self-symmetries of its targets with the points that exclude them.
fn of_site(path: &Path) -> String {
    let site =
        read_text(path).ok().filter(|text| format(text).is_some_and(|format| format.starts_with("seafix-site/")));
    let Some(site) = site.and_then(|text| Site::parse(&text, path).ok()) else { return String::new() };
    let mut notes = String::new();
    for object in &site.objects {
        let bare = object.points.iter().filter(|point| point.normal.is_none()).count();
        if bare > 0 {
            let all = object.points.len();
            notes += &format!(
                "note: `{}`: {bare} of {all} points have no `normal` and count as visible from every side\n",
                object.id
            );
        }
    }
    for target in site.targets(TargetKind::Object).unwrap_or_default() {
        let all = target.congruences();
        for congruence in all.iter().take(MAX_NOTED) {
            let ids: Vec<String> =
                congruence.broken_by.iter().take(MAX_NOTED).map(|&i| format!("`{}`", target.points[i].id)).collect();
            let reported = match ids.as_slice() {
                [] => "no point excludes it; add a point that the motion maps onto no other".to_owned(),
                ids => {
                    let more = congruence.broken_by.len() - ids.len();
                    let more = if more > 0 { format!(" or of {more} more") } else { String::new() };
                    format!("identifying one of {}{more} excludes it", ids.join(", "))
                }
            };
            notes += &format!("note: `{}`: {}; {reported}\n", target.name, congruence.describe(&target.points));
        }
        if all.len() > MAX_NOTED {
            notes += &format!("note: `{}`: and {} more such motions\n", target.name, all.len() - MAX_NOTED);
        }
    }
    notes
}

/// The value of `format` in a TOML text.
fn format(text: &str) -> Option<String> {
    toml::from_str::<toml::Table>(text).ok()?.get("format")?.as_str().map(str::to_owned)
}
