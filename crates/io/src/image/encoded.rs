//! Checks of an image file before it is decoded.

/// The reason not to read an encoded image, with its remedy; `None` if there is none.
///
/// Decoders are lenient: they fill the missing part of a JPEG with grey, guess the colours of inks, and return the
/// first image of an animation. Such pixels are no measurements.
pub(super) fn objection(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    match bytes {
        [0xFF, 0xD8, rest @ ..] => jpeg(rest),
        [0x89, b'P', b'N', b'G', _, _, _, _, chunks @ ..] => png(chunks),
        _ => None,
    }
}

const EARLY: (&str, &str) = ("a truncated image", "copy the file again");

/// Follows the markers of a JPEG to the end of the image.
fn jpeg(mut bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    loop {
        // The next marker is 0xFF and a byte other than fill, stuffed zero or restart.
        let at = bytes.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 1 | 0xD0..=0xD7 | 0xFF));
        let Some(at) = at else { return Some(EARLY) };
        let (marker, segment) = (bytes[at + 1], &bytes[at + 2..]);
        if marker == 0xD9 {
            return None;
        }
        let [high, low, content @ ..] = segment else { return Some(EARLY) };
        // The length includes its own two bytes.
        let length = usize::from(u16::from_be_bytes([*high, *low])).saturating_sub(2);
        let frame = matches!(marker, 0xC0..=0xCF) && !matches!(marker, 0xC4 | 0xC8 | 0xCC);
        // A frame segment holds depth, height, width and the number of components.
        if frame && content.get(5) == Some(&4) {
            return Some(("an image of four inks (CMYK)", "convert it to grey or RGB"));
        }
        let Some(rest) = content.get(length..) else { return Some(EARLY) };
        bytes = rest;
    }
}

/// Follows the chunks of a PNG to the pixels.
fn png(mut bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    while let [a, b, c, d, kind @ ..] = bytes {
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        if kind.starts_with(b"acTL") {
            return Some(("a moving image", "give each image as a file of its own"));
        }
        if kind.starts_with(b"IDAT") {
            return None;
        }
        // A chunk is length, kind, content and checksum.
        bytes = kind.get(length.checked_add(8)?..)?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jpeg_by_hand() {
        let frame = |components: u8| {
            let mut bytes = vec![0xFF, 0xD8, 0xFF, 0xC0, 0, 11, 8, 0, 1, 0, 1, components, 1, 0x11, 0];
            bytes.extend([0xFF, 0xDA, 0, 4, 9, 9, 0x12, 0xFF, 0, 0x34, 0xFF, 0xD0, 0x56, 0xFF, 0xD9]);
            bytes
        };
        assert_eq!(objection(&frame(1)), None);
        assert_eq!(objection(&frame(4)).map(|(what, _)| what), Some("an image of four inks (CMYK)"));
        let complete = frame(3);
        for end in 2..complete.len() {
            assert_eq!(objection(&complete[..end]), Some(EARLY), "{end}");
        }
        // A trailer after the image, as some cameras write, is ignored.
        assert_eq!(objection(&[&complete[..], b"trailer"].concat()), None);
    }
}
