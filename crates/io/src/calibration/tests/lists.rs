//! Matrices in JSON, chains by the IMU, cameras without distortion, uncalibrated cameras.

use super::*;

/// JSON of OpenCV's FileStorage (old versions write `1.`) and lists of lists under the same names.
#[test]
fn matrices_are_read_from_json() {
    let k = "[500.1, 0., 511.5, 0., 500.3, 383.5, 0., 0., 1.]";
    let rows = "[[500.1, 0, 511.5], [0, 500.3, 383.5], [0, 0, 1]]";
    let storage = |name: &str, rows: usize, data: &str| {
        format!(
            "    \"{name}\": {{ \"type_id\": \"opencv-matrix\", \"rows\": {rows}, \"cols\": 3, \"dt\": \"d\", \"data\": {data} }}"
        )
    };
    let vector = |numbers: &[f64]| format!("[{}]", list(numbers));
    let (r, t, d) = (vector(&by_rows(&turn())), vector(step().as_slice()), vector(&D));
    let opencv = [
        "    \"image_width\": 1024".to_owned(),
        "    \"image_height\": 768".to_owned(),
        storage("K1", 3, k),
        storage("D1", 1, &d),
        storage("K2", 3, k),
        storage("D2", 1, &d),
        storage("R", 3, &r),
        storage("T", 3, &t),
    ];
    let opencv = format!("{{\n{}\n}}\n", opencv.join(",\n"));
    let python = format!(
        "{{\"image_size\": [1024, 768], \"mtx_l\": {rows}, \"dist_l\": [{d}], \"mtx_r\": {rows}, \"dist_r\": [{d}], \"R\": {r}, \"T\": [[{}]]}}",
        step().iter().map(f64::to_string).collect::<Vec<_>>().join("], [")
    );
    for text in [&opencv, &python] {
        same(&[("stereo.json", text.clone())], Given::default(), "OpenCV FileStorage", 1e-12);
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("stereo.json");
        std::fs::write(&path, text).unwrap();
        assert!(is_calibration(&path));
        std::fs::write(&path, "{\"format\": \"coherence-problem/1\", \"id\": \"t\", \"model\": [[0, 0, 0]]}").unwrap();
        assert!(!is_calibration(&path), "a problem is no calibration");
    }
    assert!(
        found(&[("stereo.json", opencv.replace("\"R\"", "\"Q\""))], Given::default())
            .unwrap_err()
            .starts_with("no rotation R")
    );
}

/// OpenVINS states imu_from_camera where Kalibr states camera_from_imu. Fails if the one is taken for the other.
#[test]
fn open_vins_s_cameras_are_in_the_imu() {
    let body = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2)).into_inner();
    let place = Vector3::new(0.1, -0.4, 0.2);
    let right = body * turn().transpose();
    let key = |r: &Matrix3<f64>, t: &Vector3<f64>| {
        let rows: String =
            (0..3).map(|i| format!("    - [{}]\n", list(&[r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]))).collect();
        format!("  T_imu_cam:\n{rows}    - [0.0, 0.0, 0.0, 1.0]\n")
    };
    let text = kalibr("radtan", &D);
    let (before, after) = text.split_once("  T_cn_cnm1:\n").unwrap();
    let rest = after.split_once("0.0, 1.0]\n").unwrap().1;
    let text = format!("%YAML:1.0\n{before}{}{rest}", key(&right, &(place - right * step())));
    let text = text.replacen("cam0:\n", &format!("cam0:\n{}", key(&body, &place)), 1);
    same(&[("kalibr_imucam_chain.yaml", text)], Given::default(), "Kalibr camchain", 1e-12);
}

#[test]
fn a_chain_of_three_cameras_states_which_two_are_used() {
    let text = kalibr("radtan", &D);
    let third = text.split_once("cam1:").unwrap().1.to_owned();
    let found = found(&[("camchain.yaml", format!("{text}cam2:{third}"))], Given::default()).unwrap();
    assert!(found.notes.iter().any(|note| note.contains("cam0 and cam1 of 3 cameras")), "{:?}", found.notes);
}

#[test]
fn kalibr_s_report_is_not_its_calibration() {
    let text = "Calibration results\n====================\nCamera-system parameters:\ncam0 (/left/image_raw):\n";
    let said = found(&[("data-results-cam.txt", text.to_owned())], Given::default()).unwrap_err();
    assert!(
        said.starts_with("a report of Kalibr, which is not the calibration in") && said.contains("camchain"),
        "{said}"
    );
}

/// The last row of a motion is 0 0 0 1. Fails if any sixteen numbers are a motion.
#[test]
fn a_motion_by_columns_is_rejected() {
    let (r, t) = (turn(), step());
    let columns = format!("  T_cn_cnm1:\n  - [{}]\n", list(&[r[(0, 0)], r[(1, 0)], r[(2, 0)], 0.0]))
        + &format!("  - [{}]\n", list(&[r[(0, 1)], r[(1, 1)], r[(2, 1)], 0.0]))
        + &format!("  - [{}]\n  - [{}]\n", list(&[r[(0, 2)], r[(1, 2)], r[(2, 2)], 0.0]), list(&[t.x, t.y, t.z, 1.0]));
    let text = kalibr("radtan", &D);
    let (before, after) = text.split_once("  T_cn_cnm1:\n").unwrap();
    let rest = after.split_once("0.0, 1.0]\n").unwrap().1;
    let said = found(&[("camchain.yaml", format!("{before}{columns}{rest}"))], Given::default()).unwrap_err();
    assert!(said.starts_with("`T_cn_cnm1` is not a motion") && said.contains("the last row 0 0 0 1"), "{said}");
}

/// `left.yaml` and `right.yaml` of this model and these coefficients, with this K.
fn ros(model: &str, d: &str, k: &[f64; 9]) -> [(&'static str, String); 2] {
    let camera = |tx: f64| {
        let p = [480.0, 0.0, 500.0, tx, 0.0, 480.0, 380.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let p = if k[0] == 0.0 { [0.0; 12] } else { p };
        format!("image_width: 1024\nimage_height: 768\ndistortion_model: {model}\n")
            + &matrix_yaml("camera_matrix", 3, k)
            + &format!("distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [{d}]\n")
            + &matrix_yaml("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
            + &matrix_yaml("projection_matrix", 3, &p)
    };
    [("left.yaml", camera(0.0)), ("right.yaml", camera(-120.0))]
}

#[test]
fn a_camera_without_distortion_has_no_coefficients() {
    let k = [500.1, 0.0, 511.5, 0.0, 500.3, 383.5, 0.0, 0.0, 1.0];
    for (model, d) in [("none", ""), ("\"\"", ""), ("none", "0, 0, 0, 0, 0"), ("\"\"", "0, 0, 0, 0")] {
        let found = found(&ros(model, d, &k), Given::default()).unwrap();
        assert!(found.rig.left().distortion().shortest().is_empty() && (found.rig.baseline() - 0.25).abs() < 1e-12);
    }
    let said = found(&ros("none", "0.1, 0, 0, 0, 0", &k), Given::default()).unwrap_err();
    assert!(said.starts_with("coefficients of no distortion model") && said.contains("state plumb_bob"), "{said}");
    let said = found(&ros("plumb_bob", "", &[0.0; 9]), Given::default()).unwrap_err();
    assert!(said.starts_with("a camera that is not calibrated: K is zero"), "{said}");
    let [left, right] = ros("plumb_bob", "", &k);
    let turned = right.1.replace("data: [480, 0, 500, -120", "data: [480, 52.4, 500, -120");
    assert_ne!(turned, right.1);
    let said = found(&[left, ("right.yaml", turned)], Given::default()).unwrap_err();
    assert!(said.starts_with("P is not of the form K [I | t]") && said.contains("right.yaml"), "{said}");
}
