//! The vehicle: where it is meant to go, and where it goes.

mod route;
mod track;

pub(crate) use route::{Goal, Way};
pub use route::{Route, RouteKind};
pub(crate) use track::{RATE, State, Track};
