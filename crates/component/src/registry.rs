//! The visible list of the components of one kind.

use serde::{Serialize, de::DeserializeOwned};

use crate::{Choice, suggest::unknown};

/// What every component says of itself, whatever it does.
///
/// The implementing struct *is* its settings: its fields are the keys a user may write,
/// its `Default` the values they have otherwise.
pub trait Component: Default + Serialize + DeserializeOwned + 'static {
    /// The name in experiment files: the method's name in kebab-case.
    const NAME: &'static str;
    /// What it does, in one line of the field's words.
    const SUMMARY: &'static str;
    /// Where it comes from: author, title, year.
    const SOURCE: &'static str;

    /// Whether its settings can be: a component is built only from settings that pass.
    ///
    /// # Errors
    /// The setting that is out of its range, its value, and the range: `ratio = -1; give a number from 0 to 1`.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }
}

/// Why a component could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// No component of the kind has the name.
    #[error("no {kind} is called `{name}`{hint}")]
    UnknownName {
        /// The kind looked through.
        kind: &'static str,
        /// The name that was asked for.
        name: String,
        /// The nearest name and the list of all.
        hint: String,
    },
    /// The component has no such setting.
    #[error("{kind} `{name}` has no setting `{key}`{hint}")]
    UnknownKey {
        /// The kind of the component.
        kind: &'static str,
        /// The component.
        name: &'static str,
        /// The key that was written.
        key: String,
        /// The nearest key and the list of all.
        hint: String,
    },
    /// A setting has a value the component cannot take.
    #[error("{kind} `{name}`: {message}")]
    BadValue {
        /// The kind of the component.
        kind: &'static str,
        /// The component.
        name: &'static str,
        /// The key at fault, where it is known.
        key: Option<String>,
        /// What is wrong with it.
        message: String,
    },
}

impl BuildError {
    /// The key at fault, for a message that names the line of a file.
    pub fn key(&self) -> Option<&str> {
        match self {
            Self::UnknownName { .. } => Some("name"),
            Self::UnknownKey { key, .. } => Some(key),
            Self::BadValue { key, .. } => key.as_deref(),
        }
    }
}

/// Why settings could not become a component: the key if one is known, and the reason.
#[derive(Debug)]
pub struct SettingsError {
    key: Option<String>,
    message: String,
}

/// One line of a registry; written with [`entry!`](crate::entry).
#[derive(Debug)]
pub struct Entry<T: ?Sized> {
    name: &'static str,
    summary: &'static str,
    source: &'static str,
    defaults: fn() -> toml::Table,
    build: fn(toml::Table) -> Result<Box<T>, SettingsError>,
}

impl<T: ?Sized> Entry<T> {
    /// The entry of component `C`.
    pub const fn of<C: Component>(build: fn(toml::Table) -> Result<Box<T>, SettingsError>) -> Self {
        Self { name: C::NAME, summary: C::SUMMARY, source: C::SOURCE, defaults: defaults::<C>, build }
    }
}

/// The entry of a component in its registry: `entry!(Kabsch)`.
#[macro_export]
macro_rules! entry {
    ($component:ty) => {
        $crate::Entry::of::<$component>(|settings| Ok(Box::new($crate::settings::<$component>(settings)?)))
    };
}

/// A component from its settings; [`entry!`](crate::entry) calls it.
#[doc(hidden)]
pub fn settings<C: Component>(settings: toml::Table) -> Result<C, SettingsError> {
    // One key at a time first, so that the message can name the one at fault.
    for (key, value) in &settings {
        let mut one = toml::Table::new();
        one.insert(key.clone(), value.clone());
        if let Err(error) = one.try_into::<C>() {
            return Err(SettingsError { key: Some(key.clone()), message: error.message().to_owned() });
        }
    }
    let component: C = settings
        .try_into()
        .map_err(|error: toml::de::Error| SettingsError { key: None, message: error.message().to_owned() })?;
    component.check().map_err(|message| SettingsError { key: None, message })?;
    Ok(component)
}

/// The message of a setting that is out of its range, for [`Component::check`]: `Err` unless `holds`.
///
/// # Errors
/// `name = value; give range`.
pub fn in_range(holds: bool, name: &str, value: impl std::fmt::Display, range: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(format!("{name} = {value}; give {range}")) }
}

/// The setting, as a dotted key, that a message of [`in_range`] is about.
fn out_of_range(message: &str) -> Option<String> {
    let (name, _) = message.split_once(" = ")?;
    name.chars().all(|c| c.is_ascii_alphanumeric() || "-.[]".contains(c)).then(|| name.to_owned())
}

fn defaults<C: Component>() -> toml::Table {
    toml::Table::try_from(C::default()).expect("a component's settings are a table of plain values")
}

/// What a registry tells of one component.
#[derive(Debug, Clone, PartialEq)]
pub struct Listing {
    /// The kind: `solver`, `search`, …
    pub kind: &'static str,
    /// The name in experiment files.
    pub name: &'static str,
    /// One line on what it does.
    pub summary: &'static str,
    /// Its literature source.
    pub source: &'static str,
    /// Its settings with their default values.
    pub defaults: toml::Table,
}

/// All components of one kind, in alphabetical order.
#[derive(Debug)]
pub struct Registry<T: ?Sized + 'static> {
    kind: &'static str,
    entries: &'static [Entry<T>],
}

impl<T: ?Sized> Registry<T> {
    /// The registry of `kind` with these entries.
    pub const fn new(kind: &'static str, entries: &'static [Entry<T>]) -> Self {
        Self { kind, entries }
    }

    /// The kind of its components, in the singular: `solver`.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// The names, in the order of the list.
    pub fn names(&self) -> impl Iterator<Item = &'static str> + use<T> {
        self.entries.iter().map(|entry| entry.name)
    }

    /// What there is to say of each component, in the order of the list.
    pub fn listings(&self) -> Vec<Listing> {
        self.entries
            .iter()
            .map(|entry| Listing {
                kind: self.kind,
                name: entry.name,
                summary: entry.summary,
                source: entry.source,
                defaults: (entry.defaults)(),
            })
            .collect()
    }

    /// The component that `choice` names, with its settings.
    ///
    /// # Errors
    /// An unknown name or key (with the nearest right one), or a value of the wrong type or range.
    pub fn build(&self, choice: &Choice) -> Result<Box<T>, BuildError> {
        let entry = self.find(&choice.name)?;
        (entry.build)(choice.settings.clone()).map_err(|error| match error.key {
            Some(key) if !(entry.defaults)().contains_key(&key) => BuildError::UnknownKey {
                kind: self.kind,
                name: entry.name,
                hint: unknown(&key, &(entry.defaults)().keys().map(String::as_str).collect::<Vec<_>>()),
                key,
            },
            Some(key) => {
                let message = format!("setting `{key}`: {}", error.message.trim_end());
                BuildError::BadValue { kind: self.kind, name: entry.name, key: Some(key), message }
            }
            None => {
                let key = out_of_range(&error.message);
                BuildError::BadValue { kind: self.kind, name: entry.name, key, message: error.message }
            }
        })
    }

    /// The choice with every setting written out: what a resolved experiment stores.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn resolve(&self, choice: &Choice) -> Result<Choice, BuildError> {
        self.build(choice)?;
        let mut settings = (self.find(&choice.name)?.defaults)();
        settings.extend(choice.settings.clone());
        Ok(Choice { name: choice.name.clone(), settings })
    }

    fn find(&self, name: &str) -> Result<&'static Entry<T>, BuildError> {
        self.entries.iter().find(|entry| entry.name == name).ok_or_else(|| BuildError::UnknownName {
            kind: self.kind,
            name: name.to_owned(),
            hint: unknown(name, &self.names().collect::<Vec<_>>()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    trait Shape: std::fmt::Debug {
        fn area(&self) -> f64;
    }

    #[derive(Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
    struct Square {
        side_length: f64,
    }

    impl Default for Square {
        fn default() -> Self {
            Self { side_length: 1.0 }
        }
    }

    impl Component for Square {
        const NAME: &'static str = "square";
        const SUMMARY: &'static str = "four equal sides";
        const SOURCE: &'static str = "Euclid, Elements";

        fn check(&self) -> Result<(), String> {
            in_range(self.side_length > 0.0, "side-length", self.side_length, "a positive length")
        }
    }

    impl Shape for Square {
        fn area(&self) -> f64 {
            self.side_length * self.side_length
        }
    }

    static SHAPES: Registry<dyn Shape> = Registry::new("shape", &[entry!(Square)]);

    #[test]
    fn defaults_printed_are_defaults_used() {
        let listing = &SHAPES.listings()[0];
        let printed = Choice { name: listing.name.to_owned(), settings: listing.defaults.clone() };
        assert_eq!(SHAPES.build(&printed).unwrap().area(), SHAPES.build(&Choice::named("square")).unwrap().area());
        assert_eq!(SHAPES.resolve(&Choice::named("square")).unwrap(), printed);
    }

    #[test]
    fn an_unknown_key_is_answered_with_the_nearest() {
        let error = SHAPES.build(&Choice::named("square").with("side-lenght", 2.0)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "shape `square` has no setting `side-lenght`, did you mean `side-length`? There are side-length"
        );
        assert_eq!(error.key(), Some("side-lenght"));
    }

    #[test]
    fn a_value_out_of_range_is_refused() {
        let error = SHAPES.build(&Choice::named("square").with("side-length", -1.0)).unwrap_err();
        assert_eq!(error.to_string(), "shape `square`: side-length = -1; give a positive length");
    }

    #[test]
    fn a_wrong_type_names_its_key() {
        let error = SHAPES.build(&Choice::named("square").with("side-length", "long")).unwrap_err();
        assert!(error.to_string().starts_with("shape `square`: setting `side-length`: invalid type"), "{error}");
    }

    #[test]
    fn a_number_out_of_range_names_its_key() {
        assert_eq!(out_of_range("lamps[1].aim = [0.0]; give a place").as_deref(), Some("lamps[1].aim"));
        assert_eq!(out_of_range("two keys = 1; give one"), None);
        assert_eq!(out_of_range("no number"), None);
    }
}
