//! Coherence problems as the frames of a sequence.

use std::sync::Arc;

use seafix::{FrameData, Hints, SensorFrame};
use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Object, StereoRig, Transform};
use seafix_referencing::{Site, SiteObject, problem_file::CoherenceProblem};
use seafix_simulation::VirtualRig;

use crate::sequence::{Sequence, TrueAnswer, Truth};

/// The nominal time between frames (ns); problems have no time.
const STEP_NS: u64 = 100_000_000;

/// A problem, and its truth if known.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    pub(super) problem: Arc<CoherenceProblem>,
    pub(super) truth: Option<(Transform<Object, Camera>, TrueAnswer)>,
}

/// A function from an index to its problem, always the same one.
type Posing = Box<dyn Fn(usize) -> Posed + Send + Sync>;

/// A sequence of coherence problems. The model of each frame is an object of its own, without a pose in the world.
/// Generated problems are created one at a time.
pub(super) struct ProblemSequence {
    name: String,
    site: Site,
    rig: StereoRig,
    frames: usize,
    posing: Posing,
    inputs: Vec<(String, String)>,
}

/// The empty site of the sequence; each frame has its own.
pub(super) fn no_site() -> Site {
    Site { name: "problems".to_owned(), frame: 0, objects: Vec::new(), warnings: Vec::new() }
}

/// The site of one problem with its only object.
pub(super) fn site_of(problem: &CoherenceProblem) -> Site {
    let object = SiteObject {
        id: problem.id.clone(),
        base: [0, 1, 2],
        base_in_world: None,
        survey_sigma: 0.0,
        world_from_object: None,
        points: problem.model.clone(),
        edges: problem.edges.model.clone(),
        interest: Vec::new(),
    };
    Site { objects: vec![object], ..no_site() }
}

/// The measurements of a problem.
fn features(problem: &CoherenceProblem) -> FrameData {
    match problem.edges.lines.is_empty() {
        true => FrameData::Points(problem.cloud.clone()),
        false => FrameData::Features(problem.cloud.clone(), problem.edges.lines.clone()),
    }
}

impl ProblemSequence {
    /// A sequence of N problems with distinct ids. `inputs` are the files that they were read from, with their hashes.
    pub(super) fn new(
        name: String,
        frames: usize,
        posing: impl Fn(usize) -> Posed + Send + Sync + 'static,
        inputs: Vec<(String, String)>,
    ) -> Self {
        let rig = VirtualRig::default().build().expect("the default rig is valid");
        Self { name, site: no_site(), rig, frames, posing: Box::new(posing), inputs }
    }
}

impl Sequence for ProblemSequence {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        &self.site
    }

    /// Problems have no cameras; logs and viewers receive this rig.
    fn rig(&self) -> &StereoRig {
        &self.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        Transform::identity()
    }

    fn images(&self) -> bool {
        false
    }

    fn posed(&self) -> bool {
        true
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        None
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let problem = (self.posing)(index).problem;
        Ok(SensorFrame {
            stamp_ns: index as u64 * STEP_NS,
            frame_data: features(&problem),
            prior: None,
            hints: Hints::Problem(problem),
            readings: Vec::new(),
        })
    }

    /// The world frame is that of the object.
    fn truth(&self, index: usize) -> Option<Truth> {
        let (object_from_camera, answer) = (self.posing)(index).truth?;
        Some(Truth {
            world_from_camera: object_from_camera.relabel(),
            world_from_object: vec![Some(Transform::identity())],
            visible: Some(answer.pairs.iter().map(|&(model, _)| (0, model)).collect()),
            bound: None,
            answer: Some(answer),
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        Ok(self.inputs.clone())
    }
}
