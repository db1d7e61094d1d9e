//! The likely cause of an answer without a pose: a scale error, points near a line, too few pairs.

use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use seafix_component::Choice;
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

use super::input::CoherenceProblem;
use crate::{
    accept::{
        acceptance::Acceptance,
        outcome::{Attempt, Outcome},
    },
    problem::Correspondence,
    search::{SEARCHES, identification::Search},
    solve::solver::Solver,
};

/// The maximum number of candidate pairs whose distances are compared.
const MAX_PAIRS: usize = 400;
/// The width of a bin of the logarithm of a scale, 0.4 %.
const BIN: f64 = 0.004;
/// The largest logarithm of a scale, a factor of 2000.
const WIDEST: f64 = 7.6;
/// The number of scales that are tried.
const TRIED: usize = 5;

impl CoherenceProblem {
    /// The likely cause, as a sentence with its remedy, of an attempt without a fix; `None` if none is known.
    pub(super) fn diagnosis(
        &self,
        attempt: &Attempt,
        (search, solver, acceptance): (&dyn Search, &dyn Solver, &Acceptance),
        rng: &mut dyn Rng,
    ) -> Option<String> {
        if matches!(attempt.outcome, Outcome::Fix(_)) || self.model.len() < 3 || self.cloud.len() < 3 {
            return None;
        }
        if let Some(turn) = self.open_turn().filter(|turn| 2.0 * turn > acceptance.attitude_limit) {
            return self.near_a_line(attempt, turn, (solver, acceptance), rng);
        }
        let pairs = self.few_candidates()?;
        if let Some(text) = self.other_scale(&pairs, attempt, (search, solver, acceptance), rng) {
            return Some(text);
        }
        let certain = self.putative.as_ref().is_some_and(|pairs| pairs.len() == 3);
        (certain || self.model.len() == 3 && attempt.identified.len() == 3).then(|| {
            "three pairs fit some pose whatever they are, so that nothing vouches for this one: a fourth point would tell, or \
             `--set acceptance.max-p-wrong=0.5` takes the pairs as certain"
                .to_owned()
        })
    }

    /// The standard deviation (rad) of the rotation about the line through the model points; `None` for fewer than three.
    pub(super) fn open_turn(&self) -> Option<f64> {
        let n = self.model.len();
        let places: Vec<Vector3<f64>> = self.model.iter().map(|point| point.at.coords).collect();
        let middle = places.iter().sum::<Vector3<f64>>() / n.max(1) as f64;
        let spread: Matrix3<f64> = places.iter().map(|at| (at - middle) * (at - middle).transpose()).sum();
        let mut extents = spread.symmetric_eigenvalues();
        extents.as_mut_slice().sort_by(f64::total_cmp);
        let variances = self.cloud.iter().map(|point| point.position.covariance.trace() / 3.0);
        let sigma = (variances.sum::<f64>() / self.cloud.len().max(1) as f64).sqrt();
        // The sum of the squared distances from the line.
        let off = (extents[0] + extents[1]).max(0.0).sqrt();
        (n >= 3 && sigma.is_finite() && off > 0.0).then(|| sigma / off)
    }

    /// What a search that needs no triangle makes of points near a line.
    fn near_a_line(
        &self,
        attempt: &Attempt,
        turn: f64,
        (solver, acceptance): (&dyn Solver, &Acceptance),
        rng: &mut dyn Rng,
    ) -> Option<String> {
        let clique = SEARCHES.build(&Choice::named("maximum-clique")).ok()?;
        let found = match attempt.identified.is_empty() {
            true => self.attempt(&*clique, solver, acceptance, rng).identified.len(),
            false => attempt.identified.len(),
        };
        (found >= 3).then(|| {
            format!(
                "{found} points are identified, but they lie near a line: the rotation about it is open (one sigma {:.0}°); add \
                 a point off the line",
                turn.to_degrees().min(180.0)
            )
        })
    }

    /// The candidate pairs, if they are few.
    fn few_candidates(&self) -> Option<Vec<(usize, usize)>> {
        let candidates = self.candidates().ok()?;
        let pairs: Vec<(usize, usize)> =
            candidates.lists.iter().enumerate().flat_map(|(i, list)| list.iter().map(move |&j| (i, j))).collect();
        (pairs.len() <= MAX_PAIRS).then_some(pairs)
    }

    /// The scale at which the cloud fits, if it fits at another one only.
    fn other_scale(
        &self,
        pairs: &[(usize, usize)],
        attempt: &Attempt,
        (search, solver, acceptance): (&dyn Search, &dyn Solver, &Acceptance),
        rng: &mut dyn Rng,
    ) -> Option<String> {
        let mut best: Option<Vec<Correspondence>> = None;
        for scale in self.likely_scales(pairs) {
            let other = self.scaled(scale, pairs).attempt(search, solver, acceptance, rng);
            let found = other.identified.len();
            let more = found > best.as_ref().map_or(attempt.identified.len(), Vec::len);
            if found >= 4 && more && 2 * found > self.model.len() && matches!(other.outcome, Outcome::Fix(_)) {
                best = Some(other.identified);
            }
        }
        best.map(|found| {
            // The scale of all these pairs is more exact than that of the two that proposed it.
            let exact = self.scaled(self.scale_of(&found), pairs).attempt(search, solver, acceptance, rng).identified;
            let found = if exact.len() > found.len() { exact } else { found };
            format!(
                "at {:.3} times its size the cloud fits {} of {} model points: check the baseline, the focal length and the \
                 units of rig and survey",
                self.scale_of(&found),
                found.len(),
                self.model.len()
            )
        })
    }

    /// The median ratio of the model's distances to those of the cloud.
    fn scale_of(&self, pairs: &[Correspondence]) -> f64 {
        let all = pairs.iter().enumerate().flat_map(|(k, a)| pairs[..k].iter().map(move |b| (a, b)));
        let mut ratios: Vec<f64> = all
            .map(|(a, b)| {
                let model = self.model[a.model].at.distance(&self.model[b.model].at);
                let cloud = self.cloud[a.cloud].position.at.distance(&self.cloud[b.cloud].position.at);
                model / cloud
            })
            .filter(|ratio| ratio.is_finite())
            .collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
    }

    /// The scales with most votes of distances, except those near one.
    fn likely_scales(&self, pairs: &[(usize, usize)]) -> Vec<f64> {
        let bins = (2.0 * WIDEST / BIN) as usize + 1;
        let mut votes = vec![0_u32; bins];
        for (k, &(i, j)) in pairs.iter().enumerate() {
            for &(a, b) in pairs[..k].iter().filter(|&&(a, b)| a != i && b != j) {
                let model = self.model[i].at.distance(&self.model[a].at);
                let cloud = self.cloud[j].position.at.distance(&self.cloud[b].position.at);
                let log = (model / cloud).ln();
                if log.abs() < WIDEST {
                    votes[((log + WIDEST) / BIN) as usize] += 1;
                }
            }
        }
        // Noise spreads a scale over neighbouring bins; the background grows with the density of ratios.
        let sum = |bin: usize, reach: usize| {
            votes[bin.saturating_sub(reach)..(bin + reach + 1).min(bins)].iter().sum::<u32>()
        };
        let score = |bin: usize| f64::from(sum(bin, 2)) - f64::from(sum(bin, 25)) * 5.0 / 51.0;
        let mut peaks: Vec<(f64, usize)> = (0..bins).map(|bin| (score(bin), bin)).collect();
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut chosen: Vec<usize> = Vec::new();
        let one = (WIDEST / BIN) as usize;
        for (_, bin) in peaks.into_iter().take_while(|(score, _)| *score > 2.0) {
            if bin.abs_diff(one) > 1 && chosen.iter().all(|other| other.abs_diff(bin) > 3) {
                chosen.push(bin);
            }
            if chosen.len() == TRIED {
                break;
            }
        }
        chosen.into_iter().map(|bin| ((bin as f64 + 0.5) * BIN - WIDEST).exp()).collect()
    }

    /// The problem with its cloud at another size, with the same candidates and without a prior.
    fn scaled(&self, scale: f64, pairs: &[(usize, usize)]) -> Self {
        let point = |point: &MeasuredPoint| MeasuredPoint {
            position: UncertainPoint {
                at: Point::from(point.position.at.coords * scale),
                covariance: point.position.covariance * (scale * scale),
            },
            pixels: None,
        };
        Self {
            cloud: self.cloud.iter().map(point).collect(),
            prior: None,
            putative: Some(pairs.to_vec()),
            ..self.clone()
        }
    }
}
