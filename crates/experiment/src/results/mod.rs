//! The table of results as CSV and Parquet, written piece by piece and then joined.

mod join;
mod table;

pub(crate) use join::{TrialRows, join_csv, join_parquet};
pub(crate) use table::{Table, create as create_parquet};
