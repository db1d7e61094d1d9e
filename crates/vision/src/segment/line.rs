//! The robust straight line through the offsets of an edge's columns.

use std::ops::Range;

use super::trace::Crossing;

/// One column that the line uses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) along: f64,
    pub(super) gain: f64,
    offset: f64,
}

/// A straight line α + β (s − s̄) of displacements across the edge, in directions, over the position s.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    centre: f64,
    alpha: f64,
    beta: f64,
    /// The columns in use.
    pub(super) samples: Vec<Sample>,
    /// Their number.
    pub(super) used: f64,
    /// The RMS residual (px).
    pub(super) residual: f64,
    /// The variance of a column's offset (px²), raised by the correlation of successive ones.
    pub(super) variance: f64,
    /// The fraction of this variance that successive columns share: what the scene adds, not the image noise.
    pub(super) texture: f64,
}

impl Line {
    /// The displacement at the position s.
    pub(super) fn at(&self, along: f64) -> f64 {
        self.alpha + self.beta * (along - self.centre)
    }

    /// The larger displacement at two positions.
    pub(super) fn largest(&self, a: f64, b: f64) -> f64 {
        self.at(a).abs().max(self.at(b).abs())
    }

    /// The least-squares line of the samples.
    fn solve(&mut self) -> Option<()> {
        let (mut weight, mut centre) = (0.0, 0.0);
        for sample in &self.samples {
            let w = sample.gain * sample.gain;
            (weight, centre) = (weight + w, centre + w * sample.along);
        }
        centre /= weight;
        let (mut spread, mut first, mut second) = (0.0, 0.0, 0.0);
        for sample in &self.samples {
            let s = sample.along - centre;
            spread += sample.gain * sample.gain * s * s;
            first += sample.gain * sample.offset;
            second += sample.gain * sample.offset * s;
        }
        (self.centre, self.alpha, self.beta) = (centre, first / weight, second / spread);
        (self.alpha.is_finite() && self.beta.is_finite()).then_some(())
    }

    fn residual_of(&self, sample: &Sample) -> f64 {
        sample.offset - sample.gain * self.at(sample.along)
    }
}

/// Rounds of rejection.
const ROUNDS: usize = 4;
/// Offsets beyond this number of robust standard deviations are rejected.
const REJECTED: f64 = 3.0;
/// The smallest robust standard deviation (px) for rejection; below it rounding decides.
const SMALLEST: f64 = 0.02;

/// The line through the offsets (px) of the columns of `range`; `None` for fewer than eight of them.
///
/// It starts from Theil's median of slopes between halves, then repeats: least squares, and the rejection of offsets
/// beyond three robust standard deviations.
pub(super) fn fit_line(crossings: &[Crossing], offsets: &[Option<f64>], range: Range<usize>) -> Option<Line> {
    let all: Vec<Sample> = range
        .filter_map(|i| Some(Sample { along: crossings[i].along, gain: crossings[i].gain, offset: offsets[i]? }))
        .collect();
    if all.len() < 8 {
        return None;
    }
    let mut line = start(&all)?;
    let mut scratch = Vec::with_capacity(all.len());
    for _ in 0..ROUNDS {
        scratch.clear();
        scratch.extend(all.iter().map(|sample| line.residual_of(sample).abs()));
        let scale = 1.4826 * median(&mut scratch)?;
        let limit = REJECTED * scale.max(SMALLEST);
        let kept: Vec<Sample> = all.iter().copied().filter(|sample| line.residual_of(sample).abs() <= limit).collect();
        let same = kept.len() == line.samples.len();
        line.samples = kept;
        if line.samples.len() < 8 {
            return None;
        }
        line.solve()?;
        if same {
            break;
        }
    }
    let n = line.samples.len() as f64;
    let residuals: Vec<f64> = line.samples.iter().map(|sample| line.residual_of(sample)).collect();
    let squares = residuals.iter().map(|r| r * r).sum::<f64>();
    line.used = n;
    line.residual = (squares / n).sqrt();
    let (factor, white) = correlation(&residuals, squares);
    line.variance = squares / (n - 2.0) * factor;
    line.texture = 1.0 - white / factor;
    Some(line)
}

/// The line through the median offsets of the outer thirds.
fn start(all: &[Sample]) -> Option<Line> {
    let third = all.len() / 3;
    let middle = |some: &[Sample]| {
        let mut offsets: Vec<f64> = some.iter().map(|sample| sample.offset / sample.gain).collect();
        let along = some.iter().map(|sample| sample.along).sum::<f64>() / some.len() as f64;
        Some((along, median(&mut offsets)?))
    };
    let (a, b) = (middle(&all[..third])?, middle(&all[all.len() - third..])?);
    let beta = (b.1 - a.1) / (b.0 - a.0);
    let line = Line { centre: a.0, alpha: a.1, beta, ..Line::default() };
    line.beta.is_finite().then_some(line)
}

/// The factor 1 + 2 Σ ρ_k by which the correlation of successive residuals raises the variance of their mean, and the
/// white part of their own variance, 1 − ρ₁.
///
/// The sum ends before the first correlation that noise explains.
fn correlation(residuals: &[f64], squares: f64) -> (f64, f64) {
    let n = residuals.len();
    let noise = 1.0 / (n as f64).sqrt();
    let (mut factor, mut white) = (1.0, 1.0);
    for lag in 1..=n / 4 {
        let rho = residuals.iter().zip(&residuals[lag..]).map(|(a, b)| a * b).sum::<f64>() / squares;
        if !(rho > noise) {
            break;
        }
        if lag == 1 {
            white = 1.0 - rho;
        }
        factor += 2.0 * rho;
    }
    (factor, white)
}

/// The median, which reorders the values; `None` of none.
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Alternating residuals are image noise; residuals that change every twenty columns come from the scene.
    #[test]
    fn what_is_alike_in_successive_columns_is_not_noise() {
        let of = |period: usize| -> (f64, f64) {
            let residuals: Vec<f64> =
                (0..400).map(|i| if (i / period).is_multiple_of(2) { 0.1 } else { -0.1 }).collect();
            correlation(&residuals, residuals.iter().map(|r| r * r).sum())
        };
        assert_eq!(of(1), (1.0, 1.0));
        // A square wave of period 40: ρ_k = 1 − k/10, up to the ends.
        let (factor, white) = of(20);
        assert!((white - 0.1).abs() < 0.01 && (factor - 10.0).abs() < 1.0, "{factor} {white}");
    }
}
