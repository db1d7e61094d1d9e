//! Matchers of left and right key points.

mod along;
pub(crate) mod correlate;
mod curve;
mod domain_evidence;
mod domains;
mod epipolar;
mod epipolar_band;
mod exhaustive;
mod grid;
mod lucas_kanade;
mod matcher;
mod metric;
mod mutual_ratio;
mod nearest;
mod outline_corners;
mod sought;
mod support;
#[cfg(test)]
mod test_scene;
mod zncc_band;

pub use epipolar_band::EpipolarBand;
pub use lucas_kanade::LucasKanade;
pub use matcher::{Match, Matcher, View};
pub use mutual_ratio::MutualRatio;
pub use outline_corners::{CornerView, OutlineCorners};
use seafix_component::{Registry, entry};
pub use zncc_band::ZnccBand;

/// The registry of matchers.
pub static MATCHERS: Registry<dyn Matcher> =
    Registry::new("matcher", &[entry!(EpipolarBand), entry!(LucasKanade), entry!(MutualRatio), entry!(ZnccBand)]);
