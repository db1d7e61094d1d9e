//! `seafix dive`.

use std::path::PathBuf;

use clap::Args;
use seafix_component::Fault;
use seafix_experiment::{
    Observer, Plan, dataset,
    source::{CalibratedPort, Passage, Sight, Truth},
};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_referencing::Site;

use crate::{
    exit::{DONE, Ended, Failure, INPUT, OUTPUT, USAGE},
    terminal::{Progress, print},
};

#[derive(Debug, Args)]
pub(crate) struct Dive {
    /// The experiment file; the dive of its first trial is made.
    experiment: PathBuf,
    /// How many stereo pairs; otherwise as many as the experiment says.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.water.attenuation=0.3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The folder of the data set; it must not exist.
    #[arg(long)]
    out: PathBuf,
    /// The licence of the data set.
    #[arg(long, default_value = "MIT OR Apache-2.0")]
    licence: String,
    /// How many threads work; the images do not depend on it [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Dive {
    pub(crate) fn execute(&self) -> Ended {
        let frames = self.frames.map(|frames| format!("source.frames={frames}"));
        let settings: Vec<String> = self.set.iter().cloned().chain(frames).collect();
        let plan = Plan::read(&self.experiment, &settings).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let trial = plan.trials.first().ok_or_else(|| Failure::new(USAGE, "the experiment has no trial"))?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(0, usize::from))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("no threads ({error})")))?;
        pool.install(|| {
            let passage = trial
                .source
                .open(trial.resolved.seed, &plan.folder)
                .map_err(|faults| Failure::faults(INPUT, &faults))?;
            let progress = Progress::new();
            let count = passage.frames();
            let pixels = passage.rig().left().size().map(u64::from).iter().product::<u64>();
            progress.begins(count, pixels * 2 * count as u64 * 6 / 10, &self.out);
            let written =
                dataset::write(&Watched { passage: &*passage, progress: &progress }, &self.out, &self.licence);
            progress.end();
            written.map_err(|fault| Failure::new(OUTPUT, fault))?;
            print(&format!("{count} stereo pairs in {}\n", self.out.display()))?;
            Ok(DONE)
        })
    }
}

/// A passage that tells how far it is.
struct Watched<'a> {
    passage: &'a dyn Passage,
    progress: &'a Progress,
}

impl Passage for Watched<'_> {
    fn name(&self) -> &str {
        self.passage.name()
    }

    fn site(&self) -> &Site {
        self.passage.site()
    }

    fn rig(&self) -> &StereoRig {
        self.passage.rig()
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.passage.body_from_camera()
    }

    fn images(&self) -> bool {
        self.passage.images()
    }

    fn frames(&self) -> usize {
        self.passage.frames()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        self.passage.prior_sigma()
    }

    fn bits(&self) -> u8 {
        self.passage.bits()
    }

    fn ports(&self) -> [Option<CalibratedPort>; 2] {
        self.passage.ports()
    }

    fn sensors(&self) -> Vec<(String, String)> {
        self.passage.sensors()
    }

    fn sight(&self, index: usize) -> Result<Sight, Fault> {
        let sight = self.passage.sight(index);
        self.progress.frame("");
        sight
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        self.passage.truth(index)
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        self.passage.inputs()
    }
}
