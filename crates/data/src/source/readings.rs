//! Sensor readings of a simulated dive: for an odometry, and as tables beside its data set.

use std::fmt::Write;

use nalgebra::{Matrix3, Vector3};
use seafix_navigation::{Device, Reading};
use seafix_simulation::{PlannedMission, sensors::TimedReading};

use crate::sensor_buffer::SensorBuffer;

/// The readings of the Doppler log and the gyro, with the noise of their data sheets.
pub(super) fn sensor_buffer(mission: &PlannedMission) -> SensorBuffer {
    let readings = mission.readings();
    let noise = Noise::of(mission);
    let sample = |device, time: f64, arrival: f64, value: Vector3<f64>, sigma: f64| {
        let covariance = Matrix3::identity() * (sigma * sigma);
        (mission.stamp(arrival), Reading { device, stamp_ns: mission.stamp(time), value, covariance })
    };
    let doppler = readings.doppler.iter().map(|r| sample(Device::Doppler, r.time, r.arrival, r.value, noise.doppler));
    let gyro = readings.attitude.iter().map(|r| sample(Device::Gyro, r.time, r.arrival, r.value.rate, noise.gyro));
    SensorBuffer::new(doppler.chain(gyro).collect())
}

/// The standard deviations of a reading's noise per axis: velocity (m/s), rate of turn (rad/s).
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

/// The tables with the names of their files.
pub(super) fn tables(mission: &PlannedMission) -> Vec<(String, String)> {
    let readings = mission.readings();
    let axes = |name: &str| ["x", "y", "z"].map(|axis| format!("{name}{axis}")).join(",");
    let acoustic = table("north,east,down,sigma", &readings.acoustic, mission, |fix| {
        [fix.at.x, fix.at.y, fix.at.z, fix.sigma].to_vec()
    });
    let noise = Noise::of(mission);
    let with_sigma = |v: &Vector3<f64>, sigma: f64| v.iter().copied().chain([sigma]).collect();
    let doppler = table(&format!("{},sigma", axes("v")), &readings.doppler, mission, |v| with_sigma(v, noise.doppler));
    let gyro = table(&format!("{},sigma", axes("w")), &readings.attitude, mission, |reading| {
        with_sigma(&reading.rate, noise.gyro)
    });
    let attitude = table(&format!("{},qx,qy,qz,qw", axes("w")), &readings.attitude, mission, |reading| {
        let q = reading.world_from_body;
        reading.rate.iter().copied().chain([q.i, q.j, q.k, q.w]).collect()
    });
    let depth = table("depth", &readings.depth, mission, |depth| vec![*depth]);
    let places = mission.waypoints().into_iter().map(|[north, east, height]| format!("{north},{east},{height}\n"));
    let route = std::iter::once("north,east,height\n".to_owned()).chain(places).collect();
    let all = [("acoustic", acoustic), ("doppler", doppler), ("gyro", gyro), ("attitude", attitude), ("depth", depth)];
    let truth = mission.true_points().map(|(object, point, [x, y, z])| format!("{object},{point},{x},{y},{z}\n"));
    let truth = std::iter::once("object,point,x,y,z\n".to_owned()).chain(truth).collect();
    let all = all.into_iter().chain([("waypoints", route), ("truth-points", truth)]);
    all.chain(lbl(mission)).map(|(name, table)| (format!("{name}.csv"), table)).collect()
}

/// The surveyed transponders, the ranges to them, and the resulting positions; empty without transponders.
fn lbl(mission: &PlannedMission) -> Vec<(&'static str, String)> {
    let places = &mission.settings().sensors.lbl.transponders;
    if places.is_empty() {
        return Vec::new();
    }
    let mut transponders = "transponder,north,east,down\n".to_owned();
    let mut ranges = "stamp_ns,arrival_ns,transponder,range\n".to_owned();
    let mut positions = "stamp_ns,arrival_ns,north,east,down,sigma_north,sigma_east,sigma_down\n".to_owned();
    let put = |table: &mut String, line: std::fmt::Arguments<'_>| {
        table.write_fmt(line).expect("writing to a string does not fail");
        table.push('\n');
    };
    for (k, [north, east, down]) in places.iter().enumerate() {
        put(&mut transponders, format_args!("{k},{north},{east},{down}"));
    }
    for answer in mission.readings().lbl {
        let [stamp, arrival] = [answer.time, answer.arrival].map(|time| mission.stamp(time));
        let (received, fix) = &answer.value;
        for (k, range) in received.0.iter().take(places.len()).enumerate() {
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
    readings: &[TimedReading<V>],
    mission: &PlannedMission,
    numbers: impl Fn(&V) -> Vec<f64>,
) -> String {
    let mut text = format!("stamp_ns,arrival_ns,{columns}\n");
    for reading in readings {
        let [stamp, arrival] = [reading.time, reading.arrival].map(|time| mission.stamp(time));
        let values: Vec<String> = numbers(&reading.value).iter().map(f64::to_string).collect();
        writeln!(text, "{stamp},{arrival},{}", values.join(",")).expect("writing to a string does not fail");
    }
    text
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeMap, path::Path};

    use seafix_simulation::{Mission, RigPlan, sensors::Lbl};

    use super::*;

    /// A short dive with all sensors.
    fn mission() -> PlannedMission {
        let transponders = vec![[-50.0, -40.0, 38.0], [60.0, -40.0, 39.0], [55.0, 55.0, 37.0], [-40.0, 60.0, 38.5]];
        let mut mission = Mission {
            frames: 2,
            rate: 0.1,
            rig: RigPlan { size: [64, 48], focal: 31.0, ..RigPlan::default() },
            ..Mission::default()
        };
        mission.sensors.lbl = Lbl { transponders, ..Lbl::default() };
        mission.plan(3, 0, Path::new("")).unwrap()
    }

    /// The header and the rows of a table.
    fn read(text: &str) -> (String, Vec<Vec<String>>) {
        let mut lines = text.lines();
        let columns = lines.next().unwrap().to_owned();
        let rows: Vec<Vec<String>> = lines.map(|line| line.split(',').map(str::to_owned).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == columns.split(',').count()), "{columns}: rows of different lengths");
        (columns, rows)
    }

    #[test]
    fn tables_hold_the_readings_to_the_bit() {
        let mission = mission();
        let readings = mission.readings();
        let tables: BTreeMap<String, (String, Vec<Vec<String>>)> =
            tables(&mission).into_iter().map(|(name, text)| (name, read(&text))).collect();
        let names: Vec<&str> = tables.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "acoustic",
                "attitude",
                "depth",
                "doppler",
                "gyro",
                "lbl",
                "ranges",
                "transponders",
                "truth-points",
                "waypoints"
            ]
            .map(|name| format!("{name}.csv"))
        );
        let number = |text: &String| text.parse::<f64>().unwrap();
        let same = |name: &str, columns: &str, times: Vec<[f64; 2]>, values: Vec<Vec<f64>>| {
            let (found, rows) = &tables[name];
            assert_eq!(found, &format!("stamp_ns,arrival_ns,{columns}"));
            assert!(rows.len() == values.len() && !rows.is_empty(), "{name}: {} of {}", rows.len(), values.len());
            for ((row, times), values) in rows.iter().zip(times).zip(values) {
                assert_eq!(row[..2], times.map(|time| mission.stamp(time).to_string()), "{name}");
                assert!(times[0] <= times[1], "{name}: received before it was sent");
                assert_eq!(row[2..].iter().map(number).collect::<Vec<_>>(), values, "{name}");
            }
        };
        macro_rules! check {
            ($name:literal, $columns:literal, $list:expr, $values:expr) => {
                same(
                    $name,
                    $columns,
                    $list.iter().map(|r| [r.time, r.arrival]).collect(),
                    $list.iter().map(|r| $values(&r.value)).collect(),
                )
            };
        }
        check!(
            "acoustic.csv",
            "north,east,down,sigma",
            readings.acoustic,
            |fix: &seafix_simulation::sensors::AcousticFix| vec![fix.at.x, fix.at.y, fix.at.z, fix.sigma]
        );
        check!("depth.csv", "depth", readings.depth, |depth: &f64| vec![*depth]);
        check!("doppler.csv", "vx,vy,vz,sigma", readings.doppler, |v: &Vector3<f64>| vec![v.x, v.y, v.z, 0.004]);
        let sigma = mission.settings().sensors.attitude.rate_sigma();
        type Attitude = seafix_simulation::sensors::AttitudeReading;
        check!("gyro.csv", "wx,wy,wz,sigma", readings.attitude, |reading: &Attitude| vec![
            reading.rate.x,
            reading.rate.y,
            reading.rate.z,
            sigma
        ]);
        check!("attitude.csv", "wx,wy,wz,qx,qy,qz,qw", readings.attitude, |reading: &Attitude| {
            let q = reading.world_from_body;
            vec![reading.rate.x, reading.rate.y, reading.rate.z, q.i, q.j, q.k, q.w]
        });
        // The received ranges, and the position that they determine.
        let received = readings.lbl.iter().map(|answer| answer.value.0.0.iter().flatten().count()).sum::<usize>();
        assert_eq!(
            (&tables["ranges.csv"].0[..], tables["ranges.csv"].1.len()),
            ("stamp_ns,arrival_ns,transponder,range", received)
        );
        let first = readings.lbl.iter().flat_map(|a| a.value.0.0).flatten().next().unwrap();
        assert_eq!(number(&tables["ranges.csv"].1[0][3]), first);
        let fixes = readings.lbl.iter().filter_map(|answer| answer.value.1.as_ref()).collect::<Vec<_>>();
        assert_eq!(tables["lbl.csv"].1.len(), fixes.len());
        assert_eq!(number(&tables["lbl.csv"].1[0][2]), fixes[0].at.x);
        let places: Vec<Vec<f64>> =
            tables["transponders.csv"].1.iter().map(|row| row[1..].iter().map(number).collect()).collect();
        assert_eq!(places, mission.settings().sensors.lbl.transponders.iter().map(|p| p.to_vec()).collect::<Vec<_>>());
        // The true points agree with the survey within its errors.
        let (columns, rows) = &tables["truth-points.csv"];
        assert_eq!(columns, "object,point,x,y,z");
        let surveyed =
            mission.site().objects.iter().zip(mission.world_from_object()).flat_map(|(object, at)| {
                object.points.iter().map(move |point| (&object.id, &point.id, *at * point.at))
            });
        let surveyed: Vec<_> = surveyed.collect();
        assert_eq!(rows.len(), surveyed.len());
        for (row, (object, point, at)) in rows.iter().zip(&surveyed) {
            assert_eq!([&row[0], &row[1]], [*object, *point]);
            let truth = Vector3::from_fn(|k, _| number(&row[2 + k]));
            assert!((truth - at.coords).norm() < 0.01 && truth != at.coords, "{object} {point}");
        }
        // The route in the form of the setting `route.waypoints`.
        let (columns, rows) = &tables["waypoints.csv"];
        assert_eq!(columns, "north,east,height");
        let waypoints: Vec<[f64; 3]> = rows.iter().map(|row| [0, 1, 2].map(|k| number(&row[k]))).collect();
        assert_eq!(waypoints, mission.waypoints());
        assert!(waypoints.len() > 2 && waypoints.iter().all(|place| (place[2] - 3.5).abs() < 1e-9), "{waypoints:?}");
    }
}
