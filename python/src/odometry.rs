//! Odometry from stereo pairs.

use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, ndarray::aview2};
use pyo3::{exceptions::PyValueError, prelude::*};
use seafix::{
    component::Choice,
    navigation::{ODOMETRIES, OdometryOutcome, OdometrySession, StereoPair},
    vision::Threads,
};

use crate::{
    array::array4,
    choice::choice,
    image::pair,
    interpreter::detached,
    invalid::{invalid, stated, with_attributes},
    rig::Rig,
};

/// The result of an odometry for one stereo pair.
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Motion {
    /// str: ``began`` for the first pair of a segment, ``followed``, or ``skipped``.
    #[pyo3(get)]
    outcome: &'static str,
    /// str or None: the reason why the pair was skipped.
    #[pyo3(get)]
    reason: Option<String>,
    /// int: the index of the segment; the motion between two segments is unknown.
    #[pyo3(get)]
    segment: Option<usize>,
    pose: Option<nalgebra::Matrix4<f64>>,
}

#[pymethods]
impl Motion {
    /// ndarray, shape (4, 4), or None: the pose of the left camera; the world is its frame at the first pair (m).
    #[getter]
    fn world_from_camera<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.pose.as_ref().map(|pose| array4(py, pose))
    }

    fn __repr__(&self) -> String {
        format!("Motion({})", self.reason.as_deref().unwrap_or(self.outcome))
    }
}

/// An odometry: the motion of a stereo rig from its images.
///
/// Parameters
/// ----------
/// rig : Rig
///     The stereo rig.
/// odometry : str or dict, default "stereo"
///     A registered odometry that needs no other sensors, or a dictionary of its `name` and settings.
///
/// Raises
/// ------
/// ValueError
///     An unknown odometry or setting, or one that needs readings of other sensors.
///
/// Examples
/// --------
/// >>> odometry = sf.Odometry(rig)
/// >>> motion = odometry.push(stamp_ns, left, right)
/// >>> stamps_ns, poses, segments = odometry.trajectory()
#[pyclass(frozen, module = "seafix")]
pub(crate) struct Odometry {
    session: Mutex<Box<dyn OdometrySession + 'static>>,
    rig: seafix::Rig,
}

#[pymethods]
impl Odometry {
    #[new]
    #[pyo3(signature = (rig, odometry=None))]
    fn new(py: Python<'_>, rig: &Rig, odometry: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let choice = odometry.map_or_else(|| Ok(Choice::named("stereo")), |given| choice(given, "odometry"))?;
        let built = ODOMETRIES.build(&choice).map_err(|error| stated(py, "odometry", &error.to_string()))?;
        if built.needs_readings() {
            let what = format!("the odometry `{}` needs readings of other sensors", choice.name);
            return Err(invalid(py, "odometry", what, "use `stereo` or `icp`, or run an experiment with a recording"));
        }
        // A session borrows its odometry and its rig. Both are some kilobytes and live as long as the program.
        let (odometry, stereo) = (Box::leak(built), Box::leak(Box::new(rig.inner.stereo)));
        let session = odometry.begin(stereo, rig.inner.body_from_camera, Threads::One);
        Ok(Self { session: Mutex::new(session), rig: rig.inner.clone() })
    }

    /// Process the next stereo pair.
    ///
    /// Parameters
    /// ----------
    /// stamp_ns : int
    ///     Time of exposure (ns), later than that of the previous pair.
    /// left, right : str, os.PathLike or ndarray
    ///     The images, as for :meth:`Localizer.localize`.
    ///
    /// Returns
    /// -------
    /// Motion
    ///     The preliminary pose; later pairs may refine it (:meth:`trajectory`).
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A stamp that is not later than the previous one, or an invalid image. The state is then unchanged.
    fn push(
        &self,
        py: Python<'_>,
        stamp_ns: &Bound<'_, PyAny>,
        left: &Bound<'_, PyAny>,
        right: &Bound<'_, PyAny>,
    ) -> PyResult<Motion> {
        let stamp_ns: u64 = stamp_ns.extract().map_err(|_| {
            let what = format!("`stamp_ns` is {stamp_ns}");
            invalid(py, "stamp_ns", what, "give whole nanoseconds from 0 to 18446744073709551615")
        })?;
        let (left, right) = pair(left, right, &self.rig)?;
        let advanced = detached(py, || {
            let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
            let outcome = session.advance(&StereoPair { stamp_ns, left: &left, right: &right });
            outcome.map(|outcome| (outcome, session.latest()))
        })?;
        let (outcome, latest) = advanced.map_err(|error| {
            with_attributes(py, PyValueError::new_err(error.to_string()), "stamp_ns", "sort the pairs by time")
        })?;
        let (outcome, reason) = match outcome {
            OdometryOutcome::Began => ("began", None),
            OdometryOutcome::Followed { .. } => ("followed", None),
            OdometryOutcome::Skipped(lost) => ("skipped", Some(lost.to_string())),
        };
        // The latest waypoint of a skipped pair is that of an earlier one.
        let latest = latest.filter(|_| reason.is_none());
        Ok(Motion {
            outcome,
            reason,
            segment: latest.map(|(segment, _)| segment),
            pose: latest.map(|(_, waypoint)| waypoint.world_from_camera.matrix()),
        })
    }

    /// The trajectory up to now.
    ///
    /// Returns
    /// -------
    /// stamps_ns : ndarray of int, shape (k,)
    ///     The times (ns).
    /// poses : ndarray, shape (k, 4, 4)
    ///     The poses ``world_from_camera`` (m). A segment after a break begins where the previous one ended.
    /// segments : ndarray of int, shape (k,)
    ///     The segment of each pose. The motion between two segments is unknown: poses of different segments must not be
    ///     compared.
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<StampedPoses<'py>> {
        let trajectory = detached(py, || self.session.lock().unwrap_or_else(PoisonError::into_inner).trajectory())?;
        let poses = || trajectory.segments.iter().flat_map(|segment| &segment.poses);
        let rows: Vec<[f64; 16]> = poses()
            .map(|it| {
                let matrix = it.world_from_camera.matrix();
                std::array::from_fn(|k| matrix[(k / 4, k % 4)])
            })
            .collect();
        let stamps = PyArray1::from_iter(py, poses().map(|it| it.stamp_ns as i64));
        let segments = trajectory.segments.iter().enumerate();
        let segments = segments.flat_map(|(index, segment)| segment.poses.iter().map(move |_| index as i64));
        let segments = PyArray1::from_iter(py, segments);
        Ok((stamps, PyArray2::from_array(py, &aview2(&rows)).reshape([rows.len(), 4, 4])?, segments))
    }

    fn __repr__(&self) -> String {
        "Odometry()".to_owned()
    }
}

/// Times (ns), the poses at them, and the segments of these.
type StampedPoses<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<i64>>);
