//! COLMAP's `rig_config.json`, with its intrinsics or with `cameras.txt` and `images.txt` beside it.

use super::*;

const CAMERAS: &str = "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n7 FULL_OPENCV 1024 768 500.1 500.3 512 384 0.0015 0.0004 -3e-5 0.0004 0.0002 0 0 0\n9 FULL_OPENCV 1024 768 500.1 500.3 512 384 0.0015 0.0004 -3e-5 0.0004 0.0002 0 0 0\n";
const IMAGES: &str =
    "# Image list\n1 1 0 0 0 0 0 0 7 rig/left/a.png\n10.5 20.5 -1 30 40 7\n2 1 0 0 0 0 0 0 9 rig/right/a.png\n\n";

/// The configuration; `more` are further keys of both cameras.
fn config(more: &str) -> String {
    let q = nalgebra::UnitQuaternion::from_matrix(&turn());
    let pose = format!(
        "\"cam_from_rig_rotation\": [{}], \"cam_from_rig_translation\": [{}]",
        list(&[q.w, q.i, q.j, q.k]),
        list(step().as_slice())
    );
    format!(
        "[{{\"cameras\": [{{\"image_prefix\": \"rig/right/\", {pose}{more}}}, {{\"image_prefix\": \"rig/left/\", \"ref_sensor\": true{more}}}]}}]"
    )
}

const PARAMETERS: &str = ", \"camera_model_name\": \"FULL_OPENCV\", \"camera_params\": [500.1, 500.3, 512, 384, 0.0015, 0.0004, -3e-5, 0.0004, 0.0002, 0, 0, 0]";

#[test]
fn colmap_s_rig_configuration_and_its_cameras() {
    let own = [("rig_config.json", config(PARAMETERS))];
    let given = Given { size: Some([1024, 768]), unit: 1.0 };
    same(&own, given, "COLMAP rig_config.json", 1e-12);
    assert!(found(&own, Given::default()).unwrap_err().starts_with("no size of the images"));
    let (cameras, images) = (("cameras.txt", CAMERAS.to_owned()), ("images.txt", IMAGES.to_owned()));
    // Sizes stand beside the file, and so may everything about the cameras.
    same(&[own[0].clone(), cameras.clone()], Given::default(), "COLMAP rig_config.json", 1e-12);
    let bare = ("rig_config.json", config(""));
    same(&[bare.clone(), cameras.clone(), images], Given::default(), "COLMAP rig_config.json", 1e-12);
    let said = found(&[bare, cameras], Given::default()).unwrap_err();
    assert!(said.starts_with("no intrinsics of a camera") && said.contains("images.txt"), "{said}");
}

#[test]
fn what_is_no_pair_in_a_rig_configuration_is_named() {
    let given = Given { size: Some([1024, 768]), unit: 1.0 };
    let said = |text: String| found(&[("rig_config.json", text)], given).unwrap_err();
    let text = config(PARAMETERS);
    assert!(said(text.replace(", \"ref_sensor\": true", "")).starts_with("a rig without one reference camera"));
    assert!(said(text.replace("cam_from_rig_rotation", "rotation")).starts_with("no pose of the second camera"));
    let third = text.replacen("[{\"cameras\": [", "[{\"cameras\": [{\"image_prefix\": \"c\"}, ", 1);
    assert!(said(third).starts_with("not a rig of two cameras"));
    assert!(said(text.replace("FULL_OPENCV", "FOV")).starts_with("an unsupported camera model FOV"));
    assert!(said(text.replace("]}]", "")).starts_with("invalid JSON"));
}
