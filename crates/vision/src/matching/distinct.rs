//! One pair for each place.

use super::Match;

/// Pairs that end nearer to each other (px) are one place.
const SAME: f64 = 1.0;

/// The memory of the choice.
#[derive(Debug, Default)]
pub(super) struct Distinct {
    order: Vec<Match>,
}

impl Distinct {
    /// Replaces `found` by the pairs there are, in the order of the left key points. Of pairs that end at one place
    /// in the right image the best stays; of equally good ones the first.
    pub(super) fn keep_into(&mut self, pairs: &[Option<Match>], found: &mut Vec<Match>) {
        let order = &mut self.order;
        order.clear();
        order.extend(pairs.iter().flatten());
        order.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.left.cmp(&b.left)));
        found.clear();
        for pair in order {
            if found.iter().all(|kept: &Match| kept.right.distance(&pair.right) >= SAME) {
                found.push(*pair);
            }
        }
        found.sort_unstable_by_key(|pair| pair.left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    #[test]
    fn the_best_of_a_place_stays() {
        let pair = |left, u, distance| Some(Match { left, right: Pixel { u, v: 5.0 }, distance });
        let pairs = [pair(0, 10.0, 0.2), None, pair(2, 10.5, 0.1), pair(3, 12.0, 0.1), pair(4, 12.3, 0.1)];
        let mut found = Vec::new();
        Distinct::default().keep_into(&pairs, &mut found);
        assert_eq!(found.iter().map(|pair| pair.left).collect::<Vec<_>>(), [2, 3]);
    }
}
