//! Statistics of the reports.

use pyo3::prelude::*;
use seafix_evaluation::{Bootstrap, median};

use crate::{array::vector, interpreter::detached, invalid::invalid};

/// The seed of the reports' intervals.
const SEED: u64 = 20_211_038;

/// The median of values and its confidence interval, as the reports compute it.
///
/// Parameters
/// ----------
/// values : array_like, shape (n,)
///     Values in order of time; infinite ones are failures.
/// confidence : float
///     The confidence, above 0 and below 1.
///
/// Returns
/// -------
/// tuple of float
///     The median, and the low and the high end of the interval.
#[pyfunction]
pub(crate) fn median_interval(py: Python<'_>, values: &Bound<'_, PyAny>, confidence: f64) -> PyResult<(f64, f64, f64)> {
    let mut values = vector(values, "values", "(n,)")?;
    if values.is_empty() || values.iter().any(|value| value.is_nan()) {
        return Err(invalid(py, "values", "`values` is empty or has a NaN", "give one number or more"));
    }
    if !(confidence > 0.0 && confidence < 1.0) {
        let what = format!("`confidence` is {confidence}");
        return Err(invalid(py, "confidence", what, "give a number above 0 and below 1"));
    }
    let (low, high) = detached(py, || Bootstrap::of(values.len(), SEED).median(&values, confidence))?;
    Ok((median(&mut values), low, high))
}
