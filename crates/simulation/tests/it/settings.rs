//! Every setting of a dive has an effect, and a setting of an inactive factor has none (P72 for each setting).
//!
//! The list is complete: a setting outside of both tables fails the test.

use std::collections::{BTreeSet, HashMap};

use seafix_simulation::Mission;
use toml::{Table, Value};

use crate::dives::{Seen, base, seen};

/// A setting, another value for it, the settings that activate it, and the settings that deactivate it.
type Setting = (&'static str, &'static str, &'static str, Option<&'static str>);

const TRANSPONDERS: &str =
    "sensors.lbl.transponders=[[-50.0, -40.0, 38.0], [60.0, -40.0, 39.0], [55.0, 55.0, 37.0], [-40.0, 60.0, 38.5]]";
const NO_TRANSPONDERS: Option<&str> = Some("sensors.lbl.transponders=[]");
const MURKY: &str = "water.attenuation=0.4";
const CLEAR: Option<&str> = Some("water.attenuation=0.0");
const DOME: &str = r#"rig.port.kind="dome""#;
const FLAT: &str = r#"rig.port.kind="flat""#;
const NO_PORT: Option<&str> = Some(r#"rig.port.kind="none""#);
const STILL_WATER: Option<&str> = Some("current.speed=0.0;current.sigma=0.0");
const GIVEN: Option<&str> = Some(r#"prior="sensors""#);
const BY_HAND: &str = "imager.automatic=false";
const RANDOM: &str = r#"site="random""#;
const BUILT: Option<&str> = Some(r#"site="drill-centre""#);
const TOUR: Option<&str> = Some(r#"route.kind="tour""#);
const INSPECTION: &str = r#"route.kind="inspection";rate=0.0"#;

#[rustfmt::skip]
const SETTINGS: &[Setting] = &[
    ("site", r#""karmin2""#, r#"route.kind="orbit""#, None),
    ("rate", "0.7", "", None),
    ("start", "4.0", "", None),
    ("frames", "3", "", None),
    ("prior", r#""sampled""#, "", None),
    ("prior-position", "0.2", r#"prior="sampled""#, GIVEN),
    ("prior-attitude-deg", "0.2", r#"prior="sampled""#, GIVEN),
    ("model-sigma", "0.002", "", None),
    ("model-edges", "0.5", "", None),
    ("survey-sigma", "0.02", "", None),
    ("shadows", "false", "", None),
    ("random.objects", "5", RANDOM, BUILT),
    ("random.points", "5", RANDOM, BUILT),
    ("random.extent", "40.0", RANDOM, BUILT),
    ("random.number", "3", RANDOM, BUILT),
    ("changes.objects", r#"["plet"]"#, "changes.shift=0.2", Some("changes.shift=0.0")),
    ("changes.shift", "0.1", "", None),
    ("changes.settlement", "0.1", "", None),
    ("changes.tilt-deg", "1.0", "", None),
    ("changes.heading-deg", "1.0", "", None),
    ("changes.growth", "0.5", "", None),
    ("changes.rounding", "0.03", "", None),
    ("changes.silt", "0.05", "", None),
    ("changes.occluders", "5", "", None),
    ("rig.size", "[128, 100]", "", None),
    ("rig.focal", "64.0", "", None),
    ("rig.focal-in", r#""water""#, "rig.focal=90.0;rig.port.kind=\"flat\"", NO_PORT),
    ("rig.baseline", "0.3", "", None),
    ("rig.distortion", "[-0.1, 0.0, 0.0, 0.0]", "", None),
    ("rig.at", "[0.2, 0.0, 0.1]", "", None),
    ("rig.ahead-deg", "10.0", "", None),
    ("rig.port.kind", r#""dome""#, "rig.port.offset=[0.0, 0.001, 0.004]", None),
    ("rig.port.distance", "0.05", FLAT, NO_PORT),
    ("rig.port.thickness", "0.02", FLAT, NO_PORT),
    ("rig.port.radius", "0.08", "rig.port.kind=\"dome\";rig.port.offset=[0.0, 0.0, 0.004]", NO_PORT),
    ("rig.port.offset", "[0.001, 0.0, 0.004]", DOME, NO_PORT),
    ("rig.port.glass", "1.7", FLAT, NO_PORT),
    ("rig.port.water", "1.33", FLAT, NO_PORT),
    ("rig.error.focal", "0.001", "", None),
    ("rig.error.principal", "[0.5, 0.0]", "", None),
    ("rig.error.baseline", "0.001", "", None),
    ("rig.error.turn-deg", "[0.0, 0.0, 0.02]", "", None),
    ("imager.exposure-ms", "6.0", BY_HAND, None),
    ("imager.gain", "2.0", BY_HAND, None),
    ("imager.automatic", "false", "", None),
    ("imager.target", "0.5", "", Some(BY_HAND)),
    ("imager.full-well", "8000.0", "", None),
    ("imager.read-noise", "9.0", "", None),
    ("imager.shot-noise", "false", "", None),
    ("imager.prnu", "0.02", "", None),
    ("imager.dsnu", "5.0", "", None),
    ("imager.black", "9.0", "", None),
    ("imager.bits", "12", "", None),
    ("imager.blur", "0.9", "", None),
    ("imager.readout-ms", "30.0", "", None),
    ("imager.sync-ms", "20.0", "", None),
    ("water.attenuation", "0.3", "", None),
    ("water.level", r#""coastal""#, "", None),
    ("water.albedo", "0.5", MURKY, CLEAR),
    ("water.forwardness", "0.5", MURKY, CLEAR),
    ("water.isotropic", "0.2", MURKY, CLEAR),
    ("water.small-angle", "0.6", MURKY, CLEAR),
    ("water.blur", "2.0", MURKY, CLEAR),
    ("water.ambient", "0.1", "", None),
    ("water.snow", "900.0", "", None),
    ("water.snow-radius", "[0.001, 0.004]", "water.snow=900.0", Some("water.snow=0.0")),
    ("lamps", "[{ power = 2.0 }]", "", None),
    ("route.kind", r#""lawnmower""#, "", None),
    ("route.altitude", "3.0", "", None),
    ("route.speed", "0.5", "", None),
    ("route.length", "20.0", "rate=0.0", None),
    ("route.spacing", "5.0", "route.kind=\"lawnmower\";rate=0.0", TOUR),
    ("route.radius", "2.0", r#"route.kind="orbit""#, TOUR),
    ("route.object", r#""plet""#, r#"route.kind="orbit""#, TOUR),
    ("route.stand-off", "1.7", INSPECTION, TOUR),
    ("route.clearance", "1.0", INSPECTION, TOUR),
    ("route.hold", "2.0", INSPECTION, TOUR),
    ("route.waypoints", "[[0.0, 0.0, 4.0], [9.0, 3.0, 4.0]]", "route.kind=\"waypoints\";route.waypoints=[[0.0, 0.0, 4.0], [9.0, 0.0, 4.0]]", TOUR),
    ("vehicle.kind", r#""rail""#, "", None),
    ("vehicle.proportional", "0.5", "", Some(r#"vehicle.kind="rail""#)),
    ("vehicle.derivative", "1.2", "", Some(r#"vehicle.kind="rail""#)),
    ("vehicle.integral", "0.05", "", Some(r#"vehicle.kind="rail""#)),
    ("current.speed", "0.1", "", Some(r#"vehicle.kind="rail""#)),
    ("current.towards-deg", "20.0", "current.speed=0.1", STILL_WATER),
    ("current.roughness", "0.01", "current.speed=0.1;route.altitude=4.0", STILL_WATER),
    ("current.sigma", "0.05", "", None),
    ("current.tau", "20.0", "current.sigma=0.05", STILL_WATER),
    ("sensors.acoustic.from", "[20.0, 0.0, 0.0]", "", None),
    ("sensors.acoustic.at", "[0.0, 0.0, -0.5]", "", None),
    ("sensors.acoustic.range-fraction", "0.01", "", None),
    ("sensors.acoustic.sigma", "0.2", "", None),
    ("sensors.acoustic.rate", "1.0", "", None),
    ("sensors.acoustic.outliers", "1.0", "", None),
    ("sensors.acoustic.dropouts", "1.0", "", None),
    ("sensors.lbl.transponders", "[[-50.0, -40.0, 38.0], [60.0, -40.0, 39.0], [55.0, 55.0, 37.0]]", "", None),
    ("sensors.lbl.survey", "0.2", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.at", "[0.0, 0.0, -0.5]", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.sigma", "0.3", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.sound", "0.002", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.rate", "1.0", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.outliers", "1.0", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.lbl.dropouts", "1.0", TRANSPONDERS, NO_TRANSPONDERS),
    ("sensors.doppler.at", "[0.5, 0.0, 0.0]", "", None),
    ("sensors.doppler.scale", "0.01", "", None),
    ("sensors.doppler.sigma", "0.01", "", None),
    ("sensors.doppler.rate", "2.0", "", None),
    ("sensors.doppler.reach", "[0.4, 2.0]", "", None),
    ("sensors.doppler.latency", "0.3", "", None),
    ("sensors.doppler.dropouts", "0.5", "", None),
    ("sensors.attitude.heading-deg", "1.0", "", None),
    ("sensors.attitude.level-deg", "0.3", "", None),
    ("sensors.attitude.sigma-deg", "0.1", "", None),
    ("sensors.attitude.random-walk", "0.3", "", None),
    ("sensors.attitude.instability", "9.0", "", None),
    ("sensors.attitude.tau", "100.0", "", None),
    ("sensors.attitude.rate", "20.0", "", None),
    ("sensors.attitude.latency", "0.3", "", None),
    ("sensors.attitude.dropouts", "0.5", "", None),
    ("sensors.depth.at", "[0.5, 0.0, 0.2]", "", None),
    ("sensors.depth.bias", "0.3", "", None),
    ("sensors.depth.sigma", "0.1", "", None),
    ("sensors.depth.rate", "2.0", "", None),
    ("sensors.depth.latency", "0.3", "", None),
    ("sensors.depth.dropouts", "0.5", "", None),
    ("faults", r#"[{ device = "depth", kind = "off", from = 1.0, to = 9.0 }]"#, "", None),
    ("points.sigma-px", "0.3", "", None),
    ("points.found", "0.5", "", None),
    ("points.clutter", "20", "", None),
];

/// Settings without an effect on the outputs: the choice between images and points, and the limit of rejection.
const SILENT: [&str; 2] = ["as-points", "clearance"];

/// The table with `settings`, given as `key=value;key=value`.
fn with(table: &Table, settings: &str) -> Table {
    let mut table = table.clone();
    for setting in settings.split(';').filter(|text| !text.is_empty()) {
        let (key, value) = setting.split_once('=').expect("key=value");
        let value = toml::from_str::<Table>(&format!("value={value}")).expect("the value is TOML")["value"].clone();
        let mut keys: Vec<&str> = key.split('.').collect();
        let last = keys.pop().expect("a key has a name");
        let place = keys.iter().fold(&mut table, |at, key| at[*key].as_table_mut().expect("settings are in tables"));
        assert!(place.insert(last.to_owned(), value).is_some(), "unknown setting {key}");
    }
    table
}

fn observe(table: &Table, images: bool) -> Seen {
    seen(&table.clone().try_into::<Mission>().expect("these are settings"), images)
}

/// All settings as dotted keys.
fn leaves(table: &Table, before: &str, into: &mut BTreeSet<String>) {
    for (key, value) in table {
        let name = format!("{before}{key}");
        match value {
            Value::Table(inner) => leaves(inner, &format!("{name}."), into),
            _ => drop(into.insert(name)),
        }
    }
}

#[test]
fn the_list_of_settings_is_complete() {
    let mut there = BTreeSet::new();
    leaves(&Table::try_from(base()).unwrap(), "", &mut there);
    let listed: BTreeSet<String> = SETTINGS.iter().map(|s| s.0).chain(SILENT).map(str::to_owned).collect();
    assert_eq!(there, listed);
}

#[test]
#[ignore = "long: every setting of every factor"]
fn every_setting_does_something_and_nothing_where_its_factor_is_off() {
    let table = Table::try_from(base()).unwrap();
    let mut faults = Vec::new();
    let mut before: HashMap<(String, bool), Seen> = HashMap::new();
    // Whether a change on top of some settings has an effect. Images do not depend on sensors.
    let mut shows = |settings: String, change: &str| {
        let images = !["sensors.", "points.", "prior"].iter().any(|key| change.starts_with(key));
        let table = with(&table, &settings);
        let changed = observe(&with(&table, change), images);
        *before.entry((settings, images)).or_insert_with(|| observe(&table, images)) != changed
    };
    for (key, value, on, off) in SETTINGS {
        let change = format!("{key}={value}");
        if !shows((*on).to_owned(), &change) {
            faults.push(format!("{change} has no effect"));
        }
        if let Some(off) = off.filter(|off| shows(format!("{on};{off}"), &change)) {
            faults.push(format!("{change} has an effect with {off}"));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
