//! `seafix model`.

mod arguments;
mod dive;
mod dive_arguments;
mod page;
mod pair;
mod propose;
mod true_marks;

use seafix::PipelineSettings;
use seafix_data::ModelByHand;
use seafix_experiment::changed_pipeline;

pub(crate) use self::arguments::Model;
use self::pair::PairFiles;
use super::set::built;
use crate::exit::{Ended, Failure, USAGE};

impl Model {
    pub(crate) fn execute(&self) -> Ended {
        let usage = |message: String| Failure::new(USAGE, message);
        for (name, value, max) in [("reach", self.reach, 100.0), ("mark-sigma", self.mark_sigma, 100.0)] {
            if !(value > 0.0 && value <= max) {
                return Err(usage(format!(
                    "invalid --{name} {value}: outside of 0 to {max} px; give a positive number"
                )));
            }
        }
        let base = match &self.base[..] {
            [] => None,
            [p1, p2, p3] => Some([p1, p2, p3].map(String::clone)),
            other => {
                return Err(usage(format!(
                    "invalid --base {}: not three ids; separate three ids by commas",
                    other.join(",")
                )));
            }
        };
        let calibration = self.dive.calibration()?;
        let change = |set: &[String]| changed_pipeline(&PipelineSettings::default(), set);
        let (_, front_end) = built(&self.set, change, PipelineSettings::front_end)?;
        let (reach, mark_sigma, object) = (self.reach, self.mark_sigma, self.id.clone());
        let by_hand = ModelByHand { front_end: &front_end, reach, mark_sigma, object, base };
        if let Some(error) = self.dive.true_marks {
            return true_marks::execute(self, error);
        }
        if let Some(count) = self.dive.propose {
            return propose::execute(self, count as usize, &front_end);
        }
        match (&self.marks, &self.right, &self.rig, &self.points) {
            (Some(marks), ..) => {
                let mut lines = built(&self.set, change, PipelineSettings::line_front_end)?.1;
                // The points of a dive do not contain the calibration's error, which all pairs have in common.
                lines.calibration_px = 0.0;
                dive::execute(self, marks, by_hand, calibration, self.dive.edges.then_some(&lines))
            }
            (None, Some(right), Some(rig), Some(points)) => {
                self.pair_source.of_no_recording()?;
                pair::execute(self, &PairFiles { left: &self.left, right, rig, points }, &by_hand)
            }
            // The parser of the command line requires the others without --marks.
            _ => Err(usage("no marks; give --marks, or RIGHT, --rig and --points".to_owned())),
        }
    }
}
