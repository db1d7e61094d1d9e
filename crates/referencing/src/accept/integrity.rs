//! The integrity of a fix: protection levels that include wrong matches.

use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use super::{acceptance::Acceptance, transfer::Transfer};
use crate::{
    observations::Observations,
    solve::likelihood::{
        leave_out::Deletions,
        mixed::MIN_FEATURE_VALUE,
        scale_error::{ScaleError, of_mean_variance},
    },
};
use consistency::Hypotheses;
pub(super) use protection::semi_axes;
use protection::{apart, block, longer_than, radius};

pub(crate) mod consistency;
mod parts;
mod protection;

pub use consistency::Consistency;
pub use protection::Protection;

/// The grade of redundancy for wrong matches, by the number of points.
///
/// The grade depends on the number alone, since any three points fit. Whether these particular points allow an
/// exclusion (four in a row do not) follows from solution separation and protection levels: both are `None` if a point
/// is indispensable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Redundancy {
    /// Three points: a wrong match that keeps their distances within the tolerance is undetectable.
    Unmonitored,
    /// Four points: a wrong match is detectable, but not identifiable.
    Detectable,
    /// Five points or more: the wrong match is identifiable and can be excluded.
    Excludable,
}

impl Redundancy {
    /// The grade of a number of points.
    pub fn of(points: usize) -> Self {
        match points {
            0..=3 => Self::Unmonitored,
            4 => Self::Detectable,
            _ => Self::Excludable,
        }
    }

    /// The grade of points and edges: by the number of features that can be spared, whichever they are.
    ///
    /// Three points, two points and an edge, or two edges determine a pose; a point counts two of six, an edge three.
    pub(super) fn of_features(points: usize, edges: usize) -> Self {
        if edges == 0 {
            return Self::of(points);
        }
        let enough = |spared: usize| {
            let of_edges = spared.min(edges);
            2 * points.saturating_sub(spared - of_edges) + 3 * (edges - of_edges) >= MIN_FEATURE_VALUE
        };
        match (enough(1), enough(2)) {
            (false, _) => Self::Unmonitored,
            (true, false) => Self::Detectable,
            (true, true) => Self::Excludable,
        }
    }

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unmonitored => "unmonitored",
            Self::Detectable => "detectable",
            Self::Excludable => "excludable",
        }
    }
}

/// The integrity of a fix beyond its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrity {
    /// The grade of redundancy by the number of points and edges.
    pub redundancy: Redundancy,
    /// χ² of the residuals at the maximum-likelihood pose.
    pub chi2: f64,
    /// The degrees of freedom of χ², 3k + 4m − 6 for k points and m edges.
    pub dof: usize,
    /// The limit of χ², which a correct set exceeds with probability one minus the confidence.
    pub chi2_limit: f64,
    /// Solution separation: the largest shift of the position (m) when one point is excluded.
    ///
    /// `None` with fewer than four points, or if a point is indispensable.
    pub solution_separation: Option<f64>,
    /// Solution separation (m) when two points are excluded.
    ///
    /// `None` with fewer than five points, if two points are indispensable, or if [`Acceptance::two_wrong_rate`] is
    /// zero.
    pub solution_separation_two: Option<f64>,
    /// The posterior probability of a wrong pose or of an absent object.
    ///
    /// A pose is wrong if it differs from the truth by more than the alert limit; it then has mostly other pairs than
    /// the fix. `None` for a search that does not weigh evidence.
    pub misidentified: Option<f64>,
    /// The protection levels at [`Acceptance::risk`].
    ///
    /// `None` without redundancy (three points, or an indispensable point), or if
    /// [`misidentified`](Self::misidentified) exceeds the risk.
    pub protection: Option<Protection>,
    /// The scale error between measurement and model; `None` with fewer than four points, since any three fit.
    pub scale_error: Option<ScaleError>,
    /// The depth error: the excess ε of measured distances along the optical axis over the model's, relative to them.
    ///
    /// With p the position of a point (m, camera frame) and p̄ the mean, p′ = p + ε (p − p̄)_z e_z. ε is f/f₀ − 1 for
    /// a focal length f of both cameras instead of f₀, since X = u b/d does not depend on f and Z = f b/d does. `None`
    /// with fewer than four points, or if the points do not determine it, as those of a plane seen face-on.
    pub depth_error: Option<ScaleError>,
    /// The evidence that a part of the object is displaced against the rest.
    ///
    /// `None` with fewer than four points, or if [`Acceptance::moved_part_rate`] is zero.
    pub consistency: Option<Consistency>,
}

/// Solution separation and the protection levels that follow from it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct IntegrityTests {
    /// The largest shift of the position (m) without one point; `None` with fewer than four, or if one is
    /// indispensable.
    pub(super) one: Option<f64>,
    /// The largest shift without two points; `None` with fewer than five, or if two wrong matches are assumed
    /// impossible.
    pub(super) two: Option<f64>,
    /// The protection levels.
    pub(super) protection: Option<Protection>,
    /// The scale error, as [`Integrity::scale_error`].
    pub(super) scale_error: Option<ScaleError>,
    /// The depth error, as [`Integrity::depth_error`].
    pub(super) depth_error: Option<ScaleError>,
    /// The most critical point: its index in the set, and the error of the transferred model points if it is a wrong
    /// match.
    ///
    /// The error is in metres (RMS, one sigma), infinite if the point is indispensable. `None` with fewer than four
    /// points.
    pub(super) influential: Option<(usize, f64)>,
    /// The consistency of the object's parts, as [`Integrity::consistency`].
    pub(super) consistency: Option<Consistency>,
    /// The increase of the fix's covariance by displaced parts, if their evidence is significant.
    pub(super) spread: Option<Matrix6<f64>>,
}

/// Protection levels by solution separation (Blanch and others, *Baseline advanced RAIM user algorithm*, 2015).
///
/// If the points of a set I are wrong matches, the pose x_I without them is undisturbed, and the error of the fix x is
/// at most |x − x_I| + K σ_I. The separation is used as computed, without a threshold; K σ_I is the radius that x_I
/// exceeds with its fraction of the risk divided by the rate of such sets. A third of the risk is allotted to the
/// fault-free case, a third to a displaced part of the object ([`Hypotheses`]), the rest to one wrong match, or in equal
/// parts to one and to two. Without the case of a displaced part the others have half each. Radii are the largest
/// semi-axis times √χ²₃. x_I is the maximum-likelihood pose for every solver. Sets of two require five points, and six
/// for a level, since any three remaining points fit.
///
/// `alert` is the alert limit (m), the largest displacement of a part that is assumed.
///
/// No radius holds if all points are mistaken: the probability `misidentified` of that case is subtracted from the risk
/// first, and there is no level if nothing remains.
pub(super) fn protection(
    data: &Observations<'_>,
    pose: &Transform<Object, Camera>,
    covariance: &Covariance6<Object, Camera>,
    acceptance: &Acceptance,
    transfer: &Transfer,
    alert: f64,
    misidentified: f64,
) -> IntegrityTests {
    let n = data.points.len() + data.edges.len();
    if Redundancy::of_features(data.points.len(), data.edges.len()) == Redundancy::Unmonitored {
        return IntegrityTests::default();
    }
    let left = acceptance.risk - misidentified;
    // A NaN leaves nothing.
    let identified = left > 0.0;
    let risk = if identified { left } else { acceptance.risk };
    let rate = acceptance.moved_part_rate;
    let part = if rate > 0.0 { 1.0 / 3.0 } else { 0.5 } * risk;
    let own = Protection::quiet(covariance, part);
    let even = || of_mean_variance(&data.points, pose).filter(|_| data.points.len() > 3);
    let Some(deletions) = Deletions::near(data, pose) else {
        return IntegrityTests {
            scale_error: even(),
            influential: Some((0, f64::INFINITY)),
            ..IntegrityTests::default()
        };
    };
    let (scale_error, depth_error) = (deletions.scale_error.or_else(even), deletions.depth_error);
    let mut exclusions = Exclusions { pose, transfer, deletions, level: own, spared: true, influential: None };
    let twice = acceptance.two_wrong_rate > 0.0;
    let fraction = if twice { 0.5 } else { 1.0 } * part;
    let ones = (0..n).map(|out| [out]);
    let one = exclusions.farthest(ones, (fraction / acceptance.wrong_match_rate).min(1.0));
    let two = (twice && n >= 5).then_some(()).and_then(|()| {
        let twos = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        exclusions.farthest(twos, (fraction / acceptance.two_wrong_rate).min(1.0))
    });
    let available = identified && exclusions.spared && (!twice || n >= 6);
    let Exclusions { deletions, mut level, influential, .. } = exclusions;
    let places = deletions.places.clone();
    let hypotheses =
        (rate > 0.0).then(|| Hypotheses::of(&deletions, &places, alert, transfer.rms(covariance))).flatten();
    let consistency = hypotheses.as_ref().map(Hypotheses::consistency);
    if let Some(hypotheses) = hypotheses.as_ref().filter(|_| available) {
        hypotheses.cover(&mut level, &deletions, pose, rate, part);
    }
    let significant = consistency.is_some_and(|found| found.bayes_factor > acceptance.max_bayes_factor());
    let spread = hypotheses.filter(|_| significant).map(|all| all.spread(&deletions, pose, covariance, rate));
    IntegrityTests {
        one,
        two,
        protection: available.then_some(level),
        scale_error,
        depth_error,
        influential,
        consistency,
        spread,
    }
}

/// The exclusion of points from a fix, and the maxima so far.
struct Exclusions<'a> {
    pose: &'a Transform<Object, Camera>,
    transfer: &'a Transfer,
    deletions: Deletions<'a>,
    level: Protection,
    /// Whether no excluded set was indispensable.
    spared: bool,
    /// The point whose exclusion moves the model points most.
    influential: Option<(usize, f64)>,
}

impl Exclusions<'_> {
    /// Raises the levels for these sets of wrong matches.
    ///
    /// `fraction` is the probability allotted to each set. Returns the largest shift of the position (m); `None` if one
    /// of the sets is indispensable.
    fn farthest<const N: usize>(&mut self, sets: impl Iterator<Item = [usize; N]>, fraction: f64) -> Option<f64> {
        let k = radius(fraction);
        let mut farthest = Some(0.0_f64);
        for out in sets {
            let Some((without, certainty)) = self.deletions.without(&out) else {
                (self.spared, farthest) = (false, None);
                self.note_influence(&out, f64::INFINITY);
                continue;
            };
            // If this point is a wrong match, the error is the shift plus the error of the pose without it.
            self.note_influence(&out, self.transfer.between(self.pose, &without).hypot(self.transfer.rms(&certainty)));
            let (moved, turned) = apart(self.pose, &without);
            farthest = farthest.map(|farthest| farthest.max(moved));
            // Eigenvalues are computed only if they may raise a level.
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

    /// Keeps the most critical point.
    fn note_influence(&mut self, out: &[usize], off: f64) {
        if let &[point] = out
            && self.influential.is_none_or(|(_, max)| !max.is_nan() && !(off <= max))
        {
            self.influential = Some((point, off));
        }
    }
}

/// Largest standard deviation of the attitude (rad) for a level; beyond it other local minima are near, and no Gaussian
/// radius bounds the error.
const WEAK: f64 = 0.035;

#[cfg(test)]
mod tests;
