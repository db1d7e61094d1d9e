//! E5: what may not change an answer with edges does not, for every registered search that identifies them (P24 to P29).

use nalgebra::{Matrix4, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Camera, MeasuredPoint, Point, Transform, UncertainPoint};
use seafix_referencing::{Candidates, Correspondence, End, MaximumClique, Rejected, SEARCHES};

use super::planted::{Draw, Planted, Sets, edge, searches, sets, truth};

/// Well-posed scenes: points and edges that no other pose explains, measured to 0.2 mm among clutter.
const DRAW: Draw = Draw { model: (4, 5), clutter: (4, 4), noise: 1e-4, mirrored: false, boxed: false };
/// Scenes of which only edges determine the pose, at right angles.
const BOXED: Draw = Draw { model: (1, 8), boxed: true, ..DRAW };
const SCENES: u64 = 12;

fn scenes() -> impl Iterator<Item = (u64, Draw, Planted)> {
    [DRAW, BOXED].into_iter().flat_map(|draw| {
        (0..SCENES).map(move |seed| (seed, draw, Planted::of(draw, &mut ChaCha8Rng::seed_from_u64(seed))))
    })
}

fn order(count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    (1..count).rev().for_each(|i| order.swap(i, rng.random_range(0..=i)));
    order
}

/// The registry: a search states that it uses edges if it does. Fails if `ransac` does not.
#[test]
fn a_search_with_edges_states_so_in_the_catalogue() {
    let named: Vec<&str> = searches().iter().map(|(name, _)| *name).collect();
    assert_eq!(named, ["maximum-clique", "ransac", "rigid-consensus"]);
    for listing in SEARCHES.listings() {
        let states = listing.properties.iter().any(|(key, value)| *key == "features" && value.contains("edges"));
        assert_eq!(states, named.contains(&listing.name), "{}", listing.name);
    }
}

/// Every search finds what is there. Fails if lines are directed only one way.
#[test]
fn points_and_edges_are_found_together() {
    for (seed, draw, scene) in scenes() {
        for (name, search) in searches() {
            let found = scene.answer(&*search).map(|found| sets(&found));
            assert_eq!(found, Ok(truth(draw.model)), "{name}, scene {seed}");
        }
    }
}

/// P24: the order of points, lines and ends does not matter.
///
/// Fails if only the first eight lines are candidates.
#[test]
fn the_order_of_features_and_ends_changes_nothing() {
    for (seed, draw, mut scene) in scenes() {
        // Two images of one edge 1 mm apart: the choice between them depends on an order.
        let (twice, at) = (scene.lines[0], scene.lines.len());
        scene.lines.push(twice);
        scene.of_edges.iter_mut().for_each(|list| list.push(at));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (models, clouds) = (order(scene.model.len(), &mut rng), order(scene.cloud.len(), &mut rng));
        let (edges, lines) = (order(scene.edges.len(), &mut rng), order(scene.lines.len(), &mut rng));
        let mut moved = Planted {
            model: models.iter().map(|&i| scene.model[i].clone()).collect(),
            cloud: clouds.iter().map(|&j| scene.cloud[j]).collect(),
            candidates: Candidates::all(models.len(), clouds.len()),
            edges: edges.iter().map(|&i| scene.edges[i].clone()).collect(),
            lines: lines.iter().map(|&j| scene.lines[j]).collect(),
            ..scene.clone()
        };
        for (k, edge) in moved.edges.iter_mut().enumerate().filter(|(k, _)| k % 2 == 0) {
            edge.ends.reverse();
            moved.lines[k].ends.reverse();
        }
        let back = |(points, of_edges): Sets| -> Sets {
            let old = |pair: Correspondence, models: &[usize], clouds: &[usize]| Correspondence {
                model: models[pair.model],
                cloud: clouds[pair.cloud],
            };
            let mut points: Vec<_> = points.into_iter().map(|pair| old(pair, &models, &clouds)).collect();
            let mut of_edges: Vec<_> = of_edges.into_iter().map(|pair| old(pair, &edges, &lines)).collect();
            // The two equal lines have no order but that of their numbers.
            of_edges.iter_mut().filter(|pair| pair.cloud == at).for_each(|pair| pair.cloud = 0);
            points.sort();
            of_edges.sort();
            (points, of_edges)
        };
        for (name, search) in searches() {
            let there = moved.answer(&*search).map(|found| back(sets(&found)));
            assert_eq!(there, Ok(truth(draw.model)), "{name}, scene {seed}");
        }
    }
}

/// P25: a rigid motion of cloud and lines changes nothing.
///
/// Fails if lines on one side of the camera are left out.
#[test]
fn a_motion_of_cloud_and_lines_changes_nothing() {
    for (seed, draw, scene) in scenes() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
        let motion = Transform::<Camera, Camera>::exp(&Vector6::from_fn(|_, _| rng.random_range(-1.5..1.5)));
        let turn = motion.rotation_matrix();
        let mut moved = scene.clone();
        for point in &mut moved.cloud {
            let UncertainPoint { at, covariance } = point.position;
            point.position = UncertainPoint { at: motion * at, covariance: turn * covariance * turn.transpose() };
        }
        // The offsets are isotropic, so that the new basis across a line does not matter.
        moved.lines.iter_mut().for_each(|line| line.ends = line.ends.map(|end| motion * end));
        for (name, search) in searches() {
            let there = moved.answer(&*search).map(|found| sets(&found));
            assert_eq!(there, Ok(truth(draw.model)), "{name}, scene {seed}");
        }
    }
}

/// P26: only a planar part of a mirror image is an answer, and never an undisputed one of more than half of it.
///
/// Fails if a larger mirror image of the set is not sought.
#[test]
fn a_mirror_image_is_rejected() {
    for draw in [DRAW, BOXED] {
        let draw = Draw { mirrored: true, clutter: (0, 0), ..draw };
        for seed in 0..SCENES {
            let scene = Planted::of(draw, &mut ChaCha8Rng::seed_from_u64(seed));
            for (name, search) in searches() {
                if let Ok(found) = scene.answer(&*search) {
                    let size = found.pairs.len() + found.edges.len();
                    let disputed = matches!(found.undecided, Some(Rejected::Mirrored { .. }));
                    let half = (draw.model.0 + draw.model.1) / 2;
                    assert!(disputed || size <= half, "{name}, scene {seed}: {size} features");
                }
            }
        }
    }
}

/// P27: a further line, edge or candidate never makes the largest set smaller.
///
/// Fails if a model edge with more than five candidates is skipped.
#[test]
fn more_never_finds_less() {
    let search = MaximumClique::default();
    for (seed, _, scene) in scenes() {
        let mut fewer = scene.clone();
        fewer.of_edges[0].clear();
        fewer.of_edges[1].truncate(2);
        let size = |scene: &Planted| {
            let found = scene.answer(&search).expect("a set");
            (found.pairs.len() + found.edges.len(), found.optimal)
        };
        let ((less, proved), (more, all)) = (size(&fewer), size(&scene));
        assert!(proved && all && less < more, "scene {seed}: {less}, {more}");
    }
}

/// P28: a problem of twice or half the size has the same answer. Edges have tolerances in metres for the errors of the
/// model, so that the law holds for well-posed scenes only.
///
/// Fails if lines longer than a metre are left out.
#[test]
fn a_problem_of_another_size_is_the_same_problem() {
    for (seed, draw, scene) in scenes() {
        for scale in [0.5, 2.0] {
            let mut scaled = scene.clone();
            scaled.model.iter_mut().for_each(|point| point.at = Point::from(point.at.coords * scale));
            for MeasuredPoint { position, .. } in &mut scaled.cloud {
                *position = UncertainPoint {
                    at: Point::from(position.at.coords * scale),
                    covariance: position.covariance * (scale * scale),
                };
            }
            scaled.edges.iter_mut().for_each(|one| {
                let ends = one.places(&scene.model).map(|end| End::At(Point::from(end.coords * scale)));
                *one = edge(ends);
            });
            for line in &mut scaled.lines {
                line.ends = line.ends.map(|end| Point::from(end.coords * scale));
                line.offsets = Matrix4::from(line.offsets * (scale * scale));
            }
            for (name, search) in searches() {
                let there = scaled.answer(&*search).map(|found| sets(&found));
                assert_eq!(there, Ok(truth(draw.model)), "{name}, scene {seed}");
            }
        }
    }
}

/// P29: no edge and no line serves twice, and all pairs are candidates, in the order of the model.
///
/// Fails if two edges may have one line.
#[test]
fn no_line_serves_twice() {
    for seed in 0..2 * SCENES {
        // Edges that nearly coincide contend for one line.
        let mut scene = Planted::of(DRAW, &mut ChaCha8Rng::seed_from_u64(seed));
        scene.edges[1] = scene.edges[0].clone();
        scene.of_edges[2].clear();
        for (name, search) in searches() {
            let Ok(found) = scene.answer(&*search) else { continue };
            for (k, a) in found.edges.iter().enumerate() {
                assert!(scene.of_edges[a.model].contains(&a.cloud), "{name}, scene {seed}: {a:?}");
                let twice = found.edges[..k].iter().any(|b| a.model == b.model || a.cloud == b.cloud);
                assert!(!twice, "{name}, scene {seed}: {:?}", found.edges);
            }
            assert!(found.edges.is_sorted_by_key(|pair| pair.model), "{name}, scene {seed}");
        }
    }
}
