//! Registration of one cloud to another.

use std::collections::HashMap;

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Transform, so3};

use super::{
    grid::Grid,
    settings::{Distance, Icp},
};
use crate::odometry_trajectory::Lost;

/// The gate of a partner: the 99 % quantile of χ²₃.
const GATE: f64 = 11.345;
/// Minimum ratio of the number of partners to the number at wrong positions.
///
/// The wrong positions are half the reach to each side. Even a cloud of other ground has slightly more partners at its
/// best position than elsewhere.
const BEYOND_NFA: usize = 2;
/// Factor by which the reach narrows at each level, down to the fraction `NARROWEST`.
const NARROWING: f64 = 0.5;
const NARROWEST: f64 = 0.005;
/// Convergence threshold: largest component of a step (rad, m).
const SETTLED: f64 = 1e-9;
/// Edge length of the voxels in which offsets are counted, as a fraction of the reach.
const OFFSETS: f64 = 0.1;

/// A cloud, prepared for registration.
#[derive(Debug)]
pub(super) struct Ground {
    points: Vec<Vector3<f64>>,
    /// The measurement covariance of each point.
    noise: Vec<Matrix3<f64>>,
    /// The covariance of each point along its local surface (plane-to-plane ICP).
    slip: Vec<Matrix3<f64>>,
    grid: Grid,
}

/// The pose of a cloud relative to the key frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Registered {
    pub(super) key_from_now: Transform<Camera, Camera>,
    pub(super) covariance: Covariance6<Camera, Camera>,
    /// Number of points with a partner.
    pub(super) partners: usize,
}

/// A pair of points: residual `left`, its measurement covariance and weight, in the key frame.
struct Pair {
    jacobian: Matrix3x6<f64>,
    left: Vector3<f64>,
    measured: Matrix3<f64>,
    weight: Matrix3<f64>,
    far: f64,
}

impl Pair {
    /// The squared Mahalanobis distance of the pair, by its measurement noise.
    fn apart(&self) -> f64 {
        let weight = self.measured.try_inverse();
        weight.map_or(f64::INFINITY, |weight| self.left.dot(&(weight * self.left)))
    }
}

impl Ground {
    pub(super) fn new(settings: &Icp, cloud: &[MeasuredPoint]) -> Self {
        let points: Vec<Vector3<f64>> = cloud.iter().map(|point| point.position.at.coords).collect();
        let noise = cloud.iter().map(|point| point.position.covariance).collect();
        let grid = Grid::new(points.clone(), settings.reach);
        let slip = match settings.distance {
            Distance::Plane => points.iter().map(|at| slip(at, &points, &grid, settings)).collect(),
            Distance::Point | Distance::Measured => vec![Matrix3::zeros(); points.len()],
        };
        Self { points, noise, slip, grid }
    }

    /// The number of points.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Registers the cloud `now`, from `guess`; after a failure, from the offset with the most votes.
    pub(super) fn register(
        &self,
        settings: &Icp,
        now: &Self,
        guess: &Transform<Camera, Camera>,
    ) -> Result<Registered, Lost> {
        self.from(settings, now, guess).or_else(|lost| {
            let shifted = self.offset(settings, now, guess).ok_or(lost)?;
            self.from(settings, now, &shifted)
        })
    }

    fn from(&self, settings: &Icp, now: &Self, guess: &Transform<Camera, Camera>) -> Result<Registered, Lost> {
        let mut pose = *guess;
        let mut width = 1.0;
        // At first partners may lie anywhere within reach; at last only the points' own noise counts.
        while width > NARROWEST {
            width *= NARROWING;
            pose = self.fit(settings, now, pose, settings.reach * width);
        }
        pose = self.fit(settings, now, pose, 0.0);
        self.judge(settings, now, pose)
    }

    /// Alternates between nearest points and the best pose (ICP); `width` (m) is added to the noise.
    fn fit(
        &self,
        settings: &Icp,
        now: &Self,
        mut pose: Transform<Camera, Camera>,
        width: f64,
    ) -> Transform<Camera, Camera> {
        for _ in 0..settings.iterations {
            let mut pairs = self.pairs(settings, now, &pose, width);
            pairs.sort_by(|a, b| a.far.total_cmp(&b.far));
            pairs.truncate((settings.keep * pairs.len() as f64).ceil() as usize);
            let Some(step) = solved(&pairs).map(|(step, _)| step).filter(|step| step.iter().all(|x| x.is_finite()))
            else {
                return pose;
            };
            pose = pose.perturbed(&step).renormalized();
            if step.amax() < SETTLED {
                break;
            }
        }
        pose
    }

    /// The nearest point of this cloud for each point of `now`.
    fn pairs(&self, settings: &Icp, now: &Self, pose: &Transform<Camera, Camera>, width: f64) -> Vec<Pair> {
        let (turn, move_) = (pose.rotation_matrix(), pose.translation());
        let even = self.noise.iter().chain(&now.noise).map(|noise| noise.trace() / 3.0).sum::<f64>()
            / (self.len() + now.len()).max(1) as f64;
        // Without additional width only the noise limits the distance of partners.
        let reach = if width > 0.0 { (4.0 * width).min(settings.reach) } else { settings.reach };
        let pair = |(k, at): (usize, &Vector3<f64>)| {
            let there = turn * at + move_;
            let (partner, _) = self.grid.nearest(&there, reach)?;
            let left = there - self.points[partner];
            let measured = self.noise[partner] + turn * now.noise[k] * turn.transpose();
            let spread = match settings.distance {
                Distance::Point => Matrix3::identity() * (2.0 * even),
                Distance::Measured => measured,
                Distance::Plane => measured + self.slip[partner] + turn * now.slip[k] * turn.transpose(),
            };
            let weight = (spread + Matrix3::identity() * (width * width)).try_inverse()?;
            let mut jacobian = Matrix3x6::zeros();
            jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-turn * so3::skew(at)));
            jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
            // The Mahalanobis distance: trimming keeps the nearest pairs in this metric.
            let far = left.dot(&(weight * left));
            Some(Pair { jacobian, left, measured, weight, far })
        };
        now.points.iter().enumerate().filter_map(pair).collect()
    }

    /// The registration with its covariance, if enough points confirm the pose.
    fn judge(&self, settings: &Icp, now: &Self, pose: Transform<Camera, Camera>) -> Result<Registered, Lost> {
        let pairs = self.partners(settings, now, &pose);
        let found = pairs.len();
        let smaller = self.len().min(now.len());
        let sides = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()];
        let elsewhere = sides.map(|side| {
            let shifted = Transform::new(pose.rotation(), pose.translation() + side * (0.5 * settings.reach));
            self.partners(settings, now, &shifted).len()
        });
        let at_random = elsewhere.into_iter().max().unwrap_or(0);
        let min = (settings.min_fraction * smaller as f64).ceil() as usize;
        let needed = settings.min_points.max(min).max(BEYOND_NFA * at_random);
        if found < needed {
            return Err(Lost::NoConsensus { found, matches: smaller, needed });
        }
        let Some((_, normal)) = solved(&pairs) else { return Err(Lost::Weak(f64::INFINITY)) };
        let Some(inverse) = normal.try_inverse() else { return Err(Lost::Weak(f64::INFINITY)) };
        let covariance = match settings.distance {
            // The weights differ from the inverse covariance, hence the sandwich estimate A⁻¹ (Σ Jᵀ W C W J) A⁻¹.
            Distance::Point => {
                let middle: Matrix6<f64> = pairs
                    .iter()
                    .map(|pair| {
                        let wj = pair.weight * pair.jacobian;
                        wj.transpose() * pair.measured * wj
                    })
                    .sum();
                inverse * middle * inverse
            }
            Distance::Measured | Distance::Plane => inverse,
        };
        // A χ² above its expectation inflates the covariance.
        let chi2: f64 = pairs.iter().map(Pair::apart).sum();
        let dof = (3 * found) as f64 - 6.0;
        Ok(Registered {
            key_from_now: pose,
            covariance: Covariance6::new(covariance * (chi2 / dof).max(1.0)),
            partners: found,
        })
    }

    /// The pairs whose Mahalanobis distance passes the gate.
    fn partners(&self, settings: &Icp, now: &Self, pose: &Transform<Camera, Camera>) -> Vec<Pair> {
        let mut pairs = self.pairs(settings, now, pose, 0.0);
        pairs.retain(|pair| pair.apart() <= GATE);
        pairs
    }

    /// The `guess`, moved by the offset with the most votes of point pairs within reach; `None` without a pair.
    fn offset(
        &self,
        settings: &Icp,
        now: &Self,
        guess: &Transform<Camera, Camera>,
    ) -> Option<Transform<Camera, Camera>> {
        let side = OFFSETS * settings.reach;
        let (turn, move_) = (guess.rotation_matrix(), guess.translation());
        let mut votes: HashMap<[i64; 3], (usize, Vector3<f64>)> = HashMap::new();
        for at in &now.points {
            let there = turn * at + move_;
            for (index, _) in self.grid.within(&there, settings.reach) {
                let off = self.points[index] - there;
                let vote = votes.entry([off.x, off.y, off.z].map(|x| (x / side).floor() as i64)).or_default();
                *vote = (vote.0 + 1, vote.1 + off);
            }
        }
        let (_, (count, sum)) = votes.into_iter().max_by(|a, b| a.1.0.cmp(&b.1.0).then(b.0.cmp(&a.0)))?;
        Some(Transform::new(guess.rotation(), move_ + sum / count as f64))
    }
}

/// The Gauss–Newton step ξ of all pairs, and the normal matrix Σ Jᵀ W J.
fn solved(pairs: &[Pair]) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for pair in pairs {
        let jw = pair.jacobian.transpose() * pair.weight;
        normal += jw * pair.jacobian;
        right -= jw * pair.left;
    }
    Some((normal.cholesky()?.solve(&right), normal))
}

/// The covariance of a point along its local surface.
///
/// Its standard deviation is the mean distance of the neighbours, in the plane of their scatter; there is none along
/// the normal.
fn slip(at: &Vector3<f64>, points: &[Vector3<f64>], grid: &Grid, settings: &Icp) -> Matrix3<f64> {
    let mut near: Vec<(usize, f64)> = grid.within(at, settings.reach).collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    near.truncate(settings.neighbours + 1);
    if near.len() < 4 {
        return Matrix3::zeros();
    }
    let n = near.len() as f64;
    let mean = near.iter().map(|(k, _)| points[*k]).sum::<Vector3<f64>>() / n;
    let scatter: Matrix3<f64> = near.iter().map(|(k, _)| (points[*k] - mean) * (points[*k] - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let spacing = near.iter().map(|(_, far)| far).sum::<f64>() / (n - 1.0);
    (Matrix3::identity() - normal * normal.transpose()) * spacing
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use seafix_component::Component;
    use seafix_geometry::{Point, UncertainPoint};

    use super::*;

    const SIGMA: f64 = 0.002;

    /// A deterministic pseudo-random number, uniform between −½ and ½.
    fn noise(seed: u64) -> f64 {
        let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }

    /// A cloud of a wavy ground, seen after `now_from_key`, with noise of `SIGMA`; `keep` selects its points.
    fn cloud(pose: &Transform<Camera, Camera>, seed: u64, keep: impl Fn(usize) -> bool) -> Vec<MeasuredPoint> {
        let ground = (0..300_usize).filter(|k| keep(*k)).map(|k| {
            let id = k as u64;
            let (x, y) = (3.0 * noise(3 * id), 2.0 * noise(3 * id + 1));
            let at = Point3::new(x, y, 2.5 + 0.2 * libm::sin(3.0 * x) + 0.1 * libm::cos(4.0 * y));
            let jitter = |axis| SIGMA * 12.0_f64.sqrt() * noise(seed * 10_000 + 3 * id + axis);
            let at = *pose * Point::from(at.coords);
            let at = Point::from(at.coords + Vector3::new(jitter(0), jitter(1), jitter(2)));
            MeasuredPoint { position: UncertainPoint::isotropic(at, SIGMA), pixels: None }
        });
        ground.collect()
    }

    /// Every distance measure registers two views that share three quarters of their points, with a consistent
    /// covariance.
    #[test]
    fn clouds_fall_into_place() {
        let truth = Transform::exp(&Vector6::new(0.01, -0.02, 0.03, 0.12, -0.05, 0.02));
        for distance in [Distance::Point, Distance::Measured, Distance::Plane] {
            let settings = Icp { distance, ..Icp::default() };
            assert_eq!(settings.check(), Ok(()));
            let key = Ground::new(&settings, &cloud(&Transform::identity(), 1, |k| k % 8 != 0));
            let now = Ground::new(&settings, &cloud(&truth.inverse(), 2, |k| k % 8 != 3));
            let registered = key.register(&settings, &now, &Transform::identity()).unwrap();
            let error = registered.key_from_now.error_to(&truth);
            // Point-to-plane registration is less accurate along the surface.
            let max = if distance == Distance::Plane { 1e-2 } else { 2e-3 };
            assert!(error.amax() < max, "{distance:?}: {error:?}");
            let nees = error.dot(&(registered.covariance.matrix.try_inverse().unwrap() * error));
            // The quantile of χ²₆ at 1 − 1e-5.
            assert!(nees < 34.9, "{distance:?}: {nees}");
            assert!(registered.partners > 200, "{distance:?}: {}", registered.partners);
        }
    }

    /// A cloud of other ground is rejected for every distance measure.
    #[test]
    fn other_ground_is_rejected() {
        for distance in [Distance::Point, Distance::Measured, Distance::Plane] {
            let settings = Icp { distance, ..Icp::default() };
            let key = Ground::new(&settings, &cloud(&Transform::identity(), 1, |_| true));
            let turned = Transform::exp(&Vector6::new(0.0, 0.0, std::f64::consts::PI, 0.3, 0.2, 0.0));
            let now = Ground::new(&settings, &cloud(&turned, 2, |_| true));
            let lost = key.register(&settings, &now, &Transform::identity());
            assert!(matches!(lost, Err(Lost::NoConsensus { .. } | Lost::Weak(_))), "{distance:?}: {lost:?}");
        }
    }
}
