//! A grid of points in the plane.

/// Points sorted into the cells of a grid over their bounding box.
#[derive(Debug, Default)]
pub(super) struct Grid {
    low: [f64; 2],
    cell: [f64; 2],
    /// The start of each cell in `order`, in row-major order, then the end of the last.
    starts: Vec<u32>,
    /// The points by cell, in their original order within a cell.
    order: Vec<u32>,
}

/// The number of cells along either side.
const SIDE: usize = 64;
/// The largest shift of a border by rounding, as a fraction of a cell.
const SLACK: f64 = 1e-6;

impl Grid {
    /// Replaces the points; points that are not finite are skipped.
    pub(super) fn fill(&mut self, points: impl Iterator<Item = [f64; 2]> + Clone) {
        let known = points.enumerate().filter(|(_, at)| at.iter().all(|x| x.is_finite()));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (_, at) in known.clone() {
            low = [low[0].min(at[0]), low[1].min(at[1])];
            high = [high[0].max(at[0]), high[1].max(at[1])];
        }
        self.low = low;
        self.cell = std::array::from_fn(|axis| ((high[axis] - low[axis]) / SIDE as f64).max(f64::MIN_POSITIVE));
        self.starts.clear();
        self.starts.resize(SIDE * SIDE + 1, 0);
        for (_, at) in known.clone() {
            let cell = self.cell_of(at);
            self.starts[cell + 1] += 1;
        }
        for cell in 0..SIDE * SIDE {
            self.starts[cell + 1] += self.starts[cell];
        }
        self.order.clear();
        self.order.resize(self.starts[SIDE * SIDE] as usize, 0);
        // Filling advances each start to the next cell's start; the shift undoes it.
        for (index, at) in known {
            let cell = self.cell_of(at);
            self.order[self.starts[cell] as usize] = index as u32;
            self.starts[cell] += 1;
        }
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }

    /// The number of points in the grid.
    pub(super) fn len(&self) -> usize {
        self.order.len()
    }

    /// The sides of the bounding box.
    pub(super) fn extent(&self) -> [f64; 2] {
        self.cell.map(|cell| cell * SIDE as f64)
    }

    /// Visits all points with |a x + b y + c| ≤ `half`, and a few more.
    pub(super) fn along_line(&self, [a, b, c]: [f64; 3], half: f64, mut visit: impl FnMut(usize)) {
        let half = half * (1.0 + SLACK);
        let spread = |k: f64, low: f64, high: f64| (f64::min(k * low, k * high), f64::max(k * low, k * high));
        let [width, height] = self.extent();
        // The term a x has this range in the box, and b y must compensate it.
        let (min, max) = spread(a, self.low[0], self.low[0] + width);
        let (top, bottom) = interval(b, -half - c - max, half - c - min);
        if !(top <= self.low[1] + height * (1.0 + SLACK) && bottom >= self.low[1] - height * SLACK) {
            return;
        }
        for row in self.index(1, top)..=self.index(1, bottom) {
            let y = self.low[1] + row as f64 * self.cell[1];
            let (min, max) = spread(b, y - SLACK * self.cell[1], y + (1.0 + SLACK) * self.cell[1]);
            let (first, last) = interval(a, -half - c - max, half - c - min);
            if first <= self.low[0] + width * (1.0 + SLACK) && last >= self.low[0] - width * SLACK {
                self.run(row, first, last).iter().for_each(|&index| visit(index as usize));
            }
        }
    }

    /// Visits all points within `reach` of `at` along both axes, and a few more.
    pub(super) fn around(&self, at: [f64; 2], reach: f64, mut visit: impl FnMut(usize)) {
        for row in self.index(1, at[1] - reach)..=self.index(1, at[1] + reach) {
            self.run(row, at[0] - reach, at[0] + reach).iter().for_each(|&index| visit(index as usize));
        }
    }

    /// The points of the cells of a row from `first` to `last`.
    fn run(&self, row: usize, first: f64, last: f64) -> &[u32] {
        let (first, last) = (row * SIDE + self.index(0, first), row * SIDE + self.index(0, last));
        &self.order[self.starts[first] as usize..self.starts[last + 1] as usize]
    }

    /// The row or column of a coordinate, clamped to the grid.
    fn index(&self, axis: usize, x: f64) -> usize {
        (((x - self.low[axis]) / self.cell[axis]) as usize).min(SIDE - 1)
    }

    fn cell_of(&self, at: [f64; 2]) -> usize {
        self.index(1, at[1]) * SIDE + self.index(0, at[0])
    }
}

/// The range of x with low ≤ k x ≤ high.
fn interval(k: f64, low: f64, high: f64) -> (f64, f64) {
    match k {
        k if k > 0.0 => (low / k, high / k),
        k if k < 0.0 => (high / k, low / k),
        _ if low <= 0.0 && high >= 0.0 => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (f64::INFINITY, f64::NEG_INFINITY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: usize) -> Vec<[f64; 2]> {
        let mut state = 5_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        (0..n).map(|_| [3.0 * next() - 1.0, next() - 0.5]).collect()
    }

    #[test]
    fn every_point_beside_a_line_is_visited() {
        let points = scattered(500);
        let mut grid = Grid::default();
        grid.fill(points.iter().copied());
        for (index, turn) in (0..200).map(|i| (i, f64::from(i) * 0.157)) {
            let (a, b) = if index % 50 == 0 { (0.0, 1.0) } else { (libm::sin(turn), libm::cos(turn)) };
            let (c, half) = (0.01 * f64::from(index) - 1.0, 0.001 * f64::from(index));
            let mut seen = vec![0; points.len()];
            grid.along_line([a, b, c], half, |index| seen[index] += 1);
            assert!(seen.iter().all(|&times| times <= 1), "a point is visited twice");
            let beside = |at: &[f64; 2]| (a * at[0] + b * at[1] + c).abs() <= half;
            assert!(points.iter().zip(&seen).all(|(at, &times)| times == 1 || !beside(at)), "{a} {b} {c} {half}");
            assert!(half > 0.03 || seen.iter().sum::<i32>() < 250, "too many other points are visited");
        }
    }

    #[test]
    fn every_point_around_a_place_is_visited() {
        let points = scattered(300);
        let mut grid = Grid::default();
        grid.fill(points.iter().copied());
        for (at, reach) in [([0.0, 0.0], 0.1), ([2.1, 0.6], 0.2), ([-5.0, 0.0], 4.5), ([0.5, 0.1], 100.0)] {
            let mut seen = vec![false; points.len()];
            grid.around(at, reach, |index| seen[index] = true);
            let within = |p: &[f64; 2]| (p[0] - at[0]).abs() <= reach && (p[1] - at[1]).abs() <= reach;
            assert!(points.iter().zip(&seen).all(|(p, &seen)| seen || !within(p)));
        }
    }

    #[test]
    fn no_points_one_point_and_points_that_are_none() {
        let mut grid = Grid::default();
        let visited = |grid: &Grid| {
            let mut found = Vec::new();
            grid.along_line([0.0, 1.0, -2.0], 0.5, |index| found.push(index));
            found
        };
        grid.fill([].into_iter());
        assert!(visited(&grid).is_empty() && grid.len() == 0);
        grid.fill([[f64::NAN, 2.0], [7.0, 2.2], [f64::INFINITY, 2.0]].into_iter());
        assert_eq!((visited(&grid), grid.len()), (vec![1], 1));
    }
}
