//! The covariance of a weak attitude under a nonlinear likelihood.

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use crate::{
    observations::Observation,
    solve::{
        degeneracy::Degenerate,
        likelihood::{
            descent::{Linearized, Term, linearize},
            pixel_terms::{PixelTerms, TermTarget},
        },
    },
};

/// Standard deviation of the attitude (rad, three axes together) up to which first order holds.
const STRAIGHT: f64 = 0.02;
/// Standard deviation about one axis (rad) up to which a rotation is linear by itself.
const STIFF: f64 = 0.006;
/// Distance between quadrature nodes (first-order standard deviations).
const STEP: f64 = 0.5;
/// Number of nodes to each side: twelve standard deviations.
const NODES: i32 = 24;
/// Largest rotation (rad).
const FARTHEST: f64 = 1.0;
/// Excess of χ² at which a pose has no weight; beyond it lies another minimum.
const NOTHING: f64 = 25.0;
/// Minimum number of nodes to each side.
const MIN: i32 = 12;
/// Number of steps in which the other five coordinates follow a rotation.
const FOLLOWS: usize = 3;

/// The covariance of the maximum-likelihood pose of the pixels: first order, and [`inflated`] for a weak attitude.
///
/// # Errors
///
/// The first invalid or hidden point, or an undetermined motion.
pub(crate) fn pixel_covariance(
    points: &[Observation],
    rig: &StereoRig,
    target: TermTarget,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let mut all = PixelTerms::new(rig);
    all.see(points, target)?;
    let live = |k: usize, place: &_| all.live(k, place);
    let first = linearize(points, at, &live)?.covariance()?;
    Ok(Covariance6::new(inflated(points, at, first, &live)))
}

/// The covariance `first`, with the part of its most uncertain rotation from the profile likelihood.
///
/// With e an axis of the attitude's covariance, σ² = eᵀ Σ_φφ e and d = Σ (e, 0) / σ, first order states that χ² grows
/// by t² at `at · Exp(t d)`. The attitude of a small distant object follows from its foreshortening, which changes with
/// the square of its tilt. Its χ² is then no parabola but a curved trough, with a shoulder or a second minimum on the
/// other side, and the slope at the maximum-likelihood pose differs from that at the truth farther along the trough.
/// The profile likelihood L(t) is the maximum over all poses rotated from `at` by t σ about e; ξ(t) is the step to its
/// pose. For the axis with the largest ∫ t² L / ∫ L, the first-order term d dᵀ is replaced by ∫ ξ ξᵀ L / ∫ L: the
/// second moment about the answer, which includes its bias.
///
/// (Bates and Watts, *Nonlinear regression analysis and its applications*, 1988, chapter 6.)
fn inflated(
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
    /// ∫ t² L / ∫ L: one to first order.
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

/// The minimum of the cost without further rotation about the axis, and its pose; `None` if a point is behind a camera.
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
