//! The straight edges of a problem.

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use seafix::referencing::problem_file::{EdgeParts, RawEnd, RawLine};

use crate::{
    array::{doubles, index_pairs, shape_error},
    invalid::invalid,
};

/// The arguments of a problem that state edges.
pub(crate) struct EdgeArguments<'a, 'py> {
    pub(crate) edges: Option<&'a Bound<'py, PyAny>>,
    pub(crate) lines: Option<&'a Bound<'py, PyAny>>,
    pub(crate) line_covariances: Option<&'a Bound<'py, PyAny>>,
    pub(crate) putative: Option<&'a Bound<'py, PyAny>>,
}

impl EdgeArguments<'_, '_> {
    /// The edges before validation.
    pub(crate) fn parts(&self, py: Python<'_>) -> PyResult<EdgeParts> {
        let edges = self.edges.map_or(Ok(Vec::new()), edges)?;
        let ends = self.lines.map_or(Ok(Vec::new()), line_ends)?;
        let covariances = match self.line_covariances {
            Some(given) => line_covariances(given, ends.len())?,
            None if ends.is_empty() => Vec::new(),
            None => {
                let remedy = "give `line_covariances` (k, 4, 4) or (4, 4) in m²";
                return Err(invalid(py, "line_covariances", "the noise of the lines is not stated", remedy));
            }
        };
        let lines = ends.into_iter().zip(covariances).map(|(ends, covariance)| RawLine { ends, covariance }).collect();
        let putative = self.putative.map(|given| index_pairs(given, "putative_edges")).transpose()?;
        Ok(EdgeParts { edges, lines, putative })
    }
}

/// The two ends of each edge: places, or indices of model points.
fn edges(given: &Bound<'_, PyAny>) -> PyResult<Vec<[RawEnd; 2]>> {
    let wrong = |index: Option<usize>| {
        let what = index.map_or("`edges` is not a list of edges".to_owned(), |at| format!("edge {at} has no two ends"));
        let remedy = "give two ends an edge: places of three numbers (m), or indices of model points from 0";
        invalid(given.py(), "edges", what, remedy)
    };
    let end = |end: Bound<'_, PyAny>| match end.extract::<usize>() {
        Ok(point) => Some(RawEnd::Point(point)),
        Err(_) => end.extract::<[f64; 3]>().ok().map(RawEnd::At),
    };
    let edge = |(index, ends): (usize, PyResult<Bound<'_, PyAny>>)| {
        let ends = ends?;
        let both = ends.extract::<[Bound<'_, PyAny>; 2]>().map_err(|_| wrong(Some(index)))?;
        let [from, to] = both.map(end);
        from.zip(to).map(|(from, to)| [from, to]).ok_or_else(|| wrong(Some(index)))
    };
    given.try_iter().map_err(|_| wrong(None))?.enumerate().map(edge).collect()
}

/// The two places of each measured line.
fn line_ends(given: &Bound<'_, PyAny>) -> PyResult<Vec<[[f64; 3]; 2]>> {
    let array = doubles(given, "lines")?;
    let view = array.as_array();
    match *array.shape() {
        [0] => Ok(Vec::new()),
        [count, 2, 3] => {
            let place = |k: usize, end: usize| std::array::from_fn(|axis| view[[k, end, axis].as_slice()]);
            Ok((0..count).map(|k| [place(k, 0), place(k, 1)]).collect())
        }
        ref shape => Err(shape_error(given.py(), "lines", shape, "(k, 2, 3)")),
    }
}

/// The covariance of each of `count` lines: an array (k, 4, 4), or one (4, 4) for all.
fn line_covariances(given: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<[[f64; 4]; 4]>> {
    let array = doubles(given, "line_covariances")?;
    let view = array.as_array();
    match *array.shape() {
        [4, 4] => Ok(vec![std::array::from_fn(|r| std::array::from_fn(|c| view[[r, c].as_slice()])); count]),
        [found, 4, 4] if found == count => {
            let of = |k: usize| std::array::from_fn(|r| std::array::from_fn(|c| view[[k, r, c].as_slice()]));
            Ok((0..count).map(of).collect())
        }
        ref shape => Err(shape_error(given.py(), "line_covariances", shape, &format!("({count}, 4, 4) or (4, 4)"))),
    }
}
