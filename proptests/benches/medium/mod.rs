//! A representative problem of each family.

use seafix_referencing::problem_file::CoherenceProblem;
use seafix_simulation::families::{Family, Generated, Presence};

/// The numbers of the problems among those of seed 1.
pub(crate) const MEDIUM: [(Family, u64); 7] =
    [(Family::A, 10), (Family::B, 4), (Family::C, 4), (Family::D, 25), (Family::E, 1), (Family::F, 4), (Family::G, 7)];

/// The problem at this index.
pub(crate) fn problem(place: usize) -> CoherenceProblem {
    let (family, number) = MEDIUM[place];
    Generated::new(family, 1, number, Presence::Present).problem.problem()
}
