//! Pixels of a `sensor_msgs/Image`.

use super::{bayer::Mosaic, messages::Image};

impl Image<'_> {
    /// The samples row by row, grey or RGB, and the maximum of a sample; images of 16 bits have `bits` significant
    /// bits.
    pub(crate) fn samples(&self, bits: u8) -> Result<(Vec<u16>, u16), String> {
        // The bytes of a sample, the samples of a pixel, and the indices of red, green and blue.
        let (bytes, channels, colours): (usize, usize, &[usize]) = match self.encoding.as_str() {
            "mono8" | "8UC1" => (1, 1, &[0]),
            "mono16" | "16UC1" => (2, 1, &[0]),
            "rgb8" => (1, 3, &[0, 1, 2]),
            "bgr8" | "8UC3" => (1, 3, &[2, 1, 0]),
            "rgba8" => (1, 4, &[0, 1, 2]),
            "bgra8" | "8UC4" => (1, 4, &[2, 1, 0]),
            "rgb16" => (2, 3, &[0, 1, 2]),
            "bgr16" | "16UC3" => (2, 3, &[2, 1, 0]),
            "rgba16" => (2, 4, &[0, 1, 2]),
            "bgra16" | "16UC4" => (2, 4, &[2, 1, 0]),
            // Luma and chroma alternate: the luma is the grey image.
            "yuv422_yuy2" | "yuyv" => (1, 2, &[0]),
            "yuv422" | "uyvy" => (1, 2, &[1]),
            // The luma of all pixels stands before the chroma.
            "nv12" | "nv21" | "nv24" => (1, 1, &[0]),
            other => match Mosaic::of(other) {
                Some(_) if other.ends_with("16") => (2, 1, &[0]),
                Some(_) => (1, 1, &[0]),
                None => {
                    let read =
                        "mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, bayer_*, yuv422, yuv422_yuy2, nv12";
                    let remedy = "republish the recording with image_proc or `cv_bridge` as mono8";
                    return Err(format!("the pixel format `{other}` is not supported; give {read}, or {remedy}"));
                }
            },
        };
        let [width, height] = self.size.map(|length| length as usize);
        let (row, step) = (width * channels * bytes, self.step as usize);
        let rows = match self.encoding.as_str() {
            "nv12" | "nv21" => height + height / 2,
            "nv24" => 3 * height,
            _ => height,
        };
        if width == 0 || height == 0 || step < row || self.data.len() != step.saturating_mul(rows) {
            let held = self.data.len();
            return Err(format!("an image of {width}×{height}, rows of {row} bytes {step} apart, in {held} bytes"));
        }
        let sample = |at: &[u8]| match (bytes, self.is_bigendian) {
            (1, _) => u16::from(at[0]),
            (_, true) => u16::from_be_bytes([at[0], at[1]]),
            (_, false) => u16::from_le_bytes([at[0], at[1]]),
        };
        let samples = self.data.chunks_exact(step).take(height).flat_map(|line| {
            let pixels = line[..row].chunks_exact(channels * bytes);
            pixels.flat_map(|pixel| colours.iter().map(|&colour| sample(&pixel[colour * bytes..])))
        });
        let white = if bytes == 1 { 255 } else { ((1_u32 << bits.min(16)) - 1) as u16 };
        Ok((samples.collect(), white))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(encoding: &str, size: [u32; 2], step: u32, data: &[u8]) -> Result<(Vec<u16>, u16), String> {
        Image { size, encoding: encoding.to_owned(), is_bigendian: encoding == "mono16", step, data }.samples(16)
    }

    #[test]
    fn rows_may_be_filled_up_and_colours_in_any_order() {
        assert_eq!(samples("mono8", [2, 2], 3, &[1, 2, 0, 3, 4, 0]), Ok((vec![1, 2, 3, 4], 255)));
        assert_eq!(samples("bgra8", [1, 1], 4, &[1, 2, 3, 9]), Ok((vec![3, 2, 1], 255)));
        assert_eq!(samples("mono16", [1, 1], 2, &[1, 2]), Ok((vec![258], 65535)));
        assert_eq!(samples("16UC1", [1, 1], 2, &[1, 2]), Ok((vec![513], 65535)));
        assert_eq!(samples("rgb16", [1, 1], 6, &[1, 0, 2, 0, 3, 0]), Ok((vec![1, 2, 3], 65535)));
        assert_eq!(samples("yuv422_yuy2", [2, 1], 4, &[7, 128, 9, 128]), Ok((vec![7, 9], 255)));
        assert_eq!(samples("yuv422", [2, 1], 4, &[128, 7, 128, 9]), Ok((vec![7, 9], 255)));
        assert_eq!(samples("nv12", [2, 2], 2, &[1, 2, 3, 4, 128, 128]), Ok((vec![1, 2, 3, 4], 255)));
        assert_eq!(samples("bayer_gbrg16", [2, 1], 4, &[1, 0, 2, 0]), Ok((vec![1, 2], 65535)));
    }

    #[test]
    fn what_does_not_fit_is_named() {
        assert!(samples("32FC1", [1, 1], 4, &[1; 4]).unwrap_err().contains("`32FC1` is not supported; give mono8"));
        assert!(samples("mono8", [2, 2], 2, &[1, 2, 3]).unwrap_err().contains("in 3 bytes"));
        assert!(samples("rgb8", [2, 1], 2, &[1, 2]).unwrap_err().contains("rows of 6 bytes 2 apart"));
    }
}
