//! Checks for images from which no motion can be estimated.

use seafix_vision::Image;

use crate::odometry_trajectory::{Lost, Side};

/// Minimum standard deviation of the brightness (grey levels); below it an image holds only noise and rounding.
const MIN_VARIATION: f64 = 1.0;
/// Brightness of a saturated pixel (grey levels).
const WHITE: f32 = 254.5;
/// Maximum fraction of saturated pixels.
const MAX_WHITE: f64 = 0.5;

/// The last usable pair of raw images, to recognise a frozen camera.
#[derive(Debug, Default)]
pub(crate) struct RawImages(Option<[Image; 2]>);

impl RawImages {
    /// The reason why the images are unusable; usable images are kept for the next comparison.
    pub(crate) fn take(&mut self, images: [&Image; 2]) -> Option<Lost> {
        let lost = unusable(images, self.0.as_ref().map(|[left, right]| [left, right]));
        if lost.is_none() {
            match &mut self.0 {
                Some(raw) => raw.iter_mut().zip(images).for_each(|(raw, image)| raw.copy_from(image)),
                raw => *raw = Some(images.map(Image::clone)),
            }
        }
        lost
    }
}

/// The reason why the images are unusable; `before` is the previous pair.
fn unusable(images: [&Image; 2], before: Option<[&Image; 2]>) -> Option<Lost> {
    for (side, image) in [Side::Left, Side::Right].into_iter().zip(images) {
        let pixels = image.pixels();
        let count = pixels.len() as f64;
        let (mut sum, mut squares, mut white) = (0.0, 0.0, 0_usize);
        for row in pixels.chunks(image.width()) {
            let (mut s, mut q) = (0.0_f32, 0.0_f32);
            for &pixel in row {
                // Values relative to mid grey keep the squares small and precise.
                let off = pixel - 128.0;
                s += off;
                q += off * off;
                white += usize::from(pixel >= WHITE);
            }
            sum += f64::from(s);
            squares += f64::from(q);
        }
        let fraction = white as f64 / count;
        if fraction > MAX_WHITE {
            return Some(Lost::Saturated(side, 100.0 * fraction));
        }
        let deviation = (squares / count - (sum / count).powi(2)).max(0.0).sqrt();
        if deviation < MIN_VARIATION {
            return Some(Lost::Blank(side, deviation));
        }
    }
    let before = before?;
    for (index, side) in [Side::Left, Side::Right].into_iter().enumerate() {
        if images[index] == before[index] {
            return Some(Lost::Frozen(side));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: impl Fn(usize) -> f32) -> Image {
        Image::new(16, 16, (0..256).map(value).collect()).unwrap()
    }

    #[test]
    fn each_fault_has_its_name() {
        let good = image(|i| (i * 37 % 200) as f32);
        let other = image(|i| (i * 53 % 200) as f32);
        let black = image(|i| (i % 2) as f32);
        let white = image(|i| if i % 3 == 0 { (i % 200) as f32 } else { 255.0 });
        assert_eq!(unusable([&good, &other], Some([&other, &good])), None);
        assert!(matches!(unusable([&good, &black], None), Some(Lost::Blank(Side::Right, _))));
        assert!(matches!(unusable([&white, &good], None), Some(Lost::Saturated(Side::Left, _))));
        assert_eq!(unusable([&good, &other], Some([&black, &other])), Some(Lost::Frozen(Side::Right)));
    }

    #[test]
    fn frozen_is_what_repeats_the_last_images_that_showed_anything() {
        let good = image(|i| (i * 37 % 200) as f32);
        let other = image(|i| (i * 53 % 200) as f32);
        let black = image(|i| (i % 2) as f32);
        let mut raw = RawImages::default();
        assert_eq!(raw.take([&good, &other]), None);
        assert!(matches!(raw.take([&black, &other]), Some(Lost::Blank(Side::Left, _))));
        assert_eq!(raw.take([&good, &good]), Some(Lost::Frozen(Side::Left)));
        assert_eq!(raw.take([&other, &good]), None);
        assert_eq!(raw.take([&good, &good]), Some(Lost::Frozen(Side::Right)));
    }
}
