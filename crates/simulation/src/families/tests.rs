use std::path::Path;

use nalgebra::{Matrix4, Vector3};
use seafix_geometry::{Camera, Object, Point, Transform};
use seafix_referencing::problem_file::CoherenceProblem;

use super::*;

/// Numbers that cover every cell of the smaller sizes.
fn numbers(family: Family) -> Vec<u64> {
    match family {
        Family::A => (0..28).chain(63..91).collect(),
        Family::D => (0..36).step_by(3).collect(),
        _ => (0..18).collect(),
    }
}

fn all(presence: Presence) -> impl Iterator<Item = Generated> {
    Family::ALL
        .into_iter()
        .flat_map(move |family| numbers(family).into_iter().map(move |k| Generated::new(family, 5, k, presence)))
}

fn motion(rows: &[[f64; 4]; 4]) -> Transform<Camera, Object> {
    Transform::from_matrix(&Matrix4::from_fn(|i, k| rows[i][k])).unwrap()
}

fn placed(generated: &Generated, by: &[[f64; 4]; 4]) -> Vec<Vector3<f64>> {
    let pose = motion(by);
    generated.problem.model.iter().map(|at| (pose * Point::from(*at)).coords).collect()
}

#[test]
fn the_file_holds_the_problem() {
    for generated in all(Presence::Present).step_by(7).chain(all(Presence::Absent).step_by(11)) {
        let text = serde_json::to_string(&generated.problem).unwrap();
        let mut read = CoherenceProblem::parse(&text, Path::new("drawn.json")).unwrap();
        let mut given = generated.problem.problem();
        // The parser may differ in the last bit of seventeen digits.
        match (read.prior.take(), given.prior.take()) {
            (Some(read), Some(given)) => {
                assert_eq!(read.bound, given.bound);
                assert!(read.object_from_camera.error_to(&given.object_from_camera).amax() < 1e-12);
            }
            (read, given) => assert!(read.is_none() && given.is_none()),
        }
        assert!(read == given, "{} changes when it is parsed", generated.problem.id);
    }
}

#[test]
fn a_problem_is_a_function_of_seed_family_and_number() {
    for family in Family::ALL {
        let generated = |seed, number| Generated::new(family, seed, number, Presence::Present);
        assert_eq!(generated(1, 2), generated(1, 2));
        assert_ne!(generated(1, 2).problem.cloud, generated(2, 2).problem.cloud);
        assert_ne!(generated(1, 2).problem.cloud, generated(1, 3).problem.cloud);
    }
}

#[test]
fn true_pairs_are_where_the_pose_places_them_within_the_noise() {
    let (mut squares, mut terms) = (0.0, 0.0);
    for generated in all(Presence::Present) {
        let at = placed(&generated, &generated.truth.t_cam_obj);
        let problem = &generated.problem;
        for &[i, j] in &generated.truth.pairs {
            let sigma = problem.sigma_xyz.as_ref().map_or([problem.sigma; 3], |rows| rows[j]);
            let off: Vector3<f64> = (Vector3::from(problem.cloud[j]) - at[i]).component_div(&Vector3::from(sigma));
            assert!(off.amax() < 5.5, "{}: {off}", problem.id);
            squares += off.norm_squared();
            terms += 3.0;
        }
        assert_eq!(generated.truth.pose_defined, generated.truth.pairs.len() >= 3, "{}", problem.id);
        assert!(generated.truth.max_coherent_true.is_none_or(|max| max <= generated.truth.pairs.len()));
    }
    let ratio: f64 = squares / terms;
    assert!((ratio - 1.0).abs() < 0.03, "noise of {ratio} times the stated variance in {terms} terms");
}

#[test]
fn visible_points_lie_in_their_gates() {
    let mut nearest_edge = 0f64;
    for generated in all(Presence::Present) {
        let Some(prior) = &generated.problem.prior else { continue };
        let at = placed(&generated, &prior.t_cam_obj);
        for &[i, j] in &generated.truth.pairs {
            let off = (Vector3::from(generated.problem.cloud[j]) - at[i]).amax() / prior.shell_half_m;
            assert!(off <= 1.0, "{}: {off}", generated.problem.id);
            nearest_edge = nearest_edge.max(off);
        }
    }
    assert!(nearest_edge > 0.9, "no point lies near the border of its gate: {nearest_edge}");
}

#[test]
fn dense_clutter_lies_in_gates_and_other_clutter_keeps_off_hidden_points() {
    for generated in all(Presence::Present) {
        let (problem, truth) = (&generated.problem, &generated.truth);
        let true_points: Vec<usize> = truth.pairs.iter().map(|pair| pair[1]).collect();
        let clutter = || {
            let clutter = problem.cloud.iter().enumerate().filter(|(j, _)| !true_points.contains(j));
            clutter.map(|(_, at)| Vector3::from(*at))
        };
        if problem.family == "g" || truth.params.dense == Some(true) {
            let prior = problem.prior.as_ref().unwrap();
            let centres = placed(&generated, &prior.t_cam_obj);
            let inside = |at: Vector3<f64>| centres.iter().any(|c| (at - c).amax() <= prior.shell_half_m + 1e-6);
            assert!(clutter().all(inside), "{}", problem.id);
        }
        let clear = match problem.family {
            "b" => 0.15,
            "f" => 0.18,
            _ => continue,
        };
        let at = placed(&generated, &truth.t_cam_obj);
        let hidden: Vec<_> = (0..at.len()).filter(|i| truth.pairs.iter().all(|pair| pair[0] != *i)).collect();
        assert!(clutter().all(|c| hidden.iter().all(|&i| (c - at[i]).norm() >= clear - 1e-5)), "{}", problem.id);
    }
}

#[test]
fn an_absent_object_leaves_model_prior_and_size_as_they_are() {
    for (there, gone) in all(Presence::Present).zip(all(Presence::Absent)) {
        assert!(gone.truth.pairs.is_empty() && !gone.truth.pose_defined && gone.truth.params.absent == Some(true));
        assert_eq!(gone.problem.model, there.problem.model);
        assert_eq!(gone.problem.prior.is_some(), there.problem.prior.is_some());
        assert_eq!(gone.truth.t_cam_obj, there.truth.t_cam_obj);
        let lost = if there.problem.family == "e" { there.truth.pairs.len() } else { 0 };
        assert_eq!(gone.problem.cloud.len() + lost, there.problem.cloud.len(), "{}", there.problem.id);
    }
}

/// Half extents 10 to 30 % away from the object's, so that the box's edges are elsewhere; and no place is kept clear.
///
/// Fails if the box keeps a dimension, and if places stay clear.
#[test]
fn another_box_stands_in_the_place_of_a_replaced_object() {
    let (mut inside, mut problems) = (0, 0);
    for gone in all(Presence::Replaced) {
        assert!(gone.truth.pairs.is_empty() && !gone.truth.pose_defined && gone.truth.params.absent == Some(true));
        if !matches!(gone.problem.family, "b" | "f") {
            continue;
        }
        let at = placed(&gone, &gone.truth.t_cam_obj);
        let near = |seen: &[f64; 3]| at.iter().any(|at| (Vector3::from(*seen) - at).norm() < 0.15);
        inside += usize::from(gone.problem.cloud.iter().any(near));
        problems += 1;
        // Few points lie within 0.1 m of two planes of the object's own box.
        let pose = motion(&gone.truth.t_cam_obj).inverse();
        let on_own_edge = |seen: &&[f64; 3]| {
            let at = (pose * Point::from(**seen)).coords.abs() - Vector3::new(2.5, 1.75, 1.5);
            at.iter().filter(|off| off.abs() < 0.1).count() >= 2 && at.max() < 0.1
        };
        let on_edges = gone.problem.cloud.iter().filter(on_own_edge).count();
        assert!(on_edges * 10 < gone.problem.cloud.len(), "{on_edges} of {}", gone.problem.cloud.len());
    }
    // Of 500 points about 1.4 are near a place, none of an absent object's: a quarter of those clouds has none by chance.
    assert!(2 * inside > problems && problems > 0, "{inside} of {problems}");
}

#[test]
fn families_are_known_by_their_names() {
    assert!(Family::ALL.into_iter().all(|family| family.name().parse() == Ok(family)));
    assert_eq!(
        "h".parse::<Family>().unwrap_err(),
        "unknown family `h`; give one of paper-scale, site-scale, no-prior, putative, lattice, few-visible, \
         dense-clutter"
    );
}
