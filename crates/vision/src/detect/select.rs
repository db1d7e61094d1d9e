//! The selection of key points beyond a maximum number.

use seafix_component::Settings;
use seafix_geometry::Pixel;
use serde::{Deserialize, Serialize};

use crate::keypoint::Keypoint;

/// Selection of key points beyond a maximum number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Selection {
    /// The strongest of the image.
    Strongest,
    /// The strongest of each square cell, then the second of each cell, and so on.
    #[default]
    Balanced,
    /// The points with the largest distance to a clearly stronger one, 0.9 Rⱼ > Rᵢ: adaptive non-maximal suppression.
    ///
    /// Unlike cells, it does not depend on the position of a grid. Source: Brown, Szeliski and Winder, *Multi-image
    /// matching using multi-scale oriented patches*, CVPR 2005.
    Adaptive,
}

/// The maximum number of key points and their selection.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) features: usize,
    pub(super) selection: Selection,
    /// The number of cells along the longer side of the image, for [`Selection::Balanced`].
    pub(super) cells: usize,
}

/// The working memory of a selection.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// The rank (the largest is kept first), the index by strength, and the point.
    ranked: Vec<(f64, usize, Keypoint)>,
    taken: Vec<usize>,
    near: Near,
}

/// The factor 0.9 of a clearly stronger response.
const CLEARLY: f32 = 0.9;

pub(super) fn stronger(a: &Keypoint, b: &Keypoint) -> std::cmp::Ordering {
    let (u, v) = (a.at.u.total_cmp(&b.at.u), a.at.v.total_cmp(&b.at.v));
    b.response.total_cmp(&a.response).then(v).then(u)
}

impl Budget {
    /// Keeps the selected points of an image of this width and height, strongest first; equals in row-major order.
    pub(super) fn keep(&self, found: &mut Vec<Keypoint>, size: [usize; 2], scratch: &mut Scratch) {
        if found.len() > self.features {
            match self.selection {
                Selection::Strongest => {
                    found.select_nth_unstable_by(self.features, stronger);
                    found.truncate(self.features);
                }
                Selection::Balanced => {
                    found.sort_unstable_by(stronger);
                    rank_in_cells(found, size, self.cells, scratch);
                    self.first(found, scratch);
                }
                Selection::Adaptive => {
                    found.sort_unstable_by(stronger);
                    rank_by_distance(found, size, scratch);
                    self.first(found, scratch);
                }
            }
        }
        found.sort_unstable_by(stronger);
    }

    /// Replaces `found` by the points of the highest rank.
    fn first(&self, found: &mut Vec<Keypoint>, scratch: &mut Scratch) {
        let ranked = &mut scratch.ranked;
        if self.features < ranked.len() {
            ranked.select_nth_unstable_by(self.features, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        }
        found.clear();
        found.extend(ranked.iter().take(self.features).map(|(_, _, point)| *point));
    }
}

/// Ranks the strongest of a cell 0, its second −1, and so on.
fn rank_in_cells(sorted: &[Keypoint], [width, height]: [usize; 2], cells: usize, scratch: &mut Scratch) {
    let longer = width.max(height);
    let cells = cells.clamp(1, longer);
    let cell = |x: f64, n: usize| (x.max(0.0) as usize).min(n - 1) * cells / longer;
    let columns = cell(width as f64, width) + 1;
    scratch.taken.clear();
    scratch.taken.resize(columns * (cell(height as f64, height) + 1), 0);
    scratch.ranked.clear();
    scratch.ranked.extend(sorted.iter().enumerate().map(|(order, point)| {
        let taken = &mut scratch.taken[cell(point.at.v, height) * columns + cell(point.at.u, width)];
        *taken += 1;
        (-(*taken as f64), order, *point)
    }));
}

/// Ranks points by the squared distance to the nearest clearly stronger one (px²).
fn rank_by_distance(sorted: &[Keypoint], size: [usize; 2], scratch: &mut Scratch) {
    let Scratch { ranked, near, .. } = scratch;
    near.clear(size, sorted.len());
    ranked.clear();
    let mut inserted = 0;
    ranked.extend(sorted.iter().enumerate().map(|(order, point)| {
        while inserted < order && CLEARLY * sorted[inserted].response > point.response {
            near.insert(sorted[inserted].at);
            inserted += 1;
        }
        (near.squared(point.at), order, *point)
    }));
}

/// A grid of points for nearest-neighbour queries.
#[derive(Debug, Default)]
struct Near {
    /// The side of a cell (px).
    side: f64,
    /// The numbers of cells along x and y.
    cells: [usize; 2],
    /// The last point of each cell.
    last: Vec<usize>,
    /// Each point with the index of the previous one of its cell.
    points: Vec<(Pixel, usize)>,
}

const NONE: usize = usize::MAX;

impl Near {
    /// Removes all points and sizes the grid for about `count` points.
    fn clear(&mut self, [width, height]: [usize; 2], count: usize) {
        let (width, height) = (width as f64, height as f64);
        self.side = (width * height / count as f64).sqrt().max(1.0);
        self.cells = [width, height].map(|n| (n / self.side) as usize + 1);
        self.last.clear();
        self.last.resize(self.cells[0] * self.cells[1], NONE);
        self.points.clear();
    }

    fn cell(&self, at: Pixel) -> [usize; 2] {
        let cell = |x: f64, n: usize| ((x.max(0.0) / self.side) as usize).min(n - 1);
        [cell(at.u, self.cells[0]), cell(at.v, self.cells[1])]
    }

    fn insert(&mut self, at: Pixel) {
        let [column, row] = self.cell(at);
        let last = &mut self.last[row * self.cells[0] + column];
        self.points.push((at, *last));
        *last = self.points.len() - 1;
    }

    /// The squared distance to the nearest point (px²); infinite without points.
    fn squared(&self, at: Pixel) -> f64 {
        let [column, row] = self.cell(at);
        let [columns, rows] = self.cells;
        let mut best = f64::INFINITY;
        for ring in 0..columns.max(rows) {
            let (top, bottom) = (row.saturating_sub(ring), (row + ring).min(rows - 1));
            for y in top..=bottom {
                let full = y.abs_diff(row) == ring;
                let step = if full || ring == 0 { 1 } else { 2 * ring };
                let sides = (0..=2 * ring).step_by(step).filter_map(|x| (column + x).checked_sub(ring));
                for x in sides.filter(|&x| x < columns) {
                    best = best.min(self.squared_in(at, y * columns + x));
                }
            }
            // All points of the next ring are farther away than this.
            let reach = ring as f64 * self.side;
            if best <= reach * reach {
                break;
            }
        }
        best
    }

    fn squared_in(&self, at: Pixel, cell: usize) -> f64 {
        let mut best = f64::INFINITY;
        let mut index = self.last[cell];
        while let Some((other, before)) = self.points.get(index) {
            let (du, dv) = (other.u - at.u, other.v - at.v);
            best = best.min(du * du + dv * dv);
            index = *before;
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(u: f64, v: f64, response: f32) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response, scale: 1.0 }
    }

    fn kept(all: &[Keypoint], features: usize, selection: Selection, cells: usize) -> Vec<Keypoint> {
        let mut found = all.to_vec();
        Budget { features, selection, cells }.keep(&mut found, [100, 80], &mut Scratch::default());
        found
    }

    /// Points all over 100×80 px with a fixed seed.
    fn many(n: u32) -> Vec<Keypoint> {
        let hash = |i: u32| {
            let h = i.wrapping_mul(0x9E37_79B1);
            (h ^ (h >> 15)).wrapping_mul(0x85EB_CA77) >> 8
        };
        let spot = |i: u32, n: u32| f64::from(hash(i) % (n * 10)) / 10.0;
        (0..n).map(|i| point(spot(3 * i, 100), spot(3 * i + 1, 80), (hash(3 * i + 2) % 5000) as f32 + 1.0)).collect()
    }

    #[test]
    fn cells_divide_the_budget() {
        let all = [point(5.0, 0.0, 7.5), point(1.0, 0.0, 9.0), point(60.0, 0.0, 1.0), point(3.0, 0.0, 8.0)];
        let columns = |selection, cells| kept(&all, 3, selection, cells).iter().map(|p| p.at.u).collect::<Vec<_>>();
        assert_eq!(columns(Selection::Strongest, 2), [1.0, 3.0, 5.0]);
        assert_eq!(columns(Selection::Balanced, 1), [1.0, 3.0, 5.0]);
        assert_eq!(columns(Selection::Balanced, 2), [1.0, 3.0, 60.0]);
        // 0.9 · 9 suppresses 8, at a distance of 2, and 7.5, at 4; 0.9 · 8 suppresses neither.
        assert_eq!(columns(Selection::Adaptive, 2), [1.0, 5.0, 60.0]);
    }

    #[test]
    fn adaptive_keeps_those_farthest_from_a_clearly_stronger_one() {
        let all = many(400);
        for features in [1, 20, 150] {
            let mut radius: Vec<(f64, Keypoint)> = all
                .iter()
                .map(|p| {
                    let stronger = all.iter().filter(|q| 0.9 * q.response > p.response);
                    (stronger.map(|q| q.at.distance(&p.at)).fold(f64::INFINITY, f64::min), *p)
                })
                .collect();
            radius.sort_by(|a, b| b.0.total_cmp(&a.0).then(stronger(&a.1, &b.1)));
            let mut expected: Vec<_> = radius[..features].iter().map(|(_, point)| *point).collect();
            expected.sort_by(stronger);
            assert_eq!(kept(&all, features, Selection::Adaptive, 0), expected);
        }
    }

    #[test]
    fn any_selection_keeps_the_budget_and_what_fits_in_any_order() {
        let all = many(300);
        let mut backwards = all.clone();
        backwards.reverse();
        for selection in [Selection::Strongest, Selection::Balanced, Selection::Adaptive] {
            let some = kept(&all, 40, selection, 8);
            assert_eq!(some.len(), 40);
            assert!(some.windows(2).all(|w| w[0].response >= w[1].response));
            assert_eq!(some, kept(&backwards, 40, selection, 8));
            assert_eq!(kept(&all, 300, selection, 8), kept(&all, 1000, Selection::Strongest, 8));
            assert_eq!(kept(&all, 0, selection, 8), []);
            assert_eq!(kept(&[], 5, selection, 8), []);
        }
    }
}
