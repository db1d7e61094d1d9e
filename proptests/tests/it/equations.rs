//! The paper's equations, in row vectors.

use nalgebra::Vector3;
use proptest::prelude::*;
use seafix_geometry::{
    Body, Object, Point, Transform, World,
    row_vector::{BodyAtFix, BodyAtStart, H, eq1, eq2, eq3, eq4, eq5, eq6},
};
use seafix_proptests::{
    law,
    points::{sine_of_smallest_angle, triangle},
    poses::{pose, rotation, vector},
    within,
};

/// Maximum coordinate (m).
const REACH: f64 = 100.0;

/// P9. Formula (5) with exact points returns the true H: rotation ≤ 1e-12 / sin, translation ≤
/// 1e-12 (1 + L) / sin.
///
/// The three points lie within 30 m of the object's origin, their sides are 0.3 to 10 m long.
///
/// Seen to fail when Eq. (5) inverts the other factor.
#[test]
fn direct_referencing_is_exact() {
    let near = triangle::<Object>().prop_map(|[p1, p2, p3]: [Point<Object>; 3]| {
        let back = p1.coords * -0.4;
        [p1 + back, p2 + back, p3 + back]
    });
    law(1024, (near, pose::<Body, Object>(50.0)), |(p, body_from_object)| {
        let c = p.map(|point| body_from_object * point);
        let (measured, known) = (eq3(&c).expect("no line"), eq4(&p).expect("no line"));
        let found = eq5(&measured, &known);
        let truth = H::<Body, Object>::from(body_from_object.inverse());
        let sine = sine_of_smallest_angle(&p);
        let difference = found.matrix - truth.matrix;
        let longest = body_from_object.translation().norm();
        within("rotation", difference.fixed_view::<3, 3>(0, 0).amax(), 1e-12 / sine)?;
        within("translation", difference.fixed_view::<1, 3>(3, 0).amax(), 1e-12 * (1.0 + longest) / sine)
    });
}

/// P10. Formula (2), through the world, equals formula (5), direct, on noise-free data: ≤ 1e-10.
///
/// The surveyed base and the three identified points are different points of the object; both triangles have sines of
/// at least 0.05 and sides of 0.3 to 10 m.
///
/// Seen to fail when Eq. (2) omits the inverse of the object's pose in the world.
#[test]
fn by_the_world_and_direct_agree() {
    let solid = |corners: &[Point<Object>; 3]| sine_of_smallest_angle(corners) >= 0.05;
    let base = triangle::<Object>().prop_filter("a thin base", solid);
    let identified = triangle::<Object>().prop_filter("a thin triangle", solid);
    law(
        512,
        (base, identified, pose::<World, Object>(20.0), pose::<World, BodyAtStart>(50.0), pose::<World, Body>(50.0)),
        |(base, identified, placed, world_from_start, world_from_body)| {
            // The object frame is that of Eq. (1) on the surveyed base.
            let [p1, p2, p3] = base.map(|point| placed * Point::from(point.coords * 0.2));
            let object_to_world = eq1(&p1, &p2, &p3).expect("no line");
            let seen = identified.map(|point| placed * Point::from(point.coords * 0.2));
            let known = seen.map(|point| object_to_world.inverse().apply(&point));
            let measured = seen.map(|point| world_from_body.inverse() * point);
            let direct = eq5(&eq3(&measured).expect("no line"), &eq4(&known).expect("no line"));
            let start_to_now = H::<BodyAtStart, Body>::from(world_from_body.inverse() * world_from_start);
            let by_world = eq2(&start_to_now, &H::from(world_from_start), &object_to_world);
            within("(2) − (5)", (by_world.matrix - direct.matrix).amax(), 1e-10)
        },
    );
}

/// A trajectory of a vehicle: successive poses in the world with steps of up to half a metre and three degrees, from
/// within ±30 m.
fn track(
    start: (nalgebra::UnitQuaternion<f64>, Vector3<f64>),
    turns: &[Vector3<f64>],
    steps: usize,
) -> Vec<Transform<World, Body>> {
    let mut pose = Transform::new(start.0, start.1);
    let mut path = vec![pose];
    for step in 0..steps {
        let phi = turns[step % turns.len()] * 0.03;
        let ahead = Vector3::new(0.3, 0.1, -0.05).component_mul(&turns[(step * 7 + 3) % turns.len()]);
        let motion = Transform::<Body, Body>::exp(&[phi.x, phi.y, phi.z, ahead.x, ahead.y, ahead.z].into());
        pose = (pose * motion).renormalized();
        path.push(pose);
    }
    path
}

/// The chain of odometry from the first pose of a trajectory, step by step, in row vectors.
fn chained(path: &[Transform<World, Body>]) -> H<BodyAtFix, Body> {
    let first: H<BodyAtFix, Body> = H::from(Transform::identity());
    path.windows(2).fold(first, |chain, pair| chain * H::<Body, Body>::from(pair[1].inverse() * pair[0]))
}

/// P11. Chain (6): a fix at i carried to j by exact odometry equals a fix at j: ≤ 1e-10 after 2 000 steps; for j = i it
/// is the fix bit for bit.
///
/// Seen to fail when Eq. (6) is taken without the inverse.
#[test]
fn a_fix_is_carried_by_odometry() {
    let turns = prop::collection::vec(vector(1.0), 31);
    law(16, (pose::<World, Object>(30.0), rotation(), vector(30.0), turns), |(placed, r, t, turns)| {
        let path = track((r, t), &turns, 2000);
        prop_assume!(path.iter().all(|pose| pose.translation().amax() <= REACH));
        let fix = |pose: &Transform<World, Body>| placed.inverse() * *pose;
        let at_i = H::<BodyAtFix, Object>::from(fix(&path[0]).relabel());
        let at_j = H::<Body, Object>::from(fix(&path[2000]));
        within("(6) − (5)", (eq6(&chained(&path), &at_i).matrix - at_j.matrix).amax(), 1e-10)?;
        prop_assert_eq!(eq6(&chained(&path[..1]), &at_i).matrix, at_i.matrix);
        Ok(())
    });
}

/// P12. (6) composed in one step or in many agrees: ≤ 1e-12 times the number of steps.
///
/// Seen to fail when products of rows multiply right to left.
#[test]
fn many_steps_are_one() {
    let turns = prop::collection::vec(vector(1.0), 31);
    law(
        128,
        (pose::<World, Object>(30.0), rotation(), vector(30.0), turns, 1usize..200),
        |(placed, r, t, turns, n)| {
            let path = track((r, t), &turns, n);
            let at_i = H::<BodyAtFix, Object>::from((placed.inverse() * path[0]).relabel());
            let one: H<BodyAtFix, Body> = H::from((path[n].inverse() * path[0]).relabel());
            let many = eq6(&chained(&path), &at_i);
            within("many − one", (many.matrix - eq6(&one, &at_i).matrix).amax(), 1e-12 * n as f64)
        },
    );
}
