//! Grey images as PNG, the lossless form in which logs keep them.

use std::io::Cursor;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Filter, Limits};

use seafix_component::decoded;

use crate::record::GreyImage;

/// No image of a log has more pixels than this.
const LIMIT: u64 = 64 << 20;

/// `image` as PNG, losslessly and quickly.
///
/// # Errors
/// An image whose pixels do not fill it.
pub fn encode_png(image: &GreyImage) -> Result<Vec<u8>, String> {
    // To try all filters on every row takes half as long again and saves a hundredth.
    encode_grey([image.width, image.height], BitDepth::Eight, Filter::Avg, &image.pixels)
}

/// Grey samples of 16 bits as PNG, losslessly.
///
/// # Errors
/// Samples that do not fill an image of this size.
pub fn encode_png_16(size: [u32; 2], samples: &[u16]) -> Result<Vec<u8>, String> {
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect();
    encode_grey(size, BitDepth::Sixteen, Filter::Adaptive, &bytes)
}

fn encode_grey([width, height]: [u32; 2], depth: BitDepth, filter: Filter, data: &[u8]) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    encoder.set_filter(filter);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(data).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// The 8-bit grey image in a PNG; its declared size is checked before anything is decoded.
pub(crate) fn decode(bytes: &[u8]) -> Result<GreyImage, String> {
    decoded(|| decode_grey(bytes), |message| message)
}

fn decode_grey(bytes: &[u8]) -> Result<GreyImage, String> {
    let mut decoder =
        Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: usize::try_from(LIMIT).unwrap_or(usize::MAX) });
    let header = decoder.read_header_info().map_err(|error| error.to_string())?;
    let (width, height) = header.size();
    if u64::from(width) * u64::from(height) > LIMIT {
        return Err(format!("an image of {width} x {height} px; the limit is {LIMIT} px"));
    }
    if (header.color_type, header.bit_depth) != (ColorType::Grayscale, BitDepth::Eight) {
        return Err(format!("a PNG of kind {:?} {:?}; logs keep 8-bit grey", header.color_type, header.bit_depth));
    }
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let mut pixels = vec![0; width as usize * height as usize];
    reader.next_frame(&mut pixels).map_err(|error| error.to_string())?;
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
    fn a_bomb_is_rejected_by_its_header() {
        let mut bytes = encode_png(&GreyImage { width: 1, height: 1, pixels: vec![0] }).unwrap();
        bytes[16..20].copy_from_slice(&8_000_000_u32.to_be_bytes());
        assert!(decode(&bytes).is_err());
    }
}
