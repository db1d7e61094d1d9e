//! A grey image.

/// A grey image, row by row from the top left; values 0 (black) to 255 (the white of 8 bits).
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<f32>,
}

/// Why pixels are no image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{pixels} pixels do not fill {width}×{height}")]
pub struct BadImage {
    width: usize,
    height: usize,
    pixels: usize,
}

impl Image {
    /// The image of these pixels, row by row.
    ///
    /// # Errors
    /// [`BadImage`] when the count of pixels is not width × height, or either is zero.
    pub fn new(width: usize, height: usize, pixels: Vec<f32>) -> Result<Self, BadImage> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(pixels.len()) {
            return Err(BadImage { width, height, pixels: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }

    /// The pixels of row `y`.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// All pixels, row by row, to be changed in place.
    pub fn pixels_mut(&mut self) -> &mut [f32] {
        &mut self.pixels
    }

    /// Becomes the same as `other`, in the memory it has.
    pub fn copy_from(&mut self, other: &Self) {
        (self.width, self.height) = (other.width, other.height);
        self.pixels.clear();
        self.pixels.extend_from_slice(&other.pixels);
    }

    /// Takes `pixels` for its own and leaves its former ones in their place: a stage that cannot work
    /// in place writes there and swaps.
    ///
    /// # Panics
    /// When they are not as many.
    pub(crate) fn swap_pixels(&mut self, pixels: &mut Vec<f32>) {
        assert_eq!(pixels.len(), self.pixels.len(), "an image keeps its size");
        std::mem::swap(pixels, &mut self.pixels);
    }

    /// An image of no pixels, which only this crate sees, to be given a size.
    pub(crate) fn blank() -> Self {
        Self { width: 0, height: 0, pixels: Vec::new() }
    }

    /// Gives this image another size, in the memory that it has; the pixels are to be written.
    pub(crate) fn reshape(&mut self, width: usize, height: usize) -> &mut [f32] {
        (self.width, self.height) = (width, height);
        self.pixels.resize(width * height, 0.0);
        &mut self.pixels
    }

    /// The variance of the error of rounding (squares of grey levels): that of whole levels, or of 16 bits where the image
    /// has levels between them.
    pub(crate) fn rounding(&self) -> f64 {
        const STEP: f64 = 255.0 / 65_535.0;
        // Some pixels tell: finer levels are whole once in hundreds.
        let stride = (self.pixels.len() / 257).max(1);
        let full = self.pixels.iter().step_by(stride).all(|level| level.fract() == 0.0);
        if full { 1.0 / 12.0 } else { STEP * STEP / 12.0 }
    }

    /// The pixels rounded to 8 bits, clipped at black and white.
    pub fn to_u8(&self) -> Vec<u8> {
        self.pixels.iter().map(|p| p.round().clamp(0.0, 255.0) as u8).collect()
    }
}

/// Noise of whole grey levels, the same every time.
#[cfg(test)]
pub(crate) fn random_image(width: usize, height: usize) -> Image {
    let value = |i: usize| {
        let h = (i as u32).wrapping_mul(0x9E37_79B1);
        ((h ^ (h >> 15)).wrapping_mul(0x85EB_CA77) >> 24) as f32
    };
    Image::new(width, height, (0..width * height).map(value).collect()).unwrap()
}
