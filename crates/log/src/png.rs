//! Grey images as PNG, the lossless form in which logs keep them.

use std::io::Cursor;

use image::{
    ExtendedColorType, ImageDecoder, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder},
};

use crate::GreyImage;

/// No image of a log has more pixels than this.
const LIMIT: u64 = 64 << 20;

/// `image` as PNG, losslessly and quickly.
///
/// # Errors
/// An image whose pixels do not fill it.
pub fn encode_png(image: &GreyImage) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    // To try all filters on every row takes half as long again and saves a hundredth.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Avg)
        .write_image(&image.pixels, image.width, image.height, ExtendedColorType::L8)
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// The 8-bit grey image in a PNG; its declared size is checked before anything is decoded.
pub(crate) fn decode(bytes: &[u8]) -> Result<GreyImage, String> {
    let decoder = PngDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > LIMIT {
        return Err(format!("an image of {width} x {height} px; the limit is {LIMIT} px"));
    }
    if decoder.color_type() != image::ColorType::L8 {
        return Err(format!("a PNG of kind {:?}; logs keep 8-bit grey", decoder.color_type()));
    }
    let mut pixels = vec![0; width as usize * height as usize];
    decoder.read_image(&mut pixels).map_err(|error| error.to_string())?;
    Ok(GreyImage { width, height, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_image_comes_back() {
        let image = GreyImage { width: 5, height: 3, pixels: (0..15).map(|i| i * 17).collect() };
        assert_eq!(decode(&encode_png(&image).unwrap()).unwrap(), image);
    }

    #[test]
    fn a_bomb_is_refused_by_its_header() {
        let mut bytes = encode_png(&GreyImage { width: 1, height: 1, pixels: vec![0] }).unwrap();
        bytes[16..20].copy_from_slice(&8_000_000_u32.to_be_bytes());
        assert!(decode(&bytes).is_err());
    }
}
