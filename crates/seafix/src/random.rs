//! Random numbers of the searches, a function of seed and frame alone.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// The generator of a frame, named by its number or its stamp. Seed and frame are the key of the cipher, so that the numbers of
/// a frame do not depend on other frames.
pub(crate) fn of_frame(seed: u64, frame: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip([seed, frame]) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}
