//! Tables.

use crate::document::span::{Span, Text, plain_text};

/// A table with rows of heads, and lines with one cell for every column.
#[derive(Debug, Default)]
pub(crate) struct Table {
    /// The stem of its file names.
    pub(crate) id: String,
    pub(crate) caption: Text,
    /// The rows of heads; the last row has one head for every column.
    pub(crate) heads: Vec<Vec<Head>>,
    pub(crate) lines: Vec<Line>,
}

/// The head of one or several columns.
#[derive(Debug, Clone)]
pub(crate) struct Head {
    pub(crate) text: String,
    pub(crate) columns: usize,
    /// Whether the column has numbers, which are right-aligned.
    pub(crate) numbers: bool,
}

/// A line of cells.
#[derive(Debug, Default)]
pub(crate) struct Line {
    pub(crate) cells: Vec<Cell>,
    /// Whether a thin rule is above the line.
    pub(crate) rule: bool,
}

/// A cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    pub(crate) text: Text,
    /// Whether the text may wrap.
    pub(crate) prose: bool,
    /// Whether the cell is less prominent than its neighbours.
    pub(crate) minor: bool,
}

impl Head {
    /// The head of a column of words.
    pub(crate) fn words(text: impl Into<String>) -> Self {
        Self { text: text.into(), columns: 1, numbers: false }
    }

    /// The head of a column of numbers.
    pub(crate) fn numbers(text: impl Into<String>) -> Self {
        Self { text: text.into(), columns: 1, numbers: true }
    }

    /// The head over several columns.
    pub(crate) fn over(columns: usize, text: impl Into<String>) -> Self {
        Self { text: text.into(), columns, numbers: false }
    }
}

impl<S: Into<Span>> From<S> for Cell {
    fn from(span: S) -> Self {
        Self { text: vec![span.into()], ..Self::default() }
    }
}

impl Cell {
    pub(crate) fn prose(text: Text) -> Self {
        Self { text, prose: true, ..Self::default() }
    }

    pub(crate) fn minor(span: impl Into<Span>) -> Self {
        Self { text: vec![span.into()], minor: true, ..Self::default() }
    }

    pub(crate) fn plain(&self) -> String {
        plain_text(&self.text)
    }
}

impl Table {
    /// An empty table with one row of heads.
    pub(crate) fn new(id: &str, caption: Text, heads: Vec<Head>) -> Self {
        Self { id: id.to_owned(), caption, heads: vec![heads], lines: Vec::new() }
    }

    pub(crate) fn line(&mut self, rule: bool, cells: Vec<Cell>) {
        self.lines.push(Line { cells, rule });
    }

    /// Whether column `place` has numbers.
    pub(crate) fn numbers(&self, place: usize) -> bool {
        self.heads.last().and_then(|heads| heads.get(place)).is_some_and(|head| head.numbers)
    }

    /// The number of columns.
    pub(crate) fn columns(&self) -> usize {
        self.heads.last().map_or(0, Vec::len)
    }

    /// The names of the columns: all heads above each column, joined.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names = vec![String::new(); self.columns()];
        for heads in &self.heads {
            let mut place = 0;
            for head in heads {
                for name in names.iter_mut().skip(place).take(head.columns) {
                    if !head.text.is_empty() {
                        *name = if name.is_empty() { head.text.clone() } else { format!("{name}, {}", head.text) };
                    }
                }
                place += head.columns;
            }
        }
        names
    }
}
