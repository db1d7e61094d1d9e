//! The virtual scene: every flat surface of the site in the world, and ray casting.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Point, World};

use crate::{
    blueprint::{Blueprint, BoxPlan, ObjectPlan, PipePlan},
    seabed::Seabed,
    stream::{Purpose, Stream},
};

/// The finish of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Finish {
    /// Coated steel with stains and growth.
    Plate,
    /// Paint on a plate.
    Paint,
    /// Rock.
    Rock,
}

/// A flat, convex surface in the world.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    /// Corners, in order.
    pub(crate) corners: Vec<Vector3<f64>>,
    /// Outward unit normal.
    pub(crate) normal: Vector3<f64>,
    /// Albedo.
    pub(crate) albedo: f32,
    /// Finish.
    pub(crate) finish: Finish,
    /// Layer: 1 for paint, which lies in the plane of its plate; 0 otherwise.
    pub(crate) layer: u8,
    /// Bounding sphere.
    ball: Ball,
}

/// A corner that a detector may find: a feature point or a distractor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corner {
    /// Position.
    pub(crate) at: Vector3<f64>,
    /// Outward normal of the side from which the corner is visible.
    pub(crate) normal: Vector3<f64>,
}

/// The surfaces and corners of one object.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub(crate) surfaces: Vec<Surface>,
    /// Feature points, in the order of the blueprint.
    pub(crate) points: Vec<Corner>,
    /// Corners that are no feature points.
    pub(crate) distractors: Vec<Corner>,
    ball: Ball,
}

/// Everything visible.
#[derive(Debug, Clone)]
pub(crate) struct VirtualScene {
    pub(crate) bodies: Vec<Body>,
    pub(crate) seabed: Seabed,
    pub(crate) texture: u32,
}

/// Number of sides of a pipe's cross-section.
const PIPE_SIDES: usize = 16;

/// A bounding sphere.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: Vector3<f64>,
    radius: f64,
}

impl Ball {
    /// The smallest sphere about a centre that holds all places.
    fn around<'a>(centre: Vector3<f64>, places: impl Iterator<Item = &'a Vector3<f64>>) -> Self {
        Self { centre, radius: places.map(|p| (p - centre).norm()).fold(0.0, f64::max) + 1e-6 }
    }

    /// Whether the line through `from` along `along` meets the sphere.
    fn meets(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> bool {
        let miss = (self.centre - from).cross(along).norm_squared();
        miss <= self.radius * self.radius * along.norm_squared()
    }
}

impl Surface {
    fn new(corners: Vec<Vector3<f64>>, outside: &Vector3<f64>, albedo: f64, finish: Finish) -> Self {
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
        let normal = if normal.dot(outside) < 0.0 { -normal } else { normal };
        let centre = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        let ball = Ball::around(centre, corners.iter());
        Self { corners, normal, albedo: albedo as f32, finish, layer: u8::from(finish == Finish::Paint), ball }
    }

    /// The t at which `from + t·along` meets the surface.
    fn hit(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let slope = self.normal.dot(along);
        if slope.abs() < 1e-12 || !self.ball.meets(from, along) {
            return None;
        }
        let t = self.normal.dot(&(self.corners[0] - from)) / slope;
        if !(t > 0.0) {
            return None;
        }
        let at = from + along * t;
        let sides = self.corners.iter().zip(self.corners.iter().cycle().skip(1));
        let mut turns = sides.map(|(a, b)| (b - a).cross(&(at - a)).dot(&self.normal));
        let first = turns.next()?;
        turns.all(|turn| turn * first >= 0.0).then_some(t)
    }
}

impl Body {
    fn new(plan: &ObjectPlan, depth: f64, seabed: &Seabed, rocks: &mut Stream, count: usize) -> Self {
        let [roll, pitch] = plan.tilt_deg.map(f64::to_radians);
        let about = |axis: Vector3<f64>, angle: f64| seafix_geometry::so3::exp(&(axis * angle));
        let turn: UnitQuaternion<f64> =
            about(Vector3::z(), plan.yaw_deg.to_radians()) * about(Vector3::y(), pitch) * about(Vector3::x(), roll);
        let origin = Vector3::new(plan.at[0], plan.at[1], depth);
        let world = |p: [f64; 3]| origin + turn * Vector3::new(p[0], p[1], -p[2]);
        let up = turn * -Vector3::z();

        let mut surfaces = Vec::new();
        let mut distractors = Vec::new();
        for body in &plan.boxes {
            box_surfaces(body, &world, &mut surfaces);
            distractors.extend(body.corners().map(|c| Corner { at: world(body.on_top(c)), normal: up }));
        }
        for panel in &plan.panels {
            let corners: Vec<_> = panel.outline.iter().map(|c| world(plan.boxes[panel.carrier].on_top(*c))).collect();
            distractors.extend(corners.iter().map(|&at| Corner { at, normal: up }));
            surfaces.push(Surface::new(corners, &up, panel.albedo, Finish::Paint));
        }
        for chequer in &plan.chequers {
            let (sine, cosine) = libm::sincos(chequer.yaw_deg.to_radians());
            let at = |i: u32, j: u32| {
                let (x, y) = (f64::from(i) * chequer.square, f64::from(j) * chequer.square);
                let [cx, cy] = chequer.corner;
                world(plan.boxes[chequer.carrier].on_top([cx + cosine * x - sine * y, cy + sine * x + cosine * y]))
            };
            for i in 0..chequer.cells[0] {
                for j in 0..chequer.cells[1] {
                    distractors.push(Corner { at: at(i, j), normal: up });
                    if (i + j) % 2 == 0 {
                        let corners = vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                        surfaces.push(Surface::new(corners, &up, chequer.albedo, Finish::Paint));
                    }
                }
            }
        }
        for pipe in &plan.pipes {
            pipe_surfaces(pipe, &world, &mut surfaces, &mut distractors);
        }
        for _ in 0..count {
            rock_surfaces(&origin, seabed, rocks, &mut surfaces, &mut distractors);
        }

        let points: Vec<_> = plan.points.iter().map(|p| Corner { at: world(plan.place(p)), normal: up }).collect();
        distractors.retain(|d| points.iter().all(|p| (p.at - d.at).norm() > 1e-6));
        let ball = Ball::around(origin, surfaces.iter().flat_map(|s| &s.corners));
        Self { surfaces, points, distractors, ball }
    }

    /// The mean of the feature points.
    pub(crate) fn centroid(&self) -> Vector3<f64> {
        self.points.iter().map(|p| p.at).sum::<Vector3<f64>>() / self.points.len() as f64
    }
}

/// The six faces of a box.
fn box_surfaces(body: &BoxPlan, world: &impl Fn([f64; 3]) -> Vector3<f64>, surfaces: &mut Vec<Surface>) {
    let top = body.corners().map(|c| body.on_top(c));
    let upper = top.map(world);
    let lower = top.map(|[x, y, _]| world([x, y, body.bottom]));
    let centre = (upper.iter().sum::<Vector3<f64>>() + lower.iter().sum::<Vector3<f64>>()) / 8.0;
    let mut add = |corners: Vec<Vector3<f64>>| {
        let outside = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64 - centre;
        surfaces.push(Surface::new(corners, &outside, body.albedo, Finish::Plate));
    };
    add(upper.to_vec());
    add(lower.to_vec());
    for k in 0..4 {
        let next = (k + 1) % 4;
        add(vec![upper[k], upper[next], lower[next], lower[k]]);
    }
}

/// The sides and caps of a pipe; four places on each rim are distractors.
fn pipe_surfaces(
    pipe: &PipePlan,
    world: &impl Fn([f64; 3]) -> Vector3<f64>,
    surfaces: &mut Vec<Surface>,
    distractors: &mut Vec<Corner>,
) {
    let (from, to) = (world(pipe.from), world(pipe.to));
    let axis = (to - from).normalize();
    let across = axis.cross(&if axis.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
    let along = axis.cross(&across);
    let rim: Vec<_> = (0..PIPE_SIDES)
        .map(|k| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * k as f64 / PIPE_SIDES as f64);
            (across * cosine + along * sine) * pipe.radius
        })
        .collect();
    for k in 0..PIPE_SIDES {
        let (a, b) = (rim[k], rim[(k + 1) % PIPE_SIDES]);
        surfaces.push(Surface::new(vec![from + a, to + a, to + b, from + b], &(a + b), pipe.albedo, Finish::Plate));
    }
    for (end, outside) in [(from, -axis), (to, axis)] {
        surfaces.push(Surface::new(rim.iter().map(|r| end + r).collect(), &outside, pipe.albedo, Finish::Plate));
        distractors.extend(rim.iter().step_by(4).map(|r| Corner { at: end + r, normal: *r + outside * pipe.radius }));
    }
}

/// One rock beside an object, half sunk into the seabed.
fn rock_surfaces(
    origin: &Vector3<f64>,
    seabed: &Seabed,
    rocks: &mut Stream,
    surfaces: &mut Vec<Surface>,
    distractors: &mut Vec<Corner>,
) {
    const SIDES: usize = 7;
    let away = rocks.between(2.0, 3.8);
    let (sine, cosine) = libm::sincos(rocks.between(0.0, std::f64::consts::TAU));
    let (north, east) = (origin.x + away * cosine, origin.y + away * sine);
    let foot = Vector3::new(north, east, seabed.down(north, east));
    let size = rocks.between(0.07, 0.22);
    let albedo = rocks.between(0.2, 0.4);
    let mut ring = |radius: f64, height: f64, turn: f64| -> Vec<Vector3<f64>> {
        (0..SIDES)
            .map(|k| {
                let (sine, cosine) = libm::sincos(std::f64::consts::TAU * (k as f64 + turn) / SIDES as f64);
                let r = size * radius * rocks.between(0.8, 1.2);
                foot + Vector3::new(r * cosine, r * sine, -size * height * rocks.between(0.85, 1.15))
            })
            .collect()
    };
    let (low, high) = (ring(1.0, -0.4, 0.0), ring(0.62, 0.5, 0.5));
    let top = high.iter().sum::<Vector3<f64>>() / SIDES as f64 - Vector3::new(0.0, 0.0, 0.18 * size);
    let mut add = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>| {
        let outside = (a + b + c) / 3.0 - foot;
        surfaces.push(Surface::new(vec![a, b, c], &outside, albedo, Finish::Rock));
    };
    for k in 0..SIDES {
        let next = (k + 1) % SIDES;
        add(low[k], low[next], high[k]);
        add(low[next], high[next], high[k]);
        add(high[k], high[next], top);
    }
    distractors.push(Corner { at: top, normal: -Vector3::z() });
}

impl VirtualScene {
    /// Builds the scene of a blueprint; relief, rocks and textures depend on the seed.
    pub(crate) fn new(blueprint: &Blueprint, seed: u64) -> Self {
        let seabed = Seabed::new(blueprint.depth, seed);
        let bodies = blueprint
            .objects
            .iter()
            .enumerate()
            .map(|(index, plan)| {
                let mut rocks = Stream::new(seed, 0, index as u64, Purpose::Rocks);
                Body::new(plan, blueprint.depth, &seabed, &mut rocks, blueprint.rocks)
            })
            .collect();
        let texture = Stream::new(seed, 0, 0, Purpose::Texture).bits() as u32;
        Self { bodies, seabed, texture }
    }

    /// The first t > 0 at which `from + t·along` meets a body or the seabed.
    pub(crate) fn hit(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let bodies = self.bodies.iter().filter(|b| b.ball.meets(from, along));
        let solid = bodies.flat_map(|b| &b.surfaces).filter_map(|s| s.hit(from, along));
        solid.chain(self.seabed.hit(from, along)).min_by(f64::total_cmp)
    }

    /// Whether `to` is visible from `from`, up to a millimetre before it.
    pub(crate) fn clear(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let along = to - from;
        let before = 1.0 - 1e-3 / along.norm();
        let solid = self.bodies.iter().filter(|b| b.ball.meets(from, &along)).flat_map(|b| &b.surfaces);
        let mut hits = solid.filter_map(|s| s.hit(from, &along)).chain(self.seabed.hit(from, &along));
        !hits.any(|t| t < before)
    }

    /// Whether a corner faces `from` and is not occluded.
    pub(crate) fn sees(&self, from: &Vector3<f64>, corner: &Corner) -> bool {
        corner.normal.dot(&(from - corner.at)) > 0.0 && self.clear(from, &corner.at)
    }

    /// The surface point that a ray meets.
    pub(crate) fn seen(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<Point<World>> {
        self.hit(from, along).map(|t| Point::from(from + along * t))
    }

    /// The smallest depth of anything within `reach` (m) of the vertical through a place.
    pub(crate) fn summit(&self, at: &Vector3<f64>, reach: f64) -> f64 {
        let near = self.bodies.iter().flat_map(|b| &b.surfaces).flat_map(|s| &s.corners);
        near.filter(|c| (c.xy() - at.xy()).norm() < reach)
            .map(|c| c.z)
            .fold(self.seabed.depth() - self.seabed.crest(), f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feature_points_are_seen_from_straight_above_and_hidden_from_below() {
        let scene = VirtualScene::new(&Blueprint::drill_centre(), 1);
        for body in &scene.bodies {
            for point in &body.points {
                assert!(scene.sees(&(point.at - Vector3::new(0.0, 0.0, 2.0)), point));
                assert!(!scene.sees(&(point.at + Vector3::new(0.0, 0.0, 2.0)), point));
            }
        }
    }

    #[test]
    fn a_ray_down_onto_a_box_stops_at_its_top() {
        let scene = VirtualScene::new(&Blueprint::drill_centre(), 1);
        let point = scene.bodies[2].points[0];
        let from = point.at + point.normal * 3.0;
        let t = scene.hit(&from, &-point.normal);
        assert!((t.unwrap() - 3.0).abs() < 1e-6);
    }
}
