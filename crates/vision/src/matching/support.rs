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
