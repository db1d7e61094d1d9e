//! Maxima of a response over an image, with subpixel positions.

use multiversion::multiversion;
use seafix_geometry::Pixel;

use crate::{keypoint::Keypoint, workspace::Threads};

/// The criteria of a maximum.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peaks {
    /// The minimum response.
    pub(super) min: f32,
    /// The radius of non-maximum suppression (px).
    pub(super) radius: usize,
}

/// The working memory of a search.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    bands: Vec<Band>,
    disc: Disc,
}

#[derive(Debug, Default)]
struct Band {
    marks: Vec<u8>,
    found: Vec<Keypoint>,
}

/// The half-widths of a disc's rows, from the middle row outwards (px).
#[derive(Debug, Default)]
pub(super) struct Disc(Vec<usize>);

impl Disc {
    pub(super) fn set(&mut self, radius: usize) {
        self.0.clear();
        self.0.extend((0..=radius).map(|dy| (radius * radius - dy * dy).isqrt()));
    }
}

impl Peaks {
    /// Replaces `found` by the maxima in row-major order: positive pixels of at least `min` that none within the radius
    /// exceeds.
    ///
    /// The first of equal pixels within the radius counts. Border pixels are never maxima.
    pub(super) fn find(
        &self,
        response: &[f32],
        width: usize,
        threads: Threads,
        scratch: &mut Scratch,
        found: &mut Vec<Keypoint>,
    ) {
        let height = response.len() / width;
        found.clear();
        if width < 3 || height < 3 {
            return;
        }
        let Scratch { bands, disc } = scratch;
        disc.set(self.radius.min(width.max(height)));
        let rows = threads.rows_a_band(height - 2);
        let count = (height - 2).div_ceil(rows);
        bands.resize_with(count.max(bands.len()), Band::default);
        threads.pieces(&mut bands[..count], 1, &mut Vec::<()>::new(), |index, band, ()| {
            let Band { marks, found } = &mut band[0];
            found.clear();
            let rows = 1 + index * rows..(1 + (index + 1) * rows).min(height - 1);
            in_rows(response, width, rows, self.min, disc, marks, |x, y| {
                let at = Pixel { u: x as f64, v: y as f64 };
                found.push(Keypoint { at, response: response[y * width + x], scale: 0.0 });
            });
        });
        bands[..count].iter().for_each(|band| found.extend_from_slice(&band.found));
    }
}

/// Calls `visit` with x and y of each maximum in some rows, neither the first nor the last.
///
/// The disc may extend beyond the available rows only at the border of the image.
pub(super) fn in_rows(
    response: &[f32],
    width: usize,
    rows: std::ops::Range<usize>,
    min: f32,
    disc: &Disc,
    marks: &mut Vec<u8>,
    mut visit: impl FnMut(usize, usize),
) {
    marks.clear();
    marks.resize(width, 0);
    let min = min.max(f32::from_bits(1));
    for y in rows {
        let row = |y: usize| &response[y * width..][..width];
        mark(row(y - 1), row(y), row(y + 1), min, &mut marks[1..width - 1]);
        each(marks, |x| {
            if is_greatest(response, width, [x, y], &disc.0) {
                visit(x, y);
            }
        });
    }
}

/// Marks the inner pixels of a row that are at least `min` and the largest of their nine; of equals the first.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn mark(above: &[f32], here: &[f32], below: &[f32], min: f32, marks: &mut [u8]) {
    mark_in_any_lanes(above, here, below, min, marks);
}

#[inline(always)]
fn mark_in_any_lanes(above: &[f32], here: &[f32], below: &[f32], min: f32, marks: &mut [u8]) {
    let n = marks.len();
    let [a0, a1, a2] = [&above[..n], &above[1..=n], &above[2..n + 2]];
    let [h0, h1, h2] = [&here[..n], &here[1..=n], &here[2..n + 2]];
    let [b0, b1, b2] = [&below[..n], &below[1..=n], &below[2..n + 2]];
    // A single instruction, unlike f32::max.
    let max = |a: f32, b: f32| if a > b { a } else { b };
    for x in 0..n {
        let r = h1[x];
        let before = max(max(a0[x], a1[x]), max(a2[x], h0[x]));
        let after = max(max(b0[x], b1[x]), max(b2[x], h2[x]));
        marks[x] = u8::from((r >= min) & (r > before) & (r >= after));
    }
}

/// Calls `visit` with the index of each byte that is 1; the others are 0.
fn each(marks: &[u8], mut visit: impl FnMut(usize)) {
    let (words, rest) = marks.as_chunks::<8>();
    for (index, word) in words.iter().enumerate() {
        let mut bits = u64::from_le_bytes(*word);
        while bits != 0 {
            visit(8 * index + bits.trailing_zeros() as usize / 8);
            bits &= bits - 1;
        }
    }
    let done = 8 * words.len();
    rest.iter().enumerate().filter(|(_, mark)| **mark != 0).for_each(|(index, _)| visit(done + index));
}

/// Whether no pixel of the disc around (x, y) exceeds it, and no earlier one equals it.
fn is_greatest(response: &[f32], width: usize, [x, y]: [usize; 2], chords: &[usize]) -> bool {
    let height = response.len() / width;
    let r = response[y * width + x];
    let row = |y: usize, chord: usize| {
        let row = &response[y * width..][..width];
        (&row[x.saturating_sub(chord)..x], &row[x..(x + chord + 1).min(width)])
    };
    let below = |others: &[f32]| others.iter().all(|&other| other < r);
    let no_larger = |others: &[f32]| others.iter().all(|&other| other <= r);
    // The nearest rows first: they most probably hold a larger value.
    chords.iter().enumerate().all(|(dy, &chord)| {
        if dy == 0 {
            let (left, right) = row(y, chord);
            return below(left) && no_larger(right);
        }
        let up = y.checked_sub(dy).map(|y| row(y, chord));
        let down = Some(y + dy).filter(|&y| y < height).map(|y| row(y, chord));
        up.is_none_or(|(left, right)| below(left) && below(right))
            && down.is_none_or(|(left, right)| no_larger(left) && no_larger(right))
    })
}

/// The vertex of the quadratic through nine values in row-major order, relative to the middle pixel (px).
///
/// It is Newton's step −H⁻¹ g with derivatives by central differences, at most a pixel long; zero if the nine have no
/// maximum.
pub(crate) fn vertex(nine: [[f32; 3]; 3]) -> [f64; 2] {
    let [[nw, n, ne], [w, centre, e], [sw, s, se]] = nine.map(|row| row.map(f64::from));
    let gx = 0.5 * (e - w);
    let gy = 0.5 * (s - n);
    let xx = e + w - 2.0 * centre;
    let yy = s + n - 2.0 * centre;
    let xy = 0.25 * ((se + nw) - (ne + sw));
    let determinant = xx * yy - xy * xy;
    if determinant > 0.0 && xx < 0.0 {
        let dx = (xy * gy - yy * gx) / determinant;
        let dy = (xy * gx - xx * gy) / determinant;
        if dx.abs() <= 1.0 && dy.abs() <= 1.0 {
            return [dx, dy];
        }
    }
    [0.0, 0.0]
}

/// The offset from an inner pixel to its vertex.
pub(super) fn to_vertex(response: &[f32], width: usize, [x, y]: [usize; 2]) -> [f64; 2] {
    let row = |y: usize| std::array::from_fn(|i| response[y * width + x - 1 + i]);
    vertex([row(y - 1), row(y), row(y + 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maxima(response: &[f32], width: usize, min: f32, radius: usize, threads: Threads) -> Vec<Keypoint> {
        let mut found = Vec::new();
        Peaks { min, radius }.find(response, width, threads, &mut Scratch::default(), &mut found);
        found
    }

    /// Plateaus and noise with a fixed seed.
    fn random_values(n: usize, levels: u32) -> Vec<f32> {
        let hash = |i: usize| {
            let h = (i as u32).wrapping_mul(0x9E37_79B1);
            (h ^ (h >> 15)).wrapping_mul(0x85EB_CA77) >> 8
        };
        (0..n).map(|i| (hash(i) % levels) as f32 - 3.0).collect()
    }

    #[test]
    fn a_quadratic_has_its_vertex_where_it_is() {
        // 10 − 2 (x − 2.3)² − (y − 1.8)² − (x − 2.3)(y − 1.8) on 5×4 pixels.
        let value = |i: usize| {
            let (x, y) = ((i % 5) as f32 - 2.3, (i / 5) as f32 - 1.8);
            10.0 - 2.0 * x * x - y * y - x * y
        };
        let response: Vec<f32> = (0..20).map(value).collect();
        let mut found = maxima(&response, 5, 0.0, 2, Threads::One);
        assert_eq!(found.len(), 1);
        let Pixel { u, v } = found.remove(0).at;
        let [dx, dy] = to_vertex(&response, 5, [u as usize, v as usize]);
        assert!((u + dx - 2.3).abs() < 1e-5 && (v + dy - 1.8).abs() < 1e-5, "{u} + {dx}, {v} + {dy}");
    }

    #[test]
    fn of_equal_neighbours_the_first_counts() {
        let mut response = vec![0.0; 36];
        for i in [14, 15, 20, 21] {
            response[i] = 4.0;
        }
        let found = maxima(&response, 6, 0.0, 3, Threads::One);
        assert_eq!(found, [Keypoint { at: Pixel { u: 2.0, v: 2.0 }, response: 4.0, scale: 0.0 }]);
    }

    #[test]
    fn they_are_those_that_the_definition_names() {
        for (width, height, radius, levels) in
            [(67, 41, 4, 1000), (50, 33, 1, 9), (40, 40, 7, 30), (3, 3, 2, 50), (90, 5, 0, 5)]
        {
            let response = random_values(width * height, levels);
            let greatest = |x: usize, y: usize| {
                let r = response[y * width + x];
                let mut others = (0..width * height).map(|i| (i % width, i / width));
                others.all(|(ox, oy)| {
                    let (dx, dy) = (ox.abs_diff(x), oy.abs_diff(y));
                    let near = dx * dx + dy * dy <= radius * radius || dx.max(dy) <= 1;
                    let other = response[oy * width + ox];
                    !near || if (oy, ox) < (y, x) { other < r } else { other <= r }
                })
            };
            let inner = (0..width * height).map(|i| (i % width, i / width));
            let expected: Vec<_> = inner
                .filter(|&(x, y)| x > 0 && y > 0 && x < width - 1 && y < height - 1)
                .filter(|&(x, y)| response[y * width + x] >= 2.0 && greatest(x, y))
                .map(|(x, y)| Pixel { u: x as f64, v: y as f64 })
                .collect();
            for threads in [Threads::One, Threads::Pool] {
                let found = maxima(&response, width, 2.0, radius, threads);
                assert_eq!(found.iter().map(|point| point.at).collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn every_instruction_set_marks_the_same() {
        let rows = random_values(3 * 133, 20);
        let (mut any, mut plain) = (vec![0; 131], vec![0; 131]);
        let [above, here, below] = [0, 1, 2].map(|y| &rows[133 * y..][..133]);
        mark(above, here, below, 1.0, &mut any);
        mark_in_any_lanes(above, here, below, 1.0, &mut plain);
        assert_eq!(any, plain);
    }
}
