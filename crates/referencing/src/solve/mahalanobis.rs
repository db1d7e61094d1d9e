//! Mahalanobis: 3D–3D least squares with the full covariance of every point.

use nalgebra::SMatrix;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        degeneracy::{Degenerate, check, fraction},
        likelihood::{
            descent::model_errors,
            initial_poses::{AlternativePose, STARTS, alternatives},
            mixed::{self, Mixed},
            pixel_terms::{PixelTerms, TermTarget, rig_of_pixels},
            point_fit::{covariance, solved},
            point_terms::Measured,
            profile::pixel_covariance,
        },
        solver::Solver,
    },
};

/// Weighted 3D–3D least squares: min Σ rᵀ (Σ_measured + σ_model² I)⁻¹ r, r = C − H⁻¹P in camera axes.
///
/// The covariance of a triangulated point grows with the fourth power of its depth, so points moved nearer by noise
/// have too much weight; and disparity noise biases the depth outwards, E z ≈ z (1 + σ_d²/d²). With pixels and a rig,
/// both are therefore evaluated at the *fitted* point p: its covariance Σ(p) = (Jᵀ Σ_px⁻¹ J)⁻¹, J = ∂pixels/∂p, and the
/// displacement C − p as the first-order step between the pixels of p and of C, r = Σ(p) Jᵀ Σ_px⁻¹ (π(C) − π(p)).
/// Pixels are unbiased, so r is unbiased to second order. The answer then solves Σ ∂pᵀ (Σ(p) + σ² I)⁻¹ r = 0, as does
/// reprojection of the triangulated point's pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mahalanobis {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub min_ratio: f64,
    /// Whether to evaluate covariances and displacements at the fitted points; it requires pixels and a rig.
    pub refit: bool,
    /// Maximum number of initial poses, 1 to 5, with pixels and a rig; 1 uses the unweighted fit alone.
    pub starts: usize,
}

impl Default for Mahalanobis {
    fn default() -> Self {
        Self { min_ratio: 1e-3, refit: true, starts: STARTS }
    }
}

impl Component for Mahalanobis {
    const NAME: &'static str = "mahalanobis";
    const SUMMARY: &'static str = "3D-3D least squares with full covariances, seen from the fitted points";
    const SOURCE: &'static str =
        "Matei, Meer, Optimal rigid motion estimation and performance evaluation with bootstrap, 1999";
    const PROPERTIES: seafix_component::Properties = &[("features", "points and straight edges")];

    fn check(&self) -> Result<(), String> {
        in_range((1..=5).contains(&self.starts), "starts", self.starts, "1 to 5")?;
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for Mahalanobis {
    fn takes_edges(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        if !data.edges.is_empty() {
            return mixed::solve(data, None);
        }
        check(data, self.minimum(), self.min_ratio)?;
        solved(data, self.rig(data), self.starts, |pose, _| Ok(*pose))
    }

    fn solve_near(
        &self,
        data: &Observations<'_>,
        near: &Transform<Object, Camera>,
    ) -> Result<Transform<Object, Camera>, Degenerate> {
        match data.edges.is_empty() {
            true => self.solve(data),
            false => mixed::solve_near(data, None, near),
        }
    }

    fn alternatives(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, max: f64) -> Vec<AlternativePose> {
        let Some(rig) = self.rig(data).filter(|_| data.edges.is_empty()) else { return Vec::new() };
        let mut pixel_terms = PixelTerms::new(rig);
        match pixel_terms.see(&data.points, TermTarget::Triangulated) {
            Ok(()) => alternatives(data, rig, self.starts, &pixel_terms, at, max),
            Err(_) => Vec::new(),
        }
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        if !data.edges.is_empty() {
            return mixed::covariance(data, None, at);
        }
        let Some(rig) = self.rig(data) else {
            let measured = Measured::of(&data.points);
            return covariance(data, at, &|k, place| Some(measured.term(k, place)));
        };
        pixel_covariance(&data.points, rig, TermTarget::Triangulated, at)
    }

    fn model_errors(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        if !data.edges.is_empty() {
            return Mixed::of(data, None, None)?.model_errors(at);
        }
        let Some(rig) = self.rig(data) else {
            let measured = Measured::of(&data.points);
            return model_errors(&data.points, at, &|k, place: &_| Some(measured.term(k, place)));
        };
        let mut all = PixelTerms::new(rig);
        all.see(&data.points, TermTarget::Triangulated)?;
        model_errors(&data.points, at, &|k, place: &_| all.live(k, place))
    }
}

impl Mahalanobis {
    fn rig<'a>(&self, data: &Observations<'a>) -> Option<&'a StereoRig> {
        rig_of_pixels(data).filter(|_| self.refit)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3, Vector6};
    use seafix_geometry::{Pinhole, Point, UncertainPixels, UncertainPoint};

    use super::*;
    use crate::{
        observations::Observation,
        solve::{covariance::numerical, stereo_reprojection::StereoReprojection},
    };

    const PLACES: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 1.3, 0.1], [0.4, 0.3, 0.9], [-0.7, 0.5, 0.4]];

    fn rig() -> StereoRig {
        let camera = Pinhole::new([1024, 768], [500.0, 510.0], [511.5, 383.5], &[]).unwrap();
        StereoRig::new(camera, camera, Transform::exp(&Vector6::new(0.02, -0.05, 0.01, -0.25, 0.01, 0.02))).unwrap()
    }

    /// The points as the rig sees them from 4 m, with an error of up to `max` (px) in each pixel coordinate.
    fn seen(rig: &StereoRig, max: f64) -> Observations<'_> {
        let pose = Transform::<Object, Camera>::exp(&Vector6::new(0.4, -0.3, 0.7, 0.2, 0.3, -4.0));
        let points = PLACES.iter().enumerate().map(|(k, at)| {
            let mut pixels = UncertainPixels {
                at: rig.project(&(pose.inverse() * Point::from(*at))).unwrap(),
                covariance: Matrix4::identity() * 0.09,
            };
            let off = |p: f64| max * ((k as f64 + 1.0) * p).sin();
            pixels.at.left.u += off(2.0);
            pixels.at.left.v += off(3.0);
            pixels.at.right.u += off(5.0);
            pixels.at.right.v += off(7.0);
            let found = rig.triangulate(&pixels).unwrap();
            let measured = UncertainPoint { at: found.point, covariance: found.covariance };
            Observation { measured, pixels: Some(pixels), model: Point::from(*at), model_sigma: 2e-3 }
        });
        Observations { points: points.collect(), edges: Vec::new(), rig: Some(rig) }
    }

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Mahalanobis::default().check(), Ok(()));
        for (starts, fits) in [(0, false), (1, true), (5, true), (6, false)] {
            assert_eq!(Mahalanobis { starts, ..Mahalanobis::default() }.check().is_ok(), fits, "{starts}");
        }
        let message = Mahalanobis { starts: 0, ..Mahalanobis::default() }.check().unwrap_err();
        assert_eq!(message, "starts = 0; give 1 to 5");
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Mahalanobis { min_ratio: bad, ..Mahalanobis::default() }.check().is_err(), "{bad}");
        }
    }

    /// A displacement along x of the two points on the x axis, with 1 mm of noise there, against two points with 2 mm.
    #[test]
    fn every_axis_has_its_own_weight() {
        let point = |at: [f64; 3], x: f64, off: [f64; 3]| Observation {
            measured: UncertainPoint {
                at: Point::from(at) + Vector3::from(off),
                covariance: Matrix3::from_diagonal(&Vector3::new(x * x, 1e-6, 1e-6)),
            },
            pixels: None,
            model: Point::from(at),
            model_sigma: 0.0,
        };
        let places = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
        let points: Vec<Observation> = places
            .iter()
            .enumerate()
            .map(|(k, &at)| {
                let off = if k < 2 { [3e-4, 0.0, 0.0] } else { [0.0; 3] };
                point(at, if k < 2 { 1e-3 } else { 2e-3 }, off)
            })
            .collect();
        let data = Observations { points, edges: Vec::new(), rig: None };
        let found = Mahalanobis::default().solve(&data).unwrap();
        // Weights 4 to 1: the x of the fit has an error of 4/5 of 0.3 mm.
        assert!((found.translation() + Vector3::new(2.4e-4, 0.0, 0.0)).amax() < 1e-9, "{}", found.translation());
    }

    /// The refitted answer equals that of the pixels to second order in the noise; the measured covariances lead
    /// elsewhere.
    #[test]
    fn with_pixels_and_a_rig_the_answer_is_that_of_the_pixels() {
        let rig = rig();
        let data = seen(&rig, 1.0);
        let pixels = StereoReprojection::default().solve(&data).unwrap();
        let refit = Mahalanobis::default().solve(&data).unwrap();
        let fixed = Mahalanobis { refit: false, ..Mahalanobis::default() }.solve(&data).unwrap();
        let (near, far) = (pixels.error_to(&refit).norm(), pixels.error_to(&fixed).norm());
        assert!(far > 5e-4 && near < 0.01 * far, "{near} {far}");
        // Refitting requires a rig and pixels.
        let bare =
            Mahalanobis::default().solve(&Observations { edges: Vec::new(), rig: None, ..data.clone() }).unwrap();
        assert!(fixed.error_to(&bare).amax() < 1e-12);
        let mut points = data.points.clone();
        points.iter_mut().for_each(|point| point.pixels = None);
        let without =
            Mahalanobis::default().solve(&Observations { points, edges: Vec::new(), rig: Some(&rig) }).unwrap();
        assert!(fixed.error_to(&without).amax() < 1e-12);
        // One point with pixels suffices.
        let mut some = data.clone();
        some.points[1..].iter_mut().for_each(|point| point.pixels = None);
        let solver = Mahalanobis::default();
        assert!(solver.rig(&some).is_some() && solver.rig(&data).is_some());
        assert!(Mahalanobis { refit: false, ..solver }.rig(&data).is_none());
    }

    /// The pose errors by model errors, with and without pixels, equal the effect of moved model points.
    #[test]
    fn model_errors_are_the_derivatives_of_the_answer() {
        let rig = rig();
        let solver = Mahalanobis::default();
        for data in [seen(&rig, 0.0), Observations { edges: Vec::new(), rig: None, ..seen(&rig, 0.0) }] {
            let at = solver.solve(&data).unwrap();
            let analytic = solver.model_errors(&data, &at).unwrap();
            let numeric = numerical::model_errors(|moved| solver.solve(moved), &data, &at).unwrap();
            assert_eq!(analytic.len(), 5);
            for (a, n) in analytic.iter().zip(&numeric) {
                assert!(n.amax() > 1e-5 && (a - n).amax() < 1e-5 * n.amax(), "{a} {n}");
            }
        }
    }

    /// Points without a rig have one minimum.
    #[test]
    fn bare_points_have_no_alternatives() {
        let rig = rig();
        let data = Observations { edges: Vec::new(), rig: None, ..seen(&rig, 1.0) };
        let solver = Mahalanobis::default();
        let at = solver.solve(&data).unwrap();
        assert!(solver.alternatives(&data, &at, 1e9).is_empty());
    }

    /// A plate of 0.2 m at 4 m, tilted by 20°: depths have an error of about 5 cm, so the side of the tilt is
    /// undetermined.
    #[test]
    fn a_small_tilted_plate_may_be_tilted_the_other_direction() {
        let rig = rig();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.35);
        let at = Transform::<Object, Camera>::new(turn, -(turn * Vector3::new(0.0, 0.0, 4.0)));
        let corners = [(0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1), (0.03, 0.06)];
        let points = corners.map(|(x, y)| {
            let model = Point::new(x, y, 0.0);
            let pixels = rig.project(&(at.inverse() * model)).unwrap();
            let pixels = UncertainPixels { at: pixels, covariance: Matrix4::identity() * 0.09 };
            let found = rig.triangulate(&pixels).unwrap();
            let measured = UncertainPoint { at: found.point, covariance: found.covariance };
            Observation { measured, pixels: Some(pixels), model, model_sigma: 0.0 }
        });
        let data = Observations { points: points.to_vec(), edges: Vec::new(), rig: Some(&rig) };
        let alternatives = |solver: Mahalanobis, max: f64| solver.alternatives(&data, &at, max);
        let found = alternatives(Mahalanobis::default(), 40.0);
        assert!(
            !found.is_empty() && found.iter().all(|alternative| alternative.worse > 0.0 && alternative.worse <= 40.0),
            "{found:?}"
        );
        let turned = seafix_geometry::so3::angle(&(at.rotation().inverse() * found[0].pose.rotation()));
        assert!((0.4..1.0).contains(&turned), "{turned}");
        assert!(alternatives(Mahalanobis { starts: 1, ..Mahalanobis::default() }, 40.0).is_empty());
        assert!(alternatives(Mahalanobis { refit: false, ..Mahalanobis::default() }, 40.0).is_empty());
        assert!(alternatives(Mahalanobis::default(), 0.5 * found[0].worse).is_empty());
    }
}
