//! PNG files.

use std::path::Path;

use seafix_component::Fault;
use seafix_log::{GreyImage, encode_png, encode_png_16};
use seafix_vision::Image;

/// Writes `image` as a grey PNG: of 8 bits, or of 16 with `bits` significant ones.
///
/// # Errors
/// A file that cannot be written.
pub fn write_png(path: &Path, image: &Image, bits: u8) -> Result<(), Fault> {
    let encoded = if bits <= 8 { encode_png(&grey(image)) } else { encode_deep(image, bits) };
    encoded
        .and_then(|bytes| std::fs::write(path, bytes).map_err(|error| error.to_string()))
        .map_err(|error| Fault::new(format!("cannot write ({error})"), path).remedy("check free space and permissions"))
}

/// The image as a PNG of 16 bits whose white is 2^`bits` − 1.
fn encode_deep(image: &Image, bits: u8) -> Result<Vec<u8>, String> {
    let white = f64::from((1_u32 << bits) - 1);
    let level = |grey: &f32| (f64::from(*grey) * white / 255.0).round().clamp(0.0, white) as u16;
    let samples: Vec<u16> = image.pixels().iter().map(level).collect();
    encode_png_16([image.width() as u32, image.height() as u32], &samples)
}

/// The 8-bit form of an image for logs.
pub fn grey(image: &Image) -> GreyImage {
    GreyImage { width: image.width() as u32, height: image.height() as u32, pixels: image.to_u8() }
}

#[cfg(test)]
mod tests {
    use seafix_io::{ImageLimits, read_image};

    use super::*;

    #[test]
    fn what_is_written_in_twelve_bits_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let levels: Vec<f32> = (0..48).map(|k| (f64::from(k * 87) * 255.0 / 4095.0) as f32).collect();
        let image = Image::new(8, 6, levels).unwrap();
        write_png(&path, &image, 12).unwrap();
        assert_eq!(read_image(&path, [8, 6], 12, ImageLimits::default()).unwrap(), image);
    }
}
