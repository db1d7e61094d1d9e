//! Arrays from and to numpy.

use nalgebra::{Matrix3, Matrix4, Matrix6, SMatrix};
use numpy::{
    IxDyn, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods, get_array_module,
    ndarray::aview2,
};
use pyo3::prelude::*;
use seafix::geometry::{Frame, Transform};

use crate::invalid::invalid;

/// An argument as an array of doubles: a numpy array of that type itself, else a conversion.
pub(crate) fn doubles<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    // A subclass, such as a masked array, may hide numbers that are none.
    if let Ok(array) = value.cast_exact::<PyArrayDyn<f64>>() {
        return Ok(array.readonly());
    }
    let py = value.py();
    let module = get_array_module(py)?;
    let masked = py.import("numpy.ma")?.call_method1("is_masked", (value,))?.is_truthy()?;
    if masked {
        return Err(invalid(py, name, format!("`{name}` has masked values"), "leave out the masked rows"));
    }
    // Complex numbers would lose a part, and times and texts become numbers of another meaning.
    let kind = module.call_method1("asarray", (value,)).and_then(|array| array.getattr("dtype")?.getattr("kind"));
    let kind: String = kind.and_then(|kind| kind.extract()).unwrap_or_default();
    if matches!(&*kind, "c" | "m" | "M" | "U" | "S") {
        let what = match &*kind {
            "c" => "complex numbers",
            "m" | "M" => "times",
            _ => "texts",
        };
        return Err(invalid(py, name, format!("`{name}` is an array of {what}"), "give real numbers"));
    }
    let wrong =
        || invalid(py, name, format!("`{name}` is not an array of numbers"), "give numbers, e.g. a numpy array");
    let array = module.call_method1("asarray", (value, "float64")).map_err(|_| wrong())?;
    Ok(array.cast_into::<PyArrayDyn<f64>>().map_err(|_| wrong())?.readonly())
}

/// The error of an array of another shape than `expected`, which states it in words.
pub(crate) fn shape_error(py: Python<'_>, name: &str, shape: &[usize], expected: &str) -> PyErr {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let comma = if sizes.len() == 1 { "," } else { "" };
    let found = format!("`{name}` has the shape ({}{comma})", sizes.join(", "));
    invalid(py, name, found, format!("give an array of shape {expected}"))
}

/// Rows of N numbers; `expected` is the shape in words, e.g. `(n, 3)`.
pub(crate) fn rows<const N: usize>(value: &Bound<'_, PyAny>, name: &str, expected: &str) -> PyResult<Vec<[f64; N]>> {
    let array = doubles(value, name)?;
    match array.shape() {
        &[_, columns] if columns == N => {}
        // An empty list is an array of no rows.
        &[0] => return Ok(Vec::new()),
        shape => return Err(shape_error(value.py(), name, shape, expected)),
    }
    let view = array.as_array();
    if let Some(flat) = view.to_slice() {
        return Ok(flat.as_chunks::<N>().0.to_vec());
    }
    Ok((0..view.shape()[0]).map(|i| std::array::from_fn(|k| view[IxDyn(&[i, k])])).collect())
}

/// A vector of numbers.
pub(crate) fn vector(value: &Bound<'_, PyAny>, name: &str, expected: &str) -> PyResult<Vec<f64>> {
    let array = doubles(value, name)?;
    match array.shape() {
        [_] => Ok(array.as_array().iter().copied().collect()),
        shape => Err(shape_error(value.py(), name, shape, expected)),
    }
}

/// A square matrix.
pub(crate) fn matrix<const N: usize>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<SMatrix<f64, N, N>> {
    let array = doubles(value, name)?;
    if array.shape() != [N, N] {
        return Err(shape_error(value.py(), name, array.shape(), &format!("({N}, {N})")));
    }
    let view = array.as_array();
    Ok(SMatrix::from_fn(|r, c| view[IxDyn(&[r, c])]))
}

/// The number of dimensions of an argument.
pub(crate) fn dimensions(value: &Bound<'_, PyAny>, name: &str) -> PyResult<usize> {
    Ok(doubles(value, name)?.ndim())
}

/// Covariances, one for each of `count` points: an array (m, 3, 3), or one (3, 3) for all.
pub(crate) fn covariances(value: &Bound<'_, PyAny>, name: &str, count: usize) -> PyResult<Vec<Matrix3<f64>>> {
    let array = doubles(value, name)?;
    match array.shape() {
        [3, 3] => {
            let view = array.as_array();
            Ok(vec![Matrix3::from_fn(|r, c| view[IxDyn(&[r, c])]); count])
        }
        &[found, 3, 3] => {
            let view = array.as_array();
            Ok((0..found).map(|k| Matrix3::from_fn(|r, c| view[IxDyn(&[k, r, c])])).collect())
        }
        shape => Err(shape_error(value.py(), name, shape, "(m, 3, 3) or (3, 3)")),
    }
}

/// A rigid motion (4, 4); an object with the method `as_matrix`, such as SciPy's `RigidTransform`, is one too.
pub(crate) fn motion<A: Frame, B: Frame>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Transform<A, B>> {
    let py = value.py();
    let m: Matrix4<f64> = match value.getattr_opt("as_matrix")? {
        Some(method) => matrix(&method.call0()?, name)?,
        None => matrix(value, name)?,
    };
    Transform::from_matrix(&m).map_err(|error| {
        let remedy = "give a (4, 4) rotation and translation, p_a = T p_b";
        invalid(py, name, format!("`{name}` is not a rigid motion: {error}"), remedy)
    })
}

/// Pairs of indices (k, 2).
pub(crate) fn index_pairs(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[usize; 2]>> {
    let rows = rows::<2>(value, name, "(k, 2)")?;
    let index = |x: f64| (x >= 0.0 && x.fract() == 0.0 && x < 2f64.powi(53)).then_some(x as usize);
    rows.iter()
        .enumerate()
        .map(|(k, [a, b])| match (index(*a), index(*b)) {
            (Some(a), Some(b)) => Ok([a, b]),
            _ => {
                let what = format!("`{name}` has no indices in row {k}: [{a}, {b}]");
                Err(invalid(value.py(), name, what, "give whole numbers from 0"))
            }
        })
        .collect()
}

/// A matrix as a numpy array.
pub(crate) fn array4<'py>(py: Python<'py>, matrix: &Matrix4<f64>) -> Bound<'py, PyArray2<f64>> {
    array(py, matrix)
}

/// A covariance as a numpy array.
pub(crate) fn array6<'py>(py: Python<'py>, matrix: &Matrix6<f64>) -> Bound<'py, PyArray2<f64>> {
    array(py, matrix)
}

fn array<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, R, C>,
) -> Bound<'py, PyArray2<f64>> {
    let rows: [[f64; C]; R] = std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]));
    PyArray2::from_array(py, &aview2(&rows))
}

/// Rows as a numpy array.
pub(crate) fn table<'py, T: numpy::Element, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> Bound<'py, PyArray2<T>> {
    PyArray2::from_array(py, &aview2(rows))
}

/// Covariances as a numpy array (m, 3, 3).
pub(crate) fn covariance_table<'py>(
    py: Python<'py>,
    covariances: impl Iterator<Item = Matrix3<f64>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let rows: Vec<[f64; 9]> = covariances.map(|it| std::array::from_fn(|k| it[(k / 3, k % 3)])).collect();
    PyArray2::from_array(py, &aview2(&rows)).reshape([rows.len(), 3, 3])
}

/// Pairs of places as a numpy array (n, 2, 3).
pub(crate) fn end_table<'py>(
    py: Python<'py>,
    ends: impl Iterator<Item = [[f64; 3]; 2]>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let rows: Vec<[f64; 6]> = ends.map(|it| std::array::from_fn(|k| it[k / 3][k % 3])).collect();
    PyArray2::from_array(py, &aview2(&rows)).reshape([rows.len(), 2, 3])
}
