//! Laws of solvers, over any list of them: those of the registry, or one that a program added.

use std::cell::Cell;

use nalgebra::{Matrix3, Vector3, Vector6};
use proptest::prelude::*;
use seafix_geometry::{Camera, Object, Transform};
use seafix_referencing::{Degenerate, SOLVERS, Solver};

use crate::{
    law::{distinctive, law, not_idle, within},
    least_squares::least_squares,
    poses::{apart, pose, vector},
    scenes::{Scene, bare, corners, extents, seen},
    variants::{Variant, variants},
};

/// A law of solvers.
pub type Law = fn(&[Asked]);

/// The laws with their statements.
pub const LAWS: [(&str, Law); 7] = [
    ("exact points give the exact pose", exact_points_give_the_exact_pose),
    ("the answer moves with the camera", moves_with_the_camera),
    ("the answer moves with the object", moves_with_the_object),
    ("no motion has smaller squares", no_motion_has_smaller_squares),
    ("a pose is never a reflection", a_pose_is_never_a_reflection),
    ("mirrored points leave a large residual", mirrored_points_leave_a_large_residual),
    ("the order of points does not matter", the_order_of_points_does_not_matter),
];

/// A solver, with counts of due and given answers.
pub struct Asked {
    /// The solver.
    pub solver: Variant<dyn Solver>,
    /// Whether it solves points without pixels.
    pub takes_bare: bool,
    due: Cell<u32>,
    answered: Cell<u32>,
}

impl Asked {
    /// The solver before its first answer.
    ///
    /// # Panics
    /// If a solver that needs no pixels rejects the corners of a box, or one that needs them claims least squares.
    pub fn new(solver: Variant<dyn Solver>) -> Self {
        let takes_bare = !solver.component.needs_pixels();
        let answers = solver.component.solve(&corners().observations()).is_ok();
        assert_eq!(answers, takes_bare, "{}: the corners of a box, bare", solver.name);
        let claims = solver.component.least_squares();
        assert!(takes_bare || !claims, "{} claims least squares and rejects the corners of a box", solver.name);
        Self { solver, takes_bare, due: Cell::new(0), answered: Cell::new(0) }
    }

    /// The pose of a scene. An answer is due if the solver has its required points and pixels: all scenes here are far
    /// from a line.
    ///
    /// # Errors
    /// As the solver.
    pub fn solve(&self, scene: &Scene) -> Result<Transform<Object, Camera>, Degenerate> {
        let answer = self.solver.component.solve(&scene.observations());
        if self.has_enough(scene) && (self.takes_bare || scene.rig.is_some()) {
            self.due.set(self.due.get() + 1);
            self.answered.set(self.answered.get() + u32::from(answer.is_ok()));
        }
        answer
    }

    /// Whether the scene has the minimum number of points.
    pub fn has_enough(&self, scene: &Scene) -> bool {
        scene.points.len() >= self.solver.component.minimum()
    }

    /// The name for failures.
    pub fn name(&self) -> &str {
        &self.solver.name
    }

    /// The tolerance of solvers that answer to rounding error; for others a hundred thousandth (rad, m).
    pub fn limit(&self, exact: f64) -> f64 {
        if self.solver.component.to_rounding() { exact } else { exact.max(1e-5) }
    }
}

/// Requires the answers of every solver over `cases` cases: due in at least one of four, given in at least nine of ten.
/// `pixels`: the scenes have pixels, so that no solver is exempt.
///
/// # Panics
/// If a solver answers less.
pub fn all_answer(solvers: &[Asked], cases: u32, pixels: bool) {
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

/// All variants of the registered solver `name`, one of the program or an added one; empty if there is none.
///
/// # Panics
/// As [`Asked::new`].
pub fn named(name: &str) -> Vec<Asked> {
    let of_name = |solver: &Variant<dyn Solver>| solver.name.split(' ').next() == Some(name);
    variants(&SOLVERS, &[]).into_iter().filter(of_name).map(Asked::new).collect()
}

/// The solvers that claim least squares.
pub fn claimants(solvers: &[Asked]) -> impl Iterator<Item = &Asked> {
    solvers.iter().filter(|asked| asked.solver.component.least_squares())
}

/// P38. Exact data: pose error (rad, m) ≤ 1e-12 (1 + L), for every solver of points without pixels; each answers at
/// least nine of ten scenes, whose second extent is at least 0.2 of the first.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn exact_points_give_the_exact_pose(solvers: &[Asked]) {
    let cases = law(256, bare(100.0, 0.0), |scene| {
        let truth = &scene.object_from_camera;
        let limit = 1e-12 * (1.0 + truth.translation().norm());
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            let Ok(found) = solver.solve(&scene) else { continue };
            let (angle, distance) = apart(&found, truth);
            within(&format!("{}: rotation", solver.name()), angle, solver.limit(limit))?;
            within(&format!("{}: translation", solver.name()), distance, solver.limit(limit))?;
        }
        Ok(())
    });
    all_answer(solvers, cases, false);
}

/// Whether a solver answers both scenes or neither, and the `moved` one with the pose that follows from its answer
/// `before` the motion.
fn agree(
    solver: &Asked,
    scene: &Scene,
    moved: &Scene,
    expected: impl Fn(Transform<Object, Camera>) -> Transform<Object, Camera>,
) -> Result<(), TestCaseError> {
    match (solver.solve(scene), solver.solve(moved)) {
        (Ok(before), Ok(after)) => {
            let (angle, distance) = apart(&after, &expected(before));
            within(&format!("{}: rotation", solver.name()), angle, solver.limit(1e-10))?;
            within(&format!("{}: translation", solver.name()), distance, solver.limit(1e-10))
        }
        (Err(_), Err(_)) => Ok(()),
        (before, after) => {
            prop_assert!(false, "{}: {:?}, moved {:?}", solver.name(), before, after);
            Ok(())
        }
    }
}

/// P39. Equivariance, camera side. In row vectors (y = x H) solve(x A, y) = A⁻¹ solve(x, y): ≤ 1e-10, for noisy points
/// without pixels and with covariances; a solver that rejects one rejects both, and answers at least nine of ten.
///
/// Pixels do not move with a camera, so that a solver that needs them rejects here and is tested on the object side
/// only.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn moves_with_the_camera(solvers: &[Asked]) {
    let cases = law(256, (bare(5.0, 5e-3), pose::<Camera, Camera>(5.0)), |(scene, motion)| {
        let moved = scene.camera_moved(&motion);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            agree(solver, &scene, &moved, |before| before * motion.inverse())?;
        }
        Ok(())
    });
    all_answer(solvers, cases, false);
}

/// P39. Equivariance, object side. In row vectors solve(x, y B) = solve(x, y) B: ≤ 1e-10, for noisy points with and
/// without pixels; a solver that rejects one rejects both, and answers at least nine of ten of its kind.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn moves_with_the_object(solvers: &[Asked]) {
    let scene = prop_oneof![bare(5.0, 5e-3).boxed(), seen(0.5).boxed()];
    let cases = law(256, (scene, pose::<Object, Object>(5.0)), |(scene, motion)| {
        let moved = scene.object_moved(&motion);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            agree(solver, &scene, &moved, |before| motion * before)?;
        }
        Ok(())
    });
    all_answer(solvers, cases, false);
}

/// P40. The sum of squared residuals of every solver that claims least squares is the minimum, computed from Horn's
/// eigenvalue, and no larger than that of 1 000 random perturbations of its own pose (+ 1e-15). No solver's sum is
/// below the minimum. A claimant's sum is thus at most any other's on the same points.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn no_motion_has_smaller_squares(solvers: &[Asked]) {
    let steps = prop::collection::vec((vector(1.0), vector(1.0), -7.0..0.0), 1000);
    let cases = law(128, (bare(5.0, 5e-3), steps), |(scene, steps)| {
        let minimum = least_squares(&scene);
        for solver in solvers.iter().filter(|solver| solver.has_enough(&scene)) {
            let Ok(pose) = solver.solve(&scene) else { continue };
            within(&format!("{}: below the minimum", solver.name()), minimum - scene.squares(&pose), 1e-12)?;
        }
        for solver in claimants(solvers).filter(|solver| solver.has_enough(&scene)) {
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
    all_answer(solvers, cases, false);
}

/// P41. det R = +1 always, also for coplanar, noisy and mirrored input: RᵀR = I and det R = 1 to 1e-13, no NaN. Every
/// solver answers at least nine of ten of its kind.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn a_pose_is_never_a_reflection(solvers: &[Asked]) {
    let scene =
        prop_oneof![bare(20.0, 0.0).boxed(), bare(20.0, 0.02).boxed(), bare(20.0, 1.0).boxed(), seen(0.5).boxed()];
    let cases = law(256, (scene, any::<bool>()), |(scene, mirrored)| {
        let scene = if mirrored { scene.mirrored() } else { scene };
        for solver in solvers {
            let Ok(found) = solver.solve(&scene) else { continue };
            let r = found.rotation_matrix();
            within(&format!("{}: det R − 1", solver.name()), (r.determinant() - 1.0).abs(), 1e-13)?;
            within(&format!("{}: RᵀR − I", solver.name()), (r.transpose() * r - Matrix3::identity()).amax(), 1e-13)?;
            prop_assert!(found.is_finite(), "{}: {:?}", solver.name(), found);
        }
        Ok(())
    });
    all_answer(solvers, cases, false);
}

/// P41. Mirrored input has a large residual: no rotation fits a reflection better than four times the minimum
/// eigenvalue of the points' scatter, and every solver that claims least squares reaches it (to 1e-9 of the total
/// scatter).
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn mirrored_points_leave_a_large_residual(solvers: &[Asked]) {
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
    all_answer(solvers, cases, false);
}

/// P42. The order of the points is irrelevant: ≤ 1e-13 (1 + L) between a scene and its reverse for solvers in closed
/// form, 1e-10 for those that iterate, which end a step apart; for noisy points with and without pixels. It holds for
/// poses of all points, not for the triad, whose frame starts at the first of three.
///
/// # Panics
/// If a solver breaks the law, with the smallest counterexample found.
pub fn the_order_of_points_does_not_matter(solvers: &[Asked]) {
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

/// The solvers with one sum and one decomposition: only rounding separates two forms of the same problem. (Solvers that
/// exclude points, or iterate to a ten-billionth of a standard deviation, are not among them.)
const CLOSED: [&str; 4] = ["horn", "kabsch", "umeyama", "weighted-kabsch"];

/// Checks that two poses are equal within the tolerance of the solver.
///
/// # Errors
/// The difference, if they are not.
pub fn same(solver: &Asked, a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> Result<(), TestCaseError> {
    let closed = CLOSED.iter().any(|name| solver.name().starts_with(&format!("{name} ")));
    let exact = if closed { 1e-13 * (1.0 + a.translation().norm()) } else { 1e-10 };
    let (angle, distance) = apart(a, b);
    within(&format!("{}: rotation", solver.name()), angle, solver.limit(exact))?;
    within(&format!("{}: translation", solver.name()), distance, solver.limit(exact))
}
