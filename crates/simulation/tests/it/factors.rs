//! A factor of magnitude 0 gives the same bits as no factor, and a factor with a magnitude has an effect.

use seafix_simulation::{
    Imager, Mission,
    optics::{Lamp, Port, PortKind, Water},
    scene::Changes,
    sensors::{DeviceFault, FaultKind, FaultyDevice},
    vehicle::{Current, Route, RouteKind, Vehicle, VehicleKind},
};

use crate::dives::{base, seen};

/// A factor: name, activation with magnitude 0, activation with an effect.
type Factor = (&'static str, fn(&mut Mission), fn(&mut Mission));

fn fault(device: FaultyDevice, kind: FaultKind, to: f64, amount: f64) -> DeviceFault {
    DeviceFault { device, kind, from: 1.0, to, amount }
}

const DEVICES: [FaultyDevice; 6] = [
    FaultyDevice::Images,
    FaultyDevice::Acoustic,
    FaultyDevice::Lbl,
    FaultyDevice::Doppler,
    FaultyDevice::Attitude,
    FaultyDevice::Depth,
];

/// Four transponders about the site.
fn transponders() -> Vec<[f64; 3]> {
    vec![[-50.0, -40.0, 38.0], [60.0, -40.0, 39.0], [55.0, 55.0, 37.0], [-40.0, 60.0, 38.5]]
}

/// Changes that list one object and do not change it.
fn named() -> Changes {
    Changes { objects: vec!["manifold".into()], ..Changes::default() }
}

const FACTORS: &[Factor] = &[
    (
        "turbidity",
        |m| {
            m.water =
                Water { albedo: 0.5, forwardness: 0.3, isotropic: 0.4, small_angle: 0.9, blur: 3.0, ..m.water.clone() }
        },
        |m| m.water.attenuation = 0.3,
    ),
    (
        "named water",
        |m| m.water = Water { level: "none".into(), attenuation: 1.0, ..m.water.clone() },
        |m| m.water.level = "coastal".into(),
    ),
    ("snow", |m| m.water.snow_radius = [0.002, 0.004], |m| m.water.snow = 900.0),
    ("daylight", |m| m.water.ambient = 0.0, |m| m.water.ambient = 0.2),
    (
        "a port",
        |m| m.rig.port = Port { distance: 0.1, thickness: 0.05, glass: 1.7, water: 1.4, ..Port::default() },
        |m| m.rig.port = Port { kind: PortKind::Dome, offset: [0.0, 0.002, 0.005], ..Port::default() },
    ),
    ("distortion", |m| m.rig.distortion = vec![0.0; 5], |m| m.rig.distortion = vec![-0.1, 0.0, 0.0, 0.0]),
    ("an error of the calibration", |m| m.rig.error.turn_deg = [0.0; 3], |m| m.rig.error.turn_deg = [0.02, 0.0, 0.0]),
    ("an error of the focal length", |m| m.rig.error.focal = 0.0, |m| m.rig.error.focal = 0.001),
    ("an error of the baseline", |m| m.rig.error.baseline = 0.0, |m| m.rig.error.baseline = 0.001),
    ("a lamp", |m| m.lamps.push(Lamp { power: 0.0, ..Lamp::default() }), |m| m.lamps.push(Lamp::default())),
    (
        "a current",
        |m| m.current = Current { towards_deg: 10.0, roughness: 0.01, tau: 9.0, ..m.current.clone() },
        |m| {
            m.current.speed = 0.1;
        },
    ),
    ("a gusty current", |m| m.current.tau = 1.0, |m| m.current.sigma = 0.05),
    ("a shift", |m| m.changes = named(), |m| m.changes = Changes { shift: 0.2, ..named() }),
    ("a settlement", |m| m.changes = named(), |m| m.changes = Changes { settlement: 0.05, ..named() }),
    ("a tilt", |m| m.changes = named(), |m| m.changes = Changes { tilt_deg: 1.0, ..named() }),
    ("a heading", |m| m.changes = named(), |m| m.changes = Changes { heading_deg: 2.0, ..named() }),
    ("growth", |m| m.changes = named(), |m| m.changes = Changes { growth: 0.9, ..Changes::default() }),
    ("rounded corners", |m| m.changes = named(), |m| m.changes = Changes { rounding: 0.04, ..Changes::default() }),
    ("silt", |m| m.changes = named(), |m| m.changes = Changes { silt: 0.1, ..Changes::default() }),
    ("things in the way", |m| m.changes = named(), |m| m.changes = Changes { occluders: 9, ..Changes::default() }),
    (
        "devices that fail at no time",
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Off, 1.0, 0.5))),
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Off, 9.0, 0.5))),
    ),
    (
        "devices that lose nothing",
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Intermittent, 9.0, 0.0))),
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Intermittent, 9.0, 0.9))),
    ),
    (
        "devices that are late by nothing",
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Delayed, 9.0, 0.0))),
        |m| m.faults.extend(DEVICES.map(|device| fault(device, FaultKind::Delayed, 9.0, 0.4))),
    ),
    ("a place of the cameras", |m| m.rig.at = [0.0; 3], |m| m.rig.at = [0.4, 0.1, 0.2]),
    ("a place of the log", |m| m.sensors.doppler.at = [0.0; 3], |m| m.sensors.doppler.at = [-0.5, 0.0, 0.2]),
    ("a place of the transponder", |m| m.sensors.acoustic.at = [0.0; 3], |m| m.sensors.acoustic.at = [0.0, 0.0, -0.6]),
    ("a place of the gauge", |m| m.sensors.depth.at = [0.0; 3], |m| m.sensors.depth.at = [0.5, 0.0, 0.3]),
    (
        "transponders",
        |m| {
            m.sensors.lbl.sigma = 9.0;
            m.sensors.lbl.sound = 0.1;
            m.sensors.lbl.survey = 9.0;
        },
        |m| m.sensors.lbl.transponders = transponders(),
    ),
    ("an imprecise model", |m| m.model_sigma = 0.001, |m| m.model_sigma = 0.004),
];

#[test]
fn a_factor_of_magnitude_zero_is_a_factor_left_out() {
    let plain = seen(&base(), true);
    assert!(plain.poses.iter().any(|pose| pose.contains("VisiblePoint")), "no point is in view");
    for (name, nothing, something) in FACTORS {
        let with = |change: &fn(&mut Mission)| {
            let mut mission = base();
            change(&mut mission);
            seen(&mission, true)
        };
        assert!(with(nothing) == plain, "{name} of magnitude 0 has an effect");
        assert!(with(something) != plain, "{name} has no effect");
    }
}

#[test]
fn while_nothing_moves_no_time_is_seen() {
    let rest = Mission {
        route: Route { kind: RouteKind::Approach, speed: 0.0, length: 0.3, ..Route::default() },
        vehicle: Vehicle { kind: VehicleKind::Rail, ..Vehicle::default() },
        imager: Imager { automatic: false, ..Imager::default() },
        ..base()
    };
    let slow =
        |m: &Mission| Mission { imager: Imager { readout_ms: 20.0, sync_ms: 30.0, ..m.imager.clone() }, ..m.clone() };
    assert!(seen(&slow(&rest), true) == seen(&rest, true));
    let moving = Mission { route: Route { speed: 0.4, ..Route::default() }, ..rest };
    assert!(seen(&slow(&moving), true) != seen(&moving, true));
}
