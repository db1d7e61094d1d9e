//! Selection of pose pairs for the relative error.

use super::{
    pose::{Pose, path_lengths},
    relation::angle,
};

/// The distance between the two poses of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    /// A number of frames.
    Frames(usize),
    /// A path length (m).
    Metres(f64),
    /// An angle of rotation (rad).
    Radians(f64),
}

/// The pairs (i, j), i < j, of poses at the distance `delta`, selected as by evo.
///
/// Pairs are consecutive by default. With `all`, pairs may start at every pose: for a number of frames the pair at
/// exactly this number; for a path length the nearest pair within `tolerance` times the length; for an angle every pair
/// within `tolerance` times the angle.
pub fn pairs(poses: &[Pose], delta: Delta, all: bool, tolerance: f64) -> Vec<(usize, usize)> {
    match delta {
        Delta::Frames(step) => {
            let starts = (0..poses.len()).step_by(if all { 1 } else { step.max(1) });
            starts.map(|i| (i, i + step)).filter(|&(_, j)| j < poses.len()).collect()
        }
        Delta::Metres(length) if all => all_by_path(poses, length, tolerance * length),
        Delta::Metres(length) => consecutive_by_path(poses, length),
        Delta::Radians(turn) if all => all_by_angle(poses, turn, tolerance * turn),
        Delta::Radians(turn) => consecutive_by_angle(poses, turn),
    }
}

fn all_by_path(poses: &[Pose], length: f64, tolerance: f64) -> Vec<(usize, usize)> {
    let path = path_lengths(poses);
    let off = |i: usize, j: usize| (path[j] - path[i] - length).abs();
    (0..poses.len())
        .filter_map(|i| {
            // Path lengths never decrease: the nearest end is one of the two around the nominal length.
            let after = i + 1 + path[i + 1..].partition_point(|&end| end - path[i] < length);
            let nearest = after.saturating_sub(1).max(i + 1)..poses.len().min(after + 1);
            let mut best = nearest.min_by(|&a, &b| off(i, a).total_cmp(&off(i, b)))?;
            // At rest, the first of several equal ends.
            while best > i + 1 && off(i, best - 1) <= off(i, best) {
                best -= 1;
            }
            (off(i, best) <= tolerance).then_some((i, best))
        })
        .collect()
}

fn consecutive_by_path(poses: &[Pose], length: f64) -> Vec<(usize, usize)> {
    let mut ends = vec![0];
    let mut covered = 0.0;
    for (i, step) in poses.windows(2).enumerate() {
        covered += (step[1].position - step[0].position).norm();
        if covered >= length {
            ends.push(i + 1);
            covered = 0.0;
        }
    }
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

fn all_by_angle(poses: &[Pose], turn: f64, tolerance: f64) -> Vec<(usize, usize)> {
    let near = |i: usize, j: usize| {
        let angle = angle(&poses[i].to(&poses[j]).rotation);
        turn - tolerance <= angle && angle <= turn + tolerance
    };
    (0..poses.len()).flat_map(|i| (i + 1..poses.len()).filter(move |&j| near(i, j)).map(move |j| (i, j))).collect()
}

fn consecutive_by_angle(poses: &[Pose], turn: f64) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let (mut start, mut turned) = (0, 0.0);
    for (i, step) in poses.windows(2).enumerate() {
        turned += angle(&step[0].to(&step[1]).rotation);
        if turned >= turn {
            pairs.push((start, i + 1));
            (start, turned) = (i + 1, 0.0);
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(xs: &[f64]) -> Vec<Pose> {
        xs.iter().map(|&x| Pose { position: [x, 0.0, 0.0].into(), ..Pose::IDENTITY }).collect()
    }

    #[test]
    fn by_frames() {
        let poses = line(&[0.0; 6]);
        assert_eq!(pairs(&poses, Delta::Frames(2), false, 0.1), [(0, 2), (2, 4)]);
        assert_eq!(pairs(&poses, Delta::Frames(4), true, 0.1), [(0, 4), (1, 5)]);
        assert!(pairs(&poses, Delta::Frames(6), true, 0.1).is_empty());
        assert!(pairs(&[], Delta::Frames(1), false, 0.1).is_empty());
    }

    #[test]
    fn by_path() {
        let poses = line(&[0.0, 1.0, 2.0, 2.0, 3.0, 4.0]);
        assert_eq!(pairs(&poses, Delta::Metres(2.0), false, 0.1), [(0, 2), (2, 5)]);
        assert_eq!(pairs(&poses, Delta::Metres(2.0), true, 0.1), [(0, 2), (1, 4), (2, 5), (3, 5)]);
        assert!(pairs(&poses, Delta::Metres(0.4), true, 0.1).is_empty());
    }
}
