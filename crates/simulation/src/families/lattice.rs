//! Family e: a lattice that its surroundings continue, distinguished by four points off it.

use std::collections::HashSet;

use nalgebra::Vector3;
use seafix_geometry::Point;

use super::{
    boxes::shuffled,
    clutter::anywhere,
    family::{Part, Source},
    generated::Generated,
    prior::{ahead, direction, prior_pose},
    problem::{GeneratedProblem, micrometres},
    truth::{GeneratedParameters, GeneratedTruth},
};
use crate::stream::Stream;

/// Number of lattice sites along x and y.
const SITES: [i32; 2] = [6, 5];
/// Distance of neighbouring sites (m).
const PITCH: f64 = 0.25;
/// The points off the lattice before their jitter (m).
const OFF: [[f64; 3]; 4] = [[0.11, 0.16, 0.18], [-0.52, 0.06, 0.09], [0.33, -0.41, 0.07], [-0.2, -0.35, 0.22]];
/// Jitter of the points off the lattice (m).
const OFF_JITTER: f64 = 0.02;
/// Probability that a lattice site is visible, and that a point off the lattice is.
const VISIBLE: [f64; 2] = [0.7, 0.83];
/// Minimum number of visible points off the lattice.
const MIN_OFF: usize = 3;
/// Width of the continued lattice about the object (sites).
const AROUND: i32 = 2;
/// Probability that a continued site is occupied.
const CONTINUED: f64 = 0.43;
/// Minimum lead of the truth over the best wrong placement of the lattice (points).
const LEAD: usize = 2;
/// Number of near misses of visible points.
const NEAR: usize = 12;
/// Range of their distances from the visible points, as multiples of Δ.
const NEAR_BY: [f64; 2] = [1.5, 3.0];
/// Number of clutter points anywhere in the scene.
const ANYWHERE: usize = 30;
/// Margin of the scene about the object (m).
const MARGIN: f64 = 0.3;
/// Standard deviation of the noise (m).
const SIGMA: f64 = 0.01;
/// Distance of the object from the camera (m).
const DISTANCE: f64 = 3.0;
/// Half-size of the gate (m).
const GATE: f64 = 0.4;
/// Maximum displacement of the prior pose along each axis, as a multiple of the gate.
const SHIFT: f64 = 0.5;

fn site(i: i32, k: i32) -> Vector3<f64> {
    let from_middle = |i: i32, sites: i32| PITCH * (f64::from(i) - f64::from(sites - 1) / 2.0);
    Vector3::new(from_middle(i, SITES[0]), from_middle(k, SITES[1]), 0.0)
}

fn sites() -> impl Iterator<Item = (i32, i32)> {
    (0..SITES[0]).flat_map(|i| (0..SITES[1]).map(move |k| (i, k)))
}

/// The visible lattice sites and points off the lattice, and the continued sites.
struct Seen {
    model: Vec<usize>,
    continued: Vec<(i32, i32)>,
    best_wrong: usize,
}

impl Seen {
    /// Samples until the truth leads, so that an exact method can identify it.
    fn draw(stream: &mut Stream) -> Self {
        loop {
            let lattice: Vec<usize> = (0..sites().count()).filter(|_| stream.unit() < VISIBLE[0]).collect();
            let off: Vec<usize> = (0..OFF.len()).filter(|_| stream.unit() < VISIBLE[1]).collect();
            let around = (-AROUND..SITES[0] + AROUND).flat_map(|i| (-AROUND..SITES[1] + AROUND).map(move |k| (i, k)));
            let outside = |(i, k): &(i32, i32)| !((0..SITES[0]).contains(i) && (0..SITES[1]).contains(k));
            let continued: Vec<(i32, i32)> = around.filter(outside).filter(|_| stream.unit() < CONTINUED).collect();
            let occupied = sites().enumerate().filter(|(i, _)| lattice.contains(i)).map(|(_, site)| site);
            let best_wrong = best_wrong(&occupied.chain(continued.iter().copied()).collect());
            if off.len() >= MIN_OFF && lattice.len() + off.len() >= best_wrong + LEAD {
                let first = sites().count();
                let model = lattice.into_iter().chain(off.into_iter().map(|i| first + i)).collect();
                return Self { model, continued, best_wrong };
            }
        }
    }
}

/// The maximum number of occupied sites under a wrong placement of the lattice: shifted or not, flipped (which covers
/// the same sites) or turned by 90°.
fn best_wrong(occupied: &HashSet<(i32, i32)>) -> usize {
    let covered = |along: [i32; 2], by: (i32, i32)| {
        let all = (0..along[0]).flat_map(|i| (0..along[1]).map(move |k| (i + by.0, k + by.1)));
        all.filter(|site| occupied.contains(site)).count()
    };
    let shifts = || (-SITES[0]..=SITES[0]).flat_map(|i| (-SITES[0]..=SITES[0]).map(move |k| (i, k)));
    shifts().map(|by| covered(SITES, by).max(covered([SITES[1], SITES[0]], by))).max().unwrap_or(0)
}

pub(super) fn draw(source: &Source) -> Generated {
    let mut stream = source.stream(Part::Model);
    let mut model: Vec<Vector3<f64>> = sites().map(|(i, k)| site(i, k)).collect();
    model.extend(OFF.map(|at| Vector3::from(at) + stream.normal3(OFF_JITTER)));
    let pose = ahead(&mut source.stream(Part::Pose), DISTANCE);
    let place = |at: &Vector3<f64>| (pose * Point::from(*at)).coords;
    let placed: Vec<Vector3<f64>> = model.iter().map(place).collect();
    let mut seen = Seen::draw(&mut source.stream(Part::Visible));
    let mut near = seen.model.clone();
    if source.absent() {
        seen.model.clear();
    }
    let mut problem = GeneratedProblem::new(source, &model, SIGMA);

    let mut noise = source.stream(Part::Noise);
    let measured: Vec<Vector3<f64>> = seen.model.iter().map(|&i| placed[i] + noise.normal3(SIGMA)).collect();
    let mut stream = source.stream(Part::Clutter);
    let mut points = measured.clone();
    points.extend(seen.continued.iter().map(|&(i, k)| place(&site(i, k)) + noise.normal3(SIGMA)));
    let order = shuffled(near.len(), &mut stream);
    near = order.into_iter().take(NEAR).map(|k| near[k]).collect();
    points.extend(
        near.iter()
            .map(|&i| placed[i] + direction(&mut stream) * (problem.delta * stream.between(NEAR_BY[0], NEAR_BY[1]))),
    );
    points.extend((0..ANYWHERE).map(|_| anywhere(&mut stream, &placed, MARGIN)));

    let prior = source.number.is_multiple_of(2);
    if prior {
        let seen: Vec<_> = seen.model.iter().zip(&measured).map(|(&i, &at)| (model[i], at)).collect();
        problem.prior = Some(prior_pose(&mut source.stream(Part::Prior), &pose, &model, &seen, GATE, SHIFT).1);
    }
    let order = shuffled(points.len(), &mut source.stream(Part::Order));
    problem.cloud = order.iter().map(|&k| micrometres(&points[k])).collect();
    let pairs = order.iter().enumerate().filter_map(|(j, &k)| Some([*seen.model.get(k)?, j])).collect();
    let parameters = GeneratedParameters {
        n: Some(model.len()),
        m: Some(points.len()),
        visible: Some(seen.model.len()),
        best_wrong_symmetry: Some(seen.best_wrong),
        prior: Some(prior),
        absent: source.absent().then_some(true),
        ..GeneratedParameters::default()
    };
    let truth = GeneratedTruth::new(&problem, &pose, pairs, parameters);
    Generated { problem, truth }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_is_covered_by_its_flip_its_shift_and_its_quarter_turn() {
        let full: HashSet<(i32, i32)> = sites().collect();
        assert_eq!(best_wrong(&full), 30);
        // One column less on one side and one more on the other: the shift covers all sites.
        let shifted: HashSet<(i32, i32)> = sites().map(|(i, k)| (i + 1, k)).collect();
        assert_eq!(best_wrong(&shifted), 30);
        // A quarter turn also covers all sites of five columns of five.
        assert_eq!(best_wrong(&sites().filter(|&(i, _)| i < 5).collect()), 25);
    }
}
