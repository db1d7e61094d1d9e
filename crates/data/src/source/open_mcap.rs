//! Opening of MCAP files: logs of other runs, and ROS 2 recordings.

use std::path::Path;

use seafix_component::Fault;

use super::{
    logged::Logged,
    mcap::Mcap,
    recorded::Recorded,
    recordings::{Recordings, is_log},
};
use crate::sequence::{Sequence, Source};

impl Source for Mcap {
    fn open(&self, _seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let path = folder.join(&self.path);
        let one = |fault| vec![fault];
        let recording = Recordings::open(&path, |_| false).map_err(one)?;
        if is_log(&recording) {
            return Ok(Box::new(Logged::open(&path, self.read)?));
        }
        if self.site.is_empty() {
            let fault = Fault::new("a recording without a site", &path);
            return Err(one(fault.remedy("a fix needs a known object: set `site` to a site file")));
        }
        Ok(Box::new(Recorded::open(&path, self, folder)?))
    }

    fn may_have_readings(&self) -> bool {
        true
    }
}
