//! Lens distortion as a map of the normalised plane: Brown–Conrady, rational, thin prism, and equidistant.

use nalgebra::{Matrix2, Vector2};

/// The family of a lens distortion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LensModel {
    /// A perspective lens, r = f·tan θ, with Brown–Conrady distortion.
    #[default]
    Pinhole,
    /// An equidistant (Kannala–Brandt) lens, r = f·θ_d(θ).
    Equidistant,
}

/// The distortion of normalised coordinates (x, y) = (X/Z, Y/Z), r² = x² + y².
///
/// Brown–Conrady with the rational and the thin prism extension, `plumb_bob` and `rational_polynomial`: k1 k2 p1 p2
/// \[k3 \[k4 k5 k6 \[s1 s2 s3 s4\]\]\]:
/// x' = x·ρ + 2 p1 x y + p2 (r² + 2x²) + s1 r² + s2 r⁴, y' = y·ρ + p1 (r² + 2y²) + 2 p2 x y + s3 r² + s4 r⁴,
/// ρ = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶).
///
/// Equidistant, k1 k2 k3 k4: (x', y') = (x, y)·θ_d/r, θ = atan r, θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
///
/// Sources: Brown, *Decentering distortion of lenses*, 1966; Kannala and Brandt, *A generic camera model*, 2006; the
/// order of the coefficients is OpenCV's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    model: LensModel,
    coefficients: [f64; 12],
}

impl Distortion {
    /// The Brown–Conrady distortion of these coefficients; absent ones are zero.
    pub(crate) fn pinhole(coefficients: [f64; 12]) -> Self {
        Self { model: LensModel::Pinhole, coefficients }
    }

    /// The equidistant distortion k1 k2 k3 k4.
    pub(crate) fn equidistant([k1, k2, k3, k4]: [f64; 4]) -> Self {
        let mut coefficients = [0.0; 12];
        coefficients[..4].copy_from_slice(&[k1, k2, k3, k4]);
        Self { model: LensModel::Equidistant, coefficients }
    }

    /// The family of the lens.
    pub fn model(&self) -> LensModel {
        self.model
    }

    /// The coefficients, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 or k1 k2 k3 k4; absent ones are zero.
    pub fn coefficients(&self) -> &[f64; 12] {
        &self.coefficients
    }

    /// The coefficients as the shortest list of a calibration file: 0, 4, 5, 8 or 12 numbers, 4 of an equidistant lens.
    pub fn shortest(&self) -> &[f64] {
        if self.model == LensModel::Equidistant {
            return &self.coefficients[..4];
        }
        let used = self.coefficients.iter().rposition(|&k| k != 0.0).map_or(0, |last| last + 1);
        let length = [0, 4, 5, 8].into_iter().find(|&length| length >= used).unwrap_or(12);
        &self.coefficients[..length]
    }

    /// Whether the map is the identity.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The factor ρ(r²) and its derivative dρ/d(r²).
    fn radial(&self, r2: f64) -> (f64, f64) {
        if self.model == LensModel::Equidistant {
            return self.angular(r2);
        }
        let [k1, k2, _, _, k3, k4, k5, k6, ..] = self.coefficients;
        let numerator = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
        let d_numerator = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let d_denominator = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
        let rho = numerator / denominator;
        (rho, (d_numerator - rho * d_denominator) / denominator)
    }

    /// The factor θ_d/r of an equidistant lens and its derivative by r².
    fn angular(&self, r2: f64) -> (f64, f64) {
        let [k1, k2, k3, k4, ..] = self.coefficients;
        // Below this radius the series of atan is exact: θ = r (1 − r²/3 + …), θ_d/r = 1 + (k1 − 1/3) r² + ….
        const SMALL: f64 = 1e-8;
        if r2 < SMALL {
            let (a, b) = (k1 - 1.0 / 3.0, 0.2 - k1 + k2);
            return (1.0 + r2 * (a + r2 * b), a + 2.0 * b * r2);
        }
        let r = r2.sqrt();
        let theta = r.atan();
        let t2 = theta * theta;
        let distorted = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
        let slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
        let rho = distorted / r;
        // d(θ_d/r)/dr = (θ_d'·θ' − θ_d/r)/r, and d/d(r²) = d/dr / (2r).
        (rho, (slope / (1.0 + r2) - rho) / (2.0 * r2))
    }

    /// The distorted position of `n`, with the Jacobian of the map.
    pub(crate) fn distort(&self, n: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (x, y) = (n.x, n.y);
        let r2 = x * x + y * y;
        let (rho, d) = self.radial(r2);
        if self.model == LensModel::Equidistant {
            let cross = 2.0 * d * x * y;
            let jacobian = Matrix2::new(rho + 2.0 * d * x * x, cross, cross, rho + 2.0 * d * y * y);
            return (Vector2::new(x * rho, y * rho), jacobian);
        }
        let [_, _, p1, p2, _, _, _, _, s1, s2, s3, s4] = self.coefficients;
        let mut place = Vector2::new(
            x * rho + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * rho + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let cross = 2.0 * d * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
        let mut jacobian = Matrix2::new(
            rho + 2.0 * d * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            rho + 2.0 * d * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        if [s1, s2, s3, s4] != [0.0; 4] {
            place += Vector2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
            let by_r2 = Vector2::new(s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2);
            jacobian += 2.0 * by_r2 * n.transpose();
        }
        (place, jacobian)
    }

    /// The normalised radius up to which the radial map r·ρ(r²) increases; beyond it the lens model folds back.
    pub(crate) fn monotone_radius(&self) -> f64 {
        // 84 degrees off the axis; an equidistant lens sees up to 89.9.
        let far = if self.model == LensModel::Equidistant { 500.0 } else { 10.0 };
        if *self == Self::default() {
            return f64::INFINITY;
        }
        let slope = |r: f64| {
            let (rho, d) = self.radial(r * r);
            rho + 2.0 * d * r * r
        };
        let steps = 2000;
        // Equal steps of the angle for a lens whose radius is an angle.
        let radius = |i: i32| match self.model {
            LensModel::Pinhole => far * f64::from(i) / f64::from(steps),
            LensModel::Equidistant => (f64::atan(far) * f64::from(i) / f64::from(steps)).tan(),
        };
        (1..=steps).map(radius).find(|r| !(slope(*r) > 0.0)).unwrap_or(f64::INFINITY)
    }

    /// A first approximation of the position whose distorted position is `target`.
    pub(crate) fn start(&self, target: &Vector2<f64>) -> Vector2<f64> {
        if self.model == LensModel::Pinhole {
            return *target;
        }
        // θ from θ_d by Newton's iteration in the angle, where the map is close to linear.
        let distorted = target.norm();
        let [k1, k2, k3, k4, ..] = self.coefficients;
        let mut theta = distorted.min(1.5);
        for _ in 0..20 {
            let t2 = theta * theta;
            let off = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))) - distorted;
            let slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
            theta = (theta - off / slope).clamp(0.0, 1.57);
        }
        if distorted > 0.0 { target * (theta.tan() / distorted) } else { *target }
    }
}
