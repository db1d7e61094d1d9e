//! The blurred step across an edge.

use std::sync::LazyLock;

/// The normal equations of one sample across an edge: levels a + c Φ(t/σ) − e φ(t/σ)/σ at the distances t.
///
/// Φ and φ are the normal distribution and its density, c is the contrast, and e = c δ for a small offset δ of the edge.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Step {
    n: f64,
    /// Sums of Φ, φ/σ and the level, and of their products.
    p: f64,
    q: f64,
    y: f64,
    pp: f64,
    pq: f64,
    qq: f64,
    py: f64,
    qy: f64,
}

/// The solution for one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fitted {
    /// The level of the darker side.
    pub(super) level: f64,
    /// The contrast c (grey levels).
    pub(super) contrast: f64,
    /// The product e of contrast and offset.
    pub(super) moment: f64,
}

impl Step {
    /// Adds the grey level at distance `t` (px), with the inverse blur 1/σ (1/px).
    pub(super) fn add(&mut self, normal: Normal, t: f64, inverse_blur: f64, level: f64) {
        let (p, density) = normal.at(t * inverse_blur);
        let q = density * inverse_blur;
        self.n += 1.0;
        self.p += p;
        self.q += q;
        self.y += level;
        self.pp += p * p;
        self.pq += p * q;
        self.qq += q * q;
        self.py += p * level;
        self.qy += q * level;
    }

    /// The least-squares solution; `None` for too few levels.
    pub(super) fn solve(&self) -> Option<Fitted> {
        let (p, q, y) = (self.p / self.n, self.q / self.n, self.y / self.n);
        let (pp, pq, qq) = (self.pp - self.p * p, self.pq - self.p * q, self.qq - self.q * q);
        let (py, qy) = (self.py - self.p * y, self.qy - self.q * y);
        let determinant = pp * qq - pq * pq;
        if !(determinant > 1e-9 * pp * qq) {
            return None;
        }
        let contrast = (qq * py - pq * qy) / determinant;
        let slope = (pp * qy - pq * py) / determinant;
        Some(Fitted { level: y - contrast * p - slope * q, contrast, moment: -slope })
    }
}

/// The range and the resolution of the table of the normal distribution.
const REACH: f64 = 6.0;
const PER_UNIT: f64 = 64.0;

/// A table of the normal distribution Φ and its density φ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal(&'static [[f64; 2]]);

impl Normal {
    pub(super) fn table() -> Self {
        static TABLE: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
            let count = (2.0 * REACH * PER_UNIT) as usize + 2;
            let entry = |i: usize| {
                let x = i as f64 / PER_UNIT - REACH;
                let density = libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
                [0.5 * libm::erfc(-x / std::f64::consts::SQRT_2), density]
            };
            (0..count).map(entry).collect()
        });
        Self(&TABLE)
    }

    /// Φ(x) and φ(x) by linear interpolation, accurate to 1e-5.
    pub(super) fn at(self, x: f64) -> (f64, f64) {
        let place = (x.clamp(-REACH, REACH) + REACH) * PER_UNIT;
        let index = place as usize;
        let part = place - index as f64;
        let (a, b) = (self.0[index], self.0[index + 1]);
        (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_step_is_measured() {
        let (mut step, normal) = (Step::default(), Normal::table());
        for i in -4..=4 {
            let t = f64::from(i) + 0.3;
            step.add(normal, t, 1.0 / 0.9, 40.0 + 25.0 * normal.at((t - 0.05) / 0.9).0);
        }
        let fitted = step.solve().unwrap();
        assert!((fitted.moment / fitted.contrast - 0.05).abs() < 1e-3, "{fitted:?}");
        assert!((fitted.contrast - 25.0).abs() < 0.1 && (fitted.level - 40.0).abs() < 0.1);
        assert_eq!(Step::default().solve(), None);
    }

    #[test]
    fn the_table_is_the_normal_distribution() {
        for x in [-7.0, -2.013, 0.0, 0.777, 3.3, 7.0] {
            let (below, density) = Normal::table().at(x);
            assert!((below - 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)).abs() < 1e-5);
            let exact = libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
            assert!((density - exact).abs() < 2e-5, "{x}: {density} {exact}");
        }
    }
}
