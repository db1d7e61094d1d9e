//! Triad: the paper's pose from three identified points.

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::{Observation, Observations},
    solve::{
        covariance::{numerical, resampled},
        degeneracy::{Degenerate, fraction, seen},
        solver::Solver,
    },
};

/// The rule that selects the three points of the triad.
///
/// The paper takes "the three most reliable" and does not define them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Choose {
    /// The triangle of largest area in the model.
    #[default]
    LargestArea,
    /// The triangle whose pose has the smallest predicted error over all identified points.
    SmallestCovariance,
    /// The first triangle, in the order of the model, that is not too slender.
    First,
}

/// The paper's direct referencing by auxiliary frames on three identified points, Eq. (3)–(5).
///
/// `object_from_camera = object_from_auxiliary · (camera_from_auxiliary)⁻¹`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Triad {
    /// The rule that selects the three points.
    pub choose: Choose,
    /// Minimum sine of the smallest angle of a triangle, 0 to below 1; more slender triangles are excluded.
    pub min_sine: f64,
}

impl Default for Triad {
    fn default() -> Self {
        Self { choose: Choose::default(), min_sine: 0.05 }
    }
}

impl Component for Triad {
    const NAME: &'static str = "triad";
    const SUMMARY: &'static str = "auxiliary frames on three identified points, Bobkov et al. 2021, Eq. (3) to (5)";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of autonomous \
         underwater vehicles to man-made objects using stereo images, 2021";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-sine", self.min_sine)
    }
}

/// Maximum number of points for a search over all triangles (40 points have 9880); more points are sampled evenly.
const MAX_WEIGHTED: usize = 40;

impl Solver for Triad {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        let three = self.three(data)?;
        pose(&three.map(|i| &data.points[i]))
    }

    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        self.three(data).map_or(Vec::new(), Vec::from)
    }

    /// The covariance by resampling of the three points.
    ///
    /// First order does not suffice: no other points average their depths, and attitude errors of several degrees are
    /// nonlinear in them.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let three = self.three(data)?.map(|i| data.points[i]).to_vec();
        resampled::covariance(
            of_three,
            &Observations { points: three, edges: Vec::new(), rig: data.rig },
            at,
            resampled::Answer::Straight,
        )
    }
}

impl Triad {
    /// The three points that determine the pose, ascending.
    fn three(&self, data: &Observations<'_>) -> Result<[usize; 3], Degenerate> {
        seen(data, 3)?;
        let min = self.min_sine * self.min_sine;
        let wide = |three: [usize; 3]| min_sine_squared(&three.map(|i| &data.points[i])) >= min;
        // The usual answer, without the search over all triangles.
        let likely = match self.choose {
            Choose::First => Some([0, 1, 2].map(|k| weighted(data.points.len(), k))),
            Choose::LargestArea => largest(&data.points),
            Choose::SmallestCovariance => None,
        };
        if let Some(three) = likely.filter(|&three| wide(three)) {
            return Ok(three);
        }
        let mut best: Option<([usize; 3], f64)> = None;
        for three in triangles(data.points.len()).filter(|&three| wide(three)) {
            let worth = match self.choose {
                Choose::First => return Ok(three),
                Choose::LargestArea => square_area(&three.map(|i| &data.points[i])),
                Choose::SmallestCovariance => match predicted_error(&three.map(|i| data.points[i]), data) {
                    Ok(error) => -error,
                    Err(_) => continue,
                },
            };
            // Ties are resolved by the order of the model: only a strictly better triangle replaces.
            if best.is_none_or(|(_, max)| worth > max) {
                best = Some((three, worth));
            }
        }
        best.map(|(three, _)| three).ok_or_else(|| self.line(data))
    }

    /// The error for triangles that are all too slender, with the largest sine.
    fn line(&self, data: &Observations<'_>) -> Degenerate {
        let sines = triangles(data.points.len()).map(|three| min_sine_squared(&three.map(|i| &data.points[i])));
        Degenerate::Collinear { ratio: sines.fold(0.0, f64::max).sqrt(), min: self.min_sine }
    }
}

/// The index of the k-th sampled point of `count`: every point, or an even sample of many.
fn weighted(count: usize, k: usize) -> usize {
    if count <= MAX_WEIGHTED { k } else { k * count / MAX_WEIGHTED }
}

/// All triangles of `count` points in lexicographic order; for many points, those of an even sample.
fn triangles(count: usize) -> impl Iterator<Item = [usize; 3]> {
    let kept = count.min(MAX_WEIGHTED);
    let at = move |i: usize| weighted(count, i);
    (0..kept).flat_map(move |i| (i + 1..kept).flat_map(move |j| (j + 1..kept).map(move |k| [at(i), at(j), at(k)])))
}

/// The triangle of largest area in the model among those of [`triangles`], ascending; `None` if all points coincide.
///
/// Branch and bound, exact: no triangle with a longest side of length L has an area above √3/4 L², so a side too short
/// for the best area so far needs no third point. A greedy triangle provides a large first bound.
fn largest(points: &[Observation]) -> Option<[usize; 3]> {
    let kept = points.len().min(MAX_WEIGHTED);
    let (mut x, mut y, mut z) = ([0.0; MAX_WEIGHTED], [0.0; MAX_WEIGHTED], [0.0; MAX_WEIGHTED]);
    for k in 0..kept {
        let at = &points[weighted(points.len(), k)].model.coords;
        (x[k], y[k], z[k]) = (at.x, at.y, at.z);
    }
    let (x, y, z) = (&x[..kept], &y[..kept], &z[..kept]);
    let side = |i: usize, j: usize| (x[j] - x[i], y[j] - y[i], z[j] - z[i]);
    let square = |i: usize, j: usize| {
        let (a, b, c) = side(i, j);
        a * a + b * b + c * c
    };
    // Four times the squared area over all third points: index of the largest, and its value.
    let third = |i: usize, j: usize| {
        let (a, b, c) = side(i, j);
        let mut worth = [0.0; MAX_WEIGHTED];
        for (k, worth) in worth[..kept].iter_mut().enumerate() {
            let (d, e, f) = (x[k] - x[i], y[k] - y[i], z[k] - z[i]);
            let (u, v, w) = (b * f - c * e, c * d - a * f, a * e - b * d);
            *worth = u * u + v * v + w * w;
        }
        first_greatest(&worth[..kept])
    };
    let farthest = |i: usize| {
        let mut away = [0.0; MAX_WEIGHTED];
        away[..kept].iter_mut().enumerate().for_each(|(k, away)| *away = square(i, k));
        first_greatest(&away[..kept]).0
    };
    let one = farthest(0);
    let two = farthest(one);
    let (three, mut max) = third(one, two);
    let mut best = [one, two, three];
    for i in 0..kept {
        for j in i + 1..kept {
            let length = square(i, j);
            // Strict comparison: a triangle that only equals the best is skipped.
            if 0.75 * length * length > max {
                let (k, worth) = third(i, j);
                if worth > max {
                    (best, max) = ([i, j, k], worth);
                }
            }
        }
    }
    best.sort_unstable();
    (max > 0.0).then(|| best.map(|k| weighted(points.len(), k)))
}

/// The largest of some numbers and its first index.
fn first_greatest(values: &[f64]) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (k, &value) in values.iter().enumerate() {
        if value > best.1 {
            best = (k, value);
        }
    }
    best
}

/// Eq. (3)–(5): alignment of the axes of both auxiliary frames, R = M_object M_cameraᵀ, and of P1 with C1.
fn pose(points: &[&Observation; 3]) -> Result<Transform<Object, Camera>, Degenerate> {
    let [c1, c2, c3] = points.map(|point| &point.measured.at.coords);
    let [p1, p2, p3] = points.map(|point| &point.model.coords);
    let rotation = axes(p1, p2, p3)? * axes(c1, c2, c3)?.transpose();
    Ok(Transform::from_axes(&rotation, p1 - rotation * c1))
}

/// The axes of [`seafix_geometry::triad`] as the columns of a matrix.
fn axes(p1: &Vector3<f64>, p2: &Vector3<f64>, p3: &Vector3<f64>) -> Result<Matrix3<f64>, Degenerate> {
    const MIN_SINE: f64 = 1e-9;
    let (a, b) = (p2 - p1, p3 - p1);
    let normal = a.cross(&b);
    let (length, size, sides) = (b.norm_squared(), normal.norm_squared(), a.norm_squared() * b.norm_squared());
    // A NaN (coincident points) is rejected as well.
    if !(size >= MIN_SINE * MIN_SINE * sides && size > 0.0) {
        let ratio = (size / sides).sqrt();
        return Err(Degenerate::Collinear { ratio: if ratio.is_nan() { 0.0 } else { ratio }, min: MIN_SINE });
    }
    let (x, z) = (b * (1.0 / length.sqrt()), normal * (1.0 / size.sqrt()));
    Ok(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

/// The first-order covariance; it suffices for a comparison of triangles.
fn covariance_of(
    points: &[Observation; 3],
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let three = Observations { points: points.to_vec(), edges: Vec::new(), rig: data.rig };
    numerical::covariance(of_three, &three, at)
}

/// The pose of three points.
fn of_three(data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
    pose(&[&data.points[0], &data.points[1], &data.points[2]])
}

/// The squared sine of the smallest angle, the smaller of model and measurement.
fn min_sine_squared(points: &[&Observation; 3]) -> f64 {
    let of = |p: [Vector3<f64>; 3]| {
        let sides = [(p[1] - p[0]), (p[2] - p[1]), (p[0] - p[2])];
        let square = sides[0].cross(&sides[1]).norm_squared();
        let [a, b, c] = sides.map(|side| side.norm_squared());
        // The smallest angle lies between the two longest sides.
        square / (a * b).max(b * c).max(c * a)
    };
    of(points.map(|point| point.model.coords)).min(of(points.map(|point| point.measured.at.coords)))
}

/// Four times the squared area of the model's triangle (m⁴).
fn square_area(points: &[&Observation; 3]) -> f64 {
    (points[1].model - points[0].model).cross(&(points[2].model - points[0].model)).norm_squared()
}

/// The summed variance (m²) of all identified points under the pose from these three.
fn predicted_error(points: &[Observation; 3], data: &Observations<'_>) -> Result<f64, Degenerate> {
    let at = pose(&points.each_ref())?;
    let covariance = covariance_of(points, data, &at)?;
    Ok(data.points.iter().map(|point| covariance.of_point(&point.measured.at).trace()).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Point, triad};

    #[test]
    fn the_axes_are_the_triads() {
        let [a, b, c] = [[0.3, -1.0, 2.0], [1.4, 0.2, 2.2], [-0.5, 0.7, 3.0]].map(Vector3::from);
        let [pa, pb, pc] = [a, b, c].map(Point::<Camera>::from);
        let expected = triad::<Camera, Object>(&pa, &pb, &pc).unwrap().rotation_matrix();
        assert!((axes(&a, &b, &c).unwrap() - expected).amax() < 1e-15);
        assert!(axes(&a, &a, &c).is_err() && axes(&a, &b, &(a + (b - a) * 2.0)).is_err());
    }

    /// Pseudo-random points in a box, so that any of them may be corners.
    fn scattered(count: usize, seed: u64) -> Vec<Observation> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let point = |_| {
            let at = Point::new(next() * 1.4, next(), 3.0 + 0.6 * next());
            let measured = seafix_geometry::UncertainPoint::isotropic(at, 1e-3);
            Observation { measured, pixels: None, model: Point::from(at.coords), model_sigma: 0.0 }
        };
        (0..count).map(point).collect()
    }

    /// A box, a slender box and a flat one; the longest side of a slender box belongs to no large triangle.
    #[test]
    fn the_bounded_search_finds_the_largest_triangle() {
        let seeds = (3..30).flat_map(|count| (0..20).map(move |k: u64| (count, k.wrapping_mul(0x9E37_79B9_7F4A_7C15))));
        for ((count, seed), shape) in seeds.chain([(90, 1), (200, 2)]).flat_map(|set| {
            [[1.0, 1.0, 1.0], [1.0, 0.1, 0.1], [1.0, 0.3, 0.0]].map(|shape| (set, Vector3::from(shape)))
        }) {
            let mut points = scattered(count, seed);
            points.iter_mut().for_each(|point| point.model.coords.component_mul_assign(&shape));
            let area = |three: [usize; 3]| square_area(&three.map(|i| &points[i]));
            let max = triangles(count).map(area).fold(0.0, f64::max);
            let found = area(largest(&points).unwrap());
            assert!((found / max - 1.0).abs() < 1e-9, "{count} points, seed {seed}: {found} of {max}");
        }
        let mut one_place = scattered(5, 1);
        one_place.iter_mut().for_each(|point| point.model = Point::origin());
        assert_eq!(largest(&one_place), None);
    }

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Triad::default().check(), Ok(()));
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Triad { min_sine: bad, ..Triad::default() }.check().is_err(), "{bad}");
        }
    }

    /// Points of the model, seen from `pose` with a noise of 1 mm.
    fn seen(places: &[[f64; 3]], pose: &Transform<Object, Camera>) -> Vec<Observation> {
        let point = |at: &[f64; 3]| {
            let model = Point::from(*at);
            let measured = seafix_geometry::UncertainPoint::isotropic(pose.inverse() * model, 1e-3);
            Observation { measured, pixels: None, model, model_sigma: 0.0 }
        };
        places.iter().map(point).collect()
    }

    fn three(solver: &Triad, points: &[Observation]) -> Result<[usize; 3], Degenerate> {
        solver.three(&Observations { points: points.to_vec(), edges: Vec::new(), rig: None })
    }

    /// Sides 3, 4, 5 have the area 6 and the sines 3/5, 4/5 and 1; sides 5, 12, 13 have the smallest sine 5/13.
    #[test]
    fn areas_and_angles_of_right_triangles() {
        let corners = |a: f64, b: f64| [[0.0, 0.0, 1.0], [a, 0.0, 1.0], [0.0, b, 1.0]];
        let points = |model: [[f64; 3]; 3], measured: [[f64; 3]; 3]| {
            let mut points = seen(&model, &Transform::identity());
            points.iter_mut().zip(measured).for_each(|(point, at)| point.measured.at = at.into());
            points
        };
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let arranged = |corners: [[f64; 3]; 3]| order.map(|k| corners[k]);
            let of = |model, measured| {
                let points = points(arranged(model), arranged(measured));
                (min_sine_squared(&[0, 1, 2].map(|k| &points[k])), square_area(&[0, 1, 2].map(|k| &points[k])))
            };
            let (sine, area) = of(corners(3.0, 4.0), corners(3.0, 4.0));
            assert!((sine - 0.36).abs() < 1e-12 && (area - 144.0).abs() < 1e-9, "{order:?}: {sine} {area}");
            let (model, measured) =
                (of(corners(3.0, 4.0), corners(5.0, 12.0)), of(corners(5.0, 12.0), corners(3.0, 4.0)));
            let min = 25.0 / 169.0;
            assert!((model.0 - min).abs() < 1e-12 && (measured.0 - min).abs() < 1e-12, "{order:?}");
            assert!((measured.1 - 3600.0).abs() < 1e-9);
        }
    }

    /// R = M_object M_cameraᵀ and P1 on C1: a quarter turn about z aligns the first points although the others differ.
    #[test]
    fn the_pose_maps_the_first_points_on_each_other() {
        let mut points = seen(&[[1.0, 2.0, 3.0], [1.0, 4.0, 3.0], [0.0, 2.0, 3.0]], &Transform::identity());
        let measured = [[0.0, 0.0, 5.0], [2.5, 0.0, 5.0], [0.0, 1.5, 5.0]];
        points.iter_mut().zip(measured).for_each(|(point, at)| point.measured.at = at.into());
        let found = pose(&[0, 1, 2].map(|k| &points[k])).unwrap();
        // The object's +y is the camera's +x, and its −x the camera's +y.
        let expected = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((found.rotation_matrix() - expected).amax() < 1e-15);
        assert!((found * points[0].measured.at - points[0].model).amax() < 1e-14);
        assert!((found.translation() - Vector3::new(1.0, 2.0, -2.0)).amax() < 1e-14);
    }

    #[test]
    fn axes_are_rejected_with_the_sine_of_the_angle_at_the_first_point() {
        let [a, b] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Vector3::from);
        let at = |sine: f64| axes(&a, &b, &Vector3::new(3.0, 3.0 * sine, 0.0));
        assert!(at(2e-9).is_ok());
        match at(5e-10) {
            Err(Degenerate::Collinear { ratio, min }) => assert!((ratio / 5e-10 - 1.0).abs() < 1e-6 && min == 1e-9),
            other => panic!("{other:?}"),
        }
        assert_eq!(axes(&a, &a, &a), Err(Degenerate::Collinear { ratio: 0.0, min: 1e-9 }));
    }

    /// The setting is the sine of the triangle's smallest angle; the error states that of the widest triangle.
    #[test]
    fn slender_triangles_are_passed_over() {
        let solver = |choose, min_sine| Triad { choose, min_sine };
        // The smallest angles: sin = 0.1/√(4 + 0.01) of the first three, more with the fourth.
        let places = [[0.0, 0.0, 3.0], [1.0, 0.1, 3.0], [2.0, 0.0, 3.0], [1.0, 1.0, 3.0]];
        let points = seen(&places, &Transform::identity());
        // sin² of the angle at the first: (cross product 0.2)² over the two longest sides squared, 4 · 1.01.
        let sine = (0.04_f64 / (4.0 * 1.01)).sqrt();
        assert_eq!(three(&solver(Choose::First, sine * 0.999), &points), Ok([0, 1, 2]));
        assert_eq!(three(&solver(Choose::First, sine * 1.001), &points), Ok([0, 1, 3]));
        for choose in [Choose::First, Choose::LargestArea, Choose::SmallestCovariance] {
            match three(&solver(choose, sine * 1.001), &points[..3]) {
                Err(Degenerate::Collinear { ratio, min }) => {
                    assert!((ratio / sine - 1.0).abs() < 1e-9 && min == sine * 1.001, "{ratio}");
                }
                other => panic!("{other:?}"),
            }
        }
        // The largest triangle, 10 m by 0.6 m, is too slender: the next is taken.
        let places = [[0.0, 0.0, 3.0], [5.0, 0.6, 3.0], [10.0, 0.0, 3.0], [0.0, 1.0, 3.0], [1.0, 0.0, 3.0]];
        let points = seen(&places, &Transform::identity());
        let area = |three: [usize; 3]| square_area(&three.map(|k| &points[k]));
        let sine = |three: [usize; 3]| min_sine_squared(&three.map(|k| &points[k])).sqrt();
        let widest = triangles(5).filter(|&three| sine(three) >= 0.15).max_by(|&a, &b| area(a).total_cmp(&area(b)));
        assert!(sine(largest(&points).unwrap()) < 0.15);
        assert_eq!(three(&solver(Choose::LargestArea, 0.15), &points).ok(), widest);
        // Four equal triangles, the halves of a square: the first is taken.
        let square =
            seen(&[[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [1.0, 1.0, 3.0], [0.0, 1.0, 3.0]], &Transform::identity());
        assert_eq!(three(&solver(Choose::SmallestCovariance, 0.05), &square[..3]), Ok([0, 1, 2]));
        assert_eq!(largest(&square).map(|three| square_area(&three.map(|k| &square[k]))), Some(1.0));
    }

    /// A right angle with the legs W = 0.5 to the second point and L = 2 to the third, each point with isotropic noise
    /// δ of variance σ²: the first and the third position have the variance 3 σ², the second (3 + 2 W²/L²) σ².
    #[test]
    fn the_predicted_error_is_that_of_three_points() {
        let places = [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [2.0, 0.0, 0.0], [2.0, 0.5, 0.0]];
        let data = Observations { points: seen(&places, &Transform::identity()), edges: Vec::new(), rig: None };
        let of = |points: &[Observation]| {
            let data = Observations { points: points.to_vec(), edges: Vec::new(), rig: None };
            predicted_error(&[points[0], points[1], points[2]], &data).unwrap() / 1e-6
        };
        let ratio = 0.5 * 0.5 / 4.0;
        assert!((of(&data.points[..3]) - (9.0 + 2.0 * ratio)).abs() < 1e-5, "{}", of(&data.points[..3]));
        // The error of the position (L, W, 0) is (δ₁x − (δ₃ − δ₁)y W/L, δ₃y, δ₂z + δ₃z − δ₁z).
        let fourth = (1.0 + 2.0 * ratio) + 1.0 + 3.0;
        assert!((of(&data.points) - (9.0 + 2.0 * ratio + fourth)).abs() < 1e-5, "{}", of(&data.points));
    }

    /// The point with ten times the noise is excluded, at every index.
    #[test]
    fn the_smallest_covariance_leaves_the_worst_point_out() {
        let solver = Triad { choose: Choose::SmallestCovariance, ..Triad::default() };
        let places = [[0.0, 0.0, 3.0], [1.0, 0.2, 3.1], [0.9, 1.1, 3.0], [-0.1, 1.0, 2.8]];
        for worst in 0..4 {
            let mut points = seen(&places, &Transform::identity());
            points[worst].measured.covariance *= 100.0;
            let others: Vec<usize> = (0..4).filter(|&k| k != worst).collect();
            assert_eq!(three(&solver, &points).unwrap().to_vec(), others);
            let data = Observations { points, edges: Vec::new(), rig: None };
            assert_eq!(solver.used(&data), others);
        }
    }

    /// More than forty points are sampled evenly down to forty.
    #[test]
    fn many_points_are_thinned_evenly() {
        assert_eq!(triangles(4).collect::<Vec<_>>(), [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
        assert_eq!((triangles(40).count(), triangles(41).count(), triangles(200).count()), (9880, 9880, 9880));
        assert_eq!((weighted(40, 39), weighted(41, 39), weighted(80, 1), weighted(80, 39)), (39, 39, 2, 78));
        assert_eq!(triangles(80).next(), Some([0, 2, 4]));
        assert_eq!(triangles(80).last(), Some([74, 76, 78]));
        let points = scattered(90, 4);
        assert_eq!(three(&Triad { choose: Choose::First, ..Triad::default() }, &points), Ok([0, 2, 4]));
    }

    /// Every assignment of the corners of the largest triangle to indices.
    #[test]
    fn the_largest_triangle_is_found_wherever_its_corners_stand() {
        let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [1.0, 3.0, -1.0]];
        for (i, j, k) in (0..6).flat_map(|i| (i + 1..6).flat_map(move |j| (j + 1..6).map(move |k| (i, j, k)))) {
            let mut places = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|n: f64| [1.5 + 0.2 * n, 1.0 - 0.1 * n * n, 0.05 * n]);
            (places[i], places[j], places[k]) = (corners[0], corners[1], corners[2]);
            assert_eq!(largest(&seen(&places, &Transform::identity())), Some([i, j, k]));
        }
    }
}
