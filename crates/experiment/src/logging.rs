//! Settings for the content of logs.

use seafix_component::Settings;
use seafix_log::GreyImage;
use serde::{Deserialize, Serialize};

/// The content of a log for each frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct Logging {
    /// The form of the images.
    pub images: ImagesLogged,
}

/// The form of logged images, which make up most of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum ImagesLogged {
    /// Full images, on which any method can be replayed.
    #[default]
    All,
    /// Thumbnails of at least 256 columns, enough to see the scene.
    Thumbnails,
    /// No images; clouds and results are logged in any case.
    None,
}

/// The minimum width of a thumbnail (px).
const COLUMNS: u32 = 256;

impl Logging {
    /// Whether all settings are defaults.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl ImagesLogged {
    /// The factor by which images with this number of columns are reduced.
    pub(crate) fn factor(self, columns: u32) -> u32 {
        match self {
            Self::All | Self::None => 1,
            Self::Thumbnails => (columns / COLUMNS).max(1),
        }
    }

    /// The logged form of an image.
    pub(crate) fn logged(self, image: GreyImage) -> Option<GreyImage> {
        match self {
            Self::All => Some(image),
            Self::None => None,
            Self::Thumbnails => Some(smaller(&image, self.factor(image.width))),
        }
    }
}

/// The image reduced by `factor`: each pixel is the mean of `factor`² pixels.
fn smaller(image: &GreyImage, factor: u32) -> GreyImage {
    let (width, height) = (image.width / factor, (image.height / factor).max(1));
    let mean = |x: u32, y: u32| {
        let rows = y * factor..((y + 1) * factor).min(image.height);
        let area = factor * rows.len() as u32;
        let of_row = |row: u32| {
            let start = (row * image.width + x * factor) as usize;
            image.pixels[start..start + factor as usize].iter().map(|&p| u32::from(p)).sum::<u32>()
        };
        ((rows.map(of_row).sum::<u32>() + area / 2) / area) as u8
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
    GreyImage { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thumbnail_has_the_means() {
        let pixels = [0, 2, 10, 10, 9, 4, 6, 10, 10, 9].to_vec();
        let small = smaller(&GreyImage { width: 5, height: 2, pixels }, 2);
        assert_eq!((small.width, small.height, small.pixels), (2, 1, vec![3, 10]));
        assert_eq!([1024, 255, 1600].map(|columns| ImagesLogged::Thumbnails.factor(columns)), [4, 1, 6]);
    }
}
