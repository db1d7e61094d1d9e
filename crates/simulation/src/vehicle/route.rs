//! The planned route: waypoints and the standard survey patterns.

use nalgebra::{Vector2, Vector3};
use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

use super::inspection::{self, Looker};
use crate::scene::Scene;

/// Half length of the rounding of a corner (m).
pub(super) const ROUNDING: f64 = 0.8;
/// Number of samples of that rounding.
const SAMPLES: i32 = 16;

/// The kinds of route.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum RouteKind {
    /// A tour over all objects, back and forth until `length` is reached; the paper's 200 m path.
    #[default]
    Tour,
    /// Parallel lines over the complete site, `spacing` apart.
    Lawnmower,
    /// A circle of `radius` around `object`, with the heading towards it.
    Orbit,
    /// A descent to `object` over `length`, from twice the altitude.
    Approach,
    /// The polyline through `waypoints`.
    Waypoints,
    /// A stop at a view of each point of interest, from `stand-off`.
    Inspection,
}

/// The planned route.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Route {
    /// The kind of route.
    pub kind: RouteKind,
    /// Height of the cameras above the mean seabed (m), from 0.3 to 100. An inspection uses it between views that no
    /// straight line joins.
    pub altitude: f64,
    /// Speed over ground (m/s), from 0 to 5. The default lies in the paper's range of 0.2 to 0.5 m/s.
    pub speed: f64,
    /// Length of a tour or of an approach (m), from 0 to 100 000. The default is the paper's.
    pub length: f64,
    /// Distance between the lines of a lawnmower (m), from 0.2 to 100.
    pub spacing: f64,
    /// Radius of an orbit (m), from 0.2 to 100.
    pub radius: f64,
    /// The object of an orbit, approach or inspection. An empty name selects the site's own object, or all objects of
    /// an inspection.
    pub object: String,
    /// Distance from a point of interest to the left camera (m), from 0.2 to 100.
    pub stand_off: f64,
    /// Minimum distance of an inspection from bounding boxes and surfaces (m), from 0 to 100.
    pub clearance: f64,
    /// Duration of the stop at each view of an inspection (s), from 0 to 600.
    pub hold: f64,
    /// Vertices of a `waypoints` route: north, east, height above the mean seabed (m).
    pub waypoints: Vec<[f64; 3]>,
}

impl Default for Route {
    fn default() -> Self {
        Self {
            kind: RouteKind::Tour,
            altitude: 3.5,
            speed: 0.4,
            length: 200.0,
            spacing: 3.0,
            radius: 1.5,
            object: String::new(),
            stand_off: 1.5,
            clearance: 0.5,
            hold: 4.0,
            waypoints: Vec::new(),
        }
    }
}

impl Route {
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("route.{name}"), x, &format!("a number from {low} to {high}"))
        };
        within("altitude", self.altitude, 0.3, 100.0)?;
        within("speed", self.speed, 0.0, 5.0)?;
        within("length", self.length, 0.0, 1e5)?;
        within("spacing", self.spacing, 0.2, 100.0)?;
        within("radius", self.radius, 0.2, 100.0)?;
        within("stand-off", self.stand_off, 0.2, 100.0)?;
        within("clearance", self.clearance, 0.0, 100.0)?;
        within("hold", self.hold, 0.0, 600.0)?;
        for (k, point) in self.waypoints.iter().enumerate() {
            let fine = point.iter().all(|x| x.abs() < 1e5) && point[2] > 0.0;
            let name = format!("route.waypoints[{k}]");
            in_range(fine, &name, format!("{point:?}"), "north, east and a positive height above the seabed")?;
        }
        let count = self.waypoints.len();
        in_range(self.kind != RouteKind::Waypoints || count > 0, "route.waypoints", count, "one waypoint or more")
    }
}

/// A planned route: a polyline with headings, or with the direction of motion or a place to look at as the heading.
#[derive(Debug, Clone)]
pub(crate) struct PlannedRoute {
    pub(super) places: Vec<Vector3<f64>>,
    /// Path length up to each vertex; two equal vertices enclose a stop, as a length.
    pub(super) lengths: Vec<f64>,
    /// The unwrapped heading at each vertex; empty where the vertices do not state any.
    pub(super) headings: Vec<f64>,
    pub(super) look_at: Option<Vector2<f64>>,
    pub(super) speed: f64,
}

/// The desired position, velocity and heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Goal {
    pub(crate) at: Vector3<f64>,
    pub(crate) velocity: Vector3<f64>,
    pub(crate) heading: f64,
}

impl PlannedRoute {
    /// Plans the route over a scene with the cameras and lamps of `looker`.
    pub(crate) fn new(route: &Route, scene: &Scene, looker: &Looker<'_>) -> Result<Self, String> {
        let depth = scene.seabed.depth();
        let over = |p: Vector2<f64>, height: f64| Vector3::new(p.x, p.y, depth - height);
        let centres: Vec<Vector2<f64>> = scene.objects.iter().map(|o| o.centroid().xy()).collect();
        let named = scene.nominal.objects.iter().position(|o| o.id == route.object);
        if named.is_none() && !route.object.is_empty() {
            let names: Vec<&str> = scene.nominal.objects.iter().map(|o| o.id.as_str()).collect();
            return Err(format!("route.object = `{}`; give one of {}", route.object, names.join(", ")));
        }
        let (centre, altitude) = (centres[named.unwrap_or(scene.nominal.frame)], route.altitude);
        let mut look_at = None;
        let places = match route.kind {
            RouteKind::Inspection => return inspection::planned(route, named, scene, looker),
            RouteKind::Waypoints => route.waypoints.iter().map(|w| over(Vector2::new(w[0], w[1]), w[2])).collect(),
            RouteKind::Tour => tour(&centres, route.length).into_iter().map(|p| over(p, altitude)).collect(),
            RouteKind::Lawnmower => {
                let low = centres.iter().fold(centres[0], |a, b| a.inf(b)) - Vector2::repeat(2.0);
                let high = centres.iter().fold(centres[0], |a, b| a.sup(b)) + Vector2::repeat(2.0);
                let lines = ((high.y - low.y) / route.spacing).floor() as usize + 1;
                let ends = |k: usize| if k.is_multiple_of(2) { [low.x, high.x] } else { [high.x, low.x] };
                let line =
                    |k: usize| ends(k).map(|x| over(Vector2::new(x, low.y + route.spacing * k as f64), altitude));
                (0..lines).flat_map(line).collect()
            }
            RouteKind::Orbit => {
                look_at = Some(centre);
                let place = |k: i32| {
                    let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(k) / 48.0);
                    over(centre + Vector2::new(cosine, sine) * route.radius, altitude)
                };
                (0..=48).map(place).collect()
            }
            RouteKind::Approach => {
                look_at = Some(centre);
                let away = Vector2::new(0.8, 0.6) * route.length;
                vec![over(centre - away, 2.0 * altitude), over(centre - away * 0.3, altitude), over(centre, altitude)]
            }
        };
        Ok(Self::through(places, look_at, route.speed))
    }

    pub(super) fn through(places: Vec<Vector3<f64>>, look_at: Option<Vector2<f64>>, speed: f64) -> Self {
        let mut lengths = vec![0.0];
        for pair in places.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + (pair[1] - pair[0]).norm());
        }
        Self { places, lengths, headings: Vec::new(), look_at, speed }
    }

    /// The position at this path length.
    fn place(&self, s: f64) -> Vector3<f64> {
        let (k, t) = self.between(s);
        if t == 0.0 { self.places[k] } else { self.places[k] + (self.places[k + 1] - self.places[k]) * t }
    }

    /// The vertex before this path length, and the fraction of the segment to the next.
    fn between(&self, s: f64) -> (usize, f64) {
        let last = self.places.len() - 1;
        let k = self.lengths.partition_point(|l| *l <= s);
        if k == 0 || last == 0 {
            return (0, 0.0);
        }
        if k > last {
            return (last, 0.0);
        }
        let (a, b) = (self.lengths[k - 1], self.lengths[k]);
        (k - 1, (s - a) / (b - a))
    }

    /// The desired state at a time (s): the mean of the route around its position, which rounds the corners.
    pub(crate) fn at(&self, time: f64) -> Goal {
        let s = self.speed * time;
        let step = ROUNDING / f64::from(SAMPLES);
        let mean = |s: f64| {
            (-SAMPLES..=SAMPLES).map(|k| self.place(s + f64::from(k) * step)).sum::<Vector3<f64>>()
                / f64::from(2 * SAMPLES + 1)
        };
        let at = mean(s);
        const H: f64 = 0.05;
        let ahead = (mean(s + H) - mean(s - H)) / (2.0 * H);
        if !self.headings.is_empty() {
            let heading = |s: f64| {
                let (k, t) = self.between(s);
                if t == 0.0 {
                    self.headings[k]
                } else {
                    self.headings[k] + (self.headings[k + 1] - self.headings[k]) * t
                }
            };
            let sum: f64 = (-SAMPLES..=SAMPLES).map(|k| heading(s + f64::from(k) * step)).sum();
            return Goal { at, velocity: ahead * self.speed, heading: sum / f64::from(2 * SAMPLES + 1) };
        }
        // The direction of motion over a longer stretch, which is also defined at both ends.
        let far = self.place((s + 1.5).min(self.length())) - self.place((s - 1.5).max(0.0).min(self.length() - 1e-3));
        let towards = self.look_at.map_or(far.xy(), |p| p - at.xy());
        let heading = if towards.norm() > 1e-6 { libm::atan2(towards.y, towards.x) } else { 0.0 };
        Goal { at, velocity: ahead * self.speed, heading }
    }

    /// The vertices of the route.
    pub(crate) fn places(&self) -> &[Vector3<f64>] {
        &self.places
    }

    /// The path length (m), stops included.
    pub(crate) fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }
}

/// The places one after the other and back, up to a length.
fn tour(centres: &[Vector2<f64>], length: f64) -> Vec<Vector2<f64>> {
    let n = centres.len();
    if n == 1 {
        // A single object: crosses over it.
        let arm = |k: usize| centres[0] + [Vector2::x(), Vector2::y(), -Vector2::x(), -Vector2::y()][k % 4] * 0.8;
        return (0..4 + (length / 1.6) as usize).map(arm).collect();
    }
    let mut planned = vec![centres[0]];
    let mut sum = 0.0;
    for k in 1.. {
        let (turn, step) = (k / (n - 1), k % (n - 1));
        let index = if turn % 2 == 0 { step } else { n - 1 - step };
        let next = centres[index];
        sum += (next - planned[planned.len() - 1]).norm();
        planned.push(next);
        if sum >= length {
            break;
        }
    }
    planned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tour_goes_there_and_back_to_its_length() {
        let centres = [Vector2::new(0.0, 0.0), Vector2::new(10.0, 0.0), Vector2::new(10.0, 10.0)];
        let planned = tour(&centres, 50.0);
        assert_eq!(planned[..5], [centres[0], centres[1], centres[2], centres[1], centres[0]]);
        assert_eq!(planned.len(), 6);
    }

    #[test]
    fn corners_are_round_and_straights_straight() {
        let planned = PlannedRoute::through(
            vec![Vector3::zeros(), Vector3::x() * 10.0, Vector3::new(10.0, 10.0, 0.0)],
            None,
            0.5,
        );
        let goal = planned.at(10.0);
        assert!((goal.at - Vector3::x() * 5.0).norm() < 1e-12 && (goal.velocity - Vector3::x() * 0.5).norm() < 1e-9);
        assert!(goal.heading.abs() < 1e-12);
        let corner = planned.at(20.0);
        assert!((corner.heading - std::f64::consts::FRAC_PI_4).abs() < 1e-9 && corner.at.x < 10.0);
        let end = planned.at(1000.0);
        assert!((end.at - Vector3::new(10.0, 10.0, 0.0)).norm() < 1e-12 && end.velocity.norm() < 1e-12);
        assert!((end.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    }
}
