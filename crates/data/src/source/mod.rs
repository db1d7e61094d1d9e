//! Sources: where stereo pairs, or clouds, come from.

use std::path::Path;

use seafix_component::{Fault, Registry, entry};
use seafix_evaluation::Solved;
use seafix_geometry::{Body, Camera, Covariance6, Object, StereoRig, Transform, World};
use seafix_referencing::Site;

mod bag;
mod dataset;
mod dive;
mod euroc;
mod generated_pairs;
mod generated_problems;
mod kitti;
mod logged;
mod mcap;
mod problem_sequence;
mod problems;
mod readings;
mod recorded;
mod sensor_buffer;
mod topics;
mod virtual_dive;
mod virtual_images;
mod virtual_layouts;
mod virtual_points;

pub use dataset::DatasetSource;
pub use dive::Dive;
pub use euroc::Euroc;
pub use generated_pairs::GeneratedPairs;
pub use generated_problems::GeneratedProblems;
pub use kitti::Kitti;
pub use mcap::{LoggedInput, Mcap};

pub use crate::{dataset::Cameras, ros::Views};
pub use problems::Problems;
pub use recorded::check_recording;
pub use sensor_buffer::SensorBuffer;
pub use virtual_images::VirtualImages;
pub use virtual_layouts::VirtualLayouts;
pub use virtual_points::VirtualPoints;

pub use seafix::{FrameData, Hints, SensorFrame, WorldPrior};

/// What is true at one instant. The runner compares with it; no method is given it.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The left camera.
    pub world_from_camera: Transform<World, Camera>,
    /// Each object of the site, in its order; `None` where no world is known. Of a problem its only object.
    pub world_from_object: Vec<Option<Transform<World, Object>>>,
    /// The feature points both cameras see, as (object, point) indices; `None` where nobody knows.
    pub visible: Option<Vec<(usize, usize)>>,
    /// The Cramér–Rao bound on the pose relative to an object of the site, where it is known: the least covariance that
    /// any unbiased estimate could have.
    pub bound: Option<(usize, Covariance6<Object, Camera>)>,
    /// The answer to an identification problem, where the frame is one.
    pub answer: Option<TrueAnswer>,
}

/// The true answer to an identification problem, and by which rule a pose is right.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueAnswer {
    /// The true pairs (model point, cloud point).
    pub pairs: Vec<(usize, usize)>,
    /// When a pose counts as found.
    pub rule: Solved,
}

pub use crate::dataset::CalibratedPort;

/// A sequence of instants, simulated or recorded, opened and checked.
pub trait Sequence: Send + Sync {
    /// Its name, for people.
    fn name(&self) -> &str;
    /// What there is to see; without objects where each instant brings its own.
    fn site(&self) -> &Site;
    /// The rig the method is told.
    fn rig(&self) -> &StereoRig;
    /// Where the left camera sits in the vehicle.
    fn body_from_camera(&self) -> Transform<Body, Camera>;
    /// Whether it gives images rather than clouds.
    fn images(&self) -> bool;
    /// Whether every point says which one it is, so that nothing is searched.
    fn labelled(&self) -> bool {
        false
    }
    /// Whether every instant is a problem about an object of its own: the passage has then no site.
    fn posed(&self) -> bool {
        false
    }
    /// How many instants there are.
    fn frames(&self) -> usize;
    /// The number of instant `index`: it seeds what a method draws, and names the frame in logs.
    fn number(&self, index: usize) -> u64 {
        index as u64
    }
    /// Standard deviations of the prior, typical for the passage: position per world axis (m) and
    /// attitude per camera axis (rad).
    fn prior_sigma(&self) -> Option<(f64, f64)>;
    /// Standard deviation of a pixel coordinate in clouds that come without images (px), where known.
    fn pixel_sigma(&self) -> Option<f64> {
        None
    }
    /// Depth of the pixels of its images (bits).
    fn bits(&self) -> u8 {
        8
    }
    /// The ports that the cameras stand behind, where they stand behind any, as the rig was calibrated behind them.
    fn ports(&self) -> [Option<CalibratedPort>; 2] {
        [None, None]
    }
    /// Whether both the vehicle's Doppler log and its gyro are heard.
    fn has_readings(&self) -> bool {
        false
    }
    /// What the vehicle's navigation sensors said, as tables: names of files and their CSV text.
    fn sensors(&self) -> Vec<(String, String)> {
        Vec::new()
    }
    /// What is odd about it but not wrong.
    fn warnings(&self) -> &[Fault] {
        &[]
    }
    /// What a method may see at instant `index`.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault>;
    /// What is true at instant `index`, where it is known.
    fn truth(&self, index: usize) -> Option<Truth>;
    /// Files it was made from, with their SHA-256.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn inputs(&self) -> Result<Vec<(String, String)>, Fault>;
}

/// Where stereo pairs or clouds come from.
pub trait Source: Send + Sync + std::fmt::Debug {
    /// Opens the passage that `seed` selects; relative paths start from `folder`. Everything that
    /// can be checked without decoding images is checked here.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    fn open(&self, seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>>;
    /// Whether its points have pixels, which some solvers need.
    fn has_pixels(&self) -> bool {
        true
    }
    /// Whether it may have readings of the vehicle's Doppler log and gyro; what it opens says whether it has.
    fn may_have_readings(&self) -> bool {
        false
    }
}

/// All sources.
pub static SOURCES: Registry<dyn Source> = Registry::new(
    "source",
    &[
        entry!(DatasetSource),
        entry!(Dive),
        entry!(GeneratedPairs),
        entry!(GeneratedProblems),
        entry!(Euroc),
        entry!(Kitti),
        entry!(Mcap),
        entry!(Problems),
        entry!(VirtualImages),
        entry!(VirtualLayouts),
        entry!(VirtualPoints),
    ],
);

/// The site of a problem, which is about an object of its own; `None` where the passage's is looked at.
pub fn own_site(sensor_frame: &SensorFrame) -> Option<Site> {
    match &sensor_frame.hints {
        Hints::Problem(problem) => Some(problem_sequence::site_of(problem)),
        _ => None,
    }
}
