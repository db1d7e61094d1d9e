//! The largest admissible sets by plain enumeration: what searches are held against.
//!
//! Everything is written anew here, distances, tolerances and volumes included, with no eye to speed.
//!
//! The tests of `seafix-referencing` have a brute force of their own, for one search and in many cases.
//! This one is independent of it on purpose: the definition of an admissible set is what all laws of
//! searches rest on, and a misreading of it would have to be made twice. It also says what is wrong with
//! a set that is not admissible, and which cases rounding decides.

use nalgebra::Vector3;
use seafix_referencing::{Correspondence, Problem, Tolerance};

/// A difference nearer to its bound than this (m), or a volume nearer to its limit (m³), is decided
/// by rounding.
const ROUNDING: f64 = 1e-12;

/// All admissible sets of the largest size.
#[derive(Debug, Clone, Default)]
pub struct Largest {
    /// Their size.
    pub size: usize,
    /// The sets, each in the order of the model points.
    pub sets: Vec<Vec<Correspondence>>,
    /// Whether a test was so near its bound that rounding decided it: nothing can be held against this.
    pub doubtful: bool,
}

/// The largest sets of candidate pairs that are coherent and one-to-one and, with `orientation`, of
/// which no four are a mirror image.
pub fn largest(problem: &Problem<'_>, orientation: bool) -> Largest {
    let mut largest = Largest::default();
    extend(problem, orientation, 0, &mut Vec::new(), &mut largest);
    largest
}

/// Each candidate of model point `i` in turn, and none.
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

/// What keeps a set from being admissible; `None` if nothing does.
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

/// | |P_a P_b| − |C_a C_b| | (m).
pub fn difference(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> f64 {
    let length = |v: Vector3<f64>| (v.x * v.x + v.y * v.y + v.z * v.z).sqrt();
    let known = length(model(problem, b) - model(problem, a));
    let measured = length(cloud(problem, b) - cloud(problem, a));
    (known - measured).abs()
}

/// Δ of the two pairs (m).
pub fn tolerance(problem: &Problem<'_>, a: Correspondence, b: Correspondence) -> f64 {
    match problem.tolerance {
        Tolerance::Fixed(delta) => delta,
        Tolerance::Sigmas(k) => {
            let step = cloud(problem, b) - cloud(problem, a);
            let variance: f64 = [a, b]
                .iter()
                .map(|pair| {
                    // The variance along the step; along z where two measured points coincide.
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

/// Whether the model's volume exceeds three standard deviations of the measured one, and the two
/// have not the same sign.
pub fn is_mirrored(problem: &Problem<'_>, four: [Correspondence; 4]) -> bool {
    let (known, measured, limit) = volumes(problem, four);
    known.abs() > limit && known * measured <= 0.0
}

/// The model's volume (m³), the measured one, and what the model's must exceed to decide.
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

/// Whether rounding decides if the four are a mirror image.
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
