//! Windowed bundle adjustment over key frames and landmarks.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use seafix_geometry::{Camera, StereoRig, Transform, World};

use super::{
    follow::WindowKeyFrame,
    landmark::{Landmark, project},
    pose::{MAX, SOFT},
};

/// Maximum number of iterations, rejected steps included.
const STEPS: usize = 10;
/// Convergence threshold: relative decrease of the cost.
const MIN_GAIN: f64 = 1e-4;

/// Robust bundle adjustment of the key frames from `first` on and of their common landmarks.
///
/// It minimises Σ ρ(rᵀ S⁻¹ r) over all observations of landmarks that at least two key frames observe, with the Cauchy
/// loss ρ. The landmarks are eliminated first (Schur complement). Key frames before `first` are fixed and define the
/// gauge. Observations that are outliers at the end are dropped.
pub(super) fn adjust(rig: &StereoRig, frames: &mut [WindowKeyFrame], landmarks: &mut [Landmark], first: usize) {
    let count = frames.len() - first;
    let active: Vec<usize> = (0..landmarks.len())
        .filter(|&index| {
            let views = &landmarks[index].views;
            views.len() > 1 && views.last().is_some_and(|view| view.frame >= first)
        })
        .collect();
    if active.is_empty() || count == 0 {
        return;
    }
    let mut damping = 1e-6;
    let Some(mut here) = Equations::of(rig, frames, landmarks, &active, first) else { return };
    for _ in 0..STEPS {
        let Some((steps, moves)) = here.solve(damping) else {
            damping = f64::max(10.0 * damping, 1e-6);
            continue;
        };
        let poses: Vec<Transform<World, Camera>> =
            frames[first..].iter().map(|frame| frame.world_from_camera).collect();
        let places: Vec<Vector3<f64>> = active.iter().map(|&index| landmarks[index].at).collect();
        for (k, frame) in frames[first..].iter_mut().enumerate() {
            let xi: Vector6<f64> = steps.fixed_rows::<6>(6 * k).into_owned();
            frame.world_from_camera = frame.world_from_camera.perturbed(&xi).renormalized();
        }
        for (&index, step) in active.iter().zip(&moves) {
            landmarks[index].at += step;
        }
        let before = here.cost;
        let next = Equations::of(rig, frames, landmarks, &active, first);
        match next.filter(|next| next.cost <= before) {
            Some(next) => {
                here = next;
                damping = f64::max(0.1 * damping, 1e-9);
                if before - here.cost < MIN_GAIN * before {
                    break;
                }
            }
            None => {
                frames[first..].iter_mut().zip(poses).for_each(|(frame, pose)| frame.world_from_camera = pose);
                active.iter().zip(places).for_each(|(&index, at)| landmarks[index].at = at);
                damping *= 10.0;
                if damping > 1e3 {
                    break;
                }
            }
        }
    }
    prune(rig, frames, landmarks, &active);
    for (&index, block) in active.iter().zip(&here.blocks) {
        if let Some(inverse) = block.own.cholesky() {
            landmarks[index].covariance = inverse.inverse();
        }
    }
}

/// Drops outlier observations.
fn prune(rig: &StereoRig, frames: &[WindowKeyFrame], landmarks: &mut [Landmark], active: &[usize]) {
    for &index in active {
        let (anchor, at) = (landmarks[index].anchor, landmarks[index].at);
        let world_from_anchor = frames[anchor].world_from_camera;
        landmarks[index].views.retain(|view| {
            let here_from_anchor = frames[view.frame].world_from_camera.inverse() * world_from_anchor;
            project(rig, &here_from_anchor, &at).is_some_and(|seen| {
                let r = view.pixels - seen.pixels;
                r.dot(&(view.information * r)) < MAX
            })
        });
    }
}

/// The contribution of one landmark to the normal equations.
struct Block {
    own: Matrix3<f64>,
    pull: Vector3<f64>,
    /// The free key frames that observe it, counted from the first one, each with its cross block.
    with: Vec<(usize, Matrix6x3<f64>)>,
}

/// The normal equations of all poses and landmarks.
struct Equations {
    poses: DMatrix<f64>,
    pull: DVector<f64>,
    blocks: Vec<Block>,
    cost: f64,
}

/// The reduced system of the poses, and the terms that recover the landmarks.
struct Reduced {
    normal: DMatrix<f64>,
    pull: DVector<f64>,
    inverses: Vec<Matrix3<f64>>,
}

impl Equations {
    fn of(
        rig: &StereoRig,
        frames: &[WindowKeyFrame],
        landmarks: &[Landmark],
        active: &[usize],
        first: usize,
    ) -> Option<Self> {
        let size = 6 * (frames.len() - first);
        let mut all = Self {
            poses: DMatrix::zeros(size, size),
            pull: DVector::zeros(size),
            blocks: Vec::with_capacity(active.len()),
            cost: 0.0,
        };
        let inverses: Vec<Transform<Camera, World>> =
            frames.iter().map(|frame| frame.world_from_camera.inverse()).collect();
        for &index in active {
            let landmark = &landmarks[index];
            if !(landmark.at.z > -1.0 && landmark.at.iter().all(|x| x.is_finite())) {
                return None;
            }
            let block = all.landmark(rig, frames, &inverses, landmark, first);
            all.blocks.push(block);
        }
        all.cost.is_finite().then_some(all)
    }

    fn landmark(
        &mut self,
        rig: &StereoRig,
        frames: &[WindowKeyFrame],
        inverses: &[Transform<Camera, World>],
        landmark: &Landmark,
        first: usize,
    ) -> Block {
        let mut block = Block { own: Matrix3::zeros(), pull: Vector3::zeros(), with: Vec::new() };
        let world_from_anchor = frames[landmark.anchor].world_from_camera;
        let anchor = landmark.anchor.checked_sub(first);
        for view in &landmark.views {
            let own = view.frame == landmark.anchor;
            let here_from_anchor = if own { Transform::identity() } else { inverses[view.frame] * world_from_anchor };
            let Some(seen) = project(rig, &here_from_anchor, &landmark.at) else {
                // A landmark behind a camera has a constant large cost.
                self.cost += 1e3;
                continue;
            };
            let r = view.pixels - seen.pixels;
            let chi = r.dot(&(view.information * r));
            self.cost += SOFT * libm::log1p(chi / SOFT);
            let weight = view.information * (1.0 / (1.0 + chi / SOFT));
            let by_landmark = seen.by_landmark(&here_from_anchor);
            let weighted = weight * by_landmark;
            block.own += by_landmark.transpose() * weighted;
            block.pull += weighted.transpose() * r;
            if own {
                continue;
            }
            let here = view.frame.checked_sub(first);
            let by_here = here.map(|k| (k, seen.by_pose()));
            let by_anchor = anchor.map(|k| (k, seen.by_anchor(&here_from_anchor, &landmark.at)));
            for (k, by) in [&by_here, &by_anchor].into_iter().flatten() {
                let weighted_by = weight * by;
                self.add(*k, *k, &(by.transpose() * weighted_by));
                let pull = weighted_by.transpose() * r;
                let mut rows = self.pull.fixed_rows_mut::<6>(6 * k);
                rows += pull;
                let across = by.transpose() * weighted;
                match block.with.iter_mut().find(|(other, _)| other == k) {
                    Some((_, sum)) => *sum += across,
                    None => block.with.push((*k, across)),
                }
            }
            if let (Some((a, by_a)), Some((b, by_b))) = (&by_here, &by_anchor) {
                let across = by_a.transpose() * weight * by_b;
                self.add(*a, *b, &across);
                self.add(*b, *a, &across.transpose());
            }
        }
        block
    }

    fn add(&mut self, row: usize, column: usize, block: &Matrix6<f64>) {
        let mut view = self.poses.fixed_view_mut::<6, 6>(6 * row, 6 * column);
        view += block;
    }

    /// The reduced camera system: landmarks eliminated, every diagonal damped relative to itself.
    fn reduced(&self, damping: f64) -> Option<Reduced> {
        let (mut normal, mut pull) = (self.poses.clone(), self.pull.clone());
        for k in 0..normal.nrows() {
            normal[(k, k)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut own = block.own;
            for k in 0..3 {
                own[(k, k)] *= 1.0 + damping;
            }
            let inverse = own.cholesky()?.inverse();
            for (a, across_a) in &block.with {
                let reduced = across_a * inverse;
                let mut rows = pull.fixed_rows_mut::<6>(6 * a);
                rows -= reduced * block.pull;
                for (b, across_b) in &block.with {
                    let mut view = normal.fixed_view_mut::<6, 6>(6 * a, 6 * b);
                    view -= reduced * across_b.transpose();
                }
            }
            inverses.push(inverse);
        }
        Some(Reduced { normal, pull, inverses })
    }

    /// The steps of the poses and of the landmarks.
    fn solve(&self, damping: f64) -> Option<(DVector<f64>, Vec<Vector3<f64>>)> {
        let Reduced { normal, pull, inverses } = self.reduced(damping)?;
        let steps = normal.cholesky()?.solve(&pull);
        let moves = self.blocks.iter().zip(&inverses).map(|(block, inverse)| {
            let mut rest = block.pull;
            for (k, across) in &block.with {
                rest -= across.tr_mul(&steps.fixed_rows::<6>(6 * k));
            }
            inverse * rest
        });
        let moves = moves.collect();
        Some((steps, moves))
    }
}
