//! Independent searches for left key points in the right image.

use seafix_geometry::Pixel;

use super::matcher::Match;
use crate::{detect::Keypoint, workspace::Threads};

/// The number of left key points in a piece of the work.
const PIECE: usize = 32;
/// The distance (px) below which two right pixels are the same.
const SAME: f64 = 1.0;

/// The working memory, with that of each seeker `S`.
#[derive(Debug, Default)]
pub(super) struct Sought<S> {
    seekers: Vec<S>,
    pairs: Vec<Option<Match>>,
    order: Vec<Match>,
}

impl<S: Send + Default> Sought<S> {
    /// Replaces `found` by the results of `seek` for each key point: the pixel in the right image and the distance.
    ///
    /// The best of several pairs with the same right pixel is kept.
    pub(super) fn each(
        &mut self,
        threads: Threads,
        left: &[Keypoint],
        found: &mut Vec<Match>,
        seek: impl Fn(&Pixel, &mut S) -> Option<(Pixel, f32)> + Send + Sync,
    ) {
        let Self { seekers, pairs, order } = self;
        pairs.clear();
        pairs.resize(left.len(), None);
        threads.pieces(pairs, PIECE, seekers, |index, piece, seeker| {
            for (left_index, pair) in (index * PIECE..).zip(piece) {
                let sought = seek(&left[left_index].at, seeker);
                *pair = sought.map(|(right, distance)| Match { left: left_index, right, distance });
            }
        });
        distinct(pairs, order, found);
    }
}

/// Replaces `found` by the pairs with distinct right pixels, in the order of the left key points.
///
/// The best of several pairs with the same right pixel is kept; of equally good ones the first.
fn distinct(pairs: &[Option<Match>], order: &mut Vec<Match>, found: &mut Vec<Match>) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_a_place_stays() {
        let pair = |left, u, distance| Some(Match { left, right: Pixel { u, v: 5.0 }, distance });
        let pairs = [pair(0, 10.0, 0.2), None, pair(2, 10.5, 0.1), pair(3, 12.0, 0.1), pair(4, 12.3, 0.1)];
        let mut found = Vec::new();
        distinct(&pairs, &mut Vec::new(), &mut found);
        assert_eq!(found.iter().map(|pair| pair.left).collect::<Vec<_>>(), [2, 3]);
    }
}
