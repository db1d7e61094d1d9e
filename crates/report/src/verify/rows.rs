//! The attempts of a log, and their outcomes by definition.

use seafix_log::{Outcome, TargetRecord};

use super::logs::{Log, Row};
use crate::field::Field;

/// The attempts within the stamps.
pub(super) fn rows(log: &Log, span: [u64; 2]) -> impl Iterator<Item = &Row> {
    log.sample(span).flat_map(|frame| &frame.rows)
}

/// The value of a quantity of an attempt.
pub(super) fn value(row: &Row, field: Field) -> Option<f64> {
    if field == Field::Candidates { Some(row.candidates as f64) } else { field.of(&row.record) }
}

/// Whether an attempt is a fix that is not known to be wrong.
pub(super) fn found(row: &TargetRecord) -> bool {
    row.outcome == Outcome::Fix && row.evaluation.wrong != Some(true)
}

/// The error for comparisons: infinite for a rejected attempt or a wrong fix.
pub(super) fn error(row: &TargetRecord, field: Field) -> f64 {
    if found(row) { field.of(row).unwrap_or(f64::INFINITY) } else { f64::INFINITY }
}
