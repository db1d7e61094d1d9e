//! A generated problem as plain data, and as input of a search.

use nalgebra::{Matrix3, Matrix4, Vector3};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{ModelPoint, Prior, PriorBound, problem_file::CoherenceProblem};
use serde::Serialize;

use super::family::Source;

/// A problem with the keys and the order of `coherence-problem/1`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedProblem {
    /// Name of the format.
    pub format: &'static str,
    /// Family and number.
    pub id: String,
    /// Letter of the family.
    pub family: &'static str,
    /// Name of the seed.
    pub seed_set: String,
    /// Number in the family.
    pub seed: u64,
    /// Model points in the object frame (m).
    pub model: Vec<[f64; 3]>,
    /// Cloud points in the camera frame (m).
    pub cloud: Vec<[f64; 3]>,
    /// Root mean square of the coordinates' standard deviations (m).
    pub sigma: f64,
    /// Distance tolerance Δ = 3√2 σ (m).
    pub delta: f64,
    /// Prior pose, if there is one.
    pub prior: Option<GeneratedPrior>,
    /// Putative pairs, if the search is restricted to them.
    pub putative: Option<Vec<[usize; 2]>>,
    /// Standard deviations along the camera's axes (m), if they differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_xyz: Option<Vec<[f64; 3]>>,
}

/// A prior pose with its gate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GeneratedPrior {
    /// Prior camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// Half-size of the gate (m).
    pub shell_half_m: f64,
}

impl GeneratedProblem {
    /// A problem without cloud, prior pose and putative pairs.
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

    /// The problem as input of a search.
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
            edges: Default::default(),
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

/// Rounds to six decimals.
pub(super) fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

/// Coordinates rounded to 1 µm, as in the files.
pub(super) fn micrometres(at: &Vector3<f64>) -> [f64; 3] {
    [round(at.x), round(at.y), round(at.z)]
}
