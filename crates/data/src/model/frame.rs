//! The object's frame by the rule of Fig. 2, and the covariance of points in it.

use nalgebra::{DMatrix, Matrix3, Vector3};
use seafix_geometry::{Collinear, Object, Point, Transform, World, triad};

/// An object's frame on three of its points.
#[derive(Debug, Clone)]
pub(super) struct ObjectFrame {
    /// The pose of the frame.
    pub(super) world_from_object: Transform<World, Object>,
    /// The points in the frame.
    pub(super) points: Vec<Point<Object>>,
    base: [usize; 3],
}

impl ObjectFrame {
    /// The frame on the points with the indices `base`.
    ///
    /// # Errors
    /// [`Collinear`] base points.
    pub(super) fn on(points: &[Point<World>], base: [usize; 3]) -> Result<Self, Collinear> {
        let [p1, p2, p3] = base.map(|index| &points[index]);
        let world_from_object: Transform<World, Object> = triad(p1, p2, p3)?;
        let back = world_from_object.inverse();
        let mut own: Vec<Point<Object>> = points.iter().map(|point| back * *point).collect();
        // The rule makes these six coordinates zero; rounding leaves 1e-17.
        own[base[0]] = Point::origin();
        own[base[2]].coords.y = 0.0;
        own[base[2]].coords.z = 0.0;
        own[base[1]].coords.z = 0.0;
        Ok(Self { world_from_object, points: own, base })
    }

    /// Displacements of all points in the world, one displacement a column, as displacements in the frame that moves
    /// with its base points.
    ///
    /// With d = Rᵀ δ and q the coordinates in the frame, a point moves by d − d₁ − ω × q. The rotation ω keeps P3 on x
    /// and P2 in the plane z = 0: ω_z = (d₃ − d₁)_y/x₃, ω_y = −(d₃ − d₁)_z/x₃, ω_x = ((d₂ − d₁)_z + ω_y x₂)/y₂.
    pub(super) fn carried(&self, displacements: &DMatrix<f64>) -> DMatrix<f64> {
        let turn: Matrix3<f64> = self.world_from_object.rotation_matrix().transpose();
        let [p1, p2, p3] = self.base;
        let (q2, q3) = (self.points[p2].coords, self.points[p3].coords);
        let mut moved = displacements.clone();
        for mut column in moved.column_iter_mut() {
            let own: Vec<Vector3<f64>> = (0..self.points.len()).map(|k| turn * column.fixed_rows::<3>(3 * k)).collect();
            let (second, third) = (own[p2] - own[p1], own[p3] - own[p1]);
            let (about_y, about_z) = (-third.z / q3.x, third.y / q3.x);
            let rotation = Vector3::new((second.z + about_y * q2.x) / q2.y, about_y, about_z);
            for (k, d) in own.iter().enumerate() {
                let mut change = d - own[p1] - rotation.cross(&self.points[k].coords);
                // Zero by the rule, without rounding.
                if k == p1 {
                    change = Vector3::zeros();
                } else if k == p3 {
                    (change.y, change.z) = (0.0, 0.0);
                } else if k == p2 {
                    change.z = 0.0;
                }
                column.fixed_rows_mut::<3>(3 * k).copy_from(&change);
            }
        }
        moved
    }

    /// The covariance of all points in the frame from that in the world.
    pub(super) fn covariance(&self, in_world: &DMatrix<f64>) -> DMatrix<f64> {
        let half = self.carried(in_world).transpose();
        let both = self.carried(&half);
        (&both + both.transpose()) * 0.5
    }
}

/// The part of a covariance of n points that no motion of all of them explains (inner constraints): P Σ P with the
/// projection P away from rigid motions.
///
/// It does not depend on the frame in which Σ is given, up to a rotation of the axes.
pub(super) fn inner<F>(points: &[Point<F>], covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let count = points.len();
    let centre = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / count as f64;
    let mut motions = DMatrix::zeros(3 * count, 6);
    for (k, point) in points.iter().enumerate() {
        motions.fixed_view_mut::<3, 3>(3 * k, 0).copy_from(&-(point.coords - centre).cross_matrix());
        motions.fixed_view_mut::<3, 3>(3 * k, 3).copy_from(&Matrix3::identity());
    }
    let unit = motions.qr().q();
    let project = |matrix: &DMatrix<f64>| matrix - &unit * (unit.transpose() * matrix);
    project(&project(covariance).transpose())
}

/// The standard deviation of a coordinate of each point relative to all others (m), for sites, whose points have
/// independent errors.
///
/// Independent errors of variance s² leave s² (1 − 2/n) of it after the best alignment of n points, so
/// s² = tr Σ_ii / 3 · n/(n − 2) with the inner covariance Σ.
pub(super) fn relative_sigmas(inner: &DMatrix<f64>) -> Vec<f64> {
    let count = inner.nrows() / 3;
    let factor = count as f64 / (count as f64 - 2.0).max(1.0);
    let trace = |k: usize| inner.fixed_view::<3, 3>(3 * k, 3 * k).trace();
    (0..count).map(|k| (trace(k) / 3.0 * factor).max(0.0).sqrt()).collect()
}
