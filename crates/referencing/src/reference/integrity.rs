//! How far off a fix may be, wrong matches included.

use nalgebra::{Matrix3, SymmetricEigen};
use seafix_geometry::{Camera, Covariance6, Object, Transform, so3};

use super::Acceptance;
use crate::{Mahalanobis, Observations, Solver, candidates::chi_square};

/// What the number of points allows to know of a wrong match.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Redundancy {
    /// Three points: any three fit, nothing would show.
    Unmonitored,
    /// Four: that one is wrong would show, not which.
    Detectable,
    /// Five and more: the wrong one can be told and left out.
    Excludable,
}

impl Redundancy {
    /// The grade of so many points.
    pub fn of(points: usize) -> Self {
        match points {
            0..=3 => Self::Unmonitored,
            4 => Self::Detectable,
            _ => Self::Excludable,
        }
    }
}

/// Radii that the errors of a fix exceed with no more than the stated risk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Protection {
    /// Of the camera's position in the object frame (m).
    pub position: f64,
    /// Of the attitude (rad).
    pub attitude: f64,
}

/// What supports a fix beyond its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrity {
    /// What the number of points allows to know.
    pub redundancy: Redundancy,
    /// χ² of the residuals at the most likely pose.
    pub chi2: f64,
    /// Its degrees of freedom, 3k − 6.
    pub freedom: usize,
    /// The χ² that a true set exceeds with one minus the confidence.
    pub chi2_limit: f64,
    /// Solution separation: the farthest that the position moves (m) when one point is left out; `None` with fewer
    /// than four points.
    pub separation: Option<f64>,
    /// Protection levels at [`Acceptance::risk`]; `None` where nothing can vouch for the fix (three points, or a point
    /// that cannot be spared).
    pub protection: Option<Protection>,
}

/// Protection levels by solution separation (Blanch and others, *Baseline advanced RAIM user algorithm*, 2015).
///
/// If point i is a wrong match, the pose x_i without it is not disturbed, and the fix x is off by no more than
/// |x − x_i| + K σ_i: the separation as it is, no threshold assumed, and the radius that x_i itself exceeds with
/// the share of the risk that the rate of wrong matches leaves. Half of the risk goes to the case that nothing is
/// wrong, half to one wrong match. Radii are the greatest semi-axis times √χ²₃. x_i is the most likely pose,
/// whatever solver gave x.
pub(super) fn protection(
    data: &Observations<'_>,
    pose: &Transform<Object, Camera>,
    covariance: &Covariance6<Object, Camera>,
    acceptance: &Acceptance,
) -> (Option<f64>, Option<Protection>) {
    let n = data.points.len();
    if Redundancy::of(n) == Redundancy::Unmonitored {
        return (None, None);
    }
    let quiet = radius(0.5 * acceptance.risk);
    let (position, attitude) = semi_axes(covariance);
    let mut level = Protection { position: quiet * position, attitude: quiet * attitude };
    let share = (0.5 * acceptance.risk / acceptance.wrong_match_rate).min(1.0);
    let k = radius(share);
    let mut separation: f64 = 0.0;
    let mut spared = true;
    for out in 0..n {
        let mut fewer = data.clone();
        fewer.points.remove(out);
        let witness = Mahalanobis::default();
        let Ok(without) = witness.solve(&fewer) else {
            spared = false;
            continue;
        };
        let Ok(certainty) = witness.covariance(&fewer, &without) else {
            spared = false;
            continue;
        };
        let moved = (pose.translation() - without.translation()).norm();
        let turned = so3::angle(&(pose.rotation().inverse() * without.rotation()));
        let (position, attitude) = semi_axes(&certainty);
        separation = separation.max(moved);
        level.position = level.position.max(moved + k * position);
        level.attitude = level.attitude.max(turned + k * attitude);
        spared &= attitude <= WEAK;
    }
    (Some(separation), spared.then_some(level))
}

/// An attitude less certain than this (rad) has other valleys nearby: no Gaussian radius bounds its error.
const WEAK: f64 = 0.035;

/// Greatest standard deviations of position (m) and attitude (rad) over all directions.
fn semi_axes(covariance: &Covariance6<Object, Camera>) -> (f64, f64) {
    let greatest = |first: usize| {
        let block: Matrix3<f64> = covariance.matrix.fixed_view::<3, 3>(first, first).into();
        SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
    };
    (greatest(3), greatest(0))
}

/// The radius, in standard deviations, that a normal vector of three exceeds with this probability.
fn radius(probability: f64) -> f64 {
    chi_square(3, 1.0 - probability).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Observation;
    use nalgebra::Vector3;
    use seafix_geometry::{Point, UncertainPoint};

    const SIGMA: f64 = 0.002;

    fn seen(count: usize) -> (Observations<'static>, Transform<Object, Camera>) {
        let places =
            [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 1.3, 0.1], [0.4, 0.3, 0.9], [-0.7, 0.5, 0.4], [0.6, -0.8, 0.3]];
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -3.0].into());
        let points = places[..count].iter().map(|&at| Observation {
            measured: UncertainPoint::isotropic(pose.inverse() * Point::from(at), SIGMA),
            pixels: None,
            model: Point::from(at),
            model_sigma: 0.0,
        });
        (Observations { points: points.collect(), rig: None }, pose)
    }

    fn of(data: &Observations<'_>, acceptance: &Acceptance) -> (Option<f64>, Option<Protection>) {
        let witness = Mahalanobis::default();
        let pose = witness.solve(data).unwrap();
        protection(data, &pose, &witness.covariance(data, &pose).unwrap(), acceptance)
    }

    #[test]
    fn three_points_are_unavailable() {
        assert_eq!(of(&seen(3).0, &Acceptance::default()), (None, None));
        assert_eq!(
            [3, 4, 5].map(Redundancy::of),
            [Redundancy::Unmonitored, Redundancy::Detectable, Redundancy::Excludable]
        );
    }

    #[test]
    fn levels_grow_with_noise_and_with_a_smaller_risk() {
        let (data, _) = seen(6);
        let (separation, level) = of(&data, &Acceptance::default());
        let level = level.expect("six points");
        assert!(separation.unwrap() < 1e-9 && level.position > 0.0 && level.attitude > 0.0);
        let strict = of(&data, &Acceptance { risk: 1e-6, ..Acceptance::default() }).1.unwrap();
        assert!(strict.position > level.position && strict.attitude > level.attitude);
        let mut noisy = data;
        noisy.points.iter_mut().for_each(|point| point.measured.covariance *= 4.0);
        let noisy = of(&noisy, &Acceptance::default()).1.unwrap();
        assert!((noisy.position / level.position - 2.0).abs() < 1e-6);
    }

    #[test]
    fn one_wrong_match_is_within_the_level() {
        for wrong in 0..6 {
            let (mut data, truth) = seen(6);
            data.points[wrong].measured.at = data.points[wrong].measured.at + Vector3::new(0.1, -0.2, 0.1);
            let pose = Mahalanobis::default().solve(&data).unwrap();
            let off = (pose.translation() - truth.translation()).norm();
            let (separation, level) = of(&data, &Acceptance::default());
            let level = level.expect("six points");
            assert!(
                off > 10.0 * SIGMA && off <= level.position && separation.unwrap() >= off - 1e-6,
                "{off} {level:?}"
            );
        }
    }
}
