//! Comparison of two runs: of their configurations and inputs, then of their results.

use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{BufRead, BufReader, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use seafix_component::{Fault, read_text};
use seafix_log::unchanged;
use serde::Deserialize;

use crate::{results::AxisColumn, run::manifest};

/// A value that differs; `None` if it exists in the other run only.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Change {
    /// The name: a dotted key of the configuration, a file, or a row and its column.
    pub what: String,
    /// The value in the first run.
    pub first: Option<String>,
    /// The value in the second run.
    pub second: Option<String>,
}

/// The differences of two runs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Difference {
    /// The settings, trials and seeds.
    pub configuration: Vec<Change>,
    /// The input files.
    pub inputs: Vec<Change>,
    /// The first hundred values of the results, without durations.
    pub results: Vec<Change>,
    /// The number of differing values in each column.
    pub columns: BTreeMap<String, u64>,
    /// The number of rows in both runs.
    pub rows: u64,
}

/// The maximum number of listed values.
const MAX: usize = 100;

impl Difference {
    /// Whether the runs are equal.
    pub fn is_none(&self) -> bool {
        self.configuration.is_empty() && self.inputs.is_empty() && self.columns.is_empty()
    }
}

/// Compares the runs in two folders.
///
/// Trials are paired by their values of all settings that vary in either run, regardless of order. Rows of paired
/// trials are compared by frame and object, in order. Durations, versions and machines are not compared.
///
/// # Errors
/// A folder without a finished run, or files that cannot be read.
pub fn diff(first: &Path, second: &Path) -> Result<Difference, Fault> {
    let (a, b) = (RunInputs::read(first)?, RunInputs::read(second)?);
    let pairs = pairs(&a.trials, &b.trials);
    let mut difference = Difference {
        configuration: configuration(&a, &b, &pairs),
        inputs: changes(&a.inputs, &b.inputs),
        ..Difference::default()
    };
    let (mut one, mut two) = (Table::open(first)?, Table::open(second)?);
    // The trial's name and the axes are settings, which are compared as configuration.
    let set = |name: &String| name == "trial" || a.axes.contains(name) || b.axes.contains(name);
    let common: Vec<(usize, usize)> = one
        .columns
        .iter()
        .enumerate()
        .filter(|(_, name)| !set(name) && !name.ends_with("_ms"))
        .filter_map(|(i, name)| Some((i, two.columns.iter().position(|other| other == name)?)))
        .collect();
    for (only, other) in [(&one, &two), (&two, &one)] {
        for name in only.columns.iter().filter(|name| !set(name) && !other.columns.contains(name)) {
            difference.columns.insert(name.clone(), 0);
        }
    }
    for (here, there) in &pairs {
        one.begin(here.map(|place| a.trials[place].name.as_str()))?;
        two.begin(there.map(|place| b.trials[place].name.as_str()))?;
        difference.rows_of_a_trial(&mut one, &mut two, &common)?;
    }
    Ok(difference)
}

impl Difference {
    /// Compares the rows of paired trials.
    fn rows_of_a_trial(&mut self, one: &mut Table, two: &mut Table, common: &[(usize, usize)]) -> Result<(), Fault> {
        let (mut left, mut right) = (one.next()?, two.next()?);
        loop {
            let order = match (&left, &right) {
                (None, None) => return Ok(()),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some(a), Some(b)) => a.key.cmp(&b.key),
            };
            let names = |row: &Option<Row>| row.as_ref().map(Row::name).unwrap_or_default();
            match order {
                Ordering::Less => {
                    self.note("row", names(&left), Some("there".to_owned()), None);
                    left = one.next()?;
                }
                Ordering::Greater => {
                    self.note("row", names(&right), None, Some("there".to_owned()));
                    right = two.next()?;
                }
                Ordering::Equal => {
                    if let (Some(a), Some(b)) = (&left, &right) {
                        self.rows += 1;
                        for &(i, j) in common {
                            let (x, y) = (&a.cells[i], &b.cells[j]);
                            if x != y {
                                self.note(&one.columns[i], a.name(), Some(x.clone()), Some(y.clone()));
                            }
                        }
                    }
                    (left, right) = (one.next()?, two.next()?);
                }
            }
        }
    }
}

/// Pairs the trials of both runs; unpaired trials of the second come last.
fn pairs(a: &[OfTrial], b: &[OfTrial]) -> Vec<(Option<usize>, Option<usize>)> {
    let varies = |trials: &[OfTrial]| -> BTreeSet<String> {
        let keys = trials.iter().flat_map(|trial| trial.settings.keys());
        let differs =
            |key: &&String| trials.iter().any(|trial| trial.settings.get(*key) != trials[0].settings.get(*key));
        keys.filter(differs).cloned().collect()
    };
    let keys: BTreeSet<String> = varies(a).into_iter().chain(varies(b)).collect();
    let identity = |trial: &OfTrial| keys.iter().map(|key| trial.settings.get(key).cloned()).collect::<Vec<_>>();
    let mut left: Vec<Option<usize>> = (0..b.len()).map(Some).collect();
    let mut pairs: Vec<(Option<usize>, Option<usize>)> = Vec::new();
    for (place, trial) in a.iter().enumerate() {
        // The first unpaired one of several identical trials.
        let same = left.iter_mut().find(|other| other.is_some_and(|k| identity(&b[k]) == identity(trial)));
        pairs.push((Some(place), same.and_then(Option::take)));
    }
    pairs.extend(left.into_iter().flatten().map(|k| (None, Some(k))));
    pairs
}

/// The differences of the configurations. A difference common to all pairs is listed once.
fn configuration(a: &RunInputs, b: &RunInputs, pairs: &[(Option<usize>, Option<usize>)]) -> Vec<Change> {
    let (mut found, mut alone) = (BTreeMap::<Change, Vec<&str>>::new(), Vec::new());
    let mut both = 0;
    for pair in pairs {
        match *pair {
            (Some(i), Some(j)) => {
                both += 1;
                for change in changes(&a.trials[i].settings, &b.trials[j].settings) {
                    found.entry(change).or_default().push(&a.trials[i].name);
                }
            }
            (here, there) => {
                let name = here.map(|i| &a.trials[i].name).or(there.map(|j| &b.trials[j].name));
                let is_there = |place: Option<usize>| place.map(|_| "there".to_owned());
                let what = format!("trial {}", name.map_or("", String::as_str));
                alone.push(Change { what, first: is_there(here), second: is_there(there) });
            }
        }
    }
    let mut all = Vec::new();
    for (change, names) in found {
        match names.len() == both {
            true => all.push(change),
            false => all.extend(
                names.iter().map(|name| Change { what: format!("trial {name}: {}", change.what), ..change.clone() }),
            ),
        }
    }
    if a.trials.len() != b.trials.len() {
        let count = |run_inputs: &RunInputs| Some(run_inputs.trials.len().to_string());
        all.push(Change { what: "trials".to_owned(), first: count(a), second: count(b) });
    }
    all.sort_by(|one, other| one.what.cmp(&other.what));
    all.extend(alone);
    all
}

impl Difference {
    fn note(&mut self, column: &str, row: String, first: Option<String>, second: Option<String>) {
        *self.columns.entry(column.to_owned()).or_default() += 1;
        if self.results.len() < MAX {
            self.results.push(Change { what: format!("{row} {column}"), first, second });
        }
    }
}

fn changes(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Vec<Change> {
    let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let change = |key: &String| Change { what: key.clone(), first: a.get(key).cloned(), second: b.get(key).cloned() };
    keys.into_iter().map(change).filter(|change| change.first != change.second).collect()
}

/// The inputs of a run, from its manifest.
struct RunInputs {
    inputs: BTreeMap<String, String>,
    trials: Vec<OfTrial>,
    /// The columns of the varied settings.
    axes: BTreeSet<String>,
}

/// The inputs of one trial.
struct OfTrial {
    name: String,
    /// The settings by dotted key.
    settings: BTreeMap<String, String>,
}

/// The compared part of `manifest.json`.
#[derive(Deserialize)]
struct Manifest {
    format: String,
    #[serde(default)]
    state: String,
    trials: Vec<Entry>,
    /// The columns of the varied settings, which are compared as configuration.
    #[serde(default)]
    axes: Vec<AxisColumn>,
    inputs: Vec<Input>,
}

#[derive(Deserialize)]
struct Entry {
    name: String,
    configuration: String,
}

#[derive(Deserialize)]
struct Input {
    source: String,
    files: BTreeMap<String, String>,
}

impl RunInputs {
    fn read(folder: &Path) -> Result<Self, Fault> {
        let file = folder.join("manifest.json");
        let remedy = "name the folder of a finished run";
        let text = read_text(&file).map_err(|fault| manifest::without(folder).unwrap_or(fault.remedy(remedy)))?;
        let manifest: Manifest = serde_json::from_str(&text)
            .map_err(|error| Fault::new("a manifest that cannot be read", &file).on_line(error.line()).value(error))?;
        if !manifest.format.starts_with("seafix-manifest/") {
            return Err(Fault::new("not a run's manifest", &file).value(manifest.format));
        }
        let unfinished = match manifest.state.as_str() {
            "shard" => Some("a shard of a run; join all shards with `seafix merge`"),
            "running" | "interrupted" => Some("an unfinished run; resume it with --resume"),
            _ => None,
        };
        if let Some((what, remedy)) = unfinished.and_then(|message| message.split_once("; ")) {
            return Err(Fault::new(what, &file).remedy(remedy));
        }
        let mut trials = Vec::new();
        for trial in manifest.trials {
            let table: toml::Table = toml::from_str(&trial.configuration)
                .map_err(|error| Fault::in_toml(&file, &trial.configuration, &error))?;
            let mut settings = BTreeMap::new();
            flatten("", &table.into(), &mut settings);
            trials.push(OfTrial { name: trial.name, settings });
        }
        let inputs = manifest.inputs.into_iter().flat_map(|input| {
            let source = input.source;
            input.files.into_iter().map(move |(file, sum)| (format!("{source}: {file}"), sum))
        });
        let axes = manifest.axes.into_iter().map(|axis| axis.column).collect();
        Ok(Self { inputs: inputs.collect(), trials, axes })
    }
}

/// Lists every value of a TOML tree by its dotted key.
fn flatten(path: &str, value: &toml::Value, into: &mut BTreeMap<String, String>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        toml::Value::Table(table) => table.iter().for_each(|(key, value)| flatten(&below(key), value, into)),
        other => {
            into.insert(path.to_owned(), other.to_string());
        }
    }
}

/// A row of a table of results.
struct Row {
    /// The frame, and the index of the attempt in it.
    key: (u64, u64),
    trial: String,
    object: String,
    cells: Vec<String>,
}

impl Row {
    fn name(&self) -> String {
        format!("trial {} frame {} {}", self.trial, self.key.0, self.object).trim_end().to_owned()
    }
}

/// A reader of a table of results, row by row for one trial at a time.
struct Table {
    file: PathBuf,
    input: BufReader<File>,
    line: usize,
    columns: Vec<String>,
    /// The position of each trial's rows: byte offset, and number of lines before. They are contiguous.
    starts: BTreeMap<String, (u64, usize)>,
    trial: Option<String>,
    last: Option<(u64, u64)>,
}

impl Table {
    fn open(folder: &Path) -> Result<Self, Fault> {
        let file = folder.join("results.csv");
        unchanged(&file).map_err(|error| Fault::new(error.to_string(), &file))?;
        let input = File::open(&file)
            .map_err(|error| Fault::new(format!("cannot read ({error})"), &file).remedy("name the folder of a run"))?;
        let (input, starts) = (BufReader::new(input), BTreeMap::new());
        let mut table = Self { file, input, line: 0, columns: Vec::new(), starts, trial: None, last: None };
        table.columns = table.cells()?.unwrap_or_default();
        for name in ["trial", "frame", "object"] {
            if !table.columns.iter().any(|column| column == name) {
                return Err(Fault::new("a table without a column", &table.file).value(name));
            }
        }
        loop {
            let start = (table.input.stream_position().map_err(|error| table.unreadable(&error))?, table.line);
            let Some(cells) = table.cells()? else { return Ok(table) };
            let trial = table.cell(&cells, "trial").to_owned();
            table.starts.entry(trial).or_insert(start);
        }
    }

    /// Moves to the rows of a trial; without a trial there are none.
    fn begin(&mut self, trial: Option<&str>) -> Result<(), Fault> {
        self.last = None;
        let start = trial.and_then(|trial| Some((trial.to_owned(), *self.starts.get(trial)?)));
        self.trial = start.as_ref().map(|(trial, _)| trial.clone());
        if let Some((_, (byte, line))) = start {
            self.line = line;
            self.input.seek(SeekFrom::Start(byte)).map_err(|error| self.unreadable(&error))?;
        }
        Ok(())
    }

    fn unreadable(&self, error: &std::io::Error) -> Fault {
        Fault::new(format!("cannot read ({error})"), &self.file).on_line(self.line)
    }

    fn cell<'c>(&self, cells: &'c [String], name: &str) -> &'c str {
        let place = self.columns.iter().position(|column| column == name);
        place.and_then(|place| cells.get(place)).map_or("", String::as_str)
    }

    fn cells(&mut self) -> Result<Option<Vec<String>>, Fault> {
        self.line += 1;
        let mut line = String::new();
        let read = self.input.read_line(&mut line).map_err(|error| self.unreadable(&error))?;
        Ok((read > 0).then(|| cells(line.trim_end_matches(['\n', '\r']))))
    }

    /// The next row of the trial.
    fn next(&mut self) -> Result<Option<Row>, Fault> {
        let Some(trial) = self.trial.clone() else { return Ok(None) };
        let Some(cells) = self.cells()? else { return Ok(None) };
        if cells.len() != self.columns.len() {
            let fault =
                Fault::new(format!("{} cells in a table of {} columns", cells.len(), self.columns.len()), &self.file);
            return Err(fault.on_line(self.line));
        }
        if self.cell(&cells, "trial") != trial {
            self.trial = None;
            return Ok(None);
        }
        let frame = self.cell(&cells, "frame").parse::<u64>().map_err(|_| {
            let value = format!("{trial} frame {}", self.cell(&cells, "frame"));
            Fault::new("a row without a frame number", &self.file).on_line(self.line).value(value)
        })?;
        let object = self.cell(&cells, "object").to_owned();
        let attempt = self.last.filter(|(at, _)| *at == frame).map_or(0, |(_, attempt)| attempt + 1);
        self.last = Some((frame, attempt));
        Ok(Some(Row { key: (frame, attempt), trial, object, cells }))
    }
}

/// The fields of a line (RFC 4180); names of trials and objects have no line breaks.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        let last = cells.last_mut().expect("there is always a field");
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => {
                letters.next();
                last.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            letter => last.push(letter),
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_may_be_quoted() {
        assert_eq!(cells("a,\"b,\"\"c\"\"\",,d"), ["a", "b,\"c\"", "", "d"]);
        assert_eq!(cells(""), [""]);
    }

    fn trial(name: &str, settings: &[(&str, &str)]) -> OfTrial {
        let settings = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        OfTrial { name: name.to_owned(), settings }
    }

    #[test]
    fn trials_belong_together_by_what_varies() {
        let a = [trial("1", &[("solver", "x"), ("range", "2")]), trial("2", &[("solver", "y"), ("range", "2")])];
        let b = [
            trial("1", &[("solver", "y"), ("range", "2"), ("seed", "3")]),
            trial("2", &[("solver", "x"), ("range", "2"), ("seed", "3")]),
            trial("3", &[("solver", "x"), ("range", "5"), ("seed", "3")]),
        ];
        // The seed varies in neither run: it is a difference and does not pair trials.
        assert_eq!(pairs(&a, &b), [(Some(0), Some(1)), (Some(1), Some(0)), (None, Some(2))]);
        assert_eq!(pairs(&b, &a), [(Some(0), Some(1)), (Some(1), Some(0)), (Some(2), None)]);
        let run_inputs = |trials| RunInputs { inputs: BTreeMap::new(), trials, axes: Default::default() };
        let message: Vec<String> = configuration(
            &run_inputs(a.into()),
            &run_inputs(b.into()),
            &[(Some(0), Some(1)), (Some(1), Some(0)), (None, Some(2))],
        )
        .into_iter()
        .map(|change| format!("{} {:?} {:?}", change.what, change.first, change.second))
        .collect();
        assert_eq!(
            message,
            ["seed None Some(\"3\")", "trials Some(\"2\") Some(\"3\")", "trial 3 None Some(\"there\")"]
        );
        // The first of several identical trials is paired with the first.
        let same = [trial("1", &[]), trial("2", &[])];
        assert_eq!(pairs(&same, &same), [(Some(0), Some(0)), (Some(1), Some(1))]);
    }

    #[test]
    fn a_tree_is_reported_by_its_leaves() {
        let table: toml::Table = toml::from_str("a = 1\n[b]\nc = ['x']\n").unwrap();
        let mut leaves = BTreeMap::new();
        flatten("", &table.into(), &mut leaves);
        assert_eq!(
            leaves.into_iter().collect::<Vec<_>>(),
            [("a".into(), "1".into()), ("b.c".into(), "[\"x\"]".into())]
        );
    }
}
