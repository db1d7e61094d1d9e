//! One cloud laid over another.

use std::collections::HashMap;

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Transform, so3};

use super::{Distance, Icp, grid::Grid};
use crate::Lost;

/// χ²₃ at 99 %: partners.
const GATE: f64 = 11.345;
/// So many times more partners than the same cloud has elsewhere, where it has them by chance: away by half the reach to each side.
/// The best place of a cloud that does not belong there has some more than any place.
const BEYOND_NFA: usize = 2;
/// The reach narrows by this factor from step to step, down to its share `NARROWEST`.
const NARROWING: f64 = 0.5;
const NARROWEST: f64 = 0.005;
/// A step that is shorter ends the iterations (rad, m).
const SETTLED: f64 = 1e-9;
/// Cubes in which offsets are counted, as a share of the reach.
const OFFSETS: f64 = 0.1;

/// A cloud, ready to be laid upon.
#[derive(Debug)]
pub(super) struct Ground {
    points: Vec<Vector3<f64>>,
    /// The noise that each was measured with.
    noise: Vec<Matrix3<f64>>,
    /// How far each may slip along its surface.
    slip: Vec<Matrix3<f64>>,
    grid: Grid,
}

/// Where a cloud lies on another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Registered {
    pub(super) key_from_now: Transform<Camera, Camera>,
    pub(super) covariance: Covariance6<Camera, Camera>,
    /// Points with a partner.
    pub(super) partners: usize,
}

/// A pair of points: what is left between them, and the noise of that in the key frame.
struct Pair {
    jacobian: Matrix3x6<f64>,
    left: Vector3<f64>,
    measured: Matrix3<f64>,
    weight: Matrix3<f64>,
    far: f64,
}

impl Pair {
    /// Their distance squared in the noise they were measured with.
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

    /// How many points it has.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Lays `now` upon it, from `guess` on and, where that leads nowhere, from the offset that most pairs of points have.
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
        // So wide that the first partners may be anywhere in reach; in the end the points' own noise alone.
        while width > NARROWEST {
            width *= NARROWING;
            pose = self.fit(settings, now, pose, settings.reach * width);
        }
        pose = self.fit(settings, now, pose, 0.0);
        self.judge(settings, now, pose)
    }

    /// Nearest points and their best pose in turn; `width` is added to the noise (m).
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

    /// Each point of `now` with its nearest one here.
    fn pairs(&self, settings: &Icp, now: &Self, pose: &Transform<Camera, Camera>, width: f64) -> Vec<Pair> {
        let (turn, move_) = (pose.rotation_matrix(), pose.translation());
        let even = self.noise.iter().chain(&now.noise).map(|noise| noise.trace() / 3.0).sum::<f64>()
            / (self.len() + now.len()).max(1) as f64;
        // With the noise alone partners are as near as noise lets them be.
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
            // Of pairs within their noise all count alike; of those beyond it the nearest are kept.
            let far = left.dot(&(weight * left));
            Some(Pair { jacobian, left, measured, weight, far })
        };
        now.points.iter().enumerate().filter_map(pair).collect()
    }

    /// Whether the points say that they lie so, and how well that is known.
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
            // The fit does not weigh as the noise is: A⁻¹ (Σ Jᵀ W C W J) A⁻¹.
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
        // Partners that fit worse than their noise know less.
        let chi2: f64 = pairs.iter().map(Pair::apart).sum();
        let dof = (3 * found) as f64 - 6.0;
        Ok(Registered {
            key_from_now: pose,
            covariance: Covariance6::new(covariance * (chi2 / dof).max(1.0)),
            partners: found,
        })
    }

    /// The pairs that are as near as their noise lets them be.
    fn partners(&self, settings: &Icp, now: &Self, pose: &Transform<Camera, Camera>) -> Vec<Pair> {
        let mut pairs = self.pairs(settings, now, pose, 0.0);
        pairs.retain(|pair| pair.apart() <= GATE);
        pairs
    }

    /// `guess` moved by the offset that most pairs of points within reach agree on; `None` where there are none.
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

/// The step ξ that is best for all pairs, and the normal matrix Σ Jᵀ W J.
fn solved(pairs: &[Pair]) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for pair in pairs {
        let jw = pair.jacobian.transpose() * pair.weight;
        normal += jw * pair.jacobian;
        right -= jw * pair.left;
    }
    Some((normal.cholesky()?.solve(&right), normal))
}

/// How far a point may slip along the surface of its neighbours: by their mean distance, in all directions of the plane of
/// their scatter, not along its normal.
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

    /// Numbers that look random: evenly between −½ and ½.
    fn noise(seed: u64) -> f64 {
        let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }

    /// Points on a wavy ground, seen after `now_from_key`, with noise of `SIGMA`; those that `keep` says.
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

    /// Every distance finds the motion between two views that share three quarters of their points, within what it claims.
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
            // Planes that slip tell less than points that do not.
            let max = if distance == Distance::Plane { 1e-2 } else { 2e-3 };
            assert!(error.amax() < max, "{distance:?}: {error:?}");
            let nees = error.dot(&(registered.covariance.matrix.try_inverse().unwrap() * error));
            // χ²₆ at 1 − 1e-5.
            assert!(nees < 34.9, "{distance:?}: {nees}");
            assert!(registered.partners > 200, "{distance:?}: {}", registered.partners);
        }
    }

    /// Other ground is not taken for this one, whatever makes points near.
    #[test]
    fn other_ground_is_refused() {
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
