//! Vectorised normal numbers with the bits of [`Stream::normal`](crate::Stream::normal).
//!
//! The elementary functions repeat the steps of `libm`'s `log` and `sincos` for the arguments that occur. The few
//! arguments for which `libm` branches are passed to `libm` itself.

/// Number of pairs computed in one pass.
pub(crate) const PAIRS: usize = 32;

/// One number for each pair.
type Lane<T> = [T; PAIRS];

/// Two independent normal numbers from two uniform numbers in [0, 1) (Box and Muller, 1958).
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(crate) fn normals(first: &Lane<f64>, second: &Lane<f64>) -> [Lane<f64>; 2] {
    let (mut radius, mut angle) = ([0.0; PAIRS], [0.0; PAIRS]);
    log(&first.map(|unit| 1.0 - unit), &mut radius);
    for i in 0..PAIRS {
        radius[i] = (-2.0 * radius[i]).sqrt();
        angle[i] = std::f64::consts::TAU * second[i];
    }
    let (mut sine, mut cosine) = ([0.0; PAIRS], [0.0; PAIRS]);
    sincos(&angle, &mut sine, &mut cosine);
    for i in 0..PAIRS {
        (sine[i], cosine[i]) = (radius[i] * sine[i], radius[i] * cosine[i]);
    }
    [cosine, sine]
}

/// The natural logarithm of positive, normal numbers (FreeBSD's `e_log.c`).
#[inline(always)]
fn log(x: &Lane<f64>, out: &mut Lane<f64>) {
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
    const LG: [f64; 7] = [
        6.666_666_666_666_735e-1,
        3.999_999_999_940_942e-1,
        2.857_142_874_366_239e-1,
        2.222_219_843_214_978_4e-1,
        1.818_357_216_161_805e-1,
        1.531_383_769_920_937_3e-1,
        1.479_819_860_511_658_6e-1,
    ];
    // x = m·2ᵏ with m in [√½, √2).
    const ROOT_HALF: u32 = 0x3FE6_A09E;
    let (mut m, mut k) = ([0.0; PAIRS], [0_i32; PAIRS]);
    for i in 0..PAIRS {
        let bits = x[i].to_bits();
        let high = (bits >> 32) as u32 + (0x3FF0_0000 - ROOT_HALF);
        k[i] = (high >> 20) as i32 - 0x3FF;
        m[i] = f64::from_bits(u64::from((high & 0x000F_FFFF) + ROOT_HALF) << 32 | bits & 0xFFFF_FFFF);
    }
    for i in 0..PAIRS {
        let f = m[i] - 1.0;
        let half = 0.5 * f * f;
        let s = f / (2.0 + f);
        let z = s * s;
        let w = z * z;
        let t1 = w * (LG[1] + w * (LG[3] + w * LG[5]));
        let t2 = z * (LG[0] + w * (LG[2] + w * (LG[4] + w * LG[6])));
        let (r, k) = (t2 + t1, f64::from(k[i]));
        out[i] = s * (half + r) + k * LN2_LO - half + f + k * LN2_HI;
    }
}

/// Sine and cosine of angles from 0 to 2π (FreeBSD's `s_sin.c`, `e_rem_pio2.c`, `k_sin.c` and `k_cos.c`).
#[inline(always)]
fn sincos(x: &Lane<f64>, sine: &mut Lane<f64>, cosine: &mut Lane<f64>) {
    const PIO2_1: f64 = 1.570_796_326_734_125_6;
    const PIO2_1T: f64 = 6.077_100_506_506_192e-11;
    const S: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    const C: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    // Number of quarter turns to subtract.
    let (mut quarters, mut rare) = ([0_i32; PAIRS], false);
    for i in 0..PAIRS {
        let high = (x[i].to_bits() >> 32) as u32;
        let above = |bound: u32| i32::from(high > bound);
        quarters[i] = above(0x3FE9_21FB) + above(0x4002_D97C) + above(0x400F_6A7A) + above(0x4015_FDBC);
        rare |= near_quarter(high);
    }
    for i in 0..PAIRS {
        let n = f64::from(quarters[i]);
        let z = x[i] - n * PIO2_1;
        let y0 = z - n * PIO2_1T;
        let y1 = (z - y0) - n * PIO2_1T;
        let z = y0 * y0;
        let (w, v) = (z * z, z * y0);
        let r = S[1] + z * (S[2] + z * S[3]) + z * w * (S[4] + z * S[5]);
        let full = y0 + v * (S[0] + z * r);
        let reduced = y0 - ((z * (0.5 * y1 - v * r) - y1) - v * S[0]);
        let s = if quarters[i] == 0 { full } else { reduced };
        let r = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
        let half = 0.5 * z;
        let w = 1.0 - half;
        let c = w + (((1.0 - w) - half) + (z * r - y0 * y1));
        let odd = quarters[i] & 1 == 1;
        let (across, along) = if odd { (c, s) } else { (s, c) };
        // The sine changes its sign in the third and fourth quarter, the cosine in the second and third.
        sine[i] = if quarters[i] & 2 == 2 { -across } else { across };
        cosine[i] = if (quarters[i] + 1) & 2 == 2 { -along } else { along };
    }
    if rare {
        for i in 0..PAIRS {
            if near_quarter((x[i].to_bits() >> 32) as u32) {
                (sine[i], cosine[i]) = libm::sincos(x[i]);
            }
        }
    }
}

/// Whether an angle, given by its upper bits, is so near to a multiple of π/2 that `libm` reduces it with more digits.
#[inline(always)]
fn near_quarter(high: u32) -> bool {
    (high & 0xF_FFFF == 0x9_21FB) | (high == 0x4012_D97C)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_those_of_libm_bit_by_bit() {
        let near = |x: f64| (-40..40_i64).map(move |k| f64::from_bits((x.to_bits() as i64 + k) as u64));
        let quarters = (1..=8).map(|n| f64::from(n) * std::f64::consts::FRAC_PI_4);
        let edges = [0x3FE9_21FB_u64, 0x4002_D97C, 0x400F_6A7A, 0x4015_FDBC, 0x4012_D97C, 0x4019_21FB]
            .into_iter()
            .flat_map(|high| [high << 32, high << 32 | 0xFFFF_FFFF, high << 32 | 0x5442_D18F].map(f64::from_bits));
        let many = (0..200_000).map(|k| f64::from(k) * (std::f64::consts::TAU / 200_000.0));
        let tiny = (0..60).map(|k| 6.0 * 0.5_f64.powi(k));
        let angles: Vec<f64> = quarters.chain(edges).flat_map(near).chain(many).chain(tiny).collect();
        for angles in angles.chunks_exact(PAIRS) {
            let (mut sine, mut cosine) = ([0.0; PAIRS], [0.0; PAIRS]);
            let angles: &Lane<f64> = angles.try_into().unwrap();
            sincos(angles, &mut sine, &mut cosine);
            for i in 0..PAIRS {
                let (s, c) = libm::sincos(angles[i]);
                assert_eq!((sine[i].to_bits(), cosine[i].to_bits()), (s.to_bits(), c.to_bits()), "{}", angles[i]);
            }
        }
        let some = (1..200_000).map(|k| f64::from(k) / 200_000.0);
        let small = (0..53).map(|k| 0.5_f64.powi(k));
        let numbers: Vec<f64> = some.chain(small).chain(near(1.0).filter(|x| *x <= 1.0)).collect();
        for numbers in numbers.chunks_exact(PAIRS) {
            let mut found = [0.0; PAIRS];
            let numbers: &Lane<f64> = numbers.try_into().unwrap();
            log(numbers, &mut found);
            for i in 0..PAIRS {
                assert_eq!(found[i].to_bits(), libm::log(numbers[i]).to_bits(), "{}", numbers[i]);
            }
        }
    }
}
