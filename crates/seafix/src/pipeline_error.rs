//! The error of an invalid setting.

use seafix_component::{BuildError, Choice, Part, Registry, out_of_range};

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

impl PipelineError {
    /// The fault of a component as the fault of its setting; `place` is its index in a list.
    pub(crate) fn of_component(setting: &'static str, place: Option<usize>, error: &BuildError) -> Self {
        let place = place.map(|place| place.to_string());
        let steps: Vec<&str> = place.as_deref().into_iter().chain(error.key()).collect();
        let key = (!steps.is_empty()).then(|| steps.join("."));
        Self { setting, key, part: error.part(), near: error.near(), message: error.to_string() }
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

/// Builds the chosen component.
///
/// # Errors
/// An unknown component or an invalid value.
pub fn build<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Result<Box<T>, PipelineError> {
    registry.build(choice).map_err(|error| PipelineError::of_component(registry.kind(), None, &error))
}
