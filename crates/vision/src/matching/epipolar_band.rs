//! Mutual nearest neighbours along the epipolar band, supported by neighbouring pairs.

use seafix_component::{Component, Settings, in_range};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{
    along::{Along, Test},
    epipolar::{Band, Limits},
    matcher::{Match, Matcher, View},
    metric::Metric,
};
use crate::workspace::Workspace;

/// Mutual nearest neighbours by descriptor along the epipolar band, with ratio test and neighbour support.
///
/// A pair is admissible if its key points lie within `epipolar_px` of a common point's projections (Sampson distance,
/// see [`StereoRig::epipolar_distance`]) and that point's depth lies between the limits. This holds for any rig,
/// rectified or not. Only admissible pairs compete, for the second place too; otherwise a repeated pattern would have
/// no clear nearest neighbour anywhere.
///
/// The distance is Euclidean between numbers and Hamming between bits. A pair passes if its distance is less than
/// `ratio` times the distance to the second nearest, seen from either side. With `neighbours`, pairs compete by weight
/// instead: the inverse squared distance times the support of the pairs around it (relaxation labelling). A pair is
/// ambiguous if its whole neighbourhood fits as well one period of a repeated pattern further; its neighbours then
/// count as ambiguous too. If many pairs are ambiguous, the pattern is matched as one: each shift by a period is a
/// hypothesis, and the shift whose borders or descriptors fit three standard errors better than those of any other is
/// taken. Without such a shift each neighbourhood decides as before, and ambiguous pairs are rejected.
///
/// Limit: descriptors of different kinds or lengths do not match.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004 (ratio); Barnard and Thompson,
/// *Disparity analysis of images*, PAMI 1980 (support).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct EpipolarBand {
    /// Maximum ratio of the distances to the nearest and the second nearest; 1 disables the test.
    pub ratio: f64,
    /// Maximum distance between descriptors of unit length, whatever the second nearest; its square is 2 − 2 cos of
    /// their angle.
    pub max_distance: f64,
    /// Maximum fraction of differing bits, for binary descriptors.
    pub max_hamming: f64,
    /// Half-width of the epipolar band (px).
    pub epipolar_px: f64,
    /// Minimum depth in the left camera (m).
    pub min_depth: f64,
    /// Maximum depth in the left camera (m).
    pub max_depth: f64,
    /// Number of neighbours of a left key point that support its pairs; 0: descriptors alone decide.
    pub neighbours: usize,
}

impl Default for EpipolarBand {
    fn default() -> Self {
        Self {
            ratio: 0.85,
            max_distance: 0.7,
            max_hamming: 0.25,
            epipolar_px: 1.0,
            min_depth: 0.1,
            max_depth: 50.0,
            neighbours: 30,
        }
    }
}

impl Component for EpipolarBand {
    const NAME: &'static str = "epipolar-band";
    const SUMMARY: &'static str = "mutual nearest neighbours along the epipolar band, supported by neighbouring pairs";
    const SOURCE: &'static str = "Barnard and Thompson, Disparity analysis of images, PAMI 1980";
    const VERSION: u32 = 3;

    fn check(&self) -> Result<(), String> {
        let Self { ratio, max_distance, max_hamming, epipolar_px, min_depth, max_depth, neighbours } = *self;
        in_range(ratio > 0.0 && ratio <= 1.0, "ratio", ratio, "more than 0, at most 1")?;
        in_range(max_distance > 0.0 && max_distance <= 2.0, "max-distance", max_distance, "more than 0, at most 2")?;
        in_range(max_hamming > 0.0 && max_hamming <= 1.0, "max-hamming", max_hamming, "more than 0, at most 1")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        in_range(min_depth >= 0.0 && min_depth.is_finite(), "min-depth", min_depth, "0 or a positive depth (m)")?;
        let beyond = format!("a depth beyond min-depth = {min_depth} (m)");
        in_range(max_depth > min_depth && max_depth.is_finite(), "max-depth", max_depth, &beyond)?;
        in_range(neighbours <= 1000, "neighbours", neighbours, "at most 1000")
    }
}

impl EpipolarBand {
    /// The maximum squared distance of a pair.
    pub(super) fn max(&self, metric: &Metric<'_>) -> f32 {
        match metric {
            Metric::Euclid(_) => (self.max_distance * self.max_distance) as f32,
            Metric::Hamming(_) => 4.0 * self.max_hamming as f32,
        }
    }

    /// Finds the matches, including those of ambiguous patterns if `patterns` is set.
    pub(crate) fn find(
        &self,
        [left, right]: [&View<'_>; 2],
        rig: &StereoRig,
        patterns: bool,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        found.clear();
        let Some(metric) = Metric::of(left.descriptors, right.descriptors) else { return };
        let (band, along) = work.get::<(Band, Along)>();
        let limits = Limits { px: self.epipolar_px, depths: [self.min_depth, self.max_depth] };
        band.fill(left.keypoints, right.keypoints, rig, &limits);
        let test = Test { squared_ratio: metric.squared_ratio(self.ratio), neighbours: self.neighbours, patterns };
        along.search(
            test,
            [left.keypoints, right.keypoints],
            |i, visit| band.visit(i, visit),
            |i, j| metric.squared(i, j),
            |i, j, squared| {
                if squared <= self.max(&metric) {
                    let (right, distance) = (right.keypoints[j].at, metric.distance(squared));
                    found.push(Match { left: i, right, distance });
                }
            },
        );
    }
}

impl Matcher for EpipolarBand {
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        self.find([left, right], rig, false, work, found);
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_scene::{index, matched, numbers, rig, scene, unit};
    use super::*;
    use crate::describe::{Descriptors, Table};
    use crate::matching::mutual_ratio::MutualRatio;
    use nalgebra::Vector3;
    use seafix_geometry::{Pixel, Point};

    /// The definition by brute force; with `banded` only admissible pairs compete.
    fn brute_force(
        m: &EpipolarBand,
        banded: bool,
        left: (&[Pixel], &Descriptors),
        right: (&[Pixel], &Descriptors),
        rig: &StereoRig,
    ) -> Vec<(usize, usize)> {
        let allowed = |i: usize, j: usize| {
            let seen = seafix_geometry::StereoPixels { left: left.0[i], right: right.0[j] };
            !banded
                || rig.epipolar_distance(&seen).is_some_and(|d| d <= m.epipolar_px)
                    && rig
                        .triangulate(&seafix_geometry::UncertainPixels::independent(seen, 0.1))
                        .is_ok_and(|t| (m.min_depth..=m.max_depth).contains(&t.point.coords.z))
        };
        let distance = |i: usize, j: usize| -> f32 {
            left.1
                .numbers()
                .unwrap()
                .row(i)
                .iter()
                .zip(right.1.numbers().unwrap().row(j))
                .map(|(a, b)| (a - b) * (a - b))
                .sum::<f32>()
                .sqrt()
        };
        let mut pairs = Vec::new();
        for i in 0..left.0.len() {
            for j in 0..right.0.len() {
                let d = distance(i, j);
                let clear =
                    |competitors: Vec<f32>| competitors.into_iter().all(|competitor| d <= m.ratio as f32 * competitor);
                if allowed(i, j)
                    && d <= m.max_distance as f32
                    && clear((0..right.0.len()).filter(|&k| k != j && allowed(i, k)).map(|k| distance(i, k)).collect())
                    && clear((0..left.0.len()).filter(|&k| k != i && allowed(k, j)).map(|k| distance(k, j)).collect())
                {
                    pairs.push((i, j));
                }
            }
        }
        pairs
    }

    #[test]
    fn it_is_the_definition() {
        for (step, turn) in [
            (Vector3::new(0.25, 0.0, 0.0), Vector3::zeros()),
            (Vector3::new(0.01, 0.3, 0.02), Vector3::new(0.05, -0.02, 0.1)),
            // One camera ahead of the other, with epipoles inside the images.
            (Vector3::new(0.05, 0.02, 0.4), Vector3::new(0.0, 0.02, 0.3)),
        ] {
            let rig = rig(step, turn);
            let (l, r, a, b) = scene(150, &rig);
            let plain = EpipolarBand { neighbours: 0, ..EpipolarBand::default() };
            let check = |matcher: &dyn Matcher, settings: &EpipolarBand, banded| {
                let found = matched(matcher, (&l, &a), (&r, &b), &rig);
                let pairs: Vec<_> = found.iter().map(|m| (m.left, index(&r, m))).collect();
                assert_eq!(pairs, brute_force(settings, banded, (&l, &a), (&r, &b), &rig), "{matcher:?}");
            };
            check(&MutualRatio::default(), &plain, false);
            for matcher in [
                plain.clone(),
                EpipolarBand { epipolar_px: 60.0, ratio: 0.95, max_distance: 1.2, ..plain.clone() },
                EpipolarBand { min_depth: 2.0, max_depth: 3.0, ..plain.clone() },
            ] {
                check(&matcher, &matcher, true);
            }
        }
    }

    #[test]
    fn every_point_of_a_vertical_rig_finds_its_own() {
        let rig = rig(Vector3::new(0.0, 0.3, 0.0), Vector3::new(0.0, 0.0, 0.2));
        let (l, r, a, b) = scene(100, &rig);
        let found = matched(&EpipolarBand::default(), (&l, &a), (&r, &b), &rig);
        assert!(found.len() >= 98, "{}", found.len());
        assert!(found.iter().all(|m| index(&r, m) == 99 - m.left));
    }

    #[test]
    fn alike_points_are_distinguished_by_the_band_alone() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        // A column of identical points.
        let seen: Vec<_> =
            (0..9).map(|i| rig.project(&Point::new(0.0, f64::from(i) * 0.2 - 0.8, 2.0)).unwrap()).collect();
        let (l, r): (Vec<_>, Vec<_>) = seen.iter().map(|s| (s.left, s.right)).unzip();
        let same = Descriptors::Numbers(Table::new(2, [0.6, 0.8].repeat(9)));
        let found = matched(&EpipolarBand::default(), (&l, &same), (&r, &same), &rig);
        assert!(found.iter().map(|m| (m.left, index(&r, m))).eq((0..9).map(|i| (i, i))));
        assert!(matched(&MutualRatio::default(), (&l, &same), (&r, &same), &rig).is_empty());
    }

    #[test]
    fn a_lattice_is_matched_by_its_neighbours_alone() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        let seen: Vec<_> = (0..48)
            .map(|i| Point::new(f64::from(i % 8) * 0.1 - 0.35, f64::from(i / 8) * 0.1 - 0.25, 2.0))
            .map(|point| rig.project(&point).unwrap())
            .collect();
        let (l, r): (Vec<_>, Vec<_>) = seen.iter().map(|s| (s.left, s.right)).unzip();
        // A common pattern, individual differences of most points, and image noise: neighbours decide for the others.
        let mut next = numbers(11);
        let own = |i: usize| if (i / 16).is_multiple_of(5) { 0.0 } else { 1.5 };
        let descriptor: Vec<f32> = (0..48 * 16).map(|i| (i % 16) as f32 / 16.0 + own(i) * next()).collect();
        let mut noisy = || unit(descriptor.iter().map(|x| x + 0.1 * next()).collect(), 16);
        let (a, b) = (noisy(), noisy());
        let right = |neighbours| {
            let found = matched(&EpipolarBand { neighbours, ..EpipolarBand::default() }, (&l, &a), (&r, &b), &rig);
            (found.iter().filter(|m| m.left == index(&r, m)).count(), found.len())
        };
        let (alone, found) = right(0);
        assert!(alone <= found && found < 48, "by descriptors alone {alone} of {found} are right");
        assert_eq!(right(30), (48, 48));
    }

    #[test]
    fn a_lattice_of_indistinguishable_points_has_no_match() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        let mut next = numbers(3);
        let (mut found, mut wrong) = (0, 0);
        for noise in [0.0, 1e-4, 0.1, 0.3] {
            for columns in [9, 14] {
                let seen: Vec<_> = (0..7 * columns)
                    .map(|i| Point::new(f64::from(i % columns) * 0.1 - 0.5, f64::from(i / columns) * 0.1 - 0.3, 2.0))
                    .map(|point| rig.project(&point).unwrap())
                    .collect();
                let (l, r): (Vec<_>, Vec<_>) = seen.iter().map(|s| (s.left, s.right)).unzip();
                let mut descriptor = || unit((0..l.len() * 16).map(|_| 0.5 + noise * (next() - 0.5)).collect(), 16);
                let (a, b) = (descriptor(), descriptor());
                let pairs = matched(&EpipolarBand::default(), (&l, &a), (&r, &b), &rig);
                found += pairs.len();
                wrong += pairs.iter().filter(|m| index(&r, m) != m.left).count();
            }
        }
        // Without the test for alternatives 478 of the 644 would match, 390 of them wrongly.
        assert_eq!((found, wrong), (0, 0));
    }
}
