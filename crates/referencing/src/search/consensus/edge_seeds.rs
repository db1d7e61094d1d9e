//! Poses from two features of which one is an edge.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::{
    edge_terms::EdgeTerms, edge_votes::Votes, joined::Joined, likelihood::Mode, local_maxima::Climb, motion::Motion,
};
use crate::{
    edge_coherence::{PARALLEL, edges_agree, point_agrees},
    solve::line_frames::{Feature, frames},
};

/// Tolerance (standard deviations) of angles and distances of two edges.
const SIGMAS: f64 = 4.0;
/// Maximum number of pairs that are followed, and of successive pairs without a new mode.
const FOLLOWED: usize = 100;
const FRUITLESS: usize = 30;
/// Evidence (nats) below the best at which an ascent ends early.
pub(super) const HOPELESS: f64 = 20.0;
/// Maximum number of vertices of each kind in the graph about the prior.
const MAX_VERTICES: usize = 320;
/// The same in a graph about a displacement of the prior; its time is quadratic. Tried on two problems of 120 and 300 edges.
const MAX_VOTERS: usize = 1000;

/// A vertex of the common graph: a pair of edges or a pair of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Node {
    Edge(usize),
    Point(usize),
}

/// The modes reached from two coherent pairs.
///
/// Of too many pairs under a prior, those about each of the prior's displacements with most votes are taken in turn: a
/// wide prior says little of a single pair. `work` counts the tests.
pub(in crate::search) fn edge_modes(joined: &Joined<'_>, known: &[Mode], work: &mut u64) -> Vec<Mode> {
    let pairs = free(joined);
    let mut found = Vec::new();
    let prior = joined.climb.prior_terms.known.as_ref().filter(|_| pairs.iter().any(|kind| kind.len() > MAX_VERTICES));
    let votes = prior.and_then(|prior| Some((prior, Votes::of(joined, prior, &pairs, work)?)));
    // A grid about as coarse as the prior is wide has no peak: every feature votes for all of its cells.
    let peaks = votes.as_ref().map_or_else(Vec::new, |(prior, votes)| votes.peaks(prior));
    if let Some((prior, votes)) = votes.filter(|_| !peaks.is_empty()) {
        let centroid = prior.motion.apply(&joined.climb.prior_terms.centroid);
        for displacement in peaks {
            let voters = limited(joined, votes.voters(joined, prior, &pairs, &displacement), MAX_VOTERS);
            let start = prior.motion.moved(&Vector3::zeros(), &displacement, &centroid);
            grow(joined, voters, Some(start), (known, &mut found), work);
        }
    } else {
        let start = joined.climb.prior_terms.known.as_ref().map(|known| known.motion);
        grow(joined, limited(joined, pairs, MAX_VERTICES), start, (known, &mut found), work);
    }
    found
}

/// Adds the modes reached from two coherent pairs of these, those with most common neighbours first.
///
/// The graph holds pairs of edges and pairs of points; two pairs are coherent if angles and distances agree. A seed is
/// two edges that are not parallel or, with a prior, an edge and a point. It gives a pose: from `start` if there is
/// one, else in closed form. A seed whose members belong to a known mode is skipped.
fn grow(
    joined: &Joined<'_>,
    [edges, points]: [Vec<usize>; 2],
    start: Option<Motion>,
    (known, found): (&[Mode], &mut Vec<Mode>),
    work: &mut u64,
) {
    let nodes: Vec<Node> = edges.into_iter().map(Node::Edge).chain(points.into_iter().map(Node::Point)).collect();
    let words = nodes.len().div_ceil(64);
    let mut bits = vec![0u64; words * nodes.len()];
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (i, &a) in nodes.iter().enumerate() {
        for (k, &b) in nodes.iter().enumerate().take(i) {
            *work += 1;
            if let Some(seeds) = coherent(joined, a, b) {
                bits[i * words + k / 64] |= 1 << (k % 64);
                bits[k * words + i / 64] |= 1 << (i % 64);
                if seeds {
                    pairs.push((k, i));
                }
            }
        }
    }
    let common = |&(k, i): &(usize, usize)| -> u32 {
        (0..words).map(|word| (bits[k * words + word] & bits[i * words + word]).count_ones()).sum()
    };
    let mut ranked: Vec<(u32, usize, usize)> = pairs.iter().map(|pair| (common(pair), pair.0, pair.1)).collect();
    ranked.sort_unstable_by(|a, b| b.0.cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut followed, mut fruitless) = (0, 0);
    for (_, k, i) in ranked {
        let seed = [nodes[k], nodes[i]];
        let holds = |mode: &Mode| {
            seed.iter().all(|node| match node {
                Node::Edge(v) => mode.edges.binary_search(v).is_ok(),
                Node::Point(v) => mode.holds(*v),
            })
        };
        if found.iter().chain(known.iter()).any(holds) {
            continue;
        }
        followed += 1;
        fruitless += 1;
        *work += 64;
        let edges: Vec<usize> =
            seed.iter().filter_map(|node| if let Node::Edge(v) = node { Some(*v) } else { None }).collect();
        let points: Vec<usize> =
            seed.iter().filter_map(|node| if let Node::Point(v) = node { Some(*v) } else { None }).collect();
        // An edge that the start leaves beside its line says nothing there.
        let near = |start: &Motion| edges.iter().all(|&v| joined.edges.vertices[v].placed(start).is_some());
        let start = start.filter(|start| !points.is_empty() || near(start));
        for start in start.map_or_else(|| closed_forms(joined, &edges), |start| vec![start]) {
            let Some((motion, factor)) = joined.fit(&points, &edges, &start, 3) else { continue };
            let best = found.iter().chain(known.iter()).map(|mode| mode.ln_evidence).fold(0.0, f64::max);
            let Some(mode) = joined.near(&motion, Some(&factor), best - HOPELESS) else { continue };
            if found.iter().all(|other| other.members != mode.members || other.edges != mode.edges) {
                fruitless = 0;
                found.push(mode);
            }
        }
        if followed == FOLLOWED || fruitless == FRUITLESS {
            break;
        }
    }
}

/// The vertices that may seed a pose: edges and points.
fn free(joined: &Joined<'_>) -> [Vec<usize>; 2] {
    let EdgeTerms { vertices, .. } = joined.edges;
    let edges = (0..vertices.len()).filter(|&v| vertices[v].depth && !joined.taken.contains(&vertices[v].pair.cloud));
    let Climb { graph, taken, .. } = joined.climb;
    let points = (0..graph.vertices.len()).filter(|&v| !taken.contains(&graph.vertices[v].cloud));
    [edges.collect(), points.collect()]
}

/// At most `max` vertices of each kind, those of the greatest gain, ascending.
fn limited(joined: &Joined<'_>, [mut edges, mut points]: [Vec<usize>; 2], max: usize) -> [Vec<usize>; 2] {
    let keep = |all: &mut Vec<usize>, gain: &dyn Fn(usize) -> f64| {
        if all.len() > max {
            all.sort_by(|&a, &b| gain(b).total_cmp(&gain(a)).then(a.cmp(&b)));
            all.truncate(max);
            all.sort_unstable();
        }
    };
    keep(&mut edges, &|v| joined.edges.vertices[v].gain);
    keep(&mut points, &|v| joined.climb.terms.pairs[v].gain);
    [edges, points]
}

/// Whether two vertices seed a pose; `None` if they are not coherent.
fn coherent(joined: &Joined<'_>, a: Node, b: Node) -> Option<bool> {
    let EdgeTerms { vertices, .. } = joined.edges;
    let Climb { terms, graph, prior_terms, .. } = joined.climb;
    match (a, b) {
        (Node::Edge(a), Node::Edge(b)) => {
            let (one, other) = (&vertices[a], &vertices[b]);
            if one.pair.model == other.pair.model || one.pair.cloud == other.pair.cloud {
                return None;
            }
            let sine = edges_agree([&one.model, &other.model], [&one.line, &other.line], SIGMAS)?;
            Some(sine > PARALLEL)
        }
        (Node::Edge(edge), Node::Point(point)) | (Node::Point(point), Node::Edge(edge)) => {
            let (one, other) = (&terms.pairs[point], &vertices[edge]);
            let noise = Matrix3::identity() * one.variance;
            let agrees = point_agrees((&one.model, &other.model), (&one.cloud, &noise), &other.line, SIGMAS);
            agrees.then_some(prior_terms.known.is_some())
        }
        (Node::Point(a), Node::Point(b)) => {
            let (p, q) = (graph.vertices[a], graph.vertices[b]);
            if p.model == q.model || p.cloud == q.cloud {
                return None;
            }
            let (one, other) = (&terms.pairs[a], &terms.pairs[b]);
            let off = (one.model - other.model).norm() - (one.cloud - other.cloud).norm();
            (off.abs() <= SIGMAS * (one.variance + other.variance).sqrt()).then_some(false)
        }
    }
}

/// The initial motions of a seed by the closed forms of its edges.
fn closed_forms(joined: &Joined<'_>, edges: &[usize]) -> Vec<Motion> {
    let feature = |&v: &usize| {
        let vertex = &joined.edges.vertices[v];
        Feature::Line(vertex.model, vertex.line.ends, vertex.line.direction_sigma())
    };
    frames(&edges.iter().map(feature).collect::<Vec<_>>()).iter().map(Motion::of).collect()
}

/// The lines of the members of a mode.
pub(in crate::search) fn lines_of(mode: &Mode, edges: &EdgeTerms<'_>) -> BTreeSet<usize> {
    mode.edges.iter().map(|&v| edges.vertices[v].pair.cloud).collect()
}
