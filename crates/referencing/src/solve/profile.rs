//! How uncertain a weak attitude is where the likelihood is bent.

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform};

use super::descent::{Linearized, Term, linearize};
use crate::Observation;

/// Attitudes that are known to this (rad, three axes together) have a likelihood as straight as their noise: first order
/// stands.
const STRAIGHT: f64 = 0.02;
/// Turns that are known to this (rad) are straight by themselves.
const STIFF: f64 = 0.006;
/// Between two nodes of the quadrature (standard deviations by first order).
const STEP: f64 = 0.5;
/// Nodes to either side: twelve standard deviations.
const NODES: i32 = 24;
/// No turn goes further (rad).
const FARTHEST: f64 = 1.0;
/// A pose whose χ² is larger by this weighs nothing, and what lies beyond it is another valley.
const NOTHING: f64 = 25.0;
/// Nodes that are looked at to either side whatever lies between.
const MIN: i32 = 12;
/// Steps in which the other five coordinates follow a turn.
const FOLLOWS: usize = 3;

/// The covariance `first` with the part that belongs to the most uncertain turn taken from the likelihood itself.
///
/// With e an axis of the attitude's covariance, σ² = eᵀ Σ_φφ e and d = Σ (e, 0) / σ, first order says that χ² is larger by t² at
/// `at · Exp(t d)`. A small object far away is known by how much it is foreshortened, which changes with the square of its
/// tilt: its χ² is no parabola but a bent trough with a shoulder or another minimum on the side to which noise did not lead,
/// and what the likeliest pose says of the slope where it lies is not what the truth, farther along the trough, would say. The
/// profile likelihood L(t) is the greatest of all poses turned from `at` by t σ about e, ξ(t) the step to its pose. Of the three
/// axes that with the largest ∫ t² L / ∫ L replaces d dᵀ, what first order says of it, by ∫ ξ ξᵀ L / ∫ L: the second moment about
/// the answer, so that its bias is in it.
///
/// (Bates and Watts, *Nonlinear regression analysis and its applications*, 1988, chapter 6.)
pub(super) fn inflated(
    points: &[Observation],
    at: &Transform<Object, Camera>,
    first: Matrix6<f64>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Matrix6<f64> {
    let attitude = first.fixed_view::<3, 3>(0, 0).into_owned();
    if attitude.trace() <= STRAIGHT * STRAIGHT {
        return first;
    }
    let Ok(here) = linearize(points, at, term) else { return first };
    let eigen = attitude.symmetric_eigen();
    let mut max = (0.0, first);
    for (axis, variance) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
        if *variance <= STIFF * STIFF {
            continue;
        }
        let mut about = Vector6::zeros();
        about.fixed_rows_mut::<3>(0).copy_from(&axis);
        let along = first * about / variance.sqrt();
        let found = Trough::of(points, at, &here, &about, &along, variance.sqrt(), term);
        if found.spread > max.0 {
            max = (found.spread, first - along * along.transpose() + found.second);
        }
    }
    max.1
}

/// The moments of the profile likelihood about one axis.
struct Trough {
    /// ∫ t² L / ∫ L: one by first order.
    spread: f64,
    /// ∫ ξ ξᵀ L / ∫ L.
    second: Matrix6<f64>,
}

impl Trough {
    fn of(
        points: &[Observation],
        at: &Transform<Object, Camera>,
        here: &Linearized,
        about: &Vector6<f64>,
        along: &Vector6<f64>,
        sigma: f64,
        term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
    ) -> Self {
        let (mut mass, mut spread, mut second) = (1.0, 0.0, Matrix6::zeros());
        for side in [STEP, -STEP] {
            let mut pose = *at;
            for node in 1..=NODES {
                let t = STEP * f64::from(node);
                pose = pose.perturbed(&(along * side));
                let cost = if t * sigma <= FARTHEST { follow(points, &mut pose, about, term) } else { None };
                let Some(worse) = cost.map(|cost| cost - here.cost) else { break };
                let weight = (-0.5 * worse).exp();
                let xi = at.error_to(&pose);
                mass += weight;
                spread += t * t * weight;
                second += xi * xi.transpose() * weight;
                if worse > NOTHING && node > MIN {
                    break;
                }
            }
        }
        Self { spread: spread / mass, second: second / mass }
    }
}

/// The least cost that the coordinates reach which do not turn the pose about the axis, and their pose; `None` where a point
/// is behind a camera.
fn follow(
    points: &[Observation],
    pose: &mut Transform<Object, Camera>,
    about: &Vector6<f64>,
    term: &impl Fn(usize, &Vector3<f64>) -> Option<Term>,
) -> Option<f64> {
    let mut here = linearize(points, pose, term).ok()?;
    for _ in 0..FOLLOWS {
        let covariance = here.covariance().ok()?;
        let (free, held) = (covariance * here.gradient, covariance * about);
        let next = pose.perturbed(&(free - held * (about.dot(&free) / about.dot(&held))));
        let there = linearize(points, &next, term).ok()?;
        if !(there.cost < here.cost) {
            break;
        }
        (*pose, here) = (next, there);
    }
    Some(here.cost)
}
