//! What the navigation sensors of a dive said, as tables beside its data set.

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
    [("acoustic", acoustic), ("doppler", doppler), ("attitude", attitude), ("depth", depth)]
        .map(|(name, table)| (format!("{name}.csv"), table))
        .into()
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
