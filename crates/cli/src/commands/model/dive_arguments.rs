//! The arguments of `seafix model` for a dive.

use std::path::PathBuf;

use clap::Args;
use seafix_component::Choice;
use seafix_data::{CalibrationSigma, ModelFromDive, StereoPairs};
use seafix_navigation::{ODOMETRIES, Odometry};

use super::super::pair_source::with_readings;
use crate::exit::{Failure, OUTPUT, USAGE};

#[derive(Debug, Args)]
pub(super) struct DiveArguments {
    /// The odometry between the pairs of a dive; `none`: each pose from the model itself.
    #[arg(long, default_value = "stereo", value_name = "NAME")]
    pub(super) odometry: String,
    /// Standard deviation of the principal points (px): an error that all pairs of a dive have in common.
    #[arg(long, default_value_t = CalibrationSigma::default().pixels, value_name = "PX")]
    pub(super) principal_sigma: f64,
    /// Relative standard deviation of the baseline: that of the scale of a model from a dive.
    #[arg(long, default_value_t = CalibrationSigma::default().baseline, value_name = "FRACTION")]
    pub(super) baseline_sigma: f64,
    /// Systematic error of a located corner against the physical one (px, one standard deviation), equal in all pairs of a dive.
    #[arg(long, default_value_t = ModelFromDive::CORNER_SIGMA, value_name = "PX")]
    pub(super) corner_sigma: f64,
    /// List the straight edges near the points that three or more pairs show.
    #[arg(long, requires = "marks")]
    pub(super) edges: bool,
    /// Do not correct the rotation of the right camera, even if the images of a dive contradict the rig.
    #[arg(long)]
    pub(super) keep_rig: bool,
    /// Also build a model from the odd pairs and one from the even pairs of a dive, and report their difference.
    #[arg(long)]
    pub(super) half: bool,
    /// Propose this number of features, with marks in their best pairs; --out is then the table of marks.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(super) propose: Option<u32>,
    /// Write the marks of a simulated operator with this error (px), for studies: the points of the object --id that the
    /// truth of the data set shows; --out is then the table of marks.
    #[arg(long, value_name = "PX", conflicts_with = "propose")]
    pub(super) true_marks: Option<f64>,
    /// The seed of --true-marks.
    #[arg(long, default_value_t = 1, value_name = "SEED", requires = "true_marks")]
    pub(super) marks_seed: u64,
    /// Write a page with the best views of each point, or with the proposals, to this file.
    #[arg(long, value_name = "PAGE.html")]
    pub(super) page: Option<PathBuf>,
    /// Number of threads for a dive; the model does not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) threads: Option<u16>,
}

impl DiveArguments {
    /// The uncertainty of the rig; checks that of corners too.
    pub(super) fn calibration(&self) -> Result<CalibrationSigma, Failure> {
        let given = [
            ("principal-sigma", self.principal_sigma, 10.0),
            ("baseline-sigma", self.baseline_sigma, 0.1),
            ("corner-sigma", self.corner_sigma, 10.0),
        ];
        for (name, value, max) in given {
            if !(0.0..=max).contains(&value) {
                return Err(Failure::new(USAGE, format!("invalid --{name} {value}: give a number from 0 to {max}")));
            }
        }
        Ok(CalibrationSigma { pixels: self.principal_sigma, baseline: self.baseline_sigma })
    }

    /// The odometry by its name; `None` for `none`.
    pub(super) fn odometry(&self, dive: &StereoPairs) -> Result<Option<Box<dyn Odometry>>, Failure> {
        if self.odometry == "none" {
            return Ok(None);
        }
        let usage = |error| Failure::new(USAGE, error);
        let mut choice = ODOMETRIES.resolve(&Choice::named(&self.odometry)).map_err(usage)?;
        // The poses belong to the rig of the model.
        if let Some(corrects) = choice.settings.get_mut("correct-range-offset") {
            *corrects = false.into();
        }
        let odometry = ODOMETRIES.build(&choice).map_err(usage)?;
        with_readings(dive, &*odometry, &self.odometry)?;
        Ok(Some(odometry))
    }

    /// The threads.
    pub(super) fn pool(&self) -> Result<rayon::ThreadPool, Failure> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(0, usize::from))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot start threads: {error}")))
    }
}
