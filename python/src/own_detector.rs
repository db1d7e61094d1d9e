//! Detectors written in Python.

use std::fmt;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::{prelude::*, types::PyDict};
use seafix::{
    component::{Added, Construct},
    geometry::Pixel,
    vision::{DETECTORS, Detector, Image, Keypoint, Workspace},
};

use crate::{
    array::{rows, table},
    choice::Built,
    failure,
    image::single,
    interpreter::detached,
    invalid::{invalid, stated},
    own::{self, Declared},
};

/// A detector that calls a Python function.
struct PythonDetector {
    function: Py<PyAny>,
    settings: Py<PyDict>,
    scale: f32,
}

impl fmt::Debug for PythonDetector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PythonDetector").field("scale", &self.scale).finish_non_exhaustive()
    }
}

impl PythonDetector {
    fn called(&self, py: Python<'_>, image: &Image) -> PyResult<Vec<Keypoint>> {
        let pixels = PyArray1::from_slice(py, image.pixels()).reshape([image.height(), image.width()])?;
        let given = self.function.bind(py).call((pixels,), Some(self.settings.bind(py)))?;
        if given.is_none() {
            return Err(invalid(
                py,
                "points",
                "the detector returned None",
                "return an array (n, 3), also for no point",
            ));
        }
        let given = rows::<3>(&given, "points", "(n, 3)")?;
        let inside = |x: f64, size: usize| x >= 0.0 && x <= (size - 1) as f64;
        for (k, &[u, v, score]) in given.iter().enumerate() {
            if !(inside(u, image.width()) && inside(v, image.height()) && score.is_finite()) {
                let what = format!("the key point ({u}, {v}, {score}) in row {k} is not in the image");
                return Err(invalid(py, "points", what, "return rows u, v, score with u in 0..w−1 and v in 0..h−1"));
            }
        }
        let keypoint =
            |[u, v, score]: [f64; 3]| Keypoint { at: Pixel { u, v }, response: score as f32, scale: self.scale };
        let mut found: Vec<Keypoint> = given.into_iter().map(keypoint).collect();
        // The order of equals is the function's own.
        found.sort_by(|a, b| b.response.total_cmp(&a.response));
        Ok(found)
    }
}

impl Detector for PythonDetector {
    fn detect_into(&self, image: &Image, _: &mut Workspace, found: &mut Vec<Keypoint>) {
        *found = Python::attach(|py| {
            self.called(py, image).unwrap_or_else(|error| {
                failure::keep(py, error);
                Vec::new()
            })
        });
    }
}

/// Register a Python function as a detector.
///
/// Parameters
/// ----------
/// function : callable
///     ``function(image, **settings) -> points`` with an image (h, w) of float32 and rows (n, 3): u, v, score.
/// declared : dict
///     ``name``, ``summary``, ``source``, ``version`` and ``defaults``.
/// scale : float
///     The size of the detected structures (px).
#[pyfunction]
pub(crate) fn add_detector(
    py: Python<'_>,
    function: Py<PyAny>,
    declared: &Bound<'_, PyDict>,
    scale: f32,
) -> PyResult<()> {
    if !(scale > 0.0 && scale.is_finite()) {
        let remedy = "give the standard deviation of the structure in px, above 0";
        return Err(invalid(py, "scale", format!("`scale` is {scale}"), remedy));
    }
    let Declared { name, summary, source, version, defaults } = own::declared(declared)?;
    let construct: Construct<dyn Detector> = Box::new(move |settings| {
        Python::attach(|py| {
            let settings = own::keywords(py, settings).map_err(|error| error.to_string())?.unbind();
            Ok(Box::new(PythonDetector { function: function.clone_ref(py), settings, scale }) as Box<dyn Detector>)
        })
    });
    let added = DETECTORS.add(Added { name: name.clone(), summary, source, version, defaults, construct });
    added.map_err(|error| stated(py, "name", &error.to_string()))?;
    own::remember("detector", &name);
    Ok(())
}

/// Detect key points in an image.
///
/// Parameters
/// ----------
/// image : ndarray
///     An array of shape (h, w) and type uint8, uint16 or float32, or a colour array (h, w, 3) of uint8 in OpenCV's order
///     blue, green, red.
/// detector : str or dict, default "harris"
///     A name of :func:`detectors`, or a dictionary with ``name`` and settings.
///
/// Returns
/// -------
/// ndarray, shape (n, 3)
///     The key points, strongest first: u to the right and v down (px; the centre of the first pixel is 0, 0), and the
///     score in the detector's own measure.
///
/// Raises
/// ------
/// ValueError
///     An unknown detector or setting, or no image.
///
/// Examples
/// --------
/// >>> sf.detect(image, detector={"name": "harris", "features": 100})[:, :2]
#[pyfunction]
#[pyo3(signature = (image, detector=None))]
pub(crate) fn detect<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    detector: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    static BUILT: Built<dyn Detector> = Built::new();
    let harris = "harris".into_pyobject(py)?.into_any();
    let (_, detector) = BUILT.component(&DETECTORS, detector.unwrap_or(&harris))?;
    let image = single(image)?;
    let found = detached(py, || detector.detect(&image))?;
    if let Some(error) = failure::taken() {
        return Err(error);
    }
    Ok(table(py, &found.iter().map(|point| [point.at.u, point.at.v, f64::from(point.response)]).collect::<Vec<_>>()))
}
