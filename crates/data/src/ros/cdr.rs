//! A reader of CDR messages, value by value.

/// A reader of values that checks every length against the rest of the message.
#[derive(Debug)]
pub(super) struct Cdr<'a> {
    /// The message after its header.
    bytes: &'a [u8],
    at: usize,
}

/// The fault, with its byte in the message.
pub(super) type Read<T> = Result<T, String>;

/// The size of the header (bytes).
const HEADER: usize = 4;

impl<'a> Cdr<'a> {
    /// A reader of a message, positioned after its header.
    pub(super) fn new(message: &'a [u8]) -> Read<Self> {
        let Some((header, bytes)) = message.split_at_checked(HEADER) else {
            return Err(format!("{} bytes, less than a header, at byte 0", message.len()));
        };
        let kind = match [header[0], header[1]] {
            [0, 1] => return Ok(Self { bytes, at: 0 }),
            [0, 0] => "big-endian CDR",
            [0, 2 | 3] => "a parameter list (PL_CDR)",
            [0, 6..=11] => "XCDR2",
            _ => "unknown",
        };
        Err(format!(
            "the header {:02x}{:02x} at byte 0 is {kind}; only little-endian CDR is supported",
            header[0], header[1]
        ))
    }

    /// The next `count` bytes.
    fn take(&mut self, count: usize) -> Read<&'a [u8]> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest
            .get(..count)
            .ok_or_else(|| format!("{count} bytes at byte {}, where {} are left", self.at + HEADER, rest.len()))?;
        self.at += count;
        Ok(taken)
    }

    /// The next number, aligned to a multiple of its size.
    fn number<const N: usize>(&mut self) -> Read<[u8; N]> {
        self.at = self.at.next_multiple_of(N);
        self.take(N).map(|bytes| bytes.try_into().expect("take returns N bytes"))
    }

    pub(super) fn u8(&mut self) -> Read<u8> {
        self.number::<1>().map(|[byte]| byte)
    }

    pub(super) fn u32(&mut self) -> Read<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Read<i32> {
        self.number().map(i32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Read<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Read<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(numbers)
    }

    /// The length of a sequence whose elements have at least `min` bytes each.
    pub(super) fn length(&mut self, min: usize) -> Read<usize> {
        let length = self.u32()? as usize;
        let left = self.bytes.len().saturating_sub(self.at);
        match length.checked_mul(min) {
            Some(needed) if needed <= left => Ok(length),
            _ => Err(format!("a length of {length} at byte {}, where {left} bytes are left", self.at - 4 + HEADER)),
        }
    }

    pub(super) fn bytes(&mut self) -> Read<&'a [u8]> {
        let length = self.length(1)?;
        self.take(length)
    }

    /// A string, with its final zero.
    pub(super) fn string(&mut self) -> Read<String> {
        let at = self.at.next_multiple_of(4) + HEADER;
        let bytes = self.bytes()?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        String::from_utf8(text.to_vec()).map_err(|_| format!("text at byte {at} that is not UTF-8"))
    }

    /// Checks the end of the message: only padding may follow.
    pub(super) fn end(self) -> Read<()> {
        match self.bytes.get(self.at..).unwrap_or_default() {
            left if left.len() < 4 && left.iter().all(|&byte| byte == 0) => Ok(()),
            left => Err(format!("{} bytes too many at byte {}", left.len(), self.at + HEADER)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_on_multiples_of_their_size() {
        let message =
            [&[0, 1, 0, 0, 7, 0, 0, 0, 5, 0, 0, 0][..], &1.5f64.to_le_bytes(), &[3, 0, 0, 0], b"ab\0"].concat();
        let mut cdr = Cdr::new(&message).unwrap();
        assert_eq!((cdr.u8(), cdr.u32(), cdr.f64(), cdr.string()), (Ok(7), Ok(5), Ok(1.5), Ok("ab".to_owned())));
        assert_eq!(cdr.end(), Ok(()));
    }

    #[test]
    fn what_is_not_there_is_named_with_its_byte() {
        assert!(Cdr::new(&[0, 0, 0, 0]).unwrap_err().contains("big-endian"));
        assert!(Cdr::new(&[0, 7, 0, 0]).unwrap_err().contains("XCDR2"));
        assert!(Cdr::new(&[0]).unwrap_err().contains("less than a header"));
        let mut cdr = Cdr::new(&[0, 1, 0, 0, 255, 255, 255, 255]).unwrap();
        assert_eq!(cdr.string().unwrap_err(), "a length of 4294967295 at byte 4, where 0 bytes are left");
        let mut cdr = Cdr::new(&[0, 1, 0, 0, 1]).unwrap();
        assert_eq!(cdr.u32().unwrap_err(), "4 bytes at byte 4, where 1 are left");
        assert!(Cdr::new(&[0, 1, 0, 0, 0, 0, 0, 0]).unwrap().end().unwrap_err().contains("4 bytes too many at byte 4"));
    }
}
