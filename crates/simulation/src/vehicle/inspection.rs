//! The route of an inspection, with one stand-off view of each point of interest.
//!
//! Each view is as near to the point's normal as the mounted cameras and the surrounding bodies allow.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Body, Camera, Point, StereoRig, Transform, World, so3};
use seafix_referencing::BoundingBox;

use super::route::{Goal, PlannedRoute, ROUNDING, Route};
use crate::scene::Scene;

/// Maximum angle between a view and the point's normal (degrees).
const OBLIQUE_DEG: i32 = 60;
/// Angular step of the rings about the normal on which views are sought (degrees).
const RING_DEG: i32 = 5;
/// Number of places on each ring.
const PLACES: i32 = 24;
/// Number of headings tried at each place.
const HEADINGS: i32 = 4;
/// Minimum distance of the inspected point from the image border, as a fraction of the shorter side.
const BORDER: f64 = 0.1;
/// Length of the last part of a line of sight that the point's own relief may occlude (m).
const RELIEF: f64 = 0.01;
/// Step of the collision check along a segment (m).
const STEP: f64 = 0.1;
/// Heights above the altitude that are tried on the path between two views (m).
const RAISED: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 8.0];

/// The cameras as mounted, and the parts that need clearance.
#[derive(Debug, Clone)]
pub(crate) struct Looker<'a> {
    pub(crate) rig: &'a StereoRig,
    pub(crate) body_from_camera: Transform<Body, Camera>,
    /// Cameras and lamps, in the left camera's frame (m).
    pub(crate) parts: Vec<Vector3<f64>>,
}

/// The left camera's position and the heading of the level vehicle (rad, from north over east).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stand {
    at: Vector3<f64>,
    heading: f64,
}

/// A point of interest in the world.
struct Wanted {
    /// Names of the object and of the point.
    name: String,
    at: Vector3<f64>,
    normal: Vector3<f64>,
}

/// Numbers of rejected places about a point, by cause.
#[derive(Debug, Clone, Copy, Default)]
struct Rejected {
    touching: usize,
    outside: usize,
    hidden: usize,
    under: usize,
}

/// Plans the route along the points of interest of all objects, or of one. `scene` is the site as built, which is the
/// planner's knowledge.
///
/// Nearest neighbour and 2-opt order the views. The vehicle moves from one view to the next straight if that segment is
/// clear, or else climbs to the route's altitude, crosses and descends.
pub(super) fn planned(
    route: &Route,
    only: Option<usize>,
    scene: &Scene,
    looker: &Looker<'_>,
) -> Result<PlannedRoute, String> {
    let ground = Ground::new(route, scene, looker);
    let wanted = wanted(only, scene);
    if wanted.is_empty() {
        let whose = only.map_or_else(|| "the site".to_owned(), |o| format!("`{}`", scene.nominal.objects[o].id));
        return Err(format!(
            "route.kind = `inspection`; {whose} has no point of interest; add an [[object.interest]] to the site file"
        ));
    }
    let views: Vec<Stand> = wanted.iter().map(|point| ground.view(point)).collect::<Result<_, _>>()?;
    let order = short(&views);
    let rest = 2.0 * ROUNDING + route.hold * route.speed;
    let mut planned = Along::new(views[order[0]], rest);
    for pair in order.windows(2) {
        let (a, b) = (&views[pair[0]], &views[pair[1]]);
        let names = [pair[0], pair[1]].map(|k| &wanted[k].name);
        for corner in ground.segment(a, b, names)? {
            planned.go(corner);
            // Corners are not rounded at a stop.
            planned.rest(2.0 * ROUNDING);
        }
        planned.rest(route.hold * route.speed);
    }
    Ok(planned.finish(route.speed))
}

/// The points of interest in the world, as built; a point without a normal is viewed from above.
fn wanted(only: Option<usize>, scene: &Scene) -> Vec<Wanted> {
    let objects = scene.nominal.objects.iter().zip(&scene.world_from_object).enumerate();
    let chosen = objects.filter(|(o, _)| only.is_none_or(|one| one == *o));
    let points = chosen.flat_map(|(_, (object, pose))| object.interest.iter().map(move |point| (object, pose, point)));
    let of = |(object, pose, point): (&seafix_referencing::SiteObject, &Transform<World, _>, _)| {
        let point: &seafix_referencing::Interest = point;
        Wanted {
            name: format!("{}/{}", object.id, point.id),
            at: (*pose * point.at).coords,
            normal: point.normal.map_or_else(|| -Vector3::z(), |normal| pose.rotation() * normal),
        }
    };
    points.map(of).collect()
}

/// The scene for the collision check, with the required clearance.
struct Ground<'a> {
    route: &'a Route,
    scene: &'a Scene,
    looker: &'a Looker<'a>,
    gates: Vec<BoundingBox<World>>,
    /// Depth of the route's altitude (m).
    cruise: f64,
}

impl<'a> Ground<'a> {
    fn new(route: &'a Route, scene: &'a Scene, looker: &'a Looker<'a>) -> Self {
        let gates = scene
            .objects
            .iter()
            .filter_map(|object| BoundingBox::around(object.points.iter().map(|point| Point::from(point.at))))
            .collect();
        Self { route, scene, looker, gates, cruise: scene.seabed.depth() - route.altitude }
    }

    /// The camera's attitude at a stand.
    fn turned(&self, stand: &Stand) -> UnitQuaternion<f64> {
        so3::exp(&(Vector3::z() * stand.heading)) * self.looker.body_from_camera.rotation()
    }

    /// Whether every camera and lamp keeps its clearance from bounding boxes, bodies and seabed.
    fn clear(&self, stand: &Stand) -> bool {
        let (turn, clearance) = (self.turned(stand), self.route.clearance);
        self.looker.parts.iter().all(|part| {
            let at = stand.at + turn * part;
            let place = Point::from(at);
            !self.gates.iter().any(|gate| gate.grown_contains(&place, clearance))
                && self.scene.distance(&at, clearance.max(1e-6)).is_none()
        })
    }

    /// Whether a straight segment from stop to stop is clear at every heading of the vehicle.
    fn clear_along(&self, a: &Stand, b: &Stand) -> bool {
        let mut segment = Along::new(*a, 2.0 * ROUNDING);
        segment.go(*b);
        segment.rest(2.0 * ROUNDING);
        let segment = segment.finish(1.0);
        let steps = (segment.length() / STEP).ceil() as i32;
        (0..=steps).all(|k| {
            let Goal { at, heading, .. } = segment.at(segment.length() * f64::from(k) / f64::from(steps));
            self.clear(&Stand { at, heading })
        })
    }

    /// The view of a point nearest to its normal.
    fn view(&self, point: &Wanted) -> Result<Stand, String> {
        let mut rejected = Rejected::default();
        let across = across_of(&point.normal);
        let other = point.normal.cross(&across);
        for degrees in (0..=OBLIQUE_DEG).step_by(RING_DEG as usize) {
            let (sine, cosine) = libm::sincos(f64::from(degrees).to_radians());
            let mut best: Option<(f64, Stand)> = None;
            for place in 0..if degrees == 0 { 1 } else { PLACES } {
                let (y, x) = libm::sincos(std::f64::consts::TAU * f64::from(place) / f64::from(PLACES));
                let from = point.normal * cosine + (across * x + other * y) * sine;
                if let Some((off, stand)) = self.stand(point, &from, &mut rejected)
                    && best.is_none_or(|(min, _)| off < min - 1e-9)
                {
                    best = Some((off, stand));
                }
            }
            if let Some((_, stand)) = best {
                return Ok(stand);
            }
        }
        let Rejected { touching, outside, hidden, under } = rejected;
        Err(format!(
            "route: no clear view of `{}` at north {:.2}, east {:.2}, depth {:.2} m from {} m within \
             {OBLIQUE_DEG}° of its normal: {touching} viewpoints are within {} m of a bounding box, a body or the \
             seabed, the point is outside of the images from {outside} and occluded from {hidden}, {under} have no \
             clear path upward; change route.stand-off, route.clearance or rig.ahead-deg",
            point.name, point.at.x, point.at.y, point.at.z, self.route.stand_off, self.route.clearance
        ))
    }

    /// The best view from the direction `from`, with the point's angle to the optical axis (rad).
    fn stand(&self, point: &Wanted, from: &Vector3<f64>, rejected: &mut Rejected) -> Option<(f64, Stand)> {
        let at = point.at + from * self.route.stand_off;
        let ahead = -from.xy();
        let straight = if ahead.norm() > 1e-6 { libm::atan2(ahead.y, ahead.x) } else { 0.0 };
        let headings = (0..HEADINGS).map(|k| straight + std::f64::consts::TAU * f64::from(k) / f64::from(HEADINGS));
        let mut seeing: Vec<(f64, Stand)> = headings
            .filter_map(|heading| {
                let stand = Stand { at, heading };
                let seen: Point<Camera> = Point::from(self.turned(&stand).inverse() * (point.at - at));
                let [w, h] = self.looker.rig.left().size().map(f64::from);
                self.looker.rig.sees(&seen, BORDER * w.min(h))?;
                Some((libm::atan2(seen.coords.xy().norm(), seen.coords.z), stand))
            })
            .collect();
        seeing.sort_by(|a, b| a.0.total_cmp(&b.0));
        if seeing.is_empty() {
            rejected.outside += 1;
            return None;
        }
        seeing.retain(|(_, stand)| self.clear(stand));
        if seeing.is_empty() {
            rejected.touching += 1;
            return None;
        }
        seeing.retain(|(_, stand)| {
            // The first two parts are the cameras.
            self.looker.parts.iter().take(2).all(|camera| {
                let viewpoint = stand.at + self.turned(stand) * camera;
                let to = point.at + (viewpoint - point.at).normalize() * RELIEF;
                self.scene.clear(&viewpoint, &to)
            })
        });
        if seeing.is_empty() {
            rejected.hidden += 1;
            return None;
        }
        seeing.retain(|(_, stand)| self.clear_along(stand, &self.above(stand, self.cruise)));
        if seeing.is_empty() {
            rejected.under += 1;
        }
        seeing.first().copied()
    }

    /// The stand straight above at a depth, or the stand itself if it is higher.
    fn above(&self, stand: &Stand, depth: f64) -> Stand {
        Stand { at: Vector3::new(stand.at.x, stand.at.y, depth.min(stand.at.z)), ..*stand }
    }

    /// The vertices from one view to the next, the last included.
    fn segment(&self, a: &Stand, b: &Stand, names: [&String; 2]) -> Result<Vec<Stand>, String> {
        if self.clear_along(a, b) {
            return Ok(vec![*b]);
        }
        for raised in RAISED {
            let depth = self.cruise - raised;
            let (up, down) = (self.above(a, depth), self.above(b, depth));
            if self.clear_along(a, &up) && self.clear_along(&up, &down) && self.clear_along(&down, b) {
                return Ok(vec![up, down, *b]);
            }
        }
        Err(format!(
            "route: no clear path from `{}` to `{}`, neither straight nor at {} m above the seabed or up to {} m \
             higher; raise route.altitude or lower route.clearance",
            names[0],
            names[1],
            self.route.altitude,
            RAISED[RAISED.len() - 1]
        ))
    }
}

/// A unit vector perpendicular to `normal`.
fn across_of(normal: &Vector3<f64>) -> Vector3<f64> {
    let axis = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    normal.cross(&axis).normalize()
}

/// An order of the views with a short path: nearest neighbour, then 2-opt.
fn short(views: &[Stand]) -> Vec<usize> {
    let n = views.len();
    let far = |i: usize, k: usize| (views[i].at - views[k].at).norm();
    let mut order = vec![0];
    while order.len() < n {
        let last = order[order.len() - 1];
        let left = (0..n).filter(|k| !order.contains(k));
        order.extend(left.min_by(|&i, &k| far(last, i).total_cmp(&far(last, k))));
    }
    // Reversing the part i..=k exchanges the two segments at its ends; an end of the path has none.
    loop {
        let mut better = false;
        for i in 0..n {
            for k in i + 1..n {
                let before = |i: usize| i.checked_sub(1).map(|before| order[before]);
                let after = order.get(k + 1).copied();
                let (first, last) = (order[i], order[k]);
                let segment = |a: Option<usize>, b: usize| a.map_or(0.0, |a| far(a, b));
                let was = segment(before(i), first) + segment(after, last);
                let would = segment(before(i), last) + segment(after, first);
                if would < was - 1e-9 {
                    order[i..=k].reverse();
                    better = true;
                }
            }
        }
        if !better {
            return order;
        }
    }
}

/// A route under construction.
struct Along {
    places: Vec<Vector3<f64>>,
    headings: Vec<f64>,
    lengths: Vec<f64>,
}

impl Along {
    /// Starts at a view with a stop.
    fn new(start: Stand, rest: f64) -> Self {
        let mut planned = Self { places: vec![start.at], headings: vec![start.heading], lengths: vec![0.0] };
        planned.rest(rest);
        planned
    }

    fn push(&mut self, at: Vector3<f64>, heading: f64, length: f64) {
        self.places.push(at);
        self.headings.push(heading);
        self.lengths.push(self.lengths[self.lengths.len() - 1] + length);
    }

    /// Moves to a place; headings turn the shorter way.
    fn go(&mut self, to: Stand) {
        let (at, heading) = (self.places[self.places.len() - 1], self.headings[self.headings.len() - 1]);
        let turn = libm::remainder(to.heading - heading, std::f64::consts::TAU);
        self.push(to.at, heading + turn, (to.at - at).norm());
    }

    fn rest(&mut self, length: f64) {
        self.push(self.places[self.places.len() - 1], self.headings[self.headings.len() - 1], length);
    }

    fn finish(self, speed: f64) -> PlannedRoute {
        PlannedRoute { places: self.places, lengths: self.lengths, headings: self.headings, look_at: None, speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_short() {
        // Shuffled places of a line: the path through them is the line, from one end to the other.
        let stand = |x: f64| Stand { at: Vector3::new(x, 0.0, 0.0), heading: 0.0 };
        let places = [3.0, 0.0, 5.0, 1.0, 4.0, 2.0];
        let order = short(&places.map(stand));
        let mut planned: Vec<f64> = order.iter().map(|&k| places[k]).collect();
        if planned[0] > planned[5] {
            planned.reverse();
        }
        assert_eq!(planned, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
