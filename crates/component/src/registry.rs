//! Registries: the components of one kind.

use std::sync::{Arc, PoisonError, RwLock};

use serde::{Serialize, de::DeserializeOwned};

pub use listing::{Listing, Properties};

use crate::{
    choice::Choice,
    places::Part,
    registry::added::{Added, NotAdded, is_name},
    settings::{Settings, SettingsError, SettingsTable},
    suggest::{nearest, unknown},
    words::plain,
};

/// The description and settings of a component.
///
/// The fields of the implementing struct are its settings; `Default` gives their default values.
pub trait Component: Default + Serialize + DeserializeOwned + Settings + 'static {
    /// The name in experiment files: the method's name in kebab-case.
    const NAME: &'static str;
    /// A one-line description in the field's words.
    const SUMMARY: &'static str;
    /// The literature source: author, title, year.
    const SOURCE: &'static str;
    /// Further properties that help to choose between components of one kind.
    ///
    /// A search, for example, states what it `maximises`, whether it is `exact`, and its `time`.
    const PROPERTIES: Properties = &[];
    /// The version of the results.
    ///
    /// Increase it with every change that alters a result for some input; `seafix publish` then repeats the stored
    /// runs.
    const VERSION: u32 = 1;

    /// Checks the ranges of the settings; only valid settings can build a component.
    ///
    /// # Errors
    /// The invalid setting, its value and the valid range: `ratio = -1; give a number from 0 to 1`.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }
}

/// The reason why a component could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An unknown name.
    #[error("no {kind} is called `{name}`{hint}")]
    UnknownName {
        /// The kind of the registry.
        kind: &'static str,
        /// The requested name.
        name: String,
        /// The nearest known name, if one is close enough.
        near: Option<&'static str>,
        /// The nearest name and the list of all names.
        hint: String,
    },
    /// An unknown setting.
    #[error("{kind} `{name}` has no setting `{key}`{hint}")]
    UnknownKey {
        /// The kind of the component.
        kind: &'static str,
        /// The name of the component.
        name: &'static str,
        /// The unknown key.
        key: String,
        /// The nearest key and the list of all keys.
        hint: String,
    },
    /// An invalid value of a setting.
    #[error("{kind} `{name}`: {message}")]
    BadValue {
        /// The kind of the component.
        kind: &'static str,
        /// The name of the component.
        name: &'static str,
        /// The key of the setting, if it is known.
        key: Option<String>,
        /// The description of the error.
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

    /// The part of the setting that is at fault.
    pub fn part(&self) -> Part {
        if matches!(self, Self::UnknownKey { .. }) { Part::Key } else { Part::Value }
    }

    /// The known name nearest to an unknown one.
    pub fn near(&self) -> Option<&'static str> {
        if let Self::UnknownName { near, .. } = self { *near } else { None }
    }
}

/// An entry of a registry; written with [`entry!`](crate::entry).
#[derive(Debug)]
pub struct Entry<T: ?Sized + 'static> {
    name: &'static str,
    summary: &'static str,
    source: &'static str,
    properties: Properties,
    version: u32,
    maker: Maker<T>,
}

/// The defaults and the constructor of a component.
enum Maker<T: ?Sized + 'static> {
    /// A struct of the program.
    Struct { table: fn() -> SettingsTable, build: fn(toml::Table) -> Result<Box<T>, Vec<SettingsError>> },
    /// A component that was added while the program ran.
    Added(&'static Added<T>),
}

impl<T: ?Sized> std::fmt::Debug for Maker<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if matches!(self, Self::Struct { .. }) { "Struct" } else { "Added" })
    }
}

impl<T: ?Sized> Entry<T> {
    fn defaults(&self) -> toml::Table {
        match self.maker {
            Maker::Struct { table, .. } => table().defaults,
            Maker::Added(added) => added.defaults.clone(),
        }
    }

    fn table(&self) -> SettingsTable {
        match self.maker {
            Maker::Struct { table, .. } => table(),
            Maker::Added(added) => added.table(),
        }
    }

    fn build(&self, settings: toml::Table) -> Result<Box<T>, Vec<SettingsError>> {
        match self.maker {
            Maker::Struct { build, .. } => build(settings),
            Maker::Added(added) => added.built(settings),
        }
    }

    /// The entry of component `C`.
    pub const fn of<C: Component>(build: fn(toml::Table) -> Result<Box<T>, Vec<SettingsError>>) -> Self {
        Self {
            name: C::NAME,
            summary: C::SUMMARY,
            source: C::SOURCE,
            properties: C::PROPERTIES,
            version: C::VERSION,
            maker: Maker::Struct { table: table::<C>, build },
        }
    }
}

/// The entry of a component in its registry: `entry!(Kabsch)`.
#[macro_export]
macro_rules! entry {
    ($component:ty) => {
        $crate::Entry::of::<$component>(|settings| Ok(Box::new($crate::settings::<$component>(settings)?)))
    };
}

/// The component with these settings, or all errors in them; [`entry!`](crate::entry) calls it.
#[doc(hidden)]
pub fn settings<C: Component>(mut settings: toml::Table) -> Result<C, Vec<SettingsError>> {
    let mut errors = Vec::new();
    // Each key is checked alone first, so that the message can name it. An invalid value is removed, so that the others
    // can be checked.
    for key in settings.keys().cloned().collect::<Vec<_>>() {
        while let Some(value) = settings.get(&key) {
            let rejected = |value: &toml::Value| {
                let alone = toml::Table::from_iter([(key.clone(), value.clone())]);
                alone.try_into::<C>().err().map(|error| error.message().to_owned())
            };
            let Some(message) = rejected(value) else { break };
            let mut path = vec![key.clone()];
            culprit(value, &message, &rejected, &mut path);
            take_out(&mut settings, &path);
            errors.push(SettingsError { key: Some(path.join(".")), message });
        }
    }
    loop {
        let message = match settings.clone().try_into::<C>() {
            Err(error) => plain(error.message()),
            Ok(component) => match component.check() {
                Ok(()) if errors.is_empty() => return Ok(component),
                Ok(()) => return Err(errors),
                Err(message) => message,
            },
        };
        let key = out_of_range(&message);
        let written = key.as_deref().and_then(|key| key.split(['.', '[']).next());
        // An absent key means that the error results from another one.
        let next = written.and_then(|key| settings.remove(key)).is_some();
        if next || errors.is_empty() {
            errors.push(SettingsError { key, message });
        }
        if !next {
            return Err(errors);
        }
    }
}

/// Appends to `path` the steps that lead to the error `message` inside `value`.
///
/// The function `rejected` gives the error message for a replacement value.
fn culprit(
    value: &toml::Value,
    message: &str,
    rejected: &dyn Fn(&toml::Value) -> Option<String>,
    path: &mut Vec<String>,
) {
    let is_it = |rest: &toml::Value| {
        // The removed part is at fault if the error disappears or another one appears.
        rejected(rest).is_none_or(|other| other != message && !other.starts_with("missing field"))
    };
    let steps: Vec<String> = match value {
        toml::Value::Table(table) => table.keys().cloned().collect(),
        toml::Value::Array(list) if list.iter().all(toml::Value::is_table) => {
            (0..list.len()).map(|k| k.to_string()).collect()
        }
        _ => return,
    };
    for step in steps {
        let mut rest = value.clone();
        remove(&mut rest, &step);
        if is_it(&rest) {
            path.push(step.clone());
            let replaced = |inner: &toml::Value| {
                let mut full = value.clone();
                if let Some(place) = inside(&mut full, &step) {
                    *place = inner.clone();
                }
                rejected(&full)
            };
            let mut full = value.clone();
            if let Some(inner) = inside(&mut full, &step) {
                culprit(inner, message, &replaced, path);
            }
            return;
        }
    }
}

/// The child of a value: by key in a table, by index in an array.
pub fn inside<'a>(value: &'a mut toml::Value, step: &str) -> Option<&'a mut toml::Value> {
    match value {
        toml::Value::Table(table) => table.get_mut(step),
        toml::Value::Array(list) => list.get_mut(step.parse::<usize>().ok()?),
        _ => None,
    }
}

fn remove(value: &mut toml::Value, step: &str) {
    match value {
        toml::Value::Table(table) => drop(table.remove(step)),
        toml::Value::Array(list) => {
            if let Some(place) = step.parse().ok().filter(|&k: &usize| k < list.len()) {
                list.remove(place);
            }
        }
        _ => {}
    }
}

/// Removes the setting at `path`.
pub fn take_out(settings: &mut toml::Table, path: &[impl AsRef<str>]) {
    let Some((last, above)) = path.split_last() else { return };
    let Some((first, above)) = above.split_first() else {
        settings.remove(last.as_ref());
        return;
    };
    let mut here = settings.get_mut(first.as_ref());
    for step in above {
        here = here.and_then(|value| inside(value, step.as_ref()));
    }
    if let Some(value) = here {
        remove(value, last.as_ref());
    }
}

/// The range check of a setting for [`Component::check`]: `Err` unless `holds`.
///
/// # Errors
/// `name = value; give range`.
pub fn in_range(holds: bool, name: &str, value: impl std::fmt::Display, range: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(format!("{name} = {value}; give {range}")) }
}

/// The dotted key of the setting in a message of [`in_range`].
pub fn out_of_range(message: &str) -> Option<String> {
    let (name, _) = message.split_once(" = ")?;
    name.chars().all(|c| c.is_ascii_alphanumeric() || "-.[]".contains(c)).then(|| name.to_owned())
}

/// All errors that `check` finds in settings that belong to no component.
///
/// After each error the setting is reset to its default and the check repeated.
pub fn each_invalid<T: Clone + Serialize + DeserializeOwned>(
    full: &T,
    check: fn(&T) -> Result<(), String>,
) -> Vec<String> {
    let (mut found, mut rest) = (Vec::new(), full.clone());
    while let Err(message) = check(&rest) {
        // An invalid default ends the loop.
        let next = if found.contains(&message) { None } else { without(&rest, &message) };
        found.push(message);
        match next {
            Some(next) => rest = next,
            None => break,
        }
    }
    found.dedup();
    found
}

/// The settings with the one named in `message` reset to its default, if possible.
fn without<T: Serialize + DeserializeOwned>(full: &T, message: &str) -> Option<T> {
    let own = message.split_once(": ").map_or(message, |(_, own)| own);
    let key = out_of_range(message).or_else(|| out_of_range(own))?;
    let mut table = toml::Table::try_from(full).ok()?;
    let path: Vec<&str> = key.split(['.', '[', ']']).filter(|step| !step.is_empty()).collect();
    take_out(&mut table, &path);
    table.try_into().ok()
}

fn table<C: Component>() -> SettingsTable {
    SettingsTable {
        form: C::form(),
        defaults: toml::Table::try_from(C::default()).expect("a component's settings are a table of plain values"),
        refusals: Arc::new(|given| settings::<C>(given.clone()).err().unwrap_or_default()),
    }
}

/// All components of one kind, in alphabetical order, then those added while the program runs.
#[derive(Debug)]
pub struct Registry<T: ?Sized + 'static> {
    kind: &'static str,
    entries: &'static [Entry<T>],
    added: RwLock<Vec<&'static Entry<T>>>,
}

impl<T: ?Sized> Registry<T> {
    /// A registry of `kind` with these entries.
    pub const fn new(kind: &'static str, entries: &'static [Entry<T>]) -> Self {
        Self { kind, entries, added: RwLock::new(Vec::new()) }
    }

    /// Adds a component while the program runs; an added one of the same name is replaced.
    ///
    /// The entry is kept for the life of the program, as are those that it replaces.
    ///
    /// # Errors
    /// A name that is not in kebab-case, or that a component of the program has.
    pub fn add(&self, component: Added<T>) -> Result<(), NotAdded> {
        if !is_name(&component.name) {
            return Err(NotAdded::Name { kind: self.kind, name: component.name });
        }
        if self.entries.iter().any(|entry| entry.name == component.name) {
            return Err(NotAdded::Taken { kind: self.kind, name: component.name });
        }
        let component: &'static Added<T> = Box::leak(Box::new(component));
        let entry: &'static Entry<T> = Box::leak(Box::new(Entry {
            name: &component.name,
            summary: &component.summary,
            source: &component.source,
            properties: &[],
            version: component.version,
            maker: Maker::Added(component),
        }));
        let mut added = self.added.write().unwrap_or_else(PoisonError::into_inner);
        added.retain(|other| other.name != entry.name);
        added.push(entry);
        Ok(())
    }

    /// All entries: those of the program, then those added.
    fn all(&self) -> Vec<&'static Entry<T>> {
        let added = self.added.read().unwrap_or_else(PoisonError::into_inner);
        self.entries.iter().chain(added.iter().copied()).collect()
    }

    /// The kind of its components, in the singular: `solver`.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// The names, in the order of the list.
    pub fn names(&self) -> impl Iterator<Item = &'static str> + use<T> {
        self.all().into_iter().map(|entry| entry.name)
    }

    /// The descriptions of all components, in the order of the list.
    pub fn listings(&self) -> Vec<Listing> {
        self.all()
            .iter()
            .map(|entry| Listing {
                kind: self.kind,
                name: entry.name,
                summary: entry.summary,
                source: entry.source,
                properties: entry.properties,
                version: entry.version,
                table: entry.table(),
            })
            .collect()
    }

    /// Builds the component that `choice` names, with its settings.
    ///
    /// # Errors
    /// The first of [`faults`](Self::faults): an unknown name or key (with the nearest known one), or a value of the
    /// wrong type or range.
    pub fn build(&self, choice: &Choice) -> Result<Box<T>, BuildError> {
        let entry = self.find(&choice.name)?;
        entry.build(choice.settings.clone()).map_err(|errors| {
            let first = errors.into_iter().next().expect("a rejected table has at least one error");
            self.fault(entry, first)
        })
    }

    /// All errors of `choice`; for a misspelt name the settings are checked against the nearest known component.
    pub fn faults(&self, choice: &Choice) -> Vec<BuildError> {
        match self.find(&choice.name) {
            Err(error) => {
                let meant =
                    error.near().map(|near| Choice { name: near.to_owned(), settings: choice.settings.clone() });
                let settings = meant.iter().flat_map(|meant| self.faults(meant)).collect::<Vec<_>>();
                std::iter::once(error).chain(settings).collect()
            }
            Ok(entry) => {
                let errors = entry.build(choice.settings.clone()).err().unwrap_or_default();
                errors.into_iter().map(|error| self.fault(entry, error)).collect()
            }
        }
    }

    fn fault(&self, entry: &'static Entry<T>, SettingsError { key, message }: SettingsError) -> BuildError {
        let (kind, name) = (self.kind, entry.name);
        let Some(key) = key else { return BuildError::BadValue { kind, name, key: None, message } };
        let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        let nested = words.split_first().filter(|_| key.contains('.') && message.starts_with("unknown field"));
        if !key.contains(['.', '[']) && !entry.defaults().contains_key(&key) {
            let hint = unknown(&key, &entry.defaults().keys().map(String::as_str).collect::<Vec<_>>());
            return BuildError::UnknownKey { kind, name, key, hint };
        }
        if let Some((word, known)) = nested {
            return BuildError::UnknownKey { kind, name, hint: unknown(word, known), key };
        }
        // The message of a range check names its setting.
        let message = match out_of_range(&message) {
            Some(_) => message,
            None => format!("setting `{key}`: {}", plain(&message)),
        };
        BuildError::BadValue { kind, name, key: Some(key), message }
    }

    /// The choice with all settings written out, as a resolved experiment stores it.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn resolve(&self, choice: &Choice) -> Result<Choice, BuildError> {
        self.build(choice)?;
        let mut settings = self.find(&choice.name)?.defaults();
        settings.extend(choice.settings.clone());
        Ok(Choice { name: choice.name.clone(), settings })
    }

    fn find(&self, name: &str) -> Result<&'static Entry<T>, BuildError> {
        self.all().into_iter().find(|entry| entry.name == name).ok_or_else(|| BuildError::UnknownName {
            kind: self.kind,
            name: name.to_owned(),
            near: nearest(name, self.names()),
            hint: unknown(name, &self.names().collect::<Vec<_>>()),
        })
    }
}

/// The part of a registry that does not depend on the trait of its components.
pub trait Components: Sync {
    /// As [`Registry::kind`].
    fn kind(&self) -> &'static str;
    /// As [`Registry::listings`].
    fn listings(&self) -> Vec<Listing>;
    /// As [`Registry::faults`].
    fn faults(&self, choice: &Choice) -> Vec<BuildError>;
    /// As [`Registry::resolve`].
    ///
    /// # Errors
    /// As [`Registry::build`].
    fn resolve(&self, choice: &Choice) -> Result<Choice, BuildError>;
}

impl<T: ?Sized> Components for Registry<T> {
    fn kind(&self) -> &'static str {
        self.kind()
    }

    fn listings(&self) -> Vec<Listing> {
        self.listings()
    }

    fn faults(&self, choice: &Choice) -> Vec<BuildError> {
        self.faults(choice)
    }

    fn resolve(&self, choice: &Choice) -> Result<Choice, BuildError> {
        self.resolve(choice)
    }
}

pub(crate) mod added;
mod listing;
#[cfg(test)]
mod tests;
