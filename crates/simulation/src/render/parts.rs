//! The parts of a row's pixels: facet, position and fraction of the pixel.

use smallvec::SmallVec;

use super::{
    camera::{Line, RenderCamera, RowPose},
    coverage::area,
    facet::{Facet, LANES, Spots},
    outline::Outline,
    visibility::{NONE, SAMPLES, Strip, places},
};

/// Range of a pixel that sees nothing (m).
pub(super) const NOWHERE: f32 = 1e3;

/// One row of the image.
pub(super) struct Row {
    pub(super) number: usize,
    pub(super) in_strip: usize,
    pub(super) pose: Option<RowPose>,
}

impl Row {
    fn line(&self, camera_model: &RenderCamera, column: usize, [du, dv]: [f32; 2]) -> Line {
        let line = camera_model.line(column, self.number, du, dv);
        self.pose.as_ref().map_or(line, |pose| pose.apply(&line))
    }
}

/// Consecutive parts that show the same facet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    pub(super) facet: u32,
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Rays of parts, as a structure of arrays; `z` and `from` stay empty if all rays are (x, y, 1) from the pupil.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) from: [Vec<f32>; 3],
}

/// The samples of a pixel that see one facet: number, sum of their offsets, fraction of the pixel.
#[derive(Debug, Clone, Copy)]
struct Group {
    /// Index of an outline of the facet.
    outline: u32,
    facet: u32,
    count: f32,
    offset: [f32; 2],
    fraction: f64,
}

/// The sides of a facet in a pixel, relative to its centre: a·u + b·v + c ≥ 0 inside, (a, b) of unit length.
type Sides = SmallVec<[[f64; 3]; 4]>;

/// All parts of a row, as a structure of arrays.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) columns: Vec<u32>,
    /// Fraction of the pixel.
    pub(super) fractions: Vec<f32>,
    /// Column position in the row; fractional.
    pub(super) u: Vec<f32>,
    pub(super) lines: Lines,
    pub(super) runs: Vec<Run>,
    /// Column, Z and range at the centre of each pixel that edges cross.
    pub(super) centres: Vec<(u32, f32, f32)>,
    groups: Vec<Group>,
}

impl Lines {
    fn clear(&mut self) {
        let [a, b, c] = &mut self.from;
        [&mut self.x, &mut self.y, &mut self.z, a, b, c].into_iter().for_each(Vec::clear);
    }

    fn push(&mut self, line: &Line, bent: bool) {
        self.x.push(line.along[0]);
        self.y.push(line.along[1]);
        if bent {
            self.z.push(line.along[2]);
            self.from.iter_mut().zip(line.from).for_each(|(list, x)| list.push(x));
        }
    }

    /// Whether each ray has its own direction and origin.
    pub(super) fn bent(&self) -> bool {
        !self.z.is_empty()
    }
}

impl Parts {
    /// Finds the parts of a row of a strip.
    pub(super) fn find(
        &mut self,
        row: &Row,
        strip: &Strip,
        outlines: &[Outline],
        facets: &[Facet],
        camera_model: &RenderCamera,
    ) {
        self.columns.clear();
        self.fractions.clear();
        self.u.clear();
        self.runs.clear();
        self.centres.clear();
        self.lines.clear();
        let offsets = places();
        let (seen, crossed, samples) = strip.row(row.in_strip);
        let bent = row.pose.is_some() || !camera_model.lens.is_straight();
        let mut column = 0;
        for (&next, samples) in crossed.iter().zip(samples) {
            self.full(column..next as usize, seen, row, outlines, camera_model, bent);
            self.crossed(next as usize, seen, samples, &offsets, row, outlines, facets, camera_model, bent);
            column = next as usize + 1;
        }
        self.full(column..seen.len(), seen, row, outlines, camera_model, bent);
        // Vectorised work reads beyond the end.
        let padded = self.columns.len() + LANES;
        let [a, b, c] = &mut self.lines.from;
        for list in [&mut self.lines.x, &mut self.lines.y] {
            list.resize(padded, 0.0);
        }
        if bent {
            for list in [&mut self.lines.z, a, b, c] {
                list.resize(padded, 0.0);
            }
        }
    }

    /// Adds the pixels that no edge crosses.
    fn full(
        &mut self,
        columns: std::ops::Range<usize>,
        seen: &[u32],
        row: &Row,
        outlines: &[Outline],
        camera_model: &RenderCamera,
        bent: bool,
    ) {
        if columns.is_empty() {
            return;
        }
        let first = self.columns.len();
        self.columns.extend(columns.clone().map(|c| c as u32));
        self.u.extend(columns.clone().map(|c| c as f32));
        self.fractions.resize(self.columns.len(), 1.0);
        if bent {
            for column in columns.clone() {
                self.lines.push(&row.line(camera_model, column, [0.0; 2]), true);
            }
        } else {
            let (x, y) = camera_model.straight(row.number);
            self.lines.x.extend_from_slice(&x[columns.clone()]);
            self.lines.y.resize(self.columns.len(), y);
        }
        let (offset, mut from) = (first.wrapping_sub(columns.start), columns.start);
        for run in seen[columns].chunk_by(|a, b| a == b) {
            let to = from + run.len();
            self.run(facet_of(outlines, run[0]), offset.wrapping_add(from), offset.wrapping_add(to));
            from = to;
        }
    }

    /// Adds a pixel that an edge crosses: one part for each facet of its samples.
    #[expect(clippy::too_many_arguments, reason = "an inner step, called in one place")]
    fn crossed(
        &mut self,
        column: usize,
        seen: &[u32],
        samples: &[u32; SAMPLES],
        offsets: &[[f32; SAMPLES]; 2],
        row: &Row,
        outlines: &[Outline],
        facets: &[Facet],
        camera_model: &RenderCamera,
        bent: bool,
    ) {
        let centre = (seen[column] != NONE).then(|| {
            let line = row.line(camera_model, column, [0.0; 2]);
            facets[facet_of(outlines, seen[column]) as usize].spot(&line)
        });
        let (z, range) = centre.unwrap_or((NOWHERE, NOWHERE));
        self.centres.push((column as u32, z, range));
        group(samples, outlines, offsets, &mut self.groups);
        let sides = |group: &Group| {
            if bent {
                facets[group.facet as usize].sides(|at| row.line(camera_model, column, at))
            } else {
                straight(&outlines[group.outline as usize], column, row.number)
            }
        };
        fraction(&mut self.groups, sides, offsets);
        for k in 0..self.groups.len() {
            let Group { facet, count, offset: [du, dv], fraction, .. } = self.groups[k];
            let offset = [du / count, dv / count];
            let here = self.columns.len();
            self.columns.push(column as u32);
            self.u.push(column as f32 + offset[0]);
            self.fractions.push(fraction as f32);
            self.lines.push(&row.line(camera_model, column, offset), bent);
            self.run(facet, here, here + 1);
        }
    }

    fn run(&mut self, facet: u32, from: usize, to: usize) {
        match self.runs.last_mut() {
            Some(last) if last.facet == facet && last.to == from => last.to = to,
            _ => self.runs.push(Run { facet, from, to }),
        }
    }

    /// The surface points of all parts; parts that see nothing lie far away, facing the camera.
    pub(super) fn spots(&self, facets: &[Facet], focal: f32, out: &mut Spots) {
        super::facet::spots(&self.runs, self.columns.len(), facets, &self.lines, 1.0 / focal, out);
    }
}

fn facet_of(outlines: &[Outline], index: u32) -> u32 {
    if index == NONE { NONE } else { outlines[index as usize].facet }
}

/// Groups the samples of a pixel by facet. Triangles of one smooth surface stay separate, because each has its own
/// plane.
fn group(samples: &[u32; SAMPLES], outlines: &[Outline], offsets: &[[f32; SAMPLES]; 2], groups: &mut Vec<Group>) {
    groups.clear();
    let mut here = 0;
    for (k, &outline) in samples.iter().enumerate() {
        if groups.get(here).is_none_or(|g| g.outline != outline) {
            let facet = facet_of(outlines, outline);
            here = groups.iter().position(|g| g.facet == facet).unwrap_or_else(|| {
                groups.push(Group { outline, facet, count: 0.0, offset: [0.0; 2], fraction: 0.0 });
                groups.len() - 1
            });
        }
        let group = &mut groups[here];
        group.count += 1.0;
        group.offset = [group.offset[0] + offsets[0][k], group.offset[1] + offsets[1][k]];
    }
}

/// The sides of an outline relative to a pixel.
fn straight(outline: &Outline, column: usize, row: usize) -> Sides {
    let (u, v) = (column as f64, row as f64);
    outline.sides().iter().map(|side| side.line).map(|[a, b, c]| [a, b, a * u + b * v + c]).collect()
}

/// The pixel fraction of each group.
///
/// A facet that nothing hides in the pixel (all samples inside of it see it) gets the exact area inside its sides;
/// samples alone would give its edges steps. The other facets share the rest by their samples.
fn fraction(groups: &mut [Group], sides: impl Fn(&Group) -> Sides, places: &[[f32; SAMPLES]; 2]) {
    if let [only] = groups {
        only.fraction = 1.0;
        return;
    }
    let (mut free, mut hidden) = (0.0, 0.0);
    for group in &mut *groups {
        let sides = if group.facet == NONE { Sides::new() } else { sides(group) };
        let full = !sides.is_empty() && within(&sides, places) <= group.count;
        group.fraction = if full { area(&sides) } else { -1.0 };
        if full { free += group.fraction } else { hidden += group.count }
    }
    // Slivers without a sample belong to no group; the fractions add up to 1 nevertheless.
    let scale = if free > 1.0 || hidden == 0.0 && free > 0.0 { 1.0 / free } else { 1.0 };
    let left = if hidden > 0.0 { (1.0 - free).max(0.0) / f64::from(hidden) } else { 0.0 };
    for group in groups {
        group.fraction = if group.fraction < 0.0 { left * f64::from(group.count) } else { scale * group.fraction };
    }
}

/// The number of samples inside all sides with a margin, because bent sides are approximated to 1/50 px.
fn within(sides: &Sides, places: &[[f32; SAMPLES]; 2]) -> f32 {
    const BESIDE: f32 = 0.03;
    let mut min = [f32::MAX; SAMPLES];
    for side in sides {
        let [a, b, at] = side.map(|x| x as f32);
        for k in 0..SAMPLES {
            min[k] = min[k].min(at + a * places[0][k] + b * places[1][k]);
        }
    }
    min.iter().map(|x| f32::from(u8::from(*x > BESIDE))).sum()
}
