//! Families, and the origin of a problem.

use std::str::FromStr;

use crate::stream::{Purpose, Stream};

/// A family of generated coherence problems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// Paper-scale: the size of the paper's scenes.
    A,
    /// Site-scale: a complete site.
    B,
    /// No-prior: a site without a prior pose.
    C,
    /// Putative correspondences.
    D,
    /// Lattice: a lattice with decoys.
    E,
    /// Few-visible: a site of which few points are visible.
    F,
    /// Dense-clutter: a site with all clutter in the gates.
    G,
}

impl Family {
    /// All families, in order.
    pub const ALL: [Self; 7] = [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F, Self::G];

    /// Name of the family.
    pub fn name(self) -> &'static str {
        ["paper-scale", "site-scale", "no-prior", "putative", "lattice", "few-visible", "dense-clutter"][self as usize]
    }

    /// Letter of the family in `coherence-problem/1`.
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
            format!("unknown family `{name}`; give one of {names}")
        })
    }
}

/// Presence of the object in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Presence {
    /// The object is there, and its visible points were measured.
    #[default]
    Present,
    /// The object is absent, and the cloud is clutter.
    Absent,
    /// The object is absent, and clutter lies on a box of other dimensions in its place (families a, b, c, f and g; the
    /// others as [`Absent`](Self::Absent)). No place is kept clear of clutter.
    Replaced,
}

/// The origin of a problem.
pub(super) struct Source {
    pub(super) family: Family,
    pub(super) seed: u64,
    pub(super) number: u64,
    pub(super) presence: Presence,
}

/// A part of a problem with a stream of its own, so that a change of one part leaves the others unchanged.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Cell,
    Model,
    Pose,
    Visible,
    Prior,
    Clutter,
    Noise,
    Order,
    Replacement,
}

impl Source {
    pub(super) fn stream(&self, part: Part) -> Stream {
        Stream::new(self.seed, self.number, 16 * self.family as u64 + part as u64, Purpose::Problem)
    }

    pub(super) fn absent(&self) -> bool {
        self.presence != Presence::Present
    }
}
