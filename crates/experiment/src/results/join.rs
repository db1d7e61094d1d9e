//! Joining of the tables of pieces.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use parquet::{
    column::writer::ColumnCloseResult,
    errors::ParquetError,
    file::{
        reader::{FileReader, SerializedFileReader},
        writer::SerializedFileWriter,
    },
};

use seafix_log::quantities::Value;

use crate::results::{
    axes::{Axes, csv_end},
    table::{self, ROW_GROUP, Table},
};

/// The rows of one trial in the tables of one piece.
#[derive(Debug, Clone)]
pub(crate) struct TrialRows {
    /// The piece's table as CSV, without header.
    pub(crate) csv: PathBuf,
    /// The offset and the length of the rows (bytes).
    pub(crate) text: (u64, u64),
    /// The piece's table as Parquet.
    pub(crate) parquet: PathBuf,
    /// The index of the first row group and the number of row groups.
    pub(crate) groups: (usize, usize),
    /// The number of rows.
    pub(crate) rows: usize,
    /// The cells of the trial on the axes.
    pub(crate) cells: Vec<Value>,
}

/// Writes all `rows`, in order, below one header. Every row ends with the cells of its trial on the
/// `axes`.
pub(crate) fn join_csv(rows: &[TrialRows], axes: &Axes, to: &Path) -> io::Result<()> {
    let mut all = BufWriter::with_capacity(1 << 18, File::create(to)?);
    all.write_all(Table::head(axes).as_bytes())?;
    for TrialRows { csv, text: (start, length), cells, .. } in rows {
        let mut piece = File::open(csv)?;
        piece.seek(SeekFrom::Start(*start))?;
        let copied = match csv_end(cells) {
            end if end.is_empty() => io::copy(&mut piece.take(*length), &mut all)?,
            end => lengthen(BufReader::new(piece.take(*length)), end.as_bytes(), &mut all)?,
        };
        if copied < *length {
            return Err(io::Error::other(format!("{} is {} bytes too short", csv.display(), length - copied)));
        }
    }
    all.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// Copies lines with `end` at the end of each; returns the number of bytes read. A line break in quotes ends no line.
fn lengthen(mut lines: impl BufRead, end: &[u8], to: &mut impl Write) -> io::Result<u64> {
    let (mut read, mut quoted, mut line) = (0, false, Vec::new());
    loop {
        line.clear();
        let length = lines.read_until(b'\n', &mut line)?;
        if length == 0 {
            return Ok(read);
        }
        read += length as u64;
        quoted ^= line.iter().filter(|byte| **byte == b'"').count() % 2 == 1;
        match line.strip_suffix(b"\n").filter(|_| !quoted) {
            Some(cells) => {
                to.write_all(cells)?;
                to.write_all(end)?;
                to.write_all(b"\n")?;
            }
            None => to.write_all(&line)?,
        }
    }
}

/// The number of rows below which a row group is merged with others.
const SMALL: usize = ROW_GROUP / 8;

/// Writes all `rows`, in order. Large row groups are copied unchanged. Small ones are merged, so that
/// a table of many small pieces has few row groups.
pub(crate) fn join_parquet(rows: &[TrialRows], axes: &Axes, to: &Path) -> Result<(), ParquetError> {
    let mut all = table::create(to, axes)?;
    let mut waiting = Table::with(axes);
    for TrialRows { parquet, groups: (first, count), cells, .. } in rows {
        let file = File::open(parquet)?;
        let read = SerializedFileReader::new(file.try_clone()?)?;
        for group in *first..first + count {
            if waiting.rows == 0 && read.metadata().row_group(group).num_rows() as usize >= SMALL {
                copy(&mut all, &file, &read, group, (axes, &cells[..]))?;
                continue;
            }
            waiting.read(&*read.get_row_group(group)?, cells)?;
            waiting.write(&mut all, false)?;
        }
    }
    waiting.write(&mut all, true)?;
    // Writes the footer and returns the file.
    all.into_inner()?.sync_all()?;
    Ok(())
}

/// Copies a row group of a piece's table, and adds the cells of its trial on the axes.
fn copy(
    all: &mut SerializedFileWriter<File>,
    file: &File,
    read: &SerializedFileReader<File>,
    group: usize,
    (axes, cells): (&Axes, &[Value]),
) -> Result<(), ParquetError> {
    let group = read.metadata().row_group(group);
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
        copy.append_column(file, closed)?;
    }
    table::write_axes(&mut copy, axes, cells, group.num_rows() as usize)?;
    copy.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::axes::AxisColumn;
    use parquet::record::Field;
    use seafix_log::{FrameRecord, TargetRecord};
    use std::fs;

    fn frame(number: u64, object: &str) -> FrameRecord {
        let mut target = TargetRecord::rejected(object, "maximum-clique", "kabsch", "absent");
        target.evaluation.visible = (!number.is_multiple_of(3)).then_some(4);
        target.residual_rms = Some(number as f64 / 7.0);
        FrameRecord { frame: number, stamp_ns: 7, targets: vec![target], ..Default::default() }
    }

    /// The axes of a run with one varied number.
    fn axes() -> Axes {
        let trial = [("source.distance".to_owned(), 2.5.into())].into_iter().collect();
        Axes::of(&[AxisColumn::new("source.distance", "m", "Distance (m).".to_owned())], std::iter::once(&trial))
    }

    /// The tables of one piece.
    fn piece(folder: &Path, frames: std::ops::Range<u64>) -> TrialRows {
        let at = |ending: &str| folder.join(format!("{}.{ending}", frames.start));
        let (csv, parquet) = (at("csv"), at("parquet"));
        let rows = (frames.end - frames.start) as usize;
        let mut table = Table::default();
        frames.clone().for_each(|k| table.add("001", &frame(k, "a")));
        fs::write(&csv, &table.text).unwrap();
        let text = (0, table.text.len() as u64);
        let mut file = table::create(&parquet, &Axes::default()).unwrap();
        let groups = (0, table.write(&mut file, true).unwrap());
        file.close().unwrap();
        TrialRows { csv, text, parquet, groups, rows, cells: vec![Value::Real(Some(2.5))] }
    }

    #[test]
    fn a_joined_table_has_the_rows_of_its_pieces_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // The pieces are small, one with two row groups of which the first is full, and small again.
        let cuts = [0, 5, 9, 9 + 8192 + 100, 9 + 2 * 8192 + 100, 9 + 2 * 8192 + 107];
        let pieces: Vec<TrialRows> = cuts.windows(2).map(|cut| piece(folder.path(), cut[0]..cut[1])).collect();
        join_csv(&pieces, &axes(), &at("results.csv")).unwrap();
        join_parquet(&pieces, &axes(), &at("results.parquet")).unwrap();
        let full = piece(folder.path(), 0..cuts[5]);
        let text = fs::read_to_string(&full.csv).unwrap().replace('\n', ",2.5\n");
        let head = Table::head(&axes());
        assert!(head.ends_with(",region,source.distance\n"), "{head}");
        assert_eq!(fs::read_to_string(at("results.csv")).unwrap(), head + &text);
        let reader = SerializedFileReader::new(File::open(at("results.parquet")).unwrap()).unwrap();
        let about = reader.metadata().file_metadata().key_value_metadata().unwrap();
        let about = |key: &str| about.iter().find(|pair| pair.key == key).and_then(|pair| pair.value.as_deref());
        assert_eq!(about("source.distance.unit"), Some("m"));
        assert_eq!(about("source.distance.description"), Some("Distance (m)."));
        assert!(reader.num_row_groups() <= 4, "{} row groups", reader.num_row_groups());
        let mut count = 0;
        for row in reader.get_row_iter(None).unwrap() {
            let row = row.unwrap();
            let field = |name: &str| row.get_column_iter().find(|(column, _)| *column == name).unwrap().1.clone();
            assert_eq!(field("frame"), Field::Long(count));
            assert_eq!(field("object"), Field::Str("a".into()));
            assert_eq!(field("source.distance"), Field::Double(2.5));
            assert_eq!(field("visible"), if count % 3 > 0 { Field::Long(4) } else { Field::Null });
            assert_eq!(field("residual_rms"), Field::Double(count as f64 / 7.0));
            count += 1;
        }
        assert_eq!(count as u64, cuts[5]);
    }
}
