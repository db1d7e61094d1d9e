//! The visible facets of the pixels in a strip of rows, at centres and samples.

use std::ops::Range;

use super::outline::Outline;

/// Number of samples of a pixel that an edge crosses. The lattice is so even that a straight edge in any direction is
/// measured to about 1/100 of the pixel's area.
pub(super) const SAMPLES: usize = 32;
/// The generator of the lattice, near 32 golden ratios.
const LATTICE: usize = 19;
/// No facet.
pub(super) const NONE: u32 = u32::MAX;

/// Positions of the samples from the pixel's centre.
pub(super) fn places() -> [[f32; SAMPLES]; 2] {
    let coordinate = |i: usize| (i as f32 + 0.5) / SAMPLES as f32 - 0.5;
    [std::array::from_fn(coordinate), std::array::from_fn(|k| coordinate(k * LATTICE % SAMPLES))]
}

/// A strip of rows with its visible facets, as indices of outlines.
#[derive(Debug, Default)]
pub(super) struct Strip {
    width: usize,
    first_row: usize,
    rows: usize,
    depths: Vec<f32>,
    seen: Vec<u32>,
    crossed: Vec<bool>,
    /// Columns of the crossed pixels, row by row.
    columns: Vec<u32>,
    starts: Vec<usize>,
    sample_depths: Vec<[f32; SAMPLES]>,
    samples: Vec<[u32; SAMPLES]>,
}

impl Strip {
    /// Rasterises the outlines listed in `order` on `rows` of an image.
    pub(super) fn draw(&mut self, outlines: &[Outline], order: &[u32], rows: Range<usize>, width: usize) {
        (self.width, self.first_row, self.rows) = (width, rows.start, rows.len());
        let pixels = width * rows.len();
        self.depths.clear();
        self.depths.resize(pixels, 0.0);
        self.seen.clear();
        self.seen.resize(pixels, NONE);
        self.crossed.clear();
        self.crossed.resize(pixels, false);
        for &index in order {
            self.draw_centres(&outlines[index as usize], index);
        }
        self.cross_borders(outlines);
        self.columns.clear();
        self.starts.clear();
        for row in self.crossed.chunks_exact(width) {
            self.starts.push(self.columns.len());
            self.columns.extend((0..).zip(row).filter(|(_, crossed)| **crossed).map(|(column, _)| column));
        }
        self.starts.push(self.columns.len());
        self.sample_depths.clear();
        self.sample_depths.resize(self.columns.len(), [0.0; SAMPLES]);
        self.samples.clear();
        self.samples.resize(self.columns.len(), [NONE; SAMPLES]);
        let places = places();
        for &index in order {
            self.draw_samples(&outlines[index as usize], index, &places);
        }
    }

    /// The rows of the strip that an outline touches, counted in the strip.
    fn touched(&self, outline: &Outline) -> Range<usize> {
        let rows = outline.touched(self.first_row + self.rows);
        rows.start.max(self.first_row) - self.first_row..rows.end.max(self.first_row) - self.first_row
    }

    fn draw_centres(&mut self, outline: &Outline, index: u32) {
        let edged = outline.has_edges();
        for row in self.touched(outline) {
            let v = (self.first_row + row) as f64;
            let start = row * self.width;
            let (first, end) = outline.span(v, 0.0, self.width, false);
            if first < end {
                let base = outline.inverse_depth(first as f64, v) * outline.layer;
                let slope = outline.slope()[0] * outline.layer;
                fill(
                    &mut self.depths[start + first..start + end],
                    &mut self.seen[start + first..start + end],
                    base,
                    slope,
                    index,
                );
            }
            if edged {
                let (outer, outer_end) = outline.span(v, 1.0, self.width, false);
                let (inner, inner_end) = outline.span(v, -1.0, self.width, true);
                let crossed = &mut self.crossed[start..start + self.width];
                if inner >= inner_end {
                    crossed[outer..outer_end].fill(true);
                } else {
                    crossed[outer..inner.clamp(outer, outer_end)].fill(true);
                    crossed[inner_end.clamp(outer, outer_end)..outer_end].fill(true);
                }
            }
        }
    }

    /// Marks the pixels beside a change of facet that is no seam, because bodies that intersect have no edge there.
    fn cross_borders(&mut self, outlines: &[Outline]) {
        let body = |seen: u32| if seen == NONE { NONE } else { outlines[seen as usize].body };
        let width = self.width;
        let Self { seen, crossed, .. } = self;
        for row in 0..self.rows {
            let here = row * width;
            for column in changes(&seen[here..here + width - 1], &seen[here + 1..here + width]) {
                if body(seen[here + column]) != body(seen[here + column + 1]) {
                    crossed[here + column..here + column + 2].fill(true);
                }
            }
            if row + 1 == self.rows {
                continue;
            }
            let (above, below) = seen[here..here + 2 * width].split_at(width);
            for column in changes(above, below) {
                if body(above[column]) != body(below[column]) {
                    (crossed[here + column], crossed[here + width + column]) = (true, true);
                }
            }
        }
    }

    /// The facets at a row's centres, the columns that edges cross, and the facets of their samples.
    pub(super) fn row(&self, row: usize) -> (&[u32], &[u32], &[[u32; SAMPLES]]) {
        let slots = self.starts[row]..self.starts[row + 1];
        (&self.seen[row * self.width..][..self.width], &self.columns[slots.clone()], &self.samples[slots])
    }

    fn draw_samples(&mut self, outline: &Outline, index: u32, places: &[[f32; SAMPLES]; 2]) {
        for row in self.touched(outline) {
            let columns = &self.columns[self.starts[row]..self.starts[row + 1]];
            if columns.is_empty() {
                continue;
            }
            let v = (self.first_row + row) as f64;
            let (outer, outer_end) = outline.span(v, 1.0, self.width, false);
            let from = columns.partition_point(|&c| (c as usize) < outer);
            let to = columns.partition_point(|&c| (c as usize) < outer_end);
            if from >= to {
                continue;
            }
            let (inner, inner_end) = outline.span(v, -1.0, self.width, false);
            for (k, &column) in columns.iter().enumerate().take(to).skip(from) {
                let u = f64::from(column);
                let slot = self.starts[row] + k;
                let full = (inner..inner_end).contains(&(column as usize));
                let sides = if full { &[] } else { outline.sides() };
                let lines = sides.iter().map(|side| {
                    let [a, b, c] = side.line;
                    [(a * u + b * v + c) as f32, a as f32, b as f32]
                });
                let mut three = [[0.0; 3]; 4];
                three.iter_mut().zip(lines).for_each(|(kept, line)| *kept = line);
                let plane = [outline.inverse_depth(u, v), outline.slope()[0], outline.slope()[1]];
                let plane = plane.map(|x| (x * outline.layer) as f32);
                let (depths, samples) = (&mut self.sample_depths[slot], &mut self.samples[slot]);
                sample(&three[..sides.len()], &plane, places, index, depths, samples);
            }
        }
    }
}

/// Assigns the samples of a pixel inside all sides to an outline where it is nearer (1/Z) than the present facet. A
/// line or plane is given by its value at the pixel's centre and its steps.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn sample(
    sides: &[[f32; 3]],
    plane: &[f32; 3],
    places: &[[f32; SAMPLES]; 2],
    index: u32,
    depths: &mut [f32; SAMPLES],
    samples: &mut [u32; SAMPLES],
) {
    let mut inside = [0.0_f32; SAMPLES];
    for [at, a, b] in sides {
        for k in 0..SAMPLES {
            inside[k] = inside[k].min(at + a * places[0][k] + b * places[1][k]);
        }
    }
    for k in 0..SAMPLES {
        let depth = plane[0] + plane[1] * places[0][k] + plane[2] * places[1][k];
        let nearer = (inside[k] >= 0.0) & (depth > depths[k]);
        depths[k] = if nearer { depth } else { depths[k] };
        samples[k] = if nearer { index } else { samples[k] };
    }
}

/// The indices at which two rows differ.
pub(crate) fn changes<'a>(a: &'a [u32], b: &'a [u32]) -> impl Iterator<Item = usize> + 'a {
    const PIECE: usize = 16;
    // Changes are rare, so whole blocks are compared first.
    let pieces = a.chunks(PIECE).zip(b.chunks(PIECE)).enumerate().filter(|(_, (a, b))| a != b);
    pieces.flat_map(|(k, (a, b))| (0..a.len()).filter(move |&i| a[i] != b[i]).map(move |i| k * PIECE + i))
}

/// Overwrites the depths (1/Z) that are farther than the outline's.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn fill(depths: &mut [f32], seen: &mut [u32], base: f64, slope: f64, index: u32) {
    let (base, slope) = (base as f32, slope as f32);
    for (x, (depth, seen)) in depths.iter_mut().zip(seen).enumerate() {
        let here = base + slope * x as i32 as f32;
        let nearer = here > *depth;
        *depth = if nearer { here } else { *depth };
        *seen = if nearer { index } else { *seen };
    }
}
