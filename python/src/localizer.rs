//! Fixes from stereo pairs or clouds.

use std::{path::PathBuf, time::Instant};

use pyo3::prelude::*;
use seafix::{
    Error, FrameData, Hints, PosePrior as LibraryPrior, SensorFrame,
    geometry::{MeasuredPoint, Point, UncertainPoint},
};

use crate::{
    answer::Answer,
    array::{covariances, rows},
    failure,
    image::pair,
    interpreter::detached,
    invalid::{in_file, invalid, of_faults, stated},
    prior::PosePrior,
    rig::{Rig, Site},
};

/// A pipeline that computes fixes for the objects of one site from one stereo rig.
///
/// Parameters
/// ----------
/// site : Site
///     The objects that are searched for.
/// rig : Rig
///     The stereo rig.
/// settings : str or os.PathLike, optional
///     The pipeline: the path of a TOML file, or its text. It is the table ``[pipeline]`` of an experiment; absent keys
///     keep their defaults.
/// seed : int, default 0
///     Seed of searches that draw random numbers.
///
/// Raises
/// ------
/// OSError
///     The file of the settings cannot be read.
/// ValueError
///     An unknown key or component, or a value out of its range.
///
/// Examples
/// --------
/// >>> localizer = sf.Localizer(sf.Site.load("site.toml"), sf.Rig.load("dataset.toml"))
/// >>> for answer in localizer.localize("left.png", "right.png", sf.PosePrior(T, 0.1, 0.01)):
/// ...     print(answer.target, answer.outcome)
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Localizer {
    inner: seafix::Localizer,
    search: String,
    solver: String,
}

#[pymethods]
impl Localizer {
    #[new]
    #[pyo3(signature = (site, rig, settings=None, *, seed=0))]
    fn new(py: Python<'_>, site: &Site, rig: &Rig, settings: Option<PathBuf>, seed: u64) -> PyResult<Self> {
        let text = match settings {
            None => String::new(),
            Some(given) => settings_text(py, given)?,
        };
        let pipeline: seafix::PipelineSettings = toml::from_str(&text).map_err(|error| {
            stated(py, "settings", &format!("cannot read the settings: {}", error.to_string().trim_end()))
        })?;
        let built = detached(py, || seafix::Localizer::with_pipeline(&site.inner, &rig.inner, &pipeline))?;
        let inner = built.map_err(|error| of_library(py, &error))?.with_seed(seed);
        Ok(Self { inner, search: pipeline.search.name, solver: pipeline.solver.name })
    }

    /// list of str: the targets: the objects of the site, or the site as one.
    #[getter]
    fn targets(&self) -> Vec<&str> {
        self.inner.targets().iter().map(|target| target.name.as_str()).collect()
    }

    /// Compute fixes from a stereo pair.
    ///
    /// Parameters
    /// ----------
    /// left, right : str, os.PathLike or ndarray
    ///     The images: paths, arrays of shape (h, w) and type uint8, uint16 or float32, or colour arrays (h, w, 3) of
    ///     uint8 in OpenCV's order blue, green, red.
    /// prior : PosePrior, optional
    ///     Prior pose ``world_from_camera``. Without one every target is searched in the complete cloud.
    ///
    /// Returns
    /// -------
    /// list of Answer
    ///     One answer for each target in view by the prior.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     An image file cannot be read.
    /// ValueError
    ///     An image of another size than its camera's calibration, or an invalid value.
    #[pyo3(signature = (left, right, prior=None))]
    fn localize(
        &self,
        py: Python<'_>,
        left: &Bound<'_, PyAny>,
        right: &Bound<'_, PyAny>,
        prior: Option<&PosePrior>,
    ) -> PyResult<Vec<Answer>> {
        let (left, right) = pair(left, right, self.inner.rig())?;
        self.answers(py, FrameData::Stereo(left, right), prior)
    }

    /// Compute fixes from a cloud of measured points.
    ///
    /// Parameters
    /// ----------
    /// cloud : array_like, shape (m, 3)
    ///     Measured points, camera frame (m).
    /// point_covariances : array_like, shape (m, 3, 3) or (3, 3)
    ///     Covariance of each point, camera axes (m²).
    /// prior : PosePrior, optional
    ///     Prior pose ``world_from_camera``.
    ///
    /// Returns
    /// -------
    /// list of Answer
    ///     One answer for each target in view by the prior.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An array of another shape, or a solver that needs pixels: ``solver = "mahalanobis"`` needs none.
    #[pyo3(signature = (cloud, point_covariances, prior=None))]
    fn localize_points(
        &self,
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        point_covariances: &Bound<'_, PyAny>,
        prior: Option<&PosePrior>,
    ) -> PyResult<Vec<Answer>> {
        let cloud = rows::<3>(cloud, "cloud", "(m, 3)")?;
        let noise = covariances(point_covariances, "point_covariances", cloud.len())?;
        if noise.len() != cloud.len() {
            let what = format!("{} covariances for {} points", noise.len(), cloud.len());
            return Err(invalid(py, "point_covariances", what, "give one covariance per point"));
        }
        if let Some(index) = cloud.iter().position(|at| !at.iter().all(|x| x.is_finite())) {
            let what = format!("cloud point {index} is not finite");
            return Err(invalid(py, "cloud", what, "remove points without a position"));
        }
        let point = |(at, covariance): (&[f64; 3], nalgebra::Matrix3<f64>)| MeasuredPoint {
            position: UncertainPoint { at: Point::from(*at), covariance },
            pixels: None,
        };
        let points = cloud.iter().zip(noise).map(point).collect();
        self.answers(py, FrameData::Points(points), prior)
    }

    fn __repr__(&self) -> String {
        format!("Localizer({} targets, search {}, solver {})", self.inner.targets().len(), self.search, self.solver)
    }
}

impl Localizer {
    fn answers(&self, py: Python<'_>, frame_data: FrameData, prior: Option<&PosePrior>) -> PyResult<Vec<Answer>> {
        let prior: Option<LibraryPrior> = prior.map(PosePrior::in_world);
        let frame = SensorFrame { stamp_ns: 0, frame_data, prior, hints: Hints::Nothing, readings: Vec::new() };
        let start = Instant::now();
        let result = detached(py, || self.inner.process(&frame))?;
        if let Some(error) = failure::taken() {
            return Err(error);
        }
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        let answer = |attempt: seafix::TargetAttempt| Answer {
            target: self.inner.targets()[attempt.target].name.clone(),
            search: self.search.clone(),
            solver: self.solver.clone(),
            time_ms: attempt.times.total_ms.unwrap_or(time_ms),
            attempt: attempt.answer,
            posed: None,
        };
        Ok(result.attempts.into_iter().map(answer).collect())
    }
}

/// The text of the settings: that of the file at the path, or the argument itself if it is TOML.
fn settings_text(py: Python<'_>, given: PathBuf) -> PyResult<String> {
    let text = given.to_string_lossy();
    if text.contains(['=', '\n']) {
        return Ok(text.into_owned());
    }
    let read = detached(py, || seafix::component::read_text(&given))?;
    read.map_err(|fault| in_file(py, &fault))
}

/// The exception of the library's error.
pub(crate) fn of_library(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::File(fault) => in_file(py, fault),
        Error::Files(faults) => of_faults(py, faults),
        Error::Setting(error) => stated(py, error.setting, &error.to_string()),
        _ => stated(py, "", &error.to_string()),
    }
}
