//! Components that a program adds while it runs, such as those of a script.

use std::{fmt, sync::Arc};

use crate::{
    settings::{Field, Form, SettingsError, SettingsTable},
    suggest::unknown,
};

/// The constructor of an added component: the component with these settings, or the reason why they are invalid.
pub type Construct<T> = Box<dyn Fn(&toml::Table) -> Result<Box<T>, String> + Send + Sync>;

/// A component that a program adds to a registry while it runs ([`Registry::add`](crate::Registry::add)).
pub struct Added<T: ?Sized> {
    /// The name in experiment files, in kebab-case.
    pub name: String,
    /// A one-line description.
    pub summary: String,
    /// The literature source.
    pub source: String,
    /// The version of the results.
    pub version: u32,
    /// The settings with their default values.
    pub defaults: toml::Table,
    /// The constructor; it receives all settings.
    pub construct: Construct<T>,
}

impl<T: ?Sized> fmt::Debug for Added<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Added").field("name", &self.name).field("version", &self.version).finish_non_exhaustive()
    }
}

impl<T: ?Sized + 'static> Added<T> {
    /// The component with these settings in place of the defaults.
    pub(super) fn built(&self, settings: toml::Table) -> Result<Box<T>, Vec<SettingsError>> {
        let mut full = self.defaults.clone();
        let mut errors = Vec::new();
        for (key, value) in settings {
            let message = match full.get(&key) {
                None => Some(format!("unknown setting{}", unknown(&key, &self.keys()))),
                // An integer is a number as well.
                Some(known) if same_type(known, &value) => None,
                Some(known) => Some(format!("expected {}, found {}", known.type_str(), value.type_str())),
            };
            match message {
                Some(message) => errors.push(SettingsError { key: Some(key), message }),
                None => drop(full.insert(key, value)),
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        (self.construct)(&full).map_err(|message| vec![SettingsError { key: None, message }])
    }

    /// The settings, whose forms follow from the defaults.
    pub(super) fn table(&'static self) -> SettingsTable {
        // A component that is added stays for the life of the program, and so do its keys.
        let field = |(key, value): (&'static String, &toml::Value)| Field::new(key, "", Form::of_default(value), false);
        SettingsTable {
            form: Form::Table(self.defaults.iter().map(field).collect()),
            defaults: self.defaults.clone(),
            refusals: Arc::new(|given| self.built(given.clone()).err().unwrap_or_default()),
        }
    }

    fn keys(&self) -> Vec<&str> {
        self.defaults.keys().map(String::as_str).collect()
    }
}

fn same_type(known: &toml::Value, value: &toml::Value) -> bool {
    known.same_type(value) || (known.is_float() && value.is_integer())
}

/// The reason why a component cannot be added.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotAdded {
    /// A name that is not in kebab-case.
    #[error("cannot add the {kind} `{name}`: its name is not in kebab-case; use a-z, 0-9 and single hyphens")]
    Name {
        /// The kind of the registry.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A name that a component of the program has.
    #[error("cannot add the {kind} `{name}`: the program has one of this name; choose another")]
    Taken {
        /// The kind of the registry.
        kind: &'static str,
        /// The name.
        name: String,
    },
}

/// Whether a name is in kebab-case.
pub(super) fn is_name(name: &str) -> bool {
    let word = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit());
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.split('-').all(word)
}
