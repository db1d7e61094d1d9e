//! The evidence of another structure of the object's kind.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{MeasuredLine, Point};
use seafix_referencing::{
    Edges, End, Gate, ModelEdge, Problem, RigidConsensus, Search, SearchMechanism, Tolerance, candidates,
    edge_candidates,
};

use super::{
    scene::{SIDES, corner, line, pose, rig},
    search::random_prior,
};

/// The evidence (nats) of the best pose beyond that of another structure, and the number of its edges.
///
/// Some sides of the box are model edges and measured lines; the measured box is longer by this factor, and the offsets of
/// the lines have this error (px).
fn beyond(sides: &[[usize; 2]], longer: f64, sigma: f64) -> (f64, usize) {
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
    let place = |end| Point::from(corner(end).component_mul(&Vector3::new(longer, 1.0, 1.0)));
    let seen = |ends: &[usize; 2]| ends.map(|end| truth.inverse() * place(end));
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
    let posterior = found.posterior.expect("a posterior");
    let without = RigidConsensus { without: vec![SearchMechanism::Resembling], ..RigidConsensus::default() };
    let plain = without.search(&problem, &mut rng).expect("the sides").posterior.expect("a posterior");
    assert_eq!(plain.resembling, None);
    (posterior.explanations[0].ln_evidence - posterior.resembling.expect("edges"), found.edges.len())
}

/// Half the error doubles the evidence of each measured dimension, and of nothing else.
///
/// A U of three sides has one dimension, its width: parallel sides and common corners are no coincidences. The nine
/// visible sides of a box have three.
#[test]
fn only_dimensions_distinguish_the_object_from_others_of_its_kind() {
    for (sides, dimensions) in [(&[[6, 4], [4, 5], [5, 7]][..], 1.0), (&SIDES[..9], 3.0)] {
        let [coarse, fine] = [0.01, 0.005].map(|sigma| {
            let (beyond, found) = beyond(sides, 1.0, sigma);
            assert_eq!(found, sides.len());
            beyond
        });
        let counted = (fine - coarse) / 2.0_f64.ln();
        assert!((counted - dimensions).abs() < 0.1, "{counted} dimensions, {coarse} and {fine} nats");
        assert!(coarse > 2.0 * dimensions, "{coarse}");
    }
}

/// A box of the object's width and height, but of another length, explains all lines and the object only some.
#[test]
fn lines_that_the_object_leaves_unexplained_speak_for_another_structure() {
    for longer in [0.6, 0.8, 1.2, 1.4] {
        let (beyond, found) = beyond(&SIDES[..9], longer, 0.01);
        assert!((5..9).contains(&found), "{longer}: {found} edges");
        assert!(beyond < 0.0, "{longer}: {beyond} nats");
    }
}
