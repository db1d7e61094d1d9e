//! The results as a table for a terminal.

use std::fmt;

use crate::{PAPER_M1, Row, Spread, Summary, format};

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let conditions: Vec<String> = self
            .rows
            .first()
            .map(|row| row.conditions().map(|axis| format::headed(&axis.key)).collect())
            .unwrap_or_default();

        // Runs without durations say nothing of them.
        let timed = self.rows.iter().any(|row| row.times.total_ms.is_some());
        let mut results = Table::new(
            ["method"]
                .into_iter()
                .chain(conditions.iter().map(String::as_str))
                .chain(["frames", "n", "found", "refused", "wrong", "m1 mm", "m2 mm", "m3 mm", "m3 deg"])
                .chain(timed.then_some("ms")),
        );
        let column = |value: fn(&Row) -> Option<Spread>, scale: f64| {
            let medians: Vec<Option<f64>> =
                self.rows.iter().map(|row| value(row).map(|spread| spread.median * scale)).collect();
            let decimals = format::decimals(medians.iter().flatten().copied());
            medians.into_iter().map(move |median| format::number(median, decimals)).collect::<Vec<_>>()
        };
        let columns = [
            column(|row| row.m1, 1e3),
            column(|row| row.m2, 1e3),
            column(|row| row.m3_position, 1e3),
            column(|row| row.m3_attitude, 1f64.to_degrees()),
        ];
        for (index, row) in self.rows.iter().enumerate() {
            // A frame that attempted nothing stays in the count of frames; without truth nobody knows what is wrong.
            let frames = format!("{}/{}", row.referenced_frames, row.frames);
            let wrong =
                if row.found > 0 && row.unjudged == row.found { "–".to_owned() } else { row.wrong.to_string() };
            let counts = [frames, row.attempted.to_string(), row.found.to_string(), row.refused.to_string(), wrong];
            let errors = columns.iter().map(|column| column[index].clone());
            let total = format::number(row.times.total_ms, 1);
            results.row(leading(row).chain(counts).chain(errors).chain(timed.then_some(total)));
        }
        let paper = format!("{:.0}–{:.0}", PAPER_M1[0] * 1e3, PAPER_M1[1] * 1e3);
        let blank = |n| std::iter::repeat_n(String::new(), n);
        results.row(
            ["the paper".to_owned()]
                .into_iter()
                .chain(blank(conditions.len() + 5))
                .chain([paper])
                .chain(blank(3 + usize::from(timed))),
        );
        results.write(f)?;
        writeln!(
            f,
            "frames fixed of all, targets attempted (n); m1 residual C·H − P, m2 transferred model points, m3 camera position and attitude; medians of the fixes found."
        )?;

        if self.rows.iter().any(|row| row.limits.is_some()) {
            writeln!(f)?;
            self.limits(&conditions).write(f)?;
            writeln!(
                f,
                "Root mean squares over all n fixes and their ratio to the Cramér–Rao bound; NEES is 6, and 0.95 of it below the 95 % quantile, where a covariance is honest."
            )?;
        }

        for lacking in &self.lacking {
            writeln!(f, "warning: {lacking}")?;
        }
        if !timed {
            return Ok(());
        }
        let stages = self.rows.first().map(|row| row.times.stages().map(|(stage, _)| stage));
        let mut times = Table::new(
            ["method"].into_iter().chain(conditions.iter().map(String::as_str)).chain(stages.into_iter().flatten()),
        );
        for row in &self.rows {
            times.row(leading(row).chain(row.times.stages().map(|(_, time)| format::number(time, 2))));
        }
        writeln!(f)?;
        times.write(f)?;
        write!(f, "Median milliseconds; the first seven stages a frame, the others a target.")
    }
}

impl Summary {
    /// Errors beside their bound.
    fn limits(&self, conditions: &[String]) -> Table {
        let heads = ["n", "m2 RMSE mm", "bound mm", "ratio", "m3 RMSE mm", "bound mm", "ratio", "NEES", "below 95 %"];
        let mut table = Table::new(["method"].into_iter().chain(conditions.iter().map(String::as_str)).chain(heads));
        for row in &self.rows {
            let Some(limits) = row.limits else { continue };
            let beside = |[rmse, bound]: [f64; 2]| {
                [(rmse * 1e3, 3), (bound * 1e3, 3), (rmse / bound, 3)]
                    .map(|(x, digits)| format::number(Some(x), digits))
            };
            let consistency =
                [(limits.nees, 3), (limits.coverage, 4)].map(|(x, digits)| format::number(Some(x), digits));
            let numbers = beside(limits.m2).into_iter().chain(beside(limits.m3)).chain(consistency);
            table.row(leading(row).chain([limits.count.to_string()]).chain(numbers));
        }
        table
    }
}

fn leading(row: &Row) -> impl Iterator<Item = String> {
    [row.method()].into_iter().chain(row.conditions().map(|axis| axis.value.clone()))
}

/// Columns of text.
struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new<'a>(heads: impl IntoIterator<Item = &'a str>) -> Self {
        let mut table = Self { rows: Vec::new() };
        table.row(heads.into_iter().map(str::to_owned));
        table
    }

    /// Names come from files: what could move the cursor becomes a blank.
    fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let plain = |cell: String| cell.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        self.rows.push(cells.into_iter().map(plain).collect());
    }

    /// The first column to the left, the others to the right.
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.rows[0].len()).map(width).collect();
        for (index, row) in self.rows.iter().enumerate() {
            let mut line = format!("{:<1$}", row[0], widths[0]);
            for (cell, width) in row.iter().zip(&widths).skip(1) {
                line += &format!("  {cell:>width$}");
            }
            writeln!(f, "{}", line.trim_end())?;
            if index == 0 {
                writeln!(f, "{}", "─".repeat(widths.iter().sum::<usize>() + 2 * (widths.len() - 1)))?;
            }
        }
        Ok(())
    }
}
