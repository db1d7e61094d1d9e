//! The settings of the way from a sight to fixes, and what is built from them.

use seafix_component::{BuildError, Choice, Part, Registry, each_invalid, in_range, out_of_range};
use seafix_referencing::{Acceptance, Gate, SEARCHES, SOLVERS, TargetKind, Tolerance};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FILTERS, Filter, FrontEnd, InvalidStage, LOCATORS, MATCHERS, REFINEMENTS, StageChoices,
    TRIANGULATORS, read_refinement, read_triangulator,
};
use serde::{Deserialize, Serialize};

use crate::PipelineStages;

/// The settings of the way from a frame to a fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Pipeline {
    /// What is searched for: each object in view, each and then all together, or the whole site at once.
    pub target: TargetKind,
    /// How many frames a joint fix is over: the frame itself and those before it.
    pub window: usize,
    /// Prepare each image, one after the other; none by default.
    pub filters: Vec<Choice>,
    /// Finds corners in each image.
    pub detector: Choice,
    /// Says where exactly the corners are.
    pub locator: Choice,
    /// Describes their surroundings.
    pub descriptor: Choice,
    /// Pairs left with right.
    pub matcher: Choice,
    /// Says more exactly where the right image shows each left place. Settings without a name are those of `direct`.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// Turns pairs into points. Settings without a name are those of `optimal`.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// Stage 1: the shells.
    pub gate: Gate,
    /// Whether shells grow where nothing is found in them, and then vanish: an object may have been displaced.
    pub expand_gates: bool,
    /// When two distances agree.
    pub tolerance: Tolerance,
    /// Stage 2: the search. Of points that say which ones they are none is asked for.
    pub search: Choice,
    /// The solver.
    pub solver: Choice,
    /// When an answer is believed.
    pub acceptance: Acceptance,
}

impl Default for Pipeline {
    fn default() -> Self {
        Self {
            target: TargetKind::Object,
            window: 1,
            filters: Vec::new(),
            detector: Choice::named("harris"),
            locator: Choice::named("corner"),
            descriptor: Choice::named("surf"),
            matcher: Choice::named("epipolar-band"),
            refinement: Choice::named("direct"),
            triangulator: Choice::named("optimal"),
            gate: Gate::default(),
            expand_gates: false,
            tolerance: Tolerance::Sigmas(3.0),
            search: Choice::named("rigid-consensus"),
            solver: Choice::named("stereo-reprojection"),
            acceptance: Acceptance::default(),
        }
    }
}

/// A setting of the pipeline that cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct PipelineError {
    /// The key below `pipeline`.
    pub setting: &'static str,
    /// The key below that, where it is known; of a component that does not exist its `name`.
    pub key: Option<String>,
    /// What of that key it is.
    pub part: Part,
    /// The component that was meant by a name that none has.
    pub near: Option<&'static str>,
    /// What is wrong, and the nearest right thing.
    pub message: String,
}

impl Pipeline {
    /// The same pipeline with every setting of its components written out.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self {
            filters: each_filter(&self.filters, resolve)?,
            detector: resolve(&DETECTORS, &self.detector)?,
            descriptor: resolve(&DESCRIPTORS, &self.descriptor)?,
            matcher: resolve(&MATCHERS, &self.matcher)?,
            locator: resolve(&LOCATORS, &self.locator)?,
            refinement: resolve(&REFINEMENTS, &self.refinement)?,
            triangulator: resolve(&TRIANGULATORS, &self.triangulator)?,
            search: resolve(&SEARCHES, &self.search)?,
            solver: resolve(&SOLVERS, &self.solver)?,
            ..self.clone()
        })
    }

    /// Every setting that it cannot be built with.
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
        all
    }

    fn window_fits(&self) -> Result<(), PipelineError> {
        let fits = in_range((1..=1000).contains(&self.window), "window", self.window, "1 to 1000");
        fits.map_err(|message| invalid_setting("window", message))
    }

    /// Standard deviation of the coordinates of a key point that no corner was fitted to (px); none of a pipeline that
    /// cannot be built.
    pub fn pixel_sigma(&self) -> Option<f64> {
        build(&TRIANGULATORS, &self.triangulator).ok().map(|triangulator| triangulator.rules().sigma_px)
    }

    /// The part of it between two images and a cloud, ready to work.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
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

    /// The pipeline, ready to work.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn build(&self) -> Result<PipelineStages, PipelineError> {
        self.gate.check().map_err(|message| invalid_setting("gate", message))?;
        self.tolerance.check().map_err(|message| invalid_setting("tolerance", message))?;
        self.acceptance.check().map_err(|message| invalid_setting("acceptance", message))?;
        self.window_fits()?;
        let (search, solver) = (build(&SEARCHES, &self.search)?, build(&SOLVERS, &self.solver)?);
        Ok(PipelineStages::new(self.front_end()?, search, solver, self.clone()))
    }
}

/// What a check of settings that are no component's says.
pub fn invalid_setting(setting: &'static str, message: String) -> PipelineError {
    // Some checks say by themselves whose they are.
    let own = message.strip_prefix(&format!("{setting}: ")).unwrap_or(&message);
    // Settings of a list say their places: `faults[0].to`.
    let (key, message) = match out_of_range(own) {
        Some(key) => match key.strip_prefix(setting) {
            Some(below) => (Some(below.to_owned()).filter(|below| !below.is_empty()), own.to_owned()),
            None => (Some(key), format!("{setting}: {own}")),
        },
        None => (None, format!("{setting}: {own}")),
    };
    PipelineError { setting, key, part: Part::Value, near: None, message }
}

/// The choice with every setting of its component written out.
///
/// # Errors
/// An unknown component or an invalid value.
pub fn resolve<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Result<Choice, PipelineError> {
    registry.resolve(choice).map_err(|error| in_pipeline(registry, &error))
}

/// The chosen component.
///
/// # Errors
/// An unknown component or an invalid value.
pub fn build<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Result<Box<T>, PipelineError> {
    registry.build(choice).map_err(|error| in_pipeline(registry, &error))
}

/// Everything that keeps a stage from being built.
pub fn faults<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Vec<PipelineError> {
    registry.faults(choice).iter().map(|error| in_pipeline(registry, error)).collect()
}

/// The fault of the filter in this place of the list.
fn in_list(place: usize, error: PipelineError) -> PipelineError {
    let below = error.key.map_or_else(String::new, |key| format!(".{key}"));
    PipelineError { setting: "filters", key: Some(format!("{place}{below}")), ..error }
}

/// What `make` makes of each filter; an error names its place in the list.
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

/// What is wrong with a component, as the fault of its setting.
fn invalid(setting: &'static str, error: &BuildError) -> PipelineError {
    let key = error.key().map(str::to_owned);
    PipelineError { setting, key, part: error.part(), near: error.near(), message: error.to_string() }
}
