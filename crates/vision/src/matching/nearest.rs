//! Nearest and second nearest neighbours between two sets.

/// The nearest neighbour of each element in the other set, with the distance of the second nearest.
#[derive(Debug, Default)]
pub(super) struct Nearest {
    pub(super) left: Vec<Two>,
    pub(super) right: Vec<Two>,
}

/// The nearest element so far and the squared distances of the nearest two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Two {
    index: usize,
    squared: f32,
    second: f32,
}

/// A pair of mutual nearest neighbours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mutual {
    pub(super) left: usize,
    pub(super) right: usize,
    /// The squared distance of the pair.
    pub(super) squared: f32,
    /// The smallest squared distance from either to any other.
    pub(super) second: f32,
}

impl Two {
    pub(super) const NONE: Self = Self { index: usize::MAX, squared: f32::INFINITY, second: f32::INFINITY };

    /// Considers an element; of equal distances the lowest index is kept, in whatever order they come.
    pub(super) fn offer(&mut self, index: usize, squared: f32) {
        if squared < self.squared || squared == self.squared && index < self.index {
            *self = Self { index, squared, second: self.squared };
        } else if squared < self.second {
            self.second = squared;
        }
    }
}

impl Mutual {
    /// Whether the pair passes the ratio test; 1 disables it.
    ///
    /// A second of equal distance fails any ratio below 1.
    pub(super) fn clear(&self, squared_ratio: f32) -> bool {
        squared_ratio >= 1.0 || self.squared < squared_ratio * self.second
    }
}

impl Nearest {
    /// Resets the sets to `left` and `right` elements without distances.
    pub(super) fn reset(&mut self, left: usize, right: usize) {
        self.left.clear();
        self.left.resize(left, Two::NONE);
        self.right.clear();
        self.right.resize(right, Two::NONE);
    }

    /// Considers the squared distance of left `i` and right `j`.
    pub(super) fn offer(&mut self, i: usize, j: usize, squared: f32) {
        self.left[i].offer(j, squared);
        self.right[j].offer(i, squared);
    }

    /// The mutual nearest neighbours, in the order of the left side.
    pub(super) fn mutual(&self) -> impl Iterator<Item = Mutual> + '_ {
        self.left.iter().enumerate().filter_map(|(left, two)| {
            let back = self.right.get(two.index)?;
            let mutual = Mutual { left, right: two.index, squared: two.squared, second: two.second.min(back.second) };
            (back.index == left).then_some(mutual)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_and_second_by_hand() {
        let (left, right) = ([0.0_f32, 5.0, 5.5], [5.1_f32, 0.5, 9.0]);
        let mut nearest = Nearest::default();
        nearest.reset(3, 3);
        for (i, j) in (0..9).map(|pair| (pair / 3, pair % 3)) {
            nearest.offer(i, j, (left[i] - right[j]).powi(2));
        }
        let pairs: Vec<_> = nearest.mutual().collect();
        assert_eq!(pairs.len(), 2);
        assert_eq!((pairs[0].left, pairs[0].right), (0, 1));
        assert!((pairs[0].second - 20.25).abs() < 1e-4, "left 1 is not the second nearest of right 1");
        assert_eq!((pairs[1].left, pairs[1].right), (1, 0));
        assert!((pairs[1].second - 0.16).abs() < 1e-4, "left 2 is not the second nearest of right 0");
        assert!(pairs[0].clear(0.7) && pairs[1].clear(0.7) && !pairs[1].clear(0.05));
    }

    #[test]
    fn what_is_no_nearer_than_another_is_not_clear() {
        let mut two = [Two::NONE; 2];
        [(4, 0.0), (2, 0.0), (9, 1.0)].into_iter().for_each(|(index, squared)| two[0].offer(index, squared));
        [(9, 1.0), (2, 0.0), (4, 0.0)].into_iter().for_each(|(index, squared)| two[1].offer(index, squared));
        assert_eq!(two, [Two { index: 2, squared: 0.0, second: 0.0 }; 2]);
        let alike = Mutual { left: 0, right: 2, squared: 0.0, second: 0.0 };
        assert!(!alike.clear(0.99) && alike.clear(1.0));
    }
}
