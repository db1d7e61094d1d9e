//! Netpbm images: PBM, PGM, PPM and PAM.

use std::path::Path;

use seafix_component::Fault;

use super::samples::{Samples, damaged};

/// The header of a Netpbm file.
#[derive(Debug)]
pub(super) struct Header {
    /// The width and height (px).
    pub(super) size: [u32; 2],
    channels: usize,
    /// The value of white (MAXVAL); 1 for a bitmap.
    white: u16,
    coding: Coding,
    /// The offset of the first sample.
    begin: usize,
}

/// The coding of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coding {
    /// Decimal numbers.
    Text,
    /// One byte, or two in big-endian order if MAXVAL is above 255.
    Binary,
    /// The digits 0 (white) and 1 (black), with or without space between them.
    TextBits,
    /// Bits, 1 for black; each row begins at a byte.
    PackedBits,
}

impl Header {
    /// Reads the header of a file.
    ///
    /// # Errors
    /// The cause, if the bytes are no such header.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let (channels, coding) = match bytes.get(..2) {
            Some(b"P1") => (1, Coding::TextBits),
            Some(b"P2") => (1, Coding::Text),
            Some(b"P3") => (3, Coding::Text),
            Some(b"P4") => (1, Coding::PackedBits),
            Some(b"P5") => (1, Coding::Binary),
            Some(b"P6") => (3, Coding::Binary),
            Some(b"P7") => return Self::read_pam(bytes),
            _ => return Err("an unknown format".to_owned()),
        };
        let bitmap = matches!(coding, Coding::TextBits | Coding::PackedBits);
        let mut numbers = [0, 0, 1];
        let mut begin = 2;
        for number in &mut numbers[..if bitmap { 2 } else { 3 }] {
            let (offset, value) = words(&bytes[begin..]).next().ok_or("the header is truncated")?;
            *number = value;
            begin += offset + bytes[begin + offset..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        }
        let [width, height, white] = numbers;
        // A single white space ends the header.
        Self::checked(Self { size: [width, height], channels, white: maxval(white)?, coding, begin: begin + 1 })
    }

    /// Reads the header of a PAM file, one key a line.
    fn read_pam(bytes: &[u8]) -> Result<Self, String> {
        const END: &[u8] = b"ENDHDR\n";
        let end = bytes.windows(END.len()).position(|window| window == END).ok_or("the header has no ENDHDR")?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|error| error.to_string())?;
        let value = |key: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
            line.and_then(|value| value.trim().parse::<u32>().ok()).ok_or(format!("the header has no {key}"))
        };
        let size = [value("WIDTH")?, value("HEIGHT")?];
        let channels = value("DEPTH")? as usize;
        if !(1..=4).contains(&channels) {
            return Err(format!("{channels} samples a pixel, 1 to 4 are supported"));
        }
        let (white, begin) = (maxval(value("MAXVAL")?)?, end + END.len());
        Self::checked(Self { size, channels, white, coding: Coding::Binary, begin })
    }

    fn checked(self) -> Result<Self, String> {
        let [width, height] = self.size;
        if width == 0 || height == 0 {
            return Err(format!("the image has {width} × {height} pixels"));
        }
        Ok(self)
    }

    /// The number of samples.
    pub(super) fn count(&self) -> usize {
        let [width, height] = self.size.map(|side| side as usize);
        width.saturating_mul(height).saturating_mul(self.channels)
    }

    /// Reads the samples of the file. Faults name `path`.
    ///
    /// # Errors
    /// The first sample above MAXVAL, or missing samples.
    pub(super) fn samples(&self, bytes: &[u8], path: &Path) -> Result<Samples, Fault> {
        let (body, count) = (bytes.get(self.begin..).unwrap_or_default(), self.count());
        let width = self.size[0] as usize;
        let deep = self.coding == Coding::Binary && self.white > 255;
        let bit = |black: bool| u16::from(!black);
        let values: Vec<u16> = match self.coding {
            Coding::Text => {
                words(body).take(count).map(|(_, value)| u16::try_from(value).unwrap_or(u16::MAX)).collect()
            }
            Coding::Binary if deep => {
                body.chunks_exact(2).take(count).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
            }
            Coding::Binary => body.iter().take(count).map(|&byte| byte.into()).collect(),
            Coding::TextBits => body
                .iter()
                .filter(|byte| matches!(byte, b'0' | b'1'))
                .take(count)
                .map(|byte| bit(*byte == b'1'))
                .collect(),
            Coding::PackedBits => {
                let rows = body.chunks_exact(width.div_ceil(8)).take(self.size[1] as usize);
                rows.flat_map(|row| (0..width).map(|x| bit(row[x / 8] >> (7 - x % 8) & 1 == 1))).collect()
            }
        };
        if let Some(index) = values.iter().position(|value| *value > self.white) {
            let pixel = index / self.channels;
            let line = (self.coding == Coding::Text).then(|| line_of(bytes, self.begin, index)).flatten();
            let (x, y) = (pixel % width, pixel / width);
            return Err(Fault::new("a sample above MAXVAL", path)
                .on_line(line)
                .value(format!("{} at ({x}, {y}), MAXVAL is {}", values[index], self.white))
                .remedy("write the image again or correct MAXVAL in its header"));
        }
        if values.len() < count {
            return Err(damaged(path, format!("the file is truncated, {} of {count} samples are there", values.len())));
        }
        Ok(Samples { values, channels: self.channels, deep, white: Some(self.white) })
    }
}

fn maxval(value: u32) -> Result<u16, String> {
    u16::try_from(value).ok().filter(|white| *white > 0).ok_or(format!("MAXVAL is {value}, it must be 1 to 65535"))
}

/// The line number of a sample in a text file.
fn line_of(bytes: &[u8], begin: usize, sample: usize) -> Option<usize> {
    let (offset, _) = words(bytes.get(begin..)?).nth(sample)?;
    Some(1 + bytes[..begin + offset].iter().filter(|&&byte| byte == b'\n').count())
}

/// The decimal numbers of a text with their offsets, up to the first other word. A comment runs from # to the end of
/// its line.
fn words(bytes: &[u8]) -> impl Iterator<Item = (usize, u32)> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            match bytes.get(at)? {
                byte if byte.is_ascii_whitespace() => at += 1,
                b'#' => at += bytes[at..].iter().position(|&byte| byte == b'\n')?,
                _ => break,
            }
        }
        let begin = at;
        let mut value = 0_u32;
        while let Some(digit) = bytes.get(at).filter(|byte| byte.is_ascii_digit()) {
            value = value.saturating_mul(10).saturating_add(u32::from(digit - b'0'));
            at += 1;
        }
        (at > begin).then_some((begin, value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Samples, String> {
        Header::read(bytes)?.samples(bytes, Path::new("a.pnm")).map_err(|fault| fault.to_string())
    }

    #[test]
    fn samples_are_read_in_every_coding() {
        let files: [(&[u8], u16, &[u16]); 10] = [
            (b"P2\n# a comment 999\n3 2\n200\n1 2 3\n4 5 200\n", 200, &[1, 2, 3, 4, 5, 200]),
            (b"P5 3 2 200\n\x01\x02\x03\x04\x05\xC8", 200, &[1, 2, 3, 4, 5, 200]),
            (b"P5 3 2 4095\n\x0F\xFF\0\x01\0\x01\0\x01\0\x01\0\x02", 4095, &[4095, 1, 1, 1, 1, 2]),
            (b"P6 2 1 200\n\x01\x02\x03\x04\x05\xC8", 200, &[1, 2, 3, 4, 5, 200]),
            (b"P3 1 2 9 1 2 3 4 5 9", 9, &[1, 2, 3, 4, 5, 9]),
            (
                b"P7\nWIDTH 3\nHEIGHT 1\nDEPTH 1\nMAXVAL 200\nTUPLTYPE GRAYSCALE\nENDHDR\n\x01\x02\xC8",
                200,
                &[1, 2, 200],
            ),
            (b"P7\nWIDTH 2\nHEIGHT 1\nDEPTH 1\nMAXVAL 1\nTUPLTYPE BLACKANDWHITE\nENDHDR\n\x01\0", 1, &[1, 0]),
            (b"P2 3 2 200 200 0 0 0 0 0 999", 200, &[200, 0, 0, 0, 0, 0]),
            (b"P1 3 2 101 0 1 0", 1, &[0, 1, 0, 1, 0, 1]),
            (b"P4 9 2\n\x80\x80\x7F\x00", 1, &[0, 1, 1, 1, 1, 1, 1, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1]),
        ];
        for (bytes, white, values) in files {
            let found = read(bytes).unwrap();
            let name = String::from_utf8_lossy(bytes);
            assert_eq!((found.white, &found.values[..], found.deep), (Some(white), values, white > 255), "{name}");
        }
    }

    #[test]
    fn the_first_sample_above_maxval_is_named() {
        let wrong: [(&[u8], &str); 4] = [
            (b"P2\n# a comment\n3 2\n200\n1 2 3\n4 5 201\n", "a.pnm:6: 201 at (2, 1), MAXVAL is 200; "),
            (b"P5 3 2 200\n\xC9\x02\x03\x04\x05\xC8", ": 201 at (0, 0), MAXVAL is 200; "),
            (b"P5 3 2 4095\n\x0F\xFF\0\x01\0\x01\x10\0\0\x01\0\x01", ": 4096 at (0, 1), MAXVAL is 4095; "),
            (b"P6 3 2 200\n\x01\x02\x03\x04\x05\xFF\x01\x02\x03\x04\x05\xC8\x01\x02\x03\x04\x05\xC8", "255 at (1, 0)"),
        ];
        for (bytes, part) in wrong {
            let message = read(bytes).unwrap_err();
            assert!(message.starts_with("a sample above MAXVAL") && message.contains(part), "{message}");
        }
    }

    #[test]
    fn a_file_that_ends_early_is_rejected() {
        let others: [&[u8]; 8] = [
            b"P1 3 2 1 0 1 0 1",
            b"P4 3 2\n\xA0",
            b"\x89PNG",
            b"P5 3",
            b"P2 3 2 70000 1",
            b"P5 3 2 9",
            b"P6 1 1 255\n\0\0",
            b"P7\nWIDTH 3\nHEIGHT 1\nMAXVAL 200\nENDHDR\n\x01\x02\xC8",
        ];
        assert!(others.iter().all(|bytes| read(bytes).is_err()));
    }
}
