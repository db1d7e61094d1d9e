//! The perspective three-point problem (P3P).

use nalgebra::{Matrix3, Vector3};

/// The distances of three points from a camera that sees them along unit directions `rays`: up to four positive
/// triples.
///
/// The equations λ_i² + λ_j² − 2 λ_i λ_j (y_i·y_j) = |x_i − x_j|² are three quadrics. Elimination of the right sides
/// leaves two cones; a degenerate member of their pencil D1 + γ D2 is a pair of planes through the origin. Each plane
/// meets the cones in two lines, and each line meets a quadric once. (Persson, Nordberg, *Lambda Twist: an accurate
/// fast robust perspective three point solver*, 2018.) Newton steps on the quadrics refine every root.
pub(super) fn distances(rays: &[Vector3<f64>; 3], points: &[Vector3<f64>; 3]) -> Roots {
    let square = |i: usize, j: usize| (points[i] - points[j]).norm_squared();
    let a = [square(0, 1), square(0, 2), square(1, 2)];
    let cosine = [rays[0].dot(&rays[1]), rays[0].dot(&rays[2]), rays[1].dot(&rays[2])];
    let quadrics: [Matrix3<f64>; 3] = std::array::from_fn(|k| quadric(PAIRS[k], cosine[k]));
    let (d1, d2) = (quadrics[0] * a[2] - quadrics[2] * a[0], quadrics[1] * a[2] - quadrics[2] * a[1]);
    // Symmetric triangles make one cone singular. A mixture of both spans the same pencil and avoids it.
    let (d1, d2) = (d1 + d2 * MIXTURE, d2 - d1 * MIXTURE);
    let mut roots = Roots::default();
    let members = pencil(&d1, &d2).map(|gamma| split(&(d1 + d2 * gamma)));
    let Some((_, planes)) = members.max_by(|a, b| a.0.total_cmp(&b.0)) else { return roots };
    for line in planes.iter().flat_map(|plane| lines(plane, &d2)) {
        let size = (line.transpose() * quadrics[2] * line).x;
        if size > 0.0 {
            let lambda = line * (a[2] / size).sqrt() * line.sum().signum();
            roots.push(polish(lambda, &a, &cosine));
        }
    }
    roots
}

/// A mixing factor without relation to any symmetry.
const MIXTURE: f64 = 0.618_034;

/// Up to four triples of distances.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Roots {
    found: [Vector3<f64>; 4],
    count: usize,
}

impl Roots {
    pub(super) fn as_slice(&self) -> &[Vector3<f64>] {
        &self.found[..self.count]
    }

    fn push(&mut self, lambda: Vector3<f64>) {
        if self.count < 4 && lambda.iter().all(|&distance| distance > 0.0 && distance.is_finite()) {
            self.found[self.count] = lambda;
            self.count += 1;
        }
    }
}

const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// λ_i² + λ_j² − 2 c λ_i λ_j as a matrix.
fn quadric((i, j): (usize, usize), cosine: f64) -> Matrix3<f64> {
    let mut m = Matrix3::zeros();
    (m[(i, i)], m[(j, j)]) = (1.0, 1.0);
    (m[(i, j)], m[(j, i)]) = (-cosine, -cosine);
    m
}

/// The real γ for which D1 + γ D2 is singular.
fn pencil(d1: &Matrix3<f64>, d2: &Matrix3<f64>) -> impl Iterator<Item = f64> + use<> {
    // det(D1 + γ D2) = det D1 + γ tr(adj(D1) D2) + γ² tr(D1 adj(D2)) + γ³ det D2.
    let mixed = |a: &Matrix3<f64>, b: &Matrix3<f64>| adjugate(a).component_mul(&b.transpose()).sum();
    let coefficients = [d2.determinant(), mixed(d2, d1), mixed(d1, d2), d1.determinant()];
    let (roots, count) = cubic(&coefficients);
    roots.into_iter().take(count)
}

fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let [a, b, c] = [0, 1, 2].map(|k| m.column(k).into_owned());
    Matrix3::from_rows(&[b.cross(&c).transpose(), c.cross(&a).transpose(), a.cross(&b).transpose()])
}

/// The real roots of k₀x³ + k₁x² + k₂x + k₃.
fn cubic(k: &[f64; 4]) -> ([f64; 3], usize) {
    let [b, c, d] = [k[1] / k[0], k[2] / k[0], k[3] / k[0]];
    if ![b, c, d].iter().all(|x| x.is_finite()) {
        return ([0.0; 3], 0);
    }
    let (p, q) = (c - b * b / 3.0, 2.0 * b * b * b / 27.0 - b * c / 3.0 + d);
    let discriminant = q * q / 4.0 + p * p * p / 27.0;
    let (mut roots, count) = if discriminant > 0.0 {
        let s = discriminant.sqrt();
        // Terms of equal sign add without cancellation; the other part follows from the product.
        let u = libm::cbrt(-0.5 * q - s.copysign(q));
        ([if u == 0.0 { 0.0 } else { u - p / (3.0 * u) }, 0.0, 0.0], 1)
    } else {
        let r = (-p / 3.0).max(0.0).sqrt();
        let cosine = if r > 0.0 { (-q / (2.0 * r * r * r)).clamp(-1.0, 1.0) } else { 1.0 };
        let third = libm::acos(cosine) / 3.0;
        let at = |turn: f64| 2.0 * r * libm::cos(third - turn * std::f64::consts::TAU / 3.0);
        ([at(0.0), at(1.0), at(2.0)], 3)
    };
    for root in &mut roots[..count] {
        *root -= b / 3.0;
        for _ in 0..2 {
            let slope = (3.0 * *root + 2.0 * b) * *root + c;
            let step = (((*root + b) * *root + c) * *root + d) / slope;
            if step.is_finite() {
                *root -= step;
            }
        }
    }
    (roots, count)
}

/// The normals of the two planes of a singular quadric, and the quality of the decomposition.
///
/// The quality is the negated smallest eigenvalue over the largest; it is zero for a definite quadric, which contains
/// no real point but the origin.
fn split(m: &Matrix3<f64>) -> (f64, [Vector3<f64>; 2]) {
    let eigen = m.symmetric_eigen();
    let (value, vector) = (eigen.eigenvalues, eigen.eigenvectors);
    let (low, high) = (value.imin(), value.imax());
    let (negative, positive) = ((-value[low]).max(0.0), value[high].max(0.0));
    let (a, b) = (vector.column(high) * positive.sqrt(), vector.column(low) * negative.sqrt());
    (negative.min(positive) / value.amax(), [a + b, a - b])
}

/// The lines in which the plane with this normal meets the cone λᵀ D λ = 0.
fn lines(normal: &Vector3<f64>, cone: &Matrix3<f64>) -> impl Iterator<Item = Vector3<f64>> + use<> {
    let u = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let v = normal.cross(&u).normalize();
    let form = |x: &Vector3<f64>, y: &Vector3<f64>| (x.transpose() * cone * y).x;
    // cos²·A + 2 sin cos·B + sin²·C = 0 over the directions u cos + v sin.
    let (a, b, c) = (form(&u, &u), form(&u, &v), form(&v, &v));
    let root = (b * b - a * c).max(0.0).sqrt();
    // Noise may separate two touching lines: they then count as one double line.
    let open = b * b - a * c > -1e-6 * (a * a + b * b + c * c);
    let q = -(b + root.copysign(b));
    // Directions (cos, sin) with sin/cos = q/c and a/q.
    let both = [u * c + v * q, u * q + v * a];
    both.into_iter().filter(move |line| open && line.norm() > 0.0).map(|line| line.normalize())
}

/// Newton steps on the three quadrics.
fn polish(mut lambda: Vector3<f64>, a: &[f64; 3], cosine: &[f64; 3]) -> Vector3<f64> {
    for _ in 0..5 {
        let mut residual = Vector3::zeros();
        let mut j = Matrix3::zeros();
        for (k, &(i, l)) in PAIRS.iter().enumerate() {
            let (x, y, c) = (lambda[i], lambda[l], cosine[k]);
            residual[k] = x * x + y * y - 2.0 * c * x * y - a[k];
            (j[(k, i)], j[(k, l)]) = (2.0 * (x - c * y), 2.0 * (y - c * x));
        }
        let Some(inverse) = j.try_inverse() else { break };
        let step = inverse * residual;
        if !(step.norm() < 0.1 * lambda.norm()) {
            break;
        }
        lambda -= step;
        if step.norm() <= 1e-15 * lambda.norm() {
            break;
        }
    }
    lambda
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_true_distances_are_among_the_roots() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut missed, mut several) = (0, 0);
        for _ in 0..5000 {
            let points = [(); 3].map(|()| {
                Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), rng.random_range(2.0..5.0))
            });
            let rays = points.map(|p: Vector3<f64>| p.normalize());
            let roots = distances(&rays, &points);
            let truth = Vector3::from(points.map(|p| p.norm()));
            missed += usize::from(!roots.as_slice().iter().any(|root| (root - truth).norm() < 1e-9));
            several += usize::from(roots.as_slice().len() > 1);
        }
        assert!(missed <= 2, "{missed} of 5000 missed");
        assert!(several > 2000, "{several} had several roots");
    }

    #[test]
    fn an_equilateral_triangle_seen_from_its_axis() {
        let turn = |k: f64| k * std::f64::consts::TAU / 3.0;
        let points = [0.0, 1.0, 2.0].map(|k| Vector3::new(turn(k).cos(), turn(k).sin(), 2.0));
        let roots = distances(&points.map(|p| p.normalize()), &points);
        let near = |root: &Vector3<f64>| (root - Vector3::repeat(5f64.sqrt())).norm() < 1e-9;
        assert!(roots.as_slice().iter().any(near), "{roots:?}");
    }
}
