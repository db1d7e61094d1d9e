//! The log of a trial.

use std::{path::PathBuf, sync::Arc};

use numpy::{PyArray2, PyArray3, PyArrayMethods, ndarray::aview2};
use pyo3::{
    exceptions::{PyOSError, PyValueError},
    prelude::*,
    types::PyDict,
};
use seafix_log::{FrameRecord, LogError, Matrix4, Pair, Reader, TargetRecord, TrialHeader, TrialLog, read};

use crate::{
    array::table,
    interpreter::{detached, interruptible},
    invalid::with_attributes,
};

/// Read the log of a trial.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     An MCAP file that a run wrote.
///
/// Returns
/// -------
/// Log
///     The trial and its frames.
///
/// Raises
/// ------
/// OSError
///     The file cannot be read.
/// ValueError
///     The file is no log, or it is damaged or cut off.
#[pyfunction]
pub(crate) fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Log> {
    let log = interruptible(py, move || read(&path))?.map_err(|error| of_log(py, &error))?;
    Ok(Log { inner: Arc::new(log) })
}

/// The axes of the trial of a log, without its frames.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     An MCAP file that a run wrote.
///
/// Returns
/// -------
/// dict
///     The value of the trial by the key of each varied setting.
#[pyfunction]
pub(crate) fn read_axes(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let header = detached(py, || Reader::open(&path).map(|reader| reader.header().clone()))?;
    axes_of(py, &header.map_err(|error| of_log(py, &error))?)
}

fn axes_of<'py>(py: Python<'py>, header: &TrialHeader) -> PyResult<Bound<'py, PyDict>> {
    let axes = PyDict::new(py);
    header.axes.iter().try_for_each(|axis| axes.set_item(&axis.key, &axis.value))?;
    Ok(axes)
}

/// The surveyed pose of a target, `world_from_object`; `None` if the site has no pose in the world.
fn surveyed(header: &TrialHeader, target: &str) -> Option<Matrix4> {
    let model = header.targets.iter().find(|model| model.id == target)?;
    Some(product(header.world_from_site.as_ref()?, model.site_from_object.as_ref()?))
}

fn product(a: &Matrix4, b: &Matrix4) -> Matrix4 {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..4).map(|k| a[r][k] * b[k][c]).sum()))
}

/// The exception of a log's error.
pub(crate) fn of_log(py: Python<'_>, error: &LogError) -> PyErr {
    match error {
        LogError::Io { source, .. } => PyOSError::new_err((source.raw_os_error(), error.to_string())),
        _ => with_attributes(py, PyValueError::new_err(error.to_string()), "path", ""),
    }
}

/// The log of a trial.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Log {
    inner: Arc<TrialLog>,
}

#[pymethods]
impl Log {
    /// str: the name of the trial.
    #[getter]
    fn trial(&self) -> &str {
        &self.inner.header.trial
    }

    /// str: the question of the experiment.
    #[getter]
    fn question(&self) -> &str {
        &self.inner.header.question
    }

    /// str: the resolved configuration (TOML).
    #[getter]
    fn configuration(&self) -> &str {
        &self.inner.header.configuration
    }

    /// dict: the value of the trial on each axis of the experiment.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        axes_of(py, &self.inner.header)
    }

    /// dict of ndarray: the surveyed pose ``world_from_object``, shape (4, 4), of each target by its name (m).
    ///
    /// It is empty if the site has no pose in the world.
    #[getter]
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let objects = PyDict::new(py);
        for target in &self.inner.header.targets {
            if let Some(pose) = surveyed(&self.inner.header, &target.id) {
                objects.set_item(&target.id, table(py, &pose))?;
            }
        }
        Ok(objects)
    }

    /// dict of ndarray: the model points of each target by its name, object frame (m).
    #[getter]
    fn models<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let models = PyDict::new(py);
        for target in &self.inner.header.targets {
            let rows: Vec<[f64; 3]> = target.points.iter().map(|point| point.at).collect();
            models.set_item(&target.id, table(py, &rows))?;
        }
        Ok(models)
    }

    /// list of Frame: the logged frames, in order of time.
    #[getter]
    fn frames(&self) -> Vec<Frame> {
        (0..self.inner.frames.len()).map(|index| Frame { log: Arc::clone(&self.inner), index }).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.frames.len()
    }

    fn __repr__(&self) -> String {
        format!("Log({}, {} frames)", self.inner.header.trial, self.inner.frames.len())
    }
}

/// A frame of a log.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Frame {
    log: Arc<TrialLog>,
    index: usize,
}

impl Frame {
    fn record(&self) -> &FrameRecord {
        &self.log.frames[self.index]
    }
}

#[pymethods]
impl Frame {
    /// int: the number of the frame in its trial, from 0.
    #[getter]
    fn frame(&self) -> u64 {
        self.record().frame
    }

    /// int: the time (ns).
    #[getter]
    fn stamp_ns(&self) -> u64 {
        self.record().stamp_ns
    }

    /// ndarray, shape (m, 3): the measured points, camera frame (m).
    #[getter]
    fn cloud<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        table(py, &self.record().cloud.iter().map(|point| point.at).collect::<Vec<_>>())
    }

    /// ndarray, shape (m, 3, 3): the covariance of each measured point, camera axes (m²).
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let rows: Vec<[f64; 9]> =
            self.record().cloud.iter().map(|point| std::array::from_fn(|k| point.covariance[k / 3][k % 3])).collect();
        PyArray2::from_array(py, &aview2(&rows)).reshape([rows.len(), 3, 3])
    }

    /// ndarray, shape (k, 2): the key points of the left image (px).
    #[getter]
    fn key_points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        table(py, &self.record().key_points)
    }

    /// tuple of ndarray or None: the left and the right image, shape (h, w), uint8.
    #[getter]
    fn images<'py>(&self, py: Python<'py>) -> PyResult<Option<Images<'py>>> {
        let Some([left, right]) = &self.record().images else { return Ok(None) };
        let array = |image: &seafix_log::GreyImage| {
            numpy::PyArray1::from_slice(py, &image.pixels).reshape([image.height as usize, image.width as usize])
        };
        Ok(Some((array(left)?, array(right)?)))
    }

    /// ndarray, shape (4, 4), or None: the prior pose ``world_from_camera`` (m).
    #[getter]
    fn prior<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.record().prior.as_ref().map(|prior| table(py, &prior.world_from_camera))
    }

    /// ndarray, shape (4, 4), or None: the true pose ``world_from_camera``, if it is known (m).
    #[getter]
    fn truth<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.record().truth.as_ref().map(|truth| table(py, &truth.world_from_camera))
    }

    /// ndarray, shape (4, 4), or None: the pose ``world_from_camera`` that the navigator estimates (m).
    ///
    /// It is None in trials without a navigator, and while no fix holds.
    #[getter]
    fn navigated<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let pose = self.record().navigation.as_ref()?.pose.as_ref()?;
        let object = surveyed(&self.log.header, &pose.object)?;
        Some(table(py, &product(&object, &pose.object_from_camera)))
    }

    /// list of TargetResult: the result for each attempted target.
    #[getter]
    fn targets(&self) -> Vec<TargetResult> {
        let targets = self.record().targets.iter().enumerate().filter(|(_, target)| target.attempted());
        targets.map(|(target, _)| TargetResult { log: Arc::clone(&self.log), frame: self.index, target }).collect()
    }

    fn __repr__(&self) -> String {
        let record = self.record();
        format!("Frame({}, {} points, {} targets)", record.frame, record.cloud.len(), self.targets().len())
    }
}

/// The left and the right image.
type Images<'py> = (Bound<'py, PyArray2<u8>>, Bound<'py, PyArray2<u8>>);

/// The logged result for one target of a frame.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct TargetResult {
    log: Arc<TrialLog>,
    frame: usize,
    target: usize,
}

impl TargetResult {
    fn record(&self) -> &TargetRecord {
        &self.log.frames[self.frame].targets[self.target]
    }
}

#[pymethods]
impl TargetResult {
    /// str: the name of the target.
    #[getter]
    fn target(&self) -> &str {
        &self.record().object
    }

    /// str: the outcome: ``fix``, ``ambiguous``, ``rejected`` or ``degenerate``.
    #[getter]
    fn outcome(&self) -> &'static str {
        self.record().outcome.name()
    }

    /// str or None: the reason for a missing fix, in kebab-case.
    #[getter]
    fn reason(&self) -> Option<&str> {
        Some(self.record().reason.as_str()).filter(|reason| !reason.is_empty())
    }

    /// str or None: the reason for a missing fix as a sentence.
    #[getter]
    fn explanation(&self) -> Option<&str> {
        Some(self.record().explanation.as_str()).filter(|text| !text.is_empty())
    }

    /// ndarray, shape (4, 4), or None: the pose of a fix (m).
    #[getter]
    fn object_from_camera<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.record().object_from_camera.as_ref().map(|pose| table(py, pose))
    }

    /// ndarray, shape (6, 6), or None: the covariance of a fix, of ξ = (φ, ρ), in rad² and m².
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.record().covariance.as_ref().map(|matrix| table(py, matrix))
    }

    /// ndarray of int, shape (k, 2): the identified pairs (model, cloud).
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let row = |pair: &Pair| [i64::from(pair.model), i64::from(pair.cloud)];
        table(py, &self.record().pairs.iter().map(row).collect::<Vec<_>>())
    }

    /// float or None: the probability that the pose is not the object's.
    #[getter]
    fn p_wrong(&self) -> Option<f64> {
        self.record().p_wrong
    }

    /// float or None: the probability that the object is absent.
    #[getter]
    fn p_absent(&self) -> Option<f64> {
        self.record().p_absent
    }

    fn __repr__(&self) -> String {
        format!("TargetResult({}, {})", self.record().object, self.outcome())
    }
}
