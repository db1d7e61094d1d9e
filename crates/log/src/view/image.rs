//! Images.

use crate::proto::foxglove::CompressedImage;

use super::{names::CAMERAS, values::timestamp};

/// The image of the left (0) or right (1) camera, as PNG.
pub(crate) fn compressed(side: usize, png: Vec<u8>, stamp_ns: u64) -> CompressedImage {
    CompressedImage {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: CAMERAS[side].to_owned(),
        data: png.into(),
        format: "png".to_owned(),
    }
}
