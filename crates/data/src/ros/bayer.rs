//! Grey images of Bayer mosaics.

use seafix_vision::Image;

/// The colours of a mosaic: red 0, green 1, blue 2 of the pixels (0, 0), (1, 0), (0, 1), (1, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Mosaic([usize; 4]);

/// The weights of red, green and blue in Rec. 709.
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

impl Mosaic {
    /// The mosaic that an encoding names: `bayer_rggb8`, `bayer_gbrg16`.
    pub(crate) fn of(encoding: &str) -> Option<Self> {
        let letters = encoding.trim().strip_prefix("bayer_")?.get(..4)?;
        let mut colours = [0; 4];
        for (colour, letter) in colours.iter_mut().zip(letters.chars()) {
            *colour = "rgb".find(letter)?;
        }
        Some(Self(colours))
    }

    /// The luma of the colours that are interpolated bilinearly, so that the mosaic leaves no pattern on even colours.
    pub(crate) fn grey(self, mosaic: &Image) -> Image {
        let (width, height) = (mosaic.width(), mosaic.height());
        let pixels = mosaic.pixels();
        let mut grey = Vec::with_capacity(pixels.len());
        for v in 0..height {
            for u in 0..width {
                let (mut sums, mut weights) = ([0.0_f32; 3], [0.0_f32; 3]);
                for y in v.saturating_sub(1)..(v + 2).min(height) {
                    for x in u.saturating_sub(1)..(u + 2).min(width) {
                        let colour = self.0[2 * (y % 2) + x % 2];
                        let weight = if x == u { 2.0 } else { 1.0 } * if y == v { 2.0 } else { 1.0 };
                        sums[colour] += weight * pixels[y * width + x];
                        weights[colour] += weight;
                    }
                }
                // A single row or column lacks one colour; its neighbours stand for it.
                let mean = sums.iter().sum::<f32>() / weights.iter().sum::<f32>();
                let colour = |c: usize| if weights[c] > 0.0 { sums[c] / weights[c] } else { mean };
                grey.push(LUMA.iter().enumerate().map(|(c, luma)| luma * colour(c)).sum());
            }
        }
        Image::new(width, height, grey).expect("the size of the mosaic")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_colour_leaves_no_pattern() {
        for (name, letters) in
            [("bayer_rggb8", "rggb"), ("bayer_bggr16", "bggr"), ("bayer_gbrg8", "gbrg"), ("bayer_grbg8", "grbg")]
        {
            let levels = |letter: char| match letter {
                'r' => 200.0,
                'g' => 100.0,
                _ => 40.0,
            };
            let letters: Vec<char> = letters.chars().collect();
            let pixels = (0..7 * 5).map(|k| levels(letters[2 * (k / 7 % 2) + k % 7 % 2])).collect();
            let grey = Mosaic::of(name).unwrap().grey(&Image::new(7, 5, pixels).unwrap());
            let luma = 0.2126 * 200.0 + 0.7152 * 100.0 + 0.0722 * 40.0;
            assert!(grey.pixels().iter().all(|pixel| (pixel - luma).abs() < 1e-3), "{name}");
        }
        assert_eq!((Mosaic::of("mono8"), Mosaic::of("bayer_xggb8")), (None, None));
    }

    #[test]
    fn a_grey_slope_stays_a_slope() {
        let slope = Image::new(8, 8, (0..64).map(|k| (k % 8 + 2 * (k / 8)) as f32).collect()).unwrap();
        let grey = Mosaic::of("bayer_rggb8").unwrap().grey(&slope);
        for v in 1..7 {
            for u in 1..7 {
                assert!((grey.pixels()[v * 8 + u] - (u + 2 * v) as f32).abs() < 1e-4);
            }
        }
    }
}
