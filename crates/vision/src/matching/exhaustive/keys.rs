//! The three smallest keys of many, in lanes and without branches.

/// The number of lanes: right descriptors that are compared at once.
pub(super) const COLUMNS: usize = 16;

/// The number of positions that a key distinguishes.
pub(super) const PLACES: usize = 1 << PLACE_BITS;
const PLACE_BITS: u32 = 8;
const PLACE: i32 = (1 << PLACE_BITS) - 1;

/// The three smallest keys of each lane, smallest first.
///
/// A key is one integer with the distance in its upper bits and the position in its lower eight. Keys compare by
/// distance, then by position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Keys([[i32; COLUMNS]; 3]);

impl Keys {
    pub(super) const NONE: Self = Self([[i32::MAX; COLUMNS]; 3]);

    /// Considers one key for each lane.
    #[inline(always)]
    pub(super) fn offer(&mut self, keys: &[i32; COLUMNS]) {
        let [first, second, third] = &mut self.0;
        for lane in 0..COLUMNS {
            let key = keys[lane];
            let rest = first[lane].max(key);
            first[lane] = first[lane].min(key);
            let last = second[lane].max(rest);
            second[lane] = second[lane].min(rest);
            third[lane] = third[lane].min(last);
        }
    }

    /// Merges the keys of `lane` into `three`; `read` decodes the distance, `index` the position.
    pub(super) fn merge_into(
        &self,
        three: &mut Three,
        lane: usize,
        read: fn(i32) -> f32,
        index: impl Fn(usize) -> usize,
    ) {
        for (rank, keys) in self.0.iter().enumerate() {
            let (value, place) = (read(keys[lane] & !PLACE), (keys[lane] & PLACE) as usize);
            if keys[lane] == i32::MAX || !(value <= three.value[2] && value < f32::INFINITY) {
                break;
            }
            match rank {
                2 => three.value[2] = value,
                _ => three.offer(index(place) as u32, value),
            }
        }
    }
}

/// The key of a number that is non-negative up to rounding.
///
/// Its last eight bits make room for the position, which lowers the decoded number by at most 2⁻¹⁵ of itself.
#[inline(always)]
pub(super) fn key_of_number(value: f32, place: i32) -> i32 {
    value.to_bits() as i32 & (i32::MAX & !PLACE) | place
}

pub(super) fn number_of_key(key: i32) -> f32 {
    f32::from_bits(key as u32)
}

/// The key of a count below 2²³, which is decoded exactly.
#[inline(always)]
pub(super) fn key_of_count(count: u64, place: i32) -> i32 {
    (count as i32) << PLACE_BITS | place
}

pub(super) fn count_of_key(key: i32) -> f32 {
    (key >> PLACE_BITS) as f32
}

/// The nearest two elements so far and the distances of the nearest three.
#[derive(Debug, Clone, Copy)]
pub(super) struct Three {
    pub(super) index: [u32; 2],
    pub(super) value: [f32; 3],
}

impl Three {
    pub(super) const NONE: Self = Self { index: [u32::MAX; 2], value: [f32::INFINITY; 3] };

    /// Considers an element; of equal distances the lowest index is nearest, in whatever order they come.
    pub(super) fn offer(&mut self, index: u32, value: f32) {
        let [first, second, third] = self.value;
        let before = |other: f32, its: u32| value < other || value == other && index < its;
        if before(first, self.index[0]) {
            *self = Self { index: [index, self.index[0]], value: [value, first, second] };
        } else if before(second, self.index[1]) {
            *self = Self { index: [self.index[0], index], value: [first, value, second] };
        } else if value < third {
            self.value[2] = value;
        }
    }

    /// Merges the elements of `other`, whose third is at best the third of both.
    pub(super) fn merge(&mut self, other: &Self) {
        (0..2).filter(|&k| other.index[k] != u32::MAX).for_each(|k| self.offer(other.index[k], other.value[k]));
        self.value[2] = self.value[2].min(other.value[2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_three_of_a_lane_are_read_back() {
        let mut keys = Keys::NONE;
        for (place, value) in [5.0_f32, 2.0, 7.0, 2.0, 3.0].into_iter().enumerate() {
            keys.offer(&std::array::from_fn(|lane| key_of_number(value + lane as f32, place as i32)));
        }
        let mut three = Three::NONE;
        keys.merge_into(&mut three, 1, number_of_key, |place| 10 * place);
        assert_eq!((three.index, three.value), ([10, 30], [3.0, 3.0, 4.0]));
        // Another lane's elements are merged, equal ones in the order of their indices.
        keys.merge_into(&mut three, 1, number_of_key, |place| 10 * place + 1);
        assert_eq!((three.index, three.value), ([10, 11], [3.0, 3.0, 3.0]));
        let mut none = Three::NONE;
        Keys::NONE.merge_into(&mut none, 0, number_of_key, |place| place);
        Keys::NONE.merge_into(&mut none, 0, count_of_key, |place| place);
        assert_eq!((none.index, none.value), ([u32::MAX; 2], [f32::INFINITY; 3]));
    }

    #[test]
    fn a_number_loses_less_than_it_may() {
        for value in [0.0, 1e-30, 0.3, 1.999_999_9, 3e30] {
            let back = number_of_key(key_of_number(value, 255) & !PLACE);
            assert!(back <= value && value <= back * (1.0 + 1.0 / 32768.0), "{value}: {back}");
        }
        assert_eq!(count_of_key(key_of_count(320, 7) & !PLACE), 320.0);
    }
}
