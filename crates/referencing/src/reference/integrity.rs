//! How far off a fix may be, wrong matches included.

use nalgebra::Matrix3;
use seafix_geometry::{Camera, Covariance6, Object, Transform, so3};

use super::{Acceptance, transfer::Transfer};
use crate::{
    Observations, Stretch,
    candidates::chi_square,
    solve::{deletion::Deletions, stretch::isotropic},
};

/// What the number of points allows to know of a wrong match. A grade of the count alone, as three points are monitored by
/// nothing whatever they are: whether these very points allow it, four in a row say, is told by the separation
/// and the protection levels, which are none where a point cannot be spared.
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

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unmonitored => "unmonitored",
            Self::Detectable => "detectable",
            Self::Excludable => "excludable",
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

impl Protection {
    /// The radii that a fix with this covariance exceeds with such a probability each, where all of its points are right.
    pub(super) fn quiet(covariance: &Covariance6<Object, Camera>, probability: f64) -> Self {
        let (position, attitude) = semi_axes(covariance);
        let quiet = radius(probability);
        Self { position: quiet * position, attitude: quiet * attitude }
    }

    /// Raised so that it holds of another pose, known as well as `quiet` says, too.
    pub(super) fn cover(&mut self, quiet: &Self, fix: &Transform<Object, Camera>, other: &Transform<Object, Camera>) {
        let (moved, turned) = apart(fix, other);
        *self = self.max(&Self { position: moved + quiet.position, attitude: turned + quiet.attitude });
    }

    /// The greater radii of two.
    pub(super) fn max(&self, other: &Self) -> Self {
        Self { position: self.position.max(other.position), attitude: self.attitude.max(other.attitude) }
    }
}

/// How far apart two poses have the camera: its position (m) and attitude (rad).
fn apart(one: &Transform<Object, Camera>, other: &Transform<Object, Camera>) -> (f64, f64) {
    let moved = (one.translation() - other.translation()).norm();
    (moved, so3::angle(&(one.rotation().inverse() * other.rotation())))
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
    /// than four points, or where one cannot be spared.
    pub separation: Option<f64>,
    /// The same when two points are left out; `None` with fewer than five points, where two cannot be spared, or where
    /// [`Acceptance::two_wrong_rate`] is nought.
    pub separation_two: Option<f64>,
    /// The probability that the pose is another, farther off than the alert limit, as most of the points are others than those of the
    /// fix, or that the object is not there at all, by a search that weighs evidence; `None` of one that counts, which does not
    /// say.
    pub misidentified: Option<f64>,
    /// Protection levels at [`Acceptance::risk`]; `None` where nothing can vouch for the fix (three points, or a point
    /// that cannot be spared), or where [`misidentified`](Self::misidentified) exceeds that risk.
    pub protection: Option<Protection>,
    /// Whether what was measured is as large as the model says; `None` with fewer than four points, any three of which fit.
    pub stretch: Option<Stretch>,
}

/// How far the fix moves when points are left out, and what that protects.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Separation {
    /// Farthest move of the position (m) without one point; `None` with fewer than four, or where one cannot be spared.
    pub(super) one: Option<f64>,
    /// Without two; `None` with fewer than five, or where two wrong matches are not assumed to happen.
    pub(super) two: Option<f64>,
    /// The levels.
    pub(super) protection: Option<Protection>,
    /// See [`Integrity::stretch`].
    pub(super) stretch: Option<Stretch>,
    /// The point that the pose hangs on most: its place in the set, and by how much the model points that the fix transfers are
    /// off if it is a wrong match (m, RMS, one sigma); infinitely far where it cannot be spared. `None` with fewer than four.
    pub(super) hinge: Option<(usize, f64)>,
}

/// Protection levels by solution separation (Blanch and others, *Baseline advanced RAIM user algorithm*, 2015).
///
/// If the points of a set I are wrong matches, the pose x_I without them is not disturbed, and the fix x is off by no more
/// than |x − x_I| + K σ_I: the separation as it is, no threshold assumed, and the radius that x_I itself exceeds with
/// the share of the risk that the rate of such sets leaves. Half of the risk goes to the case that nothing is wrong,
/// the other half to one wrong match, or where two may be wrong in equal parts to one and to two. Radii are the greatest
/// semi-axis times √χ²₃. x_I is the most likely pose, whatever solver gave x. Sets of two need five points at least,
/// and six for a level: three that are left fit whatever they are.
///
/// Where all points are mistaken, no pose without some of them is right, and no radius holds: the probability `misidentified`
/// that they are is taken from the risk first, and where nothing is left of it there is no level.
pub(super) fn protection(
    data: &Observations<'_>,
    pose: &Transform<Object, Camera>,
    covariance: &Covariance6<Object, Camera>,
    acceptance: &Acceptance,
    transfer: &Transfer,
    misidentified: f64,
) -> Separation {
    let n = data.points.len();
    if Redundancy::of(n) == Redundancy::Unmonitored {
        return Separation::default();
    }
    let left = acceptance.risk - misidentified;
    // Written so that a NaN leaves nothing.
    let identified = left > 0.0;
    let risk = if identified { left } else { acceptance.risk };
    let own = Protection::quiet(covariance, 0.5 * risk);
    let even = || isotropic(&data.points, pose);
    let Some(deletions) = Deletions::of(data) else {
        return Separation { stretch: even(), hinge: Some((0, f64::INFINITY)), ..Separation::default() };
    };
    let stretch = deletions.stretch.or_else(even);
    let mut watch = Watch { pose, transfer, deletions, level: own, spared: true, hinge: None };
    let twice = acceptance.two_wrong_rate > 0.0;
    let share = if twice { 0.25 } else { 0.5 } * risk;
    let ones = (0..n).map(|out| [out]);
    let one = watch.farthest(ones, (share / acceptance.wrong_match_rate).min(1.0));
    let two = (twice && n >= 5).then_some(()).and_then(|()| {
        let twos = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        watch.farthest(twos, (share / acceptance.two_wrong_rate).min(1.0))
    });
    let available = identified && watch.spared && (!twice || n >= 6);
    Separation { one, two, protection: available.then_some(watch.level), stretch, hinge: watch.hinge }
}

/// A fix, watched while points are left out.
struct Watch<'a> {
    pose: &'a Transform<Object, Camera>,
    transfer: &'a Transfer,
    deletions: Deletions<'a>,
    level: Protection,
    /// Whether every set so far could be spared.
    spared: bool,
    /// The single point without which the model points move most.
    hinge: Option<(usize, f64)>,
}

impl Watch<'_> {
    /// Raises the levels to what these sets of wrong matches, each as likely as `share` of the risk says, may do; the
    /// farthest move of the position (m), `None` where one of the sets cannot be spared.
    fn farthest<const N: usize>(&mut self, sets: impl Iterator<Item = [usize; N]>, share: f64) -> Option<f64> {
        let k = radius(share);
        let mut farthest = Some(0.0_f64);
        for out in sets {
            let Some((without, certainty)) = self.deletions.without(&out) else {
                (self.spared, farthest) = (false, None);
                self.hang(&out, f64::INFINITY);
                continue;
            };
            // Had the fix a wrong match, the others would be right: it is off by what it differs from them, and by their error.
            self.hang(&out, self.transfer.between(self.pose, &without).hypot(self.transfer.rms(&certainty)));
            let (moved, turned) = apart(self.pose, &without);
            farthest = farthest.map(|farthest| farthest.max(moved));
            // Eigenvalues are asked for only where they may raise a level.
            if let Some(position) = longer_than((self.level.position - moved) / k, &block(&certainty, 3)) {
                self.level.position = self.level.position.max(moved + k * position);
            }
            let limit = WEAK.min((self.level.attitude - turned) / k);
            if let Some(attitude) = longer_than(limit, &block(&certainty, 0)) {
                self.level.attitude = self.level.attitude.max(turned + k * attitude);
                self.spared &= attitude <= WEAK;
            }
        }
        farthest
    }

    /// Keeps the single point that most hangs on.
    fn hang(&mut self, out: &[usize], off: f64) {
        if let &[point] = out
            && self.hinge.is_none_or(|(_, most)| !most.is_nan() && !(off <= most))
        {
            self.hinge = Some((point, off));
        }
    }
}

/// The greatest semi-axis of a covariance, where it may exceed `limit`: it is no longer than the root of the matrix's norm.
fn longer_than(limit: f64, covariance: &Matrix3<f64>) -> Option<f64> {
    /// What rounding may have taken from the norm.
    const ROUNDED: f64 = 1.0 + 1e-12;
    // Written so that a NaN is looked at too.
    (!(covariance.norm().sqrt() * ROUNDED <= limit)).then(|| semi_axis(covariance))
}

/// The greatest semi-axis of a covariance.
fn semi_axis(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// The block of the attitude (`first` = 0) or of the position (3).
fn block(covariance: &Covariance6<Object, Camera>, first: usize) -> Matrix3<f64> {
    covariance.matrix.fixed_view::<3, 3>(first, first).into()
}

/// An attitude less certain than this (rad) has other valleys nearby: no Gaussian radius bounds its error.
const WEAK: f64 = 0.035;

/// Greatest standard deviations of position (m) and attitude (rad) over all directions.
pub(super) fn semi_axes(covariance: &Covariance6<Object, Camera>) -> (f64, f64) {
    (semi_axis(&block(covariance, 3)), semi_axis(&block(covariance, 0)))
}

/// The radius, in standard deviations, that a normal vector of three exceeds with this probability.
fn radius(probability: f64) -> f64 {
    chi_square(3, 1.0 - probability).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mahalanobis, Observation, Solver};
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
        let covariance = witness.covariance(data, &pose).unwrap();
        let all = protection(data, &pose, &covariance, acceptance, &Transfer::of(&[], &pose), 0.0);
        assert_eq!(all.two.is_some(), acceptance.two_wrong_rate > 0.0 && data.points.len() >= 5);
        (all.one, all.protection)
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

    /// Seen to fail where the whole risk is left to errors.
    #[test]
    fn what_the_points_may_be_mistaken_for_is_taken_from_the_risk() {
        let (data, pose) = seen(6);
        let covariance = Mahalanobis::default().covariance(&data, &pose).unwrap();
        let level = |risk: f64, misidentified: f64| {
            let acceptance = Acceptance { risk, ..Acceptance::default() };
            protection(&data, &pose, &covariance, &acceptance, &Transfer::of(&[], &pose), misidentified).protection
        };
        assert_eq!(level(1e-4, 7e-5), level(1e-4 - 7e-5, 0.0));
        assert!(level(1e-4, 9.9e-5).is_some());
        assert_eq!([1e-4, 0.3, f64::NAN].map(|misidentified| level(1e-4, misidentified)), [None; 3]);
    }

    /// One coordinate that is as good as exact takes all weight from the others, and three points any of which fit say nothing.
    #[test]
    fn every_fix_of_four_points_has_a_stretch() {
        let stretch = |count: usize, exact: bool| {
            let (mut data, pose) = seen(count);
            data.points[0].measured.covariance[(0, 0)] = if exact { 1e-16 } else { SIGMA * SIGMA };
            let covariance = Mahalanobis::default().covariance(&data, &pose).unwrap();
            protection(&data, &pose, &covariance, &Acceptance::default(), &Transfer::of(&[], &pose), 0.0).stretch
        };
        assert_eq!(stretch(3, false), None);
        for count in [4, 6] {
            let [even, exact] = [false, true].map(|exact| stretch(count, exact).expect("four points or more"));
            assert!(even.value.abs().max(exact.value.abs()) < 1e-6, "{count}: {even:?} {exact:?}");
            // What the others say of the scale is left, and the exact one cannot say it all.
            assert!((0.7..1.05).contains(&(exact.sigma / even.sigma)), "{count}: {even:?} {exact:?}");
        }
    }

    /// Seen to fail when the separation is left out of the level.
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

    /// Seen to fail when only single points are left out.
    #[test]
    fn two_wrong_matches_are_within_the_level_where_they_are_assumed() {
        let acceptance = Acceptance { two_wrong_rate: 0.01, ..Acceptance::default() };
        for (one, two) in (0..6).flat_map(|i| (i + 1..6).map(move |j| (i, j))) {
            let (mut data, truth) = seen(6);
            for wrong in [one, two] {
                data.points[wrong].measured.at = data.points[wrong].measured.at + Vector3::new(0.1, -0.2, 0.1);
            }
            let pose = Mahalanobis::default().solve(&data).unwrap();
            let off = (pose.translation() - truth.translation()).norm();
            // Four points are left, none of them wrong: the level holds whatever the two did.
            if let Some(level) = of(&data, &acceptance).1 {
                assert!(off <= level.position, "{one} {two}: {off} {level:?}");
            }
        }
        assert!(of(&seen(6).0, &acceptance).1.is_some());
        assert_eq!(of(&seen(5).0, &acceptance).1, None, "three that are left bear no witness");
        assert!(of(&seen(5).0, &Acceptance::default()).1.is_some());
    }
}
