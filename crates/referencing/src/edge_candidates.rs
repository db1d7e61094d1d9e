//! Stage 1 for edges: the measured lines that the prior allows for each model edge.

use nalgebra::{Matrix4, SMatrix};
use seafix_geometry::MeasuredLine;

use crate::{
    candidates::Gate,
    chi_square::chi_square,
    problem::{Prior, PriorBound},
    site::{edge::ModelEdge, model::ModelPoint},
    space_line::SpaceLine,
};

/// Minimum overlap of the model edge and the measured line along it, as a fraction of the shorter one.
pub(crate) const OVERLAP: f64 = 0.25;
/// Standard deviations along the edge by which the prior may displace it.
const ALONG: f64 = 3.0;

/// The lines that may correspond to each model edge.
///
/// The offsets of both ends of the line across it, and so its direction, lie in the gate about the predicted edge; the
/// covariance is that of the prior, the measurement and the model. Either direction of the line is admitted, since
/// lamps move. Line and edge overlap by a quarter of the shorter one. Without a prior, every line is a candidate. Edges
/// that the mask `in_view` excludes have no candidates.
pub fn edge_candidates(
    edges: &[ModelEdge],
    model: &[ModelPoint],
    lines: &[MeasuredLine],
    prior: Option<&Prior>,
    gate: &Gate,
    in_view: Option<&[bool]>,
) -> Vec<Vec<usize>> {
    let prepared: Vec<Option<SpaceLine>> = lines.iter().map(SpaceLine::of).collect();
    let seen = |index: usize| in_view.is_none_or(|mask| mask.get(index).copied().unwrap_or(false));
    let of_edge = |(index, edge): (usize, &ModelEdge)| {
        if !seen(index) {
            return Vec::new();
        }
        let admitted = |line: &Option<SpaceLine>| {
            line.as_ref().is_some_and(|line| prior.is_none_or(|prior| admits(edge, model, line, prior, gate)))
        };
        (0..lines.len()).filter(|&j| admitted(&prepared[j])).collect()
    };
    edges.iter().enumerate().map(of_edge).collect()
}

fn admits(edge: &ModelEdge, model: &[ModelPoint], line: &SpaceLine, prior: &Prior, gate: &Gate) -> bool {
    let camera_from_object = prior.object_from_camera.inverse();
    let [from, to] = edge.places(model).map(|end| (camera_from_object * end).coords);
    let Some(rows) = line.rows(&from, &to) else { return false };
    let length = (to - from).norm();
    let centre = seafix_geometry::Point::from((from + to) / 2.0);
    let along = (to - from) / length;
    let slack = match &prior.bound {
        PriorBound::Box(half) => *half,
        PriorBound::Gaussian(covariance) => ALONG * along.dot(&(covariance.of_point(&centre) * along)).max(0.0).sqrt(),
    };
    if line.overlap(&rows, slack / length) < OVERLAP {
        return false;
    }
    let noise = line.noise + SpaceLine::model_noise(&rows, edge.sigmas(model));
    let limits = |half: f64| {
        // Each camera axis contributes at most the half-size.
        (0..4)
            .all(|k| rows[k].residual.abs() <= half * rows[k].gradient.lp_norm(1) + 4.0 * noise[(k, k)].max(0.0).sqrt())
    };
    match (&prior.bound, gate) {
        (PriorBound::Box(half), _) | (PriorBound::Gaussian(_), Gate::Box(half)) => limits(*half),
        (PriorBound::Gaussian(covariance), Gate::ChiSquare(confidence)) => {
            let mut j = SMatrix::<f64, 4, 6>::zeros();
            for (k, row) in rows.iter().enumerate() {
                let turn = row.gradient.cross(&row.at);
                (0..3).for_each(|axis| {
                    j[(k, axis)] = turn[axis];
                    j[(k, 3 + axis)] = -row.gradient[axis];
                });
            }
            let spread: Matrix4<f64> = j * covariance.matrix * j.transpose() + noise;
            let r = rows.each_ref().map(|row| row.residual).into();
            let r: nalgebra::Vector4<f64> = r;
            spread.cholesky().is_some_and(|root| r.dot(&root.solve(&r)) <= chi_square(4, *confidence))
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;
    use seafix_geometry::{Camera, Covariance6, Object, Point, Transform};

    use super::*;
    use crate::site::edge::End;

    fn line(from: [f64; 3], to: [f64; 3]) -> MeasuredLine {
        MeasuredLine {
            ends: [Point::from(from), Point::from(to)],
            offsets: Matrix4::identity() * 1e-6,
            segments: None,
            depth: true,
        }
    }

    /// An edge of 1 m along x, 3 m in front of the camera; the prior is good to 0.1 m and 0.01 rad.
    #[test]
    fn a_gate_of_an_edge_has_offsets_angle_and_overlap() {
        let ends = [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]].map(|at| End::At(Point::from(at)));
        let edge = ModelEdge { id: "e".to_owned(), ends, sigma: 0.0, faces: Vec::new() };
        let bound = PriorBound::Gaussian(Covariance6::isotropic(0.01, 0.1));
        let prior = Prior { object_from_camera: Transform::<Object, Camera>::identity(), bound };
        let admitted = |line: MeasuredLine| {
            let lists =
                edge_candidates(std::slice::from_ref(&edge), &[], &[line], Some(&prior), &Gate::default(), None);
            !lists[0].is_empty()
        };
        assert!(admitted(line([0.2, 0.1, 3.0], [0.9, 0.1, 3.01])));
        assert!(admitted(line([0.9, 0.1, 3.01], [0.2, 0.1, 3.0])), "the direction is free");
        assert!(!admitted(line([0.2, 0.5, 3.0], [0.9, 0.5, 3.0])), "five sigmas beside");
        assert!(!admitted(line([0.2, 0.0, 3.0], [0.9, 0.2, 3.0])), "turned by 16°");
        assert!(admitted(line([1.1, 0.0, 3.0], [1.8, 0.0, 3.0])), "displaced along by three sigmas at most");
        assert!(!admitted(line([1.6, 0.0, 3.0], [2.5, 0.0, 3.0])), "beyond its end");
        assert!(!admitted(line([0.5, -0.5, 3.0], [0.5, 0.5, 3.0])), "across");
        let hidden = edge_candidates(
            std::slice::from_ref(&edge),
            &[],
            &[line([0.2, 0.0, 3.0], [0.9, 0.0, 3.0])],
            None,
            &Gate::default(),
            Some(&[false]),
        );
        assert!(hidden[0].is_empty());
    }
}
