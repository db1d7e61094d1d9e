//! The choice of a component in an experiment file.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A choice: the name of a component and the settings that differ from its defaults.
///
/// In TOML it is a name or a table: `solver = "triad"` or `solver = { name = "triad", choose = "first" }`.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The component's name in its registry.
    pub name: String,
    /// Settings by key; absent settings keep their defaults.
    pub settings: toml::Table,
}

impl Choice {
    /// The component `name` with default settings.
    pub fn named(name: &str) -> Self {
        Self { name: name.to_owned(), settings: toml::Table::new() }
    }

    /// The choice with one more setting.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<toml::Value>) -> Self {
        self.settings.insert(key.to_owned(), value.into());
        self
    }
}

impl Choice {
    fn read<E: serde::de::Error>(value: toml::Value, unnamed: Option<&str>) -> Result<Self, E> {
        match value {
            toml::Value::String(name) => Ok(Self::named(&name)),
            toml::Value::Table(mut settings) => match (settings.remove("name"), unnamed) {
                (Some(toml::Value::String(name)), _) => Ok(Self { name, settings }),
                (Some(other), _) => Err(E::custom(format!("`name` must be a string, found {other}"))),
                (None, Some(name)) => Ok(Self { name: name.to_owned(), settings }),
                (None, None) => Err(E::custom("a component's table needs a `name`")),
            },
            other => Err(E::custom(format!("a component is a name or a table with a `name`, found {other}"))),
        }
    }

    /// A choice whose table may omit the name; its settings then belong to the component `unnamed`.
    ///
    /// It serves stages that had settings before they had a choice of components.
    ///
    /// # Errors
    /// A value that is neither a string nor a table.
    pub fn deserialize_or<'de, D: Deserializer<'de>>(deserializer: D, unnamed: &str) -> Result<Self, D::Error> {
        Self::read(toml::Value::deserialize(deserializer)?, Some(unnamed))
    }
}

impl<'de> Deserialize<'de> for Choice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::read(toml::Value::deserialize(deserializer)?, None)
    }
}

impl Serialize for Choice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = toml::Table::new();
        table.insert("name".to_owned(), self.name.clone().into());
        table.extend(self.settings.clone());
        table.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_and_a_table_are_both_choices() {
        let table: toml::Table = toml::from_str("a = 'triad'\nb = { name = 'triad', min-sine = 0.2 }").unwrap();
        let a: Choice = table["a"].clone().try_into().unwrap();
        let b: Choice = table["b"].clone().try_into().unwrap();
        assert_eq!(a, Choice::named("triad"));
        assert_eq!(b, Choice::named("triad").with("min-sine", 0.2));
        let printed = toml::to_string(&b).unwrap();
        assert_eq!(toml::from_str::<Choice>(&printed).unwrap(), b);
    }

    #[test]
    fn a_stage_that_was_no_choice_keeps_its_settings() {
        let read = |text: &str| {
            let table: toml::Table = toml::from_str(text).unwrap();
            Choice::deserialize_or(table["a"].clone(), "direct").map_err(|error| error.to_string())
        };
        assert_eq!(read("a = { window = 15 }").unwrap(), Choice::named("direct").with("window", 15));
        assert_eq!(read("a = { name = 'none' }").unwrap(), Choice::named("none"));
        assert_eq!(read("a = 'none'").unwrap(), Choice::named("none"));
        assert!(read("a = 3").is_err());
    }

    #[test]
    fn a_table_without_a_name_is_rejected() {
        assert!(toml::from_str::<Choice>("min-sine = 0.2").unwrap_err().to_string().contains("needs a `name`"));
    }
}
