//! Elementary functions in plain f32 arithmetic: the same bits on every machine, in loops that vectorise.

/// 2ˣ for |x| ≤ 126, with a relative error below 2e-7; exactly 1 at 0.
#[inline(always)]
pub(super) fn exp2(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5·2²³: adding and subtracting it rounds to an integer
    let x = x.clamp(-126.0, 126.0);
    let full = (x + MAGIC) - MAGIC;
    let f = x - full;
    // Taylor series of exp(f ln 2) on |f| ≤ 1/2.
    let y = f * std::f32::consts::LN_2;
    let p = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0))))));
    p * f32::from_bits(((full as i32 + 127) as u32) << 23)
}

/// eˣ for |x| ≤ 87; exactly 1 at 0.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    exp2(x * std::f32::consts::LOG2_E)
}

/// log₂ x for positive, normal x, with an absolute error below 1e-6.
#[inline(always)]
pub(super) fn log2(x: f32) -> f32 {
    // x = m·2ᵉ with m in [√½, √2).
    let bits = x.to_bits();
    let shifted = bits.wrapping_sub(0x3F35_04F3);
    let e = (shifted as i32) >> 23;
    let m = f32::from_bits((shifted & 0x007F_FFFF).wrapping_add(0x3F35_04F3));
    // ln m = 2 artanh t.
    let t = (m - 1.0) / (m + 1.0);
    let t2 = t * t;
    let ln = 2.0 * t * (1.0 + t2 * (1.0 / 3.0 + t2 * (0.2 + t2 * (1.0 / 7.0 + t2 * (1.0 / 9.0)))));
    e as f32 + ln * std::f32::consts::LOG2_E
}

/// A hash of three numbers to 32 bits.
#[inline(always)]
pub(super) fn mix(a: u32, b: u32, seed: u32) -> u32 {
    let mut h = seed ^ a.wrapping_mul(0x9E37_79B1) ^ b.wrapping_mul(0x85EB_CA77).rotate_left(15);
    h = (h ^ (h >> 16)).wrapping_mul(0x7FEB_352D);
    h = (h ^ (h >> 15)).wrapping_mul(0x846C_A68B);
    h ^ (h >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_have_their_literature_values() {
        assert_eq!((exp(0.0), exp2(0.0), exp2(3.0)), (1.0, 1.0, 8.0));
        for k in -2000..2000 {
            let x = k as f32 * 0.043;
            let exact = libm::exp2(f64::from(x));
            assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 3e-7, "2^{x}");
            let positive = exp2(x * 0.3);
            assert!((f64::from(log2(positive)) - libm::log2(f64::from(positive))).abs() < 2e-6, "log2 {positive}");
        }
    }
}
