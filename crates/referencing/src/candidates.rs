//! Stage 1: the cloud points that the prior allows for each model point.

use nalgebra::Matrix3;
use seafix_component::{Settings, in_range};
use seafix_geometry::{Camera, MeasuredPoint, Point};
use serde::{Deserialize, Serialize};

use crate::{
    chi_square::chi_square,
    lanes::{LANES, ones_of, packed},
    problem::{Prior, PriorBound},
    site::model::ModelPoint,
};

/// The gate about the predicted position of a model point under a Gaussian prior.
///
/// It is written in TOML as `gate = { chi-square = 0.99 }` or `gate = { box = 0.25 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Gate {
    /// The paper's shell: a box of this half-size (m) along the camera's axes.
    ///
    /// The size is equal for every point ("by the known navigation error", Sec. 2.2); the faces belong to the box.
    Box(f64),
    /// The χ² ellipsoid (c − p)ᵀ S⁻¹ (c − p) ≤ χ²₃(confidence).
    ///
    /// S = J Σ_prior Jᵀ + Σ_triangulation + σ_model² I, with J the derivative of the predicted position by the pose.
    /// The true cloud point lies in the ellipsoid with this confidence (Bar-Shalom and Fortmann, *Tracking and Data
    /// Association*, 1988, Sec. 5.2).
    ChiSquare(f64),
}

impl Default for Gate {
    fn default() -> Self {
        Self::ChiSquare(0.99)
    }
}

impl Gate {
    /// Checks the range of the gate.
    ///
    /// # Errors
    ///
    /// A half-size that is not positive and finite, or a confidence outside (0, 1).
    pub fn check(&self) -> Result<(), String> {
        // A NaN is rejected as well.
        let checked = match *self {
            Self::Box(half) => in_range(half > 0.0 && half.is_finite(), "box", half, "a positive half-size in metres"),
            Self::ChiSquare(confidence) => {
                let inside = confidence > 0.0 && confidence < 1.0;
                in_range(inside, "chi-square", confidence, "a confidence between 0 and 1")
            }
        };
        checked.map_err(|message| format!("gate: {message}"))
    }
}

/// The candidates of each model point: indices of cloud points, ascending, without repetition.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Candidates {
    /// One list per model point; empty if there is no candidate.
    pub lists: Vec<Vec<usize>>,
}

impl Candidates {
    /// Every cloud point for every model point: a search without gates.
    pub fn all(model: usize, cloud: usize) -> Self {
        Self { lists: vec![(0..cloud).collect(); model] }
    }

    /// The lists of these pairs (model, cloud), given in any order.
    ///
    /// # Panics
    ///
    /// If a model index is not below `model`.
    pub fn from_pairs(model: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let mut lists = vec![Vec::new(); model];
        for (i, j) in pairs {
            lists[i].push(j);
        }
        for list in &mut lists {
            list.sort_unstable();
            list.dedup();
        }
        Self { lists }
    }

    /// The number of candidate pairs.
    pub fn pairs(&self) -> usize {
        self.lists.iter().map(Vec::len).sum()
    }

    /// The number of model points with a candidate.
    pub fn with_candidates(&self) -> usize {
        self.lists.iter().filter(|list| !list.is_empty()).count()
    }
}

/// Stage 1: the candidates of each model point.
///
/// A cloud point c is a candidate of the model point with predicted position p if |c − p| ≤ s along each camera axis
/// ([`PriorBound::Box`], closed), or if it lies in the `gate` ([`PriorBound::Gaussian`]). Without a prior every cloud
/// point is a candidate. Model points that the mask `in_view` excludes have no candidates.
pub fn candidates(
    model: &[ModelPoint],
    cloud: &[MeasuredPoint],
    prior: Option<&Prior>,
    gate: &Gate,
    in_view: Option<&[bool]>,
) -> Candidates {
    let places = Places::of(if prior.is_some() { cloud } else { &[] });
    let seen = |index: usize| in_view.is_none_or(|mask| mask.get(index).copied().unwrap_or(false));
    let lists = model.iter().enumerate().map(|(index, point)| {
        if !seen(index) {
            return Vec::new();
        }
        let Some(prior) = prior else {
            return (0..cloud.len()).collect();
        };
        match point_gate(point, prior, gate) {
            PointGate::Box { centre, half } => places.within(&centre, half),
            PointGate::Ellipsoid(ellipsoid) => (0..cloud.len()).filter(|&j| ellipsoid.admits(&cloud[j])).collect(),
        }
    });
    Candidates { lists: lists.collect() }
}

/// The coordinates of a cloud, one column per axis, padded to full words: every model point scans all of them.
struct Places([Vec<f64>; 3]);

impl Places {
    fn of(cloud: &[MeasuredPoint]) -> Self {
        Self([0, 1, 2].map(|axis| {
            let mut column: Vec<f64> = cloud.iter().map(|point| point.position.at.coords[axis]).collect();
            // The padding lies in no box.
            column.resize(cloud.len().next_multiple_of(LANES), f64::NAN);
            column
        }))
    }

    /// The points in a box about a centre; its faces belong to it.
    fn within(&self, centre: &Point<Camera>, half: f64) -> Vec<usize> {
        let [x, y, z] = self.0.each_ref().map(|column| column.as_chunks::<LANES>().0);
        let words = x.iter().zip(y).zip(z).enumerate();
        words
            .flat_map(|(word, ((x, y), z))| ones_of(LANES * word, inside([x, y, z], centre.coords.into(), half)))
            .collect()
    }
}

/// The bits of 64 points: set for those in a box about a centre.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn inside([x, y, z]: [&[f64; LANES]; 3], c: [f64; 3], half: f64) -> u64 {
    let mut inside = [0u8; LANES];
    for k in 0..LANES {
        let near = |x: f64, c: f64| (x - c).abs() <= half;
        inside[k] = u8::from(near(x[k], c[0]) & near(y[k], c[1]) & near(z[k], c[2]));
    }
    packed(&inside)
}

/// The gate about one predicted position.
enum PointGate {
    Box { centre: Point<Camera>, half: f64 },
    Ellipsoid(Ellipsoid),
}

/// The ellipsoid (c − centre)ᵀ (covariance + Σ_c)⁻¹ (c − centre) ≤ limit.
struct Ellipsoid {
    centre: Point<Camera>,
    covariance: Matrix3<f64>,
    limit: f64,
}

fn point_gate(point: &ModelPoint, prior: &Prior, gate: &Gate) -> PointGate {
    let centre = prior.object_from_camera.inverse() * point.at;
    match (&prior.bound, gate) {
        (PriorBound::Box(half), _) | (PriorBound::Gaussian(_), Gate::Box(half)) => {
            PointGate::Box { centre, half: *half }
        }
        (PriorBound::Gaussian(covariance), Gate::ChiSquare(confidence)) => {
            let own = point.sigma * point.sigma;
            PointGate::Ellipsoid(Ellipsoid {
                centre,
                covariance: covariance.of_point(&centre) + Matrix3::identity() * own,
                limit: chi_square(3, *confidence),
            })
        }
    }
}

impl Ellipsoid {
    fn admits(&self, measured: &MeasuredPoint) -> bool {
        let step = measured.position.at - self.centre;
        // An axis without uncertainty (S singular) still admits a point exactly at the prediction.
        let s = self.covariance + measured.position.covariance;
        let floor = Matrix3::identity() * (1e-18 + 1e-12 * s.trace());
        (s + floor).cholesky().is_some_and(|s| step.dot(&s.solve(&step)) <= self.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Covariance6, Transform, UncertainPoint};

    fn cloud(places: &[[f64; 3]], sigma: f64) -> Vec<MeasuredPoint> {
        places
            .iter()
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(Point::from(*at), sigma), pixels: None })
            .collect()
    }

    fn one_point(at: [f64; 3]) -> Vec<ModelPoint> {
        vec![ModelPoint::exact("P", Point::from(at))]
    }

    fn boxed(half: f64) -> Prior {
        Prior { object_from_camera: Transform::identity(), bound: PriorBound::Box(half) }
    }

    #[test]
    fn the_faces_of_the_box_belong_to_it() {
        let model = one_point([0.0, 0.0, 2.0]);
        let cloud = cloud(&[[0.25, -0.25, 2.25], [0.25 + 1e-9, 0.0, 2.0], [0.0, 0.0, 2.0]], 0.0);
        let found = candidates(&model, &cloud, Some(&boxed(0.25)), &Gate::default(), None);
        assert_eq!(found.lists, [vec![0, 2]]);
        assert_eq!((found.pairs(), found.with_candidates()), (2, 1));
    }

    #[test]
    fn a_cloud_of_more_points_than_a_word_has_bits_is_searched_completely() {
        let model = one_point([0.0, 0.0, 2.0]);
        let places: Vec<[f64; 3]> = (0..150).map(|j| [0.01 * f64::from(j % 65) - 0.6, 0.0, 2.0]).collect();
        let found = candidates(&model, &cloud(&places, 0.0), Some(&boxed(0.0301)), &Gate::default(), None);
        assert_eq!(found.lists, [(0..150).filter(|j| (57..=63).contains(&(j % 65))).collect::<Vec<_>>()]);
    }

    #[test]
    fn the_lists_grow_with_the_box() {
        let model = one_point([0.0, 0.0, 2.0]);
        let cloud = cloud(&[[0.1, 0.0, 2.0], [0.0, 0.3, 2.0], [0.0, 0.0, 2.7]], 0.0);
        for (half, expected) in [(0.05, 0), (0.1, 1), (0.3, 2), (0.8, 3)] {
            let found = candidates(&model, &cloud, Some(&boxed(half)), &Gate::default(), None);
            assert_eq!(found.pairs(), expected, "half-size {half}");
        }
    }

    #[test]
    fn a_gaussian_prior_gates_by_its_covariance() {
        // 0.01 rad about y at 2 m depth moves the point 0.02 m along x; position 0.03 m, cloud 0.04 m, model 0.12 m.
        let model = vec![ModelPoint { sigma: 0.12, ..one_point([0.0, 0.0, 2.0])[0].clone() }];
        let bound = PriorBound::Gaussian(Covariance6::isotropic(0.01, 0.03));
        let prior = Prior { object_from_camera: Transform::identity(), bound };
        let along = |axis: usize, variance: f64, limit: f64| {
            let edge = (variance * limit).sqrt();
            let mut places = [[0.0, 0.0, 2.0]; 2];
            places[0][axis] += edge * (1.0 - 1e-6);
            places[1][axis] += edge * (1.0 + 1e-6);
            candidates(&model, &cloud(&places, 0.04), Some(&prior), &Gate::ChiSquare(0.99), None).lists
        };
        let base = 0.03f64.powi(2) + 0.04f64.powi(2) + 0.12f64.powi(2);
        let limit = chi_square(3, 0.99);
        assert!((limit - 11.345).abs() < 1e-3);
        assert_eq!(along(0, base + 0.02f64.powi(2), limit), [vec![0]]);
        assert_eq!(along(2, base, limit), [vec![0]], "attitude does not affect depth");
        let faithful = candidates(&model, &cloud(&[[0.2, 0.0, 2.0]], 0.04), Some(&prior), &Gate::Box(0.2), None);
        assert_eq!(faithful.lists, [vec![0]]);
    }

    #[test]
    fn without_a_prior_every_point_is_a_candidate_of_what_is_in_view() {
        let model = [one_point([0.0, 0.0, 2.0]), one_point([1.0, 0.0, 2.0])].concat();
        let cloud = cloud(&[[0.0; 3]; 2], 0.01);
        let found = candidates(&model, &cloud, None, &Gate::default(), Some(&[false, true]));
        assert_eq!(found.lists, [vec![], vec![0, 1]]);
        assert_eq!(candidates(&model, &cloud, None, &Gate::default(), None), Candidates::all(2, 2));
    }

    #[test]
    fn a_gate_is_written_in_toml() {
        #[derive(Debug, PartialEq, Serialize, Deserialize, Settings)]
        struct Stage {
            /// The gate.
            gate: Gate,
        }
        let read: Stage = toml::from_str("gate = { chi-square = 0.95 }").unwrap();
        assert_eq!(read.gate, Gate::ChiSquare(0.95));
        let text = toml::to_string(&Stage { gate: Gate::Box(0.25) }).unwrap();
        assert_eq!(toml::from_str::<Stage>(&text).unwrap().gate, Gate::Box(0.25));
        assert!(Gate::Box(-1.0).check().is_err() && Gate::ChiSquare(1.0).check().is_err() && read.gate.check().is_ok());
        assert!(Gate::Box(f64::NAN).check().is_err() && Gate::ChiSquare(f64::NAN).check().is_err());
    }

    #[test]
    fn the_default_gate_is_the_ellipsoid_of_99_percent() {
        assert_eq!(Gate::default(), Gate::ChiSquare(0.99));
        assert!(Gate::default().check().is_ok());
    }

    #[test]
    fn the_limits_of_a_gate_are_open() {
        for (gate, fits) in [
            (Gate::Box(0.0), false),
            (Gate::Box(f64::INFINITY), false),
            (Gate::Box(f64::MIN_POSITIVE), true),
            (Gate::ChiSquare(0.0), false),
            (Gate::ChiSquare(1.0), false),
            (Gate::ChiSquare(1e-9), true),
            (Gate::ChiSquare(0.999_999), true),
        ] {
            assert_eq!(gate.check().is_ok(), fits, "{gate:?}");
        }
        let message = Gate::Box(-1.0).check().unwrap_err();
        assert_eq!(message, "gate: box = -1; give a positive half-size in metres");
        let message = Gate::ChiSquare(1.0).check().unwrap_err();
        assert_eq!(message, "gate: chi-square = 1; give a confidence between 0 and 1");
    }

    /// The reference values are those of `scipy.stats.chi2.ppf(confidence, dof)`; χ²₂ is the exponential distribution
    /// with quantile −2 ln(1 − p). The arguments alternate to expose a cached value of other arguments.
    #[test]
    fn quantiles_of_chi_square_are_those_of_the_table() {
        let table = [
            (1, 0.95, 3.841_458_820_694_124),
            (1, 0.999, 10.827_566_170_662_733),
            (3, 0.95, 7.814_727_903_251_179),
            (3, 0.99, 11.344_866_730_144_373),
            (3, 0.999, 16.266_236_196_238_13),
            (6, 0.999, 22.457_744_484_825_323),
            (9, 0.999, 27.877_164_871_256_568),
            (2, 0.99, 9.210_340_371_976_182),
        ];
        for _ in 0..3 {
            for (dof, confidence, quantile) in table {
                let found = chi_square(dof, confidence);
                assert!((found / quantile - 1.0).abs() < 1e-9, "{dof}, {confidence}: {found}");
            }
        }
        // More arguments than the cache holds.
        for round in 0..2 {
            for k in 1..200 {
                let confidence = f64::from(k) / 200.0;
                let expected = -2.0 * (1.0 - confidence).ln();
                let found = chi_square(2, confidence);
                assert!((found / expected - 1.0).abs() < 1e-6, "round {round}, {confidence}: {found}");
            }
        }
    }

    #[test]
    fn lists_hold_each_candidate_once_in_order() {
        let lists = Candidates::from_pairs(3, [(0, 4), (2, 1), (0, 2), (0, 4), (2, 0)]);
        assert_eq!(lists.lists, [vec![2, 4], vec![], vec![0, 1]]);
        assert_eq!((lists.pairs(), lists.with_candidates()), (4, 2));
        assert_eq!(Candidates::all(2, 3).lists, [vec![0, 1, 2], vec![0, 1, 2]]);
    }

    /// Without noise the gate's standard deviation is 1 nm; along an exact axis beside an uncertain one it is 1e-6 of
    /// the uncertainty.
    #[test]
    fn a_place_that_is_known_exactly_admits_what_lies_there() {
        let bound = PriorBound::Gaussian(Covariance6::isotropic(0.0, 0.0));
        let prior = Prior { object_from_camera: Transform::identity(), bound };
        let places = [[0.0, 0.0, 2.0], [3e-9, 0.0, 2.0], [4e-9, 0.0, 2.0], [0.0, 0.0, 2.001]];
        let found = candidates(&one_point([0.0, 0.0, 2.0]), &cloud(&places, 0.0), Some(&prior), &Gate::default(), None);
        // √11.345 nm = 3.37 nm.
        assert_eq!(found.lists, [vec![0, 1]]);
        // The x axis has σ = 1 m, the other axes zero: the semi-axes are 3.37 m and 3.37 µm.
        let mut wide = Covariance6::<seafix_geometry::Object, Camera>::isotropic(0.0, 0.0);
        wide.matrix[(3, 3)] = 1.0;
        let prior = Prior { object_from_camera: Transform::identity(), bound: PriorBound::Gaussian(wide) };
        let places = [[3.3, 0.0, 2.0], [3.4, 0.0, 2.0], [0.0, 3.3e-6, 2.0], [0.0, 3.4e-6, 2.0]];
        let found = candidates(&one_point([0.0, 0.0, 2.0]), &cloud(&places, 0.0), Some(&prior), &Gate::default(), None);
        assert_eq!(found.lists, [vec![0, 2]]);
    }

    /// A mask shorter than the model hides the points beyond its end.
    #[test]
    fn what_no_mask_names_is_not_in_view() {
        let model = [one_point([0.0, 0.0, 2.0]), one_point([0.0, 0.0, 2.0])].concat();
        let places = cloud(&[[0.0, 0.0, 2.0]], 0.01);
        let found = candidates(&model, &places, Some(&boxed(0.1)), &Gate::default(), Some(&[true]));
        assert_eq!(found.lists, [vec![0], vec![]]);
    }
}
