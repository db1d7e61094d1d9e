//! The frame of three points, of an object and of a site.

use proptest::prelude::*;
use seafix_geometry::{Camera, Object, Point, Transform, World, triad};
use seafix_proptests::{
    law,
    points::{point, sine_of_smallest_angle, triangle},
    poses::pose,
    within,
};
use seafix_referencing::{ModelPoint, Site, SiteObject, TargetKind};

/// P7. The triad frame: unit vectors to 1e-14, mutually orthogonal to 1e-13, right-handed (det = +1),
/// origin = P1 exactly, e1 along P1→P3 and e3 normal to P1P2 and P1P3, P2 with y < 0.
///
/// The tolerance of the directions is 1e-13 over the sine of the smallest angle, the accuracy that rounding of the
/// coordinates allows.
///
/// Seen to fail when z is inverted (P2 has y > 0) and when P2 and P3 are exchanged.
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
/// Seen to fail when z is taken from the coordinate frame instead of the points.
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

/// Objects: a base by the rule of the frame, further points, and a surveyed pose in the world.
fn object() -> impl Strategy<Value = SiteObject> {
    (triangle::<World>(), prop::collection::vec((point::<Object>(3.0), 0.0..0.01), 0..6)).prop_map(|(base, more)| {
        let [p1, p2, p3] = base;
        let world_from_object = triad::<World, Object>(&p1, &p2, &p3).expect("the triangle is no line");
        let own = base.map(|corner| (world_from_object.inverse() * corner, 0.0));
        let points = own.into_iter().chain(more).enumerate();
        SiteObject {
            id: String::new(),
            base: [0, 1, 2],
            base_in_world: Some(base),
            survey_sigma: 0.01,
            world_from_object: Some(world_from_object),
            points: points
                .map(|(i, (at, sigma))| ModelPoint { sigma, ..ModelPoint::exact(format!("P{i}"), at) })
                .collect(),
            edges: Vec::new(),
            interest: Vec::new(),
        }
    })
}

/// P13. The site frame is the frame of the chosen object: H from that object to the site is I exactly, so that its
/// points keep their coordinates bit for bit. Every other object's points are at their surveyed positions: ≤ 1e-12 (1 +
/// L).
///
/// Seen to fail when the chosen object is transformed through the world and back like the others.
#[test]
fn the_chosen_object_is_the_frame_of_the_site() {
    law(256, (prop::collection::vec(object(), 1..5), any::<prop::sample::Index>()), |(mut objects, chosen)| {
        let frame = chosen.index(objects.len());
        for (i, object) in objects.iter_mut().enumerate() {
            object.id = format!("object {i}");
        }
        let site = Site { name: "site".to_owned(), frame, objects, warnings: Vec::new() };
        let full = &site.targets(TargetKind::Site).expect("every object's place is known")[0];
        prop_assert_eq!(full.world_from_object, site.objects[frame].world_from_object);
        let mut points = full.points.iter();
        for (i, object) in site.objects.iter().enumerate() {
            for (own, carried) in object.points.iter().zip(&mut points) {
                if i == frame {
                    prop_assert_eq!((own.at, own.sigma), (carried.at, carried.sigma));
                }
                let place = |target: &Option<Transform<World, Object>>, p| target.expect("a place is known") * p;
                let (surveyed, site) =
                    (place(&object.world_from_object, own.at), place(&full.world_from_object, carried.at));
                within("in the world", surveyed.distance(&site), 1e-12 * (1.0 + surveyed.coords.norm()))?;
            }
        }
        prop_assert!(points.next().is_none());
        Ok(())
    });
}
