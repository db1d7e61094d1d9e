//! Small problems of points and edges with a known answer.

use nalgebra::{Matrix3, Matrix4, Vector3, Vector6};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_geometry::{Camera, MeasuredLine, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{
    Candidates, Correspondence, Edges, End, Identification, ModelEdge, ModelPoint, Problem, Rejected, SEARCHES, Search,
    Tolerance,
};

/// A problem; lines and points of the object come first, in the order of the model.
#[derive(Clone)]
pub(super) struct Planted {
    pub(super) model: Vec<ModelPoint>,
    pub(super) cloud: Vec<MeasuredPoint>,
    pub(super) candidates: Candidates,
    pub(super) edges: Vec<ModelEdge>,
    pub(super) lines: Vec<MeasuredLine>,
    pub(super) of_edges: Vec<Vec<usize>>,
    pub(super) tolerance: Tolerance,
}

/// What is drawn.
#[derive(Clone, Copy)]
pub(super) struct Draw {
    /// The numbers of model points and edges.
    pub(super) model: (usize, usize),
    /// The numbers of points and lines of clutter.
    pub(super) clutter: (usize, usize),
    /// Half of the largest error of a measured coordinate (m); its standard deviation is the double.
    pub(super) noise: f64,
    /// Whether the scene is a mirror image.
    pub(super) mirrored: bool,
    /// Whether edges have one of three directions at right angles.
    pub(super) boxed: bool,
}

pub(super) fn place(rng: &mut impl Rng, half: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-half..half))
}

fn measured_point(at: Vector3<f64>, sigma: f64) -> MeasuredPoint {
    let covariance = Matrix3::identity() * (sigma * sigma);
    MeasuredPoint { position: UncertainPoint { at: Point::from(at), covariance }, pixels: None }
}

pub(super) fn measured_line(ends: [Vector3<f64>; 2], sigma: f64) -> MeasuredLine {
    let offsets = Matrix4::identity() * (sigma * sigma);
    MeasuredLine { ends: ends.map(Point::from), offsets, segments: None, depth: true }
}

impl Planted {
    /// A scene in which everything is visible and everything is a candidate.
    pub(super) fn of(draw: Draw, rng: &mut ChaCha8Rng) -> Self {
        let motion = Transform::<Camera, Object>::exp(&Vector6::from_fn(|_, _| rng.random_range(-1.5..1.5)));
        let sigma = 2.0 * draw.noise;
        let noise = |rng: &mut ChaCha8Rng| if draw.noise > 0.0 { place(rng, draw.noise) } else { Vector3::zeros() };
        let image = |at: Vector3<f64>| {
            let at = if draw.mirrored { Vector3::new(at.x, at.y, -at.z) } else { at };
            (motion * Point::from(at)).coords
        };
        let axis = |rng: &mut ChaCha8Rng| match draw.boxed {
            true => Vector3::ith(rng.random_range(0..3), 1.0),
            false => place(rng, 1.0).try_normalize(0.1).unwrap_or_else(Vector3::x),
        };
        let points: Vec<Vector3<f64>> = (0..draw.model.0).map(|_| place(rng, 1.0)).collect();
        let ends: Vec<[Vector3<f64>; 2]> = (0..draw.model.1)
            .map(|_| {
                let (from, along) = (place(rng, 0.8), axis(rng));
                [from, from + along * rng.random_range(0.4..0.9)]
            })
            .collect();
        let mut cloud: Vec<MeasuredPoint> =
            points.iter().map(|at| measured_point(image(*at) + noise(rng), sigma)).collect();
        let mut lines: Vec<MeasuredLine> = ends
            .iter()
            .map(|[from, to]| {
                let (start, end) = (rng.random_range(-0.2..0.3), rng.random_range(0.7..1.2));
                let mut part = [start, end].map(|t| image(from + (to - from) * t) + noise(rng));
                if rng.random_bool(0.5) {
                    part.reverse();
                }
                measured_line(part, sigma)
            })
            .collect();
        cloud.extend((0..draw.clutter.0).map(|_| measured_point(image(place(rng, 1.0)), sigma)));
        for _ in 0..draw.clutter.1 {
            let (from, along) = (place(rng, 0.8), axis(rng));
            let part = [from, from + along * rng.random_range(0.3..0.9)];
            lines.push(measured_line(part.map(image), sigma));
        }
        let pairs = (0..points.len()).flat_map(|i| (0..cloud.len()).map(move |j| (i, j)));
        Self {
            model: points.iter().map(|at| ModelPoint::exact("P", Point::from(*at))).collect(),
            candidates: Candidates::from_pairs(points.len(), pairs),
            cloud,
            of_edges: vec![(0..lines.len()).collect(); ends.len()],
            edges: ends.iter().map(|ends| edge(ends.map(|at| End::At(Point::from(at))))).collect(),
            lines,
            tolerance: Tolerance::Sigmas(3.0),
        }
    }

    pub(super) fn problem(&self) -> Problem<'_> {
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: self.tolerance,
            prior: None,
            edges: Edges { model: &self.edges, lines: &self.lines, candidates: &self.of_edges },
        }
    }

    /// The answer of a search.
    pub(super) fn answer(&self, search: &dyn Search) -> Result<Identification, Rejected> {
        search.search(&self.problem(), &mut ChaCha8Rng::seed_from_u64(7))
    }
}

pub(super) fn edge(ends: [End; 2]) -> ModelEdge {
    ModelEdge { id: "e".to_owned(), ends, sigma: 0.0, faces: Vec::new() }
}

/// The pairs of points and of edges of an answer.
pub(super) type Sets = (Vec<Correspondence>, Vec<Correspondence>);

pub(super) fn sets(found: &Identification) -> Sets {
    (found.pairs.clone(), found.edges.clone())
}

/// The pairs of the first `points` points and `edges` edges with their own measurements.
pub(super) fn truth((points, edges): (usize, usize)) -> Sets {
    let own = |count: usize| (0..count).map(|i| Correspondence { model: i, cloud: i }).collect();
    (own(points), own(edges))
}

/// Every registered search that identifies edges, with its name.
pub(super) fn searches() -> Vec<(&'static str, Box<dyn Search>)> {
    let built = SEARCHES
        .listings()
        .into_iter()
        .map(|listing| (listing.name, SEARCHES.build(&Choice::named(listing.name)).expect("a listed search")));
    built.filter(|(_, search)| search.takes_edges()).collect()
}
