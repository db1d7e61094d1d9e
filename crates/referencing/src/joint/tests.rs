use nalgebra::{Matrix6, Vector2, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{
    Camera, Covariance6, MeasuredLine, NormalOffset, Object, Pinhole, Pixel, Point, StereoPixels, StereoRig,
    StereoSegments, Transform, UncertainPixels, UncertainPoint,
};

use super::*;
use crate::solve::{solver::Solver, stereo_reprojection::StereoReprojection};
use crate::{
    observations::{EdgeObservation, Observation, Observations},
    solve::degeneracy::Degenerate,
};

pub(super) const MODEL: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.1, 0.6, 0.1], [0.2, 0.2, 0.4], [-0.4, 0.3, 0.2]];
pub(super) const SIGMA: f64 = 0.2;

pub(super) fn rig() -> StereoRig {
    let camera = Pinhole::new([1600, 1200], [1348.3; 2], [799.5, 599.5], &[]).unwrap();
    StereoRig::new(camera, camera, Transform::exp(&[0.0, 0.0, 0.0, -0.25, 0.0, 0.0].into())).unwrap()
}

pub(super) fn pose_of(x: f64, turn: f64) -> Transform<Object, Object> {
    Transform::exp(&[0.0, turn, 0.0, x, 0.2 * x, 0.0].into())
}

pub(super) fn instant(k: usize) -> Transform<Object, Camera> {
    Transform::exp(&[0.05 * k as f64, -0.03, 0.1, 0.2 * k as f64, 0.1, -3.0].into())
}

/// Approximately normal, of variance one: the sum of twelve uniform numbers.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// The observations of one instant of objects at their true poses, with `noise` times σ of pixel noise.
pub(super) fn object_observations(
    rig: &StereoRig,
    places: &[Transform<Object, Object>],
    k: usize,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> ObjectObservations {
    let mut points = Vec::new();
    for (object, place) in places.iter().enumerate() {
        for at in MODEL {
            let model = Point::from(at);
            let exact = rig.project(&(instant(k).inverse() * (*place * model))).unwrap();
            let mut off =
                |p: Pixel| Pixel { u: p.u + noise * SIGMA * normal(rng), v: p.v + noise * SIGMA * normal(rng) };
            let seen = StereoPixels { left: off(exact.left), right: off(exact.right) };
            let pixels = UncertainPixels::independent(seen, SIGMA);
            let found = rig.triangulate(&pixels).unwrap();
            let measured = UncertainPoint { at: found.point, covariance: found.covariance };
            points.push((object, Observation { measured, pixels: Some(pixels), model, model_sigma: 0.0 }));
        }
    }
    ObjectObservations { points, ..ObjectObservations::default() }
}

/// The straight edges between points of an object, measured at one instant with `noise` times 0.1 px of offsets.
pub(super) fn observed_edges(
    rig: &StereoRig,
    place: &Transform<Object, Object>,
    k: usize,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<EdgeObservation> {
    let edge = |ends: [usize; 2], rng: &mut ChaCha8Rng| {
        let model = ends.map(|end| Point::from(MODEL[end]));
        let ends = model.map(|end| instant(k).inverse() * (*place * end));
        let seen = ends.map(|end| rig.project(&end).unwrap());
        let mut halves = |a: Pixel, b: Pixel| {
            let along = Vector2::new(b.u - a.u, b.v - a.v);
            let normal_of_line = Vector2::new(-along.y, along.x).normalize();
            [0.2, 0.8].map(|t| {
                let error = 0.1 * noise * normal(rng);
                let (u, v) =
                    (a.u + t * along.x + error * normal_of_line.x, a.v + t * along.y + error * normal_of_line.y);
                NormalOffset { at: Pixel { u, v }, normal: normal_of_line, sigma: 0.1, texture: 0.0, common: 0.0 }
            })
        };
        let segments =
            StereoSegments { left: halves(seen[0].left, seen[1].left), right: halves(seen[0].right, seen[1].right) };
        let offsets = nalgebra::Matrix4::identity() * 1e-6;
        let measured = MeasuredLine { ends, offsets, segments: Some(segments), depth: true };
        EdgeObservation { measured, model, model_sigmas: [0.0; 2] }
    };
    [[1, 2], [2, 3], [3, 4], [4, 1], [0, 3]].map(|ends| edge(ends, rng)).to_vec()
}

/// Edges take part like points: of three objects one shows points alone, one both, one edges alone. The poses are
/// consistent (NEES), χ² has its mean, and the fix is more accurate than that of the points.
///
/// Fails if an edge moves with the camera alone, and not with its object.
#[test]
fn edges_take_part_in_a_joint_fix() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(9));
    let survey = Covariance6::<Object, Object>::isotropic(5e-3, 5e-3);
    let stated = [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)];
    let placements = [Placement::Exact, Placement::Surveyed(survey), Placement::Surveyed(survey)];
    let members: Vec<Member> = stated
        .iter()
        .zip(placements)
        .map(|(&site_from_object, placement)| Member { site_from_object, placement })
        .collect();
    let draws = 300;
    let (mut nees, mut chi2, mut dof, mut errors) = (0.0, 0.0, 0, [0.0; 2]);
    for _ in 0..draws {
        let mut truly = stated;
        for place in &mut truly[1..] {
            *place = place.perturbed(&(Vector6::from_fn(|_, _| normal(&mut rng)) * 5e-3));
        }
        let mut seen = object_observations(&rig, &truly, 1, 1.0, &mut rng);
        seen.points.retain(|(object, _)| *object < 2);
        let points = seen.clone();
        for object in [1, 2] {
            let edges = observed_edges(&rig, &truly[object], 1, 1.0, &mut rng);
            seen.edges.extend(edges.into_iter().map(|edge| (object, edge)));
        }
        let fix = joint_fix(&rig, &members, &[seen]).unwrap();
        let (pose, covariance) = fix.object_from_camera(0, 2);
        let xi = pose.error_to(&(truly[2].inverse() * instant(1)));
        nees += xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)) / f64::from(draws);
        (chi2, dof) = (chi2 + fix.chi2 / f64::from(draws), fix.dof);
        let alone = joint_fix(&rig, &members, &[points]).unwrap();
        let truth = (truly[1].inverse() * instant(1)).translation();
        for (sum, fix) in errors.iter_mut().zip([&fix, &alone]) {
            *sum += (fix.object_from_camera(0, 1).0.translation() - truth).norm_squared();
        }
    }
    assert!((nees - 6.0).abs() < 4.0 * (12.0 / f64::from(draws)).sqrt(), "{nees}");
    let spread = 4.0 * (2.0 * dof as f64 / f64::from(draws)).sqrt();
    assert!((chi2 - dof as f64).abs() < spread, "{chi2} of {dof}");
    assert!(errors[0] < 0.9 * errors[1], "{errors:?}");
}

/// Where the points determine no pose, the joint fix starts from an object's own fix.
#[test]
fn edges_alone_have_a_joint_fix() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(10));
    let places = [pose_of(0.0, 0.0), pose_of(0.8, 0.3)];
    let members = places.map(|site_from_object| Member { site_from_object, placement: Placement::Exact });
    let mut seen = ObjectObservations::default();
    for (object, place) in places.iter().enumerate() {
        let edges = observed_edges(&rig, place, 1, 0.0, &mut rng);
        seen.edges.extend(edges.into_iter().map(|edge| (object, edge)));
    }
    assert_eq!(joint_fix(&rig, &members, &[seen.clone()]), Err(Degenerate::TooFew { found: 0, needed: 3 }));
    let off = Vector6::new(0.02, -0.01, 0.02, 0.03, -0.02, 0.04);
    seen.poses.push((1, (places[1].inverse() * instant(1)).perturbed(&off)));
    let fix = joint_fix(&rig, &members, &[seen]).unwrap();
    assert!(fix.site_from_camera[0].0.error_to(&instant(1)).amax() < 1e-9, "{}", fix.chi2);
    assert_eq!(fix.dof, 34);
}

#[test]
fn one_object_alone_is_the_fix_of_one_object() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(1));
    let seen = object_observations(&rig, &[pose_of(0.0, 0.0)], 1, 1.0, &mut rng);
    let data =
        Observations { points: seen.points.iter().map(|(_, p)| *p).collect(), edges: Vec::new(), rig: Some(&rig) };
    let expected = StereoReprojection::default().solve(&data).unwrap();
    let covariance = StereoReprojection::default().covariance(&data, &expected).unwrap();
    let member = Member { site_from_object: pose_of(0.0, 0.0), placement: Placement::Exact };
    let fix = joint_fix(&rig, &[member], &[seen]).unwrap();
    let (pose, own) = &fix.site_from_camera[0];
    assert!(expected.error_to(pose).amax() < 1e-10);
    assert!((own.matrix - covariance.matrix).amax() < 1e-8 * covariance.matrix.amax());
    assert_eq!(fix.dof, 14);
}

#[test]
fn a_displaced_object_is_found_where_it_is() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(2));
    let (message, truly) = (pose_of(0.8, 0.0), pose_of(0.86, 0.05));
    let seen = [0, 1].map(|k| object_observations(&rig, &[pose_of(0.0, 0.0), truly], k, 0.0, &mut rng));
    let members = |of_second| {
        [
            Member { site_from_object: pose_of(0.0, 0.0), placement: Placement::Exact },
            Member { site_from_object: message, placement: of_second },
        ]
    };
    let fix = joint_fix(&rig, &members(Placement::Displaced), &seen).unwrap();
    assert!(fix.chi2 < 1e-8, "{}", fix.chi2);
    assert!(truly.error_to(&fix.site_from_object[1].0).amax() < 1e-8);
    for k in [0, 1] {
        assert!(instant(k).error_to(&fix.site_from_camera[k].0).amax() < 1e-8);
    }
    // Taken at its surveyed pose, it corrupts the fix, and χ² shows it.
    let misled = joint_fix(&rig, &members(Placement::Exact), &seen).unwrap();
    assert!(misled.chi2 > 100.0 * misled.dof as f64, "{}", misled.chi2);
    // A displaced object alone in view does not determine the pose in the site.
    let points = seen[0].points.iter().filter(|(object, _)| *object == 1).copied().collect();
    let alone = ObjectObservations { points, ..ObjectObservations::default() };
    let rejected = joint_fix(&rig, &members(Placement::Displaced), &[alone]);
    assert!(matches!(rejected, Err(Degenerate::Singular { fraction, min }) if fraction <= min), "{rejected:?}");
    let few = ObjectObservations { points: seen[0].points[..2].to_vec(), ..ObjectObservations::default() };
    let rejected = joint_fix(&rig, &members(Placement::Exact), &[few]);
    assert_eq!(rejected, Err(Degenerate::TooFew { found: 2, needed: 3 }));
}

/// A survey with errors by its covariance, one error per object for all points and both instants: the normalised error
/// of the poses follows χ²₆, and the fix improves the surveyed object poses.
#[test]
fn a_survey_is_one_error_an_object() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(3));
    let survey =
        Covariance6::<Object, Object>::new(Matrix6::from_diagonal(&[1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4].into()));
    let draws = 400;
    let (mut nees, mut chi2, mut dof) = (0.0, 0.0, 0);
    for _ in 0..draws {
        let message = [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)];
        let mut truly = message;
        for place in &mut truly[1..] {
            *place = place.perturbed(&(Vector6::from_fn(|_, _| normal(&mut rng)) * 1e-2));
        }
        let seen = [0, 1].map(|k| object_observations(&rig, &truly, k, 1.0, &mut rng));
        let members: Vec<Member> = message
            .iter()
            .enumerate()
            .map(|(o, &site_from_object)| Member {
                site_from_object,
                placement: if o == 0 { Placement::Exact } else { Placement::Surveyed(survey) },
            })
            .collect();
        let fix = joint_fix(&rig, &members, &seen).unwrap();
        let (pose, covariance) = &fix.site_from_camera[1];
        let xi = pose.error_to(&instant(1));
        nees += xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)) / f64::from(draws);
        (chi2, dof) = (chi2 + fix.chi2 / f64::from(draws), fix.dof);
        assert!(fix.site_from_object[1].1.matrix.trace() < survey.matrix.trace());
    }
    // Four standard deviations of the mean.
    assert!((nees - 6.0).abs() < 4.0 * (12.0 / f64::from(draws)).sqrt(), "{nees}");
    let spread = 4.0 * (2.0 * dof as f64 / f64::from(draws)).sqrt();
    assert!((chi2 - dof as f64).abs() < spread, "{chi2} of {dof}");
}

/// The common part of the errors cancels relative to an object: with a precise survey the pose relative to each object
/// is consistent (NEES), and more accurate than from that object's own points.
#[test]
fn relative_to_each_object_the_fix_is_better_than_its_own() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(4));
    let survey = Covariance6::<Object, Object>::isotropic(5e-4, 5e-4);
    let message = [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)];
    let members: Vec<Member> = message
        .iter()
        .map(|&site_from_object| Member { site_from_object, placement: Placement::Surveyed(survey) })
        .collect();
    let draws = 300;
    let (mut nees, mut joint, mut alone) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for _ in 0..draws {
        let truly = message.map(|place| place.perturbed(&(Vector6::from_fn(|_, _| normal(&mut rng)) * 5e-4)));
        let seen = [0, 1].map(|k| object_observations(&rig, &truly, k, 1.0, &mut rng));
        let fixes = joint_fixes(&rig, &members, &seen, 0.9999).expect("a consistent draw");
        assert_eq!(fixes.displaced, Vec::<usize>::new());
        for object in 0..3 {
            let truth = truly[object].inverse() * instant(1);
            let (pose, covariance) = fixes.object_from_camera[object].unwrap();
            let xi = pose.error_to(&truth);
            nees[object] += xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)) / f64::from(draws);
            joint[object] += xi.fixed_rows::<3>(3).norm_squared();
            let own = seen[1].points.iter().filter(|(o, _)| *o == object).map(|(_, p)| *p).collect();
            let own = StereoReprojection::default()
                .solve(&Observations { points: own, edges: Vec::new(), rig: Some(&rig) })
                .unwrap();
            alone[object] += own.error_to(&truth).fixed_rows::<3>(3).norm_squared();
        }
    }
    for object in 0..3 {
        // Four standard deviations of the mean.
        assert!((nees[object] - 6.0).abs() < 4.0 * (12.0 / f64::from(draws)).sqrt(), "{nees:?}");
        assert!(joint[object] < 0.5 * alone[object], "{object}: {joint:?} {alone:?}");
    }
}

/// Three surveyed objects and their true poses; the second is displaced.
fn one_displaced() -> (Vec<Member>, [Transform<Object, Object>; 3]) {
    let survey = Covariance6::<Object, Object>::isotropic(1e-3, 1e-3);
    let message = [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)];
    let member = |&site_from_object| Member { site_from_object, placement: Placement::Surveyed(survey) };
    let members: Vec<Member> = message.iter().map(member).collect();
    let mut truly = message;
    truly[1] = pose_of(0.86, 0.05);
    (members, truly)
}

#[test]
fn a_survey_that_the_images_contradict_is_given_up() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(5));
    let (members, truly) = one_displaced();
    let seen = object_observations(&rig, &truly, 1, 1.0, &mut rng);
    let fixes = joint_fixes(&rig, &members, std::slice::from_ref(&seen), 0.999).unwrap();
    assert_eq!(fixes.displaced, [1]);
    for (object, place) in truly.iter().enumerate() {
        let truth = place.inverse() * instant(1);
        let (pose, covariance) = fixes.object_from_camera[object].unwrap();
        let xi = pose.error_to(&truth);
        assert!(xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)) < 30.0, "{object}");
    }
    // Points that no rigid objects explain are rejected for every choice of surveys.
    let mut torn = seen;
    for (k, (_, point)) in torn.points.iter_mut().enumerate() {
        point.pixels.as_mut().unwrap().at.left.v += 20.0 * f64::from(u8::try_from(k % 3).unwrap());
    }
    match joint_fixes(&rig, &members, &[torn], 0.999) {
        Err(Unjoined::Contradiction { chi2, limit }) => assert!(chi2 > limit, "{chi2} {limit}"),
        other => panic!("{other:?}"),
    }
    let none = Err(Unjoined::Degenerate(Degenerate::TooFew { found: 0, needed: 3 }));
    assert_eq!(joint_fixes(&rig, &members, &[], 0.999), none);
}

/// A joint fix is never worse than the best single fix: at equal poses the covariance relative to an object is at most
/// that of its own points, in every direction, for any survey and any number of points of other objects.
///
/// Fails if the correlation of camera and object pose does not cancel.
#[test]
fn no_direction_is_known_worse_than_from_the_object_alone() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(9));
    let message = [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)];
    for round in 0..40 {
        let survey = 10f64.powf(rng.random_range(-5.0..-1.0));
        let members: Vec<Member> = message
            .iter()
            .map(|&site_from_object| Member {
                site_from_object,
                placement: Placement::Surveyed(Covariance6::isotropic(survey, survey)),
            })
            .collect();
        let mut seen = object_observations(&rig, &message, 1, 0.0, &mut rng);
        let few = round % 3;
        let mut shown = [0; 3];
        seen.points.retain(|(object, _)| {
            shown[*object] += 1;
            *object == 0 || shown[*object] <= 5 - 2 * few
        });
        let fixes = joint_fixes(&rig, &members, std::slice::from_ref(&seen), 0.999).unwrap();
        for object in 0..3 {
            let own: Vec<Observation> = seen.points.iter().filter(|(o, _)| *o == object).map(|(_, p)| *p).collect();
            let data = Observations { points: own, edges: Vec::new(), rig: Some(&rig) };
            let Ok(pose) = StereoReprojection::default().solve(&data) else { continue };
            let alone = StereoReprojection::default().covariance(&data, &pose).unwrap().matrix;
            let joint = fixes.object_from_camera[object].unwrap().1.matrix;
            let gain = (alone - joint).symmetric_eigenvalues().min();
            assert!(gain > -1e-6 * alone.amax(), "round {round}, object {object}: {gain:e} of {:e}", alone.amax());
        }
    }
}

/// The two points of a displaced object are excluded, not the survey of another object.
///
/// Fails if an object with one point may be displaced.
#[test]
fn of_an_object_of_two_points_the_points_are_given_up() {
    let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(10));
    let (members, truly) = one_displaced();
    let mut seen = object_observations(&rig, &truly, 1, 1.0, &mut rng);
    let mut shown = 0;
    seen.points.retain(|(object, _)| {
        shown += usize::from(*object == 1);
        *object != 1 || shown <= 2
    });
    let fixes = joint_fixes(&rig, &members, &[seen], 0.999).unwrap();
    assert_eq!((fixes.displaced, fixes.left_out), (vec![], vec![1]));
    assert!(fixes.object_from_camera[1].is_none());
    assert!(fixes.chi2 <= fixes.chi2_limit);
}
