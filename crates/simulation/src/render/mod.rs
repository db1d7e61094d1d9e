//! Rendering of the scene to a stereo pair.
//!
//! A software rasteriser with a visibility buffer assigns the centre of every pixel, and 32 samples of each pixel that
//! an edge crosses, to a triangle. Each visible triangle is shaded once in a pixel, at the exact intersection of the
//! pixel's ray with its plane, and weighted by the area of the pixel that it covers. Lines bend behind ports and with
//! distortion; there, triangles are subdivided until their sides are straight to 1/50 px, and only visibility depends
//! on the subdivision. Rows are processed in bands of fixed size, so the bytes do not depend on the number of threads.

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
pub use sensor::{Exposure, Imager};
pub(crate) use texture::SurfaceTextures;
pub(crate) use visibility::changes;

#[cfg(test)]
mod tests;
