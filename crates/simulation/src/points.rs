//! One view as noisy points: a detector's measurements without the image.

use seafix_component::Settings;
use seafix_geometry::{
    Camera, MeasuredPoint, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels, UncertainPoint, World,
};
use serde::{Deserialize, Serialize};

use crate::{
    stream::Stream,
    virtual_scene::{Corner, VirtualScene},
};

/// Measurement noise of points. The default follows the paper's figures, σ_d = √2·σ_px = 0.28 px; rendered images are
/// less noisy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PointNoise {
    /// Standard deviation of each pixel coordinate in each image (px), from 0 to 20.
    pub sigma_px: f64,
    /// Fraction of the visible corners that are measured, from 0 to 1.
    pub found: f64,
    /// Number of clutter points in a view, anywhere on seabed and objects; at most 100 000.
    pub clutter: usize,
}

impl PointNoise {
    /// Maximum number of clutter points in a view; all of a frame are in memory.
    pub(crate) const MAX_CLUTTER: usize = 100_000;
}

impl Default for PointNoise {
    fn default() -> Self {
        Self { sigma_px: 0.2, found: 0.9, clutter: 150 }
    }
}

/// The rig with its pose in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedRig<'a> {
    pub(crate) rig: &'a StereoRig,
    pub(crate) world_from_camera: Transform<World, Camera>,
}

impl PlacedRig<'_> {
    /// The positions of the left and the right camera.
    pub(crate) fn places(&self) -> [nalgebra::Vector3<f64>; 2] {
        let right = self.world_from_camera * self.rig.right_from_left().inverse();
        [self.world_from_camera.translation(), right.translation()]
    }

    /// The pixels of a corner that both cameras see at least `margin` (px) from the border.
    pub(crate) fn see(&self, scene: &VirtualScene, corner: &Corner, margin: f64) -> Option<StereoPixels> {
        let at = self.world_from_camera.inverse() * Point::from(corner.at);
        let pixels = self.rig.sees(&at, margin)?;
        self.places().iter().all(|from| scene.sees(from, corner)).then_some(pixels)
    }

    /// The stereo pixels of the surface point at `pixel` of the left image, if both cameras see it.
    fn project_visible(&self, scene: &VirtualScene, pixel: &Pixel) -> Option<StereoPixels> {
        let [left, right] = self.places();
        let direction = self.rig.left().normalize(pixel)?.push(1.0);
        let place = scene.seen(&left, &(self.world_from_camera.rotation() * direction))?;
        let pixels = self.rig.sees(&(self.world_from_camera.inverse() * place), 0.0)?;
        scene.clear(&right, &place.coords).then_some(pixels)
    }

    /// The measured points of the view, in random order.
    pub(crate) fn measure(&self, scene: &VirtualScene, noise: &PointNoise, stream: &mut Stream) -> Vec<MeasuredPoint> {
        let mut pixels = Vec::new();
        for corner in scene.bodies.iter().flat_map(|b| b.points.iter().chain(&b.distractors)) {
            if let Some(seen) = self.see(scene, corner, 0.0)
                && stream.unit() < noise.found
            {
                pixels.push(seen);
            }
        }
        let [width, height] = self.rig.left().size().map(|n| f64::from(n - 1));
        for _ in 0..noise.clutter {
            let pixel = Pixel { u: stream.between(0.0, width), v: stream.between(0.0, height) };
            pixels.extend(self.project_visible(scene, &pixel));
        }
        for k in (1..pixels.len()).rev() {
            pixels.swap(k, stream.below(k + 1));
        }
        pixels
            .iter()
            .filter_map(|exact| {
                let mut disturbed = |p: &Pixel| Pixel {
                    u: p.u + noise.sigma_px * stream.normal(),
                    v: p.v + noise.sigma_px * stream.normal(),
                };
                let seen = StereoPixels { left: disturbed(&exact.left), right: disturbed(&exact.right) };
                // A covariance of zero would claim an exact measurement.
                let pixels = UncertainPixels::independent(seen, noise.sigma_px.max(1e-3));
                let found = self.rig.triangulate(&pixels).ok()?;
                let position = UncertainPoint { at: found.point, covariance: found.covariance };
                Some(MeasuredPoint { position, pixels: Some(pixels) })
            })
            .collect()
    }
}
