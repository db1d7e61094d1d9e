//! Families of generated coherence problems with truth: a model, a cloud of noisy points and clutter, and a prior.
//!
//! Each problem is a function of (seed, family, number). The distributions are those of the development problems
//! `a`–`g` (`coherence-problem/1`). Parameters of a family cycle with the problem number; the others are sampled. All
//! coordinates are rounded to 1 µm, as in the files. M is the size of the cloud, N that of the model.
//!
//! | family | model | cloud | prior |
//! |---|---|---|---|
//! | a paper-scale | 7–8 points on a box | M = 89, 2–8 visible; clutter anywhere or all in gates | gate 0.2–0.5 m |
//! | b site-scale | 50 points on a box | M = 500–2000, 12–35 visible, σ 1–3 cm, in part 3σ in depth | gate 0.5 m |
//! | c no-prior | 20–50 points on a box | M = 100–300, 60 % visible | none |
//! | d putative | N = 100–10 000 points in a cube | M = N, 50–99 % of them outliers | the pairs (i, i) |
//! | e lattice | a lattice and four points off it | 2/3 visible, continued; near misses, clutter | gate 0.4 m or none |
//! | f few-visible | 50 points on a box | M = 500–2000, 4–9 visible | gate 0.3–0.5 m |
//! | g dense-clutter | 50 points on a box | M = 500–2000, 6–20 visible, all clutter in gates | gate 0.5 m |
//!
//! The clutter of family a alternates every 63 problems; the depth noise of family b alternates every 9. An
//! [absent](Presence::Absent) object has no visible points; its prior, the clutter about it and the size of the cloud
//! do not change. In b and f no clutter lies within 0.15 and 0.18 m of a hidden point's place, and thus of any place of
//! an absent object; that of a [replaced](Presence::Replaced) one may hold clutter.

mod boxes;
mod clutter;
mod family;
mod generated;
mod lattice;
mod prior;
mod problem;
mod putative;
mod truth;

use family::Source;
pub use family::{Family, Presence};
pub use generated::Generated;
pub use problem::{GeneratedPrior, GeneratedProblem};
pub use putative::PutativePairs;
pub use truth::{GeneratedParameters, GeneratedTruth};

impl Generated {
    /// Generates problem `number` of a family.
    pub fn new(family: Family, seed: u64, number: u64, presence: Presence) -> Self {
        let source = Source { family, seed, number, presence };
        match family {
            Family::D => putative::draw(&source),
            Family::E => lattice::draw(&source),
            _ => boxes::draw(&source),
        }
    }

    /// Generates problem `number` of family d (putative) with other parameters. The object, its pose and the noise
    /// depend on seed and number alone, not on the fraction of outliers.
    pub fn of_pairs(pairs: &PutativePairs, seed: u64, number: u64) -> Self {
        putative::generated(&Source { family: Family::D, seed, number, presence: Presence::Present }, pairs)
    }
}

#[cfg(test)]
mod tests;
