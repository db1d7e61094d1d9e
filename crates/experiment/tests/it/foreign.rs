//! Foreign data set formats against the native one: the same pairs, rig and truth.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use seafix_data::dataset::Dataset;
use seafix_experiment::{Options, Plan, Silent, run};
use seafix_geometry::{Body, Camera, Frame, Transform};
use tempfile::TempDir;

fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample")
}

fn own() -> Dataset {
    Dataset::open(&sample()).unwrap()
}

/// The rows of a rigid motion in YAML, over several lines as in the original data sets.
fn yaml<A: Frame, B: Frame>(pose: &Transform<A, B>) -> String {
    let rows = pose.rows().map(|row| row.map(|number| format!("{number:?}")).join(", "));
    format!("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", rows.join(",\n         "))
}

/// The left camera's pose in the body of the EuRoC set, and the pose of the truth's marker.
fn mounts() -> (Transform<Body, Camera>, Transform<Body, Camera>) {
    let at = |xi: [f64; 6]| Transform::exp(&xi.into());
    (at([0.3, -0.2, 1.1, 0.1, 0.2, -0.05]), at([-0.1, 0.4, 0.2, 0.0, -0.1, 0.3]))
}

/// The sample in EuRoC format.
fn euroc(folder: &Path) {
    let own = own();
    let (body_from_left, body_from_marker) = mounts();
    let left_from_right: Transform<Camera, Camera> = own.rig.right_from_left().inverse().relabel();
    for (side, camera, place) in
        [(0, own.rig.left(), body_from_left), (1, own.rig.right(), body_from_left * left_from_right)]
    {
        let home = folder.join(format!("mav0/cam{side}"));
        fs::create_dir_all(home.join("data")).unwrap();
        let ([fx, fy], [cx, cy], [w, h]) = (camera.focal(), camera.principal(), camera.size());
        fs::write(
            home.join("sensor.yaml"),
            format!(
                "# General sensor definitions.\nsensor_type: camera\ncomment: a sample\n\n{}\nrate_hz: 10\n\
                 resolution: [{w}, {h}]\ncamera_model: pinhole\nintrinsics: [{fx:?}, {fy:?}, {cx:?}, {cy:?}] #fu, fv, cu, cv\n\
                 distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n",
                yaml(&place)
            ),
        )
        .unwrap();
        let mut table = "#timestamp [ns],filename\r\n".to_owned();
        for frame in &own.frames {
            let image = if side == 0 { &frame.left } else { &frame.right };
            fs::copy(image, home.join(format!("data/{}.png", frame.stamp_ns))).unwrap();
            write!(table, "{0},{0}.png\r\n", frame.stamp_ns).unwrap();
        }
        fs::write(home.join("data.csv"), table).unwrap();
    }
    let home = folder.join("mav0/state_groundtruth_estimate0");
    fs::create_dir_all(&home).unwrap();
    fs::write(home.join("sensor.yaml"), format!("sensor_type: pose\n{}", yaml(&body_from_marker))).unwrap();
    let mut table =
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v\n"
            .to_owned();
    for frame in &own.frames {
        let camera_from_marker: Transform<Camera, Camera> = body_from_left.inverse() * body_from_marker;
        let pose = frame.truth.unwrap() * camera_from_marker;
        let (p, q) = (pose.translation(), pose.rotation());
        writeln!(table, "{},{},{},{},{},{},{},{},0.5", frame.stamp_ns, p.x, p.y, p.z, q.w, q.i, q.j, q.k).unwrap();
    }
    fs::write(home.join("data.csv"), table).unwrap();
}

/// The sample in KITTI format, with its cameras shifted from camera 0.
fn kitti(root: &Path) -> PathBuf {
    let own = own();
    let folder = root.join("sequences/07");
    fs::create_dir_all(root.join("poses")).unwrap();
    for camera in [2, 3] {
        fs::create_dir_all(folder.join(format!("image_{camera}"))).unwrap();
    }
    let ([fx, fy], [cx, cy]) = (own.rig.left().focal(), own.rig.left().principal());
    let shift = 0.06;
    let p = |x: f64| format!("{fx:e} 0.0 {cx:e} {:e} 0.0 {fy:e} {cy:e} 0.0 0.0 0.0 1.0 0.0", fx * x);
    let b = own.rig.baseline();
    let calib =
        format!("P0: {}\nP1: {}\nP2: {}\nP3: {}\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n", p(0.0), p(-b), p(shift), p(shift - b));
    fs::write(folder.join("calib.txt"), calib).unwrap();
    let (mut times, mut poses) = (String::new(), String::new());
    for (index, frame) in own.frames.iter().enumerate() {
        fs::copy(&frame.left, folder.join(format!("image_2/{index:06}.png"))).unwrap();
        fs::copy(&frame.right, folder.join(format!("image_3/{index:06}.png"))).unwrap();
        writeln!(times, "{}.{:09}", frame.stamp_ns / 1_000_000_000, frame.stamp_ns % 1_000_000_000).unwrap();
        // A point at x in camera 2 is at x − shift in camera 0.
        let left_from_zero = Transform::<Camera, Camera>::new(Default::default(), [shift, 0.0, 0.0].into());
        let rows = (frame.truth.unwrap() * left_from_zero).rows();
        writeln!(poses, "{}", rows[..3].concat().iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" "))
            .unwrap();
    }
    fs::write(folder.join("times.txt"), times).unwrap();
    fs::write(root.join("poses/07.txt"), poses).unwrap();
    folder
}

/// Asserts the same pairs, rig and truth, to rounding.
fn same(found: &Dataset, tolerance: f64) {
    let own = own();
    assert_eq!(found.frames.len(), own.frames.len());
    assert_eq!((found.rig.left(), found.rig.right()), (own.rig.left(), own.rig.right()));
    let off = own.rig.right_from_left().error_to(found.rig.right_from_left());
    assert!(off.norm() < tolerance, "rig {off}");
    for (found_frame, own_frame) in found.frames.iter().zip(&own.frames) {
        assert_eq!(found_frame.stamp_ns, own_frame.stamp_ns);
        assert_eq!(found.pair(found_frame).unwrap(), own.pair(own_frame).unwrap());
        let off = own_frame.truth.unwrap().error_to(&found_frame.truth.unwrap());
        assert!(off.norm() < tolerance, "truth {off}");
    }
}

#[test]
fn euroc_folders_hold_the_same() {
    let folder = TempDir::new().unwrap();
    euroc(folder.path());
    for place in [folder.path().to_owned(), folder.path().join("mav0")] {
        let found = Dataset::open(&place).unwrap();
        same(&found, 1e-12);
        assert!(found.body_from_camera.error_to(&mounts().0).norm() < 1e-12);
    }
}

#[test]
fn kitti_sequences_hold_the_same() {
    let folder = TempDir::new().unwrap();
    same(&Dataset::open(&kitti(folder.path())).unwrap(), 1e-12);
}

/// Seen to fail when only the stamps are counted.
#[test]
fn images_beyond_the_last_stamp_are_reported() {
    let folder = TempDir::new().unwrap();
    let sequence = kitti(folder.path());
    let count = own().frames.len();
    assert!(Dataset::open(&sequence).unwrap().warnings.is_empty());
    let more = |index: usize| {
        for camera in [2, 3] {
            let images = sequence.join(format!("image_{camera}"));
            fs::copy(images.join("000000.png"), images.join(format!("{index:06}.png"))).unwrap();
        }
    };
    more(count);
    let all = Dataset::open(&sequence).unwrap();
    let message = all.warnings[0].to_string();
    assert_eq!(all.frames.len(), count);
    assert!(message.contains(&format!("{count} stamps, {0} left and {0} right images", count + 1)), "{message}");
    (count..=2 * count).for_each(more);
    assert!(Dataset::open(&sequence).unwrap_err()[0].to_string().contains("images without a stamp"));
}

/// Cameras without a common trigger. Fails if the offset of their stamps is not stated.
#[test]
fn an_offset_of_the_cameras_is_stated() {
    let folder = TempDir::new().unwrap();
    euroc(folder.path());
    let file = folder.path().join("mav0/cam1/data.csv");
    let later =
        |line: &str| match line.split_once(',').and_then(|(stamp, name)| Some((stamp.parse::<u64>().ok()?, name))) {
            Some((stamp, name)) => format!("{},{name}\n", stamp + 3_000_000),
            None => format!("{line}\n"),
        };
    let table: String = fs::read_to_string(&file).unwrap().lines().map(later).collect();
    fs::write(&file, table).unwrap();
    let faults: Vec<String> = Dataset::open(folder.path()).unwrap_err().iter().map(ToString::to_string).collect();
    assert!(faults.len() == 1 && faults[0].contains("the right image is 3.0 ms after the left one"), "{faults:?}");
    assert!(faults[0].contains("frames.csv") && !faults[0].contains("tolerance"), "{faults:?}");
}

/// Fails if the first image is only said not to exist.
#[test]
fn images_that_begin_with_one_are_named() {
    let root = TempDir::new().unwrap();
    let folder = kitti(root.path());
    let count = own().frames.len();
    for camera in [2, 3] {
        let image = |index: usize| folder.join(format!("image_{camera}/{index:06}.png"));
        (0..count).rev().for_each(|index| fs::rename(image(index), image(index + 1)).unwrap());
    }
    let faults = Dataset::open(&folder).unwrap_err();
    let said = faults[0].to_string();
    assert!(faults.len() == 1 && said.starts_with("images that do not begin with 000000.png"), "{faults:?}");
    assert!(said.contains("image_2: the first is 000001.png"), "{said}");
}

#[test]
fn a_site_makes_them_sources() {
    let folder = TempDir::new().unwrap();
    euroc(folder.path());
    fs::copy(sample().join("site.toml"), folder.path().join("site.toml")).unwrap();
    let file = folder.path().join("e.toml");
    fs::write(&file, "question = 'Same?'\nsource = { name = 'euroc', path = '.', site = 'site.toml' }\n").unwrap();
    let out = folder.path().join("out");
    run(&Plan::read(&file, &[]).unwrap(), &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    // Without a prior every object is attempted in every frame; those in view have a fix.
    let table = fs::read_to_string(out.join("results.csv")).unwrap();
    let columns: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let (outcome, wrong) = ("outcome", "wrong");
    let of = |name: &str| columns[0].iter().position(|column| *column == name).unwrap();
    assert!(columns.iter().any(|row| row[of(outcome)] == "fix"), "{table}");
    assert!(columns.iter().all(|row| row[of(wrong)] != "true"), "a wrong fix: {table}");
    let rejected = Plan::read(&file, &["source.site=".to_owned()]).unwrap_err();
    assert!(rejected[0].to_string().contains("the file of a site"), "{}", rejected[0]);
}

#[test]
fn faults_name_file_and_line() {
    let message = |at: &Path, file: &str, from: &str, to: &str| {
        let path = at.join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let message = Dataset::open(at).map(|_| ()).unwrap_err()[0].to_string();
        fs::write(&path, text).unwrap();
        message
    };
    let folder = TempDir::new().unwrap();
    euroc(folder.path());
    let of = |file: &str, from: &str, to: &str| message(&folder.path().join("mav0"), file, from, to);
    let sheet = "cam1/sensor.yaml";
    let distortion = of(sheet, "radial-tangential", "polynomial");
    assert!(
        distortion.starts_with("an unknown `distortion_model` in ")
            && distortion.contains("sensor.yaml:17: polynomial"),
        "{distortion}"
    );
    assert!(of(sheet, "intrinsics: [", "intrinsics: [7.0, ").contains("`intrinsics` has 5 numbers"));
    assert!(of(sheet, "resolution", "solution").contains("`resolution` is not a list of numbers"));
    assert!(of(sheet, "data: [", "data: [7.0, ").contains("`T_BS` has 17 numbers"));
    assert!(of(sheet, "camera_model: pinhole", "camera_model: [").contains("invalid YAML"));
    let stamp = own().frames[1].stamp_ns.to_string();
    assert!(of("cam0/data.csv", &stamp, "0").contains("not later than the previous one"));
    assert!(of("cam0/data.csv", &format!("{stamp}.png"), "../../x.png").contains("leads out"));
    assert!(of("cam0/data.csv", &format!("{stamp}.png"), "x.png").contains("does not exist"));
    assert!(of("cam1/sensor.yaml", "T_BS", "T_SB").contains("`T_BS` is not a list"));

    let folder = TempDir::new().unwrap();
    let sequence = kitti(folder.path());
    let of = |file: &str, from: &str, to: &str| message(&sequence, file, from, to);
    assert!(of("calib.txt", "P3:", "P9:").contains("no line `P3:`"));
    assert!(of("calib.txt", "P3: ", "P3: 7.0 ").contains("calib.txt:4"));
    assert!(of("times.txt", "\n", "\nx\n").contains("times.txt:2: x"));
    let uneven = of("../../poses/07.txt", "\n", " 1\n");
    assert!(uneven.contains("not a rotation") && uneven.contains("07.txt:1"), "{uneven}");
    fs::remove_file(sequence.join("image_3/000002.png")).unwrap();
    let missing = Dataset::open(&sequence).map(|_| ()).unwrap_err()[0].to_string();
    assert!(missing.contains("times.txt:3") && missing.contains("image_3/000002.png"), "{missing}");
    let none = Dataset::open(folder.path()).map(|_| ()).unwrap_err()[0].to_string();
    assert!(none.contains("a folder without a data set"), "{none}");
}
