//! Bit masks of 64 answers.

/// Number of bits of a word.
pub(crate) const LANES: usize = 64;

/// The bytes, each 0 or 1, as bits.
#[inline(always)]
pub(crate) fn packed(bytes: &[u8; LANES]) -> u64 {
    // The multiplication moves byte i of eight to bit 56 + i; no other product reaches these bits.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut word = 0;
    for (eight, bytes) in bytes.as_chunks::<8>().0.iter().enumerate() {
        word |= (u64::from_le_bytes(*bytes).wrapping_mul(GATHER) >> 56) << (8 * eight);
    }
    word
}

/// The indices of the set bits, ascending; the first bit has the index `begin`.
#[inline]
pub(crate) fn ones_of(begin: usize, word: u64) -> impl Iterator<Item = usize> {
    let mut rest = word;
    std::iter::from_fn(move || {
        (rest != 0).then(|| {
            let bit = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            begin + bit
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_bits_in_their_order() {
        for k in 0..LANES {
            let mut bytes = [0; LANES];
            bytes[k] = 1;
            assert_eq!(packed(&bytes), 1 << k);
        }
        assert_eq!(packed(&[1; LANES]), u64::MAX);
    }

    #[test]
    fn bits_are_numbered_from_the_first() {
        assert_eq!(ones_of(64, 0b1000_0101).collect::<Vec<_>>(), [64, 66, 71]);
        assert_eq!(ones_of(0, 1 << 63).collect::<Vec<_>>(), [63]);
        assert_eq!(ones_of(7, 0).next(), None);
    }
}
