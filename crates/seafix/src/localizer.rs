//! Fixes from stereo pairs or clouds.

use seafix_geometry::MeasuredPoint;
use seafix_io::Rig;
use seafix_navigation::PoseGraph;
use seafix_referencing::{BestPose, Outcome, Search, Site, Solver, Target, TargetKind};
use seafix_vision::{Descriptor, Detector, Matcher};

use crate::{
    error::Error,
    frame_result::{FrameResult, View},
    images::{StereoImages, check_sizes},
    navigation_stack::NavigationStack,
    pipeline::Pipeline,
    pipeline_error::invalid_setting,
    pipeline_settings::PipelineSettings,
    random,
    sensor_frame::{FrameData, Hints, PosePrior, SensorFrame},
    session::NavigationSession,
};

/// The outcome for one target.
#[derive(Debug, Clone)]
pub struct TargetOutcome {
    /// The name of the target: an object's id, or the site's name.
    pub name: String,
    /// The fix, or the reason why there is none.
    pub outcome: Outcome,
    /// The probability that the object is absent.
    pub p_absent: Option<f64>,
    /// The probability that the pose of the fix or, without one, [`best`](Self::best) is not the object's.
    pub p_wrong: Option<f64>,
    /// The best pose of an outcome that is no fix, for a threshold of the user's own; `None` if nothing determines a pose.
    pub best: Option<BestPose>,
}

/// A pipeline that computes fixes for the objects of one site from one stereo rig.
///
/// [`Localizer::new`] uses the default pipeline. [`Localizer::from_toml`] chooses other components by name, and methods
/// such as [`Localizer::with_solver`] take a component as a trait object.
///
/// ```
/// use seafix::{Localizer, Rig, Site, component::Choice, referencing::SOLVERS};
///
/// # fn main() -> Result<(), seafix::Error> {
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
/// # let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
/// let solver = seafix::build(&SOLVERS, &Choice::named("kabsch"))?;
/// let localizer = Localizer::new(&site, &rig)?.with_solver(solver).with_seed(7);
/// assert_eq!(localizer.targets()[0].name, "tree-a");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Localizer {
    pipeline: Pipeline,
    targets: Vec<Target>,
    rig: Rig,
    seed: u64,
}

impl Localizer {
    /// A localizer with the default pipeline.
    ///
    /// # Errors
    /// Those of [`Localizer::with_pipeline`], which the default settings do not cause.
    pub fn new(site: &Site, rig: &Rig) -> Result<Self, Error> {
        Self::with_pipeline(site, rig, &PipelineSettings::default())
    }

    /// A localizer with the pipeline settings in `text`.
    ///
    /// The text is the content of the table `[pipeline]` of an experiment file.
    ///
    /// ```
    /// use seafix::{Error, Localizer, Rig, Site};
    ///
    /// # fn main() -> Result<(), Error> {
    /// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    /// # let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
    /// let settings = "target = 'joint'\nsolver = 'mahalanobis'";
    /// Localizer::from_toml(&site, &rig, settings)?;
    ///
    /// let unknown_key = Localizer::from_toml(&site, &rig, "sover = 'mahalanobis'");
    /// assert!(matches!(unknown_key, Err(Error::Settings(_))));
    /// let unknown_component = Localizer::from_toml(&site, &rig, "solver = 'mahalanbis'");
    /// assert!(matches!(unknown_component, Err(Error::Setting(_))));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Settings`]: invalid TOML or an unknown key. Other errors are those of [`Localizer::with_pipeline`].
    pub fn from_toml(site: &Site, rig: &Rig, text: &str) -> Result<Self, Error> {
        Self::with_pipeline(site, rig, &toml::from_str(text)?)
    }

    /// A localizer with these settings.
    ///
    /// # Errors
    /// [`Error::Setting`]: an unknown component or an invalid value. [`Error::NoWorld`]: an object without a pose in the
    /// world, if the pipeline's target needs one.
    pub fn with_pipeline(site: &Site, rig: &Rig, settings: &PipelineSettings) -> Result<Self, Error> {
        let pipeline = settings.build()?;
        let targets = site
            .targets(settings.target)
            .map_err(|missing| Error::NoWorld { purpose: "search for the complete site", object: missing.object })?;
        Ok(Self { pipeline, targets, rig: rig.clone(), seed: 0 })
    }

    /// Replaces the solver of the rigid motion.
    #[must_use]
    pub fn with_solver(mut self, solver: Box<dyn Solver>) -> Self {
        self.pipeline.solver = solver;
        self
    }

    /// Replaces the search of Stage 2.
    #[must_use]
    pub fn with_search(mut self, search: Box<dyn Search>) -> Self {
        self.pipeline.search = search;
        self
    }

    /// Replaces the corner detector.
    #[must_use]
    pub fn with_detector(mut self, detector: Box<dyn Detector>) -> Self {
        self.pipeline.front_end.detector = detector;
        self
    }

    /// Replaces the descriptor.
    #[must_use]
    pub fn with_descriptor(mut self, descriptor: Box<dyn Descriptor>) -> Self {
        self.pipeline.front_end.descriptor = descriptor;
        self
    }

    /// Replaces the matcher.
    #[must_use]
    pub fn with_matcher(mut self, matcher: Box<dyn Matcher>) -> Self {
        self.pipeline.front_end.matcher = matcher;
        self
    }

    /// Sets the seed of searches that draw random numbers; 0 by default.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The targets: the objects of the site, or the site as one.
    pub fn targets(&self) -> &[Target] {
        &self.targets
    }

    /// The stereo rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Outcomes of a stereo pair, one for each target in view by the prior.
    ///
    /// A target is searched in the complete cloud if there is no prior, or if the target has no pose in the world.
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

    /// Outcomes of a cloud of measured points (camera frame, m).
    ///
    /// Each target in view by the prior has an outcome. Without a prior every target is searched in the complete cloud.
    ///
    /// The default solver minimises reprojection errors and needs points with pixels. The solver `mahalanobis` needs
    /// covariances only.
    ///
    /// ```
    /// use nalgebra::{Matrix3, Vector3};
    /// use seafix::geometry::{MeasuredPoint, Point, UncertainPoint};
    /// use seafix::{Localizer, Outcome, Rig, Site};
    ///
    /// # fn main() -> Result<(), seafix::Error> {
    /// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    /// # let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
    /// let localizer = Localizer::from_toml(&site, &rig, "solver = 'mahalanobis'")?;
    /// let covariance = Matrix3::identity() * 0.008_f64.powi(2);
    /// let point = |x, y, z| {
    ///     let at = Point::from(Vector3::new(x, y, z));
    ///     MeasuredPoint { position: UncertainPoint { at, covariance }, pixels: None }
    /// };
    /// let cloud = [point(-0.6747, 0.4299, 2.7510), point(0.3571, 0.3343, 2.7467)];
    /// for target in localizer.localize_points(&cloud, None) {
    ///     // Two points do not determine a pose.
    ///     assert!(!matches!(target.outcome, Outcome::Fix(_)), "{}", target.name);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn localize_points<'a>(
        &self,
        points: &[MeasuredPoint],
        prior: impl Into<Option<&'a PosePrior>>,
    ) -> Vec<TargetOutcome> {
        self.outcomes(self.process(&frame(FrameData::Points(points.to_vec()), prior.into())))
    }

    /// The complete result for one frame: key points, cloud, candidates and outcomes.
    pub fn process(&self, frame: &SensorFrame) -> FrameResult {
        let rig = &self.rig.stereo;
        let priors = frame.target_priors(&self.targets);
        let regions = self.pipeline.regions(&self.targets, &[&priors], rig);
        let cloud = self.pipeline.cloud(&frame.frame_data, rig, &self.targets, &regions);
        let view = View { sensor_frame: frame, cloud: &cloud, targets: &self.targets, rig };
        let mut rng = random::of_frame(self.seed, frame.stamp_ns);
        let mut result = self.pipeline.fix_from(view, &priors, None, &mut rng);
        if self.pipeline.settings().target == TargetKind::Joint {
            let own = self.pipeline.object_observations(&mut result, &self.targets, rig);
            self.pipeline.join(&mut result, &[], &own, &self.targets, rig);
        }
        result
    }

    /// Begins a navigation session.
    ///
    /// A stack with key frames also recognises those of `map`, the pose graph of an earlier session.
    ///
    /// # Errors
    /// [`Error::Setting`]: a pipeline whose target is not `object`. [`Error::NoWorld`]: an object without a pose in the world.
    pub fn navigate<'a>(
        &'a self,
        navigation_stack: &'a NavigationStack,
        map: Option<&PoseGraph>,
    ) -> Result<NavigationSession<'a>, Error> {
        if self.pipeline.settings().target != TargetKind::Object {
            let message = "navigation goes from object to object; use target = \"object\"".to_owned();
            return Err(invalid_setting("target", message).into());
        }
        let missing = self.targets.iter().find(|target| target.world_from_object.is_none());
        if let Some(target) = missing {
            return Err(Error::NoWorld { purpose: "navigate", object: target.name.clone() });
        }
        let (rig, mounting) = (&self.rig.stereo, self.rig.body_from_camera);
        let session = NavigationSession::begin(navigation_stack, &self.pipeline, &self.targets, rig, mounting, map);
        Ok(session.with_seed(self.seed))
    }

    fn outcomes(&self, result: FrameResult) -> Vec<TargetOutcome> {
        let outcome = |attempt: crate::frame_result::TargetAttempt| TargetOutcome {
            name: self.targets[attempt.target].name.clone(),
            outcome: attempt.answer.outcome,
            p_absent: attempt.answer.p_absent,
            p_wrong: attempt.answer.p_wrong,
            best: attempt.answer.best,
        };
        result.attempts.into_iter().map(outcome).collect()
    }
}

/// A single frame, at time zero.
fn frame(frame_data: FrameData, prior: Option<&PosePrior>) -> SensorFrame {
    SensorFrame { stamp_ns: 0, frame_data, prior: prior.copied(), hints: Hints::Nothing, readings: Vec::new() }
}
