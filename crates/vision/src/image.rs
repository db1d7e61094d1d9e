//! Grey images.

/// A grey image in row-major order from the top left; 0 is black, 255 is the white of 8 bits.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<f32>,
}

/// An invalid image size.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("invalid image: {pixels} pixels do not fill {width}×{height}")]
pub struct BadImage {
    width: usize,
    height: usize,
    pixels: usize,
}

impl Image {
    /// The image of these pixels in row-major order.
    ///
    /// # Errors
    /// [`BadImage`] if the number of pixels differs from width × height, or either is zero.
    pub fn new(width: usize, height: usize, pixels: Vec<f32>) -> Result<Self, BadImage> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(pixels.len()) {
            return Err(BadImage { width, height, pixels: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// The width (px).
    pub fn width(&self) -> usize {
        self.width
    }

    /// The height (px).
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels in row-major order.
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }

    /// The pixels of row `y`.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// The pixels in row-major order, mutable.
    pub fn pixels_mut(&mut self) -> &mut [f32] {
        &mut self.pixels
    }

    /// Copies `other` into this image and reuses its memory.
    pub fn copy_from(&mut self, other: &Self) {
        (self.width, self.height) = (other.width, other.height);
        self.pixels.clear();
        self.pixels.extend_from_slice(&other.pixels);
    }

    /// Exchanges the pixel buffer with `pixels`, for stages that cannot work in place.
    ///
    /// # Panics
    /// If the lengths differ.
    pub(crate) fn swap_pixels(&mut self, pixels: &mut Vec<f32>) {
        assert_eq!(pixels.len(), self.pixels.len(), "the number of pixels changed");
        std::mem::swap(pixels, &mut self.pixels);
    }

    /// An image without pixels, to be given a size by [`reshape`](Self::reshape).
    pub(crate) fn blank() -> Self {
        Self { width: 0, height: 0, pixels: Vec::new() }
    }

    /// Changes the size and reuses the memory; the caller overwrites all pixels.
    pub(crate) fn reshape(&mut self, width: usize, height: usize) -> &mut [f32] {
        (self.width, self.height) = (width, height);
        self.pixels.resize(width * height, 0.0);
        &mut self.pixels
    }

    /// The variance of the rounding error (squared grey levels): of integer levels, or of 16 bits if any level is
    /// fractional.
    pub(crate) fn rounding(&self) -> f64 {
        const STEP: f64 = 255.0 / 65_535.0;
        // A sample of the pixels suffices: levels finer than integers are integer by chance once in hundreds.
        let stride = (self.pixels.len() / 257).max(1);
        let full = self.pixels.iter().step_by(stride).all(|level| level.fract() == 0.0);
        if full { 1.0 / 12.0 } else { STEP * STEP / 12.0 }
    }

    /// The pixels rounded to 8 bits and clipped to 0–255.
    pub fn to_u8(&self) -> Vec<u8> {
        self.pixels.iter().map(|p| p.round().clamp(0.0, 255.0) as u8).collect()
    }
}

/// Noise of integer grey levels with a fixed seed.
#[cfg(test)]
pub(crate) fn random_image(width: usize, height: usize) -> Image {
    let value = |i: usize| {
        let h = (i as u32).wrapping_mul(0x9E37_79B1);
        ((h ^ (h >> 15)).wrapping_mul(0x85EB_CA77) >> 24) as f32
    };
    Image::new(width, height, (0..width * height).map(value).collect()).unwrap()
}
