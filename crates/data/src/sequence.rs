//! A sequence of sensor frames with its truth, and the sources that open one.

use std::path::Path;

use seafix::SensorFrame;
use seafix_component::Fault;
use seafix_evaluation::Solved;
use seafix_geometry::{Body, Camera, Covariance6, Object, StereoRig, Transform, World};
use seafix_referencing::Site;

use crate::ports::CalibratedPort;

/// The ground truth of one frame. Evaluation uses it; no method receives it.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The pose of the left camera.
    pub world_from_camera: Transform<World, Camera>,
    /// The pose of each object of the site, in its order; `None` without a known world. A coherence problem has one
    /// object.
    pub world_from_object: Vec<Option<Transform<World, Object>>>,
    /// The feature points in view of both cameras, as (object, point) indices; `None` if unknown.
    pub visible: Option<Vec<(usize, usize)>>,
    /// The Cramér–Rao bound of the pose relative to an object of the site: the lower bound of the covariance of any
    /// unbiased estimate.
    pub bound: Option<(usize, Covariance6<Object, Camera>)>,
    /// The answer to the coherence problem, if the frame is one.
    pub answer: Option<TrueAnswer>,
}

/// The true answer to a coherence problem, and the rule by which a pose is correct.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueAnswer {
    /// The true pairs (model point, cloud point).
    pub pairs: Vec<(usize, usize)>,
    /// The rule by which a pose is correct.
    pub rule: Solved,
}

/// A sequence of sensor frames, simulated or recorded, opened and checked.
pub trait Sequence: Send + Sync {
    /// The name of the sequence in messages and reports.
    fn name(&self) -> &str;
    /// The site; without objects if each frame brings an object of its own.
    fn site(&self) -> &Site;
    /// The rig that methods receive.
    fn rig(&self) -> &StereoRig;
    /// The pose of the left camera in the vehicle.
    fn body_from_camera(&self) -> Transform<Body, Camera>;
    /// Whether the sequence has images rather than clouds.
    fn images(&self) -> bool;
    /// Whether all points are labelled, so that no search runs.
    fn labelled(&self) -> bool {
        false
    }
    /// Whether every frame is a coherence problem with its own object; the sequence then has no site.
    fn posed(&self) -> bool {
        false
    }
    /// The number of frames.
    fn frames(&self) -> usize;
    /// The number of frame `index` in logs, which also seeds the random numbers of methods.
    fn number(&self, index: usize) -> u64 {
        index as u64
    }
    /// The typical standard deviations of the prior: position per world axis (m) and attitude per camera axis (rad).
    fn prior_sigma(&self) -> Option<(f64, f64)>;
    /// The standard deviation of a pixel coordinate in clouds without images (px), if known.
    fn pixel_sigma(&self) -> Option<f64> {
        None
    }
    /// The number of significant bits of a pixel.
    fn bits(&self) -> u8 {
        8
    }
    /// The ports in front of the cameras, with the distances of their calibration.
    fn ports(&self) -> [Option<CalibratedPort>; 2] {
        [None, None]
    }
    /// Whether the sequence has readings of both the Doppler log and the gyro.
    fn has_readings(&self) -> bool {
        false
    }
    /// The readings of the navigation sensors as tables: file names and CSV text.
    fn sensors(&self) -> Vec<(String, String)> {
        Vec::new()
    }
    /// Warnings about the data.
    fn warnings(&self) -> &[Fault] {
        &[]
    }
    /// The sensor frame at `index`.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault>;
    /// The ground truth at `index`, if known.
    fn truth(&self, index: usize) -> Option<Truth>;
    /// The input files with their SHA-256.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn inputs(&self) -> Result<Vec<(String, String)>, Fault>;
}

/// A source of stereo pairs or clouds.
pub trait Source: Send + Sync + std::fmt::Debug {
    /// Opens the sequence that `seed` selects. Relative paths start from `folder`. Everything except image content is
    /// checked.
    ///
    /// # Errors
    /// All faults of the source.
    fn open(&self, seed: u64, folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>>;
    /// Whether its points have pixels, which some solvers need.
    fn has_pixels(&self) -> bool {
        true
    }
    /// Whether it may have readings of the Doppler log and gyro; [`Sequence::has_readings`] decides.
    fn may_have_readings(&self) -> bool {
        false
    }
}
