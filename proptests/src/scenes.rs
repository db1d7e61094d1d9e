//! Inputs of solvers: identified points with their true pose.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use seafix_geometry::{Camera, Object, Pixel, Point, StereoRig, Transform, UncertainPixels, UncertainPoint};
use seafix_referencing::{Observation, Observations};

use crate::{
    poses::{pose, rotation, vector},
    rigs,
};

/// Identified points, their rig if any, and the true pose.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The points.
    pub points: Vec<Observation>,
    /// The rig.
    pub rig: Option<StereoRig>,
    /// The true pose of the camera.
    pub object_from_camera: Transform<Object, Camera>,
}

impl Scene {
    /// The observations for a solver.
    pub fn observations(&self) -> Observations<'_> {
        Observations { points: self.points.clone(), edges: Vec::new(), rig: self.rig.as_ref() }
    }

    /// The sum of squared residuals C·H − P (m²).
    pub fn squares(&self, object_from_camera: &Transform<Object, Camera>) -> f64 {
        self.points.iter().map(|point| point.residual(object_from_camera).norm_squared()).sum()
    }

    /// The scene with a moved camera: `motion` maps the old camera's coordinates to the new one's. Only for points
    /// without pixels, which would change.
    #[must_use]
    pub fn camera_moved(&self, motion: &Transform<Camera, Camera>) -> Self {
        let r = motion.rotation_matrix();
        let mut moved = self.clone();
        moved.rig = None;
        moved.object_from_camera = self.object_from_camera * motion.inverse();
        for point in &mut moved.points {
            point.pixels = None;
            point.measured.at = *motion * point.measured.at;
            point.measured.covariance = r * point.measured.covariance * r.transpose();
        }
        moved
    }

    /// The scene with the object moved in the object's frame.
    #[must_use]
    pub fn object_moved(&self, motion: &Transform<Object, Object>) -> Self {
        let mut moved = self.clone();
        moved.object_from_camera = *motion * self.object_from_camera;
        for point in &mut moved.points {
            point.model = *motion * point.model;
        }
        moved
    }

    /// The mirrored scene: measured points reflected in the camera's x.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.rig = None;
        for point in &mut mirrored.points {
            point.pixels = None;
            point.measured.at.coords.x *= -1.0;
        }
        mirrored
    }
}

/// Model points about the object's origin: 3 to 16, 0.6 to 6 m in extent, planar or not, with a second extent of at
/// least 0.2 of the first.
pub fn model() -> impl Strategy<Value = Vec<Vector3<f64>>> {
    let flat = prop::bool::weighted(0.25);
    (prop::collection::vec(vector(1.0), 3..=16), rotation(), flat, 0.3..3.0)
        .prop_map(|(points, tilt, flat, scale): (Vec<_>, _, bool, f64)| {
            let flatten = Vector3::new(1.0, 0.8, if flat { 0.0 } else { 0.6 });
            points.into_iter().map(|p: Vector3<f64>| tilt * p.component_mul(&flatten) * scale).collect::<Vec<_>>()
        })
        .prop_filter("nearly a line", |points| {
            let [min, first] = [1, 2].map(|k| extents(points)[k].sqrt());
            min > 0.2 * first
        })
}

/// The eigenvalues of the scatter of points about their centroid (m²), ascending.
pub fn extents(points: &[Vector3<f64>]) -> [f64; 3] {
    let centre: Vector3<f64> = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
    let mut values: [f64; 3] = scatter.symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    values
}

/// The corners of a box of 1 × 0.8 × 0.6 m, 4 m before the camera, without pixels and noise: the easiest scene.
pub fn corners() -> Scene {
    let truth = Transform::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -4.0));
    let points = (0..8).map(|i| {
        let model = Point::new(f64::from(i & 1), 0.8 * f64::from(i >> 1 & 1), 0.6 * f64::from(i >> 2));
        Observation {
            measured: UncertainPoint::isotropic(truth.inverse() * model, 1e-3),
            pixels: None,
            model,
            model_sigma: 0.0,
        }
    });
    Scene { points: points.collect(), rig: None, object_from_camera: truth }
}

/// Points without pixels, from a camera anywhere within ±`reach` (m), with a noise of up to `noise` (m) on each
/// coordinate, and three times that in depth.
pub fn bare(reach: f64, noise: f64) -> impl Strategy<Value = Scene> {
    let noises = prop::collection::vec(vector(1.0), 16);
    (model(), pose::<Object, Camera>(reach), noises, 0.5..2.0).prop_map(move |(model, truth, noises, trust)| {
        let shape = Vector3::new(1.0, 1.0, 3.0);
        let sigma: Vector3<f64> = shape * (noise.max(1e-4) * trust);
        let covariance = Matrix3::from_diagonal(&sigma.component_mul(&sigma));
        let points = model.iter().zip(&noises).map(|(p, e)| Observation {
            measured: UncertainPoint {
                at: truth.inverse() * Point::from(*p) + e.component_mul(&shape) * noise,
                covariance,
            },
            pixels: None,
            model: Point::from(*p),
            model_sigma: 0.0,
        });
        Scene { points: points.collect(), rig: None, object_from_camera: truth }
    })
}

/// Points of a stereo rig at 4 to 12 m, triangulated from pixels with a noise of up to `noise` (px). At least three
/// points, as far from a line as those without pixels.
pub fn seen(noise: f64) -> impl Strategy<Value = Scene> {
    let noises = prop::collection::vec(prop::array::uniform4(-1.0..=1.0f64), 16);
    (rigs::rectified(), model(), rotation(), 4.0..12.0, noises).prop_filter_map(
        "not seen by both cameras",
        move |(rig, model, r, distance, noises)| {
            let camera_from_object = Transform::<Camera, Object>::new(r, Vector3::new(0.0, 0.0, distance));
            let mut points = Vec::new();
            for (p, e) in model.iter().zip(&noises) {
                let Some(mut pixels) = rig.sees(&(camera_from_object * Point::from(*p)), 0.0) else { continue };
                let off = |pixel: Pixel, u: f64, v: f64| Pixel { u: pixel.u + u * noise, v: pixel.v + v * noise };
                (pixels.left, pixels.right) = (off(pixels.left, e[0], e[1]), off(pixels.right, e[2], e[3]));
                let pixels = UncertainPixels::independent(pixels, noise.max(0.05));
                let found = rig.triangulate(&pixels).ok()?;
                points.push(Observation {
                    measured: UncertainPoint { at: found.point, covariance: found.covariance },
                    pixels: Some(pixels),
                    model: Point::from(*p),
                    model_sigma: 1e-3,
                });
            }
            let spread = |places: Vec<Vector3<f64>>| {
                let [_, second, first] = extents(&places);
                places.len() >= 3 && second > 0.04 * first
            };
            let solid = spread(points.iter().map(|point| point.model.coords).collect())
                && spread(points.iter().map(|point| point.measured.at.coords).collect());
            solid.then(|| Scene { points, rig: Some(rig), object_from_camera: camera_from_object.inverse() })
        },
    )
}
