//! The vehicle: where it is meant to go, what moves it, and where it goes.

mod controller;
mod current;
mod inspection;
mod model;
mod route;
mod track;

pub use controller::{Vehicle, VehicleKind};
pub use current::Current;
pub(crate) use inspection::Looker;
pub(crate) use route::PlannedRoute;
pub use route::{Route, RouteKind};
pub(crate) use track::Track;
#[cfg(test)]
pub(crate) use track::VehicleState;
