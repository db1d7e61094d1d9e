//! The adjustment of all observations, without those that contradict the others.

use std::collections::{BTreeMap, BTreeSet};

use seafix_geometry::{Camera, Point, StereoRig, Transform, UncertainPixels, World};

use super::{find::GATE, trail::Trail};
use crate::model::adjust::{Adjustment, Excess, Motion, Observation, Undetermined};

/// An observation's pair and feature.
pub(super) type Key = (usize, usize);

/// Poses and features before or after an adjustment.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    /// The pose of each pair, if known.
    pub(super) poses: Vec<Option<Transform<World, Camera>>>,
    /// The position of each feature.
    pub(super) features: Vec<Point<World>>,
}

/// The adjusted observations.
#[derive(Debug, Clone)]
pub(super) struct Settled<'a> {
    /// The adjustment at its solution.
    pub(super) adjustment: Adjustment<'a>,
    /// The pair of each pose.
    pub(super) pairs: Vec<usize>,
    /// The feature of each point.
    pub(super) features: Vec<usize>,
    /// The noise beyond the observations' own covariances.
    pub(super) excess: Excess,
    /// Observations that contradict the others, with their χ².
    pub(super) contradicting: BTreeMap<Key, f64>,
    /// Features with more contradicting than agreeing observations.
    pub(super) given_up: BTreeSet<usize>,
}

/// The number of observations that hold a pair to the others without an odometry: three points determine a pose.
pub(super) const HELD: usize = 3;
/// The maximum number of adjustments; the set of observations is stable after a few.
const ROUNDS: usize = 12;
/// The relative change of an excess below which it is stable.
const STABLE: f64 = 0.01;

/// Adjusts `scene` to the observations `seen`, and returns their consistent part.
///
/// Pairs that share fewer than three features with their neighbour are linked to it by the odometry. Elsewhere features
/// hold the poses, and the odometry, whose landmarks lie on the same surfaces, would count them twice.
///
/// # Errors
/// [`Undetermined`] if the observations determine no solution.
pub(super) fn settle<'a>(
    rig: &'a StereoRig,
    trail: &Trail,
    scene: &mut Scene,
    seen: &BTreeMap<Key, UncertainPixels>,
) -> Result<Settled<'a>, Undetermined> {
    let mut accepted: BTreeSet<Key> = seen.keys().copied().filter(|(pair, _)| scene.poses[*pair].is_some()).collect();
    let (mut excess, mut given_up) = (Excess::INITIAL, BTreeSet::new());
    for round in 0.. {
        let pairs = connected(trail, &accepted);
        let (mut adjustment, features) = built(rig, trail, scene, seen, &accepted, &pairs)?;
        // The switch serves poor initial poses; afterwards contradicting observations are absent.
        adjustment.solve(&excess, round == 0)?;
        pairs.iter().zip(&adjustment.poses).for_each(|(pair, pose)| scene.poses[*pair] = Some(*pose));
        features.iter().zip(&adjustment.points).for_each(|(feature, point)| scene.features[*feature] = *point);

        let all: BTreeSet<Key> = seen
            .keys()
            .copied()
            .filter(|(pair, feature)| pairs.binary_search(pair).is_ok() && features.binary_search(feature).is_ok())
            .collect();
        let everything = with_observations(&adjustment, seen, &all, &pairs, &features);
        let chi2: BTreeMap<Key, f64> = all.iter().copied().zip(everything.disagreements(&excess)?).collect();
        let agrees = |key: &Key| chi2[key] <= GATE;
        for &feature in &features {
            let (agreeing, others): (Vec<&Key>, Vec<&Key>) =
                all.iter().filter(|key| key.1 == feature).partition(|key| agrees(key));
            if others.len() > agreeing.len() {
                given_up.insert(feature);
            }
        }
        let next: BTreeSet<Key> = all.iter().copied().filter(|key| agrees(key) && !given_up.contains(&key.1)).collect();
        let estimated = estimated(&with_observations(&adjustment, seen, &next, &pairs, &features))?;
        let close = |a: f64, b: f64| (a - b).abs() <= STABLE * a.max(b);
        let stable = close(estimated.common, excess.common) && close(estimated.difference, excess.difference);
        if (next == accepted && stable && round > 0) || round == ROUNDS {
            let contradicting = chi2.into_iter().filter(|(key, chi2)| *chi2 > GATE && !next.contains(key)).collect();
            return Ok(Settled { adjustment, pairs, features, excess, contradicting, given_up });
        }
        (accepted, excess) = (next, estimated);
    }
    unreachable!("the last round returns")
}

/// The excess that the residuals of a solution show.
fn estimated(adjustment: &Adjustment<'_>) -> Result<Excess, Undetermined> {
    let measurements = 4 * adjustment.observations.len() + 6 * adjustment.motions.len();
    let dof = adjustment.dof();
    let residuals: Vec<_> = adjustment
        .residuals()
        .into_iter()
        .zip(&adjustment.observations)
        .filter_map(|(residual, observation)| Some((residual?, observation.pixels.covariance)))
        .collect();
    Ok(Excess::of(&residuals, dof as f64 / measurements.max(1) as f64, dof))
}

/// The adjustment of the accepted observations in `pairs`, and the features that they show.
fn built<'a>(
    rig: &'a StereoRig,
    trail: &Trail,
    scene: &Scene,
    seen: &BTreeMap<Key, UncertainPixels>,
    accepted: &BTreeSet<Key>,
    pairs: &[usize],
) -> Result<(Adjustment<'a>, Vec<usize>), Undetermined> {
    let used: BTreeSet<Key> = accepted.iter().copied().filter(|(pair, _)| pairs.binary_search(pair).is_ok()).collect();
    let features: Vec<usize> = used.iter().map(|key| key.1).collect::<BTreeSet<_>>().into_iter().collect();
    let poses = pairs.iter().map(|pair| scene.poses[*pair].ok_or(Undetermined)).collect::<Result<Vec<_>, _>>()?;
    if poses.is_empty() {
        return Err(Undetermined);
    }
    let points = features.iter().map(|feature| scene.features[*feature]).collect();
    let common = |a: usize, b: usize| {
        let both = |feature: &&usize| used.contains(&(a, **feature)) && used.contains(&(b, **feature));
        features.iter().filter(both).count()
    };
    let mut motions = Vec::new();
    for (from, a) in pairs.iter().enumerate() {
        // The next pair of the same segment.
        let next = (from + 1..pairs.len()).find(|to| trail.segment(pairs[*to]) == trail.segment(*a));
        let Some(to) = next.filter(|_| trail.segment(*a).is_some()) else { continue };
        if common(*a, pairs[to]) < HELD
            && let Some(motion) = trail.motion(*a, pairs[to])
        {
            motions.push(Motion { from, to, motion });
        }
    }
    let empty = Adjustment { rig, poses, points, observations: Vec::new(), motions };
    Ok((with_observations(&empty, seen, &used, pairs, &features), features))
}

/// The adjustment with other observations.
fn with_observations<'a>(
    adjustment: &Adjustment<'a>,
    seen: &BTreeMap<Key, UncertainPixels>,
    keys: &BTreeSet<Key>,
    pairs: &[usize],
    features: &[usize],
) -> Adjustment<'a> {
    let place = |all: &[usize], one: usize| all.binary_search(&one).expect("the keys are of these pairs and features");
    let observation =
        |key: &Key| Observation { view: place(pairs, key.0), point: place(features, key.1), pixels: seen[key] };
    Adjustment { observations: keys.iter().map(observation).collect(), ..adjustment.clone() }
}

/// The pairs whose poses the observations connect, ascending.
///
/// A segment of the odometry is connected in itself. A segment or a single pair joins if one of its pairs shows three
/// features of those that joined before.
pub(super) fn connected(trail: &Trail, accepted: &BTreeSet<Key>) -> Vec<usize> {
    let mut shown: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    accepted.iter().for_each(|(pair, feature)| {
        shown.entry(*pair).or_default().insert(*feature);
    });
    // A pair that no odometry holds needs features of its own.
    shown.retain(|pair, features| trail.segment(*pair).is_some() || features.len() >= HELD);
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for &pair in shown.keys() {
        let segment = trail.segment(pair);
        match groups.iter_mut().find(|group| segment.is_some() && trail.segment(group[0]) == segment) {
            Some(group) => group.push(pair),
            None => groups.push(vec![pair]),
        }
    }
    let count = |group: &Vec<usize>| group.iter().map(|pair| shown[pair].len()).sum::<usize>();
    // The largest group; of equal ones the first.
    let Some(first) = (0..groups.len()).rev().max_by_key(|index| count(&groups[*index])) else { return Vec::new() };
    let mut joined = groups.swap_remove(first);
    let mut known: BTreeSet<usize> = joined.iter().flat_map(|pair| shown[pair].iter().copied()).collect();
    loop {
        let holds = |group: &Vec<usize>| group.iter().any(|pair| shown[pair].intersection(&known).count() >= HELD);
        let Some(next) = groups.iter().position(holds) else { break };
        let group = groups.swap_remove(next);
        known.extend(group.iter().flat_map(|pair| shown[pair].iter().copied()));
        joined.extend(group);
    }
    joined.sort_unstable();
    joined
}

#[cfg(test)]
mod tests;
