//! Decoding of PNG, JPEG, TIFF and PNM files, recognised by their first bytes.

use std::{io::Cursor, path::Path};

use png::{BitDepth, ColorType, Transformations};
use seafix_component::Fault;
use zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};
use zune_jpeg::JpegDecoder;

use super::{
    pnm,
    samples::{Samples, damaged},
    tiff,
};

/// The width and height in the header of an image file.
///
/// # Errors
/// The cause, if the bytes are no image.
pub(super) fn size(bytes: &[u8]) -> Result<[u32; 2], String> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => {
            let mut decoder = png::Decoder::new(Cursor::new(bytes));
            let header = decoder.read_header_info().map_err(|error| error.to_string())?;
            Ok([header.width, header.height])
        }
        [0xFF, 0xD8, ..] => {
            let mut decoder = jpeg_decoder(bytes);
            decoder.decode_headers().map_err(|error| error.to_string())?;
            let (width, height) = decoder.dimensions().ok_or("a JPEG without a frame")?;
            let side = |side: usize| u32::try_from(side).map_err(|error| error.to_string());
            Ok([side(width)?, side(height)?])
        }
        bytes if tiff::is_one(bytes) => tiff::size(bytes),
        [b'P', b'1'..=b'7', ..] => pnm::Header::read(bytes).map(|header| header.size),
        _ => Err("an unknown format".to_owned()),
    }
}

/// Decodes an image file into at most `limit` bytes of samples. Faults name `path`.
///
/// # Errors
/// Bytes that are no complete image, or samples beyond the limit.
pub(super) fn samples(bytes: &[u8], path: &Path, limit: u64) -> Result<Samples, Fault> {
    let decoded = match bytes {
        [0x89, b'P', b'N', b'G', ..] => png_samples(bytes, limit),
        [0xFF, 0xD8, ..] => jpeg_samples(bytes, limit),
        bytes if tiff::is_one(bytes) => tiff::samples(bytes, limit),
        _ => {
            let header = pnm::Header::read(bytes).map_err(|cause| damaged(path, cause))?;
            within(limit, header.count().saturating_mul(2)).map_err(|cause| damaged(path, cause))?;
            return header.samples(bytes, path);
        }
    };
    decoded.map_err(|cause| damaged(path, cause))
}

fn png_samples(bytes: &[u8], limit: u64) -> Result<Samples, String> {
    let limits = png::Limits { bytes: usize::try_from(limit).unwrap_or(usize::MAX) };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (colour, depth) = reader.output_color_type();
    let channels = match colour {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => return Err("the colour palette was not expanded".to_owned()),
    };
    let size = reader.output_buffer_size().ok_or("the image does not fit into memory")?;
    within(limit, size)?;
    let mut buffer = vec![0; size];
    reader.next_frame(&mut buffer).map_err(|error| error.to_string())?;
    let deep = depth == BitDepth::Sixteen;
    let values = match deep {
        true => buffer.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect(),
        false => buffer.into_iter().map(u16::from).collect(),
    };
    Ok(Samples { values, channels, deep, white: None })
}

fn jpeg_samples(bytes: &[u8], limit: u64) -> Result<Samples, String> {
    let mut decoder = jpeg_decoder(bytes);
    decoder.decode_headers().map_err(|error| error.to_string())?;
    let (space, channels) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (ColorSpace::Luma, 1),
        _ => (ColorSpace::RGB, 3),
    };
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(space));
    within(limit, decoder.output_buffer_size().ok_or("the image does not fit into memory")?)?;
    let values = decoder.decode().map_err(|error| error.to_string())?;
    Ok(Samples { values: values.into_iter().map(u16::from).collect(), channels, deep: false, white: None })
}

fn jpeg_decoder(bytes: &[u8]) -> JpegDecoder<ZCursor<&[u8]>> {
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options)
}

fn within(limit: u64, size: usize) -> Result<(), String> {
    if size as u64 > limit {
        return Err(format!("it needs {size} bytes of memory, the limit is {limit}"));
    }
    Ok(())
}
