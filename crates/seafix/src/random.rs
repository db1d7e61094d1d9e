//! Random numbers of the searches, a function of seed and frame alone.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// The generator of frame number `frame`. Seed and frame are the key of the cipher, so that frames are independent of
/// each other and of their number.
pub(crate) fn of_frame(seed: u64, frame: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip([seed, frame]) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}
