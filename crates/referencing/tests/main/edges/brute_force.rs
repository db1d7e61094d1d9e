//! E7: exact searches against brute force over every admissible set of up to four points and four edges.
//!
//! The definition of admissible sets is implemented here independently, from its description, for data without noise.

use nalgebra::{Matrix2, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_referencing::{Correspondence, MaximumClique, Rejected, Tolerance};

use super::planted::{Draw, Planted, Sets};

/// The tolerances of angles (rad) and distances (m) without noise, and of points (m).
const ANGLE: f64 = 0.02;
const DISTANCE: f64 = 5e-3;
const DELTA: f64 = 0.03;
/// Sine up to which edges count as parallel, and overlap of the shorter of edge and line.
const PARALLEL: f64 = 0.2;
const OVERLAP: f64 = 0.25;
/// Distance from a bound at which rounding decides.
const ROUNDING: f64 = 1e-7;

/// One feature of a set; an edge has a direction.
#[derive(Clone, Copy, PartialEq)]
enum Member {
    Point(usize, usize),
    Edge(usize, usize, bool),
}

/// The model's part and the measured part of a feature: a place, or two ends.
#[derive(Clone, Copy)]
enum Place {
    Point(Vector3<f64>),
    Line(Vector3<f64>, Vector3<f64>),
}

/// The brute force over one problem.
struct Brute<'a> {
    scene: &'a Planted,
    orientation: bool,
    size: usize,
    best: Vec<Sets>,
    doubtful: bool,
}

impl Brute<'_> {
    fn places(&self, member: Member) -> [Place; 2] {
        match member {
            Member::Point(i, j) => {
                [Place::Point(self.scene.model[i].at.coords), Place::Point(self.scene.cloud[j].position.at.coords)]
            }
            Member::Edge(i, j, opposite) => {
                let [a, b] = self.scene.edges[i].places(&self.scene.model).map(|end| end.coords);
                let [c, d] = self.scene.lines[j].ends.map(|end| end.coords);
                [if opposite { Place::Line(b, a) } else { Place::Line(a, b) }, Place::Line(c, d)]
            }
        }
    }

    /// Whether a value is at most a bound, up to rounding.
    fn up_to(&mut self, value: f64, bound: f64) -> bool {
        self.doubtful |= (value - bound).abs() < ROUNDING;
        value <= bound
    }

    fn agree(&mut self, a: Member, b: Member) -> bool {
        let ([known_a, seen_a], [known_b, seen_b]) = (self.places(a), self.places(b));
        match (known_a, seen_a, known_b, seen_b) {
            (Place::Point(p), Place::Point(c), Place::Point(q), Place::Point(d)) => {
                self.up_to(((p - q).norm() - (c - d).norm()).abs(), DELTA)
            }
            (Place::Point(p), Place::Point(c), Place::Line(e, f), Place::Line(g, h))
            | (Place::Line(e, f), Place::Line(g, h), Place::Point(p), Place::Point(c)) => {
                let away =
                    |p: Vector3<f64>, e: Vector3<f64>, f: Vector3<f64>| (p - e).cross(&(f - e).normalize()).norm();
                let foot = |p: Vector3<f64>, e: Vector3<f64>, f: Vector3<f64>| (p - e).dot(&(f - e).normalize());
                self.up_to((away(p, e, f) - away(c, g, h)).abs(), DISTANCE)
                    && self.overlap((f - e).norm(), (h - g).norm(), foot(p, e, f), foot(c, g, h), DISTANCE)
            }
            (Place::Line(a, b), Place::Line(c, d), Place::Line(e, f), Place::Line(g, h)) => {
                self.edges_agree([[a, b], [e, f]], [[c, d], [g, h]])
            }
            _ => unreachable!("both parts of a feature are of one kind"),
        }
    }

    /// Whether a line of length `line` covers a quarter of an edge of length `edge`, or of itself.
    fn overlap(&mut self, edge: f64, line: f64, known: f64, seen: f64, slack: f64) -> bool {
        // The line's ends along the edge.
        let (low, high) = (known - seen, known - seen + line);
        let needed = OVERLAP * edge.min(line);
        self.up_to(needed - slack, edge - low) && self.up_to(needed - slack, high)
    }

    fn edges_agree(&mut self, known: [[Vector3<f64>; 2]; 2], seen: [[Vector3<f64>; 2]; 2]) -> bool {
        let along = |of: [[Vector3<f64>; 2]; 2]| of.map(|[a, b]| (b - a).normalize());
        let ([d, e], [u, v]) = (along(known), along(seen));
        if !self.up_to((d.angle(&e) - u.angle(&v)).abs(), ANGLE) {
            return false;
        }
        let (sine, sine_seen) = (d.cross(&e).norm(), u.cross(&v).norm());
        let parallel = self.up_to(sine, PARALLEL) | self.up_to(sine_seen, PARALLEL);
        if parallel {
            return self.parallel_agree(known, seen, sine);
        }
        let signed = |of: [[Vector3<f64>; 2]; 2], d: Vector3<f64>, e: Vector3<f64>| {
            (of[1][0] - of[0][0]).dot(&d.cross(&e).normalize())
        };
        let (of_model, of_lines) = (signed(known, d, e), signed(seen, u, v));
        let off = if self.orientation { of_model - of_lines } else { of_model.abs() - of_lines.abs() };
        if !self.up_to(off.abs(), DISTANCE) {
            return false;
        }
        // The feet of the common perpendicular: a + s d − b − t e is orthogonal to both.
        let feet = |of: [[Vector3<f64>; 2]; 2], d: Vector3<f64>, e: Vector3<f64>| {
            let step = of[1][0] - of[0][0];
            let system = Matrix2::new(1.0, -d.dot(&e), d.dot(&e), -1.0);
            system.try_inverse().expect("not parallel") * Vector2::new(step.dot(&d), step.dot(&e))
        };
        let (f, g) = (feet(known, d, e), feet(seen, u, v));
        let length = |ends: [Vector3<f64>; 2]| (ends[1] - ends[0]).norm();
        (0..2).all(|k| self.overlap(length(known[k]), length(seen[k]), f[k], g[k], DISTANCE / sine_seen))
    }

    fn parallel_agree(&mut self, known: [[Vector3<f64>; 2]; 2], seen: [[Vector3<f64>; 2]; 2], sine: f64) -> bool {
        let length = |ends: [Vector3<f64>; 2]| (ends[1] - ends[0]).norm();
        let distance = |from: [Vector3<f64>; 2], to: [Vector3<f64>; 2]| {
            ((to[0] + to[1]) / 2.0 - from[0]).cross(&(from[1] - from[0]).normalize()).norm()
        };
        for (one, other) in [(0, 1), (1, 0)] {
            let off = (distance(known[one], known[other]) - distance(seen[one], seen[other])).abs();
            let slope = sine * (length(known[other]) + length(seen[other])) / 2.0;
            if !self.up_to(off, DISTANCE + slope) {
                return false;
            }
        }
        // The slides at which each overlaps, along the first.
        let [d, u] = [known, seen].map(|of| (of[0][1] - of[0][0]).normalize());
        let mut common = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..2 {
            let span = |ends: [Vector3<f64>; 2], from: Vector3<f64>, d: Vector3<f64>| {
                let [a, b] = ends.map(|end| (end - from).dot(&d));
                (a.min(b), a.max(b))
            };
            let (y, x) = (span(known[k], known[0][0], d), span(seen[k], seen[0][0], u));
            let needed = OVERLAP * (y.1 - y.0).min(x.1 - x.0);
            common = (common.0.max(x.0 + needed - y.1), common.1.min(x.1 - needed - y.0));
        }
        self.up_to(common.0, common.1 + DISTANCE + sine * (length(known[0]) + length(known[1])))
    }

    /// Whether a subset of the set with its last member is a mirror image.
    fn mirrored(&mut self, set: &[Member]) -> bool {
        let Some((&last, rest)) = set.split_last() else { return false };
        for (i, &a) in rest.iter().enumerate() {
            for (k, &b) in rest[..i].iter().enumerate() {
                if self.opposed(&[a, b, last]) || rest[..k].iter().any(|&c| self.opposed(&[a, b, c, last])) {
                    return true;
                }
            }
        }
        false
    }

    /// Whether the volume of three features with an edge, or of four points, has the other sign.
    fn opposed(&mut self, members: &[Member]) -> bool {
        let (mut points, mut lines) = (Vec::new(), Vec::new());
        for &member in members {
            match self.places(member) {
                [Place::Point(p), Place::Point(c)] => points.push([p, c]),
                [Place::Line(a, b), Place::Line(c, d)] => {
                    lines.push([(a, (b - a).normalize()), (c, (d - c).normalize())]);
                }
                _ => unreachable!("both parts of a feature are of one kind"),
            }
        }
        let det = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>| {
            nalgebra::Matrix3::from_columns(&[a, b, c]).determinant()
        };
        let volumes: Vec<[f64; 2]> = match (&points[..], &lines[..]) {
            ([p, q, r, s], []) => vec![[0, 1].map(|k| det(q[k] - p[k], r[k] - p[k], s[k] - p[k]))],
            ([p, q], [l]) => vec![[0, 1].map(|k| det(q[k] - p[k], l[k].0 - p[k], l[k].1))],
            ([p], [l, m]) => [l, m].map(|from| [0, 1].map(|k| det(from[k].0 - p[k], l[k].1, m[k].1))).to_vec(),
            ([], [l, m, n]) => vec![[0, 1].map(|k| det(l[k].1, m[k].1, n[k].1))],
            _ => return false,
        };
        let floor = match (&points[..], lines.len()) {
            (_, 0) => 1e-9,
            ([p, q], _) => DISTANCE * (q[0] - p[0]).norm(),
            ([_], _) => DISTANCE,
            _ => ANGLE,
        };
        let [known, seen] = volumes.into_iter().max_by(|a, b| a[0].abs().total_cmp(&b[0].abs())).expect("a volume");
        let decisive = !self.up_to(known.abs(), floor);
        self.doubtful |= decisive && seen.abs() < ROUNDING;
        decisive && known * seen <= 0.0
    }

    /// Tries every candidate of each model feature, and none.
    fn extend(&mut self, feature: usize, set: &mut Vec<Member>) {
        let (points, edges) = (self.scene.model.len(), self.scene.edges.len());
        if feature == points + edges {
            if set.len() > self.size {
                (self.size, self.best) = (set.len(), Vec::new());
            }
            if set.len() == self.size {
                let mut sets = Sets::default();
                for member in set.iter() {
                    match *member {
                        Member::Point(model, cloud) => sets.0.push(Correspondence { model, cloud }),
                        Member::Edge(model, cloud, _) => sets.1.push(Correspondence { model, cloud }),
                    }
                }
                self.best.push(sets);
            }
            return;
        }
        self.extend(feature + 1, set);
        let members: Vec<Member> = match feature.checked_sub(points) {
            None => self.scene.candidates.lists[feature].iter().map(|&j| Member::Point(feature, j)).collect(),
            Some(i) => {
                let both = |&j: &usize| [false, true].map(|opposite| Member::Edge(i, j, opposite));
                self.scene.of_edges[i].iter().flat_map(both).collect()
            }
        };
        for member in members {
            let taken = set.iter().any(|other| match (*other, member) {
                (Member::Point(_, j), Member::Point(_, k)) | (Member::Edge(_, j, _), Member::Edge(_, k, _)) => j == k,
                _ => false,
            });
            if taken || !set.clone().into_iter().all(|other| self.agree(other, member)) {
                continue;
            }
            set.push(member);
            if !self.orientation || !self.mirrored(set) {
                self.extend(feature + 1, set);
            }
            set.pop();
        }
    }
}

/// Compares the clique with brute force; the size, if rounding decided nothing.
fn compared(seed: u64, orientation: bool) -> Option<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draw = Draw {
        model: (rng.random_range(0..=4), rng.random_range(1..=4)),
        clutter: (rng.random_range(0..=2), rng.random_range(0..=2)),
        noise: 0.0,
        mirrored: rng.random_bool(0.3),
        boxed: rng.random_bool(0.5),
    };
    let mut scene = Planted::of(draw, &mut rng);
    scene.tolerance = Tolerance::Fixed(DELTA);
    for list in scene.candidates.lists.iter_mut().chain(&mut scene.of_edges) {
        list.retain(|_| rng.random_bool(0.7));
    }
    let mut brute = Brute { scene: &scene, orientation, size: 0, best: Vec::new(), doubtful: false };
    brute.extend(0, &mut Vec::new());
    let Brute { size, best, doubtful, .. } = brute;
    let settings = MaximumClique { orientation, ..MaximumClique::default() };
    if doubtful || scene.of_edges.iter().all(Vec::is_empty) {
        return None;
    }
    match scene.answer(&settings) {
        Ok(found) => {
            assert_eq!(found.pairs.len() + found.edges.len(), size, "seed {seed}, orientation {orientation}");
            assert!(found.optimal && found.consensus_bound == size, "seed {seed}");
            let mut named: Vec<Sets> = found.alternatives.into_iter().zip(found.alternative_edges).collect();
            named.push((found.pairs, found.edges));
            assert!(named.iter().all(|set| best.contains(set)), "seed {seed}: {named:?}, brute {best:?}");
        }
        Err(Rejected::TooFewFeatures { .. }) => {
            assert!(size < 3 || 2 * scene.model.len() + 3 * scene.edges.len() < 6 || size == 0, "seed {seed}: {size}")
        }
        Err(Rejected::NoConsensus { best, .. }) => assert!(best < 3 && best == size, "seed {seed}: {best}, {size}"),
        Err(Rejected::Mirrored { .. }) => assert!(orientation && size == 3, "seed {seed}: {size}"),
        Err(unproved) => panic!("seed {seed}: {unproved}"),
    }
    Some(size)
}

/// Fails if the last line is omitted, if the sign of the distance of two edges is ignored, and if triples with an edge are
/// not tested for mirror images.
#[test]
fn exact_searches_with_edges_are_brute_force() {
    let sizes: Vec<usize> = (0..600).flat_map(|seed| [false, true].map(|by| compared(seed, by))).flatten().collect();
    let large = sizes.iter().filter(|size| **size >= 4).count();
    assert!(sizes.len() > 600 && large > 200, "{} compared, {large} of four and more", sizes.len());
}
