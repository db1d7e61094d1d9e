//! A drawn problem as plain data, and as what a search is given.

use nalgebra::{Matrix3, Matrix4, Vector3};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{ModelPoint, Prior, PriorBound, problem_file::CoherenceProblem};
use serde::Serialize;

use super::Source;

/// A problem in the keys and the order of `coherence-problem/1`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedProblem {
    /// The format's name.
    pub format: &'static str,
    /// Family and number.
    pub id: String,
    /// The family's letter.
    pub family: &'static str,
    /// The seed, as a name.
    pub seed_set: String,
    /// The number in the family.
    pub seed: u64,
    /// The feature points, object frame (m).
    pub model: Vec<[f64; 3]>,
    /// The measured points, camera frame (m).
    pub cloud: Vec<[f64; 3]>,
    /// RMS standard deviation of a measured coordinate (m).
    pub sigma: f64,
    /// The distance tolerance Δ = 3√2 σ (m).
    pub delta: f64,
    /// What is known of the pose.
    pub prior: Option<GeneratedPrior>,
    /// The only pairs to consider.
    pub putative: Option<Vec<[usize; 2]>>,
    /// Standard deviations along the camera's axes, where they differ (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_xyz: Option<Vec<[f64; 3]>>,
}

/// The rough pose and how far it may be off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedPrior {
    /// camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// Half-size of the shell (m).
    pub shell_half_m: f64,
}

impl GeneratedProblem {
    /// The frame of a problem: everything but model, cloud and what is known beforehand.
    pub(super) fn new(source: &Source, model: &[Vector3<f64>], sigma: f64) -> Self {
        Self {
            format: seafix_referencing::problem_file::FORMAT,
            id: format!("{}{:03}", source.family.letter(), source.number),
            family: source.family.letter(),
            seed_set: format!("seed-{}", source.seed),
            seed: source.number,
            model: model.iter().map(micrometres).collect(),
            cloud: Vec::new(),
            sigma,
            delta: round(3.0 * 2f64.sqrt() * sigma),
            prior: None,
            putative: None,
            sigma_xyz: None,
        }
    }

    /// What a search is given.
    pub fn problem(&self) -> CoherenceProblem {
        let model = self.model.iter().enumerate().map(|(i, at)| ModelPoint::exact(i.to_string(), Point::from(*at)));
        let cloud = self.cloud.iter().enumerate().map(|(j, at)| {
            let sigma = self.sigma_xyz.as_ref().map_or([self.sigma; 3], |rows| rows[j]);
            let covariance = Matrix3::from_diagonal(&sigma.map(|s| s * s).into());
            MeasuredPoint { position: UncertainPoint { at: Point::from(*at), covariance }, pixels: None }
        });
        CoherenceProblem {
            id: self.id.clone(),
            model: model.collect(),
            cloud: cloud.collect(),
            delta: self.delta,
            prior: self.prior.as_ref().map(GeneratedPrior::prior),
            putative: self.putative.as_ref().map(|pairs| pairs.iter().map(|&[i, j]| (i, j)).collect()),
        }
    }
}

impl GeneratedPrior {
    fn prior(&self) -> Prior {
        let matrix = Matrix4::from_fn(|row, column| self.t_cam_obj[row][column]);
        let camera_from_object =
            Transform::<Camera, Object>::from_matrix(&matrix).expect("it was made of a rigid motion");
        Prior { object_from_camera: camera_from_object.inverse(), bound: PriorBound::Box(self.shell_half_m) }
    }
}

/// To six decimals.
pub(super) fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

/// The coordinates in whole micrometres, as the files have them.
pub(super) fn micrometres(at: &Vector3<f64>) -> [f64; 3] {
    [round(at.x), round(at.y), round(at.z)]
}
