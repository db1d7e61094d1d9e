//! The matcher of segments by descriptors of the bands beside them.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{
    fit::FittedSegment,
    matcher::{SegmentMatch, SegmentMatcher, SegmentView},
    overlap::{Epipolar, PairRules},
    strips::{BANDS, Strips},
};
use crate::workspace::Workspace;

/// The matcher by the mean and the deviation of the grey levels in bands along each segment.
///
/// Each segment has one vector: the mean and the standard deviation of every band of both flanks, relative to the
/// segment's mean level and contrast. Segments that may see one line, by epipolar overlap, polarity and depth, match if
/// they are mutual nearest neighbours and the second nearest is clearly farther.
///
/// Limits: a vector of the complete segment compares different parts of an edge that is cut off in one image.
///
/// Source: Zhang and Koch, *An efficient and robust line segment matching approach based on LBD descriptor and pairwise
/// geometric consistency*, JVCIR 2013; its bands, on grey levels instead of gradients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct BandDescriptor {
    /// Minimum depth (m).
    pub min_depth: f64,
    /// Maximum depth (m).
    pub max_depth: f64,
    /// Minimum overlap, as a fraction of the shorter segment; 0 to 1.
    pub min_overlap: f64,
    /// Maximum ratio of the distances to the nearest and the second nearest, 0 to 1.
    pub ratio: f64,
    /// Angle to the epipolar lines (degrees) below which the ends of segments are compared, 0 to 45.
    pub flat_deg: f64,
}

impl Default for BandDescriptor {
    fn default() -> Self {
        Self { min_depth: 0.3, max_depth: 20.0, min_overlap: 0.4, ratio: 0.8, flat_deg: 6.0 }
    }
}

impl Component for BandDescriptor {
    const NAME: &'static str = "band-descriptor";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "nearest descriptors of the bands beside segments, under the epipolar constraint";
    const SOURCE: &'static str = "Zhang and Koch, An efficient and robust line segment matching approach based on LBD \
                                  descriptor and pairwise geometric consistency, JVCIR 2013";

    fn check(&self) -> Result<(), String> {
        in_range(self.min_depth > 0.0 && self.min_depth.is_finite(), "min-depth", self.min_depth, "above 0")?;
        let above = self.max_depth > self.min_depth && self.max_depth.is_finite();
        in_range(above, "max-depth", self.max_depth, "a depth above min-depth")?;
        in_range((0.0..=1.0).contains(&self.min_overlap), "min-overlap", self.min_overlap, "0 to 1")?;
        in_range((0.0..=1.0).contains(&self.ratio), "ratio", self.ratio, "0 to 1")?;
        in_range((0.0..=45.0).contains(&self.flat_deg), "flat-deg", self.flat_deg, "0 to 45")
    }
}

/// The mean and the deviation of each band of both flanks.
type Vector = [f64; 4 * BANDS];

/// The working memory.
#[derive(Debug, Default)]
struct Kept {
    strips: Strips,
    vectors: [Vec<Vector>; 2],
    /// The nearest left segment of each right one, and its distance.
    nearest: Vec<(usize, f64)>,
    /// The nearest right segment of each left one, its distance, and the second distance.
    forward: Vec<(usize, f64, f64)>,
}

impl SegmentMatcher for BandDescriptor {
    fn match_into(
        &self,
        left: &SegmentView<'_>,
        right: &SegmentView<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<SegmentMatch>,
    ) {
        found.clear();
        let Kept { strips, vectors, nearest, forward } = work.get::<Kept>();
        for (side, (view, camera)) in [(left, rig.left()), (right, rig.right())].into_iter().enumerate() {
            strips.fill(view.image, camera, view.segments);
            vectors[side].clear();
            vectors[side].extend(view.segments.iter().enumerate().map(|(i, segment)| vector(strips, i, segment)));
        }
        let epipolar = Epipolar::new(rig);
        let rules = PairRules {
            sine: libm::sin(self.flat_deg.to_radians()),
            depths: self.min_depth..=self.max_depth,
            min_overlap: self.min_overlap,
        };
        nearest.clear();
        nearest.resize(right.segments.len(), (usize::MAX, f64::INFINITY));
        forward.clear();
        for (i, a) in left.segments.iter().enumerate() {
            let mut own = (usize::MAX, f64::INFINITY, f64::INFINITY);
            for (j, b) in right.segments.iter().enumerate() {
                if epipolar.possible(&a.ends, &b.ends, &rules).is_none() {
                    continue;
                }
                let distance = distance(&vectors[0][i], &vectors[1][j]);
                if distance < own.1 {
                    own = (j, distance, own.1);
                } else if distance < own.2 {
                    own.2 = distance;
                }
                if distance < nearest[j].1 {
                    nearest[j] = (i, distance);
                }
            }
            forward.push(own);
        }
        found.extend(forward.iter().enumerate().filter_map(|(left, &(right, first, second))| {
            let mutual = nearest.get(right)?.0 == left;
            (mutual && first <= self.ratio * second).then_some(SegmentMatch { left, right })
        }));
    }
}

/// The vector of a segment.
fn vector(strips: &Strips, index: usize, segment: &FittedSegment) -> Vector {
    let middle = 0.5 * (segment.levels[0] + segment.levels[1]);
    let scale = 1.0 / (segment.levels[1] - segment.levels[0]).max(1.0);
    let mut all = [0.0; 4 * BANDS];
    for flank in 0..2 {
        for (band, (mean, deviation)) in strips.bands(index, flank).into_iter().enumerate() {
            let place = 2 * (flank * BANDS + band);
            (all[place], all[place + 1]) = ((mean - middle) * scale, deviation * scale);
        }
    }
    all
}

fn distance(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
