//! The best of several poses, the last step of every strategy that tests hypotheses.

use seafix_geometry::{Camera, Object, Transform};

use super::{
    grow::{conclude_within, max_possible, so_far},
    identification::{Identification, Rejected},
    limits::NEEDED,
    pose::{fraction, refined},
};
use crate::problem::{Correspondence, Problem};

/// The pose with the greatest score so far.
#[derive(Debug, Default)]
pub(super) struct BestPose {
    score: f64,
    pose: Option<Transform<Object, Camera>>,
}

impl BestPose {
    /// Keeps a finite pose if its score is positive and greater; among equals the first. True if it was kept.
    pub(super) fn offer(&mut self, score: f64, pose: Transform<Object, Camera>) -> bool {
        let better = score > self.score && pose.is_finite();
        if better {
            (self.score, self.pose) = (score, Some(pose));
        }
        better
    }

    /// The answer: the pairs that the pose explains, after alternating fit and choice.
    ///
    /// `ended` is the budget if the search spent it.
    ///
    /// # Errors
    /// [`Rejected::NotFound`] without a pose, [`Rejected::Mirrored`], [`Rejected::Budget`].
    pub(super) fn conclude(
        self,
        problem: &Problem<'_>,
        vertices: &[Correspondence],
        orientation: bool,
        mut pair_tests: u64,
        ended: Option<u64>,
    ) -> Result<Identification, Rejected> {
        let spent = pair_tests;
        let Some(pose) = self.pose else {
            let bound = max_possible(problem);
            return match ended {
                None => Err(Rejected::NotFound { bound, needed: NEEDED }),
                Some(budget) => so_far(problem, orientation, Rejected::Budget { budget, best: 0, bound, pair_tests }),
            };
        };
        let (_, ranked) = refined(problem, vertices, pose, &mut pair_tests);
        conclude_within(problem, &ranked, orientation, pair_tests, ended.map(|budget| (budget, spent)))
    }
}

/// The sum of `worth` over the model points, and the number of these within tolerance.
///
/// `worth` is a function of the residual of each model point's best candidate, as a fraction of its tolerance. The
/// vertices are sorted by model point.
pub(super) fn scored(
    problem: &Problem<'_>,
    vertices: &[Correspondence],
    pose: &Transform<Object, Camera>,
    worth: impl Fn(f64) -> f64,
) -> (f64, usize) {
    let best =
        |same: &[Correspondence]| same.iter().map(|&pair| fraction(problem, pose, pair)).fold(f64::INFINITY, f64::min);
    let within = vertices.chunk_by(|a, b| a.model == b.model).map(best).filter(|&off| off <= 1.0);
    within.fold((0.0, 0), |(sum, count), off| (sum + worth(off), count + 1))
}
