//! Files as other programs and people write them.

use std::{fs, path::Path};

use seafix_io::{ImageLimits, read_image};
use serde_json::Value;
use tempfile::TempDir;

use crate::{ended, ended_with, program};

fn sample() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample")
}

/// A pose of a walk at `k`: position, and the quaternion x, y, z, w.
pub(crate) fn pose(k: usize) -> ([f64; 3], [f64; 4]) {
    let t = k as f64 * 0.1;
    let q = [0.1 * t.sin(), 0.2, 0.3 * t.cos(), 0.8];
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    ([3.0 * t.cos(), 3.0 * t.sin(), 0.3 * t], q.map(|x| x / norm))
}

pub(crate) const START: u64 = 1_403_636_579_763_555_584;

/// A folder with the walk as `reference.tum`, and in another notation as `estimate`.
pub(crate) fn walk(line: impl Fn(usize, u64, [f64; 3], [f64; 4]) -> String, header: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let lines = |line: &dyn Fn(usize, u64, [f64; 3], [f64; 4]) -> String| -> String {
        (0..40).map(|k| line(k, START + k as u64 * 100_000_000, pose(k).0, pose(k).1) + "\n").collect()
    };
    fs::write(folder.path().join("reference.tum"), lines(&tum)).unwrap();
    fs::write(folder.path().join("estimate"), format!("{header}{}", lines(&line))).unwrap();
    folder
}

pub(crate) fn seconds(ns: u64) -> String {
    format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

pub(crate) fn tum(_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]) -> String {
    format!("{} {x} {y} {z} {a} {b} {c} {d}", seconds(ns))
}

/// The largest attitude error (degrees) of the estimate, and what was said on standard error.
pub(crate) fn angle(folder: &TempDir) -> (f64, String) {
    let mut command = program();
    let ended = ended(command.current_dir(folder.path()).args([
        "eval",
        "reference.tum",
        "estimate",
        "-r",
        "angle_deg",
        "--json",
    ]));
    assert_eq!(ended.code, Some(0), "{}", ended.error);
    let value: Value = serde_json::from_str(&ended.out).unwrap();
    assert_eq!(value["ape"]["pairs"], 40, "{value}");
    (value["ape"]["max"].as_f64().unwrap(), ended.error)
}

pub(crate) fn rejected(folder: &TempDir, part: &str) {
    let mut command = program();
    let ended = ended_with(3, command.current_dir(folder.path()).args(["eval", "reference.tum", "estimate"]));
    assert!(ended.error.contains(part) && ended.error.lines().count() == 1, "{}", ended.error);
}

#[test]
fn tables_of_poses_are_read_by_the_names_of_their_columns() {
    let w_first = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{} {x} {y} {z} {d} {a} {b} {c}", seconds(ns))
    };
    let csv = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{},{x},{y},{z},{a},{b},{c},{d}", seconds(ns))
    };
    let numbered = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{k},{}", csv(k, ns, p, q));
    let german = |k: usize, ns: u64, p: [f64; 3], q: [f64; 4]| csv(k, ns, p, q).replace(',', ";").replace('.', ",");
    let any = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{d}\t{a}\t{b}\t{c}\t{z}\t{y}\t{x}\t{ns}")
    };
    let numpy = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{:.18e},{x:e},{y:e},{z:e},{d:e},{a:e},{b:e},{c:e}", ns as f64)
    };
    let integer_ns =
        |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| format!("{ns} {x} {y} {z} {a} {b} {c} {d}");
    for folder in [
        walk(tum, ""),
        walk(w_first, "# t x y z q_w q_x q_y q_z\n"),
        walk(w_first, "# quaternions are w x y z\n"),
        walk(csv, "timestamp,tx,ty,tz,qx,qy,qz,qw\n"),
        walk(csv, "\u{feff}\"Time [s]\",\"X\",\"Y\",\"Z\",\"Q.X\",\"Q.Y\",\"Q.Z\",\"Q.W\"\n"),
        walk(numbered, "num,t,x,y,z,qx,qy,qz,qw\n"),
        walk(numbered, ",t,x,y,z,qx,qy,qz,qw\n"),
        walk(german, "t;x;y;z;qx;qy;qz;qw\n"),
        walk(any, "q_w\tq_x\tq_y\tq_z\tz\ty\tx\tstamp [ns]\n"),
        walk(integer_ns, ""),
    ] {
        let (error, said) = angle(&folder);
        assert!(error < 1e-5 && said.is_empty(), "{error} {said}");
    }
    let (error, said) = angle(&walk(numpy, ""));
    assert!(
        error < 1e-5 && said.contains("warning: stamps that have lost digits") && said.contains("128 ns"),
        "{error} {said}"
    );
    rejected(&walk(csv, ""), "the quaternion may be qx qy qz qw (TUM) or qw qx qy qz (EuRoC)");
    rejected(&walk(csv, "t,x,y,z,q0,q1,q2,q3\n"), "w may be q0 or q3");
    rejected(&walk(csv, "a,b,c,d,e,f,g,h\n"), "a header without the columns of poses");
}

#[test]
fn kitti_rows_have_twelve_thirteen_or_sixteen_numbers() {
    let matrix = |[x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        let r = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(d, a, b, c)).to_rotation_matrix();
        (0..3)
            .map(|i| format!("{} {} {} {}", r[(i, 0)], r[(i, 1)], r[(i, 2)], [x, y, z][i]))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let stamped = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{} {}", seconds(ns), matrix(p, q));
    let full = |_: usize, _: u64, p: [f64; 3], q: [f64; 4]| format!("{} 0 0 0 1", matrix(p, q));
    let both = |_: usize, ns: u64, p: [f64; 3], q: [f64; 4]| format!("{} {} 0 0 0 1", seconds(ns), matrix(p, q));
    for folder in [walk(stamped, ""), walk(full, ""), walk(both, "")] {
        assert!(angle(&folder).0 < 1e-5);
    }
    rejected(
        &walk(|k, ns, p, q| format!("{} 0 0 2 1", full(k, ns, p, q).trim_end_matches(" 0 0 0 1")), ""),
        "no 4×4 matrix of a pose",
    );
}

#[test]
fn rounded_quaternions_are_named_with_their_error() {
    let rounded = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{} {x} {y} {z} {a:.2} {b:.2} {c:.2} {d:.2}", seconds(ns))
    };
    let (error, said) = angle(&walk(rounded, ""));
    assert!(
        error < 1.15
            && said.contains("warning: quaternions rounded to few decimals")
            && said.contains("2 decimals, attitudes off by up to 1.1°"),
        "{error} {said}"
    );
    let coarse = |_: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        format!("{} {x} {y} {z} {a:.1} {b:.1} {c:.1} {d:.1}", seconds(ns))
    };
    rejected(&walk(coarse, ""), "1 decimals, attitudes off by up to 11.5°");
}

#[test]
fn positions_without_attitude_give_errors_of_position() {
    let folder = walk(tum, "");
    let at = |name: &str| folder.path().join(name);
    for (name, tail) in [("zero.tum", " 0 0 0 0"), ("four.tum", "")] {
        let lines: String = (0..40)
            .map(|k| {
                let [x, y, z] = pose(k).0;
                format!("{} {} {y} {z}{tail}\n", seconds(START + k as u64 * 100_000_000), x + 0.5)
            })
            .collect();
        fs::write(at(name), lines).unwrap();
        let eval = |arguments: &[&str]| {
            let mut command = program();
            ended(command.current_dir(folder.path()).args(["eval", name, "estimate", "--json"]).args(arguments))
        };
        let found = eval(&["--segments", "2"]);
        assert_eq!(found.code, Some(0), "{}", found.error);
        assert!(
            found.error.contains(&format!("no attitude in {name}: the RPE is that of point_distance")),
            "{}",
            found.error
        );
        let value: Value = serde_json::from_str(&found.out).unwrap();
        assert!((value["ape"]["max"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{value}");
        assert!(value["rpe"]["max"].as_f64().unwrap() < 1e-9 && value["rpe_relation"] == "point_distance", "{value}");
        assert!(value["segments"][0]["translation_percent"]["mean"].as_f64().unwrap() < 1e-6, "{value}");
        let rejected = eval(&["-r", "angle_deg"]);
        assert!(
            rejected.code == Some(3) && rejected.error.contains(&format!("no attitude in {name}: angle_deg needs one")),
            "{}",
            rejected.error
        );
    }
}

/// Poses in the notation of TUM that mean something else. Fails if errors are computed without a word.
#[test]
fn an_estimate_that_contradicts_the_reference_is_named() {
    let inverse = |k: usize, ns: u64, place: [f64; 3], [a, b, c, d]: [f64; 4]| {
        let q = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(d, a, b, c)).inverse();
        let t = -(q * nalgebra::Vector3::from(place));
        tum(k, ns, t.into(), [q.i, q.j, q.k, q.w])
    };
    let millimetres = |k: usize, ns: u64, place: [f64; 3], turn: [f64; 4]| tum(k, ns, place.map(|x| 1e3 * x), turn);
    let conjugate = |k: usize, ns: u64, place: [f64; 3], [a, b, c, d]: [f64; 4]| tum(k, ns, place, [-a, -b, -c, d]);
    for (folder, part) in [
        (walk(inverse, ""), "if the inverse is taken"),
        (walk(millimetres, ""), "if positions are in millimetres"),
        (walk(conjugate, ""), "if the rotations alone are inverted"),
    ] {
        let said = angle(&folder).1;
        assert!(
            said.contains("warning: poses that contradict the reference in estimate") && said.contains(part),
            "{said}"
        );
    }
    assert_eq!(angle(&walk(tum, "")).1, "");
}

#[test]
fn colmap_s_images_are_a_trajectory() {
    let image = |k: usize, ns: u64, [x, y, z]: [f64; 3], [a, b, c, d]: [f64; 4]| {
        // camera_from_world: R = Qᵀ, t = −R p.
        let q = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(d, a, b, c)).inverse();
        let t = -(q * nalgebra::Vector3::new(x, y, z));
        format!("{k} {} {} {} {} {} {} {} 1 {ns}.png\n", q.w, q.i, q.j, q.k, t.x, t.y, t.z)
    };
    let folder = walk(image, "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n");
    assert!(angle(&folder).0 < 1e-5);
}

/// The sample with its images, as a folder of its own.
pub(crate) fn copied() -> TempDir {
    let folder = TempDir::new().unwrap();
    for entry in fs::read_dir(sample()).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
    }
    let file = folder.path().join("dataset.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.split("[hashes]").next().unwrap()).unwrap();
    folder
}

pub(crate) fn edit(folder: &TempDir, name: &str, change: impl Fn(&str) -> String) {
    let file = folder.path().join(name);
    let text = fs::read_to_string(&file).unwrap();
    fs::write(file, change(&text)).unwrap();
}

pub(crate) fn checked(folder: &TempDir, code: i32, parts: &[&str]) {
    let ended = ended_with(code, program().current_dir(folder.path()).args(["check", "."]));
    for part in parts {
        assert!(ended.out.contains(part), "no `{part}` in {}", ended.out);
    }
}

#[test]
fn inverted_poses_are_named_by_check_and_run() {
    let folder = copied();
    checked(&folder, 0, &["in order"]);
    for name in ["prior.tum", "truth.tum"] {
        edit(&folder, name, |text| {
            let line = |line: &str| {
                let n: Vec<f64> = line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
                let q = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(n[6], n[3], n[4], n[5]))
                    .inverse();
                let t = -(q * nalgebra::Vector3::new(n[0], n[1], n[2]));
                let stamp = line.split_whitespace().next().unwrap();
                format!("{stamp} {} {} {} {} {} {} {}\n", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
            };
            text.lines().filter(|line| !line.starts_with('#')).map(line).collect()
        });
    }
    let explained = "in view in 0 of 5 pairs as given, in 5 if the inverse is taken (camera_from_world)";
    checked(&folder, 1, &["poses of the prior that put no object in view", "poses of the truth", explained]);
    let ran = ended_with(0, program().current_dir(folder.path()).args(["run", ".", "--out", "out"]));
    assert!(ran.error.contains(explained), "{}", ran.error);
    assert!(ran.out.contains("no fix in 5 frames: ") && ran.out.contains("are `"), "{}", ran.out);
}

/// Poses that put objects in view, but not where the images show them. Fails if only counts in view are compared, which
/// the vehicle's poses and centimetres pass.
#[test]
fn poses_are_compared_with_the_images() {
    let mounted = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, -std::f64::consts::FRAC_PI_2);
    for (scale, turn, explained) in [
        (100.0, nalgebra::UnitQuaternion::identity(), "in 5 if positions are in centimetres"),
        (1.0, mounted, "if they are poses of the vehicle (body_from_camera is applied)"),
    ] {
        let folder = copied();
        for name in ["prior.tum", "truth.tum"] {
            edit(&folder, name, |text| {
                let line = |line: &str| {
                    let n: Vec<f64> = line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
                    let q = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(n[6], n[3], n[4], n[5]));
                    let (q, stamp) = (q * turn, line.split_whitespace().next().unwrap());
                    let [x, y, z] = [n[0], n[1], n[2]].map(|length| length * scale);
                    format!("{stamp} {x} {y} {z} {} {} {} {}\n", q.i, q.j, q.k, q.w)
                };
                text.lines().filter(|line| !line.starts_with('#')).map(line).collect()
            });
        }
        checked(&folder, 1, &["poses of the truth", explained]);
    }
}

#[test]
fn a_baseline_in_millimetres_is_named_wherever_a_rig_is_read() {
    let folder = copied();
    edit(&folder, "dataset.toml", |text| text.replace("-0.25", "-250.0"));
    checked(&folder, 1, &["units? a baseline of 250 m", "as millimetres it is 0.2500 m"]);
    for arguments in
        [&["run", ".", "--out", "out"][..], &["cloud", "left000.png", "right000.png", "--rig", "dataset.toml"]]
    {
        let said = ended_with(3, program().current_dir(folder.path()).args(arguments));
        assert!(said.error.contains("units? a baseline of 250 m"), "{}", said.error);
    }
}

/// The EXIF block of an orientation.
fn exif(orientation: u8) -> Vec<u8> {
    let directory =
        [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[orientation, 0, 0, 0, 0, 0, 0, 0]].concat();
    let content = [b"Exif\0\0".as_slice(), &directory].concat();
    let length = (content.len() as u16 + 2).to_be_bytes();
    [&[0xFF, 0xE1], &length[..], &content].concat()
}

#[test]
fn images_are_turned_as_exif_states() {
    let folder = copied();
    let size = [1024, 768];
    for entry in fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "png") {
            let image = read_image(&path, size, 8, ImageLimits::default()).unwrap();
            let turned: Vec<u8> = image.to_u8().into_iter().rev().collect();
            let mut bytes = Vec::new();
            jpeg_encoder::Encoder::new(&mut bytes, 95)
                .encode(&turned, 1024, 768, jpeg_encoder::ColorType::Luma)
                .unwrap();
            bytes.splice(2..2, exif(3));
            fs::write(path.with_extension("jpg"), bytes).unwrap();
            fs::remove_file(path).unwrap();
        }
    }
    edit(&folder, "frames.csv", |text| text.replace(".png", ".jpg"));
    checked(
        &folder,
        0,
        &["warning: images turned as their EXIF orientation states", "turned by 180° in 10 of 10 images", "in order"],
    );
}

#[test]
fn calibrations_are_converted_and_used() {
    let folder = copied();
    let camera = |pose: &str| {
        format!(
            "  camera_model: pinhole\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  distortion_model: radtan\n  intrinsics: [500.0, 500.0, 511.5, 383.5]\n{pose}  resolution: [1024, 768]\n"
        )
    };
    let pose = "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.25]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n";
    fs::write(folder.path().join("camchain.yaml"), format!("cam0:\n{}cam1:\n{}", camera(""), camera(pose))).unwrap();
    let run = |arguments: &[&str]| ended_with(0, program().current_dir(folder.path()).args(arguments));
    let said = run(&["check", "camchain.yaml"]);
    assert!(said.out.contains("note: Kalibr camchain: 1024×768 px") && said.out.contains("in order"), "{}", said.out);
    run(&["convert", "calibration", "camchain.yaml", "--out", "made.toml"]);
    let upside_down =
        pose.replace("[1.0, 0.0, 0.0, -0.25]", "[-1.0, 0.0, 0.0, -0.25]").replace("[0.0, 1.0,", "[0.0, -1.0,");
    fs::write(folder.path().join("rolled.yaml"), format!("cam0:\n{}cam1:\n{}", camera(""), camera(&upside_down)))
        .unwrap();
    let warning = "warning: cameras rolled against each other in rolled.yaml: 180.0°";
    assert!(run(&["check", "rolled.yaml"]).out.contains(warning));
    assert!(run(&["convert", "calibration", "rolled.yaml"]).error.contains(warning));
    let clouds = ["dataset.toml", "camchain.yaml", "made.toml"]
        .map(|rig| run(&["cloud", "left000.png", "right000.png", "--rig", rig, "--json"]).out);
    let points = |text: &str| serde_json::from_str::<Value>(text).unwrap()["points"].clone();
    assert!(!points(&clouds[0]).as_array().unwrap().is_empty());
    assert!(points(&clouds[0]) == points(&clouds[1]) && points(&clouds[0]) == points(&clouds[2]));
}

#[test]
fn an_experiment_is_checked_with_everything_it_refers_to() {
    let folder = copied();
    let write = |site: &str| {
        let text = format!("question = 'Where?'\n[source]\nname = 'dataset'\npath = '.'\nsite = '{site}'\n");
        fs::write(folder.path().join("e.toml"), text).unwrap();
    };
    write("site.toml");
    let check = |code: i32| ended_with(code, program().current_dir(folder.path()).args(["check", "e.toml"])).out;
    assert!(check(0).contains("e.toml: in order"));
    write("nowhere.toml");
    assert!(check(1).contains("nowhere.toml"));
}

#[test]
fn refusals_name_the_likely_cause() {
    let folder = TempDir::new().unwrap();
    let solve = |text: &str| {
        fs::write(folder.path().join("p.json"), text).unwrap();
        ended_with(0, program().current_dir(folder.path()).args(["solve", "p.json"])).out
    };
    let shape = |n: usize, of: &dyn Fn(f64) -> [f64; 3]| -> Vec<[f64; 3]> { (0..n).map(|k| of(k as f64)).collect() };
    let problem = |model: &[[f64; 3]], cloud: &[[f64; 3]], sigma: f64, delta: f64, putative: &str| {
        let (model, cloud) = (serde_json::to_string(model).unwrap(), serde_json::to_string(cloud).unwrap());
        format!(
            "{{\"format\":\"coherence-problem/1\",\"id\":\"a\",\"model\":{model},\"cloud\":{cloud},\"sigma\":{sigma},\"delta\":{delta},\"prior\":null,\"putative\":{putative}}}"
        )
    };
    let moved = |points: &[[f64; 3]], scale: f64| -> Vec<[f64; 3]> {
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.4, 0.9);
        points
            .iter()
            .map(|p| (turn * nalgebra::Vector3::from(*p) * scale + nalgebra::Vector3::new(0.2, 0.1, 4.0)).into())
            .collect()
    };
    let box_ = shape(9, &|k| [(k * 0.619).fract() * 2.0, (k * 0.381).fract() * 1.5, (k * 0.723).fract() * 0.8]);
    let said = solve(&problem(&box_, &moved(&box_, 1.03), 0.003, 0.012, "null"));
    assert!(
        said.contains("rejected") && said.contains("at 0.971 times its size the cloud fits 9 of 9 model points"),
        "{said}"
    );
    let pipe = shape(6, &|k| [0.5 * k, 0.002 * (k * 2.1).sin(), 0.002 * (k * 1.3).cos()]);
    let said = solve(&problem(&pipe, &moved(&pipe, 1.0), 0.003, 0.02, "null"));
    assert!(said.contains("6 points are identified, but they lie near a line"), "{said}");
    let three = [[0.041, 0.022, 0.115], [0.037, 0.058, 0.09], [0.072, 0.069, 0.081]];
    let said = solve(&problem(&three, &moved(&three, 1.0), 3e-4, 2e-3, "[[0,0],[1,1],[2,2]]"));
    assert!(
        said.contains("a fourth point would tell") && said.contains("best pose, not accepted, of 3 pairs"),
        "{said}"
    );
}
