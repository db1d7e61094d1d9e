//! Objects that are not as modelled: a part is displaced, turned or scaled against the rest.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::ModelPoint;
use seafix_simulation::{Purpose, Stream};

/// The kind of difference between an object and its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bend {
    /// None: the object is as modelled.
    None,
    /// The points on one side of a plane through the middle are displaced together.
    Half,
    /// Two thirds of the points, on one side of a plane, are displaced together.
    TwoThirds,
    /// The points on one side of a plane are turned about an axis in the plane.
    Hinge,
    /// The outermost point is displaced.
    Corner,
    /// The two outermost points are displaced together.
    TwoCorners,
    /// The points on one side of a plane are scaled about their centroid.
    Scaled,
    /// A random half of the points, which no plane separates, is displaced together.
    Scattered,
}

impl Bend {
    /// All kinds.
    pub const ALL: [Self; 8] = [
        Self::None,
        Self::Half,
        Self::TwoThirds,
        Self::Hinge,
        Self::Corner,
        Self::TwoCorners,
        Self::Scaled,
        Self::Scattered,
    ];

    /// The displacements of points `at`, the largest of length `size` (m).
    fn displacements(self, at: &[Vector3<f64>], size: f64, stream: &mut Stream) -> Vec<Vector3<f64>> {
        let (shift, normal) = (direction(stream), direction(stream));
        let along: Vec<f64> = at.iter().map(|at| at.dot(&normal)).collect();
        let mut sorted = along.clone();
        sorted.sort_by(f64::total_cmp);
        let n = at.len();
        let beyond = |fraction: f64| sorted[((n as f64 * fraction) as usize).min(n - 1)];
        let side = |from: f64, of: &dyn Fn(usize) -> Vector3<f64>| -> Vec<Vector3<f64>> {
            (0..n).map(|k| if along[k] >= from { of(k) } else { Vector3::zeros() }).collect()
        };
        let together = |_: usize| shift * size;
        match self {
            Self::None => vec![Vector3::zeros(); n],
            Self::Half => side(beyond(0.5), &together),
            Self::TwoThirds => side(beyond(1.0 / 3.0), &together),
            Self::Corner => side(sorted[n - 1], &together),
            Self::TwoCorners => side(sorted[n - 2], &together),
            Self::Hinge => {
                let (from, axis) = (beyond(0.5), normal.cross(&shift).normalize());
                largest(side(from, &|k| axis.cross(&(at[k] - normal * from))), size)
            }
            Self::Scaled => {
                let from = beyond(0.5);
                let part: Vec<Vector3<f64>> = (0..n).filter(|&k| along[k] >= from).map(|k| at[k]).collect();
                let centre = part.iter().sum::<Vector3<f64>>() / part.len() as f64;
                largest(side(from, &|k| at[k] - centre), size)
            }
            Self::Scattered => {
                let mut order: Vec<usize> = (0..n).collect();
                (1..n).rev().for_each(|k| order.swap(k, stream.below(k + 1)));
                let mut all = vec![Vector3::zeros(); n];
                order[..n / 2].iter().for_each(|&k| all[k] = shift * size);
                all
            }
        }
    }
}

/// The displacements scaled so that the largest has the length `size`.
fn largest(mut all: Vec<Vector3<f64>>, size: f64) -> Vec<Vector3<f64>> {
    let max = all.iter().map(|v| v.norm()).fold(f64::MIN_POSITIVE, f64::max);
    all.iter_mut().for_each(|v| *v *= size / max);
    all
}

fn direction(stream: &mut Stream) -> Vector3<f64> {
    stream.normal3(1.0).normalize()
}

/// A model of the size of 2 × 1.6 × 1.2 m at 3 m, its measured points and the pose of the part that is not displaced.
#[derive(Debug, Clone)]
pub struct BentObject {
    /// The model, as surveyed.
    pub model: Vec<ModelPoint>,
    /// The measured points, in the order of the model.
    pub cloud: Vec<MeasuredPoint>,
    /// The true pose.
    pub object_from_camera: Transform<Object, Camera>,
}

/// Object `number` of `points` points, bent by at most `size` (m).
///
/// The noise of a coordinate is `sigma` (m) across and twice that along the line of sight.
pub fn bent_object(bend: Bend, points: usize, sigma: f64, size: f64, number: u64) -> BentObject {
    let mut stream = Stream::new(43, number, points as u64, Purpose::Survey);
    let half = [1.0, 0.8, 0.6];
    let at: Vec<Vector3<f64>> =
        (0..points).map(|_| Vector3::from(half.map(|half| stream.between(-half, half)))).collect();
    let turn = UnitQuaternion::from_scaled_axis(stream.normal3(1.5));
    let object_from_camera = Transform::new(turn, turn * Vector3::new(0.0, 0.0, -3.0));
    let off = bend.displacements(&at, size, &mut stream);
    let cloud = at.iter().zip(&off).map(|(at, off)| {
        let noise = Vector3::new(sigma, sigma, 2.0 * sigma);
        let mut position: UncertainPoint<Camera> =
            UncertainPoint::isotropic(object_from_camera.inverse() * Point::from(at + off), sigma);
        position.covariance = nalgebra::Matrix3::from_diagonal(&noise.component_mul(&noise));
        position.at = position.at + noise.component_mul(&stream.normal3(1.0));
        MeasuredPoint { position, pixels: None }
    });
    BentObject {
        cloud: cloud.collect(),
        model: at.iter().enumerate().map(|(k, at)| ModelPoint::exact(format!("P{k}"), Point::from(*at))).collect(),
        object_from_camera,
    }
}
