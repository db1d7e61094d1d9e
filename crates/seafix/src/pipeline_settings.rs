//! Settings of the pipeline from a sensor frame to fixes, and the components built from them.

use seafix_component::{Choice, Settings, each_invalid, in_range};
use seafix_referencing::{Acceptance, Gate, SEARCHES, SOLVERS, TargetKind, Tolerance};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, EdgeCorners, FILTERS, FrontEnd, LOCATORS, LineFrontEnd, LineRules, MATCHERS,
    OutlineCorners, REFINEMENTS, SEGMENT_DETECTORS, SEGMENT_MATCHERS, SegmentFit, TRIANGULATORS, read_refinement,
    read_triangulator,
};
use serde::{Deserialize, Serialize};

use crate::{
    choices,
    pipeline::Pipeline,
    pipeline_error::{PipelineError, build, invalid_setting},
};

/// The settings of the pipeline from a sensor frame to a fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PipelineSettings {
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
    /// Corners of outlines (occluding contours), which have another background in each image. They become points of the
    /// cloud.
    pub outline_corners: OutlineCorners,
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

impl Default for PipelineSettings {
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
            outline_corners: OutlineCorners::default(),
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

impl PipelineSettings {
    /// The same pipeline with the defaults of all components written out.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        choices::resolved(self)
    }

    /// All faults that keep the pipeline from being built.
    pub fn invalid(&self) -> Vec<PipelineError> {
        let mut all = choices::faults(self);
        let outlines = each_invalid(&self.outline_corners, OutlineCorners::check);
        all.extend(outlines.into_iter().map(|message| invalid_setting("outline-corners", message)));
        let fit = each_invalid(&self.segment_fit, SegmentFit::check);
        all.extend(fit.into_iter().map(|message| invalid_setting("segment-fit", message)));
        let lines = each_invalid(&self.lines, LineRules::check);
        all.extend(lines.into_iter().map(|message| invalid_setting("lines", message)));
        let corners = each_invalid(&self.edge_corners, EdgeCorners::check);
        all.extend(corners.into_iter().map(|message| invalid_setting("edge-corners", message)));
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
        self.outline_corners.check().map_err(|message| invalid_setting("outline-corners", message))?;
        let filter = |(place, choice): (usize, &Choice)| {
            FILTERS.build(choice).map_err(|error| PipelineError::of_component("filters", Some(place), &error))
        };
        Ok(FrontEnd {
            filters: self.filters.iter().enumerate().map(filter).collect::<Result<_, _>>()?,
            detector: build(&DETECTORS, &self.detector)?,
            locator: build(&LOCATORS, &self.locator)?,
            descriptor: build(&DESCRIPTORS, &self.descriptor)?,
            matcher: build(&MATCHERS, &self.matcher)?,
            refinement: build(&REFINEMENTS, &self.refinement)?,
            triangulator: build(&TRIANGULATORS, &self.triangulator)?,
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
        Ok(LineFrontEnd {
            detector: build(&SEGMENT_DETECTORS, &self.segment_detector)?,
            fit: self.segment_fit.clone(),
            matcher: build(&SEGMENT_MATCHERS, &self.segment_matcher)?,
            rules: self.lines.clone(),
            // One error of the camera model affects points and lines.
            calibration_px: build(&TRIANGULATORS, &self.triangulator)?.rules().calibration_px,
        })
    }

    /// Builds all components.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn build(&self) -> Result<Pipeline, PipelineError> {
        self.gate.check().map_err(|message| invalid_setting("gate", message))?;
        self.tolerance.check().map_err(|message| invalid_setting("tolerance", message))?;
        self.acceptance.check().map_err(|message| invalid_setting("acceptance", message))?;
        self.window_fits()?;
        self.has_features()?;
        let (search, solver) = (build(&SEARCHES, &self.search)?, build(&SOLVERS, &self.solver)?);
        Ok(Pipeline::new(self.front_end()?, self.line_front_end()?, search, solver, self.clone()))
    }
}
