//! The store of pieces before they are joined: `pieces/000012/` below the folder of the run.
//!
//! A piece has one log for each trial, the rows of all trials as `rows.csv` and `rows.parquet`, and `seal.json` with
//! lengths and checksums, written last. Until then its folder has the extension `.partial`.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{Read, Write},
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use seafix_component::{Marker, create_real_folder};
use seafix_log::Writer;
use serde::{Deserialize, Serialize};

use crate::{
    log_decimation::Thinned,
    results::{Axes, Table, TrialRows, create_parquet},
    run::outcome::RunError,
};

const FORMAT: &str = "seafix-piece/1";

/// The pieces of one folder.
#[derive(Debug, Clone)]
pub(super) struct Store {
    folder: PathBuf,
    /// The folder of the run, and its marker if pieces are written.
    run: PathBuf,
    marker: Option<Marker>,
}

/// The description of a complete piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Seal {
    format: String,
    /// The index in the run.
    pub(super) piece: usize,
    first: usize,
    end: usize,
    pub(super) trials: Vec<TrialPart>,
    files: BTreeMap<String, Sum>,
}

/// The part of one trial in a piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TrialPart {
    pub(super) name: String,
    pub(super) rows: usize,
    /// The offset of its rows in `rows.csv` and their length (bytes).
    text: (u64, u64),
    /// The index of its first row group in `rows.parquet`, and their number.
    groups: (usize, usize),
}

/// The length and checksum of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sum {
    bytes: u64,
    crc32: u32,
}

/// A complete piece.
#[derive(Debug, Clone)]
pub(super) struct Sealed {
    folder: PathBuf,
    pub(super) seal: Seal,
}

impl Sealed {
    /// The log of a trial.
    pub(super) fn log(&self, trial: &str) -> PathBuf {
        self.folder.join(format!("{trial}.mcap"))
    }

    /// The pose graph of a trial, if it keeps one.
    pub(super) fn pose_graph(&self, trial: &str) -> Option<PathBuf> {
        let name = pose_graph(trial);
        self.seal.files.contains_key(&name).then(|| self.folder.join(name))
    }

    /// The rows of a trial, if this piece has any.
    pub(super) fn rows_of(&self, trial: &str) -> Option<TrialRows> {
        let part = self.seal.trials.iter().find(|part| part.name == trial)?;
        let (csv, parquet) = (self.folder.join(CSV), self.folder.join(PARQUET));
        let cells = Vec::new();
        Some(TrialRows { csv, text: part.text, parquet, groups: part.groups, rows: part.rows, cells })
    }
}

/// The extension of a trial's pose graph file.
pub(super) const POSE_GRAPH: &str = ".pose-graph";

/// The file name of a trial's pose graph.
pub(super) fn pose_graph(trial: &str) -> String {
    format!("{trial}{POSE_GRAPH}")
}

/// The folder of the pieces in that of the run.
pub(super) const FOLDER: &str = "pieces";

const CSV: &str = "rows.csv";
const PARQUET: &str = "rows.parquet";
const SEAL: &str = "seal.json";

/// The files of a piece that do not depend on trials.
pub(super) const FIXED: [&str; 3] = [CSV, PARQUET, SEAL];

impl Store {
    /// Opens the pieces below the folder of a run, and creates their folder.
    pub(super) fn open(run: &Path, marker: Marker) -> Result<Self, RunError> {
        let store = Self { marker: Some(marker), ..Self::of(run) };
        create_real_folder(&store.folder).map_err(|error| RunError::unwritable(&store.folder, error))?;
        Ok(store)
    }

    /// The pieces of a run that is only read.
    pub(super) fn of(run: &Path) -> Self {
        Self { folder: run.join(FOLDER), run: run.to_owned(), marker: None }
    }

    fn at(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{number:06}"))
    }

    /// Whether a piece exists.
    pub(super) fn has(&self, number: usize) -> bool {
        self.at(number).is_dir()
    }

    /// A piece, if it exists and every checksum agrees.
    pub(super) fn sound(&self, number: usize) -> Option<Sealed> {
        let folder = self.at(number);
        let seal: Seal = serde_json::from_slice(&fs::read(folder.join(SEAL)).ok()?).ok()?;
        let sound = |(name, sum): (&String, &Sum)| self::sum(&folder.join(name)).is_ok_and(|found| found == *sum);
        let full = seal.format == FORMAT && seal.piece == number && seal.files.iter().all(sound);
        full.then_some(Sealed { folder, seal })
    }

    /// All complete pieces, in order.
    pub(super) fn all(&self) -> Vec<Sealed> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let numbers: Vec<usize> = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
        let mut all: Vec<Sealed> = numbers.into_par_iter().filter_map(|number| self.sound(number)).collect();
        all.sort_by_key(|sealed| sealed.seal.piece);
        all
    }

    /// The damaged pieces: numbers and folders, in order.
    pub(super) fn damaged(&self) -> Vec<(usize, PathBuf)> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut numbers: Vec<usize> = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
        numbers.sort_unstable();
        numbers
            .into_iter()
            .filter(|&number| self.sound(number).is_none())
            .map(|number| (number, self.at(number)))
            .collect()
    }

    /// Removes the files of all pieces that `marker` lists.
    pub(super) fn remove(&self, marker: &Marker) -> Result<(), RunError> {
        marker.clear(&self.run, FOLDER).map_err(RunError::Output)
    }
}

/// The output of one trial for a piece.
pub(super) struct Output {
    pub(super) trial: String,
    pub(super) log: Writer,
    pub(super) thinned: Thinned,
    pub(super) table: Table,
    /// The pose graph, if the trial keeps one.
    pub(super) pose_graph: Option<String>,
}

/// A piece in progress.
///
/// A piece that fails is removed on drop; one that is stopped stays for `seafix recover`.
pub(super) struct Draft {
    number: usize,
    store: Store,
    done: bool,
    partial: PathBuf,
    folder: PathBuf,
}

impl Draft {
    /// Begins a piece; remains of an earlier attempt are removed.
    pub(super) fn begin(store: &Store, number: usize) -> Result<Self, RunError> {
        let folder = store.at(number);
        let partial = folder.with_extension("partial");
        for old in [&folder, &partial] {
            if let (Some(marker), Some(name)) = (&store.marker, old.file_name().filter(|_| old.exists())) {
                let part = format!("{FOLDER}/{}", name.to_string_lossy());
                marker.clear(&store.run, &part).map_err(RunError::Output)?;
            }
        }
        // Files that are not ours stay, and the name is then taken.
        fs::create_dir(&partial).map_err(|error| RunError::unwritable(&partial, error))?;
        Ok(Self { number, store: store.clone(), partial, folder, done: false })
    }

    /// The path of a trial's log.
    pub(super) fn log(&self, trial: &str) -> PathBuf {
        self.partial.join(format!("{trial}.mcap"))
    }

    /// Closes the logs of a stopped piece: they can be read, but the piece is incomplete.
    pub(super) fn abandon(mut self, outputs: Vec<Output>) -> Result<(), RunError> {
        for Output { mut log, thinned, .. } in outputs {
            log.totals(&thinned.totals)?;
            log.finish()?;
        }
        self.done = true;
        Ok(())
    }

    /// Closes the logs of a complete piece, writes its rows, and renames its folder.
    pub(super) fn seal(mut self, first: usize, end: usize, outputs: Vec<Output>) -> Result<(), RunError> {
        let at = |name: &str| self.partial.join(name);
        let mut files: Vec<String> = vec![CSV.to_owned(), PARQUET.to_owned()];
        let (mut trials, mut length, mut groups) = (Vec::new(), 0, 0);
        let mut csv = File::create(at(CSV)).map_err(|error| RunError::unwritable(&at(CSV), error))?;
        let mut parquet = create_parquet(&at(PARQUET), &Axes::default())
            .map_err(|error| RunError::unwritable(&at(PARQUET), error))?;
        for Output { trial, mut log, thinned, mut table, pose_graph: graph_text } in outputs {
            log.totals(&thinned.totals)?;
            log.finish()?;
            files.push(format!("{trial}.mcap"));
            if let Some(text) = graph_text {
                let name = pose_graph(&trial);
                fs::write(at(&name), text).map_err(|error| RunError::unwritable(&at(&name), error))?;
                files.push(name);
            }
            let (rows, text) = (table.rows, table.text.len() as u64);
            csv.write_all(table.text.as_bytes()).map_err(|error| RunError::unwritable(&at(CSV), error))?;
            let more = table.write(&mut parquet, true).map_err(|error| RunError::unwritable(&at(PARQUET), error))?;
            trials.push(TrialPart { name: trial, rows, text: (length, text), groups: (groups, more) });
            (length, groups) = (length + text, groups + more);
        }
        parquet.close().map_err(|error| RunError::unwritable(&at(PARQUET), error))?;
        let sums = files.into_iter().map(|name| {
            let found = sum(&at(&name)).map_err(|error| RunError::unwritable(&at(&name), error))?;
            Ok((name, found))
        });
        let files = sums.collect::<Result<_, RunError>>()?;
        let seal = Seal { format: FORMAT.to_owned(), piece: self.number, first, end, trials, files };
        let text = serde_json::to_string(&seal).expect("a seal has plain values") + "\n";
        fs::write(at(SEAL), text).map_err(|error| RunError::unwritable(&at(SEAL), error))?;
        fs::rename(&self.partial, &self.folder).map_err(|error| RunError::unwritable(&self.folder, error))?;
        self.done = true;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if let (false, Some(marker), Some(name)) = (self.done, &self.store.marker, self.partial.file_name()) {
            let _ = marker.clear(&self.store.run, &format!("{FOLDER}/{}", name.to_string_lossy()));
        }
    }
}

fn sum(path: &Path) -> std::io::Result<Sum> {
    let mut file = File::open(path)?;
    let (mut hasher, mut bytes) = (crc32fast::Hasher::new(), 0);
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(Sum { bytes, crc32: hasher.finalize() }),
            read => {
                hasher.update(&buffer[..read]);
                bytes += read as u64;
            }
        }
    }
}
