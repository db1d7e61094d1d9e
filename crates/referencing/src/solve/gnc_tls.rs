//! Graduated non-convexity with truncated least squares: outliers count no more than the threshold.

use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    degeneracy::{check, fraction},
    irls::distance,
    kabsch::{self, fit_weighted},
    sandwich,
    weighted_kabsch::variance,
};
use crate::Observations;

/// The motion of least Σ σ_k² min(d_k², c²), d_k = ‖C·H − P‖ / σ_k, σ_k² = tr(Σ_k + σ_model² I)/3, c the threshold: least
/// squares over the points it keeps, which it chooses itself.
///
/// The sum has many minima. A convex one is solved first and bent step by step into it: with μ growing by
/// `growth`, a point weighs 1 below c²μ/(μ+1), 0 above c²(μ+1)/μ, and (c/d)√(μ(μ+1)) − μ between. Where that leaves points
/// out it may have left the wrong ones: up to `triples` sets of three points, all of few, are starts besides, and the
/// least sum stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct GncTls {
    /// c (standard deviations of a point): 4.5 keeps 99 % of true points even where all noise is along one axis.
    pub(crate) threshold: f64,
    /// By how much μ grows a step.
    pub(crate) growth: f64,
    /// How many sets of three points are tried where points are left out: 1000 are all of nineteen points.
    pub(crate) triples: usize,
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) min_ratio: f64,
}

impl Default for GncTls {
    fn default() -> Self {
        Self { threshold: 4.5, growth: 1.4, triples: 1000, min_ratio: 1e-3 }
    }
}

impl Component for GncTls {
    const NAME: &'static str = "gnc-tls";
    const SUMMARY: &'static str = "truncated least squares by graduated non-convexity: leaves outliers out";
    const SOURCE: &'static str = "Yang, Antonante, Tzoumas, Carlone, Graduated non-convexity for robust spatial \
                                  perception, 2020";

    fn check(&self) -> Result<(), String> {
        // Written so that a NaN is refused too.
        let positive = self.threshold > 0.0 && self.threshold.is_finite();
        in_range(positive, "threshold", self.threshold, "a positive number of standard deviations")?;
        let grows = self.growth > 1.0 && self.growth <= 10.0;
        in_range(grows, "growth", self.growth, "a number above 1, at most 10")?;
        in_range(self.triples <= 100_000, "triples", self.triples, "0 to 100000")?;
        fraction("min-ratio", self.min_ratio)
    }
}

/// How often a start may change what it keeps.
const MAX_TURNS: usize = 10;
/// Steps of the iteration: μ passes through twenty decades.
const MAX_STEPS: usize = 200;

impl Solver for GncTls {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        Ok(self.keep(data)?.0)
    }

    /// The points it keeps.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        let kept = check(data, self.minimum(), self.min_ratio).and_then(|()| self.keep(data));
        let kept = kept.map(|(_, kept)| kept).unwrap_or_default();
        (0..kept.len()).filter(|&k| kept[k]).collect()
    }

    /// That of least squares over the points it keeps.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let kept = self.used(data).into_iter().map(|k| data.points[k]).collect();
        let kept = Observations { points: kept, rig: data.rig };
        sandwich::or_resampled(&kept, at, |_| 1.0, |sampled| Ok(kabsch::fit(&sampled.points)))
    }
}

/// The `m`-th set of three of `n` points in the order of the dictionary: 0 is {0, 1, 2}.
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
    /// The pose and which points it rests on.
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
        // Of more than are tried every so-manieth.
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

    /// What graduation leads to.
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

    /// Whether the points that these weights keep are three and no line.
    fn determined(&self, data: &Observations<'_>, weights: &[f64]) -> bool {
        let kept = data.points.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(point, _)| *point).collect();
        check(&Observations { points: kept, rig: data.rig }, self.minimum(), self.min_ratio).is_ok()
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
