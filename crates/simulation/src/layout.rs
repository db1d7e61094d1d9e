//! Layouts of points before a stereo rig, without a scene, for the Monte Carlo of solvers.

use nalgebra::{Matrix3, Vector3};
use seafix_component::Settings;
use seafix_geometry::{
    Camera, MeasuredPoint, Object, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels, UncertainPoint,
};
use serde::{Deserialize, Serialize};

use crate::{
    dive::{BadDive, VirtualRig},
    stream::{Purpose, Stream},
};

/// The distribution of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Spread: over the central 70 % of width and height of the common field of view, with depths within ±10 %.
    #[default]
    Spread,
    /// Compact: in a box of 0.5 × 0.4 × 0.3 m with a random rotation.
    Compact,
}

/// A layout of model points before a rig, with its measurement noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Layout {
    /// Distribution of the points.
    pub shape: Shape,
    /// Number of points.
    pub points: usize,
    /// Seed of the layout: equal numbers give equal layouts.
    pub number: u64,
    /// Mean depth (m).
    pub distance: f64,
    /// Standard deviation of each pixel coordinate in each image (px).
    pub sigma_px: f64,
    /// Standard deviation of each coordinate of a model point (m), sampled anew in each draw.
    pub model_sigma: f64,
    /// The stereo rig.
    pub rig: VirtualRig,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            shape: Shape::Spread,
            points: 13,
            number: 0,
            distance: 3.25,
            sigma_px: 0.2,
            model_sigma: 0.0,
            rig: VirtualRig::default(),
        }
    }
}

/// A placed layout: the surveyed model and the true pose.
#[derive(Debug, Clone)]
pub struct Placed {
    settings: Layout,
    seed: u64,
    /// The stereo rig.
    pub rig: StereoRig,
    /// The model points.
    pub model: Vec<Point<Object>>,
    /// The true pose.
    pub object_from_camera: Transform<Object, Camera>,
}

/// Minimum ratio of the second extent of a layout to the first; below it the points are nearly collinear.
const MIN_RATIO: f64 = 0.15;
/// Maximum number of layouts that are tried.
const MAX_TRIES: usize = 10_000;

impl Layout {
    /// Places the points with this `seed`.
    ///
    /// # Errors
    /// [`BadDive`] for an invalid rig, or if no layout is visible in both images.
    pub fn place(&self, seed: u64) -> Result<Placed, BadDive> {
        let rig = self.rig.build()?;
        let mut stream = Stream::new(seed, self.number, 0, Purpose::View);
        for _ in 0..MAX_TRIES {
            let places = match self.shape {
                Shape::Spread => self.spread(&rig, &mut stream),
                Shape::Compact => self.compact(&rig, &mut stream),
            };
            let Some(places) = places.filter(|places| is_wide(places)) else { continue };
            let centre = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
            let turn = rotation(&mut stream);
            let object_from_camera = Transform::new(turn, -(turn * centre) + stream.normal3(0.1));
            let model = places.iter().map(|at| object_from_camera * Point::from(*at)).collect();
            return Ok(Placed { settings: self.clone(), seed, rig, model, object_from_camera });
        }
        Err(BadDive::Layout { points: self.points, distance: self.distance })
    }

    fn spread(&self, rig: &StereoRig, stream: &mut Stream) -> Option<Vec<Vector3<f64>>> {
        const FRACTION: f64 = 0.7;
        let [width, height] = rig.left().size().map(|n| f64::from(n - 1));
        let one = |_| {
            let depth = self.distance * stream.between(0.9, 1.1);
            // The common field of view at this depth begins at the left border of the right image.
            let hidden = self.rig.focal * self.rig.baseline / depth;
            let across = hidden + (width - hidden) * (0.5 + FRACTION * (stream.unit() - 0.5));
            let pixel = Pixel { u: across, v: height * (0.5 + FRACTION * (stream.unit() - 0.5)) };
            let at = rig.left().normalize(&pixel)?.push(1.0) * depth;
            rig.sees(&Point::from(at), 0.0).map(|_| at)
        };
        (0..self.points).map(one).collect()
    }

    fn compact(&self, rig: &StereoRig, stream: &mut Stream) -> Option<Vec<Vector3<f64>>> {
        const SIZE: [f64; 3] = [0.5, 0.4, 0.3];
        let turn = rotation(stream);
        let centre = Vector3::new(0.5 * self.rig.baseline, 0.0, self.distance);
        let one = |_| {
            let within = Vector3::from(SIZE.map(|size| size * (stream.unit() - 0.5)));
            let at = centre + turn * within;
            rig.sees(&Point::from(at), 0.0).map(|_| at)
        };
        (0..self.points).map(one).collect()
    }
}

impl Placed {
    /// Generates one draw: the points in the order of the model, triangulated from noisy pixels. `None` if noise
    /// prevents the triangulation of a point.
    pub fn draw(&self, draw: u64) -> Option<Vec<MeasuredPoint>> {
        let mut stream = Stream::new(self.seed, self.settings.number, draw, Purpose::Points);
        let (sigma, by_model) = (self.settings.sigma_px, self.settings.model_sigma);
        let measure = |model: &Point<Object>| {
            let truly = *model + stream.normal3(by_model);
            // A covariance of zero would claim an exact measurement.
            self.measure(&truly, sigma.max(1e-3), || sigma * stream.normal())
        };
        self.model.iter().map(measure).collect()
    }

    /// A wrong match of a model point, with the noise of all others.
    ///
    /// It is uniform over the visible part of the gate of this half-size (m) about the point, along the camera's axes.
    /// Points are sampled until one can be triangulated.
    ///
    /// # Panics
    /// Never: the true point is in view, and with it a part of any gate.
    pub fn elsewhere(&self, model: &Point<Object>, gate: f64, stream: &mut Stream) -> MeasuredPoint {
        let (place, sigma) = (self.object_from_camera.inverse() * *model, self.settings.sigma_px);
        let mut draw = || {
            let other = place + Vector3::from_fn(|_, _| stream.between(-gate, gate));
            self.rig.sees(&other, 0.0)?;
            self.measure(&(self.object_from_camera * other), sigma.max(1e-3), || sigma * stream.normal())
        };
        (0..MAX_TRIES).find_map(|_| draw()).expect("a part of the gate is in view")
    }

    /// The points without noise, with the covariance of pixel errors of standard deviation `sigma_px`.
    ///
    /// # Panics
    /// Never: every point of the layout lies before both cameras.
    pub fn exact(&self, sigma_px: f64) -> Vec<MeasuredPoint> {
        let measure = |model: &Point<Object>| self.measure(model, sigma_px, || 0.0).expect("the layout is in view");
        self.model.iter().map(measure).collect()
    }

    fn measure(&self, at: &Point<Object>, sigma: f64, mut noise: impl FnMut() -> f64) -> Option<MeasuredPoint> {
        let exact = self.rig.project(&(self.object_from_camera.inverse() * *at))?;
        let mut disturbed = |p: Pixel| Pixel { u: p.u + noise(), v: p.v + noise() };
        let seen = StereoPixels { left: disturbed(exact.left), right: disturbed(exact.right) };
        let pixels = UncertainPixels::independent(seen, sigma);
        let found = self.rig.triangulate(&pixels).ok()?;
        let position = UncertainPoint { at: found.point, covariance: found.covariance };
        Some(MeasuredPoint { position, pixels: Some(pixels) })
    }
}

/// A uniform random rotation from a normal quaternion (Shoemake, *Uniform random rotations*, 1992).
fn rotation(stream: &mut Stream) -> nalgebra::UnitQuaternion<f64> {
    let imaginary = stream.normal3(1.0);
    nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::from_parts(stream.normal(), imaginary))
}

/// Whether the second extent of the points exceeds 0.15 of the first.
fn is_wide(places: &[Vector3<f64>]) -> bool {
    let centre = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    let scatter: Matrix3<f64> = places.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
    let mut values: [f64; 3] = scatter.symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    values[1] > MIN_RATIO * MIN_RATIO * values[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_seen_where_the_layout_has_them() {
        for shape in [Shape::Spread, Shape::Compact] {
            for number in 0..20 {
                let layout = Layout { shape, number, points: 8, distance: 2.0, ..Layout::default() };
                let placed = layout.place(1).unwrap();
                let places: Vec<_> = placed.model.iter().map(|p| placed.object_from_camera.inverse() * *p).collect();
                assert_eq!((places.len(), placed.draw(1).unwrap().len()), (8, 8));
                assert!(places.iter().all(|at| placed.rig.sees(at, 0.0).is_some()));
                let reach = places.iter().flat_map(|a| places.iter().map(|b| a.distance(b))).fold(0.0, f64::max);
                let deep = places.iter().all(|at| (at.coords.z / 2.0 - 1.0).abs() <= 0.1 + 1e-9);
                match shape {
                    Shape::Spread => assert!(deep),
                    Shape::Compact => assert!(reach < 0.71),
                }
            }
        }
    }

    #[test]
    fn without_noise_every_draw_is_the_truth() {
        let placed = Layout { sigma_px: 0.0, ..Layout::default() }.place(3).unwrap();
        for (seen, model) in placed.draw(5).unwrap().iter().zip(&placed.model) {
            assert!((placed.object_from_camera * seen.position.at).distance(model) < 1e-10);
        }
        let noisy = Layout::default().place(3).unwrap();
        assert_ne!(noisy.draw(1).unwrap()[0], noisy.draw(2).unwrap()[0]);
        assert_eq!(noisy.draw(1).unwrap(), noisy.draw(1).unwrap());
    }

    #[test]
    fn a_wrong_match_lies_in_the_gate_and_in_view() {
        let placed = Layout { sigma_px: 0.0, ..Layout::default() }.place(3).unwrap();
        let mut stream = Stream::new(3, 0, 0, Purpose::Mismatches);
        let mut farthest: f64 = 0.0;
        for model in placed.model.iter().cycle().take(200) {
            let other = placed.elsewhere(model, 0.25, &mut stream).position.at;
            assert!(placed.rig.sees(&other, 0.0).is_some());
            farthest = farthest.max((other - placed.object_from_camera.inverse() * *model).amax());
        }
        assert!(farthest > 0.2 && farthest < 0.25 + 1e-9, "{farthest}");
    }

    #[test]
    fn a_layout_that_no_camera_sees_is_rejected() {
        assert!(Layout { distance: 0.2, shape: Shape::Compact, ..Layout::default() }.place(1).is_err());
    }
}
