//! Tables as programs and spreadsheets write them.
//!
//! Cells are separated by commas, semicolons, tabs or blanks, and may stand in quotes. Numbers have a decimal point, or
//! a decimal comma where commas do not separate cells. Empty rows are skipped.

use std::path::Path;

use seafix_component::Fault;

/// The separator of the cells of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Separator {
    Comma,
    Semicolon,
    Tab,
    /// Any number of blanks.
    Blank,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Row<'a> {
    /// Its line in the file, from 1.
    pub(crate) line: usize,
    /// The text of the line.
    pub(crate) text: &'a str,
    /// Its cells, without quotes and surrounding blanks.
    pub(crate) cells: Vec<String>,
}

/// The rows of a table and the way in which its numbers are written.
#[derive(Debug, Clone)]
pub(crate) struct Table<'a> {
    pub(crate) separator: Separator,
    pub(crate) rows: Vec<Row<'a>>,
    has_decimal_commas: bool,
}

impl Separator {
    /// The separator of a line of cells.
    pub(crate) fn of(line: &str) -> Self {
        let has = |sign: char| line.contains(sign);
        // Decimal commas stand inside words, separating ones before a blank, another comma or the end.
        let words = || line.split_whitespace();
        let decimal = |word: &str| {
            let inner = |(before, after): (&str, &str)| !before.is_empty() && !after.is_empty() && !after.contains(',');
            !word.contains(',') || word.split_once(',').is_some_and(inner)
        };
        match () {
            () if has(';') => Self::Semicolon,
            () if has('\t') => Self::Tab,
            () if has(',') && !(words().count() > 2 && words().all(decimal)) => Self::Comma,
            () => Self::Blank,
        }
    }

    /// The cells of a line.
    pub(crate) fn cells(self, line: &str) -> Vec<String> {
        let separates = |letter: char| match self {
            Self::Comma => letter == ',',
            Self::Semicolon => letter == ';',
            Self::Tab => letter == '\t',
            Self::Blank => letter.is_whitespace(),
        };
        let (mut cells, mut cell, mut quoted, mut letters) =
            (Vec::new(), String::new(), false, line.chars().peekable());
        while let Some(letter) = letters.next() {
            match letter {
                '"' if quoted && letters.peek() == Some(&'"') => {
                    cell.push('"');
                    letters.next();
                }
                '"' if quoted || cell.trim().is_empty() => quoted = !quoted,
                letter if separates(letter) && !quoted => cells.push(std::mem::take(&mut cell)),
                letter => cell.push(letter),
            }
        }
        cells.push(cell);
        let cells = cells.into_iter().map(|cell| cell.trim().to_owned());
        if self == Self::Blank { cells.filter(|cell| !cell.is_empty()).collect() } else { cells.collect() }
    }
}

impl<'a> Table<'a> {
    /// The table of numbered lines without comments; `file` is named in faults.
    ///
    /// # Errors
    /// Decimal commas beside decimal points: a comma then may separate thousands.
    pub(crate) fn of(lines: &[(usize, &'a str)], file: &Path) -> Result<Self, Fault> {
        // A header may have other signs than the rows; the last line decides.
        let last = lines.iter().rev().find(|(_, line)| !line.trim().is_empty());
        let separator = last.map_or(Separator::Blank, |(_, line)| Separator::of(line));
        let all = lines.iter().filter(|(_, text)| !text.trim().is_empty()).map(|&(line, text)| Row {
            line,
            text,
            cells: separator.cells(text),
        });
        let all: Vec<Row<'a>> = all.collect();
        let rows: Vec<Row<'a>> = all.into_iter().filter(|row| row.cells.iter().any(|cell| !cell.is_empty())).collect();
        let with = |sign: char| {
            let is_one = move |cell: &&String| cell.contains(sign) && plain(&cell.replacen(sign, ".", 1)).is_some();
            rows.iter().find_map(|row| Some((row.line, row.cells.iter().find(is_one)?)))
        };
        let (comma, point) = (with(','), with('.'));
        if let (Some((line, comma)), Some((_, point))) = (comma, point) {
            let fault = Fault::new("numbers with a comma beside numbers with a point", file).on_line(line);
            let remedy = "the comma may be decimal or separate thousands: write all numbers with a decimal point";
            return Err(fault.value(format!("{comma} and {point}")).remedy(remedy));
        }
        Ok(Self { separator, has_decimal_commas: comma.is_some(), rows })
    }

    /// The cell in the notation with a decimal point.
    pub(crate) fn with_point(&self, cell: &str) -> String {
        if self.has_decimal_commas { cell.replacen(',', ".", 1) } else { cell.to_owned() }
    }

    /// The finite number in a cell.
    pub(crate) fn number(&self, cell: &str) -> Option<f64> {
        plain(&self.with_point(cell))
    }
}

/// A finite number with a decimal point.
fn plain(cell: &str) -> Option<f64> {
    cell.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Table<'_>, String> {
        let lines: Vec<(usize, &str)> = text.lines().enumerate().map(|(index, line)| (index + 1, line)).collect();
        Table::of(&lines, Path::new("a.csv")).map_err(|fault| fault.to_string())
    }

    #[test]
    fn cells_are_found_for_every_separator() {
        for text in ["id;1,5;-2,5\n", "id\t1.5\t-2.5\n", "\"id\", 1.5 ,-2.5\n", "id   1.5 -2.5\n", "id 1,5 -2,5\n"] {
            let table = read(text).unwrap();
            assert_eq!(table.rows[0].cells[0], "id", "{text}");
            let numbers: Vec<f64> = table.rows[0].cells[1..].iter().filter_map(|cell| table.number(cell)).collect();
            assert_eq!(numbers, [1.5, -2.5], "{text}");
        }
        assert_eq!(Separator::Comma.cells("\"a \"\"b\"\", c\",,1"), ["a \"b\", c", "", "1"]);
    }

    #[test]
    fn empty_rows_are_skipped_and_two_readings_rejected() {
        let table = read("a,1\n,,\n\nb,2\n,\n").unwrap();
        assert_eq!((table.rows.len(), table.rows[1].line), (2, 4));
        assert!(read("a;1,250\nb;2.5\n").unwrap_err().contains("may be decimal or separate thousands"));
    }
}
