//! Mirror images: four points and their reflection have equal distances, but volumes of opposite sign.

use nalgebra::Vector3;

use super::volumes::Volumes;
use crate::problem::{Correspondence, Problem};

/// Standard deviations of the measured volume that a model volume must exceed to decide.
const DECISIVE: f64 = 3.0;
/// Volume, as a fraction of the product of three edges, below which it is zero up to rounding.
const ROUNDING: f64 = 1e-12;

/// Whether four pairs are a mirror image.
///
/// The volume V of the model's tetrahedron exceeds 3 σ of the measured volume, which has the opposite sign: 6V = (b −
/// a) · ((c − a) × (d − a)); σ² = Σ_k g_kᵀ Σ_k g_k over the four measured points, g_k the derivative of the measured
/// volume by point k.
pub(crate) fn mirrored(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let model = four.map(|pair| problem.model[pair.model].at.coords);
    let cloud = four.map(|pair| problem.cloud[pair.cloud].position.at.coords);
    let (known, measured) = (volume(&model), volume(&cloud));
    // Almost every test ends here: the noise is computed only if the signs differ.
    if agree(known, measured, &cloud) {
        return false;
    }
    decisive(problem, &four, &model, &cloud, known)
}

/// Whether the measured volume has the sign of the known one; the volume of coplanar points is rounding error.
fn agree(known: f64, measured: f64, cloud: &[Vector3<f64>; 4]) -> bool {
    known * measured > 0.0 && measured.abs() > ROUNDING * edges(cloud)
}

/// The required orientation of a set's quadruples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sense {
    /// Any: distances alone decide, as in the paper.
    Any,
    /// Not mirrored.
    Proper,
    /// Not upright: every decisive quadruple is a mirror image.
    Mirrored,
}

impl Sense {
    /// The sign of the product of a quadruple's volumes in model and cloud that agrees with the sense; `None` for any.
    pub(super) fn sign(self) -> Option<f64> {
        match self {
            Self::Any => None,
            Self::Proper => Some(1.0),
            Self::Mirrored => Some(-1.0),
        }
    }

    /// Whether four pairs contradict the sense.
    pub(crate) fn rejects(self, problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
        match self {
            Self::Any => false,
            Self::Proper => mirrored(problem, four),
            Self::Mirrored => upright(problem, four),
        }
    }
}

/// Whether four pairs are decisively no mirror image.
fn upright(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let model = four.map(|pair| problem.model[pair.model].at.coords);
    let cloud = four.map(|pair| problem.cloud[pair.cloud].position.at.coords);
    let known = volume(&model);
    agree(known, volume(&cloud), &cloud) && decisive(problem, &four, &model, &cloud, known)
}

/// Whether the model's volume is large enough to distinguish an image from its reflection.
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
    known.abs() > DECISIVE * variance.max(0.0).sqrt() + ROUNDING * edges(model)
}

/// The product of the three edges from the first point.
fn edges([a, b, c, d]: &[Vector3<f64>; 4]) -> f64 {
    (b - a).norm() * (c - a).norm() * (d - a).norm()
}

fn volume([a, b, c, d]: &[Vector3<f64>; 4]) -> f64 {
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

/// Whether every decisive quadruple of the set is a mirror image, and there is at least one.
pub(crate) fn wholly_mirrored(problem: &Problem<'_>, set: &[Correspondence]) -> bool {
    let mut some = false;
    for four in quadruples(set) {
        let model = four.map(|pair| problem.model[pair.model].at.coords);
        let cloud = four.map(|pair| problem.cloud[pair.cloud].position.at.coords);
        let known = volume(&model);
        if decisive(problem, &four, &model, &cloud, known) {
            if agree(known, volume(&cloud), &cloud) {
                return false;
            }
            some = true;
        }
    }
    some
}

/// All subsets of four.
pub(crate) fn quadruples(set: &[Correspondence]) -> impl Iterator<Item = [Correspondence; 4]> + '_ {
    let n = set.len();
    (0..n).flat_map(move |i| {
        (i + 1..n)
            .flat_map(move |j| (j + 1..n).flat_map(move |k| (k + 1..n).map(move |l| [set[i], set[j], set[k], set[l]])))
    })
}

/// The remainder of a large set without mirrored quadruples.
pub(crate) struct Unmirrored {
    pub(crate) pairs: Vec<Correspondence>,
    /// Whether every quadruple was tested.
    pub(crate) complete: bool,
    /// Number of quadruples tested.
    pub(crate) pair_tests: u64,
}

/// The set without the members of mirrored quadruples.
///
/// The member of most mirrored quadruples is dropped, among equals the last, until none is mirrored. Every quadruple is
/// tested if they are at most `max`. For a larger set, only quadruples with three members in a well-spread core are
/// tested: a mirrored member is mirrored with every distant triangle. The residuals of a rigid fit then test such a set
/// as a whole.
pub(crate) fn unmirrored(problem: &Problem<'_>, mut pairs: Vec<Correspondence>, max: u64) -> Unmirrored {
    let (mut complete, mut pair_tests) = (true, 0);
    loop {
        let all = choose(pairs.len(), 4) <= max;
        complete = complete && all;
        let core = if all { (0..pairs.len()).collect() } else { core(problem, &pairs, max) };
        let volumes = Volumes::of(problem, &pairs);
        let mut opposed: Vec<[u32; 4]> = Vec::new();
        'quadruples: for (place, &d) in core.iter().enumerate() {
            for (k, &c) in core[..place].iter().enumerate() {
                for (j, &b) in core[..k].iter().enumerate() {
                    let others = if all { &core[..j] } else { &[] };
                    let rest = if all { 0..0 } else { 0..pairs.len() };
                    let plane = volumes.plane([b, c, d]);
                    for a in others.iter().copied().chain(rest).filter(|a| ![b, c, d].contains(a)) {
                        pair_tests += 1;
                        if volumes.rejects(Sense::Proper, &plane, a) {
                            opposed.push([a, b, c, d].map(|i| i as u32));
                            if opposed.len() >= MAX_LISTED {
                                break 'quadruples;
                            }
                        }
                    }
                }
            }
        }
        if opposed.is_empty() {
            return Unmirrored { pairs, complete, pair_tests };
        }
        let mut dropped = vec![false; pairs.len()];
        while !opposed.is_empty() {
            let mut count = vec![0u32; pairs.len()];
            opposed.iter().flatten().for_each(|&i| count[i as usize] += 1);
            let worst = (0..pairs.len()).max_by_key(|&i| count[i]).expect("a quadruple has members");
            dropped[worst] = true;
            opposed.retain(|four| !four.contains(&(worst as u32)));
        }
        let mut place = 0..dropped.len();
        pairs.retain(|_| place.next().is_some_and(|i| !dropped[i]));
    }
}

/// Maximum number of mirrored quadruples listed before members are dropped (1.6 MB).
const MAX_LISTED: usize = 100_000;
/// Maximum number of members of the core of a set that is too large for a complete test.
const CORE: usize = 40;

/// The core of a set by farthest-point sampling in the model, from the first member on.
///
/// It has at most [`CORE`] members, and its triangles with all members are at most `max`.
fn core(problem: &Problem<'_>, pairs: &[Correspondence], max: u64) -> Vec<usize> {
    let at = |i: usize| problem.model[pairs[i].model].at;
    let mut taken = vec![0];
    let mut off: Vec<f64> = (0..pairs.len()).map(|i| at(i).distance(&at(0))).collect();
    while taken.len() < CORE && choose(taken.len() + 1, 3).saturating_mul(pairs.len() as u64) <= max {
        let next = (0..pairs.len()).max_by(|&i, &j| off[i].total_cmp(&off[j])).unwrap_or(0);
        if !(off[next] > 0.0) {
            break;
        }
        taken.push(next);
        off.iter_mut().enumerate().for_each(|(i, off)| *off = off.min(at(i).distance(&at(next))));
    }
    taken
}

/// C(n, k).
fn choose(n: usize, k: u64) -> u64 {
    (0..k).fold(1u64, |product, i| product.saturating_mul((n as u64).saturating_sub(i)) / (i + 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{candidates::Candidates, problem::Tolerance, site::model::ModelPoint};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    #[test]
    fn subsets_are_counted() {
        assert_eq!((choose(3, 4), choose(4, 4), choose(40, 3), choose(50, 4)), (0, 1, 9880, 230_300));
    }

    /// The remainder of 60 points, the last five of which lie on the wrong side of the plane z = 0.
    fn left(max: u64) -> Unmirrored {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let places: Vec<Vector3<f64>> = (0..60)
            .map(|i| {
                let z = if i < 55 { rng.random_range(-1.0..1.0) } else { rng.random_range(0.5..1.0) };
                Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), z)
            })
            .collect();
        let model: Vec<ModelPoint> = places.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let seen = places.iter().enumerate().map(|(i, at)| {
            let z = if i < 55 { at.z } else { -at.z };
            Point::new(at.x, at.y, z)
        });
        let cloud: Vec<MeasuredPoint> =
            seen.map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at, 0.001), pixels: None }).collect();
        let candidates = Candidates::from_pairs(60, (0..60).map(|i| (i, i)));
        let tolerance = Tolerance::Fixed(0.01);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let pairs: Vec<Correspondence> = (0..60).map(|i| Correspondence { model: i, cloud: i }).collect();
        unmirrored(&problem, pairs, max)
    }

    #[test]
    fn members_that_are_mirrored_are_dropped() {
        let kept = left(1_000_000);
        assert!(kept.complete && kept.pairs.len() >= 50 && kept.pairs.iter().all(|pair| pair.model < 55));
        assert!(kept.pair_tests >= choose(kept.pairs.len(), 4));
        let kept = left(100_000);
        assert!(!kept.complete && kept.pairs.len() >= 50, "{}", kept.pairs.len());
        assert!(kept.pairs.iter().all(|pair| pair.model < 55), "the core detects them too");
    }
}
