//! Images of wrong sizes, truncated, too large, or one for both cameras.

use std::{fs, path::Path};

use tempfile::TempDir;

use super::{Sample, pgm, rejected};
use crate::program;

#[test]
fn images_of_another_size() {
    Sample::new().put("a.pgm", &pgm(32, 48)).rejected(3, &["a.pgm", "32×48, calibrated 64×48"]);
}

#[test]
fn pairs_of_another_size_are_left_out_and_counted() {
    let sample = Sample::new();
    sample.put("c.pgm", &pgm(32, 48)).change("frames.csv", "a.pgm,b.pgm", "a.pgm,b.pgm\n2000000000,a.pgm,c.pgm");
    let run = |name: &str, more: &[&str]| {
        let out = sample.path(name);
        let given = ["run", sample.folder.path().to_str().unwrap(), "--out", out.to_str().unwrap()];
        let output = program().args(given).args(more).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap(), out)
    };
    let (code, said, out) = run("out", &[]);
    let counted = "1 of 2 pairs skipped: an image of another size than the calibration in";
    assert!(code == Some(0) && said.contains(counted) && said.contains("c.pgm"), "{said}");
    let rows = fs::read_to_string(out.join("results.csv")).unwrap().lines().count() - 1;
    assert_eq!(rows, 1, "one pair, one object");
    assert!(fs::read_to_string(out.join("manifest.json")).unwrap().contains(counted));
    let (code, said, out) = run("strict", &["--set", "source.reject-mismatched-images=true"]);
    assert!(code == Some(3) && said.contains("c.pgm") && !out.exists(), "{said}");
    // Two of three images have the size of another calibration.
    sample.change("frames.csv", "2000000000,a.pgm,c.pgm", "2000000000,a.pgm,c.pgm\n3000000000,c.pgm,c.pgm");
    let (code, said, out) = run("most", &[]);
    assert!(code == Some(3) && said.contains("32×48, calibrated 64×48") && !out.exists(), "{said}");
}

#[test]
fn a_truncated_image() {
    let sample = Sample::new();
    fs::write(sample.path("a.pgm"), b"\x89PNG\r\n\x1a\n\0\0").unwrap();
    sample.rejected(3, &["a.pgm", "PNG, JPEG, TIFF or PNM"]);
}

/// The sample with one image replaced by these bytes.
fn with_image(bytes: &[u8]) -> Sample {
    let sample = Sample::new();
    fs::write(sample.path("a.pgm"), bytes).unwrap();
    sample
}

/// The first 41 bytes of a PNG that declares this size.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    bytes.extend(width.to_be_bytes());
    bytes.extend(height.to_be_bytes());
    bytes.extend(b"\x08\0\0\0\0\0\0\0\0\0\0\0\0IDAT");
    bytes.truncate(41);
    bytes
}

#[test]
fn images_of_no_size_and_of_any() {
    with_image(b"P5 60000 60000 255\n1")
        .rejected(3, &["a.pgm", "60000×60000", "the limit is 67108864 pixels", "max-pixels"]);
    with_image(b"P5 0 0 255\n").rejected(3, &["a.pgm"]);
    with_image(&png_header(8_000_000, 4_000_000_000)).rejected(3, &["a.pgm"]);
    with_image(&png_header(0, 48)).rejected(3, &["a.pgm"]);
    with_image(b"").rejected(3, &["a.pgm"]);
}

#[test]
fn the_limits_of_images_are_settings() {
    let sample = Sample::new();
    let (folder, out) = (sample.folder.path().to_str().unwrap(), sample.path("out"));
    let run = |set: &str, code, parts: &[&str]| {
        rejected(&["run", folder, "--set", set, "--out", out.to_str().unwrap()], code, parts);
        assert!(!out.exists(), "something was written");
    };
    run("source.max-pixels=3071", 3, &["a.pgm", "64×48; the limit is 3071 pixels"]);
    run("source.max-bytes=100", 3, &["a.pgm", "the limit is 100 bytes"]);
    run("source.max-pixels=0", 2, &["max-pixels = 0"]);
    let check = |more: &[&str]| program().args(["check", folder]).args(more).output().unwrap().status.code();
    assert_eq!(
        (check(&[]), check(&["--max-pixels", "3072"]), check(&["--max-pixels", "3071"])),
        (Some(0), Some(0), Some(1))
    );
}

/// The output of `check` for the sample, and its exit code.
fn checked(sample: &Sample) -> (Option<i32>, String) {
    let output = program().arg("check").arg(sample.folder.path()).output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn one_image_for_both_cameras() {
    let sample = Sample::new();
    let (code, said) = checked(&sample);
    assert!(code == Some(0) && said.contains("in order"), "{said}");
    fs::copy(sample.path("a.pgm"), sample.path("b.pgm")).unwrap();
    let (code, said) = checked(&sample);
    let reported = said.contains("identical left and right images in") && said.contains("1 of 1 pairs");
    assert!(code == Some(1) && reported && !said.contains("in order"), "{said}");
    sample.rejected(3, &["a.pgm", "identical left and right images", "one image twice has no depth"]);
    // Two uniform images are equal without being a mistake.
    let dark = format!("P2\n64 48\n255\n{}", "9\n".repeat(64 * 48));
    sample.put("a.pgm", &dark).put("b.pgm", &dark);
    assert_eq!(checked(&sample).0, Some(0));
}

#[test]
fn samples_above_maxval() {
    let text = pgm(64, 48).replacen("255", "100", 1);
    let line = 4 + (0..64 * 48).position(|i| (i * 7919) % 251 > 100).unwrap();
    with_image(text.as_bytes()).rejected(3, &[&format!("a.pgm:{line}: "), "MAXVAL is 100; write the image again"]);
    let mut bytes = b"P5 64 48 200\n".to_vec();
    bytes.extend([7; 64 * 48]);
    let at = bytes.len() - 60;
    bytes[at] = 201;
    with_image(&bytes).rejected(3, &["a sample above MAXVAL", "a.pgm: 201 at (4, 47), MAXVAL is 200"]);
}

#[test]
#[cfg(unix)]
fn what_has_no_end_is_not_read() {
    let text = fs::read_to_string(Sample::new().path("dataset.toml")).unwrap();
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("dataset.toml");
    fs::write(&rig, text).unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in [Path::new("/dev/zero"), &pipe, folder.path()] {
        let (path, rig) = (path.to_str().unwrap(), rig.to_str().unwrap());
        rejected(&["cloud", path, path, "--rig", rig], 3, &[path, "a path that is not a file", "; name a file"]);
    }
    rejected(&["cloud", "a.pgm", "a.pgm", "--rig", "/dev/zero"], 3, &["/dev/zero", "text file too large"]);
}
