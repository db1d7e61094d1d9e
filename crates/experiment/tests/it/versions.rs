//! A change of results requires a change of version. Every component and every part of the shared code solves a small
//! fixed problem, and `versions.txt` holds a fingerprint of the result beside the version.
//!
//! A change of results without a change of version would let `seafix publish` keep a stored run that no program
//! reproduces.

#![allow(clippy::unwrap_used, reason = "a test may stop at once")]

use std::{collections::BTreeMap, fmt::Debug, fs, path::Path};

use hmac_sha256::Hash as Sha256;
use nalgebra::{Matrix2, Matrix3, Vector3, Vector6};
use seafix_component::{Choice, Registry};
use seafix_data::source::SOURCES;
use seafix_experiment::{Options, Plan, SHARED, Silent, components, run};
use seafix_geometry::{
    Camera, Covariance6, MeasuredPoint, Object, Pinhole, Pixel, Point, RightCamera, StereoPixels, StereoRig, Transform,
    UncertainPixels, UncertainPoint,
};
use seafix_navigation::{Device, FUSIONS, ODOMETRIES, ObjectPose, POLICIES, Reading, Situation, StereoPair};
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, Gate, ModelPoint, Observations, Prior, PriorBound, Problem, SEARCHES,
    SOLVERS, Tolerance, candidates, judge,
};
use seafix_simulation::{Purpose, Stream};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, Descriptors, FILTERS, FitScratch, FittedSegment, Image, Keypoint, LOCATORS, LineRules,
    MATCHERS, Pair, REFINEMENTS, SEGMENT_DETECTORS, SEGMENT_MATCHERS, SegmentFit, SegmentMatch, SegmentView,
    TRIANGULATORS, Threads, UncertainPixel, View,
};

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/versions.txt");
const COMMAND: &str = "SEAFIX_UPDATE=1 cargo test -p seafix-experiment versions_";

/// The sources that read files; `foreign.rs`, `problems.rs` and `replay.rs` test them.
const READERS: [&str; 5] = ["dataset", "euroc", "kitti", "mcap", "problems"];

/// The parts of the code whose versions may explain another fingerprint of a part, by the beginnings of their names.
fn rests_on(part: &str) -> &'static [&'static str] {
    match part.split(' ').next().unwrap() {
        "odometry" => &[
            "shared geometry",
            "filter",
            "detector",
            "locator",
            "descriptor",
            "matcher",
            "refinement",
            "triangulator",
            "solver",
        ],
        "source" => &["shared geometry", "shared simulation", "shared renderer"],
        "shared" => match part {
            "shared geometry" => &[],
            "shared acceptance" => &["shared geometry", "search", "solver"],
            // The fingerprint of these two is that of a table.
            "shared simulation" => &["shared geometry", "shared log"],
            "shared renderer" => &["shared geometry", "shared simulation", "shared log", "search", "shared acceptance"],
            // These parts are tested in a complete run.
            _ => &[""],
        },
        _ => &["shared geometry"],
    }
}

/// A version and a fingerprint.
type Line = (u32, String);

/// The faults of `now` against the committed `table`, and whether the table may be written again.
fn faults(table: &BTreeMap<String, Line>, now: &BTreeMap<String, Line>) -> (Vec<String>, bool) {
    let raised = |part: &str| match (table.get(part), now.get(part)) {
        (Some((old, _)), Some((new, _))) => new > old,
        _ => false,
    };
    let (mut reported, mut writable) = (Vec::new(), true);
    for (part, (version, print)) in now {
        let Some((old, known)) = table.get(part) else {
            reported.push(format!("{part} is new; run {COMMAND}"));
            continue;
        };
        let explained = raised(part)
            || now.keys().any(|other| raised(other) && rests_on(part).iter().any(|start| other.starts_with(start)));
        if version < old {
            reported.push(format!("the VERSION of {part} fell from {old} to {version}; raise it"));
            writable = false;
        } else if print != known && !explained {
            reported.push(format!("results of {part} changed; raise its VERSION and run {COMMAND}"));
            writable = false;
        } else if (version, print) != (old, known) {
            reported.push(format!("{part} or a part that it uses has another version; run {COMMAND}"));
        }
    }
    reported.extend(
        table
            .keys()
            .filter(|part| !now.contains_key(*part))
            .map(|part| format!("{part} does not exist any more; run {COMMAND}")),
    );
    (reported, writable)
}

#[test]
fn versions_change_with_results() {
    let now = fingerprints();
    let text = fs::read_to_string(TABLE).unwrap_or_default();
    let table: BTreeMap<String, Line> = text.lines().filter(|line| !line.starts_with('#')).map(line).collect();
    let (reported, writable) = faults(&table, &now);
    if std::env::var_os("SEAFIX_UPDATE").is_some() && writable {
        let head = format!("# part, version, fingerprint of its results; {COMMAND}\n");
        let lines = now.iter().map(|(part, (version, print))| format!("{part} {version} {print}\n"));
        fs::write(TABLE, head + &lines.collect::<String>()).unwrap();
        return;
    }
    assert!(reported.is_empty(), "{}", reported.join("\n"));
}

fn line(text: &str) -> (String, Line) {
    let (rest, print) = text.rsplit_once(' ').unwrap();
    let (part, version) = rest.rsplit_once(' ').unwrap();
    (part.to_owned(), (version.parse().unwrap(), print.to_owned()))
}

#[test]
fn another_result_asks_for_another_version() {
    let of = |lines: &[(&str, u32, &str)]| -> BTreeMap<String, Line> {
        lines.iter().map(|&(part, version, print)| (part.to_owned(), (version, print.to_owned()))).collect()
    };
    let table = of(&[("solver kabsch", 1, "a"), ("solver triad", 1, "b"), ("odometry icp", 1, "c")]);
    assert_eq!(faults(&table, &table), (Vec::new(), true));
    let changed = of(&[("solver kabsch", 1, "x"), ("solver triad", 1, "b"), ("odometry icp", 1, "c")]);
    let reported = format!("results of solver kabsch changed; raise its VERSION and run {COMMAND}");
    assert_eq!(faults(&table, &changed), (vec![reported], false));
    // An odometry contains solvers; one solver does not contain another.
    let raised = of(&[("solver kabsch", 2, "x"), ("solver triad", 1, "b"), ("odometry icp", 1, "y")]);
    assert!(faults(&table, &raised).1);
    let both = of(&[("solver kabsch", 2, "x"), ("solver triad", 1, "y"), ("odometry icp", 1, "c")]);
    assert!(!faults(&table, &both).1);
    let fallen = of(&[("solver kabsch", 0, "a"), ("solver triad", 1, "b"), ("odometry icp", 1, "c")]);
    assert!(!faults(&table, &fallen).1);
}

/// The numbers and truth values of a result, in order, to nine digits; names are ignored. Rounding of another processor
/// does not reach the ninth digit.
fn fingerprint(answer: &impl Debug) -> String {
    print_of(&format!("{answer:?}"))
}

fn print_of(text: &str) -> String {
    let mut hash = Sha256::new();
    let word = |c: char| c.is_ascii_alphanumeric() || "+-._".contains(c);
    for token in text.split(|c| !word(c)).filter(|token| !token.is_empty()) {
        let exact = token.parse::<i128>().is_ok() || ["true", "false"].contains(&token);
        match token.parse::<f64>() {
            _ if exact => hash.update(token),
            Ok(number) if number.abs() < 1e-12 => hash.update("0"),
            Ok(number) => hash.update(format!("{number:.8e}")),
            Err(_) => continue,
        }
        hash.update(" ");
    }
    hash.finalize()[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_fingerprint_is_of_numbers_and_not_of_names() {
    assert_eq!(print_of("Pose { x: 1.5, is: true }"), print_of("Place { u: 1.5000000000001, was: true }"));
    for other in ["Pose { x: 1.5000001, is: true }", "Pose { x: 1.5, is: false }", "Pose { x: 1.5 }"] {
        assert_ne!(print_of("Pose { x: 1.5, is: true }"), print_of(other), "{other}");
    }
}

/// The fingerprint of every component and shared part.
fn fingerprints() -> BTreeMap<String, Line> {
    let world = World::new();
    let mut prints: BTreeMap<(String, String), String> = BTreeMap::new();
    let mut add =
        |kind: &str, name: &str, print: String| drop(prints.insert((kind.to_owned(), name.to_owned()), print));
    each(&FILTERS, &mut add, |filter| fingerprint(&filter.filtered(&world.views[0].0)));
    let (board, at_corners) = World::board();
    each(&DETECTORS, &mut add, |detector| {
        fingerprint(&[&world.views[0].0, &board].map(|image| detector.detect(image)))
    });
    each(&LOCATORS, &mut add, |locator| fingerprint(&locator.locate(&board, &at_corners)));
    each(&DESCRIPTORS, &mut add, |descriptor| fingerprint(&descriptor.describe(&world.views[0].0, &world.corners())));
    each(&MATCHERS, &mut add, |matcher| {
        let (left, right) = &world.views[0];
        let corners = world.corners();
        let shifted = world.shifted(&corners);
        let described = [0.0, 0.02].map(|noise| world.described(corners.len(), noise));
        let (left, right) = (
            View { image: left, keypoints: &corners, descriptors: &described[0] },
            View { image: right, keypoints: &shifted, descriptors: &described[1] },
        );
        fingerprint(&matcher.matches(&left, &right, &world.rig))
    });
    each(&REFINEMENTS, &mut add, |refinement| {
        let (left, right) = &world.views[0];
        fingerprint(&refinement.refine(&world.pairs(), left, right, &world.rig))
    });
    each(&TRIANGULATORS, &mut add, |triangulator| {
        let seen = world.pixels();
        let mut cloud = Vec::new();
        triangulator.triangulate_into(&seen, &world.rig, &mut cloud);
        fingerprint(&(cloud, seen.iter().map(|seen| triangulator.point(&world.rig, seen)).collect::<Vec<_>>()))
    });
    each(&SEGMENT_DETECTORS, &mut add, |detector| {
        fingerprint(&[&world.views[0].0, &board].map(|image| detector.detect(image, world.rig.left())))
    });
    each(&SEGMENT_MATCHERS, &mut add, |matcher| {
        let detector = SEGMENT_DETECTORS.build(&Choice::named("a-contrario")).unwrap();
        let (fit, mut scratch) = (SegmentFit::default(), FitScratch::default());
        let (left, right) = &world.views[0];
        let mut fitted = |image: &Image, camera: &Pinhole| -> Vec<FittedSegment> {
            let found = detector.detect(image, camera);
            found.iter().filter_map(|segment| fit.fit(image, camera, segment, &mut scratch)).collect()
        };
        let segments = [fitted(left, world.rig.left()), fitted(right, world.rig.right())];
        let (left, right) =
            (SegmentView { image: left, segments: &segments[0] }, SegmentView { image: right, segments: &segments[1] });
        let found = matcher.matches(&left, &right, &world.rig);
        let line = |found: &SegmentMatch| {
            LineRules::default().line(&world.rig, &segments[0][found.left], &segments[1][found.right])
        };
        fingerprint(&found.iter().map(|found| (found.left, found.right, line(found))).collect::<Vec<_>>())
    });
    each(&SEARCHES, &mut add, |search| {
        let mut stream = Stream::new(3, 0, 0, Purpose::Search);
        fingerprint(&search.search(&world.problem(), stream.rng()))
    });
    each(&SOLVERS, &mut add, |solver| {
        let right = world.true_pairs();
        let wrong = [&right[..6], &[Correspondence { model: 6, cloud: 8 }]].concat();
        let answers = [right, wrong].map(|pairs| {
            let data = Observations::of(&pairs, &world.model, &world.cloud, Some(&world.rig));
            let pose =
                solver.solve(&data).map(|at| (at, solver.covariance(&data, &at), solver.alternatives(&data, &at, 4.0)));
            (pose, solver.used(&data), solver.scale(&data))
        });
        assert!(answers[0].0.is_ok(), "{solver:?}: {answers:?}");
        fingerprint(&answers)
    });
    each(&ODOMETRIES, &mut add, |odometry| {
        let mut session = odometry.begin(&world.rig, Transform::identity(), Threads::One);
        for (index, (left, right)) in world.views.iter().enumerate() {
            let stamp_ns = index as u64 * 500_000_000;
            for device in Device::ALL {
                let value = Vector3::new(0.08, 0.01, -0.02);
                let covariance = Matrix3::identity() * 1e-6;
                session.sense(&Reading { device, stamp_ns, value, covariance });
            }
            session.advance(&StereoPair { stamp_ns, left, right }).unwrap();
        }
        let trajectory = session.trajectory();
        fingerprint(&(trajectory.segments, trajectory.outcomes))
    });
    each(&POLICIES, &mut add, |policy| {
        let lengths = [0.0, 0.01, 0.05, 0.1, 0.5, 1.0, 3.0, 5.0, 10.0, 20.0, 40.0, 100.0, f64::INFINITY];
        let situation = |x: f64, in_view| Situation { seconds: x, metres: 0.5 * x, sigma: 0.1 * x, in_view };
        let due = |in_view| lengths.map(|x| policy.due(&situation(x, in_view)));
        fingerprint(&[due(false), due(true)])
    });
    each(&FUSIONS, &mut add, |fusion| {
        let known = ObjectPose::new(pose(0.0), Covariance6::isotropic(2e-3, 0.02));
        let takes = [0.5, 1.0, 30.0].map(|k| {
            let fix = ObjectPose::new(pose(0.005 * k), Covariance6::isotropic(3e-3, 0.01));
            (fusion.take(&known, &fix), fusion.passes(&known, &fix))
        });
        fingerprint(&takes)
    });
    for (name, settings) in [
        ("dive", "frames = 1\nrig = { size = [48, 36], focal = 24.0 }"),
        ("generated-pairs", "frames = 1\npairs = 20"),
        ("generated-problems", "frames = 1"),
        ("virtual-images", "frames = 1\nrig = { size = [48, 36], focal = 24.0 }"),
        ("virtual-layouts", "frames = 1"),
        ("virtual-points", "frames = 1"),
    ] {
        let choice = Choice { name: name.to_owned(), settings: toml::from_str(settings).unwrap() };
        let sequence = SOURCES.build(&choice).unwrap().open(7, Path::new("")).unwrap();
        let sensor_frame = sequence.sensor_frame(0).unwrap();
        add(
            "source",
            name,
            fingerprint(&(
                &sensor_frame.frame_data,
                &sensor_frame.prior,
                &sensor_frame.hints,
                &sensor_frame.readings,
                sequence.truth(0),
            )),
        );
    }

    let seen = world.pixels();
    let places: Vec<_> =
        seen.iter().map(|seen| (world.rig.triangulate(seen), world.rig.epipolar_distance(&seen.at))).collect();
    let carried = Covariance6::<Object, Camera>::isotropic(0.01, 0.1);
    add("shared", "geometry", fingerprint(&(places, pose(0.2), pose(0.2).inverse() * pose(0.1), carried)));
    add("shared", "acceptance", world.accepted());
    let small = "rig = { size = [160, 120], focal = 80.0 }";
    add("shared", "evaluation", results("name = 'virtual-layouts'\nframes = 2", "[pipeline]\nsolver = 'kabsch'"));
    add("shared", "log", results("name = 'virtual-points'\nframes = 1", ""));
    add("shared", "front-end", results(&format!("name = 'virtual-images'\nframes = 1\n{small}"), ""));
    add("shared", "renderer", results(&format!("name = 'dive'\nframes = 1\n{small}"), "[pipeline]\ndetector = 'fast'"));
    let layouts = "name = 'virtual-layouts'\nframes = 1\nobjects = 2\nshape = 'compact'";
    add("shared", "simulation", results(layouts, "[pipeline]\nsolver = 'triad'"));
    add(
        "shared",
        "navigation",
        results(&format!("name = 'virtual-images'\nframes = 3\n{small}"), "[navigation.pose-graph]"),
    );

    let versions = components().concat().into_iter().map(|one| (one.kind, one.name, one.version));
    let shared = SHARED.iter().map(|one| ("shared", one.name, one.version));
    let all: Vec<_> =
        versions.chain(shared).filter(|(kind, name, _)| *kind != "source" || !READERS.contains(name)).collect();
    assert_eq!(all.len(), prints.len(), "a fingerprint for each component and shared part");
    let nothing = print_of("");
    let silent: Vec<_> = prints.iter().filter(|(_, print)| **print == nothing).map(|((_, name), _)| name).collect();
    assert_eq!(silent, ["peak"], "a result without a number reveals no change");
    let line = |(kind, name, version): (&str, &str, u32)| {
        let print = prints.get(&(kind.to_owned(), name.to_owned()));
        (
            format!("{kind} {name}"),
            (version, print.unwrap_or_else(|| panic!("no fingerprint of {kind} {name}")).clone()),
        )
    };
    all.into_iter().map(line).collect()
}

/// The fingerprint of every component of a registry, with its defaults.
fn each<T: ?Sized>(registry: &Registry<T>, add: &mut impl FnMut(&str, &str, String), print: impl Fn(&T) -> String) {
    for name in registry.names() {
        add(registry.kind(), name, print(&registry.build(&Choice::named(name)).unwrap()));
    }
}

/// The fingerprint of the table and the logs of a small run without durations.
fn results(source: &str, rest: &str) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("versions-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (file, out) = (folder.join("e.toml"), folder.join("out"));
    fs::write(&file, format!("question = 'Why?'\nseed = 7\n[source]\n{source}\n{rest}\n")).unwrap();
    let plan = Plan::read(&file, &[]).unwrap_or_else(|faults| panic!("{faults:?}"));
    run(&plan, &Options { timed: false, ..Options::into(&out) }, &Silent).unwrap();
    let mut text = fs::read_to_string(out.join("results.csv")).unwrap();
    for trial in &plan.trials {
        let mut log = seafix_log::read(&out.join(format!("{}.mcap", trial.name))).unwrap();
        // Pixels are ignored: they are many, and the results depend on them.
        log.frames.iter_mut().for_each(|frame| frame.images = None);
        text += &format!("{:?}", log.frames);
    }
    fs::remove_dir_all(&folder).unwrap();
    print_of(&text)
}

fn pose(angle: f64) -> Transform<Object, Camera> {
    Transform::exp(&Vector6::new(0.3 + angle, -0.2, 0.5 - angle, 0.4, -0.1, -2.0 + angle))
}

/// A small fixed world: an object, a cloud with it, a rig, and three stereo pairs of a patterned plane.
struct World {
    rig: StereoRig,
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    views: Vec<(Image, Image)>,
}

/// A number in [0, 1) for two integers.
fn noise(i: i64, j: i64) -> f64 {
    let mut hash = (i as u32).wrapping_mul(0x9E37_79B1) ^ (j as u32).wrapping_mul(0x85EB_CA77);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
    f64::from(hash ^ (hash >> 15)) / 4_294_967_296.0
}

impl World {
    const SIZE: [usize; 2] = [240, 180];
    const FOCAL: f64 = 200.0;
    const BASELINE: f64 = 0.2;

    fn new() -> Self {
        let size = Self::SIZE.map(|side| side as u32);
        let camera = || Pinhole::new(size, [Self::FOCAL; 2], Self::SIZE.map(|side| side as f64 / 2.0), &[]).unwrap();
        let right_from_left =
            Transform::<RightCamera, Camera>::exp(&Vector6::new(0.0, 0.0, 0.0, -Self::BASELINE, 0.0, 0.0));
        let rig = StereoRig::new(camera(), camera(), right_from_left).unwrap();
        let places = [
            [0.0, 0.0, 0.0],
            [0.9, 0.1, 0.05],
            [0.2, 0.7, 0.1],
            [0.8, 0.6, -0.2],
            [0.4, 0.3, 0.35],
            [-0.3, 0.5, 0.2],
            [0.5, -0.4, 0.15],
        ];
        let point = |(index, at): (usize, &[f64; 3])| ModelPoint {
            sigma: 0.001,
            ..ModelPoint::exact(format!("P{index}"), Point::new(at[0], at[1], at[2]))
        };
        let model: Vec<ModelPoint> = places.iter().enumerate().map(point).collect();
        let camera_from_object = Self::truth().inverse();
        let shown: Vec<Point<Camera>> = model.iter().map(|point| camera_from_object * point.at).collect();
        let clutter = (0..4).map(|k| Point::new(noise(k, 1) - 0.5, noise(k, 2) - 0.5, 2.0 + noise(k, 3)));
        let measured = |(index, at): (usize, Point<Camera>)| {
            let mut seen = rig.project(&at).unwrap();
            let off = |k: i64| 0.2 * (noise(index as i64, 10 + k) - 0.5);
            (seen.left.u, seen.left.v) = (seen.left.u + off(0), seen.left.v + off(1));
            (seen.right.u, seen.right.v) = (seen.right.u + off(2), seen.right.v + off(3));
            let pixels = UncertainPixels::independent(seen, 0.1);
            let found = rig.triangulate(&pixels).unwrap();
            let position = UncertainPoint { at: found.point, covariance: found.covariance };
            MeasuredPoint { position, pixels: Some(pixels) }
        };
        let cloud = shown.into_iter().chain(clutter).enumerate().map(measured).collect();
        let views = (0..3).map(|k| {
            let at = 0.04 * f64::from(k);
            (Self::view(at), Self::view(at + Self::BASELINE))
        });
        Self { model, cloud, views: views.collect(), rig }
    }

    fn truth() -> Transform<Object, Camera> {
        Transform::exp(&Vector6::new(0.2, -0.1, 0.15, 0.35, 0.25, -2.4))
    }

    /// The image of a camera at `x` (m): a tilted plane of square patches, z = 2 + 0.2 x.
    fn view(x: f64) -> Image {
        let brightness = |u: f64, v: f64| {
            let across = (u - Self::SIZE[0] as f64 / 2.0) / Self::FOCAL;
            let depth = (2.0 + 0.2 * x) / (1.0 - 0.2 * across);
            let (right, down) = (x + across * depth, (v - Self::SIZE[1] as f64 / 2.0) / Self::FOCAL * depth);
            let cell = |size: f64| noise((right / size).floor() as i64, (down / size).floor() as i64);
            30.0 + 150.0 * cell(0.17) + 50.0 * cell(0.04)
        };
        let pixel = |index: usize| {
            let (u, v) = ((index % Self::SIZE[0]) as f64, (index / Self::SIZE[0]) as f64);
            let parts =
                (0..16).map(|k| brightness(u + f64::from(k % 4) / 4.0 - 0.375, v + f64::from(k / 4) / 4.0 - 0.375));
            (parts.sum::<f64>() / 16.0) as f32
        };
        Image::new(Self::SIZE[0], Self::SIZE[1], (0..Self::SIZE[0] * Self::SIZE[1]).map(pixel).collect()).unwrap()
    }

    /// The approximate corners of the patches near the centre of the image.
    fn corners(&self) -> Vec<Keypoint> {
        let corner = |k: i64| {
            let (right, down) = (0.17 * ((k % 6) as f64 - 2.0), 0.17 * ((k / 6) as f64 - 1.0));
            let depth = 2.0 + 0.2 * right;
            let [cx, cy] = Self::SIZE.map(|side| side as f64 / 2.0);
            let at = Pixel { u: cx + Self::FOCAL * right / depth + 0.3, v: cy + Self::FOCAL * down / depth - 0.2 };
            Keypoint { at, response: 1.0 + k as f32, scale: 1.2 }
        };
        (0..24).map(corner).collect()
    }

    /// The same corners in the right image, with an error.
    fn shifted(&self, corners: &[Keypoint]) -> Vec<Keypoint> {
        let shifted = |(k, corner): (usize, &Keypoint)| {
            let across = (corner.at.u - Self::SIZE[0] as f64 / 2.0) / Self::FOCAL;
            let disparity = Self::FOCAL * Self::BASELINE * (1.0 - 0.2 * across) / 2.0;
            // One in six is wrong.
            let off = if k % 6 == 3 { 6.0 } else { 0.1 };
            let at = Pixel { u: corner.at.u - disparity + 0.4 * noise(k as i64, 20), v: corner.at.v + off };
            Keypoint { at, ..*corner }
        };
        corners.iter().enumerate().map(shifted).collect()
    }

    /// Descriptors that identify key points by their index in the list, with some similarity.
    fn described(&self, count: usize, spread: f64) -> Descriptors {
        let mut described = Descriptors::default();
        let numbers = described.numbers_mut(count, 16);
        let number = |k: i64| 0.25 * noise(k, 30) + spread * (noise(k, 31) - 0.5) * (k / 16 % 6) as f64;
        numbers.iter_mut().enumerate().for_each(|(k, value)| *value = number(k as i64) as f32);
        described
    }

    /// Clean corners: a chequer-board, bright squares on dark ground beside it, and approximate positions of the
    /// corners.
    fn board() -> (Image, Vec<Keypoint>) {
        const SIDE: f64 = 20.3;
        let bright = |u: f64, v: f64| {
            let (i, j) = ((u / SIDE).floor() as i64, (v / SIDE).floor() as i64);
            let inside = if u < 120.0 { (i + j) % 2 == 0 } else { i % 2 == 0 && j % 2 == 0 };
            if inside { 190.0 } else { 50.0 }
        };
        let pixel = |index: usize| {
            let (u, v) = ((index % Self::SIZE[0]) as f64, (index / Self::SIZE[0]) as f64);
            // A blur of some two pixels, as by a lens.
            let parts =
                (0..144).map(|k| bright(u + f64::from(k % 12) / 6.0 - 0.917, v + f64::from(k / 12) / 6.0 - 0.917));
            (parts.sum::<f64>() / 144.0 + 2.0 * noise(index as i64, 40)) as f32
        };
        let image = Image::new(Self::SIZE[0], Self::SIZE[1], (0..Self::SIZE[0] * Self::SIZE[1]).map(pixel).collect());
        let corner = |k: i64| {
            let at = Pixel { u: SIDE * (2 + k % 9) as f64 + 0.2, v: SIDE * (2 + k / 9) as f64 - 0.9 };
            Keypoint { at, response: 1.0, scale: 1.2 }
        };
        (image.unwrap(), (0..45).map(corner).collect())
    }

    fn pairs(&self) -> Vec<Pair> {
        let corners = self.corners();
        let place = |keypoint: &Keypoint| UncertainPixel { at: keypoint.at, covariance: Matrix2::identity() * 0.04 };
        corners.iter().zip(&self.shifted(&corners)).map(|(a, b)| Pair { left: place(a), right: place(b) }).collect()
    }

    fn pixels(&self) -> Vec<UncertainPixels> {
        let pixels =
            |Pair { left, right }| UncertainPixels::independent(StereoPixels { left: left.at, right: right.at }, 0.2);
        self.pairs().into_iter().map(pixels).collect()
    }

    fn true_pairs(&self) -> Vec<Correspondence> {
        (0..self.model.len()).map(|k| Correspondence { model: k, cloud: k }).collect()
    }

    fn problem(&self) -> Problem<'_> {
        // Leaked for the duration of the test, because a problem borrows its parts.
        let prior = Box::leak(Box::new(self.prior()));
        let all = Box::leak(Box::new(Candidates::all(self.model.len(), self.cloud.len())));
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: all,
            tolerance: Tolerance::Sigmas(3.0),
            prior: Some(prior),
            edges: Default::default(),
        }
    }

    fn prior(&self) -> Prior {
        let off = Transform::<Camera, Camera>::exp(&Vector6::new(0.01, -0.005, 0.008, 0.05, -0.04, 0.03));
        let bound = PriorBound::Gaussian(Covariance6::isotropic(0.01, 0.05));
        Prior { object_from_camera: Self::truth() * off, bound }
    }

    /// Candidates by a gate, and the test of an identification.
    fn accepted(&self) -> String {
        let prior = self.prior();
        let gate = Gate::default();
        let listed = candidates(&self.model, &self.cloud, Some(&prior), &gate, None);
        let problem = Problem { candidates: &listed, ..self.problem() };
        let search = SEARCHES.build(&Choice::named("rigid-consensus")).unwrap();
        let solver = SOLVERS.build(&Choice::named("stereo-reprojection")).unwrap();
        let mut stream = Stream::new(4, 0, 0, Purpose::Search);
        let found = search.search(&problem, stream.rng());
        let attempt = judge(&problem, found, &*solver, &Acceptance::default(), Some(&self.rig));
        fingerprint(&(&listed, &attempt))
    }
}
