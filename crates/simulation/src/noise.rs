//! Closed-form noise: a pure function of place and seed.

/// Sixteen unit vectors.
pub(crate) const DIRECTIONS: [[f32; 2]; 16] = {
    const A: f32 = 0.923_879_5;
    const B: f32 = 0.382_683_43;
    const C: f32 = std::f32::consts::FRAC_1_SQRT_2;
    [
        [1.0, 0.0],
        [A, B],
        [C, C],
        [B, A],
        [0.0, 1.0],
        [-B, A],
        [-C, C],
        [-A, B],
        [-1.0, 0.0],
        [-A, -B],
        [-C, -C],
        [-B, -A],
        [0.0, -1.0],
        [B, -A],
        [C, -C],
        [A, -B],
    ]
};

/// A hash of 32 bits for a cell of the plane.
#[inline(always)]
pub(crate) fn hash(x: i32, y: i32, seed: u32) -> u32 {
    let mut h = seed ^ (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77).rotate_left(15);
    h = (h ^ (h >> 16)).wrapping_mul(0x7FEB_352D);
    h = (h ^ (h >> 15)).wrapping_mul(0x846C_A68B);
    h ^ (h >> 16)
}

/// Gradient noise with features of size 1, within about ±1, standard deviation about 0.35.
///
/// Source: Perlin, *Improving noise*, 2002.
pub(crate) fn gradient(x: f64, y: f64, seed: u32) -> f32 {
    let ((ix, fx), (iy, fy)) = (split(x), split(y));
    let column = |dx: u32| (ix as u32).wrapping_add(dx).wrapping_mul(0x9E37_79B1) ^ seed;
    let row = |dy: u32| (iy as u32).wrapping_add(dy).wrapping_mul(0x85EB_CA77).rotate_left(15);
    let (columns, rows) = ([column(0), column(1)], [row(0), row(1)]);
    let corner = |dx: usize, dy: usize| {
        // One round of mixing is enough for four bits.
        let h = columns[dx] ^ rows[dy];
        let [gx, gy] = DIRECTIONS[((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 28) as usize];
        gx * (fx - dx as f32) + gy * (fy - dy as f32)
    };
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (sx, sy) = (fade(fx), fade(fy));
    let above = corner(0, 0) + sx * (corner(1, 0) - corner(0, 0));
    let below = corner(0, 1) + sx * (corner(1, 1) - corner(0, 1));
    1.5 * (above + sy * (below - above))
}

/// The integer part (floor) and the fraction of `x`; a cast is faster than the platform's `floor`.
pub(crate) fn split(x: f64) -> (i32, f32) {
    let cut = x as i32;
    let below = cut - i32::from(f64::from(cut) > x);
    (below, (x - f64::from(below)) as f32)
}

/// Visible fraction of a pattern of this wavelength at a pixel of this footprint: 1 from four pixels on, 0 below two.
#[inline(always)]
pub(crate) fn shown(wavelength: f64, footprint: f64) -> f32 {
    let t = ((wavelength / footprint - 2.0) * 0.5).clamp(0.0, 1.0) as f32;
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_centred() {
        let n = 400;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let (x, y) = (f64::from(i) * 0.173 - 30.0, f64::from(j) * 0.173 - 30.0);
                let here = gradient(x, y, 5);
                sum += f64::from(here);
                assert!(here.abs() <= 1.6);
                assert!((gradient(x + 1e-4, y, 5) - here).abs() < 1e-3);
            }
        }
        assert!((sum / f64::from(n * n)).abs() < 0.02);
    }

    #[test]
    fn numbers_are_split_downwards() {
        assert_eq!(split(2.25), (2, 0.25));
        assert_eq!(split(-2.25), (-3, 0.75));
        assert_eq!(split(-2.0), (-2, 0.0));
    }

    #[test]
    fn patterns_finer_than_two_pixels_vanish() {
        assert_eq!(shown(1.9, 1.0), 0.0);
        assert_eq!(shown(4.1, 1.0), 1.0);
    }
}
