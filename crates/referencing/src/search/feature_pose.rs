//! Points and edges under a pose.

use seafix_geometry::{Camera, Object, Transform};

use super::{
    bitset::BitSet,
    features::{EdgePair, FeatureSet, Features},
    pose,
};
use crate::{
    edge_candidates::OVERLAP,
    edge_coherence::DISTANCE_FLOOR,
    observations::Observations,
    problem::Problem,
    solve::likelihood::mixed::{self, Mixed},
};

/// The maximum-likelihood pose of a set and its χ², by the coordinates of points and lines; near a known pose if there is
/// one. `None` for a set that determines none.
pub(crate) fn fitted(
    problem: &Problem<'_>,
    set: &FeatureSet,
    near: Option<&Transform<Object, Camera>>,
) -> Option<(Transform<Object, Camera>, f64)> {
    let data = Observations::of(&set.points, problem.model, problem.cloud, None).with_edges(
        &set.edges,
        problem.edges.model,
        problem.model,
        problem.edges.lines,
    );
    let pose = match near {
        Some(near) => mixed::solve_near(&data, None, near),
        None => mixed::solve(&data, None),
    };
    let pose = pose.ok().filter(Transform::is_finite)?;
    let cost = Mixed::of(&data, None, None).ok()?.independent(&pose).ok()?.cost;
    Some((pose, cost))
}

impl Features<'_> {
    /// The residual of a vertex under a pose, as a fraction of its tolerance; infinite for an edge that does not overlap
    /// its line in its direction, or whose faces are turned away.
    pub(super) fn fraction(&self, pose: &Transform<Object, Camera>, vertex: usize) -> f64 {
        match self.edge(vertex) {
            None => pose::fraction(self.problem, pose, self.points[vertex]),
            Some(edge) => self.fraction_of_edge(pose, edge),
        }
    }

    /// The tolerance of an offset is that of structural coherence: standard deviations, and the floor of the model.
    fn fraction_of_edge(&self, pose: &Transform<Object, Camera>, edge: &EdgePair) -> f64 {
        let into = pose.inverse();
        let [from, to] = edge.directed.model.map(|end| (into * seafix_geometry::Point::<Object>::from(end)).coords);
        let line = &edge.directed.line;
        if line.direction.dot(&(to - from)) <= 0.0 {
            return f64::INFINITY;
        }
        let Some(rows) = line.rows(&from, &to) else { return f64::INFINITY };
        let known = &self.problem.edges.model[edge.pair.model];
        let visible = known.shows_itself(self.problem.model, &pose.translation());
        if !visible || !(line.overlap(&rows, 0.0) >= OVERLAP) {
            return f64::INFINITY;
        }
        let of_row = |k: usize| {
            let noise = line.noise[(k, k)].max(0.0).sqrt() + edge.sigma;
            rows[k].residual.abs() / (self.problem.sigmas() * noise + DISTANCE_FLOOR)
        };
        (0..4).map(of_row).fold(0.0, f64::max)
    }

    /// The one-to-one vertices within tolerance of a pose, by ascending residual; among equals the first.
    pub(super) fn explained(&self, pose: &Transform<Object, Camera>) -> Vec<(f64, usize)> {
        let all = (0..self.len()).map(|v| (self.fraction(pose, v), v));
        let mut near: Vec<(f64, usize)> = all.filter(|(fraction, _)| *fraction <= 1.0).collect();
        near.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let Problem { model, cloud, edges, .. } = self.problem;
        let mut models = BitSet::empty(model.len() + edges.model.len());
        let mut clouds = BitSet::empty(cloud.len() + edges.lines.len());
        near.retain(|(_, vertex)| {
            let pair = self.numbered(*vertex);
            let free = !models.has(pair.model) && !clouds.has(pair.cloud);
            if free {
                models.insert(pair.model);
                clouds.insert(pair.cloud);
            }
            free
        });
        near
    }

    /// Alternates the fit and the choice of vertices until the score Σ (1 − fraction²) no longer grows; returns the
    /// vertices by ascending residual.
    pub(super) fn refined(&self, start: Transform<Object, Camera>, pair_tests: &mut u64) -> Vec<usize> {
        const MAX_ROUNDS: usize = 10;
        let (mut best, mut ranked, mut pose) = (f64::NEG_INFINITY, Vec::new(), start);
        for _ in 0..MAX_ROUNDS {
            *pair_tests += self.len() as u64;
            let near = self.explained(&pose);
            let worth: f64 = near.iter().map(|(fraction, _)| 1.0 - fraction * fraction).sum();
            if !(worth > best) {
                break;
            }
            (best, ranked) = (worth, near.into_iter().map(|(_, vertex)| vertex).collect());
            let Some((next, _)) = fitted(self.problem, &self.set(&ranked), Some(&pose)) else { break };
            pose = next;
        }
        ranked
    }
}
