use nalgebra::{UnitQuaternion, Vector6};
use seafix_geometry::Transform;

use super::*;
use crate::{
    field::{Changes, Field, built_in},
    survey::SurveyErrors,
    vehicle::{State, Track},
};

/// Straight ahead at half a metre a second, 4 m above the bed.
fn track(seconds: usize) -> Track {
    let state = |k: usize| State {
        world_from_body: Transform::new(UnitQuaternion::identity(), Vector3::new(0.005 * k as f64, 0.0, 36.0)),
        motion: Vector6::new(0.0, 0.0, 0.0, 0.5, 0.0, 0.0),
    };
    Track { states: (0..=seconds * 100).map(state).collect() }
}

fn field() -> Field {
    let none = SurveyErrors { model: 0.0, survey: 0.0 };
    Field::new(&built_in("drill-centre").unwrap(), &Changes::default(), none, 1)
}

#[test]
fn acoustic_errors_grow_with_the_range_as_said() {
    for distance in [100.0, 1000.0] {
        let usbl =
            Acoustic { from: [-distance, 0.0, 36.0], outliers: 0.0, dropouts: 0.0, rate: 50.0, ..Acoustic::default() };
        let track = track(60);
        let fixes = usbl.fixes(&track, 60.0, (1, 0));
        let error = |fix: &Reading<Vector3<f64>>| {
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
    let (track, field) = (track(60), field());
    let quiet = Doppler { sigma: 0.0, scale: 0.01, ..Doppler::default() };
    let mut squares = 0.0;
    for dive in 0..40 {
        let readings = quiet.readings(&track, &field, 3.0, (1, dive));
        let scale = readings[0].value.x / 0.5;
        assert!(readings.iter().all(|r| (r.value.x / 0.5 - scale).abs() < 1e-12));
        squares += (scale - 1.0).powi(2);
    }
    let spread: f64 = squares / 40.0;
    assert!((spread.sqrt() / 0.01 - 1.0).abs() < 0.3, "{spread}");
    let deaf = Doppler { reach: [0.4, 2.0], ..Doppler::default() };
    assert!(deaf.readings(&track, &field, 3.0, (1, 0)).is_empty());
}

#[test]
fn the_gyros_allan_deviation_falls_with_the_root_of_time_to_its_floor() {
    let sensor = AttitudeSensor { random_walk: 0.15, instability: 0.0, rate: 50.0, ..AttitudeSensor::default() };
    let allan = |sensor: &AttitudeSensor, span: usize| {
        let readings = sensor.readings(&track(600), 600.0, (3, 0));
        let means: Vec<f64> =
            readings.chunks_exact(span).map(|c| c.iter().map(|r| r.value.rate.x).sum::<f64>() / span as f64).collect();
        (means.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / (2.0 * (means.len() - 1) as f64)).sqrt()
    };
    // N/√τ with N the random walk.
    for span in [50, 200, 800] {
        let expected = 0.15_f64.to_radians() / 60.0 / (span as f64 / 50.0).sqrt();
        assert!((allan(&sensor, span) / expected - 1.0).abs() < 0.25, "{span}");
    }
    let biased = AttitudeSensor { instability: 500.0, tau: 20.0, ..sensor.clone() };
    assert!(allan(&biased, 800) > 3.0 * allan(&sensor, 800));
}

#[test]
fn the_rough_pose_errs_as_its_covariance_says() {
    let (track, field) = (track(60), field());
    let sensors = Sensors { acoustic: Acoustic { outliers: 0.0, ..Acoustic::default() }, ..Sensors::default() };
    let (mut nees, mut n) = (0.0, 0.0);
    for dive in 0..120 {
        let navigation = Navigation::new(&sensors, &[], &track, &field, 40.0, (9, dive));
        let rough = navigation.at(37.3).unwrap();
        let truth = track.at(37.3).world_from_body;
        let miss = truth.translation() - rough.world_from_body.translation();
        nees += (rough.position.try_inverse().unwrap() * miss).dot(&miss);
        n += 1.0;
        assert!(Navigation::at(&navigation, -1.0).is_none());
    }
    // χ² of three degrees of freedom over 120 dives: 3 ± 0.67 at three standard deviations.
    let mean: f64 = nees / n;
    assert!((mean - 3.0).abs() < 0.9, "{mean}");
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
