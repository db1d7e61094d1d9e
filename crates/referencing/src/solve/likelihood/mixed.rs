//! The likelihood of points and edges together, with the errors of shared model places.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Matrix4, Matrix6, SMatrix, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use super::{
    descent::{Linearized, NEAR, moved},
    edge_rows::EdgeRows,
    initial_poses::STARTS,
    pixel_terms::PIXEL_FLOOR,
    stereo_cameras::StereoCameras,
};
use crate::{
    edge_candidates::OVERLAP,
    observations::{EdgeObservation, Observations},
    solve::{
        closed_form::fit,
        degeneracy::{Degenerate, converged, wide_enough},
        line_frames::poses,
    },
    space_line::SpaceLine,
};

type Rows6 = SMatrix<f64, 4, 6>;

/// The whitened residuals of one feature and their derivatives.
///
/// r ≈ r₀ − `pose` ξ − `model` (ε₁, ε₂), with the step ξ of the pose and the errors ε (m) of the feature's model places.
struct Block {
    residual: Vector4<f64>,
    pose: Rows6,
    model: Rows6,
    /// The index of each model place; `None` if its error is zero.
    places: [Option<usize>; 2],
}

/// Points and edges of one problem.
///
/// A point has the four pixel residuals (or three coordinates), an edge four offsets. Features that name one model place
/// share its error ε ~ N(0, σ²), which is estimated with the pose and eliminated (Schur complement). Places with equal
/// coordinates are one place.
pub(crate) struct Mixed<'a> {
    data: &'a Observations<'a>,
    cameras: Option<StereoCameras<'a>>,
    edges: Vec<EdgeRows<'a>>,
    /// The inverse Cholesky factor of each feature's noise.
    whitening: Vec<Matrix4<f64>>,
    places: Vec<[Option<usize>; 2]>,
    /// The standard deviation (m) of each model place.
    sigmas: Vec<f64>,
    /// The number of features that name each model place.
    names: Vec<f64>,
}

impl<'a> Mixed<'a> {
    /// The features; points are compared by their pixels if a rig is given, by their coordinates otherwise.
    ///
    /// `rig_of_edges` is the rig for the pixels of edges.
    ///
    /// # Errors
    ///
    /// Too few features, numbers that are not finite, or invalid noise.
    pub(crate) fn of(
        data: &'a Observations<'a>,
        rig: Option<&'a StereoRig>,
        rig_of_edges: Option<&'a StereoRig>,
    ) -> Result<Self, Degenerate> {
        let (points, edges) = (data.points.len(), data.edges.len());
        if 2 * points + 3 * edges < MIN_FEATURE_VALUE {
            return Err(Degenerate::TooFew { found: points + edges, needed: 3 });
        }
        let finite =
            data.points.iter().all(|point| point.is_finite()) && data.edges.iter().all(|edge| edge.is_finite());
        if !finite {
            return Err(Degenerate::NotFinite);
        }
        let mut all = Self {
            data,
            cameras: rig.map(StereoCameras::of),
            edges: Vec::with_capacity(edges),
            whitening: Vec::with_capacity(points + edges),
            places: Vec::with_capacity(points + edges),
            sigmas: Vec::new(),
            names: Vec::new(),
        };
        let mut known: Vec<Vector3<f64>> = Vec::new();
        for (index, point) in data.points.iter().enumerate() {
            let noise = match (&point.pixels, rig) {
                (Some(pixels), Some(_)) => pixels.covariance + Matrix4::identity() * (PIXEL_FLOOR * PIXEL_FLOOR),
                _ => {
                    let digits = point.digits();
                    let mut noise = Matrix4::identity();
                    let own = point.measured.covariance + Matrix3::identity() * (digits * digits);
                    noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&own);
                    noise
                }
            };
            all.whitening.push(inverse_root(&noise).ok_or(Degenerate::Noise { index })?);
            let place = all.place(&mut known, point.model.coords, point.model_sigma);
            all.places.push([place, None]);
        }
        for (index, edge) in data.edges.iter().enumerate() {
            let index = points + index;
            let rows = EdgeRows::of(edge, rig_of_edges).ok_or(Degenerate::Noise { index })?;
            all.whitening.push(inverse_root(&rows.noise).ok_or(Degenerate::Noise { index })?);
            all.edges.push(rows);
            let places = [0, 1].map(|k| all.place(&mut known, edge.model[k].coords, edge.model_sigmas[k]));
            all.places.push(places);
        }
        Ok(all)
    }

    /// The index of a model place; `None` without an error.
    fn place(&mut self, known: &mut Vec<Vector3<f64>>, at: Vector3<f64>, sigma: f64) -> Option<usize> {
        if !(sigma > 0.0) {
            return None;
        }
        let found = known.iter().position(|other| *other == at).unwrap_or_else(|| {
            known.push(at);
            self.sigmas.push(sigma);
            self.names.push(0.0);
            known.len() - 1
        });
        self.names[found] += 1.0;
        Some(found)
    }

    /// The whitened residuals of a feature: the points first, then the edges.
    fn block(&self, index: usize, pose: &Transform<Object, Camera>) -> Result<Block, Degenerate> {
        let (r, t) = (pose.rotation_matrix(), pose.translation());
        let into = |p: &Vector3<f64>| -> Vector3<f64> { r.tr_mul(&(p - t)) };
        let (mut residual, mut of_pose, mut of_model) = (Vector4::zeros(), Rows6::zeros(), Rows6::zeros());
        let mut row = |k: usize, at: &Vector3<f64>, gradient: &Vector3<f64>, left: f64, weights: [f64; 2]| {
            residual[k] = left;
            // The place p moves by p × φ − ρ with the pose, and by Rᵀε with the model.
            let turn = gradient.cross(at);
            let by_model = r * gradient;
            for axis in 0..3 {
                of_pose[(k, axis)] = turn[axis];
                of_pose[(k, 3 + axis)] = -gradient[axis];
                of_model[(k, axis)] = weights[0] * by_model[axis];
                of_model[(k, 3 + axis)] = weights[1] * by_model[axis];
            }
        };
        if let Some(point) = self.data.points.get(index) {
            let at = into(&point.model.coords);
            match (&point.pixels, &self.cameras) {
                (Some(pixels), Some(cameras)) => {
                    let (seen, j) = cameras.project(&at).ok_or(Degenerate::Hidden { index, depth: at.z })?;
                    let off = pixels.at.coordinates() - seen;
                    for k in 0..4 {
                        row(k, &at, &j.row(k).transpose(), off[k], [1.0, 0.0]);
                    }
                }
                _ => {
                    let off = point.measured.at.coords - at;
                    for k in 0..3 {
                        row(k, &at, &Vector3::ith(k, 1.0), off[k], [1.0, 0.0]);
                    }
                }
            }
        } else {
            let number = index - self.data.points.len();
            let [from, to] = self.data.edges[number].model.map(|end| into(&end.coords));
            let rows = self.edges[number].rows(&from, &to);
            for (k, one) in rows.ok_or(Degenerate::Hidden { index, depth: from.z.min(to.z) })?.iter().enumerate() {
                row(k, &one.at, &one.gradient, one.residual, [1.0 - one.along, one.along]);
            }
        }
        let w = &self.whitening[index];
        Ok(Block { residual: w * residual, pose: w * of_pose, model: w * of_model, places: self.places[index] })
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// The normal equations of one feature, its model errors marginalised.
    ///
    /// A place that n features name has n times its variance in each of them, so that their sum has its variance again.
    pub(crate) fn one(&self, index: usize, pose: &Transform<Object, Camera>) -> Result<Linearized, Degenerate> {
        let block = self.block(index, pose)?;
        let mut noise = Matrix4::identity();
        for (end, place) in block.places.iter().enumerate() {
            if let Some(place) = place {
                let of = block.model.fixed_columns::<3>(3 * end);
                noise += of * of.transpose() * (self.names[*place] * self.sigmas[*place].powi(2));
            }
        }
        let root = noise.cholesky().ok_or(Degenerate::Noise { index })?;
        let (pull, weighted) = (root.solve(&block.residual), root.solve(&block.pose));
        let normal: Matrix6<f64> = block.pose.tr_mul(&weighted);
        let gradient: Vector6<f64> = block.pose.tr_mul(&pull);
        Ok(Linearized::from_parts(&normal, gradient, block.residual.dot(&pull)))
    }

    /// The normal equations of each feature.
    pub(crate) fn each(&self, pose: &Transform<Object, Camera>) -> Result<Vec<Linearized>, Degenerate> {
        (0..self.count()).map(|index| self.one(index, pose)).collect()
    }

    /// The normal equations of all features as if their model errors were independent.
    pub(crate) fn independent(&self, pose: &Transform<Object, Camera>) -> Result<Linearized, Degenerate> {
        let zero = Linearized::from_parts(&Matrix6::zeros(), Vector6::zeros(), 0.0);
        (0..self.count()).try_fold(zero, |sum, index| Ok(sum.plus(&self.one(index, pose)?)))
    }

    /// The normal equations of all features with shared model errors.
    pub(crate) fn shared(&self, pose: &Transform<Object, Camera>) -> Result<Linearized, Degenerate> {
        Ok(self.system(pose)?.linearized())
    }

    fn system(&self, pose: &Transform<Object, Camera>) -> Result<System, Degenerate> {
        let size = 3 * self.sigmas.len();
        let mut system = System {
            normal: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            cost: 0.0,
            mixed: DMatrix::zeros(size, 6),
            pull: DVector::zeros(size),
            root: None,
        };
        let mut own = DMatrix::zeros(size, size);
        for (place, sigma) in self.sigmas.iter().enumerate() {
            (0..3).for_each(|axis| own[(3 * place + axis, 3 * place + axis)] = 1.0 / (sigma * sigma));
        }
        for index in 0..self.count() {
            let block = self.block(index, pose)?;
            system.normal += block.pose.tr_mul(&block.pose);
            system.gradient += block.pose.tr_mul(&block.residual);
            system.cost += block.residual.norm_squared();
            let ends = block.places.iter().enumerate().filter_map(|(end, place)| Some((end, (*place)?)));
            for (end, place) in ends.clone() {
                let of = block.model.fixed_columns::<3>(3 * end);
                let mut rows = system.mixed.fixed_view_mut::<3, 6>(3 * place, 0);
                rows += of.tr_mul(&block.pose);
                let mut rows = system.pull.fixed_rows_mut::<3>(3 * place);
                rows += of.tr_mul(&block.residual);
                for (other, beside) in ends.clone() {
                    let mut square = own.fixed_view_mut::<3, 3>(3 * place, 3 * beside);
                    square += of.tr_mul(&block.model.fixed_columns::<3>(3 * other));
                }
            }
        }
        if size > 0 {
            system.root = Some(own.cholesky().ok_or(Degenerate::NotFinite)?);
        }
        Ok(system)
    }

    /// The pose error for one standard deviation of each coordinate of the model place of each point.
    pub(crate) fn model_errors(&self, pose: &Transform<Object, Camera>) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        let system = self.system(pose)?;
        let covariance = system.linearized().covariance()?;
        let Some(root) = &system.root else { return Ok(vec![SMatrix::zeros(); self.data.points.len()]) };
        let influence = root.solve(&system.mixed);
        Ok((0..self.data.points.len())
            .map(|index| match self.places[index][0] {
                None => SMatrix::zeros(),
                Some(place) => {
                    let rows = influence.fixed_view::<3, 6>(3 * place, 0);
                    -covariance * rows.transpose() / self.sigmas[place]
                }
            })
            .collect())
    }

    /// The minimum near `start` without shared errors, by damped steps.
    ///
    /// # Errors
    ///
    /// A pose that hides a feature, or an undetermined motion.
    pub(crate) fn independent_minimum(
        &self,
        start: &Transform<Object, Camera>,
        near: f64,
    ) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
        let (mut pose, mut here, mut damping) = (*start, self.independent(start)?, 0.0);
        for _ in 0..MAX_STEPS {
            let (step, decrement) = here.determined(damping)?;
            if damping == 0.0 && decrement <= near {
                break;
            }
            let next = moved(&pose, &step);
            match self.independent(&next).ok().filter(|next| next.cost < here.cost) {
                Some(better) => {
                    (pose, here) = (next, better);
                    damping = if damping > 1e-5 { damping * 0.1 } else { 0.0 };
                }
                None if damping > 1e8 => break,
                None => damping = f64::max(1e-4, damping * 10.0),
            }
        }
        Ok((pose, here))
    }

    /// The minimum near `start`: damped steps without shared errors, then steps with them until they vanish.
    ///
    /// # Errors
    ///
    /// A pose that hides a feature, an undetermined motion, or steps that do not vanish.
    pub(crate) fn minimum(
        &self,
        start: &Transform<Object, Camera>,
    ) -> Result<(Transform<Object, Camera>, Linearized), Degenerate> {
        let (mut pose, _) = self.independent_minimum(start, NEAR)?;
        let mut last = f64::INFINITY;
        for taken in 0..MAX_STEPS {
            let here = self.shared(&pose)?;
            let (step, decrement) = here.determined(0.0)?;
            if !(decrement < last) || decrement <= NOTHING {
                converged(taken, last.min(decrement).sqrt())?;
                return Ok((pose, here));
            }
            (pose, last) = (moved(&pose, &step), decrement);
        }
        converged(MAX_STEPS, last.sqrt()).and_then(|()| Ok((pose, self.shared(&pose)?)))
    }
}

/// The maximum-likelihood pose of points and edges, over the closed-form poses and the fit of the points.
///
/// The points are compared by their pixels if `rig` is given, else by their coordinates; edges likewise.
///
/// # Errors
///
/// Too few features, or that of the best initial pose.
pub(crate) fn solve(data: &Observations<'_>, rig: Option<&StereoRig>) -> Result<Transform<Object, Camera>, Degenerate> {
    let mixed = Mixed::of(data, rig, rig)?;
    let mut starts = poses(data);
    if data.points.len() >= 3 && wide_enough(&Observations { edges: Vec::new(), ..data.clone() }).is_ok() {
        starts.push(fit(&data.points));
    }
    // The features of a set fit together: the lowest cost decides, and the overlap between poses of one cost.
    let costs = starts
        .into_iter()
        .filter_map(|start| Some((mixed.independent(&start).ok()?.cost + apart(data, &start), start)));
    let ranked = alternating(costs.collect());
    let mut best: Option<(f64, Transform<Object, Camera>)> = None;
    let mut first = None;
    for start in ranked.into_iter().take(STARTS) {
        match mixed.minimum(&start) {
            Ok((pose, all)) => {
                let cost = all.cost + apart(data, &pose);
                if best.as_ref().is_none_or(|(min, _)| cost < *min) {
                    best = Some((cost, pose));
                }
            }
            Err(why) => first = first.or(Some(why)),
        }
    }
    let singular = Degenerate::Singular { fraction: 0.0, min: 0.0 };
    best.map(|(_, pose)| pose).ok_or_else(|| first.unwrap_or(singular))
}

/// Initial poses by cost, but the best of each attitude before the second of any.
///
/// A half turn about an edge maps it and all lines across it to themselves, so that a box has four attitudes of nearly one
/// cost: the first few poses may all have the wrong one.
fn alternating(mut starts: Vec<(f64, Transform<Object, Camera>)>) -> Vec<Transform<Object, Camera>> {
    /// Angle (rad) up to which two initial poses count as of one attitude.
    const ALIKE: f64 = 0.5;
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let alike =
        |a: &Transform<Object, Camera>, b: &Transform<Object, Camera>| a.rotation().angle_to(&b.rotation()) < ALIKE;
    let round = |k: usize| starts[..k].iter().filter(|(_, before)| alike(before, &starts[k].1)).count();
    let mut ranked: Vec<_> = (0..starts.len()).map(|k| (round(k), starts[k].1)).collect();
    ranked.sort_by_key(|(round, _)| *round);
    ranked.into_iter().map(|(_, start)| start).collect()
}

/// The maximum-likelihood pose of points and edges near a known one; as [`solve`] if none is there.
///
/// # Errors
///
/// As [`solve`].
pub(crate) fn solve_near(
    data: &Observations<'_>,
    rig: Option<&StereoRig>,
    near: &Transform<Object, Camera>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let found = Mixed::of(data, rig, rig)?.minimum(near);
    found.map(|(pose, _)| pose).or_else(|_| solve(data, rig))
}

/// The penalty (χ²) of edges that do not overlap their lines under a pose.
fn apart(data: &Observations<'_>, pose: &Transform<Object, Camera>) -> f64 {
    /// χ²₄ at 99 %.
    const BESIDE: f64 = 13.28;
    let into = pose.inverse();
    let beside = |edge: &&EdgeObservation| {
        let [from, to] = edge.model.map(|end| (into * end).coords);
        let line = SpaceLine::of(&edge.measured);
        !line.is_some_and(|line| line.rows(&from, &to).is_some_and(|rows| line.overlap(&rows, 0.0) >= OVERLAP))
    };
    BESIDE * data.edges.iter().filter(beside).count() as f64
}

/// The covariance of the pose of points and edges, with shared model errors.
///
/// # Errors
///
/// An undetermined motion.
pub(crate) fn covariance(
    data: &Observations<'_>,
    rig: Option<&StereoRig>,
    at: &Transform<Object, Camera>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    Mixed::of(data, rig, rig)?.shared(at)?.covariance().map(Covariance6::new)
}

/// Minimum value of a feature set that can determine a pose: a point counts two, an edge three.
///
/// Three points, two points and an edge, and two edges can; a point and an edge cannot.
pub(crate) const MIN_FEATURE_VALUE: usize = 6;
/// Maximum number of steps.
const MAX_STEPS: u64 = 100;
/// Decrement of a step of 1e-9 standard deviations, below which rounding rules.
const NOTHING: f64 = 1e-18;

/// The normal equations of pose and model errors.
struct System {
    normal: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
    mixed: DMatrix<f64>,
    pull: DVector<f64>,
    /// The factor of the information on the model errors; `None` without any.
    root: Option<Cholesky<f64, Dyn>>,
}

impl System {
    /// The normal equations of the pose, the model errors eliminated.
    fn linearized(&self) -> Linearized {
        let Some(root) = &self.root else {
            return Linearized::from_parts(&self.normal, self.gradient, self.cost);
        };
        let (mixed, pull) = (root.solve(&self.mixed), root.solve(&self.pull));
        let by_model = self.mixed.tr_mul(&mixed);
        let less = Matrix6::from_fn(|i, k| 0.5 * (by_model[(i, k)] + by_model[(k, i)]));
        let turned = self.mixed.tr_mul(&pull);
        let gradient = Vector6::from_fn(|i, _| self.gradient[i] - turned[i]);
        Linearized::from_parts(&(self.normal - less), gradient, self.cost - self.pull.dot(&pull))
    }
}

/// L⁻¹ of S = L Lᵀ; `None` if S is not finite and positive definite.
fn inverse_root(noise: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let inverse = noise.cholesky()?.l().try_inverse()?;
    inverse.iter().all(|x| x.is_finite()).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn the_best_start_of_each_attitude_comes_before_the_second_of_any() {
        let start = |turn: f64, x: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn);
            Transform::<Object, Camera>::new(turn, Vector3::new(x, 0.0, 0.0))
        };
        let half = std::f64::consts::PI;
        let starts = [(3.0, start(0.1, 3.0)), (1.0, start(0.0, 1.0)), (4.0, start(half, 4.0)), (2.0, start(0.2, 2.0))];
        let order = alternating(starts.to_vec()).iter().map(|start| start.translation().x).collect::<Vec<_>>();
        assert_eq!(order, [1.0, 4.0, 2.0, 3.0]);
    }
}
