//! What differs between two runs: first in what they were told, then in what came of it.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufRead, BufReader},
    path::Path,
};

use seafix_component::{Fault, read_text};
use serde::Deserialize;

/// One value that differs; `None` where it is only in the other run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Which: a dotted key of the configuration, a file, or a row and its column.
    pub what: String,
    /// Its value in the first run.
    pub first: Option<String>,
    /// Its value in the second.
    pub second: Option<String>,
}

/// What differs between two runs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Difference {
    /// Settings, trials and seeds.
    pub configuration: Vec<Change>,
    /// Files they were made from.
    pub inputs: Vec<Change>,
    /// Values of the results, durations left out: the first hundred of them.
    pub results: Vec<Change>,
    /// How many values differ in each column.
    pub columns: BTreeMap<String, u64>,
    /// Rows that both runs have.
    pub rows: u64,
}

/// So many differing values are kept one by one.
const MOST: usize = 100;

impl Difference {
    /// Whether nothing differs.
    pub fn is_none(&self) -> bool {
        self.configuration.is_empty() && self.inputs.is_empty() && self.columns.is_empty()
    }
}

/// Compares the runs in two folders. Rows belong together by their trial's place in the experiment,
/// frame and object, in order; durations, versions and machines are not compared.
///
/// # Errors
/// A folder that is no finished run, or files that cannot be read.
pub fn diff(first: &Path, second: &Path) -> Result<Difference, Fault> {
    let (a, b) = (Told::read(first)?, Told::read(second)?);
    let mut difference = Difference {
        configuration: changes(&a.settings, &b.settings),
        inputs: changes(&a.inputs, &b.inputs),
        ..Difference::default()
    };
    let (mut one, mut two) = (Table::open(first, &a.trials)?, Table::open(second, &b.trials)?);
    let common: Vec<(usize, usize)> = one
        .columns
        .iter()
        .enumerate()
        // The name of a trial holds its settings, which are compared above.
        .filter(|(_, name)| *name != "trial" && !name.ends_with("_ms"))
        .filter_map(|(i, name)| Some((i, two.columns.iter().position(|other| other == name)?)))
        .collect();
    for (only, other) in [(&one, &two), (&two, &one)] {
        for name in only.columns.iter().filter(|name| !other.columns.contains(name)) {
            difference.columns.insert(name.clone(), 0);
        }
    }
    let (mut left, mut right) = (one.next()?, two.next()?);
    loop {
        let order = match (&left, &right) {
            (None, None) => break,
            (Some(_), None) => std::cmp::Ordering::Less,
            (None, Some(_)) => std::cmp::Ordering::Greater,
            (Some(a), Some(b)) => a.key.cmp(&b.key),
        };
        let names = |row: &Option<Row>| row.as_ref().map(Row::name).unwrap_or_default();
        match order {
            std::cmp::Ordering::Less => {
                difference.note("row", names(&left), Some("there".to_owned()), None);
                left = one.next()?;
            }
            std::cmp::Ordering::Greater => {
                difference.note("row", names(&right), None, Some("there".to_owned()));
                right = two.next()?;
            }
            std::cmp::Ordering::Equal => {
                if let (Some(a), Some(b)) = (&left, &right) {
                    difference.rows += 1;
                    for &(i, j) in &common {
                        let (x, y) = (&a.cells[i], &b.cells[j]);
                        if x != y {
                            difference.note(&one.columns[i], a.name(), Some(x.clone()), Some(y.clone()));
                        }
                    }
                }
                (left, right) = (one.next()?, two.next()?);
            }
        }
    }
    Ok(difference)
}

impl Difference {
    fn note(&mut self, column: &str, row: String, first: Option<String>, second: Option<String>) {
        *self.columns.entry(column.to_owned()).or_default() += 1;
        if self.results.len() < MOST {
            self.results.push(Change { what: format!("{row} {column}"), first, second });
        }
    }
}

fn changes(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Vec<Change> {
    let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let change = |key: &String| Change { what: key.clone(), first: a.get(key).cloned(), second: b.get(key).cloned() };
    keys.into_iter().map(change).filter(|change| change.first != change.second).collect()
}

/// What a run was told, from its manifest.
struct Told {
    settings: BTreeMap<String, String>,
    inputs: BTreeMap<String, String>,
    /// The places of the trials, by name.
    trials: BTreeMap<String, usize>,
}

/// What of `manifest.json` is compared.
#[derive(Deserialize)]
struct Manifest {
    format: String,
    trials: Vec<Entry>,
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

impl Told {
    fn read(folder: &Path) -> Result<Self, Fault> {
        let file = folder.join("manifest.json");
        let text = read_text(&file).map_err(|fault| fault.remedy("name the folder of a finished run"))?;
        let manifest: Manifest = serde_json::from_str(&text)
            .map_err(|error| Fault::new("a manifest that cannot be read", &file).on_line(error.line()).value(error))?;
        if !manifest.format.starts_with("seafix-manifest/") {
            return Err(Fault::new("not a run's manifest", &file).value(manifest.format));
        }
        let mut trials = Vec::new();
        for trial in &manifest.trials {
            let table: toml::Table = toml::from_str(&trial.configuration)
                .map_err(|error| Fault::in_toml(&file, &trial.configuration, &error))?;
            let mut leaves = BTreeMap::new();
            flatten("", &table.into(), &mut leaves);
            trials.push(leaves);
        }
        let mut settings = BTreeMap::from([("trials".to_owned(), trials.len().to_string())]);
        for (place, leaves) in trials.iter().enumerate() {
            for (key, value) in leaves {
                // What all trials share is said once.
                let shared = trials.iter().all(|other| other.get(key) == Some(value));
                let key = if shared { key.clone() } else { format!("trial {}: {key}", place + 1) };
                settings.insert(key, value.clone());
            }
        }
        let inputs = manifest.inputs.into_iter().flat_map(|input| {
            let source = input.source;
            input.files.into_iter().map(move |(file, sum)| (format!("{source}: {file}"), sum))
        });
        Ok(Self {
            settings,
            inputs: inputs.collect(),
            trials: manifest.trials.into_iter().enumerate().map(|(place, trial)| (trial.name, place)).collect(),
        })
    }
}

/// Every value of a TOML tree by its dotted key.
fn flatten(path: &str, value: &toml::Value, into: &mut BTreeMap<String, String>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        toml::Value::Table(table) => table.iter().for_each(|(key, value)| flatten(&below(key), value, into)),
        other => {
            into.insert(path.to_owned(), other.to_string());
        }
    }
}

/// One row of a table of results.
struct Row {
    /// The trial's place, the frame, and the attempt's place in the frame.
    key: (usize, u64, u64),
    object: String,
    cells: Vec<String>,
}

impl Row {
    fn name(&self) -> String {
        let (trial, frame, _) = self.key;
        format!("trial {} frame {frame} {}", trial + 1, self.object).trim_end().to_owned()
    }
}

/// A table of results, read row by row.
struct Table<'a> {
    file: std::path::PathBuf,
    lines: std::io::Lines<BufReader<File>>,
    line: usize,
    columns: Vec<String>,
    trials: &'a BTreeMap<String, usize>,
    last: Option<(usize, u64, u64)>,
}

impl<'a> Table<'a> {
    fn open(folder: &Path, trials: &'a BTreeMap<String, usize>) -> Result<Self, Fault> {
        let file = folder.join("results.csv");
        let input = File::open(&file)
            .map_err(|error| Fault::new(format!("cannot read ({error})"), &file).remedy("name the folder of a run"))?;
        let mut table =
            Self { file, lines: BufReader::new(input).lines(), line: 0, columns: Vec::new(), trials, last: None };
        table.columns = table.cells()?.unwrap_or_default();
        for name in ["trial", "frame", "object"] {
            if !table.columns.iter().any(|column| column == name) {
                return Err(Fault::new("a table without a column", &table.file).value(name));
            }
        }
        Ok(table)
    }

    fn cells(&mut self) -> Result<Option<Vec<String>>, Fault> {
        self.line += 1;
        let line = self.lines.next().transpose();
        let line = line.map_err(|error| Fault::new(format!("cannot read ({error})"), &self.file).on_line(self.line))?;
        Ok(line.map(|line| cells(&line)))
    }

    fn next(&mut self) -> Result<Option<Row>, Fault> {
        let Some(cells) = self.cells()? else { return Ok(None) };
        if cells.len() != self.columns.len() {
            let fault = Fault::new(format!("{} cells under {} heads", cells.len(), self.columns.len()), &self.file);
            return Err(fault.on_line(self.line));
        }
        let cell = |name: &str| self.columns.iter().position(|column| column == name).map_or("", |i| &cells[i]);
        let (trial, frame) = (self.trials.get(cell("trial")), cell("frame").parse::<u64>());
        let (Some(&trial), Ok(frame)) = (trial, frame) else {
            let value = format!("{} frame {}", cell("trial"), cell("frame"));
            return Err(Fault::new("a row of no trial", &self.file).on_line(self.line).value(value));
        };
        let object = cell("object").to_owned();
        let attempt = match self.last {
            Some((before, at, attempt)) if (before, at) == (trial, frame) => attempt + 1,
            _ => 0,
        };
        self.last = Some((trial, frame, attempt));
        Ok(Some(Row { key: (trial, frame, attempt), object, cells }))
    }
}

/// The fields of a line (RFC 4180); names of trials and objects hold no line ends.
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

    #[test]
    fn a_tree_is_told_by_its_leaves() {
        let table: toml::Table = toml::from_str("a = 1\n[b]\nc = ['x']\n").unwrap();
        let mut leaves = BTreeMap::new();
        flatten("", &table.into(), &mut leaves);
        assert_eq!(
            leaves.into_iter().collect::<Vec<_>>(),
            [("a".into(), "1".into()), ("b.c".into(), "[\"x\"]".into())]
        );
    }
}
