//! Parts of images for the eyes of an operator.

use seafix_geometry::Pixel;
use seafix_vision::Image;

/// A square part of a left image around a feature.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The stamp of the pair (ns).
    pub stamp_ns: u64,
    /// The pixels.
    pub image: Image,
    /// The feature's position in [`image`](Self::image).
    pub place: Pixel,
    /// The standard deviations of the feature's expected position (px), along u and v; zero for a mark.
    pub sigma: [f64; 2],
}

/// The half side of a picture (px): an operator recognises a corner by what surrounds it.
pub(super) const HALF: usize = 48;

/// The square of half side `half` (px) around `at`, within the image, and the position of `at` in it; `None` outside.
pub(super) fn cut(left: &Image, at: Pixel, half: usize) -> Option<(Image, Pixel)> {
    let span = |x: f64, size: usize| {
        let (middle, half) = (x.round() as i64, half as i64);
        let (first, last) = ((middle - half).max(0), (middle + half).min(size as i64 - 1));
        (first <= last).then_some((first as usize, last as usize))
    };
    let ((x0, x1), (y0, y1)) = (span(at.u, left.width())?, span(at.v, left.height())?);
    let pixels: Vec<f32> = (y0..=y1).flat_map(|y| left.row(y)[x0..=x1].to_vec()).collect();
    let image = Image::new(x1 - x0 + 1, y1 - y0 + 1, pixels).ok()?;
    Some((image, Pixel { u: at.u - x0 as f64, v: at.v - y0 as f64 }))
}
