//! The truth of a generated problem, and the limits of the best possible method.

use seafix_geometry::{Camera, Object, Transform};
use seafix_referencing::{Correspondence, Kabsch, Observations, Solver, problem_file::CoherenceProblem, rms_apart};
use serde::Serialize;

use super::problem::GeneratedProblem;

/// Number of true pairs from which on the largest coherent subset is not computed.
const MANY_PAIRS: usize = 100;

/// The truth of a problem, for evaluation only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedTruth {
    /// Family and number.
    pub id: String,
    /// True camera_from_object; for an absent object, the pose of the clutter about it.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// True pairs (model point, cloud point), sorted by model point.
    pub pairs: Vec<[usize; 2]>,
    /// Whether the true pairs determine a pose.
    pub pose_defined: bool,
    /// Least-squares pose of the true pairs.
    #[serde(rename = "ideal_T_cam_obj")]
    pub ideal_t_cam_obj: Option<[[f64; 4]; 4]>,
    /// Target registration error of the least-squares pose: RMS over all model points (m).
    pub ideal_tre_rms: Option<f64>,
    /// Size of the largest coherent subset of the true pairs; `None` from 100 pairs on.
    pub max_coherent_true: Option<usize>,
    /// Parameters of the problem.
    pub params: GeneratedParameters,
}

/// Parameters of a problem; each family has some of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct GeneratedParameters {
    /// Number of model points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n: Option<usize>,
    /// Number of cloud points.
    #[serde(rename = "M", skip_serializing_if = "Option::is_none")]
    pub m: Option<usize>,
    /// Number of measured model points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub visible: Option<usize>,
    /// Half-size of the gates (m).
    #[serde(rename = "shell", skip_serializing_if = "Option::is_none")]
    pub gate: Option<f64>,
    /// Whether all clutter lies in gates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dense: Option<bool>,
    /// Standard deviation of the noise (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Ratio of depth noise to lateral noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aniso: Option<u32>,
    /// Number of points that the best wrong placement of the lattice matches.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best_wrong_symmetry: Option<usize>,
    /// Whether the problem has a prior pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<bool>,
    /// Number of putative pairs.
    #[serde(rename = "N", skip_serializing_if = "Option::is_none")]
    pub pairs: Option<usize>,
    /// Percentage of outliers among the putative pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers: Option<usize>,
    /// Radius of the ball that holds the outliers (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Whether the object is absent; not given for a present object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absent: Option<bool>,
    /// Whether a box of other dimensions stands in its place; given if one does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replaced: Option<bool>,
}

impl GeneratedTruth {
    pub(super) fn new(
        generated: &GeneratedProblem,
        camera_from_object: &Transform<Camera, Object>,
        mut pairs: Vec<[usize; 2]>,
        params: GeneratedParameters,
    ) -> Self {
        pairs.sort_unstable();
        let problem = generated.problem();
        let correspondences: Vec<Correspondence> =
            pairs.iter().map(|&[model, cloud]| Correspondence { model, cloud }).collect();
        let data = Observations::of(&correspondences, &problem.model, &problem.cloud, None);
        let ideal = Kabsch::default().solve(&data).ok();
        let off = |ideal: &Transform<Object, Camera>| rms_apart(&problem.model, ideal, &camera_from_object.inverse());
        Self {
            id: generated.id.clone(),
            t_cam_obj: camera_from_object.rows(),
            pose_defined: ideal.is_some(),
            ideal_t_cam_obj: ideal.map(|pose| pose.inverse().rows()),
            ideal_tre_rms: ideal.as_ref().map(off),
            max_coherent_true: (pairs.len() < MANY_PAIRS).then(|| max_coherent(&problem, &correspondences)),
            pairs,
            params,
        }
    }
}

/// The size of the largest coherent subset of one-to-one pairs of which nearly all agree.
fn max_coherent(problem: &CoherenceProblem, pairs: &[Correspondence]) -> usize {
    let agree = |a: Correspondence, b: Correspondence| {
        let model = problem.model[a.model].at.distance(&problem.model[b.model].at);
        let cloud = problem.cloud[a.cloud].position.at.distance(&problem.cloud[b.cloud].position.at);
        (model - cloud).abs() <= problem.delta
    };
    let conflicts: Vec<Vec<usize>> = (0..pairs.len())
        .map(|i| (0..pairs.len()).filter(|&k| k != i && !agree(pairs[i], pairs[k])).collect())
        .collect();
    without_conflict(&conflicts, &vec![true; pairs.len()])
}

/// The size of a maximum independent set in the conflict graph restricted to `left`.
///
/// A vertex with at most one conflict is always taken. Otherwise the vertex with the most conflicts is tried both ways.
fn without_conflict(conflicts: &[Vec<usize>], left: &[bool]) -> usize {
    let of = |i: usize| conflicts[i].iter().filter(|&&k| left[k]).count();
    let with = |i: usize| {
        let mut rest = left.to_vec();
        rest[i] = false;
        conflicts[i].iter().for_each(|&k| rest[k] = false);
        1 + without_conflict(conflicts, &rest)
    };
    let Some(worst) = (0..left.len()).filter(|&i| left[i]).max_by_key(|&i| of(i)) else { return 0 };
    if of(worst) == 0 {
        return left.iter().filter(|&&left| left).count();
    }
    if let Some(free) = (0..left.len()).find(|&i| left[i] && of(i) == 1) {
        return with(free);
    }
    let mut without = left.to_vec();
    without[worst] = false;
    with(worst).max(without_conflict(conflicts, &without))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_of_five_conflicts_leaves_two() {
        let ring: Vec<Vec<usize>> = (0..5).map(|i| vec![(i + 4) % 5, (i + 1) % 5]).collect();
        assert_eq!(without_conflict(&ring, &[true; 5]), 2);
        let star = vec![vec![1, 2, 3], vec![0], vec![0], vec![0]];
        assert_eq!(without_conflict(&star, &[true; 4]), 3);
        assert_eq!(without_conflict(&[vec![], vec![]], &[true; 2]), 2);
    }
}
