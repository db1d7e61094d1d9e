//! Laws of searches, over any list of them: those of the registry, or one that a program added.

use std::cell::Cell;

use nalgebra::{Matrix3, Vector3};
use proptest::{prelude::*, test_runner::TestCaseResult};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{Candidates, Correspondence, ModelPoint, Rejected, Tolerance};

use crate::{
    admissible::{difference, is_mirrored, objection, tolerance},
    law::{law, not_idle},
    poses::{direction, pose, vector},
    problems::{LARGE, Planted, SMALL, planted},
    searches::{Answer, Tried, nowhere, sets},
};

/// A law of searches.
pub type Law = fn(&[Tried]);

/// The laws with their statements; they hold for a search without any proof.
pub const LAWS: [(&str, Law); 5] = [
    ("every returned set is coherent", every_returned_set_is_coherent),
    ("no point serves twice", no_point_serves_twice),
    ("a mirror image is rejected", a_mirror_image_is_rejected),
    ("the order of the points changes nothing", the_order_of_the_points_changes_nothing),
    ("points outside every gate change nothing", points_outside_every_gate_change_nothing),
];

/// An answer without its cost: the set, or the reason.
pub fn gist(answer: &Answer) -> Result<Vec<Correspondence>, &'static str> {
    answer.as_ref().map(|found| found.pairs.clone()).map_err(Rejected::reason)
}

fn distinct(points: impl Iterator<Item = Vector3<f64>>) -> bool {
    let points: Vec<_> = points.collect();
    points.iter().enumerate().all(|(i, a)| points[..i].iter().all(|b| a != b))
}

/// Whether no two points of the model, and no two of the cloud, coincide.
pub fn all_distinct(planted: &Planted) -> bool {
    distinct(planted.model.iter().map(|p| p.at.coords)) && distinct(planted.cloud.iter().map(|c| c.position.at.coords))
}

fn every_set_is_admissible(searches: &[Tried], planted: &Planted) -> TestCaseResult {
    for search in searches {
        for set in sets(&search.answer(planted)) {
            let objection = objection(&planted.problem(), search.rejects_mirrors(), set);
            prop_assert!(objection.is_none(), "{}: {}", search.name, objection.unwrap_or_default());
        }
    }
    Ok(())
}

/// P21. Every returned set, alternatives included, is coherent: all q (q − 1)/2 differences ≤ Δ, evaluated from the
/// original coordinates, in closed form; up to 24 points and 108 in the cloud.
///
/// # Panics
/// If a search breaks the law, with the smallest counterexample found.
pub fn every_returned_set_is_coherent(searches: &[Tried]) {
    law(256, prop_oneof![planted(LARGE), planted(SMALL)], |planted| every_set_is_admissible(searches, &planted));
}

/// P29. Injectivity: no cloud point belongs to two model points, and no model point appears twice, also for model
/// points nearer than Δ and for shared lists.
///
/// # Panics
/// If a search breaks the law, with the smallest counterexample found.
pub fn no_point_serves_twice(searches: &[Tried]) {
    let contested = Cell::new(0);
    let cases = law(256, planted(SMALL), |planted| {
        let problem = planted.problem();
        let vertices = problem.candidates.lists.iter().enumerate();
        let pairs: Vec<_> =
            vertices.flat_map(|(i, list)| list.iter().map(move |&j| Correspondence { model: i, cloud: j })).collect();
        let tempting = |a: Correspondence, b: Correspondence| {
            a.cloud == b.cloud && a.model != b.model && difference(&problem, a, b) <= tolerance(&problem, a, b)
        };
        if pairs.iter().any(|&a| pairs.iter().any(|&b| tempting(a, b))) {
            contested.set(contested.get() + 1);
        }
        for search in searches {
            for set in sets(&search.answer(&planted)) {
                for (k, a) in set.iter().enumerate() {
                    let twice = set[..k].iter().any(|b| a.model == b.model || a.cloud == b.cloud);
                    prop_assert!(!twice, "{}: {:?} in {:?}", &search.name, a, set);
                }
                prop_assert!(
                    set.is_sorted_by_key(|pair| pair.model),
                    "{}: not in the order of the model",
                    &search.name
                );
            }
        }
        Ok(())
    });
    not_idle("points that would serve twice", contested.get(), cases, 40);
}

/// A measured point without noise.
pub fn measured(at: Vector3<f64>) -> MeasuredPoint {
    MeasuredPoint { position: UncertainPoint { at: Point::from(at), covariance: Matrix3::zeros() }, pixels: None }
}

/// A model of 4 to 7 points, its exact image reflected in a plane and moved, and the tolerance.
pub fn reflection(
    points: &[Vector3<f64>],
    normal: &Vector3<f64>,
    motion: &impl Fn(Vector3<f64>) -> Vector3<f64>,
    delta: f64,
) -> Planted {
    let image = |p: &Vector3<f64>| motion(p - normal * (2.0 * normal.dot(p)));
    let truth = (0..points.len()).map(|i| Correspondence { model: i, cloud: i });
    Planted {
        model: points.iter().map(|&p| ModelPoint::exact("P", Point::from(p))).collect(),
        cloud: points.iter().map(|p| measured(image(p))).collect(),
        candidates: Candidates::from_pairs(points.len(), (0..points.len()).map(|i| (i, i))),
        tolerance: Tolerance::Fixed(delta),
        truth: truth.collect(),
        pose: nowhere(),
    }
}

/// P26. Reflection of the cloud: the distance test alone accepts it completely; the orientation test must reject it as
/// `Mirrored`, with its size, if all sets of four points decide. Its triples are admissible, since three points have no
/// orientation, but they are the rest of a mirror image.
///
/// If some sets of four are too flat to decide, the maximum admissible set may have four points or more; `Mirrored` is
/// then not guaranteed, and only admissibility (P21, P22) is tested.
///
/// # Panics
/// If a search breaks the law, with the smallest counterexample found.
pub fn a_mirror_image_is_rejected(searches: &[Tried]) {
    let points = prop::collection::vec(vector(1.0), 4..=6);
    law(128, (points, direction(), pose(5.0), 1e-6..1e-3), |(points, normal, pose, delta)| {
        let pose: Transform<Camera, Object> = pose;
        let planted = reflection(&points, &normal, &|p| (pose * Point::from(p)).coords, delta);
        let problem = planted.problem();
        let all = &planted.truth;
        let solid = (0..all.len()).all(|l| {
            (0..l).all(|k| (0..k).all(|j| (0..j).all(|i| is_mirrored(&problem, [all[i], all[j], all[k], all[l]]))))
        });
        prop_assume!(solid);
        for search in searches {
            let answer = search.answer(&planted);
            if !search.claims.exact {
                prop_assert!(answer.is_err() || !search.rejects_mirrors(), "{}: {:?}", &search.name, &answer);
            } else if search.rejects_mirrors() {
                prop_assert_eq!(answer, Err(Rejected::Mirrored { best: all.len(), proved: true }), "{}", &search.name);
            } else {
                let size = answer.as_ref().map_or(0, |found| found.pairs.len());
                prop_assert_eq!(size, all.len(), "{}: {:?}", &search.name, &answer);
            }
        }
        Ok(())
    });
}

/// P24. The order of model and cloud changes only the order of the listing, if no two points coincide.
///
/// # Panics
/// If a search breaks the law, with the smallest counterexample found.
pub fn the_order_of_the_points_changes_nothing(searches: &[Tried]) {
    let answered = Cell::new(0);
    let cases = law(96, (prop_oneof![planted(SMALL), planted(LARGE)], any::<u64>()), |(planted, seed)| {
        prop_assume!(all_distinct(&planted));
        // A multiplicative shuffle: the new index k has the old point order[k].
        let order = |count: usize| {
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by_key(|&i| (i as u64 + 1).wrapping_mul(seed | 1).rotate_left(17).wrapping_mul(0x9E37_79B9));
            order
        };
        let (models, clouds) = (order(planted.model.len()), order(planted.cloud.len()));
        let new = |old: usize| clouds.iter().position(|&j| j == old).expect("a permutation");
        let moved = Planted {
            model: models.iter().map(|&i| planted.model[i].clone()).collect(),
            cloud: clouds.iter().map(|&j| planted.cloud[j]).collect(),
            candidates: Candidates::from_pairs(
                models.len(),
                models
                    .iter()
                    .enumerate()
                    .flat_map(|(k, &i)| planted.candidates.lists[i].iter().map(|&j| (k, new(j))).collect::<Vec<_>>()),
            ),
            ..planted.clone()
        };
        for search in searches {
            let back = gist(&search.answer(&moved)).map(|pairs| {
                let old =
                    |pair: &Correspondence| Correspondence { model: models[pair.model], cloud: clouds[pair.cloud] };
                let mut pairs: Vec<_> = pairs.iter().map(old).collect();
                pairs.sort();
                pairs
            });
            answered.set(answered.get() + u32::from(back.is_ok()));
            prop_assert_eq!(gist(&search.answer(&planted)), back, "{}", &search.name);
        }
        Ok(())
    });
    not_idle("answers", answered.get(), cases * searches.len() as u32, 8);
}

/// P20. Points outside of every gate do not change the result: with 10 000 distant points more the answer is the same
/// to the last bit.
///
/// # Panics
/// If a search breaks the law, with the smallest counterexample found.
pub fn points_outside_every_gate_change_nothing(searches: &[Tried]) {
    law(8, planted(LARGE), |planted| {
        let mut more = planted.clone();
        more.cloud.extend((0..10_000).map(|i| {
            let at = Point::new(1e3 + f64::from(i), -1e4, 1e5 * f64::from(i % 7));
            MeasuredPoint { position: UncertainPoint::isotropic(at, 0.01), pixels: None }
        }));
        for search in searches {
            prop_assert_eq!(search.answer(&more), search.answer(&planted), "{}", &search.name);
        }
        Ok(())
    });
}
