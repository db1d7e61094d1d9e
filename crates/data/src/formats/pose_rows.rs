//! The rows of a table of poses.

use std::path::Path;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use seafix_component::Fault;

use super::{
    columns::Columns,
    layout::{Found, Layout, find, without_poses},
    stamp::nanoseconds,
    table::{Row, Table},
    units::TimeUnit,
};

/// The attitude in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Attitude {
    Quaternion(UnitQuaternion<f64>),
    /// A rotation matrix as the file has it.
    Matrix(Matrix3<f64>),
    /// A position without an attitude.
    Unknown,
}

/// A pose and its place in the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PoseRow {
    pub(crate) line: usize,
    pub(crate) stamp_ns: Option<u64>,
    pub(crate) position: Vector3<f64>,
    pub(crate) attitude: Attitude,
}

/// The rows of a file, and warnings about their numbers.
#[derive(Debug, Default)]
pub(crate) struct PoseRows {
    pub(crate) rows: Vec<PoseRow>,
    pub(crate) warnings: Vec<Fault>,
    /// The line and the length of the first quaternion off unit length by more than the rounding of six decimals.
    pub(crate) normalised: Option<(usize, f64)>,
}

/// A quaternion of this deviation from unit length is that of a rotation with rounded digits.
const OFF_LENGTH: f64 = 1e-3;
/// The benchmark's KITTI files have seven digits: their rotations are orthonormal to about 1e-6.
const ORTHONORMAL: f64 = 1e-3;
/// The minimum of |w| for a rotation of at most 50°.
const NEAR_ONE: f64 = 0.9;
/// The minimum number of rows for a decision about the order of quaternions.
const FEW: usize = 3;

/// What a reader may assume of a table, and what it does with rows out of order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    /// Whether rows are sorted by time, keeping the first of each stamp.
    pub(crate) sorts: bool,
    /// Whether a quaternion that seems to have w first is rejected. A format that states the order excludes it.
    pub(crate) doubts_order: bool,
}

/// Reads the poses in numbered lines.
///
/// # Errors
/// The first line that is no pose, stamps that do not increase, columns with two possible meanings.
pub(crate) fn read(lines: &[(usize, &str)], file: &Path, reading: Reading) -> Result<PoseRows, Fault> {
    let data: Vec<(usize, &str)> = lines.iter().copied().filter(|(_, line)| !line.starts_with(['#', '%'])).collect();
    let table = Table::of(&data, file)?;
    let found = find(&table, lines, file)?;
    let rounding = rounding(&table, &found);
    let mut reader = Reader { table: &table, file, warnings: Vec::new(), rounding, normalised: None };
    let unit = match &found.layout {
        Layout::Columns(columns) => reader.unit(columns, &found.rows),
        Layout::Matrix { first: 0, .. } => TimeUnit::Seconds,
        Layout::Matrix { first, .. } => reader.unit_of(first - 1, None, &found.rows),
    };
    let mut rows = Vec::with_capacity(found.rows.len());
    for row in &found.rows {
        rows.push(match &found.layout {
            Layout::Columns(columns) => reader.pose(row, columns, unit)?,
            &Layout::Matrix { first, numbers } => reader.matrix(row, first, numbers, unit)?,
        });
    }
    if rows.is_empty() {
        return Err(without_poses(file));
    }
    reader.summarise(&found, &rows)?;
    if reading.doubts_order {
        doubt(&rows, &found, file)?;
    }
    let Reader { mut warnings, normalised, .. } = reader;
    if reading.sorts && rows.iter().all(|row| row.stamp_ns.is_some()) {
        let count = rows.len();
        rows.sort_by_key(|row| row.stamp_ns);
        rows.dedup_by_key(|row| row.stamp_ns);
        if rows.len() < count {
            let fault =
                Fault::new("rows of a repeated stamp", file).value(format!("{} of {count}", count - rows.len()));
            warnings.push(fault.remedy("the first of each stamp is kept"));
        }
    }
    let backwards = rows.windows(2).find(|pair| pair[0].stamp_ns.is_some() && pair[0].stamp_ns >= pair[1].stamp_ns);
    if let Some(pair) = backwards {
        let text = found.rows.iter().find(|row| row.line == pair[1].line);
        let stamp = text.and_then(|row| row.cells.get(stamp_column(&found.layout))).cloned().unwrap_or_default();
        let repeated = rows.windows(2).filter(|pair| pair[0].stamp_ns == pair[1].stamp_ns).count();
        if 2 * repeated > rows.len() && repeated > FEW {
            // Sorting would keep one pose of many.
            let fault = Fault::new("stamps that do not tell the poses apart", file).on_line(pair[1].line);
            let fault =
                fault.value(format!("{stamp}, as {repeated} of {} rows the stamp of the row before", rows.len()));
            return Err(fault.remedy("write stamps with all their digits, as text or as whole nanoseconds"));
        }
        let fault = Fault::new("a stamp not later than the previous one", file).on_line(pair[1].line).value(stamp);
        let remedy = "sort the lines by time, or keep the first of each stamp: `--sort-stamps` of eval, `sort-stamps` of a data set";
        return Err(fault.remedy(remedy));
    }
    Ok(PoseRows { rows, warnings, normalised })
}

fn stamp_column(layout: &Layout) -> usize {
    match layout {
        Layout::Columns(columns) => columns.stamp.map_or(0, |(column, _)| column),
        Layout::Matrix { first, .. } => first.saturating_sub(1),
    }
}

/// The number of decimals of the quaternions.
fn rounding(table: &Table<'_>, found: &Found<'_>) -> usize {
    let Layout::Columns(Columns { quaternion: Some(parts), .. }) = &found.layout else { return usize::MAX };
    let decimals = |cell: &String| {
        let cell = table.with_point(cell);
        if cell.contains(['e', 'E']) { usize::MAX } else { cell.split_once('.').map_or(0, |(_, digits)| digits.len()) }
    };
    found
        .rows
        .iter()
        .flat_map(|row| parts.iter().filter_map(|&part| row.cells.get(part)))
        .map(decimals)
        .max()
        .unwrap_or(0)
}

/// Rejects quaternions whose other end is close to one in every row, where w may stand: the first number of
/// x, y, z, w, and the last one of EuRoC's w, x, y, z.
fn doubt(rows: &[PoseRow], found: &Found<'_>, file: &Path) -> Result<(), Fault> {
    let near_one = |row: &PoseRow| match row.attitude {
        Attitude::Quaternion(q) => (if found.is_euroc { q.k } else { q.i }).abs() >= NEAR_ONE,
        _ => false,
    };
    if found.is_named || rows.len() < FEW || !rows.iter().all(near_one) {
        return Ok(());
    }
    let source = &found.rows[0];
    let fault = |what: &str| Fault::new(what, file).on_line(source.line).value(source.text);
    Err(match found.is_euroc {
        true => fault("quaternions that seem to have w last").remedy(
            "add a first line with the names of the columns, `timestamp,tx,ty,tz,qx,qy,qz,qw` or \
             `timestamp,tx,ty,tz,qw,qx,qy,qz`",
        ),
        false => fault("quaternions that seem to have w first").remedy(
            "name the columns in a comment above, `# seconds tx ty tz qx qy qz qw` or `# seconds tx ty tz qw qx qy qz`",
        ),
    })
}

struct Reader<'a> {
    table: &'a Table<'a>,
    file: &'a Path,
    warnings: Vec<Fault>,
    /// The number of decimals of the quaternions.
    rounding: usize,
    normalised: Option<(usize, f64)>,
}

impl Reader<'_> {
    fn fault(&self, row: &Row<'_>, what: impl Into<String>, value: &str, remedy: &str) -> Fault {
        Fault::new(what, self.file).on_line(row.line).value(value).remedy(remedy)
    }

    fn number(&self, row: &Row<'_>, column: usize) -> Result<f64, Fault> {
        let Some(cell) = row.cells.get(column) else {
            let remedy = format!("this row has no column {}; the rows above have", column + 1);
            return Err(self.fault(row, format!("{} columns", row.cells.len()), row.text, &remedy));
        };
        let remedy = match cell.parse::<f64>() {
            Ok(_) => "remove the rows without a pose, as where a tracker was lost",
            Err(_) => "give a number",
        };
        self.table.number(cell).ok_or_else(|| self.fault(row, "not a finite number", cell, remedy))
    }

    /// The unit of the stamps.
    fn unit(&mut self, columns: &Columns, rows: &[Row<'_>]) -> TimeUnit {
        match columns.stamp {
            Some((column, unit)) => self.unit_of(column, unit, rows),
            None => TimeUnit::Seconds,
        }
    }

    /// The unit of the stamps in a column: as named, otherwise by their size since 1970, or by their step if they are
    /// whole.
    fn unit_of(&mut self, column: usize, named: Option<TimeUnit>, rows: &[Row<'_>]) -> TimeUnit {
        let stamps: Vec<f64> = rows.iter().filter_map(|row| self.table.number(row.cells.get(column)?)).collect();
        let integer = rows.iter().all(|row| row.cells.get(column).is_some_and(|cell| cell.parse::<u64>().is_ok()));
        let greatest = stamps.iter().copied().fold(0.0, f64::max);
        // Whole numbers that grow by more than ten days a row are nanoseconds.
        let leaps = integer && stamps.len() > 1 && stamps.windows(2).all(|pair| pair[1] - pair[0] >= 1e6);
        let unit = named.unwrap_or(match greatest {
            greatest if greatest >= 1e17 => TimeUnit::Nanoseconds,
            greatest if greatest >= 1e14 => TimeUnit::Microseconds,
            greatest if greatest >= 1e11 && !leaps => TimeUnit::Milliseconds,
            _ if leaps => TimeUnit::Nanoseconds,
            _ => TimeUnit::Seconds,
        });
        let exponents = rows.iter().any(|row| row.cells.get(column).is_some_and(|cell| cell.contains(['e', 'E'])));
        if exponents && greatest * unit.nanoseconds() as f64 > 2f64.powi(53) {
            // Half the distance of neighbouring numbers.
            let lost = 2f64.powi((greatest * unit.nanoseconds() as f64).log2().floor() as i32 - 53);
            let fault = Fault::new("stamps that have lost digits", self.file).on_line(rows[0].line);
            let fault = fault.value(format!("{}, off by up to {lost:.0} ns", rows[0].cells[column]));
            self.warnings.push(fault.remedy("write stamps as whole nanoseconds, not as 64-bit floating point numbers"));
        }
        unit
    }

    fn stamp(&self, row: &Row<'_>, column: usize, unit: TimeUnit) -> Result<u64, Fault> {
        let cell = self.table.with_point(row.cells.get(column).map_or("", String::as_str));
        let read = match unit {
            TimeUnit::Seconds => nanoseconds(&cell),
            unit => integer(&cell).and_then(|count| count.checked_mul(unit.nanoseconds())).or_else(|| {
                let stamp = cell.parse::<f64>().ok()? * unit.nanoseconds() as f64;
                (0.0..1.8e19).contains(&stamp).then(|| stamp.round() as u64)
            }),
        };
        let remedy = match unit {
            TimeUnit::Seconds => "give seconds, not negative, as a decimal number",
            _ => "give whole nanoseconds",
        };
        read.ok_or_else(|| self.fault(row, "an invalid stamp", &cell, remedy))
    }

    fn pose(&mut self, row: &Row<'_>, columns: &Columns, unit: TimeUnit) -> Result<PoseRow, Fault> {
        let last = columns.position.into_iter().chain(columns.quaternion.into_iter().flatten()).max().unwrap_or(0);
        if row.cells.len() <= last {
            let remedy = format!("a row has {} columns at least", last + 1);
            return Err(self.fault(row, format!("{} columns", row.cells.len()), row.text, &remedy));
        }
        let mut stamp_ns = None;
        if let Some((column, _)) = columns.stamp {
            let stamp = self.stamp(row, column, unit)?;
            let rest = columns.nanoseconds.map(|column| self.number(row, column)).transpose()?.unwrap_or(0.0);
            stamp_ns = Some(stamp + rest as u64);
        }
        let metres = columns.unit.metres();
        let mut position = Vector3::zeros();
        for (axis, &column) in columns.position.iter().enumerate() {
            let number = self.number(row, column)?;
            position[axis] = if metres == 1.0 { number } else { number * metres };
        }
        let attitude = match columns.quaternion {
            None => Attitude::Unknown,
            Some([w, x, y, z]) => {
                let [w, x, y, z] =
                    [self.number(row, w)?, self.number(row, x)?, self.number(row, y)?, self.number(row, z)?];
                self.attitude(row, Quaternion::new(w, x, y, z))?
            }
        };
        Ok(PoseRow { line: row.line, stamp_ns, position, attitude })
    }

    fn attitude(&mut self, row: &Row<'_>, quaternion: Quaternion<f64>) -> Result<Attitude, Fault> {
        let norm = quaternion.norm();
        // Half a unit of the last digit in each of four numbers changes the length by at most this.
        let rounded = if self.rounding <= 2 { 10f64.powi(-(self.rounding as i32)) } else { 0.0 };
        if norm == 0.0 {
            return Ok(Attitude::Unknown);
        }
        if (norm - 1.0).abs() > OFF_LENGTH.max(rounded) || self.rounding == 0 && (norm - 1.0).abs() > OFF_LENGTH {
            let remedy = "four numbers of a rotation have the sum of squares 1: check which columns are the quaternion";
            return Err(self.fault(row, "a quaternion that is not of unit length", &format!("{norm:.6}"), remedy));
        }
        const ROUNDING: f64 = 1e-5;
        if (norm - 1.0).abs() > ROUNDING {
            self.normalised.get_or_insert((row.line, norm));
        }
        Ok(Attitude::Quaternion(UnitQuaternion::new_normalize(quaternion)))
    }

    /// Warns of what holds for the table as a whole.
    fn summarise(&mut self, found: &Found<'_>, rows: &[PoseRow]) -> Result<(), Fault> {
        let unknown = rows.iter().filter(|row| row.attitude == Attitude::Unknown).count();
        if unknown > 0 && unknown < rows.len() {
            let row = rows.iter().find(|row| row.attitude == Attitude::Unknown);
            let line = row.map(|row| row.line);
            let fault = Fault::new("a quaternion of length zero", self.file).on_line(line);
            let fault = fault.value(format!("{unknown} of {} rows", rows.len()));
            return Err(fault.remedy("remove the rows without an attitude, or give all rows the quaternion 0 0 0 0"));
        }
        let Layout::Columns(columns) = &found.layout else { return Ok(()) };
        if columns.has_other_attitude && columns.quaternion.is_none() {
            let fault = Fault::new("an attitude that is not read", self.file);
            self.warnings.push(fault.remedy("its angles have no unique convention: give qx qy qz qw"));
        }
        let off = |cells: &[String], parts: [usize; 4]| {
            let squares = parts.iter().filter_map(|&part| self.table.number(cells.get(part)?)).map(|q| q * q);
            (squares.sum::<f64>().sqrt() - 1.0).abs()
        };
        let rounded = columns.quaternion.filter(|_| self.rounding <= 2 && unknown == 0);
        if let Some(parts) = rounded
            && let Some(row) = found.rows.iter().find(|row| off(&row.cells, parts) > OFF_LENGTH)
        {
            // Each number is off by half a unit of its last digit at most, the rotation by twice their root sum square.
            let angle = (2.0 * 10f64.powi(-(self.rounding as i32))).to_degrees();
            let fault = Fault::new("quaternions rounded to few decimals", self.file).on_line(row.line);
            let fault = fault.value(format!("{} decimals, attitudes off by up to {angle:.1}°", self.rounding));
            if self.rounding < 2 {
                return Err(fault.remedy("give six decimals"));
            }
            self.warnings.push(fault.remedy("they are normalised; give six decimals"));
        }
        Ok(())
    }

    fn matrix(&self, row: &Row<'_>, first: usize, numbers: usize, unit: TimeUnit) -> Result<PoseRow, Fault> {
        if row.cells.len() != first + numbers {
            let remedy = "a KITTI line is a 4×4 matrix or its upper three rows, with or without a stamp before it";
            return Err(self.fault(row, format!("{} columns", row.cells.len()), row.text, remedy));
        }
        let mut m = [0.0; 16];
        for (index, number) in m.iter_mut().take(numbers).enumerate() {
            *number = self.number(row, first + index)?;
        }
        if numbers == 16 && m[12..] != [0.0, 0.0, 0.0, 1.0] {
            let by_columns = m[3] == 0.0 && m[7] == 0.0 && m[11] == 0.0 && m[15] == 1.0;
            let remedy = if by_columns { "it is written by columns: transpose it" } else { "its last row is 0 0 0 1" };
            return Err(self.fault(row, "16 numbers that are no 4×4 matrix of a pose", row.text, remedy));
        }
        let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
        if !(off <= ORTHONORMAL && rotation.determinant() > 0.0) {
            let value = format!("off by {off:.3e}, determinant {:.6}", rotation.determinant());
            let remedy = "a KITTI line is the upper three rows of a 4×4 matrix";
            return Err(self.fault(row, "a matrix whose left part is not a rotation", &value, remedy));
        }
        let stamp_ns = first.checked_sub(1).map(|column| self.stamp(row, column, unit)).transpose()?;
        let position = Vector3::new(m[3], m[7], m[11]);
        Ok(PoseRow { line: row.line, stamp_ns, position, attitude: Attitude::Matrix(rotation) })
    }
}

/// A whole number, also with decimals that are zero.
fn integer(cell: &str) -> Option<u64> {
    let (integer, fraction) = cell.split_once('.').unwrap_or((cell, ""));
    integer.parse().ok().filter(|_| fraction.bytes().all(|byte| byte == b'0'))
}
