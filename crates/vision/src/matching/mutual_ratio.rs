//! Mutual nearest neighbours with the ratio test.

use seafix_component::{Component, Settings};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{
    epipolar_band::EpipolarBand,
    exhaustive::Exhaustive,
    matcher::{Match, Matcher, View},
    metric::Metric,
    nearest::Nearest,
};
use crate::workspace::Workspace;

/// Mutual nearest neighbours by descriptor among all pairs, with the ratio test.
///
/// All pairs are compared exactly, by Euclidean distance between numbers or Hamming distance between bits. A pair
/// passes if its distance is less than `ratio` times the distance to the second nearest, seen from either side; of
/// equal distances the first counts as nearest.
///
/// Limits: descriptors of different kinds or lengths do not match. The rig takes no part; [`EpipolarBand`] uses it.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004 (ratio).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MutualRatio {
    /// Maximum ratio of the distances to the nearest and the second nearest; 1 disables the test.
    pub ratio: f64,
    /// Maximum distance between descriptors of unit length, whatever the second nearest; its square is 2 − 2 cos of
    /// their angle.
    pub max_distance: f64,
    /// Maximum fraction of differing bits, for binary descriptors.
    pub max_hamming: f64,
}

impl Default for MutualRatio {
    fn default() -> Self {
        let EpipolarBand { ratio, max_distance, max_hamming, .. } = EpipolarBand::default();
        Self { ratio, max_distance, max_hamming }
    }
}

impl Component for MutualRatio {
    const NAME: &'static str = "mutual-ratio";
    const SUMMARY: &'static str = "mutual nearest neighbours among all pairs, with the ratio test";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        self.alike().check()
    }
}

impl MutualRatio {
    /// The epipolar-band matcher with these settings, whose checks are shared.
    fn alike(&self) -> EpipolarBand {
        let Self { ratio, max_distance, max_hamming } = *self;
        EpipolarBand { ratio, max_distance, max_hamming, ..EpipolarBand::default() }
    }
}

impl Matcher for MutualRatio {
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        _: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        found.clear();
        let Some(metric) = Metric::of(left.descriptors, right.descriptors) else { return };
        let threads = work.threads();
        let (memory, nearest) = work.get::<(Exhaustive, Nearest)>();
        memory.compare(&metric, threads, nearest);
        let (ratio, max) = (metric.squared_ratio(self.ratio), self.alike().max(&metric));
        let pairs = nearest.mutual().filter(|pair| pair.squared <= max && pair.clear(ratio));
        found.extend(pairs.map(|pair| Match {
            left: pair.left,
            right: right.keypoints[pair.right].at,
            distance: metric.distance(pair.squared),
        }));
    }
}
