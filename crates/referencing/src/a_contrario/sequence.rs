//! Fixed quasi-random sequences: the same problem has the same answer.

use std::sync::OnceLock;

use nalgebra::Vector3;

/// Number of points and of normal numbers.
const POINTS: usize = 1 << 10;
const NORMALS: usize = 1 << 13;
/// The positive root of x⁵ = x + 1: its powers fill a four-dimensional cube evenly (Roberts, 2018).
const ROOT: f64 = 1.167_303_978_261_418_7;

/// Number of entries computed at a time on demand, since most estimates need few.
const CHUNK: usize = 64;

/// Points of the low-discrepancy sequence.
struct Points {
    /// In [0, 1).
    even: [f64; CHUNK],
    /// On the unit sphere.
    directions: [Vector3<f64>; CHUNK],
    /// Over all rotations: unit quaternions, scalar last.
    turns: [[f64; 4]; CHUNK],
}

static EVEN: [OnceLock<Points>; POINTS / CHUNK] = [const { OnceLock::new() }; POINTS / CHUNK];
static NORMAL: [OnceLock<[f64; CHUNK]>; NORMALS / CHUNK] = [const { OnceLock::new() }; NORMALS / CHUNK];

fn circle(u: f64) -> (f64, f64) {
    libm::sincos(std::f64::consts::TAU * u)
}

fn points(chunk: usize) -> &'static Points {
    EVEN[chunk].get_or_init(|| {
        let steps: [f64; 4] = std::array::from_fn(|k| (0..=k).fold(1.0, |power, _| power / ROOT));
        let cube = |k: usize| steps.map(|step| (0.5 + step * (chunk * CHUNK + k + 1) as f64).fract());
        let direction = |k: usize| {
            let [_, u, v, _] = cube(k);
            let (z, (sine, cosine)) = (2.0 * u - 1.0, circle(v));
            let across = (1.0 - z * z).max(0.0).sqrt();
            Vector3::new(across * cosine, across * sine, z)
        };
        // Shoemake, Uniform random rotations, 1992.
        let turn = |k: usize| {
            let [_, u, v, w] = cube(k);
            let ((a, b), (c, d)) = (circle(v), circle(w));
            let (near, far) = ((1.0 - u).sqrt(), u.sqrt());
            [near * a, near * b, far * c, far * d]
        };
        Points {
            even: std::array::from_fn(|k| cube(k)[0]),
            directions: std::array::from_fn(direction),
            turns: std::array::from_fn(turn),
        }
    })
}

fn normals(chunk: usize) -> &'static [f64; CHUNK] {
    NORMAL[chunk].get_or_init(|| {
        // Each takes two of the numbers.
        let mut bits = Bits(0x5eaf_1c5e).after(2 * chunk * CHUNK);
        std::array::from_fn(|_| (-2.0 * libm::log(1.0 - bits.unit())).sqrt() * circle(bits.unit()).1)
    })
}

/// Pseudo-random numbers (SplitMix: Steele, Lea and Flood, 2014).
struct Bits(u64);

const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

impl Bits {
    /// The sequence after `many` numbers.
    fn after(self, many: usize) -> Self {
        Self(self.0.wrapping_add(STEP.wrapping_mul(many as u64)))
    }

    fn unit(&mut self) -> f64 {
        let z = mixed(self.0);
        self.0 = self.0.wrapping_add(STEP);
        (z >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

/// The pseudo-random number after this one.
fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The numbers of one estimate.
pub(super) struct QuasiRandom {
    taken: usize,
    normals: usize,
    bits: Bits,
}

impl QuasiRandom {
    /// The sequence for a number of samples.
    pub(super) fn new(samples: usize) -> Self {
        Self { taken: 0, normals: 0, bits: Bits(samples as u64) }
    }

    /// A number in [0, 1), evenly distributed over a sequence of calls, one a sample.
    pub(super) fn even(&mut self) -> f64 {
        self.taken = (self.taken + 1) % POINTS;
        points(self.taken / CHUNK).even[self.taken % CHUNK]
    }

    /// A pseudo-random number in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.bits.unit()
    }

    /// A pseudo-random number in 0..n.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((self.bits.unit() * n as f64) as usize).min(n - 1)
    }

    /// A direction, one a sample.
    pub(super) fn direction(&self) -> Vector3<f64> {
        points(self.taken / CHUNK).directions[self.taken % CHUNK]
    }

    /// A rotation, one a sample: a unit quaternion, scalar last.
    pub(super) fn turn(&self) -> [f64; 4] {
        points(self.taken / CHUNK).turns[self.taken % CHUNK]
    }

    /// Three independent standard normal numbers.
    pub(super) fn normal3(&mut self) -> Vector3<f64> {
        self.normals = (self.normals + 3) % (NORMALS - 3);
        Vector3::from_fn(|k, _| normals((self.normals + k) / CHUNK)[(self.normals + k) % CHUNK])
    }
}
