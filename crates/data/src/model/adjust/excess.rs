//! The noise of observations beyond their own covariances.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// Variances that the residuals show beyond the covariances of the images.
///
/// The place that a locator calls a corner depends a little on the viewpoint: rounding of the edge, light, what lies
/// behind it. This offset is common to both images of a pair and new in another one. The disparity has an excess of its
/// own. With the common part c = (left + right)/2 and the difference d = right − left of the residuals, the excess
/// adds σ_c² I to Cov c and σ_d² I to Cov d.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Excess {
    /// The standard deviation σ_c of the common part (px).
    pub(crate) common: f64,
    /// The standard deviation σ_d of the difference (px).
    pub(crate) difference: f64,
}

impl Excess {
    /// An excess before any residual is known: corners of rendered dives have view-dependent offsets of 0.04 to 0.14 px.
    pub(crate) const INITIAL: Self = Self { common: 0.15, difference: 0.05 };
}

/// The number of degrees of freedom below which residuals determine no variance: its relative error is √(2/n), 30 %.
const FEW: usize = 20;
/// The largest excess (px): observations that differ by more do not show one point.
const MAX: f64 = 2.0;
/// The number of bisections: they resolve 2⁻³⁰ of the range.
const BISECTIONS: usize = 30;

impl Excess {
    /// The sum of `covariance` and the excess.
    pub(super) fn added_to(&self, covariance: &Matrix4<f64>) -> Matrix4<f64> {
        let (common, difference) = (self.common * self.common, 0.25 * self.difference * self.difference);
        let mut sum = *covariance;
        for k in 0..4 {
            sum[(k, k)] += common + difference;
            sum[(k, (k + 2) % 4)] += common - difference;
        }
        sum
    }

    /// The excess with which Σ cᵀ Cov⁻¹ c and Σ dᵀ Cov⁻¹ d have their expectations (variance component estimation).
    ///
    /// `redundancy` is the number of degrees of freedom over that of measurements, by which fitted residuals are smaller
    /// than errors; `dof` is the number of degrees of freedom.
    pub(crate) fn of(residuals: &[(Vector4<f64>, Matrix4<f64>)], redundancy: f64, dof: usize) -> Self {
        if dof < FEW {
            return Self::default();
        }
        let part = |vector: &Vector4<f64>, sign: f64, scale: f64| -> Vector2<f64> {
            (vector.fixed_rows::<2>(2) + vector.fixed_rows::<2>(0) * sign) * scale
        };
        let block = |all: &Matrix4<f64>, i, j| all.fixed_view::<2, 2>(i, j).into_owned();
        let covariance = |all: &Matrix4<f64>, sign: f64, scale: f64| -> Matrix2<f64> {
            let across = block(all, 0, 2) + block(all, 2, 0);
            (block(all, 0, 0) + block(all, 2, 2) + across * sign) * (scale * scale)
        };
        let of = |sign: f64, scale: f64| {
            let parts: Vec<(Vector2<f64>, Matrix2<f64>)> =
                residuals.iter().map(|(r, c)| (part(r, sign, scale), covariance(c, sign, scale))).collect();
            bisected(&parts, 2.0 * redundancy * residuals.len() as f64)
        };
        Self { common: of(1.0, 0.5), difference: of(-1.0, 1.0) }
    }
}

/// The σ with Σ rᵀ (C + σ² I)⁻¹ r = `expected`, within 0 to [`MAX`].
fn bisected(parts: &[(Vector2<f64>, Matrix2<f64>)], expected: f64) -> f64 {
    let sum = |sigma: f64| -> f64 {
        let added = Matrix2::identity() * (sigma * sigma);
        let norm = |(r, covariance): &(Vector2<f64>, Matrix2<f64>)| {
            (covariance + added).try_inverse().map_or(0.0, |information| r.dot(&(information * r)))
        };
        parts.iter().map(norm).sum()
    };
    if sum(0.0) <= expected {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, MAX);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if sum(middle) > expected { low = middle } else { high = middle }
    }
    high
}
