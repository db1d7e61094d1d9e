//! Exact search for the largest cliques of the consistency graph, within a budget.

use std::borrow::Cow;

use super::{
    association::Association,
    bitset::{BitSet, degrees},
    features::Features,
    local::{Local, Workshop},
    orientation::Sense,
    quadruples::Quadruples,
    volumes::Volumes,
};
use crate::problem::Problem;

/// Maximum size up to which every quadruple is tested for orientation while the set grows.
pub(super) const MAX_ORIENTED: usize = 40;
/// Number of first points that further points are tested against (500 points have 2.6 · 10⁹ quadruples); a complete
/// test at the end proves the answer, or it is not called optimal.
const FEW_ORIENTED: usize = 16;

/// The cliques found, with the bounds proved for the others.
#[derive(Debug)]
pub(super) struct Cliques {
    /// The largest cliques found, up to the cap; vertices ascending.
    pub(super) found: Vec<Vec<usize>>,
    /// Whether these are all of their size.
    pub(super) all: bool,
    /// Upper bound of the size of an admissible clique; equal to the size found if the search was complete.
    pub(super) bound: usize,
    /// Whether the search ended before its budget.
    pub(super) complete: bool,
}

/// Branch and bound over the cliques that a sense admits.
///
/// Each vertex in turn forms a small graph with its later neighbours. Greedy colouring bounds the clique size there
/// (Tomita and Seki, 2003; San Segundo et al., *An exact bit-parallel algorithm for the maximum clique problem*, 2011),
/// after the n-partite bound: no more members than different model points, nor than different cloud points. Vertices
/// are sorted by model point, so that the last ones, with one model point fewer than required, begin no clique.
/// Vertices with too few neighbours are removed first (k-core). Orientation removes vertices while the clique grows;
/// all bounds hold without it, so that the answer remains exact.
///
/// A graph may hold pairs of edges after those of points. Triples with an edge are then tested as quadruples of points are.
pub(super) struct Search<'a> {
    graph: &'a Association,
    /// The vertices of a graph with edges.
    features: Option<&'a Features<'a>>,
    /// The number of vertices that are pairs of points; they come first.
    points: usize,
    volumes: Volumes<'a>,
    quadruples: Quadruples,
    /// The required sense of quadruples.
    sense: Sense,
    /// Remaining tests: a vertex coloured, or a quadruple tested for orientation.
    left: u64,
    /// Number of neighbours of each vertex.
    degree: Vec<usize>,
    /// Number of different model points from each vertex on.
    models_from: Vec<usize>,
    /// Vertices that can be in a clique of interest.
    alive: BitSet,
    /// Minimum size of interest.
    min: usize,
    /// The largest cliques so far.
    found: Vec<Vec<usize>>,
    /// Maximum number of cliques kept: 1 keeps the first of the largest, more keeps all of the size of interest.
    cap: usize,
    work: Workshop,
}

/// The premature end of a search.
struct Stop;

impl<'a> Search<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, graph: &'a Association, sense: Sense, budget: u64) -> Self {
        Self::over(problem, graph, None, sense, budget)
    }

    /// The search over the graph of points and edges, which must have been made for the same sense.
    pub(super) fn with_edges(features: &'a Features<'a>, graph: &'a Association, sense: Sense, budget: u64) -> Self {
        Self::over(features.problem, graph, Some(features), sense, budget)
    }

    fn over(
        problem: &'a Problem<'a>,
        graph: &'a Association,
        features: Option<&'a Features<'a>>,
        sense: Sense,
        budget: u64,
    ) -> Self {
        let count = graph.vertices.len();
        let (all, alive) = (Vec::from_iter(0..count), BitSet::full(count));
        let mut degree = Vec::new();
        degrees(&graph.adjacency, &alive, &all, &mut degree);
        let mut models_from = vec![0; count];
        for v in (0..count).rev() {
            let new = graph.vertices.get(v + 1).is_none_or(|next| next.model != graph.vertices[v].model);
            models_from[v] = models_from.get(v + 1).copied().unwrap_or(0) + usize::from(new);
        }
        let points = features.map_or(count, |features| features.points.len());
        Self {
            graph,
            features,
            points,
            volumes: Volumes::of(problem, &graph.vertices[..points]),
            quadruples: Quadruples::default(),
            sense,
            left: budget,
            degree,
            models_from,
            alive,
            min: 1,
            found: Vec::new(),
            cap: 1,
            work: Workshop::of(graph),
        }
    }

    /// The remaining tests.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    /// Sets the required sense from here on.
    pub(super) fn set_sense(&mut self, sense: Sense) {
        self.sense = sense;
    }

    /// The largest cliques of at least `min` members: the first found, and up to `cap` of the same size.
    ///
    /// First one of the largest with the proof that none is larger, then the others with the remaining budget.
    pub(super) fn run(&mut self, min: usize, cap: usize) -> Cliques {
        (self.min, self.cap, self.found) = (min.max(1), 1, Vec::new());
        self.greedy();
        self.peel();
        let mut open = Vec::new();
        let (mut complete, mut bound) = (true, 0);
        for vertex in (0..self.degree.len()).rev() {
            let tie = self.tie();
            // The number of model points from this vertex on bounds the clique.
            if self.models_from[vertex] < tie || !self.alive.has(vertex) {
                continue;
            }
            let local = self.later_neighbours(vertex, tie);
            if local.vertices.len() + 1 >= tie {
                open.push(vertex);
            }
            if self.within(vertex, &local).is_err() {
                (complete, bound) = (false, self.max_possible());
                break;
            }
        }
        let all = complete && self.ties(&open, cap);
        let mut found = std::mem::take(&mut self.found);
        found.sort();
        let best = found.first().map_or(0, Vec::len);
        Cliques { found, all, bound: bound.min(self.partite()).max(best), complete }
    }

    /// The neighbours after a vertex that a clique of `min` members with it may contain.
    fn later_neighbours(&mut self, vertex: usize, min: usize) -> Local {
        let mut neighbours = self.alive.clone();
        neighbours.intersect(self.graph.adjacency.row(vertex));
        neighbours.drop_below(vertex + 1);
        Local::of(self.graph, neighbours, min, &mut self.work)
    }

    /// Removes vertices with too few neighbours for a clique as large as the largest.
    fn peel(&mut self) {
        let (tie, count) = (self.tie(), self.degree.len());
        self.alive = BitSet::full(count);
        let mut degree = self.degree.clone();
        let mut poor: Vec<usize> = (0..count).filter(|&v| degree[v] + 1 < tie).collect();
        poor.iter().for_each(|&v| self.alive.remove(v));
        while let Some(v) = poor.pop() {
            for w in self.graph.adjacency.ones(v) {
                degree[w] -= 1;
                if degree[w] + 1 < tie && self.alive.has(w) {
                    self.alive.remove(w);
                    poor.push(w);
                }
            }
        }
    }

    /// An upper bound of the clique size by cores: k members have k − 1 neighbours among themselves.
    fn max_possible(&self) -> usize {
        let mut sorted = self.degree.clone();
        sorted.sort_unstable_by(|a, b| b.cmp(a));
        // The maximum number k of vertices with at least k − 1 neighbours each.
        sorted.iter().enumerate().take_while(|(place, degree)| *degree >= place).count()
    }

    /// The size of the largest clique so far, or the minimum of interest.
    fn tie(&self) -> usize {
        self.found.first().map_or(self.min, Vec::len)
    }

    /// Adds all cliques as large as the largest, from the vertices `open`; true if all were visited.
    fn ties(&mut self, open: &[usize], cap: usize) -> bool {
        if cap <= 1 || self.found.is_empty() {
            return false;
        }
        (self.min, self.cap) = (self.tie(), cap);
        let first = self.found.pop().expect("a clique");
        let mut all = true;
        for &vertex in open {
            let local = self.later_neighbours(vertex, self.min);
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

    /// The n-partite bound of the complete graph.
    fn partite(&self) -> usize {
        let mut clouds: Vec<usize> = self.graph.vertices.iter().map(|pair| pair.cloud).collect();
        clouds.sort_unstable();
        clouds.dedup();
        self.models_from.first().copied().unwrap_or(0).min(clouds.len())
    }

    /// Finds a large clique greedily, so that the bounds prune from the start.
    ///
    /// It starts from some of the best connected vertices and always adds the neighbour with most neighbours among the
    /// rest.
    fn greedy(&mut self) {
        const STARTS: usize = 24;
        let mut starts: Vec<usize> = (0..self.degree.len()).collect();
        starts.sort_by_key(|&vertex| std::cmp::Reverse(self.degree[vertex]));
        // At most a quarter of the budget: the proof needs the rest.
        let reserve = self.left - self.left / 4;
        for &start in starts.iter().take(STARTS) {
            let mut neighbours = BitSet::full(self.degree.len());
            neighbours.intersect(self.graph.adjacency.row(start));
            let local = Local::of(self.graph, neighbours, self.min, &mut self.work);
            if local.vertices.len() + 1 < self.min {
                continue;
            }
            let mut clique = vec![start];
            let mut candidates = BitSet::full(local.vertices.len());
            while let Some(next) = local.best_connected(&candidates) {
                candidates.remove(next);
                if self.left > reserve && !self.rejects(&clique, local.vertices[next]) {
                    candidates.intersect(local.adjacency.row(next));
                    clique.push(local.vertices[next]);
                }
            }
            if clique.len() >= self.min {
                self.keep(&clique);
            }
            if self.left <= reserve {
                return;
            }
        }
    }

    /// Whether a vertex forms a rejected quadruple with three members of the clique.
    fn rejects(&mut self, clique: &[usize], vertex: usize) -> bool {
        if self.sense == Sense::Any {
            return false;
        }
        if let Some(features) = self.features {
            let members = decisive_members(clique);
            self.left = self.left.saturating_sub((members.len() * members.len() / 2) as u64);
            let pairs = members.iter().enumerate().flat_map(|(k, &a)| members[..k].iter().map(move |&b| (a, b)));
            if pairs.into_iter().any(|(a, b)| features.rejects([a, b, vertex], self.sense)) {
                return true;
            }
            if vertex >= self.points {
                return false;
            }
        }
        let points = self.points_of(clique);
        let members = decisive_members(&points);
        self.left = self.left.saturating_sub(Quadruples::count(members.len()));
        self.quadruples.rejected(&self.volumes, self.sense, members, vertex)
    }

    /// The members that are pairs of points.
    fn points_of<'c>(&self, clique: &'c [usize]) -> Cow<'c, [usize]> {
        match self.features {
            None => Cow::Borrowed(clique),
            Some(_) => clique.iter().copied().filter(|&v| v < self.points).collect(),
        }
    }

    fn keep(&mut self, clique: &[usize]) {
        let mut clique = clique.to_vec();
        clique.sort_unstable();
        if self.cap == 1 {
            self.min = clique.len() + 1;
            self.found.clear();
        }
        self.found.push(clique);
    }

    /// Visits the cliques of `vertex` and some of its later neighbours.
    fn within(&mut self, vertex: usize, local: &Local) -> Result<(), Stop> {
        if self.min <= 1 {
            self.keep(&[vertex]);
        }
        if local.vertices.len() + 1 < self.min {
            return Ok(());
        }
        self.expand(local, &mut vec![vertex], BitSet::full(local.vertices.len()))
    }

    fn expand(&mut self, local: &Local, clique: &mut Vec<usize>, mut candidates: BitSet) -> Result<(), Stop> {
        let needed = |search: &Self| search.min.saturating_sub(clique.len());
        if local.partite(&candidates) < needed(self) {
            return Ok(());
        }
        let coloured = local.colour(&candidates, needed(self).max(1));
        self.spend(candidates.len() as u64)?;
        for (vertex, colour) in coloured.into_iter().rev() {
            if colour < self.min.saturating_sub(clique.len()) {
                return Ok(());
            }
            let mut next = candidates.clone();
            next.intersect(local.adjacency.row(vertex));
            candidates.remove(vertex);
            self.orient(local, clique, local.vertices[vertex], &mut next)?;
            clique.push(local.vertices[vertex]);
            if clique.len() >= self.min {
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

    /// Removes the candidates that would form a rejected quadruple with `added` and two members of the clique.
    fn orient(&mut self, local: &Local, clique: &[usize], added: usize, candidates: &mut BitSet) -> Result<(), Stop> {
        if self.sense == Sense::Any || clique.is_empty() || (self.features.is_none() && clique.len() < 2) {
            return Ok(());
        }
        if let Some(features) = self.features {
            for candidate in candidates.iter().collect::<Vec<_>>() {
                let third = local.vertices[candidate];
                let members = decisive_members(clique);
                let first = members.iter().position(|&other| features.rejects([other, added, third], self.sense));
                if first.is_some() {
                    candidates.remove(candidate);
                }
                self.spend(first.map_or(members.len(), |place| place + 1) as u64)?;
            }
            if added >= self.points {
                return Ok(());
            }
        }
        let points = self.points_of(clique);
        let members = decisive_members(&points);
        let mut planes = Vec::with_capacity(members.len() * members.len() / 2);
        for (i, &a) in members.iter().enumerate() {
            planes.extend(members[..i].iter().map(|&b| self.volumes.plane([a, b, added])));
        }
        for candidate in candidates.iter().collect::<Vec<_>>() {
            let fourth = local.vertices[candidate];
            if fourth >= self.points {
                continue;
            }
            let first = planes.iter().position(|plane| self.volumes.rejects(self.sense, plane, fourth));
            if first.is_some() {
                candidates.remove(candidate);
            }
            self.spend(first.map_or(planes.len(), |place| place + 1) as u64)?;
        }
        Ok(())
    }

    fn spend(&mut self, pair_tests: u64) -> Result<(), Stop> {
        self.left = self.left.saturating_sub(pair_tests);
        if self.left == 0 { Err(Stop) } else { Ok(()) }
    }
}

/// The members that a further point is tested against.
pub(super) fn decisive_members(clique: &[usize]) -> &[usize] {
    if clique.len() < MAX_ORIENTED { clique } else { &clique[..FEW_ORIENTED] }
}

#[cfg(test)]
mod tests;
