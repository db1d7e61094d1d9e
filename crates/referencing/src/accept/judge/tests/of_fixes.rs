//! The numbers of a fix: scale, protection levels, and what it reports.

use super::*;

/// The integrity of a fix of six points with this χ² and scale error.
pub(super) fn integrity(chi2: f64, scale_error: Option<ScaleError>) -> Integrity {
    Integrity {
        redundancy: Redundancy::Excludable,
        chi2,
        dof: 12,
        chi2_limit: 32.909,
        solution_separation: None,
        solution_separation_two: None,
        misidentified: None,
        protection: None,
        scale_error,
        depth_error: None,
        consistency: None,
    }
}

/// A scale error of 1 % with σ 0.4 % is 2.5 standard deviations; the square, 6.25, exceeds 3.84 (χ²₁ at 95 %) times the
/// mean of the other eleven degrees of freedom. Points at 10 m then have an error of (1 % + 2 · 0.4 %) · 10 m = 0.18 m.
#[test]
fn a_scale_error_is_rejected_that_is_sure_and_moves_the_object_too_far() {
    let scale_error = |value: f64| Some(ScaleError { value, sigma: 0.004 });
    let of = |distance: f64, chi2: f64, scale_error: Option<ScaleError>| {
        // The distance counts to the centroid of the points, not to the origin of the object.
        let mut scene = Scene::of(octahedron([3.0, 0.0, 1.0]), &Transform::identity());
        scene.acceptance.confidence = 0.95;
        let hypothesis = scene.hypothesis(camera_at(3.0, 0.0, 1.0 - distance), chi2);
        scene.judge(&Kabsch::default(), |judge| judge.as_large_as_modelled(&hypothesis, &integrity(chi2, scale_error)))
    };
    for value in [0.01, -0.01] {
        let rejection = of(10.0, 17.0, scale_error(value)).unwrap_err();
        let RejectionReason::ScaleError { scale_error: reported, off, limit } = rejection else {
            panic!("{rejection}")
        };
        assert!(reported.value == value && close(off, 0.18) && limit == 0.10, "{off}");
    }
    assert_eq!(of(10.0, 17.0, None), Ok(()));
    // (1 % + 0.8 %) of 5.5 m and of 5.6 m: 9.9 cm and 10.08 cm.
    assert!(of(5.5, 17.0, scale_error(0.01)).is_ok() && of(5.6, 17.0, scale_error(0.01)).is_err());
    // 17.8 over eleven is 1.618 and 18 over eleven 1.636, times 3.8415 is 6.216 and 6.286.
    assert!(of(10.0, 6.25 + 17.8, scale_error(0.01)).is_err() && of(10.0, 6.25 + 18.0, scale_error(0.01)).is_ok());
    // Residuals below their noise do not increase the significance: 1.95² is less than 3.84, 1.97² more.
    assert!(of(30.0, 4.0, scale_error(0.0078)).is_ok() && of(30.0, 4.0, scale_error(0.00788)).is_err());
    assert!(of(30.0, 0.5, scale_error(0.0078)).is_ok());
}

/// A depth error of 20 % with σ 4 % displaces by (20 % + 2 · 4 %) of the depth, not of the distance.
#[test]
fn a_depth_error_of_another_medium_is_rejected() {
    let of = |scale: Option<(f64, f64)>, depth: (f64, f64), aside: f64| {
        let mut scene = Scene::of(octahedron([3.0, 0.0, 1.0]), &Transform::identity());
        scene.acceptance.confidence = 0.95;
        let hypothesis = scene.hypothesis(camera_at(3.0 - aside, 0.0, -9.0), 17.0);
        let error = |(value, sigma)| ScaleError { value, sigma };
        let known = Integrity { depth_error: Some(error(depth)), ..integrity(17.0, scale.map(error)) };
        scene.judge(&Kabsch::default(), |judge| judge.as_large_as_modelled(&hypothesis, &known))
    };
    let rejection = of(None, (0.2, 0.04), 8.0).unwrap_err();
    let RejectionReason::DepthError { depth_error, off, limit } = rejection else { panic!("{rejection}") };
    assert!(depth_error.value == 0.2 && close(off, 2.8) && limit == 0.10, "{off}");
    assert_eq!(
        (rejection.reason(), rejection.remedy().as_ref()),
        ("gate", "check the focal length: was the rig calibrated in the same medium, air or water?")
    );
    let message = "depth error: distances along the optical axis are 20.0 % longer than the model's (one sigma 4.0 %), \
                   which may displace the object by 2.80 m, the alert limit is 0.10 m";
    assert_eq!(rejection.to_string(), message);
    assert!(of(None, (-0.2, 0.04), 0.0).unwrap_err().to_string().contains("20.0 % shorter"));
    // 1.9 standard deviations; errors nearer to zero than to −0.25 and 0.33, and a little farther.
    assert_eq!(of(None, (-0.19, 0.1), 0.0), Ok(()));
    assert_eq!(
        [-0.124, -0.125, 0.164, 0.166].map(|value| of(None, (value, 0.01), 0.0).is_ok()),
        [true, false, true, false]
    );
    // A quarter with σ 10 % is tested, one with σ 10.1 % is not, however sure.
    assert!(of(None, (-0.25, 0.1), 0.0).is_err());
    assert_eq!(of(None, (-0.9, 0.101), 0.0), Ok(()));
    // The larger gain is named: 2.5² against 2.6² and 2.4²; the scale error of two equal ones.
    let named = |scale: f64, depth: f64| {
        matches!(of(Some((scale * 0.004, 0.004)), (depth * 0.08, 0.08), 0.0), Err(RejectionReason::DepthError { .. }))
    };
    assert_eq!([(2.5, 2.6), (2.5, 2.4), (2.5, 2.5), (1.0, 2.5)].map(|(s, d)| named(s, d)), [true, false, false, true]);
}

/// A fix from (0, 0, −4) with σ of 1 mrad and 1 cm, and these levels.
fn fixed(scene: &Scene, protection: Option<Protection>) -> Fix {
    let pose = camera_at(0.0, 0.0, -4.0);
    Fix {
        object_from_camera: pose,
        covariance: Covariance6::isotropic(0.001, 0.01),
        pairs: scene.pairs(),
        edges: Vec::new(),
        used: Vec::new(),
        residuals: Vec::new(),
        residual_rms: 0.0,
        score: 0.0,
        integrity: Integrity { protection, ..integrity(0.0, None) },
    }
}

/// Half of the risk of 1e-4 is the radius of 4.749 standard deviations.
#[test]
fn levels_are_raised_to_poses_that_are_no_less_likely_than_a_hundredth_of_the_risk() {
    let scene = Scene::of(octahedron([0.0; 3]), &camera_at(0.0, 0.0, -4.0));
    let other = camera_at(0.03, 0.04, -4.0).perturbed(&Vector6::new(0.0, 0.02, 0.0, 0.0, 0.0, 0.0));
    let known = Protection { position: 0.06, attitude: 0.001 };
    let level = |fraction: f64, known: Option<Protection>| {
        let mut fix = fixed(&scene, known);
        scene.judge(&Kabsch::default(), |judge| judge.cover(&mut fix, std::iter::once((fraction, &other))));
        fix.integrity.protection
    };
    const K: f64 = 4.749_184_042_602_995;
    for fraction in [1.0, COVERED * 1e-4, f64::NAN] {
        let raised = level(fraction, Some(known)).unwrap();
        assert!(close(raised.position, 0.05 + K * 0.01) && close(raised.attitude, 0.02 + K * 0.001), "{raised:?}");
    }
    assert_eq!(level(0.99e-6, Some(known)), Some(known));
    assert_eq!(level(1.0, None), None);
}

/// Levels follow from the remaining risk, never fall below the known ones, and are absent if no risk remains or none
/// were known.
#[test]
fn a_probability_of_being_mistaken_is_taken_from_the_risk_of_a_fix() {
    let mut scene = Scene::of(octahedron([0.0; 3]), &camera_at(0.0, 0.0, -4.0));
    scene.acceptance.moved_part_rate = 0.0;
    let level = |known: Option<Protection>, misidentified: f64| {
        let mut fix = fixed(&scene, known);
        scene.judge(&Kabsch::default(), |judge| judge.protected(&mut fix, misidentified));
        assert_eq!(fix.integrity.misidentified, Some(misidentified));
        fix.integrity.protection
    };
    let low = Protection { position: 0.01, attitude: 0.001 };
    // Half of the remaining 2e-5.
    let of = |risk: f64| Protection::quiet(&Covariance6::isotropic(0.001, 0.01), 0.5 * risk);
    let raised = level(Some(low), 8e-5).unwrap();
    assert!(raised.position >= of(2e-5).position && raised.attitude >= of(2e-5).attitude, "{raised:?}");
    assert!(close(raised.position, of(2e-5).position) && raised.position > of(1e-4).position, "{raised:?}");
    let high = Protection { position: 0.5, attitude: 0.4 };
    assert_eq!(level(Some(high), 8e-5), Some(high));
    assert_eq!((level(None, 8e-5), level(Some(high), 1e-4)), (None, None));
}

/// A fix of six points with an error of δ = 3 σ in one: 12 degrees of freedom, χ² = 7.5, an RMS residual of √(δ² 5/6 /
/// 6).
#[test]
fn a_fix_reports_its_numbers() {
    let mut scene = Scene::of(octahedron([0.0; 3]), &camera_at(0.0, 0.0, -4.0));
    scene.cloud[0].position.at.coords.x += 3.0 * SIGMA;
    let kabsch = Kabsch::default();
    let found = Identification::unproved(scene.pairs(), 6, 0);
    let (outcome, runner_up) = scene.judge(&kabsch, |judge| judge.poses(&found, Some(3e-5)));
    let Outcome::Fix(fix) = outcome else { panic!("{outcome:?}") };
    let known = &fix.integrity;
    assert_eq!((known.dof, known.redundancy, known.misidentified), (12, Redundancy::Excludable, Some(3e-5)));
    assert!((known.chi2 - 7.5).abs() < 1e-3 && close(known.chi2_limit, 32.909_490_407_360_21), "{known:?}");
    assert!((fix.residual_rms - 3.0 * SIGMA * (5.0_f64 / 36.0).sqrt()).abs() < 1e-6, "{}", fix.residual_rms);
    assert!(
        known.solution_separation.is_some() && known.solution_separation_two.is_none() && known.protection.is_some()
    );
    assert_eq!((fix.pairs, fix.used, fix.residuals.len()), (scene.pairs(), vec![0, 1, 2, 3, 4, 5], 6));
    assert_eq!(runner_up, None);
}
