//! Support of a pair by the pairs around it.

use seafix_geometry::Pixel;

use crate::Keypoint;

/// A right key point that a left one may be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    /// Index among the right key points.
    pub(super) right: usize,
    /// Squared distance of the descriptors.
    pub(super) squared: f32,
    /// The belief in it: inverse squared distance times all support.
    pub(super) weight: f32,
    /// The weight as a share of all candidates' weights at either key point of the pair.
    share: f32,
}

/// The candidates of every left key point, the nearest descriptors first.
#[derive(Debug)]
pub(super) struct Candidates {
    of_left: Vec<Vec<Candidate>>,
}

/// No left key point has more candidates than this.
const MOST: usize = 8;
/// No candidate's descriptor is further than this many times the nearest one's.
const FURTHEST: f32 = 2.0;
/// Rounds of mutual support.
const ROUNDS: usize = 10;
/// Greatest gradient of the displacement that still gives support: a surface seen at a grazing angle.
const GRADIENT: f64 = 0.3;
/// What detectors may err (px).
const SLACK: f64 = 1.0;
/// The support that every pair has.
const FLOOR: f32 = 0.05;

impl Candidates {
    /// From all allowed pairs of `n` left key points: (left, right, squared distance).
    pub(super) fn new(n: usize, pairs: impl Iterator<Item = (usize, usize, f32)>) -> Self {
        let mut of_left = vec![Vec::new(); n];
        for (left, right, squared) in pairs {
            of_left[left].push(Candidate { right, squared, weight: 1.0 / squared.max(1e-6), share: 0.0 });
        }
        for candidates in &mut of_left {
            candidates.sort_by(|a, b| a.squared.total_cmp(&b.squared)); // stable: of equals the first stays first
            candidates.truncate(MOST);
            let nearest = candidates.first().map_or(0.0, |c| c.squared);
            candidates.retain(|c| c.squared <= FURTHEST * FURTHEST * nearest.max(1e-6));
        }
        Self { of_left }
    }

    /// The candidates of left key point `i`.
    pub(super) fn of(&self, i: usize) -> &[Candidate] {
        &self.of_left[i]
    }

    /// Shifts belief to the candidates that agree with those of the `neighbours` nearest left key points.
    ///
    /// Pairs (i, j) and (i', j') agree by c = 1 − |δ| / (1 px + 0.3 |x_i − x_i'|), if positive, where
    /// δ = (x_j − x_i) − (x_j' − x_i') is the difference of their displacements. Each round multiplies
    /// the weight w_ij by its support, the mean over i' of the greatest p_i'j' c over j', where
    /// p_ij = w_ij / (Σ_k w_ik + Σ_k w_kj − w_ij) is the pair's share. Where nothing supports anything
    /// the weights keep their ratios, those of the plain ratio test.
    ///
    /// Source: Barnard and Thompson, *Disparity analysis of images*, PAMI 1980; Pollard, Mayhew and
    /// Frisby, *PMF: a stereo correspondence algorithm using a disparity gradient limit*, 1985.
    pub(super) fn support(&mut self, left: &[Keypoint], right: &[Keypoint], neighbours: usize) {
        let links = self.links(left, right, neighbours);
        for _ in 0..ROUNDS {
            self.share(right.len());
            let before = self.of_left.clone();
            for (candidates, links) in self.of_left.iter_mut().zip(&links) {
                for (candidate, links) in candidates.iter_mut().zip(links) {
                    let share = |link: &Link| before[link.left][link.candidate].share * link.agreement;
                    let greatest = |same: &[Link]| same.iter().map(share).fold(0.0, f32::max);
                    let sum: f32 = links.chunk_by(|a, b| a.left == b.left).map(greatest).sum();
                    candidate.weight *= FLOOR + sum / neighbours as f32;
                }
            }
        }
    }

    /// The shares that belong to the weights.
    fn share(&mut self, right: usize) {
        let mut columns = vec![0.0; right];
        self.of_left.iter().flatten().for_each(|c| columns[c.right] += c.weight);
        for candidates in &mut self.of_left {
            let row: f32 = candidates.iter().map(|c| c.weight).sum();
            candidates.iter_mut().for_each(|c| c.share = c.weight / (row + columns[c.right] - c.weight));
        }
    }

    /// What agrees with each candidate of each left key point, neighbour by neighbour.
    fn links(&self, left: &[Keypoint], right: &[Keypoint], neighbours: usize) -> Vec<Vec<Vec<Link>>> {
        let occupied: Vec<usize> = (0..left.len()).filter(|&i| !self.of_left[i].is_empty()).collect();
        let mut near: Vec<(f64, usize)> = Vec::with_capacity(occupied.len());
        let mut all = Vec::with_capacity(left.len());
        for (i, candidates) in self.of_left.iter().enumerate() {
            let mut links = vec![Vec::new(); candidates.len()];
            if !candidates.is_empty() {
                let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
                near.clear();
                near.extend(occupied.iter().filter(|&&k| k != i).map(|&k| (squared(&left[i].at, &left[k].at), k)));
                if near.len() > neighbours {
                    near.select_nth_unstable_by(neighbours, order);
                    near.truncate(neighbours);
                }
                near.sort_unstable_by(order);
                for &(apart, k) in &near {
                    let tolerance = SLACK + GRADIENT * apart.sqrt();
                    let base = (left[k].at.u - left[i].at.u, left[k].at.v - left[i].at.v);
                    for (candidate, found) in candidates.iter().zip(&mut links) {
                        let here = &right[candidate.right].at;
                        let expected = Pixel { u: here.u + base.0, v: here.v + base.1 };
                        for (index, other) in self.of_left[k].iter().enumerate() {
                            let off = squared(&expected, &right[other.right].at);
                            if other.right != candidate.right && off < tolerance * tolerance {
                                let agreement = (1.0 - off.sqrt() / tolerance) as f32;
                                found.push(Link { left: k, candidate: index, agreement });
                            }
                        }
                    }
                }
            }
            all.push(links);
        }
        all
    }
}

/// An agreeing candidate of another left key point.
#[derive(Debug, Clone, Copy)]
struct Link {
    left: usize,
    candidate: usize,
    agreement: f32,
}

fn squared(a: &Pixel, b: &Pixel) -> f64 {
    let (u, v) = (a.u - b.u, a.v - b.v);
    u * u + v * v
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: usize = 8;
    const ROWS: usize = 6;
    const COUNT: usize = COLUMNS * ROWS;

    /// A lattice of 25 px seen by both cameras, 60 px further left in the right image, where it is also
    /// slanted: 2 % narrower.
    fn lattice() -> [Vec<Keypoint>; 2] {
        let at = |u: f64, v: f64| Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.0 };
        let place = |i: usize| (100.0 + 25.0 * (i % COLUMNS) as f64, 100.0 + 25.0 * (i / COLUMNS) as f64);
        let left = (0..COUNT).map(|i| at(place(i).0, place(i).1));
        let right = (0..COUNT).map(|i| at(0.98 * place(i).0 - 60.0, place(i).1));
        [left.collect(), right.collect()]
    }

    /// Left point `i` may be every right point of its row, and all look alike: every third is a
    /// little more like its neighbour than like itself, the others the other way round.
    fn alike() -> impl Iterator<Item = (usize, usize, f32)> {
        let pairs = (0..COUNT).flat_map(|i| (0..COLUMNS).map(move |column| (i, i / COLUMNS * COLUMNS + column)));
        pairs.map(|(i, j)| {
            let itself = i == j;
            let misled = i % 3 == 0;
            (i, j, if itself == misled { 0.05 } else { 0.04 })
        })
    }

    /// The right point that each left one believes in most, and whether clearly: the second has less than
    /// half the belief.
    fn believed(candidates: &Candidates) -> Vec<(usize, bool)> {
        let most = |i: usize| {
            let mut sorted = candidates.of(i).to_vec();
            sorted.sort_by(|a, b| b.weight.total_cmp(&a.weight));
            (sorted[0].right, sorted[1].weight < 0.5 * sorted[0].weight)
        };
        (0..COUNT).map(most).collect()
    }

    #[test]
    fn neighbours_decide_where_all_points_look_alike() {
        let [left, right] = lattice();
        let mut candidates = Candidates::new(COUNT, alike());
        let alone = believed(&candidates);
        assert_eq!((0..COUNT).filter(|&i| alone[i].0 == i).count(), COUNT - COUNT / 3, "a third is misled");
        assert!(alone.iter().all(|(_, clearly)| !clearly), "and nothing is clear");
        candidates.support(&left, &right, 12);
        let together = believed(&candidates);
        assert!((0..COUNT).all(|i| together[i] == (i, true)), "{together:?}");
    }

    #[test]
    fn where_nothing_agrees_the_descriptors_decide() {
        let [left, right] = lattice();
        // The right points lie far from each other: no two displacements are alike.
        let scattered: Vec<Keypoint> = right
            .iter()
            .enumerate()
            .map(|(i, point)| Keypoint { at: Pixel { u: 1e4 * i as f64, v: point.at.v }, ..*point })
            .collect();
        let mut candidates = Candidates::new(COUNT, alike());
        let ratios = |candidates: &Candidates| -> Vec<f32> {
            (0..COUNT)
                .flat_map(|i| candidates.of(i).iter().map(move |c| c.weight / candidates.of(i)[0].weight))
                .collect()
        };
        let before = ratios(&candidates);
        candidates.support(&left, &scattered, 12);
        let furthest = before.iter().zip(ratios(&candidates)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(furthest < 1e-5, "{furthest}");
    }
}
