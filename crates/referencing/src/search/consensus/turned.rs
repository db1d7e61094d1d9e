//! Poses of an object that looks nearly the same after a turn.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::{edge_seeds::HOPELESS, joined::Joined, likelihood::Mode, motion::Motion};

/// Standard deviations of the prior's attitude within which a turn is possible.
const SIGMAS: f64 = 5.0;
/// Maximum cosine of two directions that count as at right angles.
const ACROSS: f64 = 0.1;

/// The modes near a mode turned by 90°, 180° and 270° about the directions of its edges.
///
/// A plain box has four attitudes, and a square one eight or 24. A narrow prior excludes all but one; under a wide one,
/// an ascent from the prior's attitude reaches only the nearest. The turns are about the middle of the edges; two turns in
/// succession are not tried.
pub(in crate::search) fn turned(joined: &Joined<'_>, mode: &Mode) -> Vec<Mode> {
    let edges = joined.edges;
    let Some(known) = &joined.climb.prior_terms.known else { return Vec::new() };
    let possible = |angle: f64| angle <= SIGMAS * known.attitude;
    let mut axes: Vec<Vector3<f64>> = Vec::new();
    for &v in &mode.edges {
        let [from, to] = edges.vertices[v].model;
        let Some(along) = (to - from).try_normalize(0.0) else { continue };
        if axes.iter().all(|axis| axis.dot(&along).abs() <= ACROSS) {
            axes.push(along);
        }
    }
    if let [a, b] = axes[..] {
        axes.extend(a.cross(&b).try_normalize(0.0));
    }
    let ends: Vec<Vector3<f64>> = (0..edges.edges.len()).flat_map(|edge| edges.ends(edge)).collect();
    let middle = ends.iter().sum::<Vector3<f64>>() / ends.len().max(1) as f64;
    let quarters = [1.0, 2.0, 3.0].map(|quarters| quarters * std::f64::consts::FRAC_PI_2);
    let turns = axes.iter().flat_map(|axis| quarters.map(|angle| (axis, angle)));
    let possible = turns.filter(|(_, angle)| possible(angle.min(std::f64::consts::TAU - angle)));
    let of_turn = |(axis, angle): (&Vector3<f64>, f64)| {
        let turn: Matrix3<f64> = *Rotation3::from_axis_angle(&Unit::new_unchecked(*axis), angle).matrix();
        let rotation = mode.motion.rotation * turn;
        let start = Motion { rotation, translation: mode.motion.apply(&middle) - rotation * middle };
        joined.near(&start, None, mode.ln_evidence - HOPELESS)
    };
    possible.filter_map(of_turn).collect()
}
