//! The lines of many pairs that lie on one line in space.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};
use seafix_geometry::{Object, Point, across};
use seafix_referencing::SpaceLine;

use super::{edge_view::View, find::GATE};

/// The lines of one edge, and the offsets of its ends that they measure.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// Two places on the line, object frame.
    ends: [Vector3<f64>; 2],
    /// Unit vectors across the line, along which each end is displaced.
    axes: [Vector3<f64>; 2],
    /// The covariance (m²) of the displacements before this pass; `None` in the first one.
    known: Option<Matrix4<f64>>,
    /// The part of the line that earlier pairs showed, as fractions between the ends.
    extent: [f64; 2],
    information: Matrix4<f64>,
    gradient: Vector4<f64>,
    /// The sum of the squared residuals.
    squares: f64,
    /// For each line its pair, its part of the edge, and its depth (m).
    lines: Vec<(usize, [f64; 2], f64)>,
}

/// An edge by least squares.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    /// The ends, object frame.
    pub(super) ends: [Vector3<f64>; 2],
    axes: [Vector3<f64>; 2],
    /// The standard deviation (m) of an end across the edge, from the noise of the lines.
    pub(super) sigma: f64,
    /// χ² of the lines per degree of freedom.
    pub(super) scatter: f64,
    /// The covariance (m²) of the ends across the edge.
    covariance: Matrix4<f64>,
    /// The pairs that show most of the edge.
    pub(super) pairs: Vec<usize>,
    /// The mean depth (m).
    pub(super) depth: f64,
}

/// A line of a view beside a track.
struct Compared {
    /// The offsets of the line's ends from the track.
    residual: Vector4<f64>,
    /// Their derivative by the displacements of the track's ends.
    design: Matrix4<f64>,
    /// The part of the track that the line covers.
    part: [f64; 2],
    /// The depth (m).
    depth: f64,
    /// χ² + ln det of the residuals' covariance: minus twice the log-likelihood, up to a constant.
    cost: f64,
}

/// The minimum overlap of a line and a track, as a fraction of the shorter one.
const OVERLAP: f64 = 0.25;
/// The minimum fraction of an edge that the lines of a pair cover.
const COVERED: f64 = 0.6;
/// The fraction of the pairs that show an edge beyond each of its ends.
const REACH: f64 = 0.25;

/// Adds each line of a view to the track of the highest likelihood. A line without a track begins one if `begins` accepts
/// its ends.
///
/// `slack` is the distance (rad) of a line from its edge beyond the noise.
pub(super) fn follow(tracks: &mut Vec<Track>, view: &View, slack: f64, begins: impl Fn(&[Vector3<f64>; 2]) -> bool) {
    let mut added = Vec::new();
    let mut begun = Vec::new();
    for (line, depth) in &view.lines {
        let compared = tracks.iter().enumerate().filter_map(|(k, track)| Some((k, track.compared(view, line, slack)?)));
        match compared.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) {
            Some((track, compared)) => added.push((track, line, compared)),
            None => {
                let ends = view.ends(line);
                if *depth && begins(&ends) {
                    begun.push((ends, line));
                }
            }
        }
    }
    added.into_iter().for_each(|(track, line, compared)| tracks[track].add(view.pair, line, &compared));
    for (ends, line) in begun {
        let mut track = Track::on(ends, None);
        if let Some(compared) = track.offsets(view, line) {
            track.add(view.pair, line, &compared);
            tracks.push(track);
        }
    }
}

impl Track {
    /// A track of the line through `ends`; `known` is the covariance of their displacements, if it is known.
    fn on(ends: [Vector3<f64>; 2], known: Option<Matrix4<f64>>) -> Self {
        let axes = across(&(ends[1] - ends[0]).normalize());
        let (information, gradient) = (Matrix4::zeros(), Vector4::zeros());
        Self { ends, axes, known, extent: [0.0, 1.0], information, gradient, squares: 0.0, lines: Vec::new() }
    }

    /// The number of pairs with a line.
    pub(super) fn pairs(&self) -> usize {
        let mut pairs: Vec<usize> = self.lines.iter().map(|line| line.0).collect();
        pairs.dedup();
        pairs.len()
    }

    /// The displacements of the ends and their covariance.
    fn displacements(&self) -> Option<(Vector4<f64>, Matrix4<f64>)> {
        let covariance = self.information.cholesky()?.inverse();
        Some((covariance * self.gradient, covariance))
    }

    /// The offsets of a line of a view from the track.
    fn offsets(&self, view: &View, line: &SpaceLine) -> Option<Compared> {
        let [from, to] = self.ends.map(|end| (view.camera_from_object * Point::<Object>::from(end)).coords);
        let axes = self.axes.map(|axis| view.camera_from_object.rotation_matrix() * axis);
        let offsets = line.rows(&from, &to)?;
        let design = SMatrix::from_fn(|row, column| {
            let along = offsets[row].along;
            let weight = if column < 2 { 1.0 - along } else { along };
            weight * offsets[row].gradient.dot(&axes[column % 2])
        });
        let depth = offsets.each_ref().map(|offset| offset.at.z).iter().sum::<f64>() / 4.0;
        let part = [offsets[0].along, offsets[2].along];
        let part = [part[0].min(part[1]), part[0].max(part[1])];
        Some(Compared {
            residual: offsets.each_ref().map(|offset| offset.residual).into(),
            design,
            part,
            depth,
            cost: 0.0,
        })
    }

    /// The same, if the line may be one of the track.
    fn compared(&self, view: &View, line: &SpaceLine, slack: f64) -> Option<Compared> {
        let compared = self.offsets(view, line)?;
        let [low, high] = [compared.part[0].max(self.extent[0]), compared.part[1].min(self.extent[1])];
        let shorter = (compared.part[1] - compared.part[0]).min(self.extent[1] - self.extent[0]);
        if high - low < OVERLAP * shorter {
            return None;
        }
        let (at, covariance) = match self.known {
            Some(known) => (Vector4::zeros(), known),
            None => self.displacements()?,
        };
        let design = &compared.design;
        let residual = compared.residual - design * at;
        let slack = Matrix4::identity() * (slack * compared.depth).powi(2);
        let root = (line.noise + design * covariance * design.transpose() + slack).cholesky()?;
        let chi2 = residual.dot(&root.solve(&residual));
        let volume: f64 = root.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln()).sum();
        (chi2 <= GATE).then_some(Compared { cost: chi2 + volume, ..compared })
    }

    fn add(&mut self, pair: usize, line: &SpaceLine, compared: &Compared) {
        let Some(weight) = line.noise.cholesky().map(|root| root.inverse()) else { return };
        let Compared { residual, design, part, depth, .. } = compared;
        self.information += design.transpose() * weight * design;
        self.gradient += design.transpose() * weight * residual;
        self.squares += residual.dot(&(weight * residual));
        self.extent = [self.extent[0].min(part[0]), self.extent[1].max(part[1])];
        self.lines.push((pair, *part, *depth));
    }

    /// The edge of all lines; `None` without a solution.
    pub(super) fn fitted(&self) -> Option<Fitted> {
        let (displaced, covariance) = self.displacements()?;
        let mut parts: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
        self.lines.iter().for_each(|(pair, part, _)| parts.entry(*pair).or_default().push(*part));
        let bound = |pick: fn(&[f64; 2]) -> f64| {
            let mut all: Vec<f64> =
                parts.values().map(|parts| parts.iter().map(pick).fold(f64::INFINITY, f64::min)).collect();
            all.sort_by(f64::total_cmp);
            all[((REACH * all.len() as f64) as usize).max(2).min(all.len() - 1)]
        };
        let extent = [bound(|part| part[0]), -bound(|part| -part[1])];
        let shows = |parts: &Vec<[f64; 2]>| covered(parts, extent) >= COVERED * (extent[1] - extent[0]);
        let pairs = parts.iter().filter(|(_, parts)| shows(parts)).map(|(pair, _)| *pair).collect();
        // What the scene adds to the lines of a pair shows in their scatter.
        let freedom = 4.0 * self.lines.len() as f64 - 4.0;
        let scatter = (self.squares - self.gradient.dot(&displaced)) / freedom.max(1.0);
        let at = |t: f64| {
            SMatrix::<f64, 2, 4>::from_fn(|i, j| {
                if i == j {
                    1.0 - t
                } else if i + 2 == j {
                    t
                } else {
                    0.0
                }
            })
        };
        let mut ends = Matrix4::zeros();
        ends.fixed_rows_mut::<2>(0).copy_from(&at(extent[0]));
        ends.fixed_rows_mut::<2>(2).copy_from(&at(extent[1]));
        let covariance = ends * covariance * ends.transpose() * scatter.max(1.0);
        let moved = ends * displaced;
        let place = |k: usize| {
            let along = self.ends[0] + (self.ends[1] - self.ends[0]) * extent[k];
            along + self.axes[0] * moved[2 * k] + self.axes[1] * moved[2 * k + 1]
        };
        let depth = self.lines.iter().map(|line| line.2).sum::<f64>() / self.lines.len() as f64;
        let sigma = (covariance.trace() / 4.0).sqrt();
        Some(Fitted { ends: [place(0), place(1)], axes: self.axes, scatter, sigma, covariance, pairs, depth })
    }
}

impl Fitted {
    /// A track of this edge without lines.
    fn restarted(&self) -> Track {
        Track { axes: self.axes, ..Track::on(self.ends, Some(self.covariance)) }
    }

    /// The part of this edge beside another one on the same line; `None` on another line.
    pub(super) fn part_on(&self, other: &Self, slack: f64) -> Option<[f64; 2]> {
        let direction = other.ends[1] - other.ends[0];
        let parts = self.ends.map(|end| direction.dot(&(end - other.ends[0])) / direction.norm_squared());
        let mut residual = Vector4::zeros();
        let mut design = Matrix4::zeros();
        for (k, t) in parts.iter().enumerate() {
            let off = self.ends[k] - (other.ends[0] + direction * *t);
            for axis in 0..2 {
                residual[2 * k + axis] = other.axes[axis].dot(&off);
                design[(2 * k + axis, axis)] = 1.0 - t;
                design[(2 * k + axis, axis + 2)] = *t;
            }
        }
        let turn = SMatrix::<f64, 2, 2>::from_fn(|i, j| other.axes[i].dot(&self.axes[j]));
        let mut own = Matrix4::zeros();
        for (row, column) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
            let block = turn * self.covariance.fixed_view::<2, 2>(row, column) * turn.transpose();
            own.fixed_view_mut::<2, 2>(row, column).copy_from(&block);
        }
        let slack = Matrix4::identity() * (slack * other.depth).powi(2);
        let root = (own + design * other.covariance * design.transpose() + slack).cholesky()?;
        let [low, high] = [parts[0].min(parts[1]), parts[0].max(parts[1])];
        let overlaps = high.min(1.0) - low.max(0.0) >= OVERLAP * (high - low).min(1.0);
        (overlaps && residual.dot(&root.solve(&residual)) <= GATE).then_some([low, high])
    }
}

/// The tracks of distinct edges, without lines: parts of an edge belong to the one that most pairs show.
pub(super) fn distinct(mut edges: Vec<Fitted>, slack: f64) -> Vec<Track> {
    edges.sort_by_key(|edge| std::cmp::Reverse(edge.pairs.len()));
    let mut kept: Vec<(Fitted, Track)> = Vec::new();
    for edge in edges {
        let same = kept.iter_mut().find_map(|(other, track)| Some((track, edge.part_on(other, slack)?)));
        match same {
            Some((track, part)) => track.extent = [track.extent[0].min(part[0]), track.extent[1].max(part[1])],
            None => kept.push((edge.clone(), edge.restarted())),
        }
    }
    kept.into_iter().map(|(_, track)| track).collect()
}

/// The length of the union of intervals within `extent`.
fn covered(parts: &[[f64; 2]], extent: [f64; 2]) -> f64 {
    let mut parts: Vec<[f64; 2]> = parts.to_vec();
    parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut sum, mut end) = (0.0, extent[0]);
    for [from, to] in parts {
        sum += (to.min(extent[1]) - from.max(end)).max(0.0);
        end = to.max(end);
    }
    sum
}
