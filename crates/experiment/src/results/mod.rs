//! The table of results as CSV and Parquet, written piece by piece and then joined.

mod axes;
mod cell;
mod join;
mod lines;
mod table;

pub(crate) use axes::{Axes, AxisColumn, AxisValues, csv_end};
pub(crate) use join::{TrialRows, join_csv, join_parquet};
pub(crate) use lines::{column, without};
pub(crate) use table::{Table, create as create_parquet};
