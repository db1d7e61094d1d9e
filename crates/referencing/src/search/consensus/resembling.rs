//! The evidence of another structure of the object's kind.

use faer::{
    Mat, Side,
    linalg::solvers::{Llt, Solve},
};
use nalgebra::{Matrix3, RowVector3};
use seafix_geometry::so3::skew;

use super::{fractions::ln_fraction, gaussian::HALF_LN_2PI, joined::Joined, likelihood::Mode, wireframe::Wireframe};
use crate::space_line::LineOffset;

/// ln evidence (nats) that the features of a mode belong to another structure of the object's kind, against clutter.
///
/// Man-made structures have parallel edges that meet in corners. In such a structure, parallel directions and common
/// corners are no coincidence. Only its dimensions are: a structure of other dimensions is a parallel redrawing of the
/// object's wireframe, with displacements u = N c of its vertices ([`Wireframe::information`]). Its evidence
///
/// Λ = ∫∫ p(T) p(c) B(k) Π N(r(T, c); 0, S)/ρ dc dT
///
/// lacks the factor s/σ of each dimension that the features measure. Points apart from the wireframe are clutter. If
/// rounding hides the dimensions, it is the evidence of the mode itself. `None` for a mode without edges, or without a
/// prior.
pub(in crate::search) fn ln_evidence(joined: &Joined<'_>, mode: &Mode) -> Option<f64> {
    let (terms, prior_terms, graph) = (joined.climb.terms, joined.climb.prior_terms, joined.climb.graph);
    let known = prior_terms.known.as_ref().filter(|_| !mode.edges.is_empty())?;
    let wireframe = Wireframe::of(joined.edges.points, joined.edges.edges);
    let (motion, about) = (&mode.motion, mode.motion.apply(&prior_terms.centroid));
    let corners = mode.members.iter().filter_map(|&v| Some((v, wireframe.points[graph.vertices[v].model]?)));
    let corners: Vec<(usize, usize)> = corners.collect();
    let edges: Vec<(usize, [usize; 2])> =
        mode.edges.iter().map(|&v| (v, wireframe.edges[joined.edges.vertices[v].pair.model])).collect();
    let seen: Vec<usize> =
        edges.iter().flat_map(|(_, ends)| *ends).chain(corners.iter().map(|(_, vertex)| *vertex)).collect();
    let vertices = wireframe.connected(&seen);
    let shape = wireframe.information(&vertices);
    let size = 6 + 3 * vertices.len();
    let (mut h, mut g) = (Mat::zeros(size, size), Mat::zeros(size, 1));
    h.submatrix_mut(6, 6, size - 6, size - 6).copy_from(&shape);
    let mut add = |j: &Rows, weight: &[f64], residual: &[f64]| {
        for (a, one) in j.iter().enumerate() {
            for (b, other) in j.iter().enumerate() {
                let w = weight[a * j.len() + b];
                for (row, x) in one {
                    g[(*row, 0)] += w * x * residual[b];
                    other.iter().for_each(|(column, y)| h[(*row, *column)] += w * x * y);
                }
            }
        }
    };
    // A gradient by the pose, and by the places of vertices.
    let gradient = |turn: &[f64], moves: &[(usize, f64)], by_place: &RowVector3<f64>| {
        let of = |&(vertex, weight): &(usize, f64)| {
            let first = 6 + 3 * vertices.binary_search(&vertex).unwrap_or(0);
            (0..3).map(move |axis| (first + axis, weight * by_place[axis]))
        };
        turn.iter().copied().enumerate().chain(moves.iter().flat_map(of)).collect()
    };
    let mut ln_fit = prior_terms.ln_density(motion) + joined.edges.ln_fraction[edges.len()];
    for (v, [from, to]) in &edges {
        let edge = &joined.edges.vertices[*v];
        let placed = edge.placed(motion)?;
        let turn = placed.derivative(&about);
        let row = |(k, row): (usize, &LineOffset)| {
            let by_place = motion.rotation.tr_mul(&row.gradient).transpose();
            let turn: Vec<f64> = turn.row(k).iter().copied().collect();
            gradient(&turn, &[(*from, 1.0 - row.along), (*to, row.along)], &by_place)
        };
        let j: Rows = placed.rows.iter().enumerate().map(row).collect();
        ln_fit += edge.residual_gain(&placed.residual);
        add(&j, edge.weight.as_slice(), placed.residual.as_slice());
    }
    for (v, vertex) in &corners {
        let pair = &terms.pairs[*v];
        let place = motion.apply(&pair.model);
        let turn = skew(&(about - place));
        let row = |axis: usize| {
            let mut pose: Vec<f64> = turn.row(axis).iter().copied().collect();
            pose.extend(Matrix3::<f64>::identity().row(axis).iter());
            gradient(&pose, &[(*vertex, 1.0)], &motion.rotation.row(axis).into_owned())
        };
        let j: Rows = (0..3).map(row).collect();
        ln_fit += terms.residual_gain(*v, motion);
        add(&j, pair.weight.as_slice(), (pair.cloud - place).as_slice());
    }
    ln_fit += ln_fraction(corners.len(), terms.ln_fraction.len() - 1);
    let pull = known.information * prior_terms.step_to(known, motion);
    for row in 0..6 {
        g[(row, 0)] -= pull[row];
        (0..6).for_each(|column| h[(row, column)] += known.information[(row, column)]);
    }
    let (Ok(factor), Ok(of_shape)) = (h.llt(Side::Lower), shape.llt(Side::Lower)) else {
        return Some(mode.ln_evidence);
    };
    let gain = 0.5 * (g.transpose() * factor.solve(&g))[(0, 0)];
    Some(ln_fit + gain + half_ln_det(&of_shape) - half_ln_det(&factor) + 6.0 * HALF_LN_2PI)
}

/// The derivatives of some residuals, each by its parameters.
type Rows = Vec<Vec<(usize, f64)>>;

fn half_ln_det(factor: &Llt<f64>) -> f64 {
    let l = factor.L();
    (0..l.nrows()).map(|k| libm::log(l[(k, k)])).sum()
}
