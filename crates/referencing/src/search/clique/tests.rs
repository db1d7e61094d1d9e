//! Tests of the search against every set of small graphs, of its bounds and of its cost.

use nalgebra::Vector3;
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

use super::*;
use crate::{
    candidates::Candidates,
    problem::{Correspondence, Tolerance},
    search::bitset::BitMatrix,
    site::model::ModelPoint,
};

/// Points for the model and the cloud of a graph with given edges.
struct Points {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
}

impl Points {
    fn of(places: &[Vector3<f64>], seen: &[Vector3<f64>]) -> Self {
        let measured = |at: &Vector3<f64>| UncertainPoint::isotropic(Point::from(*at), 1e-3);
        Self {
            model: places.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect(),
            cloud: seen.iter().map(|at| MeasuredPoint { position: measured(at), pixels: None }).collect(),
            candidates: Candidates::all(places.len(), seen.len()),
        }
    }

    fn scattered(count: usize) -> Self {
        let place = |k: usize| [2.0, 3.0, 5.0].map(|p: f64| (k as f64 * p.sqrt()).fract());
        let places: Vec<_> = (0..count).map(|k| Vector3::from(place(k))).collect();
        Self::of(&places, &places)
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: Tolerance::Fixed(0.01),
            prior: None,
            edges: Default::default(),
        }
    }
}

/// A graph of vertices with these model and cloud points; vertices that share one are never adjacent.
fn graph(models: &[usize], clouds: &[usize], edge: impl Fn(usize, usize) -> bool) -> Association {
    let count = models.len();
    let mut adjacency = BitMatrix::zeros(count);
    for (i, j) in (0..count).flat_map(|j| (0..j).map(move |i| (i, j))) {
        if models[i] != models[j] && clouds[i] != clouds[j] && edge(i, j) {
            adjacency.connect(i, j);
        }
    }
    let vertices = models.iter().zip(clouds).map(|(&model, &cloud)| Correspondence { model, cloud });
    Association { vertices: vertices.collect(), adjacency, pair_tests: 0 }
}

/// The edge i–j, i < j, of a graph by the bits of its number.
fn bit(number: usize) -> impl Fn(usize, usize) -> bool {
    move |i, j| number >> (j * (j - 1) / 2 + i) & 1 == 1
}

/// All largest cliques, by testing every set.
fn brute_force(graph: &Association) -> Vec<Vec<usize>> {
    let count = graph.vertices.len();
    let members = |set: usize| (0..count).filter(move |v| set >> v & 1 == 1);
    let clique =
        |set: usize| members(set).all(|a| members(set).all(|b| a == b || graph.adjacency.ones(a).any(|c| c == b)));
    let cliques: Vec<usize> = (1..1 << count).filter(|&set| clique(set)).collect();
    let max = cliques.iter().map(|set| set.count_ones()).max().unwrap_or(0);
    let mut largest: Vec<Vec<usize>> =
        cliques.into_iter().filter(|set| set.count_ones() == max).map(|set| members(set).collect()).collect();
    largest.sort();
    largest
}

fn check(problem: &Problem<'_>, graph: &Association, name: &str) {
    let largest = brute_force(graph);
    let size = largest[0].len();
    let mut search = Search::new(problem, graph, Sense::Any, 1_000_000);
    let found = search.run(1, 1000);
    assert!(found.complete && found.all && found.bound == size, "{name}: {found:?}");
    assert_eq!(found.found, largest, "{name}");
    // The same search for one clique, for at most two, for those of a size, and for larger ones.
    let one = search.run(1, 1);
    assert!(one.complete && !one.all && one.found.len() == 1 && largest.contains(&one.found[0]), "{name}: {one:?}");
    let larger = search.run(size + 1, 1);
    assert!(larger.complete && larger.found.is_empty(), "{name}: {larger:?}");
    // Single vertices do not count against the cap.
    if size == 1 {
        return;
    }
    let two = search.run(size, 2);
    assert!(
        two.complete && two.bound == size && two.found.iter().all(|clique| largest.contains(clique)),
        "{name}: {two:?}"
    );
    // The first one found may exceed the cap.
    assert!((largest.len().min(2)..=3).contains(&two.found.len()), "{name}: {two:?}");
    assert_eq!(two.all, largest.len() < 2, "{name}: {two:?}");
}

/// All 33 868 graphs of one to six vertices, each with a model and a cloud point of its own.
///
/// Fails if a bound requires one member more.
#[test]
fn the_largest_cliques_of_every_graph_of_six_vertices() {
    for count in 1..=6 {
        let (points, own) = (Points::scattered(count), Vec::from_iter(0..count));
        for number in 0..1 << (count * (count - 1) / 2) {
            check(&points.problem(), &graph(&own, &own, bit(number)), &format!("{count} vertices, {number}"));
        }
    }
}

/// All graphs of four or five vertices with shared points.
///
/// Five vertices have every partition of consecutive vertices into model points, four have every partition into cloud
/// points besides.
#[test]
fn vertices_of_one_point_exclude_each_other() {
    let shared = |count: usize, joins: usize| {
        let mut models = vec![0];
        (1..count).for_each(|k| models.push(models[k - 1] + (joins >> (k - 1) & 1)));
        models
    };
    let points = Points::scattered(5);
    for (joins, number) in (0..16).flat_map(|joins| (0..1024).map(move |number| (joins, number))) {
        let models = shared(5, joins);
        let graph = graph(&models, &[0, 1, 2, 3, 4], bit(number));
        check(&points.problem(), &graph, &format!("{models:?}, {number}"));
    }
    // Set partitions by growth: each vertex has a known cloud point or the next new one.
    let mut partitions = vec![vec![0]];
    for _ in 1..4 {
        partitions = partitions
            .into_iter()
            .flat_map(|known: Vec<usize>| {
                let next = known.iter().max().map_or(0, |max| max + 1);
                (0..=next).map(move |cloud| [&known[..], &[cloud]].concat())
            })
            .collect();
    }
    assert_eq!(partitions.len(), 15);
    for (joins, number) in (0..8).flat_map(|joins| (0..64).map(move |number| (joins, number))) {
        let models = shared(4, joins);
        for clouds in &partitions {
            check(
                &points.problem(),
                &graph(&models, clouds, bit(number)),
                &format!("{models:?}, {clouds:?}, {number}"),
            );
        }
    }
}

/// All graphs of five vertices with every small budget: a search that ended early spent all of it, and its bound holds.
#[test]
fn a_budget_ends_with_a_bound_that_holds() {
    let (points, own) = (Points::scattered(5), [0, 1, 2, 3, 4]);
    let (problem, mut ended, mut max) = (points.problem(), 0, 0);
    for number in 0..1024 {
        let graph = graph(&own, &own, bit(number));
        let largest = brute_force(&graph);
        for budget in 1..16 {
            let mut search = Search::new(&problem, &graph, Sense::Any, budget);
            let found = search.run(1, 1);
            assert!(found.bound >= largest[0].len(), "{number}, {budget}: {found:?}");
            assert_eq!(found.complete, search.left() > 0, "{number}, {budget}");
            match found.complete {
                true => assert!(largest.contains(&found.found[0]), "{number}, {budget}: {found:?}"),
                false => assert!(!found.all, "{number}, {budget}: {found:?}"),
            }
            (ended, max) = (ended + usize::from(!found.complete), max.max(found.bound));
        }
    }
    assert!(ended > 1000 && max == 5, "{ended} {max}");
}

/// Vertices of three model points and two cloud points have no clique of three members; in a star of three rays no
/// three vertices have two neighbours.
#[test]
fn bounds_of_the_full_graph() {
    let points = Points::scattered(4);
    let problem = points.problem();
    let shared = graph(&[0, 0, 1, 2], &[0, 1, 0, 1], |_, _| true);
    let search = Search::new(&problem, &shared, Sense::Any, 100);
    assert_eq!((search.partite(), &search.models_from[..]), (2, &[3, 3, 2, 1][..]));
    let star = graph(&[0, 1, 2, 3], &[0, 1, 2, 3], |i, _| i == 0);
    let mut search = Search::new(&problem, &star, Sense::Any, 100);
    assert_eq!((search.degree.clone(), search.max_possible(), search.partite()), (vec![3, 1, 1, 1], 2, 4));
    // A triangle with a tail of two: only the members of the triangle remain for a clique of three.
    let points = Points::scattered(5);
    let problem = points.problem();
    let own = [0, 1, 2, 3, 4];
    let tail = graph(&own, &own, |i, j| j < 3 || (i, j) == (2, 3) || (i, j) == (3, 4));
    search = Search::new(&problem, &tail, Sense::Any, 100);
    search.min = 3;
    search.peel();
    assert_eq!(search.alive.iter().collect::<Vec<_>>(), [0, 1, 2]);
    search.min = 2;
    search.peel();
    assert_eq!(search.alive.len(), 5);
    search.min = 4;
    search.peel();
    assert!(search.alive.is_empty());
    assert_eq!(search.tie(), 4);
    search.found = vec![vec![0, 1]];
    assert_eq!(search.tie(), 2);
}

/// A regression test of the cost on 60 vertices with half of the edges: a weaker bound costs more tests.
#[test]
fn the_proof_costs_no_more_than_it_did() {
    let count = 60;
    let (points, own) = (Points::scattered(count), Vec::from_iter(0..count));
    let joined = |i: usize, j: usize| (i * 7919 + j * j * 104_729 + i * j * 31) % 101 < 50;
    let (problem, graph) = (points.problem(), graph(&own, &own, joined));
    let mut search = Search::new(&problem, &graph, Sense::Any, 1_000_000);
    search.greedy();
    let begun = search.found[0].len();
    let mut search = Search::new(&problem, &graph, Sense::Any, 1_000_000);
    let found = search.run(1, 1000);
    let spent = 1_000_000 - search.left();
    assert!(found.complete && found.all);
    assert_eq!((begun, found.bound, found.found.len()), (8, 8, 7));
    assert!(spent <= 1777, "{spent}");
}

#[test]
fn large_sets_are_tested_against_their_first_members() {
    let all: Vec<usize> = (0..60).collect();
    assert_eq!(decisive_members(&all[..39]).len(), 39);
    assert_eq!(decisive_members(&all[..40]), &all[..16]);
}
