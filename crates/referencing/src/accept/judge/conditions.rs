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
        most_influential: Option<(usize, f64)>,
        all: f64,
    ) -> Result<(), RejectionReason> {
        let Some((place, rms)) = most_influential.filter(|_| {
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

    /// Whether the scale error is insignificant, or its effect within the alert limit.
    ///
    /// A rig with a relative scale error ε displaces the object by ε of its distance. The significance test uses the
    /// confidence of the other tests.
    pub(super) fn as_large_as_modelled(
        &self,
        hypothesis: &Hypothesis,
        integrity: &Integrity,
    ) -> Result<(), RejectionReason> {
        let Some(scale_error) = integrity.scale_error.filter(|_| self.acceptance.with(AcceptanceTest::Scale)) else {
            return Ok(());
        };
        // Residuals above their noise also raise the error of the scale.
        let sigmas = scale_error.value / scale_error.sigma;
        let left = (integrity.chi2 - sigmas * sigmas).max(0.0) / (integrity.dof - 1) as f64;
        let sure = sigmas * sigmas > chi_square(1, self.acceptance.confidence) * left.max(1.0);
        let count = hypothesis.pairs.len() as f64;
        let centre: Vector3<f64> =
            hypothesis.pairs.iter().map(|pair| self.problem.model[pair.model].at.coords).sum::<Vector3<f64>>() / count;
        // The points that the scale error moved farthest were not identified, so the estimate is too small.
        let max = scale_error.value.abs() + UNDERSTATED * scale_error.sigma;
        let off = max * (hypothesis.pose.inverse() * Point::from(centre)).coords.norm();
        match sure && off > self.alert_limit {
            true => Err(RejectionReason::ScaleError { scale_error, off, limit: self.alert_limit }),
            false => Ok(()),
        }
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

/// Number of standard deviations that are added to the scale error.
const UNDERSTATED: f64 = 2.0;
