//! Figures: charts, drawings and pictures with marks.

mod axis;
mod canvas;
mod chart;
mod drawing;
mod layer;
mod marks;
mod picture;

pub(crate) use axis::Axis;
pub(crate) use chart::{Chart, Entry, Panel};
pub(crate) use drawing::{Anchor, DASHES, Drawing, Ink, PALETTE, Shape, Stroke, mix};
pub(crate) use layer::Layer;
pub(crate) use picture::{Marked, draw as draw_picture};
