//! The rigid motion between two lists of corresponding points.

use numpy::PyArray2;
use pyo3::{prelude::*, types::PyString};
use seafix::{
    geometry::{Camera, Covariance6, Object, Point, Transform, UncertainPoint},
    referencing::{Degenerate, Observation, Observations, SOLVERS, Solver},
};

use crate::{
    array::{array4, array6, rows, vector},
    choice::Built,
    failure,
    interpreter::{detached, interruptible},
    invalid::{DegenerateError, invalid, with_attributes},
    solve::BUILT_SOLVERS,
};

/// The number of points above which Ctrl-C ends the call: a thread of its own takes longer than fewer points.
const LONG: usize = 200;

/// A pose and its covariance as arrays.
type Registered<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Compute the rigid motion that maps points onto corresponding points, ``dst ≈ T @ src``.
///
/// Parameters
/// ----------
/// src : array_like, shape (n, 3)
///     Measured points (m).
/// dst : array_like, shape (n, 3)
///     Corresponding model points, without error (m).
/// weights : array_like, shape (n,), optional
///     Weight of each pair, proportional to the inverse variance of its measured point.
/// solver : str or dict, optional
///     A registered solver that needs no pixels (see :func:`solvers`), or a dictionary of its `name` and settings. The
///     default is ``kabsch``, with weights ``weighted-kabsch``.
/// sigma : float, optional
///     Standard deviation of a measured point of weight one along each axis (m). Without one it is estimated from the
///     residuals of the least-squares motion: σ² = Σ w ‖r‖² / (3 n − 6). Robust solvers need it, because an estimate
///     includes the outliers.
///
/// Returns
/// -------
/// T : ndarray, shape (4, 4)
///     The rigid motion.
/// covariance : ndarray, shape (6, 6)
///     Covariance of ξ = (φ, ρ) in ``T_true = T @ Exp(ξ)``, rotation (rad) first, along the axes of `src`.
///
/// Raises
/// ------
/// DegenerateError
///     The points determine no motion: fewer than three, or collinear. It is a ``ValueError``.
/// ValueError
///     An array of another shape, an unknown solver, or an invalid weight.
///
/// References
/// ----------
/// Kabsch, *Acta Cryst.* A32, 1976; Umeyama, *IEEE TPAMI* 13, 1991.
///
/// Examples
/// --------
/// >>> T, covariance = sf.register(src, dst)
/// >>> dst_again = src @ T[:3, :3].T + T[:3, 3]
#[pyfunction]
#[pyo3(signature = (src, dst, weights=None, solver=None, *, sigma=None))]
pub(crate) fn register<'py>(
    py: Python<'py>,
    src: &Bound<'py, PyAny>,
    dst: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    solver: Option<&Bound<'py, PyAny>>,
    sigma: Option<f64>,
) -> PyResult<Registered<'py>> {
    let (src, dst) = (rows::<3>(src, "src", "(n, 3)")?, rows::<3>(dst, "dst", "(n, 3)")?);
    if src.len() != dst.len() {
        let what = format!("`src` has {} points and `dst` {}", src.len(), dst.len());
        return Err(invalid(py, "dst", what, "give corresponding rows"));
    }
    let weights = weights.map(|given| checked_weights(given, src.len())).transpose()?;
    if let Some(sigma) = sigma
        && !(sigma >= 0.0 && sigma.is_finite())
    {
        return Err(invalid(py, "sigma", format!("`sigma` is {sigma}"), "give metres, zero or more"));
    }
    let default = if weights.is_some() { "weighted-kabsch" } else { "kabsch" };
    let (name, solver) = component(&BUILT_SOLVERS, solver, PyString::intern(py, default).as_any())?;
    if solver.needs_pixels() {
        let what = format!("cannot register with `{name}`: it needs pixels and a rig");
        return Err(invalid(py, "solver", what, "use `mahalanobis`"));
    }
    let uneven = weights.as_ref().is_some_and(|all| all.iter().any(|w| w != &all[0]));
    if uneven && solver.least_squares() {
        let what = format!("`{name}` weights all points equally");
        return Err(invalid(py, "solver", what, "use `weighted-kabsch` or omit the weights"));
    }
    let long = src.len() > LONG;
    let solve = move || {
        let found = solution(&src, &dst, weights.as_deref(), &*solver, sigma);
        // A solver written in Python keeps its exception on the thread that it runs on.
        (found, failure::taken())
    };
    let (found, raised) = if long { interruptible(py, solve)? } else { detached(py, solve)? };
    if let Some(error) = raised {
        return Err(error);
    }
    let (pose, covariance) = found.map_err(|why| degenerate(py, &why))?;
    Ok((array4(py, &pose.matrix()), array6(py, &covariance.matrix)))
}

fn component<'py>(
    built: &Built<dyn Solver>,
    chosen: Option<&Bound<'py, PyAny>>,
    default: &Bound<'py, PyAny>,
) -> PyResult<(String, std::sync::Arc<dyn Solver>)> {
    built.component(&SOLVERS, chosen.unwrap_or(default))
}

/// The exception for points that determine no pose.
pub(crate) fn degenerate(py: Python<'_>, why: &Degenerate) -> PyErr {
    let remedy = why.remedy();
    with_attributes(py, DegenerateError::new_err(format!("cannot register the points: {why}; {remedy}")), "src", remedy)
}

fn checked_weights(given: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<f64>> {
    let (py, weights) = (given.py(), vector(given, "weights", "(n,)")?);
    if weights.len() != count {
        let what = format!("`weights` has {} values for {count} points", weights.len());
        return Err(invalid(py, "weights", what, "give one weight per point"));
    }
    match weights.iter().position(|w| !(*w > 0.0 && w.is_finite())) {
        None => Ok(weights),
        Some(index) => {
            let what = format!("weight {index} is {}", weights[index]);
            Err(invalid(py, "weights", what, "give positive numbers, and leave out points without weight"))
        }
    }
}

fn solution(
    src: &[[f64; 3]],
    dst: &[[f64; 3]],
    weights: Option<&[f64]>,
    solver: &dyn Solver,
    sigma: Option<f64>,
) -> Result<Estimate, Degenerate> {
    let weight = |k: usize| weights.map_or(1.0, |all| all[k]);
    let observation = |k: usize, sigma: f64| Observation {
        measured: UncertainPoint::isotropic(Point::from(src[k]), sigma / weight(k).sqrt()),
        pixels: None,
        model: Point::from(dst[k]),
        model_sigma: 0.0,
    };
    let all = |sigma: f64| Observations {
        points: (0..src.len()).map(|k| observation(k, sigma)).collect(),
        edges: Vec::new(),
        rig: None,
    };
    let Some(sigma) = sigma else {
        // The weights of the closed form are relative, so any unit serves for the estimate.
        let mut data = all(1.0);
        // Least squares of equal weights do not depend on the noise.
        let known = if solver.least_squares() { Some(solver.solve(&data)?) } else { None };
        let fitted = known.map_or_else(|| least_squares(weights.is_some()).solve(&data), Ok)?;
        let squares = |(k, point): (usize, &Observation)| weight(k) * point.residual(&fitted).norm_squared();
        // Three coordinates a point determine six parameters; three points leave three degrees of freedom.
        let variance = data.points.iter().enumerate().map(squares).sum::<f64>() / (3 * src.len() - 6) as f64;
        for (k, point) in data.points.iter_mut().enumerate() {
            point.measured.covariance = nalgebra::Matrix3::identity() * (variance / weight(k));
        }
        let pose = known.map_or_else(|| solver.solve(&data), Ok)?;
        return Ok((pose, solver.covariance(&data, &pose)?));
    };
    let data = all(sigma);
    let pose = solver.solve(&data)?;
    let covariance = solver.covariance(&data, &pose)?;
    Ok((pose, covariance))
}

/// The closed-form least squares, weighted by the noise or not.
fn least_squares(weighted: bool) -> &'static dyn Solver {
    use std::sync::LazyLock;

    use seafix::component::Choice;

    static EQUAL: LazyLock<Box<dyn Solver>> = LazyLock::new(|| built("kabsch"));
    static WEIGHTED: LazyLock<Box<dyn Solver>> = LazyLock::new(|| built("weighted-kabsch"));
    fn built(name: &str) -> Box<dyn Solver> {
        SOLVERS.build(&Choice::named(name)).expect("the closed forms are registered with their defaults")
    }
    if weighted { &**WEIGHTED } else { &**EQUAL }
}

/// A motion and its covariance.
type Estimate = (Transform<Object, Camera>, Covariance6<Object, Camera>);
