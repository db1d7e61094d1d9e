//! The tests of a set of pairs and of its alternatives.

use std::{borrow::Cow, collections::BTreeSet};

use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use super::{
    acceptance::Acceptance,
    alert_limit,
    apart::rms_apart,
    hypothesis::{Failure, Hypothesis, by_score},
    integrity::{Integrity, Protection, Redundancy, protection, semi_axes},
    outcome::{BestPose, Fix, Outcome},
    probability::Probability,
    rejection::RejectionReason,
    transfer::Transfer,
};
use crate::{
    ablation::AcceptanceTest,
    alternative::Alternative,
    chi_square::chi_square,
    observations::Observations,
    problem::{Correspondence, Prior, PriorBound, Problem},
    search::{consensus::Support, feature_sets, features::FeatureSet, grow::elsewhere, identification::Identification},
    site::model::ModelPoint,
    solve::{
        covariance::association::association,
        degeneracy::Degenerate,
        likelihood::{self, descent::Linearized, initial_poses::AlternativePose, mixed::Mixed, residuals::Likelihood},
        solver::Solver,
    },
};

/// The problem, solver and limits by which a set is tested.
pub(super) struct Judge<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) solver: &'a dyn Solver,
    pub(super) acceptance: &'a Acceptance,
    /// The places that stand for the object where two of its poses are compared.
    pub(super) anchors: Cow<'a, [ModelPoint]>,
    /// The distance (m, RMS over the anchors) beyond which two poses are different answers.
    pub(super) alert_limit: f64,
    /// The number of pairs of the largest tested set; of points and edges if the search counts.
    pub(super) largest: usize,
    /// Whether a search selected the sets, so that false alarms are possible.
    pub(super) searched: bool,
    pub(super) rig: Option<&'a StereoRig>,
    /// The support of the pose by the independent pairs of a large putative set.
    pub(super) support: Option<&'a Support>,
    /// Whether the search states how probably wrong matches mislead the pose, or has too many pairs for that.
    pub(super) weighs_influential_pairs: bool,
    /// The pose of the search, near which sets with edges are solved; `None` for a search that counts pairs.
    pub(super) near: Option<Transform<Object, Camera>>,
}

impl<'a> Judge<'a> {
    /// The judge of labelled pairs, which no search selected.
    pub(super) fn of_labelled(
        problem: &'a Problem<'a>,
        solver: &'a dyn Solver,
        acceptance: &'a Acceptance,
        rig: Option<&'a StereoRig>,
    ) -> Self {
        let anchors = problem.anchors();
        Self {
            problem,
            solver,
            acceptance,
            alert_limit: alert_limit(&anchors, acceptance),
            anchors,
            largest: 0,
            searched: false,
            rig,
            support: None,
            weighs_influential_pairs: false,
            near: None,
        }
    }

    /// The judge of the sets that a search found.
    pub(super) fn of_search(
        problem: &'a Problem<'a>,
        found: &'a Identification,
        solver: &'a dyn Solver,
        acceptance: &'a Acceptance,
        rig: Option<&'a StereoRig>,
    ) -> Self {
        let posterior = found.posterior.as_ref();
        let sizes = std::iter::once(&found.pairs).chain(&found.alternatives).map(Vec::len);
        let with_edges = if posterior.is_none() { found.pairs.len() + found.edges.len() } else { 0 };
        let support = posterior.and_then(|posterior| posterior.support.as_ref());
        let influential = posterior.is_some_and(|posterior| !posterior.influential_pairs.is_empty());
        Self {
            largest: sizes.max().unwrap_or(0).max(with_edges),
            searched: true,
            support,
            weighs_influential_pairs: support.is_some() || influential,
            near: posterior.and_then(|posterior| posterior.explanations.first()).map(|best| best.object_from_camera),
            ..Self::of_labelled(problem, solver, acceptance, rig)
        }
    }

    /// Whether points and edges are enough: the required number of features, and at least those that fix a pose.
    pub(super) fn size(&self, pairs: &[Correspondence], edges: &[Correspondence]) -> Result<(), RejectionReason> {
        let needed = self.acceptance.min_points.max(self.solver.minimum());
        let edges = if self.solver.takes_edges() { edges.len() } else { 0 };
        match pairs.len() + edges {
            enough if enough >= needed => Ok(()),
            few => Err(RejectionReason::TooFew { found: few, edges, needed }),
        }
    }

    /// Whether a set that a search counted is improbable to be a false alarm.
    ///
    /// A search that weighs evidence has weighed a set with edges.
    pub(super) fn a_contrario(
        &self,
        pairs: &[Correspondence],
        edges: &[Correspondence],
    ) -> Result<(), RejectionReason> {
        if !self.searched || (!edges.is_empty() && self.near.is_some()) {
            return Ok(());
        }
        self.check_p_wrong(Probability::counted_features(self.problem, pairs, edges).wrong, [pairs, edges])
    }

    /// The outcome of the set and its alternatives: one pose, several, or none.
    ///
    /// `misidentified` is [`Integrity::misidentified`].
    pub(super) fn poses(&self, found: &Identification, misidentified: Option<f64>) -> (Outcome, Option<Alternative>) {
        let mut tested = Tested::default();
        // The set that the search prefers states the reason if all fail.
        let mut first_failure: Option<(usize, Failure)> = None;
        let mut fail = |place: usize, failure: Failure| {
            if first_failure.as_ref().is_none_or(|(first, _)| place < *first) {
                first_failure = Some((place, failure));
            }
        };
        let mut full: Vec<(usize, Hypothesis)> = Vec::new();
        let edges_of = |place: usize| found.alternative_edges.get(place).map_or(&[][..], Vec::as_slice);
        let others = found.alternatives.iter().enumerate().map(|(place, pairs)| (pairs, edges_of(place)));
        let sets = std::iter::once((&found.pairs, &found.edges[..])).chain(others);
        for (place, (pairs, edges)) in sets.enumerate() {
            match self.hypothesis_of(pairs, edges) {
                Ok(hypothesis) => full.push((place, hypothesis)),
                Err(degenerate) => fail(place, Failure::Degenerate(degenerate)),
            }
        }
        full.sort_by(|(_, a), (_, b)| by_score(a, b));
        let mut rejected = Vec::new();
        for (place, hypothesis) in full {
            match self.residuals(&hypothesis) {
                Ok(()) => {
                    if let Some(failure) = self.admit(hypothesis, &mut tested) {
                        fail(place, failure);
                    }
                }
                Err(rejection) => {
                    fail(place, Failure::Rejected(rejection));
                    rejected.push(hypothesis);
                }
            }
        }
        for hypothesis in self.thinned(&rejected) {
            self.admit(hypothesis, &mut tested);
        }
        tested.passed.sort_by(by_score);
        tested.rejected.append(&mut rejected);
        tested.rejected.sort_by(by_score);
        let mut different: Vec<Hypothesis> = Vec::new();
        for hypothesis in tested.passed {
            if different.iter().all(|known| self.apart(&known.pose, &hypothesis.pose)) {
                different.push(hypothesis);
            }
        }
        if different.len() > 1 {
            return (Outcome::Ambiguous(different.into_iter().map(Hypothesis::alternative).collect()), None);
        }
        match (different.pop(), first_failure) {
            (Some(mut best), _) if !best.alternatives.is_empty() => {
                let alternatives = std::mem::take(&mut best.alternatives);
                (Outcome::Ambiguous(std::iter::once(best.alternative()).chain(alternatives).collect()), None)
            }
            (Some(best), _) => {
                let runner_up = tested.rejected.into_iter().find(|other| self.apart(&best.pose, &other.pose));
                (self.fix(best, misidentified), runner_up.map(Hypothesis::alternative))
            }
            (None, Some((_, Failure::Degenerate(why)))) => (Outcome::Degenerate(why), None),
            (None, Some((_, Failure::Rejected(why)))) => (Outcome::Rejected(why), None),
            (None, None) => unreachable!("every set either passes or fails"),
        }
    }

    /// Tests precision, prior and visibility of a hypothesis whose residuals passed; returns the reason if it fails.
    ///
    /// A hypothesis that repeats a better pose is skipped, since it cannot change the result.
    fn admit(&self, mut hypothesis: Hypothesis, tested: &mut Tested) -> Option<Failure> {
        let repeats =
            |known: &Hypothesis| known.score >= hypothesis.score && !self.apart(&known.pose, &hypothesis.pose);
        if tested.passed.iter().any(repeats) {
            return None;
        }
        match self.precise_and_near(&mut hypothesis).and_then(|()| self.seen_from_the_front(&hypothesis)) {
            Ok(()) => {
                tested.passed.push(hypothesis);
                None
            }
            Err(failure) => {
                tested.rejected.push(hypothesis);
                Some(failure)
            }
        }
    }

    /// The comparison of a fix with the best contradicting pose elsewhere.
    ///
    /// It applies if the search returned no alternative. The other pose consists of pairs that contradict the fix. If
    /// it passes every test with a score no lower than the fix's, up to rounding, the outcome is ambiguous: a symmetric
    /// object has two poses of one score.
    pub(super) fn against_elsewhere(&self, fix: Box<Fix>) -> (Outcome, Option<Alternative>) {
        let sets = match fix.edges.is_empty() {
            true => elsewhere(self.problem, &fix.object_from_camera)
                .into_iter()
                .map(|points| FeatureSet { points, edges: Vec::new() })
                .collect(),
            false => feature_sets::elsewhere(self.problem, &fix.object_from_camera),
        };
        let others = sets.iter().filter_map(|set| self.hypothesis_of(&set.points, &set.edges).ok());
        let apart = others.filter(|other| self.apart(&fix.object_from_camera, &other.pose));
        let Some(mut other) = apart.min_by(by_score) else { return (Outcome::Fix(fix), None) };
        let stands = other.score >= fix.score - ROUNDING * (1.0 + fix.score.abs())
            && self.residuals(&other).is_ok()
            && self.precise_and_near(&mut other).is_ok()
            && self.faces(&other);
        let other = other.alternative();
        if stands {
            return (Outcome::Ambiguous(vec![other, (*fix).alternative()]), None);
        }
        (Outcome::Fix(fix), Some(other))
    }

    /// The pose of a rejected set, for users with a threshold of their own; `None` if the pairs determine none.
    pub(super) fn best_pose(&self, pairs: &[Correspondence], edges: &[Correspondence]) -> Option<BestPose> {
        let data = self.observations(pairs, edges);
        let pose = self.solve(&data).ok()?;
        let covariance = self.solver.covariance(&data, &pose).ok();
        Some(BestPose { object_from_camera: pose, covariance, pairs: pairs.to_vec(), edges: edges.to_vec() })
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        match &self.near {
            Some(near) => self.solver.solve_near(data, near),
            None => self.solver.solve(data),
        }
    }

    /// The observations of the pairs; without edges for a solver that does not take them.
    fn observations(&self, pairs: &[Correspondence], edges: &[Correspondence]) -> Observations<'_> {
        let points = Observations::of(pairs, self.problem.model, self.problem.cloud, self.rig);
        if edges.is_empty() || !self.solver.takes_edges() {
            return points;
        }
        points.with_edges(edges, self.problem.edges.model, self.problem.model, self.problem.edges.lines)
    }

    /// The pose of the pairs: the best of the solver's alternatives that pass residuals, prior and visibility, with the
    /// rest as alternatives.
    pub(super) fn hypothesis(&self, pairs: &[Correspondence]) -> Result<Hypothesis, Degenerate> {
        self.hypothesis_of(pairs, &[])
    }

    /// The pose of points and edges, as [`hypothesis`](Self::hypothesis).
    pub(super) fn hypothesis_of(
        &self,
        pairs: &[Correspondence],
        edges: &[Correspondence],
    ) -> Result<Hypothesis, Degenerate> {
        let edges = if self.solver.takes_edges() { edges } else { &[] };
        let data = self.observations(pairs, edges);
        let pose = self.solve(&data)?;
        let likelihood = likelihood::maximum(&data, &pose);
        // A search that counts has counted the edges; another weighs them.
        let size = pairs.len() + if self.near.is_none() { edges.len() } else { 0 };
        let fewer = self.largest.saturating_sub(size) as f64 * chi_square(3, self.acceptance.confidence);
        let of = |pose, likelihood: Likelihood| {
            let score = -0.5 * (likelihood.cost + fewer + self.off_prior(&likelihood.pose));
            let (pairs, edges) = (pairs.to_vec(), edges.to_vec());
            Hypothesis { pairs, edges, pose, likelihood, score, covariance: None, alternatives: Vec::new() }
        };
        let own = of(pose, likelihood);
        let others = self.solver.alternatives(&data, &pose, chi_square(1, self.acceptance.confidence));
        if others.is_empty() {
            return Ok(own);
        }
        let other = |alternative: AlternativePose| {
            of(alternative.pose, Likelihood { pose: alternative.pose, cost: own.likelihood.cost + alternative.worse })
        };
        let mut possible: Vec<Hypothesis> = others.into_iter().map(other).chain([own.clone()]).collect();
        possible.retain_mut(|one| self.residuals(one).is_ok() && self.near(one).is_ok() && self.faces(one));
        possible.sort_by(by_score);
        let mut possible = possible.into_iter();
        let Some(map_estimate) = possible.next() else { return Ok(own) };
        Ok(Hypothesis { alternatives: possible.map(Hypothesis::alternative).collect(), ..map_estimate })
    }

    /// χ² of the prior at a pose; zero without a prior and for a box.
    fn off_prior(&self, pose: &Transform<Object, Camera>) -> f64 {
        match self.problem.prior {
            Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) }) => {
                let xi = object_from_camera.error_to(pose);
                covariance.matrix.cholesky().map_or(0.0, |c| xi.dot(&c.solve(&xi)))
            }
            _ => 0.0,
        }
    }

    /// Whether a rigid motion explains the set within its noise (χ² test).
    pub(super) fn residuals(&self, hypothesis: &Hypothesis) -> Result<(), RejectionReason> {
        let (chi2, limit) = (hypothesis.likelihood.cost, self.chi2_limit(hypothesis.dof()));
        // A NaN is rejected as well.
        if chi2 <= limit || !self.acceptance.with(AcceptanceTest::Residuals) {
            Ok(())
        } else {
            Err(RejectionReason::Residuals { chi2, limit })
        }
    }

    /// The limit of χ² with these degrees of freedom.
    fn chi2_limit(&self, dof: usize) -> f64 {
        let variance_factor = if self.support.is_some() { VARIANCE_FACTOR } else { 1.0 };
        variance_factor * chi_square(dof, self.acceptance.confidence)
    }

    /// Whether the pose passes the tests of precision and prior.
    ///
    /// The predicted error must be within the limits with two standard deviations. The common errors of neighbouring
    /// pairs, which enlarge the covariance of a large putative set, count with one at least.
    pub(super) fn precise_and_near(&self, hypothesis: &mut Hypothesis) -> Result<(), Failure> {
        let covariance = self.covariance(hypothesis)?;
        let transfer = Transfer::of(&self.anchors, &hypothesis.pose);
        let (rms, limit) = (transfer.rms(&covariance), self.alert_limit);
        let sigmas = self.support.map_or(2.0, |support| (2.0 / support.pairs_per_place.sqrt()).clamp(1.0, 2.0));
        // A NaN is rejected as well.
        if !(sigmas * rms <= limit) {
            return Err(Failure::Rejected(RejectionReason::Imprecise { rms, limit }));
        }
        let ((_, sigma), limit) = (semi_axes(&covariance), self.acceptance.attitude_limit);
        if !(sigmas * sigma <= limit) {
            return Err(Failure::Rejected(RejectionReason::Attitude { sigma, limit }));
        }
        self.near(hypothesis)
    }

    /// The covariance of the pose, computed once.
    fn covariance(&self, hypothesis: &mut Hypothesis) -> Result<Covariance6<Object, Camera>, Failure> {
        if let Some(known) = hypothesis.covariance {
            return Ok(known);
        }
        let covariance = self.covariance_of(hypothesis).map_err(Failure::Degenerate)?;
        hypothesis.covariance = Some(covariance);
        Ok(covariance)
    }

    /// The covariance of a pose by noise and, if a search selected the pairs, by data association.
    fn covariance_of(&self, hypothesis: &Hypothesis) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let Hypothesis { pairs, edges, pose, .. } = hypothesis;
        let data = self.observations(pairs, edges);
        let covariance = self.solver.covariance(&data, pose)?;
        let covariance = match self.support {
            Some(support) => {
                let variance_factor = (hypothesis.likelihood.cost / hypothesis.dof() as f64).max(1.0);
                Covariance6::new(covariance.matrix * (variance_factor * support.pairs_per_place))
            }
            None => covariance,
        };
        if !self.searched || pairs.is_empty() || !self.acceptance.with(AcceptanceTest::Association) {
            return Ok(covariance);
        }
        let of_edges = match edges.is_empty() {
            true => Matrix6::zeros(),
            false => information_of_edges(&data, pose)?,
        };
        let taken: BTreeSet<usize> = pairs.iter().map(|pair| pair.cloud).collect();
        let others = pairs.iter().map(|pair| {
            let list = self.problem.candidates.lists[pair.model].iter().filter(|cloud| !taken.contains(cloud));
            list.map(|&cloud| self.problem.cloud[cloud].position).collect()
        });
        let others: Vec<Vec<_>> = others.collect();
        let detected = pairs.len() as f64 / self.problem.model.len() as f64;
        Ok(Covariance6::new(covariance.matrix + association(&data, pose, &others, detected, &of_edges)))
    }

    /// Whether two poses are different answers.
    pub(super) fn apart(&self, a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> bool {
        !(rms_apart(&self.anchors, a, b) <= self.alert_limit)
    }

    /// Raises the protection levels to cover other poses within the alert limit.
    ///
    /// It covers poses whose probability relative to the fix is at least [`COVERED`] of the risk.
    pub(super) fn cover<'p>(&self, fix: &mut Fix, others: impl Iterator<Item = (f64, &'p Transform<Object, Camera>)>) {
        let quiet = Protection::quiet(&fix.covariance, 0.5 * self.acceptance.risk);
        let Some(level) = &mut fix.integrity.protection else { return };
        let likely = others.filter(|(fraction, _)| !(*fraction < COVERED * self.acceptance.risk));
        likely.for_each(|(_, other)| level.cover(&quiet, &fix.object_from_camera, other));
    }

    /// Raises the protection levels to this probability of misidentification; levels raised before are kept.
    pub(super) fn protected(&self, fix: &mut Fix, misidentified: f64) {
        let data = self.observations(&fix.pairs, &fix.edges);
        let pose = &fix.object_from_camera;
        let transfer = Transfer::of(&self.anchors, pose);
        let level =
            protection(&data, pose, &fix.covariance, self.acceptance, &transfer, self.alert_limit, misidentified)
                .protection;
        let known = fix.integrity.protection.take();
        fix.integrity.protection = known.zip(level).map(|(known, level)| known.max(&level));
        fix.integrity.misidentified = Some(misidentified);
    }

    fn fix(&self, hypothesis: Hypothesis, misidentified: Option<f64>) -> Outcome {
        let data = self.observations(&hypothesis.pairs, &hypothesis.edges);
        let known = hypothesis.covariance.map_or_else(|| self.covariance_of(&hypothesis), Ok);
        let covariance = match known {
            Ok(covariance) => covariance,
            Err(why) => return Outcome::Degenerate(why),
        };
        let transfer = Transfer::of(&self.anchors, &hypothesis.pose);
        let mistaken = misidentified.unwrap_or(0.0);
        let left_out =
            protection(&data, &hypothesis.pose, &covariance, self.acceptance, &transfer, self.alert_limit, mistaken);
        let covariance = left_out.spread.map_or(covariance, |spread| Covariance6::new(covariance.matrix + spread));
        let dof = hypothesis.dof();
        let integrity = Integrity {
            redundancy: Redundancy::of_features(hypothesis.pairs.len(), hypothesis.edges.len()),
            chi2: hypothesis.likelihood.cost,
            dof,
            chi2_limit: self.chi2_limit(dof),
            solution_separation: left_out.one,
            solution_separation_two: left_out.two,
            misidentified,
            protection: left_out.protection,
            scale_error: left_out.scale_error,
            depth_error: left_out.depth_error,
            consistency: left_out.consistency,
        };
        let features = hypothesis.pairs.len() + hypothesis.edges.len();
        let stands = self.without_any_one(&hypothesis, left_out.influential, transfer.rms(&covariance));
        let stands = stands.and_then(|()| self.as_large_as_modelled(&hypothesis, &integrity));
        if let Err(rejection) = stands.and_then(|()| self.consistent(&integrity, features, transfer.rms(&covariance))) {
            return Outcome::Rejected(rejection);
        }
        Outcome::Fix(Box::new(Fix {
            object_from_camera: hypothesis.pose,
            covariance,
            used: self.solver.used(&data),
            residuals: data.residuals(&hypothesis.pose),
            residual_rms: data.residual_rms(&hypothesis.pose),
            score: hypothesis.score,
            integrity,
            pairs: hypothesis.pairs,
            edges: hypothesis.edges,
        }))
    }
}

/// The information of the edges alone on the pose, their model errors independent.
fn information_of_edges(data: &Observations<'_>, pose: &Transform<Object, Camera>) -> Result<Matrix6<f64>, Degenerate> {
    let all = Mixed::of(data, None, data.rig)?.each(pose)?;
    Ok(all[data.points.len()..].iter().map(Linearized::information).sum())
}

/// Rounding error of a score, relative to it: two poses of a symmetric object have equal residuals.
const ROUNDING: f64 = 1e-6;

/// Largest ratio of the variance of residuals to that of the stated noise in a large putative set.
///
/// Its noise is the spacing of key points, which is known to a factor of √2 at best. Hundreds of residuals would reject
/// a standard deviation that is wrong by a tenth. The covariance of the pose grows with the ratio (a-posteriori variance
/// factor). Clutter that fills the gate of five standard deviations evenly has the ratio five.
const VARIANCE_FACTOR: f64 = 2.0;

/// Fraction of the risk: poses near the fix with a smaller relative probability need no coverage.
const COVERED: f64 = 0.01;

/// The hypotheses that passed every test, and the rejected ones.
#[derive(Default)]
struct Tested {
    passed: Vec<Hypothesis>,
    rejected: Vec<Hypothesis>,
}

mod conditions;
#[cfg(test)]
mod tests;
