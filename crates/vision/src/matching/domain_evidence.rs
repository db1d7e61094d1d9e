//! The evidence for one domain of matches against another that claims the same key points.

use super::support::{FEW, MatchCandidates, NEAREST};
use crate::detect::Keypoint;

/// The key points that a domain claims.
pub(super) struct Claims {
    /// The member at each left and at each right key point.
    at: [Vec<Option<u32>>; 2],
}

impl Claims {
    pub(super) fn of(candidates: &MatchCandidates, members: &[u32], views: [&[Keypoint]; 2]) -> Self {
        let mut at = views.map(|view| vec![None; view.len()]);
        for &c in members {
            let candidate = candidates.candidate(c);
            at[0][candidate.left] = Some(c);
            at[1][candidate.right] = Some(c);
        }
        Self { at }
    }

    /// The member at a left key point.
    pub(super) fn left(&self, point: usize) -> Option<u32> {
        self.at[0][point]
    }
}

/// A domain where it competes with another.
pub(super) struct Side<'a> {
    /// The members where both compete.
    pub(super) members: &'a [u32],
    /// The key points of all its members.
    pub(super) claims: &'a Claims,
}

/// The evidence for contested members of one domain against those of another: z² of two comparisons, with their signs.
///
/// - *Partners*: key points of either image that only one of both domains matches, although the other predicts their
///   partner inside the other image. With a and b of them z = (a − b)/√(a + b), the sign test.
/// - *Descriptors*: the mean over the left key points that both match of the logarithm of the ratio of squared
///   distances, in standard errors. They are halved, because the windows of neighbours overlap.
pub(super) fn evidence(candidates: &MatchCandidates, views: [&[Keypoint]; 2], [own, other]: [&Side<'_>; 2]) -> f32 {
    let extents = views.map(Extent::of);
    // The key points of a domain's members that the other domain does not claim.
    let alone = |side: &Side<'_>, other: &Side<'_>| -> usize {
        let of_view = (0..2).map(|view| {
            let points = side.members.iter().map(|&c| candidates.candidate(c).of_side(view));
            let alone = points.filter(|&point| other.claims.at[view][point].is_none());
            let seen = alone.filter(|&point| {
                let partner = expected_partner(candidates, other.members, views[view], view, point);
                partner.is_some_and(|at| extents[1 - view].contains(at))
            });
            seen.count()
        });
        of_view.sum()
    };
    let (a, b) = (alone(own, other) as f32, alone(other, own) as f32);
    let partners = signed_square(a - b) / (a + b).max(1.0);
    let squared = |c: u32| candidates.candidate(c).squared.max(NEAREST);
    let preferences = own.members.iter().filter_map(|&c| {
        let alternative = other.claims.left(candidates.candidate(c).left)?;
        Some(libm::logf(squared(alternative) / squared(c)))
    });
    let preferences: Vec<f32> = preferences.collect();
    partners + squared_errors(&preferences) / 4.0
}

/// The square of the mean in standard errors, with its sign; zero for few values.
fn squared_errors(values: &[f32]) -> f32 {
    if values.len() < FEW {
        return 0.0;
    }
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f32>() / (n - 1.0);
    match mean == 0.0 {
        true => 0.0,
        false => signed_square(mean) * n / variance.max(f32::MIN_POSITIVE),
    }
}

fn signed_square(x: f32) -> f32 {
    x * x.abs()
}

/// The place in the other image of the partner of a key point, by the displacement of the nearest member of a domain.
fn expected_partner(
    candidates: &MatchCandidates,
    domain: &[u32],
    view: &[Keypoint],
    side: usize,
    point: usize,
) -> Option<[f64; 2]> {
    let at = view[point].at;
    let distance = |c: u32| view[candidates.candidate(c).of_side(side)].at.distance(&at);
    let nearest = domain.iter().map(|&c| (distance(c), c)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    let [u, v] = candidates.candidate(nearest).displacement.map(f64::from);
    let sign = if side == 0 { 1.0 } else { -1.0 };
    Some([at.u + sign * u, at.v + sign * v])
}

/// The rectangle about a view's key points, beyond which the detector finds none.
struct Extent {
    min: [f64; 2],
    max: [f64; 2],
}

impl Extent {
    fn of(points: &[Keypoint]) -> Self {
        let start = Self { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] };
        points.iter().fold(start, |extent, point| Self {
            min: [extent.min[0].min(point.at.u), extent.min[1].min(point.at.v)],
            max: [extent.max[0].max(point.at.u), extent.max[1].max(point.at.v)],
        })
    }

    fn contains(&self, at: [f64; 2]) -> bool {
        (0..2).all(|axis| (self.min[axis]..=self.max[axis]).contains(&at[axis]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: the values 1, 2, 3, 6 have the mean 3 and the variance 14/3, so z² = 9·4/(14/3) = 54/7.
    #[test]
    fn squared_errors_are_those_of_the_mean() {
        assert!((squared_errors(&[1.0, 2.0, 3.0, 6.0]) - 54.0 / 7.0).abs() < 1e-5);
        assert!((squared_errors(&[-1.0, -2.0, -3.0, -6.0]) + 54.0 / 7.0).abs() < 1e-5);
        assert_eq!(squared_errors(&[1.0, 2.0, 3.0]), 0.0);
        assert_eq!(squared_errors(&[0.0; 8]), 0.0);
    }
}
