//! Locators of exact corners.
//!
//! A detector's response peaks near a corner, not at it: 1 to 2 px inside the corner of a box. A locator fits a corner
//! model to the pixels around it. Key points of both images are located before they are described: a response may have
//! two maxima beside one corner, and those of one image would match the others of the other image. Key points at no
//! corner stay. The refinement later replaces the right pixel by a more exact one than a second fit gives.

mod corner;
mod corner_junction;
mod fit;
mod junction;
mod locator;
mod model;
mod peak;
mod start;

pub use corner::{Corner, LCorner, XCorner};
pub(crate) use corner::{SOURCE as FITTED, fit_into};
pub use corner_junction::CornerJunction;
pub use fit::CornerFit;
pub use junction::Junction;
pub use locator::{Locator, Pair, UncertainPixel};
pub(crate) use model::Shape;
pub use peak::Peak;
use seafix_component::{Registry, entry};

/// The registry of locators.
pub static LOCATORS: Registry<dyn Locator> = Registry::new(
    "locator",
    &[entry!(Corner), entry!(CornerJunction), entry!(Junction), entry!(LCorner), entry!(Peak), entry!(XCorner)],
);
