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

/// Which of up to 64 words hold a bit: known without branches that no processor foresees.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn held(words: &[u64]) -> u64 {
    let mut held = 0;
    for (i, &word) in words.iter().enumerate() {
        held |= u64::from(word != 0) << i;
    }
    held
}

/// Calls `each` with every set bit from `from` on, ascending: quick where most words are empty.
#[inline]
pub(in crate::search) fn each_one(bits: &[u64], from: usize, mut each: impl FnMut(usize)) {
    each_held(bits, from, |begin, word| {
        let mut rest = word;
        while rest != 0 {
            each(begin + rest.trailing_zeros() as usize);
            rest &= rest - 1;
        }
    });
}

/// Calls `each` with every word that holds a bit from `from` on, and with the place of its first bit.
#[inline]
pub(in crate::search) fn each_held(bits: &[u64], from: usize, mut each: impl FnMut(usize, u64)) {
    let first = from / 64;
    for (block, words) in bits.get(first..).unwrap_or_default().chunks(64).enumerate() {
        let mut held = held(words);
        while held != 0 {
            let i = held.trailing_zeros() as usize;
            held &= held - 1;
            let mut rest = words[i];
            if block + i == 0 {
                rest &= !0 << (from % 64);
            }
            each((first + 64 * block + i) * 64, rest);
        }
    }
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

/// How many bits a ∧ b has from a bit on.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512bw+avx512dq+avx512vpopcntdq+popcnt",
    "x86_64+avx2+bmi1+bmi2+popcnt"
))]
pub(in crate::search) fn shared(a: &[u64], b: &[u64], from: usize) -> usize {
    let first = from / 64;
    let (Some(a), Some(b)) = (a.get(first..), b.get(first..)) else { return 0 };
    let (Some((head, a)), Some((other, b))) = (a.split_first(), b.split_first()) else { return 0 };
    let rest: u32 = a.iter().zip(b).map(|(a, b)| (a & b).count_ones()).sum();
    ((head & other & (!0 << (from % 64))).count_ones() + rest) as usize
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
        let mut many = vec![0; 130];
        [0, 5, 64, 4095, 4096, 8319].into_iter().for_each(|bit| many[bit / 64] |= 1u64 << (bit % 64));
        for from in [0, 1, 5, 6, 64, 4095, 4096, 4097, 8319, 8320, 9000] {
            let mut each = Vec::new();
            each_one(&many, from, |bit| each.push(bit));
            assert_eq!(each, ones(&many, from.min(8320)).collect::<Vec<_>>(), "from {from}");
        }
    }

    #[test]
    fn what_is_common_from_a_bit_on_is_counted() {
        let (a, b) = ([0b1110, !0], [0b0111, 0b11 << 62]);
        let mut out = [0; 2];
        assert_eq!(intersect(&a, &b, 2, &mut out), 3);
        assert_eq!(intersect(&a, &b, 64, &mut out), 2);
        assert_eq!(intersect(&a, &b, 128, &mut out), 0);
        assert_eq!(out[1], 0b11 << 62);
        assert_eq!([0, 2, 64, 127, 128].map(|from| shared(&a, &b, from)), [4, 3, 2, 1, 0]);
        assert!(is_set(&out, 127) && !is_set(&out, 0));
    }
}
