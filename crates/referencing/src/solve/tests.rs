//! Common requirements of the solvers, and the particular ones of each.

mod components;

use nalgebra::{Matrix3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{
    Camera, Covariance6, Object, Pinhole, Point, StereoRig, Transform, UncertainPixels, UncertainPoint,
};

use super::{covariance::numerical, *};
use crate::observations::{Observation, Observations};

fn motion() -> Transform<Object, Camera> {
    Transform::exp(&Vector6::new(0.4, -1.1, 0.7, 1.5, -2.0, 3.0))
}

/// Exact observations of these model points.
fn seen(model: &[[f64; 3]], sigma: f64) -> Observations<'static> {
    let points = model.iter().map(|at| {
        let model = Point::from(*at);
        let measured = UncertainPoint::isotropic(motion().inverse() * model, sigma);
        Observation { measured, pixels: None, model, model_sigma: 0.0 }
    });
    Observations { points: points.collect(), edges: Vec::new(), rig: None }
}

const SPREAD: [[f64; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 1.3, 0.1], [0.4, 0.3, 0.9], [-0.7, 0.5, 0.4]];

/// The solvers that accept points without pixels.
fn solvers() -> Vec<Box<dyn Solver>> {
    let all = SOLVERS.names().map(|name| SOLVERS.build(&seafix_component::Choice::named(name)).unwrap());
    all.filter(|solver| !solver.needs_pixels()).collect()
}

#[test]
fn exact_data_give_the_exact_pose() {
    for solver in solvers() {
        let found = solver.solve(&seen(&SPREAD, 0.01)).unwrap();
        assert!(motion().error_to(&found).amax() < 1e-12, "{solver:?}: {}", motion().error_to(&found));
    }
}

#[test]
fn flat_and_slender_sets_lose_no_digits() {
    let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let slender = [[0.0, 0.0, 0.0], [1.0, 0.01, 0.0], [2.0, 0.0, 0.01], [3.0, -0.01, 0.0]];
    for (points, limit) in [(flat, 1e-13), (slender, 1e-11)] {
        let found = Kabsch::default().solve(&seen(&points, 0.01)).unwrap();
        assert!(motion().error_to(&found).amax() < limit, "{}", motion().error_to(&found));
    }
}

#[test]
fn a_reflection_is_never_the_answer() {
    let mut data = seen(&SPREAD, 0.01);
    for point in &mut data.points {
        point.measured.at.coords.z *= -1.0;
    }
    let found = Kabsch::default().solve(&data).unwrap();
    assert!((found.rotation_matrix().determinant() - 1.0).abs() < 1e-12);
    assert!(data.residual_rms(&found) > 0.1, "a mirror image fits no rigid motion");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..1000 {
        let xi = Vector6::from_fn(|_, _| rng.random_range(-0.5..0.5));
        assert!(data.residual_rms(&found) <= data.residual_rms(&found.perturbed(&xi)), "a rotation of lower cost");
    }
}

#[test]
fn kabsch_has_the_smallest_residual_of_all_poses() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut data = seen(&SPREAD, 0.02);
    for point in &mut data.points {
        point.measured.at = point.measured.at + Vector3::from_fn(|_, _| rng.random_range(-0.03..0.03));
    }
    let best = Kabsch::default().solve(&data).unwrap();
    let triad = Triad::default().solve(&data).unwrap();
    assert!(data.residual_rms(&best) <= data.residual_rms(&triad));
    for _ in 0..1000 {
        let xi = Vector6::from_fn(|_, _| rng.random_range(-0.01..0.01));
        assert!(data.residual_rms(&best) <= data.residual_rms(&best.perturbed(&xi)));
    }
}

#[test]
fn what_determines_no_pose_is_rejected_with_its_number() {
    let line = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1e-5, 0.0]];
    for solver in solvers() {
        assert_eq!(solver.solve(&seen(&SPREAD[..2], 0.01)), Err(Degenerate::TooFew { found: 2, needed: 3 }));
        assert!(matches!(solver.solve(&seen(&line, 0.01)), Err(Degenerate::Collinear { .. })), "{solver:?}");
        let mut data = seen(&SPREAD, 0.01);
        data.points[1].measured.at.coords.y = f64::NAN;
        assert_eq!(solver.solve(&data), Err(Degenerate::NotFinite));
        assert!(matches!(solver.solve(&seen(&[[1.0, 2.0, 3.0]; 3], 0.01)), Err(Degenerate::Collinear { .. })));
    }
}

#[test]
fn the_triad_states_which_three_it_took() {
    let data = seen(&[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]], 0.01);
    let used = |choose| Triad { choose, ..Triad::default() }.used(&data);
    assert_eq!(used(Choose::First), [0, 1, 2]);
    assert_eq!(used(Choose::LargestArea), [1, 3, 4].map(|i| if i == 1 { 0 } else { i }));
    assert_eq!(used(Choose::SmallestCovariance).len(), 3);
    assert_eq!(Kabsch::default().used(&data), [0, 1, 2, 3, 4]);
    assert!(Triad::default().used(&seen(&SPREAD[..2], 0.01)).is_empty());
}

#[test]
fn the_covariance_of_kabsch_is_that_of_least_squares() {
    // With equal weights: σ² (Σ JᵀJ)⁻¹, J = [ [p]×, −I ].
    let data = seen(&SPREAD, 0.02);
    let covariance = Kabsch::default().covariance(&data, &motion()).unwrap();
    let mut normal = nalgebra::Matrix6::zeros();
    for point in &data.points {
        let mut j = nalgebra::Matrix3x6::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&seafix_geometry::so3::skew(&point.measured.at.coords));
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        normal += j.transpose() * j;
    }
    let expected = normal.try_inverse().unwrap() * 0.02 * 0.02;
    assert!((covariance.matrix - expected).amax() < 1e-6 * expected.amax());
}

#[test]
fn the_covariance_is_what_many_draws_show() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let clean = seen(&SPREAD, 0.003);
    for solver in solvers() {
        let covariance = solver.covariance(&clean, &motion()).unwrap().matrix;
        let weight = covariance.cholesky().unwrap();
        let draws = 1500;
        let mut nees = 0.0;
        for _ in 0..draws {
            let mut data = clean.clone();
            for point in &mut data.points {
                // The sum of twelve uniform numbers: variance 1.
                let normal = Vector3::from_fn(|_, _| (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>());
                point.measured.at = point.measured.at + normal * 0.003;
            }
            let xi = solver.solve(&data).unwrap().error_to(&motion());
            nees += xi.dot(&weight.solve(&xi)) / f64::from(draws);
        }
        assert!((5.6..6.4).contains(&nees), "{solver:?}: NEES {nees}");
    }
}

/// The points of `SPREAD` as a rig sees them from 4 m, without noise; the pixel covariance is that of two aligned
/// views, an independent part per view and a common part.
fn through_a_rig(rig: &StereoRig) -> (Observations<'_>, Transform<Object, Camera>) {
    through_a_rig_from(rig, Transform::exp(&Vector6::new(0.4, -0.3, 0.7, 0.2, 0.3, -4.0)))
}

/// The points of `SPREAD` as a rig sees them from a given pose.
fn through_a_rig_from(
    rig: &StereoRig,
    pose: Transform<Object, Camera>,
) -> (Observations<'_>, Transform<Object, Camera>) {
    // Small enough that the likelihood of even three points is linear within it.
    let mut covariance = nalgebra::Matrix4::identity() * 0.05_f64.powi(2);
    for i in 0..2 {
        (covariance[(i, i + 2)], covariance[(i + 2, i)]) = (0.0014, 0.0014);
    }
    let points = SPREAD.iter().map(|at| {
        let model = Point::from(*at);
        let pixels = UncertainPixels { at: rig.project(&(pose.inverse() * model)).unwrap(), covariance };
        let found = rig.triangulate(&pixels).unwrap();
        let measured = UncertainPoint { at: found.point, covariance: found.covariance };
        Observation { measured, pixels: Some(pixels), model, model_sigma: 2e-3 }
    });
    (Observations { points: points.collect(), edges: Vec::new(), rig: Some(rig) }, pose)
}

fn rig() -> StereoRig {
    let camera = Pinhole::new([1024, 768], [500.0, 510.0], [511.5, 383.5], &[-0.1, 0.02, 1e-3, -5e-4]).unwrap();
    let right_from_left = Transform::exp(&Vector6::new(0.02, -0.05, 0.01, -0.25, 0.01, 0.02));
    StereoRig::new(camera, camera, right_from_left).unwrap()
}

/// Analytic covariances equal numerical ones on exact data from random poses to 1e-6; optimisers that are not exact to
/// rounding to 1e-4, from one pose, as each answer takes a thousand evaluations.
///
/// Fails if the sandwich weights the noise by w instead of w².
#[test]
fn analytic_covariances_are_the_numerical_ones() {
    let rig = rig();
    let mut rng = ChaCha8Rng::seed_from_u64(45);
    let mut differs = Vec::new();
    let named = SOLVERS.names().filter(|name| !["irls", "triad"].contains(name));
    let all: Vec<_> =
        named.map(|name| (name, SOLVERS.build(&seafix_component::Choice::named(name)).unwrap())).collect();
    for (round, (name, solver)) in (0..5).flat_map(|round| all.iter().map(move |solver| (round, solver))) {
        if round > 0 && !solver.to_rounding() {
            continue;
        }
        // Any rotation about the optical axis, and limited ones about the others.
        let turn = Vector3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6), rng.random_range(-3.0..3.0));
        let shift = Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), rng.random_range(3.0..5.0));
        let camera_from_object = Transform::<Camera, Object>::new(seafix_geometry::so3::exp(&turn), shift);
        let (data, pose) = through_a_rig_from(&rig, camera_from_object.inverse());
        for data in [data.clone(), Observations { edges: Vec::new(), rig: None, ..data.clone() }] {
            if solver.needs_pixels() && data.rig.is_none() {
                continue;
            }
            let analytic = solver.covariance(&data, &pose).unwrap().matrix;
            let numeric = numerical::covariance(|moved| solver.solve(moved), &data, &pose).unwrap().matrix;
            let off = (analytic - numeric).amax() / analytic.amax();
            // The minima have an error of 1e-5, and so do their differences.
            if !(off < if solver.to_rounding() { 1e-6 } else { 1e-4 }) {
                differs.push((name, round, off));
            }
        }
    }
    assert!(differs.is_empty(), "{differs:?}");
}

/// Steps follow the noise: at a micrometre Huber's loss is least squares within its noise, and the numerical covariance
/// agrees.
#[test]
fn numerical_steps_stay_within_the_noise() {
    let data = seen(&SPREAD, 1e-6);
    let huber = irls::Irls::default();
    let numeric = numerical::covariance(|moved| huber.solve(moved), &data, &motion()).unwrap().matrix;
    let expected = Kabsch::default().covariance(&data, &motion()).unwrap().matrix;
    assert!((numeric - expected).amax() < 1e-5 * expected.amax(), "{}", (numeric - expected).amax() / expected.amax());
}

/// Precision is limited by the coordinates: zero noise still leaves an invertible covariance, and coordinates of a
/// hundred thousand kilometres leave their rounding error.
#[test]
fn no_point_is_known_better_than_its_digits() {
    for solver in solvers() {
        let exact = solver.covariance(&seen(&SPREAD, 0.0), &motion()).unwrap().matrix;
        assert!(exact.cholesky().is_some() && exact.amax() < 1e-15, "{solver:?}: {exact}");
        let far = Transform::<Object, Camera>::new(motion().rotation(), Vector3::new(0.0, 0.0, -1e8));
        let mut data = seen(&SPREAD, 0.0);
        data.points.iter_mut().for_each(|point| point.measured.at = far.inverse() * point.model);
        // A lever of eight digits more than the object leaves some solvers no information: they reject.
        let known = solver.solve(&data).and_then(|pose| solver.covariance(&data, &pose));
        let Ok(Covariance6 { matrix: known, .. }) = known else { continue };
        assert!(known[(0, 0)].sqrt() > 1e-8, "{solver:?}: {}", known[(0, 0)].sqrt());
    }
}

/// Absurd noise is rejected as noise, or accepted: the coordinates are not blamed.
#[test]
fn absurd_noise_is_not_blamed_on_coordinates() {
    for solver in solvers() {
        let known = solver.solve(&seen(&SPREAD, 1e15)).unwrap();
        assert!(motion().error_to(&known).amax() < 1e-9, "{solver:?}");
        for sigma in [1e200, f64::NAN] {
            let mut data = seen(&SPREAD, 0.01);
            data.points[3].measured.covariance = Matrix3::identity() * (sigma * sigma);
            assert_eq!(solver.solve(&data), Err(Degenerate::Noise { index: 3 }), "{solver:?}");
        }
    }
}

#[test]
fn pixels_are_asked_for_by_name() {
    let data = seen(&SPREAD, 0.01);
    let why = StereoReprojection::default().solve(&data).unwrap_err();
    assert_eq!(why, Degenerate::NoPixels);
    assert!(why.remedy().contains("`mahalanobis`"));
    let rig = rig();
    let (mut data, _) = through_a_rig(&rig);
    data.points[2].measured.at.coords.z = -1.0;
    let behind = Err(Degenerate::Behind { index: 2, depth: -1.0 });
    assert_eq!(
        (StereoReprojection::default().solve(&data), Mahalanobis::default().solve(&data)),
        (behind.clone(), behind)
    );
}

#[test]
fn truncated_squares_leave_outliers_out() {
    let mut data = seen(&SPREAD, 0.01);
    data.points[3].measured.at = data.points[3].measured.at + Vector3::new(0.5, -0.3, 0.2);
    let solver = gnc_tls::GncTls::default();
    assert_eq!(solver.used(&data), [0, 1, 2, 4]);
    assert!(motion().error_to(&solver.solve(&data).unwrap()).amax() < 1e-12);
    for loss in [irls::Loss::Cauchy, irls::Loss::Huber, irls::Loss::UnSquared] {
        let robust = irls::Irls { loss, ..Default::default() }.solve(&data).unwrap();
        let plain = Kabsch::default().solve(&data).unwrap();
        assert!(motion().error_to(&robust).norm() < 0.7 * motion().error_to(&plain).norm(), "{loss:?}");
    }
}

/// All solvers, with pixels, reject the same degenerate geometry with the failed number.
#[test]
fn degenerate_views_are_rejected_with_the_number_that_failed() {
    let rig = rig();
    let view = |places: &[[f64; 3]]| {
        let pose = motion();
        let points = places.iter().map(|at| {
            let place = Point::from(*at);
            let pixels = UncertainPixels::independent(rig.project(&place).unwrap(), 0.3);
            let found = rig.triangulate(&pixels).unwrap();
            let measured = UncertainPoint { at: found.point, covariance: found.covariance };
            Observation { measured, pixels: Some(pixels), model: pose * place, model_sigma: 0.0 }
        });
        Observations { points: points.collect(), edges: Vec::new(), rig: Some(&rig) }
    };
    let good = [[0.0, 0.0, 3.0], [0.8, 0.1, 3.2], [-0.4, 0.6, 2.8], [0.3, -0.5, 3.5]];
    let line = [0.0, 1.0, 2.0, 3.0].map(|k| [-0.6 + 0.4 * k, 0.1 * k, 3.0 + 0.2 * k]);
    let far = good.map(|[x, y, z]| [x * 40.0, y * 40.0, z * 40.0]);
    let plate = [[0.0, 0.0, 3.0], [0.8, 0.1, 3.0], [-0.4, 0.6, 3.0], [0.3, -0.5, 3.0]];
    for name in SOLVERS.names() {
        let solver = SOLVERS.build(&seafix_component::Choice::named(name)).unwrap();
        assert!(solver.solve(&view(&good)).is_ok(), "{name}");
        match solver.solve(&view(&line)) {
            Err(Degenerate::Collinear { ratio, min }) => assert!(ratio < min, "{name}: {ratio}"),
            other => panic!("{name}: collinear points give {other:?}"),
        }
        match solver.solve(&view(&far)) {
            Err(Degenerate::Far { fraction, max }) => assert!(fraction > max && fraction < 10.0, "{name}: {fraction}"),
            other => panic!("{name}: distant points give {other:?}"),
        }
        let mut behind = view(&good);
        behind.points[2].measured.at.coords.z *= -1.0;
        match solver.solve(&behind) {
            Err(Degenerate::Behind { index: 2, depth }) => assert!(depth < 0.0),
            other => panic!("{name}: a point behind gives {other:?}"),
        }
        // Equal disparities are valid: a plate seen from the front determines its pose.
        let pose = solver.solve(&view(&plate)).unwrap();
        assert!(motion().error_to(&pose).amax() < 1e-4, "{name}: {pose:?}");
    }
}

/// The gradient and the normal equations of a pose, at random poses and with every kind of weight: J against central
/// differences of the projections, the gradient against those of χ², at most 1e-6 of the largest.
///
/// Fails if the lever of the rotation has the wrong sign.
#[test]
fn derivatives_are_those_of_the_projections_at_random_poses() {
    use super::likelihood::{
        descent::linearize,
        pixel_terms::{PixelTerms, TermTarget},
    };
    let rig = rig();
    let mut rng = ChaCha8Rng::seed_from_u64(46);
    for round in 0..50 {
        let (mut data, truth) = through_a_rig(&rig);
        let model_sigma = if round % 2 == 0 { 0.0 } else { 3e-3 };
        for point in &mut data.points {
            point.model_sigma = model_sigma;
            let pixels = point.pixels.as_mut().unwrap();
            pixels.at.left.u += rng.random_range(-0.5..0.5);
            pixels.at.right.v += rng.random_range(-0.5..0.5);
        }
        let pose = truth.perturbed(&Vector6::from_fn(|_, _| rng.random_range(-0.05..0.05)));
        let mut pixel_terms = PixelTerms::new(&rig);
        pixel_terms.see(&data.points, TermTarget::Pixels).unwrap();
        let at = |pose: &Transform<Object, Camera>, live: bool| {
            let term = |k: usize, place: &Vector3<f64>| match live {
                true => pixel_terms.live(k, place),
                false => pixel_terms.frozen(k, place),
            };
            linearize(&data.points, pose, &term).unwrap()
        };
        // χ² of the frozen weights: the gradient is minus half of its derivative.
        let here = at(&pose, false);
        for i in 0..6 {
            let cost = |size: f64| at(&pose.perturbed(&Vector6::ith(i, size)), false).cost;
            let expected = -(cost(1e-5) - cost(-1e-5)) / 4e-5;
            let off = (here.gradient[i] - expected).abs();
            assert!(off < 1e-6 * here.gradient.amax(), "round {round}, {i}: {} for {expected}", here.gradient[i]);
        }
        // Σ Jᵀ (Σ_px + σ² D Dᵀ)⁻¹ J with J and D by differences: the sum of the live terms.
        let mut information = nalgebra::Matrix6::zeros();
        for point in &data.points {
            let project = |pose: &Transform<Object, Camera>, model: &Point<Object>| {
                rig.project(&(pose.inverse() * *model)).unwrap().coordinates()
            };
            let mut j = nalgebra::Matrix4x6::zeros();
            for i in 0..6 {
                let by = |size: f64| project(&pose.perturbed(&Vector6::ith(i, size)), &point.model);
                j.set_column(i, &((by(1e-5) - by(-1e-5)) / 2e-5));
            }
            let mut d = nalgebra::Matrix4x3::zeros();
            for i in 0..3 {
                let by = |size: f64| project(&pose, &(point.model + Vector3::ith(i, size)));
                d.set_column(i, &((by(1e-5) - by(-1e-5)) / 2e-5));
            }
            let noise = point.pixels.unwrap().covariance + d * d.transpose() * model_sigma.powi(2);
            information += j.transpose() * noise.try_inverse().unwrap() * j;
        }
        let expected = information.try_inverse().unwrap();
        let off = (at(&pose, true).covariance().unwrap() - expected).amax() / expected.amax();
        assert!(off < 1e-6, "round {round}: {off}");
    }
}
