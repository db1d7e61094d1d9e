//! The error of the disparity that motion reveals.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6x3, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, StereoRig, Transform};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{
    follow::WindowKeyFrame,
    landmark::{Landmark, project},
    pose::SOFT,
};
use crate::odometry::RangeOffset;

/// Number of key frames of a window. More would see an offset from more distances, but leave fewer independent windows.
pub(super) const SPAN: usize = 4;
/// Minimum number of windows of a test; their scatter has three degrees of freedom.
const MIN_WINDOWS: usize = 4;
/// Confidence of a test. Tests take place at 4, 8, 16, … windows, so that a long dive has few.
const CONFIDENCE: f64 = 0.999;

/// The estimate of a constant error of the disparity (px) over windows of key frames.
///
/// An error δ of the disparity changes the depth z of a point by z² δ/(f b). A rigid scene that is seen from several
/// distances contradicts it, since one motion cannot explain all the points: no other information is needed. A scale
/// error (baseline, focal length) scales the whole trajectory and is not observable from motion alone.
#[derive(Debug, Clone, Default)]
pub(super) struct OffsetEstimate {
    /// Of each window: the pull g and the information I on δ, beside its poses and landmarks.
    windows: Vec<[f64; 2]>,
    /// The sum of corrections so far (px).
    pub(super) corrected: f64,
    /// The standard deviation at the last correction (px), and the number of its windows.
    at_correction: Option<(f64, usize)>,
}

impl OffsetEstimate {
    /// Adds the window of the key frames from `base` on, which it takes as fixed.
    pub(super) fn add(&mut self, rig: &StereoRig, frames: &[WindowKeyFrame], landmarks: &[Landmark], base: usize) {
        self.windows.extend(window(rig, frames, landmarks, base));
    }

    /// δ̂ = Σ g / Σ I and its standard deviation: the larger of 1/√ΣI and the one that the scatter of the windows
    /// gives, σ² = m/(m − 1) · Σ (g − I δ̂)² / (Σ I)².
    fn remaining(&self) -> Option<(f64, f64)> {
        let count = self.windows.len();
        if count < MIN_WINDOWS {
            return None;
        }
        let [pull, information] = self.windows.iter().fold([0.0, 0.0], |[g, i], one| [g + one[0], i + one[1]]);
        let value = pull / information;
        let scatter: f64 = self.windows.iter().map(|one| (one[0] - one[1] * value).powi(2)).sum();
        let scatter = scatter * count as f64 / (count - 1) as f64 / (information * information);
        Some((value, scatter.max(1.0 / information).sqrt()))
    }

    /// The remaining offset if it is significant and larger than `min` (px).
    fn significant(&self, min: f64) -> Option<(f64, f64)> {
        let (value, sigma) = self.remaining()?;
        let student = StudentsT::new(0.0, 1.0, (self.windows.len() - 1) as f64).expect("positive degrees of freedom");
        let limit = student.inverse_cdf(0.5 + 0.5 * CONFIDENCE);
        (value.abs() > min && value.abs() > limit * sigma).then_some((value, sigma))
    }

    /// Whether it is time for a test.
    fn due(&self) -> bool {
        self.windows.len() >= MIN_WINDOWS && self.windows.len().is_power_of_two()
    }

    /// The remaining offset (px), if a test is due and finds it significant; the estimate then begins anew.
    pub(super) fn correction(&mut self, min: f64) -> Option<f64> {
        let (value, sigma) = self.due().then(|| self.significant(min)).flatten()?;
        self.corrected += value;
        self.at_correction = Some((sigma, self.windows.len()));
        self.windows.clear();
        Some(value)
    }

    /// The offset of the given rig, corrected or not; `None` if it is not significant.
    pub(super) fn offset(&self, min: f64) -> Option<RangeOffset> {
        let remaining = self.remaining().filter(|_| self.at_correction.is_some()).or_else(|| self.significant(min));
        let (value, sigma, windows) = match (remaining, self.at_correction) {
            (Some((value, sigma)), _) => (value, sigma, self.windows.len()),
            (None, Some((sigma, windows))) => (0.0, sigma, windows),
            (None, None) => return None,
        };
        Some(RangeOffset { pixels: self.corrected + value, sigma, windows, corrected: self.corrected != 0.0 })
    }
}

/// The terms of one landmark in the normal equations.
struct Block {
    own: Matrix3<f64>,
    pull: Vector3<f64>,
    /// Its cross block with δ.
    by_offset: Vector3<f64>,
    with: Vec<(usize, Matrix6x3<f64>)>,
}

/// Pull and information on δ after the elimination of landmarks and poses (Schur complement), from the key frame
/// `base` on.
///
/// Only landmarks count that begin in the window. `None` if they determine no δ.
fn window(rig: &StereoRig, frames: &[WindowKeyFrame], landmarks: &[Landmark], base: usize) -> Option<[f64; 2]> {
    let count = frames.len().checked_sub(base + 1).filter(|count| *count > 0)?;
    let direction = rig.disparity_direction();
    let by_offset = Vector4::new(0.0, 0.0, direction.x, direction.y);
    let mut normal = DMatrix::<f64>::zeros(6 * count, 6 * count);
    let (mut across, mut pull) = (DVector::<f64>::zeros(6 * count), DVector::<f64>::zeros(6 * count));
    let (mut own, mut own_pull) = (0.0, 0.0);
    for landmark in landmarks.iter().filter(|one| one.anchor >= base && one.views.len() > 1) {
        let world_from_anchor = frames[landmark.anchor].world_from_camera;
        let anchor = landmark.anchor.checked_sub(base + 1);
        let mut block =
            Block { own: Matrix3::zeros(), pull: Vector3::zeros(), by_offset: Vector3::zeros(), with: Vec::new() };
        for view in &landmark.views {
            let same = view.frame == landmark.anchor;
            let here_from_anchor: Transform<Camera, Camera> = match same {
                true => Transform::identity(),
                false => frames[view.frame].world_from_camera.inverse() * world_from_anchor,
            };
            let Some(seen) = project(rig, &here_from_anchor, &landmark.at) else { continue };
            let r = view.pixels - seen.pixels;
            let chi = r.dot(&(view.information * r));
            let weight = view.information * (1.0 / (1.0 + chi / SOFT));
            let (weighted, residual) = (weight * by_offset, weight * r);
            own += by_offset.dot(&weighted);
            own_pull += by_offset.dot(&residual);
            let by_landmark = seen.by_landmark(&here_from_anchor);
            block.own += by_landmark.transpose() * weight * by_landmark;
            block.pull += by_landmark.transpose() * residual;
            block.by_offset += by_landmark.transpose() * weighted;
            if same {
                continue;
            }
            let here = view.frame.checked_sub(base + 1).map(|k| (k, seen.by_pose()));
            let from = anchor.map(|k| (k, seen.by_anchor(&here_from_anchor, &landmark.at)));
            let both: Vec<_> = here.into_iter().chain(from).collect();
            for (a, by_a) in &both {
                let rows = 6 * a;
                let mut view = across.fixed_rows_mut::<6>(rows);
                view += by_a.transpose() * weighted;
                let mut view = pull.fixed_rows_mut::<6>(rows);
                view += by_a.transpose() * residual;
                for (b, by_b) in &both {
                    let mut view = normal.fixed_view_mut::<6, 6>(rows, 6 * b);
                    view += by_a.transpose() * weight * by_b;
                }
                let cross = by_a.transpose() * weight * by_landmark;
                match block.with.iter_mut().find(|(other, _)| other == a) {
                    Some((_, sum)) => *sum += cross,
                    None => block.with.push((*a, cross)),
                }
            }
        }
        let inverse = block.own.cholesky()?.inverse();
        own -= block.by_offset.dot(&(inverse * block.by_offset));
        own_pull -= block.by_offset.dot(&(inverse * block.pull));
        for (a, cross) in &block.with {
            let reduced = cross * inverse;
            let (by, with): (Vector6<f64>, Vector6<f64>) = (reduced * block.by_offset, reduced * block.pull);
            let mut view = across.fixed_rows_mut::<6>(6 * a);
            view -= by;
            let mut view = pull.fixed_rows_mut::<6>(6 * a);
            view -= with;
            for (b, other) in &block.with {
                let mut view = normal.fixed_view_mut::<6, 6>(6 * a, 6 * b);
                view -= reduced * other.transpose();
            }
        }
    }
    let root = normal.cholesky()?;
    let by_poses = root.solve(&across);
    let information = own - across.dot(&by_poses);
    let g = own_pull - by_poses.dot(&pull);
    (information > 0.0 && g.is_finite() && information.is_finite()).then_some([g, information])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::landmark::{LandmarkObservation, coordinates};
    use nalgebra::Matrix4;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Pinhole, Point, UncertainPixels, World};

    const NOISE: f64 = 0.1;

    fn rig() -> StereoRig {
        let camera = Pinhole::new([800, 600], [500.0, 500.0], [400.0, 300.0], &[]).unwrap();
        StereoRig::new(camera, camera, Transform::new(Default::default(), Vector3::new(-0.25, 0.0, 0.0))).unwrap()
    }

    /// The estimate of a rig whose disparities are `offset` px too large, over `windows` windows of six key frames that
    /// advance 0.3 m towards ground at 1.5 to 8 m; poses and landmarks are those of the wrong rig.
    fn estimate(offset: f64, windows: u64) -> OffsetEstimate {
        let (truth, given) = (rig(), rig().with_range_offset(-offset));
        let mut all = OffsetEstimate::default();
        for seed in 0..windows {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut uniform = |a: f64, b: f64| rng.random_range(a..b);
            let pose = |k: usize| {
                Transform::<World, Camera>::exp(&[0.0, 0.01 * k as f64, 0.0, 0.0, 0.0, 0.3 * k as f64].into())
            };
            let mut frames: Vec<WindowKeyFrame> =
                (0..6).map(|k| WindowKeyFrame { world_from_camera: pose(k), image: None }).collect();
            let mut landmarks: Vec<Landmark> = Vec::new();
            for _ in 0..120 {
                let z = uniform(3.5, 10.0);
                let at = Point::<World>::new(uniform(-0.5, 0.5) * z, uniform(-0.4, 0.4) * z, z);
                let mut seen = |k: usize| {
                    let pixels = truth.project(&(pose(k).inverse() * at))?;
                    Some(coordinates(&pixels) + Vector4::from_fn(|_, _| NOISE * 1.73 * uniform(-1.0, 1.0)))
                };
                let Some(first) = seen(0) else { continue };
                let pixel = |u, v| seafix_geometry::Pixel { u, v };
                let stereo =
                    seafix_geometry::StereoPixels { left: pixel(first[0], first[1]), right: pixel(first[2], first[3]) };
                let Some(mut landmark) = Landmark::begin(0, &UncertainPixels::independent(stereo, NOISE), 0.0, &given)
                else {
                    continue;
                };
                let information = Matrix4::identity() / (NOISE * NOISE);
                landmark.views[0].information = information;
                landmark.views.extend(
                    (1..6).filter_map(|k| seen(k).map(|pixels| LandmarkObservation { frame: k, pixels, information })),
                );
                landmarks.push(landmark);
            }
            crate::stereo::window::adjust(&given, &mut frames, &mut landmarks, 1);
            all.add(&given, &frames, &landmarks, 0);
        }
        all
    }

    /// A right rig has no significant offset. A wrong one has: its poses and landmarks share the error, and the robust
    /// loss hides a part of it, so that the first estimate is up to a quarter too small; the estimate with the corrected
    /// rig leaves less than a twentieth of a pixel.
    #[test]
    fn an_offset_of_the_disparity_is_estimated_from_motion() {
        for offset in [0.0, 0.5, -1.2] {
            let first = estimate(offset, 4);
            let (value, sigma) = first.remaining().unwrap();
            assert!(sigma < 0.1 && value.abs() < offset.abs() + 4.0 * sigma, "{offset}: {value} {sigma}");
            assert!((value - offset).abs() < 4.0 * sigma + 0.25 * offset.abs(), "{offset}: {value} {sigma}");
            assert_eq!(first.significant(0.15).is_some(), offset != 0.0, "{offset}: {value} {sigma}");
            if offset != 0.0 {
                let (rest, sigma) = estimate(offset - value, 4).remaining().unwrap();
                assert!((offset - value - rest).abs() < 0.05, "{offset}: {value} + {rest} ± {sigma}");
            }
        }
    }

    #[test]
    fn tests_are_due_at_doubled_numbers_of_windows() {
        let mut all = OffsetEstimate::default();
        let due: Vec<usize> = (1..=20).filter(|_| (all.windows.push([0.0, 1.0]), all.due()).1).collect();
        assert_eq!(due, [4, 8, 16]);
        all.windows = vec![[5000.0, 1e4], [5100.0, 1e4], [4900.0, 1e4], [5050.0, 1e4]];
        assert!(all.correction(0.15).is_some_and(|value| (value - 0.50125).abs() < 1e-9));
        assert!(all.windows.is_empty() && all.offset(0.15).is_some_and(|found| found.corrected));
    }
}
