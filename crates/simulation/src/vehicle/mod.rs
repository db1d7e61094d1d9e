//! The vehicle: its route, its dynamics, its controller and its trajectory.

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
