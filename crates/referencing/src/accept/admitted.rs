//! The model points that a measured point may be under another assignment.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::judge::Judge;
use crate::{
    a_contrario::coordinates::shuffled,
    chi_square::chi_square,
    problem::{Correspondence, PriorBound},
};

/// Tolerance at the edge of a box prior, in standard deviations of the measurement.
const BOX_EDGE: f64 = 4.0;
/// Confidences at the edge of a Gaussian prior: outside the first ellipsoid and inside the second.
const GAUSSIAN_EDGE: [f64; 2] = [0.9, 0.9999];

/// The position of a measured point relative to the gate of a model point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GatePosition {
    Inside,
    /// Outside, but within the tolerance for noise.
    Edge,
    Outside,
}

/// Maximum number of model points for which proposed labels are questioned; another assignment requires n² pairs of
/// model points.
const MAX_MISLABELED: usize = 100;

/// The model points that each measured point of a set may be.
pub(super) struct Admitted {
    /// The model points by the index of the measured point in the cloud.
    pub(super) models: BTreeMap<usize, Vec<usize>>,
    /// Whether a source other than the prior proposed the candidates; labels may then be mistaken.
    pub(super) proposed: bool,
}

impl Judge<'_> {
    /// The admissible model points of each measured point of a set: candidates, and those that a prior barely excludes.
    ///
    /// One point outside its gate by noise does not exclude a pose that the complete prior allows. If a source other
    /// than the prior proposed the candidates, every model point that the prior allows is admitted, since the proposer
    /// may confuse similar points.
    pub(super) fn admitted(&self, pairs: &[Correspondence]) -> Admitted {
        let lists = &self.problem.candidates.lists;
        let camera_from_object = self.problem.prior.map(|prior| prior.object_from_camera.inverse());
        let places: Vec<_> =
            self.problem.model.iter().filter_map(|point| Some(camera_from_object? * point.at)).collect();
        let [near, far] = GAUSSIAN_EDGE.map(|confidence| chi_square(3, confidence));
        let place_of = |model: usize, cloud: usize| {
            let (Some(prior), Some(place)) = (self.problem.prior, places.get(model)) else {
                return GatePosition::Outside;
            };
            let (seen, known) = (&self.problem.cloud[cloud].position, &self.problem.model[model]);
            let step = seen.at - *place;
            let noise = seen.covariance + Matrix3::identity() * (known.sigma * known.sigma);
            let (inside, edge) = match &prior.bound {
                PriorBound::Box(half) => {
                    let edge = |axis: usize| half + BOX_EDGE * noise[(axis, axis)].max(0.0).sqrt();
                    (step.amax() <= *half, (0..3).all(|axis| step[axis].abs() <= edge(axis)))
                }
                PriorBound::Gaussian(covariance) => {
                    let spread = (covariance.of_point(place) + noise).cholesky();
                    let chi2 = spread.map_or(f64::INFINITY, |spread| step.dot(&spread.solve(&step)));
                    (chi2 <= near, chi2 <= far)
                }
            };
            match (inside, edge) {
                (true, _) => GatePosition::Inside,
                (false, true) => GatePosition::Edge,
                (false, false) => GatePosition::Outside,
            }
        };
        let listed = |model: usize, cloud: usize| lists[model].binary_search(&cloud).is_ok();
        // There are no gates without a prior.
        let gates = places.len();
        let by_gates = |cloud: usize| (cloud, (0..gates).map(|model| place_of(model, cloud)).collect());
        let placed: Vec<(usize, Vec<GatePosition>)> = pairs.iter().map(|pair| by_gates(pair.cloud)).collect();
        // A gate with a point that is no candidate shows that another source proposed the candidates.
        let proposed = shuffled(self.problem)
            || placed.iter().any(|(cloud, places)| {
                let mut inside = (0..gates).filter(|&model| places[model] == GatePosition::Inside);
                inside.any(|model| !lists[model].is_empty() && !listed(model, *cloud))
            });
        if proposed && self.problem.model.len() > MAX_MISLABELED {
            return Admitted { models: listing(lists, pairs), proposed };
        }
        let of = |(cloud, places): (usize, Vec<GatePosition>)| {
            let allowed = |model: usize| match proposed {
                true => places.get(model) != Some(&GatePosition::Outside),
                false => places.get(model) == Some(&GatePosition::Edge),
            };
            (cloud, (0..lists.len()).filter(|&model| allowed(model) || listed(model, cloud)).collect())
        };
        Admitted { models: placed.into_iter().map(of).collect(), proposed }
    }
}

/// The model points that list each measured point of a set as a candidate.
fn listing(lists: &[Vec<usize>], pairs: &[Correspondence]) -> BTreeMap<usize, Vec<usize>> {
    let mut models: BTreeMap<usize, Vec<usize>> = pairs.iter().map(|pair| (pair.cloud, Vec::new())).collect();
    for (model, list) in lists.iter().enumerate() {
        for cloud in list {
            if let Some(models) = models.get_mut(cloud) {
                models.push(model);
            }
        }
    }
    models
}
