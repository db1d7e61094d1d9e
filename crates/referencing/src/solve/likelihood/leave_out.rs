//! Leave-out poses: the maximum-likelihood pose without some of the points.

use nalgebra::{Matrix6, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::{
    observations::Observations,
    solve::{
        degeneracy::{Degenerate, wide_enough},
        likelihood::{
            descent::{Linearized, Terms, linearize},
            initial_poses::STARTS,
            mixed::Mixed,
            pixel_terms::rig_of_pixels,
            point_fit::{covariance, solved},
            scale_error::{Lever, ScaleError, scale_error},
        },
    },
};

/// The contribution of each point to the normal equations; an exclusion costs one 6×6 solve.
pub(crate) struct Deletions<'a> {
    pub(super) data: &'a Observations<'a>,
    pub(super) pose: Transform<Object, Camera>,
    pub(super) all: Linearized,
    pub(super) each: Vec<Linearized>,
    /// The place of each feature: of a point, or of the middle of an edge (object frame).
    pub(crate) places: Vec<Vector3<f64>>,
    /// The part of the covariance by model errors that edges share.
    shared: Matrix6<f64>,
    /// The scale error of all points; `None` if they determine none.
    pub(crate) scale_error: Option<ScaleError>,
    /// The depth error of all points; `None` if they determine none.
    pub(crate) depth_error: Option<ScaleError>,
}

/// Decrement of a negligible step of a pose of points and edges.
const SMALL: f64 = 1e-12;
/// Minimum number of remaining points for a single step; with fewer another minimum may be the best.
const MIN_REMAINING: usize = 5;
/// Largest squared step (standard deviations) that counts as linear.
const NEAR: f64 = 1.0;
/// Largest standard deviation of the attitude (rad, three axes together) at which a step counts as linear.
const SURE: f64 = 0.01;

impl<'a> Deletions<'a> {
    /// The contributions about the maximum near a pose of all features; `None` if they determine no pose.
    ///
    /// The pose matters for sets with edges only.
    pub(crate) fn near(data: &'a Observations<'a>, pose: &Transform<Object, Camera>) -> Option<Self> {
        if data.edges.is_empty() {
            return Self::of(data);
        }
        let rig = rig_of_pixels(data);
        let mixed = Mixed::of(data, rig, data.rig).ok()?;
        // The contributions are those without shared errors, and so is the pose at which their sum vanishes.
        let (pose, _) = mixed.independent_minimum(pose, SMALL).ok()?;
        let here = mixed.shared(&pose).ok()?;
        let each = mixed.each(&pose).ok()?;
        let mut all = *each.first()?;
        each[1..].iter().for_each(|one| all = all.plus(one));
        let shared = here.covariance().ok()? - all.covariance().ok()?;
        let points = data.points.iter().map(|point| point.model.coords);
        let edges = data.edges.iter().map(|edge| (edge.model[0].coords + edge.model[1].coords) / 2.0);
        let places = points.chain(edges).collect();
        // Any three points have a scale of their own.
        let enough = data.points.len() > 3;
        let points = Observations { edges: Vec::new(), ..data.clone() };
        let of_points = enough.then(|| Deletions::of(&points)).flatten();
        let (scale_error, depth_error) = of_points.map_or((None, None), |it| (it.scale_error, it.depth_error));
        Some(Self { data, pose, all, each, places, shared, scale_error, depth_error })
    }

    /// `None` if all points together determine no pose.
    pub(crate) fn of(data: &'a Observations<'a>) -> Option<Self> {
        let solved = likely(data, |pose, terms| {
            let one = |k: usize| linearize(&data.points[k..=k], pose, &|_, place: &_| terms(k, place));
            let each = (0..data.points.len()).map(one).collect::<Result<Vec<_>, _>>();
            let error_of = |lever: Lever| scale_error(&data.points, pose, terms, lever);
            each.map(|each| (*pose, each, error_of(Lever::Isotropic), error_of(Lever::Depth)))
        });
        let (pose, each, scale_error, depth_error) = solved.ok()?;
        let mut all = *each.first()?;
        each[1..].iter().for_each(|one| all = all.plus(one));
        let places = data.points.iter().map(|point| point.model.coords).collect();
        Some(Self { data, pose, all, each, places, shared: Matrix6::zeros(), scale_error, depth_error })
    }

    /// The maximum-likelihood pose without the points `out`, and its covariance.
    ///
    /// It is one step from the pose of all points if the step is short and enough points remain; otherwise the
    /// remaining points are solved anew. `None` if they determine no pose.
    pub(crate) fn without(&self, out: &[usize]) -> Option<(Transform<Object, Camera>, Covariance6<Object, Camera>)> {
        if self.each.len() >= out.len() + MIN_REMAINING {
            let left = out.iter().fold(self.all, |left, &k| left.less(&self.each[k]));
            if let Ok(covariance) = left.covariance()
                && covariance.fixed_view::<3, 3>(0, 0).trace() <= SURE * SURE
                && let Some((step, decrement)) = left.step(0.0)
                && decrement <= NEAR
            {
                let edges = !self.data.edges.is_empty();
                let covariance = if edges { covariance + self.shared } else { covariance };
                return Some((self.pose.perturbed(&step), Covariance6::new(covariance)));
            }
        }
        let mut fewer = self.data.clone();
        let mut place = 0..;
        fewer.points.retain(|_| place.next().is_none_or(|k| !out.contains(&k)));
        fewer.edges.retain(|_| place.next().is_none_or(|k| !out.contains(&k)));
        if !fewer.edges.is_empty() {
            let mixed = Mixed::of(&fewer, rig_of_pixels(&fewer), fewer.rig).ok()?;
            let (pose, here) = mixed.minimum(&self.pose).ok()?;
            return Some((pose, Covariance6::new(here.covariance().ok()?)));
        }
        likely(&fewer, |pose, terms| Ok((*pose, covariance(&fewer, pose, terms)?))).ok()
    }
}

/// Applies `work` to the maximum-likelihood pose, from the usual number of initial poses, and to the terms at it.
fn likely<R>(
    data: &Observations<'_>,
    work: impl FnOnce(&Transform<Object, Camera>, Terms<'_>) -> Result<R, Degenerate>,
) -> Result<R, Degenerate> {
    wide_enough(data)?;
    solved(data, rig_of_pixels(data), STARTS, work)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        observations::{EdgeObservation, Observation},
        solve::{mahalanobis::Mahalanobis, solver::Solver},
    };
    use seafix_geometry::{MeasuredLine, Point, UncertainPoint};

    /// Seven points without pixels, one of them with a small error.
    fn seen() -> Observations<'static> {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -3.0].into());
        let points = (0..7).map(|k| {
            let (a, b) = (f64::from(k) * 1.3, f64::from(k * k % 5) * 0.4);
            let at = Point::new(a.sin(), b - 0.7, 0.5 * (a * 0.7).cos());
            let off = Vector3::new(2e-3, -1e-3, 3e-3) * f64::from(u8::from(k == 2));
            Observation {
                measured: UncertainPoint::isotropic(pose.inverse() * at + off, 2e-3),
                pixels: None,
                model: at,
                model_sigma: 0.0,
            }
        });
        Observations { points: points.collect(), edges: Vec::new(), rig: None }
    }

    /// Scale error and depth error beside an edge are those of the points alone.
    #[test]
    fn an_edge_leaves_the_errors_of_the_points() {
        let points = seen();
        let pose = Mahalanobis::default().solve(&points).unwrap();
        let ends = [points.points[0].measured.at, points.points[1].measured.at];
        let measured =
            MeasuredLine { ends, offsets: nalgebra::Matrix4::identity() * 4e-6, segments: None, depth: true };
        let model = [points.points[0].model, points.points[1].model];
        let edges = vec![EdgeObservation { measured, model, model_sigmas: [0.0; 2] }];
        let data = Observations { edges, ..points.clone() };
        let (alone, beside) = (Deletions::of(&points).unwrap(), Deletions::near(&data, &pose).unwrap());
        assert!(alone.scale_error.is_some() && alone.depth_error.is_some() && alone.scale_error != alone.depth_error);
        assert_eq!((beside.scale_error, beside.depth_error), (alone.scale_error, alone.depth_error));
    }

    #[test]
    fn a_step_leads_where_the_beginning_does() {
        let data = seen();
        let all = Deletions::of(&data).unwrap();
        for out in [&[2][..], &[0], &[2, 5]] {
            let (pose, covariance) = all.without(out).unwrap();
            let mut fewer = data.clone();
            let mut place = 0..;
            fewer.points.retain(|_| place.next().is_none_or(|k| !out.contains(&k)));
            let witness = Mahalanobis::default();
            let expected = witness.solve(&fewer).unwrap();
            // In standard deviations.
            let xi = expected.error_to(&pose);
            let off = xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)).sqrt();
            assert!(off < 0.02, "{out:?}: {off}");
            let own = witness.covariance(&fewer, &expected).unwrap();
            assert!((covariance.matrix - own.matrix).amax() < 0.02 * own.matrix.amax(), "{out:?}");
        }
        assert!(all.without(&[0, 1, 2, 3, 4]).is_none(), "two points are left");
    }
}
