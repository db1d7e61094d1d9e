//! Family e: a lattice that its surroundings continue, told apart by four points off it.

use std::collections::HashSet;

use nalgebra::Vector3;
use seafix_geometry::Point;

use super::{
    Generated, GeneratedParameters, GeneratedProblem, GeneratedTruth, Part, Source,
    boxes::shuffled,
    clutter::anywhere,
    prior::{ahead, direction, prior_pose},
    problem::micrometres,
};
use crate::stream::Stream;

/// Sites of the lattice along x and y, and the distance of neighbours (m).
const SITES: [i32; 2] = [6, 5];
const PITCH: f64 = 0.25;
/// The points off the lattice, before their jitter (m).
const OFF: [[f64; 3]; 4] = [[0.11, 0.16, 0.18], [-0.52, 0.06, 0.09], [0.33, -0.41, 0.07], [-0.2, -0.35, 0.22]];
const OFF_JITTER: f64 = 0.02;
/// How likely a site of the lattice, and a point off it, is visible.
const VISIBLE: [f64; 2] = [0.7, 0.83];
/// Least number of visible points off the lattice.
const MIN_OFF: usize = 3;
/// How far the surroundings continue the lattice (sites), and how likely a site of theirs is.
const AROUND: i32 = 2;
const CONTINUED: f64 = 0.43;
/// By how many points the truth is ahead of the best wrong placement of the lattice.
const LEAD: usize = 2;
/// Points just beyond the tolerance of a visible one: how many, and how far off in multiples of Δ.
const NEAR: usize = 12;
const NEAR_BY: [f64; 2] = [1.5, 3.0];
/// Points anywhere, and how far the scene goes beyond the object (m).
const ANYWHERE: usize = 30;
const MARGIN: f64 = 0.3;
const SIGMA: f64 = 0.01;
const DISTANCE: f64 = 3.0;
const GATE: f64 = 0.4;
/// How far the rough pose is moved along each axis, in shells.
const SHIFT: f64 = 0.5;

fn site(i: i32, k: i32) -> Vector3<f64> {
    let from_middle = |i: i32, sites: i32| PITCH * (f64::from(i) - f64::from(sites - 1) / 2.0);
    Vector3::new(from_middle(i, SITES[0]), from_middle(k, SITES[1]), 0.0)
}

fn sites() -> impl Iterator<Item = (i32, i32)> {
    (0..SITES[0]).flat_map(|i| (0..SITES[1]).map(move |k| (i, k)))
}

/// What is seen of the lattice and of the points off it, and where the surroundings continue it.
struct Seen {
    model: Vec<usize>,
    continued: Vec<(i32, i32)>,
    best_wrong: usize,
}

impl Seen {
    /// Drawn until the truth leads, so that an exact method can know it.
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

/// The most occupied sites that a placement of the lattice other than the true one covers: shifted or
/// not, flipped (which covers the same sites), or turned by a quarter.
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
        // A column less at one side, a column more at the other: the shift covers all.
        let shifted: HashSet<(i32, i32)> = sites().map(|(i, k)| (i + 1, k)).collect();
        assert_eq!(best_wrong(&shifted), 30);
        // Where five columns of five are left, a quarter turn covers them too.
        assert_eq!(best_wrong(&sites().filter(|&(i, _)| i < 5).collect()), 25);
    }
}
