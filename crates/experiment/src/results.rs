//! The table of results: one row a trial, frame and attempted target.

use std::{fs::File, path::Path, sync::Arc};

use parquet::{
    basic::{Compression, ZstdLevel},
    data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type},
    errors::ParquetError,
    file::{properties::WriterProperties, writer::SerializedFileWriter},
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
            target: TargetRecord { candidates: Vec::new(), alternatives: Vec::new(), ..target.clone() },
        })
    }

    /// What the table is sorted by; rows of one frame keep their order.
    pub(crate) fn order(&self) -> (&str, u64) {
        (&self.trial, self.frame)
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

/// The table as CSV (RFC 4180); unknown values are empty.
pub(crate) fn csv(rows: &[Row]) -> String {
    let mut text = COLUMNS.iter().map(|column| column.name).collect::<Vec<_>>().join(",") + "\n";
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

/// Writes the table as Parquet, one row group, ZSTD.
pub(crate) fn write_parquet(path: &Path, rows: &[Row]) -> Result<(), ParquetError> {
    let fields: String = COLUMNS
        .iter()
        .map(|column| match column.kind {
            "Text" => format!("REQUIRED BYTE_ARRAY {} (UTF8);", column.name),
            "Whole" => format!("OPTIONAL INT64 {};", column.name),
            "Real" => format!("OPTIONAL DOUBLE {};", column.name),
            _ => format!("OPTIONAL BOOLEAN {};", column.name),
        })
        .collect();
    let schema = Arc::new(parse_message_type(&format!("message results {{ {fields} }}"))?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by(concat!("seafix ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let mut file = SerializedFileWriter::new(File::create(path)?, schema, Arc::new(properties))?;
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
    // Writes the footer and gives the file back.
    file.into_inner()?.sync_all()?;
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
        let text = csv(&[row("a,b"), row("=1+1")]);
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
        use parquet::{
            file::reader::{FileReader, SerializedFileReader},
            record::Field,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.parquet");
        write_parquet(&path, &[row("manifold"), row("")]).unwrap();
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
