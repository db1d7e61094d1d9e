//! Closed-form poses from few features: points and lines in space.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, MeasuredLine, Object, Transform};
use smallvec::SmallVec;

use crate::{observations::Observations, space_line::SpaceLine};

/// A feature with its model and its measurement: a point, or a line with two places on it.
///
/// The second place of a measured line need not be that of the model, and its direction may be the opposite.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Feature {
    /// The model point and the measured point.
    Point(Vector3<f64>, Vector3<f64>),
    /// The ends of the model edge and of the measured line, and the standard deviation (rad) of its direction.
    Line([Vector3<f64>; 2], [Vector3<f64>; 2], f64),
}

/// Sine of the angle between two directions below which they count as parallel.
const PARALLEL: f64 = 0.05;
/// Tolerance (rad) of the angle between two directions in model and measurement, beside four standard deviations.
const ANGLE: f64 = 0.1;
/// Standard deviation (rad) of a direction at which a greater angle is worth less.
const DIRECTION_SIGMA: f64 = 0.02;

/// The possible motions camera_from_object of some features, at most four.
///
/// Two directions that are not parallel fix the rotation (the triad of the paper's Fig. 2): those of lines, and that from
/// one point to another. A line has two directions, so that two lines have up to four rotations, of which two have the
/// model's angle unless it is a right one. The translation then is the least-squares solution of R p + t = c for points
/// and of the same across the measured direction for lines. Empty if all directions are parallel, if the translation is
/// not determined, or if no angle agrees.
pub(crate) fn frames(features: &[Feature]) -> SmallVec<[Transform<Camera, Object>; 4]> {
    let mut found = SmallVec::new();
    let Some([one, other]) = widest(features) else { return found };
    let model_angle = angle(&one.model, &other.model);
    for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        if (a < 0.0 && one.polar) || (b < 0.0 && other.polar) {
            continue;
        }
        let (first, second) = (one.measured * a, other.measured * b);
        if (angle(&first, &second) - model_angle).abs() > ANGLE + 4.0 * one.sigma.hypot(other.sigma) {
            continue;
        }
        let (Some(from), Some(to)) = (basis(&one.model, &other.model), basis(&first, &second)) else { continue };
        let rotation = to * from.transpose();
        if let Some(shift) = shift(features, &rotation) {
            found.push(Transform::from_axes(&rotation, shift));
        }
    }
    found
}

/// A direction in model and measurement; `polar` if its sign is known.
struct Direction {
    model: Vector3<f64>,
    measured: Vector3<f64>,
    polar: bool,
    sigma: f64,
}

/// The two directions that fix a rotation best: a great angle between well measured directions.
fn widest(features: &[Feature]) -> Option<[Direction; 2]> {
    let mut all: SmallVec<[Direction; 16]> = SmallVec::new();
    let mut points: SmallVec<[(Vector3<f64>, Vector3<f64>); 16]> = SmallVec::new();
    for feature in features {
        match *feature {
            Feature::Line(model, measured, sigma) => all.extend(
                (model[1] - model[0])
                    .try_normalize(0.0)
                    .zip((measured[1] - measured[0]).try_normalize(0.0))
                    .map(|(model, measured)| Direction { model, measured, polar: false, sigma }),
            ),
            Feature::Point(model, measured) => points.push((model, measured)),
        }
    }
    for (i, (model, measured)) in points.iter().enumerate() {
        for (other, seen) in &points[..i] {
            let direction = (model - other).try_normalize(0.0).zip((measured - seen).try_normalize(0.0));
            all.extend(direction.map(|(model, measured)| Direction {
                model,
                measured,
                polar: true,
                sigma: DIRECTION_SIGMA,
            }));
        }
    }
    let (mut best, mut max) = (None, 0.0);
    for i in 0..all.len() {
        for k in 0..i {
            let sine = all[i].model.cross(&all[k].model).norm();
            let worth = sine / (DIRECTION_SIGMA + all[i].sigma + all[k].sigma);
            if sine > PARALLEL && worth > max {
                (best, max) = (Some((k, i)), worth);
            }
        }
    }
    let (k, i) = best?;
    let other = all.swap_remove(i);
    let one = all.swap_remove(k);
    Some([one, other])
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}

/// An orthonormal basis that treats both directions alike: their bisectors and their common normal.
fn basis(a: &Vector3<f64>, b: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let (sum, difference) = ((a + b).try_normalize(1e-9)?, (a - b).try_normalize(1e-9)?);
    Some(Matrix3::from_columns(&[sum, difference, sum.cross(&difference)]))
}

/// The least-squares translation under a rotation.
fn shift(features: &[Feature], rotation: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let (mut normal, mut pull) = (Matrix3::zeros(), Vector3::zeros());
    for feature in features {
        let (weight, off) = match feature {
            Feature::Point(model, measured) => (Matrix3::identity(), measured - rotation * model),
            Feature::Line(model, measured, _) => {
                let along = (measured[1] - measured[0]).normalize();
                let centre = |ends: &[Vector3<f64>; 2]| (ends[0] + ends[1]) / 2.0;
                (Matrix3::identity() - along * along.transpose(), centre(measured) - rotation * centre(model))
            }
        };
        normal += weight;
        pull += weight * off;
    }
    let root = normal.cholesky()?;
    (normal.symmetric_eigenvalues().min() > PARALLEL * PARALLEL).then(|| root.solve(&pull))
}

/// The possible poses of some observations: those of all features, and of the best measured lines in pairs.
///
/// Lines without a measured depth count only if the others give no pose.
pub(crate) fn poses(data: &Observations<'_>) -> Vec<Transform<Object, Camera>> {
    let found = poses_of(data, |line| line.depth);
    if found.is_empty() { poses_of(data, |_| true) } else { found }
}

fn poses_of(data: &Observations<'_>, usable: impl Fn(&MeasuredLine) -> bool) -> Vec<Transform<Object, Camera>> {
    let points = data.points.iter().map(|point| Feature::Point(point.model.coords, point.measured.at.coords));
    let lines = data.edges.iter().filter(|edge| usable(&edge.measured));
    let mut lines: Vec<(f64, Feature)> = lines
        .filter_map(|edge| {
            let sigma = SpaceLine::of(&edge.measured)?.direction_sigma();
            let (model, measured) = (edge.model.map(|end| end.coords), edge.measured.ends.map(|end| end.coords));
            Some((sigma, Feature::Line(model, measured, sigma)))
        })
        .collect();
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let lines: Vec<Feature> = lines.into_iter().map(|(_, line)| line).collect();
    let all: Vec<Feature> = points.chain(lines.iter().copied()).collect();
    let best = &lines[..lines.len().min(PAIRED)];
    let pairs = (0..best.len()).flat_map(|i| (0..i).map(move |k| [best[k], best[i]]));
    let roots = frames(&all).into_iter().chain(pairs.flat_map(|pair| frames(&pair)));
    roots.map(|root| root.inverse()).collect()
}

/// Number of lines of which pairs are solved.
const PAIRED: usize = 5;

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;

    const MODEL: [[f64; 3]; 6] =
        [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.3], [0.7, -0.2, 0.8], [0.3, 0.3, -0.5], [-0.4, 0.6, 0.2]];

    fn truth() -> Transform<Camera, Object> {
        Transform::exp(&Vector6::new(0.4, -0.7, 1.1, 0.3, -0.2, 3.0))
    }

    fn point(k: usize) -> Feature {
        let at = Vector3::from(MODEL[k]);
        Feature::Point(at, (truth() * seafix_geometry::Point::from(at)).coords)
    }

    /// A line of which another part is seen, from its other side if `reversed`.
    fn line(i: usize, k: usize, reversed: bool) -> Feature {
        let (a, b) = (Vector3::from(MODEL[i]), Vector3::from(MODEL[k]));
        let seen = |t: f64| (truth() * seafix_geometry::Point::from(a + (b - a) * t)).coords;
        let measured = [seen(0.3), seen(1.2)];
        Feature::Line([a, b], if reversed { [measured[1], measured[0]] } else { measured }, 0.0)
    }

    /// E6: the true pose is among the roots of every minimal set.
    #[test]
    fn minimal_sets_have_the_true_pose_among_their_roots() {
        for reversed in [false, true] {
            let sets: [&[Feature]; 4] = [
                &[point(0), point(1), point(2)],
                &[point(0), point(3), line(1, 2, reversed)],
                &[point(4), line(0, 1, reversed), line(2, 3, false)],
                &[line(0, 2, reversed), line(1, 5, !reversed)],
            ];
            for (number, set) in sets.iter().enumerate() {
                let roots = frames(set);
                let nearest = roots.iter().map(|root| root.error_to(&truth()).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-10, "set {number}, {} roots: {nearest:e}", roots.len());
                assert!(roots.len() <= 4);
            }
        }
    }

    #[test]
    fn parallel_lines_have_no_pose() {
        let along = Vector3::new(0.2, 0.9, 0.3);
        let line = |at: [f64; 3]| {
            let (a, b) = (Vector3::from(at), Vector3::from(at) + along);
            let seen = |p: Vector3<f64>| (truth() * seafix_geometry::Point::from(p)).coords;
            Feature::Line([a, b], [seen(a), seen(b)], 0.0)
        };
        assert!(frames(&[line([0.0; 3]), line([1.0, 0.0, 0.0]), line([0.0, 0.0, 1.0])]).is_empty());
    }
}
