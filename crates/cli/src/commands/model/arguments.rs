//! The arguments of `seafix model`, and its outputs.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{
    super::{limits::Limits, pair_source::PairSource},
    dive_arguments::DiveArguments,
};
use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Model {
    /// The left image, or with --marks or --propose a dive: the folder of a data set, a recording of ROS 2 (an
    /// MCAP file or a folder of rosbag2) or the log of a trial with its images; with --true-marks a data set.
    #[arg(value_name = "LEFT or DIVE")]
    pub(super) left: PathBuf,
    /// The right image.
    #[arg(required_unless_present_any = ["marks", "propose", "true_marks"], conflicts_with_all = ["marks", "propose", "true_marks"])]
    pub(super) right: Option<PathBuf>,
    /// The stereo rig: a dataset.toml, of which only the rig and `bits` are read.
    #[arg(long, value_name = "DATASET.toml", required_unless_present_any = ["marks", "propose", "true_marks"], conflicts_with_all = ["marks", "propose", "true_marks"])]
    pub(super) rig: Option<PathBuf>,
    /// The marks (px): lines id,left_u,left_v,right_u,right_v below that header; empty right coordinates are estimated.
    #[arg(long, value_name = "CLICKS.csv", required_unless_present_any = ["marks", "propose", "true_marks"], conflicts_with_all = ["marks", "propose", "true_marks"])]
    pub(super) points: Option<PathBuf>,
    /// The marks in pairs of a dive: lines stamp_ns,id,left_u,left_v,right_u,right_v below that header. One mark of a
    /// feature in any one pair suffices.
    #[arg(long, value_name = "MARKS.csv", conflicts_with_all = ["propose", "true_marks"])]
    pub(super) marks: Option<PathBuf>,
    #[command(flatten)]
    pub(super) dive: DiveArguments,
    #[command(flatten)]
    pub(super) pair_source: PairSource,
    /// The id of the object.
    #[arg(long, default_value = "object")]
    pub(super) id: String,
    /// P1, P2 and P3 of the object's frame: P1 is the origin, P3 lies on +x, P2 on the side of -y [default: the widest
    /// triangle].
    #[arg(long, value_name = "P1,P2,P3", value_delimiter = ',', num_args = 1)]
    pub(super) base: Vec<String>,
    /// Maximum distance of a mark from its corner (px), and of a corner of a dive from its expected position.
    #[arg(long, default_value_t = 4.0)]
    pub(super) reach: f64,
    /// Standard deviation of a mark without a corner (px).
    #[arg(long, default_value_t = 1.0)]
    pub(super) mark_sigma: f64,
    /// Change a setting of the pipeline: a dotted key and a TOML value, `locator.name="junction"`.
    #[arg(long, value_name = "KEY=VALUE")]
    pub(super) set: Vec<String>,
    #[command(flatten)]
    pub(super) limits: Limits,
    /// Print one JSON object with every point and its covariance.
    #[arg(long)]
    pub(super) json: bool,
    /// Write the site (seafix-site/1) to this file [default: standard output].
    #[arg(long, value_name = "SITE.toml")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) replacing: Replacing,
}

/// The outputs of a model.
pub(super) struct Printed {
    pub(super) site: String,
    pub(super) text: String,
    pub(super) json: String,
    pub(super) warnings: Vec<String>,
}

impl Model {
    /// Writes the site and prints what was asked for.
    pub(super) fn finish(&self, printed: &Printed, inputs: &[&Path]) -> Ended {
        printed.warnings.iter().for_each(|warning| notify(&format!("warning: {warning}")));
        if let Some(path) = &self.out {
            AtomicFile::begin(path, self.replacing, inputs)?.finish(&printed.site)?;
        }
        match (self.json, &self.out) {
            (true, _) => print(&printed.json)?,
            (false, Some(_)) => print(&printed.text)?,
            (false, None) => {
                printed.text.lines().for_each(notify);
                print(&printed.site)?;
            }
        }
        Ok(DONE)
    }
}
