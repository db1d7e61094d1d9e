//! A kernel density of clutter that follows lines and surfaces.

use nalgebra::Vector3;

use super::gaussian::HALF_LN_2PI;
use crate::problem::Problem;

/// Number of neighbours towards which a point's kernel is stretched.
const NEIGHBOURS: usize = 6;
/// Number of the neighbour whose distance gives the density of clumps.
pub(super) const NEAR: usize = 3;
/// Number of points about a place whose kernels count there; farther kernels are as thin as uniform clutter.
const AROUND: usize = 16;
/// Standard deviation of a kernel across its line, in standard deviations of the point.
const ACROSS: f64 = 3.0;
/// χ² above which a kernel is less than 10⁻²¹ of its maximum.
const NEGLIGIBLE: f64 = 100.0;
/// Minimum standard deviation of a kernel, as a fraction of its length.
const MIN_FRACTION: f64 = 1e-3;

/// A kernel density of the cloud, with kernels stretched along the lines between neighbours.
///
/// The density at x is Σ_j ⅙ Σ_l N(x; c_j, (c_l − c_j)(c_l − c_j)ᵀ + s² I) over the points j and their six nearest
/// neighbours l, s three standard deviations of point j. On a line of points most neighbours lie along it, so that the
/// density is that of the line although other points are near; a covariance of all neighbours together (manifold
/// Parzen windows, Vincent and Bengio 2003) is widened by any of them. Clutter that fills space lies on few of these
/// lines. The kernels are wider than clumps of a few standard deviations, whose density is that of the third neighbour.
pub(super) struct LineDensity {
    /// The points, ascending, and their coordinates by axis.
    points: Vec<usize>,
    places: [Vec<f64>; 3],
    /// Their standard deviations (m).
    sigmas: Vec<f64>,
    squares: Vec<f64>,
    /// The nearest points of each point, nearest first, by their index in `points`; empty until looked up.
    nearest: Vec<Vec<usize>>,
}

/// The densities of the cloud about a point (1/m³).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Densities {
    /// Along the lines between neighbours.
    pub(super) along: f64,
    /// Within the third neighbour, 2/V₃.
    pub(super) near: f64,
    /// Within the sixteenth neighbour, 15/V₁₆, or the last of fewer.
    pub(super) wide: f64,
}

impl LineDensity {
    /// The cloud points that are clutter unless they are the object's: without a prior the candidates, else all.
    pub(super) fn of(problem: &Problem<'_>) -> Self {
        let mut points: Vec<usize> = match problem.prior {
            Some(_) => (0..problem.cloud.len()).collect(),
            None => problem.candidates.lists.iter().flatten().copied().collect(),
        };
        points.sort_unstable();
        points.dedup();
        let position = |j: &usize| &problem.cloud[*j].position;
        let column = |axis: usize| points.iter().map(|j| position(j).at.coords[axis]).collect();
        let places = std::array::from_fn(column);
        let sigmas = points.iter().map(|j| (position(j).covariance.trace() / 3.0).max(0.0).sqrt()).collect();
        Self { places, sigmas, squares: vec![0.0; points.len()], nearest: vec![Vec::new(); points.len()], points }
    }

    /// The number of points.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// The densities (1/m³) at a cloud point if the points for which `excluded` holds, and the point itself, were not
    /// measured. Zero for a place that is not finite.
    pub(super) fn at(&mut self, cloud: usize, excluded: impl Fn(usize) -> bool) -> Densities {
        let Ok(own) = self.points.binary_search(&cloud) else { return Densities::default() };
        let here = self.place(own);
        self.look_up(own);
        let left = |of: &Self, index: usize| index != own && !excluded(of.points[index]);
        let around: Vec<usize> =
            self.nearest[own].iter().copied().filter(|&index| left(self, index)).take(AROUND).collect();
        // The density within the k-th neighbour, (k − 1)/V_k. Points nearer than the noise are one place.
        let within = |k: usize| {
            let Some(&j) = k.checked_sub(1).and_then(|last| around.get(last)) else { return 0.0 };
            let radius = (self.place(j) - here).norm().max(self.sigmas[own]).max(f64::MIN_POSITIVE);
            (k - 1) as f64 / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)).max(f64::MIN_POSITIVE)
        };
        let (near, wide) = (within(NEAR), within(around.len()));
        let mut sum = 0.0;
        for j in around {
            let from = self.place(j);
            self.look_up(j);
            let towards = self.nearest[j].iter().filter(|&&index| left(self, index)).take(NEIGHBOURS);
            let (mut count, mut kernels) = (0, 0.0);
            for &l in towards {
                count += 1;
                kernels += kernel(&(here - from), &(self.place(l) - from), ACROSS * self.sigmas[j]);
            }
            if count > 0 {
                sum += kernels / f64::from(count);
            }
        }
        Densities { along: sum, near, wide }
    }

    fn place(&self, index: usize) -> Vector3<f64> {
        Vector3::new(self.places[0][index], self.places[1][index], self.places[2][index])
    }

    /// Finds the nearest points of a point, twice as many as count, since some may be excluded.
    fn look_up(&mut self, of: usize) {
        if !self.nearest[of].is_empty() {
            return;
        }
        let at = self.place(of);
        squares(&self.places, &at, &mut self.squares);
        const KEPT: usize = 2 * AROUND;
        let mut nearest: Vec<(u64, usize)> = Vec::with_capacity(2 * KEPT);
        let mut farthest = f64::INFINITY;
        for (j, &square) in self.squares.iter().enumerate() {
            // Negated comparison: NaN is skipped.
            if !(square < farthest) || j == of {
                continue;
            }
            // The bits of positive numbers are in the order of the numbers.
            nearest.push((square.to_bits(), j));
            if nearest.len() == 2 * KEPT {
                nearest.select_nth_unstable(KEPT - 1);
                nearest.truncate(KEPT);
                farthest = f64::from_bits(nearest[KEPT - 1].0);
            }
        }
        nearest.sort_unstable();
        nearest.truncate(KEPT);
        self.nearest[of] = nearest.into_iter().map(|(_, j)| j).collect();
    }
}

/// The density at `step` from a kernel's centre: N(step; 0, line lineᵀ + s² I).
fn kernel(step: &Vector3<f64>, line: &Vector3<f64>, s: f64) -> f64 {
    let square = line.norm_squared();
    let across = (s * s).max(MIN_FRACTION * MIN_FRACTION * square).max(f64::MIN_POSITIVE);
    let along = square + across;
    let on = if square > 0.0 { step.dot(line).powi(2) / square } else { 0.0 };
    let chi2 = on / along + (step.norm_squared() - on).max(0.0) / across;
    if chi2 > NEGLIGIBLE {
        return 0.0;
    }
    libm::exp(-0.5 * chi2 - 3.0 * HALF_LN_2PI) / (along.sqrt() * across)
}

/// The squared distances of some places from one.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn squares([x, y, z]: &[Vec<f64>; 3], at: &Vector3<f64>, squares: &mut [f64]) {
    for (square, ((x, y), z)) in squares.iter_mut().zip(x.iter().zip(y).zip(z)) {
        let (x, y, z) = (x - at.x, y - at.y, z - at.z);
        *square = x * x + y * y + z * z;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::{candidates::Candidates, problem::Tolerance, site::model::ModelPoint};

    const SIGMA: f64 = 0.01;

    /// The median ratio of the density to the true one at the first `count` of these points.
    fn ratio(places: &[Vector3<f64>], count: usize, truth: f64) -> f64 {
        let measured = |at: &Vector3<f64>| MeasuredPoint {
            position: UncertainPoint::isotropic((*at).into(), SIGMA),
            pixels: None,
        };
        let cloud: Vec<MeasuredPoint> = places.iter().map(measured).collect();
        let model = [ModelPoint::exact("a", [0.0; 3].into())];
        let candidates = Candidates::all(1, cloud.len());
        let tolerance = Tolerance::Fixed(0.04);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let mut density = LineDensity::of(&problem);
        let mut ratios: Vec<f64> = (0..count).map(|j| density.at(j, |_| false).along / truth).collect();
        ratios.sort_by(f64::total_cmp);
        ratios[count / 2]
    }

    /// Eight points a metre along a line of two centimetres thickness have their density among two uniform points a
    /// cubic metre. Uniform points alone lie on no line: the thin kernels of their neighbours miss most of them.
    #[test]
    fn points_on_a_line_have_its_density_and_others_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut thick = |half: f64| (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * half;
        let mut line: Vec<Vector3<f64>> =
            (0..40).map(|k| Vector3::new(0.125 * f64::from(k) + thick(0.04), thick(0.02), thick(0.02))).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let space: Vec<Vector3<f64>> = (0..400).map(|_| Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0))).collect();
        line.extend(space.iter().take(400));
        // 8 a metre over 4π times the variance across: the mean density of the line over its own points.
        let on = ratio(&line, 40, 8.0 / (4.0 * std::f64::consts::PI * 4e-4));
        assert!((0.2..2.0).contains(&on), "on the line: {on}");
        let free = ratio(&space, 400, 400.0 / 216.0);
        assert!(free < 0.2, "in space: {free}");
    }

    #[test]
    fn a_kernel_has_the_volume_one() {
        let line = Vector3::new(0.3, -0.2, 0.1);
        let mut sum = 0.0;
        let n = 60;
        for i in 0..n * n * n {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) * 4.0 - 2.0;
            sum += kernel(&Vector3::new(at(i % n), at(i / n % n), at(i / n / n)), &line, 0.1);
        }
        let cell = (4.0 / f64::from(n)).powi(3);
        assert!((sum * cell - 1.0).abs() < 0.02, "{}", sum * cell);
    }
}
