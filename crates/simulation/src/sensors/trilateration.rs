//! Trilateration: a position from ranges to known places and a depth.

use nalgebra::{Matrix3, Vector3};

/// Maximum number of Levenberg–Marquardt steps.
const STEPS: usize = 40;
/// Step length that ends the fit (m).
const STILL: f64 = 1e-9;
/// Limits of the weighted sum of squares: the 99.9 % quantiles of χ² for 0 to 5 degrees of freedom. A larger sum
/// indicates an echo.
const LIMITS: [f64; 6] = [0.0, 10.8, 13.8, 16.3, 18.5, 20.5];
/// Standard deviation above which a direction counts as undetermined (m).
const UNKNOWN: f64 = 1e3;

/// A measured length with standard deviations of its independent and of its shared error (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Length {
    pub(super) value: f64,
    pub(super) noise: f64,
    pub(super) common: f64,
}

impl Length {
    fn sigma(&self) -> f64 {
        self.noise.hypot(self.common).max(1e-3)
    }
}

/// A position with the covariances of its independent noise and of its shared error (m²).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) at: Vector3<f64>,
    pub(super) noise: Matrix3<f64>,
    pub(super) common: Matrix3<f64>,
}

/// The least-squares position (north, east, down) from ranges and an optional depth.
///
/// Ranges that contradict the others are excluded, worst first, while enough remain. The answer is `None` if a
/// contradiction remains or if the measurements are too few. Two ranges and a depth fit two positions, one on each side
/// of the baseline, hence `None`. Places at one depth have a mirror image below them; `start` selects the vehicle's
/// side.
pub(super) fn trilaterate(
    ranges: &[(Vector3<f64>, Length)],
    depth: Option<Length>,
    start: Vector3<f64>,
) -> Option<Found> {
    let mut kept = ranges.to_vec();
    if kept.len() < 3 {
        return None;
    }
    loop {
        let free = (kept.len() + usize::from(depth.is_some())).checked_sub(3)?;
        let (found, cost) = fit(&kept, depth, start)?;
        if free == 0 || cost <= LIMITS[free.min(LIMITS.len() - 1)] {
            return Some(found);
        }
        // The rest must be redundant after an exclusion, or no contradiction could show.
        if free == 1 {
            return None;
        }
        let without = |k: usize| {
            let rest: Vec<_> = kept.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, r)| *r).collect();
            fit(&rest, depth, start).map_or(f64::INFINITY, |(_, cost)| cost)
        };
        let worst = (0..kept.len()).map(|k| (k, without(k))).min_by(|a, b| a.1.total_cmp(&b.1))?.0;
        kept.remove(worst);
    }
}

/// The fit and its weighted sum of squares.
fn fit(ranges: &[(Vector3<f64>, Length)], depth: Option<Length>, start: Vector3<f64>) -> Option<(Found, f64)> {
    // Each row: direction, residual, measured length with its deviations.
    let rows = |at: &Vector3<f64>| -> Vec<(Vector3<f64>, f64, Length)> {
        let range = |(place, range): &(Vector3<f64>, Length)| {
            let offset = at - place;
            let length = offset.norm().max(1e-6);
            (offset / length, range.value - length, *range)
        };
        let down = depth.map(|depth| (Vector3::z(), depth.value - at.z, depth));
        ranges.iter().map(range).chain(down).collect()
    };
    let cost = |at: &Vector3<f64>| rows(at).iter().map(|(_, miss, l)| (miss / l.sigma()).powi(2)).sum::<f64>();
    let normal = |at: &Vector3<f64>| {
        rows(at).iter().fold((Matrix3::zeros(), Vector3::zeros()), |(h, g), (along, miss, length)| {
            let weight = length.sigma().powi(-2);
            (h + along * along.transpose() * weight, g + along * (miss * weight))
        })
    };
    let (mut at, mut now, mut damping) = (start, cost(&start), 1e-6);
    for _ in 0..STEPS {
        let (h, g) = normal(&at);
        let damped = h + Matrix3::from_diagonal_element(damping * h.trace());
        let step = damped.cholesky()?.solve(&g);
        let (next, then) = (at + step, cost(&(at + step)));
        if then <= now {
            (at, now, damping) = (next, then, (damping * 0.1).max(1e-12));
            if step.norm() < STILL {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    let (h, _) = normal(&at);
    let full = h.cholesky()?.inverse();
    if !(full.symmetric_eigenvalues().max() < UNKNOWN * UNKNOWN) {
        return None;
    }
    let spread = |fraction: fn(&Length) -> f64| {
        let sum = rows(&at).iter().fold(Matrix3::zeros(), |sum, (along, _, length)| {
            let gain = full * along * length.sigma().powi(-2);
            sum + gain * gain.transpose() * fraction(length).powi(2)
        });
        0.5 * (sum + sum.transpose())
    };
    Some((Found { at, noise: spread(|l| l.noise.max(1e-3)), common: spread(|l| l.common) }, now))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around() -> [Vector3<f64>; 5] {
        [[-60.0, -50.0, 38.0], [70.0, -40.0, 39.0], [55.0, 65.0, 37.0], [-50.0, 60.0, 40.0], [0.0, 90.0, 36.0]]
            .map(Vector3::from)
    }

    fn received(at: &Vector3<f64>, n: usize) -> Vec<(Vector3<f64>, Length)> {
        let range = |t: &Vector3<f64>| (*t, Length { value: (at - t).norm(), noise: 0.1, common: 0.05 });
        around()[..n].iter().map(range).collect()
    }

    #[test]
    fn exact_ranges_give_the_exact_place() {
        let at = Vector3::new(12.0, -7.0, 34.5);
        let depth = Some(Length { value: at.z, noise: 0.02, common: 0.1 });
        for (n, depth) in [(3, depth), (4, None), (5, depth)] {
            let start = Vector3::new(0.0, -1.0, 20.0);
            let found = trilaterate(&received(&at, n), depth, start).unwrap();
            assert!((found.at - at).norm() < 1e-6, "{n}: {}", found.at);
        }
        assert_eq!(trilaterate(&received(&at, 1), depth, Vector3::zeros()), None);
        // Regression: two ranges once gave the position on the wrong side.
        assert_eq!(trilaterate(&received(&at, 2), depth, Vector3::zeros()), None);
    }

    #[test]
    fn an_echo_is_left_out_where_it_can_be_reported() {
        let at = Vector3::new(12.0, -7.0, 34.5);
        let depth = Some(Length { value: at.z, noise: 0.02, common: 0.1 });
        for echo in 0..5 {
            let mut ranges = received(&at, 5);
            ranges[echo].1.value += 4.0;
            let found = trilaterate(&ranges, depth, Vector3::new(0.0, 0.0, 20.0)).unwrap();
            assert!((found.at - at).norm() < 1e-6, "{echo}: {}", found.at);
        }
        // Three ranges and a depth have one redundant measurement, which cannot identify the echo: no position instead
        // of a false one.
        let mut ranges = received(&at, 3);
        ranges[1].1.value += 4.0;
        assert_eq!(trilaterate(&ranges, depth, Vector3::zeros()), None);
    }

    #[test]
    fn places_on_one_line_give_no_position() {
        let ranges: Vec<_> = [0.0_f64, 40.0, 100.0]
            .map(|x| (Vector3::new(x, 0.0, 40.0), Length { value: 50.0, noise: 0.1, common: 0.0 }))
            .into();
        // North and south of the line are indistinguishable.
        let depth = Some(Length { value: 40.0, noise: 0.02, common: 0.1 });
        let on_line: Vec<_> = ranges.iter().map(|(t, l)| (*t, Length { value: (t.x - 30.0).abs(), ..*l })).collect();
        assert_eq!(trilaterate(&on_line, depth, Vector3::new(20.0, 0.0, 40.0)), None);
    }
}
