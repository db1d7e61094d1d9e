//! One rig in the notation of every program.

mod colmap_rig;
mod lists;
mod orb_slam;

use std::path::PathBuf;

use nalgebra::{Matrix3, Rotation3, Vector3};
use tempfile::TempDir;

use super::*;
use crate::Rig;

const D: [f64; 5] = [0.0015, 0.0004, -3e-5, 0.0004, 0.0002];

fn turn() -> Matrix3<f64> {
    Rotation3::from_scaled_axis(Vector3::new(0.01, -0.02, 0.03)).into_inner()
}

fn step() -> Vector3<f64> {
    Vector3::new(-0.25, 0.002, 0.001)
}

fn list(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

fn by_rows(m: &Matrix3<f64>) -> Vec<f64> {
    m.transpose().iter().copied().collect()
}

/// The files in a folder of their own; the first is read.
fn found(files: &[(&str, String)], given: Given) -> Result<Calibration, String> {
    let folder = TempDir::new().unwrap();
    let mut paths: Vec<PathBuf> = Vec::new();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        paths.push(path);
    }
    read(&paths[..1], given).map_err(|fault| fault.to_string())
}

/// The rig of the files is the one above.
fn same(files: &[(&str, String)], given: Given, format: &str, decimals: f64) {
    let found = found(files, given).unwrap();
    assert_eq!(found.format, format);
    let pose = found.rig.right_from_left();
    assert!((pose.rotation_matrix() - turn()).amax() < decimals, "{format}: {}", pose.rotation_matrix());
    assert!((pose.translation() - step()).amax() < decimals, "{format}: {}", pose.translation());
    for camera in [found.rig.left(), found.rig.right()] {
        assert_eq!(camera.size(), [1024, 768], "{format}");
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        for (a, b) in [(fx, 500.1), (fy, 500.3), (cx, 511.5), (cy, 383.5)] {
            assert!((a - b).abs() < 1e-9, "{format}: {a} for {b}");
        }
        let d = camera.distortion().coefficients();
        for (a, b) in d.iter().zip(D) {
            assert!((a - b).abs() < 1e-12, "{format}: {d:?}");
        }
    }
}

fn kalibr(model: &str, coefficients: &[f64]) -> String {
    let (r, t) = (turn(), step());
    let camera = |pose: &str| {
        format!(
            "  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: {model}\n  intrinsics: [500.1, 500.3, 511.5, 383.5]\n{pose}  resolution: [1024, 768]\n",
            list(coefficients)
        )
    };
    let rows: String = (0..3).map(|i| format!("  - [{}]\n", list(&[r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]))).collect();
    format!("cam0:\n{}cam1:\n{}", camera(""), camera(&format!("  T_cn_cnm1:\n{rows}  - [0.0, 0.0, 0.0, 1.0]\n")))
}

#[test]
fn kalibr_s_camchain() {
    same(&[("camchain.yaml", kalibr("radtan", &D))], Given::default(), "Kalibr camchain", 1e-12);
    let wide = found(&[("camchain.yaml", kalibr("equidistant", &[0.1, 0.01, 0.0, 0.0]))], Given::default()).unwrap();
    assert_eq!(
        wide.rig.left(),
        &seafix_geometry::Pinhole::equidistant([1024, 768], [500.1, 500.3], [511.5, 383.5], &[0.1, 0.01, 0.0, 0.0])
            .unwrap()
    );
    assert!(
        found(&[("c.yaml", kalibr("fov", &[0.9]))], Given::default())
            .unwrap_err()
            .contains("unsupported distortion model in")
    );
}

/// A camchain of cameras and IMU may have no `T_cn_cnm1`. Fails if that is required, or if the poses are chained wrongly.
#[test]
fn kalibr_s_cameras_are_related_by_the_imu() {
    let body = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2)).into_inner();
    let place = Vector3::new(0.1, -0.4, 0.2);
    let key = |r: &Matrix3<f64>, t: &Vector3<f64>| {
        let rows: String =
            (0..3).map(|i| format!("  - [{}]\n", list(&[r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]))).collect();
        format!("  T_cam_imu:\n{rows}  - [0.0, 0.0, 0.0, 1.0]\n")
    };
    let text = kalibr("radtan", &D);
    let (before, after) = text.split_once("  T_cn_cnm1:\n").unwrap();
    let rest = after.split_once("0.0, 1.0]\n").unwrap().1;
    let without = format!("{before}{rest}");
    assert!(
        found(&[("camchain.yaml", without)], Given::default())
            .unwrap_err()
            .starts_with("no pose of the second camera in")
    );
    let right = key(&(turn() * body), &(turn() * place + step()));
    let text = format!("{before}{right}{rest}").replacen("cam0:\n", &format!("cam0:\n{}", key(&body, &place)), 1);
    same(&[("camchain.yaml", text)], Given::default(), "Kalibr camchain", 1e-12);
}

fn matrix_yaml(name: &str, rows: usize, numbers: &[f64]) -> String {
    format!("{name}:\n  rows: {rows}\n  cols: {}\n  data: [{}]\n", numbers.len() / rows, list(numbers))
}

#[test]
fn ros_s_left_and_right() {
    // Both rectified axes are those of the left camera turned by R_l; P of the right has the baseline along x.
    let between = Vector3::new(-step().norm(), 0.0, 0.0);
    // R_r t_raw = between, with R_r = R_l R^T: take R_r as the rotation of step onto between.
    let right = Rotation3::rotation_between(&step(), &between).unwrap().into_inner();
    let left = right * turn();
    let camera = |r: &Matrix3<f64>, tx: f64| {
        let k = [500.1, 0.0, 511.5, 0.0, 500.3, 383.5, 0.0, 0.0, 1.0];
        let p = [480.0, 0.0, 500.0, tx * 480.0, 0.0, 480.0, 380.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        "image_width: 1024\nimage_height: 768\ncamera_name: c\n".to_owned()
            + &matrix_yaml("camera_matrix", 3, &k)
            + "distortion_model: plumb_bob\n"
            + &matrix_yaml("distortion_coefficients", 1, &D)
            + &matrix_yaml("rectification_matrix", 3, &by_rows(r))
            + &matrix_yaml("projection_matrix", 3, &p)
    };
    let files = [("left.yaml", camera(&left, 0.0)), ("right.yaml", camera(&right, between.x))];
    same(&files, Given::default(), "ROS camera calibration", 1e-12);
    assert!(found(&files[..1], Given::default()).unwrap_err().contains("give both, left.yaml and right.yaml"));
}

fn opencv(names: [&str; 6]) -> String {
    let matrix = |name: &str, rows: usize, numbers: &[f64]| {
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {}\n   dt: d\n   data: [ {} ]\n",
            numbers.len() / rows,
            list(numbers)
        )
    };
    let k = [500.1, 0.0, 511.5, 0.0, 500.3, 383.5, 0.0, 0.0, 1.0];
    let [k1, d1, k2, d2, r, t] = names;
    "%YAML:1.0\n---\n".to_owned()
        + &matrix(k1, 3, &k)
        + &matrix(d1, 1, &D)
        + &matrix(k2, 3, &k)
        + &matrix(d2, 1, &D)
        + &matrix(r, 3, &by_rows(&turn()))
        + &matrix(t, 3, step().as_slice())
}

#[test]
fn opencv_s_file_storage() {
    let size = "image_size: [ 1024, 768 ]\n";
    for names in [
        ["K1", "D1", "K2", "D2", "R", "T"],
        ["M1", "D1", "M2", "D2", "R", "T"],
        ["cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"],
        [
            "left_camera_matrix",
            "left_distortion_coefficients",
            "right_camera_matrix",
            "right_distortion_coefficients",
            "rotation_matrix",
            "translation_vector",
        ],
        ["K0", "D0", "K1", "D1", "R", "T"],
    ] {
        same(&[("stereo.yml", opencv(names) + size)], Given::default(), "OpenCV FileStorage", 1e-12);
    }
    let bare = opencv(["K1", "D1", "K2", "D2", "R", "T"]);
    assert!(found(&[("stereo.yml", bare.clone())], Given::default()).unwrap_err().starts_with("no size of the images"));
    let given = Given { size: Some([1024, 768]), unit: 1.0 };
    same(&[("stereo.yml", bare.clone())], given, "OpenCV FileStorage", 1e-12);
    let (matrices, pose) = bare.split_at(bare.find("R: ").unwrap());
    let parts = [("intrinsics.yml", matrices.to_owned()), ("extrinsics.yml", "%YAML:1.0\n---\n".to_owned() + pose)];
    same(&parts, given, "OpenCV FileStorage", 1e-12);
    // Four coefficients are those of two models.
    let four = bare.replace(", 0.0002", "") + size;
    assert!(
        found(&[("s.yml", four.clone())], Given::default())
            .unwrap_err()
            .contains("may be k1 k2 p1 p2 or those of a fisheye lens")
    );
    let fisheye = found(&[("s.yml", four + "distortion_model: equidistant\n")], Given::default()).unwrap();
    assert_eq!(fisheye.rig.left().distortion().shortest(), &D[..4]);
    assert_eq!(fisheye.rig.left().distortion().model(), seafix_geometry::LensModel::Equidistant);
}

/// A calibration that failed. Fails if its matrix is not seen, or if any list of the file may hold such a number.
#[test]
fn numbers_that_are_not_finite_are_named() {
    let text = opencv(["K1", "D1", "K2", "D2", "R", "T"]) + "image_size: [ 1024, 768 ]\n";
    let said = |from: &str, to: &str| found(&[("s.yml", text.replacen(from, to, 1))], Given::default()).unwrap_err();
    let matrix = said("500.3", ".Nan");
    assert!(
        matrix.starts_with("`K1` has a number that is not finite in ") && matrix.contains("s.yml:7: .Nan; calibrate"),
        "{matrix}"
    );
    assert!(said("0.0015", "-.Inf").contains(":12: -.Inf"), "{}", said("0.0015", "-.Inf"));
    assert!(said("-0.25", "NaN").starts_with("`T` has"));
    let other = [("s.yml", text + "per_view_errors: [ .Nan, 0.2 ]\n")];
    same(&other, Given::default(), "OpenCV FileStorage", 1e-12);
}

/// Fails if its deviation from orthonormal columns, which is none, is all that is said.
#[test]
fn a_reflection_states_its_determinant() {
    let mut reflected = turn();
    reflected.set_column(2, &-reflected.column(2));
    let text = opencv(["K1", "D1", "K2", "D2", "R", "T"]) + "image_size: [ 1024, 768 ]\n";
    let text = text.replace(&list(&by_rows(&turn())), &list(&by_rows(&reflected)));
    let said = found(&[("s.yml", text)], Given::default()).unwrap_err();
    assert!(said.starts_with("`R` is a reflection in ") && said.contains("its determinant is -1"), "{said}");
}

#[test]
fn opencv_s_xml() {
    let matrix = |name: &str, numbers: &[f64]| {
        format!(
            "<{name} type_id=\"opencv-matrix\"><rows>1</rows><cols>1</cols><dt>d</dt><data>{}</data></{name}>\n",
            list(numbers).replace(',', "")
        )
    };
    let k = [500.1, 0.0, 511.5, 0.0, 500.3, 383.5, 0.0, 0.0, 1.0];
    let text = format!(
        "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>1024</image_width><image_height>768</image_height>{}{}{}{}{}{}</opencv_storage>\n",
        matrix("K1", &k),
        matrix("D1", &D),
        matrix("K2", &k),
        matrix("D2", &D),
        matrix("R", &by_rows(&turn())),
        matrix("T", step().as_slice())
    );
    same(&[("stereo.xml", text.clone())], Given::default(), "OpenCV FileStorage", 1e-12);
    let said = found(&[("stereo.xml", text.replace("500.1", ".Nan"))], Given::default()).unwrap_err();
    assert!(said.contains("stereo.xml:3: .Nan"), "{said}");
    assert!(
        found(&[("stereo.xml", text.replace("</K1>", "</K>"))], Given::default())
            .unwrap_err()
            .starts_with("invalid XML")
    );
}

#[test]
fn euroc_s_sensors() {
    // The body is turned against both cameras; T_BS = body_from_sensor.
    let body = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2)).into_inner();
    let place = Vector3::new(0.1, -0.4, 0.2);
    let right = body * turn().transpose();
    let sensor = |r: &Matrix3<f64>, t: &Vector3<f64>| {
        let rows: Vec<f64> =
            (0..3).flat_map(|i| [r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]).chain([0.0, 0.0, 0.0, 1.0]).collect();
        format!(
            "sensor_type: camera\n{}resolution: [1024, 768]\ncamera_model: pinhole\nintrinsics: [500.1, 500.3, 511.5, 383.5]\ndistortion_model: radial-tangential\ndistortion_coefficients: [{}]\n",
            matrix_yaml("T_BS", 4, &rows),
            list(&D)
        )
    };
    let files =
        [("cam0/sensor.yaml", sensor(&body, &place)), ("cam1/sensor.yaml", sensor(&right, &(place - right * step())))];
    same(&files, Given::default(), "EuRoC sensor.yaml", 1e-12);
}

#[test]
fn colmap_s_cameras_and_rigs() {
    let q = nalgebra::UnitQuaternion::from_matrix(&turn());
    let t = step();
    let cameras = "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n7 FULL_OPENCV 1024 768 500.1 500.3 512 384 0.0015 0.0004 -3e-5 0.0004 0.0002 0 0 0\n9 FULL_OPENCV 1024 768 500.1 500.3 512 384 0.0015 0.0004 -3e-5 0.0004 0.0002 0 0 0\n";
    let rigs = format!(
        "#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[]\n1 2 CAMERA 7 CAMERA 9 1 {} {} {} {} {} {} {}\n",
        q.w, q.i, q.j, q.k, t.x, t.y, t.z
    );
    same(
        &[("cameras.txt", cameras.to_owned()), ("rigs.txt", rigs)],
        Given::default(),
        "COLMAP cameras and rigs",
        1e-12,
    );
    assert!(found(&[("cameras.txt", cameras.to_owned())], Given::default()).unwrap_err().contains("give rigs.txt too"));
    // The quaternion with w last.
    let w_last = format!("1 2 CAMERA 7 CAMERA 9 1 {} {} {} {} -0.25 0 0\n", q.i, q.j, q.k, q.w);
    let rolled = found(&[("cameras.txt", cameras.to_owned()), ("rigs.txt", w_last)], Given::default()).unwrap();
    assert!(rolled.warning.is_some_and(|fault| fault.to_string().contains("w first or last")));
    // The comment may be missing, and the cameras exchanged.
    let bare: String = cameras.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect();
    let rigs = "1 2 CAMERA 7 CAMERA 9 1 1 0 0 0 0.25 0 0\n".to_owned();
    let other = found(&[("cameras.txt", bare), ("rigs.txt", rigs)], Given::default()).unwrap();
    assert!(other.notes.iter().any(|note| note.contains("exchange the files")), "{:?}", other.notes);
}

#[test]
fn metashape_s_cameras() {
    // P1 and P2 are OpenCV's p2 and p1; cx, cy count from the middle of the image.
    let calibration = "<calibration type=\"frame\" class=\"adjusted\"><resolution width=\"1024\" height=\"768\"/><f>500.3</f><cx>0</cx><cy>0</cy><b1>-0.2</b1><k1>0.0015</k1><k2>0.0004</k2><k3>0.0002</k3><p1>0.0004</p1><p2>-3e-5</p2></calibration>";
    let turn = turn().transpose();
    let place = -(turn * step());
    let text = format!(
        "<?xml version=\"1.0\"?><document><chunk><sensors><sensor id=\"0\" type=\"frame\">{calibration}</sensor><sensor id=\"1\" master_id=\"0\">{calibration}<rotation>{}</rotation><location>{}</location></sensor></sensors></chunk></document>",
        list(&by_rows(&turn)).replace(',', ""),
        list(place.as_slice()).replace(',', "")
    );
    same(&[("cameras.xml", text)], Given::default(), "Metashape cameras", 1e-12);
}

#[test]
fn matlab_s_exports() {
    let pair = |a: f64, b: f64| format!("[ {a} ; {b} ]");
    let side = |side: &str| {
        format!(
            "fc_{side} = {};\ncc_{side} = {};\nalpha_c_{side} = [ 0 ];\nkc_{side} = [ {} ];\n",
            pair(500.1, 500.3),
            pair(511.5, 383.5),
            list(&D).replace(", ", " ; ")
        )
    };
    let bouguet = format!(
        "nx = 1024;\nny = 768;\n{}{}om = [ 0.01 ; -0.02 ; 0.03 ];\nT = [ -250 ; 2 ; 1 ];\n",
        side("left"),
        side("right")
    );
    same(&[("Calib_Results_stereo.m", bouguet)], Given::default(), "MATLAB Calib_Results_stereo.m", 1e-12);

    // Pixels from one, the intrinsic matrix and the rotation transposed, lengths in millimetres.
    let camera = "{\"RadialDistortion\":[0.0015,0.0004,0.0002],\"TangentialDistortion\":[-3e-5,0.0004],\"ImageSize\":[768,1024],\"IntrinsicMatrix\":[[500.1,0,0],[0,500.3,0],[512.5,384.5,1]]}";
    let text = format!(
        "{{\"CameraParameters1\":{camera},\"CameraParameters2\":{camera},\"RotationOfCamera2\":[{}],\"TranslationOfCamera2\":[-250,2,1]}}",
        list(&by_rows(&turn().transpose()))
    );
    same(&[("stereo.json", text)], Given::default(), "MATLAB stereoParameters", 1e-12);
}

#[test]
fn kitti_s_projections() {
    let text = "P0: 500 0 511 0 0 500 383 0 0 0 1 0\nP1: 500 0 511 -125 0 500 383 0 0 0 1 0\n".to_owned();
    let rig = found(&[("calib.txt", text)], Given { size: Some([1024, 768]), unit: 1.0 }).unwrap();
    assert!((rig.rig.baseline() - 0.25).abs() < 1e-15 && rig.rig.is_rectified());
}

#[test]
fn a_rig_is_expected_and_a_calibration_is_given() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("camchain.yaml");
    std::fs::write(&path, kalibr("radtan", &D)).unwrap();
    assert!((Rig::from_file(&path).unwrap().stereo.baseline() - step().norm()).abs() < 1e-12);
    let other = folder.path().join("other.yaml");
    std::fs::write(&other, "a: 1\n").unwrap();
    assert!(Rig::from_file(&other).unwrap_err().to_string().starts_with("not a known stereo calibration"));
    // A baseline in millimetres is told, and its unit can be stated.
    std::fs::write(
        &path,
        kalibr("radtan", &D).replace("-0.25]", "-250]").replace("0.002]", "2]").replace("0.001]", "1]"),
    )
    .unwrap();
    let said = Rig::from_file(&path).unwrap_err().to_string();
    assert!(said.starts_with("units? a baseline of 250.0") && said.contains("as millimetres it is 0.2500 m"), "{said}");
    assert!((read(&[path], Given { size: None, unit: 1e-3 }).unwrap().rig.baseline() - step().norm()).abs() < 1e-12);
}
