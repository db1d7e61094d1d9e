//! The support of a pair by neighbouring pairs (relaxation labelling).

use super::grid::Grid;
use crate::detect::Keypoint;

/// A candidate: a right key point that may match a left one.
#[derive(Debug, Clone, Copy)]
pub(super) struct MatchCandidate {
    /// The index of the left key point.
    pub(super) left: usize,
    /// The index of the right key point.
    pub(super) right: usize,
    /// The squared distance of the descriptors.
    pub(super) squared: f32,
    /// The weight of the candidate: inverse squared distance times all support.
    pub(super) weight: f32,
    /// The weight as a fraction of the weights of all candidates of either key point.
    pub(super) fraction: f32,
    /// The displacement from the left to the right key point (px).
    pub(super) displacement: [f32; 2],
}

impl MatchCandidate {
    /// The index of the key point in the left (0) or the right image (1).
    pub(super) fn of_side(&self, side: usize) -> usize {
        if side == 0 { self.left } else { self.right }
    }
}

/// The candidates of each left key point, nearest descriptors first, and their support.
#[derive(Debug, Default)]
pub(super) struct MatchCandidates {
    all: Vec<MatchCandidate>,
    /// The start of each left key point's candidates, then the end of the last.
    starts: Vec<usize>,
    links: Vec<Link>,
    /// The start of each candidate's links, then the end of the last.
    link_starts: Vec<usize>,
    /// The left key points with candidates.
    occupied: Vec<usize>,
    grid: Grid,
    near: Vec<(f32, u32)>,
    columns: Vec<f32>,
    /// Whether each selected candidate has an alternative.
    verdicts: Vec<Option<bool>>,
    /// Whether each pair lies in a repeated pattern.
    spread: Vec<bool>,
}

/// A link to an agreeing candidate of a neighbour.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    pub(super) candidate: u32,
    pub(super) agreement: f32,
    /// The neighbour's rank by distance.
    pub(super) rank: u16,
}

/// The maximum number of candidates of a left key point.
const MAX: usize = 8;
/// The maximum ratio of a candidate's squared descriptor distance to the nearest one's.
///
/// On a repeated pattern the wrong position often looks a few times more similar than the right one; neighbours decide.
const FURTHEST: f32 = 4.0;
/// The squared distance below which descriptors count as equally near.
///
/// The two views of one place on a slanted surface differ by this much. Without the limit, the descriptors of a slanted
/// chessboard prefer a shift to the squares that the other view shows in the same size. The value was chosen among nine
/// from 1e-6 to 0.2, on the chessboards of seven real rigs and on tiled planes before six simulated ones.
pub(super) const NEAREST: f32 = 0.06;
/// The number of relaxation rounds.
const ROUNDS: usize = 10;
/// The maximum gradient of the displacement with support, that of a surface at a grazing angle.
const GRADIENT: f32 = 0.3;
/// The tolerance of the detectors' errors (px).
const SLACK: f32 = 1.0;
/// The support of a pair without agreeing neighbours.
const FLOOR: f32 = 0.05;
/// The minimum agreement of an alternative, as a fraction of the pair's.
const ALTERNATIVE: f32 = 0.5;
/// The number of standard errors by which the neighbourhood's descriptors must prefer a pair to its alternative.
///
/// It is three, doubled because the errors are not independent: windows of neighbours overlap, and the sampling by the
/// pixel grid has a similar effect on patterns a period apart.
const CLEARLY: f32 = 6.0;
/// The minimum number of neighbours for a standard error.
pub(super) const FEW: usize = 4;

/// The reciprocal of the fraction of ambiguous pairs that indicates a pattern.
///
/// The fraction was at most 1/60 in 16 pairs of images, rendered and real, without repeated patterns or of complete
/// chessboards; in unbounded patterns it was at least two thirds.
const PATTERN: usize = 5;

impl MatchCandidates {
    /// Replaces the candidates by the pairs that `visit(i, ..)` names for each left key point, with their distances.
    pub(super) fn fill(
        &mut self,
        [left, right]: [&[Keypoint]; 2],
        visit: impl Fn(usize, &mut dyn FnMut(usize)),
        squared: impl Fn(usize, usize) -> f32,
    ) {
        self.all.clear();
        self.starts.clear();
        self.starts.push(0);
        for (i, from) in left.iter().enumerate() {
            let first = self.all.len();
            visit(i, &mut |j| {
                let (to, squared) = (&right[j].at, squared(i, j));
                let displacement = [(to.u - from.at.u) as f32, (to.v - from.at.v) as f32];
                let weight = 1.0 / squared.max(NEAREST);
                self.all.push(MatchCandidate { left: i, right: j, squared, weight, fraction: 0.0, displacement });
            });
            let mine = &mut self.all[first..];
            mine.sort_unstable_by(|a, b| a.squared.total_cmp(&b.squared).then(a.right.cmp(&b.right)));
            let max = mine.first().map_or(0.0, |nearest| FURTHEST * FURTHEST * nearest.squared.max(NEAREST));
            let kept = mine.iter().take(MAX).take_while(|c| c.squared <= max).count();
            self.all.truncate(first + kept);
            self.starts.push(self.all.len());
        }
    }

    /// The candidates of left key point `i`.
    pub(super) fn of(&self, i: usize) -> &[MatchCandidate] {
        &self.all[self.starts[i]..self.starts[i + 1]]
    }

    /// The number of candidates.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// The candidate with an index.
    pub(super) fn candidate(&self, c: u32) -> &MatchCandidate {
        &self.all[c as usize]
    }

    /// The indices of the candidates of left key point `i`.
    pub(super) fn indices_of(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// The preference for a candidate to none: ln of the squared distance at which candidates are dropped, over its own.
    pub(super) fn preference_to_none(&self, c: u32) -> f32 {
        let candidate = self.candidate(c);
        let nearest = self.of(candidate.left)[0].squared.max(NEAREST);
        libm::logf(FURTHEST * FURTHEST * nearest / candidate.squared.max(NEAREST))
    }

    /// Shifts weight to the candidates that agree with those of the `neighbours` nearest left key points.
    ///
    /// Pairs (i, j) and (i', j') agree by c = 1 − |δ| / (1 px + 0.3 |x_i − x_i'|), if positive, where δ = (x_j − x_i) −
    /// (x_j' − x_i') is the difference of their displacements. Each round multiplies the weight w_ij by its support,
    /// the mean over i' of the maximum over j' of p_i'j' c, where p_ij = w_ij / (Σ_k w_ik + Σ_k w_kj − w_ij) is the
    /// pair's fraction. Without any support the weights keep their ratios, those of the plain ratio test.
    ///
    /// Source: Barnard and Thompson, *Disparity analysis of images*, PAMI 1980; Pollard, Mayhew and Frisby, *PMF: a
    /// stereo correspondence algorithm using a disparity gradient limit*, 1985.
    pub(super) fn support(&mut self, left: &[Keypoint], right: usize, neighbours: usize) {
        self.link(left, neighbours);
        for _ in 0..ROUNDS {
            self.fraction(right);
            for c in 0..self.all.len() {
                let fraction = |link: &Link| self.all[link.candidate as usize].fraction * link.agreement;
                let greatest = |same: &[Link]| same.iter().map(fraction).fold(0.0, f32::max);
                let sum: f32 = self.neighbours_of(c).map(greatest).sum();
                self.all[c].weight *= FLOOR + sum / neighbours as f32;
            }
        }
    }

    /// Decides for each of these pairs, in the order of the left key points, whether it is ambiguous: the evidence for
    /// it supports an alternative as well, as on a repeated pattern shifted by a period.
    ///
    /// An alternative of a pair is another candidate of its left key point with which the neighbours agree at least
    /// half as much, by candidates of their own. Each such neighbour, and the point itself, contributes the logarithm
    /// of a ratio of squared descriptor distances: that of its candidate that agrees with the alternative over that of
    /// its candidate that agrees with the pair. A pair is confirmed if the mean is at least six standard errors above
    /// zero or, with fewer than four neighbours, if it passes the plain ratio test.
    ///
    /// One neighbourhood may mislead, so a pair is ambiguous if more than half of the pairs that agree with it, itself
    /// included, are not confirmed.
    pub(super) fn ambiguous(&mut self, pairs: &[(usize, usize)], squared_ratio: f32, ambiguous: &mut Vec<bool>) {
        let place = |this: &Self, (i, j): (usize, usize)| {
            (this.starts[i]..this.starts[i + 1]).find(|&c| this.all[c].right == j).expect("each pair is a candidate")
        };
        let mut verdicts = std::mem::take(&mut self.verdicts);
        verdicts.clear();
        verdicts.resize(self.all.len(), None);
        for &pair in pairs {
            let (chosen, all) = (place(self, pair), self.starts[pair.0]..self.starts[pair.0 + 1]);
            let rivalled = all.into_iter().any(|c| c != chosen && self.competitors(chosen, c, squared_ratio));
            verdicts[chosen] = Some(rivalled);
        }
        ambiguous.clear();
        ambiguous.extend(pairs.iter().map(|&pair| {
            let chosen = place(self, pair);
            let around = self.links[self.link_starts[chosen]..self.link_starts[chosen + 1]].iter();
            let around = around.filter_map(|link| verdicts[link.candidate as usize]).chain(verdicts[chosen]);
            let (count, rivalled) = around.fold((0, 0), |(n, k), rivalled| (n + 1, k + i32::from(rivalled)));
            2 * rivalled > count
        }));
        self.verdicts = verdicts;
    }

    /// Marks each pair as ambiguous if more than a fifth of its `neighbours` nearest pairs are.
    ///
    /// Points of an unbounded pattern differ from their alternatives by chance at best: if the right image has no key
    /// point at the alternative's position, or has it a little off. Without repetition hardly any pair has an
    /// alternative.
    pub(super) fn spread(
        &mut self,
        left: &[Keypoint],
        pairs: &[(usize, usize)],
        neighbours: usize,
        ambiguous: &mut [bool],
    ) -> bool {
        if !ambiguous.contains(&true) {
            return false;
        }
        let Self { occupied, grid, near, spread, .. } = self;
        occupied.clear();
        occupied.extend(pairs.iter().map(|pair| pair.0));
        grid.fill(occupied.iter().map(|&i| [left[i].at.u, left[i].at.v]));
        let in_pattern = |&(i, _): &(usize, usize)| {
            nearest_neighbours(grid, left, occupied, i, neighbours, near);
            let rivalled = near.iter().filter(|(_, k)| {
                let pair = occupied.binary_search(&(*k as usize)).expect("each neighbour has a pair");
                ambiguous[pair]
            });
            near.len() > FEW && rivalled.count() > near.len() / PATTERN
        };
        spread.clear();
        spread.extend(pairs.iter().map(in_pattern));
        let pattern = spread.contains(&true);
        ambiguous.iter_mut().zip(spread).for_each(|(own, around)| *own |= *around);
        pattern
    }

    /// Whether `competitor` is as good a candidate as `chosen`, of the same left key point.
    fn competitors(&self, chosen: usize, competitor: usize, squared_ratio: f32) -> bool {
        let preference = |a: usize, b: usize| {
            let squared = |c: usize| self.all[c].squared.max(NEAREST);
            libm::logf(squared(b) / squared(a))
        };
        let own = preference(chosen, competitor);
        let (mut agree, mut agree_with_alternative, mut compared) = (0.0, 0.0, 1);
        let (mut sum, mut squares) = (own, own * own);
        let mut others = self.neighbours_of(competitor).peekable();
        for same in self.neighbours_of(chosen) {
            let agreement_weight = |link: &&Link| self.all[link.candidate as usize].fraction * link.agreement;
            let Some(here) = same.iter().max_by(|a, b| agreement_weight(a).total_cmp(&agreement_weight(b))) else {
                continue;
            };
            agree += here.agreement;
            while others.next_if(|other| other[0].rank < here.rank).is_some() {}
            let Some(other) = others.next_if(|other| other[0].rank == here.rank) else { continue };
            let Some(there) = other.iter().max_by(|a, b| a.agreement.total_cmp(&b.agreement)) else { continue };
            if there.candidate != here.candidate {
                agree_with_alternative += there.agreement;
                compared += 1;
                let preference = preference(here.candidate as usize, there.candidate as usize);
                sum += preference;
                squares += preference * preference;
            }
        }
        if compared == 1 || agree_with_alternative < ALTERNATIVE * agree {
            return false;
        }
        if compared <= FEW {
            return libm::expf(-own) >= squared_ratio;
        }
        let n = compared as f32;
        let mean = sum / n;
        let variance = (squares - n * mean * mean).max(0.0) / (n - 1.0);
        !(mean > 0.0 && mean * mean * n >= CLEARLY * CLEARLY * variance)
    }

    /// The links of a candidate, grouped by neighbour.
    pub(super) fn neighbours_of(&self, candidate: usize) -> impl Iterator<Item = &[Link]> {
        let links = &self.links[self.link_starts[candidate]..self.link_starts[candidate + 1]];
        links.chunk_by(|a, b| a.rank == b.rank)
    }

    /// Updates the fractions from the weights.
    fn fraction(&mut self, right: usize) {
        self.columns.clear();
        self.columns.resize(right, 0.0);
        self.all.iter().for_each(|c| self.columns[c.right] += c.weight);
        for candidates in self.all.chunk_by_mut(|a, b| a.left == b.left) {
            let row: f32 = candidates.iter().map(|c| c.weight).sum();
            candidates.iter_mut().for_each(|c| c.fraction = c.weight / (row + self.columns[c.right] - c.weight));
        }
    }

    /// Finds the agreeing candidates of the neighbours of each candidate.
    fn link(&mut self, left: &[Keypoint], neighbours: usize) {
        let Self { all, starts, links, link_starts, occupied, grid, near, .. } = self;
        occupied.clear();
        occupied.extend((0..left.len()).filter(|&i| starts[i] < starts[i + 1]));
        grid.fill(occupied.iter().map(|&i| [left[i].at.u, left[i].at.v]));
        links.clear();
        link_starts.clear();
        link_starts.push(0);
        for &i in &*occupied {
            nearest_neighbours(grid, left, occupied, i, neighbours, near);
            for candidate in &all[starts[i]..starts[i + 1]] {
                for (rank, &(apart, k)) in near.iter().enumerate() {
                    let tolerance = SLACK + GRADIENT * apart.sqrt();
                    let others = starts[k as usize]..starts[k as usize + 1];
                    for (index, other) in others.clone().zip(&all[others]) {
                        let (here, there) = (candidate.displacement, other.displacement);
                        let (u, v) = (here[0] - there[0], here[1] - there[1]);
                        let off = u * u + v * v;
                        if off < tolerance * tolerance && other.right != candidate.right {
                            let agreement = 1.0 - off.sqrt() / tolerance;
                            links.push(Link { candidate: index as u32, agreement, rank: rank as u16 });
                        }
                    }
                }
                link_starts.push(links.len());
            }
        }
    }
}

/// Finds the squared distances and indices of the `count` left key points nearest to `i`, among `occupied`.
fn nearest_neighbours(
    grid: &Grid,
    left: &[Keypoint],
    occupied: &[usize],
    i: usize,
    count: usize,
    near: &mut Vec<(f32, u32)>,
) {
    let at = left[i].at;
    let [width, height] = grid.extent();
    // Twice the average area of `count` points.
    let mut reach = 1.0 + (width * height * (count + 1) as f64 / (2.0 * grid.len() as f64)).sqrt();
    loop {
        near.clear();
        let within = (reach * reach) as f32;
        grid.around([at.u, at.v], reach, |index| {
            let k = occupied[index];
            let (u, v) = (left[k].at.u - at.u, left[k].at.v - at.v);
            let apart = (u * u + v * v) as f32;
            if k != i && apart <= within {
                near.push((apart, k as u32));
            }
        });
        if near.len() >= count || reach > width + height {
            break;
        }
        reach *= 1.5;
    }
    let order = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if near.len() > count {
        near.select_nth_unstable_by(count, order);
        near.truncate(count);
    }
    near.sort_unstable_by(order);
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    const COLUMNS: usize = 8;
    const ROWS: usize = 6;
    const COUNT: usize = COLUMNS * ROWS;

    /// A lattice of 25 px in both images, 60 px further left and 2 % narrower (slanted) in the right one.
    fn lattice() -> [Vec<Keypoint>; 2] {
        let at = |u: f64, v: f64| Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.0 };
        let place = |i: usize| (100.0 + 25.0 * (i % COLUMNS) as f64, 100.0 + 25.0 * (i / COLUMNS) as f64);
        let left = (0..COUNT).map(|i| at(place(i).0, place(i).1));
        let right = (0..COUNT).map(|i| at(0.98 * place(i).0 - 60.0, place(i).1));
        [left.collect(), right.collect()]
    }

    /// The candidates of left point `i` are all right points of its row, with these squared distances.
    fn of_rows(views: [&[Keypoint]; 2], squared: impl Fn(usize, usize) -> f32) -> MatchCandidates {
        let mut candidates = MatchCandidates::default();
        let row = |i: usize, visit: &mut dyn FnMut(usize)| {
            (0..COLUMNS).for_each(|column| visit(i / COLUMNS * COLUMNS + column));
        };
        candidates.fill(views, row, squared);
        candidates
    }

    /// A distance by which each third point is more similar to its neighbours than to itself; the others are not.
    fn alike(i: usize, j: usize) -> f32 {
        let (itself, misled) = (i == j, i.is_multiple_of(3));
        if itself == misled { 0.05 } else { 0.04 }
    }

    /// The right point of the largest weight for each left one, and whether the second has less than half of it.
    fn believed(candidates: &MatchCandidates) -> Vec<(usize, bool)> {
        let max = |i: usize| {
            let mut sorted = candidates.of(i).to_vec();
            sorted.sort_by(|a, b| b.weight.total_cmp(&a.weight));
            (sorted[0].right, sorted[1].weight < 0.5 * sorted[0].weight)
        };
        (0..COUNT).map(max).collect()
    }

    #[test]
    fn neighbours_decide_where_all_points_look_alike() {
        let [left, right] = lattice();
        let mut candidates = of_rows([&left, &right], alike);
        let alone = believed(&candidates);
        assert_eq!((0..COUNT).filter(|&i| alone[i].0 == i).count(), COUNT - COUNT / 3, "a third is not misled");
        assert!(alone.iter().all(|(_, clearly)| !clearly), "descriptors alone decide nothing");
        candidates.support(&left, COUNT, 12);
        let together = believed(&candidates);
        assert!((0..COUNT).all(|i| together[i] == (i, true)), "{together:?}");
    }

    #[test]
    fn where_nothing_agrees_the_descriptors_decide() {
        let [left, right] = lattice();
        // Scattered right points, so that no two displacements agree.
        let scattered: Vec<Keypoint> = right
            .iter()
            .enumerate()
            .map(|(i, point)| Keypoint { at: Pixel { u: 1e4 * i as f64, v: point.at.v }, ..*point })
            .collect();
        let mut candidates = of_rows([&left, &scattered], alike);
        let ratios = |candidates: &MatchCandidates| -> Vec<f32> {
            (0..COUNT)
                .flat_map(|i| candidates.of(i).iter().map(move |c| c.weight / candidates.of(i)[0].weight))
                .collect()
        };
        let before = ratios(&candidates);
        candidates.support(&left, COUNT, 12);
        let furthest = before.iter().zip(ratios(&candidates)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(furthest < 1e-5, "{furthest}");
    }
}
