//! Which model points a measured point may be when a set is read otherwise.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::judge::Judge;
use crate::{Correspondence, PriorBound, a_contrario::shuffled, candidates::chi_square};

/// A point of a reading may lie so many standard deviations of its measurement outside a box;
const BOX_EDGE: f64 = 4.0;
/// of a Gaussian prior outside the ellipsoid of the lesser and inside that of the greater of these confidences.
const GAUSSIAN_EDGE: [f64; 2] = [0.9, 0.9999];

/// Where a measured point lies by the shell of a model point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GatePosition {
    Inside,
    /// Outside, by no more than noise may do.
    Edge,
    Outside,
}

/// Of larger models proposed pairs are taken at their word: to read them otherwise takes n² pairs of model points.
const MAX_MISLABELED: usize = 100;

/// The model points that each measured point of a set may be.
pub(super) struct Admitted {
    /// Of each measured point, by its number in the cloud.
    pub(super) models: BTreeMap<usize, Vec<usize>>,
    /// Whether candidates were proposed by more than a prior, so that the model points may be others than those proposed.
    pub(super) proposed: bool,
}

impl Judge<'_> {
    /// The model points that each measured point of a set may be: its candidates, and those that a prior only just excludes. That
    /// one of many points falls outside its shell by its noise does not exclude a pose that the prior as a whole allows. Where
    /// candidates were proposed by more than a prior, all that it allows: what proposes may mistake a point for its like.
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
        // Without a prior there are no shells.
        let gates = places.len();
        let by_gates = |cloud: usize| (cloud, (0..gates).map(|model| place_of(model, cloud)).collect());
        let placed: Vec<(usize, Vec<GatePosition>)> = pairs.iter().map(|pair| by_gates(pair.cloud)).collect();
        // Where a shell holds what is no candidate, the candidates were proposed by more than the prior.
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

/// The model points that list each measured point of a set.
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
