//! The summary as a table for a terminal: `{}` prints it unbroken, `{:80}` in at most 80 columns.

use std::fmt;

use crate::{
    format,
    summary::{Distribution, Row, RunSummary},
};

impl fmt::Display for RunSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let conditions: Vec<String> = self
            .rows
            .first()
            .map(|row| row.conditions().map(|axis| format::headed(&axis.key)).collect())
            .unwrap_or_default();

        // If the names of trials take most of a line, they are listed once and numbered.
        let names: Vec<Vec<String>> = self.rows.iter().map(|row| leading(row).collect()).collect();
        let heads = ["method".to_owned()].into_iter().chain(conditions.iter().cloned());
        let heads: Vec<String> = heads.collect();
        let wide = Table { rows: [vec![heads.clone()], names.clone()].concat(), leading: heads.len() }.width();
        let (heads, names) = match f.width() {
            Some(max) if 2 * wide > max => {
                for (index, row) in self.rows.iter().enumerate() {
                    let parts = row.conditions().filter(|axis| axis.value != "–").map(format::condition);
                    let line = [format!("{:>2}  {}", index + 1, row.method())].into_iter().chain(parts);
                    let line = plain(&line.collect::<Vec<_>>().join(", "));
                    writeln!(f, "{}", wrapped(&line, f.width(), 4))?;
                }
                writeln!(f)?;
                (vec!["trial".to_owned()], (1..=names.len()).map(|number| vec![number.to_string()]).collect())
            }
            _ => (heads, names),
        };
        let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
        // Runs without durations have no column of times.
        let timed = self.rows.iter().any(|row| row.times.total_ms.is_some());
        let mut results = Table::new(
            &heads,
            ["frames", "n", "fixes", "rejected", "wrong", "fit RMS mm", "TRE mm", "position mm", "attitude deg"]
                .into_iter()
                .chain(timed.then_some("ms")),
        );
        let column = |value: fn(&Row) -> Option<Distribution>, scale: f64| {
            let medians: Vec<Option<f64>> =
                self.rows.iter().map(|row| value(row).map(|spread| spread.median * scale)).collect();
            let decimals = format::decimals(medians.iter().flatten().copied());
            medians.into_iter().map(move |median| format::number(median, decimals)).collect::<Vec<_>>()
        };
        let columns = [
            column(|row| row.fit, 1e3),
            column(|row| row.tre, 1e3),
            column(|row| row.position_error, 1e3),
            column(|row| row.attitude_error, 1f64.to_degrees()),
        ];
        for (index, row) in self.rows.iter().enumerate() {
            // Frames without an attempt count as frames; without ground truth the number of wrong fixes is unknown.
            let frames = format!("{}/{}", row.fix_frames, row.frames);
            let wrong =
                if row.found > 0 && row.unjudged == row.found { "–".to_owned() } else { row.wrong.to_string() };
            let counts = [frames, row.attempted.to_string(), row.found.to_string(), row.rejected.to_string(), wrong];
            let errors = columns.iter().map(|column| column[index].clone());
            let total = format::number(row.times.total_ms, 1);
            results.row(names[index].iter().cloned().chain(counts).chain(errors).chain(timed.then_some(total)));
        }
        results.write(f)?;
        let max = f.width();
        let message = |text: &str| wrapped(text, max, 0);
        let note = message(
            "frames: with a fix/all; n: attempts; medians over the fixes of fit RMS (the paper’s measure), target registration error (TRE), camera position error and attitude error.",
        );
        writeln!(f, "{note}")?;
        for sentence in self.rejections.iter().chain(&self.published) {
            writeln!(f, "{}", message(&plain(sentence)))?;
        }

        if self.rows.iter().any(|row| row.limits.is_some()) {
            writeln!(f)?;
            self.limits(&heads, &names).write(f)?;
            let note = message(
                "RMS errors over all n fixes and their ratio to the Cramér–Rao bound. A consistent covariance has a mean NEES of 6 and 0.95 of the fixes below the 95 % quantile.",
            );
            writeln!(f, "{note}")?;
        }

        for lacking in &self.lacking {
            writeln!(f, "{}", message(&format!("warning: {lacking}")))?;
        }
        if !timed {
            return Ok(());
        }
        let stages = self.rows.first().map(|row| row.times.stages().map(|(stage, _)| stage));
        let mut times = Table::new(&heads, stages.into_iter().flatten());
        for (row, name) in self.rows.iter().zip(&names) {
            times.row(name.iter().cloned().chain(row.times.stages().map(|(_, time)| format::number(time, 2))));
        }
        writeln!(f)?;
        times.write(f)?;
        let shared = self.shared_times().map(|shared| format!(" {shared}")).unwrap_or_default();
        let note = format!("Median times in ms: per frame up to odometry, per attempt from candidates on.{shared}");
        write!(f, "{}", wrapped(&note, f.width(), 0))
    }
}

impl RunSummary {
    /// The table of RMS errors and Cramér–Rao bounds.
    fn limits(&self, heads: &[&str], names: &[Vec<String>]) -> Table {
        let leading = heads;
        let heads =
            ["n", "TRE RMSE mm", "bound mm", "ratio", "position RMSE mm", "bound mm", "ratio", "NEES", "below 95 %"];
        let mut table = Table::new(leading, heads);
        for (row, name) in self.rows.iter().zip(names) {
            let Some(limits) = row.limits else { continue };
            let beside = |[rmse, bound]: [f64; 2]| {
                [(rmse * 1e3, 3), (bound * 1e3, 3), (rmse / bound, 3)]
                    .map(|(x, digits)| format::number(Some(x), digits))
            };
            let consistency =
                [(limits.nees, 3), (limits.coverage, 4)].map(|(x, digits)| format::number(Some(x), digits));
            let numbers = beside(limits.tre).into_iter().chain(beside(limits.position)).chain(consistency);
            table.row(name.iter().cloned().chain([limits.count.to_string()]).chain(numbers));
        }
        table
    }
}

fn leading(row: &Row) -> impl Iterator<Item = String> {
    [row.method()].into_iter().chain(row.conditions().map(|axis| axis.value.clone()))
}

/// A text with control characters replaced by blanks, so that it moves no cursor.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A text broken at blanks into lines of at most `max` columns.
///
/// Later lines are indented; words longer than a line are cut.
pub(crate) fn wrapped(text: &str, max: Option<usize>, indent: usize) -> String {
    let Some(max) = max.map(|max| max.max(indent + 8)) else { return text.to_owned() };
    let mut lines = vec![String::new()];
    let mut taken = 0;
    for (place, word) in text.split(' ').enumerate() {
        let mut rest: Vec<char> = word.chars().collect();
        if place > 0 && taken + 1 + rest.len() > max {
            lines.push(" ".repeat(indent));
            taken = indent;
        } else if place > 0 {
            lines.last_mut().expect("there is a line").push(' ');
            taken += 1;
        }
        while taken + rest.len() > max {
            let cut = rest.drain(..max - taken).collect::<String>();
            lines.last_mut().expect("there is a line").push_str(&cut);
            lines.push(" ".repeat(indent));
            taken = indent;
        }
        taken += rest.len();
        lines.last_mut().expect("there is a line").extend(rest);
    }
    lines.join("\n")
}

/// A table of text in columns.
struct Table {
    rows: Vec<Vec<String>>,
    /// The number of leading columns that identify a row.
    leading: usize,
}

impl Table {
    fn new<'a>(leading: &[&'a str], heads: impl IntoIterator<Item = &'a str>) -> Self {
        let mut table = Self { rows: Vec::new(), leading: leading.len() };
        table.row(leading.iter().copied().chain(heads).map(str::to_owned));
        table
    }

    /// Adds a row; control characters of names from files become blanks.
    fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().map(|cell| plain(&cell)).collect());
    }

    fn widths(&self) -> Vec<usize> {
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        (0..self.rows[0].len()).map(width).collect()
    }

    /// The width in columns of a terminal.
    fn width(&self) -> usize {
        let widths = self.widths();
        widths.iter().sum::<usize>() + 2 * (widths.len() - 1)
    }

    /// Prints the first column left-aligned and the others right-aligned.
    ///
    /// Columns that do not fit the width follow below, with the leading columns repeated.
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let lead = widths[..self.leading].iter().map(|width| width + 2).sum::<usize>();
        let mut parts: Vec<(Vec<usize>, usize)> = Vec::new();
        for (column, width) in widths.iter().enumerate().skip(self.leading) {
            let wide = width + 2;
            match parts.last_mut() {
                Some((part, taken)) if f.width().is_none_or(|max| *taken + wide - 2 <= max) => {
                    part.push(column);
                    *taken += wide;
                }
                _ => parts.push(((0..self.leading).chain([column]).collect(), lead + wide)),
            }
        }
        for (place, (columns, taken)) in parts.iter().enumerate() {
            if place > 0 {
                writeln!(f)?;
            }
            for (index, row) in self.rows.iter().enumerate() {
                let mut line = format!("{:<1$}", row[columns[0]], widths[columns[0]]);
                for &column in &columns[1..] {
                    line += &format!("  {:>1$}", row[column], widths[column]);
                }
                writeln!(f, "{}", line.trim_end())?;
                if index == 0 {
                    writeln!(f, "{}", "─".repeat(taken - 2))?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Shown(Table);

    impl fmt::Display for Shown {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            self.0.write(f)
        }
    }

    /// Seen to fail where the table is not split by width.
    #[test]
    fn a_table_is_no_wider_than_it_may_be() {
        let mut table = Table::new(&["method"], ["one", "two", "three", "four"]);
        table.row(["some name", "1", "22222222", "3", "4"].map(str::to_owned));
        let table = Shown(table);
        assert_eq!(format!("{table}").lines().count(), 3);
        for max in 20..60 {
            let text = format!("{table:max$}");
            assert!(text.lines().all(|line| line.chars().count() <= max), "{max}: {text}");
            assert!(["22222222", "four"].iter().all(|cell| text.matches(cell).count() == 1), "{text}");
        }
    }

    #[test]
    fn lines_break_at_blanks() {
        assert_eq!(wrapped("one two three", Some(8), 0), "one two\nthree");
        assert_eq!(wrapped("one two three", None, 0), "one two three");
        assert_eq!(wrapped("a bcdefghijklmn", Some(10), 2), "a\n  bcdefghi\n  jklmn");
    }
}
