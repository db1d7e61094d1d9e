//! Corners of a real chessboard, compared with OpenCV's: numbers found and matched, 3D error, and calibration residual.
//!
//! `SEAFIX_CHESSBOARD=FOLDER cargo bench --workspace --bench chessboard`; the folder holds the stereo pairs of OpenCV's
//! `samples/data` as `leftNN.jpg` and `rightNN.jpg`, OpenCV's corners in `corners.json` and its calibration in
//! `calibration.json`.
//!
//! A corner counts as matched if one point of the cloud lies within 1.5 px of OpenCV's in both images, and as wrong if
//! it does so in the left image only. The 3D error is the RMS residual of a rigid fit of the board. Finally OpenCV
//! calibrates the rig by each set of corners; the residuals in the images show which set is more accurate.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

mod common;

use common::peer::{OPENCV, Peer, floats};
use nalgebra::{Matrix3, Matrix4, Vector3};
use seafix_component::Choice;
use seafix_geometry::{Pinhole, Pixel, StereoPixels, StereoRig, Transform, UncertainPixels};
use seafix_vision::{DESCRIPTORS, DETECTORS, Direct, FrontEnd, FrontEndOutput, LOCATORS, MATCHERS, Optimal, Warp};
use serde_json::{Value, json};

/// The maximum distance from OpenCV's corner (px).
const NEAR: f64 = 1.5;

/// A board with OpenCV's corners in both images and the matched ones of Seafix.
struct Board {
    theirs: Vec<StereoPixels>,
    ours: Vec<Option<StereoPixels>>,
    wrong: usize,
}

fn main() {
    let Ok(folder) = std::env::var("SEAFIX_CHESSBOARD") else {
        return println!("skipped the chessboard: SEAFIX_CHESSBOARD is not set; see crates/vision/benches/README.md");
    };
    let Some(mut opencv) = Peer::from_env(OPENCV, "the chessboard") else { return };
    let read = |name: &str| -> Value {
        let text = std::fs::read_to_string(format!("{folder}/{name}")).expect("a readable file in SEAFIX_CHESSBOARD");
        serde_json::from_str(&text).expect("JSON")
    };
    let (corners, calibration) = (read("corners.json"), read("calibration.json"));
    let rig = rig(&calibration["calibration"]);
    let square = calibration["square"].as_f64().expect("the side of a square");
    let [columns, _] = [0, 1].map(|i| calibration["pattern_inner_corners"][i].as_u64().expect("corners") as usize);
    println!("peer: {}", opencv.version);
    println!(
        "{:<28} {:>13} {:>6} {:>10} {:>16} {:>24} {:>12}",
        "corners", "matched", "wrong", "3D RMS mm", "disparity − peer", "calibrated: l, r, stereo", "3D RMS mm"
    );
    let pairs = corners.as_object().expect("pairs by name");
    for (name, warp) in [
        ("OpenCV's", None),
        ("Seafix, translation", Some(Warp::Translation)),
        ("Seafix, slanted", Some(Warp::Slanted)),
        ("Seafix, as-seen", Some(Warp::AsSeen)),
    ] {
        let boards: Vec<Board> = pairs
            .iter()
            .map(|(pair, at)| {
                let theirs = stereo(&at["left"], &at["right"]);
                let Some(warp) = warp else {
                    return Board { ours: theirs.iter().copied().map(Some).collect(), theirs, wrong: 0 };
                };
                let images = ["left", "right"].map(|side| opencv.picture(&format!("{folder}/{side}{pair}.jpg")));
                let mut output = FrontEndOutput::default();
                front_end(warp).run(&images[0], &images[1], &rig, &mut output);
                found(theirs, &output.pixels)
            })
            .collect();
        let all = || boards.iter().flat_map(|board| board.theirs.iter().zip(&board.ours));
        let matched = all().filter(|(_, ours)| ours.is_some()).count();
        let mut shifts: Vec<f64> = all()
            .filter_map(|(theirs, ours)| {
                let ours = (*ours)?;
                Some((ours.left.u - ours.right.u) - (theirs.left.u - theirs.right.u))
            })
            .collect();
        shifts.sort_by(f64::total_cmp);
        let again = opencv.ask(&request(&boards, columns, square));
        let [l, r, both] = ["left", "right", "stereo"].map(|key| again[key].as_f64().expect("an RMS"));
        println!(
            "{name:<28} {:>13} {:>6} {:>10.3} {:>13.3} px {:>24} {:>12.3}",
            format!("{matched} of {}", all().count()),
            boards.iter().map(|board| board.wrong).sum::<usize>(),
            spatial(&boards, &rig, columns, square),
            shifts[shifts.len() / 2],
            format!("{l:.3}, {r:.3}, {both:.3} px"),
            spatial(&boards, &self::rig(&again), columns, square),
        );
    }
}

fn front_end(warp: Warp) -> FrontEnd {
    let plain = Choice::named;
    FrontEnd {
        filters: Vec::new(),
        detector: DETECTORS.build(&plain("harris")).expect("a detector"),
        locator: LOCATORS.build(&plain("corner")).expect("a locator"),
        descriptor: DESCRIPTORS.build(&plain("surf")).expect("a descriptor"),
        matcher: MATCHERS.build(&plain("epipolar-band")).expect("a matcher"),
        refinement: Box::new(Direct { warp, ..Direct::default() }),
        triangulator: Box::new(Optimal::default()),
    }
}

/// Matches the pairs to OpenCV's corners.
fn found(theirs: Vec<StereoPixels>, pairs: &[UncertainPixels]) -> Board {
    let (mut ours, mut wrong) = (Vec::new(), 0);
    for corner in &theirs {
        let near = pairs.iter().map(|pair| pair.at).filter(|at| at.left.distance(&corner.left) < NEAR);
        let nearest = near.min_by(|a, b| a.left.distance(&corner.left).total_cmp(&b.left.distance(&corner.left)));
        let right = nearest.filter(|at| at.right.distance(&corner.right) < NEAR);
        wrong += usize::from(nearest.is_some() && right.is_none());
        ours.push(right);
    }
    Board { theirs, ours, wrong }
}

/// The position of a corner on the board (m), in row-major order.
fn place(index: usize, columns: usize, square: f64) -> Vector3<f64> {
    Vector3::new((index % columns) as f64, (index / columns) as f64, 0.0) * square
}

/// The RMS residual of rigid fits of the board to the triangulated corners (mm).
fn spatial(boards: &[Board], rig: &StereoRig, columns: usize, square: f64) -> f64 {
    let (mut squares, mut count) = (0.0, 0);
    for board in boards {
        let triangulate = |at: &StereoPixels| rig.triangulate(&UncertainPixels::independent(*at, 0.1)).ok();
        let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = board
            .ours
            .iter()
            .enumerate()
            .filter_map(|(i, at)| Some((place(i, columns, square), triangulate(at.as_ref()?)?.point.coords)))
            .collect();
        let n = pairs.len() as f64;
        let a = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
        let b = pairs.iter().map(|pair| pair.1).sum::<Vector3<f64>>() / n;
        let moments: Matrix3<f64> = pairs.iter().map(|(p, q)| (q - b) * (p - a).transpose()).sum();
        let svd = moments.svd(true, true);
        let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
        let turn = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum())) * v_t;
        squares += pairs.iter().map(|(p, q)| (turn * (p - a) - (q - b)).norm_squared()).sum::<f64>();
        count += pairs.len();
    }
    1e3 * (squares / count as f64).sqrt()
}

/// The rig of OpenCV's calibration.
fn rig(numbers: &Value) -> StereoRig {
    let flat = |value: &Value| -> Vec<f64> {
        let rows = value.as_array().expect("a matrix").iter();
        rows.flat_map(|row| row.as_array().map_or(vec![row], |row| row.iter().collect()))
            .map(|x| x.as_f64().expect("a number"))
            .collect()
    };
    let camera = |k: &str, d: &str| {
        let k = flat(&numbers[k]);
        Pinhole::new([640, 480], [k[0], k[4]], [k[2], k[5]], &flat(&numbers[d])).expect("a camera")
    };
    let (turn, step) = (flat(&numbers["R"]), flat(&numbers["T"]));
    let mut matrix = Matrix4::identity();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::from_row_slice(&turn));
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from_slice(&step);
    let right_from_left = Transform::from_matrix(&matrix).expect("a rotation");
    StereoRig::new(camera("K1", "D1"), camera("K2", "D2"), right_from_left).expect("a rig")
}

fn stereo(left: &Value, right: &Value) -> Vec<StereoPixels> {
    let pixels = |value: &Value| -> Vec<Pixel> {
        let rows = value.as_array().expect("corners").iter();
        rows.map(|at| Pixel { u: at[0].as_f64().expect("u"), v: at[1].as_f64().expect("v") }).collect()
    };
    pixels(left).into_iter().zip(pixels(right)).map(|(left, right)| StereoPixels { left, right }).collect()
}

/// The request for a calibration by these corners.
fn request(boards: &[Board], columns: usize, square: f64) -> Value {
    let of = |board: &Board| {
        let corners = board.ours.iter().enumerate().filter_map(|(i, at)| Some((place(i, columns, square), (*at)?)));
        let rows: Vec<f32> = corners
            .flat_map(|(p, at)| [p.x, p.y, p.z, at.left.u, at.left.v, at.right.u, at.right.v].map(|x| x as f32))
            .collect();
        floats(&[rows.len() / 7, 7], &rows)
    };
    json!({"do": "calibrate", "size": [640, 480], "boards": boards.iter().map(of).collect::<Vec<_>>()})
}
