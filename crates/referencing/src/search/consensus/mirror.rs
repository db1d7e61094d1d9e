//! The mirror image of the object as an alternative to a pose.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Matrix3, Vector3};

use super::{
    Motion,
    bits::ones,
    graph::ConsistencyGraph,
    likelihood::{Mode, Term, Terms},
    local_maxima::Climb,
    prior_terms::PriorTerms,
};
use crate::{
    ModelPoint,
    lanes::{LANES, packed},
};

/// Minimum evidence (nats) of an image over the pose, since a planar object is its own image.
const MARGIN: f64 = 3.0;
/// Limits of the reflected triples: number of members, number of triples, and number of pairs for each triple.
const SPREAD: usize = 10;
const MAX_THREES: usize = 64;
const PAIRS_A_THREE: usize = 8;
/// Gate about a motion from three noisy points (χ²₃).
const LOOSE: f64 = 50.0;

/// The mirror image of the model that shares a planar part with the mode, if it has more evidence.
///
/// Such a mode is the remainder of that image and no pose of the object. The model is reflected in the best-fitting
/// plane of its members, and in the planes of some of their triples, since one of the members may not belong to the
/// image. From the reflection with most fitting pairs, pairs are chosen and the motion is fitted as for any pose. The
/// prior gives no information on images: both are weighed without it.
pub(in crate::search) fn mirror_image(
    model: &[ModelPoint],
    (terms, prior_terms, graph): (&Terms, &PriorTerms, &ConsistencyGraph),
    mode: &Mode,
) -> Option<Mode> {
    let prior_terms =
        PriorTerms { known: None, centroid: prior_terms.centroid, ln_peak: prior_terms.ln_peak, parts: None };
    let taken = BTreeSet::new();
    let climb = Climb { model, terms, prior_terms: &prior_terms, graph, taken: &taken, compared: Cell::new(0) };
    let count = mode.members.len() as f64;
    let centre = mode.members.iter().map(|&v| terms.pairs[v].model).sum::<Vector3<f64>>() / count;
    let step = |v: &usize| terms.pairs[*v].model - centre;
    let spread: Matrix3<f64> = mode.members.iter().map(|v| step(v) * step(v).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let own = climb.from(&mode.members, &mode.motion, f64::NEG_INFINITY, |_| false)?;
    let image = |members: &[usize], motion: &Motion| {
        let image = climb.from(members, motion, f64::NEG_INFINITY, |_| false)?;
        (image.ln_evidence > own.ln_evidence + MARGIN).then_some(image)
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
            largest = near(terms, graph, &places, &motion, known).map(|members| (members, motion)).or(largest);
        }
        largest.and_then(|(members, motion)| image(&members, &motion))
    })
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

/// The best pair within the gate of each model point; `None` if they are not more than `more_than`.
fn near(
    terms: &Terms,
    graph: &ConsistencyGraph,
    places: &Places,
    motion: &Motion,
    more_than: usize,
) -> Option<Vec<usize>> {
    let mut within = Vec::new();
    within_reach(places, motion, &mut within);
    if within.iter().map(|word| word.count_ones() as usize).sum::<usize>() <= more_than {
        return None;
    }
    let mut best: Vec<(f64, usize)> = Vec::new();
    for v in ones(&within, 0) {
        let pair = &terms.pairs[v];
        let d2 = pair.distance(&(pair.cloud - motion.apply(&pair.model)));
        if !(d2 <= LOOSE) {
            continue;
        }
        match best.last_mut() {
            Some(last) if graph.rank[last.1] == graph.rank[v] => {
                if d2 < last.0 {
                    *last = (d2, v);
                }
            }
            _ => best.push((d2, v)),
        }
    }
    (best.len() > more_than).then(|| best.into_iter().map(|(_, v)| v).collect())
}

/// The pairs' coordinates in model and cloud by axis, with their squared gates (m²) about a motion.
///
/// The columns are padded to complete words with entries that are within reach of nothing.
struct Places {
    at: [Vec<f64>; 6],
    reach2: Vec<f64>,
}

impl Places {
    fn of(terms: &Terms) -> Self {
        let full = terms.pairs.len().next_multiple_of(LANES);
        let filled = |value: &dyn Fn(&Term) -> f64| {
            let mut column: Vec<f64> = terms.pairs.iter().map(value).collect();
            column.resize(full, f64::NAN);
            column
        };
        // χ² is at least that of the greatest variance.
        Self {
            at: std::array::from_fn(|axis| {
                filled(&|pair| if axis < 3 { pair.model[axis] } else { pair.cloud[axis - 3] })
            }),
            reach2: filled(&|pair| LOOSE * pair.variance),
        }
    }
}

/// The pairs within reach of a motion, one bit each.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn within_reach(places: &Places, motion: &Motion, within: &mut Vec<u64>) {
    let [mx, my, mz, cx, cy, cz] = places.at.each_ref().map(|column| column.as_chunks::<LANES>().0);
    let (r, t) = (&motion.rotation, &motion.translation);
    for (word, reach2) in places.reach2.as_chunks::<LANES>().0.iter().enumerate() {
        let (mx, my, mz, cx, cy, cz) = (&mx[word], &my[word], &mz[word], &cx[word], &cy[word], &cz[word]);
        let mut near = [0u8; LANES];
        for k in 0..LANES {
            let off = |row: usize, measured: f64| {
                measured - (r[(row, 0)] * mx[k] + r[(row, 1)] * my[k] + r[(row, 2)] * mz[k] + t[row])
            };
            let (x, y, z) = (off(0, cx[k]), off(1, cy[k]), off(2, cz[k]));
            near[k] = u8::from(x * x + y * y + z * z <= reach2[k]);
        }
        within.push(packed(&near));
    }
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
