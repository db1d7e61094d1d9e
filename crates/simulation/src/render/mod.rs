//! From the field to two images.
//!
//! A software rasteriser with a visibility buffer: every pixel's centre, and 32 places of each pixel
//! that an edge crosses, are assigned to a triangle; each triangle is shaded once in a pixel, at the
//! exact place where the pixel's ray meets its plane, and counts by the area of the pixel that it covers. Lines bend behind ports and with distortion;
//! there, triangles are cut until they are straight to a fiftieth of a pixel, and only visibility
//! depends on the cuts. Work is shared by rows in bands of fixed size: the same bytes on any number of threads.

mod band;
mod blur;
mod camera;
mod coverage;
mod facet;
mod light;
mod math;
mod outline;
mod parts;
mod scene;
mod sensor;
mod shadow;
mod snow;
mod texture;
mod view;
mod visibility;

pub(crate) use camera::{RenderCamera, Rolling};
pub(crate) use scene::{Shot, Studio};
pub(crate) use sensor::Pattern;
pub use sensor::{Exposure, Imager};
pub(crate) use texture::SurfaceTextures;
pub(crate) use visibility::changes;

#[cfg(test)]
mod tests;
