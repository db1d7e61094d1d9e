//! Marks drawn into an image, with smooth edges.

use image::{Rgb, RgbImage};

/// White.
pub(super) const WHITE: [u8; 3] = [255; 3];
/// Black.
pub(super) const BLACK: [u8; 3] = [0; 3];
/// Blue that the colour-blind tell from the others.
pub(super) const BLUE: [u8; 3] = [86, 180, 233];
/// Orange, likewise.
pub(super) const ORANGE: [u8; 3] = [255, 176, 0];
/// Vermilion, likewise.
pub(super) const VERMILION: [u8; 3] = [230, 60, 20];

/// Fills the pixels within `reach` of `centre` where `distance` (px, negative inside) says so.
fn paint(image: &mut RgbImage, [u, v]: [f64; 2], reach: f64, colour: [u8; 3], distance: impl Fn(f64, f64) -> f64) {
    let bounds = |at: f64, size: u32| {
        let first = (at - reach - 1.0).floor().clamp(0.0, f64::from(size));
        let last = (at + reach + 2.0).ceil().clamp(0.0, f64::from(size));
        first as u32..last as u32
    };
    for y in bounds(v, image.height()) {
        for x in bounds(u, image.width()) {
            let cover = (0.5 - distance(f64::from(x) - u, f64::from(y) - v)).clamp(0.0, 1.0);
            let Rgb(under) = *image.get_pixel(x, y);
            let mix = |i: usize| (f64::from(under[i]) * (1.0 - cover) + f64::from(colour[i]) * cover).round() as u8;
            image.put_pixel(x, y, Rgb([mix(0), mix(1), mix(2)]));
        }
    }
}

/// A filled circle.
pub(super) fn disc(image: &mut RgbImage, centre: [f64; 2], radius: f64, colour: [u8; 3]) {
    paint(image, centre, radius, colour, |x, y| x.hypot(y) - radius);
}

/// A circle of this line width.
pub(super) fn ring(image: &mut RgbImage, centre: [f64; 2], radius: f64, width: f64, colour: [u8; 3]) {
    paint(image, centre, radius + width, colour, |x, y| (x.hypot(y) - radius).abs() - width / 2.0);
}

/// A plus sign with arms of this length.
pub(super) fn plus(image: &mut RgbImage, centre: [f64; 2], arm: f64, width: f64, colour: [u8; 3]) {
    let bar = |along: f64, across: f64| (along.abs() - arm).max(across.abs() - width / 2.0);
    paint(image, centre, arm, colour, |x, y| bar(x, y).min(bar(y, x)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_stay_in_the_image() {
        let mut image = RgbImage::new(8, 8);
        for at in [[-20.0, 3.0], [7.9, 7.9], [1e9, -1e9]] {
            disc(&mut image, at, 3.0, WHITE);
            ring(&mut image, at, 3.0, 1.0, BLUE);
            plus(&mut image, at, 3.0, 1.0, ORANGE);
        }
        assert_eq!(image.get_pixel(0, 0), &Rgb(BLACK));
        disc(&mut image, [2.0, 2.0], 1.0, WHITE);
        assert_eq!(image.get_pixel(2, 2), &Rgb(WHITE));
    }
}
