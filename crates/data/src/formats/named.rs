//! Rows of a table whose first line names the columns.

use std::path::Path;

use seafix_component::Fault;

use super::table::{Row, Table};

/// The cells of the columns `header` of each row, and their lines. Columns may stand in any order, and others beside
/// them; names may differ in case and signs.
///
/// # Errors
/// A first line without one of the names, a row with fewer columns.
pub(crate) fn rows<const N: usize>(
    text: &str,
    file: &Path,
    header: [&str; N],
) -> Result<Vec<(usize, [String; N])>, Fault> {
    let lines: Vec<(usize, &str)> = text.lines().enumerate().map(|(index, line)| (index + 1, line)).collect();
    let expected = header.join(",");
    let table = Table::of(&lines, file)?;
    let wrong = |value: &str| {
        Fault::new("a wrong header", file).on_line(1).value(value).remedy(format!("the first line is `{expected}`"))
    };
    let Some((names, rows)) = table.rows.split_first() else { return Err(wrong("")) };
    let plain = |name: &str| name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
    let mut columns = [0; N];
    for (column, wanted) in columns.iter_mut().zip(header) {
        let found: Vec<usize> =
            (0..names.cells.len()).filter(|&column| plain(&names.cells[column]) == plain(wanted)).collect();
        let &[only] = found.as_slice() else { return Err(wrong(names.text)) };
        *column = only;
    }
    let cells = |row: &Row<'_>| {
        if row.cells.len() != names.cells.len() {
            return Err(Fault::new(format!("{} columns", row.cells.len()), file)
                .on_line(row.line)
                .value(row.text)
                .remedy(format!("a line is `{}`", names.text.trim())));
        }
        Ok((row.line, columns.map(|column| row.cells[column].clone())))
    };
    rows.iter().map(cells).collect()
}

/// The number in a cell, with a decimal point or comma.
///
/// # Errors
/// A word that is not a number, with its line.
pub(crate) fn number<T: std::str::FromStr>(word: &str, line: usize, file: &Path) -> Result<T, Fault> {
    let pointed = || word.replacen(',', ".", 1).parse().ok();
    word.parse().ok().or_else(pointed).ok_or_else(|| {
        // A number that is none of the column's kind is a fraction where whole numbers stand.
        let is_fraction = word.replacen(',', ".", 1).parse::<f64>().is_ok_and(f64::is_finite);
        let (what, remedy) = match is_fraction {
            true => ("not a whole number", "stamps are whole nanoseconds: multiply seconds by 1000000000"),
            false => ("not a number", "give a plain decimal number"),
        };
        Fault::new(what, file).on_line(line).value(word).remedy(remedy)
    })
}
