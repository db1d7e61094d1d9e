//! The probability that given model points match by chance: the tube about their rigid motions.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Cholesky, Matrix3, Rotation3, U3, UnitQuaternion, Vector3};

use super::{
    null::{GateVolume, Null, any, density},
    sequence::QuasiRandom,
};
use crate::problem::{Problem, Tolerance};

/// Minimum standard deviation of a measurement (m).
const FLOOR: f64 = 1e-9;
/// Number of directions of the errors in a sample of few points; one direction for more points.
const DIRECTIONS: usize = 2;
const FEW: usize = 5;
/// Sine of a small rotation, whose second order is negligible; factor by which the search exceeds its end.
const SMALL_TURN: f64 = 0.6;
const BEYOND: f64 = 1.25;
/// Nodes and weights of Gauss–Legendre quadrature on [0, 1].
const LEGENDRE: [[f64; 2]; 5] = [
    [0.046_910_077_030_668, 0.118_463_442_528_094_5],
    [0.230_765_344_947_158_5, 0.239_314_335_249_683_2],
    [0.5, 0.284_444_444_444_444_4],
    [0.769_234_655_052_841_5, 0.239_314_335_249_683_2],
    [0.953_089_922_969_332, 0.118_463_442_528_094_5],
];

/// The noise of candidates: one covariance for the frame.
pub(super) struct Noise {
    /// The mean covariance of a measured point (m²).
    measured: Matrix3<f64>,
    /// The lower Cholesky factor of that plus the model's own variance: Σ = L Lᵀ.
    root: Matrix3<f64>,
    /// L⁻¹.
    whitening: Matrix3<f64>,
    ln_det_root: f64,
}

impl Noise {
    pub(super) fn of(problem: &Problem<'_>) -> Self {
        let lists = &problem.candidates.lists;
        let (mut sum, mut count) = (Matrix3::zeros(), 0.0);
        for &j in lists.iter().flatten() {
            sum += problem.cloud[j].position.covariance;
            count += 1.0;
        }
        let mut measured = sum / f64::max(count, 1.0);
        if problem.prior.is_none() {
            // The rotation between object and camera is unknown.
            measured = Matrix3::identity() * (measured.trace() / 3.0);
        }
        let model = problem.model.iter().map(|point| point.sigma * point.sigma).sum::<f64>();
        let own = model / problem.model.len().max(1) as f64 + FLOOR * FLOOR;
        let root = Cholesky::new(measured + Matrix3::identity() * own)
            .map_or_else(|| Matrix3::from_element(f64::NAN), |cholesky| cholesky.l());
        let whitening = root.try_inverse().unwrap_or_else(|| Matrix3::from_element(f64::NAN));
        Self { measured, root, whitening, ln_det_root: libm::log(root.m11 * root.m22 * root.m33) }
    }

    pub(super) fn is_nan(&self) -> bool {
        !self.ln_det_root.is_finite() || !self.whitening.iter().all(|x| x.is_finite())
    }
}

/// Subsets of one size and the tube about each.
pub(super) struct Shape<'a> {
    problem: &'a Problem<'a>,
    null: &'a Null<'a>,
    noise: &'a Noise,
    /// Dimension of the tube's section, and its radius.
    dof: f64,
    radius: f64,
    /// ln of the volume of the tube's section, with all factors common to the members.
    ln_section: f64,
    /// Minimum inertia about any axis with noise: the square of h₀ = R ω_{D−1}/(ω_D (D + 1)), the mean radius of a full
    /// tube.
    min_inertia: f64,
    /// The members, about their centroid.
    at: Vec<Vector3<f64>>,
    errors: Vec<Vector3<f64>>,
}

/// ln of the volume of the unit ball in d dimensions.
fn ln_ball(d: f64) -> f64 {
    0.5 * d * libm::log(PI) - libm::lgamma(0.5 * d + 1.0)
}

/// Σ [x]×ᵀ [x]× = Σ |x|² I − x xᵀ.
fn inertia<'x>(points: impl Iterator<Item = &'x Vector3<f64>>) -> Matrix3<f64> {
    points.fold(Matrix3::zeros(), |sum, x| sum + Matrix3::identity() * x.norm_squared() - x * x.transpose())
}

impl<'a> Shape<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, null: &'a Null<'a>, noise: &'a Noise, size: usize, chi2: f64) -> Self {
        let dof = (3 * size - 6) as f64;
        // Coherent sets are no worse than this anyway.
        let best = noise.whitening.norm();
        let widest = match problem.tolerance {
            Tolerance::Fixed(delta) => delta,
            Tolerance::Sigmas(k) => k * (2.0 * noise.root.norm_squared()).sqrt(),
        };
        let radius = chi2.sqrt().min((size as f64).sqrt() * widest * best);
        let ball = ln_ball(dof);
        let full = radius * libm::exp(ln_ball(dof - 1.0) - ball) / (dof + 1.0);
        Self {
            problem,
            null,
            noise,
            dof,
            radius,
            ln_section: ball
                + dof * libm::log(radius)
                + 1.5 * libm::log(size as f64)
                + (size as f64 - 1.0) * noise.ln_det_root
                + null.ln_scale() * size as f64,
            min_inertia: full * full,
            at: Vec::with_capacity(size),
            errors: Vec::with_capacity(size),
        }
    }

    /// An estimate from one rotation and a few directions of the errors; the mean of many is P(S) up to the
    /// [scale](Self::ln_scale).
    pub(super) fn fit_probability(&mut self, set: &[usize], sequence: &mut QuasiRandom) -> f64 {
        if !self.centre(set) {
            return 0.0;
        }
        let motions = match self.null {
            Null::Gates(gates) => in_gates(&self.at, set, gates, sequence),
            Null::Box(lengths) => in_box(&self.at, lengths, sequence),
            Null::Shuffled(cloud) => among(&self.at, cloud, sequence),
        };
        self.estimate(set, motions, sequence)
    }

    /// The estimate from a rotation with which a set barely fits the cloud's box; zero without a box.
    pub(super) fn barely_fits(&mut self, set: &[usize], sequence: &mut QuasiRandom) -> f64 {
        if !(matches!(self.null, Null::Box(_)) && self.centre(set)) {
            return 0.0;
        }
        let reach = self.radius * self.noise.root.norm() / 3f64.sqrt();
        self.estimate(set, ALL_TURNS * reach.powi(3), sequence)
    }

    /// Centres the members; false if they are too few.
    fn centre(&mut self, set: &[usize]) -> bool {
        if set.len() < 3 || self.radius <= 0.0 {
            return false;
        }
        self.at.clear();
        self.at.extend(set.iter().map(|&i| match self.null {
            Null::Gates(gates) => gates[i].centre,
            _ => self.problem.model[i].at.coords,
        }));
        let centroid = self.at.iter().sum::<Vector3<f64>>() / set.len() as f64;
        self.at.iter_mut().for_each(|x| *x -= centroid);
        true
    }

    /// The estimate from the measure of motions of one rotation (m³ rad³, up to the omitted density).
    fn estimate(&mut self, set: &[usize], motions: f64, sequence: &mut QuasiRandom) -> f64 {
        if !(motions > 0.0) {
            return 0.0;
        }
        // Σ [x]×ᵀ W [x]×: the information of the rotation.
        let whitened = |x: &Vector3<f64>| self.noise.whitening * x.cross_matrix();
        let turn = self.at.iter().fold(Matrix3::identity() * self.min_inertia, |sum, x| {
            let j = whitened(x);
            sum + j.transpose() * j
        });
        let within = self.within_tolerances(set, &turn, sequence);
        within * turn.determinant().sqrt() * motions
    }

    /// ln of the common factor of every estimate.
    pub(super) fn ln_scale(&self) -> f64 {
        self.ln_section
    }

    /// The fraction of the ball of radius R in which all distances are within their tolerances: the mean of the D-th
    /// power of the relative extent along random directions.
    fn within_tolerances(&mut self, set: &[usize], turn: &Matrix3<f64>, sequence: &mut QuasiRandom) -> f64 {
        let root = &self.noise.root;
        if let Tolerance::Fixed(delta) = self.problem.tolerance {
            // |n · (e_i − e_j)| ≤ √2 R ‖L‖.
            if 2f64.sqrt() * self.radius * root.norm() <= delta * 3f64.sqrt() && isotropic(root) {
                return 1.0;
            }
        }
        let Some(cholesky) = Cholesky::new(*turn) else { return 1.0 };
        let mut along = || libm::pow(self.within_tolerance(set, &cholesky, sequence), self.dof);
        let directions = if set.len() > FEW { 1 } else { DIRECTIONS };
        (0..directions).map(|_| along()).sum::<f64>() / directions as f64
    }

    /// The extent along a random error direction, as a fraction of R, within which all distances keep their tolerances.
    fn within_tolerance(&mut self, set: &[usize], turn: &Cholesky<f64, U3>, sequence: &mut QuasiRandom) -> f64 {
        let root = &self.noise.root;
        self.errors.clear();
        self.errors.extend(set.iter().map(|_| sequence.normal3()));
        let mean = self.errors.iter().sum::<Vector3<f64>>() / set.len() as f64;
        let whitening = &self.noise.whitening;
        let mut moment = Vector3::zeros();
        for (e, x) in self.errors.iter_mut().zip(&self.at) {
            *e -= mean;
            moment += (whitening * x.cross_matrix()).transpose() * *e;
        }
        let a = turn.solve(&moment);
        let mut square = 0.0;
        for (e, x) in self.errors.iter_mut().zip(&self.at) {
            *e -= whitening * x.cross(&a);
            square += e.norm_squared();
            *e = root * *e;
        }
        let norm = square.sqrt();
        let mut within = 1.0_f64;
        for i in 0..set.len() {
            for k in 0..i {
                let n = (self.at[i] - self.at[k]).try_normalize(FLOOR).unwrap_or_else(Vector3::z);
                let step = n.dot(&(self.errors[i] - self.errors[k])).abs() * self.radius / norm;
                let delta = self.tolerance(set[i], set[k], &n);
                if step * within > delta {
                    within = delta / step;
                }
            }
        }
        within
    }

    fn tolerance(&self, i: usize, k: usize, n: &Vector3<f64>) -> f64 {
        match self.problem.tolerance {
            Tolerance::Fixed(delta) => delta,
            Tolerance::Sigmas(sigmas) => {
                let model = self.problem.model[i].sigma.powi(2) + self.problem.model[k].sigma.powi(2);
                sigmas * (2.0 * n.dot(&(self.noise.measured * n)) + model).sqrt()
            }
        }
    }
}

fn isotropic(root: &Matrix3<f64>) -> bool {
    root.m11 == root.m22 && root.m22 == root.m33 && root.m21 == 0.0 && root.m31 == 0.0 && root.m32 == 0.0
}

/// The measure of motions that keep every member in its gate, for one rotation axis.
///
/// A rotation by 2ψ about the axis w moves the members by 4 sin²ψ wᵀ I w in all, I their inertia; gates of half-sizes s
/// permit Σ |s|². The quaternion's vector part v = w sin ψ therefore lies in the ellipsoid vᵀ I v ≤ Σ |s|²/4 and in the
/// unit ball. With v = L⁻ᵀ u ϱ, u uniform on the sphere and L Lᵀ the ellipsoid's form, the measure of rotations 8
/// dv/√(1 − v²) is 8/|L| · sin²ψ dψ du/|L⁻ᵀ u|³; ψ is integrated by Gauss–Legendre quadrature. Translations fill the
/// overlap of the gates.
fn in_gates(at: &[Vector3<f64>], set: &[usize], gates: &[GateVolume], sequence: &mut QuasiRandom) -> f64 {
    let inertia = inertia(at.iter());
    let allowed = set.iter().map(|&i| gates[i].half.norm_squared()).sum::<f64>() / 4.0;
    // The minimum inertia is at least 4 |I|/tr². If it permits half a turn, both bounds are combined.
    let free = 4.0 * inertia.determinant() < 2.0 * allowed * inertia.trace().powi(2);
    let fraction = if free { 0.25 } else { 0.0 };
    let form = (inertia + Matrix3::identity() * (fraction * allowed)) / (allowed * (1.0 + fraction));
    let Some(cholesky) = Cholesky::new(form) else { return 0.0 };
    let l = cholesky.l();
    let Some(along) = l.tr_solve_lower_triangular(&sequence.direction()) else { return 0.0 };
    let length = along.norm();
    let axis = along / length;

    // The end of the rotation: by the ellipsoid, and by the range of the members' steps, to first order.
    let max = gates_of(set, gates).fold(Vector3::zeros(), |max: Vector3<f64>, gate| max.sup(&gate.half));
    let (mut low, mut high) = (Vector3::zeros(), Vector3::<f64>::zeros());
    for x in at {
        let step = axis.cross(x);
        low = low.inf(&step);
        high = high.sup(&step);
    }
    let by_range = (0..3).map(|a| 2.0 * max[a] / (high[a] - low[a])).fold(f64::INFINITY, f64::min);
    let by_range = if by_range < SMALL_TURN { BEYOND * 0.5 * by_range } else { 1.0 };
    let end = length.min(by_range).min(1.0);
    let all_round = end == 1.0;

    let mut sum = 0.0;
    for [node, weight] in LEGENDRE {
        // Small rotations by their sine, which costs only a root; full ones by their angle.
        let (sine, cosine, measure) = if all_round {
            let (sine, cosine) = libm::sincos(FRAC_PI_2 * node);
            (sine, cosine, FRAC_PI_2)
        } else {
            let sine = end * node;
            let cosine = (1.0 - sine * sine).sqrt();
            (sine, cosine, end / cosine)
        };
        let v = axis * sine;
        let (mut low, mut high) = (Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY));
        for (x, gate) in at.iter().zip(gates_of(set, gates)) {
            // (R − 1) x = 2 v × (q₀ x + v × x).
            let step = 2.0 * v.cross(&(x * cosine + v.cross(x)));
            low = low.sup(&(-gate.half - step));
            high = high.inf(&(gate.half - step));
        }
        sum += weight * measure * sine * sine * (high - low).map(|length| length.max(0.0)).product();
    }
    let density: f64 = gates_of(set, gates).map(|gate| gate.relative_density).product();
    8.0 * 4.0 * PI / (l.m11 * l.m22 * l.m33) * sum / length.powi(3) * density
}

fn gates_of<'s>(set: &'s [usize], gates: &'s [GateVolume]) -> impl Iterator<Item = &'s GateVolume> {
    set.iter().map(|&i| &gates[i])
}

/// The measure of all rotations.
const ALL_TURNS: f64 = 8.0 * PI * PI;

fn turned(sequence: &QuasiRandom) -> Rotation3<f64> {
    let [i, j, k, w] = sequence.turn();
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, i, j, k)).to_rotation_matrix()
}

/// The measure of motions that keep every member in a box of these lengths.
fn in_box(at: &[Vector3<f64>], lengths: &Vector3<f64>, sequence: &mut QuasiRandom) -> f64 {
    let turn = turned(sequence);
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for x in at {
        let x = turn * x;
        low = low.inf(&x);
        high = high.sup(&x);
    }
    ALL_TURNS * (lengths - (high - low)).map(|length| length.max(0.0)).product()
}

/// The measure of motions that bring one member onto a cloud point, times the density at the others.
fn among(at: &[Vector3<f64>], cloud: &[&seafix_geometry::MeasuredPoint], sequence: &mut QuasiRandom) -> f64 {
    let turn = turned(sequence);
    let anchor = sequence.below(at.len());
    let place = any(cloud, sequence) - turn * at[anchor];
    let others = at.iter().enumerate().filter(|&(i, _)| i != anchor);
    ALL_TURNS * others.map(|(_, x)| density(cloud, &(place + turn * x))).product::<f64>()
}
