//! A synthetic run with known results.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
};

use seafix_log::{
    Axis, CameraRecord, CloudPoint, Component, Evaluation, FrameRecord, FrameTimes, GreyImage, Integrity, ModelPoint,
    Outcome, Pair, PixelPair, PointOfInterest, PriorRecord, RigRecord, TargetModel, TargetRecord, TargetTimes,
    TrialHeader, TruthRecord, Writer,
};

const IDENTITY: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
pub(crate) const SIZE: [u32; 2] = [512, 384];
const F: f64 = 250.0;
pub(crate) const NAME: &str = "<script>alert('x')</script>&\" 50%_a \\input{x} =cmd|x \u{1b}[31m";

/// Pseudo-random numbers between −0.5 and 0.5, the same on every machine.
pub(crate) fn noise(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

pub(crate) fn header(index: usize, distance: f64, solver: &str) -> TrialHeader {
    let camera = CameraRecord {
        size: SIZE,
        matrix: [[F, 0.0, 255.5], [0.0, F, 191.5], [0.0, 0.0, 1.0]],
        distortion: vec![],
        equidistant: false,
    };
    let mut right_from_left = IDENTITY;
    right_from_left[0][3] = -0.25;
    let component = |stage: &str, name: &str, summary: &str, source: &str| Component {
        stage: stage.to_owned(),
        name: name.to_owned(),
        summary: summary.to_owned(),
        source: source.to_owned(),
        settings: vec![("threshold".to_owned(), "0.001".to_owned()), ("limit".to_owned(), "600".to_owned())],
    };
    TrialHeader {
        run: "virtual-direct".to_owned(),
        trial: format!("{index:03}-distance-{distance}-solver-{solver}"),
        title: format!("virtual direct {NAME}"),
        question: "How accurate is a direct fix on one object from 2 to 5 m?".to_owned(),
        command: "cargo run --release -- run experiments/virtual-direct.toml".to_owned(),
        axes: vec![
            Axis { key: "source.distance".to_owned(), value: format!("{distance:.1}") },
            Axis { key: "pipeline.solver".to_owned(), value: solver.to_owned() },
        ],
        components: vec![
            component("detector", "harris", "corners with sub-pixel peaks", "Harris and Stephens 1988"),
            component("search", "maximum-clique", "the largest coherent set, one-to-one, mirror images rejected", ""),
            component("solver", solver, "a rigid motion from points", "Kabsch 1976"),
        ],
        configuration: format!("seed = 1\n[pipeline]\nsolver = \"{solver}\"\n"),
        site: "format = \"seafix-site/1\"\n".to_owned(),
        source: "virtual-images".to_owned(),
        rig: RigRecord {
            left: camera.clone(),
            right: camera,
            right_from_left,
            rectified: true,
            right_from_left_rotation: None,
        },
        body_from_camera: IDENTITY,
        world_from_site: Some(IDENTITY),
        targets: vec![TargetModel {
            id: format!("manifold {NAME}"),
            site_from_object: Some(IDENTITY),
            points: (0..9)
                .map(|i| ModelPoint {
                    id: format!("M{i}"),
                    at: [0.45 * f64::from(i % 3) - 0.45, 0.35 * f64::from(i / 3) - 0.35, 0.1 * noise(i as u64)],
                    sigma: 0.001,
                })
                .collect(),
            alert_limit: 0.05,
            edges: Vec::new(),
        }],
        prior_position_sigma: Some(0.1),
        prior_attitude_sigma: Some(0.5_f64.to_radians()),
        pixel_sigma: Some(0.25),
        seeds: vec![("experiment".to_owned(), 1)],
        versions: vec![("seafix".to_owned(), "0.1.0".to_owned())],
    }
}

/// The seed of a frame at a distance.
fn seed(number: u64, distance: f64) -> u64 {
    10_000 * number + (distance * 10.0) as u64
}

/// Frame `number` at `distance`.
///
/// Every sixth is rejected, and one frame of the run has a wrong fix.
pub(crate) fn frame(header: &TrialHeader, number: u64, distance: f64) -> FrameRecord {
    let blind = blind(header, number, distance);
    let images = Some([0, 1].map(|side| image(&blind.cloud, side, seed(number, distance))));
    FrameRecord { images, ..blind }
}

/// A synthetic image with a corner at every cloud point.
fn image(cloud: &[CloudPoint], side: usize, seed: u64) -> GreyImage {
    let wave = |n: u32, of: fn(f64) -> f64| (0..n).map(|k| of(f64::from(k))).collect::<Vec<f64>>();
    let (across, down) = (wave(SIZE[0], |x| (x / 23.0).sin()), wave(SIZE[1], |y| (y / 17.0).cos()));
    let mut pixels: Vec<u8> = (0..SIZE[0] * SIZE[1])
        .map(|i| {
            let (x, y) = ((i % SIZE[0]) as usize, (i / SIZE[0]) as usize);
            (90.0 + 25.0 * across[x] * down[y] + 14.0 * noise(u64::from(i) + seed)) as u8
        })
        .collect();
    for point in cloud {
        let seen = point.pixels.map(|pixels| if side == 0 { pixels.left } else { pixels.right }).unwrap();
        for (dx, dy) in (-9..9).flat_map(|dx| (-9..9).map(move |dy| (dx, dy))) {
            let (x, y) = (seen[0] as i64 + dx, seen[1] as i64 + dy);
            if (0..i64::from(SIZE[0])).contains(&x) && (0..i64::from(SIZE[1])).contains(&y) && (dx < 0) == (dy < 0) {
                pixels[(y * i64::from(SIZE[0]) + x) as usize] = 190;
            }
        }
    }
    GreyImage { width: SIZE[0], height: SIZE[1], pixels }
}

/// The frame without its images, which take most of the time.
pub(crate) fn blind(header: &TrialHeader, number: u64, distance: f64) -> FrameRecord {
    let target = &header.targets[0];
    let mut world_from_camera = IDENTITY;
    world_from_camera[2][3] = -distance;
    let see = |p: [f64; 3], seed: u64| {
        let z = p[2] + distance;
        let at = |shift: f64, s: u64| {
            [F * (p[0] - shift) / z + 255.5 + 0.4 * noise(s), F * p[1] / z + 191.5 + 0.4 * noise(s + 7)]
        };
        PixelPair { left: at(0.0, seed), right: at(0.25, seed + 1) }
    };
    let seed = seed(number, distance);
    let covariance = [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-4]];
    let cloud: Vec<CloudPoint> = (0..40)
        .map(|i| {
            let at = match target.points.get(i) {
                Some(point) => point.at,
                None => [2.0 * noise(seed + i as u64), 1.6 * noise(seed + 60 + i as u64), 0.3],
            };
            let pixels = Some(see(at, seed + 13 * i as u64));
            CloudPoint { at: [at[0], at[1], at[2] + distance], covariance, pixels }
        })
        .collect();
    let solver = &header.components[2].name;
    let worse = if solver == "triad" { 2.0 } else { 1.0 };
    let rejected = number % 6 == 5;
    let wrong = number == 3 && distance > 4.5 && solver == "triad";
    let mut row = TargetRecord::rejected(
        &target.id,
        "maximum-clique",
        solver,
        if number % 12 == 5 { "absent" } else { "too-few" },
    );
    row.candidates = (0..9).map(|i| vec![i, 9 + i, 20 + i]).collect();
    row.times = TargetTimes {
        candidates_ms: Some(0.05),
        search_ms: Some(0.4 + 0.1 * noise(seed)),
        solve_ms: (!rejected).then_some(0.012),
        total_ms: Some(120.0 + 10.0 * noise(seed)),
    };
    row.evaluation = Evaluation { wrong: Some(false), visible: Some(9), identified: Some(2), ..Evaluation::default() };
    if !rejected {
        let scale = worse * 0.001 * distance * distance * (1.0 + noise(seed + 3));
        row.outcome = Outcome::Fix;
        row.reason.clear();
        let turn = 1.1 * scale;
        let mut turned = world_from_camera;
        (turned[0], turned[1]) = ([turn.cos(), -turn.sin(), 0.0, 0.0], [turn.sin(), turn.cos(), 0.0, 0.0]);
        row.object_from_camera = Some(turned);
        row.covariance = Some(std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1e-5 } else { 0.0 })));
        row.pairs = (0..7).map(|i| Pair { model: i, cloud: i }).collect();
        row.used = if solver == "triad" { vec![0, 2, 6] } else { (0..7).collect() };
        row.integrity = Some(Integrity {
            redundancy: "excludable".to_owned(),
            protection_position: (number % 5 != 4).then(|| 0.03 + 0.02 * noise(seed + 5)),
            ..Integrity::default()
        });
        row.evaluation = Evaluation {
            wrong: Some(wrong),
            wrong_pairs: Some(wrong),
            visible: Some(9),
            identified: Some(7),
            correct_pairs: Some(7),
            fit_rms: Some(scale),
            fit_rms_unused: (solver == "triad").then_some(1.3 * scale),
            tre_rms: Some(if wrong { 0.4 } else { 1.4 * scale }),
            position_error: Some(4.0 * scale),
            attitude_error: Some(turn),
            nees: Some(6.0 + 4.0 * noise(seed + 4)),
            ..Evaluation::default()
        };
    }
    FrameRecord {
        frame: number,
        stamp_ns: number * 100_000_000,
        images: None,
        key_points: cloud.iter().filter_map(|point| point.pixels).map(|pixels| pixels.left).collect(),
        cloud,
        lines: Vec::new(),
        prior: Some(PriorRecord { world_from_camera }),
        truth: Some(TruthRecord {
            world_from_camera,
            world_from_object: vec![(target.id.clone(), IDENTITY)],
            visible: vec![],
        }),
        targets: vec![row],
        times: FrameTimes {
            shared: seafix_log::SharedStages::default(),
            detect_ms: Some(60.0),
            locate_ms: Some(9.0),
            describe_ms: Some(31.0),
            match_ms: Some(6.0),
            refine_ms: Some(4.0),
            triangulate_ms: Some(0.3),
            odometry_ms: None,
        },
        inputs: None,
        navigation: None,
        poi: (0..number % 3)
            .map(|k| PointOfInterest {
                object: target.id.clone(),
                point: ["panel", "valve over of <2>"][k as usize].to_owned(),
                at: [0.1, 0.0, distance],
                believed: (!rejected).then(|| [0.1 + 0.01 * worse * noise(seed + k), 0.0, distance]),
                nees: (!rejected).then(|| 3.0 + 2.0 * noise(seed + 9 + k)),
            })
            .collect(),
    }
}

/// The logs of a run: file names and contents.
type Logs = Vec<(String, Vec<u8>)>;

/// Writes a run with two trials at each distance.
///
/// The logs of the same distances are generated once.
pub(crate) fn write_run(folder: &Path, distances: &[f64]) {
    static MADE: Mutex<BTreeMap<String, Arc<Logs>>> = Mutex::new(BTreeMap::new());
    let made = {
        let mut all = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(all.entry(format!("{distances:?}")).or_insert_with(|| Arc::new(made(distances))))
    };
    for (name, bytes) in made.iter() {
        fs::write(folder.join(name), bytes).unwrap();
    }
}

fn made(distances: &[f64]) -> Logs {
    let folder = tempfile::tempdir().unwrap();
    let mut logs = Logs::new();
    for &distance in distances {
        for solver in ["triad", "kabsch"] {
            let header = header(logs.len() + 1, distance, solver);
            let (name, path) = (format!("{}.mcap", header.trial), folder.path().join("log.mcap"));
            let mut writer = Writer::create(&path, &header).unwrap();
            (0..12).for_each(|number| writer.frame(&frame(&header, number, distance)).unwrap());
            writer.finish().unwrap();
            logs.push((name, fs::read(path).unwrap()));
        }
    }
    logs
}
