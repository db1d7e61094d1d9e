//! Sets as bit masks.

use std::cmp::Ordering;

use crate::lanes::ones_of;

/// The set bits from `from` on, ascending.
pub(in crate::search) fn ones(bits: &[u64], from: usize) -> impl Iterator<Item = usize> + '_ {
    let first = from / 64;
    bits[first.min(bits.len())..].iter().enumerate().flat_map(move |(step, &word)| {
        let after = if step == 0 { !0 << (from % 64) } else { !0 };
        ones_of(64 * (first + step), word & after)
    })
}

/// The mask of nonzero words among up to 64; without branches, which would be unpredictable.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn held(words: &[u64]) -> u64 {
    let mut held = 0;
    for (i, &word) in words.iter().enumerate() {
        held |= u64::from(word != 0) << i;
    }
    held
}

/// Calls `each` with first bit index and value of every nonzero word, from bit `from` on.
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

/// A nonzero word of a set.
#[derive(Clone, Copy)]
pub(in crate::search) struct Held {
    place: u32,
    pub(in crate::search) bits: u64,
}

impl Held {
    /// Lists the nonzero words from a bit on.
    pub(in crate::search) fn list(set: &[u64], from: usize, held: &mut Vec<Self>) {
        held.clear();
        each_held(set, from, |begin, bits| held.push(Self { place: (begin / 64) as u32, bits }));
    }

    /// Index of the word.
    #[inline]
    pub(in crate::search) fn place(&self) -> usize {
        self.place as usize
    }

    /// Index of its first bit.
    #[inline]
    pub(in crate::search) fn begin(&self) -> usize {
        64 * self.place()
    }

    /// Its set bits.
    #[inline]
    pub(in crate::search) fn ones(&self) -> impl Iterator<Item = usize> + use<> {
        ones_of(self.begin(), self.bits)
    }

    /// The intersection with another set from a bit on.
    #[inline]
    pub(in crate::search) fn and(&self, other: &[u64], from: usize) -> u64 {
        let after = match self.place().cmp(&(from / 64)) {
            Ordering::Less => 0,
            Ordering::Equal => !0 << (from % 64),
            Ordering::Greater => !0,
        };
        self.bits & other[self.place()] & after
    }
}

/// The groups of bits with a set bit, each as its last bit; `lasts` marks the last bit of every group.
///
/// An addition to all bits of a group but the last carries into the last if any is set, and never out of it.
#[inline]
pub(in crate::search) fn groups(word: u64, lasts: u64) -> u64 {
    ((word & !lasts).wrapping_add(!lasts) | word) & lasts
}

/// Whether a bit is set.
#[inline]
pub(in crate::search) fn is_set(bits: &[u64], bit: usize) -> bool {
    bits[bit / 64] >> (bit % 64) & 1 == 1
}

/// a ∧ b from a bit on, and the number of groups with one of these bits; earlier words of `out` are unchanged. `lasts`
/// has the last bit of every group and of every word.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512bw+avx512dq+avx512vpopcntdq+popcnt",
    "x86_64+avx2+bmi1+bmi2+popcnt"
))]
pub(in crate::search) fn intersect(a: &[u64], b: &[u64], lasts: &[u64], from: usize, out: &mut [u64]) -> usize {
    let first = from / 64;
    if first >= out.len() {
        return 0;
    }
    let mut count = 0;
    for (((out, a), b), &lasts) in out[first..].iter_mut().zip(&a[first..]).zip(&b[first..]).zip(&lasts[first..]) {
        *out = a & b;
        count += groups(*out, lasts).count_ones() as usize;
    }
    let of_first = |word: u64| groups(word, lasts[first]).count_ones() as usize;
    count - of_first(out[first]) + of_first(out[first] & (!0 << (from % 64)))
}

/// The number of bits of a ∧ b from a bit on.
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
            let mut held = Vec::new();
            Held::list(&many, from, &mut held);
            let each: Vec<usize> = held.iter().flat_map(Held::ones).collect();
            assert_eq!(each, ones(&many, from.min(8320)).collect::<Vec<_>>(), "from {from}");
        }
    }

    #[test]
    fn groups_are_found_that_hold_a_bit() {
        // Groups of 1, 2, 5, 32, 23 and 1 bits.
        let ends: [u32; 6] = [1, 3, 8, 40, 63, 64];
        let lasts = ends.iter().fold(0, |lasts, end| lasts | 1 << (end - 1));
        let last_of = |bit: u32| 1u64 << (ends.iter().find(|&&end| bit < end).expect("within") - 1);
        for bit in 0..64 {
            for other in 0..64 {
                let held = groups(1 << bit | 1 << other, lasts);
                assert_eq!(held, last_of(bit) | last_of(other), "bits {bit} and {other}");
            }
        }
        assert_eq!((groups(0, lasts), groups(!0, lasts), groups(!0, !0)), (0, lasts, !0));
    }

    #[test]
    fn what_is_common_from_a_bit_on_is_counted() {
        let (a, b) = ([0b1110, !0], [0b0111, 0b11 << 62]);
        let mut out = [0; 2];
        // Groups of one bit each; groups of three, one and sixty, and of two, one and sixty-one.
        let (single, lasts) = ([!0; 2], [1 << 63 | 0b1100, 1 << 63 | 0b110]);
        for (lasts, counts) in [(&single, [3, 2]), (&lasts, [2, 1])] {
            assert_eq!([2, 64].map(|from| intersect(&a, &b, lasts, from, &mut out)), counts);
            assert_eq!(intersect(&a, &b, lasts, 128, &mut out), 0);
        }
        assert_eq!(out[1], 0b11 << 62);
        assert_eq!([0, 2, 64, 127, 128].map(|from| shared(&a, &b, from)), [4, 3, 2, 1, 0]);
        assert!(is_set(&out, 127) && !is_set(&out, 0));
    }
}
