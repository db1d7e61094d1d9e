//! Coherence problems with a known solution.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::{prelude::*, sample::Index};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{Candidates, Correspondence, ModelPoint, Problem, Tolerance, problem_file::CoherenceProblem};

use crate::poses::{rotation, vector};

/// A problem and its solution.
#[derive(Debug, Clone)]
pub struct Planted {
    /// The model's points.
    pub model: Vec<ModelPoint>,
    /// The cloud: images of visible points, then decoys, then clutter.
    pub cloud: Vec<MeasuredPoint>,
    /// The candidates: the true image of every visible point, and others.
    pub candidates: Candidates,
    /// The tolerance of distances.
    pub tolerance: Tolerance,
    /// The true pairs, of the visible points.
    pub truth: Vec<Correspondence>,
    /// The true pose of the camera.
    pub pose: Transform<Object, Camera>,
}

impl Planted {
    /// The problem for a search.
    pub fn problem(&self) -> Problem<'_> {
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: self.tolerance,
            prior: None,
            edges: Default::default(),
        }
    }
}

/// The problem of a file with its candidates.
#[derive(Debug, Clone)]
pub struct Listed {
    /// The problem of the file.
    pub file: CoherenceProblem,
    /// Its candidates.
    pub candidates: Candidates,
}

impl Listed {
    /// Lists the candidates.
    ///
    /// # Panics
    /// If there are too many.
    pub fn new(file: CoherenceProblem) -> Self {
        let candidates = file.candidates().expect("few enough to list");
        Self { file, candidates }
    }

    /// The problem for a search.
    pub fn problem(&self) -> Problem<'_> {
        let Self { file, candidates } = self;
        Problem {
            model: &file.model,
            cloud: &file.cloud,
            candidates,
            tolerance: Tolerance::Fixed(file.delta),
            prior: file.prior.as_ref(),
            edges: Default::default(),
        }
    }
}

/// The arrangement of a model's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Anywhere in a box of 2 × 1.5 × 1 m.
    Scattered,
    /// On a lattice of 0.25 m, 3 × 3 × 3: many equal distances and many mirror images of parts.
    Lattice,
    /// In a plane, 2 × 1.5 m.
    Flat,
    /// Within a few tolerances of each other, with images that are candidates of each other: one cloud point may suit
    /// two model points.
    Dense,
}

/// The maximum size of a problem.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Maximum number of model points.
    pub points: usize,
    /// Maximum number of candidates of a point.
    pub list: usize,
    /// Maximum number of cloud points that are neither images nor decoys.
    pub clutter: usize,
}

/// A size for brute force: 7 points, 4 candidates each.
pub const SMALL: Size = Size { points: 7, list: 4, clutter: 6 };
/// A size for exact searches, with equal numbers of candidates.
pub const MEDIUM: Size = Size { points: 11, list: 5, clutter: 20 };
/// A size beyond brute force: more vertices than bits of a machine word.
pub const LARGE: Size = Size { points: 24, list: 6, clutter: 60 };

/// The draws of a model point.
#[derive(Debug, Clone)]
struct Generated {
    place: Vector3<f64>,
    cell: [u8; 3],
    /// The noise of its image, and of its decoy (fractions of the problem's noise).
    noise: [Vector3<f64>; 2],
    visible: bool,
    /// Whether the cloud also holds the image of its reflection.
    decoy: bool,
    others: Vec<Index>,
    sigma: f64,
}

fn generated(list: usize) -> impl Strategy<Value = Generated> {
    let noise = || vector(1.0);
    (
        vector(1.0),
        prop::array::uniform3(0u8..3),
        (noise(), noise()),
        prop::bool::weighted(0.85),
        prop::bool::weighted(0.4),
        prop::collection::vec(any::<Index>(), 0..=list),
        0.0..=1.0,
    )
        .prop_map(|(place, cell, (a, b), visible, decoy, others, sigma)| Generated {
            place,
            cell,
            noise: [a, b],
            visible,
            decoy,
            others,
            sigma,
        })
}

/// The common draws of a problem.
#[derive(Debug, Clone)]
struct Shared {
    layout: Layout,
    camera_from_object: Transform<Camera, Object>,
    /// Whether the cloud is the model's mirror image.
    mirrored: bool,
    tolerance: Tolerance,
    /// Maximum noise of a coordinate (m).
    noise: f64,
    /// Standard deviations (m) of measured points on the camera's axes, and of model points.
    sigma: [f64; 4],
}

fn shared() -> impl Strategy<Value = Shared> {
    let layout =
        prop::sample::select(vec![Layout::Scattered, Layout::Lattice, Layout::Lattice, Layout::Flat, Layout::Dense]);
    let motion = (rotation(), vector(1.0))
        .prop_map(|(r, t): (UnitQuaternion<f64>, Vector3<f64>)| Transform::new(r, t + Vector3::new(0.0, 0.0, 4.0)));
    let sigmas = (0.0..=0.01, 1.0..10.0, prop_oneof![Just(0.0), 1e-3..5e-3]);
    let fixed = (2e-3..0.06).prop_map(Tolerance::Fixed);
    let tolerance = prop_oneof![2 => fixed, 1 => (2.0..4.0).prop_map(Tolerance::Sigmas)];
    let exact = prop_oneof![1 => Just(0.0), 2 => 0.0..=1.0, 1 => Just(1.0)];
    (layout, motion, prop::bool::weighted(0.2), tolerance, exact, prop_oneof![1 => Just(0.0), 3 => Just(1.0)], sigmas)
        .prop_map(|(layout, camera_from_object, mirrored, tolerance, noise, exactly, (across, depth, model))| {
            let (noise, across) = match tolerance {
                Tolerance::Fixed(delta) => (noise * delta * 0.4, across * exactly),
                // A tolerance of zero accepts nothing: measured points are uncertain here.
                Tolerance::Sigmas(_) => (noise * (across + 1e-3), across + 1e-3),
            };
            Shared {
                layout,
                camera_from_object,
                mirrored,
                tolerance,
                noise,
                sigma: [across, across, across * depth, model],
            }
        })
}

/// Problems up to this size.
pub fn planted(size: Size) -> impl Strategy<Value = Planted> {
    let points = prop::collection::vec(generated(size.list), 1..=size.points);
    let clutter = prop::collection::vec(vector(1.0), 0..=size.clutter);
    (shared(), points, clutter).prop_map(|(shared, points, clutter)| plant(&shared, &points, &clutter))
}

fn plant(shared: &Shared, points: &[Generated], clutter: &[Vector3<f64>]) -> Planted {
    let extent = Vector3::new(1.0, 0.75, 0.5);
    let place = |generated: &Generated| match shared.layout {
        Layout::Scattered => generated.place.component_mul(&extent),
        Layout::Flat => generated.place.component_mul(&Vector3::new(1.0, 0.75, 0.0)),
        Layout::Lattice => (Vector3::from(generated.cell.map(f64::from)) - Vector3::from_element(1.0)) * 0.25,
        Layout::Dense => generated.place * 0.05,
    };
    let reflected = |p: Vector3<f64>| Vector3::new(p.x, p.y, -p.z);
    let image = |p: Vector3<f64>, noise: Vector3<f64>| {
        let p = if shared.mirrored { reflected(p) } else { p };
        shared.camera_from_object * Point::from(p) + noise * shared.noise
    };
    let model: Vec<ModelPoint> = points
        .iter()
        .enumerate()
        .map(|(i, generated)| ModelPoint {
            sigma: shared.sigma[3] * generated.sigma,
            ..ModelPoint::exact(format!("P{i}"), Point::from(place(generated)))
        })
        .collect();
    let mut places: Vec<Point<Camera>> = Vec::new();
    let mut lists = vec![Vec::new(); points.len()];
    let mut truth = Vec::new();
    for (i, generated) in points.iter().enumerate().filter(|(_, generated)| generated.visible) {
        truth.push(Correspondence { model: i, cloud: places.len() });
        lists[i].push(places.len());
        places.push(image(place(generated), generated.noise[0]));
    }
    for (i, generated) in points.iter().enumerate().filter(|(_, generated)| generated.decoy) {
        lists[i].push(places.len());
        places.push(image(reflected(place(generated)), generated.noise[1]));
    }
    places.extend(clutter.iter().map(|p| shared.camera_from_object * Point::from(p.component_mul(&extent))));
    for (list, generated) in lists.iter_mut().zip(points) {
        // Images and decoys come first; clutter extends the list to the drawn length.
        let reach = if shared.layout == Layout::Dense { truth.len() } else { places.len() };
        let more = generated.others.len().saturating_sub(list.len());
        list.extend(generated.others.iter().filter(|_| reach > 0).take(more).map(|other| other.index(reach)));
    }
    let pairs = lists.iter().enumerate().flat_map(|(i, list)| list.iter().map(move |&j| (i, j)));
    let [x, y, z, _] = shared.sigma;
    let covariance = Matrix3::from_diagonal(&Vector3::new(x * x, y * y, z * z));
    let measure = |at| MeasuredPoint { position: UncertainPoint { at, covariance }, pixels: None };
    Planted {
        candidates: Candidates::from_pairs(model.len(), pairs),
        cloud: places.into_iter().map(measure).collect(),
        model,
        tolerance: shared.tolerance,
        truth,
        pose: shared.camera_from_object.inverse(),
    }
}
