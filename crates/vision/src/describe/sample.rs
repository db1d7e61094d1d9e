//! Bilinear interpolation of brightness.

/// The bilinear interpolation of `pixels` (rows of `width`) at (u, v).
///
/// The nearest pixel is repeated beyond the border.
#[inline(always)]
pub(crate) fn bilinear(pixels: &[f32], width: usize, u: f32, v: f32) -> f32 {
    let height = pixels.len() / width;
    let (left, right, across) = around(u, width);
    let (above, below, down) = around(v, height);
    let (above, below) = (&pixels[above * width..][..width], &pixels[below * width..][..width]);
    let upper = above[left] + across * (above[right] - above[left]);
    let lower = below[left] + across * (below[right] - below[left]);
    upper + down * (lower - upper)
}

/// The two of `size` pixels around `at`, and the position between them (0 to 1).
#[inline(always)]
fn around(at: f32, size: usize) -> (usize, usize, f32) {
    let at = at.clamp(0.0, (size - 1) as f32);
    let first = at as usize;
    (first, (first + 1).min(size - 1), at - first as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_interpolated_exactly_and_ends_at_the_border() {
        let pixels: Vec<f32> = (0..20).map(|i| (i % 5) as f32 + 10.0 * (i / 5) as f32).collect();
        assert_eq!(bilinear(&pixels, 5, 1.25, 2.5), 26.25);
        assert_eq!(bilinear(&pixels, 5, -3.0, 0.5), 5.0);
        assert_eq!(bilinear(&pixels, 5, 4.0, 3.0), 34.0);
        assert_eq!(bilinear(&pixels, 5, 1e30, 1e30), 34.0);
    }
}
