//! Corners that the front end finds by itself, joined over the pairs of a dive.

use nalgebra::{Matrix3, Matrix4};
use seafix_geometry::{Camera, MeasuredPoint, Point, Transform, UncertainPixels, World};
use seafix_vision::{FrontEnd, FrontEndOutput};

use crate::stereo_pairs::StereoPairs;

/// A corner of one pair.
#[derive(Debug, Clone)]
pub(super) struct Corner {
    /// The index of the pair.
    pub(super) pair: usize,
    /// The pixels with the covariance of their own errors.
    pub(super) pixels: UncertainPixels,
    /// Its position.
    pub(super) at: Point<World>,
    /// The covariance of its position, with the pose as exact (m²).
    pub(super) covariance: Matrix3<f64>,
}

/// A place where pairs show corners.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// The best located of the corners.
    pub(super) corner: Corner,
    /// The number of pairs in which the front end finds a corner here.
    pub(super) pairs: usize,
}

/// The variance (px²) of a corner's position above which a corner is a detector's maximum and no fit.
const FITTED: f64 = 0.25;
/// The drift of an odometry (m) over the pairs that show one feature.
const DRIFT: f64 = 5e-3;
/// The 99 % quantile of χ² with three degrees of freedom.
const GATE: f64 = 11.345;
/// The largest distance (m) between a corner's positions in two pairs.
const NEAR: f64 = 0.05;

/// The fitted corners of a pair at a known pose; none if it cannot be read, which the odometry reports.
pub(super) fn corners(
    front_end: &FrontEnd,
    dive: &StereoPairs,
    pair: usize,
    pose: &Transform<World, Camera>,
) -> Vec<Corner> {
    let Ok((left, right)) = dive.pair(pair) else { return Vec::new() };
    let mut output = FrontEndOutput::default();
    front_end.run(&left, &right, &dive.rig, &mut output);
    let turn = pose.rotation_matrix();
    // All pairs have one calibration error.
    let common = Matrix4::identity() * front_end.triangulator.rules().calibration_px.powi(2);
    let corner = |point: &MeasuredPoint| {
        let measured = point.pixels?;
        let pixels = UncertainPixels { covariance: measured.covariance - common, ..measured };
        let covariance = turn * point.position.covariance * turn.transpose();
        (pixels.covariance[(0, 0)] < FITTED).then(|| Corner { pair, pixels, at: *pose * point.position.at, covariance })
    };
    output.cloud.iter().filter_map(corner).collect()
}

/// The candidates among the corners of all pairs, those of the largest number of pairs first.
pub(super) fn candidates(corners: Vec<Vec<Corner>>) -> Vec<Candidate> {
    let mut joined = Vec::new();
    corners.into_iter().for_each(|corners| join(&mut joined, corners));
    // A stable sort: equal ones stay in the order of the dive.
    joined.sort_by_key(|candidate: &Candidate| std::cmp::Reverse(candidate.pairs));
    joined
}

/// Adds the corners of one pair: each to the nearest candidate, or as one of its own.
fn join(candidates: &mut Vec<Candidate>, corners: Vec<Corner>) {
    let mut taken = vec![false; candidates.len()];
    for corner in corners {
        let disagreement = |candidate: &Candidate| -> Option<f64> {
            let step = corner.at - candidate.corner.at;
            if step.norm() > NEAR {
                return None;
            }
            let spread = corner.covariance + candidate.corner.covariance + Matrix3::identity() * (DRIFT * DRIFT);
            let chi2 = step.dot(&spread.cholesky()?.solve(&step));
            (chi2 <= GATE).then_some(chi2)
        };
        let free = (0..taken.len()).filter(|index| !taken[*index]);
        let near = free.filter_map(|index| Some((disagreement(&candidates[index])?, index)));
        match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, index)) => {
                taken[index] = true;
                let candidate = &mut candidates[index];
                candidate.pairs += 1;
                if corner.covariance.trace() < candidate.corner.covariance.trace() {
                    candidate.corner = corner;
                }
            }
            None => candidates.push(Candidate { corner, pairs: 1 }),
        }
    }
}
