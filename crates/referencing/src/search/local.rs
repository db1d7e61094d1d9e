//! The neighbourhood of one vertex as a small graph.

use super::{
    association::Association,
    bitset::{BitMatrix, BitSet, degrees},
};
use crate::lanes::{LANES, ones_of};

/// The subgraph of the neighbours of one vertex.
#[derive(Debug, Default)]
pub(super) struct Local {
    /// Their indices in the full graph.
    pub(super) vertices: Vec<usize>,
    pub(super) adjacency: BitMatrix,
    /// Their model points and cloud points, renumbered from 0.
    models: Vec<usize>,
    clouds: Vec<usize>,
}

/// Reusable memory for the construction of neighbourhoods.
#[derive(Debug)]
pub(super) struct Workshop {
    /// The local index of each vertex of the full graph.
    place: Vec<u32>,
    /// The local index of each model point and each cloud point.
    models: Names,
    clouds: Names,
    degrees: Vec<usize>,
}

impl Workshop {
    pub(super) fn of(graph: &Association) -> Self {
        let max =
            |of: fn(&crate::problem::Correspondence) -> usize| graph.vertices.iter().map(of).max().map_or(0, |m| m + 1);
        Self {
            place: vec![0; graph.vertices.len()],
            models: Names::upto(max(|pair| pair.model)),
            clouds: Names::upto(max(|pair| pair.cloud)),
            degrees: Vec::new(),
        }
    }
}

impl Local {
    /// The subgraph of those `members` that can be in a clique of `min` with their common neighbour.
    ///
    /// Each needs `min − 2` of the others as neighbours. They are sorted by descending degree, so that colouring begins
    /// with the well-connected. Empty if they are too few.
    pub(super) fn of(graph: &Association, mut members: BitSet, min: usize, work: &mut Workshop) -> Self {
        let mut kept: Vec<usize> = members.iter().collect();
        loop {
            if kept.len() + 1 < min {
                return Self::default();
            }
            degrees(&graph.adjacency, &members, &kept, &mut work.degrees);
            let before = kept.len();
            let mut degree = work.degrees.iter();
            kept.retain(|&v| {
                let stays = degree.next().is_some_and(|degree| degree + 2 >= min);
                if !stays {
                    members.remove(v);
                }
                stays
            });
            if kept.len() == before {
                break;
            }
        }
        let mut order: Vec<(usize, usize)> = work.degrees.iter().copied().zip(kept).collect();
        order.sort_unstable_by_key(|&(degree, v)| (std::cmp::Reverse(degree), v));
        let vertices: Vec<usize> = order.into_iter().map(|(_, v)| v).collect();
        vertices.iter().enumerate().for_each(|(i, &v)| work.place[v] = i as u32);
        let mut adjacency = BitMatrix::zeros(vertices.len());
        for (i, &v) in vertices.iter().enumerate() {
            let row = graph.adjacency.row(v);
            let local = adjacency.row_mut(i);
            for (index, (word, other)) in members.words().iter().zip(row).enumerate() {
                for w in ones_of(index * LANES, word & other) {
                    let place = work.place[w] as usize;
                    local[place / 64] |= 1 << (place % 64);
                }
            }
        }
        let models = work.models.numbered(vertices.iter().map(|&v| graph.vertices[v].model));
        let clouds = work.clouds.numbered(vertices.iter().map(|&v| graph.vertices[v].cloud));
        Self { vertices, adjacency, models, clouds }
    }

    /// The candidate with most neighbours among the candidates; among equals the first of the full graph.
    pub(super) fn best_connected(&self, candidates: &BitSet) -> Option<usize> {
        let worth = |v: usize| (candidates.common(self.adjacency.row(v)), std::cmp::Reverse(self.vertices[v]));
        candidates.iter().max_by_key(|&v| worth(v))
    }

    /// The n-partite bound: the number of different model points and of different cloud points among the candidates.
    pub(super) fn partite(&self, candidates: &BitSet) -> usize {
        let count = self.vertices.len();
        let (mut models, mut clouds) = (BitSet::empty(count), BitSet::empty(count));
        for v in candidates.iter() {
            models.insert(self.models[v]);
            clouds.insert(self.clouds[v]);
        }
        models.len().min(clouds.len())
    }

    /// Greedy colouring: the vertices with colours of at least `min`, in ascending order of colour.
    ///
    /// A clique among the vertices up to one of them has at most as many members as its colour.
    pub(super) fn colour(&self, candidates: &BitSet, min: usize) -> Vec<(usize, usize)> {
        let mut coloured = Vec::new();
        let mut rest = candidates.clone();
        let mut colour = 0;
        while !rest.is_empty() {
            colour += 1;
            let mut free = rest.clone();
            let mut from = 0;
            while let Some(vertex) = free.next(from) {
                free.subtract(self.adjacency.row(vertex), vertex);
                rest.remove(vertex);
                from = vertex + 1;
                if colour >= min {
                    coloured.push((vertex, colour));
                }
            }
        }
        coloured
    }
}

/// A renumbering of arbitrary indices from 0.
#[derive(Debug)]
struct Names {
    /// The number of each index, and the round in which it was assigned.
    given: Vec<(u32, u32)>,
    round: u32,
}

impl Names {
    fn upto(limit: usize) -> Self {
        Self { given: vec![(0, 0); limit], round: 0 }
    }

    fn numbered(&mut self, names: impl Iterator<Item = usize>) -> Vec<usize> {
        self.round += 1;
        let mut next = 0;
        names
            .map(|name| {
                let (number, round) = &mut self.given[name];
                if *round != self.round {
                    (*number, *round) = (next, self.round);
                    next += 1;
                }
                *number as usize
            })
            .collect()
    }
}
