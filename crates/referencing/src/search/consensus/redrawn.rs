//! A structure of the object's kind about a pose, and the lines that it explains beyond those of the pose.

use std::collections::BTreeSet;

use faer::{Side, linalg::solvers::DenseSolveCore};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, MatrixXx4, RowVector3, Vector3, Vector4};
use seafix_geometry::so3::skew;

use super::{
    edge_terms::{FAR, Placed},
    fractions::ln_fraction,
    gaussian::half_ln_det,
    joined::Joined,
    likelihood::Mode,
    wireframe::Wireframe,
};
use crate::space_line::LineOffset;

/// The derivatives of some residuals, each by its parameters: pose (rotation, translation), then places of vertices.
pub(super) type Rows = Vec<Vec<(usize, f64)>>;

/// A parallel redrawing of the object's wireframe in the place of a mode: its pose and the displacements of its vertices.
pub(super) struct Redrawn<'a> {
    joined: &'a Joined<'a>,
    mode: &'a Mode,
    wireframe: &'a Wireframe,
    /// The vertices of the parts of which the mode has a feature, ascending.
    pub(super) vertices: Vec<usize>,
    /// The vertices of the other parts, one part after the other.
    others: Vec<Vec<usize>>,
    /// The index of the first coordinate of each vertex of the wireframe.
    first: Vec<usize>,
    /// The edges beyond those of the mode that the camera may see.
    further: Vec<usize>,
    /// The place about which the pose turns.
    about: Vector3<f64>,
}

impl<'a> Redrawn<'a> {
    pub(super) fn of(joined: &'a Joined<'a>, mode: &'a Mode, wireframe: &'a Wireframe) -> Self {
        let terms = joined.edges;
        let known: BTreeSet<usize> = mode.edges.iter().map(|&v| terms.vertices[v].pair.model).collect();
        let camera = mode.motion.origin();
        let free = |i: &usize| !known.contains(i) && terms.edges[*i].shows_itself(terms.points, &camera);
        let further: Vec<usize> = (0..terms.edges.len()).filter(free).collect();
        let about = mode.motion.apply(&joined.climb.prior_terms.centroid);
        let seen: Vec<usize> = known.iter().flat_map(|&edge| wireframe.edges[edge]).collect();
        let mut structure =
            Self { joined, mode, wireframe, vertices: seen, others: Vec::new(), first: Vec::new(), further, about };
        structure.vertices.extend(structure.corners().map(|(_, vertex)| vertex).collect::<Vec<_>>());
        structure.vertices = wireframe.connected(&structure.vertices);
        let mut placed: BTreeSet<usize> = structure.vertices.iter().copied().collect();
        for &edge in &structure.further {
            let from = wireframe.edges[edge][0];
            if !placed.contains(&from) {
                let part = wireframe.connected(&[from]);
                placed.extend(&part);
                structure.others.push(part);
            }
        }
        structure.first = vec![usize::MAX; wireframe.count()];
        for (k, vertex) in structure.vertices.iter().chain(structure.others.iter().flatten()).enumerate() {
            structure.first[*vertex] = 6 + 3 * k;
        }
        structure
    }

    /// The points of the mode on the wireframe, with their vertices.
    pub(super) fn corners(&self) -> impl Iterator<Item = (usize, usize)> {
        let graph = self.joined.climb.graph;
        self.mode.members.iter().filter_map(|&v| Some((v, self.wireframe.points[graph.vertices[v].model]?)))
    }

    pub(super) fn rows_of_edge(&self, edge: usize, placed: &Placed) -> Rows {
        let turn = placed.derivative(&self.about);
        let [from, to] = self.wireframe.edges[edge];
        let row = |(k, row): (usize, &LineOffset)| {
            let by_place = self.mode.motion.rotation.tr_mul(&row.gradient).transpose();
            let turn: Vec<f64> = turn.row(k).iter().copied().collect();
            self.gradient(&turn, &[(from, 1.0 - row.along), (to, row.along)], &by_place)
        };
        placed.rows.iter().enumerate().map(row).collect()
    }

    pub(super) fn rows_of_point(&self, place: &Vector3<f64>, vertex: usize) -> Rows {
        let turn = skew(&(self.about - place));
        let row = |axis: usize| {
            let mut pose: Vec<f64> = turn.row(axis).iter().copied().collect();
            pose.extend(Matrix3::<f64>::identity().row(axis).iter());
            self.gradient(&pose, &[(vertex, 1.0)], &self.mode.motion.rotation.row(axis).into_owned())
        };
        (0..3).map(row).collect()
    }

    /// A gradient by the pose, and by the places of vertices.
    fn gradient(&self, turn: &[f64], moves: &[(usize, f64)], by_place: &RowVector3<f64>) -> Vec<(usize, f64)> {
        let of = |&(vertex, weight): &(usize, f64)| {
            let first = self.first[vertex];
            (0..3).map(move |axis| (first + axis, weight * by_place[axis]))
        };
        turn.iter().copied().enumerate().chain(moves.iter().flat_map(of)).collect()
    }

    /// ln evidence (nats) of the lines beyond those of the mode that the structure explains.
    ///
    /// `step` is the displacement of pose and vertices, and `covariance` its covariance. The line with the greatest
    /// predictive likelihood ratio is added first, and determines the structure further (a Kalman update). Lines beyond
    /// the gates of the object's edges count too: the gates do not hold for a structure of other dimensions.
    pub(super) fn ln_evidence_of_further_lines(&self, step: DVector<f64>, covariance: DMatrix<f64>) -> f64 {
        let terms = self.joined.edges;
        let (mut step, mut covariance) = self.with_other_parts(step, covariance);
        let used: BTreeSet<usize> = self.mode.edges.iter().map(|&v| terms.vertices[v].pair.cloud).collect();
        let lines: Vec<usize> = (0..terms.lines.len()).filter(|line| !used.contains(line)).collect();
        let pairs = self.further.iter().flat_map(|&edge| lines.iter().map(move |&line| (edge, line)));
        let mut left: Vec<(usize, usize)> = pairs.collect();
        let (mut known, mut all) = (used.len(), terms.ln_fraction.len() - 1);
        let (mut sum, mut max, start) = (0.0, 0.0, terms.ln_fraction[known]);
        loop {
            let mut best: Option<((usize, usize), Prediction)> = None;
            left.retain(|&(edge, line)| {
                let Some(of) = self.predicted(edge, line, &step, &covariance) else { return false };
                if best.as_ref().is_none_or(|best| of.gain > best.1.gain) {
                    best = Some(((edge, line), of));
                }
                true
            });
            let Some(((edge, line), of)) = best.filter(|best| best.1.gain > 0.0) else { return max };
            left.retain(|other| other.0 != edge && other.1 != line);
            known += 1;
            all += usize::from(terms.candidates[edge].is_empty());
            sum += of.gain;
            max = f64::max(max, sum + ln_fraction(known, all) - start);
            let moved = MatrixXx4::from_fn(step.len(), |row, k| {
                of.rows[k].iter().map(|(column, x)| covariance[(row, *column)] * x).sum::<f64>()
            });
            let gained = &moved * of.weight;
            step += &gained * of.residual;
            covariance -= gained * moved.transpose();
        }
    }

    /// Displacements and covariance with those of the parts of which the mode has no feature: nothing is known of them.
    fn with_other_parts(&self, step: DVector<f64>, covariance: DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let known = step.len();
        let size = known + 3 * self.others.iter().map(Vec::len).sum::<usize>();
        let mut all = covariance.resize(size, size, 0.0);
        for part in &self.others {
            let first = self.first[part[0]];
            let shape = self.wireframe.information(part);
            if let Ok(factor) = shape.llt(Side::Lower) {
                let inverse = factor.inverse();
                let mut own = all.view_mut((first, first), (3 * part.len(), 3 * part.len()));
                own.copy_from(&DMatrix::from_fn(3 * part.len(), 3 * part.len(), |row, column| inverse[(row, column)]));
            }
        }
        (step.resize_vertically(size, 0.0), all)
    }

    /// A line about the place of an edge in the structure; `None` without overlap, and beyond the gate.
    fn predicted(
        &self,
        edge: usize,
        line: usize,
        step: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Option<Prediction> {
        let terms = self.joined.edges;
        let (ends, vertices) = (terms.ends(edge), self.wireframe.edges[edge]);
        let displaced = [0, 1].map(|end| {
            let first = self.first[vertices[end]];
            let own = Vector3::from_fn(|axis, _| step[first + axis]);
            let place = self.mode.motion.apply(&(ends[end] + own));
            let [turn, shift] = [0, 3].map(|k| Vector3::new(step[k], step[k + 1], step[k + 2]));
            place + turn.cross(&(place - self.about)) + shift
        });
        let placed = Placed::of(terms.lines[line].as_ref()?, &displaced)?;
        let noise = terms.noise(edge, line)?;
        let rows = self.rows_of_edge(edge, &placed);
        let of = |a: usize, b: usize| -> f64 {
            let by = |(column, y): &(usize, f64)| -> f64 {
                y * rows[a].iter().map(|(row, x)| x * covariance[(*row, *column)]).sum::<f64>()
            };
            rows[b].iter().map(by).sum::<f64>() + noise[(a, b)]
        };
        let spread = Matrix4::from_fn(of);
        let root = spread.cholesky()?;
        let d2 = placed.residual.dot(&root.solve(&placed.residual));
        if !(d2 <= FAR) {
            return None;
        }
        let wider = half_ln_det(&root) - half_ln_det(&noise.cholesky()?);
        let gain = terms.vertex(edge, line)?.gain - wider - 0.5 * d2;
        Some(Prediction { gain, rows, residual: placed.residual, weight: root.inverse() })
    }
}

/// A line about its place in a structure.
struct Prediction {
    /// ln of the likelihood ratio.
    gain: f64,
    rows: Rows,
    residual: Vector4<f64>,
    /// The inverse covariance of the residual, with that of the structure.
    weight: Matrix4<f64>,
}
