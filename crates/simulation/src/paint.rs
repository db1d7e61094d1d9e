//! Colours of surfaces: closed-form textures under a fixed light.

use nalgebra::Vector3;

use crate::{
    noise::{gradient, hash, shown, split},
    virtual_scene::Finish,
};

/// Ambient part of the light.
const AMBIENT: f32 = 0.38;
/// Directional part of the light, from the lamp.
const LAMP: f32 = 0.72;

/// The unit vector towards the light (world): high, from the north-east.
fn towards_light() -> Vector3<f64> {
    Vector3::new(0.45, 0.38, -0.81).normalize()
}

/// The irradiance of a surface with this normal, by Lambert's law.
pub(crate) fn light(normal: &Vector3<f64>) -> f32 {
    let cosine = normal.dot(&towards_light()) / normal.norm();
    AMBIENT + LAMP * cosine.max(0.0) as f32
}

/// Sine and cosine of each octave's rotation, which keeps their grids from aligning.
pub(crate) const OCTAVE_TURNS: [(f64, f64); 4] = [(0.0, 1.0), (0.6, 0.8), (0.8, -0.6), (-0.28, 0.96)];

/// The seed of octave `k`.
pub(crate) fn octave_seed(seed: u32, k: usize) -> u32 {
    seed.wrapping_add(k as u32 * 0x51ED)
}

/// Octaves of the seabed: feature size (m) and amplitude.
pub(crate) const SAND: [(f64, f32); 4] = [(0.34, 0.12), (0.13, 0.13), (0.05, 0.13), (0.019, 0.12)];
/// The two grids of stones on the seabed: offset of the seed, and side of a cell (m). The second grid is rotated.
pub(crate) const STONES: [(u32, f64); 2] = [(0xA5A5, 0.21), (0x5A5A, 0.085)];

/// The sum of noise octaves, given as pairs of feature size (m) and amplitude.
fn octaves(x: f64, y: f64, footprint: f64, seed: u32, layers: &[(f64, f32)]) -> f32 {
    let mut sum = 0.0;
    for (k, &(size, amplitude)) in layers.iter().enumerate() {
        let weight = shown(size * 1.5, footprint) * amplitude;
        if weight > 0.0 {
            let ((s, c), scale) = (OCTAVE_TURNS[k % 4], 1.0 / size);
            let (u, v) = ((c * x - s * y) * scale, (s * x + c * y) * scale);
            sum += weight * gradient(u + 17.3, v - 5.1, octave_seed(seed, k));
        }
    }
    sum
}

/// Pebbles: at most one in each cell of a grid, lit from one side.
fn pebbles(x: f64, y: f64, footprint: f64, seed: u32, cell: f64) -> f32 {
    let weight = shown(cell * 0.5, footprint);
    if weight == 0.0 {
        return 0.0;
    }
    let ((cu, fu), (cv, fv)) = (split(x / cell), split(y / cell));
    let h = hash(cu, cv, seed);
    if h & 7 > 3 {
        return 0.0;
    }
    let fraction = |shift: u32| ((h >> shift) & 0xFF) as f32 / 255.0;
    let radius = 0.16 + 0.26 * fraction(3) * fraction(3);
    let room = 1.0 - 2.0 * radius;
    let (du, dv) = (fu - radius - room * fraction(8), fv - radius - room * fraction(16));
    let scale_error = 1.0 + 0.5 * fraction(20);
    let (along, across) = if h & 0x800_0000 == 0 { (du, dv * scale_error) } else { (du * scale_error, dv) };
    let distance = (along * along + across * across).sqrt();
    let soft = (footprint / cell) as f32 + 0.3 * radius;
    let inside = ((radius - distance) / soft + 0.5).clamp(0.0, 1.0);
    let tone = 0.9 * fraction(24) - 0.5 + 0.12 * (du * 0.76 + dv * 0.65) / radius;
    weight * inside * tone
}

/// A factor of the seabed's albedo around a place (north, east), with patches of metres.
pub(crate) fn patches(north: f64, east: f64, seed: u32) -> f32 {
    1.0 + octaves(north, east, 0.1, seed ^ 0x3C3C, &[(2.3, 0.14), (0.9, 0.14)])
}

/// The seabed's albedo at a place (north, east) for pixels with this footprint (m).
pub(crate) fn seabed(north: f64, east: f64, footprint: f64, seed: u32) -> f32 {
    let sand = octaves(north, east, footprint, seed, &SAND);
    let (tu, tv) = (0.8 * north - 0.6 * east, 0.6 * north + 0.8 * east);
    let [(salt, cell), (turned_salt, turned_cell)] = STONES;
    let stones = pebbles(north, east, footprint, seed ^ salt, cell)
        + 0.8 * pebbles(tu, tv, footprint, seed ^ turned_salt, turned_cell);
    0.33 * (1.0 + sand + 0.8 * stones).max(0.1)
}

/// Octaves of noise, with the offset of their seed from the surface's.
pub(crate) type Coat = (u32, &'static [(f64, f32)]);

/// The coats of a finish; their sum plus 1 is the factor of the albedo.
pub(crate) fn coats(finish: Finish) -> &'static [Coat] {
    match finish {
        // Stains and growth: large blotches, and small ones where they are thick.
        Finish::Plate => &[(0, &[(0.42, 0.16), (0.17, 0.12)]), (0x77, &[(0.071, 0.10), (0.03, 0.07), (0.013, 0.05)])],
        Finish::Paint => &[(0, &[(0.11, 0.16), (0.04, 0.12), (0.015, 0.08)])],
        Finish::Rock => &[(0, &[(0.09, 0.25), (0.035, 0.2), (0.014, 0.15)])],
    }
}

/// The factor of a surface's albedo at (x, y) of its plane (m).
pub(crate) fn finish(finish: Finish, x: f64, y: f64, footprint: f64, seed: u32) -> f32 {
    coats(finish).iter().fold(1.0, |sum, (salt, layers)| sum + octaves(x, y, footprint, seed ^ salt, layers))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_follows_the_cosine_and_never_fails() {
        let l = towards_light();
        assert!((light(&l) - AMBIENT - LAMP).abs() < 1e-6);
        assert_eq!(light(&-l), AMBIENT);
        let tilted = Vector3::new(l.z, 0.0, -l.x).normalize();
        assert!((light(&(l + tilted)) - AMBIENT - LAMP * libm::sqrtf(0.5)).abs() < 1e-6);
    }

    #[test]
    fn the_seabed_is_never_white_nor_black() {
        for k in 0..20_000 {
            let (n, e) = (f64::from(k) * 0.0371, f64::from(k % 317) * 0.0113);
            let a = seabed(n, e, 0.004, 9);
            assert!((0.02..0.75).contains(&a), "{a}");
        }
    }

    #[test]
    fn far_away_a_texture_is_its_mean() {
        assert!((seabed(0.3, 0.4, 100.0, 9) - 0.33).abs() < 1e-6);
        assert_eq!(finish(Finish::Plate, 0.1, 0.2, 100.0, 9), 1.0);
    }
}
