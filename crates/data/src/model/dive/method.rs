//! The model of an object from a dive.

use std::path::Path;

use seafix_component::Fault;
use seafix_navigation::Odometry;
use seafix_vision::LineFrontEnd;

use super::{
    built::DiveModel,
    contradictions::contradictions,
    find::Finder,
    finish::Finish,
    marks,
    progress::Progress,
    settle::HELD,
    start::{Marks, pairs_of},
    trail::Trail,
};
use crate::{
    model::{
        adjust::CalibrationSigma,
        by_hand::{HandModel, ModelByHand},
    },
    stereo_pairs::StereoPairs,
};

/// The settings for a model from a dive.
#[derive(Debug)]
pub struct ModelFromDive<'a> {
    /// The settings of a mark, the object's name and its base; the reach is also the radius of the search in other pairs.
    pub by_hand: ModelByHand<'a>,
    /// The uncertainty of the rig.
    pub calibration: CalibrationSigma,
    /// The standard deviation (px) of the place that the locator calls a corner, in common to all pairs: light, texture,
    /// and what lies behind the corner.
    pub corner_sigma: f64,
    /// The measurement of lines, for straight edges; `None` for points alone.
    pub edges: Option<&'a LineFrontEnd>,
    /// The odometry; `None` to find the pose of each pair from the model itself.
    pub odometry: Option<&'a dyn Odometry>,
    /// Whether the models of every second pair are compared.
    pub halves: bool,
    /// Whether the best views of each point are cut out.
    pub pictures: bool,
}

impl ModelFromDive<'_> {
    /// The default of [`corner_sigma`](Self::corner_sigma) (px).
    ///
    /// With it, and without errors of the calibration, χ² of models of seven rendered objects from two heights is 0.2 to
    /// 1.3 of its degrees of freedom for eleven of fourteen, 2 to 17 for the others.
    pub const CORNER_SIGMA: f64 = 0.03;

    /// Builds the model of the only pair of a dive, as [`ModelByHand`] does.
    ///
    /// # Errors
    /// Invalid marks.
    pub fn of_only_pair(&self, dive: &StereoPairs, text: &str, file: &Path) -> Result<HandModel, Vec<Fault>> {
        let marks = marks::read(text, file, sizes(dive)).map_err(|fault| vec![fault])?;
        pairs_of(dive, &marks, file)?;
        let one = |fault| vec![fault];
        let (left, right) = dive.pair(0).map_err(one)?;
        let marks = marks.into_iter().map(|mark| mark.mark).collect();
        self.by_hand.of_marks([&left, &right], &dive.rig, marks, file).map_err(one)
    }

    /// Builds a model from the marks in `text`, the content of `file`, and all pairs of a dive.
    ///
    /// `progress` is called for each pair of the odometry.
    ///
    /// # Errors
    /// All faults of the marks, pairs without connection, or fewer than three points that remain.
    pub fn model(
        &self,
        dive: &StereoPairs,
        text: &str,
        file: &Path,
        progress: &mut dyn FnMut(),
    ) -> Result<DiveModel, Vec<Fault>> {
        let marks = marks::read(text, file, sizes(dive)).map_err(|fault| vec![fault])?;
        let Marks { features: marked, unmatched } = self.by_hand.located(dive, marks, file)?;
        if marked.iter().filter(|feature| feature.marks[0].measured.is_some()).count() < HELD {
            return Err(unmatched);
        }
        let (trail, unread) = match self.odometry {
            Some(odometry) => Trail::by_odometry(dive, odometry, progress),
            None => (Trail::unknown(dive.stamps().len()), Vec::new()),
        };
        let finder = Finder { front_end: self.by_hand.front_end, rig: &dive.rig, reach: self.by_hand.reach };
        let mut state = Progress::begin(&marked, trail, finder, unread);
        let settled = state.rounds(dive, &marked, file)?;
        let alone = state.unconfirmed(&settled);
        let settled = if alone.is_empty() { settled } else { state.without(&alone, dive, file)? };
        let faults = contradictions(&marked, &state.gathered.seen, &settled, file);
        if !faults.is_empty() {
            return Err(faults);
        }
        Finish {
            by_hand: &self.by_hand,
            calibration: &self.calibration,
            corner_sigma: self.corner_sigma,
            edges: self.edges,
            dive,
            marked: &marked,
            features: &state.features,
            trail: &state.trail,
            scene: &state.scene,
            gathered: &state.gathered,
            settled: &settled,
            alone: &alone,
            halves: self.halves,
            pictures: self.pictures,
            file,
        }
        .model(state.warnings)
        .map_err(|fault| vec![fault])
    }
}

fn sizes(dive: &StereoPairs) -> [[u32; 2]; 2] {
    [dive.rig.left(), dive.rig.right()].map(seafix_geometry::Pinhole::size)
}
