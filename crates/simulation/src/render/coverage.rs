//! The area of a pixel inside straight sides.

/// Maximum number of corners of a square that four lines have clipped.
const MAX: usize = 8;

/// The area of a pixel inside its sides.
///
/// The pixel is the unit square about the origin. The inside of a side [a, b, c] is a·x + b·y + c ≥ 0; at most four
/// sides are given. The square is clipped by Sutherland and Hodgman (1974), and the shoelace formula gives the area.
pub(super) fn area(sides: &[[f64; 3]]) -> f64 {
    let mut corners = [[0.0; 2]; MAX];
    corners[..4].copy_from_slice(&[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]);
    let mut count = 4;
    for &[a, b, c] in sides {
        // The value at the farthest corner of the square.
        let reach = 0.5 * (a.abs() + b.abs());
        if c >= reach {
            continue;
        }
        if c <= -reach {
            return 0.0;
        }
        let (full, n) = (corners, count);
        count = 0;
        let value = |p: &[f64; 2]| a * p[0] + b * p[1] + c;
        for k in 0..n {
            let (p, q) = (full[k], full[if k + 1 == n { 0 } else { k + 1 }]);
            let (here, there) = (value(&p), value(&q));
            if here >= 0.0 && count < MAX {
                corners[count] = p;
                count += 1;
            }
            if (here >= 0.0) != (there >= 0.0) && count < MAX {
                let t = here / (here - there);
                corners[count] = [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
                count += 1;
            }
        }
    }
    let last = |k: usize| corners[if k + 1 == count { 0 } else { k + 1 }];
    0.5 * (0..count).map(|k| (corners[k], last(k))).map(|(p, q)| p[0] * q[1] - q[0] * p[1]).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_those_of_triangles_and_trapezes() {
        assert_eq!(area(&[]), 1.0);
        assert_eq!(area(&[[1.0, 0.0, 0.6]]), 1.0);
        assert_eq!(area(&[[1.0, 0.0, -0.6]]), 0.0);
        assert!((area(&[[1.0, 0.0, 0.2]]) - 0.7).abs() < 1e-15);
        // A corner cut off: legs of 0.4 and 0.8.
        assert!((area(&[[2.0, 1.0, 0.5 + 1.0 - 0.8]]) - (1.0 - 0.5 * 0.4 * 0.8)).abs() < 1e-15);
        // A triangle inside the pixel, and a strip across it.
        let triangle = [[0.0, 1.0, 0.2], [1.0, -1.0, 0.2], [-1.0, -1.0, 0.2]];
        assert!((area(&triangle) - 0.16).abs() < 1e-15);
        assert!((area(&[[0.6, 0.8, 0.1], [-0.6, -0.8, 0.1]]) - 0.2 / 0.8).abs() < 1e-12);
    }

    #[test]
    fn both_sides_of_a_line_make_the_pixel() {
        for k in 0..500 {
            let (b, a) = libm::sincos(f64::from(k));
            let c = 0.7 * libm::sin(f64::from(k) * 0.37);
            let sum = area(&[[a, b, c]]) + area(&[[-a, -b, -c]]);
            assert!((sum - 1.0).abs() < 1e-14, "{k}: {sum}");
        }
    }
}
