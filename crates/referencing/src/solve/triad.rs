//! Triad: the paper's pose from three identified points.

use nalgebra::{Matrix3, Vector3};
use seafix_component::Component;
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver, numerical, resampled,
    spread::{seen, share},
};
use crate::{Observation, Observations};

/// Which three of the identified points the pose rests on ("the three most reliable", which the
/// paper does not define).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choose {
    /// The triangle of largest area in the model.
    #[default]
    LargestArea,
    /// The triangle whose pose has the least predicted error over all identified points.
    SmallestCovariance,
    /// The first triangle, in the order of the model, that is no line.
    First,
}

/// Direct referencing by an auxiliary frame on three identified points: Eq. (3)–(5),
/// `object_from_camera = object_from_auxiliary · (camera_from_auxiliary)⁻¹`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Triad {
    /// Which three points.
    pub choose: Choose,
    /// Sine of the smallest angle of a triangle below which it counts as a line.
    pub least_sine: f64,
}

impl Default for Triad {
    fn default() -> Self {
        Self { choose: Choose::default(), least_sine: 0.05 }
    }
}

impl Component for Triad {
    const NAME: &'static str = "triad";
    const SUMMARY: &'static str = "auxiliary frames on three identified points, Eq. (3) to (5)";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of autonomous \
         underwater vehicles to man-made objects using stereo images, 2021";

    fn check(&self) -> Result<(), String> {
        share("least-sine", self.least_sine)
    }
}

/// More points than this are thinned before all triangles are weighed: 40 points have 9880.
const MOST_WEIGHED: usize = 40;

impl Solver for Triad {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        let three = self.three(data)?;
        pose(&three.map(|i| &data.points[i]))
    }

    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        self.three(data).map_or(Vec::new(), Vec::from)
    }

    /// That of many draws of the three chosen points: no other averages their depths, and errors of several degrees are no
    /// longer straight in them.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let three = self.three(data)?.map(|i| data.points[i]).to_vec();
        resampled::covariance(of_three, &Observations { points: three, rig: data.rig }, at, resampled::Answer::Straight)
    }
}

impl Triad {
    /// The three points the pose rests on, ascending.
    fn three(&self, data: &Observations<'_>) -> Result<[usize; 3], Degenerate> {
        seen(data, 3)?;
        let least = self.least_sine * self.least_sine;
        let wide = |three: [usize; 3]| least_sine_squared(&three.map(|i| &data.points[i])) >= least;
        // What is nearly always the answer, without the walk over all triangles.
        let likely = match self.choose {
            Choose::First => Some([0, 1, 2].map(|k| weighed(data.points.len(), k))),
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
            // Ties are broken by the order of the model: strictly better replaces.
            if best.is_none_or(|(_, most)| worth > most) {
                best = Some((three, worth));
            }
        }
        best.map(|(three, _)| three).ok_or_else(|| self.line(data))
    }

    /// That no triangle is wide enough, with the widest.
    fn line(&self, data: &Observations<'_>) -> Degenerate {
        let sines = triangles(data.points.len()).map(|three| least_sine_squared(&three.map(|i| &data.points[i])));
        Degenerate::Collinear { ratio: sines.fold(0.0, f64::max).sqrt(), least: self.least_sine }
    }
}

/// The k-th of the points that are weighed, of `count`: all, or an even sample of many.
fn weighed(count: usize, k: usize) -> usize {
    if count <= MOST_WEIGHED { k } else { k * count / MOST_WEIGHED }
}

/// All triangles of `count` points, lexicographic; of many points, those of an even sample.
fn triangles(count: usize) -> impl Iterator<Item = [usize; 3]> {
    let kept = count.min(MOST_WEIGHED);
    let at = move |i: usize| weighed(count, i);
    (0..kept).flat_map(move |i| (i + 1..kept).flat_map(move |j| (j + 1..kept).map(move |k| [at(i), at(j), at(k)])))
}

/// The triangle of largest area in the model among those of [`triangles`], ascending; `None` where all points coincide.
///
/// Exact, though few triangles are looked at: on a longest side of length L none has more than √3/4 L², so that a
/// side too short for the best area known needs no third point. A greedy triangle makes the first best one large.
fn largest(points: &[Observation]) -> Option<[usize; 3]> {
    let kept = points.len().min(MOST_WEIGHED);
    let (mut x, mut y, mut z) = ([0.0; MOST_WEIGHED], [0.0; MOST_WEIGHED], [0.0; MOST_WEIGHED]);
    for k in 0..kept {
        let at = &points[weighed(points.len(), k)].model.coords;
        (x[k], y[k], z[k]) = (at.x, at.y, at.z);
    }
    let (x, y, z) = (&x[..kept], &y[..kept], &z[..kept]);
    let side = |i: usize, j: usize| (x[j] - x[i], y[j] - y[i], z[j] - z[i]);
    let square = |i: usize, j: usize| {
        let (a, b, c) = side(i, j);
        a * a + b * b + c * c
    };
    // Four times the square of the area, over all third points: the greatest and its place.
    let third = |i: usize, j: usize| {
        let (a, b, c) = side(i, j);
        let mut worth = [0.0; MOST_WEIGHED];
        for (k, worth) in worth[..kept].iter_mut().enumerate() {
            let (d, e, f) = (x[k] - x[i], y[k] - y[i], z[k] - z[i]);
            let (u, v, w) = (b * f - c * e, c * d - a * f, a * e - b * d);
            *worth = u * u + v * v + w * w;
        }
        first_greatest(&worth[..kept])
    };
    let farthest = |i: usize| {
        let mut away = [0.0; MOST_WEIGHED];
        away[..kept].iter_mut().enumerate().for_each(|(k, away)| *away = square(i, k));
        first_greatest(&away[..kept]).0
    };
    let one = farthest(0);
    let two = farthest(one);
    let (three, mut most) = third(one, two);
    let mut best = [one, two, three];
    for i in 0..kept {
        for j in i + 1..kept {
            let length = square(i, j);
            // Strictly: what only equals the best is left.
            if 0.75 * length * length > most {
                let (k, worth) = third(i, j);
                if worth > most {
                    (best, most) = ([i, j, k], worth);
                }
            }
        }
    }
    best.sort_unstable();
    (most > 0.0).then(|| best.map(|k| weighed(points.len(), k)))
}

/// The greatest of some numbers and the first place where it stands.
fn first_greatest(values: &[f64]) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (k, &value) in values.iter().enumerate() {
        if value > best.1 {
            best = (k, value);
        }
    }
    best
}

/// Eq. (3)–(5): the axes of both auxiliary frames laid on each other, R = M_object M_cameraᵀ, and P1 on C1.
fn pose(points: &[&Observation; 3]) -> Result<Transform<Object, Camera>, Degenerate> {
    let [c1, c2, c3] = points.map(|point| &point.measured.at.coords);
    let [p1, p2, p3] = points.map(|point| &point.model.coords);
    let rotation = axes(p1, p2, p3)? * axes(c1, c2, c3)?.transpose();
    Ok(Transform::from_axes(&rotation, p1 - rotation * c1))
}

/// The axes of [`seafix_geometry::triad`] as the columns of a matrix.
fn axes(p1: &Vector3<f64>, p2: &Vector3<f64>, p3: &Vector3<f64>) -> Result<Matrix3<f64>, Degenerate> {
    const LEAST_SINE: f64 = 1e-9;
    let (a, b) = (p2 - p1, p3 - p1);
    let normal = a.cross(&b);
    let (length, size, sides) = (b.norm_squared(), normal.norm_squared(), a.norm_squared() * b.norm_squared());
    // Written so that a NaN (coincident points) is refused too.
    if !(size >= LEAST_SINE * LEAST_SINE * sides && size > 0.0) {
        let ratio = (size / sides).sqrt();
        return Err(Degenerate::Collinear { ratio: if ratio.is_nan() { 0.0 } else { ratio }, least: LEAST_SINE });
    }
    let (x, z) = (b * (1.0 / length.sqrt()), normal * (1.0 / size.sqrt()));
    Ok(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

/// By derivatives: to compare triangles it need not be better.
fn covariance_of(
    points: &[Observation; 3],
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let three = Observations { points: points.to_vec(), rig: data.rig };
    numerical::covariance(of_three, &three, at)
}

/// The pose of three points.
fn of_three(data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
    pose(&[&data.points[0], &data.points[1], &data.points[2]])
}

/// The square of the sine of the smallest angle, in the model or as measured, whichever is smaller.
fn least_sine_squared(points: &[&Observation; 3]) -> f64 {
    let of = |p: [Vector3<f64>; 3]| {
        let sides = [(p[1] - p[0]), (p[2] - p[1]), (p[0] - p[2])];
        let square = sides[0].cross(&sides[1]).norm_squared();
        let [a, b, c] = sides.map(|side| side.norm_squared());
        // The smallest angle lies between the two longest sides.
        square / (a * b).max(b * c).max(c * a)
    };
    of(points.map(|point| point.model.coords)).min(of(points.map(|point| point.measured.at.coords)))
}

/// Four times the square of the area of the model's triangle (m⁴).
fn square_area(points: &[&Observation; 3]) -> f64 {
    (points[1].model - points[0].model).cross(&(points[2].model - points[0].model)).norm_squared()
}

/// The variance (m²) that the pose from these three gives all identified points, summed.
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

    /// Points in a box, by a small generator: the corners of a triangle are any of them.
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

    #[test]
    fn the_bounded_search_finds_the_largest_triangle() {
        for (count, seed) in (3..30).flat_map(|count| (0..20).map(move |seed| (count, seed))).chain([(90, 1), (200, 2)])
        {
            let points = scattered(count, seed);
            let area = |three: [usize; 3]| square_area(&three.map(|i| &points[i]));
            let most = triangles(count).map(area).fold(0.0, f64::max);
            let found = area(largest(&points).unwrap());
            assert!((found / most - 1.0).abs() < 1e-12, "{count} points, seed {seed}: {found} of {most}");
        }
        let mut one_place = scattered(5, 1);
        one_place.iter_mut().for_each(|point| point.model = Point::origin());
        assert_eq!(largest(&one_place), None);
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        assert_eq!(Triad::default().check(), Ok(()));
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Triad { least_sine: bad, ..Triad::default() }.check().is_err(), "{bad}");
        }
    }
}
