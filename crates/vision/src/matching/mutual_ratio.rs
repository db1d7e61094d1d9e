//! Mutual nearest neighbours with the ratio test.

use seafix_component::{Component, in_range};
use seafix_geometry::StereoRig;
use serde::{Deserialize, Serialize};

use super::{
    Match, Matcher, View,
    epipolar::Band,
    nearest::{Nearest, squared},
    support::Candidates,
};
use crate::{Table, Workspace};

/// Pairs of key points that are each other's nearest by descriptor, clearly nearer than the second.
///
/// Distance is Euclidean between descriptors; a pair passes when it is at most `ratio` times the
/// distance to the second nearest, seen from either side. Only pairs that the rig allows compete, for
/// the second place too: a pattern that repeats itself would otherwise have no clear nearest anywhere.
/// A pair is allowed when the key points lie within `epipolar_px` of seeing one point (Sampson
/// distance, as in [`StereoRig::epipolar_distance`]) whose depth lies between the limits; this holds
/// for any rig, rectified or not.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004 (ratio).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MutualRatio {
    /// The greatest distance, as a share of the distance to the second nearest; 1 switches the test off.
    pub ratio: f64,
    /// The greatest distance between descriptors of unit length, whatever the second is: 2 − 2 cos of
    /// their angle is its square.
    pub max_distance: f64,
    /// Half width of the epipolar band (px). 0: every pair is allowed, at any depth.
    pub epipolar_px: f64,
    /// Least depth in the left camera (m).
    pub min_depth: f64,
    /// Greatest depth in the left camera (m).
    pub max_depth: f64,
    /// How many neighbours of a left key point support its pairs; 0: descriptors alone decide. Needs
    /// the epipolar band.
    pub neighbours: usize,
}

impl Default for MutualRatio {
    fn default() -> Self {
        Self { ratio: 0.85, max_distance: 0.7, epipolar_px: 1.0, min_depth: 0.1, max_depth: 50.0, neighbours: 30 }
    }
}

impl Component for MutualRatio {
    const NAME: &'static str = "mutual-ratio";
    const SUMMARY: &'static str = "mutual nearest neighbours along the epipolar band, with the ratio test";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        let Self { ratio, max_distance, epipolar_px, min_depth, max_depth, neighbours } = *self;
        in_range(ratio > 0.0 && ratio <= 1.0, "ratio", ratio, "more than 0, at most 1")?;
        in_range(max_distance > 0.0 && max_distance <= 2.0, "max-distance", max_distance, "more than 0, at most 2")?;
        in_range((0.0..=1000.0).contains(&epipolar_px), "epipolar-px", epipolar_px, "a number from 0 to 1000 (px)")?;
        in_range(min_depth >= 0.0 && min_depth.is_finite(), "min-depth", min_depth, "0 or a positive depth (m)")?;
        let beyond = format!("a depth beyond min-depth = {min_depth} (m)");
        in_range(max_depth > min_depth && max_depth.is_finite(), "max-depth", max_depth, &beyond)?;
        in_range(neighbours <= 1000, "neighbours", neighbours, "at most 1000")
    }
}

impl Matcher for MutualRatio {
    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        _: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        found.clear();
        let (Some(a), Some(b)) = (left.descriptors.numbers(), right.descriptors.numbers()) else { return };
        let nearest =
            if self.epipolar_px > 0.0 { self.along_the_band(left, right, [a, b], rig) } else { Nearest::of_all(a, b) };
        let ratio = (self.ratio * self.ratio) as f32;
        let greatest = self.max_distance as f32;
        let pairs = nearest.mutual().filter(|pair| pair.squared <= ratio * pair.second).map(|pair| {
            let distance = squared(a.row(pair.left), b.row(pair.right)).sqrt();
            Match { left: pair.left, right: right.keypoints[pair.right].at, distance }
        });
        found.extend(pairs.filter(|pair| pair.distance <= greatest));
    }
}

impl MutualRatio {
    /// The nearest among the pairs that the rig allows, where distance is that of the descriptors or,
    /// with neighbours, the inverse of its supported weight.
    fn along_the_band(&self, left: &View<'_>, right: &View<'_>, [a, b]: [&Table<f32>; 2], rig: &StereoRig) -> Nearest {
        let band = Band::new(left.keypoints, right.keypoints, rig, self.epipolar_px, self.min_depth, self.max_depth);
        let (n, m) = (left.keypoints.len(), right.keypoints.len());
        let pairs = (0..n).flat_map(|i| (0..m).map(move |j| (i, j))).filter(|&(i, j)| band.allows(i, j));
        let pairs = pairs.map(|(i, j)| (i, j, squared(a.row(i), b.row(j))));
        let mut nearest = Nearest::none(n, m);
        if self.neighbours == 0 {
            pairs.for_each(|(i, j, squared)| nearest.offer(i, j, squared));
            return nearest;
        }
        let mut candidates = Candidates::new(n, pairs);
        candidates.support(left.keypoints, right.keypoints, self.neighbours);
        for i in 0..n {
            candidates.of(i).iter().for_each(|c| nearest.offer(i, c.right, 1.0 / c.weight));
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Descriptors, Image, Keypoint, Table};
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::{Pinhole, Pixel, Point, Transform};

    /// The right camera `step` (m) from the left one and turned by `turn` (rad).
    fn rig(step: Vector3<f64>, turn: Vector3<f64>) -> StereoRig {
        let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[-0.05, 0.01, 0.001, 0.0]).unwrap();
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        StereoRig::new(camera, camera, Transform::new(rotation, rotation * -step)).unwrap()
    }

    fn numbers(seed: u32) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        }
    }

    fn keypoints(pixels: &[Pixel]) -> Vec<Keypoint> {
        pixels.iter().map(|&at| Keypoint { at, response: 1.0, scale: 1.0 }).collect()
    }

    fn unit(values: Vec<f32>, length: usize) -> Descriptors {
        let unit = values.chunks_exact(length).flat_map(|v| {
            let norm = v.iter().map(|x| x * x).sum::<f32>().sqrt();
            v.iter().map(move |x| x / norm)
        });
        Descriptors::Numbers(Table::new(length, unit.collect()))
    }

    fn matched(
        matcher: &MutualRatio,
        left: (&[Pixel], &Descriptors),
        right: (&[Pixel], &Descriptors),
        rig: &StereoRig,
    ) -> Vec<Match> {
        let image = Image::new(1, 1, vec![0.0]).unwrap();
        let (l, r) = (keypoints(left.0), keypoints(right.0));
        matcher.matches(
            &View { image: &image, keypoints: &l, descriptors: left.1 },
            &View { image: &image, keypoints: &r, descriptors: right.1 },
            rig,
        )
    }

    /// Which right pixel a match means.
    fn index(right: &[Pixel], found: &Match) -> usize {
        right.iter().position(|at| *at == found.right).unwrap()
    }

    /// Points at random depths, their pixels in both images and random descriptors, noisy on the right,
    /// where they come in reverse order.
    fn scene(n: usize, rig: &StereoRig) -> (Vec<Pixel>, Vec<Pixel>, Descriptors, Descriptors) {
        let mut next = numbers(7);
        let (mut left, mut right, mut a, mut b) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        while left.len() < n {
            let z = 1.0 + 4.0 * f64::from(next());
            let point = Point::new(z * (f64::from(next()) - 0.5), z * (f64::from(next()) - 0.5), z);
            let Some(seen) = rig.sees(&point, 5.0) else { continue };
            left.push(seen.left);
            right.insert(0, seen.right);
            let d: Vec<f32> = (0..16).map(|_| next() - 0.5).collect();
            b.splice(0..0, d.iter().map(|x| x + 0.2 * (next() - 0.5)).collect::<Vec<_>>());
            a.extend(d);
        }
        (left, right, unit(a, 16), unit(b, 16))
    }

    /// The definition, word by word.
    fn brute_force(
        m: &MutualRatio,
        left: (&[Pixel], &Descriptors),
        right: (&[Pixel], &Descriptors),
        rig: &StereoRig,
    ) -> Vec<(usize, usize)> {
        let allowed = |i: usize, j: usize| {
            let seen = seafix_geometry::StereoPixels { left: left.0[i], right: right.0[j] };
            m.epipolar_px == 0.0
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
                let clear = |rivals: Vec<f32>| rivals.into_iter().all(|rival| d <= m.ratio as f32 * rival);
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
        ] {
            let rig = rig(step, turn);
            let (l, r, a, b) = scene(150, &rig);
            for matcher in [
                MutualRatio::default(),
                MutualRatio { epipolar_px: 0.0, ..MutualRatio::default() },
                MutualRatio { epipolar_px: 60.0, ratio: 0.95, max_distance: 1.2, ..MutualRatio::default() },
                MutualRatio { min_depth: 2.0, max_depth: 3.0, ..MutualRatio::default() },
            ] {
                let found = matched(&matcher, (&l, &a), (&r, &b), &rig);
                let pairs: Vec<_> = found.iter().map(|m| (m.left, index(&r, m))).collect();
                assert_eq!(pairs, brute_force(&matcher, (&l, &a), (&r, &b), &rig), "{matcher:?}");
                // Left to right and back: the same pairs when the images change places (P54).
                if matcher.epipolar_px == 0.0 {
                    let mut back: Vec<_> =
                        matched(&matcher, (&r, &b), (&l, &a), &rig).iter().map(|m| (index(&l, m), m.left)).collect();
                    back.sort_unstable();
                    assert_eq!(pairs, back);
                }
            }
        }
    }

    #[test]
    fn every_point_of_a_vertical_rig_finds_its_own() {
        let rig = rig(Vector3::new(0.0, 0.3, 0.0), Vector3::new(0.0, 0.0, 0.2));
        let (l, r, a, b) = scene(100, &rig);
        let found = matched(&MutualRatio::default(), (&l, &a), (&r, &b), &rig);
        assert!(found.len() >= 98, "{}", found.len());
        assert!(found.iter().all(|m| index(&r, m) == 99 - m.left));
    }

    #[test]
    fn alike_points_are_told_apart_by_the_band_alone() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        // A column of points that all look the same.
        let seen: Vec<_> =
            (0..9).map(|i| rig.project(&Point::new(0.0, f64::from(i) * 0.2 - 0.8, 2.0)).unwrap()).collect();
        let (l, r): (Vec<_>, Vec<_>) = seen.iter().map(|s| (s.left, s.right)).unzip();
        let same = Descriptors::Numbers(Table::new(2, [0.6, 0.8].repeat(9)));
        let found = matched(&MutualRatio::default(), (&l, &same), (&r, &same), &rig);
        assert!(found.iter().map(|m| (m.left, index(&r, m))).eq((0..9).map(|i| (i, i))));
        let without = MutualRatio { epipolar_px: 0.0, ..MutualRatio::default() };
        assert!(matched(&without, (&l, &same), (&r, &same), &rig).len() <= 1);
    }

    #[test]
    fn a_lattice_is_matched_by_its_neighbours_alone() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        let seen: Vec<_> = (0..48)
            .map(|i| Point::new(f64::from(i % 8) * 0.1 - 0.35, f64::from(i / 8) * 0.1 - 0.25, 2.0))
            .map(|point| rig.project(&point).unwrap())
            .collect();
        let (l, r): (Vec<_>, Vec<_>) = seen.iter().map(|s| (s.left, s.right)).unzip();
        // One look for all, a little of each point's own, and more noise in each image.
        let mut next = numbers(11);
        let look: Vec<f32> = (0..48 * 16).map(|i| (i % 16) as f32 / 16.0 + 0.2 * next()).collect();
        let mut noisy = || unit(look.iter().map(|x| x + 0.3 * next()).collect(), 16);
        let (a, b) = (noisy(), noisy());
        let right = |neighbours| {
            let found = matched(&MutualRatio { neighbours, ..MutualRatio::default() }, (&l, &a), (&r, &b), &rig);
            (found.iter().filter(|m| m.left == index(&r, m)).count(), found.len())
        };
        let (alone, found) = right(0);
        assert!(alone <= 5 && found < 48, "descriptors alone: {alone} of {found} are right");
        assert_eq!(right(30), (48, 48));
    }

    #[test]
    fn nothing_matches_nothing() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros());
        let (l, _, a, _) = scene(3, &rig);
        let none = Descriptors::Numbers(Table::new(16, Vec::new()));
        for matcher in [MutualRatio::default(), MutualRatio { epipolar_px: 0.0, ..MutualRatio::default() }] {
            assert!(matched(&matcher, (&l, &a), (&[], &none), &rig).is_empty());
            assert!(matched(&matcher, (&[], &none), (&l, &a), &rig).is_empty());
        }
    }
}
