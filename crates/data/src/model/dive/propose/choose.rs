//! The choice among confirmed candidates.

use super::confirm::Confirmed;

/// Distance (m) between features that belong to different objects.
pub(super) const OBJECTS_APART: f64 = 2.0;
/// The distance (m) within which two candidates are one corner: a window of the locator at a metre.
const ONE_CORNER: f64 = 0.01;

/// At most `count` of the candidates, the best first.
///
/// Two points at the distance d that are known to σ determine a direction to σ/d. So the next one is that of the largest
/// d/σ, with d the distance to the nearest one chosen before it, times the fraction of its pairs that show it. Beyond the
/// size of an object distance adds nothing.
pub(super) fn chosen(candidates: Vec<Confirmed>, count: usize) -> Vec<Confirmed> {
    let mut open: Vec<(f64, Confirmed)> = candidates.into_iter().map(|one| (OBJECTS_APART, one)).collect();
    let mut chosen: Vec<Confirmed> = Vec::new();
    let worth = |(distance, one): &(f64, Confirmed)| distance * one.shown() / one.sigma;
    while chosen.len() < count {
        // Of equal ones the first.
        let best = (0..open.len()).rev().max_by(|a, b| worth(&open[*a]).total_cmp(&worth(&open[*b])));
        let Some(index) = best else { break };
        let (_, next) = open.remove(index);
        open.iter_mut().for_each(|(distance, one)| *distance = distance.min(one.at.distance(&next.at)));
        open.retain(|(distance, _)| *distance >= ONE_CORNER);
        chosen.push(next);
    }
    chosen
}

/// The object of each feature: clusters, numbered by the order of their best one.
pub(super) fn objects(features: &[Confirmed]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..features.len()).collect();
    for a in 0..features.len() {
        for b in 0..a {
            if features[a].at.distance(&features[b].at) < OBJECTS_APART && group[a] != group[b] {
                let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|own| **own == from).for_each(|own| *own = to);
            }
        }
    }
    let mut first: Vec<usize> = group.clone();
    first.sort_unstable();
    first.dedup();
    group.iter().map(|own| first.binary_search(own).expect("it is one of them")).collect()
}

impl Confirmed {
    /// The fraction of its pairs that show it.
    fn shown(&self) -> f64 {
        self.pairs.len() as f64 / self.expected as f64
    }
}

#[cfg(test)]
mod tests {
    use seafix_geometry::{Pixel, Point};

    use super::*;

    fn one(x: f64, sigma: f64, shown: usize) -> Confirmed {
        let pairs = (0..shown).map(|pair| (pair, Pixel { u: 0.0, v: 0.0 })).collect();
        Confirmed { at: Point::new(x, 0.0, 0.0), sigma, pairs, expected: 10, parallax: 1.0 }
    }

    fn places(chosen: &[Confirmed]) -> Vec<f64> {
        chosen.iter().map(|one| one.at.coords.x).collect()
    }

    #[test]
    fn accurate_corners_that_are_apart_and_often_shown_come_first() {
        // Of two equal distances the better known one; of two equal σ the more distant; then the one that more pairs show.
        let all = vec![one(0.0, 1e-4, 10), one(1.0, 2e-4, 10), one(-1.0, 1.5e-4, 10), one(0.1, 1.1e-4, 10)];
        assert_eq!(places(&chosen(all, 3)), [0.0, -1.0, 1.0]);
        assert_eq!(places(&chosen(vec![one(0.0, 1e-4, 10), one(1.0, 2e-4, 4), one(-1.0, 2e-4, 9)], 2)), [0.0, -1.0]);
        // A corner is proposed once, in whatever number of candidates.
        assert_eq!(places(&chosen(vec![one(0.0, 1e-4, 9), one(0.004, 1e-4, 10), one(0.5, 1e-3, 5)], 9)), [0.004, 0.5]);
        assert_eq!(chosen(Vec::new(), 3).len(), 0);
    }

    #[test]
    fn what_lies_far_away_is_no_better_than_what_lies_on_another_object() {
        // The fish at 50 m is poorly known; distance alone does not make up for it.
        let all = vec![one(0.0, 1e-4, 10), one(50.0, 1e-3, 10), one(0.5, 2e-4, 10)];
        assert_eq!(places(&chosen(all.clone(), 2)), [0.0, 0.5]);
        assert_eq!(objects(&all), [0, 1, 0]);
    }
}
