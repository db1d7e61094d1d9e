//! Exact cliques of the association graph, largest first, within a budget.

use std::collections::{HashMap, HashSet};

use super::{
    association::Association,
    bitset::{BitMatrix, BitSet},
    orientation::Sense,
};
use crate::Problem;

/// Up to this many points every four are tested for orientation while the set grows.
pub(super) const MOST_ORIENTED: usize = 40;
/// Further points are tested against the first so many only (four of 500 points are 2.6 · 10⁹), and
/// the answer is proved by a complete test at the end, or not called optimal.
const FEW_ORIENTED: usize = 16;

/// The cliques found and what is proved about the others.
#[derive(Debug)]
pub(super) struct Cliques {
    /// The largest cliques met, up to the cap; vertices ascending.
    pub(super) found: Vec<Vec<usize>>,
    /// Whether these are all of their size.
    pub(super) all: bool,
    /// No admissible clique is larger; equal to the size found when the search was complete.
    pub(super) bound: usize,
    /// Whether the search ended by itself.
    pub(super) complete: bool,
}

/// Branch and bound over the cliques that `admits` allows.
///
/// Each vertex in turn, from the densest part of a degeneracy order, with its later neighbours as
/// one small graph; there greedy colouring bounds the size (Tomita and Seki, 2003; San Segundo et al.,
/// *An exact bit-parallel algorithm for the maximum clique problem*, 2011), and before it the n-partite
/// bound: no more members than there are different model points, nor than different cloud points.
/// Orientation removes vertices while the clique grows; both bounds hold without it, so the answer
/// stays exact.
pub(super) struct Search<'a> {
    problem: &'a Problem<'a>,
    graph: &'a Association,
    /// What fours are refused.
    sense: Sense,
    /// Tests left: a vertex coloured, or four points tested for orientation.
    left: u64,
    order: Vec<usize>,
    core: Vec<usize>,
    /// Least size that is still of interest.
    least: usize,
    /// The largest cliques so far.
    found: Vec<Vec<usize>>,
    /// With 1 the first of the largest is kept, with more all of the size of interest.
    cap: usize,
}

/// The end of a search before its time.
struct Stop;

impl<'a> Search<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, graph: &'a Association, sense: Sense, budget: u64) -> Self {
        let (order, core) = degeneracy(graph.vertices.len(), &graph.adjacency);
        Self { problem, graph, sense, left: budget, order, core, least: 1, found: Vec::new(), cap: 1 }
    }

    /// Tests not yet spent.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    /// Refuses other fours from here on.
    pub(super) fn set_sense(&mut self, sense: Sense) {
        self.sense = sense;
    }

    /// The largest cliques of at least `least` members; of those that tie, no more than `cap`.
    ///
    /// First one of the largest and the proof that none is larger, then what ties with it, with the
    /// budget that is left.
    pub(super) fn run(&mut self, least: usize, cap: usize) -> Cliques {
        (self.least, self.cap, self.found) = (least.max(1), 1, Vec::new());
        self.greedy();
        let mut later = BitSet::empty(self.graph.vertices.len());
        let mut open = Vec::new();
        let (mut complete, mut bound) = (true, 0);
        for position in (0..self.order.len()).rev() {
            let vertex = self.order[position];
            let tie = self.tie();
            // Cores do not grow towards the front of the order: nothing large is left.
            if self.core[vertex] + 1 < tie {
                break;
            }
            let mut neighbours = later.clone();
            neighbours.intersect(self.graph.adjacency.row(vertex));
            later.insert(vertex);
            let local = Local::of(self.graph, neighbours, tie);
            if local.vertices.len() + 1 >= tie {
                open.push(position);
            }
            if self.within(vertex, &local).is_err() {
                (complete, bound) = (false, self.core[vertex] + 1);
                break;
            }
        }
        let all = complete && self.ties(&open, cap);
        let mut found = std::mem::take(&mut self.found);
        found.sort();
        let best = found.first().map_or(0, Vec::len);
        Cliques { found, all, bound: bound.min(self.partite()).max(best), complete }
    }

    /// The size of the largest so far, or the least that is of interest.
    fn tie(&self) -> usize {
        self.found.first().map_or(self.least, Vec::len)
    }

    /// Adds all cliques as large as the largest, from the vertices at these places of the order;
    /// whether all were met.
    fn ties(&mut self, open: &[usize], cap: usize) -> bool {
        if cap <= 1 || self.found.is_empty() {
            return false;
        }
        (self.least, self.cap) = (self.tie(), cap);
        let first = self.found.pop().expect("there is one");
        let mut place = vec![0; self.order.len()];
        self.order.iter().enumerate().for_each(|(position, &vertex)| place[vertex] = position);
        let mut all = true;
        for &position in open {
            let vertex = self.order[position];
            let mut neighbours = BitSet::empty(place.len());
            self.graph.adjacency.ones(vertex).filter(|&w| place[w] > position).for_each(|w| neighbours.insert(w));
            let local = Local::of(self.graph, neighbours, self.least);
            if self.within(vertex, &local).is_err() {
                all = false;
                break;
            }
        }
        if !self.found.contains(&first) {
            self.found.push(first);
        }
        all
    }

    /// The n-partite bound of the whole graph.
    fn partite(&self) -> usize {
        distinct(self.graph.vertices.iter().map(|pair| pair.model))
            .min(distinct(self.graph.vertices.iter().map(|pair| pair.cloud)))
    }

    /// A large clique at once, so that the bounds cut from the start: from some of the densest
    /// vertices, always the neighbour with most neighbours among those that remain.
    fn greedy(&mut self) {
        const STARTS: usize = 24;
        let mut starts: Vec<usize> = self.order.clone();
        starts.sort_by_key(|&vertex| std::cmp::Reverse((self.core[vertex], self.graph.adjacency.degree(vertex))));
        // A quarter of the budget at most: the proof needs the rest.
        let reserve = self.left - self.left / 4;
        for &start in starts.iter().take(STARTS) {
            if self.core[start] + 1 < self.least {
                return;
            }
            let mut neighbours = BitSet::full(self.graph.vertices.len());
            neighbours.intersect(self.graph.adjacency.row(start));
            let local = Local::of(self.graph, neighbours, self.least);
            let mut clique = vec![start];
            let mut candidates = BitSet::full(local.vertices.len());
            while let Some(next) = local.best_connected(&candidates) {
                candidates.remove(next);
                if self.left > reserve && !self.refuses(&clique, local.vertices[next]) {
                    candidates.intersect(local.adjacency.row(next));
                    clique.push(local.vertices[next]);
                }
            }
            if clique.len() >= self.least {
                self.keep(&clique);
            }
            if self.left <= reserve {
                return;
            }
        }
    }

    /// Whether a vertex makes a refused four with some three members of the clique.
    fn refuses(&mut self, clique: &[usize], vertex: usize) -> bool {
        if self.sense == Sense::Any {
            return false;
        }
        let members = decisive_members(clique);
        let vertices = &self.graph.vertices;
        let mut tests = 0;
        let refused = members.iter().enumerate().any(|(i, &a)| {
            members[..i].iter().enumerate().any(|(k, &b)| {
                members[..k].iter().any(|&c| {
                    tests += 1;
                    self.sense.refuses(self.problem, [vertices[a], vertices[b], vertices[c], vertices[vertex]])
                })
            })
        });
        self.left = self.left.saturating_sub(tests);
        refused
    }

    fn keep(&mut self, clique: &[usize]) {
        let mut clique = clique.to_vec();
        clique.sort_unstable();
        if self.cap == 1 {
            self.least = clique.len() + 1;
            self.found.clear();
        }
        self.found.push(clique);
    }

    /// The cliques of `vertex` and some of its later neighbours.
    fn within(&mut self, vertex: usize, local: &Local) -> Result<(), Stop> {
        if self.least <= 1 {
            self.keep(&[vertex]);
        }
        if local.vertices.len() + 1 < self.least {
            return Ok(());
        }
        self.expand(local, &mut vec![vertex], BitSet::full(local.vertices.len()))
    }

    fn expand(&mut self, local: &Local, clique: &mut Vec<usize>, mut candidates: BitSet) -> Result<(), Stop> {
        let needed = |search: &Self| search.least.saturating_sub(clique.len());
        if local.partite(&candidates) < needed(self) {
            return Ok(());
        }
        let coloured = local.colour(&candidates, needed(self).max(1));
        self.spend(candidates.len() as u64)?;
        for (vertex, colour) in coloured.into_iter().rev() {
            if colour < self.least.saturating_sub(clique.len()) {
                return Ok(());
            }
            let mut next = candidates.clone();
            next.intersect(local.adjacency.row(vertex));
            candidates.remove(vertex);
            self.orient(local, clique, local.vertices[vertex], &mut next)?;
            clique.push(local.vertices[vertex]);
            if clique.len() >= self.least {
                self.keep(clique);
                if self.cap > 1 && self.found.len() >= self.cap {
                    return Err(Stop);
                }
            }
            let result = if next.is_empty() { Ok(()) } else { self.expand(local, clique, next) };
            clique.pop();
            result?;
        }
        Ok(())
    }

    /// Removes the candidates that would make a refused four with `added` and two members of the clique.
    fn orient(&mut self, local: &Local, clique: &[usize], added: usize, candidates: &mut BitSet) -> Result<(), Stop> {
        if self.sense == Sense::Any || clique.len() < 2 {
            return Ok(());
        }
        let vertices = &self.graph.vertices;
        let members = decisive_members(clique);
        for candidate in candidates.iter().collect::<Vec<_>>() {
            let (c, d) = (vertices[added], vertices[local.vertices[candidate]]);
            let mut tests = 0;
            let refused = members.iter().enumerate().any(|(i, &a)| {
                members[..i].iter().any(|&b| {
                    tests += 1;
                    self.sense.refuses(self.problem, [vertices[a], vertices[b], c, d])
                })
            });
            if refused {
                candidates.remove(candidate);
            }
            self.spend(tests)?;
        }
        Ok(())
    }

    fn spend(&mut self, tests: u64) -> Result<(), Stop> {
        self.left = self.left.saturating_sub(tests);
        if self.left == 0 { Err(Stop) } else { Ok(()) }
    }
}

/// The neighbours of one vertex as a graph of their own.
struct Local {
    /// Their numbers in the whole graph.
    vertices: Vec<usize>,
    adjacency: BitMatrix,
    /// Their model points and cloud points, numbered from 0.
    models: Vec<usize>,
    clouds: Vec<usize>,
}

impl Local {
    /// The neighbours that can be in a clique of `least` members with their centre: each needs
    /// `least − 2` of the others as neighbours. Ordered by degree, so that colouring begins with the
    /// well-connected.
    fn of(graph: &Association, mut members: BitSet, least: usize) -> Self {
        let mut vertices: Vec<(usize, usize)> = Vec::new();
        loop {
            vertices.clear();
            vertices.extend(members.iter().map(|v| (members.common(graph.adjacency.row(v)), v)));
            let poor = vertices.iter().filter(|(degree, _)| degree + 2 < least);
            let poor: Vec<usize> = poor.map(|&(_, v)| v).collect();
            poor.iter().for_each(|&v| members.remove(v));
            if poor.is_empty() {
                break;
            }
        }
        vertices.sort_by_key(|&(degree, v)| (std::cmp::Reverse(degree), v));
        let vertices: Vec<usize> = vertices.into_iter().map(|(_, v)| v).collect();
        let place: HashMap<usize, usize> = vertices.iter().enumerate().map(|(i, &v)| (v, i)).collect();
        let mut adjacency = BitMatrix::zeros(vertices.len());
        for (i, &v) in vertices.iter().enumerate() {
            members.shared(graph.adjacency.row(v)).filter_map(|w| place.get(&w)).for_each(|&k| adjacency.connect(i, k));
        }
        let models = numbered(vertices.iter().map(|&v| graph.vertices[v].model));
        let clouds = numbered(vertices.iter().map(|&v| graph.vertices[v].cloud));
        Self { vertices, adjacency, models, clouds }
    }

    /// The candidate with most neighbours among the candidates; of equals the first of the whole graph.
    fn best_connected(&self, candidates: &BitSet) -> Option<usize> {
        let worth = |v: usize| (candidates.common(self.adjacency.row(v)), std::cmp::Reverse(self.vertices[v]));
        candidates.iter().max_by_key(|&v| worth(v))
    }

    /// The n-partite bound: different model points and different cloud points among the candidates.
    fn partite(&self, candidates: &BitSet) -> usize {
        let count = self.vertices.len();
        let (mut models, mut clouds) = (BitSet::empty(count), BitSet::empty(count));
        for v in candidates.iter() {
            models.insert(self.models[v]);
            clouds.insert(self.clouds[v]);
        }
        models.len().min(clouds.len())
    }

    /// Greedy colouring: vertices with their colours from `least` on, in ascending order of colour.
    /// A clique among the vertices up to one of them has at most its colour's number of members.
    fn colour(&self, candidates: &BitSet, least: usize) -> Vec<(usize, usize)> {
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
                if colour >= least {
                    coloured.push((vertex, colour));
                }
            }
        }
        coloured
    }
}

/// The members that a further point is tested against.
fn decisive_members(clique: &[usize]) -> &[usize] {
    if clique.len() < MOST_ORIENTED { clique } else { &clique[..FEW_ORIENTED] }
}

/// Numbers from 0 in the place of arbitrary ones.
fn numbered(values: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut names = HashMap::new();
    values
        .map(|value| {
            let next = names.len();
            *names.entry(value).or_insert(next)
        })
        .collect()
}

fn distinct(values: impl Iterator<Item = usize>) -> usize {
    values.collect::<HashSet<_>>().len()
}

/// A degeneracy order (always the vertex of least remaining degree next; of equals the first) and
/// the core number of each vertex. (Matula and Beck, *Smallest-last ordering*, 1983.)
fn degeneracy(count: usize, adjacency: &BitMatrix) -> (Vec<usize>, Vec<usize>) {
    let mut degree: Vec<usize> = (0..count).map(|v| adjacency.degree(v)).collect();
    // Vertices sorted by degree, where each stands, and where each degree begins (Batagelj and Zaveršnik, 2003).
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&v| degree[v]);
    let mut place = vec![0; count];
    order.iter().enumerate().for_each(|(i, &v)| place[v] = i);
    let most = degree.iter().copied().max().unwrap_or(0);
    let mut start: Vec<usize> = (0..=most + 1).map(|d| order.partition_point(|&v| degree[v] < d)).collect();
    for i in 0..count {
        let vertex = order[i];
        for neighbour in adjacency.ones(vertex) {
            let d = degree[neighbour];
            if d > degree[vertex] {
                // To the front of its degree's range, which then begins one later.
                let front = start[d].max(i + 1);
                let other = order[front];
                order.swap(front, place[neighbour]);
                place[other] = place[neighbour];
                place[neighbour] = front;
                start[d] = front + 1;
                degree[neighbour] -= 1;
            }
        }
    }
    (order, degree)
}
