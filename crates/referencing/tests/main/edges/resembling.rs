//! The evidence of another structure of the object's kind.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{MeasuredLine, Point};
use seafix_referencing::{
    Edges, End, Gate, ModelEdge, Problem, RigidConsensus, Search, Tolerance, candidates, edge_candidates,
};

use super::{
    scene::{SIDES, corner, line, pose, rig},
    search::random_prior,
};

/// The evidence (nats) of some sides of the box beyond that of another structure; their offsets have this error (px).
fn beyond(sides: &[[usize; 2]], sigma: f64) -> f64 {
    let (rig, truth) = (rig(), pose(3.5, 0.6));
    let edges: Vec<ModelEdge> = sides
        .iter()
        .map(|ends| ModelEdge {
            id: format!("{ends:?}"),
            ends: ends.map(|end| End::At(corner(end).into())),
            sigma: 0.0,
            faces: Vec::new(),
        })
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let prior = random_prior(&truth, (0.0087, 0.1), &mut rng);
    let seen = |ends: &[usize; 2]| ends.map(|end| truth.inverse() * Point::from(corner(end)));
    let lines: Vec<MeasuredLine> = sides.iter().map(|ends| line(&rig, seen(ends), sigma, &mut rng)).collect();
    assert!(lines.iter().all(|line| line.depth));
    let lists = candidates(&[], &[], Some(&prior), &Gate::default(), None);
    let of_edges = edge_candidates(&edges, &[], &lines, Some(&prior), &Gate::default(), None);
    let problem = Problem {
        model: &[],
        cloud: &[],
        candidates: &lists,
        tolerance: Tolerance::Sigmas(3.0),
        prior: Some(&prior),
        edges: Edges { model: &edges, lines: &lines, candidates: &of_edges },
    };
    let found = RigidConsensus::default().search(&problem, &mut rng).expect("the sides");
    assert_eq!(found.edges.len(), sides.len());
    let posterior = found.posterior.expect("a posterior");
    posterior.explanations[0].ln_evidence - posterior.resembling.expect("edges")
}

/// Half the error doubles the evidence of each measured dimension, and of nothing else.
///
/// A U of three sides has one dimension, its width: parallel sides and common corners are no coincidences. The nine
/// visible sides of a box have three.
#[test]
fn only_dimensions_distinguish_the_object_from_others_of_its_kind() {
    for (sides, dimensions) in [(&[[6, 4], [4, 5], [5, 7]][..], 1.0), (&SIDES[..9], 3.0)] {
        let [coarse, fine] = [0.01, 0.005].map(|sigma| beyond(sides, sigma));
        let counted = (fine - coarse) / 2.0_f64.ln();
        assert!((counted - dimensions).abs() < 0.1, "{counted} dimensions, {coarse} and {fine} nats");
        assert!(coarse > 2.0 * dimensions, "{coarse}");
    }
}
