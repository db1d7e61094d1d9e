//! Sources: where stereo pairs, or clouds, come from.

use std::{path::Path, sync::Arc};

use seafix_component::{Fault, Registry, entry};
use seafix_evaluation::Solved;
use seafix_geometry::{Body, Camera, Covariance6, MeasuredPoint, Object, StereoRig, Transform, World};
use seafix_navigation::Reading as SensorReading;
use seafix_referencing::{Prior, Site, Target, problem_file::CoherenceProblem};
use seafix_simulation::optics::Port;
use seafix_vision::Image;

mod bag;
mod dataset;
mod dive;
mod drawn_pairs;
mod drawn_problems;
mod euroc;
mod heard;
mod kitti;
mod logged;
mod mcap;
mod problem_passage;
mod problems;
mod readings;
mod recorded;
mod topics;
mod virtual_dive;
mod virtual_images;
mod virtual_layouts;
mod virtual_points;

pub use dataset::DatasetSource;
pub use dive::Dive;
pub use drawn_pairs::DrawnPairs;
pub use drawn_problems::DrawnProblems;
pub use euroc::Euroc;
pub use kitti::Kitti;
pub use mcap::{Mcap, Reading};

pub use crate::{dataset::Cameras, ros::Views};
pub(crate) use heard::Heard;
pub use problems::Problems;
pub use recorded::check_recording;
pub use virtual_images::VirtualImages;
pub use virtual_layouts::VirtualLayouts;
pub use virtual_points::VirtualPoints;

/// What a method may see of one instant.
#[derive(Debug, Clone)]
pub struct Sight {
    /// When (ns).
    pub stamp_ns: u64,
    /// What the cameras gave.
    pub eyes: Eyes,
    /// The rough pose, if one is known.
    pub prior: Option<WorldPrior>,
    /// What is told beside what the cameras gave.
    pub told: Told,
    /// What the navigation sensors told since the instant before, as it arrived.
    pub readings: Vec<SensorReading>,
}

impl Sight {
    /// The rough pose relative to each target; `None` where there is none, or no world.
    pub(crate) fn rough(&self, targets: &[Target]) -> Vec<Option<Prior>> {
        let prior = |target: &Target| {
            let world = self.prior.as_ref()?;
            target.prior(&world.world_from_camera, &world.covariance)
        };
        targets.iter().map(prior).collect()
    }

    /// The site of a problem, which is about an object of its own; `None` where the passage's is looked at.
    pub(crate) fn own_site(&self) -> Option<Site> {
        match &self.told {
            Told::Problem(problem) => Some(problem_passage::site_of(problem)),
            _ => None,
        }
    }
}

/// What a method is told of one instant beside what the cameras gave and the rough pose in the world.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Told {
    /// Nothing.
    #[default]
    Nothing,
    /// Which feature point each point of the cloud says it is, as (object, point) indices, no two the same: nothing is
    /// searched then.
    Names(Vec<(usize, usize)>),
    /// An identification problem about an object of its own, its tolerance, candidates and rough pose included: only
    /// that object is attempted, and the pipeline's `gate` and `tolerance` have no say.
    Problem(Arc<CoherenceProblem>),
}

/// What the cameras gave.
#[derive(Debug, Clone)]
pub enum Eyes {
    /// A stereo pair.
    Pair(Image, Image),
    /// A cloud that came without images.
    Points(Vec<MeasuredPoint>),
}

/// The rough pose of the left camera in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldPrior {
    /// The pose.
    pub world_from_camera: Transform<World, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<World, Camera>,
}

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

/// A port, and the distance at which the camera behind it was calibrated in the water.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedPort {
    /// The port.
    pub port: Port,
    /// Distance of the calibration (m): the camera's numbers hold there, and only nearly elsewhere.
    pub range: f64,
}

/// A sequence of instants, simulated or recorded, opened and checked.
pub trait Passage: Send + Sync {
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
    fn named(&self) -> bool {
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
    fn hears(&self) -> bool {
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
    fn sight(&self, index: usize) -> Result<Sight, Fault>;
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
    fn open(&self, seed: u64, folder: &Path) -> Result<Box<dyn Passage>, Vec<Fault>>;
    /// Whether its points have pixels, which some solvers need.
    fn has_pixels(&self) -> bool {
        true
    }
    /// Whether it may have readings of the vehicle's Doppler log and gyro; what it opens says whether it has.
    fn may_hear(&self) -> bool {
        false
    }
}

/// All sources.
pub static SOURCES: Registry<dyn Source> = Registry::new(
    "source",
    &[
        entry!(DatasetSource),
        entry!(Dive),
        entry!(DrawnPairs),
        entry!(DrawnProblems),
        entry!(Euroc),
        entry!(Kitti),
        entry!(Mcap),
        entry!(Problems),
        entry!(VirtualImages),
        entry!(VirtualLayouts),
        entry!(VirtualPoints),
    ],
);
