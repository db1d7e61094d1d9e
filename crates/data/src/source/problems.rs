//! Coherence problems from files.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use hmac_sha256::Hash as Sha256;
use seafix_component::{Component, Fault, Settings, in_range, read_text};
use seafix_evaluation::Solved;
use seafix_geometry::{Camera, Object, Transform};
use seafix_referencing::problem_file::{self, CoherenceProblem};
use serde::{Deserialize, Serialize, de::IgnoredAny};

use super::problem_sequence::{Posed, ProblemSequence};
use crate::{
    dataset::sha256,
    sequence::{Sequence, Source, TrueAnswer},
};

/// A source of coherence problems (`coherence-problem/1`) from a folder, one a frame. Subfolders are included, in the
/// order of paths. The ground truth of `NAME.json` is `NAME.truth.json` if it exists; only evaluation uses it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Problems {
    /// The folder, or the file of one problem; relative to the experiment file.
    pub path: String,
}

impl Component for Problems {
    const NAME: &'static str = "problems";
    const SUMMARY: &'static str = "coherence problems (coherence-problem/1) in files, one a frame";
    const SOURCE: &'static str = "docs/formats.md";

    fn check(&self) -> Result<(), String> {
        in_range(!self.path.is_empty(), "path", "''", "a folder of problems, relative to the experiment file")
    }
}

impl Source for Problems {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let path = folder.join(&self.path);
        let one = |fault| vec![fault];
        let mut files = Vec::new();
        gather(&path, &mut files).map_err(one)?;
        files.sort();
        if files.is_empty() {
            let remedy = "name a folder of .json files; `seafix generate` writes some";
            return Err(one(Fault::new("no coherence problem", &path).remedy(remedy)));
        }
        let (mut posed, mut inputs, mut faults) = (Vec::new(), Vec::new(), Vec::new());
        for file in &files {
            match read(file, &path) {
                Ok((problem, hashes)) => {
                    posed.push(problem);
                    inputs.extend(hashes);
                }
                Err(fault) => faults.push(fault),
            }
        }
        faults.extend(twice(&posed, &files));
        if !faults.is_empty() {
            return Err(faults);
        }
        // The hash distinguishes problems with the same path and number.
        let mut contents = Sha256::new();
        inputs.iter().for_each(|(name, hash)| contents.update(format!("{hash}  {name}\n")));
        let contents: String = contents.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        let name = format!("{} problems in {}, SHA-256 {contents}", posed.len(), self.path);
        let frames = posed.len();
        Ok(Box::new(ProblemSequence::new(name, frames, move |index| posed[index].clone(), inputs)))
    }

    fn has_pixels(&self) -> bool {
        false
    }
}

/// The problem files at `path` without those of truth; links are not followed.
fn gather(path: &Path, files: &mut Vec<PathBuf>) -> Result<(), Fault> {
    let unreadable = |error: std::io::Error| Fault::new(format!("cannot read ({error})"), path);
    if !path.is_dir() {
        if !path.exists() {
            return Err(Fault::new("no such file or folder", path).remedy("correct `path`"));
        }
        files.push(path.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(path).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let (kind, name) = (entry.file_type().map_err(unreadable)?, entry.file_name());
        let name = name.to_string_lossy();
        if kind.is_dir() {
            gather(&entry.path(), files)?;
        } else if kind.is_file() && name.ends_with(".json") && !name.ends_with(".truth.json") {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// A problem with its truth, and the hashes of both files by their names below `folder`.
fn read(file: &Path, folder: &Path) -> Result<(Posed, Vec<(String, String)>), Fault> {
    let mut problem = problem_file::read(file)?;
    if problem.model.len() < 3 {
        let fault = Fault::new("a model of fewer than three points", file).value(problem.model.len());
        return Err(fault.remedy("a pose needs three points; remove the file"));
    }
    if problem.id.is_empty() {
        problem.id = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    }
    let beside = file.with_extension("truth.json");
    let truth = if beside.exists() { Some(TruthFile::read(&beside, &problem)?) } else { None };
    let mut hashes = Vec::new();
    for path in [Some(file), truth.is_some().then_some(&beside)].into_iter().flatten() {
        let name = path.strip_prefix(folder).ok().filter(|name| !name.as_os_str().is_empty()).unwrap_or(path);
        hashes.push((name.to_string_lossy().replace('\\', "/"), sha256(path)?));
    }
    Ok((Posed { problem: Arc::new(problem), truth }, hashes))
}

/// The fault of two problems with the same name, which results could not distinguish.
fn twice(posed: &[Posed], files: &[PathBuf]) -> Vec<Fault> {
    let mut names: Vec<&str> = posed.iter().map(|posed| posed.problem.id.as_str()).collect();
    names.sort_unstable();
    let same = names.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
    same.map(|id| Fault::new("two problems with the same `id`", &files[0]).value(id).remedy("give each its own"))
        .collect()
}

/// The truth in `NAME.truth.json`; other keys are ignored.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TruthFile {
    #[serde(default, rename = "id")]
    _id: IgnoredAny,
    #[serde(rename = "T_cam_obj")]
    t_cam_obj: [[f64; 4]; 4],
    pairs: Vec<[usize; 2]>,
    pose_defined: bool,
    #[serde(default, rename = "ideal_T_cam_obj")]
    _ideal: IgnoredAny,
    ideal_tre_rms: Option<f64>,
    #[serde(default, rename = "max_coherent_true")]
    _coherent: IgnoredAny,
    #[serde(default, rename = "params")]
    _params: IgnoredAny,
}

impl TruthFile {
    fn read(file: &Path, problem: &CoherenceProblem) -> Result<(Transform<Object, Camera>, TrueAnswer), Fault> {
        let text = read_text(file)?;
        let truth: Self = serde_json::from_str(&text).map_err(|error| {
            let what = error.to_string();
            Fault::new(what.split(" at line ").next().unwrap_or_default(), file)
                .on_line(Some(error.line()).filter(|line| *line > 0))
        })?;
        let camera_from_object = Transform::<Camera, Object>::from_rows(&truth.t_cam_obj)
            .map_err(|error| Fault::new(format!("`T_cam_obj` is not a rigid motion: {error}"), file))?;
        let (n, m) = (problem.model.len(), problem.cloud.len());
        if let Some(pair) = truth.pairs.iter().find(|[model, cloud]| *model >= n || *cloud >= m) {
            let fault = Fault::new("a true pair with an index out of range", file).value(format!("{pair:?}"));
            return Err(fault.remedy(format!("there are {n} model and {m} cloud points, counted from 0")));
        }
        let ideal_rms = truth.ideal_tre_rms.filter(|_| truth.pose_defined);
        if truth.pose_defined && !ideal_rms.is_some_and(|rms| rms >= 0.0) {
            let fault = Fault::new("`pose_defined` without `ideal_tre_rms`", file);
            return Err(fault.remedy("give the RMS error of the least-squares pose of the true pairs (m)"));
        }
        let answer = TrueAnswer {
            pairs: truth.pairs.iter().map(|&[model, cloud]| (model, cloud)).collect(),
            rule: Solved { ideal_rms, putative: problem.putative.is_some() },
        };
        Ok((camera_from_object.inverse(), answer))
    }
}
