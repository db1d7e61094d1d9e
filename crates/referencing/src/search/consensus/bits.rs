//! Sets as bits of words.

/// Whether any of the bits `from..to` is set.
pub(in crate::search) fn any(bits: &[u64], from: usize, to: usize) -> bool {
    let (first, last) = (from / 64, (to - 1) / 64);
    let low = !0 << (from % 64);
    let high = !0 >> (63 - (to - 1) % 64);
    if first == last {
        return bits[first] & low & high != 0;
    }
    bits[first] & low != 0 || bits[last] & high != 0 || bits[first + 1..last].iter().any(|&word| word != 0)
}

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

/// a ∧ b from a bit on, and how many bits that are; what comes before is left as it is.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512bw+avx512dq+popcnt",
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
        assert!(any(&bits, 63, 64) && !any(&bits, 64, 128) && any(&bits, 0, 192) && !any(&bits, 0, 63));
        assert!(any(&bits, 100, 129) && !any(&bits, 129, 130) && !any(&bits, 131, 192));
    }

    #[test]
    fn what_is_common_from_a_bit_on_is_counted() {
        let (a, b) = ([0b1110, !0], [0b0111, 0b11 << 62]);
        let mut out = [0; 2];
        assert_eq!(intersect(&a, &b, 2, &mut out), 3);
        assert_eq!(intersect(&a, &b, 64, &mut out), 2);
        assert_eq!(intersect(&a, &b, 128, &mut out), 0);
        assert_eq!(out[1], 0b11 << 62);
    }
}
