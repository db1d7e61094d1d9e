//! `seafix model`.

mod dive;
mod page;
mod pair;
mod propose;

use std::path::{Path, PathBuf};

use clap::Args;
use seafix::Pipeline;
use seafix_data::ModelByHand;
use seafix_experiment::changed_pipeline;

use self::pair::PairFiles;
use super::limits::Limits;
use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, USAGE},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Model {
    /// The left image, or with --marks or --propose the folder of a dive: a data set.
    #[arg(value_name = "LEFT or DIVE")]
    left: PathBuf,
    /// The right image.
    #[arg(required_unless_present_any = ["marks", "propose"], conflicts_with_all = ["marks", "propose"])]
    right: Option<PathBuf>,
    /// The stereo rig: a dataset.toml, of which only the rig and `bits` are read.
    #[arg(long, value_name = "DATASET.toml", required_unless_present_any = ["marks", "propose"], conflicts_with_all = ["marks", "propose"])]
    rig: Option<PathBuf>,
    /// The marks (px): lines id,left_u,left_v,right_u,right_v below that header; empty right coordinates are estimated.
    #[arg(long, value_name = "CLICKS.csv", required_unless_present_any = ["marks", "propose"], conflicts_with_all = ["marks", "propose"])]
    points: Option<PathBuf>,
    /// The marks in pairs of a dive: lines stamp_ns,id,left_u,left_v,right_u,right_v below that header. One mark of a
    /// feature in any one pair suffices.
    #[arg(long, value_name = "MARKS.csv", conflicts_with = "propose")]
    marks: Option<PathBuf>,
    #[command(flatten)]
    dive: dive::DiveArguments,
    /// The id of the object.
    #[arg(long, default_value = "object")]
    id: String,
    /// P1, P2 and P3 of the object's frame: P1 is the origin, P3 lies on +x, P2 on the side of -y [default: the widest
    /// triangle].
    #[arg(long, value_name = "P1,P2,P3", value_delimiter = ',', num_args = 1)]
    base: Vec<String>,
    /// Maximum distance of a mark from its corner (px), and of a corner of a dive from its expected position.
    #[arg(long, default_value_t = 4.0)]
    reach: f64,
    /// Standard deviation of a mark without a corner (px).
    #[arg(long, default_value_t = 1.0)]
    mark_sigma: f64,
    /// Change a setting of the pipeline: a dotted key and a TOML value, `locator.name="junction"`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    limits: Limits,
    /// Print one JSON object with every point and its covariance.
    #[arg(long)]
    json: bool,
    /// Write the site (seafix-site/1) to this file [default: standard output].
    #[arg(long, value_name = "SITE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
}

/// The outputs of a model.
struct Printed {
    site: String,
    people: String,
    machines: String,
    warnings: Vec<String>,
}

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
        let pipeline =
            changed_pipeline(&Pipeline::default(), &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let front_end = pipeline.front_end().map_err(|error| Failure::new(USAGE, error))?;
        let (reach, mark_sigma, object) = (self.reach, self.mark_sigma, self.id.clone());
        let by_hand = ModelByHand { front_end: &front_end, reach, mark_sigma, object, base };
        if let Some(count) = self.dive.propose {
            return propose::execute(self, count as usize, &front_end);
        }
        match (&self.marks, &self.right, &self.rig, &self.points) {
            (Some(marks), ..) => dive::execute(self, marks, by_hand, calibration),
            (None, Some(right), Some(rig), Some(points)) => {
                pair::execute(self, &PairFiles { left: &self.left, right, rig, points }, &by_hand)
            }
            // The parser of the command line requires the others without --marks.
            _ => Err(usage("no marks; give --marks, or RIGHT, --rig and --points".to_owned())),
        }
    }

    /// Writes the site and prints what was asked for.
    fn finish(&self, printed: &Printed, inputs: &[&Path]) -> Ended {
        printed.warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        if let Some(path) = &self.out {
            AtomicFile::begin(path, self.replacing, inputs)?.finish(&printed.site)?;
        }
        match (self.json, &self.out) {
            (true, _) => print(&printed.machines)?,
            (false, Some(_)) => print(&printed.people)?,
            (false, None) => {
                printed.people.lines().for_each(notify);
                print(&printed.site)?;
            }
        }
        Ok(DONE)
    }
}
