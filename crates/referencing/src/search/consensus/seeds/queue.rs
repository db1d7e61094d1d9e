//! The priority queue of pairs.

/// Number of pairs sorted first.
const SORTED: usize = 1024;

/// Bound and vertices of a pair.
pub(in crate::search) type Pair = (f32, u32, u32);

/// Sort key: descending bound, equal bounds in the order of the graph.
pub(super) fn order(&(bound, a, b): &Pair) -> u128 {
    // The order of `total_cmp`: the greater of two negative numbers has the smaller bits.
    let bits = bound.to_bits();
    let ascending = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
    u128::from(!ascending) << 64 | u128::from(a) << 32 | u128::from(b)
}

/// The pairs in descending order of their bound. Incremental sort, since seldom all are taken: each step sorts as many
/// as were taken before.
pub(super) struct Queue {
    pairs: Vec<Pair>,
    taken: usize,
    sorted: usize,
}

impl Queue {
    pub(super) fn of(pairs: Vec<Pair>) -> Self {
        Self { pairs, taken: 0, sorted: 0 }
    }

    /// All pairs, taken or not, in no order.
    pub(super) fn into_pairs(self) -> Vec<Pair> {
        self.pairs
    }

    fn sort_more(&mut self) {
        let rest = &mut self.pairs[self.sorted..];
        let more = self.sorted.max(SORTED).min(rest.len());
        if more < rest.len() {
            rest.select_nth_unstable_by_key(more, order);
        }
        rest[..more].sort_unstable_by_key(order);
        self.sorted += more;
    }
}

impl Iterator for Queue {
    type Item = Pair;

    fn next(&mut self) -> Option<Pair> {
        if self.taken == self.sorted {
            self.sort_more();
        }
        let next = self.pairs.get(self.taken).copied();
        self.taken += usize::from(next.is_some());
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_bound_comes_first_and_every_pair_once() {
        let bound = |k: u32| ((k * 7919) % 5003) as f32 - 2500.0;
        let pairs: Vec<Pair> = (0..5000).map(|k| (bound(k / 2), k, k + 1)).collect();
        let mut sorted = pairs.clone();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        assert_eq!(Queue::of(pairs).collect::<Vec<_>>(), sorted);
        assert_eq!(Queue::of(Vec::new()).next(), None);
    }
}
