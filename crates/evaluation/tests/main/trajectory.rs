//! Tests of trajectory errors against evo.

use nalgebra::{Matrix3, Vector3};
use seafix_evaluation::trajectory::{
    Alignment, Delta, Pose, Relation, Summary, UndeterminedAlignment, align, ape, associate, drift, pairs,
    path_lengths, rpe,
};

use crate::{names, near, numbers};

const EVO: &str = include_str!("../fixtures/trajectory.txt");

fn poses(key: &str) -> Vec<Pose> {
    let pose = |m: &[f64]| Pose {
        rotation: Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]),
        position: Vector3::new(m[3], m[7], m[11]),
    };
    numbers(EVO, key).chunks(12).map(pose).collect()
}

fn places(key: &str) -> Vec<(usize, usize)> {
    numbers(EVO, key).chunks(2).map(|pair| (pair[0] as usize, pair[1] as usize)).collect()
}

fn statistics(errors: &[f64]) -> [f64; 10] {
    let s = Summary::of(errors);
    assert_eq!(s.pairs, errors.len());
    [s.rmse, s.mean, s.median, s.std, s.min, s.max, s.sse, s.p75, s.p95, s.p99]
}

/// Asserts that the numbers agree, each relative to its own size.
fn alike(found: &[f64], wanted: &[f64], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (i, (a, b)) in found.iter().zip(wanted).enumerate() {
        // evo computes angles by a logarithm, accurate to 1e-12 rad.
        assert!((a - b).abs() <= 1e-9 * b.abs() + 1e-12, "{what}, number {i}: {a}, expected {b}");
    }
}

fn alignment(name: &str, reference: &[Pose], estimate: &[Pose]) -> Alignment {
    match name {
        "none" => Alignment::IDENTITY,
        "align" => align(reference, estimate, false).unwrap(),
        "align-scale" => align(reference, estimate, true).unwrap(),
        // The scale of the alignment with scale, alone.
        "scale" => Alignment { scale: align(reference, estimate, true).unwrap().scale, ..Alignment::IDENTITY },
        "origin" => Alignment::onto(&reference[0], &estimate[0]),
        _ => panic!("{name}"),
    }
}

#[test]
fn evo_aligns_alike() {
    let (reference, estimate) = (poses("reference"), poses("estimate"));
    for name in ["align", "align-scale", "origin"] {
        let found = alignment(name, &reference, &estimate);
        let wanted = numbers(EVO, &format!("alignment {name}"));
        let parts: Vec<f64> = (0..3)
            .flat_map(|i| {
                let row = found.rotation.row(i);
                [row[0], row[1], row[2], found.translation[i]]
            })
            .chain([found.scale])
            .collect();
        near(&parts, &wanted, 1e-13, name);
    }
    assert!((alignment("scale", &reference, &estimate).scale - numbers(EVO, "alignment scale")[12]).abs() < 1e-14);
}

/// The test fails with zeros for `ape`, and without the branch for translations.
#[test]
fn evo_has_the_same_absolute_errors() {
    let (reference, estimate) = (poses("reference"), poses("estimate"));
    for relation in Relation::ALL.into_iter().filter(|relation| relation.is_absolute()) {
        let name = relation.name();
        alike(&ape(&reference, &estimate, relation), &numbers(EVO, &format!("ape {name}")), name);
        for how in ["none", "align", "scale", "align-scale", "origin"] {
            let motion = alignment(how, &reference, &estimate);
            let moved: Vec<Pose> = estimate.iter().map(|pose| motion.apply(pose)).collect();
            let found = statistics(&ape(&reference, &moved, relation));
            let key = format!("ape statistics {how} {name}");
            alike(&found, &numbers(EVO, &key), &key);
        }
    }
    assert_eq!(Relation::ALL.iter().filter(|relation| relation.is_absolute()).count(), 6);
}

/// Consecutive and all pairs, by frames, path length and angle.
#[test]
fn evo_chooses_the_same_pairs_and_has_the_same_relative_errors() {
    let (reference, estimate) = (poses("reference"), poses("estimate"));
    let mut kinds = 0;
    for kind in names(EVO, "pairs ") {
        let words: Vec<&str> = kind.split(' ').collect();
        let (size, tolerance) = (words[1].parse::<f64>().unwrap(), words[2].parse().unwrap());
        let delta = match words[0] {
            "frames" => Delta::Frames(size as usize),
            "metres" => Delta::Metres(size),
            "radians" => Delta::Radians(size),
            unit => panic!("{unit}"),
        };
        let found = pairs(&reference, delta, words[3] == "all", tolerance);
        assert_eq!(found, places(&format!("pairs {kind}")), "{kind}");
        for relation in Relation::ALL {
            let key = format!("rpe {} {kind}", relation.name());
            alike(&rpe(&reference, &estimate, &found, relation), &numbers(EVO, &key), &key);
        }
        kinds += 1;
    }
    assert_eq!(kinds, 16);
}

#[test]
fn evo_associates_alike() {
    let mut cases = 0;
    for case in names(EVO, "match ") {
        let words: Vec<&str> = case.split(' ').collect();
        let stamps = |whose: &str| -> Vec<u64> {
            numbers(EVO, &format!("stamps {} {whose}", words[0])).into_iter().map(|stamp| stamp as u64).collect()
        };
        let (tolerance, offset) = (words[1].parse().unwrap(), words[2].parse().unwrap());
        let found = associate(&stamps("reference"), &stamps("estimate"), tolerance, offset);
        assert_eq!(found, places(&format!("match {case}")), "{case}");
        cases += 1;
    }
    assert_eq!(cases, 21);
    assert_eq!(associate(&[], &[1, 2], 5, 0), []);
    assert_eq!(associate(&[1, 2], &[], 5, 0), []);
    assert_eq!(associate(&[10, 10, 30], &[10], 5, 0), [(0, 0)], "the first of two equal stamps");
    // Equal distance: the first one. Equal lengths: the stamps of the estimate are associated.
    assert_eq!(associate(&[10, 20], &[15], 5, 0), [(0, 0)]);
    assert_eq!(associate(&[10, 20], &[14, 16], 100, 0), [(0, 0), (1, 1)]);
    assert_eq!(associate(&[10, 40], &[11, 12], 100, 0), [(0, 0), (0, 1)]);
}

/// Translation and rotation per metre, over segments of 1.5, 3 and 6 m.
#[test]
fn the_drift_is_kitti_s() {
    let (reference, estimate) = (poses("reference"), poses("estimate"));
    near(&path_lengths(&reference), &numbers(EVO, "path reference"), 1e-15, "path");
    assert!(path_lengths(&[]).is_empty());
    let wanted = numbers(EVO, "drift");
    let found = drift(&reference, &estimate, &[1.5, 3.0, 6.0, 100.0]);
    assert_eq!(found.len(), wanted.len() / 5);
    for (segment, wanted) in found.iter().zip(wanted.chunks(5)) {
        assert_eq!([segment.from as f64, segment.to as f64, segment.length], wanted[..3]);
        assert!((segment.translation / wanted[3] - 1.0).abs() < 1e-12, "{segment:?}: {}", wanted[3]);
        // The table's angle comes from an arc cosine.
        assert!((segment.rotation - wanted[4]).abs() < 1e-9, "{segment:?}: {}", wanted[4]);
    }
}

#[test]
fn a_pose_and_its_matrix_by_hand() {
    // A rotation by 90° about z at (1, 2, 3).
    let rotation = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let pose = Pose { rotation, position: Vector3::new(1.0, 2.0, 3.0) };
    let ahead = Pose { position: Vector3::new(1.0, 0.0, 0.0), ..Pose::IDENTITY };
    assert_eq!(pose.then(&ahead).position, Vector3::new(1.0, 3.0, 3.0));
    assert_eq!(pose.to(&pose.then(&ahead)), ahead);
    let motion = Alignment { rotation, translation: Vector3::new(1.0, 2.0, 3.0), scale: 2.0 };
    let rows = [[0.0, -2.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0], [0.0, 0.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0]];
    assert_eq!(motion.rows(), rows);
    assert_eq!(motion.apply(&ahead).position, Vector3::new(1.0, 4.0, 3.0));
    assert_eq!(motion.apply(&ahead).rotation, rotation);
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { position: Vector3::new(x, y, z), ..Pose::IDENTITY }
}

/// Deviations of ±w across a line of ±1 have the singular values 2/4 and 2w²/4.
///
/// An alignment is rejected for w² ≤ 2ε on a short line, and relative to the squared length on a long one.
#[test]
fn a_line_is_one_up_to_rounding() {
    let cross = |length: f64, w: f64| {
        let poses = [at(length, 0.0, 0.0), at(-length, 0.0, 0.0), at(0.0, w, 0.0), at(0.0, -w, 0.0)];
        align(&poses, &poses, false)
    };
    let edge = (2.0 * f64::EPSILON).sqrt();
    assert!(
        cross(1.0, 1.01 * edge).is_ok()
            && matches!(cross(1.0, 0.99 * edge), Err(UndeterminedAlignment::OneLine { .. }))
    );
    // For 100 m the first singular value is 5000 m².
    let edge = (2.0 * 5000.0 * f64::EPSILON).sqrt();
    assert!(cross(100.0, 1.01 * edge).is_ok());
    let Err(UndeterminedAlignment::OneLine { first, second }) = cross(100.0, 0.99 * edge) else { panic!("a line") };
    assert!((first - 5000.0).abs() < 1e-9 && (second / (0.99 * 0.99 * 5000.0 * f64::EPSILON) - 1.0).abs() < 0.1);
    let three = [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0)];
    assert!(align(&three, &three, false).is_ok(), "three poses suffice");
    assert_eq!(align(&[], &[], true), Err(UndeterminedAlignment::TooFew(0)));
}

/// A mirrored estimate is aligned by a rotation; Umeyama's scale has a negative third singular value.
#[test]
fn a_mirrored_estimate_is_turned_not_mirrored() {
    let reference = [
        at(3.0, 0.0, 0.0),
        at(-3.0, 0.0, 0.0),
        at(0.0, 2.0, 0.0),
        at(0.0, -2.0, 0.0),
        at(0.0, 0.0, 1.0),
        at(0.0, 0.0, -1.0),
    ];
    let mirrored = reference.map(|pose| at(pose.position.x, pose.position.y, -pose.position.z));
    let found = align(&reference, &mirrored, true).unwrap();
    assert!((found.rotation - Matrix3::identity()).amax() < 1e-15);
    // (18 + 8 − 2) / (18 + 8 + 2).
    assert!((found.scale - 24.0 / 28.0).abs() < 1e-15, "{}", found.scale);
    let through = reference.map(|pose| at(-pose.position.x, -pose.position.y, -pose.position.z));
    let found = align(&reference, &through, true).unwrap();
    assert!((found.rotation.determinant() - 1.0).abs() < 1e-14 && (found.scale - 24.0 / 28.0).abs() < 1e-14);
}

#[test]
fn a_ratio_needs_a_distance() {
    let still = [at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0), at(2.0, 0.0, 0.0)];
    let moved = [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(4.0, 0.0, 0.0)];
    let steps = [(0, 1), (1, 2)];
    assert_eq!(rpe(&still, &moved, &steps, Relation::PointDistance), [1.0, 1.0]);
    assert_eq!(rpe(&still, &moved, &steps, Relation::PointDistanceRatio), [50.0]);
    assert_eq!(ape(&still, &moved, Relation::PointDistance), [0.0, 1.0, 2.0]);
}

#[test]
fn relations_have_evo_s_names_and_units() {
    let found = Relation::ALL.map(|relation| (relation.name(), relation.unit(), relation.is_absolute()));
    let wanted = [
        ("full", "1", true),
        ("trans_part", "m", true),
        ("rot_part", "1", true),
        ("angle_rad", "rad", true),
        ("angle_deg", "deg", true),
        ("point_distance", "m", true),
        ("point_distance_error_ratio", "%", false),
    ];
    assert_eq!(found, wanted);
}

/// Pair ends around the nominal length, by hand: the nearest, and the first of equally near ones.
#[test]
fn pairs_by_path_take_the_nearest_end() {
    let line = |xs: &[f64]| -> Vec<Pose> { xs.iter().map(|&x| at(x, 0.0, 0.0)).collect() };
    let all = |xs: &[f64], length: f64, tolerance: f64| pairs(&line(xs), Delta::Metres(length), true, tolerance);
    assert_eq!(all(&[0.0, 0.75, 1.25, 3.0], 1.0, 0.25), [(0, 1)], "0.75 and 1.25 are equally near: the first");
    assert_eq!(all(&[0.0, 0.7, 1.2, 3.0], 1.0, 0.25), [(0, 2)], "1.2 is nearer than 0.7");
    assert_eq!(all(&[0.0, 0.9, 1.2, 3.0], 1.0, 0.25), [(0, 1)], "0.9 is nearer than 1.2");
    assert_eq!(all(&[0.0, 1.0, 1.0, 1.0], 1.0, 0.0), [(0, 1)], "at rest: the first");
    assert_eq!(all(&[0.0, 0.0, 0.0, 1.0], 1.0, 0.0), [(0, 3), (1, 3), (2, 3)]);
    assert_eq!(all(&[0.0, 0.9, 0.9, 1.3], 1.0, 0.25), [(0, 1)], "at rest before the end: the first");
    assert_eq!(all(&[0.0, 5.0], 1.0, 5.0), [(0, 1)], "the next pose is always tried");
    // The tolerance is relative to the length.
    assert_eq!(all(&[0.0, 3.5], 4.0, 0.15), [(0, 1)]);
    assert_eq!(all(&[0.0, 3.5], 4.0, 0.12), []);
    let turned = |angles: &[f64]| -> Vec<Pose> {
        let turn = |a: f64| Matrix3::new(a.cos(), -a.sin(), 0.0, a.sin(), a.cos(), 0.0, 0.0, 0.0, 1.0);
        angles.iter().map(|&a| Pose { rotation: turn(a), ..Pose::IDENTITY }).collect()
    };
    let poses = turned(&[0.0, 0.169, 0.171, 0.229, 0.231]);
    assert_eq!(pairs(&poses, Delta::Radians(0.2), true, 0.15), [(0, 2), (0, 3)]);
    assert_eq!(pairs(&poses[..2], Delta::Radians(0.2), true, 1.0), [(0, 1)], "no pose is paired with itself");
    assert_eq!(pairs(&poses, Delta::Radians(0.2), false, 0.1), [(0, 3)]);
    assert_eq!(pairs(&poses, Delta::Frames(0), false, 0.1), [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4)]);
}
