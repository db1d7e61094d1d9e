//! Readers of image files.

use std::{fs::File, io::Read, path::Path};

use seafix_component::{Fault, decoded, decoded_file};
use seafix_vision::Image;

use self::{encoded::objection, samples::Samples};

mod decode;
mod encoded;
mod orientation;
mod pnm;
mod samples;
mod tiff;
mod unread;

pub use orientation::Orientation;

/// The limits of an image's size, checked before memory is allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageLimits {
    /// The maximum number of pixels in a header.
    pub pixels: u64,
    /// The maximum size of the file and of the decoder's memory (bytes).
    pub bytes: u64,
}

impl Default for ImageLimits {
    /// 64 Mi pixels, 512 MiB.
    fn default() -> Self {
        Self { pixels: 64 << 20, bytes: 512 << 20 }
    }
}

/// Reads a PNG, JPEG or PNM image as grey values.
///
/// An EXIF orientation is obeyed: the image is upright, as OpenCV reads it.
/// Values range from 0 (black) to 255 (white) at the full depth of the file. Colour becomes luma (Rec. 709).
/// `expected` is the calibrated size, `bits` the number of significant bits in images of 16 bits.
///
/// # Errors
/// An unreadable, truncated or unsupported file, an animation, a CMYK image, transparent pixels, values above `bits`, a
/// size other than expected or beyond `limits`. Sizes are checked in the header before decoding.
pub fn read_image(path: &Path, expected: [u32; 2], bits: u8, limits: ImageLimits) -> Result<Image, Fault> {
    let mut bytes = Vec::new();
    // The size of a file may change during reading, and a pipe has none.
    let read = regular(path)?.take(limits.bytes.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(path, &error))?;
    if bytes.len() as u64 > limits.bytes {
        let remedy = format!("the limit is {} bytes; {} raises it", limits.bytes, allows("max-bytes"));
        let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len()).max(bytes.len() as u64);
        return Err(Fault::new("an image file too large", path).value(format!("{size} bytes")).remedy(remedy));
    }
    decode_image(&bytes, path, expected, bits, limits)
}

/// Opens the regular file at `path`; devices, pipes and folders are rejected.
///
/// # Errors
/// A path that is no regular file, or the cause of the failure.
pub fn regular(path: &Path) -> Result<File, Fault> {
    let kind = std::fs::metadata(path).map_err(|error| unreadable(path, &error))?.file_type();
    if !kind.is_file() {
        let kind = if kind.is_dir() { "a folder" } else { "a device, pipe or socket" };
        return Err(Fault::new("a path that is not a file", path).value(kind).remedy("name a file"));
    }
    File::open(path).map_err(|error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> Fault {
    Fault::new(format!("cannot read ({error})"), path).remedy("check the path and its permissions")
}

/// The option of a command and the key of an experiment that change a limit.
fn allows(limit: &str) -> String {
    format!("`--{limit}`, in an experiment `source.{limit}`,")
}

/// Reads an image from the bytes of a file; faults name `path`.
///
/// # Errors
/// As for [`read_image`].
pub fn decode_image(
    bytes: &[u8],
    path: &Path,
    expected: [u32; 2],
    bits: u8,
    limits: ImageLimits,
) -> Result<Image, Fault> {
    decoded_file(path, || read_samples(bytes, path, expected, bits, limits))
}

fn read_samples(bytes: &[u8], path: &Path, expected: [u32; 2], bits: u8, limits: ImageLimits) -> Result<Image, Fault> {
    if let Some((format, remedy)) = unread::format(bytes) {
        return Err(Fault::new("an image of a format that is not read", path).value(format).remedy(remedy));
    }
    let stored = decode::size(bytes).map_err(|cause| samples::damaged(path, cause))?;
    let orientation = Orientation::of(bytes);
    let size = orientation.turned(stored);
    if size != expected && stored == expected {
        let what = "an image that EXIF turns to another size than the calibration";
        let value = format!("{}, calibrated {}×{}", orientation.describe(), expected[0], expected[1]);
        let remedy = "if the calibration is of the stored image, remove the tag: `exiftool -Orientation= FILE`";
        return Err(Fault::new(what, path).value(value).remedy(remedy));
    }
    check_size(path, size, expected, limits)?;
    if let Some((what, remedy)) = objection(bytes) {
        return Err(Fault::new(what, path).remedy(remedy));
    }
    let samples = decode::samples(bytes, path, limits.bytes)?;
    let pixels =
        grey_levels(&samples, stored[0] as usize, bits).map_err(|fault| Fault { file: path.to_owned(), ..fault })?;
    let pixels = orientation.upright(pixels, stored[0] as usize);
    Image::new(size[0] as usize, size[1] as usize, pixels).map_err(|error| Fault::new(error.to_string(), path))
}

/// The image of raw samples of a camera, row by row: grey or RGB, with `white` as maximum.
pub fn image_of_samples(samples: &[u16], [width, height]: [u32; 2], white: u16) -> Result<Image, Fault> {
    let channels = samples.len() / (width as usize * height as usize).max(1);
    let pixels = levels_of(samples, channels.max(1), width as usize, white, 0)?;
    Image::new(width as usize, height as usize, pixels).map_err(|error| Fault::new(error.to_string(), Path::new("")))
}

/// Checks the size of an image against the limits and the calibration.
fn check_size(path: &Path, [width, height]: [u32; 2], expected: [u32; 2], limits: ImageLimits) -> Result<(), Fault> {
    if u64::from(width) * u64::from(height) > limits.pixels {
        return Err(Fault::new("an image too large", path).value(format!("{width}×{height}")).remedy(format!(
            "the limit is {} pixels; {} raises it",
            limits.pixels,
            allows("max-pixels")
        )));
    }
    if [width, height] != expected {
        return Err(size_mismatch(path, [width, height], expected));
    }
    Ok(())
}

fn size_mismatch(path: &Path, [width, height]: [u32; 2], [w, h]: [u32; 2]) -> Fault {
    let same_shape = u64::from(width) * u64::from(h) == u64::from(height) * u64::from(w);
    let remedy = match () {
        () if width == h && height == w => {
            "turn the images as the calibration's were: theirs are turned by 90°".to_owned()
        }
        () if same_shape => format!(
            "use images of the calibrated size, or multiply fx, fy, cx + 0.5 and cy + 0.5 by {} and correct `size`",
            f64::from(width) / f64::from(w.max(1))
        ),
        () => "use the images of the calibrated camera, or correct `size`".to_owned(),
    };
    Fault::new("an image of another size than the calibration", path)
        .value(format!("{width}×{height}, calibrated {w}×{h}"))
        .remedy(remedy)
}

/// The size of the upright image in the header of an image file; `None` without a readable header.
pub fn declared_size(path: &Path) -> Option<[u32; 2]> {
    let bytes = header(path)?;
    let size = decoded(|| decode::size(&bytes), |message| message).ok()?;
    Some(Orientation::of(&bytes).turned(size))
}

/// The orientation that EXIF states in an image file.
pub fn orientation(path: &Path) -> Orientation {
    header(path).map_or(Orientation::UPRIGHT, |bytes| Orientation::of(&bytes))
}

/// The beginning of a file.
fn header(path: &Path) -> Option<Vec<u8>> {
    /// This length covers the thumbnails and profiles that cameras write before a JPEG's frame.
    const HEADER: u64 = 4 << 20;
    let mut bytes = Vec::new();
    regular(path).ok()?.take(HEADER).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// The fault of an image whose header has another size than `expected`; `None` without a readable header.
pub fn size_fault(path: &Path, expected: [u32; 2]) -> Option<Fault> {
    let size = declared_size(path)?;
    (size != expected).then(|| size_mismatch(path, size, expected))
}

/// The weights of red, green and blue in Rec. 709, in ten-thousandths.
const LUMA: [u32; 3] = [2126, 7152, 722];

/// The luma of every pixel, 0 to 255; `bits` is the number of significant bits in images of 16 bits.
fn grey_levels(samples: &Samples, width: usize, bits: u8) -> Result<Vec<f32>, Fault> {
    let full = if samples.deep { ((1_u32 << bits.min(16)) - 1) as u16 } else { u8::MAX.into() };
    let opaque = samples.white.unwrap_or(if samples.deep { u16::MAX } else { u8::MAX.into() });
    let white = samples.white.map_or(full, |white| white.min(full));
    levels_of(&samples.values, samples.channels, width, white, opaque)
}

fn levels_of(samples: &[u16], channels: usize, width: usize, white: u16, opaque: u16) -> Result<Vec<f32>, Fault> {
    let here = Path::new("");
    let colours = if channels > 2 { 3 } else { 1 };
    let pixels = samples.chunks_exact(channels);
    if pixels.clone().any(|pixel| pixel[colours..].iter().any(|&alpha| alpha < opaque)) {
        return Err(Fault::new("an image with transparent pixels", here).remedy("remove the alpha channel"));
    }
    if pixels.clone().any(|pixel| pixel[..colours].iter().any(|&value| value > white)) {
        let greatest = |pixel: &[u16]| pixel[..colours].iter().copied().max().unwrap_or(0);
        let all = pixels.clone().map(greatest).enumerate();
        let (at, max) = all.max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0))).unwrap_or_default();
        let (x, y, min) = (at % width.max(1), at / width.max(1), if max < 4096 { 12 } else { 16 });
        return Err(Fault::new("a pixel value above the bit depth", here)
            .value(format!("{max} at ({x}, {y}), white is {white}"))
            .remedy(format!("set bits = {min} in dataset.toml")));
    }
    // Integer arithmetic up to here gives the same value for a grey pixel stored as grey and as colour.
    let complete = f64::from(LUMA.iter().sum::<u32>()) * f64::from(white);
    let level = |pixel: &[u16]| {
        let luma: u32 = match pixel {
            [grey] | [grey, _] => u32::from(*grey) * LUMA.iter().sum::<u32>(),
            _ => pixel.iter().zip(LUMA).map(|(&value, weight)| u32::from(value) * weight).sum(),
        };
        (f64::from(luma) * 255.0 / complete) as f32
    };
    Ok(pixels.map(level).collect())
}

#[cfg(test)]
mod tests {
    use png::{BitDepth, ColorType};

    use super::*;

    /// Writes the bytes to a file and reads the image back.
    fn read(name: &str, bytes: &[u8], size: [u32; 2], bits: u8) -> Result<Image, String> {
        within(ImageLimits::default(), name, bytes, size, bits)
    }

    fn within(limits: ImageLimits, name: &str, bytes: &[u8], size: [u32; 2], bits: u8) -> Result<Image, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_image(&path, size, bits, limits).map_err(|fault| fault.to_string())
    }

    fn rejected(name: &str, bytes: &[u8], parts: &[&str]) {
        let message = read(name, bytes, [8, 6], 16).unwrap_err();
        for part in [&[name], parts].concat() {
            assert!(message.contains(part), "no `{part}` in {message}");
        }
        assert_eq!(message.lines().count(), 1);
    }

    /// A PNG of 8×6 pixels.
    fn png(samples: &[u8], (color, depth): (ColorType, BitDepth)) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(samples).unwrap();
        bytes
    }

    const GREY: (ColorType, BitDepth) = (ColorType::Grayscale, BitDepth::Eight);
    const DEEP: (ColorType, BitDepth) = (ColorType::Grayscale, BitDepth::Sixteen);

    fn pgm(samples: &[u8]) -> Vec<u8> {
        [b"P5 8 6 255\n", samples].concat()
    }

    fn jpeg(samples: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        jpeg_encoder::Encoder::new(&mut bytes, 100).encode(samples, 8, 6, jpeg_encoder::ColorType::Luma).unwrap();
        bytes
    }

    fn words(values: impl Iterator<Item = u16>) -> Vec<u8> {
        values.flat_map(u16::to_be_bytes).collect()
    }

    /// A palette of four bytes, which the decoder of PNG does not survive. Fails without the border.
    #[test]
    fn a_panic_of_a_decoder_is_a_fault_of_the_image() {
        let bytes = include_bytes!("../../../../fuzz/corpus/image/palette-short.png");
        let path = Path::new("palette.png");
        let fault = decode_image(bytes, path, [8, 6], 8, ImageLimits::default()).unwrap_err();
        assert!(fault.file == path && fault.to_string().lines().count() == 1, "{fault}");
    }

    #[test]
    fn grey_is_read_as_finely_as_it_is_stored() {
        let eight: Vec<u8> = (0..48).map(|i| i * 5).collect();
        for bytes in [png(&eight, GREY), pgm(&eight)] {
            let found = read("a", &bytes, [8, 6], 16).unwrap();
            assert!(found.pixels().iter().zip(&eight).all(|(a, b)| *a == f32::from(*b)));
        }
        let sixteen = words((0..48).map(|i| i * 1394));
        let found = read("a", &png(&sixteen, DEEP), [8, 6], 16).unwrap();
        for (i, value) in found.pixels().iter().enumerate() {
            assert_eq!(*value, (i as f64 * 1394.0 * 255.0 / 65535.0) as f32);
        }
        let twelve = png(&words((0..48).map(|i| 4095 - i)), DEEP);
        let found = read("a", &twelve, [8, 6], 12).unwrap();
        assert_eq!(found.pixels()[0], 255.0);
        assert_eq!(found.pixels()[47], (4048.0 * 255.0 / 4095.0_f64) as f32);
        let message = read("a", &twelve, [8, 6], 8).unwrap_err();
        assert!(message.contains("4095 at (0, 0), white is 255; ") && message.contains("set bits = 12"), "{message}");
    }

    #[test]
    fn colour_becomes_luma_without_rounding() {
        let grey: Vec<u8> = (0..48).flat_map(|i| [i * 5; 3]).collect();
        let found = read("a", &png(&grey, (ColorType::Rgb, BitDepth::Eight)), [8, 6], 16).unwrap();
        assert!(found.pixels().iter().enumerate().all(|(i, value)| *value == i as f32 * 5.0));
        let red: Vec<u8> = (0..48).flat_map(|_| [255, 0, 0, 255]).collect();
        let found = read("a", &png(&red, (ColorType::Rgba, BitDepth::Eight)), [8, 6], 16).unwrap();
        assert!((found.pixels()[7] - 54.213).abs() < 1e-4);
        let wide = words((0..48).flat_map(|i| [i, 65535, 0]));
        let found = read("a", &png(&wide, (ColorType::Rgb, BitDepth::Sixteen)), [8, 6], 16).unwrap();
        assert!((f64::from(found.pixels()[40]) - 255.0 * (0.7152 + 0.2126 * 40.0 / 65535.0)).abs() < 1e-4);
    }

    #[test]
    fn what_is_no_still_image_of_light_is_rejected_by_name() {
        let glass: Vec<u8> = (0..48).flat_map(|i| [100, 200 + i]).collect();
        rejected("a.png", &png(&glass, (ColorType::GrayscaleAlpha, BitDepth::Eight)), &["transparent pixels"]);
        // The chunk that announces an animation follows the 33 bytes of signature and header.
        let mut moving = png(&[7; 48], GREY);
        let frames = [0, 0, 0, 8, b'a', b'c', b'T', b'L', 0, 0, 0, 2, 0, 0, 0, 0, 0xF3, 0x8D, 0x93, 0x70];
        moving.splice(33..33, frames);
        rejected("a.png", &moving, &["a moving image"]);
        rejected("a.png", b"GIF", &["PNG, JPEG, TIFF or PNM"]);
        rejected("a.png", b"", &["PNG, JPEG, TIFF or PNM"]);
    }

    /// Fails if a format is one among all unknown ones.
    #[test]
    fn known_formats_that_are_not_read_state_their_converter() {
        for (bytes, parts) in [
            (&b"RIFF\x24\0\0\0WEBPVP8 "[..], ["WebP", "dwebp FILE.webp -o FILE.png"]),
            (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", ["HEIC", "heif-convert FILE.heic FILE.png"]),
            (b"\0\0\0\x20ftypavif\0\0\0\0avifmif1", ["AVIF", "avifdec FILE.avif FILE.png"]),
            (b"\0\0\0\x20ftypisom\0\0\x02\0", ["a video", "ffmpeg -i FILE"]),
            (b"GIF89a\x08\0\x06\0", ["GIF", "magick"]),
            (b"BM\x86\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0", ["BMP", "magick FILE FILE.png"]),
            (b"\xFF\x0A\x7A", ["JPEG XL", "djxl"]),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:0", ["Git LFS", "git lfs pull"]),
            (b"<!DOCTYPE html><html>", ["a page of text", "download the file again"]),
        ] {
            rejected("a.jpg", bytes, &[&["an image of a format that is not read in"], &parts[..]].concat());
        }
    }

    #[test]
    fn a_truncated_image_is_rejected_wherever_it_ends() {
        let samples: Vec<u8> = (0..48_usize).map(|i| (i * 37 % 251) as u8).collect();
        for (name, complete) in [("a.png", png(&samples, GREY)), ("a.jpg", jpeg(&samples)), ("a.pgm", pgm(&samples))] {
            assert!(read(name, &complete, [8, 6], 16).is_ok());
            // The last chunk of a PNG, 12 bytes, holds no data.
            let last = if name == "a.png" { complete.len() - 13 } else { complete.len() - 1 };
            for end in [0, 1, 5, 20, last / 2, last - 10, last] {
                assert!(read(name, &complete[..end], [8, 6], 16).is_err(), "{name}: {end} of {}", complete.len());
            }
        }
        // The content decides the format, not the extension.
        assert!(read("a.jpg", &png(&samples, GREY), [8, 6], 16).is_ok());
    }

    /// Interlaced pixels (Adam7, seven passes): 8×6 pixels in steps of 5.
    #[test]
    fn an_interlaced_image_is_put_in_order() {
        let bytes = [
            137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 8, 0, 0, 0, 6, 8, 0, 0, 0, 1, 172,
            105, 176, 177, 0, 0, 0, 71, 73, 68, 65, 84, 120, 1, 1, 60, 0, 195, 255, 0, 0, 0, 20, 0, 160, 180, 0, 10,
            30, 0, 170, 190, 0, 80, 90, 100, 110, 0, 5, 15, 25, 35, 0, 85, 95, 105, 115, 0, 165, 175, 185, 195, 0, 40,
            45, 50, 55, 60, 65, 70, 75, 0, 120, 125, 130, 135, 140, 145, 150, 155, 0, 200, 205, 210, 215, 220, 225,
            230, 235, 238, 81, 22, 9, 215, 91, 7, 20, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
        ];
        let found = read("a.png", &bytes, [8, 6], 8).unwrap();
        assert!(found.pixels().iter().enumerate().all(|(i, value)| *value == i as f32 * 5.0));
    }

    #[test]
    fn the_limits_are_the_caller_s() {
        let samples: Vec<u8> = (0..48).collect();
        let complete = png(&samples, GREY);
        let limited = |pixels, bytes| within(ImageLimits { pixels, bytes }, "a.png", &complete, [8, 6], 16);
        let enough = complete.len() as u64 + 48;
        assert!(limited(48, enough).is_ok());
        let message = limited(47, enough).unwrap_err();
        assert!(
            message.contains(
                "8×6; the limit is 47 pixels; `--max-pixels`, in an experiment `source.max-pixels`, raises it"
            ),
            "{message}"
        );
        let message = limited(48, complete.len() as u64 - 1).unwrap_err();
        assert!(message.contains("bytes; `--max-bytes`, in an experiment `source.max-bytes`, raises it"), "{message}");
        // A small file that decodes to much more memory.
        let flat = png(&[0; 48], GREY);
        assert!(within(ImageLimits { pixels: 48, bytes: 40 }, "a.png", &flat, [8, 6], 16).is_err());
    }

    #[test]
    fn huge_and_empty_sizes_are_rejected_from_the_header() {
        rejected("a.pgm", b"P5 0 0 255\n", &["a.pgm"]);
        rejected(
            "a.pgm",
            b"P5 100000 100000 255\n1234",
            &["an image too large", "100000×100000; the limit is 67108864 pixels"],
        );
        let header = |width: u32, height: u32| {
            let mut bytes = png(&[7; 48], GREY);
            bytes[16..20].copy_from_slice(&width.to_be_bytes());
            bytes[20..24].copy_from_slice(&height.to_be_bytes());
            bytes.truncate(41);
            bytes
        };
        for (width, height) in [(8_000_000, 4_000_000_000), (60_000, 60_000), (0, 6)] {
            rejected("a.png", &header(width, height), &[]);
        }
        let mut jpeg = self::jpeg(&[7; 48]);
        let frame = jpeg.windows(2).position(|pair| pair == [0xFF, 0xC0]).unwrap();
        jpeg[frame + 5..frame + 9].fill(0xFF);
        rejected("a.jpg", &jpeg, &["an image too large", "65535×65535"]);
    }
}
