//! `seafix diff`.

use std::path::PathBuf;

use clap::Args;
use seafix_experiment::{Change, diff};

use crate::{
    exit::{DONE, Ended, FINDINGS, Failure, INPUT},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct Diff {
    /// The folder of the first run.
    first: PathBuf,
    /// The folder of the second run.
    second: PathBuf,
    /// Maximum number of differing values that are listed.
    #[arg(long, default_value_t = 10)]
    max: usize,
}

impl Diff {
    pub(crate) fn execute(&self) -> Ended {
        let found = diff(&self.first, &self.second).map_err(|fault| Failure::new(INPUT, fault))?;
        if found.is_none() {
            print(&format!("no difference: the same configuration and inputs, {} equal rows\n", found.rows))?;
            return Ok(DONE);
        }
        let mut text = String::new();
        for (title, changes) in [("configuration", &found.configuration), ("inputs", &found.inputs)] {
            if !changes.is_empty() {
                text += &format!("{title}\n{}", changes.iter().map(line).collect::<String>());
            }
        }
        if found.columns.is_empty() {
            text += &format!("results: {} rows, all equal\n", found.rows);
        } else {
            text += &format!("results: {} rows in both\n", found.rows);
            let counts = found.columns.iter().map(|(column, count)| match count {
                0 => format!("  {column}: in one run only\n"),
                count => format!("  {column}: {count} differ\n"),
            });
            text += &counts.collect::<String>();
            text += &found.results.iter().take(self.max).map(line).collect::<String>();
        }
        print(&text)?;
        Ok(FINDINGS)
    }
}

fn line(change: &Change) -> String {
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "–".to_owned());
    let line = format!("  {}: {} | {}", change.what, value(&change.first), value(&change.second));
    // Names come from files; control characters in them must not reach the terminal.
    line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>() + "\n"
}
