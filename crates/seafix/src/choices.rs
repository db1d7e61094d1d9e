//! The choices of components in a table of settings.

use seafix_component::{Chosen, Components, Settings};
use seafix_navigation::{FUSIONS, ODOMETRIES, POLICIES};
use seafix_referencing::{SEARCHES, SOLVERS};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FILTERS, LOCATORS, MATCHERS, REFINEMENTS, SEGMENT_DETECTORS, SEGMENT_MATCHERS,
    TRIANGULATORS,
};

use crate::pipeline_error::PipelineError;

/// The registries of all components that a pipeline or its navigation chooses, in the order of the stages.
pub static REGISTRIES: [&dyn Components; 14] = [
    &FILTERS,
    &DETECTORS,
    &LOCATORS,
    &DESCRIPTORS,
    &MATCHERS,
    &REFINEMENTS,
    &TRIANGULATORS,
    &SEGMENT_DETECTORS,
    &SEGMENT_MATCHERS,
    &SEARCHES,
    &SOLVERS,
    &ODOMETRIES,
    &POLICIES,
    &FUSIONS,
];

/// The same settings with the defaults of all chosen components written out.
///
/// # Errors
/// The first invalid choice.
pub(crate) fn resolved<T: Settings + Clone>(settings: &T) -> Result<T, PipelineError> {
    let mut resolved = settings.clone();
    for Chosen { key, kind, place, choice } in resolved.choices() {
        let written_out = registry(kind).resolve(choice);
        *choice = written_out.map_err(|error| PipelineError::of_component(key, place, &error))?;
    }
    Ok(resolved)
}

/// All faults of the chosen components.
pub(crate) fn faults<T: Settings + Clone>(settings: &T) -> Vec<PipelineError> {
    let mut all = Vec::new();
    for Chosen { key, kind, place, choice } in settings.clone().choices() {
        let errors = registry(kind).faults(choice);
        all.extend(errors.iter().map(|error| PipelineError::of_component(key, place, error)));
    }
    all
}

fn registry(kind: &str) -> &'static dyn Components {
    let found = REGISTRIES.into_iter().find(|registry| registry.kind() == kind);
    found.unwrap_or_else(|| panic!("{kind} has no registry"))
}
