//! The evidence of another structure of the object's kind.

use faer::{
    Mat, Side,
    linalg::solvers::{DenseSolveCore, Llt, Solve},
};
use nalgebra::{DMatrix, DVector};

use super::{
    fractions::ln_fraction,
    gaussian::HALF_LN_2PI,
    joined::Joined,
    likelihood::Mode,
    redrawn::{Redrawn, Rows},
    wireframe::Wireframe,
};

/// ln evidence (nats) that the features of a mode belong to another structure of the object's kind, against clutter.
///
/// Man-made structures have parallel edges that meet in corners. In such a structure, parallel directions and common
/// corners are no coincidence. Only its dimensions are: a structure of other dimensions is a parallel redrawing of the
/// object's wireframe, with displacements u = N c of its vertices ([`Wireframe::information`]). Its evidence
///
/// Λ = ∫∫ p(T) p(c) B(k) Π N(r(T, c); 0, S)/ρ dc dT
///
/// lacks the factor s/σ of each dimension that the features measure, but it has the lines that the object leaves
/// unexplained and a structure of other dimensions explains ([`Redrawn::ln_evidence_of_further_lines`]). Points apart from
/// the wireframe are clutter. If rounding hides the dimensions, it is the evidence of the mode itself. `None` for a mode
/// without edges, or without a prior.
pub(in crate::search) fn ln_evidence(joined: &Joined<'_>, mode: &Mode) -> Option<f64> {
    let prior_terms = joined.climb.prior_terms;
    let known = prior_terms.known.as_ref().filter(|_| !mode.edges.is_empty())?;
    let wireframe = Wireframe::of(joined.edges.points, joined.edges.edges);
    let structure = Redrawn::of(joined, mode, &wireframe);
    let terms = joined.climb.terms;
    let corners: Vec<(usize, usize)> = structure.corners().collect();
    let shape = wireframe.information(&structure.vertices);
    let size = 6 + shape.nrows();
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
    let mut ln_fit = prior_terms.ln_density(&mode.motion) + joined.edges.ln_fraction[mode.edges.len()];
    for &v in &mode.edges {
        let edge = &joined.edges.vertices[v];
        let placed = edge.placed(&mode.motion)?;
        ln_fit += edge.residual_gain(&placed.residual);
        add(&structure.rows_of_edge(edge.pair.model, &placed), edge.weight.as_slice(), placed.residual.as_slice());
    }
    for (v, vertex) in &corners {
        let pair = &terms.pairs[*v];
        let place = mode.motion.apply(&pair.model);
        ln_fit += terms.residual_gain(*v, &mode.motion);
        add(&structure.rows_of_point(&place, *vertex), pair.weight.as_slice(), (pair.cloud - place).as_slice());
    }
    ln_fit += ln_fraction(corners.len(), terms.ln_fraction.len() - 1);
    let pull = known.information * prior_terms.step_to(known, &mode.motion);
    for row in 0..6 {
        g[(row, 0)] -= pull[row];
        (0..6).for_each(|column| h[(row, column)] += known.information[(row, column)]);
    }
    let (Ok(factor), Ok(of_shape)) = (h.llt(Side::Lower), shape.llt(Side::Lower)) else {
        return Some(mode.ln_evidence);
    };
    let step = factor.solve(&g);
    let gain = 0.5 * (g.transpose() * &step)[(0, 0)];
    let ln_evidence = ln_fit + gain + half_ln_det(&of_shape) - half_ln_det(&factor) + 6.0 * HALF_LN_2PI;
    let inverse = factor.inverse();
    let step = DVector::from_fn(size, |row, _| step[(row, 0)]);
    let covariance = DMatrix::from_fn(size, size, |row, column| inverse[(row, column)]);
    Some(ln_evidence + structure.ln_evidence_of_further_lines(step, covariance))
}

fn half_ln_det(factor: &Llt<f64>) -> f64 {
    let l = factor.L();
    (0..l.nrows()).map(|k| libm::log(l[(k, k)])).sum()
}
