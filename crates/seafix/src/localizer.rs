//! Fixes from stereo pairs or clouds.

use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Transform, World};
use seafix_io::Rig;
use seafix_navigation::PoseGraph;
use seafix_referencing::{Outcome, Search, Site, Solver, Target, TargetKind};
use seafix_vision::{Descriptor, Detector, Matcher};

use crate::{
    Error, FrameData, FrameResult, Hints, NavigationSession, NavigationStack, Pipeline, PipelineStages, SensorFrame,
    StereoImages, WorldPrior, images::check_sizes, random, stages::View,
};

/// A prior pose of the left camera in the world, with its covariance.
pub type PosePrior = WorldPrior;

impl WorldPrior {
    /// A prior whose error has the same standard deviation in every direction: `attitude` (rad) per axis of the camera,
    /// `position` (m) per axis.
    pub fn isotropic(world_from_camera: Transform<World, Camera>, attitude: f64, position: f64) -> Self {
        Self { world_from_camera, covariance: Covariance6::isotropic(attitude, position) }
    }
}

/// The outcome of the attempt to fix one target.
#[derive(Debug, Clone)]
pub struct TargetOutcome {
    /// The name of the target: an object's id, or the site's name.
    pub name: String,
    /// A fix, or why there is none.
    pub outcome: Outcome,
}

/// A pipeline for one site and one rig: it finds the objects of the site in stereo pairs or clouds.
///
/// [`Localizer::new`] takes the default pipeline. A component of another name is chosen in a TOML text
/// ([`Localizer::from_toml`]); a component of one's own is given as a trait object ([`Localizer::with_solver`]).
#[derive(Debug)]
pub struct Localizer {
    stages: PipelineStages,
    targets: Vec<Target>,
    rig: Rig,
    seed: u64,
}

impl Localizer {
    /// A localizer with the default pipeline.
    ///
    /// # Errors
    /// [`Error::NoWorld`]: an object without a place in the world, where the pipeline's target needs it.
    pub fn new(site: &Site, rig: &Rig) -> Result<Self, Error> {
        Self::with_pipeline(site, rig, &Pipeline::default())
    }

    /// A localizer with the pipeline settings in `text`, the table `[pipeline]` of an experiment file.
    ///
    /// # Errors
    /// [`Error::Settings`]: no valid TOML, or an unknown key; else as [`Localizer::with_pipeline`].
    pub fn from_toml(site: &Site, rig: &Rig, text: &str) -> Result<Self, Error> {
        Self::with_pipeline(site, rig, &toml::from_str(text)?)
    }

    /// A localizer with these settings.
    ///
    /// # Errors
    /// [`Error::Setting`]: an unknown component or an invalid value. [`Error::NoWorld`]: an object without a place in the
    /// world, where the pipeline's target needs it.
    pub fn with_pipeline(site: &Site, rig: &Rig, pipeline: &Pipeline) -> Result<Self, Error> {
        let stages = pipeline.build()?;
        let targets = site
            .targets(pipeline.target)
            .map_err(|missing| Error::NoWorld { purpose: "search for the whole site", object: missing.object })?;
        Ok(Self { stages, targets, rig: rig.clone(), seed: 0 })
    }

    /// The same with another solver.
    #[must_use]
    pub fn with_solver(mut self, solver: Box<dyn Solver>) -> Self {
        self.stages.solver = solver;
        self
    }

    /// The same with another search.
    #[must_use]
    pub fn with_search(mut self, search: Box<dyn Search>) -> Self {
        self.stages.search = search;
        self
    }

    /// The same with another detector.
    #[must_use]
    pub fn with_detector(mut self, detector: Box<dyn Detector>) -> Self {
        self.stages.front_end.detector = detector;
        self
    }

    /// The same with another descriptor.
    #[must_use]
    pub fn with_descriptor(mut self, descriptor: Box<dyn Descriptor>) -> Self {
        self.stages.front_end.descriptor = descriptor;
        self
    }

    /// The same with another matcher.
    #[must_use]
    pub fn with_matcher(mut self, matcher: Box<dyn Matcher>) -> Self {
        self.stages.front_end.matcher = matcher;
        self
    }

    /// The same with another seed for searches that draw random numbers; the default is 0.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The targets, in the order of the outcomes.
    pub fn targets(&self) -> &[Target] {
        &self.targets
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Fixes from a stereo pair: an outcome for each target that the prior puts in view.
    ///
    /// Without a prior every target is searched in the whole cloud.
    ///
    /// # Errors
    /// [`Error::ImageSize`]: an image of another size than its camera is calibrated for.
    pub fn localize<'a>(
        &self,
        images: &StereoImages,
        prior: impl Into<Option<&'a PosePrior>>,
    ) -> Result<Vec<TargetOutcome>, Error> {
        check_sizes(&images.left, &images.right, &self.rig.stereo)?;
        let frame_data = FrameData::Stereo(images.left.clone(), images.right.clone());
        Ok(self.outcomes(self.process(&frame(frame_data, prior.into()))))
    }

    /// Fixes from a cloud of measured points (camera frame, m): an outcome for each target that the prior puts in view.
    ///
    /// A solver that works on pixels, as the default does, uses the points' pixels where they have any.
    pub fn localize_points<'a>(
        &self,
        points: &[MeasuredPoint],
        prior: impl Into<Option<&'a PosePrior>>,
    ) -> Vec<TargetOutcome> {
        self.outcomes(self.process(&frame(FrameData::Points(points.to_vec()), prior.into())))
    }

    /// Everything that the pipeline computed from one frame: key points, cloud, candidates and answers.
    pub fn process(&self, frame: &SensorFrame) -> FrameResult {
        let rig = &self.rig.stereo;
        let cloud = self.stages.cloud(&frame.frame_data, rig);
        let view = View { sensor_frame: frame, cloud: &cloud, targets: &self.targets, rig };
        let priors = frame.prior_pose(&self.targets);
        let mut rng = random::of_frame(self.seed, frame.stamp_ns);
        let mut result = self.stages.fix_from(view, &priors, None, &mut rng);
        if self.stages.settings().target == TargetKind::Joint {
            let own = self.stages.object_observations(&mut result, &self.targets, rig);
            self.stages.join(&mut result, &[], &own, &self.targets, rig);
        }
        result
    }

    /// Begins to navigate with these components, from `map` where an earlier session left one.
    ///
    /// # Errors
    /// [`Error::NoWorld`]: navigation needs the place of every object in the world.
    pub fn navigate<'a>(
        &'a self,
        navigation_stack: &'a NavigationStack,
        map: Option<&PoseGraph>,
    ) -> Result<NavigationSession<'a>, Error> {
        let missing = self.targets.iter().find(|target| target.world_from_object.is_none());
        if let Some(target) = missing {
            return Err(Error::NoWorld { purpose: "navigate", object: target.name.clone() });
        }
        Ok(NavigationSession::begin(
            navigation_stack,
            &self.stages,
            &self.targets,
            &self.rig.stereo,
            self.rig.body_from_camera,
            map,
        ))
    }

    fn outcomes(&self, result: FrameResult) -> Vec<TargetOutcome> {
        let outcome = |attempt: crate::TargetAttempt| TargetOutcome {
            name: self.targets[attempt.target].name.clone(),
            outcome: attempt.answer.outcome,
        };
        result.attempts.into_iter().map(outcome).collect()
    }
}

/// A single frame, at time zero.
fn frame(frame_data: FrameData, prior: Option<&PosePrior>) -> SensorFrame {
    SensorFrame { stamp_ns: 0, frame_data, prior: prior.copied(), hints: Hints::Nothing, readings: Vec::new() }
}
