//! Mirror images: four points and their reflection have the same distances, but volumes of opposite sign.

use nalgebra::Vector3;

use crate::{Correspondence, Problem};

/// Standard deviations by which a model volume must exceed the noise of the measured one to decide.
const DECISIVE: f64 = 3.0;
/// Volumes below this share of the product of three edges are zero but for rounding.
const ROUNDING: f64 = 1e-12;

/// Whether four pairs are a mirror image: the volume V of the model's tetrahedron is beyond 3 σ of the
/// measured one's noise, and the measured volume has not its sign.
///
/// 6V = (b − a) · ((c − a) × (d − a)); σ² = Σ_k g_kᵀ Σ_k g_k over the four measured points, g_k the
/// derivative of the measured volume by point k.
pub(crate) fn mirrored(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let model = four.map(|pair| problem.model[pair.model].at.coords);
    let cloud = four.map(|pair| problem.cloud[pair.cloud].position.at.coords);
    let (known, measured) = (volume(&model), volume(&cloud));
    // Almost every question ends here: the noise is looked at only where the signs differ.
    if known * measured > 0.0 {
        return false;
    }
    decisive(problem, &four, &model, &cloud, known)
}

/// Whether the model's volume is large enough to tell an image from its reflection.
fn decisive(
    problem: &Problem<'_>,
    four: &[Correspondence; 4],
    model: &[Vector3<f64>; 4],
    cloud: &[Vector3<f64>; 4],
    known: f64,
) -> bool {
    let [a, b, c, d] = cloud;
    let gradients =
        [(d - b).cross(&(c - b)), (c - a).cross(&(d - a)), (d - a).cross(&(b - a)), (b - a).cross(&(c - a))];
    let variance: f64 = four
        .iter()
        .zip(gradients)
        .map(|(pair, g)| g.dot(&(problem.cloud[pair.cloud].position.covariance * g)) / 36.0)
        .sum();
    let edges = (model[1] - model[0]).norm() * (model[2] - model[0]).norm() * (model[3] - model[0]).norm();
    known.abs() > DECISIVE * variance.max(0.0).sqrt() + ROUNDING * edges
}

fn volume([a, b, c, d]: &[Vector3<f64>; 4]) -> f64 {
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

/// Whether every decisive four of the set are a mirror image, and there is one.
pub(crate) fn wholly_mirrored(problem: &Problem<'_>, set: &[Correspondence]) -> bool {
    let mut some = false;
    for four in fours(set) {
        let model = four.map(|pair| problem.model[pair.model].at.coords);
        let cloud = four.map(|pair| problem.cloud[pair.cloud].position.at.coords);
        let known = volume(&model);
        if decisive(problem, &four, &model, &cloud, known) {
            if known * volume(&cloud) > 0.0 {
                return false;
            }
            some = true;
        }
    }
    some
}

/// All subsets of four.
pub(crate) fn fours(set: &[Correspondence]) -> impl Iterator<Item = [Correspondence; 4]> + '_ {
    let n = set.len();
    (0..n).flat_map(move |i| {
        (i + 1..n)
            .flat_map(move |j| (j + 1..n).flat_map(move |k| (k + 1..n).map(move |l| [set[i], set[j], set[k], set[l]])))
    })
}
