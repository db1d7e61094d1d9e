//! The edges of a repeated pattern, and the edges that distinguish an object from its pattern.

use nalgebra::Vector3;

use super::{edge_terms::EdgeTerms, fractions::ln_fraction, likelihood::Mode};
use crate::site::{edge::ModelEdge, model::ModelPoint};

/// Whether each edge lies on the line of another edge after a step of the pattern, within `off` (m) at both ends.
///
/// The lines of a chessboard and the rungs of a ladder do; the sides of a plate about them do not.
pub(super) fn repeated_edges(edges: &[ModelEdge], model: &[ModelPoint], basis: &[Vector3<f64>], off: f64) -> Vec<bool> {
    let places: Vec<[Vector3<f64>; 2]> = edges.iter().map(|edge| edge.places(model).map(|end| end.coords)).collect();
    let on_line = |[from, to]: &[Vector3<f64>; 2], place: &Vector3<f64>| {
        let Some(along) = (to - from).try_normalize(0.0) else { return false };
        let step = place - from;
        (step - along * along.dot(&step)).norm() <= off
    };
    let repeats = |i: usize| {
        basis.iter().flat_map(|step| [*step, -step]).any(|step| {
            let others = (0..places.len()).filter(|&k| k != i);
            others.into_iter().any(|k| places[i].iter().all(|end| on_line(&places[k], &(end + step))))
        })
    };
    (0..places.len()).map(repeats).collect()
}

/// ln evidence of the edges of a mode against clutter (nats), by kind; zero for a problem without edges.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct EdgeEvidence {
    /// Of all edges, as the evidence of the mode contains it.
    pub(super) all: f64,
    /// Of the edges of the pattern, with a visible fraction of their own.
    pub(super) repeated: f64,
    /// Of the edges outside the pattern, with a visible fraction of their own.
    pub(super) distinctive: f64,
}

impl EdgeEvidence {
    /// The evidence of the edges of a mode; `repeats` tells the edges of the pattern.
    pub(super) fn of(edges: &EdgeTerms<'_>, repeats: &[bool], mode: &Mode) -> Self {
        let of_kind = |kind: bool| {
            let candidates = edges.vertices.chunk_by(|a, b| a.pair.model == b.pair.model);
            let n = candidates.filter(|same| repeats[same[0].pair.model] == kind).count();
            let gains: Vec<f64> = mode
                .edges
                .iter()
                .map(|&v| &edges.vertices[v])
                .filter(|vertex| repeats[vertex.pair.model] == kind)
                .filter_map(|vertex| Some(vertex.residual_gain(&vertex.placed(&mode.motion)?.residual)))
                .collect();
            gains.iter().sum::<f64>() + ln_fraction(gains.len(), n)
        };
        Self { all: edges.ln_ratio(&mode.edges, &mode.motion), repeated: of_kind(true), distinctive: of_kind(false) }
    }
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Point;

    use super::*;
    use crate::site::edge::End;

    /// Three lines of a board with steps of 1 m, and the four sides of a plate 0.6 m beyond it.
    #[test]
    fn lines_of_a_pattern_repeat_and_sides_of_a_plate_do_not() {
        let line = |from: [f64; 2], to: [f64; 2]| ModelEdge {
            id: String::new(),
            ends: [from, to].map(|[x, y]| End::At(Point::new(x, y, 0.0))),
            sigma: 0.0,
            faces: Vec::new(),
        };
        let (low, high) = (-0.6, 2.6);
        let edges = [
            line([0.0, 0.0], [0.0, 2.0]),
            line([1.0, 0.0], [1.0, 2.0]),
            line([2.0, 0.0], [2.0, 2.0]),
            line([low, low], [low, high]),
            line([high, low], [high, high]),
            line([low, low], [high, low]),
            line([low, high], [high, high]),
        ];
        let repeats = repeated_edges(&edges, &[], &[Vector3::x(), Vector3::y()], 0.03);
        assert_eq!(repeats, [true, true, true, false, false, false, false]);
    }
}
