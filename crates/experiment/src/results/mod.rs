//! The table of results, as CSV and as Parquet: made piece by piece, then joined.

mod columns;
mod join;
mod table;

pub use columns::COLUMNS;
pub(crate) use columns::Row;
pub(crate) use join::{TrialRows, join_csv, join_parquet};
pub(crate) use table::{Table, create as create_parquet};
