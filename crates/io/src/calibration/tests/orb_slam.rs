//! The settings of ORB-SLAM: new and old names, rectified and raw images, and what is no stereo rig.

use super::*;

/// `Stereo.T_c1_c2` is left_from_right. Fails if it is taken for right_from_left.
#[test]
fn orb_slam_s_pair_is_related_by_left_from_right() {
    let r = turn().transpose();
    let t = -(r * step());
    let rows: Vec<f64> = (0..3).flat_map(|i| [r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]).collect();
    let camera = |name: &str| {
        let k = [("fx", 500.1), ("fy", 500.3), ("cx", 511.5), ("cy", 383.5)];
        let d = ["k1", "k2", "p1", "p2", "k3"].into_iter().zip(D);
        k.into_iter().chain(d).map(|(key, value)| format!("{name}.{key}: {value}\n")).collect::<String>()
    };
    let text = |first: &str, motion: &str, kind: &str| {
        format!(
            "%YAML:1.0\n---\nCamera.type: \"{kind}\"\nCamera.width: 1024\nCamera.height: 768\n{}{}{motion}: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data:[{}, 0, 0, 0, 1]\n",
            camera(first),
            camera("Camera2"),
            list(&rows)
        )
    };
    for names in [("Camera1", "Stereo.T_c1_c2"), ("Camera", "Tlr")] {
        same(&[("EuRoC.yaml", text(names.0, names.1, "PinHole"))], Given::default(), "settings of ORB-SLAM", 1e-12);
    }
    let wide =
        found(&[("TUM_VI.yaml", text("Camera1", "Stereo.T_c1_c2", "KannalaBrandt8"))], Given::default()).unwrap();
    assert_eq!(wide.rig.left().distortion().model(), seafix_geometry::LensModel::Equidistant);
    let mono =
        "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.width: 1024\nCamera.height: 768\n".to_owned() + &camera("Camera1");
    let said = found(&[("mono.yaml", mono)], Given::default()).unwrap_err();
    assert!(said.starts_with("coefficients of one camera without the other") && said.contains("Camera2.fx"), "{said}");
}

#[test]
fn orb_slam_s_rectified_images_have_a_baseline() {
    let text = |type_: &str, baseline: &str| {
        format!(
            "%YAML:1.0\n{type_}Camera.width: 1024\nCamera.height: 768\nCamera.fx: 500.0\nCamera.fy: 500.0\nCamera.cx: 511.0\nCamera.cy: 383.0\n{baseline}"
        )
    };
    for baseline in ["Camera.bf: 125.0\n", "Stereo.b: 0.25\n"] {
        let rig = found(&[("KITTI.yaml", text("", baseline))], Given::default()).unwrap();
        assert!((rig.rig.baseline() - 0.25).abs() < 1e-12 && rig.rig.is_rectified());
        assert_eq!(rig.rig.left().size(), [1024, 768]);
    }
    for (more, states) in [("RGBD.DepthMapFactor: 5000.0\nStereo.b: 0.07\n", "RGB-D"), ("", "monocular")] {
        let said = found(&[("TUM1.yaml", text("", more))], Given::default()).unwrap_err();
        assert!(said.contains(states) && said.starts_with("settings of one camera"), "{said}");
    }
}

/// The settings of raw images: x_rect = R x, P = K [I | t]. Fails if R or t is left away.
#[test]
fn orb_slam_s_raw_images_are_rectified_by_their_matrices() {
    let between = Vector3::new(-step().norm(), 0.0, 0.0);
    let right = Rotation3::rotation_between(&step(), &between).unwrap().into_inner();
    let left = right * turn();
    let matrix = |name: &str, numbers: &[f64]| {
        format!(
            "{name}: !!opencv-matrix\n   rows: 3\n   cols: {}\n   dt: d\n   data:[{}]\n",
            numbers.len() / 3,
            list(numbers)
        )
    };
    let k = [500.1, 0.0, 511.5, 0.0, 500.3, 383.5, 0.0, 0.0, 1.0];
    let side = |name: &str, r: &Matrix3<f64>, shift: f64| {
        let p = [480.0, 0.0, 500.0, 480.0 * shift, 0.0, 480.0, 380.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let d = format!("{name}.D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [{}]\n", list(&D));
        matrix(&format!("{name}.K"), &k)
            + &d
            + &matrix(&format!("{name}.R"), &by_rows(r))
            + &matrix(&format!("{name}.P"), &p)
    };
    let text = "%YAML:1.0\nCamera.fx: 480.0\nCamera.width: 1024\nCamera.height: 768\nCamera.bf: 120.0\n".to_owned()
        + &side("LEFT", &left, 0.0)
        + &side("RIGHT", &right, between.x);
    same(&[("EuRoC.yaml", text)], Given::default(), "settings of ORB-SLAM", 1e-12);
}
