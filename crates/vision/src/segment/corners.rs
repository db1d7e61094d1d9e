//! Corners where two measured edges meet.

use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2};
use seafix_component::{Settings, in_range};
use seafix_geometry::{
    Camera, MeasuredPoint, Pinhole, Pixel, Point, StereoPixels, StereoRig, StereoSegments, UncertainPixels,
};
use serde::{Deserialize, Serialize};

use super::{fit::FittedSegment, matcher::SegmentMatch};
use crate::triangulate::Triangulator;

/// The settings of corners that are intersections of straight edges.
///
/// The response of a corner detector peaks 1 to 2 px beside the true corner, and texture beside the edges disturbs a
/// fit of the corner's neighbourhood. The edges themselves are fitted over their whole length, so their intersection
/// is accurate to a tenth of a pixel. An intersection is a point of the scene only if both edges meet in space: its
/// pixels in both images must then lie on one epipolar line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct EdgeCorners {
    /// Whether corners are made from edges.
    pub enabled: bool,
    /// Maximum distance of the corner beyond the nearer end of each segment, as a fraction of the segment's length:
    /// texture and occlusion shorten segments.
    pub max_gap_fraction: f64,
    /// Minimum angle between the edges (degrees).
    pub min_angle_deg: f64,
    /// Maximum standard deviation of a corner in the image (px).
    pub max_sigma: f64,
    /// Fraction of true corners that pass the χ² test of their distance from the epipolar line.
    pub confidence: f64,
}

impl Default for EdgeCorners {
    fn default() -> Self {
        Self { enabled: true, max_gap_fraction: 1.0, min_angle_deg: 17.5, max_sigma: 1.0, confidence: 0.997 }
    }
}

impl EdgeCorners {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The name, value and valid range of a wrong setting.
    pub fn check(&self) -> Result<(), String> {
        let Self { enabled: _, max_gap_fraction, min_angle_deg, max_sigma, confidence } = *self;
        let fraction = (0.0..=10.0).contains(&max_gap_fraction);
        in_range(fraction, "max-gap-fraction", max_gap_fraction, "a number from 0 to 10")?;
        let angle = min_angle_deg > 0.0 && min_angle_deg <= 90.0;
        in_range(angle, "min-angle-deg", min_angle_deg, "above 0, at most 90 (degrees)")?;
        in_range(max_sigma > 0.0 && max_sigma <= 100.0, "max-sigma", max_sigma, "above 0, at most 100 (px)")?;
        let sure = confidence > 0.0 && confidence <= 1.0;
        in_range(sure, "confidence", confidence, "above 0, at most 1 (no test)")
    }

    /// Adds the corners of the matched segments of both images to a cloud, each triangulated as its other points are.
    ///
    /// A corner and a point of the cloud that agree within their covariances are one; the more accurate one stays.
    /// Corners at both ends of an edge share its errors, which their covariances do not express.
    pub fn add_to(
        &self,
        cloud: &mut Vec<MeasuredPoint>,
        segments: [&[FittedSegment]; 2],
        matches: &[SegmentMatch],
        rig: &StereoRig,
        triangulator: &dyn Triangulator,
    ) {
        let pairs = self.pairs(rig, segments, matches);
        for corner in pairs.iter().filter_map(|pair| triangulator.measured(rig, pair, self.confidence)) {
            let better = |point: &MeasuredPoint| agree(point, &corner) && spread(point) <= spread(&corner);
            if !cloud.iter().any(better) {
                cloud.retain(|point| !agree(point, &corner));
                cloud.push(corner);
            }
        }
    }

    /// The pixels of the corners of matched segments, the most accurate first; each corner once.
    ///
    /// The offsets of an edge in both images are correlated, and with them the pixels of a corner:
    /// Σ = B C Bᵀ, with C the covariance of the four lines' offsets at the corner and B their intersection.
    fn pairs(
        &self,
        rig: &StereoRig,
        [left, right]: [&[FittedSegment]; 2],
        matches: &[SegmentMatch],
    ) -> Vec<UncertainPixels> {
        let mut all = Vec::new();
        for (i, first) in matches.iter().enumerate() {
            for second in &matches[..i] {
                let of = |found: &SegmentMatch| [&left[found.left], &right[found.right]];
                all.extend(self.corner(rig, of(first), of(second)));
            }
        }
        all.sort_by(|a, b| a.covariance.trace().total_cmp(&b.covariance.trace()));
        let mut kept: Vec<UncertainPixels> = Vec::new();
        for corner in all {
            if kept.iter().all(|earlier| earlier.at.left.distance(&corner.at.left) >= SAME) {
                kept.push(corner);
            }
        }
        kept
    }

    /// The corner of two edges, each given by its segments in the left and the right image.
    fn corner(&self, rig: &StereoRig, a: [&FittedSegment; 2], b: [&FittedSegment; 2]) -> Option<UncertainPixels> {
        let left = self.meeting(rig.left(), a[0], b[0])?;
        let right = self.meeting(rig.right(), a[1], b[1])?;
        // The covariance of the offsets of lines a and b in the left image, then in the right one.
        let mut offsets = Matrix4::zeros();
        for (line, [l, r]) in [a, b].into_iter().enumerate() {
            let ([l0, l1], [r0, r1]) = (left.weights[line], right.weights[line]);
            let weights = Matrix4x2::new(l0, 0.0, l1, 0.0, 0.0, r0, 0.0, r1);
            let own = StereoSegments { left: l.offsets, right: r.offsets }.covariance();
            let both: Matrix2<f64> = weights.transpose() * own * weights;
            for (i, k) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                offsets[(2 * i + line, 2 * k + line)] = both[(i, k)];
            }
        }
        let mut by = Matrix4::zeros();
        by.fixed_view_mut::<2, 2>(0, 0).copy_from(&left.by_offsets);
        by.fixed_view_mut::<2, 2>(2, 2).copy_from(&right.by_offsets);
        let covariance = by * offsets * by.transpose();
        let accurate = (0..4).all(|i| covariance[(i, i)] <= self.max_sigma * self.max_sigma);
        accurate.then_some(UncertainPixels { at: StereoPixels { left: left.at, right: right.at }, covariance })
    }

    /// The intersection of two segments in one image, if it is close to an end of both.
    fn meeting(&self, camera: &Pinhole, a: &FittedSegment, b: &FittedSegment) -> Option<Meeting> {
        let directions = [a, b].map(|segment| (segment.ends[1] - segment.ends[0]).normalize());
        let sine = directions[0].perp(&directions[1]);
        if !(sine.abs() >= libm::sin(self.min_angle_deg.to_radians())) {
            return None;
        }
        let at = a.ends[0] + directions[0] * ((b.ends[0] - a.ends[0]).perp(&directions[1]) / sine);
        let (pixel, jacobian) = camera.project_with_jacobian(&Point::<Camera>::from(at.push(1.0)))?;
        if !camera.contains(&pixel, 0.0) {
            return None;
        }
        let jacobian: Matrix2<f64> = jacobian.fixed_view::<2, 2>(0, 0).into();
        let mut normals = Matrix2::zeros();
        let mut weights = [[0.0; 2]; 2];
        for (line, (segment, along)) in [a, b].into_iter().zip(directions).enumerate() {
            let place = |direction: &Vector2<f64>| (direction - segment.ends[0]).dot(&along);
            let (here, end) = (place(&at), place(&segment.ends[1]));
            let tangent = jacobian * along;
            let beyond = (-here).max(here - end) * tangent.norm();
            if !(-INSIDE..=self.max_gap_fraction * segment.length).contains(&beyond) {
                return None;
            }
            let normal = Vector2::new(-tangent.y, tangent.x).normalize();
            let side = if normal.dot(&segment.offsets[0].normal) < 0.0 { -1.0 } else { 1.0 };
            normals.set_row(line, &(side * normal.transpose()));
            let [first, second] = segment.offsets.map(|half| camera.normalize(&half.at).map(|at| place(&at)));
            let (first, second) = (first?, second?);
            let part = (here - first) / (second - first);
            weights[line] = [1.0 - part, part];
        }
        Some(Meeting { at: pixel, by_offsets: normals.try_inverse()?, weights })
    }
}

/// The maximum distance (px) of a corner from the end of a segment that passes it: blur lengthens segments a little.
const INSIDE: f64 = 4.0;
/// The distance (px) within which two corners are one.
const SAME: f64 = 1.0;

/// The χ² distribution's quantile of 99 % with three degrees of freedom.
const AGREE: f64 = 11.345;

/// Whether two points are one within their covariances.
fn agree(a: &MeasuredPoint, b: &MeasuredPoint) -> bool {
    let apart = a.position.at.coords - b.position.at.coords;
    let covariance = a.position.covariance + b.position.covariance;
    // The trace bounds the largest eigenvalue, and so χ² from below.
    apart.norm_squared() <= AGREE * covariance.trace()
        && covariance.cholesky().is_some_and(|factor| apart.dot(&factor.solve(&apart)) <= AGREE)
}

/// The variance of a point in its worst direction, up to a factor of three.
fn spread(point: &MeasuredPoint) -> f64 {
    point.position.covariance.trace()
}

/// The intersection of two lines in one image.
struct Meeting {
    at: Pixel,
    /// The derivative of the pixel by the offsets of both lines at the intersection.
    by_offsets: Matrix2<f64>,
    /// The weights of the two half-points in the offset of each line at the intersection.
    weights: [[f64; 2]; 2],
}
