//! Surface textures: tiles with mean 1, as image pyramids.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use super::math::mix;
use crate::scene::Texture;

/// Side of a tile (texels), a power of two.
const SIDE: usize = 1024;

/// Number of places looked up in one pass.
pub(super) const CHUNK: usize = 32;

/// A periodic tile with its pyramid of coarser levels.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    /// All levels, finest first, each with half the side of the previous one. A texel is stored with its neighbours to
    /// the right, below, and diagonal, which gives one look-up instead of four.
    texels: Vec<[u16; 4]>,
    /// Texels per metre.
    scale: f32,
}

/// A surface texture: the product of a fine and a coarse tile. Their periods have no common multiple within sight, so
/// that no repetition is visible.
#[derive(Debug, Clone)]
pub(super) struct SurfaceTexture {
    fine: Tile,
    coarse: Tile,
}

/// All textures, each computed at its first use.
#[derive(Debug, Clone)]
pub(crate) struct SurfaceTextures {
    surfaces: [OnceLock<Box<SurfaceTexture>>; 7],
    /// Sorted values of the growth pattern at places everywhere.
    slow: OnceLock<Vec<f32>>,
    seed: u32,
}

/// One octave of a tile: number of wavelengths across it, and amplitude.
type Octave = (u32, f32);

impl Tile {
    /// The tile with `value` at every texel, `texel` metres wide.
    fn new(texel: f64, value: impl Fn(usize, usize) -> f32) -> Self {
        let mut finest: Vec<f32> = (0..SIDE * SIDE).map(|i| value(i % SIDE, i / SIDE)).collect();
        let mean = finest.iter().map(|&x| f64::from(x)).sum::<f64>() / finest.len() as f64;
        for x in &mut finest {
            *x = (f64::from(*x) / mean) as f32;
        }
        let mut texels = Vec::new();
        let (mut side, mut level) = (SIDE, finest);
        loop {
            let at = |x: usize, y: usize| level[(y % side) * side + x % side];
            let short = |x: usize, y: usize| (at(x, y) * 16384.0 + 0.5).clamp(0.0, 65535.0) as u16;
            let quad = |x, y| [short(x, y), short(x + 1, y), short(x, y + 1), short(x + 1, y + 1)];
            texels.extend((0..side * side).map(|i| quad(i % side, i / side)));
            if side == 1 {
                break;
            }
            let half = side / 2;
            level = (0..half * half)
                .map(|i| {
                    let (x, y) = (2 * (i % half), 2 * (i / half));
                    0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
                })
                .collect();
            side = half;
        }
        Self { texels, scale: (1.0 / texel) as f32 }
    }

    /// The values at (u, v) metres for pixels with a footprint of `footprint` metres, by trilinear interpolation. Only
    /// the first `count` results are valid.
    #[inline(always)]
    fn at(&self, count: usize, u: &[f32; CHUNK], v: &[f32; CHUNK], footprint: &[f32; CHUNK], out: &mut [f32; CHUNK]) {
        let mut between = [0.0; CHUNK];
        let (mut fine, mut coarse) = (Cells::default(), Cells::default());
        for i in 0..CHUNK {
            let (x, y) = (u[i] * self.scale, v[i] * self.scale);
            let texels = (footprint[i] * self.scale).max(1.0);
            // log2 of the width from the float's own exponent, linear between powers of two.
            let level = ((texels.to_bits() >> 23) - 127).min(COARSEST - 1);
            between[i] = (texels * f32::from_bits((127 - level) << 23) - 1.0).clamp(0.0, 1.0);
            (fine.place[i], fine.across[i], fine.down[i]) = cell(level, x, y);
            (coarse.place[i], coarse.across[i], coarse.down[i]) = cell(level + 1, x, y);
        }
        // A separate look-up loop leaves whole vectors to the loops around it.
        let (mut near, mut far) = ([0; CHUNK], [0; CHUNK]);
        for i in 0..count.min(CHUNK) {
            near[i] = packed(self.texels[fine.place[i] as usize]);
            far[i] = packed(self.texels[coarse.place[i] as usize]);
        }
        for i in 0..CHUNK {
            let value = bilinear(near[i], fine.across[i], fine.down[i]);
            out[i] = value + between[i] * (bilinear(far[i], coarse.across[i], coarse.down[i]) - value);
        }
    }
}

/// The coarsest level, of one texel.
const COARSEST: u32 = SIDE.trailing_zeros();

/// Texel indices, and the positions between them.
#[derive(Default)]
struct Cells {
    place: [u32; CHUNK],
    across: [f32; CHUNK],
    down: [f32; CHUNK],
}

/// The texel of a level whose centre precedes (x, y), given in texels of the finest level, and the distances to it.
#[inline(always)]
fn cell(level: u32, x: f32, y: f32) -> (u32, f32, f32) {
    const ALL: u32 = (SIDE * SIDE) as u32;
    let shift = COARSEST - level;
    let side = 1_u32 << shift;
    // The finer levels have S² + S²/4 + … = 4 (S² − s²)/3 texels; the division by 3 is a multiplication with its
    // inverse mod 2³².
    let before = ((ALL - side * side).wrapping_mul(0xAAAA_AAAB)) * 4;
    let scale = f32::from_bits((127 - level) << 23);
    // Texel centres lie at half-integers.
    let (x, y) = (x * scale - 0.5, y * scale - 0.5);
    let (xi, yi) = (floor(x), floor(y));
    let mask = side - 1;
    let place = before + ((yi as u32 & mask) << shift) + (xi as u32 & mask);
    (place, x - xi as f32, y - yi as f32)
}

#[inline(always)]
fn packed([a, b, c, d]: [u16; 4]) -> u64 {
    u64::from(a) | u64::from(b) << 16 | u64::from(c) << 32 | u64::from(d) << 48
}

/// Bilinear interpolation between a texel and its neighbours.
#[inline(always)]
fn bilinear(four: u64, across: f32, down: f32) -> f32 {
    let [a, b, c, d] = [0, 16, 32, 48].map(|shift| ((four >> shift) & 0xFFFF) as u32 as i32 as f32);
    let (above, below) = (a + across * (b - a), c + across * (d - c));
    (above + down * (below - above)) * (1.0 / 16384.0)
}

/// The integer below `x`.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut - i32::from(cut as f32 > x)
}

impl SurfaceTextures {
    pub(crate) fn new(seed: u32) -> Self {
        Self { surfaces: Default::default(), slow: OnceLock::new(), seed }
    }

    /// The textures of this seed, shared by all concurrent dives; a texture takes 22 MB.
    pub(crate) fn shared(seed: u32) -> Arc<Self> {
        static ALL: Mutex<Vec<Weak<SurfaceTextures>>> = Mutex::new(Vec::new());
        let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|surfaces| surfaces.strong_count() > 0);
        let known = all.iter().filter_map(Weak::upgrade).find(|surfaces| surfaces.seed == seed);
        known.unwrap_or_else(|| {
            let surfaces = Arc::new(Self::new(seed));
            all.push(Arc::downgrade(&surfaces));
            surfaces
        })
    }

    /// Factors of the albedo at places (u, v) of a surface (m), for pixels with these footprints (m).
    pub(super) fn at(&self, texture: Texture, u: &[f32], v: &[f32], footprint: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.resize(u.len(), 1.0);
        if texture != Texture::Plain {
            let surface = self.surfaces[texture as usize].get_or_init(|| Box::new(surface(texture, self.seed)));
            surface.at(u, v, footprint, out);
        }
    }
}

/// Number of pattern values from which the threshold of growth is taken.
const SPREAD: usize = 4096;
/// Steepness of the border of growth.
const BORDER: f32 = 12.0;

impl SurfaceTextures {
    /// The fraction of each place that growth covers, for a body of which growth covers the fraction `growth`. Growth
    /// starts where a slow pattern is low.
    pub(super) fn grown(&self, growth: f32, u: &mut [f32], v: &mut [f32], footprint: &[f32], out: &mut Vec<f32>) {
        if growth >= 1.0 {
            out.clear();
            return out.resize(u.len(), 1.0);
        }
        // The quantile of the pattern at the fraction `growth`, over places of Roberts' R2 sequence (2018).
        let slow = self.slow.get_or_init(|| {
            let place = |k: usize, step: f64| (30.0 * (k as f64 * step).fract()) as f32;
            let north: Vec<f32> = (0..SPREAD).map(|k| place(k, 0.754_877_666_246_692_8)).collect();
            let east: Vec<f32> = (0..SPREAD).map(|k| place(k, 0.569_840_290_998_053_3)).collect();
            let mut values = Vec::new();
            self.at(Texture::Steel, &north, &east, &[0.004; SPREAD], &mut values);
            values.sort_unstable_by(f32::total_cmp);
            values
        });
        let level = slow[((growth * SPREAD as f32) as usize).min(SPREAD - 1)];
        u.iter_mut().for_each(|u| *u = 0.37 * *u + 5.0);
        v.iter_mut().for_each(|v| *v *= 0.37);
        self.at(Texture::Steel, u, v, footprint, out);
        out.iter_mut().for_each(|slow| *slow = ((level - *slow) * BORDER + 0.5).clamp(0.0, 1.0));
    }
}

impl SurfaceTexture {
    fn at(&self, u: &[f32], v: &[f32], footprint: &[f32], out: &mut [f32]) {
        textured(self, u, v, footprint, out);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn textured(surface: &SurfaceTexture, u: &[f32], v: &[f32], footprint: &[f32], out: &mut [f32]) {
    let (mut s, mut t, mut width) = ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
    let (mut p, mut q, mut fine, mut coarse) = ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
    let chunks = u.chunks(CHUNK).zip(v.chunks(CHUNK)).zip(footprint.chunks(CHUNK)).zip(out.chunks_mut(CHUNK));
    for (((u, v), footprint), out) in chunks {
        let n = out.len();
        s[..n].copy_from_slice(u);
        t[..n].copy_from_slice(v);
        width[..n].copy_from_slice(footprint);
        for i in 0..CHUNK {
            // The coarse tile is rotated, so that the two grids do not align.
            (p[i], q[i]) = (0.8 * s[i] - 0.6 * t[i], 0.6 * s[i] + 0.8 * t[i]);
        }
        surface.fine.at(n, &s, &t, &width, &mut fine);
        surface.coarse.at(n, &p, &q, &width, &mut coarse);
        for i in 0..n {
            out[i] = fine[i] * coarse[i];
        }
    }
}

fn surface(texture: Texture, seed: u32) -> SurfaceTexture {
    let seed = mix(texture as u32, 5, seed);
    let tile =
        |texel: f64, octaves: &[Octave], salt: u32| Tile::new(texel, |x, y| 1.0 + sum(octaves, x, y, seed ^ salt));
    match texture {
        Texture::Plain | Texture::Sand => SurfaceTexture {
            fine: Tile::new(0.0022, |x, y| {
                let grain = sum(&[(14, 0.07), (31, 0.09), (67, 0.10), (139, 0.10), (283, 0.10)], x, y, seed);
                let stones = pebbles(x, y, 11, seed ^ 0xA5A5) + 0.8 * pebbles(x, y, 27, seed ^ 0x5A5A);
                (1.0 + grain + 0.8 * stones).max(0.15)
            }),
            coarse: tile(0.0131, &[(5, 0.12), (11, 0.12), (23, 0.10), (49, 0.08), (101, 0.05)], 0x3C3C),
        },
        Texture::Steel => SurfaceTexture {
            fine: tile(0.0017, &stained([5, 11, 24, 59, 131], 0.15), 1),
            coarse: Tile::new(0.0059, |x, y| {
                // Anodes prevent rust, so stains are faint.
                let rust = sum(&stained([7, 17, 41], 0.71), x, y, seed ^ 2);
                1.0 - 0.2 * ((rust - 0.25) * 3.0).clamp(0.0, 1.0) + sum(&[(9, 0.08)], x, y, seed ^ 3)
            }),
        },
        Texture::Paint => SurfaceTexture {
            fine: tile(0.0017, &stained([7, 19, 47, 113, 241], 0.09), 1),
            coarse: Tile::new(0.0047, |x, y| {
                // The grey primer (0.4) shows where yellow (0.58) is worn off.
                let worn = sum(&stained([9, 21, 53, 127], 0.81), x, y, seed ^ 2);
                1.0 - 0.3 * ((worn - 0.48) * 4.0).clamp(0.0, 1.0) + sum(&[(5, 0.07), (13, 0.05)], x, y, seed ^ 3)
            }),
        },
        Texture::Rock => SurfaceTexture {
            fine: tile(0.0017, &[(9, 0.14), (21, 0.15), (53, 0.14), (127, 0.10)], 1),
            coarse: tile(0.0053, &[(13, 0.14), (37, 0.10)], 2),
        },
        Texture::Concrete => SurfaceTexture {
            fine: Tile::new(0.0009, |x, y| {
                let grain = sum(&[(13, 0.05), (31, 0.06), (71, 0.07), (151, 0.09), (331, 0.10)], x, y, seed);
                (1.0 + grain + 0.5 * pebbles(x, y, 41, seed ^ 0xA5A5)).max(0.2)
            }),
            coarse: tile(0.0057, &[(5, 0.08), (13, 0.08), (31, 0.08), (73, 0.06)], 4),
        },
        Texture::Growth => SurfaceTexture {
            fine: Tile::new(0.0015, |x, y| {
                let tufts = sum(&[(33, 0.35), (71, 0.35), (151, 0.25)], x, y, seed ^ 1);
                (1.0 + tufts).max(0.2)
            }),
            coarse: tile(0.0061, &[(7, 0.16), (19, 0.16), (47, 0.12)], 2),
        },
    }
}

/// Octaves of a coat marked by stains, films and wear.
///
/// Brownian noise: each amplitude is proportional to the root of its wavelength (Hurst exponent ½; Pentland,
/// *Fractal-based description of natural scenes*, 1984), and `rms` is that of the sum. Equal contrast at a centimetre
/// and at a decimetre would be bare, pitted metal.
fn stained<const N: usize>(waves: [u32; N], rms: f32) -> [Octave; N] {
    let all: f32 = waves.iter().map(|w| 1.0 / *w as f32).sum();
    waves.map(|w| (w, rms * (1.0 / (w as f32 * all)).sqrt()))
}

/// The sum of octaves of gradient noise with the period of the tile (Perlin 2002).
fn sum(octaves: &[Octave], x: usize, y: usize, seed: u32) -> f32 {
    let mut sum = 0.0;
    for &(waves, amplitude) in octaves {
        let scale = waves as f32 / SIDE as f32;
        let (u, v) = ((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
        let (i, j) = (u as u32, v as u32);
        let (fx, fy) = (u - i as f32, v - j as f32);
        let corner = |di: u32, dj: u32| {
            let h = mix((i + di) % waves, (j + dj) % waves, seed ^ waves.wrapping_mul(0x51ED));
            let (gx, gy) = DIRECTIONS[(h >> 28) as usize];
            gx * (fx - di as f32) + gy * (fy - dj as f32)
        };
        let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (sx, sy) = (fade(fx), fade(fy));
        let above = corner(0, 0) + sx * (corner(1, 0) - corner(0, 0));
        let below = corner(0, 1) + sx * (corner(1, 1) - corner(0, 1));
        sum += amplitude * 1.5 * (above + sy * (below - above));
    }
    sum
}

/// Sixteen unit vectors.
const DIRECTIONS: [(f32, f32); 16] = {
    const A: f32 = 0.923_879_5;
    const B: f32 = 0.382_683_43;
    const C: f32 = std::f32::consts::FRAC_1_SQRT_2;
    [
        (1.0, 0.0),
        (A, B),
        (C, C),
        (B, A),
        (0.0, 1.0),
        (-B, A),
        (-C, C),
        (-A, B),
        (-1.0, 0.0),
        (-A, -B),
        (-C, -C),
        (-B, -A),
        (0.0, -1.0),
        (B, -A),
        (C, -C),
        (A, -B),
    ]
};

/// Pebbles and shells: at most one in each of `cells`² cells.
fn pebbles(x: usize, y: usize, cells: u32, seed: u32) -> f32 {
    let scale = cells as f32 / SIDE as f32;
    let (u, v) = ((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
    let (i, j) = (u as u32, v as u32);
    let h = mix(i, j, seed);
    if h & 7 > 4 {
        return 0.0;
    }
    let fraction = |shift: u32| ((h >> shift) & 0xFF) as f32 / 255.0;
    let radius = 0.1 + 0.3 * fraction(3) * fraction(3);
    let room = 1.0 - 2.0 * radius;
    let (du, dv) = (u - i as f32 - radius - room * fraction(8), v - j as f32 - radius - room * fraction(16));
    let elongation = 1.0 + 0.7 * fraction(20);
    let (along, across) = if h & 0x800_0000 == 0 { (du, dv * elongation) } else { (du * elongation, dv) };
    let distance = (along * along + across * across).sqrt();
    let inside = ((radius - distance) / (0.25 * radius) + 0.5).clamp(0.0, 1.0);
    inside * (0.9 * fraction(24) - 0.5 + 0.15 * (du * 0.76 + dv * 0.65) / radius)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value at one place of a tile.
    fn at(tile: &Tile, u: f32, v: f32, footprint: f32) -> f32 {
        let mut out = [0.0; CHUNK];
        tile.at(1, &[u; CHUNK], &[v; CHUNK], &[footprint; CHUNK], &mut out);
        out[0]
    }

    #[test]
    fn a_tile_repeats_is_continuous_and_fades_to_its_mean() {
        let surface = surface(Texture::Sand, 3);
        let period = SIDE as f32 * 0.0022;
        let (mut sum, mut n) = (0.0, 0.0);
        for k in 0..3000 {
            let (u, v) = (k as f32 * 0.013, (k % 71) as f32 * 0.029);
            let here = at(&surface.fine, u, v, 0.004);
            assert!((at(&surface.fine, u + period, v - period, 0.004) - here).abs() < 0.02);
            assert!((at(&surface.fine, u + 1e-4, v, 0.004) - here).abs() < 0.08);
            assert!((at(&surface.fine, u, v, 0.00881) - at(&surface.fine, u, v, 0.00879)).abs() < 0.01);
            sum += f64::from(here);
            n += 1.0;
        }
        assert!((sum / n - 1.0).abs() < 0.05);
        assert!((at(&surface.fine, 0.3, 0.4, 1e3) - 1.0).abs() < 1e-3);
        let mut plain = Vec::new();
        SurfaceTextures::new(1).at(Texture::Plain, &[0.1; 3], &[0.2; 3], &[0.01; 3], &mut plain);
        assert_eq!(plain, [1.0; 3]);
    }

    #[test]
    fn stains_of_a_coat_differ_with_the_distance() {
        // The mean square difference of Brownian noise doubles with the distance.
        for waves in [[5, 11, 24, 59, 131], [7, 19, 47, 113, 241]] {
            let octaves = stained(waves, 0.2);
            let value = |x: usize, y: usize| f64::from(sum(&octaves, x, y, 7));
            let structure = |d: usize| {
                let pairs = (0..40_000).map(|k| (k * 37 % SIDE, k * 53 % SIDE));
                pairs.map(|(x, y)| value((x + d) % SIDE, y) - value(x, y)).map(|step| step * step).sum::<f64>()
            };
            let growth = structure(32) / structure(8);
            assert!((3.0..5.0).contains(&growth), "{growth}");
        }
    }

    #[test]
    fn growth_covers_its_fraction() {
        // Regression: with fixed thresholds a growth of one quarter was hardly visible.
        let surfaces = SurfaceTextures::new(9);
        for growth in [0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98, 1.0] {
            let mut u: Vec<f32> = (0..20_000).map(|k| (k % 141) as f32 * 0.31).collect();
            let mut v: Vec<f32> = (0..20_000).map(|k| (k / 141) as f32 * 0.29).collect();
            let mut cover = Vec::new();
            surfaces.grown(growth, &mut u, &mut v, &[0.004; 20_000], &mut cover);
            let mean = cover.iter().sum::<f32>() / cover.len() as f32;
            assert!((mean - growth).abs() < 0.06, "{growth}: {mean}");
        }
    }

    #[test]
    fn levels_lie_one_behind_the_other() {
        let sides = (0..=COARSEST).map(|level| 1_u32 << (COARSEST - level));
        let mut before = 0;
        for (level, side) in (0..).zip(sides) {
            let inside = 0.75 * f32::from_bits((127 + level) << 23);
            assert_eq!(cell(level, inside, inside).0, before);
            before += side * side;
        }
    }

    #[test]
    fn negative_places_have_values_too() {
        assert_eq!((floor(-0.25), floor(-1.0), floor(2.75)), (-1, -1, 2));
        let surface = surface(Texture::Rock, 3);
        assert!((0.1..3.0).contains(&at(&surface.fine, -20.3, -7.7, 0.002)));
    }
}
