//! All randomness of a dive: counter-based streams, so that nothing depends on order or threads.

use rand::Rng;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use crate::normals::{PAIRS, normals};

/// What a stream of random numbers is drawn for; each purpose has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Errors of the model's points and of the survey.
    Survey,
    /// Rocks on the bed.
    Rocks,
    /// The relief of the bed.
    Relief,
    /// The textures of all surfaces.
    Texture,
    /// From where a frame is taken.
    View,
    /// The error of a frame's rough pose.
    Prior,
    /// The noise of a frame's left image.
    LeftImage,
    /// The noise of a frame's right image.
    RightImage,
    /// The clutter and the noise of a frame's points.
    Points,
    /// What a search draws in a frame.
    Search,
    /// An identification problem of a family.
    Problem,
    /// Whereto objects moved since the survey.
    Changes,
    /// Things in the way.
    Occluders,
    /// A site drawn at random.
    Site,
    /// The current's fluctuations.
    Current,
    /// Which instants a faulty device fails at.
    Faults,
    /// A ping of the acoustic positioning.
    Acoustics,
    /// A reading of the Doppler log.
    Doppler,
    /// A reading of gyro and attitude.
    Gyro,
    /// A reading of the depth.
    Depth,
    /// Imperfections that a device keeps for the whole dive.
    FaultyDevice,
    /// The particles in the water.
    Snow,
    /// A question to the transponders on the bed.
    Transponders,
    /// Which points are wrong matches, and where these lie.
    Mismatches,
}

/// A stream of random numbers, a function of (seed, dive, frame, purpose) alone.
///
/// The four numbers *are* the key of the cipher: streams never overlap, and a further frame
/// changes no earlier one. The elementary functions are those of `libm`: the same numbers on
/// every platform.
#[derive(Debug, Clone)]
pub struct Stream {
    rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Stream {
    /// The stream for `purpose` in `frame` of the dive (or trial) number `dive`.
    pub fn new(seed: u64, dive: u64, frame: u64, purpose: Purpose) -> Self {
        let mut key = [0; 32];
        for (bytes, word) in key.chunks_exact_mut(8).zip([seed, dive, frame, purpose as u64]) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self { rng: ChaCha8Rng::from_seed(key), spare: None }
    }

    /// The generator itself, for code that draws through `rand`'s traits.
    pub fn rng(&mut self) -> &mut dyn Rng {
        &mut self.rng
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.rng.next_u64()
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0..n; 0 where n is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Normal with mean 0 and standard deviation 1. (Box and Muller, 1958.)
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * self.unit());
        self.spare = Some(radius * sine);
        radius * cosine
    }

    /// Fills a list with what as many calls of [`normal`](Self::normal) would give.
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

    /// Three independent normal numbers of standard deviation `sigma`.
    pub fn normal3(&mut self, sigma: f64) -> nalgebra::Vector3<f64> {
        let [x, y, z] = [self.normal(), self.normal(), self.normal()];
        nalgebra::Vector3::new(x, y, z) * sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen to fail when the spare number is not used first.
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
