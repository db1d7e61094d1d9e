//! The tests of one pose: prior, visibility, dependence on single points, scale, and consistency of the object.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform};

use super::Judge;
use crate::{
    ablation::AcceptanceTest,
    accept::{
        hypothesis::{Failure, Hypothesis},
        integrity::Integrity,
        rejection::RejectionReason,
    },
    chi_square::chi_square,
    problem::PriorBound,
    site::model::ModelPoint,
    solve::likelihood::scale_error::ScaleError,
};

impl Judge<'_> {
    /// Whether the pose agrees with the prior.
    pub(super) fn near(&self, hypothesis: &mut Hypothesis) -> Result<(), Failure> {
        let covariance = self.covariance(hypothesis)?;
        let Some(prior) = self.problem.prior else { return Ok(()) };
        let off = match &prior.bound {
            PriorBound::Gaussian(of_prior) => {
                let xi = prior.object_from_camera.error_to(&hypothesis.pose);
                let sum = (of_prior.matrix + covariance.matrix).cholesky();
                let chi2 = sum.map_or(f64::INFINITY, |c| xi.dot(&c.solve(&xi)));
                (chi2 / chi_square(6, self.acceptance.confidence)).sqrt()
            }
            PriorBound::Box(half) => self.off_box(hypothesis, &covariance, &prior.object_from_camera, *half),
        };
        if off <= 1.0 || !self.acceptance.with(AcceptanceTest::Prior) {
            Ok(())
        } else {
            Err(Failure::Rejected(RejectionReason::Prior { off }))
        }
    }

    /// Whether the camera sees the identified points from their visible sides.
    pub(super) fn seen_from_the_front(&self, hypothesis: &Hypothesis) -> Result<(), Failure> {
        if self.faces(hypothesis) {
            return Ok(());
        }
        let camera = hypothesis.pose.translation();
        let angle = |point: &ModelPoint| point.incidence_angle(&camera).unwrap_or(0.0);
        let points = hypothesis.pairs.iter().map(|pair| &self.problem.model[pair.model]);
        let worst = points.max_by(|a, b| angle(a).total_cmp(&angle(b)));
        let (point, angle) = worst.map_or_else(Default::default, |worst| (worst.id.clone(), angle(worst)));
        let max = ModelPoint::max_incidence_angle();
        Err(Failure::Rejected(RejectionReason::Behind { point, angle, max }))
    }

    /// The distance of the identified model points from their prior positions, relative to its limit.
    ///
    /// The result is the largest step along a camera axis divided by the half-size of the box plus the allowed noise.
    pub(super) fn off_box(
        &self,
        hypothesis: &Hypothesis,
        covariance: &Covariance6<Object, Camera>,
        prior: &Transform<Object, Camera>,
        half: f64,
    ) -> f64 {
        let sigmas = chi_square(1, self.acceptance.confidence).sqrt();
        let (by_pose, by_prior) = (hypothesis.pose.inverse(), prior.inverse());
        let offs = hypothesis.pairs.iter().flat_map(|pair| {
            let at = self.problem.model[pair.model].at;
            let placed = by_pose * at;
            let (step, noise) = (placed - by_prior * at, covariance.of_point(&placed));
            (0..3).map(move |axis| step[axis].abs() / (half + sigmas * noise[(axis, axis)].max(0.0).sqrt()))
        });
        offs.fold(0.0, f64::max)
    }

    /// Whether the pose stays within the alert limit despite any single wrong match.
    ///
    /// It applies to sets that a search selected. If the visible points of a large model are few, close together or in
    /// a row, many wrong poses are possible; a clutter point near one of them makes a wrong pose look precise. Three
    /// points cannot be tested: each is needed.
    ///
    /// A posterior of points states the probability of such a match ([`Posterior::misled`](crate::Posterior::misled)).
    /// Of a large putative set, poses of many pairs are not tested.
    ///
    /// `all` is the predicted error of the complete set, whose own test it passed. A pose does not depend on a point
    /// whose exclusion changes the predicted error by less than [`CARRIED`]: otherwise a pose of hundreds of points that
    /// is just precise enough would fail by the loss of any of them.
    pub(super) fn without_any_one(
        &self,
        hypothesis: &Hypothesis,
        influential: Option<(usize, f64)>,
        all: f64,
    ) -> Result<(), RejectionReason> {
        let Some((place, rms)) = influential.filter(|_| {
            self.searched && !self.weighs_influential_pairs && self.acceptance.with(AcceptanceTest::InfluentialPairs)
        }) else {
            return Ok(());
        };
        // A NaN is rejected as well.
        if 2.0 * rms <= self.alert_limit || rms <= (1.0 + CARRIED) * all {
            return Ok(());
        }
        let point = match place.checked_sub(hypothesis.pairs.len()) {
            None => self.problem.model[hypothesis.pairs[place].model].id.clone(),
            Some(edge) => self.problem.edges.model[hypothesis.edges[edge].model].id.clone(),
        };
        Err(RejectionReason::InfluentialPairs { points: vec![point], rms, limit: self.alert_limit })
    }

    /// Whether scale error and depth error are insignificant, or their effects within the alert limit.
    ///
    /// A rig with a relative scale error ε displaces the object by ε of its distance, a depth error by ε of its depth.
    /// Each significance test uses the confidence of the other tests. If both fail, the reason is the one that reduces
    /// χ² more.
    ///
    /// Sound rigs have depth errors in single images too: of 331 pairs of real boards, 24 have 3 to 14 % at four to eight
    /// standard deviations, although the median errors of their model points are 0.1 to 1.3 mm, set by set. A depth error
    /// rejects only if it is [nearer](in_other_medium) to that of a wrong medium than to zero.
    pub(super) fn as_large_as_modelled(
        &self,
        hypothesis: &Hypothesis,
        integrity: &Integrity,
    ) -> Result<(), RejectionReason> {
        if !self.acceptance.with(AcceptanceTest::Scale) {
            return Ok(());
        }
        let count = hypothesis.pairs.len() as f64;
        let centre: Vector3<f64> =
            hypothesis.pairs.iter().map(|pair| self.problem.model[pair.model].at.coords).sum::<Vector3<f64>>() / count;
        let at = (hypothesis.pose.inverse() * Point::from(centre)).coords;
        let limit = self.alert_limit;
        let depth = integrity.depth_error.filter(in_other_medium).and_then(|depth_error| {
            let (gain, off) = self.displacement(&depth_error, at.z.abs(), integrity)?;
            Some((gain, RejectionReason::DepthError { depth_error, off, limit }))
        });
        let scale = integrity.scale_error.and_then(|scale_error| {
            let (gain, off) = self.displacement(&scale_error, at.norm(), integrity)?;
            Some((gain, RejectionReason::ScaleError { scale_error, off, limit }))
        });
        // The last of equal gains, the scale error.
        let cause = [depth, scale].into_iter().flatten().max_by(|(a, _), (b, _)| a.total_cmp(b));
        cause.map_or(Ok(()), |(_, rejection)| Err(rejection))
    }

    /// The reduction of χ² by this error, and the displacement (m) of an object at this distance (m); `None` if the
    /// error is insignificant or the displacement within the alert limit.
    fn displacement(&self, error: &ScaleError, distance: f64, integrity: &Integrity) -> Option<(f64, f64)> {
        let gain = (error.value / error.sigma).powi(2);
        // Residuals above their noise also raise the error of the scale.
        let left = (integrity.chi2 - gain).max(0.0) / (integrity.dof - 1) as f64;
        let sure = gain > chi_square(1, self.acceptance.confidence) * left.max(1.0);
        // The points that the error moved farthest were not identified, so the estimate is too small.
        let off = (error.value.abs() + UNDERSTATED * error.sigma) * distance;
        (sure && off > self.alert_limit).then_some((gain, off))
    }

    /// Whether no part of the object is significantly displaced, or the effect on the pose within the alert limit.
    ///
    /// `rms` is the predicted error of the model points, which includes the displacement.
    ///
    /// The errors of neighbouring pairs of a large putative set are alike and look like displaced parts: they reject none.
    pub(super) fn consistent(&self, integrity: &Integrity, points: usize, rms: f64) -> Result<(), RejectionReason> {
        let limit = self.acceptance.max_bayes_factor();
        let significant = integrity
            .consistency
            .filter(|found| found.bayes_factor > limit && self.acceptance.with(AcceptanceTest::Consistency))
            .filter(|_| self.support.is_none());
        let Some(consistency) = significant.filter(|_| !(2.0 * rms <= self.alert_limit)) else { return Ok(()) };
        Err(RejectionReason::Inconsistent { consistency, points, limit, rms, alert_limit: self.alert_limit })
    }
}

/// Fraction of the predicted error by which the exclusion of a point changes it if a pose depends on the point.
///
/// One of k equal points changes it by 1/(2k): by 13 % for four, 5 % for ten.
const CARRIED: f64 = 0.05;

/// Refractive index of sea water for visible light.
const WATER: f64 = 1.33;
/// Largest standard deviation of a depth error that is tested: more does not show that of a wrong medium at three sigma.
const INFORMATIVE: f64 = 0.1;

/// Whether a depth error is nearer to that of a calibration in the other medium than to zero.
///
/// Behind a flat port water multiplies the focal length by its refractive index n. A calibration in air used in water
/// has the depth error 1/n − 1 = −0.25, one in water used in air n − 1 = 0.33; half of either is the limit.
fn in_other_medium(depth_error: &ScaleError) -> bool {
    let limits = (1.0 / WATER - 1.0) / 2.0..=(WATER - 1.0) / 2.0;
    depth_error.sigma <= INFORMATIVE && !limits.contains(&depth_error.value)
}

/// Number of standard deviations that are added to a scale or depth error.
const UNDERSTATED: f64 = 2.0;
