//! The box of a cloud.

use nalgebra::Vector3;

/// The share of the points, at either end of an axis, that may lie far outside.
const OUTSIDE: f64 = 0.1;
/// Clouds of fewer points have none outside.
const FEWEST: usize = 8;
/// A box so many times as long as evenly spread points would need for what lies between those shares is not filled evenly.
const TIMES: f64 = 3.0;
/// Parts of a side; a third of it lies in no more than three.
const PARTS: usize = 6;

/// The box, along the axes, that clutter is taken to fill evenly.
///
/// The bounding box of the points; but where a few lie far outside, it is the box of the others. A wrong match of a distant
/// ground, or of a ray that hardly meets the other, is measured anywhere up to the horizon, and a bounding box that reaches
/// out to it makes clutter appear to be as thin as water. Along each axis
///
/// w = (x₍₉₀₎ − x₍₁₀₎)/0.8
///
/// is the length that evenly spread points would have, by the tenth and the ninetieth of a hundred; the side is that of the
/// bounding box, unless that is more than 3 w, which of ten evenly spread points happens to one axis in two thousand, and of
/// more hardly ever, and more than the object is long beyond w at either end: before a wall that fills a tenth of the depth,
/// what stands out by less may be the object. Then it is w. Points that are no numbers are nowhere.
///
/// The interdecile range is a robust estimate of scale: Huber and Ronchetti, *Robust Statistics*, 2009, ch. 5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CloudBox {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl CloudBox {
    /// The box of these points, where the object is so long (m); empty, at the origin, of none.
    pub(crate) fn of(points: impl Iterator<Item = Vector3<f64>>, object: f64) -> Self {
        let mut columns: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(points.size_hint().0));
        for at in points.filter(|at| at.iter().all(|x| x.is_finite())) {
            columns.iter_mut().zip(&at).for_each(|(column, x)| column.push(*x));
        }
        let [x, y, z] = columns.map(|mut column| side(&mut column, object));
        Self { low: Vector3::new(x.0, y.0, z.0), high: Vector3::new(x.1, y.1, z.1) }
    }

    /// Its sides (m).
    pub(crate) fn lengths(&self) -> Vector3<f64> {
        self.high - self.low
    }

    /// Whether a place is in it.
    pub(crate) fn holds(&self, at: &Vector3<f64>) -> bool {
        (0..3).all(|axis| self.low[axis] <= at[axis] && at[axis] <= self.high[axis])
    }
}

/// Where the box begins and ends along one axis.
fn side(column: &mut [f64], object: f64) -> (f64, f64) {
    let (low, high) =
        column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    if column.is_empty() {
        return (0.0, 0.0);
    }
    let out = ((OUTSIDE * column.len() as f64) as usize).max(1);
    if column.len() < FEWEST || !may_be_short(column, (low, high), out) {
        return (low, high);
    }
    let last = column.len() - 1 - out;
    let (_, &mut first, rest) = column.select_nth_unstable_by(out, f64::total_cmp);
    let (_, &mut last, _) = rest.select_nth_unstable_by(last - out - 1, f64::total_cmp);
    // Of n evenly spread points there are n − 1 spacings, out of each end's not counted.
    let spacings = (column.len() - 1) as f64;
    let length = (last - first) * spacings / (spacings - 2.0 * out as f64);
    if high - low <= (TIMES * length).max(length + 2.0 * object) {
        return (low, high);
    }
    let beyond = 0.5 * (length - (last - first));
    ((first - beyond).max(low), (last + beyond).min(high))
}

/// Whether all but `out` at either end may lie within a third of the side: no sorting is needed to see that they do not.
fn may_be_short(column: &[f64], (low, high): (f64, f64), out: usize) -> bool {
    let scale = PARTS as f64 / (high - low);
    let mut counts = [0usize; PARTS];
    for x in column {
        counts[(((x - low) * scale) as usize).min(PARTS - 1)] += 1;
    }
    // A side without a length, or of one that is no number, is looked at.
    !(scale > 0.0 && scale.is_finite())
        || counts.windows(3).any(|three| three.iter().sum::<usize>() >= column.len() - 2 * out)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn drawn(count: usize, seed: u64) -> Vec<Vector3<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| Vector3::from_fn(|axis, _| rng.random_range(-1.0..1.0) * [2.0, 1.0, 0.5][axis])).collect()
    }

    fn bounds(points: &[Vector3<f64>]) -> CloudBox {
        let first = points[0];
        let (low, high) = points.iter().fold((first, first), |(low, high), at| (low.inf(at), high.sup(at)));
        CloudBox { low, high }
    }

    #[test]
    fn evenly_spread_points_fill_their_bounding_box() {
        for seed in 0..300 {
            for count in [1, 3, 7, 20, 100, 1000] {
                let points = drawn(count, seed);
                assert_eq!(CloudBox::of(points.iter().copied(), 1.0), bounds(&points), "{count} of seed {seed}");
            }
        }
    }

    /// Seen to fail with the bounding box.
    #[test]
    fn a_few_points_far_outside_are_not_in_it() {
        for seed in 0..300 {
            for (count, far) in [(10, 1), (20, 1), (100, 9), (1000, 90)] {
                let mut points = drawn(count, seed);
                let own = bounds(&points).lengths();
                // Up to the horizon, and as far as numbers go.
                points.extend((0..far).map(|k| Vector3::new(-20.0, 30.0, 10.0) * 1e3_f64.powi(k % 100)));
                let found = CloudBox::of(points.iter().copied(), 1.0);
                let times = found.lengths().component_div(&own);
                assert!(times.iter().all(|times| (0.4..2.5).contains(times)), "{count} of seed {seed}: {times:?}");
                let held = points.iter().filter(|at| found.holds(at)).count();
                assert!(10 * held >= 4 * count && held <= count, "{count} of seed {seed}: {held} inside");
            }
        }
    }

    #[test]
    fn it_does_not_depend_on_the_order() {
        let mut points = drawn(50, 7);
        points.push(Vector3::repeat(1e4));
        let forth = CloudBox::of(points.iter().copied(), 1.0);
        assert_eq!(forth, CloudBox::of(points.iter().rev().copied(), 1.0));
    }

    #[test]
    fn what_is_no_number_is_nowhere() {
        let points = [Vector3::zeros(), Vector3::new(1.0, f64::NAN, 0.0), Vector3::new(2.0, 1.0, 3.0)];
        assert_eq!(CloudBox::of(points.into_iter(), 1.0).lengths(), Vector3::new(2.0, 1.0, 3.0));
        assert_eq!(CloudBox::of(std::iter::empty(), 1.0).lengths(), Vector3::zeros());
        let flat = vec![Vector3::new(1.0, 2.0, 3.0); 20];
        assert_eq!(CloudBox::of(flat.into_iter(), 1.0).lengths(), Vector3::zeros());
        let far = [-1.7e308, 0.0, 1.7e308].map(Vector3::repeat);
        assert_eq!(CloudBox::of(far.into_iter(), 1.0).lengths(), Vector3::repeat(f64::INFINITY));
    }
}
