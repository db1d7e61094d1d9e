//! Families of identification problems with truth: a model, a cloud of noisy points and clutter, and
//! what is known beforehand, each a function of (seed, family, number).
//!
//! The laws are those of the development problems `a`–`g` (coherence-problem/1); what a family fixes
//! cycles with the number of the problem, the rest is drawn. All coordinates are rounded to 1 µm, as
//! the files have them.
//!
//! | family | model | cloud | known beforehand |
//! |---|---|---|---|
//! | a | 7–8 points on a box | M = 89, 2–8 visible; clutter over the scene or, in every second 63, all in shells | shell 0.2–0.5 m |
//! | b | 50 points on a box | M = 500–2000, 12–35 visible, σ 1–3 cm, in every second 9 three times as much in depth | shell 0.5 m |
//! | c | 20–50 points on a box | M = 100–300, 60 % visible | nothing |
//! | d | N = 100–10 000 points in a cube | the same, 50–99 % of them elsewhere | the pairs (i, i) |
//! | e | a lattice and four points off it | two thirds visible, its continuation, near misses, clutter | shell 0.4 m or nothing |
//! | f | 50 points on a box | M = 500–2000, 4–9 visible | shell 0.3–0.5 m |
//! | g | 50 points on a box | M = 500–2000, 6–20 visible, all clutter in shells | shell 0.5 m |
//!
//! An [absent](Presence::Absent) object has no visible points; its prior, the clutter about it and the
//! size of the cloud stay as they are.

mod boxes;
mod clutter;
mod lattice;
mod prior;
mod problem;
mod putative;
mod truth;

use std::str::FromStr;

pub use problem::{GeneratedPrior, GeneratedProblem};
pub use putative::PutativePairs;
pub use truth::{GeneratedParameters, GeneratedTruth};

use crate::stream::{Purpose, Stream};

/// A family of identification problems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// The paper's scale.
    A,
    /// A whole site.
    B,
    /// A site without a prior.
    C,
    /// Putative correspondences.
    D,
    /// A lattice with decoys.
    E,
    /// A site of which little is visible.
    F,
    /// A site with all clutter in its shells.
    G,
}

impl Family {
    /// All families, in order.
    pub const ALL: [Self; 7] = [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F, Self::G];

    /// Its name.
    pub fn name(self) -> &'static str {
        ["paper-scale", "site-scale", "no-prior", "putative", "lattice", "few-visible", "dense-clutter"][self as usize]
    }

    /// Its letter in `coherence-problem/1`.
    pub fn letter(self) -> &'static str {
        ["a", "b", "c", "d", "e", "f", "g"][self as usize]
    }
}

impl FromStr for Family {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|family| family.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("no family is called `{name}`; there are {names}")
        })
    }
}

/// Whether the object is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Presence {
    /// It is, and its visible points were measured.
    #[default]
    Present,
    /// It is not: the cloud is clutter.
    Absent,
}

/// A problem and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Generated {
    /// What a method may see.
    pub problem: GeneratedProblem,
    /// What only the judge may see.
    pub truth: GeneratedTruth,
}

impl Generated {
    /// The problem of this `number` in a family.
    pub fn new(family: Family, seed: u64, number: u64, presence: Presence) -> Self {
        let source = Source { family, seed, number, presence };
        match family {
            Family::D => putative::draw(&source),
            Family::E => lattice::draw(&source),
            _ => boxes::draw(&source),
        }
    }

    /// The problem of this `number` among those of family d, with pairs of another kind: of one seed and number the object,
    /// its pose and the noise are the same whatever the share of wrong pairs.
    pub fn of_pairs(pairs: &PutativePairs, seed: u64, number: u64) -> Self {
        putative::generated(&Source { family: Family::D, seed, number, presence: Presence::Present }, pairs)
    }
}

/// Where a problem comes from.
struct Source {
    family: Family,
    seed: u64,
    number: u64,
    presence: Presence,
}

/// What a stream of a problem is for: a change of one leaves the others as they are.
#[derive(Clone, Copy)]
enum Part {
    Cell,
    Model,
    Pose,
    Visible,
    Prior,
    Clutter,
    Noise,
    Order,
}

impl Source {
    fn stream(&self, part: Part) -> Stream {
        Stream::new(self.seed, self.number, 16 * self.family as u64 + part as u64, Purpose::Problem)
    }

    fn absent(&self) -> bool {
        self.presence == Presence::Absent
    }
}

#[cfg(test)]
mod tests;
