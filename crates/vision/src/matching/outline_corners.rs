//! Corners of outlines, matched by the side that both images show.

use nalgebra::Matrix4;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{MeasuredPoint, Pixel, StereoPixels, StereoRig, UncertainPixels};
use serde::{Deserialize, Serialize};

use super::{
    epipolar::{Band, Limits},
    nearest::Nearest,
};
use crate::{
    describe::bilinear,
    image::Image,
    keypoint::Keypoint,
    locate::{Junction, Locator, UncertainPixel},
    triangulate::Triangulator,
};

/// The settings of corners of outlines (occluding contours).
///
/// Behind a corner of an object's outline lies another background in each image, so that descriptors of the whole
/// neighbourhood differ and the corner has no match. Its own side is the same in both. Corners that are in no point of
/// the cloud are compared by their levels in 24 directions: two corners are alike if a sector of adjacent directions
/// is and ends at an edge on both sides in both images, or if all directions are. A match is the best pair of both its
/// corners, by a margin.
///
/// Each corner is the fit of the locator or a junction of edges ([`Junction`]), and has its position and covariance in
/// each image: an alignment of the neighbourhoods would follow the backgrounds.
///
/// Limits: the directions are those of the images. Cameras that are rolled against each other show the same side in other
/// directions.
///
/// Source: Fusiello, Roberto and Trucco, *Efficient stereo with multiple windowing*, CVPR 1997 (windows on one side of
/// an occlusion).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OutlineCorners {
    /// Whether corners of outlines are matched.
    pub enabled: bool,
    /// Maximum number of key points in an image that are examined, the strongest of those in no point of the cloud.
    pub candidates: usize,
    /// Minimum angle of the sector that is alike (degrees).
    pub min_angle_deg: f64,
    /// Maximum RMS difference of the levels in one direction, as a fraction of the standard deviation of all levels
    /// around the corner with more contrast.
    pub max_difference: f64,
    /// Maximum ratio of the likeness of the second best pair to the best's; 1 disables the test.
    pub ratio: f64,
    /// Half-width of the epipolar band (px).
    pub epipolar_px: f64,
    /// Minimum depth (m).
    pub min_depth: f64,
    /// Standard deviation of the window of the junction at a key point without a fitted corner (px).
    pub junction_sigma: f64,
    /// Maximum ratio of the squared distances of a junction's edges along their normals and along their lines.
    pub junction_max_ratio: f64,
    /// Fraction of true corners that pass the χ² test of their distance from the epipolar line; 1: no test.
    pub confidence: f64,
}

impl Default for OutlineCorners {
    fn default() -> Self {
        Self {
            enabled: true,
            candidates: 100,
            min_angle_deg: 90.0,
            max_difference: 0.3,
            ratio: 0.8,
            epipolar_px: 1.0,
            min_depth: 0.1,
            junction_sigma: 2.5,
            junction_max_ratio: 0.2,
            confidence: 0.997,
        }
    }
}

/// One image with its key points and their corners.
#[derive(Debug, Clone, Copy)]
pub struct CornerView<'a> {
    /// The image.
    pub image: &'a Image,
    /// The key points.
    pub keypoints: &'a [Keypoint],
    /// The fitted corner at each key point, in their order.
    pub located: &'a [Option<UncertainPixel>],
}

/// The number of directions around a corner.
const DIRECTIONS: usize = 24;
/// The distances (px) of the levels in each direction: outside the corner's blur, inside a descriptor's window.
const RADII: [f64; 5] = [2.5, 4.0, 5.5, 7.0, 8.5];
/// The distance (px) below which two corners are the same.
const SAME: f64 = 1.0;
/// The distance (px) from a measured point's pixel within which a corner belongs to that point.
const TAKEN: f64 = 2.0;

impl OutlineCorners {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The name, value and valid range of a wrong setting.
    pub fn check(&self) -> Result<(), String> {
        let Self { candidates, min_angle_deg, max_difference, ratio, epipolar_px, min_depth, confidence, .. } = *self;
        in_range((1..=10_000).contains(&candidates), "candidates", candidates, "1 to 10000")?;
        in_range((30.0..=360.0).contains(&min_angle_deg), "min-angle-deg", min_angle_deg, "30 to 360 (degrees)")?;
        let difference = max_difference > 0.0 && max_difference <= 10.0;
        in_range(difference, "max-difference", max_difference, "above 0, at most 10")?;
        in_range(ratio > 0.0 && ratio <= 1.0, "ratio", ratio, "more than 0, at most 1")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        in_range(min_depth > 0.0 && min_depth.is_finite(), "min-depth", min_depth, "above 0")?;
        self.junction().check().map_err(|message| format!("junction-{message}"))?;
        let sure = confidence > 0.0 && confidence <= 1.0;
        in_range(sure, "confidence", confidence, "above 0, at most 1 (no test)")
    }

    fn junction(&self) -> Junction {
        Junction { sigma: self.junction_sigma, max_ratio: self.junction_max_ratio }
    }

    /// Adds the corners of both images that are in no point of the cloud.
    pub fn add_to(
        &self,
        cloud: &mut Vec<MeasuredPoint>,
        [left, right]: &[CornerView<'_>; 2],
        rig: &StereoRig,
        triangulator: &dyn Triangulator,
    ) {
        let seen = cloud.iter().filter_map(|point| point.pixels.as_ref());
        let (l, r): (Vec<Pixel>, Vec<Pixel>) = seen.map(|pixels| (pixels.at.left, pixels.at.right)).unzip();
        let corners = [self.corners(left, &l), self.corners(right, &r)];
        let pairs = self.pairs(&corners, rig, [self.min_depth, triangulator.rules().max_depth]);
        cloud.extend(pairs.iter().filter_map(|pair| triangulator.measured(rig, pair, self.confidence)));
    }

    /// The corners of one image that are none of the `taken` ones, each once, the strongest first.
    fn corners(&self, &CornerView { image, keypoints, located }: &CornerView<'_>, taken: &[Pixel]) -> Vec<Corner> {
        let free = |at: &Pixel| taken.iter().all(|taken| taken.distance(at) >= TAKEN);
        let mut known: Vec<(Keypoint, Option<UncertainPixel>)> =
            keypoints.iter().copied().zip(located.iter().copied()).collect();
        known.sort_by(|(a, _), (b, _)| b.response.total_cmp(&a.response));
        let known = known.into_iter().filter(|(keypoint, _)| free(&keypoint.at)).take(self.candidates);
        let (points, mut places): (Vec<Keypoint>, Vec<Option<UncertainPixel>>) = known.unzip();
        for (place, junction) in places.iter_mut().zip(self.junction().locate(image, &points)) {
            *place = place.or(junction);
        }
        let mut corners: Vec<Corner> = Vec::new();
        for (point, place) in points.into_iter().zip(places) {
            let Some(place) = place.filter(|place| free(&place.at)) else { continue };
            if corners.iter().all(|known| known.place.at.distance(&place.at) >= SAME) {
                corners.extend(Corner::of(image, Keypoint { at: place.at, ..point }, place));
            }
        }
        corners
    }

    /// The pairs of corners that are alike, in the order of the left ones.
    fn pairs(&self, [left, right]: &[Vec<Corner>; 2], rig: &StereoRig, depths: [f64; 2]) -> Vec<UncertainPixels> {
        let points = |corners: &[Corner]| corners.iter().map(|corner| corner.point).collect::<Vec<_>>();
        let mut band = Band::default();
        band.fill(&points(left), &points(right), rig, &Limits { px: self.epipolar_px, depths });
        let mut nearest = Nearest::default();
        nearest.reset(left.len(), right.len());
        for (i, corner) in left.iter().enumerate() {
            band.visit(i, |j| {
                if let Some(likeness) = self.likeness(corner, &right[j]) {
                    nearest.offer(i, j, 1.0 / likeness);
                }
            });
        }
        let pair = |left: &UncertainPixel, right: &UncertainPixel| {
            let mut covariance = Matrix4::zeros();
            covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&left.covariance);
            covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&right.covariance);
            UncertainPixels { at: StereoPixels { left: left.at, right: right.at }, covariance }
        };
        let clear = nearest.mutual().filter(|found| found.clear(self.ratio as f32));
        clear.map(|found| pair(&left[found.left].place, &right[found.right].place)).collect()
    }

    /// The likeness of two corners: the sum over the best sector of 1 − d, with each direction's difference d as a
    /// fraction of the maximum.
    ///
    /// A sector has the minimum angle and ends at an edge on both sides, in both images: backgrounds that are alike by
    /// chance end anywhere. `None` without a sector.
    fn likeness(&self, one: &Corner, other: &Corner) -> Option<f32> {
        let max = self.max_difference as f32 * one.contrast.max(other.contrast);
        let alike: [f32; DIRECTIONS] =
            std::array::from_fn(|k| 1.0 - difference(&one.levels[k], &other.levels[k]) / max);
        let min = libm::ceil(self.min_angle_deg / 360.0 * DIRECTIONS as f64) as usize;
        if alike.iter().all(|alike| *alike > 0.0) {
            return Some(alike.iter().sum());
        }
        let edge = |inside: usize, outside: usize| {
            let of =
                |corner: &Corner| difference(&corner.levels[inside % DIRECTIONS], &corner.levels[outside % DIRECTIONS]);
            of(one) > max && of(other) > max
        };
        let begins = |start: &usize| alike[(start + DIRECTIONS - 1) % DIRECTIONS] <= 0.0;
        let sector = |start: usize| {
            let along = (0..DIRECTIONS).map(|k| alike[(start + k) % DIRECTIONS]).take_while(|alike| *alike > 0.0);
            let (count, sum) = along.fold((0, 0.0), |(count, sum), alike| (count + 1, sum + alike));
            // The direction along an edge shows both sides.
            let bounded = (min..=DIRECTIONS - 3).contains(&count)
                && edge(start + 1, start + DIRECTIONS - 2)
                && edge(start + count + DIRECTIONS - 2, start + count + 1);
            bounded.then_some(sum)
        };
        (0..DIRECTIONS).filter(begins).filter_map(sector).max_by(f32::total_cmp)
    }
}

/// The RMS difference of two directions.
fn difference(one: &[f32; RADII.len()], other: &[f32; RADII.len()]) -> f32 {
    let squares: f32 = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / RADII.len() as f32).sqrt()
}

/// A corner with the levels around it.
#[derive(Debug)]
struct Corner {
    point: Keypoint,
    place: UncertainPixel,
    levels: [[f32; RADII.len()]; DIRECTIONS],
    /// The standard deviation of the levels.
    contrast: f32,
}

impl Corner {
    /// `None` too close to the border, and if all levels are equal.
    fn of(image: &Image, point: Keypoint, place: UncertainPixel) -> Option<Self> {
        let reach = RADII[RADII.len() - 1];
        let within = |at: f64, size: usize| at >= reach && at + reach <= (size - 1) as f64;
        if !(within(place.at.u, image.width()) && within(place.at.v, image.height())) {
            return None;
        }
        let levels: [[f32; RADII.len()]; DIRECTIONS] = std::array::from_fn(|k| {
            let (sine, cosine) = libm::sincos(k as f64 * std::f64::consts::TAU / DIRECTIONS as f64);
            RADII.map(|radius| {
                let (u, v) = (place.at.u + radius * cosine, place.at.v + radius * sine);
                bilinear(image.pixels(), image.width(), u as f32, v as f32)
            })
        });
        let n = (DIRECTIONS * RADII.len()) as f32;
        let mean = levels.iter().flatten().sum::<f32>() / n;
        let squares: f32 = levels.iter().flatten().map(|level| (level - mean) * (level - mean)).sum();
        let contrast = (squares / n).sqrt();
        (contrast > 0.0).then_some(Self { point, place, levels, contrast })
    }
}
