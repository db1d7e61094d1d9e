//! The parts of a cloud, separated by gaps longer than the object.

use std::cmp::Ordering;

use nalgebra::Vector3;

use crate::{
    problem::{Correspondence, Problem},
    search::limits::NEEDED,
    site::target::diameter,
};

/// Groups of candidates that no set of the object can span, each with its clutter density.
///
/// Single-linkage clustering (Sneath, *The application of computers to taxonomy*, 1957). Two points of the object are
/// no farther apart than its length plus the tolerance, so that at most one of two points in different clusters is the
/// object's. A wrong match of distant ground, measured anywhere up to the horizon, becomes a part of its own, and so
/// does a seabed farther from the object than the object's length.
///
/// Each part is assumed to be filled evenly, up to half of the object's length beyond its outermost points but not
/// beyond the cloud. A single box about all points would dilute the clutter density with the distance of the farthest
/// point.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    /// The part of each cloud point; `None` for a point that is no candidate.
    part_of: Vec<Option<usize>>,
    parts: Vec<Part>,
    full: Part,
    /// Length of the object (m).
    object: f64,
    /// Maximum tolerance of a candidate (m), the minimum side of a box.
    min: f64,
}

/// Points and their bounding box.
#[derive(Debug, Clone, Copy)]
struct Part {
    count: usize,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Part {
    fn empty() -> Self {
        Self { count: 0, low: Vector3::repeat(f64::INFINITY), high: Vector3::repeat(f64::NEG_INFINITY) }
    }

    fn add(&mut self, at: &Vector3<f64>) {
        (self.low, self.high) = (self.low.inf(at), self.high.sup(at));
        self.count += 1;
    }

    fn lengths(&self) -> Vector3<f64> {
        if self.count == 0 { Vector3::zeros() } else { self.high - self.low }
    }

    /// Ascending number of points; equal numbers by descending position along the axes.
    fn order(&self, other: &Self) -> Ordering {
        let axes = self.low.iter().zip(&other.low).map(|(own, others)| others.total_cmp(own));
        axes.fold(self.count.cmp(&other.count), Ordering::then)
    }
}

/// A candidate: index, position, and its part of the tolerance of a distance (m).
type Candidate = (usize, Vector3<f64>, f64);

impl Parts {
    /// The parts of the candidates of a problem.
    pub(crate) fn of(problem: &Problem<'_>) -> Self {
        let lists = problem.candidates.lists.iter().enumerate();
        let pairs = lists.flat_map(|(model, list)| list.iter().map(move |&cloud| Correspondence { model, cloud }));
        let mut reaches: Vec<Option<f64>> = vec![None; problem.cloud.len()];
        let mut min = f64::MIN_POSITIVE;
        for pair in pairs {
            let reach = problem.fraction_of_delta(pair);
            min = min.max(reach);
            reaches[pair.cloud] = Some(reaches[pair.cloud].map_or(reach, |known| known.max(reach)));
        }
        let at = |number: usize| problem.cloud[number].position.at.coords;
        let candidates = reaches.iter().enumerate().filter_map(|(number, reach)| Some((number, at(number), (*reach)?)));
        let finite = candidates.filter(|(_, at, _)| at.iter().all(|x| x.is_finite()));
        Self::joined(finite.collect(), problem.cloud.len(), diameter(problem.model), min)
    }

    /// The clusters of points joined by steps of at most the object's length.
    fn joined(mut left: Vec<Candidate>, count: usize, object: f64, min: f64) -> Self {
        let mut full = Part::empty();
        left.iter().for_each(|(_, at, _)| full.add(at));
        let (mut part_of, mut parts) = (vec![None; count], Vec::new());
        let mut joined: Vec<Candidate> = Vec::new();
        while let Some(first) = left.pop() {
            let mut part = Part::empty();
            joined.push(first);
            while let Some((number, at, reach)) = joined.pop() {
                part_of[number] = Some(parts.len());
                part.add(&at);
                let known = joined.len();
                left.retain(|other| {
                    let apart = (other.1 - at).norm() > object + reach + other.2;
                    if !apart {
                        joined.push(*other);
                    }
                    apart
                });
                // The farthest neighbour is next: it reaches most of the remaining points.
                let off = |i: &usize| (joined[*i].1 - at).norm_squared();
                if let Some(farthest) = (known..joined.len()).max_by(|i, k| off(i).total_cmp(&off(k))) {
                    let last = joined.len() - 1;
                    joined.swap(farthest, last);
                }
            }
            parts.push(part);
        }
        Self { part_of, parts, full, object, min }
    }

    fn part(&self, point: usize) -> Option<&Part> {
        self.part_of[point].map(|part| &self.parts[part])
    }

    /// The sides (m) of the box that a part fills.
    fn lengths(&self, part: &Part) -> Vector3<f64> {
        part.lengths().add_scalar(self.object).inf(&self.full.lengths())
    }

    /// ln of the volume (m³) of a box.
    fn ln_of(&self, lengths: &Vector3<f64>) -> f64 {
        lengths.iter().map(|side| libm::log(side.max(self.min))).sum()
    }

    /// The excess density of a point's part over the complete cloud (nats), at least zero.
    pub(crate) fn ln_excess(&self, point: usize) -> f64 {
        let density = |count: usize, lengths: &Vector3<f64>| libm::log(count as f64) - self.ln_of(lengths);
        let even = density(self.full.count, &self.full.lengths());
        self.part(point).map_or(0.0, |part| (density(part.count, &self.lengths(part)) - even).max(0.0))
    }

    /// The sides (m) of a box that all points would fill with the density of one point's part.
    ///
    /// The box has the proportions of the part; it is the box of the cloud if the cloud is denser.
    pub(crate) fn as_dense(&self, point: usize) -> Vector3<f64> {
        let full = self.full.lengths();
        let Some(part) = self.part(point).filter(|_| self.ln_excess(point) > 0.0) else { return full };
        self.lengths(part) * libm::cbrt(self.full.count as f64 / part.count as f64)
    }

    /// ln of the volume (m³) of the box about all points.
    pub(crate) fn ln_full(&self) -> f64 {
        self.ln_of(&self.full.lengths())
    }

    /// ln of the volume (m³) of all parts that can hold a pose, limited to the box about all points.
    pub(crate) fn ln_volume(&self) -> f64 {
        let full = self.ln_full();
        let hold = self.parts.iter().filter(|part| part.count >= NEEDED);
        let mut fractions: Vec<f64> = hold.map(|part| libm::exp(self.ln_of(&self.lengths(part)) - full)).collect();
        // Sorted: the sum does not depend on the order of the points.
        fractions.sort_unstable_by(f64::total_cmp);
        full + libm::log(fractions.iter().sum::<f64>().clamp(f64::MIN_POSITIVE, 1.0))
    }

    /// A point of the part with the most points.
    pub(crate) fn in_largest(&self) -> Option<usize> {
        let largest = (0..self.parts.len()).max_by(|&i, &k| self.parts[i].order(&self.parts[k]))?;
        self.part_of.iter().position(|part| *part == Some(largest))
    }

    /// Whether two points are in one part.
    pub(crate) fn together(&self, one: usize, other: usize) -> bool {
        self.part_of[one].is_some() && self.part_of[one] == self.part_of[other]
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Parts for an object of 1 m and tolerances of 1 cm.
    fn parts(points: &[Vector3<f64>]) -> Parts {
        let finite = points.iter().enumerate().filter(|(_, at)| at.iter().all(|x| x.is_finite()));
        Parts::joined(finite.map(|(number, at)| (number, *at, 0.01)).collect(), points.len(), 1.0, 0.02)
    }

    fn sampled(count: usize, seed: u64) -> Vec<Vector3<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| Vector3::from_fn(|axis, _| rng.random_range(-1.0..1.0) * [1.5, 1.0, 0.5][axis])).collect()
    }

    #[test]
    fn a_cloud_without_gaps_is_its_box() {
        for seed in 0..100 {
            let points = sampled(60, seed);
            let parts = parts(&points);
            let (low, high) = points.iter().fold((points[0], points[0]), |(low, high), at| (low.inf(at), high.sup(at)));
            assert_eq!(parts.as_dense(7), high - low);
            assert_eq!((parts.ln_excess(7), parts.ln_volume()), (0.0, parts.ln_full()));
            assert!((parts.ln_full() - (high - low).iter().product::<f64>().ln()).abs() < 1e-12);
            assert!(parts.in_largest().is_some_and(|middle| (0..60).all(|point| parts.together(point, middle))));
        }
    }

    /// Fails with one box about all points.
    #[test]
    fn what_no_step_reaches_is_another_part() {
        // 1.02 m are a step, 1.03 m are none.
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        let chain = parts(&[at(2.04), at(0.0), at(5.0), at(1.02), at(3.07), at(f64::NAN)]);
        let together: Vec<bool> = (0..6).map(|point| chain.together(point, 0)).collect();
        assert_eq!(together, [true, true, false, true, false, false]);
        assert_eq!(chain.in_largest(), Some(0));
        for seed in 0..100 {
            let mut points = sampled(40, seed);
            let alone = parts(&points);
            points.extend((1..=4).map(|k| Vector3::new(-2.0, 3.0, 1.0) * 10f64.powi(20 * k)));
            let found = parts(&points);
            // As dense as before, up to the margin of half a metre; the far points are no denser than the cloud.
            let times = found.as_dense(7).component_div(&(alone.as_dense(7) * libm::cbrt(44.0 / 40.0)));
            assert!(times.iter().all(|times| (1.0..3.0).contains(times)), "seed {seed}: {times:?}");
            let volume = found.ln_volume() - alone.ln_volume();
            assert!((0.0..3.0).contains(&volume), "seed {seed}: e^{volume} of the volume");
            assert!((0..40).all(|point| found.together(point, 7)) && !found.together(41, 42));
            assert!(found.ln_excess(7) > 100.0, "the farthest point dilutes the density of the cloud");
        }
    }

    #[test]
    fn the_order_of_the_points_is_none_of_the_parts() {
        let mut points = sampled(30, 3);
        points.extend(sampled(9, 4).into_iter().map(|at| at + Vector3::new(7.0, 0.0, 0.0)));
        points.push(Vector3::repeat(1e4));
        let forth = parts(&points);
        points.reverse();
        let back = parts(&points);
        assert_eq!((forth.ln_volume(), forth.ln_full()), (back.ln_volume(), back.ln_full()));
        for point in 0..40 {
            assert_eq!(forth.ln_excess(point), back.ln_excess(39 - point));
            assert_eq!(forth.as_dense(point), back.as_dense(39 - point));
        }
    }

    #[test]
    fn none_and_the_farthest_points_are_parts_too() {
        assert_eq!((parts(&[]).in_largest(), parts(&[]).ln_volume().is_nan()), (None, false));
        let far = parts(&[-1.7e308, 0.0, 1.7e308].map(Vector3::repeat));
        assert!(far.ln_excess(1) >= 0.0 && !far.together(0, 1));
        assert!(!far.ln_volume().is_nan() && far.as_dense(1).iter().all(|x| !x.is_nan()));
    }
}
