//! The evidence of another structure of the object's kind.

use nalgebra::{DMatrix, DVector, RowVector3};
use seafix_geometry::so3::skew;

use super::{fractions::ln_fraction, gaussian::HALF_LN_2PI, joined::Joined, likelihood::Mode, wireframe::Wireframe};

/// Standard deviation of a vertex of another structure along each axis, relative to the mean length of the edges.
///
/// The difference of two vertices then has a standard deviation of a fifth of the length: neighbours of the object, and
/// its shadow, are about as large as the object.
const SPREAD: f64 = 0.141;

/// ln evidence (nats) that the features of a mode belong to another structure of the object's kind, against clutter.
///
/// Man-made structures have parallel edges that meet in corners. In such a structure, parallel directions and common
/// corners are no coincidence. Only its dimensions are: a structure of other dimensions is a parallel redrawing of the
/// object's wireframe, with displacements u = N c of its vertices, c ~ N(0, s² n I) for a part of n vertices. Its
/// evidence
///
/// Λ = ∫∫ p(T) p(c) B(k) Π N(r(T, c); 0, S)/ρ dc dT
///
/// lacks the coincidence of each dimension that the features measure, about s/σ. Points apart from the wireframe are
/// clutter. `None` without edges, and without a prior.
pub(in crate::search) fn ln_evidence(joined: &Joined<'_>, mode: &Mode) -> Option<f64> {
    let (terms, prior_terms, graph) = (joined.climb.terms, joined.climb.prior_terms, joined.climb.graph);
    let known = prior_terms.known.as_ref().filter(|_| !mode.edges.is_empty())?;
    let wireframe = Wireframe::of(joined.edges.points, joined.edges.edges);
    let (motion, about) = (&mode.motion, mode.motion.apply(&prior_terms.centroid));
    let corners = mode.members.iter().filter_map(|&v| Some((v, wireframe.points[graph.vertices[v].model]?)));
    let corners: Vec<(usize, usize)> = corners.collect();
    let edges: Vec<(usize, [usize; 2])> =
        mode.edges.iter().map(|&v| (v, wireframe.edges[joined.edges.vertices[v].pair.model])).collect();
    let seen = edges.iter().flat_map(|(_, ends)| *ends).chain(corners.iter().map(|(_, vertex)| *vertex));
    let shape = Shape::of(&wireframe, seen);
    let (mut h, mut g) = (DMatrix::zeros(shape.size, shape.size), DVector::zeros(shape.size));
    let mut add = |j: &DMatrix<f64>, weight: &[f64], residual: &[f64]| {
        let weighted = j.tr_mul(&DMatrix::from_column_slice(residual.len(), residual.len(), weight));
        h += &weighted * j;
        g += weighted * DVector::from_column_slice(residual);
    };
    let mut ln_fit = prior_terms.ln_density(motion) + joined.edges.ln_fraction[edges.len()];
    for (v, [from, to]) in &edges {
        let edge = &joined.edges.vertices[*v];
        let placed = edge.placed(motion)?;
        let mut j = DMatrix::zeros(4, shape.size);
        j.columns_mut(0, 6).copy_from(&placed.derivative(&about));
        for (k, row) in placed.rows.iter().enumerate() {
            let gradient = motion.rotation.tr_mul(&row.gradient).transpose();
            shape.move_by(*from, gradient * (1.0 - row.along), (&mut j, k));
            shape.move_by(*to, gradient * row.along, (&mut j, k));
        }
        ln_fit += edge.residual_gain(&placed.residual);
        add(&j, edge.weight.as_slice(), placed.residual.as_slice());
    }
    for (v, vertex) in &corners {
        let pair = &terms.pairs[*v];
        let place = motion.apply(&pair.model);
        let mut j = DMatrix::zeros(3, shape.size);
        j.view_mut((0, 0), (3, 3)).copy_from(&-skew(&(place - about)));
        j.view_mut((0, 3), (3, 3)).fill_with_identity();
        for axis in 0..3 {
            shape.move_by(*vertex, motion.rotation.row(axis).into_owned(), (&mut j, axis));
        }
        ln_fit += terms.residual_gain(*v, motion);
        add(&j, pair.weight.as_slice(), (pair.cloud - place).as_slice());
    }
    ln_fit += ln_fraction(corners.len(), terms.ln_fraction.len() - 1);
    let mut part = h.view_mut((0, 0), (6, 6));
    part += known.information;
    let mut part = g.rows_mut(0, 6);
    part -= known.information * prior_terms.step_to(known, motion);
    for (k, sigma) in shape.sigmas.iter().enumerate() {
        h[(6 + k, 6 + k)] += 1.0 / (sigma * sigma);
        ln_fit -= libm::log(*sigma);
    }
    let factor = h.cholesky()?;
    let gain = 0.5 * g.dot(&factor.solve(&g));
    let half_ln_det: f64 = factor.l_dirty().diagonal().iter().map(|x| libm::log(*x)).sum();
    Some(ln_fit + gain - half_ln_det + 6.0 * HALF_LN_2PI)
}

/// The dimensions of a structure: the displacements c of each part with a feature, after the six parameters of the pose.
struct Shape<'a> {
    wireframe: &'a Wireframe,
    /// The first parameter of each part; `None` for a part without a feature.
    first: Vec<Option<usize>>,
    /// The number of parameters.
    size: usize,
    /// The standard deviation of each displacement (m).
    sigmas: Vec<f64>,
}

impl<'a> Shape<'a> {
    /// The dimensions of the parts of some vertices.
    fn of(wireframe: &'a Wireframe, vertices: impl Iterator<Item = usize>) -> Self {
        let mut seen = vec![false; wireframe.parts.len()];
        vertices.for_each(|vertex| seen[wireframe.places[vertex].0] = true);
        let mut shape = Self { wireframe, first: vec![None; seen.len()], size: 6, sigmas: Vec::new() };
        for (k, part) in wireframe.parts.iter().enumerate().filter(|(k, _)| seen[*k]) {
            shape.first[k] = Some(shape.size);
            shape.size += part.ncols();
            let sigma = SPREAD * wireframe.length * (part.nrows() as f64 / 3.0).sqrt();
            shape.sigmas.extend(std::iter::repeat_n(sigma, part.ncols()));
        }
        shape
    }

    /// Adds to a row the derivative of a residual with this gradient by the place of a vertex.
    fn move_by(&self, vertex: usize, gradient: RowVector3<f64>, (j, row): (&mut DMatrix<f64>, usize)) {
        let (k, at) = self.wireframe.places[vertex];
        let part = &self.wireframe.parts[k];
        let Some(first) = self.first[k] else { return };
        let mut columns = j.view_mut((row, first), (1, part.ncols()));
        columns += gradient * part.fixed_rows::<3>(3 * at);
    }
}
