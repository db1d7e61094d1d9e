//! Patterns that repeat by a translation: their continuation beyond the object looks like a part of it.

use nalgebra::Vector3;

use super::{
    edge_terms::EdgeTerms,
    fractions::ln_fraction,
    graph::ConsistencyGraph,
    lattice::{Lattice, forward, independent},
    likelihood::{Mode, PairTerms, ln_measured},
    motion::Motion,
    pattern_edges::{EdgeEvidence, repeated_edges},
    pattern_shifts::{ln_phase, ln_shifted},
    prior_terms::PriorTerms,
    seeds::MARGIN,
};
use crate::{
    problem::Problem,
    search::posterior::LN_RESEMBLES,
    site::{edge::ModelEdge, model::ModelPoint, target::diameter},
};

/// Maximum number of model points for the detection of a pattern, which takes cubic time.
const MAX_POINTS: usize = 128;
/// Minimum number of equally spaced collinear triples of a pattern, and the minimum fraction of the points.
const MIN_ROWS: usize = 3;
const MIN_FRACTION: f64 = 0.25;
/// Tolerance of a point's place in a row, as a fraction of the model's diameter.
const OFF_FRACTION: f64 = 0.015;
/// Minimum step in units of that tolerance.
const MIN_STEP: f64 = 3.0;
/// Number of points outside the pattern that suffice to identify an object.
const TELLING: usize = 3;
/// Maximum number of shifts whose places are compared.
const MAX_REGION: usize = 64;
/// Evidence (nats) that a pattern ends at one side of the object, above which a complete identification decides against
/// the shifts to this side; the margin of the search.
const ENDS: f64 = MARGIN;
/// Tolerance of a shift, as a fraction of the shortest step.
const SHIFT_FRACTION: f64 = 0.25;

/// The points of a model that repeat by a translation, with their continuation beyond the model.
///
/// Examples are a lattice, a ladder and a row of bolts.
pub(in crate::search) struct Pattern {
    /// Whether a model point belongs to the pattern.
    repeats: Vec<bool>,
    /// Whether a model edge does.
    edges_repeat: Vec<bool>,
    /// The points of the pattern (object frame).
    at: Vec<Vector3<f64>>,
    /// The next places beyond the model (object frame).
    pub(super) beyond: Vec<Vector3<f64>>,
    /// Tolerance of a place (m).
    off: f64,
    /// Mean variance of a coordinate of the points of the pattern (m²).
    variance: f64,
    /// The steps of the pattern, one to three (object frame).
    pub(super) basis: Vec<Vector3<f64>>,
}

/// ln evidence of a pattern that continues beyond the object at a pose, relative to clutter alone (nats).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::search) struct PatternEvidence {
    /// Another pattern with the same steps: the object is absent.
    pub(in crate::search) alone: f64,
    /// The object's own pattern, which holds the object at another shift.
    pub(in crate::search) shifted: f64,
    /// The pattern around the object.
    pub(in crate::search) around: f64,
    /// The evidence without the edges and the numbers of seen and unseen points of the pattern.
    in_blocks: f64,
    /// The prior density of the pose, and the evidence of the edges outside the pattern.
    ln_prior: f64,
    /// Whether the pose identifies a point outside the pattern.
    identifies: bool,
}

impl PatternEvidence {
    /// ln of the odds of this shift against another, without the numbers of seen and unseen points.
    pub(super) fn against(&self, other: &Self) -> f64 {
        match self.identifies || other.identifies {
            true => self.in_blocks - other.in_blocks,
            false => self.ln_prior - other.ln_prior,
        }
    }
}

impl Pattern {
    /// The pattern of a model and its edges; `None` without one.
    pub(in crate::search) fn of(model: &[ModelPoint], edges: &[ModelEdge]) -> Option<Self> {
        let n = model.len();
        let min = ((MIN_FRACTION * n as f64).ceil() as usize).max(MIN_ROWS);
        if !(MIN_ROWS + 2..=MAX_POINTS).contains(&n) {
            return None;
        }
        let at: Vec<Vector3<f64>> = model.iter().map(|point| point.at.coords).collect();
        let off = OFF_FRACTION * diameter(model);
        let mut along: Vec<&Vector3<f64>> = at.iter().collect();
        along.sort_by(|a, b| a.x.total_cmp(&b.x));
        let near = |place: &Vector3<f64>| {
            let from = along.partition_point(|p| p.x < place.x - off);
            let mut beside = along[from..].iter().take_while(|p| p.x <= place.x + off);
            beside.any(|p| (*p - place).norm_squared() <= off * off)
        };
        // Every midpoint of two others: the step to it, each once.
        let mut steps: Vec<Vector3<f64>> = Vec::new();
        for a in 0..n {
            for c in 0..a {
                let step = (at[a] - at[c]) / 2.0;
                if step.norm() >= MIN_STEP * off && near(&(at[c] + step)) {
                    steps.push(if forward(&step) { step } else { -step });
                }
            }
        }
        let alike = |step: &Vector3<f64>| steps.iter().filter(|other| (*other - step).norm() <= off).count();
        let common = steps.iter().filter(|step| alike(step) >= min).copied().collect();
        let basis = independent(common);
        if basis.is_empty() {
            return None;
        }
        let edges_repeat = repeated_edges(edges, model, &basis, off);
        let mut pattern = Self {
            repeats: vec![false; n],
            edges_repeat,
            at: Vec::new(),
            beyond: Vec::new(),
            off,
            variance: 0.0,
            basis,
        };
        let basis = pattern.basis.clone();
        let next = |i: usize| basis.iter().flat_map(|step| [*step, -step]).map(move |step| (i, step));
        for (i, step) in (0..n).flat_map(next) {
            if near(&(at[i] + step)) {
                pattern.repeats[i] = true;
            }
        }
        // Isolated points may lie on the same lattice or on a finer one.
        let (own, finer) = (Lattice::of(&basis, 1.0), Lattice::of(&repeated(&at, off), 0.5));
        let of_it: Vec<usize> = (0..n).filter(|&i| pattern.repeats[i]).collect();
        let on = |p: &Vector3<f64>| {
            let mut steps = of_it.iter().map(|&i| p - at[i]);
            steps.any(|step| own.off(&step) <= off || finer.off(&step) <= off)
        };
        let alone: Vec<usize> = (0..n).filter(|&i| !pattern.repeats[i] && on(&at[i])).collect();
        alone.into_iter().for_each(|i| pattern.repeats[i] = true);
        for (i, step) in (0..n).flat_map(next) {
            let place = at[i] + step;
            let known = || pattern.beyond.iter().any(|other| (other - place).norm() <= 2.0 * off);
            if pattern.repeats[i] && !near(&place) && !known() {
                pattern.beyond.push(place);
            }
        }
        let members: Vec<usize> = (0..n).filter(|&i| pattern.repeats[i]).collect();
        pattern.at = members.iter().map(|&i| at[i]).collect();
        pattern.variance = members.iter().map(|&i| model[i].sigma.powi(2)).sum::<f64>() / members.len().max(1) as f64;
        Some(pattern)
    }

    /// The points that distinguish the object from the pattern, if they suffice.
    pub(in crate::search) fn distinctive(&self) -> Option<Vec<bool>> {
        let distinctive: Vec<bool> = self.repeats.iter().map(|repeats| !repeats).collect();
        (distinctive.iter().filter(|&&distinctive| distinctive).count() >= TELLING).then_some(distinctive)
    }

    /// Adds to each mode the evidence of the pattern around the object; the best mode is then the first.
    ///
    /// Detectors and matchers lose a pattern in blocks, such as a row. If the pattern goes on to one side of the object
    /// ([`Self::goes_on_to`]), unseen points therefore do not distinguish the shifts to this side: such a shift has at
    /// least the evidence of the best mode, changed by the prior, by the residuals and by the points and edges outside
    /// the pattern alone, and may become the best. Poses that identify no such point are compared by the prior and these
    /// edges: a few corners with larger errors than stated decide their residuals. Where the pattern ends, evidence
    /// decides.
    ///
    /// Returns the evidence of the pattern at the best mode; `None` without modes.
    pub(in crate::search) fn weigh(
        &self,
        problem: &Problem<'_>,
        parts: (&PairTerms, &PriorTerms, &ConsistencyGraph),
        edges: Option<&EdgeTerms<'_>>,
        modes: &mut Vec<Mode>,
    ) -> Option<PatternEvidence> {
        let shifts = self.shifts_from_first(modes);
        let add = |(at, mut mode): (usize, Mode)| {
            let others = shifts[at].iter().flat_map(|own| shifts.iter().flatten().map(move |other| other - own));
            let beyond = self.beyond_all(others);
            let continued = self.continued(problem, parts, edges, &mode, &beyond);
            let around = continued.around;
            let (less, more) =
                if around < mode.ln_evidence { (around, mode.ln_evidence) } else { (mode.ln_evidence, around) };
            mode.ln_evidence = more + libm::log1p(libm::exp(less - more));
            (mode, continued, shifts[at])
        };
        let mut ranked: Vec<(Mode, PatternEvidence, Option<Vector3<f64>>)> =
            modes.drain(..).enumerate().map(add).collect();
        ranked.sort_by(|(a, ..), (b, ..)| a.by_evidence(b));
        if let Some(((best, of_best, Some(own)), others)) = ranked.split_first_mut() {
            for (other, continued, shift) in others.iter_mut() {
                let Some(shift) = shift else { continue };
                if self.goes_on_to(problem, parts, best, &(*shift - *own)) {
                    other.ln_evidence = other.ln_evidence.max(best.ln_evidence + continued.against(of_best));
                }
            }
            ranked.sort_by(|(a, ..), (b, ..)| a.by_evidence(b));
        }
        let of_best = ranked.first().map(|(_, continued, _)| *continued);
        modes.extend(ranked.into_iter().map(|(mode, ..)| mode));
        of_best
    }

    /// Whether the cloud shows the pattern where the object would be at this shift from the pose of a mode.
    ///
    /// A complete identification with few of these places seen shows that the pattern ends there. What lies on the other
    /// sides of the object says nothing: a board with a border continues on the sides from which a shifted pose came.
    pub(super) fn goes_on_to(
        &self,
        problem: &Problem<'_>,
        (terms, _, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
        mode: &Mode,
        shift: &Vector3<f64>,
    ) -> bool {
        let own = |place: &Vector3<f64>| self.at.iter().any(|known| (known - place).norm() <= 2.0 * self.off);
        let places: Vec<Vector3<f64>> = self.at.iter().map(|place| place + shift).filter(|place| !own(place)).collect();
        let (further, _) = self.seen_at(problem, (terms, graph), mode, &places);
        let (all, n) = (self.at.len(), places.len());
        let seen = mode.members.iter().filter(|v| self.repeats[graph.vertices[**v].model]).count();
        let ln_ends = ln_fraction(seen, all) + ln_fraction(further, n) - ln_fraction(seen + further, all + n);
        further > 0 && !(seen == all && ln_ends >= ENDS)
    }

    /// The number of these places (object frame) at which the cloud has a point that no pair of the mode uses, and the
    /// sum of their evidence against clutter (nats).
    fn seen_at(
        &self,
        problem: &Problem<'_>,
        (terms, graph): (&PairTerms, &ConsistencyGraph),
        mode: &Mode,
        places: &[Vector3<f64>],
    ) -> (usize, f64) {
        let of_pattern = || mode.members.iter().filter(|v| self.repeats[graph.vertices[**v].model]);
        let ln_clutter = of_pattern().map(|&v| terms.ln_density_about(v, graph.vertices[v].model)).sum::<f64>()
            / of_pattern().count().max(1) as f64;
        let mut taken = vec![false; problem.cloud.len()];
        mode.members.iter().for_each(|&v| taken[graph.vertices[v].cloud] = true);
        let (mut further, mut gains) = (0, 0.0);
        for place in places.iter().map(|place| mode.motion.apply(place)) {
            let free = problem.cloud.iter().zip(&taken).filter(|(_, taken)| !**taken);
            let gain = free
                .filter_map(|(point, _)| ln_measured(&point.position, self.variance, &place))
                .map(|ln_density| ln_density - ln_clutter)
                .fold(0.0, f64::max);
            gains += gain;
            further += usize::from(gain > 0.0);
        }
        (further, gains)
    }

    /// The shift of each mode from the first, if it is one.
    fn shifts_from_first(&self, modes: &[Mode]) -> Vec<Option<Vector3<f64>>> {
        modes.iter().map(|mode| self.shift_between(&modes[0].motion, &mode.motion, MIN_STEP * self.off)).collect()
    }

    /// Whether one pose is another one shifted within the pattern: points of one lie on points of the other.
    pub(in crate::search) fn is_shift(&self, from: &Motion, to: &Motion) -> bool {
        let shortest = self.basis.iter().map(|step| step.norm()).fold(f64::INFINITY, f64::min);
        let shift = self.shift_between(from, to, SHIFT_FRACTION * shortest).filter(|shift| *shift != Vector3::zeros());
        let own = |place: &Vector3<f64>| self.at.iter().any(|known| (known - place).norm() <= 2.0 * self.off);
        shift.is_some_and(|shift| self.at.iter().any(|place| own(&(place + shift))))
    }

    /// The shift from one pose to another (object frame), if it is one up to `off` (m).
    fn shift_between(&self, from: &Motion, to: &Motion, off: f64) -> Option<Vector3<f64>> {
        Lattice::of(&self.basis, 1.0).shift_between(&self.at, [from, to], off)
    }

    /// The places beyond the object at which the pattern may continue, if the object may also be at these shifts.
    ///
    /// Poses that differ by a shift are compared over the same places: what one explains as the object, the other
    /// explains as the pattern around it. With the next places of each pose alone, a pose that lies further within the
    /// pattern would explain more of the cloud.
    fn beyond_all(&self, shifts: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
        let mut beyond = self.beyond.clone();
        let same = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() <= 2.0 * self.off;
        for shift in shifts.take(MAX_REGION).filter(|shift| *shift != Vector3::zeros()) {
            for place in self.at.iter().chain(&self.beyond).map(|place| place + shift) {
                if !self.at.iter().chain(&beyond).any(|known| same(known, &place)) {
                    beyond.push(place);
                }
            }
        }
        beyond
    }

    /// The evidence of the continued pattern at the pose of a mode, over the places `beyond` the object.
    ///
    /// Let k of n model points be seen, and m of the M places beyond the object. The pattern alone shows them all
    /// with one visible fraction, B(k + m, n + M), since the object ends nowhere in it; around the object it has a
    /// fraction of its own, B(k, n)·B(m, M). Points outside the pattern belong to the object only.
    ///
    /// A pattern without the object in this place is one of two. The object's own pattern may hold the object at another
    /// shift, so that the pose is not unique: that has the prior probability of the other shifts ([`ln_shifted`]). If points of the object are unseen while the
    /// pattern continues, both are equally likely, since matchers lose a pattern in blocks: only a complete
    /// identification shows where the object ends. Another pattern with the same steps has the prior probability of
    /// structured clutter ([`LN_RESEMBLES`]), and its phase is uniform ([`ln_phase`]).
    pub(in crate::search) fn continued(
        &self,
        problem: &Problem<'_>,
        (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
        edges: Option<&EdgeTerms<'_>>,
        mode: &Mode,
        beyond: &[Vector3<f64>],
    ) -> PatternEvidence {
        let by_edges =
            edges.map_or_else(EdgeEvidence::default, |edges| EdgeEvidence::of(edges, &self.edges_repeat, mode));
        let repeats = |v: &&usize| self.repeats[graph.vertices[**v].model];
        let of_pattern: Vec<usize> = mode.members.iter().filter(repeats).copied().collect();
        let points: f64 =
            mode.members.iter().filter(|v| !repeats(v)).map(|&v| terms.residual_gain(v, &mode.motion)).sum();
        // What the pattern alone does not show.
        let own = points + by_edges.all - by_edges.repeated;
        let (n, all) = (self.repeats.len(), self.repeats.iter().filter(|&&repeats| repeats).count());
        let (k, seen) = (mode.members.len(), of_pattern.len());
        let (further, gains) = self.seen_at(problem, (terms, graph), mode, beyond);
        let beyond = beyond.len();
        let shown = mode.ln_evidence - ln_fraction(k, n) - own;
        let goes_on = gains + ln_fraction(seen + further, all + beyond);
        // Enough points outside the pattern must identify the object: the pattern itself may end anywhere.
        let ends = if n - all >= TELLING { ln_fraction(seen, all) } else { f64::NEG_INFINITY };
        let around = mode.ln_evidence + gains + ln_fraction(further, beyond);
        let likely = shown + goes_on.max(ends);
        let incomplete = seen < all && further > 0;
        let own_pattern = if incomplete { likely.max(around - own) } else { likely };
        let another = likely + LN_RESEMBLES + ln_phase(&self.basis, prior_terms, &mode.motion);
        let shifted = own_pattern + ln_shifted(&self.basis, prior_terms, &mode.motion);
        let of_points = mode.ln_evidence - by_edges.all;
        let in_blocks = of_points - ln_fraction(k, n) + ln_fraction(k - seen, n - all) + gains + by_edges.distinctive;
        let ln_prior = prior_terms.known.as_ref().map_or(0.0, |_| prior_terms.ln_density(&mode.motion));
        let ln_prior = ln_prior + by_edges.distinctive;
        PatternEvidence { alone: another, shifted, around, in_blocks, ln_prior, identifies: k > seen }
    }
}

/// The shortest steps in up to three directions by each of which [`MIN_ROWS`] points or more follow others.
fn repeated(at: &[Vector3<f64>], off: f64) -> Vec<Vector3<f64>> {
    let mut steps: Vec<Vector3<f64>> = Vec::new();
    for (a, from) in at.iter().enumerate() {
        let to = at[..a].iter().map(|to| to - from).filter(|step| step.norm() >= MIN_STEP * off);
        steps.extend(to.map(|step| if forward(&step) { step } else { -step }));
    }
    steps.sort_by(|a, b| a.x.total_cmp(&b.x));
    let alike = |step: &Vector3<f64>| {
        let from = steps.partition_point(|other| other.x < step.x - off);
        let beside = steps[from..].iter().take_while(|other| other.x <= step.x + off);
        beside.filter(|other| (*other - step).norm_squared() <= off * off).count()
    };
    let common = steps.iter().filter(|step| alike(step) >= MIN_ROWS).copied().collect();
    independent(common)
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Point;

    use super::*;

    fn pattern(places: impl IntoIterator<Item = [f64; 3]>) -> Option<(usize, usize)> {
        let model: Vec<ModelPoint> = places.into_iter().map(|at| ModelPoint::exact("", Point::from(at))).collect();
        let pattern = Pattern::of(&model, &[])?;
        Some((pattern.repeats.iter().filter(|&&repeats| repeats).count(), pattern.beyond.len()))
    }

    fn lattice(columns: u8, rows: u8) -> Vec<[f64; 3]> {
        let row = |i: u8| (0..rows).map(move |k| [0.25 * f64::from(i), 0.25 * f64::from(k), 0.0]);
        (0..columns).flat_map(row).collect()
    }

    #[test]
    fn a_lattice_repeats_and_goes_on_at_each_side() {
        let off = [[0.735, 0.66, 0.18], [0.105, 0.56, 0.09], [0.955, 0.09, 0.07], [0.425, 0.15, 0.22]];
        assert_eq!(pattern(lattice(6, 5).into_iter().chain(off)), Some((30, 22)));
        // A ladder of six rungs continues at its two ends.
        assert_eq!(pattern(lattice(6, 2)), Some((12, 4)));
    }

    #[test]
    fn a_lone_point_on_the_lattice_is_not_distinctive() {
        // A row, a column, and isolated points.
        let row = (0..6).map(|x| (x, 0));
        let nodes: Vec<(i32, i32)> = row.chain([(5, 2), (5, 3), (5, 4), (5, 5), (0, 2), (2, 3), (3, 5)]).collect();
        let places: Vec<[f64; 3]> = nodes.iter().map(|&(x, y)| [0.3 * f64::from(x), 0.3 * f64::from(y), 0.0]).collect();
        let all = |off: f64| {
            let reported = [[0.14, 0.44, off], [0.75, 0.16, off], [1.33, 0.15, off]];
            places.iter().copied().chain(reported.into_iter().filter(move |_| off > 0.0))
        };
        let distinctive = |off: f64| {
            let model: Vec<ModelPoint> = all(off).map(|at| ModelPoint::exact("", Point::from(at))).collect();
            let distinctive = Pattern::of(&model, &[]).expect("rows and columns").distinctive();
            distinctive.map(|distinctive| distinctive.iter().filter(|&&distinctive| distinctive).count())
        };
        assert_eq!(distinctive(0.0), None);
        assert_eq!(distinctive(0.2), Some(3));
    }

    /// A step is a shift; four tenths of a step, a step out of the plane, and a pose beyond the pattern are none.
    #[test]
    fn a_shift_moves_the_pattern_onto_itself() {
        let points: Vec<ModelPoint> =
            lattice(6, 5).into_iter().map(|at| ModelPoint::exact("", Point::from(at))).collect();
        let pattern = Pattern::of(&points, &[]).expect("a lattice");
        let moved = |by: [f64; 3]| {
            let of = |at: Vector3<f64>| Motion { rotation: nalgebra::Matrix3::identity(), translation: at };
            pattern.is_shift(&of(Vector3::zeros()), &of(0.25 * Vector3::from(by)))
        };
        let cases = [[1.0, 0.0, 0.0], [-2.1, 1.1, 0.0], [0.0; 3], [0.4, 0.4, 0.0], [1.0, 0.0, 1.0], [7.0, 0.0, 0.0]];
        assert_eq!(cases.map(moved), [true, true, false, false, false, false]);
    }

    #[test]
    fn what_does_not_come_three_times_in_a_row_is_no_pattern() {
        let corners = (0..8u8).map(|c| [0, 1, 2].map(|k| f64::from(c >> k & 1) * [1.0, 1.5, 2.2][k]));
        assert_eq!(pattern(corners), None);
        assert_eq!(pattern(lattice(2, 2)), None);
        let places =
            [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.5, 0.0, 1.5], [1.0, 2.2, 0.3], [-1.6, 0.4, 1.0]];
        assert_eq!(pattern(places), None);
    }
}
