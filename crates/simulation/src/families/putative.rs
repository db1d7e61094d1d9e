//! Family d: putative correspondences, most of them outliers.

use nalgebra::Vector3;
use seafix_geometry::{Point, Transform};

use super::{
    boxes::shuffled,
    family::{Part, Source},
    generated::Generated,
    prior::{cube, direction, rotation},
    problem::{GeneratedProblem, micrometres},
    truth::{GeneratedParameters, GeneratedTruth},
};

/// Number of pairs, and percentage of outliers among them.
const CELLS: [(usize, usize); 13] = [
    (100, 50),
    (100, 80),
    (100, 90),
    (100, 95),
    (1000, 50),
    (1000, 80),
    (1000, 90),
    (1000, 95),
    (1000, 99),
    (5000, 95),
    (5000, 99),
    (10_000, 95),
    (10_000, 99),
];
/// Number of consecutive problems in one cell.
const A_CELL: usize = 4;

/// Putative correspondences between model points and equally many measured points; the model is uniform in a cube of
/// edge 1 m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PutativePairs {
    /// Number of pairs.
    pub pairs: usize,
    /// Percentage of outliers, whose measured points are uniform in a ball about the object.
    pub outliers: usize,
    /// Radius of the ball (m).
    pub radius: f64,
    /// Standard deviation of the measured points on each axis (m).
    pub sigma: f64,
}

pub(super) fn draw(source: &Source) -> Generated {
    let k = usize::try_from(source.number % 1_000_000).expect("it is below a million");
    let (pairs, outliers) = CELLS[k / A_CELL % CELLS.len()];
    generated(source, &PutativePairs { pairs, outliers, radius: [5.0, 1.0][k % 2], sigma: 0.01 })
}

pub(super) fn generated(source: &Source, of: &PutativePairs) -> Generated {
    let &PutativePairs { pairs: n, outliers: wrong, radius, sigma } = of;
    let mut stream = source.stream(Part::Model);
    let model: Vec<Vector3<f64>> = (0..n).map(|_| cube(&mut stream, 0.5)).collect();
    let mut stream = source.stream(Part::Pose);
    let pose = Transform::new(rotation(&mut stream), cube(&mut stream, 1.0));
    let mut order = shuffled(n, &mut source.stream(Part::Visible));
    let outliers = if source.absent() { order.split_off(0) } else { order.split_off(n - n * wrong / 100) };

    let mut stream = source.stream(Part::Noise);
    let mut cloud: Vec<Vector3<f64>> =
        model.iter().map(|at| (pose * Point::from(*at)).coords + stream.normal3(sigma)).collect();
    let mut stream = source.stream(Part::Clutter);
    for &i in &outliers {
        cloud[i] = pose.translation() + direction(&mut stream) * (radius * libm::cbrt(stream.unit()));
    }
    let mut problem = GeneratedProblem::new(source, &model, sigma);
    problem.cloud = cloud.iter().map(micrometres).collect();
    problem.putative = Some((0..n).map(|i| [i, i]).collect());
    let parameters = GeneratedParameters {
        pairs: Some(n),
        outliers: Some(wrong),
        radius: Some(radius),
        absent: source.absent().then_some(true),
        ..GeneratedParameters::default()
    };
    let truth = GeneratedTruth::new(&problem, &pose, order.iter().map(|&i| [i, i]).collect(), parameters);
    Generated { problem, truth }
}
