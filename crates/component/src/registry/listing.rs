//! The description of a component.

use crate::settings::SettingsTable;

/// Properties of a component as (name, value): `("time", "N log N for N candidate pairs")`.
pub type Properties = &'static [(&'static str, &'static str)];

/// The description of one component in a registry.
#[derive(Debug, Clone)]
pub struct Listing {
    /// The kind: `solver`, `search`, …
    pub kind: &'static str,
    /// The name in experiment files.
    pub name: &'static str,
    /// The one-line description.
    pub summary: &'static str,
    /// The literature source.
    pub source: &'static str,
    /// Further properties as (name, value).
    pub properties: Properties,
    /// The version of the results.
    pub version: u32,
    /// The settings.
    pub table: SettingsTable,
}
