//! Errors in the settings of a component.

/// An error in the settings of a component: the dotted key, if one is known, and the message.
#[derive(Debug)]
pub struct SettingsError {
    /// The dotted key.
    pub key: Option<String>,
    /// The message.
    pub message: String,
}

/// The errors of the settings in a table; absent settings keep their defaults.
pub type Refusals = dyn Fn(&toml::Table) -> Vec<SettingsError> + Send + Sync;
