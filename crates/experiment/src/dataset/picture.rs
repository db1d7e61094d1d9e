//! Image files in and out.

use std::{fs::File, io::BufReader, path::Path};

use image::{ColorType, ImageReader, Limits};
use seafix_component::Fault;
use seafix_log::encode_png;
use seafix_vision::Image;

use crate::record::grey;

/// The most pixels an image may declare.
const MOST_PIXELS: u64 = 64 << 20;
/// The most memory its decoder may take (bytes).
const MOST_MEMORY: u64 = 512 << 20;

/// Reads a PNG, JPEG or PNM image as grey; colour becomes luma (Rec. 709 weights). `expected` is the
/// size that the calibration has, `bits` the depth of the pixels in images of 16 bits.
///
/// # Errors
/// An unreadable, truncated or foreign file, a size other than expected or beyond 64 Mpx
/// (checked from the header, before anything is decoded).
pub fn read_image(path: &Path, expected: [u32; 2], bits: u8) -> Result<Image, Fault> {
    let (width, height) = image_size(path, expected)?;
    let mut reader = open(path)?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_MEMORY);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| damaged(path, &error))?;
    let pixels: Vec<f32> = match decoded.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
            decoded.into_luma8().into_raw().into_iter().map(f32::from).collect()
        }
        _ => {
            let white = (1_u32 << bits.min(16)) - 1;
            decoded.into_luma16().into_raw().into_iter().map(|p| f32::from(p) * (255.0 / white as f32)).collect()
        }
    };
    Image::new(width as usize, height as usize, pixels).map_err(|error| Fault::new(error.to_string(), path))
}

/// Width and height from the header alone; `expected` is the size that the calibration has.
fn image_size(path: &Path, expected: [u32; 2]) -> Result<(u32, u32), Fault> {
    let (width, height) = open(path)?.into_dimensions().map_err(|error| damaged(path, &error))?;
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(Fault::new("an image too large", path)
            .value(format!("{width}×{height}"))
            .remedy(format!("at most {MOST_PIXELS} pixels are read")));
    }
    let [w, h] = expected;
    if (width, height) != (w, h) {
        return Err(Fault::new("an image of another size than the calibration", path)
            .value(format!("{width}×{height}, calibrated {w}×{h}"))
            .remedy("give the images the rig was calibrated with, or correct `size`"));
    }
    Ok((width, height))
}

fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, Fault> {
    ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(|error| {
        Fault::new(format!("cannot read ({error})"), path).remedy("check the path and its permissions")
    })
}

fn damaged(path: &Path, error: &image::ImageError) -> Fault {
    Fault::new("no image that can be decoded", path)
        .value(error.to_string())
        .remedy("PNG, JPEG and PNM are read, grey or colour, 8 or 16 bits")
}

/// Writes `image` as an 8-bit grey PNG.
///
/// # Errors
/// The file cannot be written.
pub fn write_png(path: &Path, image: &Image) -> Result<(), Fault> {
    encode_png(&grey(image))
        .and_then(|bytes| std::fs::write(path, bytes).map_err(|error| error.to_string()))
        .map_err(|error| Fault::new(format!("cannot write ({error})"), path).remedy("check space and permissions"))
}
