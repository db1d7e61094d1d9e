//! Other assignments of the measured points of a fix, by self-symmetry of the model.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Transform};

use super::{
    admitted::Admitted,
    hypothesis::{Hypothesis, by_score},
    judge::Judge,
    outcome::Outcome,
    probability::Probability,
};
use crate::{
    ablation::AcceptanceTest,
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::{kabsch::Kabsch, solver::Solver},
};

/// Maximum number of pairs of model points for the first two measured points; beyond it no symmetry is sought.
const MAX_BASES: usize = 1_000_000;
/// Maximum number of assignments of one set; more are not needed to call it ambiguous.
const MAX_SYMMETRIC: usize = 64;
/// Number of poses from which an assignment is made: that of three points, and those of all assigned points.
const ROUNDS: usize = 2;

impl Judge<'_> {
    /// The outcome under the model's self-symmetry: ambiguous if other model points fit the measurements.
    ///
    /// If a motion maps the identified model points onto other model points, the poses before and after it explain the
    /// same measurements. Candidates, residuals, precision, prior and visible sides decide between them as between any
    /// sets; an assignment that passes all tests is an alternative. A search that weighs evidence accepts the fix if
    /// the probability of all alternatives, by the likelihood of the pairs and the prior, leaves P(wrong) within
    /// [`Acceptance::max_p_wrong`](super::Acceptance::max_p_wrong); it is deducted from the risk of the protection
    /// levels. Other searches accept no alternative. An assignment outside the candidates is weighted by the
    /// probability that the proposer confused the points ([`Judge::mislabeled`]).
    ///
    /// `probability` becomes that of the outcome.
    pub(super) fn check_self_symmetry(
        &self,
        mut outcome: Outcome,
        weighs: bool,
        probability: &mut Probability,
    ) -> Outcome {
        let Outcome::Fix(fix) = &mut outcome else { return outcome };
        let max = self.acceptance.max_p_wrong;
        let admitted = self.admitted(&fix.pairs);
        let sets = self.symmetric_sets(&fix.pairs, &admitted);
        if sets.is_empty() {
            return outcome;
        }
        let Ok(own) = self.hypothesis(&fix.pairs) else { return outcome };
        let mut possible: Vec<Hypothesis> = sets.iter().filter_map(|pairs| self.hypothesis(pairs).ok()).collect();
        possible.retain(|other| self.faces(other) && self.residuals(other).is_ok());
        // In order of falling score: an assignment near a known one is the same pose.
        possible.sort_by(by_score);
        let (mut near, mut others): (Vec<Hypothesis>, Vec<Hypothesis>) = (Vec::new(), Vec::new());
        for mut other in possible {
            if others.iter().any(|known| !self.apart(&known.pose, &other.pose))
                || self.precise_and_near(&mut other).is_err()
            {
                continue;
            }
            if self.apart(&own.pose, &other.pose) { &mut others } else { &mut near }.push(other);
        }
        let fraction = |other: &Hypothesis| (other.score - own.score).exp();
        self.cover(fix, near.iter().map(|other| (fraction(other), &other.pose)));
        let mut weight = 0.0;
        others.retain(|other| {
            let mislabeled = if admitted.proposed { self.mislabeled(&own, other) } else { 1.0 };
            let of_other = mislabeled * fraction(other);
            weight += of_other;
            weighs || mislabeled >= 1.0 || !max.allows(of_other / (1.0 + of_other))
        });
        if weighs {
            // The search may have counted some of them among the poses elsewhere; counting twice is conservative.
            *probability = probability.beside(weight / (1.0 + weight));
        }
        if others.is_empty() || (weighs && max.allows(probability.wrong)) {
            if weight > 0.0 && weighs {
                self.protected(fix, probability.wrong);
            }
            return outcome;
        }
        Outcome::Ambiguous(std::iter::once(own).chain(others).map(Hypothesis::alternative).collect())
    }

    /// All assignments of the same measured points to other model points.
    ///
    /// Alignment (Huttenlocher and Ullman, *Recognizing solid objects by alignment with an image*, 1990): a wide
    /// triangle of the measured points is placed on every coherent triangle of the model, and each other point must
    /// then lie at a model point of its own. The points are taken at the places of their model points, without noise,
    /// so that model points side by side are distinguished.
    fn symmetric_sets(&self, pairs: &[Correspondence], admitted: &Admitted) -> BTreeSet<Vec<Correspondence>> {
        let mut found = BTreeSet::new();
        let mut cloud = self.problem.cloud.to_vec();
        pairs.iter().for_each(|pair| cloud[pair.cloud].position.at = self.problem.model[pair.model].at.coords.into());
        let exact = &Problem { cloud: &cloud, ..*self.problem };
        let Some(base) = wide(exact, pairs) else { return found };
        let [first, second, third] = base.map(|cloud| &admitted.models[&cloud]);
        if first.len().saturating_mul(second.len()) > MAX_BASES {
            return found;
        }
        let at = |model: usize, place: usize| Correspondence { model, cloud: base[place] };
        let known: BTreeSet<&Correspondence> = pairs.iter().collect();
        let measured = |a: usize, b: usize| exact.measured(base[a], base[b]);
        let [near, far, opposite] = [measured(0, 1), measured(0, 2), measured(1, 2)];
        let meet =
            |a: Correspondence, b: Correspondence, measured: f64| a.model != b.model && exact.agrees(a, b, measured);
        for &i in first {
            let seconds: Vec<usize> = second.iter().copied().filter(|&j| meet(at(i, 0), at(j, 1), near)).collect();
            if seconds.is_empty() {
                continue;
            }
            let thirds: Vec<usize> = third.iter().copied().filter(|&k| meet(at(i, 0), at(k, 2), far)).collect();
            for &j in &seconds {
                for &k in thirds.iter().filter(|&&k| meet(at(j, 1), at(k, 2), opposite)) {
                    let three = [at(i, 0), at(j, 1), at(k, 2)];
                    if three.iter().all(|pair| known.contains(pair)) {
                        continue;
                    }
                    found.extend(completed(exact, three, pairs, admitted));
                    if found.len() >= MAX_SYMMETRIC {
                        return found;
                    }
                }
            }
        }
        found
    }

    /// Whether the camera sees the identified points from their visible sides.
    pub(super) fn faces(&self, hypothesis: &Hypothesis) -> bool {
        let camera = hypothesis.pose.translation();
        !self.acceptance.with(AcceptanceTest::Visibility)
            || hypothesis.pairs.iter().all(|pair| self.problem.model[pair.model].shows_itself(&camera))
    }
}

/// Three distant measured points: one far from the centroid, the farthest from it, and the one with the largest
/// triangle.
fn wide(problem: &Problem<'_>, pairs: &[Correspondence]) -> Option<[usize; 3]> {
    let place = |pair: &Correspondence| problem.cloud[pair.cloud].position.at.coords;
    let middle = pairs.iter().map(place).sum::<Vector3<f64>>() / pairs.len() as f64;
    let largest = |size: &dyn Fn(Vector3<f64>) -> f64| {
        pairs.iter().max_by(|a, b| size(place(a)).total_cmp(&size(place(b))).then_with(|| b.cmp(a)))
    };
    let first = largest(&|at| (at - middle).norm())?;
    let second = largest(&|at| (at - place(first)).norm())?;
    let side = place(second) - place(first);
    let third = largest(&|at| side.cross(&(at - place(first))).norm())?;
    let three = [first.cloud, second.cloud, third.cloud];
    (three[0] != three[1] && three[0] != three[2] && three[1] != three[2]).then_some(three)
}

/// The assignment of all measured points of `pairs` that extends these three.
///
/// `None` unless each other point lies at a model point of its own. The pose of three points alone may put two points
/// beside one model point, so that it is computed again from all points that were assigned, nearest first.
fn completed(
    problem: &Problem<'_>,
    three: [Correspondence; 3],
    pairs: &[Correspondence],
    admitted: &Admitted,
) -> Option<Vec<Correspondence>> {
    let mut possible: Vec<Correspondence> = Vec::new();
    for cloud in pairs.iter().map(|pair| pair.cloud).filter(|cloud| three.iter().all(|pair| pair.cloud != *cloud)) {
        let before = possible.len();
        possible.extend(coherent(problem, cloud, &three, &admitted.models[&cloud]));
        if possible.len() == before {
            return None;
        }
    }
    let mut set = three.to_vec();
    for _ in 0..ROUNDS {
        let data = Observations::of(&set, problem.model, problem.cloud, None);
        let pose = Kabsch::default().solve(&data).ok()?;
        set = nearest_first(problem, &pose, three, &possible);
    }
    set.sort_unstable();
    (set.len() == pairs.len()).then_some(set)
}

/// The admitted model points of a measured point that are coherent with the three.
fn coherent(
    problem: &Problem<'_>,
    cloud: usize,
    three: &[Correspondence; 3],
    admitted: &[usize],
) -> impl Iterator<Item = Correspondence> {
    let measured = three.map(|pair| (pair, problem.measured(pair.cloud, cloud)));
    let own = move |&model: &usize| Correspondence { model, cloud };
    let agrees = move |own: &Correspondence| {
        let agrees =
            |&(pair, measured): &(Correspondence, f64)| pair.model != own.model && problem.agrees(pair, *own, measured);
        measured.iter().all(agrees)
    };
    admitted.iter().map(own).filter(agrees)
}

/// The three with each other measured point at the nearest free model point under a pose, nearest pairs first.
fn nearest_first(
    problem: &Problem<'_>,
    pose: &Transform<Object, Camera>,
    three: [Correspondence; 3],
    possible: &[Correspondence],
) -> Vec<Correspondence> {
    let apart = |pair: &Correspondence| {
        let place = *pose * problem.cloud[pair.cloud].position.at;
        (problem.model[pair.model].at - place).norm_squared()
    };
    let mut ranked: Vec<(f64, Correspondence)> = possible.iter().map(|pair| (apart(pair), *pair)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut set = three.to_vec();
    let mut models: BTreeSet<usize> = three.iter().map(|pair| pair.model).collect();
    let mut clouds = BTreeSet::new();
    for (_, pair) in ranked {
        if !models.contains(&pair.model) && clouds.insert(pair.cloud) {
            models.insert(pair.model);
            set.push(pair);
        }
    }
    set
}
