//! The quadruples of one vertex with three others.

use super::{orientation::Sense, volumes::Volumes};
use crate::lanes::{LANES, ones_of, packed};

/// Tests whether a vertex and three members of a set have the other orientation than `sign`.
///
/// Two members span a plane with the vertex. If a third does not lie on the same side of it in model and cloud beyond
/// doubt, the exact test decides. The memory for the planes is reused.
#[derive(Debug, Default)]
pub(super) struct Quadruples {
    /// Coordinates of the members in model and cloud relative to the vertex, by axis.
    places: [Vec<f64>; 6],
    /// Normals of the planes in model and cloud by axis, in complete words: members i < k at k (k − 1)/2 + i.
    normals: [Vec<f64>; 6],
}

/// The number of pairs of n items.
fn pairs(n: usize) -> usize {
    n * n.saturating_sub(1) / 2
}

impl Quadruples {
    /// The number of quadruples of a vertex with three of the members.
    pub(super) fn count(members: usize) -> u64 {
        (pairs(members) * members.saturating_sub(2) / 3) as u64
    }

    pub(super) fn rejected(&mut self, volumes: &Volumes<'_>, sense: Sense, members: &[usize], vertex: usize) -> bool {
        let Some(sign) = sense.sign() else { return false };
        let origin = volumes.place(vertex);
        for (axis, column) in self.places.iter_mut().enumerate() {
            column.clear();
            column.extend(members.iter().map(|&v| volumes.place(v)[axis] - origin[axis]));
        }
        let full = pairs(members.len()).next_multiple_of(LANES);
        self.normals.iter_mut().for_each(|column| column.resize(full, 0.0));
        span(&self.places, &mut self.normals);
        (2..members.len()).any(|third| {
            self.unclear(third, sign, volumes.doubt()).any(|plane| {
                // The last k with k (k − 1)/2 ≤ plane.
                let second = (8 * plane + 1).isqrt().div_ceil(2);
                let first = plane - pairs(second);
                volumes.contradict(sense, [members[first], members[second], members[third], vertex])
            })
        })
    }

    /// The planes of earlier members for which the side of a member is in doubt or contradicts the sign.
    fn unclear(&self, member: usize, sign: f64, doubt: f64) -> impl Iterator<Item = usize> {
        let place = self.places.each_ref().map(|column| column[member]);
        (0..pairs(member)).step_by(LANES).flat_map(move |begin| {
            let normals = self.normals.each_ref().map(|column| &column[begin..]);
            let asked = !0 >> (LANES - (pairs(member) - begin).min(LANES));
            ones_of(begin, asked & !clear(&normals, &place, sign, doubt))
        })
    }
}

/// The normals of the planes through the origin and any two of some places.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn span(places: &[Vec<f64>; 6], normals: &mut [Vec<f64>; 6]) {
    let count = places[0].len();
    for side in [0, 3] {
        let [x, y, z] = [0, 1, 2].map(|axis| &places[side + axis][..count]);
        let [u, v, w] = &mut normals[side..side + 3] else { unreachable!("three axes a side") };
        for second in 1..count {
            let (from, to) = (pairs(second), pairs(second + 1));
            let (u, v, w) = (&mut u[from..to], &mut v[from..to], &mut w[from..to]);
            let (a, b, c) = (x[second], y[second], z[second]);
            for first in 0..second {
                u[first] = b * z[first] - c * y[first];
                v[first] = c * x[first] - a * z[first];
                w[first] = a * y[first] - b * x[first];
            }
        }
    }
}

/// The mask of the planes for which a place clearly has the orientation `sign`.
///
/// It is on the same side (1) in model and cloud, or on opposite sides (-1).
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn clear(normals: &[&[f64]; 6], place: &[f64; 6], sign: f64, doubt: f64) -> u64 {
    let [a, b, c, u, v, w] = normals.map(|column| column.first_chunk::<LANES>().expect("complete words"));
    let mut clear = [0u8; LANES];
    for k in 0..LANES {
        let known = a[k] * place[0] + b[k] * place[1] + c[k] * place[2];
        let measured = u[k] * place[3] + v[k] * place[4] + w[k] * place[5];
        clear[k] = u8::from(sign * (known * measured) > doubt);
    }
    packed(&clear)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    use super::*;
    use crate::{
        candidates::Candidates,
        problem::{Correspondence, Problem, Tolerance},
        site::model::ModelPoint,
    };

    #[test]
    fn quadruples_are_counted() {
        assert_eq!([0, 1, 2, 3, 4, 39].map(Quadruples::count), [0, 0, 0, 1, 4, 9139]);
    }

    /// The test agrees with a test of each quadruple.
    ///
    /// The sets have up to forty members, some with a point on the wrong side. Fails if triples without the third
    /// member alone are tested, if a plane is taken for that of other members, and with a wrong sign in a normal.
    #[test]
    fn what_is_rejected_makes_a_four_that_contradicts() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut quadruples, mut rejected) = (Quadruples::default(), 0);
        for n in (1..40).chain([2, 5, 39, 3]) {
            let mut place = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let model: Vec<ModelPoint> = (0..=n).map(|_| ModelPoint::exact("", place().into())).collect();
            let moved = if n % 2 == 0 { 0.002 } else { 0.1 };
            let cloud: Vec<MeasuredPoint> = model
                .iter()
                .map(|point| Point::from(point.at.coords + place() * moved))
                .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at, 0.002), pixels: None })
                .collect();
            let candidates = Candidates::from_pairs(n + 1, (0..=n).map(|i| (i, i)));
            let tolerance = Tolerance::Fixed(1.0);
            let problem = Problem {
                model: &model,
                cloud: &cloud,
                candidates: &candidates,
                tolerance,
                prior: None,
                edges: Default::default(),
            };
            let vertices: Vec<Correspondence> = (0..=n).map(|i| Correspondence { model: i, cloud: i }).collect();
            let volumes = Volumes::of(&problem, &vertices);
            let members: Vec<usize> = (1..=n).rev().collect();
            for sense in [Sense::Any, Sense::Proper, Sense::Mirrored] {
                let by_itself = (0..n).any(|i| {
                    (0..i).any(|k| (0..k).any(|l| volumes.contradict(sense, [members[i], members[k], members[l], 0])))
                });
                assert_eq!(quadruples.rejected(&volumes, sense, &members, 0), by_itself, "{n} members, {sense:?}");
                rejected += usize::from(by_itself);
            }
        }
        assert!((45..80).contains(&rejected), "{rejected}");
    }
}
