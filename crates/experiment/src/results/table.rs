//! Rows in memory, stored by column, before they are written to files.

use std::{fs::File, path::Path, sync::Arc};

use parquet::{
    basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel},
    column::{reader::ColumnReader, writer::ColumnWriter},
    data_type::ByteArray,
    errors::ParquetError,
    file::{
        metadata::KeyValue,
        properties::WriterProperties,
        reader::RowGroupReader,
        writer::{SerializedFileWriter, SerializedRowGroupWriter},
    },
    schema::types::{Type, TypePtr},
};

use seafix_log::{
    FrameRecord, TargetRecord,
    quantities::{Kind, QUANTITIES, Value},
};

use super::{
    axes::Axes,
    cell::{quote, write_cell},
};

/// The number of rows of a full row group of the Parquet table.
pub(super) const ROW_GROUP: usize = 8192;

/// The rows of one trial: as CSV text (RFC 4180, unknown values empty) and as columns.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) rows: usize,
    pub(crate) text: String,
    columns: Vec<Values>,
    /// The columns of the varied settings, which only a joined table has.
    axes: Vec<Values>,
}

/// The values of one column. A column with unknown values has the known ones, and for every row whether it has one.
#[derive(Debug)]
enum Values {
    Text(Vec<ByteArray>),
    Integer(Vec<i64>, Vec<i16>),
    Real(Vec<f64>, Vec<i16>),
    Flag(Vec<bool>, Vec<i16>),
}

impl Default for Table {
    fn default() -> Self {
        Self::with(&Axes::default())
    }
}

impl Table {
    /// An empty table that also has the columns of `axes`.
    pub(super) fn with(axes: &Axes) -> Self {
        let columns = QUANTITIES.iter().map(|column| Values::empty(column.kind)).collect();
        let axes = axes.columns.iter().map(|(_, kind)| Values::empty(*kind)).collect();
        Self { rows: 0, text: String::new(), columns, axes }
    }

    /// The header of the table as CSV.
    pub(crate) fn head(axes: &Axes) -> String {
        let mut text = QUANTITIES.iter().map(|column| column.name).collect::<Vec<_>>().join(",");
        for (column, _) in &axes.columns {
            text.push(',');
            quote(&mut text, &column.column);
        }
        text + "\n"
    }

    /// Adds the rows of a frame, one for each attempt.
    pub(crate) fn add(&mut self, trial: &str, frame: &FrameRecord) {
        frame.targets.iter().for_each(|target| self.add_row(trial, frame, target));
    }

    fn add_row(&mut self, trial: &str, frame: &FrameRecord, target: &TargetRecord) {
        self.rows += 1;
        for (place, (column, values)) in QUANTITIES.iter().zip(&mut self.columns).enumerate() {
            if place > 0 {
                self.text.push(',');
            }
            let cell = column.value(trial, frame, target);
            write_cell(&mut self.text, &cell);
            values.push(cell);
        }
        self.text.push('\n');
    }

    /// Adds the rows of a row group to the columns, but not to the text; `cells` are those of its trial on the axes.
    pub(super) fn read(&mut self, group: &dyn RowGroupReader, cells: &[Value]) -> Result<(), ParquetError> {
        let rows = group.metadata().num_rows() as usize;
        self.rows += rows;
        for (place, values) in self.columns.iter_mut().enumerate() {
            values.read(group.get_column_reader(place)?, rows)?;
        }
        for (values, cell) in self.axes.iter_mut().zip(cells) {
            (0..rows).for_each(|_| values.push(cell.clone()));
        }
        Ok(())
    }

    /// Writes the columns as row groups of [`ROW_GROUP`] rows and removes them. The result is the number of groups. The
    /// remaining rows are written as a smaller group if this is the `end`.
    pub(crate) fn write(&mut self, file: &mut SerializedFileWriter<File>, end: bool) -> Result<usize, ParquetError> {
        let mut groups = 0;
        while self.rows >= ROW_GROUP || (end && self.rows > 0) {
            let rows = self.rows.min(ROW_GROUP);
            let mut group = file.next_row_group()?;
            for values in self.columns.iter_mut().chain(&mut self.axes) {
                let mut writer = group.next_column()?.expect("the schema has this column");
                values.write(writer.untyped(), rows)?;
                writer.close()?;
            }
            group.close()?;
            self.rows -= rows;
            groups += 1;
        }
        Ok(groups)
    }
}

impl Values {
    fn empty(kind: Kind) -> Self {
        match kind {
            Kind::Text => Self::Text(Vec::new()),
            Kind::Integer => Self::Integer(Vec::new(), Vec::new()),
            Kind::Real => Self::Real(Vec::new(), Vec::new()),
            Kind::Flag => Self::Flag(Vec::new(), Vec::new()),
        }
    }

    /// The column of `rows` equal cells.
    fn constant(kind: Kind, cell: &Value, rows: usize) -> Self {
        let mut values = Self::empty(kind);
        (0..rows).for_each(|_| values.push(cell.clone()));
        values
    }

    fn push(&mut self, cell: Value) {
        fn known<T>((values, levels): (&mut Vec<T>, &mut Vec<i16>), value: Option<T>) {
            levels.push(i16::from(value.is_some()));
            values.extend(value);
        }
        match (self, cell) {
            (Self::Text(all), Value::Text(word)) => all.push(ByteArray::from(word.into_bytes())),
            (Self::Integer(all, levels), Value::Integer(value)) => known((all, levels), value),
            (Self::Real(all, levels), Value::Real(value)) => known((all, levels), value),
            (Self::Flag(all, levels), Value::Flag(value)) => known((all, levels), value),
            _ => unreachable!("a column has cells of its own type"),
        }
    }

    fn read(&mut self, reader: ColumnReader, rows: usize) -> Result<(), ParquetError> {
        match (self, reader) {
            (Self::Text(all), ColumnReader::ByteArrayColumnReader(mut reader)) => {
                reader.read_records(rows, None, None, all).map(drop)
            }
            (Self::Integer(all, levels), ColumnReader::Int64ColumnReader(mut reader)) => {
                reader.read_records(rows, Some(levels), None, all).map(drop)
            }
            (Self::Real(all, levels), ColumnReader::DoubleColumnReader(mut reader)) => {
                reader.read_records(rows, Some(levels), None, all).map(drop)
            }
            (Self::Flag(all, levels), ColumnReader::BoolColumnReader(mut reader)) => {
                reader.read_records(rows, Some(levels), None, all).map(drop)
            }
            _ => Err(ParquetError::General("a column of another type".to_owned())),
        }
    }

    /// Writes the first `rows` rows and removes them.
    fn write(&mut self, writer: &mut ColumnWriter<'_>, rows: usize) -> Result<(), ParquetError> {
        fn first<T>(values: &mut Vec<T>, levels: &mut Vec<i16>, rows: usize) -> (Vec<T>, Vec<i16>) {
            let levels: Vec<i16> = levels.drain(..rows).collect();
            let known = levels.iter().filter(|level| **level > 0).count();
            (values.drain(..known).collect(), levels)
        }
        match (self, writer) {
            (Self::Text(all), ColumnWriter::ByteArrayColumnWriter(writer)) => {
                let words: Vec<ByteArray> = all.drain(..rows).collect();
                writer.write_batch(&words, None, None).map(drop)
            }
            (Self::Integer(all, levels), ColumnWriter::Int64ColumnWriter(writer)) => {
                let (values, levels) = first(all, levels, rows);
                writer.write_batch(&values, Some(&levels), None).map(drop)
            }
            (Self::Real(all, levels), ColumnWriter::DoubleColumnWriter(writer)) => {
                let (values, levels) = first(all, levels, rows);
                writer.write_batch(&values, Some(&levels), None).map(drop)
            }
            (Self::Flag(all, levels), ColumnWriter::BoolColumnWriter(writer)) => {
                let (values, levels) = first(all, levels, rows);
                writer.write_batch(&values, Some(&levels), None).map(drop)
            }
            _ => Err(ParquetError::General("a column of another type".to_owned())),
        }
    }
}

/// Writes the columns of the axes into a row group of one trial, after its other columns.
pub(super) fn write_axes(
    group: &mut SerializedRowGroupWriter<'_, File>,
    axes: &Axes,
    cells: &[Value],
    rows: usize,
) -> Result<(), ParquetError> {
    for ((_, kind), cell) in axes.columns.iter().zip(cells) {
        let mut writer = group.next_column()?.expect("the schema has this column");
        Values::constant(*kind, cell, rows).write(writer.untyped(), rows)?;
        writer.close()?;
    }
    Ok(())
}

/// A column of the schema. Words are never unknown, but empty.
fn field(name: &str, kind: Kind) -> Result<TypePtr, ParquetError> {
    let (physical, repetition, logical) = match kind {
        Kind::Text => (Physical::BYTE_ARRAY, Repetition::REQUIRED, Some(LogicalType::String)),
        Kind::Integer => (Physical::INT64, Repetition::OPTIONAL, None),
        Kind::Real => (Physical::DOUBLE, Repetition::OPTIONAL, None),
        Kind::Flag => (Physical::BOOLEAN, Repetition::OPTIONAL, None),
    };
    let column = Type::primitive_type_builder(name, physical).with_repetition(repetition);
    column.with_logical_type(logical).build().map(Arc::new)
}

/// Creates an empty Parquet table with ZSTD compression.
pub(crate) fn create(path: &Path, axes: &Axes) -> Result<SerializedFileWriter<File>, ParquetError> {
    let own = QUANTITIES.iter().map(|column| (column.name, column.kind, column.unit, column.doc));
    let varied = axes
        .columns
        .iter()
        .map(|(column, kind)| (column.column.as_str(), *kind, column.unit.as_str(), column.description.as_str()));
    let columns: Vec<(&str, Kind, &str, &str)> = own.chain(varied).collect();
    let fields = columns.iter().map(|&(name, kind, ..)| field(name, kind)).collect::<Result<_, _>>()?;
    let schema = Arc::new(Type::group_type_builder("results").with_fields(fields).build()?);
    // What the columns are, for whoever finds the file alone: the table of `docs/quantities.md`.
    let about = |suffix: &str, text: &str, column: &str| KeyValue::new(format!("{column}.{suffix}"), text.to_owned());
    let described =
        columns.iter().flat_map(|&(name, _, unit, doc)| [about("unit", unit, name), about("description", doc, name)]);
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(described.collect()))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by(concat!("seafix ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    SerializedFileWriter::new(File::create(path)?, schema, Arc::new(properties))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_a_line_and_unknown_is_empty() {
        let mut table = Table::default();
        for object in ["a,b", "=1+1"] {
            let mut target = TargetRecord::rejected(object, "maximum-clique", "kabsch", "absent");
            target.evaluation.visible = Some(4);
            let frame = FrameRecord { frame: 2, stamp_ns: 7, targets: vec![target], ..Default::default() };
            table.add("001", &frame);
        }
        let head = "trial,frame,stamp_ns,object,search,solver,outcome,reason,explanation,p_absent,p_wrong";
        assert!(Table::head(&Axes::default()).starts_with(head));
        let mut lines = table.text.lines();
        assert!(lines.next().unwrap().starts_with("001,2,7,\"a,b\",maximum-clique,kabsch,rejected,absent,,,,,,4,,"));
        assert!(lines.next().unwrap().contains("\"'=1+1\""));
    }
}
