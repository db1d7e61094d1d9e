//! Triad: the paper's pose from three identified points.

use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform, triad};
use serde::{Deserialize, Serialize};

use super::{Degenerate, Solver, numerical, spread::check};
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
        // Written so that a NaN is refused too.
        let share = self.least_sine >= 0.0 && self.least_sine < 1.0;
        in_range(share, "least-sine", self.least_sine, "a sine from 0 to below 1")
    }
}

/// More points than this are thinned before all triangles are weighed: 40 points have 9880.
const MOST_WEIGHED: usize = 40;

impl Solver for Triad {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        let three = self.three(data)?;
        pose(&three.map(|i| data.points[i]))
    }

    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        self.three(data).map_or(Vec::new(), Vec::from)
    }

    /// The derivatives are those of the three chosen points: another choice under a small step
    /// would be no derivative.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        covariance_of(&self.three(data)?.map(|i| data.points[i]), data, at)
    }
}

impl Triad {
    /// The three points the pose rests on, ascending.
    fn three(&self, data: &Observations<'_>) -> Result<[usize; 3], Degenerate> {
        check(data, 3, 1e-9)?;
        let triangles = triangles(data.points.len());
        let mut best: Option<([usize; 3], f64)> = None;
        let mut widest: f64 = 0.0;
        for three in triangles {
            let points = three.map(|i| data.points[i]);
            let sine = least_sine(&points);
            widest = widest.max(sine);
            if !(sine >= self.least_sine) {
                continue;
            }
            let worth = match self.choose {
                Choose::First => return Ok(three),
                Choose::LargestArea => area(&points),
                Choose::SmallestCovariance => match predicted_error(&points, data) {
                    Ok(error) => -error,
                    Err(_) => continue,
                },
            };
            // Ties are broken by the order of the model: strictly better replaces.
            if best.is_none_or(|(_, most)| worth > most) {
                best = Some((three, worth));
            }
        }
        best.map(|(three, _)| three).ok_or(Degenerate::Collinear { ratio: widest, least: self.least_sine })
    }
}

/// All triangles of `count` points, lexicographic; of many points, those of an even sample.
fn triangles(count: usize) -> impl Iterator<Item = [usize; 3]> {
    let kept = count.min(MOST_WEIGHED);
    let at = move |i: usize| i * count / kept;
    (0..kept).flat_map(move |i| (i + 1..kept).flat_map(move |j| (j + 1..kept).map(move |k| [at(i), at(j), at(k)])))
}

/// Eq. (3)–(5).
fn pose(points: &[Observation; 3]) -> Result<Transform<Object, Camera>, Degenerate> {
    let line =
        |collinear: seafix_geometry::Collinear| Degenerate::Collinear { ratio: collinear.sine, least: collinear.least };
    let [c1, c2, c3] = points.map(|point| point.measured.at);
    let [p1, p2, p3] = points.map(|point| point.model);
    let camera_from_auxiliary = triad::<Camera, Object>(&c1, &c2, &c3).map_err(line)?;
    let object_from_auxiliary = triad::<Object, Object>(&p1, &p2, &p3).map_err(line)?;
    Ok(object_from_auxiliary * camera_from_auxiliary.inverse())
}

fn covariance_of(
    points: &[Observation; 3],
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    let three = Observations { points: points.to_vec(), rig: data.rig };
    let solve = |moved: &Observations<'_>| pose(&[moved.points[0], moved.points[1], moved.points[2]]);
    numerical::covariance(solve, &three, at)
}

/// The sine of the smallest angle, in the model or as measured, whichever is smaller.
fn least_sine(points: &[Observation; 3]) -> f64 {
    let sine = |a: f64, b: f64, double_area: f64| double_area / (a * b);
    let of = |p: [nalgebra::Vector3<f64>; 3]| {
        let sides = [(p[1] - p[0]), (p[2] - p[1]), (p[0] - p[2])];
        let double_area = sides[0].cross(&sides[1]).norm();
        let [a, b, c] = sides.map(|side| side.norm());
        sine(a, b, double_area).min(sine(b, c, double_area)).min(sine(c, a, double_area))
    };
    of(points.map(|point| point.model.coords)).min(of(points.map(|point| point.measured.at.coords)))
}

/// Twice the area of the model's triangle (m²).
fn area(points: &[Observation; 3]) -> f64 {
    (points[1].model - points[0].model).cross(&(points[2].model - points[0].model)).norm()
}

/// The variance (m²) that the pose from these three gives all identified points, summed.
fn predicted_error(points: &[Observation; 3], data: &Observations<'_>) -> Result<f64, Degenerate> {
    let at = pose(points)?;
    let covariance = covariance_of(points, data, &at)?;
    Ok(data.points.iter().map(|point| covariance.of_point(&point.measured.at).trace()).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_refused() {
        assert_eq!(Triad::default().check(), Ok(()));
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Triad { least_sine: bad, ..Triad::default() }.check().is_err(), "{bad}");
        }
    }
}
