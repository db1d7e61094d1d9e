//! Counter-based random streams: results do not depend on order or threads.

use rand::Rng;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use crate::normals::{PAIRS, normals};

/// The purpose of a random stream; each purpose has a stream of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Errors of the model points and of the survey.
    Survey,
    /// Rocks on the seabed.
    Rocks,
    /// Relief of the seabed.
    Relief,
    /// Textures of all surfaces.
    Texture,
    /// Viewpoint of a frame.
    View,
    /// Error of a frame's prior pose.
    Prior,
    /// Noise of a frame's left image.
    LeftImage,
    /// Noise of a frame's right image.
    RightImage,
    /// Clutter and noise of a frame's points.
    Points,
    /// Random choices of a search in a frame.
    Search,
    /// A generated coherence problem.
    Problem,
    /// Displacements of objects since the survey.
    Changes,
    /// Occluders.
    Occluders,
    /// A random site.
    Site,
    /// Fluctuations of the current.
    Current,
    /// Instants at which a faulty device fails.
    Faults,
    /// A fix of the acoustic positioning.
    Acoustics,
    /// A reading of the Doppler log.
    Doppler,
    /// A reading of gyro and attitude.
    Gyro,
    /// A reading of the depth gauge.
    Depth,
    /// Device errors that are constant over a dive.
    FaultyDevice,
    /// Particles in the water.
    Snow,
    /// An interrogation of the transponders.
    Transponders,
    /// Selection and positions of wrong matches.
    Mismatches,
    /// Errors of the ends of edges.
    Edges,
    /// Marks of an operator.
    Marks,
}

/// A stream of random numbers, a function of (seed, dive, frame, purpose) alone.
///
/// The four numbers are the key of the cipher, so streams never overlap, and a further frame changes no earlier one.
/// The elementary functions are those of `libm`, so the numbers are the same on every platform.
#[derive(Debug, Clone)]
pub struct Stream {
    rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Stream {
    /// The stream for `purpose` in `frame` of dive (or trial) number `dive`.
    pub fn new(seed: u64, dive: u64, frame: u64, purpose: Purpose) -> Self {
        let mut key = [0; 32];
        for (bytes, word) in key.chunks_exact_mut(8).zip([seed, dive, frame, purpose as u64]) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self { rng: ChaCha8Rng::from_seed(key), spare: None }
    }

    /// The generator itself, for code that uses `rand`'s traits.
    pub fn rng(&mut self) -> &mut dyn Rng {
        &mut self.rng
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.rng.next_u64()
    }

    /// A uniform number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A uniform number in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A uniform integer in 0..n; 0 if n is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// A normal number with mean 0 and standard deviation 1 (Box and Muller, 1958).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * self.unit());
        self.spare = Some(radius * sine);
        radius * cosine
    }

    /// Fills a slice with the results of as many calls of [`normal`](Self::normal).
    pub(crate) fn normals(&mut self, out: &mut [f64]) {
        let spare = usize::from(self.spare.is_some()).min(out.len());
        let (first, rest) = out.split_at_mut(spare);
        first.iter_mut().for_each(|x| *x = self.normal());
        let mut chunks = rest.chunks_exact_mut(2 * PAIRS);
        for chunk in &mut chunks {
            let (mut radii, mut angles) = ([0.0; PAIRS], [0.0; PAIRS]);
            for (radius, angle) in radii.iter_mut().zip(&mut angles) {
                (*radius, *angle) = (self.unit(), self.unit());
            }
            let [cosine, sine] = normals(&radii, &angles);
            for ((pair, cosine), sine) in chunk.chunks_exact_mut(2).zip(cosine).zip(sine) {
                pair.copy_from_slice(&[cosine, sine]);
            }
        }
        chunks.into_remainder().iter_mut().for_each(|x| *x = self.normal());
    }

    /// Three independent normal numbers with standard deviation `sigma`.
    pub fn normal3(&mut self, sigma: f64) -> nalgebra::Vector3<f64> {
        let [x, y, z] = [self.normal(), self.normal(), self.normal()];
        nalgebra::Vector3::new(x, y, z) * sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_normal_numbers_are_those_generated_one_by_one() {
        let stream = || Stream::new(4, 0, 7, Purpose::LeftImage);
        let (mut one, mut many) = (stream(), stream());
        for count in [1, 0, 64, 300, 5, 20_000, 1] {
            let mut all = vec![0.0; count];
            many.normals(&mut all);
            assert!(all.iter().all(|x| x.to_bits() == one.normal().to_bits()), "{count}");
        }
    }

    #[test]
    fn streams_are_functions_of_their_four_numbers() {
        let first = |s, d, f, p| Stream::new(s, d, f, p).bits();
        let reference = first(1, 2, 3, Purpose::View);
        assert_eq!(reference, first(1, 2, 3, Purpose::View));
        for other in [
            first(2, 2, 3, Purpose::View),
            first(1, 3, 3, Purpose::View),
            first(1, 2, 4, Purpose::View),
            first(1, 2, 3, Purpose::Prior),
        ] {
            assert_ne!(reference, other);
        }
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(7, 0, 0, Purpose::Points);
        let n = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let x = stream.normal();
            sum += x;
            squares += x * x;
        }
        let n = f64::from(n);
        assert!((sum / n).abs() < 0.015 && (squares / n - 1.0).abs() < 0.02);
    }

    #[test]
    fn integers_stay_below_their_bound() {
        let mut stream = Stream::new(7, 0, 1, Purpose::Points);
        assert!((0..1000).all(|_| stream.below(7) < 7));
        assert_eq!(stream.below(0), 0);
    }
}
