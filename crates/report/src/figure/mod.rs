//! Figures.

mod field;
mod marks;
mod picture;
mod plot;

pub(crate) use field::{Cell, Field, field};
pub(crate) use picture::Picture;
pub(crate) use plot::{Panel, Plot, Series, Value, plot};

/// Colours that the colour-blind tell apart (Okabe and Ito, 2008), dark enough for lines on white.
pub(crate) const PALETTE: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];
