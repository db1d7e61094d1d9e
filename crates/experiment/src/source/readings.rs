//! What the navigation sensors of a dive said, to an odometry and as tables beside its data set, and where its route led.

use std::fmt::Write;

use nalgebra::{Matrix3, Vector3};
use seafix_navigation::{Device, Reading as Told};
use seafix_simulation::{PlannedMission, sensors::Reading};

use super::Heard;

/// What the Doppler log and the gyro told, and how much noise their data sheets say is in it.
pub(super) fn heard(mission: &PlannedMission) -> Heard {
    let readings = mission.readings();
    let noise = Noise::of(mission);
    let told = |device, time: f64, arrival: f64, value: Vector3<f64>, sigma: f64| {
        let covariance = Matrix3::identity() * (sigma * sigma);
        (mission.stamp(arrival), Told { device, stamp_ns: mission.stamp(time), value, covariance })
    };
    let doppler = readings.doppler.iter().map(|r| told(Device::Doppler, r.time, r.arrival, r.value, noise.doppler));
    let gyro = readings.attitude.iter().map(|r| told(Device::Gyro, r.time, r.arrival, r.value.rate, noise.gyro));
    Heard::new(doppler.chain(gyro).collect())
}

/// Standard deviations of the noise of a reading, each axis: velocity (m/s), rate of turn (rad/s).
struct Noise {
    doppler: f64,
    gyro: f64,
}

impl Noise {
    fn of(mission: &PlannedMission) -> Self {
        let sensors = &mission.settings().sensors;
        Self { doppler: sensors.doppler.sigma, gyro: sensors.attitude.rate_sigma() }
    }
}

/// The tables, by the names of their files.
pub(super) fn tables(mission: &PlannedMission) -> Vec<(String, String)> {
    let readings = mission.readings();
    let axes = |name: &str| ["x", "y", "z"].map(|axis| format!("{name}{axis}")).join(",");
    let acoustic = table("north,east,down,sigma", &readings.acoustic, mission, |fix| {
        [fix.at.x, fix.at.y, fix.at.z, fix.sigma].to_vec()
    });
    let noise = Noise::of(mission);
    let with_sigma = |v: &Vector3<f64>, sigma: f64| v.iter().copied().chain([sigma]).collect();
    let doppler = table(&format!("{},sigma", axes("v")), &readings.doppler, mission, |v| with_sigma(v, noise.doppler));
    let gyro =
        table(&format!("{},sigma", axes("w")), &readings.attitude, mission, |said| with_sigma(&said.rate, noise.gyro));
    let attitude = table(&format!("{},qx,qy,qz,qw", axes("w")), &readings.attitude, mission, |said| {
        let q = said.world_from_body;
        said.rate.iter().copied().chain([q.i, q.j, q.k, q.w]).collect()
    });
    let depth = table("depth", &readings.depth, mission, |depth| vec![*depth]);
    let places = mission.waypoints().into_iter().map(|[north, east, height]| format!("{north},{east},{height}\n"));
    let route = std::iter::once("north,east,height\n".to_owned()).chain(places).collect();
    let all = [("acoustic", acoustic), ("doppler", doppler), ("gyro", gyro), ("attitude", attitude), ("depth", depth)];
    let all = all.into_iter().chain([("waypoints", route)]);
    all.chain(lbl(mission)).map(|(name, table)| (format!("{name}.csv"), table)).collect()
}

/// Transponders as surveyed, the ranges to them, and the positions by them; nothing where there are none.
fn lbl(mission: &PlannedMission) -> Vec<(&'static str, String)> {
    let places = &mission.settings().sensors.lbl.transponders;
    if places.is_empty() {
        return Vec::new();
    }
    let mut transponders = "transponder,north,east,down\n".to_owned();
    let mut ranges = "stamp_ns,arrival_ns,transponder,range\n".to_owned();
    let mut positions = "stamp_ns,arrival_ns,north,east,down,sigma_north,sigma_east,sigma_down\n".to_owned();
    let put = |table: &mut String, line: std::fmt::Arguments<'_>| {
        table.write_fmt(line).expect("a string takes all");
        table.push('\n');
    };
    for (k, [north, east, down]) in places.iter().enumerate() {
        put(&mut transponders, format_args!("{k},{north},{east},{down}"));
    }
    for answer in mission.readings().lbl {
        let [stamp, arrival] = [answer.time, answer.arrival].map(|time| mission.stamp(time));
        let (heard, fix) = &answer.value;
        for (k, range) in heard.0.iter().take(places.len()).enumerate() {
            if let Some(range) = range {
                put(&mut ranges, format_args!("{stamp},{arrival},{k},{range}"));
            }
        }
        if let Some(fix) = fix {
            let numbers: Vec<String> = fix.at.iter().chain(fix.sigma.iter()).map(f64::to_string).collect();
            put(&mut positions, format_args!("{stamp},{arrival},{}", numbers.join(",")));
        }
    }
    vec![("transponders", transponders), ("ranges", ranges), ("lbl", positions)]
}

fn table<V>(
    columns: &str,
    readings: &[Reading<V>],
    mission: &PlannedMission,
    numbers: impl Fn(&V) -> Vec<f64>,
) -> String {
    let mut text = format!("stamp_ns,arrival_ns,{columns}\n");
    for reading in readings {
        let [stamp, arrival] = [reading.time, reading.arrival].map(|time| mission.stamp(time));
        let values: Vec<String> = numbers(&reading.value).iter().map(f64::to_string).collect();
        writeln!(text, "{stamp},{arrival},{}", values.join(",")).expect("a string takes all");
    }
    text
}
