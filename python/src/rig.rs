//! Stereo rigs and sites.

use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;

use crate::{
    array::{array4, table},
    interpreter::detached,
    invalid::{in_file, of_faults},
};

/// A calibrated stereo rig.
///
/// Read one with :meth:`load`.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Rig {
    pub(crate) inner: seafix::Rig,
}

#[pymethods]
impl Rig {
    /// The rig of a data set description (``seafix-dataset/1``).
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file ``dataset.toml``, or its folder.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ValueError
    ///     Its first invalid value, with line and remedy.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = detached(py, || seafix::Rig::from_file(&path))?;
        Ok(Self { inner: read.map_err(|fault| in_file(py, &fault))? })
    }

    /// tuple of int: width and height of the left image (px).
    #[getter]
    fn size(&self) -> (u32, u32) {
        self.inner.stereo.left().size().into()
    }

    /// float: the distance between the two cameras (m).
    #[getter]
    fn baseline(&self) -> f64 {
        self.inner.stereo.baseline()
    }

    /// ndarray, shape (4, 4): the pose of the left camera in the right one (m).
    #[getter]
    fn right_from_left<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array4(py, &self.inner.stereo.right_from_left().matrix())
    }

    fn __repr__(&self) -> String {
        let [width, height] = self.inner.stereo.left().size();
        format!("Rig({width}×{height} px, baseline {:.3} m)", self.inner.stereo.baseline())
    }
}

/// A site: known objects, their feature points and their surveyed poses.
///
/// Read one with :meth:`load`.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Site {
    pub(crate) inner: seafix::Site,
}

#[pymethods]
impl Site {
    /// The site in a file (``seafix-site/1``).
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ValueError
    ///     All faults of the file, one a line, each with its line and remedy.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = detached(py, || seafix::Site::from_file(&path))?;
        Ok(Self { inner: read.map_err(|faults| of_faults(py, &faults))? })
    }

    /// str: the name of the site.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// list of str: the identifiers of its objects.
    #[getter]
    fn objects(&self) -> Vec<&str> {
        self.inner.objects.iter().map(|object| object.id.as_str()).collect()
    }

    /// The feature points of an object, object frame.
    ///
    /// Parameters
    /// ----------
    /// id : str
    ///     The identifier of the object.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n, 3)
    ///     The points (m).
    ///
    /// Raises
    /// ------
    /// KeyError
    ///     The site has no such object.
    fn points<'py>(&self, py: Python<'py>, id: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let Some(object) = self.inner.object(id) else {
            let known = self.objects().join(", ");
            let what = format!("the site has no object `{id}`; there are {known}");
            return Err(pyo3::exceptions::PyKeyError::new_err(what));
        };
        let rows: Vec<[f64; 3]> = object.points.iter().map(|point| point.at.coords.into()).collect();
        Ok(table(py, &rows))
    }

    fn __repr__(&self) -> String {
        format!("Site({}, {} objects)", self.inner.name, self.inner.objects.len())
    }
}
