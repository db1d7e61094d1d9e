use nalgebra::{UnitQuaternion, Vector6};
use seafix_geometry::Transform;

use super::*;
use crate::{
    scene::{Changes, Scene, built_in},
    survey::SurveyErrors,
    vehicle::{Track, VehicleState},
};

/// A straight track at 0.5 m/s, 4 m above the seabed.
fn track(seconds: usize) -> Track {
    let state = |k: usize| VehicleState {
        world_from_body: Transform::new(UnitQuaternion::identity(), Vector3::new(0.005 * k as f64, 0.0, 36.0)),
        motion: Vector6::new(0.0, 0.0, 0.0, 0.5, 0.0, 0.0),
    };
    Track { states: (0..=seconds * 100).map(state).collect() }
}

fn scene() -> Scene {
    let none = SurveyErrors { model: 0.0, survey: 0.0 };
    Scene::new(&built_in("drill-centre").unwrap(), &Changes::default(), none, 1)
}

#[test]
fn acoustic_errors_grow_with_the_range_as_stated() {
    // Regression: errors 1.2 times as large as reported fail this test.
    for distance in [100.0, 1000.0] {
        let usbl =
            Acoustic { from: [-distance, 0.0, 36.0], outliers: 0.0, dropouts: 0.0, rate: 50.0, ..Acoustic::default() };
        let track = track(60);
        let fixes = usbl.fixes(&track, 60.0, (1, 0));
        let error = |fix: &TimedReading<Vector3<f64>>| {
            let at = track.at(fix.time).world_from_body.translation();
            let expected = 0.005 * (at - Vector3::from(usbl.from)).norm();
            assert!((fix.arrival - fix.time - 2.0 * (at.x + distance) / 1500.0).abs() < 1e-9);
            (fix.value - at).norm_squared() / 3.0 / (expected * expected)
        };
        let ratio = fixes.iter().map(error).sum::<f64>() / fixes.len() as f64;
        assert!((ratio - 1.0).abs() < 0.05, "{distance}: {ratio}");
    }
}

#[test]
fn the_scale_of_the_doppler_log_is_one_number_a_dive() {
    let (track, scene) = (track(60), scene());
    let quiet = Doppler { sigma: 0.0, scale: 0.01, ..Doppler::default() };
    let mut squares = 0.0;
    for dive in 0..40 {
        let readings = quiet.readings(&track, &scene, 3.0, (1, dive));
        let scale = readings[0].value.x / 0.5;
        assert!(readings.iter().all(|r| (r.value.x / 0.5 - scale).abs() < 1e-12));
        squares += (scale - 1.0).powi(2);
    }
    let spread: f64 = squares / 40.0;
    assert!((spread.sqrt() / 0.01 - 1.0).abs() < 0.3, "{spread}");
    let deaf = Doppler { reach: [0.4, 2.0], ..Doppler::default() };
    assert!(deaf.readings(&track, &scene, 3.0, (1, 0)).is_empty());
}

#[test]
fn the_gyros_allan_deviation_falls_with_the_root_of_time_to_its_floor() {
    // Regression: noise that does not depend on the rate fails this test.
    let sensor = AttitudeSensor { random_walk: 0.15, instability: 0.0, rate: 50.0, ..AttitudeSensor::default() };
    let allan = |sensor: &AttitudeSensor, span: usize| {
        let readings = sensor.readings(&track(600), 600.0, (3, 0));
        let means: Vec<f64> =
            readings.chunks_exact(span).map(|c| c.iter().map(|r| r.value.rate.x).sum::<f64>() / span as f64).collect();
        (means.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / (2.0 * (means.len() - 1) as f64)).sqrt()
    };
    // N/√τ, with the random walk N.
    for span in [50, 200, 800] {
        let expected = 0.15_f64.to_radians() / 60.0 / (span as f64 / 50.0).sqrt();
        assert!((allan(&sensor, span) / expected - 1.0).abs() < 0.25, "{span}");
    }
    let biased = AttitudeSensor { instability: 500.0, tau: 20.0, ..sensor.clone() };
    assert!(allan(&biased, 800) > 3.0 * allan(&sensor, 800));
}

#[test]
fn the_bias_of_the_gyro_has_the_allan_deviation_of_its_process() {
    // The Allan variance of a bias with standard deviation s and time constant T over means of τ (IEEE Std 952) is
    // σ²(τ) = 2 s² T/τ · (1 − T/(2τ)·(3 − 4 e^{−τ/T} + e^{−2τ/T})), with its maximum at about τ = 1.9 T.
    // The test takes the mean of twelve dives.
    let (s, constant) = (200.0_f64, 10.0);
    for rate in [5.0, 20.0] {
        let sensor =
            AttitudeSensor { random_walk: 0.0, instability: s, tau: constant, rate, ..AttitudeSensor::default() };
        for tau in [1.0, 4.0, 19.0, 60.0] {
            let span = (tau * rate) as usize;
            let (mut sum, mut n) = (0.0, 0.0);
            for dive in 0..12 {
                let readings = sensor.readings(&track(600), 600.0, (3, dive));
                for axis in 0..3 {
                    let mean = |c: &[TimedReading<AttitudeReading>]| {
                        c.iter().map(|r| r.value.rate[axis]).sum::<f64>() / span as f64
                    };
                    let means: Vec<f64> = readings.chunks_exact(span).map(mean).collect();
                    sum += means.windows(2).map(|w| 0.5 * (w[1] - w[0]).powi(2)).sum::<f64>();
                    n += (means.len() - 1) as f64;
                }
            }
            let x = constant / tau;
            let bracket = 3.0 - 4.0 * libm::exp(-1.0 / x) + libm::exp(-2.0 / x);
            let exact = 2.0 * x * (1.0 - 0.5 * x * bracket) * (s.to_radians() / 3600.0).powi(2);
            let ratio = (sum / n / exact).sqrt();
            assert!((ratio - 1.0).abs() < 0.08, "{rate} Hz, {tau} s: {ratio}");
        }
    }
}

#[test]
fn what_sensors_state_has_an_error_by_what_is_set() {
    // Normalised squared errors of every sensor over 150 dives: the mean is the number of axes, within four standard
    // errors. A constant error counts once in a dive, noise once in a reading.
    let (track, scene) = (track(12), scene());
    let (mut scale, mut heading, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    let (mut doppler, mut gauge) = (Vec::new(), Vec::new());
    let sensors = Sensors::default();
    let quiet = Doppler { sigma: 0.0, ..Doppler::default() };
    for dive in 0..150 {
        let seeds = (8, dive);
        scale.push((quiet.readings(&track, &scene, 0.1, seeds)[0].value.x / 0.5 - 1.0) / quiet.scale);
        let noisy = Doppler { scale: 0.0, ..sensors.doppler.clone() };
        let errors = noisy.readings(&track, &scene, 10.0, seeds);
        let error = |r: &TimedReading<Vector3<f64>>| (r.value - Vector3::new(0.5, 0.0, 0.0)) / noisy.sigma;
        doppler.extend(errors.iter().map(error).flat_map(|e| [e.x, e.y, e.z]));
        let steady = AttitudeSensor { sigma_deg: 0.0, level_deg: 0.0, ..sensors.attitude.clone() };
        let text = steady.readings(&track, 0.1, seeds)[0].value.world_from_body;
        heading.push(text.scaled_axis().z / steady.heading_deg.to_radians());
        let readings = sensors.depth.readings(&track, 10.0, seeds);
        let mean = readings.iter().map(|r| r.value - 36.0).sum::<f64>() / readings.len() as f64;
        depth.push(mean / sensors.depth.bias.hypot(sensors.depth.sigma / (readings.len() as f64).sqrt()));
        gauge.extend(readings.iter().map(|r| {
            let fraction = 1.0 - 1.0 / readings.len() as f64;
            (r.value - 36.0 - mean) / (sensors.depth.sigma * fraction.sqrt())
        }));
    }
    for (name, errors) in
        [("scale", scale), ("heading", heading), ("depth", depth), ("doppler", doppler), ("gauge", gauge)]
    {
        let n = errors.len() as f64;
        let mean = errors.iter().map(|e| e * e).sum::<f64>() / n;
        assert!((mean - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{name}: {mean} of {n}");
    }
}

#[test]
fn the_prior_pose_has_a_consistent_covariance() {
    let (track, scene) = (track(60), scene());
    let sensors = Sensors { acoustic: Acoustic { outliers: 0.0, ..Acoustic::default() }, ..Sensors::default() };
    let (mut nees, mut n) = (0.0, 0.0);
    for dive in 0..120 {
        let navigation = SensorNavigation::new(&sensors, &[], &track, &scene, 40.0, (9, dive));
        let prior_pose = navigation.at(37.3).unwrap();
        let truth = track.at(37.3).world_from_body;
        let miss = truth.translation() - prior_pose.world_from_body.translation();
        nees += (prior_pose.position.try_inverse().unwrap() * miss).dot(&miss);
        n += 1.0;
        assert!(SensorNavigation::at(&navigation, -1.0).is_none());
    }
    // χ² with three degrees of freedom over 120 dives: 3 ± 0.67 at three standard deviations.
    let mean: f64 = nees / n;
    assert!((mean - 3.0).abs() < 0.9, "{mean}");
}

/// Five transponders about the site, without USBL.
fn among_five() -> Sensors {
    let transponders =
        vec![[-60.0, -50.0, 38.0], [70.0, -40.0, 39.0], [55.0, 65.0, 37.0], [-50.0, 60.0, 40.0], [0.0, 90.0, 36.0]];
    Sensors {
        acoustic: Acoustic { dropouts: 1.0, ..Acoustic::default() },
        lbl: Lbl { transponders, outliers: 0.0, at: [0.3, 0.0, -0.5], ..Lbl::default() },
        ..Sensors::default()
    }
}

#[test]
fn positions_among_transponders_have_a_consistent_covariance() {
    let (track, scene) = (track(60), scene());
    let sensors = among_five();
    let (mut nees, mut n, mut fixes, mut good) = (0.0, 0.0, 0, 0);
    for dive in 0..120 {
        let navigation = SensorNavigation::new(&sensors, &[], &track, &scene, 40.0, (4, dive));
        let prior_pose = navigation.at(37.3).unwrap();
        let miss = track.at(37.3).world_from_body.translation() - prior_pose.world_from_body.translation();
        nees += (prior_pose.position.try_inverse().unwrap() * miss).dot(&miss);
        n += 1.0;
        for reading in navigation.readings().lbl {
            // Some interrogations give too few replies, or contradictory ones.
            let Some(fix) = reading.value.1 else { continue };
            let at = track.at(reading.time).world_from_body * seafix_geometry::Point::new(0.3, 0.0, -0.5);
            assert!((fix.at - at.coords).norm() < 5.0 * fix.sigma.norm());
            // Three replies and the depth suffice, with a larger standard deviation than five replies.
            good += usize::from(fix.sigma.norm() < 0.3);
            fixes += 1;
        }
    }
    let mean: f64 = nees / n;
    assert!((mean - 3.0).abs() < 0.9 && fixes > 120 * 20 && good > 120 * 19, "{mean} {fixes}");
}

#[test]
fn exact_ranges_determine_the_position() {
    let (track, scene) = (track(60), scene());
    let mut sensors = among_five();
    sensors.lbl = Lbl { sigma: 0.0, sound: 0.0, survey: 0.0, dropouts: 0.0, ..sensors.lbl };
    (sensors.depth.sigma, sensors.depth.bias) = (0.0, 0.0);
    (sensors.attitude.heading_deg, sensors.attitude.level_deg, sensors.attitude.sigma_deg) = (0.0, 0.0, 0.0);
    for reading in SensorNavigation::new(&sensors, &[], &track, &scene, 20.0, (4, 0)).readings().lbl {
        let at = track.at(reading.time).world_from_body * seafix_geometry::Point::new(0.3, 0.0, -0.5);
        assert!((reading.value.1.unwrap().at - at.coords).norm() < 1e-6);
        // The last reply comes from the farthest transponder.
        let farthest = reading.value.0.0.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
        assert!((reading.arrival - reading.time - 2.0 * farthest / 1500.0).abs() < 1e-9);
    }
    // LBL without transponders is off, whatever its other settings.
    let none = Sensors { lbl: Lbl { transponders: Vec::new(), sigma: 9.0, ..sensors.lbl }, ..Sensors::default() };
    let text = |sensors: &Sensors| SensorNavigation::new(sensors, &[], &track, &scene, 20.0, (4, 0));
    assert_eq!(text(&none).readings(), text(&Sensors::default()).readings());
    assert_eq!(text(&none).at(15.0), text(&Sensors::default()).at(15.0));
}

#[test]
fn transponders_that_give_no_position_are_rejected() {
    let message = |transponders: Vec<[f64; 3]>| Lbl { transponders, ..Lbl::default() }.check().unwrap_err();
    assert_eq!(message(vec![[0.0; 3]; 2]), "sensors.lbl.transponders = 2; give 3 to 8 positions, or none");
    let twice = message(vec![[0.0; 3], [50.0, 0.0, 0.0], [0.0; 3]]);
    assert!(twice.starts_with("sensors.lbl.transponders[2] = ") && !twice.contains('\n'), "{twice}");
    assert!(message(vec![[f64::NAN; 3]; 3]).contains("= NaN; give a number"));
}

#[test]
fn a_longer_dive_changes_no_earlier_reading() {
    let track = track(60);
    let (short, long) =
        (DepthGauge::default().readings(&track, 5.0, (1, 0)), DepthGauge::default().readings(&track, 50.0, (1, 0)));
    assert_eq!(short, long[..short.len()]);
    let sensor = AttitudeSensor::default();
    let short = sensor.readings(&track, 5.0, (1, 0));
    assert_eq!(short, sensor.readings(&track, 50.0, (1, 0))[..short.len()]);
}
