//! Edges that repeat by a translation: their continuation beyond the object looks like a part of it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::Vector3;

use super::{
    edge_terms::{EdgeTerms, EdgeVertex},
    fractions::ln_fraction,
    joined::Joined,
    lattice::{Lattice, forward, independent},
    likelihood::Mode,
    motion::Motion,
};

/// Maximum number of model edges for the detection of a pattern.
const MAX_EDGES: usize = 128;
/// Minimum number of edges that a step moves onto others, and the fraction of the edges that they must exceed.
///
/// A step by the width of a plain box moves a third of its edges onto others.
const MIN_MOVED: usize = 3;
const MIN_FRACTION: f64 = 1.0 / 3.0;
/// Tolerance of an edge's ends, as a fraction of the model's extent.
const OFF_FRACTION: f64 = 0.015;
/// Minimum step in units of that tolerance.
const MIN_STEP: f64 = 3.0;
/// ln of the prior probability that the pattern goes on beyond the object, an assumption.
///
/// It is one in a hundred. With one half, more ladders of which a tenth is hidden are ambiguous.
const LN_GOES_ON: f64 = -4.6;
/// Maximum number of shifts examined: any two decide that the pose is ambiguous.
const MAX_SHIFTS: usize = 16;

/// A model edge: its middle, and the step from there to one of its ends (object frame).
#[derive(Clone, Copy)]
struct Segment {
    middle: Vector3<f64>,
    half: Vector3<f64>,
}

impl Segment {
    /// Whether it lies on another edge after a step, within `off` (m).
    fn is_at(&self, other: &Self, step: &Vector3<f64>, off: f64) -> bool {
        (self.middle + step - other.middle).norm() <= off && self.is_like(other, off)
    }

    /// Whether it is parallel to another edge and as long.
    fn is_like(&self, other: &Self, off: f64) -> bool {
        (self.half - other.half).norm().min((self.half + other.half).norm()) <= off
    }
}

/// The translations by which the edges of a model repeat, as those of a row of boxes, a rack or a ladder do.
pub(in crate::search) struct EdgePattern {
    /// The model edges.
    segments: Vec<Segment>,
    middles: Vec<Vector3<f64>>,
    /// Whether a step moves an edge onto another.
    repeats: Vec<bool>,
    /// Tolerance of a place (m).
    off: f64,
    /// The steps of the pattern, one to three (object frame).
    basis: Vec<Vector3<f64>>,
}

impl EdgePattern {
    /// The pattern of the model's edges; `None` without one.
    pub(in crate::search) fn of(edges: &EdgeTerms<'_>) -> Option<Self> {
        Self::of_segments((0..edges.edges.len()).map(|edge| edges.ends(edge)))
    }

    fn of_segments(ends: impl Iterator<Item = [Vector3<f64>; 2]>) -> Option<Self> {
        let segment = |[from, to]: [Vector3<f64>; 2]| Segment { middle: (from + to) / 2.0, half: (to - from) / 2.0 };
        let segments: Vec<Segment> = ends.map(segment).collect();
        let n = segments.len();
        if n > MAX_EDGES {
            return None;
        }
        let middles: Vec<Vector3<f64>> = segments.iter().map(|segment| segment.middle).collect();
        let reach = |segment: &Segment| (segment.middle - middles[0]).norm() + segment.half.norm();
        let off = OFF_FRACTION * segments.iter().map(reach).fold(0.0, f64::max);
        let mut steps: Vec<Vector3<f64>> = Vec::new();
        for a in 0..n {
            for c in 0..a {
                let step = middles[a] - middles[c];
                if step.norm() >= MIN_STEP * off && segments[a].is_like(&segments[c], off) {
                    steps.push(if forward(&step) { step } else { -step });
                }
            }
        }
        let moved = |step: &Vector3<f64>| steps.iter().filter(|other| (*other - step).norm() <= off).count();
        let enough = |count: usize| count >= MIN_MOVED && count as f64 > MIN_FRACTION * n as f64;
        let basis = independent(steps.iter().filter(|step| enough(moved(step))).copied().collect());
        let onto_other = |segment: &Segment, step: &Vector3<f64>| {
            segments.iter().any(|other| segment.is_at(other, step, off) || segment.is_at(other, &-step, off))
        };
        let repeats = segments.iter().map(|segment| basis.iter().any(|step| onto_other(segment, step))).collect();
        (!basis.is_empty()).then_some(Self { segments, middles, repeats, off, basis })
    }

    /// The poses of the object shifted within its pattern, reached from a mode step by step.
    pub(in crate::search) fn shifts(&self, joined: &Joined<'_>, mode: &Mode) -> Vec<Mode> {
        let mut found: Vec<Mode> = Vec::new();
        let mut known: BTreeSet<[i32; 3]> = BTreeSet::from([[0; 3]]);
        let mut open = VecDeque::from([[0; 3]]);
        while let Some(from) = open.pop_front() {
            for (axis, step) in (0..self.basis.len()).flat_map(|axis| [(axis, 1), (axis, -1)]) {
                let mut to: [i32; 3] = from;
                to[axis] += step;
                if known.len() > MAX_SHIFTS || !known.insert(to) {
                    continue;
                }
                let by = self.basis.iter().zip(to).map(|(step, times)| step * f64::from(times)).sum::<Vector3<f64>>();
                let start = Motion { translation: mode.motion.apply(&by), ..mode.motion };
                // A weak shift slides back to the place of a neighbour, and a far one holds few edges of the object.
                let stays = |shifted: &Mode| {
                    self.shift_between(&start, &shifted.motion) == Some(Vector3::zeros())
                        && 2 * shifted.edges.len() > mode.edges.len()
                };
                if let Some(shifted) = joined.near(&start, None, f64::NEG_INFINITY).filter(stays) {
                    found.push(shifted);
                    open.push_back(to);
                }
            }
        }
        found
    }

    /// Adds to each mode the evidence of the pattern around the object; the best mode is then the first.
    ///
    /// Poses that differ by a shift are compared over the same places: what one explains as the object, the other
    /// explains as the pattern around it. Let k of n model edges be seen, and m of the M places at which the other
    /// shifts have their edges. With the prior probability c that the pattern goes on, with the same visible fraction,
    ///
    /// Λ = B(k, n) Π_k + c B(k + m, n + M) Π_k Π_m,
    ///
    /// with the likelihood ratios Π of the lines and the probability B of their number. Where lines continue the pattern,
    /// only edges and points that do not repeat, and the prior, distinguish the shifts.
    pub(in crate::search) fn weigh(&self, edges: &EdgeTerms<'_>, modes: &mut [Mode]) {
        let Some((first, half)) = modes.first().map(|mode| (mode.motion, mode.edges.len() / 2)) else { return };
        let shift_of = |mode: &Mode| self.shift_between(&first, &mode.motion).filter(|_| mode.edges.len() > half);
        let shifts: Vec<Option<Vector3<f64>>> = modes.iter().map(shift_of).collect();
        // The evidence of each line that any of the shifts explains by an edge of the pattern.
        let mut gains: BTreeMap<usize, f64> = BTreeMap::new();
        for (mode, _) in modes.iter().zip(&shifts).filter(|(_, shift)| shift.is_some()) {
            let repeats = |vertex: &&EdgeVertex| self.repeats[vertex.pair.model];
            for vertex in mode.edges.iter().map(|&v| &edges.vertices[v]).filter(repeats) {
                let Some(placed) = vertex.placed(&mode.motion) else { continue };
                let gain = gains.entry(vertex.pair.cloud).or_insert(f64::NEG_INFINITY);
                *gain = gain.max(vertex.residual_gain(&placed.residual));
            }
        }
        for (mode, shift) in modes.iter_mut().zip(&shifts) {
            let Some(own) = shift else { continue };
            let places = self.beyond(shifts.iter().flatten().map(|other| other - own));
            let used: BTreeSet<usize> = mode.edges.iter().map(|&v| edges.vertices[v].pair.cloud).collect();
            let further: Vec<f64> = gains
                .iter()
                .filter(|(line, gain)| !used.contains(*line) && **gain > 0.0)
                .map(|(_, &gain)| gain)
                .collect();
            let (k, m, n) = (mode.edges.len(), further.len().min(places), edges.ln_fraction.len() - 1);
            let fractions = ln_fraction(k + m, n + places) - ln_fraction(k, n);
            let around = LN_GOES_ON + further.iter().sum::<f64>() + fractions;
            mode.ln_evidence += around.max(0.0) + libm::log1p(libm::exp(-around.abs()));
        }
        modes.sort_by(Mode::by_evidence);
    }

    /// The number of places beyond the object at which its edges would lie at these shifts.
    fn beyond(&self, shifts: impl Iterator<Item = Vector3<f64>>) -> usize {
        let mut beyond: Vec<Segment> = Vec::new();
        for shift in shifts.filter(|shift| *shift != Vector3::zeros()) {
            for (segment, _) in self.segments.iter().zip(&self.repeats).filter(|(_, repeats)| **repeats) {
                let moved = Segment { middle: segment.middle + shift, ..*segment };
                let known = |other: &Segment| moved.is_at(other, &Vector3::zeros(), 2.0 * self.off);
                if !self.segments.iter().any(known) && !beyond.iter().any(known) {
                    beyond.push(moved);
                }
            }
        }
        beyond.len()
    }

    fn shift_between(&self, from: &Motion, to: &Motion) -> Option<Vector3<f64>> {
        Lattice::of(&self.basis, 1.0).shift_between(&self.middles, [from, to], MIN_STEP * self.off)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges of a number of equal boxes in a row.
    fn boxes(count: u8) -> Vec<[Vector3<f64>; 2]> {
        let corner = |c: u8, k: u8| {
            let at = [c & 1, c >> 1 & 1, c >> 2].map(f64::from);
            Vector3::new(0.45 * f64::from(k) + 0.3 * at[0], 0.4 * at[1], 0.3 * at[2])
        };
        let sides = (0..8u8).flat_map(|a| [1, 2, 4].map(|bit| (a, a ^ bit))).filter(|(a, b)| a < b);
        let sides: Vec<(u8, u8)> = sides.collect();
        (0..count).flat_map(|k| sides.iter().map(move |&(a, b)| [corner(a, k), corner(b, k)])).collect()
    }

    #[test]
    fn boxes_in_a_row_are_a_pattern_and_one_is_none() {
        let pattern = EdgePattern::of_segments(boxes(3).into_iter()).expect("a row");
        assert_eq!(pattern.basis.len(), 1);
        assert!((pattern.basis[0] - Vector3::new(0.45, 0.0, 0.0)).norm() < 1e-12);
        // One box more at either side, or two at one.
        let beyond = |steps: [f64; 2]| pattern.beyond(steps.into_iter().map(|step| pattern.basis[0] * step));
        assert_eq!([beyond([1.0, -1.0]), beyond([0.0, 2.0]), beyond([1.0, 2.0])], [24, 24, 24]);
        assert!(EdgePattern::of_segments(boxes(2).into_iter()).is_some());
        assert!(EdgePattern::of_segments(boxes(1).into_iter()).is_none());
    }
}
