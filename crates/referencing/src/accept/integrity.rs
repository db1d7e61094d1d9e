//! How far off a fix may be, wrong matches included.

use nalgebra::Matrix3;
use seafix_geometry::{Camera, Covariance6, Object, Transform, so3};

use super::{Acceptance, transfer::Transfer};
use crate::{
    Observations, ScaleError,
    candidates::chi_square,
    solve::{leave_out::Deletions, scale_error::isotropic},
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
    pub dof: usize,
    /// The χ² that a true set exceeds with one minus the confidence.
    pub chi2_limit: f64,
    /// Solution separation: the farthest that the position moves (m) when one point is left out; `None` with fewer
    /// than four points, or where one cannot be spared.
    pub solution_separation: Option<f64>,
    /// The same when two points are left out; `None` with fewer than five points, where two cannot be spared, or where
    /// [`Acceptance::two_wrong_rate`] is nought.
    pub solution_separation_two: Option<f64>,
    /// The probability that the pose is another, farther off than the alert limit, as most of the points are others than those of the
    /// fix, or that the object is not there at all, by a search that weighs evidence; `None` of one that counts, which does not
    /// say.
    pub misidentified: Option<f64>,
    /// Protection levels at [`Acceptance::risk`]; `None` where nothing can vouch for the fix (three points, or a point
    /// that cannot be spared), or where [`misidentified`](Self::misidentified) exceeds that risk.
    pub protection: Option<Protection>,
    /// Whether what was measured is as large as the model says; `None` with fewer than four points, any three of which fit.
    pub scale_error: Option<ScaleError>,
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
    pub(super) scale_error: Option<ScaleError>,
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
        return Separation { scale_error: even(), hinge: Some((0, f64::INFINITY)), ..Separation::default() };
    };
    let scale_error = deletions.scale_error.or_else(even);
    let mut watch = Watch { pose, transfer, deletions, level: own, spared: true, hinge: None };
    let twice = acceptance.two_wrong_rate > 0.0;
    let fraction = if twice { 0.25 } else { 0.5 } * risk;
    let ones = (0..n).map(|out| [out]);
    let one = watch.farthest(ones, (fraction / acceptance.wrong_match_rate).min(1.0));
    let two = (twice && n >= 5).then_some(()).and_then(|()| {
        let twos = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        watch.farthest(twos, (fraction / acceptance.two_wrong_rate).min(1.0))
    });
    let available = identified && watch.spared && (!twice || n >= 6);
    Separation { one, two, protection: available.then_some(watch.level), scale_error, hinge: watch.hinge }
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
    /// Raises the levels to what these sets of wrong matches, each as likely as `fraction` of the risk says, may do; the
    /// farthest move of the position (m), `None` where one of the sets cannot be spared.
    fn farthest<const N: usize>(&mut self, sets: impl Iterator<Item = [usize; N]>, fraction: f64) -> Option<f64> {
        let k = radius(fraction);
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
            && self.hinge.is_none_or(|(_, max)| !max.is_nan() && !(off <= max))
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
mod tests;
