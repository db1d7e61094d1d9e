//! Every solver: exact on exact data, equivariant, never a reflection.

use std::cell::Cell;

use nalgebra::{Matrix3, Vector3, Vector6};
use proptest::prelude::*;
use seafix_geometry::{Camera, Object, Transform};
use seafix_proptests::{
    distinctive, law,
    least_squares::least_squares,
    not_idle,
    poses::{apart, pose, vector},
    scenes::{Scene, bare, corners, extents, seen},
    variants::{Variant, variants},
    within,
};
use seafix_referencing::{Degenerate, Observation, Observations, SOLVERS, Solver};

/// A solver, with counts of due and given answers.
struct Asked {
    solver: Variant<dyn Solver>,
    /// Whether it solves points without pixels.
    takes_bare: bool,
    due: Cell<u32>,
    answered: Cell<u32>,
}

impl Asked {
    /// The pose of a scene. An answer is due if the solver has its required points and pixels: all scenes here are far
    /// from a line.
    fn solve(&self, scene: &Scene) -> Result<Transform<Object, Camera>, Degenerate> {
        let answer = self.solver.component.solve(&scene.observations());
        if self.has_enough(scene) && (self.takes_bare || scene.rig.is_some()) {
            self.due.set(self.due.get() + 1);
            self.answered.set(self.answered.get() + u32::from(answer.is_ok()));
        }
        answer
    }

    fn has_enough(&self, scene: &Scene) -> bool {
        scene.points.len() >= self.solver.component.minimum()
    }

    fn name(&self) -> &str {
        &self.solver.name
    }

    /// The tolerance of solvers that answer to rounding error; for others a hundred thousandth (rad, m).
    fn limit(&self, exact: f64) -> f64 {
        if self.solver.component.to_rounding() { exact } else { exact.max(1e-5) }
    }
}

/// Every solver with every value of its switches.
///
/// A solver that needs pixels rejects the corners of a box without them, and is tested with pixels; every other solver
/// answers. A solver that claims least squares must not need pixels.
fn solvers() -> Vec<Asked> {
    let solvers = variants(&SOLVERS, &[]).into_iter().map(|solver| {
        let takes_bare = !solver.component.needs_pixels();
        let answers = solver.component.solve(&corners().observations()).is_ok();
        assert_eq!(answers, takes_bare, "{}: the corners of a box, bare", solver.name);
        let claims = solver.component.least_squares();
        assert!(takes_bare || !claims, "{} claims least squares and rejects the corners of a box", solver.name);
        Asked { solver, takes_bare, due: Cell::new(0), answered: Cell::new(0) }
    });
    solvers.collect()
}

/// Requires the answers of every solver over `cases` cases: due in at least one of four, given in at least nine of ten.
/// `pixels`: the scenes have pixels, so that no solver is exempt.
fn all_answer(solvers: &[Asked], cases: u32, pixels: bool) {
    for asked in solvers.iter().filter(|asked| pixels || asked.takes_bare) {
        let (due, answered) = (asked.due.get(), asked.answered.get());
        not_idle(&format!("{}: scenes with enough points", asked.name()), due, cases, 4);
        assert!(
            !distinctive(cases) || answered * 10 >= due * 9,
            "{}: {answered} answers to {due} scenes",
            asked.name()
        );
    }
    assert!(solvers.iter().any(|asked| asked.answered.get() > 0), "no solver answers");
}

/// P38. Exact data: pose error (rad, m) ≤ 1e-12 (1 + L), for every solver of points without pixels; each answers at
/// least nine of ten scenes, whose second extent is at least 0.2 of the first.
///
/// Seen to fail when the rotation is transposed, when the determinant's sign is omitted (coplanar points), and when one
/// variant rejects a quarter of all scenes.
#[test]
fn exact_points_give_the_exact_pose() {
    let solvers = solvers();
    let cases = law(256, bare(100.0, 0.0), |scene| {
        let truth = &scene.object_from_camera;
        let limit = 1e-12 * (1.0 + truth.translation().norm());
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            let Ok(found) = solver.solve(&scene) else { continue };
            let (angle, distance) = apart(&found, truth);
            within(&format!("{}: rotation", solver.name()), angle, limit)?;
            within(&format!("{}: translation", solver.name()), distance, limit)?;
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// P38 for points of a rig: exact pixels, with rig and pixels given. Triangulated points are accurate to 1e-9 m, which
/// over the points' extent is the tolerance of the pose. Every solver answers at least nine of ten.
///
/// Seen to fail when the measured points' centroid is omitted, when a solver rejects everything, and as the law above.
#[test]
fn exact_pixels_give_the_exact_pose() {
    let solvers = solvers();
    let cases = law(256, seen(0.0), |scene| {
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            let Ok(found) = solver.solve(&scene) else { continue };
            let (angle, distance) = apart(&found, &scene.object_from_camera);
            within(&format!("{}: rotation", solver.name()), angle, solver.limit(1e-8))?;
            within(&format!("{}: translation", solver.name()), distance, solver.limit(1e-7))?;
        }
        Ok(())
    });
    all_answer(&solvers, cases, true);
}

/// P39. Equivariance, camera side. In row vectors (y = x H) solve(x A, y) = A⁻¹ solve(x, y): ≤ 1e-10, for noisy points
/// without pixels and with covariances; a solver that rejects one rejects both, and answers at least nine of ten.
///
/// Pixels do not move with a camera, so that a solver that needs them rejects here and is tested on the object side
/// only.
///
/// Seen to fail when the centroid of the measured points is omitted, and when one variant rejects a quarter of all
/// scenes.
#[test]
fn moves_with_the_camera() {
    let solvers = solvers();
    let cases = law(256, (bare(5.0, 5e-3), pose::<Camera, Camera>(5.0)), |(scene, motion)| {
        let moved = scene.camera_moved(&motion);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            match (solver.solve(&scene), solver.solve(&moved)) {
                (Ok(before), Ok(after)) => {
                    let (angle, distance) = apart(&after, &(before * motion.inverse()));
                    within(&format!("{}: rotation", solver.name()), angle, solver.limit(1e-10))?;
                    within(&format!("{}: translation", solver.name()), distance, solver.limit(1e-10))?;
                }
                (before, after) => {
                    prop_assert!(
                        before.is_err() && after.is_err(),
                        "{}: {:?}, moved {:?}",
                        solver.name(),
                        before,
                        after
                    );
                }
            }
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// P39. Equivariance, object side. In row vectors solve(x, y B) = solve(x, y) B: ≤ 1e-10, for noisy points with and
/// without pixels; a solver that rejects one rejects both, and answers at least nine of ten of its kind.
///
/// Seen to fail when the centroid of the model's points is omitted, when points are weighted by their distance from the
/// object's origin, and when the area of a triangle is measured from there.
#[test]
fn moves_with_the_object() {
    let solvers = solvers();
    let scene = prop_oneof![bare(5.0, 5e-3).boxed(), seen(0.5).boxed()];
    let cases = law(256, (scene, pose::<Object, Object>(5.0)), |(scene, motion)| {
        let moved = scene.object_moved(&motion);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            match (solver.solve(&scene), solver.solve(&moved)) {
                (Ok(before), Ok(after)) => {
                    let (angle, distance) = apart(&after, &(motion * before));
                    within(&format!("{}: rotation", solver.name()), angle, solver.limit(1e-10))?;
                    within(&format!("{}: translation", solver.name()), distance, solver.limit(1e-10))?;
                }
                (before, after) => {
                    prop_assert!(
                        before.is_err() && after.is_err(),
                        "{}: {:?}, moved {:?}",
                        solver.name(),
                        before,
                        after
                    );
                }
            }
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// The solvers that claim least squares.
fn claimants(solvers: &[Asked]) -> impl Iterator<Item = &Asked> {
    solvers.iter().filter(|asked| asked.solver.component.least_squares())
}

/// P40. The sum of squared residuals of every solver that claims least squares is the minimum, computed from Horn's
/// eigenvalue, and no larger than that of 1 000 random perturbations of its own pose (+ 1e-15). No solver's sum is
/// below the minimum. A claimant's sum is thus at most any other's on the same points.
///
/// Seen to fail when points are weighted by their distance from the object's origin, when a centroid is omitted, when
/// the rotation is transposed, and when a second solver claims falsely.
#[test]
fn no_motion_has_smaller_squares() {
    let solvers = solvers();
    assert!(claimants(&solvers).count() > 0, "no solver claims least squares");
    let steps = prop::collection::vec((vector(1.0), vector(1.0), -7.0..0.0), 1000);
    let cases = law(128, (bare(5.0, 5e-3), steps), |(scene, steps)| {
        let minimum = least_squares(&scene);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            let Ok(pose) = solver.solve(&scene) else { continue };
            within(&format!("{}: below the minimum", solver.name()), minimum - scene.squares(&pose), 1e-12)?;
        }
        for solver in claimants(&solvers).filter(|solver| solver.has_enough(&scene)) {
            let Ok(pose) = solver.solve(&scene) else { continue };
            let squares = scene.squares(&pose);
            within(&format!("{}: above the minimum", solver.name()), squares - minimum, 1e-12)?;
            for (turn, step, size) in &steps {
                let xi = Vector6::new(turn.x, turn.y, turn.z, step.x, step.y, step.z) * 10f64.powf(*size);
                let beside = scene.squares(&pose.perturbed(&xi));
                within(&format!("{}: more than beside", solver.name()), squares - beside, 1e-15)?;
            }
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// P41. det R = +1 always, also for coplanar, noisy and mirrored input: RᵀR = I and det R = 1 to 1e-13, no NaN. Every
/// solver answers at least nine of ten of its kind.
///
/// Seen to fail when a rotation is 1e-9 too long, and when a solver rejects mirrored input.
#[test]
fn a_pose_is_never_a_reflection() {
    let solvers = solvers();
    let scene =
        prop_oneof![bare(20.0, 0.0).boxed(), bare(20.0, 0.02).boxed(), bare(20.0, 1.0).boxed(), seen(0.5).boxed()];
    let cases = law(256, (scene, any::<bool>()), |(scene, mirrored)| {
        let scene = if mirrored { scene.mirrored() } else { scene };
        for solver in &solvers {
            let Ok(found) = solver.solve(&scene) else { continue };
            let r = found.rotation_matrix();
            within(&format!("{}: det R − 1", solver.name()), (r.determinant() - 1.0).abs(), 1e-13)?;
            within(&format!("{}: RᵀR − I", solver.name()), (r.transpose() * r - Matrix3::identity()).amax(), 1e-13)?;
            prop_assert!(found.is_finite(), "{}: {:?}", solver.name(), found);
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// P41. Mirrored input has a large residual: no rotation fits a reflection better than four times the minimum
/// eigenvalue of the points' scatter, and every solver that claims least squares reaches it (to 1e-9 of the total
/// scatter).
///
/// Seen to fail when the determinant's sign is omitted.
#[test]
fn mirrored_points_leave_a_large_residual() {
    let solvers = solvers();
    let cases = law(256, bare(10.0, 0.0), |scene| {
        let mirrored = scene.mirrored();
        let places: Vec<Vector3<f64>> = scene.points.iter().map(|point| point.model.coords).collect();
        let [min, second, first] = extents(&places);
        let expected = 4.0 * min;
        let rounding = 1e-9 * (min + second + first);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&mirrored)) {
            let Ok(pose) = solver.solve(&mirrored) else { continue };
            let squares = mirrored.squares(&pose);
            within(&format!("{}: below the minimum over rotations", solver.name()), expected - squares, rounding)?;
            if solver.solver.component.least_squares() {
                within(&format!("{}: above the best rotation", solver.name()), squares - expected, rounding)?;
            }
        }
        Ok(())
    });
    all_answer(&solvers, cases, false);
}

/// The solvers with one sum and one decomposition: only rounding separates two forms of the same problem. (Solvers that
/// exclude points, or iterate to a ten-billionth of a standard deviation, are not among them.)
const CLOSED: [&str; 4] = ["horn", "kabsch", "umeyama", "weighted-kabsch"];

/// P42. The order of the points is irrelevant: ≤ 1e-13 (1 + L) between a scene and its reverse for solvers in closed
/// form, 1e-10 for those that iterate, which end a step apart; for noisy points with and without pixels. It holds for
/// poses of all points, not for the triad, whose frame starts at the first of three.
///
/// Seen to fail for triads, unless they are excluded.
#[test]
fn the_order_of_points_does_not_matter() {
    let solvers = solvers();
    let scene = prop_oneof![bare(5.0, 5e-3).boxed(), seen(0.5).boxed()];
    let cases = law(128, scene, |scene| {
        let mut reversed = scene.clone();
        reversed.points.reverse();
        let data = scene.observations();
        let rests_on_all = |asked: &&Asked| {
            !asked.name().starts_with("triad") && asked.solver.component.used(&data).len() == scene.points.len()
        };
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)).filter(rests_on_all) {
            let (Ok(before), Ok(after)) = (solver.solve(&scene), solver.solve(&reversed)) else { continue };
            same(solver, &before, &after)?;
        }
        Ok(())
    });
    assert!(cases > 0);
}

/// Whether two poses are equal within the tolerance of the solver.
fn same(solver: &Asked, a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> Result<(), TestCaseError> {
    let closed = CLOSED.iter().any(|name| solver.name().starts_with(&format!("{name} ")));
    let exact = if closed { 1e-13 * (1.0 + a.translation().norm()) } else { 1e-10 };
    let (angle, distance) = apart(a, b);
    within(&format!("{}: rotation", solver.name()), angle, solver.limit(exact))?;
    within(&format!("{}: translation", solver.name()), distance, solver.limit(exact))
}

/// P43. Inverse problem: solve(x, y) = solve(y, x)⁻¹ for equal weights, ≤ 1e-11 (1 + L), for every solver that claims
/// least squares.
///
/// Seen to fail when points are weighted by their distance from the object's origin.
#[test]
fn the_inverse_problem_has_the_inverse_answer() {
    let solvers = solvers();
    law(128, bare(5.0, 5e-3), |scene| {
        let mut inverse = scene.clone();
        for point in &mut inverse.points {
            (point.model, point.measured.at) = (point.measured.at.coords.into(), point.model.coords.into());
        }
        for solver in claimants(&solvers).filter(|solver| solver.has_enough(&scene)) {
            let (Ok(there), Ok(back)) = (solver.solve(&scene), solver.solve(&inverse)) else { continue };
            let (angle, distance) = apart(&there, &back.inverse().relabel());
            let limit = 1e-11 * (1.0 + there.translation().norm());
            within(&format!("{}: rotation", solver.name()), angle, limit)?;
            within(&format!("{}: translation", solver.name()), distance, limit)?;
        }
        Ok(())
    });
}

/// P42. A weight of zero removes a point, and weights twice as large for all give the same pose: ≤ 1e-13 (1 + L) for
/// `weighted-kabsch`, 1e-10 for `mahalanobis`, which iterates. A noise of 1e8 times the others' is a weight of 1e-16,
/// half the noise a weight of four.
///
/// Seen to fail when every weight is larger by one.
#[test]
fn a_point_without_weight_is_no_point() {
    let solvers = solvers();
    let weighing =
        |asked: &&Asked| ["mahalanobis ", "weighted-kabsch "].iter().any(|name| asked.name().starts_with(name));
    let compared = Cell::new(0);
    let cases = law(128, bare(5.0, 5e-3), |scene| {
        prop_assume!(scene.points.len() >= 5);
        let (mut fewer, mut deaf) = (scene.clone(), scene.clone());
        deaf.points.last_mut().expect("five points").measured.covariance *= 1e16;
        fewer.points.pop();
        let places: Vec<Vector3<f64>> = fewer.points.iter().map(|point| point.model.coords).collect();
        let [_, second, first] = extents(&places);
        prop_assume!(second > 0.01 * first);
        for solver in solvers.iter().filter(weighing) {
            if let (Ok(without), Ok(with)) = (solver.solve(&fewer), solver.solve(&deaf)) {
                same(solver, &without, &with)?;
            }
            for times in [0.25, 0.5] {
                let mut weighted = scene.clone();
                weighted.points.iter_mut().for_each(|point| point.measured.covariance *= times);
                if let (Ok(before), Ok(after)) = (solver.solve(&scene), solver.solve(&weighted)) {
                    same(solver, &before, &after)?;
                    compared.set(compared.get() + 1);
                }
            }
        }
        Ok(())
    });
    not_idle("compared", compared.get(), cases, 2);
}

/// P44. Three exact points: every solver that claims least squares agrees with the triad, ≤ 1e-11 (1 + L).
///
/// Seen to fail when the determinant's sign is omitted.
#[test]
fn three_points_leave_one_answer() {
    let solvers = solvers();
    law(256, bare(5.0, 0.0), |mut scene| {
        scene.points.truncate(3);
        let places: Vec<Vector3<f64>> = scene.points.iter().map(|point| point.model.coords).collect();
        let [_, second, first] = extents(&places);
        prop_assume!(second > 0.01 * first);
        let triad = solvers.iter().find(|asked| asked.name().starts_with("triad")).expect("it is listed");
        let Ok(expected) = triad.solve(&scene) else { return Ok(()) };
        for solver in claimants(&solvers) {
            let Ok(found) = solver.solve(&scene) else { continue };
            let (angle, distance) = apart(&found, &expected);
            let limit = 1e-11 * (1.0 + expected.translation().norm());
            within(&format!("{}: rotation", solver.name()), angle, limit)?;
            within(&format!("{}: translation", solver.name()), distance, limit)?;
        }
        Ok(())
    });
}

/// P45. With all residuals below the threshold, truncated least squares equal least squares, and so does Huber's loss:
/// ≤ 1e-9.
///
/// Seen to fail when Huber's weights decrease from zero on.
#[test]
fn robust_solvers_trust_what_is_near() {
    let robust = [
        SOLVERS.build(&seafix_component::Choice::named("gnc-tls").with("threshold", 1e3)),
        SOLVERS.build(&seafix_component::Choice::named("irls").with("loss", "huber").with("threshold", 1e3)),
    ];
    let kabsch = SOLVERS.build(&seafix_component::Choice::named("kabsch")).expect("it is listed");
    law(128, bare(5.0, 5e-3), |scene| {
        let Ok(expected) = kabsch.solve(&scene.observations()) else { return Ok(()) };
        for solver in robust.iter().flatten() {
            let found = solver.solve(&scene.observations()).expect("what Kabsch answers, they answer");
            let (angle, distance) = apart(&found, &expected);
            within(&format!("{solver:?}: rotation"), angle, 1e-9)?;
            within(&format!("{solver:?}: translation"), distance, 1e-9)?;
        }
        Ok(())
    });
    assert!(robust.iter().all(Result::is_ok));
}

/// P45. `gnc-tls` keeps exactly the maximum set of points that a rigid motion brings within the threshold, if the set
/// is unique. Up to half of the points are more than 0.2 m off in any direction; nearer ones might pass for noise of a
/// few millimetres and make the maximum set undecided. Complete enumeration gives the sets.
///
/// Seen to fail when no triples are tried after the graduation.
#[test]
fn truncated_squares_keep_the_only_consensus() {
    let solver = SOLVERS.build(&seafix_component::Choice::named("gnc-tls")).expect("it is listed");
    let outliers = prop::collection::vec((any::<prop::sample::Index>(), vector(1.0)), 0..=4);
    let compared = Cell::new(0);
    let cases = law(128, (bare(5.0, 2e-3), outliers), |(mut scene, outliers)| {
        scene.points.truncate(10);
        let count = scene.points.len();
        prop_assume!(count >= 6 && outliers.len() <= count / 2);
        prop_assume!(outliers.iter().all(|(_, off)| off.norm() > 0.1));
        for (index, off) in &outliers {
            let point = index.get(&scene.points).measured.at;
            let k = index.index(count);
            scene.points[k].measured.at = point + off * 2.0;
        }
        let Some(only) = only_consensus(&scene.points) else { return Ok(()) };
        prop_assume!(2 * only.len() >= count);
        compared.set(compared.get() + 1);
        prop_assert_eq!(solver.used(&scene.observations()), only);
        Ok(())
    });
    not_idle("a unique consensus", compared.get(), cases, 4);
}

/// The maximum set of points within 4.5 standard deviations of their own least-squares pose, by complete enumeration;
/// `None` if it is not unique.
fn only_consensus(points: &[Observation]) -> Option<Vec<usize>> {
    let kabsch = SOLVERS.build(&seafix_component::Choice::named("kabsch")).expect("it is listed");
    let mut found: Vec<Vec<usize>> = Vec::new();
    for set in 0..1u32 << points.len() {
        let max = found.first().map_or(3, Vec::len);
        if (set.count_ones() as usize) < max {
            continue;
        }
        let members: Vec<usize> = (0..points.len()).filter(|k| set >> k & 1 == 1).collect();
        let data = Observations { points: members.iter().map(|&k| points[k]).collect(), rig: None };
        let Ok(pose) = kabsch.solve(&data) else { continue };
        let near = |point: &Observation| {
            point.residual(&pose).norm() <= 4.5 * (point.measured.covariance.trace() / 3.0).sqrt()
        };
        if data.points.iter().all(near) {
            if members.len() > max {
                found.clear();
            }
            found.push(members);
        }
    }
    if found.len() == 1 { found.pop() } else { None }
}

/// General optimisers without knowledge of poses and analytic derivatives find no better minimum than
/// `stereo-reprojection`, and the same one, within a thousandth of a standard deviation of its covariance.
///
/// Seen to fail when the solver stops at the resolution of the cost.
#[test]
fn independent_judges_agree() {
    let build = |name: &str| SOLVERS.build(&seafix_component::Choice::named(name)).expect("it is listed");
    let (ours, judges) = (build("stereo-reprojection"), ["l-bfgs", "nelder-mead"].map(|name| (name, build(name))));
    let compared = Cell::new(0);
    let cases = law(64, seen(0.5), |mut scene| {
        prop_assume!(scene.points.len() >= 5);
        scene.points.iter_mut().for_each(|point| point.model_sigma = 0.0);
        let data = scene.observations();
        let (Ok(pose), true) = (ours.solve(&data), scene.rig.is_some()) else { return Ok(()) };
        let covariance = ours.covariance(&data, &pose).expect("it answered");
        for (name, judge) in &judges {
            let Ok(found) = judge.solve(&data) else { continue };
            let xi = pose.error_to(&found);
            let off = covariance.matrix.cholesky().map_or(f64::NAN, |c| xi.dot(&c.solve(&xi)));
            within(&format!("{name}: squared standard deviations"), off, 1e-6)?;
            compared.set(compared.get() + 1);
        }
        Ok(())
    });
    not_idle("compared", compared.get(), cases, 2);
}

/// An optimiser that is stopped before its minimum rejects, with its iterations and the remaining distance; its answers
/// are within that distance of `stereo-reprojection`'s pose.
///
/// Seen to fail when every end counts as a minimum.
#[test]
fn what_has_not_converged_is_refused() {
    let build = |choice: seafix_component::Choice| SOLVERS.build(&choice).expect("it is listed");
    let ours = build(seafix_component::Choice::named("stereo-reprojection"));
    let (refused, answered) = (Cell::new(0), Cell::new(0));
    let scene = (seen(0.5), prop_oneof![Just("l-bfgs"), Just("nelder-mead")], 1..40_i64);
    let cases = law(128, scene, |(mut scene, name, iterations)| {
        prop_assume!(scene.points.len() >= 5);
        scene.points.iter_mut().for_each(|point| point.model_sigma = 0.0);
        let data = scene.observations();
        let hasty = build(seafix_component::Choice::named(name).with("iterations", iterations));
        let Ok(pose) = ours.solve(&data) else { return Ok(()) };
        match hasty.solve(&data) {
            Ok(found) => {
                let covariance = ours.covariance(&data, &pose).expect("it answered");
                let xi = pose.error_to(&found);
                let off = covariance.matrix.cholesky().map_or(f64::NAN, |c| xi.dot(&c.solve(&xi)).sqrt());
                within(&format!("{name}, {iterations} iterations: standard deviations"), off, 0.02)?;
                answered.set(answered.get() + 1);
            }
            Err(Degenerate::Unconverged { steps, off, max }) => {
                prop_assert!(steps > 0 && off > max, "{name}: {steps} {off} {max}");
                refused.set(refused.get() + 1);
            }
            Err(other) => prop_assert!(false, "{}: {}", name, other),
        }
        Ok(())
    });
    not_idle("rejected", refused.get(), cases, 8);
    not_idle("answered", answered.get(), cases, 16);
}
