//! The model from every second pair, against that from the others.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, Matrix3, Vector3};
use seafix_evaluation::{ModelDifference, compare_models};
use seafix_geometry::{StereoRig, UncertainPixels};

use super::{
    settle::{Key, Scene, settle},
    trail::Trail,
};
use crate::model::adjust::CalibrationSigma;

/// The points of one half with their covariance.
struct Half {
    points: BTreeMap<usize, Vector3<f64>>,
    features: Vec<usize>,
    covariance: DMatrix<f64>,
}

/// The difference of the models from the odd and the even ones of `pairs`; `None` with fewer than three common points.
///
/// Both halves have the same calibration, so their difference shows the noise alone.
pub(super) fn halves(
    rig: &StereoRig,
    trail: &Trail,
    scene: &Scene,
    seen: &BTreeMap<Key, UncertainPixels>,
    pairs: &[usize],
) -> Option<ModelDifference> {
    let half = |parity: usize| -> Option<Half> {
        let own: BTreeSet<usize> = pairs.iter().skip(parity).step_by(2).copied().collect();
        let seen = seen.iter().filter(|(key, _)| own.contains(&key.0)).map(|(key, pixels)| (*key, *pixels)).collect();
        let mut scene = scene.clone();
        let settled = settle(rig, trail, &mut scene, &seen).ok()?;
        let exact = CalibrationSigma { pixels: 0.0, baseline: 0.0 };
        let covariance = settled.adjustment.spread(&settled.excess, &exact).ok()?.noise;
        let points = settled.features.iter().copied().zip(settled.adjustment.points.iter().map(|point| point.coords));
        Some(Half { points: points.collect(), features: settled.features, covariance })
    };
    let [first, second] = [half(0)?, half(1)?];
    let common: Vec<usize> = first.features.iter().copied().filter(|f| second.points.contains_key(f)).collect();
    let [a, b] = [&first, &second].map(|half| common.iter().map(|f| half.points[f]).collect::<Vec<_>>());
    let count = common.len();
    let aligned = compare_models(&a, &b, &DMatrix::identity(3 * count, 3 * count)).ok()?.alignment;
    let [own, other] = [&first, &second].map(|half| part(half, &common));
    let turn = block_diagonal(&aligned.rotation, count);
    compare_models(&a, &b, &(own + &turn * other * turn.transpose())).ok()
}

/// The covariance of some features.
fn part(half: &Half, common: &[usize]) -> DMatrix<f64> {
    let index: Vec<usize> =
        common.iter().map(|f| half.features.binary_search(f).expect("both halves have the feature")).collect();
    DMatrix::from_fn(3 * common.len(), 3 * common.len(), |i, j| {
        half.covariance[(3 * index[i / 3] + i % 3, 3 * index[j / 3] + j % 3)]
    })
}

fn block_diagonal(turn: &Matrix3<f64>, count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(3 * count, 3 * count, |i, j| if i / 3 == j / 3 { turn[(i % 3, j % 3)] } else { 0.0 })
}
