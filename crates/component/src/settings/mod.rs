//! Settings that describe themselves: form, sentence, unit, range and default.

mod error;
mod form;
mod probe;
mod range;
mod setting;
mod unit;

pub use error::{Refusals, SettingsError};
pub use form::{Chosen, Field, Form, Settings};
pub use range::{Bound, Range};
pub use setting::{Setting, SettingsTable};

#[cfg(test)]
mod tests;
