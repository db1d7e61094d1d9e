//! Colour images in memory.

use jpeg_encoder::{ColorType, Encoder};

/// An RGB image, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Canvas {
    pub(super) width: u32,
    pub(super) height: u32,
    pixels: Vec<[u8; 3]>,
}

impl Canvas {
    /// An image of one colour.
    pub(super) fn new(width: u32, height: u32, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    fn place(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// The colour of a pixel.
    pub(super) fn at(&self, x: u32, y: u32) -> [u8; 3] {
        self.pixels[self.place(x, y)]
    }

    /// Sets the colour of a pixel.
    pub(super) fn set(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        let place = self.place(x, y);
        self.pixels[place] = colour;
    }

    /// The image resampled to another size.
    pub(super) fn resized(&self, width: u32, height: u32) -> Self {
        let size = [self.width, self.height].map(|side| side as usize);
        let planes = [0, 1, 2].map(|channel| {
            let plane: Vec<u8> = self.pixels.iter().map(|pixel| pixel[channel]).collect();
            resized(&plane, size, [width as usize, height as usize])
        });
        let pixels = (0..planes[0].len()).map(|i| [planes[0][i], planes[1][i], planes[2][i]]).collect();
        Self { width, height, pixels }
    }

    /// The image as a JPEG with a quality from 1 to 100.
    pub(super) fn jpeg(&self, quality: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        let side = |side: u32| u16::try_from(side).expect("a picture of a frame has the size that JPEG can hold");
        Encoder::new(&mut bytes, quality)
            .encode(self.pixels.as_flattened(), side(self.width), side(self.height), ColorType::Rgb)
            .expect("memory can be written, and the pixels fill the picture");
        bytes
    }
}

/// A grey image resampled with a triangle filter.
///
/// The filter interpolates linearly when it enlarges and averages when it shrinks. `size` and `to` are width and height
/// (px).
pub(super) fn resized(pixels: &[u8], size: [usize; 2], to: [usize; 2]) -> Vec<u8> {
    let columns = weights(size[0], to[0]);
    let rows = weights(size[1], to[1]);
    let wide: Vec<f32> = pixels
        .chunks_exact(size[0].max(1))
        .flat_map(|row| {
            columns.iter().map(|taps| taps.iter().map(|&(x, weight)| weight * f32::from(row[x])).sum::<f32>())
        })
        .collect();
    let mut resized = Vec::with_capacity(to[0] * to[1]);
    for taps in &rows {
        for x in 0..to[0] {
            let level: f32 = taps.iter().map(|&(y, weight)| weight * wide[y * to[0] + x]).sum();
            resized.push(level.round().clamp(0.0, 255.0) as u8);
        }
    }
    resized
}

/// The source pixels and weights of each of `to` pixels.
///
/// The weights of a pixel add up to one.
fn weights(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let ratio = from as f32 / to.max(1) as f32;
    let reach = ratio.max(1.0);
    let of_one = |place: usize| {
        // Pixel k covers the interval from k to k + 1.
        let centre = (place as f32 + 0.5) * ratio - 0.5;
        let first = (centre - reach).ceil().max(0.0) as usize;
        let last = ((centre + reach).floor().max(0.0) as usize).min(from.saturating_sub(1));
        let taps = (first..=last).map(|x| (x, 1.0 - ((x as f32 - centre) / reach).abs()));
        let taps: Vec<_> = taps.filter(|(_, weight)| *weight > 0.0).collect();
        let sum: f32 = taps.iter().map(|(_, weight)| weight).sum();
        taps.into_iter().map(|(x, weight)| (x, weight / sum)).collect()
    };
    (0..to).map(of_one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_grows_by_interpolation_and_shrinks_by_means() {
        assert_eq!(resized(&[0, 100], [2, 1], [4, 1]), [0, 25, 75, 100]);
        assert_eq!(resized(&[0, 100], [1, 2], [1, 4]), [0, 25, 75, 100]);
        // Weights 3, 3, 1 and 1, 3, 3, 1 of eight, the first cut off at the border.
        assert_eq!(resized(&[10, 20, 70, 80], [4, 1], [2, 1]), [23, 67]);
        let ramp: Vec<u8> = (0..100).collect();
        assert_eq!(resized(&ramp, [10, 10], [10, 10]), ramp);
    }

    #[test]
    fn a_picture_of_one_colour_stays_so_in_any_size() {
        let canvas = Canvas::new(7, 5, [10, 20, 30]).resized(3, 9);
        assert_eq!(canvas, Canvas::new(3, 9, [10, 20, 30]));
    }
}
