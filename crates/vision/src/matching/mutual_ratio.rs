//! Mutual nearest neighbours with the ratio test.

use seafix_component::Component;
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
/// The rig plays no part: [`EpipolarBand`] is the one that asks it.
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
    /// The matcher whose settings these are, with the rest of its own.
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
