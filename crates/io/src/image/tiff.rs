//! Decoding of TIFF files: grey or colour of 8 or 16 bits, uncompressed, LZW or PackBits.

use std::io::Cursor;

use tiff::{
    ColorType,
    decoder::{Decoder, DecodingResult, Limits},
};

use super::samples::Samples;

/// Whether the bytes begin like a TIFF file.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    matches!(bytes, [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..])
}

/// The width and height in the first directory.
///
/// # Errors
/// The cause, if the bytes are no TIFF.
pub(super) fn size(bytes: &[u8]) -> Result<[u32; 2], String> {
    let (width, height) = decoder(bytes, u64::MAX)?.dimensions().map_err(|error| error.to_string())?;
    Ok([width, height])
}

/// The samples of the only image, in at most `limit` bytes.
///
/// # Errors
/// Another depth or compression, several images, or damage.
pub(super) fn samples(bytes: &[u8], limit: u64) -> Result<Samples, String> {
    let mut decoder = decoder(bytes, limit)?;
    let text = |error: tiff::TiffError| error.to_string();
    let (channels, deep) = match decoder.colortype().map_err(text)? {
        ColorType::Gray(8) => (1, false),
        ColorType::Gray(16) => (1, true),
        ColorType::GrayA(8) => (2, false),
        ColorType::GrayA(16) => (2, true),
        ColorType::RGB(8) => (3, false),
        ColorType::RGB(16) => (3, true),
        ColorType::RGBA(8) => (4, false),
        ColorType::RGBA(16) => (4, true),
        other => return Err(format!("a TIFF of the kind {other:?}, where grey or RGB of 8 or 16 bits is read")),
    };
    let values = match decoder.read_image().map_err(text)? {
        DecodingResult::U8(values) => values.into_iter().map(u16::from).collect(),
        DecodingResult::U16(values) => values,
        _ => return Err("a TIFF whose samples are not unsigned whole numbers".to_owned()),
    };
    if decoder.more_images() {
        return Err("a TIFF of several images; give each as a file of its own".to_owned());
    }
    Ok(Samples { values, channels, deep, white: None })
}

fn decoder(bytes: &[u8], limit: u64) -> Result<Decoder<Cursor<&[u8]>>, String> {
    let limit = usize::try_from(limit).unwrap_or(usize::MAX);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = limit;
    limits.intermediate_buffer_size = limit;
    Ok(Decoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?.with_limits(limits))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A TIFF of one strip: width, height, bits, compression, samples of a pixel, photometric, and the data.
    fn file(little: bool, size: [u16; 2], bits: u16, compression: u16, channels: u16, data: &[u8]) -> Vec<u8> {
        let word = |x: u16| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let long = |x: u32| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let photometric = if channels == 1 { 1 } else { 2 };
        let start: &[u8] = if little { b"II" } else { b"MM" };
        let mut bytes = [start, &word(42), &long(8 + data.len() as u32)].concat();
        bytes.extend(data);
        let depth = 8 + data.len() as u32 + 2 + 12 * 9 + 4;
        let short = |tag: u16, value: u16| [&word(tag)[..], &word(3), &long(1), &word(value), &[0, 0]].concat();
        let number = |tag: u16, value: u32| [&word(tag)[..], &word(4), &long(1), &long(value)].concat();
        bytes.extend(word(9));
        bytes.extend(short(256, size[0]));
        bytes.extend(short(257, size[1]));
        bytes.extend(if channels == 1 {
            short(258, bits)
        } else {
            [&word(258)[..], &word(3), &long(u32::from(channels)), &long(depth)].concat()
        });
        bytes.extend(short(259, compression));
        bytes.extend(short(262, photometric));
        bytes.extend(number(273, 8));
        bytes.extend(short(277, channels));
        bytes.extend(short(278, size[1]));
        bytes.extend(number(279, data.len() as u32));
        bytes.extend(long(0));
        bytes.extend((0..channels).flat_map(|_| word(bits)));
        bytes
    }

    #[test]
    fn grey_and_colour_of_both_depths_are_read() {
        let eight: Vec<u8> = (0..12).collect();
        for little in [true, false] {
            let read = samples(&file(little, [4, 3], 8, 1, 1, &eight), 1 << 20).unwrap();
            assert_eq!((read.values, read.channels, read.deep), ((0..12).collect(), 1, false));
            let colour = samples(&file(little, [2, 2], 8, 1, 3, &eight), 1 << 20).unwrap();
            assert_eq!((colour.values.len(), colour.channels), (12, 3));
            let deep: Vec<u8> = (0..6_u16)
                .flat_map(|k| if little { (k * 9000).to_le_bytes() } else { (k * 9000).to_be_bytes() })
                .collect();
            let read = samples(&file(little, [3, 2], 16, 1, 1, &deep), 1 << 20).unwrap();
            assert_eq!((read.values, read.deep), ((0..6).map(|k| k * 9000).collect(), true));
        }
    }

    /// The codes of LZW by hand: clear (256), 7, 7, the pair 7 7 (258), end (257), in nine bits each.
    #[test]
    fn lzw_is_read() {
        let mut bits = String::new();
        for code in [256, 7, 258, 7, 257] {
            bits += &format!("{code:09b}");
        }
        bits += &"0".repeat((8 - bits.len() % 8) % 8);
        let data: Vec<u8> = bits
            .as_bytes()
            .chunks(8)
            .map(|eight| u8::from_str_radix(std::str::from_utf8(eight).unwrap(), 2).unwrap())
            .collect();
        let read = samples(&file(true, [4, 1], 8, 5, 1, &data), 1 << 20).unwrap();
        assert_eq!(read.values, [7; 4]);
    }

    #[test]
    fn what_is_not_read_is_named_and_bounded() {
        let complete = file(true, [4, 3], 8, 1, 1, &[5; 12]);
        assert_eq!(size(&complete), Ok([4, 3]));
        assert!(samples(&complete, 4).is_err());
        // The last two bytes are those of a table that grey images do not need.
        for end in 0..complete.len() - 2 {
            assert!(samples(&complete[..end], 1 << 20).is_err(), "{end}");
        }
        assert!(samples(&file(true, [4, 3], 32, 1, 1, &[0; 48]), 1 << 20).unwrap_err().contains("8 or 16 bits"));
    }
}
