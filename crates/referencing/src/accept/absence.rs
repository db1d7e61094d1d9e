//! Whether the object is there at all.

use std::cell::OnceCell;

use super::{RejectionReason, judge::Judge};
use crate::{
    Identification, PosteriorProbabilities, Problem,
    a_contrario::{AContrario, dimension},
};

/// What is asked of a frame before the object is believed to be there.
pub(super) struct Absence<'a> {
    judge: &'a Judge<'a>,
    found: &'a Identification,
    probabilities: &'a PosteriorProbabilities,
    a_contrario: &'a AContrario<'a>,
    /// Looked at where it decides, and once.
    fills_space: OnceCell<bool>,
    rare: OnceCell<bool>,
}

impl<'a> Absence<'a> {
    pub(super) fn of(
        judge: &'a Judge<'a>,
        found: &'a Identification,
        probabilities: &'a PosteriorProbabilities,
        a_contrario: &'a AContrario<'a>,
    ) -> Self {
        Self { judge, found, probabilities, a_contrario, fills_space: OnceCell::new(), rare: OnceCell::new() }
    }

    /// Why the object is not believed to be there when its absence has this probability; `None` where it is.
    ///
    /// A pattern that looks like the object is no chance: how sure its odds are does not depend on where clutter lies. And shuffled
    /// partners that often make a set as large at this very pose are an absence that the evidence does not know of.
    pub(super) fn refusal(&self, absent: f64) -> Option<RejectionReason> {
        let (min, max) = self.limits();
        let a_contrario = absent - self.probabilities.alike;
        let limit = if min < max && a_contrario > min && self.fills_space() { max } else { min };
        // Written so that a NaN is refused too.
        let likely = a_contrario <= limit && absent <= max;
        if (likely && self.a_contrario.at_their_pose() <= limit) || self.is_rare() {
            return None;
        }
        let (probability, limit) = match (likely, a_contrario <= limit) {
            (true, _) => (self.a_contrario.at_their_pose().min(1.0), limit),
            (false, true) => (absent, max),
            (false, false) => (a_contrario, limit),
        };
        Some(RejectionReason::Absent { probability, limit })
    }

    /// The largest probability of absence with which any pose is believed.
    pub(super) fn max(&self) -> f64 {
        self.limits().1
    }

    /// The largest probabilities of absence with which a pose is believed: where clutter lies on lines and surfaces, and
    /// where it fills space; of models as small as the limit is stated for they are one.
    ///
    /// Every number of visible points is equally likely beforehand, so that of a larger model each has less, and clutter
    /// that fills space shows a stated evidence the more seldom. On lines and surfaces the evidence, a sum of as many terms
    /// as points are visible, is too sure by something of each: the more, the larger the model.
    fn limits(&self) -> (f64, f64) {
        let larger = (self.judge.problem.model.len() + 1) as f64 / STATED_FOR;
        let stated = self.judge.acceptance.absence;
        if larger <= 1.0 {
            return (stated, stated);
        }
        // The lesser by its odds: of what is stated to be hardly a limit at all, so little is asked of any model.
        let odds = stated / (1.0 - stated) / (larger * larger * larger.sqrt());
        (odds / (1.0 + odds), (stated * larger).min(MAX_ABSENCE.max(stated)))
    }

    /// Whether the candidates that are not the object's fill space, as the evidence takes clutter to do.
    fn fills_space(&self) -> bool {
        let fills = || dimension(self.judge.problem, &self.found.pairs).is_some_and(|of| of >= FILLS_SPACE);
        *self.fills_space.get_or_init(fills)
    }

    /// Whether chance gives sets as good so rarely that the pose is believed although absence is not as improbable as it
    /// should be.
    ///
    /// The probability of absence takes every number of visible points to be equally likely, which of a large model makes
    /// few visible ones improbable beforehand; chance is counted without. Only of putative pairs whose points fill space is
    /// its count good enough for that: partners that were shuffled lie wherever the cloud does, while clutter in shells lies
    /// on edges that look like the object's.
    fn is_rare(&self) -> bool {
        let Problem { cloud, candidates, prior, .. } = self.judge.problem;
        let acceptance = self.judge.acceptance;
        let putative = || prior.is_none() && candidates.lists.iter().any(|list| list.len() < cloud.len());
        *self.rare.get_or_init(|| {
            putative()
                && self.probabilities.absent <= IMPROBABLE
                && self.probabilities.alike <= acceptance.absence
                && self.fills_space()
                && self.a_contrario.sets_as_good() <= acceptance.rare
        })
    }
}

// These four are no settings: they belong to the scale on which `acceptance.absence` and `acceptance.rare` are stated, and were
// chosen with their defaults on drawn problems. Whoever wants to be stricter or laxer moves those two.

/// An object is not believed whose absence is more probable than this.
const IMPROBABLE: f64 = 0.05;
/// The greatest limit of the probability of absence, whatever the model.
const MAX_ABSENCE: f64 = 0.01;
/// Clutter of fewer dimensions lies on lines and surfaces.
const FILLS_SPACE: f64 = 2.3;
/// The number of points, and one, of the models that [`Acceptance::absence`](super::Acceptance::absence) is stated for.
const STATED_FOR: f64 = 9.0;
