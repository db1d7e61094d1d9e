//! Tables of poses as trackers, plotting programs and spreadsheets write them.

use std::fs;

use tempfile::TempDir;

use crate::{
    ended, ended_with,
    foreign_files::{START, angle, rejected, seconds, tum, walk},
    program,
};

/// A line of a table after its stamp: x, y, z, and the quaternion with w last.
fn rest([x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4], sign: char) -> String {
    [x, y, z, a, b, c, d].map(|number| number.to_string()).join(&sign.to_string())
}

/// Exports of ROS, PlotJuggler, maplab, OpenVINS and VINS-Fusion.
#[test]
fn exports_of_other_programs_are_read() {
    let topic = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,field.pose.position.y,\
                 field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,\
                 field.pose.orientation.w\n";
    // The time of recording is late by a second: the stamp of the message counts.
    let echoed = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| {
        format!("{},{k},{ns},map,{}", ns + 1_000_000_000, rest(p, q, ','))
    };
    let plot = "__time,/odom/pose/pose/position/x,/odom/pose/pose/position/y,/odom/pose/pose/position/z,\
                /odom/pose/pose/orientation/x,/odom/pose/pose/orientation/y,/odom/pose/pose/orientation/z,\
                /odom/pose/pose/orientation/w\n";
    let plotted = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{},{}", seconds(ns), rest(p, q, ','));
    let split = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| {
        format!("{},{},{}", ns / 1_000_000_000, ns % 1_000_000_000, rest(p, q, ','))
    };
    let maplab = "timestamp [ns], vertex index, p_G_I x [m], p_G_I y [m], p_G_I z [m], q_G_I w [-], q_G_I x [-], q_G_I y [-], \
                  q_G_I z [-]\n";
    let vertices = |k: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{ns}, {k}, {x}, {y}, {z}, {d}, {a}, {b}, {c}")
    };
    let vins = "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33\n";
    let filtered = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| {
        format!("{} {}{}", seconds(ns), rest(p, q, ' '), " 0.001".repeat(12))
    };
    let fused = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{ns},{x},{y},{z},{d},{a},{b},{c},0.1,0.2,0.3,")
    };
    let unit = |power: u32| {
        move |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{} {}", ns / 10u64.pow(power), rest(p, q, ' '))
    };
    let negated = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| {
        tum(k, ns, p, q.map(|part| if k.is_multiple_of(2) { part } else { -part }))
    };
    for (folder, tolerance) in [
        (walk(echoed, topic), 1e-5),
        (walk(plotted, plot), 1e-5),
        (walk(split, "sec,nanosec,x,y,z,qx,qy,qz,qw\n"), 1e-5),
        (walk(vertices, maplab), 1e-5),
        (walk(filtered, vins), 1e-5),
        (walk(fused, ""), 1e-5),
        (walk(unit(6), ""), 1e-5),
        (walk(unit(3), ""), 1e-5),
        (walk(negated, ""), 1e-5),
        (walk(|k, ns, p, q| tum(k, ns, p, q) + "\r", ""), 1e-5),
    ] {
        let (error, said) = angle(&folder);
        assert!(error < tolerance && said.is_empty(), "{error} {said}");
    }
}

/// Fails if nothing but the number of associated poses is said.
#[test]
fn stamps_of_another_clock_are_rejected_with_the_offset() {
    let later = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| tum(k, ns + 7_200_000_000_000, p, q);
    let relative = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| tum(k, ns - START, p, q);
    for (folder, offset) in [(walk(later, ""), "-7200"), (walk(relative, ""), "1403636579.763555584")] {
        rejected(&folder, &format!("if both begin together, `--t-offset {offset}` associates 40 poses"));
        let mut command = program();
        let command = command.current_dir(folder.path()).args(["eval", "reference.tum", "estimate", "--json"]);
        let found = ended(command.arg(format!("--t-offset={offset}")));
        assert!(found.code == Some(0) && found.out.contains("\"pairs\":40"), "{} {}", found.out, found.error);
    }
    rejected(
        &walk(|k, _, p, q| format!("{k} {}", rest(p, q, ' ')), ""),
        "the stamps of the estimate count its rows (0, 1, …)",
    );
    let between = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| tum(k, ns + 50_000_000, p, q);
    rejected(&walk(between, ""), "the nearest stamps are 0.050 s apart (median)");
}

#[test]
fn lengths_in_other_units_and_directions_of_the_world() {
    let scaled = |factor: f64| {
        move |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| {
            format!("{},{}", seconds(ns), rest(p.map(|x| x / factor), q, ','))
        }
    };
    for (header, factor) in [
        ("t,x [ft],y [ft],z [ft],qx,qy,qz,qw\n", 0.3048),
        ("t,x_km,y_km,z_km,qx,qy,qz,qw\n", 1e3),
        ("t[s],x[cm],y[cm],z[cm],qx,qy,qz,qw\n", 1e-2),
    ] {
        let folder = walk(scaled(factor), header);
        let mut command = program();
        let found = ended(command.current_dir(folder.path()).args(["eval", "reference.tum", "estimate", "--json"]));
        let value: serde_json::Value = serde_json::from_str(&found.out).unwrap();
        assert!(value["ape"]["max"].as_f64().unwrap() < 1e-9, "{header} {}", found.error);
    }
    rejected(
        &walk(scaled(1.0), "t,x [in],y [in],z [in],qx,qy,qz,qw\n"),
        "a column in the unit `in`, which is not read",
    );
    rejected(&walk(scaled(1.0), "time [min],x,y,z,qx,qy,qz,qw\n"), "a column in the unit `min`");
    rejected(&walk(scaled(1.0), "t,lat,lon,depth,qx,qy,qz,qw\n"), "geographic coordinates, which are no lengths");
    // The reference is x, y, z; easting is y, northing x, and depth z.
    let survey = |_: usize, ns: u64, [x, y, z]: [f64; 3], _: [f64; 4]| format!("{};{y};{x};{z}", seconds(ns));
    let folder = walk(survey, "time;easting;northing;depth\n");
    let mut command = program();
    let found = ended(command.current_dir(folder.path()).args(["eval", "reference.tum", "estimate", "--json"]));
    let value: serde_json::Value = serde_json::from_str(&found.out).unwrap();
    assert!(value["ape"]["max"].as_f64().unwrap() < 1e-9, "{}", found.error);
}

#[test]
fn rows_that_are_no_poses_are_named() {
    let lost = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| match k % 10 {
        0 => format!("{} nan nan nan nan nan nan nan", seconds(ns)),
        _ => tum(k, ns, p, q),
    };
    rejected(&walk(lost, ""), "not a finite number in estimate:1: nan; remove the rows without a pose");
    let sheet = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{:.4E},{}", ns as f64 * 1e-9, rest(p, q, ','));
    rejected(&walk(sheet, "t,x,y,z,qx,qy,qz,qw\n"), "stamps that do not tell the poses apart");
    let level =
        |_: usize, ns: u64, [x, y, z]: [f64; 3], _: [f64; 4]| format!("{ns},{x},{y},{z},0.1,0,0,0.994987437106620");
    rejected(&walk(level, ""), "quaternions that seem to have w last");
    for (bytes, part) in [
        (
            &b"PK\x03\x04\x14\0\x06\0"[..],
            "not a text file in estimate: a zip archive or a spreadsheet; unpack it, or save",
        ),
        (b"\x93NUMPY\x01\0v\0", "an array of NumPy; write it as text"),
        (b"\x1f\x8b\x08\0", "compressed with gzip"),
    ] {
        let folder = walk(tum, "");
        fs::write(folder.path().join("estimate"), bytes).unwrap();
        rejected(&folder, part);
    }
}

/// Fails if `check` takes a table of poses for an experiment without a question.
#[test]
fn a_trajectory_is_checked_as_what_it_is() {
    let folder = walk(tum, "");
    let check = |name: &str, code: i32| {
        let mut command = program();
        ended_with(code, command.current_dir(folder.path()).args(["check", name])).out
    };
    let said = check("reference.tum", 0);
    assert!(said.contains("note: a trajectory of 40 poses over 3.9 s") && said.contains("in order"), "{said}");
    // `eval` reads any name, and files with words of calibrations.
    let poses = fs::read_to_string(folder.path().join("reference.tum")).unwrap();
    let image = |k: u64| format!("{k} 1 0 0 0 {k} 0 0 1 {}.png\n\n", START + k * 100_000_000);
    let images = "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n".to_owned();
    for (name, text) in [
        ("walk", poses.clone()),
        ("walk.traj", poses.replace('\n', "\r")),
        ("cam0.txt", format!("# poses of cam0, as camera_model pinhole\n{poses}")),
        ("images.txt", images.clone() + &(0..40).map(image).collect::<String>()),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
        let said = check(name, 0);
        assert!(said.contains("note: a trajectory of 40 poses") && said.contains("in order"), "{said}");
    }
    fs::write(folder.path().join("images.txt"), images + "1 2 0 0 0 0 0 0 1 a.png\n\n").unwrap();
    assert!(check("images.txt", 1).contains("unit length in images.txt:2"), "{}", check("images.txt", 1));
    fs::write(folder.path().join("notes.txt"), "the camera was cleaned\n").unwrap();
    let said = check("notes.txt", 1);
    assert!(said.lines().count() == 1 && !said.contains("question"), "{said}");
    let empty = TempDir::new().unwrap();
    fs::write(empty.path().join("a.csv"), "").unwrap();
    let mut command = program();
    let said = ended_with(1, command.current_dir(empty.path()).args(["check", "a.csv"])).out;
    assert!(said.contains("a trajectory without poses") && said.lines().count() == 1, "{said}");
}

/// Fails if the folder of a bare name is the empty path.
#[test]
fn a_description_is_checked_from_its_own_folder() {
    let folder = TempDir::new().unwrap();
    let text = "format = \"seafix-dataset/1\"\nname = \"a\"\nlicence = \"own\"\nframes = \"frames.csv\"\n";
    let camera = |side: &str| {
        format!("[rig.{side}]\nsize = [64, 48]\nfx = 50.0\nfy = 50.0\ncx = 31.5\ncy = 23.5\ndistortion = []\n")
    };
    let pose = "[rig]\nright_from_left = [[1.0,0.0,0.0,-0.1],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]\nrectified = true\n";
    let text = format!("{text}{pose}{}{}", camera("left"), camera("right"));
    fs::write(folder.path().join("dataset.toml"), text).unwrap();
    let mut command = program();
    let said = ended_with(1, command.current_dir(folder.path()).args(["check", "dataset.toml"])).out;
    assert!(said.contains("frames.csv") && !said.contains("no such folder"), "{said}");
}
