//! The matcher of segments by epipolar overlap and the levels beside them.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{
    fit::FittedSegment,
    matcher::{SegmentMatch, SegmentMatcher, SegmentView},
    overlap::{Epipolar, PairRules, between},
    strips::{Likeness, Strips, likeness},
};
use crate::workspace::Workspace;

/// The matcher by epipolar overlap, polarity, the levels of both flanks, and neighbours at equal depth.
///
/// Two segments may match if the epipolar lines of their ends overlap them, the brighter side is the same, and the
/// depths are possible. The levels beside them are compared on either flank apart, since behind an outline lies another
/// background in each image: the more alike flank counts twice. A pair's weight grows with every neighbour that may lie
/// at the same depth. A match is the best pair of both its segments, by a margin.
///
/// Limits: an edge that repeats along the epipolar lines, in a uniform place, has no unique match.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OverlapProfile {
    /// Minimum depth (m).
    pub min_depth: f64,
    /// Maximum depth (m).
    pub max_depth: f64,
    /// Minimum overlap, as a fraction of the shorter segment; 0 to 1.
    pub min_overlap: f64,
    /// Minimum weight of a pair, 0 to 1: the likeness of the levels beside it.
    pub min_likeness: f64,
    /// Maximum ratio of the second best pair's weight to the best's, 0 to 1.
    pub ratio: f64,
    /// Weight of neighbours at the same depth, at least 0; 0: levels alone decide.
    pub support: f64,
    /// Angle to the epipolar lines (degrees) below which the ends of segments are compared, 0 to 45.
    pub flat_deg: f64,
}

impl Default for OverlapProfile {
    fn default() -> Self {
        Self {
            min_depth: 0.3,
            max_depth: 20.0,
            min_overlap: 0.4,
            min_likeness: 0.3,
            ratio: 0.85,
            support: 1.0,
            flat_deg: 6.0,
        }
    }
}

impl Component for OverlapProfile {
    const NAME: &'static str = "overlap-profile";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "epipolar overlap, polarity, the levels of both flanks and neighbours at equal depth";
    const SOURCE: &'static str =
        "Schmid and Zisserman, Automatic line matching across views, CVPR 1997; epipolar beam and flanks";

    fn check(&self) -> Result<(), String> {
        in_range(self.min_depth > 0.0 && self.min_depth.is_finite(), "min-depth", self.min_depth, "above 0")?;
        let above = self.max_depth > self.min_depth && self.max_depth.is_finite();
        in_range(above, "max-depth", self.max_depth, "a depth above min-depth")?;
        in_range((0.0..=1.0).contains(&self.min_overlap), "min-overlap", self.min_overlap, "0 to 1")?;
        in_range((0.0..=1.0).contains(&self.min_likeness), "min-likeness", self.min_likeness, "0 to 1")?;
        in_range((0.0..=1.0).contains(&self.ratio), "ratio", self.ratio, "0 to 1")?;
        in_range((0.0..=100.0).contains(&self.support), "support", self.support, "0 to 100")?;
        in_range((0.0..=45.0).contains(&self.flat_deg), "flat-deg", self.flat_deg, "0 to 45")
    }
}

/// A possible match of a left segment.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    right: usize,
    likeness: f64,
    weight: f64,
    inverse_depth: f64,
}

/// The working memory.
#[derive(Debug, Default)]
struct Kept {
    strips: [Strips; 2],
    candidates: Vec<Candidate>,
    starts: Vec<usize>,
    best: Vec<[f64; 2]>,
    neighbours: Vec<(f64, usize)>,
}

/// The number of neighbours that support a pair.
const NEIGHBOURS: usize = 8;
/// The relative difference of inverse depths that halves a neighbour's support.
const SAME_DEPTH: f64 = 0.08;

impl SegmentMatcher for OverlapProfile {
    fn match_into(
        &self,
        left: &SegmentView<'_>,
        right: &SegmentView<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<SegmentMatch>,
    ) {
        found.clear();
        let kept = work.get::<Kept>();
        kept.strips[0].fill(left.image, rig.left(), left.segments);
        kept.strips[1].fill(right.image, rig.right(), right.segments);
        self.candidates(left.segments, right.segments, rig, kept);
        self.support(left.segments, kept);
        self.select(left.segments.len(), right.segments.len(), kept, found);
    }
}

impl OverlapProfile {
    /// The possible matches of each left segment.
    fn candidates(&self, left: &[FittedSegment], right: &[FittedSegment], rig: &StereoRig, kept: &mut Kept) {
        let epipolar = Epipolar::new(rig);
        let rules = PairRules {
            sine: libm::sin(self.flat_deg.to_radians()),
            depths: self.min_depth..=self.max_depth,
            min_overlap: self.min_overlap,
        };
        let Kept { strips: [l, r], candidates, starts, .. } = kept;
        candidates.clear();
        starts.clear();
        for (i, a) in left.iter().enumerate() {
            starts.push(candidates.len());
            for (j, b) in right.iter().enumerate() {
                let Some(overlap) = epipolar.possible(&a.ends, &b.ends, &rules) else { continue };
                let flanks = likeness([l, r], [i, j], [overlap.left, overlap.right]);
                let likeness = alike(&flanks, a, b);
                if likeness >= self.min_likeness {
                    let inverse_depth = overlap.inverse_depth();
                    candidates.push(Candidate { right: j, likeness, weight: likeness, inverse_depth });
                }
            }
        }
        starts.push(candidates.len());
    }

    /// Raises the weight of candidates by neighbours that may lie at the same depth.
    fn support(&self, left: &[FittedSegment], kept: &mut Kept) {
        if !(self.support > 0.0) {
            return;
        }
        let Kept { candidates, starts, neighbours, .. } = kept;
        for (i, segment) in left.iter().enumerate() {
            let own = starts[i]..starts[i + 1];
            if own.is_empty() {
                continue;
            }
            let middle = between(&segment.ends, 0.5);
            neighbours.clear();
            neighbours.extend((0..left.len()).filter(|&n| n != i && starts[n] < starts[n + 1]).map(|n| {
                // The distance between the segments, by ends and middles.
                let near = [0.0, 0.5, 1.0].map(|s| (between(&left[n].ends, s) - middle).norm());
                (near.into_iter().fold(f64::INFINITY, f64::min), n)
            }));
            let count = NEIGHBOURS.min(neighbours.len());
            if count > 0 && count < neighbours.len() {
                neighbours.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            }
            // Summed in the order of the segments, so that bits do not depend on the selection.
            neighbours[..count].sort_unstable_by_key(|neighbour| neighbour.1);
            for place in own {
                let rho = candidates[place].inverse_depth;
                let agreeing: f64 = neighbours[..count]
                    .iter()
                    .map(|&(_, n)| {
                        let theirs = candidates[starts[n]..starts[n + 1]].iter();
                        theirs
                            .map(|other| {
                                let off = (other.inverse_depth / rho - 1.0) / SAME_DEPTH;
                                other.likeness / (1.0 + off * off)
                            })
                            .fold(0.0, f64::max)
                    })
                    .sum();
                let part = agreeing / NEIGHBOURS as f64;
                candidates[place].weight = candidates[place].likeness * (1.0 + self.support * part);
            }
        }
    }

    /// The pairs that are the best of both segments by a margin.
    fn select(&self, left: usize, right: usize, kept: &mut Kept, found: &mut Vec<SegmentMatch>) {
        let Kept { candidates, starts, best, .. } = kept;
        // The best and the second best weight of each right segment.
        best.clear();
        best.resize(right, [0.0; 2]);
        for candidate in candidates.iter() {
            offer(&mut best[candidate.right], candidate.weight);
        }
        for i in 0..left {
            let own = &candidates[starts[i]..starts[i + 1]];
            let mut two = [0.0; 2];
            own.iter().for_each(|candidate| offer(&mut two, candidate.weight));
            let Some(first) = own.iter().find(|candidate| candidate.weight == two[0]) else { continue };
            let clear = |[first, second]: [f64; 2]| second <= self.ratio * first;
            if best[first.right][0] == two[0] && clear(two) && clear(best[first.right]) {
                found.push(SegmentMatch { left: i, right: first.right });
            }
        }
    }
}

/// Enters a weight into the best two.
fn offer(best: &mut [f64; 2], weight: f64) {
    if weight > best[0] {
        *best = [weight, best[0]];
    } else if weight > best[1] {
        best[1] = weight;
    }
}

/// The likeness of two segments by both flanks, 0 to 1.
fn alike(flanks: &[Likeness; 2], a: &FittedSegment, b: &FittedSegment) -> f64 {
    let contrast = |segment: &FittedSegment| segment.levels[1] - segment.levels[0];
    let scale = 0.5 * (contrast(a) + contrast(b)) + LEVELS;
    let each = flanks.map(|flank| {
        let level = 1.0 / (1.0 + (flank.difference / (0.5 * scale)).powi(2));
        // Texture counts in proportion to its strength; a uniform flank neither supports nor contradicts.
        let texture = flank.deviation / (flank.deviation + LEVELS);
        level * (1.0 - 0.5 * texture * (1.0 - flank.correlation.max(0.0)))
    });
    let ratio = contrast(a).min(contrast(b)) / contrast(a).max(contrast(b)).max(1e-9);
    ratio.sqrt() * (2.0 * each[0].max(each[1]) + each[0].min(each[1])) / 3.0
}

/// Differences of grey levels that noise alone explains.
const LEVELS: f64 = 4.0;
