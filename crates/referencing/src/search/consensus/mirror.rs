//! The mirror image of the object as an alternative to a pose.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::{
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    local_maxima::Climb,
    motion::Motion,
    places::Places,
    prior_terms::PriorTerms,
};
use crate::site::model::ModelPoint;

/// Minimum evidence (nats) of an image over the pose, since a planar object is its own image.
const MARGIN: f64 = 3.0;
/// Number of standard deviations by which an image must fit the common pairs better (see [`beyond_noise`]).
const SIGMAS: f64 = 3.0;
/// Limits of the reflected triples: number of members, number of triples, and number of pairs for each triple.
const SPREAD: usize = 10;
const MAX_THREES: usize = 64;
const PAIRS_A_THREE: usize = 8;

/// The mirror image of the model that shares a planar part with the mode, if it has more evidence.
///
/// Such a mode is the remainder of that image and no pose of the object. The model is reflected in the best-fitting
/// plane of its members, and in the planes of some of their triples, since one of the members may not belong to the
/// image. From the reflection with most fitting pairs, pairs are chosen and the motion is fitted as for any pose. The
/// prior gives no information on images: both are weighed without it.
pub(in crate::search) fn mirror_image(
    model: &[ModelPoint],
    (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
    mode: &Mode,
) -> Option<Mode> {
    let prior_terms =
        PriorTerms { known: None, centroid: prior_terms.centroid, ln_peak: prior_terms.ln_peak, parts: None };
    let taken = BTreeSet::new();
    let climb = Climb::new(model, (terms, &prior_terms, graph), &taken);
    let count = mode.members.len() as f64;
    let centre = mode.members.iter().map(|&v| terms.pairs[v].model).sum::<Vector3<f64>>() / count;
    let step = |v: &usize| terms.pairs[*v].model - centre;
    let spread: Matrix3<f64> = mode.members.iter().map(|v| step(v) * step(v).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let own = climb.from(&mode.members, &mode.motion, f64::NEG_INFINITY, |_| false)?;
    let image = |members: &[usize], motion: &Motion| {
        let image = climb.from(members, motion, f64::NEG_INFINITY, |_| false)?;
        (image.ln_evidence > own.ln_evidence + MARGIN + beyond_noise(terms, &own, &image)).then_some(image)
    };
    let of_all = reflected(&mode.motion, &centre, &normal);
    image(&mode.members, &of_all).or_else(|| {
        let max = (graph.vertices.len() / PAIRS_A_THREE).clamp(1, MAX_THREES);
        let places = Places::of(terms);
        let mut largest: Option<(Vec<usize>, Motion)> = None;
        for three in threes(&mode.members, max) {
            let model = three.map(|v| &terms.pairs[v].model);
            let normal = (model[1] - model[0]).cross(&(model[2] - model[0]));
            let motion = Motion::of_three(model, three.map(|v| &terms.pairs[v].cloud)).zip(normal.try_normalize(0.0));
            let Some(motion) = motion.map(|(motion, normal)| reflected(&motion, model[0], &normal)) else { continue };
            let known = largest.as_ref().map_or(mode.members.len(), |(members, _)| members.len());
            largest = places.near(terms, graph, &motion, known).map(|members| (members, motion)).or(largest);
        }
        largest.and_then(|(members, motion)| image(&members, &motion))
    })
}

/// The evidence (nats) by which an image of a planar set may exceed the pose by noise.
///
/// A planar set is its own image. The noise of model and cloud across the plane adds up for one of them and cancels for
/// the other: each common pair contributes d_i to the difference of evidence, with either sign equally probable, so
/// that the standard deviation of their sum is √Σ d_i². Pairs of which the plane contains the model point have d_i = 0,
/// as the planar remainder of a true image has.
fn beyond_noise(terms: &PairTerms, own: &Mode, image: &Mode) -> f64 {
    let common = own.members.iter().filter(|&&v| image.holds(v));
    let off = |v: &usize| terms.residual_gain(*v, &image.motion) - terms.residual_gain(*v, &own.motion);
    SIGMAS * common.map(|v| off(v).powi(2)).sum::<f64>().sqrt()
}

/// A motion preceded by the reflection of the model in the plane through a point with this normal.
fn reflected(motion: &Motion, through: &Vector3<f64>, normal: &Vector3<f64>) -> Motion {
    let rotation = motion.rotation * (Matrix3::identity() - normal * normal.transpose() * 2.0);
    Motion { rotation, translation: motion.apply(through) - rotation * through }
}

/// At most `max` triples of the members, evenly spread.
fn threes(members: &[usize], max: usize) -> impl Iterator<Item = [usize; 3]> {
    let some: Vec<usize> = members.iter().copied().step_by(members.len().div_ceil(SPREAD).max(1)).collect();
    let k = some.len();
    let of = |a: usize| (a + 1..k).flat_map(move |b| (b + 1..k).map(move |c| [a, b, c]));
    let all: Vec<[usize; 3]> = (0..k).flat_map(of).map(|three| three.map(|i| some[i])).collect();
    let step = all.len().div_ceil(max).max(1);
    all.into_iter().step_by(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threes_are_spread_over_the_members() {
        let of = |k: usize, max: usize| threes(&(0..k).map(|v| 2 * v).collect::<Vec<_>>(), max).collect::<Vec<_>>();
        assert!(of(2, 64).is_empty());
        assert_eq!(of(4, 64), [[0, 2, 4], [0, 2, 6], [0, 4, 6], [2, 4, 6]]);
        assert_eq!(of(4, 2), [[0, 2, 4], [0, 4, 6]]);
        // Every third of thirty members, and every other of their 120 triples.
        let some = of(30, 64);
        assert_eq!((some.len(), some[0], some[59]), (60, [0, 6, 12], [36, 48, 54]));
    }
}
