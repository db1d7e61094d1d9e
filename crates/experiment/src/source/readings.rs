//! What the navigation sensors of a dive said, and where its route led, as tables beside its data set.

use std::fmt::Write;

use seafix_simulation::{PlannedMission, sensors::Reading};

/// The tables, by the names of their files.
pub(super) fn tables(mission: &PlannedMission) -> Vec<(String, String)> {
    let readings = mission.readings();
    let axes = |name: &str| ["x", "y", "z"].map(|axis| format!("{name}{axis}")).join(",");
    let acoustic = table("north,east,down,sigma", &readings.acoustic, mission, |fix| {
        [fix.at.x, fix.at.y, fix.at.z, fix.sigma].to_vec()
    });
    let doppler = table(&axes("v"), &readings.doppler, mission, |v| v.iter().copied().collect());
    let attitude = table(&format!("{},qx,qy,qz,qw", axes("w")), &readings.attitude, mission, |said| {
        let q = said.world_from_body;
        said.rate.iter().copied().chain([q.i, q.j, q.k, q.w]).collect()
    });
    let depth = table("depth", &readings.depth, mission, |depth| vec![*depth]);
    let places = mission.waypoints().into_iter().map(|[north, east, height]| format!("{north},{east},{height}\n"));
    let route = std::iter::once("north,east,height\n".to_owned()).chain(places).collect();
    let all =
        [("acoustic", acoustic), ("doppler", doppler), ("attitude", attitude), ("depth", depth), ("waypoints", route)];
    all.into_iter().chain(lbl(mission)).map(|(name, table)| (format!("{name}.csv"), table)).collect()
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
