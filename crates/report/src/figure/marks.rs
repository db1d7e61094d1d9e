//! Anti-aliased marks on an image.

use crate::figure::canvas::Canvas;

/// The colour white.
pub(super) const WHITE: [u8; 3] = [255; 3];
/// The colour black.
pub(super) const BLACK: [u8; 3] = [0; 3];
/// A blue that colour-blind readers can distinguish from the other colours.
pub(super) const BLUE: [u8; 3] = [86, 180, 233];
/// An orange that colour-blind readers can distinguish from the other colours.
pub(super) const ORANGE: [u8; 3] = [255, 176, 0];
/// A vermilion that colour-blind readers can distinguish from the other colours.
pub(super) const VERMILION: [u8; 3] = [230, 60, 20];

/// Paints a shape around `centre`, given by its signed distance (px, negative inside) within `reach`.
fn paint(image: &mut Canvas, [u, v]: [f64; 2], reach: f64, colour: [u8; 3], distance: impl Fn(f64, f64) -> f64) {
    let bounds = |at: f64, size: u32| {
        let first = (at - reach - 1.0).floor().clamp(0.0, f64::from(size));
        let last = (at + reach + 2.0).ceil().clamp(0.0, f64::from(size));
        first as u32..last as u32
    };
    for y in bounds(v, image.height) {
        for x in bounds(u, image.width) {
            let cover = (0.5 - distance(f64::from(x) - u, f64::from(y) - v)).clamp(0.0, 1.0);
            let under = image.at(x, y);
            let mix = |i: usize| (f64::from(under[i]) * (1.0 - cover) + f64::from(colour[i]) * cover).round() as u8;
            image.set(x, y, [mix(0), mix(1), mix(2)]);
        }
    }
}

/// Draws a filled circle.
pub(super) fn disc(image: &mut Canvas, centre: [f64; 2], radius: f64, colour: [u8; 3]) {
    paint(image, centre, radius, colour, |x, y| x.hypot(y) - radius);
}

/// Draws a circle with a line width.
pub(super) fn ring(image: &mut Canvas, centre: [f64; 2], radius: f64, width: f64, colour: [u8; 3]) {
    paint(image, centre, radius + width, colour, |x, y| (x.hypot(y) - radius).abs() - width / 2.0);
}

/// Draws a plus sign with arms of length `arm`.
pub(super) fn plus(image: &mut Canvas, centre: [f64; 2], arm: f64, width: f64, colour: [u8; 3]) {
    let bar = |along: f64, across: f64| (along.abs() - arm).max(across.abs() - width / 2.0);
    paint(image, centre, arm, colour, |x, y| bar(x, y).min(bar(y, x)));
}

/// Draws the outline of a rectangle with half sides `a` and `b`.
pub(super) fn frame(image: &mut Canvas, centre: [f64; 2], [a, b]: [f64; 2], width: f64, colour: [u8; 3]) {
    let inside = |x: f64, y: f64| (x.abs() - a).max(y.abs() - b);
    paint(image, centre, a.max(b) + width, colour, |x, y| inside(x, y).abs() - width / 2.0);
}

/// Draws a digit from 0 to 9 of half height `half`, in lines of constant width.
pub(super) fn digit(image: &mut Canvas, centre: [f64; 2], digit: usize, half: f64, colour: [u8; 3]) {
    // The strokes on a grid of 3 × 5 points: x from −1 to 1, y from −2 to 2.
    const LINES: [&[[[f64; 2]; 2]]; 10] = [
        &[
            [[-1.0, -2.0], [1.0, -2.0]],
            [[1.0, -2.0], [1.0, 2.0]],
            [[1.0, 2.0], [-1.0, 2.0]],
            [[-1.0, 2.0], [-1.0, -2.0]],
        ],
        &[[[-0.7, -1.2], [0.2, -2.0]], [[0.2, -2.0], [0.2, 2.0]]],
        &[
            [[-1.0, -1.6], [-0.6, -2.0]],
            [[-0.6, -2.0], [0.8, -2.0]],
            [[0.8, -2.0], [1.0, -0.8]],
            [[1.0, -0.8], [-1.0, 2.0]],
            [[-1.0, 2.0], [1.0, 2.0]],
        ],
        &[[[-1.0, -2.0], [1.0, -2.0]], [[1.0, -2.0], [1.0, 2.0]], [[1.0, 2.0], [-1.0, 2.0]], [[-0.5, 0.0], [1.0, 0.0]]],
        &[[[0.5, 2.0], [0.5, -2.0]], [[0.5, -2.0], [-1.1, 0.8]], [[-1.1, 0.8], [1.1, 0.8]]],
        &[
            [[1.0, -2.0], [-1.0, -2.0]],
            [[-1.0, -2.0], [-1.0, -0.3]],
            [[-1.0, -0.3], [1.0, -0.3]],
            [[1.0, -0.3], [1.0, 2.0]],
            [[1.0, 2.0], [-1.0, 2.0]],
        ],
        &[
            [[0.9, -2.0], [-1.0, 0.0]],
            [[-1.0, 0.0], [-1.0, 2.0]],
            [[-1.0, 2.0], [1.0, 2.0]],
            [[1.0, 2.0], [1.0, 0.0]],
            [[1.0, 0.0], [-1.0, 0.0]],
        ],
        &[[[-1.0, -2.0], [1.0, -2.0]], [[1.0, -2.0], [-0.3, 2.0]]],
        &[
            [[-1.0, -2.0], [1.0, -2.0]],
            [[1.0, -2.0], [1.0, 2.0]],
            [[1.0, 2.0], [-1.0, 2.0]],
            [[-1.0, 2.0], [-1.0, -2.0]],
            [[-1.0, 0.0], [1.0, 0.0]],
        ],
        &[
            [[1.0, 0.0], [-1.0, 0.0]],
            [[-1.0, 0.0], [-1.0, -2.0]],
            [[-1.0, -2.0], [1.0, -2.0]],
            [[1.0, -2.0], [1.0, 0.0]],
            [[1.0, 0.0], [-0.9, 2.0]],
        ],
    ];
    let unit = half / 2.0;
    let near = |x: f64, y: f64, [[ax, ay], [bx, by]]: [[f64; 2]; 2]| {
        let ([ax, ay], [bx, by]) = ([ax * unit, ay * unit], [bx * unit, by * unit]);
        let (dx, dy) = (bx - ax, by - ay);
        let along = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        (x - ax - along * dx).hypot(y - ay - along * dy)
    };
    let lines = LINES[digit % 10];
    let distance = |x: f64, y: f64| lines.iter().map(|line| near(x, y, *line)).fold(f64::INFINITY, f64::min);
    paint(image, centre, half * 1.3, colour, |x, y| distance(x, y) - 0.17 * half);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_stay_in_the_image() {
        let mut image = Canvas::new(8, 8, BLACK);
        for at in [[-20.0, 3.0], [7.9, 7.9], [1e9, -1e9]] {
            disc(&mut image, at, 3.0, WHITE);
            ring(&mut image, at, 3.0, 1.0, BLUE);
            plus(&mut image, at, 3.0, 1.0, ORANGE);
        }
        assert_eq!(image.at(0, 0), BLACK);
        disc(&mut image, [2.0, 2.0], 1.0, WHITE);
        assert_eq!(image.at(2, 2), WHITE);
    }
}
