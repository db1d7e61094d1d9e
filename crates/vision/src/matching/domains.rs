//! The domains of a repeated pattern: which of several shifts matches the pattern as one.

use super::{
    domain_evidence::{Claims, Side, evidence},
    support::{FEW, MatchCandidates},
};
use crate::detect::Keypoint;

/// Candidates grouped into domains, and the decision between domains that claim the same key points.
///
/// A *domain* is a connected set of agreeing candidates, one-to-one: one displacement field over one surface. A repeated
/// pattern has one domain for each shift by a period. A neighbourhood inside the pattern cannot distinguish them, but
/// their borders can: of a finite pattern, a shifted domain leaves key points of both images without a partner.
///
/// Source: Marr and Poggio, *Cooperative computation of stereo disparity*, Science 1976 (domains of one disparity).
#[derive(Debug, Default)]
pub(super) struct Domains {
    /// The domain of each candidate.
    of: Vec<u32>,
    /// The members of each domain, as indices of candidates.
    members: Vec<Vec<u32>>,
}

/// The verdict on a member of a domain against other domains, from the best to the worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Uncontested,
    Clear,
    Equal,
    Lost,
}

/// No domain.
const NONE: u32 = u32::MAX;
/// The minimum agreement of neighbours in one domain.
const AGREE: f32 = 0.5;
/// The number of neighbours to which a domain grows.
const GROW: u16 = 12;
/// The number of nearest members about a member, and how many of them another domain must claim so that the member lies
/// where both compete.
const AROUND: usize = 8;
const BESIDE: usize = 2;
/// The square of the number of standard errors by which a domain must exceed another: three.
///
/// If a shift leaves n points without a partner and the other domain none, the sign test has z² = n. This limit and the
/// numbers above were tried on the chessboards of seven real rigs and on tiled planes before six simulated ones.
const DECISIVE: f32 = 9.0;

impl Domains {
    /// Finds the right key point of each left one over which domains compete, if one of them fits clearly better.
    ///
    /// The domain with the largest total preference for its candidates is examined first.
    pub(super) fn decide(
        &mut self,
        candidates: &MatchCandidates,
        views: [&[Keypoint]; 2],
        decisions: &mut Vec<Option<usize>>,
    ) {
        self.grow(candidates, views.map(<[_]>::len));
        decisions.clear();
        decisions.resize(views[0].len(), None);
        let mut matched = views.map(|view| vec![false; view.len()]);
        let mut open: Vec<usize> = (0..self.members.len()).filter(|&d| self.members[d].len() >= FEW).collect();
        while !open.is_empty() {
            let free = |c: &u32| {
                let candidate = candidates.candidate(*c);
                !matched[0][candidate.left] && !matched[1][candidate.right]
            };
            let score = |d: usize| -> f32 {
                let free = self.members[d].iter().filter(|c| free(c));
                free.map(|&c| candidates.preference_to_none(c)).sum()
            };
            let best = open.iter().enumerate().map(|(place, &d)| (score(d), place));
            let (_, best) = best.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).expect("an open domain");
            let domain = open.remove(best);
            let chosen: Vec<u32> = self.members[domain].iter().copied().filter(free).collect();
            if chosen.len() < FEW {
                continue;
            }
            let verdicts = self.contest(candidates, views, domain as u32, &chosen);
            for (&c, verdict) in chosen.iter().zip(verdicts) {
                let candidate = candidates.candidate(c);
                if verdict == Verdict::Clear {
                    decisions[candidate.left] = Some(candidate.right);
                }
                // A better domain may still claim the key points of a member that lost.
                if verdict != Verdict::Lost {
                    matched[0][candidate.left] = true;
                    matched[1][candidate.right] = true;
                }
            }
        }
    }

    /// Groups the candidates into domains, from the most certain ones outwards.
    fn grow(&mut self, candidates: &MatchCandidates, [left, right]: [usize; 2]) {
        let Self { of, members } = self;
        of.clear();
        of.resize(candidates.len(), NONE);
        members.clear();
        let (mut of_left, mut of_right) = (vec![NONE; left], vec![NONE; right]);
        let mut seeds: Vec<u32> = (0..candidates.len() as u32).collect();
        let fraction = |c: u32| candidates.candidate(c).fraction;
        seeds.sort_by(|&a, &b| fraction(b).total_cmp(&fraction(a)).then(a.cmp(&b)));
        for seed in seeds {
            let domain = members.len() as u32;
            let mut enter = |c: u32| {
                let candidate = candidates.candidate(c);
                let (left, right) = (&mut of_left[candidate.left], &mut of_right[candidate.right]);
                let free = of[c as usize] == NONE && *left != domain && *right != domain;
                if free {
                    (of[c as usize], *left, *right) = (domain, domain, domain);
                }
                free
            };
            if !enter(seed) {
                continue;
            }
            let mut grown = vec![seed];
            let mut next = 0;
            while let Some(&member) = grown.get(next) {
                next += 1;
                for same in candidates.neighbours_of(member as usize).take_while(|same| same[0].rank < GROW) {
                    let nearest = same.iter().max_by(|a, b| a.agreement.total_cmp(&b.agreement));
                    let agreeing = nearest.filter(|link| link.agreement >= AGREE);
                    grown.extend(agreeing.map(|link| link.candidate).filter(|&c| enter(c)));
                }
            }
            members.push(grown);
        }
    }

    /// Compares the chosen members of a domain with every domain that claims a left key point of them.
    ///
    /// Returns the worst verdict on each member.
    fn contest(
        &self,
        candidates: &MatchCandidates,
        views: [&[Keypoint]; 2],
        domain: u32,
        chosen: &[u32],
    ) -> Vec<Verdict> {
        let mut others: Vec<u32> = chosen
            .iter()
            .flat_map(|&c| candidates.indices_of(candidates.candidate(c).left))
            .map(|c| self.of[c])
            .filter(|&other| other != domain && self.members[other as usize].len() >= FEW)
            .collect();
        others.sort_unstable();
        others.dedup();
        let own = Claims::of(candidates, &self.members[domain as usize], views);
        let mut verdicts = vec![Verdict::Uncontested; chosen.len()];
        for other in others {
            let members = &self.members[other as usize];
            let claims = Claims::of(candidates, members, views);
            let beside: Vec<bool> = chosen.iter().map(|&c| self.beside(candidates, domain, c, &claims)).collect();
            let contested: Vec<u32> =
                chosen.iter().zip(&beside).filter(|(_, beside)| **beside).map(|(&c, _)| c).collect();
            if contested.len() < FEW {
                continue;
            }
            let theirs: Vec<u32> =
                members.iter().copied().filter(|&c| self.beside(candidates, other, c, &own)).collect();
            let sides = [Side { members: &contested, claims: &own }, Side { members: &theirs, claims: &claims }];
            let evidence = evidence(candidates, views, [&sides[0], &sides[1]]);
            let verdict = match evidence {
                _ if evidence >= DECISIVE => Verdict::Clear,
                _ if evidence <= -DECISIVE => Verdict::Lost,
                _ => Verdict::Equal,
            };
            for (worst, _) in verdicts.iter_mut().zip(beside).filter(|(_, beside)| *beside) {
                *worst = (*worst).max(verdict);
            }
        }
        verdicts
    }

    /// Whether other claims concern a member of a domain: its left key point, or those of members about it.
    fn beside(&self, candidates: &MatchCandidates, domain: u32, member: u32, others: &Claims) -> bool {
        let claimed = |c: u32| others.left(candidates.candidate(c).left).is_some();
        if claimed(member) {
            return true;
        }
        let near = candidates.neighbours_of(member as usize);
        let near = near.filter_map(|same| same.iter().find(|link| self.of[link.candidate as usize] == domain));
        near.take(AROUND).filter(|link| claimed(link.candidate)).count() >= BESIDE
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use seafix_geometry::Pixel;

    use super::*;

    const PERIOD: f64 = 20.0;

    fn points(at: impl Iterator<Item = (f64, f64)>) -> Vec<Keypoint> {
        at.map(|(u, v)| Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.0 }).collect()
    }

    /// The decisions on a lattice of alike points in six rows, seen 55 px further left in the right image.
    ///
    /// `windows` are the columns that each image shows. With `around`, both images show points far beside the lattice.
    fn decisions(
        windows: [Range<usize>; 2],
        around: bool,
        distance: impl Fn(usize, usize) -> f32,
    ) -> Vec<Option<usize>> {
        let view = |window: &Range<usize>, shift: f64| {
            let lattice = (0..6).flat_map(|row| window.clone().map(move |column| (column, row)));
            let lattice =
                lattice.map(|(column, row)| (200.0 + PERIOD * column as f64 - shift, 200.0 + PERIOD * f64::from(row)));
            let corners = [(0.0, 0.0), (1000.0, 1000.0)].into_iter().filter(|_| around);
            points(lattice.chain(corners))
        };
        let [left, right] = [view(&windows[0], 0.0), view(&windows[1], 55.0)];
        let [width, across] = windows.map(|window| window.len());
        let mut candidates = MatchCandidates::default();
        let row = |i: usize, visit: &mut dyn FnMut(usize)| {
            (0..across).filter(|_| i < 6 * width).for_each(|j| visit(i / width * across + j));
        };
        candidates.fill([&left, &right], row, distance);
        candidates.support(&left, right.len(), 30);
        let mut decisions = Vec::new();
        Domains::default().decide(&candidates, [&left, &right], &mut decisions);
        decisions.truncate(6 * width);
        decisions
    }

    /// A board that ends is matched as one although no neighbourhood inside it tells a column from the next.
    #[test]
    fn a_pattern_that_ends_is_matched_by_its_borders() {
        let all = decisions([0..8, 0..8], true, |_, _| 0.05);
        assert!(all.iter().enumerate().all(|(i, decision)| *decision == Some(i)), "{all:?}");
    }

    /// Of a pattern that both images cut off, no shift is better than another.
    #[test]
    fn a_pattern_without_end_remains_ambiguous() {
        // The true shift has partners for three of six columns, the shift that aligns both windows for all.
        let all = decisions([0..6, 3..9], false, |_, _| 0.05);
        assert!(all.iter().all(Option::is_none), "{all:?}");
    }

    /// Descriptors that together prefer one shift decide where borders do not.
    #[test]
    fn descriptors_of_the_pattern_decide_as_one() {
        let prefers = |i: usize, j: usize| if i == j { 0.3 + 0.01 * (i % 5) as f32 } else { 0.5 };
        let all = decisions([0..8, 0..8], false, prefers);
        assert!(all.iter().enumerate().all(|(i, decision)| *decision == Some(i)), "{all:?}");
    }
}
