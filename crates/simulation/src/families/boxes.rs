//! Families a, b, c, f and g: points on the edges and faces of a box.

use nalgebra::Vector3;
use seafix_geometry::Point;

use super::{
    clutter::{EDGE_JITTER, Scene, in_gates, on_edge, on_face},
    family::{Family, Part, Presence, Source},
    generated::Generated,
    prior::{ahead, prior_pose},
    problem::{GeneratedProblem, micrometres, round},
    truth::{GeneratedParameters, GeneratedTruth},
};
use crate::stream::Stream;

/// Fraction of the model points on edges; the rest lies on faces.
const ON_EDGES: f64 = 0.6;
/// Half extents of the boxes along their axes (m).
const SMALL: [f64; 3] = [1.25, 0.75, 0.75];
const LARGE: [f64; 3] = [2.5, 1.75, 1.5];
const MEDIUM: [f64; 3] = [2.0, 1.5, 1.25];

/// The parameters that the problem number determines.
struct Cell {
    half: [f64; 3],
    /// Distance of the object from the camera (m).
    distance: f64,
    /// Minimum distance of two model points (m).
    apart: f64,
    n: usize,
    m: usize,
    visible: usize,
    /// Half-size of the gates (m); `None` without a prior.
    gate: Option<f64>,
    /// Margin of the scene about the object (m).
    margin: f64,
    sigma: f64,
    /// Ratio of depth noise to lateral noise.
    depth: u32,
    /// Whether all clutter lies in gates.
    dense: bool,
    /// Minimum distance of clutter from a hidden model point (m).
    clear: f64,
}

impl Cell {
    fn of(source: &Source) -> Self {
        let mut stream = source.stream(Part::Cell);
        let k = usize::try_from(source.number % 1_000_000).expect("it is below a million");
        let site = Self {
            half: LARGE,
            distance: 7.0,
            apart: 0.25,
            n: 50,
            m: [500, 1000, 2000][k % 3],
            visible: 0,
            gate: Some(0.5),
            margin: 0.5,
            sigma: 0.01,
            depth: 1,
            dense: false,
            clear: 0.0,
        };
        match source.family {
            Family::A => {
                let (n, gate) = (7 + stream.below(2), [0.2, 0.3, 0.5][k / 7 % 3]);
                Self {
                    half: SMALL,
                    distance: 4.0,
                    apart: 0.3,
                    n,
                    m: 89,
                    visible: (2 + k % 7).min(n),
                    gate: Some(gate),
                    margin: gate,
                    dense: k / 63 % 2 == 1,
                    ..site
                }
            }
            Family::B => Self {
                visible: 12 + stream.below(24),
                sigma: [0.01, 0.02, 0.03][k / 3 % 3],
                depth: [1, 3][k / 9 % 2],
                clear: 0.15,
                ..site
            },
            Family::F => Self {
                visible: 4 + k / 3 % 6,
                gate: Some([0.3, 0.5][k % 2]),
                sigma: [0.01, 0.02][k / 2 % 2],
                clear: 0.18,
                ..site
            },
            Family::G => Self { visible: [6, 8, 10, 12, 14, 20][k / 3 % 6], dense: true, ..site },
            _ => {
                let n = [20, 30, 50][k % 3];
                let (m, visible) = ([100, 200, 300][k % 3], n * 3 / 5);
                Self { half: MEDIUM, distance: 6.0, n, m, visible, gate: None, ..site }
            }
        }
    }

    fn parameters(&self, source: &Source, visible: usize) -> GeneratedParameters {
        let site = matches!(source.family, Family::B | Family::F | Family::G);
        GeneratedParameters {
            n: Some(self.n),
            m: Some(self.m),
            visible: Some(visible),
            gate: self.gate,
            dense: (source.family == Family::A).then_some(self.dense),
            sigma: site.then_some(self.sigma),
            aniso: (source.family == Family::B).then_some(self.depth),
            absent: source.absent().then_some(true),
            replaced: (source.presence == Presence::Replaced).then_some(true),
            ..GeneratedParameters::default()
        }
    }
}

/// The model points, with a minimum distance of `apart`.
fn model(cell: &Cell, stream: &mut Stream) -> Vec<Vector3<f64>> {
    let half = Vector3::from(cell.half);
    let mut points: Vec<Vector3<f64>> = Vec::new();
    while points.len() < cell.n {
        let at = if stream.unit() < ON_EDGES { on_edge(stream, &half) } else { on_face(stream, &half) };
        let at = at + stream.normal3(EDGE_JITTER);
        if points.iter().all(|other| (at - other).norm() >= cell.apart) {
            points.push(at);
        }
    }
    points
}

/// The indices 0..n in random order.
pub(super) fn shuffled(n: usize, stream: &mut Stream) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, stream.below(k + 1));
    }
    order
}

pub(super) fn draw(source: &Source) -> Generated {
    let cell = Cell::of(source);
    let model = model(&cell, &mut source.stream(Part::Model));
    let pose = ahead(&mut source.stream(Part::Pose), cell.distance);
    let placed: Vec<Vector3<f64>> = model.iter().map(|at| (pose * Point::from(*at)).coords).collect();
    let mut seen = shuffled(cell.n, &mut source.stream(Part::Visible));
    let hidden = seen.split_off(if source.absent() { 0 } else { cell.visible });
    let noise = noise(&cell);
    let mut stream = source.stream(Part::Noise);
    let measured: Vec<(usize, Vector3<f64>)> =
        seen.iter().map(|&i| (i, placed[i] + stream.normal3(1.0).component_mul(&noise))).collect();
    let prior = cell.gate.map(|gate| {
        let seen: Vec<_> = measured.iter().map(|&(i, at)| (model[i], at)).collect();
        prior_pose(&mut source.stream(Part::Prior), &pose, &model, &seen, gate, 0.6)
    });

    let mut stream = source.stream(Part::Clutter);
    let replaced = source.presence == Presence::Replaced;
    let half = if replaced { other(&cell.half, &mut source.stream(Part::Replacement)) } else { cell.half.into() };
    let scene = Scene { camera_from_object: &pose, half, margin: cell.margin, placed: &placed };
    let predicted: Option<Vec<Vector3<f64>>> = prior
        .as_ref()
        .filter(|_| cell.dense)
        .map(|(prior_pose, _)| model.iter().map(|at| (*prior_pose * Point::from(*at)).coords).collect());
    let mut points: Vec<Vector3<f64>> = measured.iter().map(|(_, at)| *at).collect();
    while points.len() < cell.m {
        let at = match (&predicted, cell.gate) {
            // The other box has a quarter of the clutter here as well.
            (Some(_), _) if replaced && stream.below(4) == 0 => scene.edge(&mut stream),
            (Some(predicted), Some(half)) => in_gates(&mut stream, predicted, half),
            _ => scene.clutter(&mut stream),
        };
        if replaced || hidden.iter().all(|&i| (placed[i] - at).norm() >= cell.clear) {
            points.push(at);
        }
    }

    let order = shuffled(cell.m, &mut source.stream(Part::Order));
    let mut problem = GeneratedProblem::new(source, &model, cell.sigma);
    problem.cloud = order.iter().map(|&k| micrometres(&points[k])).collect();
    problem.prior = prior.map(|(_, prior)| prior);
    problem.sigma_xyz = (cell.depth > 1).then(|| vec![[round(noise.x), round(noise.y), round(noise.z)]; cell.m]);
    let pairs = order.iter().enumerate().filter_map(|(j, &k)| Some([*seen.get(k)?, j])).collect();
    let truth = GeneratedTruth::new(&problem, &pose, pairs, cell.parameters(source, seen.len()));
    Generated { problem, truth }
}

/// Half extents of another box: each larger or smaller by 10 to 30 %.
fn other(half: &[f64; 3], stream: &mut Stream) -> Vector3<f64> {
    Vector3::from(*half)
        .map(|half| half * (1.0 + stream.between(0.1, 0.3) * if stream.below(2) == 0 { -1.0 } else { 1.0 }))
}

/// Standard deviations along the camera's axes (m), whose root mean square is the cell's σ.
fn noise(cell: &Cell) -> Vector3<f64> {
    let depth = f64::from(cell.depth);
    let across = cell.sigma * (3.0 / (2.0 + depth * depth)).sqrt();
    Vector3::new(across, across, across * depth)
}
