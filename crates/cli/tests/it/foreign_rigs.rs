//! Calibrations, images and sites that contradict each other, and what `check` says of them.

use std::fs;

use crate::{
    ended_with,
    foreign_files::{checked, copied, edit},
    program,
};

/// The first pairs of the sample, as few as a test needs.
fn pairs(count: usize) -> tempfile::TempDir {
    let folder = copied();
    edit(&folder, "frames.csv", |text| text.lines().take(1 + count).map(|line| format!("{line}\n")).collect());
    edit(&folder, "visibility.csv", |text| {
        let stamps: Vec<String> = fs::read_to_string(folder.path().join("frames.csv"))
            .unwrap()
            .lines()
            .map(|line| line.split(',').next().unwrap().to_owned())
            .collect();
        let kept = |line: &&str| stamps.iter().any(|stamp| line.starts_with(stamp));
        text.lines().filter(kept).map(|line| format!("{line}\n")).collect()
    });
    folder
}

/// Fails if a focal length in millimetres is a camera of 179°.
#[test]
fn a_focal_length_in_millimetres_is_rejected() {
    let folder = copied();
    edit(&folder, "dataset.toml", |text| text.replace("fx = 500.0", "fx = 6.0").replace("fy = 500.0", "fy = 6.0"));
    checked(
        &folder,
        1,
        &["units? 6 px in images 1024 px wide is a field of view of 178.7°", "the pitch of the pixels"],
    );
}

/// Mistakes that both cameras share leave matches on the epipolar lines; the truth shows them.
#[test]
fn mistakes_of_both_cameras_are_named() {
    for (from, to, explained) in [
        (["cx =", "cy ="], ["cy =", "cx ="], "if cx and cy are exchanged"),
        (["fx = 500.0", "fy = 500.0"], ["fx = 250.0", "fy = 250.0"], "if the focal length is twice as large"),
    ] {
        let folder = pairs(2);
        edit(&folder, "dataset.toml", |text| {
            text.replace(from[0], "\u{1}").replace(from[1], to[1]).replace('\u{1}', to[0])
        });
        checked(&folder, 1, &["that contradict the images", explained]);
    }
}

/// The prior predicts the objects where they were surveyed. Fails if it is compared with their true places.
#[test]
fn a_site_in_another_world_is_named() {
    let folder = pairs(3);
    edit(&folder, "site.toml", |text| {
        let line = |line: &str| match line.strip_prefix("base_in_world = ") {
            Some(rows) => {
                let rows: Vec<[f64; 3]> = serde_json::from_str(rows).unwrap();
                let rows: Vec<[f64; 3]> = rows.into_iter().map(|[north, east, down]| [east, north, -down]).collect();
                format!("base_in_world = {}\n", serde_json::to_string(&rows).unwrap())
            }
            None => format!("{line}\n"),
        };
        text.lines().map(line).collect()
    });
    checked(&folder, 1, &["poses of the prior that put no object in view", "ENU for NED"]);
}

/// The vehicle's poses as the camera's, with a prior so wide that chance gives as many matches: only fixes tell.
#[test]
fn a_wide_prior_of_the_vehicle_is_named_by_fixes() {
    let folder = pairs(2);
    // body_from_camera turns by a quarter about the axis of view.
    let mounted = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, -std::f64::consts::FRAC_PI_2);
    edit(&folder, "prior.tum", |text| {
        let line = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let n: Vec<f64> = words[1..].iter().map(|word| word.parse().unwrap()).collect();
            let q =
                nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(n[6], n[3], n[4], n[5])) * mounted;
            format!("{} {} {} {} {}\n", words[..4].join(" "), q.i, q.j, q.k, q.w)
        };
        text.lines().filter(|line| !line.starts_with('#')).take(2).map(line).collect()
    });
    edit(&folder, "dataset.toml", |text| {
        let kept = |line: &&str| !["truth =", "visibility =", "objects ="].iter().any(|key| line.starts_with(key));
        let text: String = text.lines().filter(kept).map(|line| format!("{line}\n")).collect();
        text.replace("position = 0.1", "position = 1.0").replace("attitude_deg = 0.5", "attitude_deg = 5.0")
    });
    let named = "a fix in 0 of 2 pairs as given, in 2 if they are poses of the vehicle (body_from_camera is applied)";
    checked(&folder, 1, &["poses of the prior that give no fix", named]);
}

#[test]
fn images_of_another_size_state_the_ratio() {
    for (size, part) in [
        ("[2048, 1536]", "multiply fx, fy, cx + 0.5 and cy + 0.5 by 0.5 and correct `size`"),
        ("[768, 1024]", "theirs are turned by 90°"),
        ("[1000, 768]", "use the images of the calibrated camera"),
    ] {
        let folder = copied();
        edit(&folder, "dataset.toml", |text| text.replace("[1024, 768]", size).replace("cx = 511.5", "cx = 383.5"));
        checked(&folder, 1, &[part]);
    }
}

#[test]
fn an_image_of_another_format_states_its_converter() {
    let folder = copied();
    fs::write(folder.path().join("left001.png"), b"RIFF\x24\0\0\0WEBPVP8 and so on").unwrap();
    checked(&folder, 1, &["an image of a format that is not read in", "left001.png: WebP; convert it to PNG: `dwebp"]);
}

#[test]
fn the_columns_of_the_frames_are_read_by_name() {
    let folder = copied();
    edit(&folder, "frames.csv", |text| {
        let turned = |line: &str| line.split(',').rev().collect::<Vec<_>>().join(";") + "\n";
        text.lines().map(turned).collect()
    });
    checked(&folder, 0, &["in order"]);
}

#[test]
fn stamps_in_seconds_are_named_where_nanoseconds_stand() {
    let folder = copied();
    edit(&folder, "frames.csv", |text| text.replace("1700000000000000000,", "1700000000.0,"));
    checked(&folder, 1, &["not a whole number in", "frames.csv:2: 1700000000.0; stamps are whole nanoseconds"]);
}

#[test]
fn a_calibration_of_orb_slam_is_a_rig() {
    let folder = copied();
    let text = "%YAML:1.0\nCamera.type: \"Rectified\"\nCamera1.fx: 500.0\nCamera1.fy: 500.0\nCamera1.cx: 511.5\n\
                Camera1.cy: 383.5\nCamera.width: 1024\nCamera.height: 768\nStereo.b: 0.25\n";
    fs::write(folder.path().join("orb.yaml"), text).unwrap();
    let said = ended_with(0, program().current_dir(folder.path()).args(["check", "orb.yaml"])).out;
    assert!(said.contains("settings of ORB-SLAM") && said.contains("baseline 0.2500 m"), "{said}");
    let cloud = ["cloud", "left000.png", "right000.png", "--json", "--rig"];
    let clouds = ["orb.yaml", "dataset.toml"]
        .map(|rig| ended_with(0, program().current_dir(folder.path()).args(cloud).arg(rig)).out);
    let points = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap()["points"].clone();
    assert_eq!(points(&clouds[0]), points(&clouds[1]));
}
