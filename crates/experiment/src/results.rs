//! The table of results: one row a trial, frame and attempted target.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use parquet::{
    basic::{Compression, ZstdLevel},
    column::writer::ColumnCloseResult,
    data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type},
    errors::ParquetError,
    file::{
        properties::WriterProperties,
        reader::{FileReader, SerializedFileReader},
        writer::SerializedFileWriter,
    },
    schema::parser::parse_message_type,
};
use seafix_log::{FrameRecord, FrameTimes, TargetRecord};

/// One row: an attempt, its frame and its trial.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    trial: String,
    frame: u64,
    stamp_ns: u64,
    times: FrameTimes,
    target: TargetRecord,
}

impl Row {
    /// The rows of one frame.
    pub(crate) fn of(trial: &str, frame: &FrameRecord) -> impl Iterator<Item = Self> {
        frame.targets.iter().map(move |target| Self {
            trial: trial.to_owned(),
            frame: frame.frame,
            stamp_ns: frame.stamp_ns,
            times: frame.times,
            // Rows wait in their thousands: what no column has is left out.
            target: TargetRecord {
                candidates: Vec::new(),
                alternatives: Vec::new(),
                pairs: Vec::new(),
                used: Vec::new(),
                detail: String::new(),
                ..target.clone()
            },
        })
    }
}

/// A value of the table; `None` where it is unknown.
enum Cell {
    Text(String),
    Whole(Option<i64>),
    Real(Option<f64>),
    Flag(Option<bool>),
}

/// One column: its name and how a row fills it.
#[derive(Debug)]
pub struct Column {
    /// The name, in the head of both files.
    pub name: &'static str,
    kind: &'static str,
    fill: fn(&Row) -> Cell,
}

macro_rules! columns {
    ($($kind:ident $name:literal = $fill:expr),* $(,)?) => {
        &[$(Column { name: $name, kind: stringify!($kind), fill: |row| Cell::$kind($fill(row)) }),*]
    };
}

/// The columns, in order. Times are milliseconds, lengths metres, angles radians.
pub static COLUMNS: &[Column] = columns![
    Text "trial" = |r: &Row| r.trial.clone(),
    Whole "frame" = |r: &Row| Some(r.frame as i64),
    Whole "stamp_ns" = |r: &Row| Some(r.stamp_ns as i64),
    Text "object" = |r: &Row| r.target.object.clone(),
    Text "search" = |r: &Row| r.target.search.clone(),
    Text "solver" = |r: &Row| r.target.solver.clone(),
    Text "outcome" = |r: &Row| r.target.outcome.to_string(),
    Text "reason" = |r: &Row| r.target.reason.clone(),
    Flag "wrong" = |r: &Row| r.target.evaluation.wrong,
    Flag "wrong_pairs" = |r: &Row| r.target.evaluation.wrong_pairs,
    Whole "visible" = |r: &Row| r.target.evaluation.visible.map(i64::from),
    Whole "identified" = |r: &Row| r.target.evaluation.identified.map(i64::from),
    Whole "correct_pairs" = |r: &Row| r.target.evaluation.correct_pairs.map(i64::from),
    Real "m1_rms" = |r: &Row| r.target.evaluation.m1_rms,
    Real "m1_unused_rms" = |r: &Row| r.target.evaluation.m1_unused_rms,
    Real "m2_rms" = |r: &Row| r.target.evaluation.m2_rms,
    Real "m3_position" = |r: &Row| r.target.evaluation.m3_position,
    Real "m3_attitude" = |r: &Row| r.target.evaluation.m3_attitude,
    Real "nees" = |r: &Row| r.target.evaluation.nees,
    Real "m2_bound" = |r: &Row| r.target.evaluation.m2_bound,
    Real "m3_bound" = |r: &Row| r.target.evaluation.m3_bound,
    Real "residual_rms" = |r: &Row| r.target.residual_rms,
    Flag "optimal" = |r: &Row| r.target.optimal,
    Whole "size_bound" = |r: &Row| r.target.size_bound.map(|n| n as i64),
    Real "expected_chance_sets" = |r: &Row| r.target.expected_chance_sets,
    Whole "tests" = |r: &Row| r.target.tests.map(|n| n as i64),
    Real "detect_ms" = |r: &Row| r.times.detect_ms,
    Real "locate_ms" = |r: &Row| r.times.locate_ms,
    Real "describe_ms" = |r: &Row| r.times.describe_ms,
    Real "match_ms" = |r: &Row| r.times.match_ms,
    Real "refine_ms" = |r: &Row| r.times.refine_ms,
    Real "triangulate_ms" = |r: &Row| r.times.triangulate_ms,
    Real "candidates_ms" = |r: &Row| r.target.times.candidates_ms,
    Real "search_ms" = |r: &Row| r.target.times.search_ms,
    Real "solve_ms" = |r: &Row| r.target.times.solve_ms,
    Real "total_ms" = |r: &Row| r.target.times.total_ms,
];

/// The rows of one trial, on their way into the tables: written in pieces as they come, so that however many there are
/// few are in memory.
pub(crate) struct Part {
    /// How many rows there are.
    pub(crate) rows: usize,
    csv: PathBuf,
    parquet: PathBuf,
    text: Option<BufWriter<File>>,
    columns: Option<SerializedFileWriter<File>>,
    waiting: Vec<Row>,
}

/// Rows of one row group of the Parquet table.
const ROW_GROUP: usize = 8192;

impl Part {
    /// The part of `trial`, in files of its own beside the tables until they are joined.
    pub(crate) fn create(folder: &Path, trial: &str) -> Result<Self, String> {
        let at = |ending: &str| folder.join(format!("{trial}.results.{ending}.partial"));
        let (csv, parquet) = (at("csv"), at("parquet"));
        let text = BufWriter::new(File::create(&csv).map_err(|error| error.to_string())?);
        let columns = parquet_writer(&parquet)?;
        Ok(Self { rows: 0, csv, parquet, text: Some(text), columns: Some(columns), waiting: Vec::new() })
    }

    /// Adds a row.
    pub(crate) fn add(&mut self, row: Row) -> Result<(), String> {
        self.rows += 1;
        self.waiting.push(row);
        if self.waiting.len() < ROW_GROUP { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<(), String> {
        let rows = std::mem::take(&mut self.waiting);
        if let (Some(text), Some(columns), false) = (&mut self.text, &mut self.columns, rows.is_empty()) {
            text.write_all(csv_lines(&rows).as_bytes()).map_err(|error| error.to_string())?;
            write_row_group(columns, &rows).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// No more rows come.
    pub(crate) fn close(&mut self) -> Result<(), String> {
        self.flush()?;
        if let (Some(mut text), Some(columns)) = (self.text.take(), self.columns.take()) {
            text.flush().map_err(|error| error.to_string())?;
            columns.close().map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// Removes its files.
    pub(crate) fn remove(self) -> Result<(), String> {
        [&self.csv, &self.parquet].into_iter().try_for_each(fs::remove_file).map_err(|error| error.to_string())
    }
}

/// Joins parts into the table at `path`, `results.csv.…` or `results.parquet.…`.
pub(crate) fn join(parts: &[Part], path: &Path) -> Result<(), String> {
    if path.to_string_lossy().contains(".csv") {
        let mut all = File::create(path).map_err(|error| error.to_string())?;
        all.write_all(csv_head().as_bytes()).map_err(|error| error.to_string())?;
        for part in parts {
            let mut text = File::open(&part.csv).map_err(|error| error.to_string())?;
            io::copy(&mut text, &mut all).map_err(|error| error.to_string())?;
        }
        return all.sync_all().map_err(|error| error.to_string());
    }
    let mut all = parquet_writer(path)?;
    parts.iter().try_for_each(|part| append(&mut all, &part.parquet)).map_err(|error| error.to_string())?;
    // Writes the footer and gives the file back.
    all.into_inner().map_err(|error| error.to_string())?.sync_all().map_err(|error| error.to_string())
}

/// Copies the row groups of another table of the same columns, as they are.
fn append(all: &mut SerializedFileWriter<File>, part: &Path) -> Result<(), ParquetError> {
    let file = File::open(part)?;
    let read = SerializedFileReader::new(file.try_clone()?)?;
    for group in read.metadata().row_groups() {
        let mut copy = all.next_row_group()?;
        for column in group.columns() {
            let closed = ColumnCloseResult {
                bytes_written: column.compressed_size() as u64,
                rows_written: group.num_rows() as u64,
                metadata: column.clone(),
                bloom_filter: None,
                column_index: None,
                offset_index: None,
            };
            copy.append_column(&file, closed)?;
        }
        copy.close()?;
    }
    Ok(())
}

/// The head of the table as CSV.
fn csv_head() -> String {
    COLUMNS.iter().map(|column| column.name).collect::<Vec<_>>().join(",") + "\n"
}

/// Rows as CSV (RFC 4180); unknown values are empty.
fn csv_lines(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = COLUMNS
            .iter()
            .map(|column| match (column.fill)(row) {
                Cell::Text(word) => quoted(&word),
                Cell::Whole(number) => number.map(|n| n.to_string()).unwrap_or_default(),
                Cell::Real(number) => number.map(real).unwrap_or_default(),
                Cell::Flag(flag) => flag.map(|f| f.to_string()).unwrap_or_default(),
            })
            .collect();
        text += &cells.join(",");
        text += "\n";
    }
    text
}

/// A number with all its digits; very small ones with an exponent instead of many zeros.
fn real(x: f64) -> String {
    if x != 0.0 && x.abs() < 1e-5 { format!("{x:e}") } else { x.to_string() }
}

/// A word as a CSV field: quoted where it must be; a spreadsheet shall not take it for a formula.
fn quoted(word: &str) -> String {
    let formula = word.starts_with(['=', '+', '-', '@', '\t', '\r']);
    if formula || word.contains([',', '"', '\n', '\r']) {
        format!("\"{}{}\"", if formula { "'" } else { "" }, word.replace('"', "\"\""))
    } else {
        word.to_owned()
    }
}

/// An empty Parquet table, ZSTD.
fn parquet_writer(path: &Path) -> Result<SerializedFileWriter<File>, String> {
    let fields: String = COLUMNS
        .iter()
        .map(|column| match column.kind {
            "Text" => format!("REQUIRED BYTE_ARRAY {} (UTF8);", column.name),
            "Whole" => format!("OPTIONAL INT64 {};", column.name),
            "Real" => format!("OPTIONAL DOUBLE {};", column.name),
            _ => format!("OPTIONAL BOOLEAN {};", column.name),
        })
        .collect();
    let new = || -> Result<SerializedFileWriter<File>, ParquetError> {
        let schema = Arc::new(parse_message_type(&format!("message results {{ {fields} }}"))?);
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_created_by(concat!("seafix ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        SerializedFileWriter::new(File::create(path)?, schema, Arc::new(properties))
    };
    new().map_err(|error| error.to_string())
}

/// Writes rows as one row group.
fn write_row_group(file: &mut SerializedFileWriter<File>, rows: &[Row]) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    for column in COLUMNS {
        let mut writer = group.next_column()?.expect("the schema has this column");
        let cells = rows.iter().map(|row| (column.fill)(row));
        match column.kind {
            "Text" => {
                let words: Vec<ByteArray> = cells
                    .map(|cell| if let Cell::Text(word) = cell { word.as_str().into() } else { "".into() })
                    .collect();
                writer.typed::<ByteArrayType>().write_batch(&words, None, None)?;
            }
            "Whole" => {
                let (values, levels) = known(cells.map(|cell| if let Cell::Whole(n) = cell { n } else { None }));
                writer.typed::<Int64Type>().write_batch(&values, Some(&levels), None)?;
            }
            "Real" => {
                let (values, levels) = known(cells.map(|cell| if let Cell::Real(x) = cell { x } else { None }));
                writer.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
            }
            _ => {
                let (values, levels) = known(cells.map(|cell| if let Cell::Flag(f) = cell { f } else { None }));
                writer.typed::<BoolType>().write_batch(&values, Some(&levels), None)?;
            }
        }
        writer.close()?;
    }
    group.close()?;
    Ok(())
}

/// The known values, and for every row whether it has one.
fn known<T>(cells: impl Iterator<Item = Option<T>>) -> (Vec<T>, Vec<i16>) {
    let mut values = Vec::new();
    let levels = cells
        .map(|cell| {
            let level = i16::from(cell.is_some());
            values.extend(cell);
            level
        })
        .collect();
    (values, levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(object: &str) -> Row {
        let mut target = TargetRecord::refused(object, "maximum-clique", "kabsch", "chance");
        target.evaluation.visible = Some(4);
        let frame = FrameRecord { frame: 2, stamp_ns: 7, targets: vec![target], ..Default::default() };
        Row::of("001", &frame).next().unwrap()
    }

    #[test]
    fn a_row_is_a_line_and_unknown_is_empty() {
        let text = csv_head() + &csv_lines(&[row("a,b"), row("=1+1")]);
        let mut lines = text.lines();
        assert!(
            lines
                .next()
                .unwrap()
                .starts_with("trial,frame,stamp_ns,object,search,solver,outcome,reason,wrong,wrong_pairs,visible")
        );
        assert!(lines.next().unwrap().starts_with("001,2,7,\"a,b\",maximum-clique,kabsch,unidentified,chance,,,4,,"));
        assert!(lines.next().unwrap().contains("\"'=1+1\""));
    }

    #[test]
    fn the_same_table_is_read_back_from_parquet() {
        use parquet::record::Field;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.parquet");
        // Two parts of a row each become one table.
        let part = |trial: &str, object: &str| {
            let mut part = Part::create(folder.path(), trial).unwrap();
            part.add(row(object)).unwrap();
            part.close().unwrap();
            part
        };
        let parts = [part("001", "manifold"), part("002", "")];
        join(&parts, &path).unwrap();
        let text = folder.path().join("results.csv");
        join(&parts, &text).unwrap();
        assert_eq!(fs::read_to_string(&text).unwrap(), csv_head() + &csv_lines(&[row("manifold"), row("")]));
        parts.into_iter().for_each(|part| part.remove().unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "the parts are gone");
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        let field = |row: usize, name: &str| {
            rows[row].get_column_iter().find(|(column, _)| *column == name).map(|(_, field)| field.clone()).unwrap()
        };
        assert_eq!(rows.len(), 2);
        assert_eq!(field(0, "object"), Field::Str("manifold".into()));
        assert_eq!(field(0, "visible"), Field::Long(4));
        assert_eq!(field(1, "m2_rms"), Field::Null);
        assert_eq!(field(1, "stamp_ns"), Field::Long(7));
    }
}
