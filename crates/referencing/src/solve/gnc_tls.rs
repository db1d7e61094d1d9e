//! Graduated non-convexity with truncated least squares: the threshold limits the effect of outliers.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        closed_form::{distance, fit, fit_weighted, variance},
        covariance::sandwich,
        degeneracy::{Degenerate, check, fraction},
        solver::Solver,
    },
};

/// Truncated least squares: min Σ σ_k² min(d_k², c²), d_k = ‖C·H − P‖ / σ_k, by graduated non-convexity.
///
/// σ_k² = tr(Σ_k + σ_model² I)/3 and c is the threshold. The result is the least-squares motion of the inliers, which
/// the method selects itself. The sum has many minima: a convex approximation is solved first and gradually changed
/// into it. With μ growing by `growth`, a point has weight 1 below c²μ/(μ+1), 0 above c²(μ+1)/μ, and (c/d)√(μ(μ+1)) − μ
/// between. If points are excluded, they may be the wrong ones: up to `triples` sets of three points then serve as
/// further starts (all sets, for few points), and the smallest sum is the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct GncTls {
    /// Threshold c (standard deviations of a point), positive; 4.5 keeps 99 % of the inliers even if all noise is along
    /// one axis.
    pub(crate) threshold: f64,
    /// Factor by which μ grows per step, above 1 and at most 10.
    pub(crate) growth: f64,
    /// Maximum number of sets of three points that serve as starts, 0 to 100000; 1000 covers all sets of nineteen
    /// points.
    pub(crate) triples: usize,
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

impl Default for GncTls {
    fn default() -> Self {
        Self { threshold: 4.5, growth: 1.4, triples: 1000, min_ratio: 1e-3 }
    }
}

impl Component for GncTls {
    const NAME: &'static str = "gnc-tls";
    const SUMMARY: &'static str = "truncated least squares by graduated non-convexity: excludes outliers";
    const SOURCE: &'static str = "Yang, Antonante, Tzoumas, Carlone, Graduated non-convexity for robust spatial \
                                  perception, 2020";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        // A NaN is rejected as well.
        let positive = self.threshold > 0.0 && self.threshold.is_finite();
        in_range(positive, "threshold", self.threshold, "a positive number of standard deviations")?;
        let grows = self.growth > 1.0 && self.growth <= 10.0;
        in_range(grows, "growth", self.growth, "a number above 1, at most 10")?;
        in_range(self.triples <= 100_000, "triples", self.triples, "0 to 100000")?;
        fraction("min-ratio", self.min_ratio)
    }
}

/// Maximum number of changes of the inliers per start.
const MAX_TURNS: usize = 10;
/// Maximum number of steps; μ passes through twenty decades.
const MAX_STEPS: usize = 200;

impl Solver for GncTls {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        Ok(self.keep(data)?.0)
    }

    /// The inliers.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        let kept = check(data, self.minimum(), self.min_ratio).and_then(|()| self.keep(data));
        let kept = kept.map(|(_, kept)| kept).unwrap_or_default();
        (0..kept.len()).filter(|&k| kept[k]).collect()
    }

    /// The covariance of least squares over the inliers.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let kept = self.used(data).into_iter().map(|k| data.points[k]).collect();
        let kept = Observations { points: kept, edges: Vec::new(), rig: data.rig };
        sandwich::or_resampled(&kept, at, |_| 1.0, |sampled| Ok(fit(&sampled.points)))
    }
}

/// The `m`-th set of three of `n` points in lexicographic order: 0 is {0, 1, 2}.
fn triple(mut m: usize, n: usize) -> [usize; 3] {
    let pairs = |i: usize| (n - i - 1) * (n - i - 2) / 2;
    let mut i = 0;
    while m >= pairs(i) {
        m -= pairs(i);
        i += 1;
    }
    let mut j = i + 1;
    while m >= n - j - 1 {
        m -= n - j - 1;
        j += 1;
    }
    [i, j, j + 1 + m]
}

impl GncTls {
    /// The pose and its inliers.
    fn keep(&self, data: &Observations<'_>) -> Result<(Transform<Object, Camera>, Vec<bool>), Degenerate> {
        let (mut pose, mut kept) = self.graduated(data)?;
        if kept.iter().all(|&kept| kept) {
            return Ok((pose, kept));
        }
        let points = &data.points;
        let c2 = self.threshold * self.threshold;
        let sum = |pose: &_| -> f64 {
            points.iter().map(|point| variance(point) * distance(point, pose).powi(2).min(c2)).sum()
        };
        let mut min = sum(&pose);
        let n = points.len();
        let all = n * (n - 1) * (n - 2) / 6;
        // An even sample of the sets if there are more than `triples`.
        let stride = all.div_ceil(self.triples.max(1));
        for three in (0..all).step_by(stride).take(self.triples).map(|m| triple(m, n)) {
            let mut chosen: Vec<bool> = (0..n).map(|k| three.contains(&k)).collect();
            for _ in 0..MAX_TURNS {
                let weights: Vec<f64> = chosen.iter().map(|&kept| f64::from(u8::from(kept))).collect();
                if !self.determined(data, &weights) {
                    break;
                }
                let other = fit_weighted(points, |k| weights[k]);
                let next: Vec<bool> = points.iter().map(|point| distance(point, &other).powi(2) <= c2).collect();
                if next == chosen {
                    let found = sum(&other);
                    if found < min * (1.0 - 1e-9) {
                        (min, pose, kept) = (found, other, next);
                    }
                    break;
                }
                chosen = next;
            }
        }
        Ok((pose, kept))
    }

    /// The result of graduated non-convexity from the unweighted fit.
    fn graduated(&self, data: &Observations<'_>) -> Result<(Transform<Object, Camera>, Vec<bool>), Degenerate> {
        let points = &data.points;
        let c2 = self.threshold * self.threshold;
        let mut pose = fit_weighted(points, |_| 1.0);
        let mut squares: Vec<f64> = points.iter().map(|point| distance(point, &pose).powi(2)).collect();
        let largest = squares.iter().copied().fold(0.0, f64::max);
        if !largest.is_finite() {
            return Err(Degenerate::NotFinite);
        }
        let mut weights = vec![1.0; points.len()];
        if 2.0 * largest > c2 {
            let mut mu = c2 / (2.0 * largest - c2);
            for _ in 0..MAX_STEPS {
                let weight = |d2: f64| {
                    if d2 <= c2 * mu / (mu + 1.0) {
                        1.0
                    } else if d2 >= c2 * (mu + 1.0) / mu {
                        0.0
                    } else {
                        ((c2 / d2 * mu * (mu + 1.0)).sqrt() - mu).clamp(0.0, 1.0)
                    }
                };
                let next: Vec<f64> = squares.iter().map(|&d2| weight(d2)).collect();
                if !self.determined(data, &next) {
                    return Ok((pose, weights.iter().map(|&w| w > 0.0).collect()));
                }
                weights = next;
                pose = fit_weighted(points, |k| weights[k]);
                squares.iter_mut().zip(points).for_each(|(d2, point)| *d2 = distance(point, &pose).powi(2));
                if weights.iter().all(|&w| w == 0.0 || w == 1.0) {
                    break;
                }
                mu *= self.growth;
            }
        }
        Ok((pose, weights.iter().map(|&w| w > 0.5).collect()))
    }

    /// Whether the points with a positive weight are three or more and not collinear.
    fn determined(&self, data: &Observations<'_>, weights: &[f64]) -> bool {
        let kept = data.points.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(point, _)| *point).collect();
        check(&Observations { points: kept, edges: Vec::new(), rig: data.rig }, self.minimum(), self.min_ratio).is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::triple;

    #[test]
    fn sets_of_three_come_in_the_order_of_the_dictionary() {
        let n = 7;
        let all = (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
        for (m, three) in all.enumerate() {
            assert_eq!(triple(m, n), three);
        }
    }
}
