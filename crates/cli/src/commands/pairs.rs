//! Writing the stereo pairs of a source as a data set, with the user told how far it is.

use std::path::Path;

use seafix_component::Fault;
use seafix_experiment::{
    dataset,
    source::{CalibratedPort, Passage, Sight, Truth},
};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_referencing::Site;

use crate::{
    exit::{DONE, Ended, Failure, OUTPUT},
    terminal::{Progress, print, tell},
};

/// Writes all frames of `passage` to the folder `out`, which must not exist.
pub(super) fn write(passage: &dyn Passage, out: &Path, licence: &str) -> Ended {
    let progress = Progress::new();
    let count = passage.frames();
    tell(&format!("{count} frames into {}", out.display()));
    progress.expect(count);
    let written = dataset::write(&Watched { passage, progress: &progress }, out, licence);
    progress.end();
    written.map_err(|fault| Failure::new(OUTPUT, fault))?;
    print(&format!("{count} stereo pairs in {}\n", out.display()))?;
    Ok(DONE)
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
        self.progress.step("");
        sight
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        self.passage.truth(index)
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        self.passage.inputs()
    }
}
