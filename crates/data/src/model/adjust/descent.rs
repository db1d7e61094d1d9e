//! Levenberg–Marquardt on the sparse normal equations.

use faer::{Side, linalg::solvers::Solve};
use nalgebra::{Matrix4, Matrix6, Vector3, Vector6};

use super::{
    Adjustment, Undetermined,
    equations::{State, equations},
    observation::{Motion, Observation},
    switch::{cost, switch},
};

/// Maximum number of iterations, rejected steps included.
const STEPS: usize = 100;
/// The squared Mahalanobis length of the last step.
const LAST: f64 = 1e-16;
/// The largest damping; a minimum is not found beyond it.
const MAX_DAMPING: f64 = 1e9;

/// Minimises the switched cost with switch threshold `threshold`, infinite for plain least squares.
///
/// # Errors
/// [`Undetermined`] if the equations are singular or a point leaves the view.
pub(super) fn descend(
    problem: &mut Adjustment<'_>,
    observations: &[(Observation, Matrix4<f64>)],
    motions: &[(Motion, Matrix6<f64>)],
    threshold: f64,
) -> Result<(), Undetermined> {
    let mut damping = 0.0;
    let mut before = total(&state(problem), observations, motions, threshold);
    for _ in 0..STEPS {
        let weighted = switched(&state(problem), observations, threshold);
        let built = equations(&state(problem), &weighted, motions, damping).ok_or(Undetermined)?;
        let Ok(factor) = built.normal.sp_cholesky(Side::Lower) else {
            damping = f64::max(10.0 * damping, 1e-6);
            if damping > MAX_DAMPING {
                return Err(Undetermined);
            }
            continue;
        };
        let step = factor.solve(&built.pull);
        let size: f64 = (0..built.pull.nrows()).map(|k| step[(k, 0)] * built.pull[(k, 0)]).sum();
        if !size.is_finite() {
            return Err(Undetermined);
        }
        let kept = (problem.poses.clone(), problem.points.clone());
        let places: Vec<Option<usize>> = (0..kept.0.len()).map(|pose| state(problem).pose_unknown(pose)).collect();
        let first = state(problem).point_unknown(0);
        for (pose, place) in problem.poses.iter_mut().zip(places) {
            let Some(place) = place else { continue };
            *pose = pose.perturbed(&Vector6::from_fn(|k, _| step[(place + k, 0)])).renormalized();
        }
        for (index, point) in problem.points.iter_mut().enumerate() {
            *point = *point + Vector3::from_fn(|k, _| step[(first + 3 * index + k, 0)]);
        }
        let after = total(&state(problem), observations, motions, threshold);
        if after <= before {
            let rounding = before - after <= 1e-14 * before;
            before = after;
            damping = if damping < 1e-12 { 0.0 } else { 0.1 * damping };
            if size < LAST || rounding && size < 1e-9 {
                return Ok(());
            }
        } else {
            (problem.poses, problem.points) = kept;
            damping = f64::max(10.0 * damping, 1e-6);
            if size < 1e-9 || damping > MAX_DAMPING {
                return Ok(());
            }
        }
    }
    Ok(())
}

fn state<'a>(problem: &'a Adjustment<'_>) -> State<'a> {
    State { rig: problem.rig, poses: &problem.poses, points: &problem.points }
}

/// The squared Mahalanobis norm of an observation; `None` out of view.
fn disagreement(state: &State<'_>, observation: &Observation, information: &Matrix4<f64>) -> Option<f64> {
    let r = observation.pixels.at.coordinates() - state.expected(observation)?.coordinates();
    Some(r.dot(&(information * r)))
}

/// The observations with their switched information; one out of view has none.
fn switched(
    state: &State<'_>,
    observations: &[(Observation, Matrix4<f64>)],
    threshold: f64,
) -> Vec<(Observation, Matrix4<f64>)> {
    let weighted = |(observation, information): &(Observation, Matrix4<f64>)| {
        let factor = match disagreement(state, observation, information) {
            None if threshold.is_finite() => 0.0,
            None => 1.0,
            Some(_) if threshold.is_infinite() => 1.0,
            Some(chi2) => switch(chi2, threshold),
        };
        (*observation, information * (factor * factor))
    };
    observations.iter().map(weighted).collect()
}

fn total(
    state: &State<'_>,
    observations: &[(Observation, Matrix4<f64>)],
    motions: &[(Motion, Matrix6<f64>)],
    threshold: f64,
) -> f64 {
    let of_observation = |(observation, information): &(Observation, Matrix4<f64>)| {
        match disagreement(state, observation, information) {
            Some(chi2) if threshold.is_infinite() => chi2,
            Some(chi2) => cost(chi2, threshold),
            // The limit of the switched cost.
            None => threshold,
        }
    };
    let of_motion = |(motion, information): &(Motion, Matrix6<f64>)| {
        let r = state.motion_residual(motion);
        r.dot(&(information * r))
    };
    observations.iter().map(of_observation).chain(motions.iter().map(of_motion)).sum()
}
