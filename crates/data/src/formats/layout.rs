//! The columns of a table of poses: by the names in a header, otherwise by their number.

use std::path::Path;

use seafix_component::Fault;

use super::{
    columns::{Columns, columns, columns_of, states_w_first},
    table::{Row, Separator, Table},
    units::{LengthUnit, TimeUnit},
};

/// The columns of a pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Layout {
    /// Columns of position and quaternion.
    Columns(Columns),
    /// A matrix by rows from this column on, of 12 or 16 numbers; the column before it is the stamp if there is one.
    Matrix { first: usize, numbers: usize },
}

/// The layout of a table, its data rows, and the minimum number of columns.
pub(super) struct Found<'a> {
    pub(super) layout: Layout,
    pub(super) rows: Vec<Row<'a>>,
    /// Whether a name or a comment states the order of the quaternion.
    pub(super) is_named: bool,
    /// Whether the columns are those of EuRoC without names.
    pub(super) is_euroc: bool,
}

/// Finds the columns of `table`, whose comments are among `lines`.
///
/// # Errors
/// A header whose columns are open, a number of columns without a meaning, two possible readings.
pub(super) fn find<'a>(table: &Table<'a>, lines: &[(usize, &str)], file: &Path) -> Result<Found<'a>, Fault> {
    let mut rows = table.rows.clone();
    let first = rows.first().ok_or_else(|| without_poses(file))?;
    // A pose of `nan`, which trackers write where they are lost, is a row and no header.
    let is_name = |cell: &&String| cell.parse::<f64>().is_err() && table.number(cell).is_none();
    let is_header = first.cells.iter().filter(is_name).count() * 2 > first.cells.len();
    let before = if is_header { first.line } else { rows[0].line };
    let mut named: Option<Columns> = None;
    let mut w_first = None;
    for (line, text) in lines.iter().take_while(|(line, _)| *line < before) {
        if text.starts_with(['#', '%']) {
            let stated = states_w_first(text);
            named = match columns(text, *line, file) {
                // Words that state the order of the quaternion name no columns.
                Err(_) if stated.is_some() => named,
                found => found?.or(named),
            };
            w_first = stated.or(w_first);
        }
    }
    if is_header {
        let (line, text) = (first.line, first.text);
        let header = match columns_of(&first.cells, text, line, file)? {
            None => columns(text, line, file)?,
            header => header,
        };
        let Some(header) = header else {
            let fault = Fault::new("a header without the columns of poses", file).on_line(line).value(text);
            return Err(fault.remedy("name the columns `timestamp tx ty tz qx qy qz qw`"));
        };
        named = Some(header);
        rows.remove(0);
    }
    let row = rows.first().ok_or_else(|| without_poses(file))?;
    if let Some(found) = named {
        // The name of an index column is often missing; a comment may name other columns than the rows have.
        let columns = row.cells.len();
        let last = found.position.into_iter().chain(found.quaternion.into_iter().flatten()).max().unwrap_or(0);
        if columns > last {
            return Ok(Found { layout: Layout::Columns(found), rows, is_named: true, is_euroc: false });
        }
        let fault = Fault::new(format!("{columns} columns"), file).on_line(row.line).value(row.text);
        return Err(fault.remedy(format!("the header names {} and more", last + 1)));
    }
    unnamed(table, rows, w_first, file)
}

/// The fault of a file without poses.
pub(super) fn without_poses(file: &Path) -> Fault {
    Fault::new("a trajectory without poses", file).remedy("give TUM, KITTI or EuRoC lines")
}

fn unnamed<'a>(table: &Table<'a>, rows: Vec<Row<'a>>, w_first: Option<bool>, file: &Path) -> Result<Found<'a>, Fault> {
    let row = &rows[0];
    let width = row.cells.len();
    let cell = |row: &Row<'_>, column: usize| row.cells.get(column).and_then(|cell| table.number(cell));
    // Row numbers: whole, one apart, in the first column of a table that has one column too many.
    let counts = |column: usize| {
        let step = |pair: &[Row<'_>]| Some(cell(&pair[1], column)? - cell(&pair[0], column)?);
        rows.len() > 1 && rows.windows(2).all(|pair| step(pair) == Some(1.0))
    };
    let meaningful = |width: usize| matches!(width, 4 | 8 | 12 | 13 | 16 | 17);
    let integer_ns = |column: usize| row.cells.get(column).is_some_and(|cell| cell.parse::<u64>().is_ok());
    let is_numbered =
        !meaningful(width) && meaningful(width.saturating_sub(1)) && counts(0) && !is_nanoseconds(cell(row, 0));
    let from = usize::from(is_numbered);
    let at = |first: usize, quaternion: Option<[usize; 4]>, unit: Option<TimeUnit>| {
        Layout::Columns(Columns {
            stamp: Some((first, unit)),
            nanoseconds: None,
            position: [first + 1, first + 2, first + 3],
            unit: LengthUnit::Metres,
            quaternion: quaternion.map(|parts| parts.map(|part| first + 4 + part)),
            has_other_attitude: false,
        })
    };
    const W_FIRST: Option<[usize; 4]> = Some([0, 1, 2, 3]);
    const W_LAST: Option<[usize; 4]> = Some([3, 0, 1, 2]);
    let last_row = |first: usize| {
        (0..4).all(|column| {
            rows.iter().all(|row| cell(row, first + 12 + column) == Some(if column == 3 { 1.0 } else { 0.0 }))
        })
    };
    let comma = table.separator == Separator::Comma;
    let fault =
        |what: String, remedy: &str| Err(Fault::new(what, file).on_line(row.line).value(row.text).remedy(remedy));
    let is_euroc = comma && (integer_ns(from) || is_nanoseconds(cell(row, from))) && width - from >= 8;
    let layout = match width - from {
        12 if !is_euroc => Layout::Matrix { first: from, numbers: 12 },
        13 if !is_euroc => Layout::Matrix { first: from + 1, numbers: 12 },
        16 if !is_euroc || last_row(from) => Layout::Matrix { first: from, numbers: 16 },
        17 if last_row(from + 1) => Layout::Matrix { first: from + 1, numbers: 16 },
        _ if is_euroc => {
            let order = if w_first == Some(false) { W_LAST } else { W_FIRST };
            at(from, order, Some(TimeUnit::Nanoseconds))
        }
        8 => match w_first {
            Some(true) => at(from, W_FIRST, None),
            None if comma => {
                return fault(
                    "a table that does not name its columns".to_owned(),
                    "the quaternion may be qx qy qz qw (TUM) or qw qx qy qz (EuRoC): add a first line \
                     `timestamp,tx,ty,tz,qx,qy,qz,qw` in the order of the columns",
                );
            }
            _ => at(from, W_LAST, None),
        },
        4 => at(from, None, None),
        7 => return fault("7 columns".to_owned(), "a pose without a stamp has no partner; begin lines with the stamp"),
        count => {
            return fault(
                format!("{count} columns"),
                "give `seconds tx ty tz qx qy qz qw`, a 4×4 matrix or its upper three rows, or name the columns in a \
                 first line",
            );
        }
    };
    Ok(Found { layout, rows, is_named: w_first.is_some(), is_euroc })
}

/// Whether a stamp can only be nanoseconds since 1970.
fn is_nanoseconds(stamp: Option<f64>) -> bool {
    stamp.is_some_and(|stamp| stamp >= 1e17)
}
