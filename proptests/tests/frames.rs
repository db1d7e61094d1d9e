//! The frame that three points define.

use seafix_geometry::{Camera, Object, Point, World, triad};
use seafix_proptests::{
    law,
    points::{sine_of_smallest_angle, triangle},
    poses::pose,
    within,
};

/// P7. The triad frame: unit vectors to 1e-14, mutually orthogonal to 1e-13, right-handed (det = +1),
/// origin = P1 exactly, e1 along P1→P3 and e3 normal to P1P2 and P1P3, P2 with y < 0.
///
/// The directions are held to 1e-13 over the sine of the smallest angle, the accuracy that the
/// coordinates' own rounding allows.
///
/// Seen to fail when z is turned round (P2 has y > 0) and when P2 and P3 change places.
#[test]
fn three_points_make_a_frame() {
    law(1024, triangle::<World>(), |corners| {
        let [p1, p2, p3] = corners;
        let frame = triad::<World, Object>(&p1, &p2, &p3).expect("the triangle is no line");
        let axes = frame.rotation_matrix();
        let [e1, e2, e3] = [0, 1, 2].map(|i| axes.column(i).into_owned());
        for (what, e) in [("|e1|", e1), ("|e2|", e2), ("|e3|", e3)] {
            within(what, (e.norm() - 1.0).abs(), 1e-14)?;
        }
        for (what, cosine) in [("e1·e2", e1.dot(&e2)), ("e2·e3", e2.dot(&e3)), ("e3·e1", e3.dot(&e1))] {
            within(what, cosine.abs(), 1e-13)?;
        }
        within("det − 1", (axes.determinant() - 1.0).abs(), 1e-13)?;
        within("origin", (frame.translation() - p1.coords).amax(), 0.0)?;
        let limit = 1e-13 / sine_of_smallest_angle(&corners);
        let (a, b) = ((p2 - p1).normalize(), (p3 - p1).normalize());
        within("e1 along P1P3", (e1 - b).norm(), limit)?;
        within("e3 · P1P2", e3.dot(&a).abs(), limit)?;
        within("e3 · P1P3", e3.dot(&b).abs(), limit)?;
        let y = (frame.inverse() * p2).coords.y;
        within("P2's y over its distance", y / (p2 - p1).norm(), -0.5e-3)
    });
}

/// P8. The triad of points moved by T is the triad moved by T: ≤ 1e-12 (1 + L) / sin(smallest angle).
///
/// Seen to fail when an axis is taken from the coordinate frame instead of the points.
#[test]
fn a_frame_moves_with_its_points() {
    law(1024, (triangle::<World>(), pose::<Camera, World>(100.0)), |(corners, motion)| {
        let [p1, p2, p3] = corners.map(|corner| -> Point<Camera> { motion * corner });
        let moved = triad::<Camera, Object>(&p1, &p2, &p3).expect("a moved triangle is no line");
        let [p1, p2, p3] = corners;
        let expected = motion * triad::<World, Object>(&p1, &p2, &p3).expect("the triangle is no line");
        let longest = motion.translation().norm().max(expected.translation().norm());
        let limit = 1e-12 * (1.0 + longest) / sine_of_smallest_angle(&corners);
        within("moved triad − triad of moved", (moved.matrix() - expected.matrix()).amax(), limit)
    });
}
