//! Maximum admissible sets by complete enumeration: the reference for searches.
//!
//! Distances, tolerances and volumes are implemented independently here, without regard to speed.
//!
//! The tests of `seafix-referencing` have another brute force, for one search and in many cases. This one is
//! independent on purpose: all laws of searches rest on the definition of an admissible set, and two implementations do
//! not share a misreading. It also states the defect of a set that is not admissible, and detects cases that rounding
//! decides.

use nalgebra::Vector3;
use seafix_referencing::{Correspondence, Problem, Tolerance};

/// Margin of a bound: rounding decides a difference (m) or a volume (m³) that is nearer to its bound.
const ROUNDING: f64 = 1e-12;

/// The admissible sets of maximum size.
#[derive(Debug, Clone, Default)]
pub struct Largest {
    /// Their common size.
    pub size: usize,
    /// The sets, each in the order of the model points.
    pub sets: Vec<Vec<Correspondence>>,
    /// Whether rounding decided a test; the result is then no reference.
    pub doubtful: bool,
}

/// Finds the maximum coherent, one-to-one sets of candidate pairs; with `orientation`, sets without four pairs of a
/// mirror image.
pub fn largest(problem: &Problem<'_>, orientation: bool) -> Largest {
    let mut largest = Largest::default();
    extend(problem, orientation, 0, &mut Vec::new(), &mut largest);
    largest
}

/// Tries each candidate of model point `i`, and none.
fn extend(problem: &Problem<'_>, orientation: bool, i: usize, set: &mut Vec<Correspondence>, largest: &mut Largest) {
    if i == problem.model.len() {
        if set.len() > largest.size {
            (largest.size, largest.sets) = (set.len(), Vec::new());
        }
        if set.len() == largest.size && !set.is_empty() {
            largest.sets.push(set.clone());
        }
        return;
    }
    for &j in &problem.candidates.lists[i] {
        let pair = Correspondence { model: i, cloud: j };
        let coherent = set.iter().all(|&other| {
            if other.cloud == j {
                return false;
            }
            largest.doubtful |= (difference(problem, other, pair) - tolerance(problem, other, pair)).abs() < ROUNDING;
            coherent(problem, other, pair)
        });
        let mirrored = orientation
            && coherent
            && threes(set).any(|[a, b, c]| {
                largest.doubtful |= doubtful(problem, [a, b, c, pair]);
                is_mirrored(problem, [a, b, c, pair])
            });
        if coherent && !mirrored {
            set.push(pair);
            extend(problem, orientation, i + 1, set, largest);
            set.pop();
        }
    }
    extend(problem, orientation, i + 1, set, largest);
}

/// The reason why a set is not admissible; `None` for an admissible set.
pub fn objection(problem: &Problem<'_>, orientation: bool, set: &[Correspondence]) -> Option<String> {
    for (k, &a) in set.iter().enumerate() {
        if !problem.candidates.lists[a.model].contains(&a.cloud) {
            return Some(format!("{a:?} is no candidate"));
        }
        for &b in &set[..k] {
            if a.model == b.model || a.cloud == b.cloud {
                return Some(format!("{a:?} and {b:?} share a point"));
            }
            let (difference, tolerance) = (difference(problem, a, b), tolerance(problem, a, b));
            if !(difference <= tolerance) {
                return Some(format!("{a:?} and {b:?} differ by {difference:e}, more than {tolerance:e}"));
            }
        }
    }
    let quadruples = set.iter().enumerate().flat_map(|(k, &d)| threes(&set[..k]).map(move |[a, b, c]| [a, b, c, d]));
    let four = quadruples.filter(|_| orientation).find(|&four| is_mirrored(problem, four) && !doubtful(problem, four));
    four.map(|four| format!("{four:?} are a mirror image"))
}

/// The difference of distances | |P_a P_b| − |C_a C_b| | (m).
pub fn difference(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> f64 {
    let length = |v: Vector3<f64>| (v.x * v.x + v.y * v.y + v.z * v.z).sqrt();
    let known = length(model(problem, b) - model(problem, a));
    let measured = length(cloud(problem, b) - cloud(problem, a));
    (known - measured).abs()
}

/// The tolerance Δ of two pairs (m).
pub fn tolerance(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> f64 {
    match problem.tolerance {
        Tolerance::Fixed(delta) => delta,
        Tolerance::Sigmas(k) => {
            let step = cloud(problem, b) - cloud(problem, a);
            let variance: f64 = [a, b]
                .iter()
                .map(|pair| {
                    // The variance along the step; along z for coincident measured points.
                    let n = if step == Vector3::zeros() { Vector3::z() } else { step / step.norm() };
                    let s = problem.cloud[pair.cloud].position.covariance;
                    (n.transpose() * s * n).x + problem.model[pair.model].sigma * problem.model[pair.model].sigma
                })
                .sum();
            k * variance.sqrt()
        }
    }
}

fn coherent(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> bool {
    difference(problem, a, b) <= tolerance(problem, a, b)
}

/// Whether the model's volume exceeds three standard deviations of the measured one, with the opposite sign.
pub fn is_mirrored(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let (known, measured, limit) = volumes(problem, four);
    known.abs() > limit && known * measured <= 0.0
}

/// The model's volume (m³), the measured one, and the threshold of the model's for a decision.
fn volumes(problem: &Problem<'_>, four: [Correspondence; 4]) -> (f64, f64, f64) {
    let volume = |p: [Vector3<f64>; 4]| (p[1] - p[0]).cross(&(p[2] - p[0])).dot(&(p[3] - p[0])) / 6.0;
    let known = volume(four.map(|pair| model(problem, pair)));
    let seen = four.map(|pair| cloud(problem, pair));
    let measured = volume(seen);
    // The volume is linear in each coordinate: its derivative is the difference over one metre.
    let variance: f64 = (0..4)
        .map(|k| {
            let by = |axis| {
                let mut moved = seen;
                moved[k][axis] += 1.0;
                volume(moved) - measured
            };
            let gradient = Vector3::new(by(0), by(1), by(2));
            (gradient.transpose() * problem.cloud[four[k].cloud].position.covariance * gradient).x
        })
        .sum();
    (known, measured, 3.0 * variance.sqrt() + ROUNDING)
}

/// Whether rounding decides if four pairs are a mirror image.
fn doubtful(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let (known, measured, limit) = volumes(problem, four);
    let edge = known.abs() > ROUNDING / 100.0 && (known.abs() - limit).abs() < 4.0 * ROUNDING;
    edge || (known.abs() > limit && measured.abs() < ROUNDING)
}

/// All subsets of three.
fn threes(set: &[Correspondence]) -> impl Iterator<Item = [Correspondence; 3]> + '_ {
    let n = set.len();
    (0..n).flat_map(move |i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [set[i], set[j], set[k]])))
}

fn model(problem: &Problem<'_>, pair: Correspondence) -> Vector3<f64> {
    problem.model[pair.model].at.coords
}

fn cloud(problem: &Problem<'_>, pair: Correspondence) -> Vector3<f64> {
    problem.cloud[pair.cloud].position.at.coords
}
