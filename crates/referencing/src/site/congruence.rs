//! Partial self-congruences: motions that map a large part of a model onto itself.

use nalgebra::Vector3;
use seafix_geometry::{Object, Point, Transform, UncertainPoint};

use super::{model::ModelPoint, target::diameter};
use crate::{
    observations::{Observation, Observations},
    solve::{kabsch::Kabsch, solver::Solver},
};

/// The minimum fraction and the minimum number of points that a motion must map.
const MIN_FRACTION: f64 = 0.6;
const MIN_POINTS: usize = 4;
/// The distance (m, RMS over the points), also as a fraction of the diameter, below which poses are one answer.
///
/// Half of it is the tolerance of a mapped point.
const ALERT_LIMIT: f64 = 0.10;
const ALERT_FRACTION: f64 = 0.05;
/// The minimum shape ratio of a triangle that determines a motion: the smaller of second side and height over the
/// longest side.
///
/// For a slender model it is half of the best ratio of its triangles.
const MIN_RATIO: f64 = 0.2;
/// The maximum number of point comparisons. Models too large for all triangles are sampled evenly within it.
const MAX_WORK: usize = 300_000_000;
/// The maximum number of listed motions.
const MAX_MOTIONS: usize = 200;
/// The number of points in the first test of a motion of a larger model, and the minimum number mapped.
const TRIED: usize = 16;
const TRIED_MAPPED: usize = 5;

/// A partial self-congruence: a motion other than the identity that maps many model points onto model points.
///
/// If no other points are identified, the pose followed by this motion explains the data equally well.
#[derive(Debug, Clone, PartialEq)]
pub struct Congruence {
    /// The motion of the model: p ↦ `motion` · p.
    pub motion: Transform<Object, Object>,
    /// The mapped points and their images: indices, ascending.
    pub pairs: Vec<(usize, usize)>,
    /// The points that the motion maps onto no point; one of them, if identified, excludes the motion.
    pub broken_by: Vec<usize>,
}

/// All self-congruences, in order of falling number of mapped points.
///
/// Alignment (Huttenlocher and Ullman, *Recognizing solid objects by alignment with an image*, 1990): each triangle of
/// points and each congruent triangle of the model, within the tolerance, give a motion, which is then fitted to all
/// points that it maps. The list is complete for up to about fifty points. Larger models are sampled: triangles are
/// taken evenly within the work limit. A motion maps a triangle completely with a probability of at least a fifth, so
/// it is missed after ten triangles with a probability of one tenth, after forty with 10⁻⁴.
pub(crate) fn congruences(points: &[ModelPoint]) -> Vec<Congruence> {
    let n = points.len();
    if n < MIN_POINTS {
        return Vec::new();
    }
    let alert = ALERT_LIMIT.min(ALERT_FRACTION * diameter(points));
    let search = Finder { at: points.iter().map(|p| p.at).collect(), tolerance: alert / 2.0, alert, min: min(n) };
    let mut found = search.all();
    found.sort_by(|a, b| b.pairs.len().cmp(&a.pairs.len()).then_with(|| a.pairs.cmp(&b.pairs)));
    found
}

fn min(n: usize) -> usize {
    ((MIN_FRACTION * n as f64).ceil() as usize).max(MIN_POINTS)
}

struct Finder {
    at: Vec<Point<Object>>,
    tolerance: f64,
    alert: f64,
    min: usize,
}

impl Finder {
    fn all(&self) -> Vec<Congruence> {
        let n = self.at.len();
        let distance: Vec<Vec<f64>> = self.at.iter().map(|a| self.at.iter().map(|b| a.distance(b)).collect()).collect();
        let mut found: Vec<Congruence> = Vec::new();
        // Large models use distant triangles: the stride is odd, so it is no multiple of a row.
        let triangles = n * (n - 1) * (n - 2) / 6;
        let stride = (triangles.saturating_mul(n * n) / (MAX_WORK / 4)).max(1) | 1;
        let own = |[a, b, c]: [usize; 3]| ratio([distance[a][b], distance[b][c], distance[a][c]]);
        let some = || triples(n).enumerate().filter(|(number, _)| (number + 1) % stride == 0).map(|(_, three)| three);
        let min = some().map(own).fold(0.0, f64::max).min(2.0 * MIN_RATIO) / 2.0;
        let mut work = 0;
        for three in some().filter(|three| own(*three) >= min && min > 0.0) {
            self.images(three, &distance, &mut found, &mut work);
            if found.len() >= MAX_MOTIONS || work >= MAX_WORK {
                break;
            }
        }
        found
    }

    /// Adds the motions that map this triangle onto another.
    fn images(&self, [a, b, c]: [usize; 3], distance: &[Vec<f64>], found: &mut Vec<Congruence>, work: &mut usize) {
        let alike = |x: f64, y: f64| (x - y).abs() <= 2.0 * self.tolerance;
        let n = self.at.len();
        for i in 0..n {
            let at = |side: f64| (0..n).filter(move |&j| j != i && alike(distance[i][j], side));
            let third: Vec<usize> = at(distance[a][c]).collect();
            *work += 2 * n;
            for j in at(distance[a][b]) {
                *work += third.len();
                for &k in third.iter().filter(|&&k| k != j && alike(distance[j][k], distance[b][c])) {
                    let pairs = [(a, i), (b, j), (c, k)];
                    *work += 4 * found.len();
                    if [a, b, c] != [i, j, k] && !known(found, &pairs) {
                        self.add(&pairs, found, work);
                    }
                    if *work >= MAX_WORK || found.len() >= MAX_MOTIONS {
                        return;
                    }
                }
            }
        }
    }

    /// Adds the motion of these three pairs if it is new and maps enough points.
    fn add(&self, pairs: &[(usize, usize); 3], found: &mut Vec<Congruence>, work: &mut usize) {
        let n = self.at.len();
        let Some(mut motion) = self.fit(pairs) else { return };
        if n > 4 * TRIED {
            *work += TRIED * n;
            if !self.promises(&motion) {
                return;
            }
        }
        // Average cost: a failing motion fails after fewer than half of the points.
        *work += n * n / 2;
        // Three points fit worse than all: the first pass doubles the tolerance.
        let mut mapped = self.map(&motion, 2.0 * self.tolerance);
        for _ in 0..2 {
            if mapped.len() < self.min {
                return;
            }
            *work += n * n;
            let Some(better) = self.fit(&mapped) else { return };
            motion = better;
            mapped = self.map(&motion, self.tolerance);
        }
        if mapped.len() < self.min || self.apart(&motion, &Transform::identity()) <= self.alert {
            return;
        }
        let same = found.iter().position(|known| self.apart(&known.motion, &motion) <= self.alert);
        let broken_by = (0..self.at.len()).filter(|i| mapped.iter().all(|(from, _)| from != i)).collect();
        let congruence = Congruence { motion, pairs: mapped, broken_by };
        match same {
            Some(at) if congruence.pairs.len() > found[at].pairs.len() => found[at] = congruence,
            Some(_) => {}
            None => found.push(congruence),
        }
    }

    /// Whether the motion maps enough of a few points, taken evenly.
    fn promises(&self, motion: &Transform<Object, Object>) -> bool {
        let limit = 4.0 * self.tolerance * self.tolerance;
        let tried = (0..TRIED).map(|k| *motion * self.at[k * self.at.len() / TRIED]);
        let mapped = |image: &Point<Object>| self.at.iter().any(|p| (p.coords - image.coords).norm_squared() <= limit);
        tried.filter(mapped).count() >= TRIED_MAPPED
    }

    /// The points whose image lies within `tolerance` of a point, one to one, the nearest first.
    fn map(&self, motion: &Transform<Object, Object>, tolerance: f64) -> Vec<(usize, usize)> {
        let n = self.at.len();
        let mut onto: Vec<Option<(usize, f64)>> = vec![None; n];
        let mut missed = 0;
        for (i, at) in self.at.iter().enumerate() {
            let image = *motion * *at;
            let nearest = self.at.iter().map(|p| (p.coords - image.coords).norm_squared()).enumerate();
            let Some((j, square)) = nearest.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if square > tolerance * tolerance {
                missed += 1;
                if n - missed < self.min {
                    return Vec::new();
                }
            } else if onto[j].is_none_or(|(_, other)| square < other) {
                onto[j] = Some((i, square));
            }
        }
        let mut pairs: Vec<(usize, usize)> =
            onto.iter().enumerate().filter_map(|(j, from)| from.map(|(i, _)| (i, j))).collect();
        pairs.sort_unstable();
        pairs
    }

    /// The least-squares motion that maps the first point of each pair onto the second.
    fn fit(&self, pairs: &[(usize, usize)]) -> Option<Transform<Object, Object>> {
        let observation = |&(from, onto): &(usize, usize)| Observation {
            measured: UncertainPoint::isotropic(Point::from(self.at[from].coords), self.tolerance),
            pixels: None,
            model: self.at[onto],
            model_sigma: 0.0,
        };
        let data = Observations { points: pairs.iter().map(observation).collect(), edges: Vec::new(), rig: None };
        Kabsch::default().solve(&data).ok().map(|motion| motion.relabel())
    }

    /// The distance of the points under two motions (m, RMS).
    fn apart(&self, a: &Transform<Object, Object>, b: &Transform<Object, Object>) -> f64 {
        let sum: f64 = self.at.iter().map(|p| ((*a * *p).coords - (*b * *p).coords).norm_squared()).sum();
        (sum / self.at.len() as f64).sqrt()
    }
}

/// Whether a known motion maps these pairs.
fn known(found: &[Congruence], pairs: &[(usize, usize); 3]) -> bool {
    found.iter().any(|congruence| pairs.iter().all(|pair| congruence.pairs.binary_search(pair).is_ok()))
}

/// All triples of n indices, ascending.
fn triples(n: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..n).flat_map(move |a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c])))
}

/// The shape ratio of a triangle with these sides: the smaller of second side and height over the longest side; zero
/// for a point.
///
/// It measures the distance from a line and between the corners.
fn ratio(mut sides: [f64; 3]) -> f64 {
    sides.sort_by(f64::total_cmp);
    let [a, b, c] = sides;
    // Heron: 16 area² = (a + b + c)(−a + b + c)(a − b + c)(a + b − c); the height over c is 2 area/c.
    let square = (a + b + c) * (b + c - a) * (a + c - b) * (a + b - c);
    let height = 0.5 * square.max(0.0).sqrt() / c;
    if c > 0.0 { b.min(height) / c } else { 0.0 }
}

impl Congruence {
    /// The largest distance (m) between a mapped point and its image point.
    pub(crate) fn farthest_off(&self, points: &[ModelPoint]) -> f64 {
        let off = |&(from, onto): &(usize, usize)| (self.motion * points[from].at).distance(&points[onto].at);
        self.pairs.iter().map(off).fold(0.0, f64::max)
    }

    /// The motion in words: rotation and translation of the points, and the number of mapped points.
    pub fn describe(&self, points: &[ModelPoint]) -> String {
        let degrees = self.motion.rotation().angle().to_degrees();
        let centre = points.iter().map(|p| p.at.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let shift = ((self.motion * Point::from(centre)).coords - centre).norm();
        let what = match (degrees > 1.0, shift > 1e-3) {
            (true, false) => format!("a rotation by {degrees:.0}°"),
            (false, _) => format!("a translation by {shift:.2} m"),
            (true, true) => format!("a rotation by {degrees:.0}° with a translation by {shift:.2} m"),
        };
        format!("{what} maps {} of {} points onto others", self.pairs.len(), points.len())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    fn model(at: impl IntoIterator<Item = [f64; 3]>) -> Vec<ModelPoint> {
        at.into_iter().enumerate().map(|(i, at)| ModelPoint::exact(i.to_string(), Point::from(at))).collect()
    }

    fn corners(size: [f64; 3]) -> Vec<ModelPoint> {
        model((0..8).map(|c| [0, 1, 2].map(|k| if c >> k & 1 == 1 { size[k] } else { 0.0 })))
    }

    fn lattice() -> Vec<ModelPoint> {
        let sites = (0..6).flat_map(|i| (0..5).map(move |k| [0.25 * f64::from(i), 0.25 * f64::from(k), 0.0]));
        model(sites.chain([[0.735, 0.66, 0.18], [0.105, 0.56, 0.09], [0.955, 0.09, 0.07], [0.425, 0.15, 0.22]]))
    }

    fn sizes(points: &[ModelPoint]) -> Vec<usize> {
        congruences(points).iter().map(|congruence| congruence.pairs.len()).collect()
    }

    #[test]
    fn a_cube_has_23_rotations_and_a_cuboid_three() {
        assert_eq!(sizes(&corners([1.0, 1.0, 1.0])), [8; 23]);
        assert_eq!(sizes(&corners([1.0, 1.5, 2.2])), [8; 3]);
        let all = congruences(&corners([1.0, 1.5, 2.2]));
        assert!(all.iter().all(|congruence| congruence.broken_by.is_empty()));
        assert_eq!(all[0].describe(&corners([1.0, 1.5, 2.2])), "a rotation by 180° maps 8 of 8 points onto others");
    }

    #[test]
    fn a_corner_off_its_place_breaks_the_cuboid() {
        let mut points = corners([1.0, 1.5, 2.2]);
        points.push(ModelPoint::exact("mark", Point::new(0.3, 0.4, 2.2)));
        let found = congruences(&points);
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|congruence| congruence.pairs.len() == 8 && congruence.broken_by == [8]));
    }

    #[test]
    fn a_lattice_is_flipped_shifted_and_turned_by_a_quarter() {
        // Flips: 30 points. Translations by a column and quarter turns about four points: 25, each flipped or not (8 +
        // 16). Translations by a row: 24 (8). Others map 20, and by coincidence one point off the lattice.
        let found = sizes(&lattice());
        let of = |size: usize| found.iter().filter(|&&found| found == size).count();
        assert_eq!((of(30), of(25), of(24)), (3, 24, 8), "{found:?}");
        assert!(found[35..].iter().all(|&size| size == 21), "{found:?}");
    }

    /// Fails if every triangle must be a fifth as high as it is long.
    #[test]
    fn a_zigzag_is_turned_and_shifted() {
        let zigzag = model((0..8).map(|i| [0.3 * f64::from(i), 0.1 * f64::from(i % 2), 0.0]));
        let found = sizes(&zigzag);
        assert!(found.contains(&8) && found.contains(&6), "{found:?}");
    }

    #[test]
    fn an_asymmetric_object_has_none() {
        let places =
            [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.5, 0.0, 1.5], [1.0, 2.2, 0.3], [-1.6, 0.4, 1.0]];
        assert_eq!(congruences(&model(places)), []);
        assert_eq!(congruences(&model(places[..3].iter().copied())), []);
    }

    #[test]
    fn moving_the_model_changes_nothing() {
        let motion = Transform::<Object, Object>::new(
            UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7)),
            Vector3::new(3.0, -8.0, 0.5),
        );
        for points in [corners([1.0, 1.5, 1.5]), lattice()] {
            let moved: Vec<ModelPoint> =
                points.iter().map(|point| ModelPoint { at: motion * point.at, ..point.clone() }).collect();
            let (here, there) = (congruences(&points), congruences(&moved));
            let pairs = |all: &[Congruence]| all.iter().map(|found| found.pairs.clone()).collect::<Vec<_>>();
            assert_eq!(pairs(&here), pairs(&there));
            for (a, b) in here.iter().zip(&there) {
                let carried = motion * a.motion * motion.inverse();
                assert!(carried.error_to(&b.motion).amax() < 1e-6);
            }
        }
    }

    #[test]
    fn five_hundred_points_are_bounded() {
        let grid = (0..500).map(|i| [0.3 * f64::from(i % 25), 0.3 * f64::from(i / 25), 0.05 * f64::from((i * i) % 7)]);
        assert!(congruences(&model(grid)).len() <= MAX_MOTIONS);
    }
}
