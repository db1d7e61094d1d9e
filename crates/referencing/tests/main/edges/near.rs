//! Two model edges that lie near each other.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{MeasuredLine, Point};
use seafix_referencing::{End, ModelEdge, Outcome};

use super::{
    scene::{SIDES, corner, line, pose, rig, square},
    search::{Model, SIGMA, random_prior},
};

/// Distance of the two edges (m).
const APART: f64 = 0.03;
const FRAMES: usize = 30;

/// A box of nine visible edges whose first edge has a second one 30 mm beside it on the top, as a lip has.
fn lip() -> Model {
    let edge = |id: String, ends: [Vector3<f64>; 2]| {
        let ends = ends.map(|end| End::At(end.into()));
        ModelEdge { id, ends, sigma: 0.0, faces: Vec::new() }
    };
    let [from, to] = SIDES[0].map(corner);
    let beside = Vector3::new(0.0, APART, 0.0);
    let sides = (0..9).map(|k| edge(format!("S{k}"), SIDES[k].map(corner)));
    let edges = sides.chain([edge("lip".to_owned(), [from + beside, to + beside])]).collect();
    Model { points: Vec::new(), edges }
}

/// Law E9: one of the two is not detected, at random. The other is never taken for it in a fix.
#[test]
fn of_two_near_edges_the_right_one_is_identified_or_none() {
    let (model, rig) = (lip(), rig());
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let (mut fixes, mut taken) = (0, 0);
    for frame in 0..FRAMES {
        let hidden = if rng.random() { 0 } else { 9 };
        let shown: Vec<usize> = (0..10).filter(|&k| k != hidden).collect();
        let truth = pose(3.0, rng.random_range(0.0..6.0));
        let prior = random_prior(&truth, (0.0087, 0.1), &mut rng);
        let into = truth.inverse();
        let measured = |k: &usize| model.edges[*k].places(&[]).map(|end| into * Point::from(end.coords));
        let lines: Vec<MeasuredLine> = shown.iter().map(|k| line(&rig, measured(k), SIGMA, &mut rng)).collect();
        let answer = model.attempt((&[], &lines), &prior, &mut rng);
        let Outcome::Fix(fix) = &answer.outcome else { continue };
        fixes += 1;
        taken += usize::from(fix.edges.iter().any(|pair| [0, 9].contains(&pair.model)));
        let error = square(&fix.object_from_camera, &truth).sqrt();
        assert!(error < 0.01, "frame {frame}: {error} m");
        let wrong: Vec<_> = fix.edges.iter().filter(|pair| shown[pair.cloud] != pair.model).collect();
        assert!(wrong.is_empty(), "frame {frame}: {wrong:?} of {shown:?}");
    }
    assert!(fixes >= FRAMES * 8 / 10 && taken >= fixes * 8 / 10, "{fixes} fixes, {taken} with one of the two");
}
