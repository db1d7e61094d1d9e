//! Vectorised albedos with the bits of [`paint::seabed`](crate::paint::seabed) and
//! [`paint::finish`](crate::paint::finish).

use crate::{
    noise::{DIRECTIONS, hash, shown},
    paint::{OCTAVE_TURNS, SAND, STONES, coats, octave_seed},
    virtual_scene::Finish,
};

/// Number of places computed in one pass.
const CHUNK: usize = 32;

/// One number for each place.
type Lane<T> = [T; CHUNK];

/// [`paint::seabed`](crate::paint::seabed) at each place (north, east) for pixels with these footprints (m).
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(crate) fn seabeds(north: &[f64], east: &[f64], footprint: &[f64], seed: u32, out: &mut Vec<f32>) {
    out.clear();
    out.resize(north.len(), 0.0);
    let places = north.chunks(CHUNK).zip(east.chunks(CHUNK)).zip(footprint.chunks(CHUNK));
    let (mut x, mut y, mut width) = ([0.0; CHUNK], [0.0; CHUNK], [1.0; CHUNK]);
    for (((north, east), footprint), out) in places.zip(out.chunks_mut(CHUNK)) {
        x[..out.len()].copy_from_slice(north);
        y[..out.len()].copy_from_slice(east);
        width[..out.len()].copy_from_slice(footprint);
        let (mut sand, mut stones) = ([0.0; CHUNK], [0.0; CHUNK]);
        octaves(&SAND, &x, &y, &width, seed, &mut sand);
        let [(salt, cell), (turned_salt, turned_cell)] = STONES;
        for i in 0..CHUNK {
            stones[i] = pebbles(x[i], y[i], width[i], seed ^ salt, cell);
        }
        if width.iter().any(|width| shown(turned_cell * 0.5, *width) > 0.0) {
            for i in 0..CHUNK {
                let (u, v) = (0.8 * x[i] - 0.6 * y[i], 0.6 * x[i] + 0.8 * y[i]);
                stones[i] += 0.8 * pebbles(u, v, width[i], seed ^ turned_salt, turned_cell);
            }
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = 0.33 * (1.0 + sand[i] + 0.8 * stones[i]).max(0.1);
        }
    }
}

/// [`paint::finish`](crate::paint::finish) at each place (x, y) of a surface for pixels with these footprints (m).
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(crate) fn finishes(finish: Finish, x: &[f64], y: &[f64], footprint: &[f64], seed: u32, out: &mut Vec<f32>) {
    out.clear();
    out.resize(x.len(), 1.0);
    let places = x.chunks(CHUNK).zip(y.chunks(CHUNK)).zip(footprint.chunks(CHUNK));
    let (mut u, mut v, mut width) = ([0.0; CHUNK], [0.0; CHUNK], [1.0; CHUNK]);
    for (((x, y), footprint), out) in places.zip(out.chunks_mut(CHUNK)) {
        u[..out.len()].copy_from_slice(x);
        v[..out.len()].copy_from_slice(y);
        width[..out.len()].copy_from_slice(footprint);
        for (salt, layers) in coats(finish) {
            let mut sum = [0.0; CHUNK];
            octaves(layers, &u, &v, &width, seed ^ salt, &mut sum);
            out.iter_mut().zip(sum).for_each(|(out, sum)| *out += sum);
        }
    }
}

/// Adds the octaves of gradient noise that are visible at some place.
#[inline(always)]
fn octaves(layers: &[(f64, f32)], x: &Lane<f64>, y: &Lane<f64>, width: &Lane<f64>, seed: u32, sum: &mut Lane<f32>) {
    for (k, &(size, amplitude)) in layers.iter().enumerate() {
        let weight = width.map(|width| shown(size * 1.5, width) * amplitude);
        if weight.iter().any(|weight| *weight > 0.0) {
            octave(k, size, x, y, seed, &weight, sum);
        }
    }
}

/// Adds octave `k` of gradient noise.
#[inline(always)]
fn octave(k: usize, size: f64, x: &Lane<f64>, y: &Lane<f64>, seed: u32, weight: &Lane<f32>, sum: &mut Lane<f32>) {
    let ((s, c), scale, seed) = (OCTAVE_TURNS[k % 4], 1.0 / size, octave_seed(seed, k));
    let (mut fx, mut fy) = ([0.0; CHUNK], [0.0; CHUNK]);
    let mut directions = [[0; CHUNK]; 4];
    for i in 0..CHUNK {
        let (u, v) = ((c * x[i] - s * y[i]) * scale, (s * x[i] + c * y[i]) * scale);
        let (ix, iy);
        ((ix, fx[i]), (iy, fy[i])) = (split(u + 17.3), split(v - 5.1));
        let column = |dx: u32| (ix as u32).wrapping_add(dx).wrapping_mul(0x9E37_79B1) ^ seed;
        let row = |dy: u32| (iy as u32).wrapping_add(dy).wrapping_mul(0x85EB_CA77).rotate_left(15);
        let direction = |h: u32| (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 28;
        directions[0][i] = direction(column(0) ^ row(0));
        directions[1][i] = direction(column(1) ^ row(0));
        directions[2][i] = direction(column(0) ^ row(1));
        directions[3][i] = direction(column(1) ^ row(1));
    }
    // A separate look-up loop leaves whole vectors to the loops around it.
    let gradients = directions.map(|lane| lane.map(|k| PACKED[(k & 15) as usize]));
    for i in 0..CHUNK {
        let corner = |corner: usize, dx: f32, dy: f32| {
            let packed = gradients[corner][i];
            let (gx, gy) = (f32::from_bits(packed as u32), f32::from_bits((packed >> 32) as u32));
            gx * (fx[i] - dx) + gy * (fy[i] - dy)
        };
        let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (sx, sy) = (fade(fx[i]), fade(fy[i]));
        let above = corner(0, 0.0, 0.0) + sx * (corner(1, 1.0, 0.0) - corner(0, 0.0, 0.0));
        let below = corner(2, 0.0, 1.0) + sx * (corner(3, 1.0, 1.0) - corner(2, 0.0, 1.0));
        sum[i] += weight[i] * (1.5 * (above + sy * (below - above)));
    }
}

/// Both numbers of each direction, packed.
const PACKED: [u64; 16] = {
    let mut all = [0; 16];
    let mut k = 0;
    while k < 16 {
        let [x, y] = DIRECTIONS[k];
        all[k] = x.to_bits() as u64 | (y.to_bits() as u64) << 32;
        k += 1;
    }
    all
};

/// [`paint::pebbles`](crate::paint::pebbles) without branches.
#[inline(always)]
fn pebbles(x: f64, y: f64, footprint: f64, seed: u32, cell: f64) -> f32 {
    let weight = shown(cell * 0.5, footprint);
    let ((cu, fu), (cv, fv)) = (split(x / cell), split(y / cell));
    let h = hash(cu, cv, seed);
    let fraction = |shift: u32| ((h >> shift) & 0xFF) as i32 as f32 / 255.0;
    let radius = 0.16 + 0.26 * fraction(3) * fraction(3);
    let room = 1.0 - 2.0 * radius;
    let (du, dv) = (fu - radius - room * fraction(8), fv - radius - room * fraction(16));
    let scale_error = 1.0 + 0.5 * fraction(20);
    let (along, across) = if h & 0x800_0000 == 0 { (du, dv * scale_error) } else { (du * scale_error, dv) };
    let distance = (along * along + across * across).sqrt();
    let soft = (footprint / cell) as f32 + 0.3 * radius;
    let inside = ((radius - distance) / soft + 0.5).clamp(0.0, 1.0);
    let tone = 0.9 * fraction(24) - 0.5 + 0.12 * (du * 0.76 + dv * 0.65) / radius;
    if h & 7 > 3 { 0.0 } else { weight * inside * tone }
}

/// Integer part and fraction of `x` as in [`noise::split`](crate::noise::split), for |x| < 2³¹. A cast would keep loops
/// from being vectorised.
#[inline(always)]
fn split(x: f64) -> (i32, f32) {
    // 1.5·2⁵²: adding it rounds to an integer, which then stands in the lowest bits.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    let near = (x + MAGIC) - MAGIC;
    let below = if near > x { near - 1.0 } else { near };
    ((below + MAGIC).to_bits() as u32 as i32, (x - below) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint;

    /// Regression: stones of the second grid without rotation fail this test.
    #[test]
    fn many_places_have_the_values_of_each() {
        // Footprints from millimetres, with every octave visible, to decimetres, with none.
        for (footprint, count) in [(0.002, 5000), (0.006, 5000), (0.02, 5000), (0.09, 501), (2.0, 33)] {
            let of = |step: f64| (0..count).map(|k| f64::from(k) * step - 7.0).collect::<Vec<_>>();
            let (north, east) = (of(0.0137), of(-0.0051));
            let widths: Vec<f64> = (0..count).map(|k| footprint * (1.0 + f64::from(k % 7) * 0.03)).collect();
            let mut all = vec![9.0; 3];
            seabeds(&north, &east, &widths, 77, &mut all);
            assert_eq!(all.len(), north.len());
            for (k, value) in all.iter().enumerate() {
                assert_eq!(
                    value.to_bits(),
                    paint::seabed(north[k], east[k], widths[k], 77).to_bits(),
                    "{footprint}, {k}"
                );
            }
            for finish in [Finish::Plate, Finish::Paint, Finish::Rock] {
                finishes(finish, &north, &east, &widths, 5, &mut all);
                for (k, value) in all.iter().enumerate() {
                    let one = paint::finish(finish, north[k], east[k], widths[k], 5);
                    assert_eq!(value.to_bits(), one.to_bits(), "{finish:?}, {footprint}, {k}");
                }
            }
        }
    }

    #[test]
    fn numbers_are_split_downwards() {
        for x in [2.25, -2.25, -2.0, 0.0, -0.0, 1e9 + 0.5, -1e-12, 0.999_999_999_999] {
            assert_eq!(split(x), crate::noise::split(x));
        }
    }
}
