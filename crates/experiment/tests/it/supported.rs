//! The integrity of a fix in the log and in the table, and the reason of a failed joint fix.

use std::{
    collections::HashMap,
    fs::{self, File},
};

use nalgebra::{Matrix3, Matrix4};
use parquet::{
    file::{reader::FileReader, serialized_reader::SerializedFileReader},
    record::Field,
};
use seafix_experiment::{Options, Plan, Silent, run};
use seafix_geometry::{MeasuredPoint, Pixel, Point, StereoPixels, UncertainPixels, UncertainPoint};
use seafix_log::{FrameRecord, Outcome, TrialLog, read};
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, ModelPoint, Outcome as Answer, Problem, StereoReprojection, Tolerance,
    judge_labelled,
};
use seafix_simulation::VirtualRig;
use tempfile::TempDir;

/// The frames of the log and the rows of the table of an experiment's only trial.
fn made(experiment: &str) -> (Vec<FrameRecord>, Vec<HashMap<String, String>>) {
    let (log, rows) = run_of(experiment);
    (log.frames, rows)
}

/// The fields of a line of CSV; a comma within quotes separates none.
fn fields(line: &str) -> Vec<String> {
    let mut quoted = false;
    let separates = |c: char| {
        quoted ^= c == '"';
        c == ',' && !quoted
    };
    line.split(separates).map(str::to_owned).collect()
}

/// The log and the rows of the table, which are equal in CSV and Parquet.
fn run_of(experiment: &str) -> (TrialLog, Vec<HashMap<String, String>>) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("e.toml");
    fs::write(&file, format!("question = 'Why accept it?'\nseed = 5\n{experiment}")).unwrap();
    let plan = Plan::read(&file, &[]).unwrap();
    let out = folder.path().join("run");
    run(&plan, &Options { threads: 2, ..Options::into(&out) }, &Silent).unwrap();
    let log = read(&out.join(format!("{}.mcap", plan.trials[0].name))).unwrap();
    let table = fs::read_to_string(out.join("results.csv")).unwrap();
    let mut lines = table.lines().map(fields);
    let head = lines.next().unwrap();
    let rows: Vec<HashMap<String, String>> = lines.map(|row| head.iter().cloned().zip(row).collect()).collect();
    let parquet = SerializedFileReader::new(File::open(out.join("results.parquet")).unwrap()).unwrap();
    for (row, same) in rows.iter().zip(parquet.get_row_iter(None).unwrap()) {
        for (name, field) in same.unwrap().get_column_iter() {
            let (text, number) = (&row[name], row[name].parse::<f64>());
            match field {
                Field::Double(value) => assert_eq!(number, Ok(*value), "{name}"),
                Field::Long(value) => assert_eq!(number, Ok(*value as f64), "{name}"),
                Field::Str(value) => assert_eq!(text.trim_matches('"'), value, "{name}"),
                Field::Null => assert_eq!(text, "", "{name}"),
                _ => {}
            }
        }
    }
    (log, rows)
}

#[test]
fn what_supports_a_fix_stands_in_log_and_table() {
    for (points, grade) in [(3, "unmonitored"), (4, "detectable"), (13, "excludable")] {
        let (frames, rows) =
            made(&format!("[source]\nname = 'virtual-layouts'\nlayouts = 2\nframes = 8\npoints = {points}\n"));
        let mut fixes = 0;
        for (frame, row) in frames.iter().zip(&rows) {
            let target = &frame.targets[0];
            if target.outcome != Outcome::Fix {
                assert!(target.integrity.is_none() && row["redundancy"].is_empty() && row["chi2"].is_empty());
                continue;
            }
            fixes += 1;
            let it = target.integrity.as_ref().unwrap();
            assert_eq!((it.redundancy.as_str(), it.dof), (grade, 3 * points - 6));
            assert!(it.chi2 > 0.0 || points == 3, "{it:?}");
            assert!(it.chi2 <= it.chi2_limit);
            let number = |name: &str| row[name].parse::<f64>().ok();
            assert_eq!(row["redundancy"], grade);
            assert_eq!(number("chi2_dof"), Some(it.dof as f64));
            let columns = ["chi2", "chi2_limit", "solution_separation", "protection_position", "protection_attitude"];
            let logged = [
                Some(it.chi2),
                Some(it.chi2_limit),
                it.solution_separation,
                it.protection_position,
                it.protection_attitude,
            ];
            assert_eq!(columns.map(number), logged);
            assert_eq!(it.protection_position.is_some(), it.protection_attitude.is_some());
            assert!(points != 3 || (it.solution_separation, it.protection_position) == (None, None));
            assert!(points != 13 || it.protection_position.unwrap() > it.solution_separation.unwrap());
        }
        assert!(fixes > 0, "{points} points");
    }
}

/// The log and the table hold the exact numbers of the fix: the logged points are solved and tested again.
///
/// Seen to fail when the position's protection level is logged as the attitude's.
#[test]
fn the_log_and_the_table_hold_the_numbers_of_the_fix() {
    let (log, rows) = run_of(
        "[source]\nname = 'virtual-layouts'\nlayouts = 4\nframes = 24\npoints = 9\n[pipeline]\nacceptance = { two-wrong-rate = 0.01 }\n",
    );
    let rig = VirtualRig::default().build().unwrap();
    let acceptance = Acceptance { two_wrong_rate: 0.01, ..Acceptance::default() };
    assert_eq!((log.frames.len(), rows.len()), (24, 24));
    for (frame, row) in log.frames.iter().zip(&rows) {
        let target = &frame.targets[0];
        let known = log.header.targets.iter().find(|known| known.id == target.object).unwrap();
        let point = |p: &seafix_log::ModelPoint| ModelPoint {
            sigma: p.sigma,
            ..ModelPoint::exact(p.id.clone(), Point::from(p.at))
        };
        let model: Vec<ModelPoint> = known.points.iter().map(point).collect();
        let pixel = |[u, v]: [f64; 2]| Pixel { u, v };
        let cloud: Vec<MeasuredPoint> = frame
            .cloud
            .iter()
            .zip(&frame.inputs.as_ref().unwrap().pixel_covariances)
            .map(|(seen, covariance)| {
                let pixels = seen.pixels.as_ref().unwrap();
                let at = StereoPixels { left: pixel(pixels.left), right: pixel(pixels.right) };
                let covariance = Matrix4::from_fn(|r, c| covariance[r][c]);
                let spread = Matrix3::from_fn(|r, c| seen.covariance[r][c]);
                let position = UncertainPoint { at: Point::from(seen.at), covariance: spread };
                MeasuredPoint { position, pixels: Some(UncertainPixels { at, covariance }) }
            })
            .collect();
        let pairs: Vec<Correspondence> = (0..9).map(|k| Correspondence { model: k, cloud: k }).collect();
        let candidates = Candidates::from_pairs(9, (0..9).map(|k| (k, k)));
        let (tolerance, prior) = (Tolerance::Sigmas(3.0), None);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior,
            edges: Default::default(),
        };
        let attempt = judge_labelled(&problem, pairs, &StereoReprojection::default(), &acceptance, Some(&rig));
        let Answer::Fix(fix) = attempt.outcome else { panic!("{:?}", attempt.outcome) };
        let (message, it) = (&fix.integrity, target.integrity.as_ref().unwrap());
        assert_eq!(target.object_from_camera, Some(fix.object_from_camera.rows()));
        assert_eq!((it.redundancy.as_str(), it.dof), (message.redundancy.name(), message.dof as u64));
        let fix_text = [
            Some(fix.residual_rms),
            Some(message.chi2),
            Some(message.chi2_limit),
            message.solution_separation,
            message.solution_separation_two,
            message.protection.map(|level| level.position),
            message.protection.map(|level| level.attitude),
            message.scale_error.map(|it| it.value),
            message.scale_error.map(|it| it.sigma),
        ];
        let log_value = [
            target.residual_rms,
            Some(it.chi2),
            Some(it.chi2_limit),
            it.solution_separation,
            it.solution_separation_two,
            it.protection_position,
            it.protection_attitude,
            it.scale_error,
            it.scale_error_sigma,
        ];
        assert_eq!(fix_text, log_value);
        assert!(fix_text.iter().all(Option::is_some), "{fix_text:?}");
        let columns = [
            "chi2",
            "chi2_limit",
            "solution_separation",
            "solution_separation_two",
            "protection_position",
            "protection_attitude",
            "scale_error",
            "scale_error_sigma",
        ];
        assert_eq!(columns.map(|name| row[name].parse::<f64>().ok())[..], fix_text[1..]);
        // Residuals are C·H − P of each pair, and their RMS is logged.
        for (pair, residual) in fix.pairs.iter().zip(&fix.residuals) {
            let at = fix.object_from_camera * cloud[pair.cloud].position.at;
            assert_eq!(at - model[pair.model].at, *residual);
        }
        let squares: f64 = fix.residuals.iter().map(|residual| residual.norm_squared()).sum();
        assert!((fix.residual_rms - (squares / 9.0).sqrt()).abs() < 1e-15);
    }
}

/// At a confidence of 0.4 more than half of all true sets fail the test, jointly as well as alone.
#[test]
fn a_joint_fix_that_fails_states_why() {
    let source = "[source]\nname = 'virtual-layouts'\nlayouts = 2\nobjects = 2\npoints = 12\nframes = 60\nsurvey-sigma = 0.002\n";
    let (frames, _) = made(&format!("{source}[pipeline]\ntarget = 'joint'\n[pipeline.acceptance]\nconfidence = 0.4\n"));
    let fixes = frames.iter().flat_map(|frame| &frame.targets).filter(|target| target.outcome == Outcome::Fix);
    let (joined, failed): (Vec<_>, Vec<_>) =
        fixes.partition(|target| target.explanation.starts_with("joint fix over "));
    assert!(!failed.is_empty() && !joined.is_empty(), "{} failed, {} joined", failed.len(), joined.len());
    for target in failed {
        assert!(
            target.explanation.starts_with("no joint fix, each object keeps its own pose: "),
            "{}",
            target.explanation
        );
        assert!(target.explanation.contains("χ² = "), "{}", target.explanation);
    }
}

/// The few points of an object without its own fix are used in the joint fix. The explanations of both objects state
/// it. The object stays rejected.
#[test]
fn a_joint_fix_states_what_took_part() {
    let source = "[source]\nname = 'virtual-layouts'\nlayouts = 3\nobjects = 3\npoints = 14\nframes = 30\nsurvey-sigma = 0.001\n";
    // The objects have five, five and four points, and five are required.
    let (frames, _) = made(&format!("{source}[pipeline]\ntarget = 'joint'\n[pipeline.acceptance]\nmin-points = 5\n"));
    let (mut took_part, mut left_out) = (0, 0);
    for frame in &frames {
        for target in &frame.targets {
            match target.outcome {
                Outcome::Fix => {
                    assert!(target.explanation.starts_with("joint fix over `layout"), "{}", target.explanation)
                }
                _ => {
                    assert!(
                        target.explanation.starts_with("too few identified points: 4 found, 5 required"),
                        "{}",
                        target.explanation
                    );
                    took_part += usize::from(target.explanation.ends_with("; 4 points used in the joint fix"));
                    left_out += usize::from(target.explanation.contains("; not in the joint fix: "));
                }
            }
        }
        let message = |part: &str| frame.targets.iter().any(|target| target.explanation.contains(part));
        assert_eq!(message("used in the joint fix"), message("(4 points, without a fix of its own)"));
        assert_eq!(message("not in the joint fix"), message("; excluded: "));
    }
    assert!(took_part > 15, "{took_part} of 30 used, {left_out} excluded");
}
