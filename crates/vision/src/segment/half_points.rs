//! The two independent offsets that carry the information of a fitted straight line.

/// Two places s along a line and the variance of the independent offsets there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HalfPoints {
    pub(super) places: [f64; 2],
    /// The variance of each offset, in the units of the samples' noise.
    pub(super) variance: f64,
}

/// The two independent offsets equal to n samples of offsets α + β s, each with the weight w and the variance v / w.
///
/// The places are the samples' weighted centre ± their weighted RMS distance from it, and both variances are 2v / Σw:
/// for any α, β the sum of squares is that of the samples, up to the constant of the best fit. `None` if all samples
/// lie in one place.
pub(super) fn half_points(samples: impl Iterator<Item = (f64, f64)> + Clone, v: f64) -> Option<HalfPoints> {
    let (weight, sum) = samples.clone().fold((0.0, 0.0), |(weight, sum), (s, w)| (weight + w, sum + w * s));
    let centre = sum / weight;
    let spread = (samples.map(|(s, w)| w * (s - centre) * (s - centre)).sum::<f64>() / weight).sqrt();
    (spread > 0.0).then(|| HalfPoints { places: [centre - spread, centre + spread], variance: 2.0 * v / weight })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The information of (α, β), and the difference of χ² between two lines, agree for any spacing and weights.
    #[test]
    fn two_offsets_have_the_information_of_all_samples() {
        for spacing in [1.0, 1.7, 3.1] {
            let samples: Vec<(f64, f64)> =
                (0..23).map(|i| (libm::pow(f64::from(i), spacing) * 0.37 - 4.0, 0.5 + f64::from(i * i % 7))).collect();
            let v = 0.31;
            let two = half_points(samples.iter().copied(), v).unwrap();
            let moment = |power: i32| samples.iter().map(|(s, w)| w / v * s.powi(power)).sum::<f64>();
            let own = |power: i32| two.places.iter().map(|s| s.powi(power) / two.variance).sum::<f64>();
            for power in 0..3 {
                assert!((own(power) / moment(power) - 1.0).abs() < 1e-12, "{power}: {} {}", own(power), moment(power));
            }
            // Samples on a line: both sums of squares vanish there, and grow alike away from it.
            let line = |(a, b): (f64, f64), s: f64| a + b * s;
            let (truth, other) = ((0.3, -0.02), (0.1, 0.05));
            let of_samples: f64 = samples.iter().map(|&(s, w)| w / v * (line(truth, s) - line(other, s)).powi(2)).sum();
            let of_two: f64 =
                two.places.iter().map(|&s| (line(truth, s) - line(other, s)).powi(2) / two.variance).sum();
            assert!((of_two / of_samples - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn one_place_is_no_line() {
        assert_eq!(half_points([(2.0, 1.0), (2.0, 3.0)].into_iter(), 1.0), None);
    }
}
