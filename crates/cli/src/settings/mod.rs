//! The settings of files and components, for `show`, `schema` and `docs/settings.md`.

#[cfg(test)]
mod markdown;
mod schema;
mod tables;
mod text;

#[cfg(test)]
pub(crate) use markdown::markdown;
pub(crate) use schema::experiment;
pub(crate) use tables::{Section, names, section};
pub(crate) use text::text;

#[cfg(test)]
mod tests;
