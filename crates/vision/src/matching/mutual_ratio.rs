//! Mutual nearest neighbours with the ratio test.

use seafix_component::{Component, in_range};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{EpipolarBand, Match, Matcher, View, exhaustive::Exhaustive, metric::Metric, nearest::Nearest};
use crate::Workspace;

/// Pairs of key points that are each other's nearest by descriptor, clearly nearer than the second.
///
/// All pairs are compared, exactly: by their Euclidean distance between numbers, by the bits that
/// differ (Hamming) between bits. A pair passes when it is less than `ratio` times the distance to the
/// second nearest, seen from either side; of equally near ones the first counts as nearest. Descriptors
/// of different kinds or lengths match nothing.
///
/// With an epipolar band only the pairs that it allows compete; it is then [`EpipolarBand`] with the
/// same settings.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004 (ratio).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MutualRatio {
    /// The greatest distance, as a share of the distance to the second nearest; 1 switches the test off.
    pub ratio: f64,
    /// The greatest distance between descriptors of unit length, whatever the second is: 2 − 2 cos of
    /// their angle is its square.
    pub max_distance: f64,
    /// The greatest share of bits that may differ, where descriptors are bits.
    pub max_hamming: f64,
    /// Half width of the epipolar band (px). 0: every pair is allowed, at any depth.
    pub epipolar_px: f64,
    /// Least depth in the left camera (m), with a band.
    pub min_depth: f64,
    /// Greatest depth in the left camera (m), with a band.
    pub max_depth: f64,
    /// How many neighbours of a left key point support its pairs, with a band; 0: descriptors alone decide.
    pub neighbours: usize,
}

impl Default for MutualRatio {
    fn default() -> Self {
        let EpipolarBand { ratio, max_distance, max_hamming, min_depth, max_depth, .. } = EpipolarBand::default();
        Self { ratio, max_distance, max_hamming, epipolar_px: 0.0, min_depth, max_depth, neighbours: 0 }
    }
}

impl Component for MutualRatio {
    const NAME: &'static str = "mutual-ratio";
    const SUMMARY: &'static str = "mutual nearest neighbours among all pairs, with the ratio test";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        let px = self.epipolar_px;
        in_range((0.0..=1000.0).contains(&px), "epipolar-px", px, "a number from 0 to 1000 (px)")?;
        let any = EpipolarBand::default().epipolar_px;
        EpipolarBand { epipolar_px: if px > 0.0 { px } else { any }, ..self.band() }.check()
    }
}

impl MutualRatio {
    /// The same settings along a band.
    fn band(&self) -> EpipolarBand {
        let Self { ratio, max_distance, max_hamming, epipolar_px, min_depth, max_depth, neighbours } = *self;
        EpipolarBand { ratio, max_distance, max_hamming, epipolar_px, min_depth, max_depth, neighbours }
    }
}

impl Matcher for MutualRatio {
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        if self.epipolar_px > 0.0 {
            return self.band().match_into(left, right, rig, work, found);
        }
        found.clear();
        let Some(metric) = Metric::of(left.descriptors, right.descriptors) else { return };
        let threads = work.threads();
        let (memory, nearest) = work.get::<(Exhaustive, Nearest)>();
        memory.compare(&metric, threads, nearest);
        let (ratio, most) = (metric.squared_ratio(self.ratio), self.band().most(&metric));
        let pairs = nearest.mutual().filter(|pair| pair.squared <= most && pair.clear(ratio));
        found.extend(pairs.map(|pair| Match {
            left: pair.left,
            right: right.keypoints[pair.right].at,
            distance: metric.distance(pair.squared),
        }));
    }
}
