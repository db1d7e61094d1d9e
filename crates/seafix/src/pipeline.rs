//! Settings of the pipeline from a sensor frame to fixes, and the components built from them.

use seafix_component::{BuildError, Choice, Part, Registry, Settings, each_invalid, in_range, out_of_range};
use seafix_referencing::{Acceptance, Gate, SEARCHES, SOLVERS, TargetKind, Tolerance};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, EdgeCorners, FILTERS, Filter, FrontEnd, InvalidStage, LOCATORS, LineChoices, LineFrontEnd,
    LineRules, MATCHERS, REFINEMENTS, SEGMENT_DETECTORS, SEGMENT_MATCHERS, SegmentFit, StageChoices, TRIANGULATORS,
    read_refinement, read_triangulator,
};
use serde::{Deserialize, Serialize};

use crate::stages::PipelineStages;

/// The settings of the pipeline from a sensor frame to a fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Pipeline {
    /// The target of a search: each object in view, each object followed by a joint fix, or the complete site.
    pub target: TargetKind,
    /// The number of frames of a joint fix, 1 to 1000: the current frame and those before it. A fix from a single pair has
    /// only the current one.
    pub window: usize,
    /// The filters applied to each image, in order; none by default.
    pub filters: Vec<Choice>,
    /// The corner detector.
    pub detector: Choice,
    /// The locator that refines the position of a detected corner.
    pub locator: Choice,
    /// The descriptor of a corner's neighbourhood.
    pub descriptor: Choice,
    /// The matcher of left and right key points.
    pub matcher: Choice,
    /// The refinement of a match to a fraction of a pixel. A table without `name` has the settings of `direct`.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// The triangulator of matched pairs. A table without `name` has the settings of `optimal`.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// Whether points of the model are identified. Without them objects are attempted by their edges alone, and objects
    /// without edges are not attempted.
    pub points: UseOfPoints,
    /// Whether straight edges of the model are identified beside its points; a site without edges has none.
    pub edges: UseOfEdges,
    /// The features that decide whether an object is attempted.
    pub attempts: Attempts,
    /// The detector of straight segments.
    pub segment_detector: Choice,
    /// The fit of a segment over its length.
    pub segment_fit: SegmentFit,
    /// The matcher of left and right segments.
    pub segment_matcher: Choice,
    /// The triangulation of matched segments.
    pub lines: LineRules,
    /// Corners that are intersections of edges. They become points of the cloud, unless the edges are identified
    /// themselves.
    pub edge_corners: EdgeCorners,
    /// The gates of the candidate selection ("shells" in the paper).
    pub gate: Gate,
    /// Whether the search is repeated with larger gates, then without, when it finds nothing. A displaced object is
    /// outside its gates.
    pub expand_gates: bool,
    /// The tolerance within which two distances agree.
    pub tolerance: Tolerance,
    /// The search of Stage 2. Labelled points need none.
    pub search: Choice,
    /// The solver of the rigid motion.
    pub solver: Choice,
    /// The acceptance tests of a fix.
    pub acceptance: Acceptance,
}

impl Default for Pipeline {
    fn default() -> Self {
        Self {
            target: TargetKind::Object,
            window: 1,
            filters: Vec::new(),
            detector: Choice::named("harris"),
            locator: Choice::named("corner-junction"),
            descriptor: Choice::named("surf"),
            matcher: Choice::named("epipolar-band"),
            refinement: Choice::named("direct"),
            triangulator: Choice::named("optimal"),
            points: UseOfPoints::On,
            edges: UseOfEdges::On,
            attempts: Attempts::Identified,
            segment_detector: Choice::named("a-contrario"),
            segment_fit: SegmentFit::default(),
            segment_matcher: Choice::named("overlap-profile"),
            lines: LineRules::default(),
            edge_corners: EdgeCorners::default(),
            gate: Gate::default(),
            expand_gates: false,
            tolerance: Tolerance::Sigmas(3.0),
            search: Choice::named("rigid-consensus"),
            solver: Choice::named("stereo-reprojection"),
            acceptance: Acceptance::default(),
        }
    }
}

/// The use of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum UseOfPoints {
    /// Points are measured and identified.
    #[default]
    On,
    /// Edges alone.
    Off,
}

/// The use of straight edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum UseOfEdges {
    /// Edges are measured and identified where the site has some.
    #[default]
    On,
    /// Points alone.
    Off,
}

/// The features of which three must be in view by the prior; without a prior every object is attempted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Attempts {
    /// The features that the pipeline identifies; edges count if the frame has measured lines, or without points.
    #[default]
    Identified,
    /// All points and edges of the model: pipelines that identify different features make the same attempts.
    Model,
}

/// An invalid setting of the pipeline or of navigation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct PipelineError {
    /// The key below `pipeline` or `navigation`.
    pub setting: &'static str,
    /// The key below `setting`, if known; `name` for an unknown component.
    pub key: Option<String>,
    /// The faulty part: key or value.
    pub part: Part,
    /// The existing component whose name is closest to an unknown name.
    pub near: Option<&'static str>,
    /// The fault and the closest valid setting.
    pub message: String,
}

impl Pipeline {
    /// The same pipeline with the defaults of all components written out.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self {
            filters: each_filter(&self.filters, resolve)?,
            detector: resolve(&DETECTORS, &self.detector)?,
            descriptor: resolve(&DESCRIPTORS, &self.descriptor)?,
            matcher: resolve(&MATCHERS, &self.matcher)?,
            locator: resolve(&LOCATORS, &self.locator)?,
            refinement: resolve(&REFINEMENTS, &self.refinement)?,
            triangulator: resolve(&TRIANGULATORS, &self.triangulator)?,
            segment_detector: resolve(&SEGMENT_DETECTORS, &self.segment_detector)?,
            segment_matcher: resolve(&SEGMENT_MATCHERS, &self.segment_matcher)?,
            search: resolve(&SEARCHES, &self.search)?,
            solver: resolve(&SOLVERS, &self.solver)?,
            ..self.clone()
        })
    }

    /// All faults that keep the pipeline from being built.
    pub fn invalid(&self) -> Vec<PipelineError> {
        let filters = self.filters.iter().enumerate().flat_map(|(place, choice)| {
            let of = move |error: PipelineError| in_list(place, error);
            faults(&FILTERS, choice).into_iter().map(of)
        });
        let mut all: Vec<PipelineError> = filters.collect();
        all.extend(faults(&DETECTORS, &self.detector));
        all.extend(faults(&LOCATORS, &self.locator));
        all.extend(faults(&DESCRIPTORS, &self.descriptor));
        all.extend(faults(&MATCHERS, &self.matcher));
        all.extend(faults(&REFINEMENTS, &self.refinement));
        all.extend(faults(&TRIANGULATORS, &self.triangulator));
        all.extend(faults(&SEGMENT_DETECTORS, &self.segment_detector));
        all.extend(faults(&SEGMENT_MATCHERS, &self.segment_matcher));
        let fit = each_invalid(&self.segment_fit, SegmentFit::check);
        all.extend(fit.into_iter().map(|message| invalid_setting("segment-fit", message)));
        let lines = each_invalid(&self.lines, LineRules::check);
        all.extend(lines.into_iter().map(|message| invalid_setting("lines", message)));
        let corners = each_invalid(&self.edge_corners, EdgeCorners::check);
        all.extend(corners.into_iter().map(|message| invalid_setting("edge-corners", message)));
        all.extend(faults(&SEARCHES, &self.search));
        all.extend(faults(&SOLVERS, &self.solver));
        all.extend(each_invalid(&self.gate, Gate::check).into_iter().map(|message| invalid_setting("gate", message)));
        all.extend(
            each_invalid(&self.tolerance, Tolerance::check)
                .into_iter()
                .map(|message| invalid_setting("tolerance", message)),
        );
        let acceptance = each_invalid(&self.acceptance, Acceptance::check);
        all.extend(acceptance.into_iter().map(|message| invalid_setting("acceptance", message)));
        all.extend(self.window_fits().err());
        all.extend(self.has_features().err());
        all
    }

    /// Checks that a pipeline without points identifies edges.
    fn has_features(&self) -> Result<(), PipelineError> {
        let fault = |cause: &str| Err(invalid_setting("points", format!("points = off; {cause}")));
        if self.points == UseOfPoints::On {
            return Ok(());
        }
        if self.edges == UseOfEdges::Off {
            return fault("`edges` is off too; switch one of them on");
        }
        // An unknown component is a fault of its own.
        if build(&SEARCHES, &self.search).is_ok_and(|search| !search.takes_edges()) {
            return fault(&format!("the search `{}` takes no edges; choose rigid-consensus", self.search.name));
        }
        if build(&SOLVERS, &self.solver).is_ok_and(|solver| !solver.takes_edges()) {
            return fault(&format!("the solver `{}` takes no edges; choose stereo-reprojection", self.solver.name));
        }
        Ok(())
    }

    fn window_fits(&self) -> Result<(), PipelineError> {
        let fits = in_range((1..=1000).contains(&self.window), "window", self.window, "1 to 1000");
        fits.map_err(|message| invalid_setting("window", message))
    }

    /// The standard deviation of a key point's coordinates without a corner fit (px); `None` for an invalid
    /// triangulator.
    pub fn pixel_sigma(&self) -> Option<f64> {
        build(&TRIANGULATORS, &self.triangulator).ok().map(|triangulator| triangulator.rules().sigma_px)
    }

    /// The front end: the stages from two images to a cloud.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn front_end(&self) -> Result<FrontEnd, PipelineError> {
        let choices = StageChoices {
            filters: &self.filters,
            detector: &self.detector,
            locator: &self.locator,
            descriptor: &self.descriptor,
            matcher: &self.matcher,
            refinement: &self.refinement,
            triangulator: &self.triangulator,
        };
        FrontEnd::build(&choices).map_err(|InvalidStage { stage, place, error }| {
            let error = invalid(stage, &error);
            match place {
                Some(place) => in_list(place, error),
                None => error,
            }
        })
    }

    /// The stages from two images to measured lines.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn line_front_end(&self) -> Result<LineFrontEnd, PipelineError> {
        self.segment_fit.check().map_err(|message| invalid_setting("segment-fit", message))?;
        self.lines.check().map_err(|message| invalid_setting("lines", message))?;
        self.edge_corners.check().map_err(|message| invalid_setting("edge-corners", message))?;
        let choices = LineChoices {
            segment_detector: &self.segment_detector,
            segment_fit: &self.segment_fit,
            segment_matcher: &self.segment_matcher,
            lines: &self.lines,
            // One error of the camera model affects points and lines.
            calibration_px: build(&TRIANGULATORS, &self.triangulator)?.rules().calibration_px,
        };
        LineFrontEnd::build(&choices).map_err(|InvalidStage { stage, error, .. }| invalid(stage, &error))
    }

    /// Builds all components.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn build(&self) -> Result<PipelineStages, PipelineError> {
        self.gate.check().map_err(|message| invalid_setting("gate", message))?;
        self.tolerance.check().map_err(|message| invalid_setting("tolerance", message))?;
        self.acceptance.check().map_err(|message| invalid_setting("acceptance", message))?;
        self.window_fits()?;
        self.has_features()?;
        let (search, solver) = (build(&SEARCHES, &self.search)?, build(&SOLVERS, &self.solver)?);
        Ok(PipelineStages::new(self.front_end()?, self.line_front_end()?, search, solver, self.clone()))
    }
}

/// The error of a setting without component, such as `gate` or `acceptance`.
pub fn invalid_setting(setting: &'static str, message: String) -> PipelineError {
    // Some messages begin with the name of the setting.
    let own = message.strip_prefix(&format!("{setting}: ")).unwrap_or(&message);
    // The keys of a list's entries have indices, as in `faults[0].to`.
    let (key, message) = match out_of_range(own) {
        Some(key) => match key.strip_prefix(setting) {
            Some(below) => (Some(below.to_owned()).filter(|below| !below.is_empty()), own.to_owned()),
            None => (Some(key), format!("{setting}: {own}")),
        },
        None => (None, format!("{setting}: {own}")),
    };
    PipelineError { setting, key, part: Part::Value, near: None, message }
}

/// The choice with all defaults of its component written out.
///
/// # Errors
/// An unknown component or an invalid value.
pub fn resolve<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Result<Choice, PipelineError> {
    registry.resolve(choice).map_err(|error| in_pipeline(registry, &error))
}

/// Builds the chosen component.
///
/// # Errors
/// An unknown component or an invalid value.
pub fn build<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Result<Box<T>, PipelineError> {
    registry.build(choice).map_err(|error| in_pipeline(registry, &error))
}

/// All faults that keep a component from being built.
pub fn faults<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Vec<PipelineError> {
    registry.faults(choice).iter().map(|error| in_pipeline(registry, error)).collect()
}

/// The fault of the filter at index `place` of the list.
fn in_list(place: usize, error: PipelineError) -> PipelineError {
    let below = error.key.map_or_else(String::new, |key| format!(".{key}"));
    PipelineError { setting: "filters", key: Some(format!("{place}{below}")), ..error }
}

/// Applies `make` to each filter; an error names the filter's index.
fn each_filter<T>(
    choices: &[Choice],
    make: fn(&Registry<dyn Filter>, &Choice) -> Result<T, PipelineError>,
) -> Result<Vec<T>, PipelineError> {
    let one = |(place, choice)| make(&FILTERS, choice).map_err(|error| in_list(place, error));
    choices.iter().enumerate().map(one).collect()
}

fn in_pipeline<T: ?Sized>(registry: &Registry<T>, error: &BuildError) -> PipelineError {
    invalid(registry.kind(), error)
}

/// The fault of a component as the fault of its setting.
fn invalid(setting: &'static str, error: &BuildError) -> PipelineError {
    let key = error.key().map(str::to_owned);
    PipelineError { setting, key, part: error.part(), near: error.near(), message: error.to_string() }
}
