//! The likelihood terms of edges.

use std::collections::BTreeSet;

use nalgebra::{Matrix2, Matrix4, Matrix6, SMatrix, Vector2, Vector3, Vector4};
use seafix_geometry::MeasuredLine;

use super::{
    fractions::fractions,
    gaussian::{HALF_LN_2PI, half_ln_det},
    motion::Motion,
    prior_terms::{PriorTerms, spread},
};
use crate::{
    edge_candidates::OVERLAP,
    problem::{Correspondence, Problem},
    site::{edge::ModelEdge, model::ModelPoint},
    space_line::{LineOffset, SpaceLine},
};

/// Gate of a pair about its place under the pose (χ²₄).
pub(super) const FAR: f64 = 28.0;
/// Gate (χ²₄) of the area about a predicted edge in which lines are counted.
const COUNTED: f64 = 13.28;

pub(in crate::search) type Rows6 = SMatrix<f64, 4, 6>;

/// A candidate pair of a model edge and a measured line.
pub(in crate::search) struct EdgeVertex {
    pub(in crate::search) pair: Correspondence,
    /// The ends of the model edge, object frame.
    pub(in crate::search) model: [Vector3<f64>; 2],
    pub(in crate::search) line: SpaceLine,
    /// The information on the four offsets.
    pub(in crate::search) weight: Matrix4<f64>,
    /// ln of the likelihood ratio at zero residual.
    pub(in crate::search) gain: f64,
    /// Whether the line may seed a pose.
    pub(in crate::search) depth: bool,
}

/// A vertex under a motion.
pub(in crate::search) struct Placed {
    pub(in crate::search) rows: [LineOffset; 4],
    pub(in crate::search) residual: Vector4<f64>,
}

impl EdgeVertex {
    /// The residuals under a motion; `None` without overlap.
    pub(in crate::search) fn placed(&self, motion: &Motion) -> Option<Placed> {
        Placed::of(&self.line, &self.model.each_ref().map(|end| motion.apply(end)))
    }

    /// The log-likelihood ratio of a residual, without a gate.
    pub(in crate::search) fn residual_gain(&self, r: &Vector4<f64>) -> f64 {
        self.gain - 0.5 * r.dot(&(self.weight * r))
    }
}

impl Placed {
    /// The residuals of a line from an edge with these ends, camera frame; `None` without overlap.
    pub(in crate::search) fn of(line: &SpaceLine, [from, to]: &[Vector3<f64>; 2]) -> Option<Self> {
        let rows = line.rows(from, to)?;
        if !(line.overlap(&rows, 0.0) >= OVERLAP) {
            return None;
        }
        let residual = Vector4::from_fn(|k, _| rows[k].residual);
        Some(Self { rows, residual })
    }

    /// The derivative of the predicted offsets by (φ, τ): a rotation about a place and a translation.
    pub(in crate::search) fn derivative(&self, about: &Vector3<f64>) -> Rows6 {
        let mut j = Rows6::zeros();
        for (k, row) in self.rows.iter().enumerate() {
            let turn = (row.at - about).cross(&row.gradient);
            for axis in 0..3 {
                j[(k, axis)] = turn[axis];
                j[(k, 3 + axis)] = row.gradient[axis];
            }
        }
        j
    }
}

/// The likelihood terms of the candidate pairs of edges.
///
/// A true pair contributes ln N(r; 0, S) − ln ρ, r the four offsets of the measured line from the edge. Under clutter
/// the offsets are uniform over the area A in which the prior places the edge, and the direction is that of one of the
/// lines there: structures have few directions, so that a line's direction is hardly evidence. With m lines in the gate,
///
/// ρ = 1/A Σ_j N(θ_j − θ; 0, S_θj + S_θ),
///
/// θ_j the directions of the m lines with the covariances S_θj, and S_θ that of S. As for points, all numbers of visible edges are equally probable.
pub(in crate::search) struct EdgeTerms<'a> {
    pub(in crate::search) edges: &'a [ModelEdge],
    pub(in crate::search) points: &'a [ModelPoint],
    /// The vertices, by model edge.
    pub(in crate::search) vertices: Vec<EdgeVertex>,
    /// ln B(k), k = 0…n.
    pub(in crate::search) ln_fraction: Vec<f64>,
    /// The measured lines.
    pub(in crate::search) lines: Vec<Option<SpaceLine>>,
    /// The lines in the gate of each model edge.
    pub(in crate::search) candidates: &'a [Vec<usize>],
    /// The pose by the prior.
    expected: Option<Motion>,
    /// The area (m²) in which the prior places each edge.
    areas: Vec<f64>,
    /// The area (m²) of all lines, for those beyond the gate.
    anywhere: f64,
    measured: &'a [MeasuredLine],
}

impl<'a> EdgeTerms<'a> {
    /// `None` for a problem without edges.
    pub(in crate::search) fn of(problem: &Problem<'a>, prior_terms: &PriorTerms) -> Option<Self> {
        let crate::problem::Edges { model, lines, candidates } = problem.edges;
        if candidates.iter().all(Vec::is_empty) {
            return None;
        }
        let known = prior_terms.known.as_ref();
        let covariance = known.and_then(|known| Some(known.information.cholesky()?.inverse()));
        let area = |edge: &ModelEdge| {
            let ends = edge.places(problem.model).map(|end| end.coords);
            let (known, covariance) = known.zip(covariance.as_ref())?;
            Some(area(&ends, edge.sigmas(problem.model), &known.motion, prior_terms, covariance))
        };
        let anywhere = cross_section(problem);
        let mut terms = Self {
            edges: model,
            points: problem.model,
            vertices: Vec::new(),
            ln_fraction: fractions(candidates.iter().filter(|list| !list.is_empty()).count()),
            lines: lines.iter().map(SpaceLine::of).collect(),
            candidates,
            expected: known.map(|known| known.motion),
            areas: model.iter().map(|edge| area(edge).unwrap_or(anywhere)).collect(),
            anywhere,
            measured: lines,
        };
        let pairs = candidates.iter().enumerate().flat_map(|(i, list)| list.iter().map(move |&j| (i, j)));
        terms.vertices = pairs.filter_map(|(i, j)| terms.vertex(i, j)).collect();
        Some(terms)
    }

    /// The terms of a model edge and a line, a candidate or not; `None` for a line or noise that is not defined.
    pub(in crate::search) fn vertex(&self, edge: usize, line: usize) -> Option<EdgeVertex> {
        let noise = self.noise(edge, line)?;
        let root = noise.cholesky()?;
        let of = self.lines[line]?;
        // From offsets at both ends to offset and direction.
        let ln_peak = -half_ln_det(&root) - 4.0 * HALF_LN_2PI + 2.0 * libm::log(of.length());
        let own = turn_spread(&noise, of.length());
        let density = |other: &SpaceLine| direction_density(&of, &own, other);
        let list = &self.candidates[edge];
        let ln_clutter = match list.binary_search(&line) {
            Ok(_) => {
                let others = list.iter().filter_map(|&other| self.lines[other].as_ref());
                libm::log(others.map(density).sum::<f64>() / self.areas[edge])
            }
            Err(_) => libm::log(self.lines.iter().flatten().map(density).sum::<f64>() / self.anywhere),
        };
        Some(EdgeVertex {
            pair: Correspondence { model: edge, cloud: line },
            model: self.ends(edge),
            line: of,
            weight: root.inverse(),
            gain: ln_peak - ln_clutter,
            depth: self.measured[line].depth,
        })
    }

    /// The covariance (m²) of the offsets of a line from a model edge; `None` for a line that is not defined.
    pub(in crate::search) fn noise(&self, edge: usize, line: usize) -> Option<Matrix4<f64>> {
        let (line, sigmas) = (self.lines[line]?, self.edges[edge].sigmas(self.points));
        let rows = self.expected.and_then(|motion| {
            let [from, to] = self.ends(edge).map(|end| motion.apply(&end));
            line.rows(&from, &to)
        });
        let by_model = match &rows {
            Some(rows) => SpaceLine::model_noise(rows, sigmas),
            None => Matrix4::identity() * (sigmas[0] * sigmas[0] + sigmas[1] * sigmas[1]),
        };
        Some(line.noise + by_model)
    }

    /// The ends of a model edge, object frame.
    pub(in crate::search) fn ends(&self, edge: usize) -> [Vector3<f64>; 2] {
        self.edges[edge].places(self.points).map(|end| end.coords)
    }

    /// The maximum-likelihood one-to-one set under a motion, ascending.
    ///
    /// `loose` is the covariance of the motion's (φ, τ) about `about`, by which residuals may exceed their noise.
    /// Lines in `taken` are not used.
    pub(in crate::search) fn choose(
        &self,
        motion: &Motion,
        taken: &BTreeSet<usize>,
        loose: Option<(&Matrix6<f64>, &Vector3<f64>)>,
    ) -> Vec<usize> {
        let camera = motion.origin();
        let mut best: Vec<(f64, usize)> = Vec::new();
        let mut shown = (usize::MAX, false);
        for (v, vertex) in self.vertices.iter().enumerate() {
            if shown.0 != vertex.pair.model {
                let edge = &self.edges[vertex.pair.model];
                shown = (vertex.pair.model, edge.shows_itself(self.points, &camera));
            }
            if !shown.1 || taken.contains(&vertex.pair.cloud) {
                continue;
            }
            let Some(placed) = vertex.placed(motion) else { continue };
            let r = &placed.residual;
            let own = r.dot(&(vertex.weight * r));
            let d2 = match loose {
                Some((covariance, about)) if own > FAR => {
                    let j = placed.derivative(about);
                    let Some(noise) = vertex.weight.try_inverse() else { continue };
                    let spread = noise + j * covariance * j.transpose();
                    spread.cholesky().map_or(f64::INFINITY, |root| r.dot(&root.solve(r)))
                }
                _ => own,
            };
            if d2 <= FAR {
                best.push((vertex.gain - 0.5 * d2, v));
            }
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let (mut edges, mut lines) = (BTreeSet::new(), BTreeSet::new());
        best.retain(|&(_, v)| {
            let Correspondence { model, cloud } = self.vertices[v].pair;
            let first = !edges.contains(&model) && !lines.contains(&cloud);
            if first {
                edges.insert(model);
                lines.insert(cloud);
            }
            first
        });
        let (mut sum, mut max, mut keep) = (0.0, self.ln_fraction[0], 0);
        for (k, (gain, _)) in best.iter().enumerate() {
            sum += gain;
            if sum + self.ln_fraction[k + 1] > max {
                (max, keep) = (sum + self.ln_fraction[k + 1], k + 1);
            }
        }
        let mut members: Vec<usize> = best[..keep].iter().map(|&(_, v)| v).collect();
        members.sort_unstable();
        members
    }

    /// The sum of the log-likelihood ratios of some vertices under a motion, with the probability of their number.
    pub(in crate::search) fn ln_ratio(&self, members: &[usize], motion: &Motion) -> f64 {
        let gain = |&v: &usize| {
            let vertex = &self.vertices[v];
            vertex.placed(motion).map_or(f64::NEG_INFINITY, |placed| vertex.residual_gain(&placed.residual))
        };
        members.iter().map(gain).sum::<f64>() + self.ln_fraction[members.len()]
    }
}

/// The area (m²) in which the prior places the middle of an edge, across it.
fn area(
    ends: &[Vector3<f64>; 2],
    sigmas: [f64; 2],
    motion: &Motion,
    prior_terms: &PriorTerms,
    covariance: &Matrix6<f64>,
) -> f64 {
    let [from, to] = ends.each_ref().map(|end| motion.apply(end));
    let direction = (to - from).normalize();
    let [n1, n2] = seafix_geometry::across(&direction);
    let lever = (from + to) / 2.0 - motion.apply(&prior_terms.centroid);
    let place = spread(covariance, &lever);
    let own = (sigmas[0] * sigmas[0] + sigmas[1] * sigmas[1]) / 4.0;
    let [a, b, c] = [n1.dot(&(place * n1)) + own, n1.dot(&(place * n2)), n2.dot(&(place * n2)) + own];
    std::f64::consts::PI * COUNTED * (a * c - b * b).max(f64::MIN_POSITIVE).sqrt()
}

/// The cross-section (m²) of the box about all lines.
fn cross_section(problem: &Problem<'_>) -> f64 {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for end in problem.edges.lines.iter().flat_map(|line| &line.ends) {
        (low, high) = (low.inf(&end.coords), high.sup(&end.coords));
    }
    libm::pow((high - low).product().max(f64::MIN_POSITIVE), 2.0 / 3.0)
}

/// The covariance (rad²) of a line's direction, from that of the offsets of its ends.
fn turn_spread(offsets: &Matrix4<f64>, length: f64) -> Matrix2<f64> {
    let block = |i: usize, k: usize| offsets.fixed_view::<2, 2>(2 * i, 2 * k).into_owned();
    (block(0, 0) + block(1, 1) - block(0, 1) - block(1, 0)) / (length * length)
}

/// The density (1/rad²) at the direction of a line, smoothed by `own`, that another line in its own noise contributes.
fn direction_density(line: &SpaceLine, own: &Matrix2<f64>, other: &SpaceLine) -> f64 {
    let sign = line.direction.dot(&other.direction).signum();
    let step = Vector2::from_fn(|axis, _| sign * line.across[axis].dot(&other.direction));
    let turn = Matrix2::from_fn(|row, column| line.across[row].dot(&other.across[column]));
    let spread = own + turn * turn_spread(&other.noise, other.length()) * turn.transpose();
    let Some(root) = spread.cholesky() else { return 0.0 };
    let d2 = step.dot(&root.solve(&step));
    libm::exp(-0.5 * d2) / (std::f64::consts::TAU * root.l_dirty().diagonal().product())
}
