//! Grompone's detector of segments.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::Pinhole;
use serde::{Deserialize, Serialize};

use super::{
    detector::{Segment, SegmentDetector},
    gradients::Gradients,
    nfa::log_nfa,
    region::{Rectangle, Regions},
    straight::Straight,
};
use crate::{image::Image, workspace::Workspace};

/// The line segment detector with a-contrario validation.
///
/// Regions of connected places whose gradients agree within an angle τ grow from the steepest place on. A region's
/// rectangle, along its main axis of inertia, is a segment if its number of false alarms is at most
/// 10^`log-nfa`: N · P(k of n places aligned by chance), with p = τ/π and N = 11 (W·H)^{5/2} rectangles. The image is
/// binned first: binning halves the noise and leaves a quarter of the places, and the fit over the full image follows.
///
/// Limits: edges closer than three binned pixels merge; a curved outline becomes several chords.
///
/// Source: Grompone von Gioi, Jakubowicz, Morel and Randall, *LSD: a line segment detector*, IPOL 2012.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct AContrario {
    /// Side of the squares of pixels that are averaged, 1 to 4.
    pub binning: usize,
    /// Tolerance of a gradient's direction (degrees), 5 to 45.
    pub angle_deg: f64,
    /// Minimum gradient (grey levels, from one binned pixel to the next); 0 to 255.
    pub gradient: f64,
    /// Minimum gradient as a multiple of the image's median gradient; it adapts to haze and noise.
    pub median: f64,
    /// Minimum fraction of a rectangle's places that are aligned, 0 to 1.
    pub density: f64,
    /// Minimum length of a segment in the image (px).
    pub min_length: f64,
    /// Maximum logarithm to base 10 of the number of false alarms.
    pub log_nfa: f64,
}

impl Default for AContrario {
    fn default() -> Self {
        Self { binning: 2, angle_deg: 22.5, gradient: 1.0, median: 1.5, density: 0.6, min_length: 16.0, log_nfa: 0.0 }
    }
}

impl Component for AContrario {
    const NAME: &'static str = "a-contrario";
    const SUMMARY: &'static str = "regions of aligned gradients, accepted by their number of false alarms";
    const SOURCE: &'static str =
        "Grompone von Gioi, Jakubowicz, Morel and Randall, LSD: a line segment detector, IPOL 2012";

    fn check(&self) -> Result<(), String> {
        in_range((1..=4).contains(&self.binning), "binning", self.binning, "1 to 4")?;
        in_range((5.0..=45.0).contains(&self.angle_deg), "angle-deg", self.angle_deg, "5 to 45")?;
        in_range((0.0..=255.0).contains(&self.gradient), "gradient", self.gradient, "0 to 255")?;
        in_range((0.0..=100.0).contains(&self.median), "median", self.median, "0 to 100")?;
        in_range((0.0..=1.0).contains(&self.density), "density", self.density, "0 to 1")?;
        in_range((4.0..=1e4).contains(&self.min_length), "min-length", self.min_length, "4 to 10000")?;
        in_range((-100.0..=10.0).contains(&self.log_nfa), "log-nfa", self.log_nfa, "-100 to 10")
    }
}

/// The working memory.
#[derive(Debug, Default)]
struct Kept {
    field: Gradients,
    straight: Straight,
    regions: Regions,
}

impl SegmentDetector for AContrario {
    fn detect_into(&self, image: &Image, camera: &Pinhole, work: &mut Workspace, found: &mut Vec<Segment>) {
        found.clear();
        let Kept { field, straight, regions } = work.get::<Kept>();
        field.fill(image, self.binning, self.gradient as f32, self.median as f32);
        straight.fill(camera, self.binning, field.width, field.height);
        regions.reset(field.unit.len());
        let pixels = (field.width * field.height) as f64;
        let log_tests = 2.5 * libm::log10(pixels.max(1.0)) + libm::log10(11.0);
        let aligned = libm::cos(self.angle_deg.to_radians()) as f32;
        // Fewer places are not certain enough even if all are aligned.
        let certain = (log_tests - self.log_nfa) / -libm::log10(self.angle_deg / 180.0);
        let minimum = certain.max(self.min_length / self.binning as f64);
        for &seed in &field.order {
            if !regions.is_free(seed) {
                continue;
            }
            regions.grow(field, straight, seed, aligned);
            if (regions.members.len() as f64) < minimum {
                continue;
            }
            let Some((rectangle, log_nfa)) = self.best(regions, log_tests) else { continue };
            let ends = [0, 1].map(|end| straight.direction(rectangle.end(end)));
            found.push(Segment { ends, log_nfa });
        }
    }
}

impl AContrario {
    /// The rectangle of the region with the fewest false alarms, and their logarithm.
    ///
    /// `None` if it is too short, too sparse or not certain enough. A sparse region is shrunk around its seed.
    fn best(&self, regions: &mut Regions, log_tests: f64) -> Option<(Rectangle, f64)> {
        let pixel = self.binning as f64;
        loop {
            let (rectangle, nfa) = self.narrowest(regions, log_tests);
            if rectangle.length() < self.min_length {
                return None;
            }
            if rectangle.inside as f64 >= self.density * rectangle.places(pixel) {
                return (nfa <= self.log_nfa).then_some((rectangle, nfa));
            }
            // The factor is the source's.
            regions.shrink(0.75 * regions.radius());
        }
    }

    /// The rectangle of the width with the fewest false alarms.
    fn narrowest(&self, regions: &Regions, log_tests: f64) -> (Rectangle, f64) {
        let pixel = self.binning as f64;
        let probability = self.angle_deg / 180.0;
        let nfa = |r: &Rectangle| log_nfa(log_tests, r.places(pixel), r.inside as f64, probability);
        let full = regions.rectangle(pixel);
        let mut best = (full, nfa(&full));
        for step in 1..=4 {
            let half_width = full.half_width * (1.0 - 0.2 * f64::from(step));
            if half_width < 0.75 * pixel {
                break;
            }
            let narrowed = regions.narrowed(&full, half_width);
            let own = nfa(&narrowed);
            if own < best.1 {
                best = (narrowed, own);
            }
        }
        best
    }
}
