//! The names of trials and of series of trials in sentences.

use crate::{
    content::conditions::axes,
    format,
    summary::{Row, RunSummary},
};

/// The names of trials and of series of trials.
pub(crate) struct Labels {
    /// The key of the numeric axis along which a series runs.
    pub(crate) along: Option<String>,
    /// The keys of the axes that distinguish series.
    pub(crate) apart: Vec<String>,
}

impl Labels {
    pub(crate) fn of(summary: &RunSummary) -> Self {
        let along = axes::numeric(summary);
        let axes = summary.rows.first().map(|row| row.axes.clone()).unwrap_or_default();
        let varies = |key: &String| summary.rows.iter().any(|row| value(row, key) != value(&summary.rows[0], key));
        let apart = axes.into_iter().map(|axis| axis.key).filter(|key| Some(key) != along.as_ref() && varies(key));
        let mut apart: Vec<String> = apart.collect();
        // With several methods on several kinds of problems, every method is one series.
        if along.is_none() && apart.len() > 1 {
            let method = |key: &String| matches!(format::short(key), "search" | "solver" | "method");
            if apart.iter().any(method) {
                apart.retain(method);
            }
        }
        Self { along, apart }
    }

    /// The name of the series that holds `row`.
    pub(crate) fn of_series(&self, row: &Row) -> String {
        let named = |key: &String| match format::short(key) {
            "seed" => format!("seed {}", value(row, key)),
            _ => value(row, key),
        };
        let values: Vec<String> = self.apart.iter().map(named).collect();
        if values.is_empty() { row.method() } else { values.join(", ") }
    }

    /// The name of a trial among all trials of the run.
    pub(crate) fn of_trial(&self, row: &Row) -> String {
        match (&self.along, self.apart.is_empty()) {
            (Some(key), true) => self.place(row, key),
            (Some(key), false) => format!("{}, {}", self.of_series(row), self.place(row, key)),
            (None, _) => {
                let values: Vec<String> = row.axes.iter().map(|axis| axis.value.clone()).collect();
                if values.is_empty() { row.method() } else { values.join(", ") }
            }
        }
    }

    pub(crate) fn place(&self, row: &Row, key: &str) -> String {
        format::placed(key, &value(row, key))
    }

    /// Whether at most `max` trials form one series, or each its own series.
    pub(crate) fn reported_singly(&self, summary: &RunSummary, max: usize) -> bool {
        let series = self.series(summary).len();
        summary.rows.len() <= max && (series == 1 || series == summary.rows.len())
    }

    /// The series with the indices of their rows, in the order of the run.
    pub(crate) fn series(&self, summary: &RunSummary) -> Vec<(String, Vec<usize>)> {
        let mut series: Vec<(String, Vec<usize>)> = Vec::new();
        for (index, row) in summary.rows.iter().enumerate() {
            let name = self.of_series(row);
            match series.iter_mut().find(|(known, _)| *known == name) {
                Some((_, members)) => members.push(index),
                None => series.push((name, vec![index])),
            }
        }
        series
    }
}

/// The value of a row on an axis as text; empty without the axis.
pub(crate) fn value(row: &Row, key: &str) -> String {
    row.axes.iter().find(|axis| axis.key == key).map_or_else(String::new, |axis| axis.value.clone())
}
