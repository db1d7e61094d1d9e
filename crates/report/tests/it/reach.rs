//! Areas under recall curves and errors at lever arms, against values by hand.

use std::fs;

use seafix_log::Writer;
use seafix_report::{Forms, report, verify};

use crate::made_up::{blind, header};

/// Three fixes in four attempts, rotated by 0.02 rad about the centroid of their points and shifted by 3 mm.
///
/// Seen to fail where the rotation or the rejected attempts are ignored, and where the arm starts at the object's
/// origin.
#[test]
fn areas_and_lever_arms_are_as_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = header(1, 3.0, "kabsch");
    header.axes.clear();
    let mut writer = Writer::create(&folder.path().join("001.mcap"), &header).unwrap();
    let (sine, cosine) = 0.02_f64.sin_cos();
    for (place, number) in [0, 1, 2, 5].into_iter().enumerate() {
        let mut frame = blind(&header, number, 3.0);
        frame.frame = place as u64;
        let row = &mut frame.targets[0];
        if let Some(pose) = &mut row.object_from_camera {
            let points = &header.targets[0].points[..7];
            let centre = [0, 1].map(|k| points.iter().map(|point| point.at[k]).sum::<f64>() / 7.0);
            // E = shift · rotation about the centroid; the true pose has no rotation.
            let [x, y] = centre;
            *pose = [
                [cosine, -sine, 0.0, x - cosine * x + sine * y],
                [sine, cosine, 0.0, y - sine * x - cosine * y],
                [0.0, 0.0, 1.0, pose[2][3] + 0.003],
                [0.0, 0.0, 0.0, 1.0],
            ];
            row.evaluation.tre_rms = Some(0.01 * place as f64);
            row.evaluation.attitude_error = Some(0.02);
        }
        writer.frame(&frame).unwrap();
    }
    writer.finish().unwrap();
    let out = folder.path().join("report");
    report(folder.path(), &out, Forms::ALL).unwrap();
    let table = fs::read_to_string(out.join("tables/reach.csv")).unwrap();
    let cells: Vec<f64> = table.lines().nth(1).unwrap().split(',').skip(1).map(|cell| cell.parse().unwrap()).collect();
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b;
    assert!(cells[0] == 4.0 && cells[3] == 3.0, "{table}");
    assert!(near(cells[1], 100.0 * (1.0 + 0.8 + 0.6) / 4.0), "{table}");
    assert!(near(cells[2], 100.0 * 0.75 * (1.0 - 0.02_f64.to_degrees() / 5.0)), "{table}");
    for (arm, cells) in [1.0, 2.0, 5.0].into_iter().zip(cells[4..].chunks(2)) {
        let error: f64 = 1e3 * (9e-6 + 8.0 / 3.0 * (arm * 0.01_f64.sin()).powi(2)).sqrt();
        assert!(near(cells[0], error) && near(cells[1], error), "{error}: {table}");
    }
    assert!(verify(folder.path(), &out).unwrap().holds());
}
