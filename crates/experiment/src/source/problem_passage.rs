//! Identification problems as the frames of a passage: what both sources of problems share.

use std::sync::Arc;

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Object, StereoRig, Transform, World};
use seafix_referencing::{Site, SiteObject, problem_file::CoherenceProblem};
use seafix_simulation::VirtualRig;

use super::{Eyes, Passage, Sight, Told, TrueAnswer, Truth};

/// Time between frames (ns): problems have none.
const STEP_NS: u64 = 100_000_000;

/// A problem, and what is true of it where that is known.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    pub(super) problem: Arc<CoherenceProblem>,
    pub(super) truth: Option<(Transform<Object, Camera>, TrueAnswer)>,
}

/// A problem a frame: its model is an object of its own, of a site that has no world.
pub(super) struct ProblemPassage {
    name: String,
    site: Site,
    rig: StereoRig,
    posed: Vec<Posed>,
    inputs: Vec<(String, String)>,
}

impl ProblemPassage {
    /// The problems in this order; their ids differ. `inputs` are the files they came from, with their hashes.
    pub(super) fn new(name: String, posed: Vec<Posed>, inputs: Vec<(String, String)>) -> Self {
        let object = |posed: &Posed| SiteObject {
            id: posed.problem.id.clone(),
            base: [0, 1, 2],
            base_in_world: None,
            survey_sigma: 0.0,
            world_from_object: None,
            points: posed.problem.model.clone(),
            interest: Vec::new(),
        };
        let objects = posed.iter().map(object).collect();
        let site = Site { name: "problems".to_owned(), frame: 0, objects, warnings: Vec::new() };
        let rig = VirtualRig::default().build().expect("the default rig is sound");
        Self { name, site, rig, posed, inputs }
    }
}

impl Passage for ProblemPassage {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        &self.site
    }

    /// Problems come without cameras; logs and viewers have this one.
    fn rig(&self) -> &StereoRig {
        &self.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        Transform::identity()
    }

    fn images(&self) -> bool {
        false
    }

    fn frames(&self) -> usize {
        self.posed.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        None
    }

    fn sight(&self, index: usize) -> Result<Sight, Fault> {
        let problem = &self.posed[index].problem;
        Ok(Sight {
            stamp_ns: index as u64 * STEP_NS,
            eyes: Eyes::Points(problem.cloud.clone()),
            prior: None,
            told: Told::Problem(index, Arc::clone(problem)),
            readings: Vec::new(),
        })
    }

    /// The world of a frame is its object's.
    fn truth(&self, index: usize) -> Option<Truth> {
        let (object_from_camera, answer) = self.posed[index].truth.as_ref()?;
        let place = |object: usize| (object == index).then(Transform::<World, Object>::identity);
        Some(Truth {
            world_from_camera: object_from_camera.relabel(),
            world_from_object: (0..self.posed.len()).map(place).collect(),
            visible: Some(answer.pairs.iter().map(|&(model, _)| (index, model)).collect()),
            bound: None,
            answer: Some(answer.clone()),
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        Ok(self.inputs.clone())
    }
}
