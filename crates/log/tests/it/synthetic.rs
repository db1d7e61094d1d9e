//! A small made-up trial: every field filled somewhere, every optional field empty somewhere.

use seafix_log::*;

pub(crate) const IDENTITY: Matrix4 =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Numbers that look random and are the same everywhere.
pub(crate) fn noise(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

pub(crate) fn at(x: f64, y: f64, z: f64) -> Matrix4 {
    let mut place = IDENTITY;
    (place[0][3], place[1][3], place[2][3]) = (x, y, z);
    place
}

pub(crate) fn header() -> TrialHeader {
    let camera = CameraRecord {
        size: [64, 48],
        matrix: [[50.0, 0.0, 31.5], [0.0, 50.0, 23.5], [0.0, 0.0, 1.0]],
        distortion: vec![0.1, 0.01, 0.0, 0.0],
        equidistant: true,
    };
    let target = |id: &str, x: f64| TargetModel {
        id: id.to_owned(),
        site_from_object: (x < 3.0).then(|| at(x, 0.0, 0.0)),
        points: (0..5)
            .map(|i| ModelPoint { id: format!("{id}{i}"), at: [noise(i), noise(i + 9), noise(i + 20)], sigma: 0.001 })
            .collect(),
        alert_limit: 0.05,
        edges: vec![ModelEdge { id: format!("{id}-side"), ends: [[x, 0.5, 0.0], [x, 1.5, 0.25]] }],
    };
    TrialHeader {
        run: "example".to_owned(),
        trial: "0-kabsch".to_owned(),
        title: "An example".to_owned(),
        question: "Does <every> field come back?".to_owned(),
        command: "seafix run example.toml".to_owned(),
        axes: vec![Axis { key: "solver".to_owned(), value: "kabsch".to_owned() }],
        components: vec![Component {
            stage: "solver".to_owned(),
            name: "kabsch".to_owned(),
            summary: "least squares".to_owned(),
            source: "Kabsch 1976".to_owned(),
            settings: vec![("least".to_owned(), "3".to_owned())],
        }],
        configuration: "question = 'why'\n".to_owned(),
        site: "format = 'seafix-site/1'\n".to_owned(),
        source: "made up".to_owned(),
        rig: RigRecord {
            left: camera.clone(),
            right: camera,
            right_from_left: at(-0.25, 0.0, 0.0),
            rectified: true,
            right_from_left_rotation: Some([0.1, 0.2, -0.3, 0.9273618495495704]),
        },
        body_from_camera: [[0.0, 0.0, 1.0, 0.1], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        world_from_site: Some(at(10.0, 20.0, 30.0)),
        targets: vec![target("A", 0.0), target("B", 2.0), target("nowhere", 4.0)],
        prior_position_sigma: Some(0.1),
        prior_attitude_sigma: None,
        pixel_sigma: Some(0.2),
        seeds: vec![("experiment".to_owned(), u64::MAX)],
        versions: vec![("seafix".to_owned(), "0.1.0".to_owned())],
    }
}

pub(crate) fn frame(number: u64) -> FrameRecord {
    let value = |i: u64| noise(1000 * number + i);
    let image = |seed: u64| GreyImage {
        width: 64,
        height: 48,
        pixels: (0..64 * 48).map(|i| (128.0 + 100.0 * noise(seed + i / 7)) as u8).collect(),
    };
    let cloud = (0..12)
        .map(|i| CloudPoint {
            at: [value(i), value(i + 50), 3.0 + value(i + 100)],
            covariance: [[1e-6, 2e-7, 0.0], [2e-7, 1e-6, 0.0], [0.0, 0.0, 1e-4 * (1.0 + value(i))]],
            pixels: (i % 3 != 0)
                .then(|| PixelPair { left: [5.0 * i as f64, value(i) + 20.0], right: [i as f64, 20.0] }),
        })
        .collect();
    let lines = (0..3)
        .map(|i| Line {
            ends: [[value(i), 0.5, 3.0], [value(i), 1.5, 3.25]],
            covariance: [[1e-6, 2e-7, 0.0, 0.0], [2e-7, 1e-6, 0.0, 0.0], [0.0, 0.0, 1e-6, 0.0], [0.0, 0.0, 0.0, 1e-5]],
            depth: i > 0,
            segments: (i < 2).then(|| {
                let offset = |at| Offset { at, normal: [0.6, 0.8], sigma: 0.125, texture: 0.0625, common: value(i) };
                [[offset([5.0, 6.0]), offset([9.0, 3.0])], [offset([4.0, 6.0]), offset([8.0, 3.0])]]
            }),
        })
        .collect();
    let mut fixed = TargetRecord::rejected("A", "maximum-clique", "kabsch", "");
    fixed.outcome = Outcome::Fix;
    fixed.object_from_camera = Some(at(value(1), value(2), -3.0));
    let mut covariance = [[0.0; 6]; 6];
    (0..6).for_each(|i| covariance[i][i] = 1e-5 * (i + 1) as f64);
    fixed.covariance = Some(covariance);
    fixed.candidates = vec![vec![0, 1], vec![], vec![2, 5, 6], vec![3], vec![4, 11]];
    fixed.edges = vec![EdgePair { model: 0, line: 1 }];
    fixed.pairs = vec![Pair { model: 0, cloud: 1 }, Pair { model: 2, cloud: 5 }, Pair { model: 4, cloud: 11 }];
    fixed.used = vec![0, 2];
    fixed.alternatives =
        vec![Alternative { object_from_camera: IDENTITY, pairs: vec![Pair { model: 1, cloud: 0 }], score: -7.5 }];
    fixed.optimal = Some(true);
    fixed.consensus_bound = Some(3);
    fixed.nfa = Some(1e-4);
    fixed.pair_tests = Some(1234);
    fixed.residual_rms = Some(0.004);
    fixed.integrity = Some(Integrity {
        redundancy: "unmonitored".to_owned(),
        chi2: 2.5 + value(4),
        dof: 3,
        chi2_limit: 16.3,
        solution_separation: None,
        solution_separation_two: Some(0.02),
        protection_position: Some(0.03),
        protection_attitude: Some(0.004),
        scale_error: Some(-0.002),
        scale_error_sigma: Some(0.001),
        depth_error: Some(0.004),
        depth_error_sigma: Some(0.002),
    });
    fixed.evaluation = Evaluation {
        wrong: Some(false),
        wrong_pairs: Some(false),
        visible: Some(4),
        identified: Some(3),
        correct_pairs: Some(3),
        fit_rms: Some(0.004),
        fit_rms_unused: None,
        tre_rms: Some(0.006),
        position_error: Some(0.01),
        attitude_error: Some(0.002),
        nees: Some(5.5),
        tre_crlb: Some(0.005),
        position_crlb: None,
        alert_limit: Some(0.05),
        edges_visible: Some(6),
        edges_identified: Some(4),
        correct_edges: Some(4),
        mssd: Some(0.012),
        mspd: None,
    };
    fixed.times =
        TargetTimes { candidates_ms: Some(0.1), search_ms: Some(0.2), solve_ms: None, total_ms: Some(12.0 + value(9)) };
    let mut rejected = TargetRecord::rejected("B", "maximum-clique", "kabsch", "too-few");
    rejected.explanation = "2 points".to_owned();
    (rejected.p_absent, rejected.p_wrong) = (Some(0.25), Some(0.5));
    rejected.best = Some(BestPose {
        object_from_camera: at(0.1, 0.2, -4.0),
        covariance: Some(covariance),
        pairs: vec![Pair { model: 3, cloud: 2 }, Pair { model: 0, cloud: 4 }],
    });
    let odd = number % 2 == 1;
    FrameRecord {
        frame: number,
        stamp_ns: 1_600_000_000_000_000_000 + number * 100_000_000,
        images: (!odd).then(|| [image(number), image(number + 1)]),
        key_points: (0..30).map(|i| [32.0 + 60.0 * value(i + 200), 24.0 + 40.0 * value(i + 300)]).collect(),
        cloud,
        lines,
        prior: odd.then(|| PriorRecord { world_from_camera: at(10.0, 20.0, 27.0) }),
        truth: (number % 3 != 2).then(|| TruthRecord {
            world_from_camera: at(10.0, 20.0, 27.0),
            world_from_object: vec![("A".to_owned(), at(10.0, 20.0, 30.0))],
            visible: vec![VisiblePoint { object: "A".to_owned(), point: 2 }],
        }),
        targets: if number == 3 {
            vec![TargetRecord::not_attempted("maximum-clique", "kabsch", "nothing-in-view")]
        } else {
            vec![fixed, rejected]
        },
        times: FrameTimes {
            detect_ms: Some(3.0),
            locate_ms: Some(0.5),
            describe_ms: None,
            match_ms: Some(0.0),
            refine_ms: Some(2.5),
            triangulate_ms: Some(1.0),
            odometry_ms: Some(60.0),
            shared: SharedStages { front_end: odd, search: number % 3 == 1, odometry: number % 4 == 2 },
        },
        inputs: (number % 4 != 3).then(|| Box::new(inputs(number))),
        navigation: (number > 0).then(|| Box::new(navigation(number))),
        poi: (0..number % 3)
            .map(|k| PointOfInterest {
                object: "A".to_owned(),
                point: format!("valve-{k}"),
                at: [0.1, value(70 + k), 1.5],
                believed: (k == 0).then(|| [0.1 + 1.0 / 3.0, value(70), 1.5]),
                nees: (k == 0).then_some(2.5),
            })
            .collect(),
    }
}

/// What the navigator knew after frame `number`: in turn with and without everything that may be missing.
fn navigation(number: u64) -> NavigationRecord {
    let odd = number % 2 == 1;
    let covariance =
        std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 0.01 } else { 1e-4 * (r + c) as f64 }));
    let pose = NavigatedRecord { object: "A".to_owned(), object_from_camera: at(1.0 / 3.0, 0.1, -2.0), covariance };
    NavigationRecord {
        state: "dead reckoning".to_owned(),
        due: odd,
        pose: odd.then(|| pose.clone()),
        odometry_only: (!odd).then_some(pose),
        odometry: OdometryStep {
            lost: if odd { "the left image shows nothing".to_owned() } else { String::new() },
            motion: (!odd).then(|| (at(0.1, 0.0, 1.0 / 7.0), covariance)),
        },
        events: vec!["fix at object A".to_owned(); number as usize % 3],
        errors: NavigationErrors {
            tre_rms: odd.then_some(0.01),
            position_error: odd.then_some(1.0 / 3.0),
            attitude_error: (!odd).then_some(0.0),
            nees: Some(6.0),
            odometry_only_position_error: odd.then_some(0.1),
            odometry_only_attitude_error: (!odd).then_some(0.2),
        },
    }
}

/// What the method of frame `number` was given: in turn with and without everything that may be missing.
fn inputs(number: u64) -> Inputs {
    let odd = number % 2 == 1;
    let x = number as f64 * 0.1;
    let pose = ExactPose { rotation: [0.1, 0.2, -0.3, 0.9273618495495704], translation: [x, 1.0 / 3.0, -2.0] };
    let covariance =
        std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 0.01 } else { 1e-4 * (r + c) as f64 }));
    let pixels = std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 0.1 } else { 0.01 * (r + c) as f64 }));
    Inputs {
        prior: odd.then_some((pose, covariance)),
        pixel_covariances: vec![pixels; number as usize],
        names: odd.then(|| vec![SitePoint { object: 1, point: 2 }]),
        problem: (!odd).then(|| ProblemRecord {
            model: TargetModel {
                id: "of its own".to_owned(),
                site_from_object: None,
                points: vec![ModelPoint { id: "1".to_owned(), at: [x, 1.0 / 3.0, 0.25], sigma: 1e-3 }],
                alert_limit: 0.05,
                edges: Vec::new(),
            },
            delta: 0.04,
            prior: (number > 0).then_some((pose, 0.5)),
            putative: (number > 1).then(|| vec![[0, 3], [1, 4]]),
            edges: vec![ProblemEdge { ends: [[x, 0.0, 0.25], [x, 0.5, 0.25]], points: [Some(0), None] }],
            putative_edges: (number > 1).then(|| vec![EdgePair { model: 0, line: 2 }]),
        }),
        truth: Some(TrueState {
            world_from_camera: pose,
            moved: vec![(0, Some(pose)), (2, None)],
            visible: odd.then(Vec::new),
            bound: odd.then_some((1, covariance)),
            answer: (!odd).then(|| AnswerRecord { pairs: vec![[0, 3]], ideal_rms: Some(0.002), is_putative: odd }),
        }),
        exact_images: odd,
        readings: (0..number % 3)
            .map(|k| SensorReading {
                device: if k == 0 { "doppler" } else { "gyro" }.to_owned(),
                stamp_ns: 1_600_000_000_000_000_000 + k,
                value: [x, 1.0 / 3.0, -0.1],
                covariance: [[1e-5, 0.0, 1e-7], [0.0, 1e-5, 0.0], [1e-7, 0.0, 2e-5]],
            })
            .collect(),
    }
}

/// Writes a trial of `frames` frames to `path`, and what they add up to.
pub(crate) fn write(path: &std::path::Path, frames: u64) {
    let mut writer = Writer::create(path, &header()).unwrap();
    (0..frames).for_each(|number| writer.frame(&frame(number)).unwrap());
    writer.totals(&Totals { every: 1, frames, ..Totals::default() }).unwrap();
    writer.finish().unwrap();
}
