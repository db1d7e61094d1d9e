//! Propagation of light: lamps, water, ports, lenses.

mod backscatter;
mod lamp;
mod lens;
mod port;
mod water;

pub(crate) use backscatter::Backscatter;
pub use lamp::Lamp;
pub use lens::Lens;
pub use port::{Port, PortKind, Ray};
pub use water::{WATERS, Water};
