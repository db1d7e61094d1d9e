//! The detector of segments by edge drawing.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::Pinhole;
use serde::{Deserialize, Serialize};

use super::{
    chain::{Chord, Link, is_ridge, links, walk},
    detector::{Segment, SegmentDetector},
    gradients::Gradients,
    nfa::log_nfa,
    straight::Straight,
};
use crate::{image::Image, workspace::Workspace};

/// The detector of segments in chains of the steepest places.
///
/// From each place that is the steepest across its edge a chain is drawn along the edge, in both directions. A part of
/// a chain is straight while its places lie within a tolerance of their line of least squares, and is a segment if its
/// number of false alarms, N · P(k of n places aligned by chance), is at most 10^`log-nfa`, with N = (W·H)² pairs of
/// ends.
///
/// Limits: a chain ends where noise breaks the ridge, so soft edges become several segments.
///
/// Source: Akinlar and Topal, *EDLines: a real-time line segment detector with a false detection control*, Pattern
/// Recognition Letters 2011; Suárez, Buenaposada and Baumela, *ELSED*, Pattern Recognition 2022.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct EdgeDrawing {
    /// Side of the squares of pixels that are averaged, 1 to 4.
    pub binning: usize,
    /// Tolerance of a gradient's direction (degrees), 5 to 45.
    pub angle_deg: f64,
    /// Minimum gradient (grey levels, from one binned pixel to the next), 0 to 255.
    pub gradient: f64,
    /// Minimum gradient as a multiple of the image's median gradient, 0 to 100.
    pub median: f64,
    /// Maximum distance of a place from its line (binned pixels).
    pub tolerance: f64,
    /// Minimum length of a segment in the image (px).
    pub min_length: f64,
    /// Maximum logarithm to base 10 of the number of false alarms.
    pub log_nfa: f64,
}

impl Default for EdgeDrawing {
    fn default() -> Self {
        Self { binning: 2, angle_deg: 22.5, gradient: 1.0, median: 1.5, tolerance: 0.8, min_length: 16.0, log_nfa: 0.0 }
    }
}

impl Component for EdgeDrawing {
    const NAME: &'static str = "edge-drawing";
    const SUMMARY: &'static str = "straight parts of chains of the steepest places, accepted by their false alarms";
    const SOURCE: &'static str = "Akinlar and Topal, EDLines: a real-time line segment detector with a false detection \
                                  control, Pattern Recognition Letters 2011";

    fn check(&self) -> Result<(), String> {
        in_range((1..=4).contains(&self.binning), "binning", self.binning, "1 to 4")?;
        in_range((5.0..=45.0).contains(&self.angle_deg), "angle-deg", self.angle_deg, "5 to 45")?;
        in_range((0.0..=255.0).contains(&self.gradient), "gradient", self.gradient, "0 to 255")?;
        in_range((0.0..=100.0).contains(&self.median), "median", self.median, "0 to 100")?;
        in_range((0.1..=10.0).contains(&self.tolerance), "tolerance", self.tolerance, "0.1 to 10")?;
        in_range((4.0..=1e4).contains(&self.min_length), "min-length", self.min_length, "4 to 10000")?;
        in_range((-100.0..=10.0).contains(&self.log_nfa), "log-nfa", self.log_nfa, "-100 to 10")
    }
}

/// The working memory.
#[derive(Debug, Default)]
struct Kept {
    field: Gradients,
    straight: Straight,
    taken: Vec<bool>,
    places: Vec<usize>,
    other: Vec<usize>,
    links: Vec<Link>,
}

impl SegmentDetector for EdgeDrawing {
    fn detect_into(&self, image: &Image, camera: &Pinhole, work: &mut Workspace, found: &mut Vec<Segment>) {
        found.clear();
        let Kept { field, straight, taken, places, other, links: chain } = work.get::<Kept>();
        field.fill(image, self.binning, self.gradient as f32, self.median as f32);
        straight.fill(camera, self.binning, field.width, field.height);
        taken.clear();
        taken.resize(field.unit.len(), false);
        let aligned = libm::cos(self.angle_deg.to_radians());
        let log_tests = 2.0 * libm::log10(((field.width * field.height) as f64).max(1.0));
        let minimum = (self.min_length / self.binning as f64).ceil().max(4.0) as usize;
        for &seed in &field.order {
            let seed = seed as usize;
            if taken[seed] || !is_ridge(field, seed) {
                continue;
            }
            taken[seed] = true;
            let [gx, gy] = field.unit[seed];
            places.clear();
            other.clear();
            walk(field, taken, seed, [-gy, gx], aligned as f32, other);
            walk(field, taken, seed, [gy, -gx], aligned as f32, places);
            if places.len() + other.len() + 1 < minimum {
                continue;
            }
            places.reverse();
            places.push(seed);
            places.append(other);
            links(field, straight, places, chain);
            self.straight_parts(chain, minimum, |part, chord| {
                let k = part.iter().filter(|link| chord.is_aligned(link, aligned)).count();
                let log_nfa = log_nfa(log_tests, part.len() as f64, k as f64, self.angle_deg / 180.0);
                let ends = chord.ends(part).map(|end| straight.direction(end));
                if log_nfa <= self.log_nfa {
                    found.push(Segment { ends, log_nfa });
                }
            });
        }
    }
}

impl EdgeDrawing {
    /// Calls `emit` with each straight part of a chain of at least `least` places, and its line.
    fn straight_parts(&self, chain: &[Link], minimum: usize, mut emit: impl FnMut(&[Link], &Chord)) {
        let tolerance = self.tolerance * self.binning as f64;
        let mut start = 0;
        while start + minimum <= chain.len() {
            let mut chord = Chord::of(&chain[start..start + minimum]);
            let fits = |chord: &Chord, part: &[Link]| part.iter().all(|link| chord.distance(link) <= tolerance);
            if !fits(&chord, &chain[start..start + minimum]) {
                start += 1;
                continue;
            }
            let mut end = start + minimum;
            // The line is fitted again while the part grows by half, since a short part determines it badly.
            loop {
                let limit = chain.len().min(end + (end - start) / 2);
                let grown = chain[end..limit].iter().take_while(|link| chord.distance(link) <= tolerance).count();
                if grown == 0 {
                    break;
                }
                end += grown;
                chord = Chord::of(&chain[start..end]);
            }
            emit(&chain[start..end], &chord);
            start = end;
        }
    }
}
