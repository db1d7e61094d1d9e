//! RANSAC: the motion with the most inliers.

use rand::{Rng, RngExt};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, StereoPixels, StereoRig, Transform, UncertainPoint};
use seafix_referencing::{Observation, Observations, Solver};

/// The observation of an earlier point, in the role of the model point, in a later pair.
pub(crate) fn seen_again(earlier: &UncertainPoint<Camera>, later: &MeasuredPoint) -> Observation {
    Observation {
        measured: later.position,
        pixels: later.pixels,
        model: Point::<Object>::from(earlier.at.coords),
        // The error across the line of sight; the larger one along it is common to all candidate motions.
        model_sigma: earlier.covariance.symmetric_eigenvalues().min().max(0.0).sqrt(),
    }
}

/// The settings of RANSAC.
pub(crate) struct Rules {
    /// Inlier threshold: RMS distance over both images (px).
    pub(crate) px: f64,
    /// Probability that at least one sample is free of outliers.
    pub(crate) confidence: f64,
    /// Maximum number of samples.
    pub(crate) draws: usize,
}

impl Rules {
    /// The distance (px) beyond which a point has moved, as opposed to a bad measurement.
    pub(crate) fn elsewhere(&self) -> f64 {
        3.0 * self.px
    }
}

/// A motion `earlier_from_later` and its inliers.
pub(crate) struct Consensus {
    pub(crate) motion: Transform<Object, Camera>,
    pub(crate) inliers: Vec<usize>,
    score: f64,
}

/// MSAC: maximises Σ (1 − r²/t²)₊ over the motions of random minimal samples and the `guesses`.
///
/// The residual r is the distance of a point from its predicted position in both new images, t the threshold. Each new
/// best motion is re-estimated from all of its inliers.
pub(crate) fn consensus(
    data: &Observations<'_>,
    rig: &StereoRig,
    rules: &Rules,
    (minimal, solver): (&dyn Solver, &dyn Solver),
    guesses: &[Transform<Object, Camera>],
    rng: &mut dyn Rng,
) -> Option<Consensus> {
    let count = data.points.len();
    let size = minimal.minimum();
    if count < size {
        return None;
    }
    let mut best: Option<Consensus> = None;
    let offer = |motion: Transform<Object, Camera>, best: &mut Option<Consensus>| {
        let mut tried = judge(data, rig, rules, motion);
        if best.as_ref().is_some_and(|best| tried.score <= best.score) {
            return;
        }
        // The motion of a minimal sample is re-estimated twice from all of its inliers.
        for _ in 0..2 {
            if tried.inliers.len() < 2 * size {
                break;
            }
            let some = subset(data, &tried.inliers);
            match solver.solve(&some).map(|motion| judge(data, rig, rules, motion)) {
                Ok(better) if better.score > tried.score => tried = better,
                _ => break,
            }
        }
        *best = Some(tried);
    };
    guesses.iter().for_each(|guess| offer(*guess, &mut best));
    let mut sampled = 0;
    while sampled < rules.draws {
        let fraction = best.as_ref().map_or(0.0, |best| best.inliers.len() as f64 / count as f64);
        let missed = 1.0 - fraction.powi(size as i32);
        let needed = libm::log(1.0 - rules.confidence) / libm::log(missed.clamp(1e-12, 1.0 - 1e-12));
        if sampled as f64 >= needed {
            break;
        }
        sampled += 1;
        let mut three = Vec::with_capacity(size);
        while three.len() < size {
            let index = rng.random_range(0..count);
            if !three.contains(&index) {
                three.push(index);
            }
        }
        if let Ok(motion) = minimal.solve(&subset(data, &three)) {
            offer(motion, &mut best);
        }
    }
    best
}

/// Whether the best motion is indistinguishable from rest: the identity explains nearly all of its inliers.
pub(crate) fn is_still(best: &Consensus, data: &Observations<'_>, rig: &StereoRig, rules: &Rules) -> bool {
    /// Minimum fraction of the inliers that the identity must explain.
    const STILL: f64 = 0.9;
    let still = judge(data, rig, rules, Transform::identity()).inliers.len();
    still as f64 >= STILL * best.inliers.len() as f64
}

/// The number of inliers of the best motion among points that contradict the first one.
pub(crate) fn competitor(
    best: &Consensus,
    data: &Observations<'_>,
    rig: &StereoRig,
    rules: &Rules,
    solvers: (&dyn Solver, &dyn Solver),
    rng: &mut dyn Rng,
) -> usize {
    let far = rules.elsewhere();
    let by_best = best.motion.inverse();
    let others: Vec<usize> = (0..data.points.len())
        .filter(|&index| squared_distance(&data.points[index], rig, &by_best).is_none_or(|squared| squared > far * far))
        .collect();
    consensus(&subset(data, &others), rig, rules, solvers, &[], rng).map_or(0, |other| other.inliers.len())
}

/// A selection of the points.
pub(crate) fn subset<'a>(data: &Observations<'a>, indices: &[usize]) -> Observations<'a> {
    Observations { points: indices.iter().map(|&index| data.points[index]).collect(), edges: Vec::new(), rig: data.rig }
}

fn judge(data: &Observations<'_>, rig: &StereoRig, rules: &Rules, motion: Transform<Object, Camera>) -> Consensus {
    let later_from_earlier = motion.inverse();
    let (mut inliers, mut score) = (Vec::new(), 0.0);
    for (index, point) in data.points.iter().enumerate() {
        let Some(squared) = squared_distance(point, rig, &later_from_earlier) else { continue };
        let fraction = squared / (rules.px * rules.px);
        if fraction < 1.0 {
            score += 1.0 - fraction;
            inliers.push(index);
        }
    }
    Consensus { motion, inliers, score }
}

/// The squared distance from the predicted position, averaged over both images (px²).
fn squared_distance(point: &Observation, rig: &StereoRig, motion: &Transform<Camera, Object>) -> Option<f64> {
    let StereoPixels { left, right } = rig.project(&(*motion * point.model))?;
    let seen = point.pixels?.at;
    let square = |x: f64| x * x;
    let l = square(left.u - seen.left.u) + square(left.v - seen.left.v);
    let r = square(right.u - seen.right.u) + square(right.v - seen.right.v);
    Some(0.5 * (l + r))
}
