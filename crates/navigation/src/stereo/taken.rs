//! Minimum distances between the landmarks of an image.

use std::collections::HashMap;

/// The occupied positions of an image, in a grid.
pub(super) struct Taken {
    apart: f64,
    cells: HashMap<[i64; 2], Vec<[f64; 2]>>,
}

impl Taken {
    pub(super) fn new(apart: f64) -> Self {
        Self { apart, cells: HashMap::new() }
    }

    fn cell(&self, at: [f64; 2]) -> [i64; 2] {
        at.map(|x| (x / self.apart).floor() as i64)
    }

    pub(super) fn insert(&mut self, at: [f64; 2]) {
        self.cells.entry(self.cell(at)).or_default().push(at);
    }

    pub(super) fn free(&self, at: [f64; 2]) -> bool {
        let [column, row] = self.cell(at);
        let near = |other: &[f64; 2]| {
            let (u, v) = (other[0] - at[0], other[1] - at[1]);
            u * u + v * v < self.apart * self.apart
        };
        let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| [column + x, row + y]));
        !around.filter_map(|cell| self.cells.get(&cell)).flatten().any(near)
    }
}
