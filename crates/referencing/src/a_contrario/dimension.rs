//! The local dimension of clutter.

use super::{coordinates, sample::spread_sample};
use crate::{Correspondence, Problem};

/// Number of neighbours of a point that define its scale.
const NEIGHBOURS: usize = 12;
/// Minimum radius about a point, in standard deviations of its place, since noise itself is three-dimensional.
const REACH: f64 = 6.0;
/// Maximum number of points whose neighbours are counted.
const SAMPLE: usize = 256;

/// The correlation dimension of the unused candidates: 3 for a volume, 2 for surfaces, 1 for lines.
///
/// The growth of the number of neighbours with the distance, summed over all points (Grassberger and Procaccia,
/// *Measuring the strangeness of strange attractors*, 1983, about each point at its own scale):
///
/// D = log₂ Σ_i N_i(r_i) / Σ_i N_i(r_i/2),
///
/// N_i(r) the number of neighbours of point i nearer than r (m), r_i the distance of its twelfth, but at least six
/// standard deviations of its place. `None` for fewer than 13 points and for places that are not finite. More than
/// [`SAMPLE`] points are decimated by [`spread_sample`]. Time O(256 M).
pub(crate) fn dimension(problem: &Problem<'_>, used: &[Correspondence]) -> Option<f64> {
    let mut counts = vec![false; problem.cloud.len()];
    problem.candidates.lists.iter().flatten().for_each(|&j| counts[j] = true);
    used.iter().for_each(|pair| counts[pair.cloud] = false);
    let all: Vec<usize> = (0..counts.len()).filter(|&j| counts[j]).collect();
    if all.len() <= NEIGHBOURS {
        return None;
    }
    let places: Vec<_> = all.iter().map(|&j| coordinates(&problem.cloud[j])).collect();
    let mut sample = all;
    spread_sample(problem.cloud, &mut sample, SAMPLE);
    let (mut near, mut far) = (0, 0);
    let mut squares = Vec::with_capacity(places.len());
    for j in sample {
        let here = coordinates(&problem.cloud[j]);
        squares.clear();
        squares.extend(places.iter().map(|at| (at - here).norm_squared()));
        // The nearest of all is the point itself.
        let twelfth = *squares.select_nth_unstable_by(NEIGHBOURS, f64::total_cmp).1;
        let square = twelfth.max(REACH * REACH * problem.cloud[j].position.covariance.trace() / 3.0);
        let within = |square: f64| squares.iter().filter(|&&of| of < square).count().saturating_sub(1);
        far += within(square);
        near += within(0.25 * square);
    }
    (near > 0).then(|| libm::log2(far as f64 / near as f64))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::{Candidates, ModelPoint, Tolerance};

    const SIGMA: f64 = 0.01;

    fn of(places: &[Vector3<f64>], used: &[usize]) -> Option<f64> {
        let covariance = Matrix3::identity() * SIGMA * SIGMA;
        let measured = |at: &Vector3<f64>| MeasuredPoint {
            position: UncertainPoint { at: (*at).into(), covariance },
            pixels: None,
        };
        let cloud: Vec<MeasuredPoint> = places.iter().map(measured).collect();
        let model = [ModelPoint::exact("a", [0.0; 3].into())];
        let candidates = Candidates { lists: vec![(0..cloud.len()).collect()] };
        let tolerance = Tolerance::Fixed(0.04);
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None };
        let used: Vec<Correspondence> = used.iter().map(|&cloud| Correspondence { model: 0, cloud }).collect();
        dimension(&problem, &used)
    }

    /// Points uniform along the first `axes` of a box of four metres, with `noise` along all.
    fn spread(axes: usize, noise: f64, rng: &mut ChaCha8Rng) -> Vec<Vector3<f64>> {
        let mut of = |half: f64| if half > 0.0 { rng.random_range(-half..half) } else { 0.0 };
        (0..600).map(|_| Vector3::from_fn(|axis, _| of(if axis < axes { 2.0 } else { 0.0 }) + of(noise))).collect()
    }

    #[test]
    fn lines_surfaces_and_space_have_one_two_and_three() {
        let rng = &mut ChaCha8Rng::seed_from_u64(5);
        for axes in 1..=3 {
            let found = of(&spread(axes, 0.0, rng), &[]).expect("a dimension");
            // At the boundary the number of neighbours grows less.
            assert!((found - axes as f64).abs() < 0.1 * axes as f64, "{axes}: {found}");
        }
        // Seven millimetres apart along a line, with noise of that size across it.
        let noise = of(&spread(1, SIGMA, rng), &[]).expect("a dimension");
        assert!(noise < 1.2, "{noise}");
    }

    #[test]
    fn it_does_not_depend_on_how_points_are_numbered_nor_on_those_that_are_used() {
        let rng = &mut ChaCha8Rng::seed_from_u64(6);
        let mut places = spread(2, 0.05, rng);
        let before = of(&places, &[]).expect("a dimension");
        places.reverse();
        assert!((of(&places, &[]).expect("a dimension") - before).abs() < 1e-12);
        // Four hundred points of a line, all of them used.
        let line = (0..400).map(|k| Vector3::new(1.0, 0.01 * f64::from(k), 1.0));
        let with: Vec<Vector3<f64>> = places.iter().copied().chain(line).collect();
        let used: Vec<usize> = (600..1000).collect();
        assert!((of(&with, &used).unwrap() - before).abs() < 1e-12);
        assert!(of(&with, &[]).expect("a dimension") < before - 0.3);
    }

    #[test]
    fn few_points_or_no_places_have_none() {
        assert_eq!(of(&[Vector3::zeros(); 12], &[]), None);
        assert_eq!(of(&[Vector3::zeros(); 30], &[]), Some(0.0));
        assert_eq!(of(&[Vector3::repeat(f64::NAN); 30], &[]), None);
    }
}
