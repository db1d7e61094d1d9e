//! Images of Netpbm say themselves what white is, and hold nothing brighter.

use std::path::Path;

use seafix_component::Fault;

/// The greatest value, MAXVAL, of a PGM, PPM or PAM image of this size; `None` of bitmaps and of other files.
///
/// The decoder takes samples as they come: one above MAXVAL is a damaged file, or one with a wrong header.
///
/// # Errors
/// The first sample above MAXVAL, with its place.
pub(super) fn white(bytes: &[u8], [width, height]: [u32; 2]) -> Result<Option<u16>, Fault> {
    let Some(header) = Header::read(bytes) else { return Ok(None) };
    let Header { white, channels, text, begin } = header;
    let count = width as usize * height as usize * channels;
    let body = &bytes[begin..];
    let beyond = match (text, white > 255) {
        (true, _) => words(body).take(count).enumerate().find(|(_, (_, sample))| *sample > u32::from(white)),
        (false, false) => {
            let found = body.iter().take(count).position(|&sample| u16::from(sample) > white);
            found.map(|at| (at, (at, body[at].into())))
        }
        (false, true) => {
            let mut samples = body.chunks_exact(2).take(count).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
            let found = samples.clone().position(|sample| sample > white);
            found.and_then(|at| Some((at, (at, samples.nth(at)?.into()))))
        }
    };
    let Some((index, (offset, sample))) = beyond else { return Ok(Some(white)) };
    let pixel = index / channels;
    let (x, y) = (pixel % width as usize, pixel / width as usize);
    let line = text.then(|| 1 + bytes[..begin + offset].iter().filter(|&&byte| byte == b'\n').count());
    Err(Fault::new("a sample above MAXVAL", Path::new(""))
        .on_line(line)
        .value(format!("{sample} at ({x}, {y}), MAXVAL is {white}"))
        .remedy("write the image again, or give its header the MAXVAL that its samples have"))
}

/// What stands before the samples.
struct Header {
    white: u16,
    channels: usize,
    /// Samples as decimal numbers.
    text: bool,
    /// Where they begin.
    begin: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Option<Self> {
        let (channels, text) = match bytes.get(..2)? {
            b"P2" => (1, true),
            b"P3" => (3, true),
            b"P5" => (1, false),
            b"P6" => (3, false),
            b"P7" => return Self::arbitrary(bytes),
            _ => return None,
        };
        let mut numbers = [0; 3];
        let mut at = 2;
        for number in &mut numbers {
            let (offset, value) = words(&bytes[at..]).next()?;
            *number = value;
            let digits = bytes[at + offset..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            at += offset + digits;
        }
        // One space ends the header.
        let white = u16::try_from(numbers[2]).ok().filter(|white| *white > 0)?;
        Some(Self { white, channels, text, begin: (at + 1).min(bytes.len()) })
    }

    /// PAM: a line a key.
    fn arbitrary(bytes: &[u8]) -> Option<Self> {
        const END: &[u8] = b"ENDHDR\n";
        let end = bytes.windows(END.len()).position(|window| window == END)?;
        let header = std::str::from_utf8(&bytes[..end]).ok()?;
        let value = |key: &str| {
            header.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(' ')?.trim().parse::<u16>().ok())
        };
        // Of bitmaps the decoder makes black and white.
        let white = value("MAXVAL").filter(|white| *white > 1)?;
        Some(Self { white, channels: value("DEPTH")?.into(), text: false, begin: end + END.len() })
    }
}

/// The decimal numbers of a text with their places; comments run from # to the end of the line. What is no number ends
/// them: the decoder says so.
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

    fn said(bytes: &[u8]) -> Result<Option<u16>, String> {
        white(bytes, [3, 2]).map_err(|fault| fault.to_string())
    }

    #[test]
    fn the_first_sample_above_maxval_is_named() {
        let right: [&[u8]; 6] = [
            b"P2\n# a comment 999\n3 2\n200\n1 2 3\n4 5 200\n",
            b"P5 3 2 200\n\x01\x02\x03\x04\x05\xC8",
            b"P5 3 2 4095\n\x0F\xFF\0\x01\0\x01\0\x01\0\x01\0\x01",
            b"P6 3 2 200\n\x01\x02\x03\x04\x05\xC8\x01\x02\x03\x04\x05\xC8\x01\x02\x03\x04\x05\xC8",
            b"P7\nWIDTH 3\nHEIGHT 2\nDEPTH 1\nMAXVAL 200\nTUPLTYPE GRAYSCALE\nENDHDR\n\x01\x02\x03\x04\x05\xC8",
            b"P2 3 2 200 200 0 0 0 0 0 999",
        ];
        for (bytes, white) in right.into_iter().zip([200, 200, 4095, 200, 200, 200]) {
            assert_eq!(said(bytes), Ok(Some(white)), "{}", String::from_utf8_lossy(bytes));
        }
        let wrong: [(&[u8], &str); 4] = [
            (b"P2\n# a comment\n3 2\n200\n1 2 3\n4 5 201\n", ":6: 201 at (2, 1), MAXVAL is 200; "),
            (b"P5 3 2 200\n\xC9\x02\x03\x04\x05\xC8", ": 201 at (0, 0), MAXVAL is 200; "),
            (b"P5 3 2 4095\n\x0F\xFF\0\x01\0\x01\x10\0\0\x01\0\x01", ": 4096 at (0, 1), MAXVAL is 4095; "),
            (b"P6 3 2 200\n\x01\x02\x03\x04\x05\xFF\x01\x02\x03\x04\x05\xC8\x01\x02\x03\x04\x05\xC8", "255 at (1, 0)"),
        ];
        for (bytes, part) in wrong {
            let said = said(bytes).unwrap_err();
            assert!(said.starts_with("a sample above MAXVAL in ") && said.contains(part), "{said}");
        }
        // Bitmaps, other formats, and headers that end.
        let others: [&[u8]; 5] = [b"P1 3 2 1 0 1 0 1 0", b"P4 3 2\n\xA0\xA0", b"\x89PNG", b"P5 3", b"P2 3 2 70000 1"];
        assert!(others.iter().all(|bytes| said(bytes) == Ok(None)));
    }
}
