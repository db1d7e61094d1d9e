//! `seafix eval` against evo itself, to nine digits.
//!
//! `SEAFIX_EVO` names the Python of an environment that has it: `python3 -m venv evo && evo/bin/pip install evo==1.38.1`, then
//! `SEAFIX_EVO=$PWD/evo/bin/python cargo test --release -p seafix evo -- --ignored`.

use std::{
    env, fs,
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

use crate::program;

/// Computes what the two commands of evo would, of `argv`: reference, estimate, JSON of the settings.
const PEER: &str = r#"
import json, sys
from evo.core import metrics, sync
from evo.tools import file_interface as files
from evo.main_ape import ape
from evo.main_rpe import rpe

def read(name):
    if name.endswith(".kitti"):
        return files.read_kitti_poses_file(name)
    return files.read_euroc_csv_trajectory(name) if name.endswith(".csv") else files.read_tum_trajectory_file(name)

reference, estimate = read(sys.argv[1]), read(sys.argv[2])
s = json.loads(sys.argv[3])
relation = {r.name: r for r in metrics.PoseRelation}[s["relation"]]
unit = {"f": metrics.Unit.frames, "m": metrics.Unit.meters, "d": metrics.Unit.degrees, "r": metrics.Unit.radians}[s["unit"]]
if not sys.argv[1].endswith(".kitti"):
    reference, estimate = sync.associate_trajectories(reference, estimate, max_diff=s["tolerance"])
import copy
common = dict(align=s["align"], correct_scale=s["scale"], align_origin=s["origin"])
out = {}
if relation is not metrics.PoseRelation.point_distance_error_ratio:
    found = ape(copy.deepcopy(reference), copy.deepcopy(estimate), relation, **common)
    out["ape"] = dict(found.stats, pairs=len(found.np_arrays["error_array"]))
found = rpe(copy.deepcopy(reference), copy.deepcopy(estimate), relation, delta=s["delta"], delta_unit=unit, all_pairs=s["all"],
            pairs_from_reference=s["from_reference"], support_loop=True, **common)
out["rpe"] = dict(found.stats, pairs=len(found.np_arrays["error_array"]))
print("\n" + json.dumps({k: {n: float(x) for n, x in v.items()} for k, v in out.items()}))
"#;

/// A walk with turns, and odometry of it that drifts; the stamps of the two are not the same.
fn walks(folder: &Path) {
    let mut state = 12_345_u64;
    let mut noise = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let attitude = |a: f64, b: f64, c: f64| {
        // q = q_z(a) · q_y(b) · q_x(c), as (x, y, z, w).
        let ((sa, ca), (sb, cb), (sc, cc)) = ((a / 2.0).sin_cos(), (b / 2.0).sin_cos(), (c / 2.0).sin_cos());
        let (x, y) = (ca * cb * sc - sa * sb * cc, ca * sb * cc + sa * cb * sc);
        let (z, w) = (sa * cb * cc - ca * sb * sc, ca * cb * cc + sa * sb * sc);
        [x, y, z, w]
    };
    let (mut truth, mut odometry) = (String::new(), String::new());
    let mut off = [0.0; 4];
    for i in 0..400 {
        let t = f64::from(i) * 0.1;
        let (x, y, z) = (8.0 * (0.11 * t).sin(), 5.0 * (0.17 * t).cos() + 0.2 * t, 0.5 * (0.3 * t).sin());
        let line = |stamp: f64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
            format!("{stamp:.6} {x:.9} {y:.9} {z:.9} {a:.9} {b:.9} {c:.9} {d:.9}\n")
        };
        let stamp = 1_600_000_000.0 + t;
        truth += &line(stamp, [x, y, z], attitude(0.11 * t, 0.1 * (0.2 * t).sin(), 0.05 * (0.5 * t).cos()));
        off.iter_mut().for_each(|off| *off += 0.01 * noise());
        if i % 7 != 3 {
            let turn = attitude(0.11 * t + off[3], 0.1 * (0.2 * t).sin() + 0.2 * off[0], 0.05 * (0.5 * t).cos());
            odometry += &line(stamp + 0.004 * noise(), [1.02 * x + off[0], y + off[1], z + off[2]], turn);
        }
    }
    fs::write(folder.join("truth.tum"), truth).unwrap();
    fs::write(folder.join("odometry.tum"), odometry).unwrap();
}

fn answer(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // evo shows its progress on standard output.
    serde_json::from_str(String::from_utf8_lossy(&output.stdout).lines().last().unwrap()).unwrap()
}

#[test]
#[ignore = "long: needs evo"]
fn every_number_of_evo_is_met() {
    let python = env::var("SEAFIX_EVO").expect("SEAFIX_EVO names a Python with evo");
    let folder = tempfile::tempdir().unwrap();
    walks(folder.path());
    let seafix =
        |arguments: &[&str]| answer(&program().current_dir(&folder).arg("eval").args(arguments).output().unwrap());
    // The matched poses of both, in the other formats.
    seafix(&["truth.tum", "odometry.tum", "--json", "--out", "odometry.kitti"]);
    seafix(&["odometry.tum", "truth.tum", "--json", "--out", "truth.kitti"]);
    seafix(&["odometry.tum", "odometry.tum", "--json", "--out", "odometry.csv"]);
    let relations = [
        ("full", "full_transformation"),
        ("trans_part", "translation_part"),
        ("rot_part", "rotation_part"),
        ("angle_rad", "rotation_angle_rad"),
        ("angle_deg", "rotation_angle_deg"),
        ("point_distance", "point_distance"),
        ("point_distance_error_ratio", "point_distance_error_ratio"),
    ];
    let deltas = [("1", "f"), ("10", "f"), ("2.5", "m"), ("12", "d"), ("0.2", "r")];
    let alignments: [&[&str]; 5] = [&[], &["--align"], &["--scale"], &["--align", "--scale"], &["--align-origin"]];
    let mut compared = 0;
    for (reference, estimate) in
        [("truth.tum", "odometry.tum"), ("truth.kitti", "odometry.kitti"), ("truth.tum", "odometry.csv")]
    {
        for (k, (name, peer)) in relations.into_iter().enumerate() {
            for (d, (delta, unit)) in deltas.into_iter().enumerate() {
                let (all, from_reference) = (d % 2 == k % 2, d % 3 == k % 3);
                let align = alignments[(k + d) % alignments.len()];
                let mut arguments = vec![reference, estimate, "--json", "-r", name, "-d", delta, "-u", unit];
                arguments.extend(align);
                arguments.extend(all.then_some("--all-pairs"));
                arguments.extend(from_reference.then_some("--pairs-from-reference"));
                let ours = seafix(&arguments);
                let settings = serde_json::json!({
                    "relation": peer, "delta": delta.parse::<f64>().unwrap(), "unit": unit, "tolerance": 0.01,
                    "align": align.contains(&"--align"), "scale": align.contains(&"--scale"),
                    "origin": align.contains(&"--align-origin"), "all": all, "from_reference": from_reference,
                });
                let run = Command::new(&python)
                    .current_dir(&folder)
                    .args(["-c", PEER, reference, estimate, &settings.to_string()])
                    .output()
                    .unwrap();
                for (metric, numbers) in answer(&run).as_object().unwrap() {
                    for (statistic, wanted) in numbers.as_object().unwrap() {
                        let (wanted, found) = (wanted.as_f64().unwrap(), ours[metric][statistic].as_f64());
                        let found = found.unwrap_or_else(|| panic!("{arguments:?}: no {metric} {statistic}"));
                        let near = (found - wanted).abs() <= 1e-9 * wanted.abs().max(1e-6);
                        assert!(near, "{arguments:?} {metric} {statistic}: {found} against {wanted}");
                        compared += 1;
                    }
                }
            }
        }
    }
    println!("{compared} numbers agree");
}
