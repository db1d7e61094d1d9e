//! Stamps and colours of the messages.

use crate::proto::{Timestamp, foxglove::Color};

/// A stamp as the messages write it.
pub(crate) fn timestamp(stamp_ns: u64) -> Timestamp {
    let second = 1_000_000_000;
    let seconds = stamp_ns / second;
    // Viewers count seconds in 32 bits.
    if seconds > u64::from(u32::MAX) {
        return Timestamp { seconds: u32::MAX.into(), nanos: 999_999_999 };
    }
    Timestamp { seconds: seconds as i64, nanos: (stamp_ns % second) as i32 }
}

/// Colours that the colour-blind tell apart (Okabe and Ito, 2008), one a target in turn.
pub(super) const PALETTE: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// The colour of target `index`.
pub(super) fn colour(index: usize) -> [u8; 3] {
    PALETTE[index % PALETTE.len()]
}

/// The same as a message.
pub(super) fn colour_message([r, g, b]: [u8; 3]) -> Color {
    let part = |byte: u8| f64::from(byte) / 255.0;
    Color { r: part(r), g: part(g), b: part(b), a: 1.0 }
}
