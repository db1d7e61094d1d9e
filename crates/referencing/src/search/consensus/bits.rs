//! Sets as bits of words.

/// The set bits from `from` on, ascending.
pub(in crate::search) fn ones(bits: &[u64], from: usize) -> impl Iterator<Item = usize> + '_ {
    let first = from / 64;
    bits[first.min(bits.len())..].iter().enumerate().flat_map(move |(step, &word)| {
        let mut rest = if step == 0 { word & (!0 << (from % 64)) } else { word };
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                (first + step) * 64 + bit
            })
        })
    })
}

/// Whether a bit is set.
#[inline]
pub(in crate::search) fn is_set(bits: &[u64], bit: usize) -> bool {
    bits[bit / 64] >> (bit % 64) & 1 == 1
}

/// a ∧ b from a bit on, and how many bits that are; what comes before is left as it is.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512bw+avx512dq+avx512vpopcntdq+popcnt",
    "x86_64+avx2+bmi1+bmi2+popcnt"
))]
pub(in crate::search) fn intersect(a: &[u64], b: &[u64], from: usize, out: &mut [u64]) -> usize {
    let first = from / 64;
    if first >= out.len() {
        return 0;
    }
    let mut count = 0;
    for ((out, a), b) in out[first..].iter_mut().zip(&a[first..]).zip(&b[first..]) {
        *out = a & b;
        count += out.count_ones() as usize;
    }
    count - (out[first] & !(!0 << (from % 64))).count_ones() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_found_where_they_are() {
        let bits = [1 << 63, 0, 0b101];
        assert_eq!(ones(&bits, 0).collect::<Vec<_>>(), [63, 128, 130]);
        assert_eq!(ones(&bits, 129).collect::<Vec<_>>(), [130]);
        assert_eq!(ones(&bits, 192).count(), 0);
    }

    #[test]
    fn what_is_common_from_a_bit_on_is_counted() {
        let (a, b) = ([0b1110, !0], [0b0111, 0b11 << 62]);
        let mut out = [0; 2];
        assert_eq!(intersect(&a, &b, 2, &mut out), 3);
        assert_eq!(intersect(&a, &b, 64, &mut out), 2);
        assert_eq!(intersect(&a, &b, 128, &mut out), 0);
        assert_eq!(out[1], 0b11 << 62);
        assert!(is_set(&out, 127) && !is_set(&out, 0));
    }
}
