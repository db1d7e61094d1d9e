//! Extrema of differences of Gaussians among their samples.

use std::{cmp::Ordering, ops::Range};

use multiversion::multiversion;

use crate::scale_space::{INTERVALS, LEVELS, Octave};

/// The number of differences of neighbouring levels.
const DIFFERENCES: usize = LEVELS - 1;
/// The number of samples that are compared side by side.
const LANES: usize = 16;

/// Appends the extrema (level, x, y) of these rows to `found` in row-major order.
///
/// The difference D = level + 1 − level of an extremum exceeds `min` and its 26 neighbours, or is as far below; of
/// equal samples the first counts. `border` columns and rows on each side are skipped. `ring` is scratch for the
/// differences of three rows.
pub(super) fn extrema(
    octave: &Octave,
    rows: Range<usize>,
    border: usize,
    min: f32,
    ring: &mut Vec<f32>,
    found: &mut Vec<[usize; 3]>,
) {
    let width = octave.width();
    let slot = DIFFERENCES * width;
    ring.resize(3 * slot, 0.0);
    for y in rows.start - 1..rows.end + 1 {
        for (level, out) in ring[y % 3 * slot..][..slot].chunks_exact_mut(width).enumerate() {
            let row = |level: usize| &octave.level(level)[y * width..][..width];
            out.iter_mut().zip(row(level + 1)).zip(row(level)).for_each(|((out, a), b)| *out = a - b);
        }
        let Some(here) = y.checked_sub(1).filter(|here| rows.contains(here)) else { continue };
        for level in 1..=INTERVALS {
            let row = |y: usize, level: usize| &ring[y % 3 * slot + level * width..][..width];
            let around = |level: usize| [row(here - 1, level), row(here, level), row(here + 1, level)];
            let [below, same, above] = [around(level - 1), around(level), around(level + 1)];
            in_row(&same, border, min, |x| {
                if beyond([&below, &same, &above], min, x) {
                    found.push([level, x, here]);
                }
            });
        }
    }
}

/// Calls `maybe` for the columns whose value in the middle row is an extremum of its nine.
fn in_row(rows: &[&[f32]; 3], border: usize, min: f32, mut maybe: impl FnMut(usize)) {
    let width = rows[1].len();
    for x in (border..width - border).step_by(LANES) {
        // The last block overlaps the one before.
        let first = x.min((width - border).saturating_sub(LANES));
        if width < LANES + 2 {
            (x..(x + LANES).min(width - border)).for_each(&mut maybe);
            continue;
        }
        let first = first.clamp(1, width - LANES - 1);
        let mut flags = extremal(rows, first, min);
        while flags != 0 {
            let at = first + flags.trailing_zeros() as usize;
            flags &= flags - 1;
            if at >= x && at < width - border {
                maybe(at);
            }
        }
    }
}

/// The bit mask of the samples from `first` on that are extrema among the nine of their level.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn extremal(rows: &[&[f32]; 3], first: usize, min: f32) -> u32 {
    let [above, here, below] = rows.map(|row| &row[first - 1..first + LANES + 1]);
    let (mut max, mut fewest) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let upper = greater(greater(above[i], above[i + 1]), above[i + 2]);
        let lower = greater(greater(below[i], below[i + 1]), below[i + 2]);
        max[i] = greater(greater(upper, lower), greater(here[i], here[i + 2]));
    }
    for i in 0..LANES {
        let upper = less(less(above[i], above[i + 1]), above[i + 2]);
        let lower = less(less(below[i], below[i + 1]), below[i + 2]);
        fewest[i] = less(less(upper, lower), less(here[i], here[i + 2]));
    }
    let mut flags = 0;
    for i in 0..LANES {
        let value = here[i + 1];
        let extremal = (value >= min) & (value >= max[i]) | (value <= -min) & (value <= fewest[i]);
        flags |= u32::from(extremal) << i;
    }
    flags
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Whether a sample exceeds `min` and its 26 neighbours, with either sign, and equals none before it.
fn beyond(levels: [&[&[f32]; 3]; 3], min: f32, x: usize) -> bool {
    let value = levels[1][1][x];
    let sign = if value < 0.0 { -1.0 } else { 1.0 };
    let value = sign * value;
    let neighbours = levels.iter().flat_map(|rows| rows.iter()).flat_map(|row| &row[x - 1..=x + 1]);
    let holds = |(place, &other): (usize, &f32)| match place.cmp(&13) {
        Ordering::Less => sign * other < value,
        Ordering::Equal => true,
        Ordering::Greater => sign * other <= value,
    };
    value >= min && neighbours.enumerate().all(holds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{image::Image, scale_space::ScaleSpace, workspace::Threads};

    #[test]
    fn it_finds_what_comparing_all_neighbours_finds() {
        for (width, height) in [(150, 90), (11, 30), (12, 12), (27, 64), (34, 16)] {
            let value = |i: usize| {
                // Squares of 5 px, a structure that survives the first levels.
                let square = i % width / 5 + 1000 * (i / width / 5);
                let h = (square as u32).wrapping_mul(0x9E37_79B1);
                let h = (h ^ (h >> 15)).wrapping_mul(0x85EB_CA77);
                ((h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35) >> 24) as f32
            };
            let image = Image::new(width, height, (0..width * height).map(value).collect()).unwrap();
            let mut space = ScaleSpace::default();
            space.look_at(&image);
            let octave = space.octave(0, LEVELS - 1, Threads::One);
            let d =
                |[level, x, y]: [usize; 3]| octave.level(level + 1)[y * width + x] - octave.level(level)[y * width + x];
            let extremal = |&[level, x, y]: &[usize; 3]| {
                let here = d([level, x, y]);
                let around = (0..27).filter(|i| *i != 13);
                let others: Vec<f32> =
                    around.map(|i| d([level + i / 9 - 1, x + i % 3 - 1, y + i / 3 % 3 - 1])).collect();
                here >= 0.2 && others.iter().all(|o| *o < here) || here <= -0.2 && others.iter().all(|o| *o > here)
            };
            let rows = 5..height - 5;
            let inner =
                rows.clone().flat_map(|y| (1..=INTERVALS).flat_map(move |l| (5..width - 5).map(move |x| [l, x, y])));
            let expected: Vec<[usize; 3]> = inner.filter(extremal).collect();
            let mut found = Vec::new();
            extrema(octave, rows, 5, 0.2, &mut Vec::new(), &mut found);
            assert_eq!(found, expected, "{width}×{height}");
            assert!(width < 150 || found.len() > 10, "{}", found.len());
        }
    }
}
