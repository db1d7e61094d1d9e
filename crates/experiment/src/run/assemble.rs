//! Assembly of all pieces into one log for each trial and one table.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rayon::{ThreadPool, prelude::*};
use seafix_component::PartialFile;

use crate::{
    results::{Axes, TrialRows, join_csv, join_parquet},
    run::{
        manifest::Manifest,
        observer::Observer,
        outcome::RunError,
        store::{Sealed, pose_graph},
    },
};
use seafix_data::dataset::sha256;

/// Writes the logs and tables of the run that `manifest` describes from its pieces, in order; `false` if the observer
/// stopped it.
pub(super) fn assemble(
    folder: &Path,
    manifest: &mut Manifest,
    pieces: &[Sealed],
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<bool, RunError> {
    let axes = manifest.axis_columns();
    let mut rows = Vec::new();
    let mut outputs: Vec<Output> = Vec::new();
    for trial in &manifest.trials {
        let of_trial: Vec<(&Sealed, TrialRows)> =
            pieces.iter().filter_map(|piece| Some((piece, piece.rows_of(&trial.name)?))).collect();
        let logs = of_trial.iter().map(|(piece, _)| piece.log(&trial.name)).collect();
        outputs.push(Output { path: folder.join(&trial.log), kind: Kind::Log(logs) });
        // The pose graph is complete after the last frame; a navigated source is one piece.
        if let Some(graph) = of_trial.iter().find_map(|(piece, _)| piece.pose_graph(&trial.name)) {
            outputs.push(Output { path: folder.join(pose_graph(&trial.name)), kind: Kind::PoseGraph(graph) });
        }
        let cells = axes.cells(&trial.values);
        rows.extend(of_trial.into_iter().map(|(_, own)| TrialRows { cells: cells.clone(), ..own }));
    }
    manifest.rows = rows.iter().map(|part| part.rows).sum();
    outputs.push(Output { path: folder.join("results.csv"), kind: Kind::Csv(&rows, &axes) });
    outputs.push(Output { path: folder.join("results.parquet"), kind: Kind::Parquet(&rows, &axes) });

    let hashes: Result<Vec<Option<(String, String)>>, RunError> =
        pool.install(|| outputs.par_iter().map(|output| output.write(observer)).collect());
    let hashes: Option<BTreeMap<String, String>> = hashes?.into_iter().collect();
    let done = hashes.is_some();
    manifest.outputs = hashes.unwrap_or_default();
    Ok(done)
}

/// A file of the run and its parts.
struct Output<'a> {
    path: PathBuf,
    kind: Kind<'a>,
}

enum Kind<'a> {
    Log(Vec<PathBuf>),
    PoseGraph(PathBuf),
    Csv(&'a [TrialRows], &'a Axes),
    Parquet(&'a [TrialRows], &'a Axes),
}

impl Output<'_> {
    /// Writes the file; returns its name and SHA-256, or nothing if the observer stopped it.
    fn write(&self, observer: &dyn Observer) -> Result<Option<(String, String)>, RunError> {
        if observer.stops() {
            return Ok(None);
        }
        match &self.kind {
            Kind::Log(parts) => {
                if !seafix_log::join(parts, &self.path, || !observer.stops())? {
                    return Ok(None);
                }
            }
            Kind::PoseGraph(graph) => {
                self.complete(|path| fs::copy(graph, path).map(drop).map_err(|error| error.to_string()))?
            }
            Kind::Csv(rows, axes) => self.complete(|path| join_csv(rows, axes, path).map_err(|e| e.to_string()))?,
            Kind::Parquet(rows, axes) => {
                self.complete(|path| join_parquet(rows, axes, path).map_err(|e| e.to_string()))?
            }
        }
        let name = self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(Some((name, sha256(&self.path).map_err(RunError::Output)?)))
    }

    /// Writes the file with the extension `.partial`, and renames it when it is complete.
    fn complete(&self, write: impl FnOnce(&Path) -> Result<(), String>) -> Result<(), RunError> {
        let (partial, _) = PartialFile::create(&self.path).map_err(|error| RunError::unwritable(&self.path, error))?;
        write(partial.unfinished()).map_err(|error| RunError::unwritable(partial.unfinished(), error))?;
        partial.finish().map_err(|error| RunError::unwritable(&self.path, error))
    }
}
