//! The orientation that EXIF states: how stored rows and columns become those of the upright image.

/// The orientations of EXIF, 1 to 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Orientation(u8);

/// The tag of the orientation in a TIFF directory.
const TAG: u16 = 0x0112;

impl Orientation {
    /// As stored.
    pub const UPRIGHT: Self = Self(1);

    /// The orientation in the bytes of a JPEG, PNG or TIFF file; upright without one.
    pub fn of(bytes: &[u8]) -> Self {
        let block = match bytes {
            [0xFF, 0xD8, rest @ ..] => of_jpeg(rest),
            [0x89, b'P', b'N', b'G', _, _, _, _, rest @ ..] => of_png(rest),
            [b'I', b'I', ..] | [b'M', b'M', ..] => Some(bytes),
            _ => None,
        };
        block.and_then(of_directory).map_or(Self::UPRIGHT, Self)
    }

    /// Whether rows and columns change places.
    pub fn is_transposed(self) -> bool {
        self.0 >= 5
    }

    /// The size of the upright image.
    pub fn turned(self, [width, height]: [u32; 2]) -> [u32; 2] {
        if self.is_transposed() { [height, width] } else { [width, height] }
    }

    /// The pixels of the upright image, row by row, of the stored ones with this width.
    pub fn upright<T: Copy>(self, stored: Vec<T>, width: usize) -> Vec<T> {
        if self == Self::UPRIGHT || width == 0 {
            return stored;
        }
        let height = stored.len() / width;
        let (across, down) = if self.is_transposed() { (height, width) } else { (width, height) };
        let place = |x: usize, y: usize| match self.0 {
            2 => (width - 1 - x, y),
            3 => (width - 1 - x, height - 1 - y),
            4 => (x, height - 1 - y),
            5 => (y, x),
            6 => (y, height - 1 - x),
            7 => (width - 1 - y, height - 1 - x),
            8 => (width - 1 - y, x),
            _ => (x, y),
        };
        let all = (0..down).flat_map(|y| (0..across).map(move |x| (x, y)));
        all.map(|(x, y)| place(x, y)).map(|(u, v)| stored[v * width + u]).collect()
    }

    /// The turn in words.
    pub fn describe(self) -> &'static str {
        match self.0 {
            2 => "mirrored left to right",
            3 => "turned by 180°",
            4 => "mirrored top to bottom",
            5 => "transposed",
            6 => "turned clockwise by 90°",
            7 => "transposed and turned by 180°",
            8 => "turned anticlockwise by 90°",
            _ => "upright",
        }
    }
}

/// The TIFF block of the first EXIF segment of a JPEG.
fn of_jpeg(mut bytes: &[u8]) -> Option<&[u8]> {
    while let [0xFF, marker, high, low, rest @ ..] = bytes {
        // Pixels begin; no segment follows.
        if matches!(marker, 0xDA | 0xD9) {
            return None;
        }
        let length = usize::from(u16::from_be_bytes([*high, *low])).checked_sub(2)?;
        let content = rest.get(..length)?;
        if *marker == 0xE1
            && let Some(block) = content.strip_prefix(b"Exif\0\0")
        {
            return Some(block);
        }
        bytes = &rest[length..];
    }
    None
}

/// The TIFF block of the chunk `eXIf` of a PNG.
fn of_png(mut bytes: &[u8]) -> Option<&[u8]> {
    while let [a, b, c, d, kind @ ..] = bytes {
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        if kind.starts_with(b"eXIf") {
            return kind.get(4..length.checked_add(4)?);
        }
        bytes = kind.get(length.checked_add(8)?..)?;
    }
    None
}

/// The orientation in the first directory of a TIFF block.
fn of_directory(block: &[u8]) -> Option<u8> {
    let little = match block.get(..4)? {
        b"II*\0" => true,
        b"MM\0*" => false,
        _ => return None,
    };
    let word = |at: usize| {
        let bytes: [u8; 2] = block.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    };
    let long = |at: usize| {
        let bytes: [u8; 4] = block.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    };
    let directory = long(4)? as usize;
    let entries = usize::from(word(directory)?);
    (0..entries).find_map(|index| {
        let entry = directory.checked_add(2 + 12 * index)?;
        let value = (word(entry)? == TAG).then(|| word(entry + 8))??;
        u8::try_from(value).ok().filter(|value| (1..=8).contains(value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A TIFF block with one entry, in both byte orders.
    fn block(orientation: u16, little: bool) -> Vec<u8> {
        let word = |x: u16| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let long = |x: u32| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let start: &[u8] = if little { b"II" } else { b"MM" };
        [start, &word(42), &long(8), &word(1), &word(TAG), &word(3), &long(1), &word(orientation), &[0, 0], &long(0)]
            .concat()
    }

    fn jpeg(block: &[u8]) -> Vec<u8> {
        let length = (block.len() as u16 + 8).to_be_bytes();
        [&[0xFF, 0xD8, 0xFF, 0xE0, 0, 4, 1, 2, 0xFF, 0xE1], &length[..], b"Exif\0\0", block, &[0xFF, 0xDA, 0, 2]]
            .concat()
    }

    #[test]
    fn the_tag_is_found_in_both_byte_orders_and_both_formats() {
        for little in [true, false] {
            let block = block(6, little);
            assert_eq!(Orientation::of(&jpeg(&block)), Orientation(6));
            let chunk = [&(block.len() as u32).to_be_bytes()[..], b"eXIf", &block, &[0; 4]].concat();
            let png = [
                &[0x89, b'P', b'N', b'G', 13, 10, 26, 10, 0, 0, 0, 1, b'I', b'H', b'D', b'R', 0, 0, 0, 0, 0][..],
                &chunk,
            ]
            .concat();
            assert_eq!(Orientation::of(&png), Orientation(6));
            for end in 0..block.len() {
                assert!(Orientation::of(&jpeg(&block[..end])).0 <= 8, "a truncated block is no fault");
            }
        }
        assert_eq!(Orientation::of(&jpeg(&block(9, true))), Orientation::UPRIGHT);
    }

    /// The stored image 0 1 2 / 3 4 5; the upright ones by hand from the EXIF standard's row and column of the first
    /// stored pixel.
    #[test]
    fn every_orientation_is_put_upright() {
        let upright = |orientation: u8| Orientation(orientation).upright(vec![0, 1, 2, 3, 4, 5], 3);
        assert_eq!(upright(1), [0, 1, 2, 3, 4, 5]);
        assert_eq!(upright(2), [2, 1, 0, 5, 4, 3]);
        assert_eq!(upright(3), [5, 4, 3, 2, 1, 0]);
        assert_eq!(upright(4), [3, 4, 5, 0, 1, 2]);
        assert_eq!(upright(5), [0, 3, 1, 4, 2, 5]);
        assert_eq!(upright(6), [3, 0, 4, 1, 5, 2]);
        assert_eq!(upright(7), [5, 2, 4, 1, 3, 0]);
        assert_eq!(upright(8), [2, 5, 1, 4, 0, 3]);
        assert_eq!(Orientation(6).turned([3, 2]), [2, 3]);
    }
}
