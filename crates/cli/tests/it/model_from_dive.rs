//! `seafix model DIVE`: a model from a dive, and `seafix eval` of two sites.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use seafix_data::{
    StereoPairs,
    dataset::{Dataset, write_png},
    source::Mcap,
};
use seafix_geometry::{Object, Pixel, Transform, triad};
use seafix_referencing::{ModelEdge, Site};
use tempfile::TempDir;

use crate::{Ended, ended_with, program, recordings::recording_of};

/// Half an orbit of six pairs around an object, whose site is the truth.
const DIVE: &str = r#"
question = "Does a dive around an object give its model?"
seed = 5

[source]
name = "dive"
frames = 6
rate = 0.8
model-sigma = 0.0
survey-sigma = 0.0

[source.route]
kind = "orbit"
object = "manifold"
altitude = 2.5
radius = 0.8
"#;

/// The rendered dive, once for all tests.
fn dive() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("dive.toml"), DIVE).unwrap();
        ended_with(0, program().current_dir(folder.path()).args(["dive", "dive.toml", "--out", "dive"]));
        folder
    });
    folder.path()
}

/// One mark of each point, a pixel off, in the pair that shows it nearest to the centre: the lines of the table.
fn marks() -> Vec<String> {
    let dataset = Dataset::open(&dive().join("dive")).unwrap();
    let object = dataset.site.as_ref().unwrap().object("manifold").unwrap();
    let world_from_object = object.world_from_object.unwrap();
    let [u, v] = dataset.rig.left().principal();
    let centre = Pixel { u, v };
    let mark = |point: &seafix_referencing::ModelPoint| {
        let seen = dataset.frames.iter().filter_map(|frame| {
            let named = |(object, id): &&(String, String)| object == "manifold" && *id == point.id;
            frame.visible.iter().find(named)?;
            let pixels = dataset.rig.project(&(frame.truth?.inverse() * (world_from_object * point.at)))?;
            Some((pixels.left.distance(&centre), frame.stamp_ns, pixels.left))
        });
        let (_, stamp, at) = seen.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(format!("{stamp},{},{:.1},{:.1},,", point.id, at.u + 0.7, at.v - 0.6))
    };
    object.points.iter().filter_map(mark).collect()
}

const HEADER: &str = "stamp_ns,id,left_u,left_v,right_u,right_v";

fn table(lines: &[String]) -> String {
    format!("{HEADER}\n{}\n", lines.join("\n"))
}

fn model(folder: &Path, dive: &Path, marks: &str, more: &[&str], code: i32) -> Ended {
    fs::write(folder.join("marks.csv"), marks).unwrap();
    let mut command = program();
    command.current_dir(folder).arg("model").arg(dive);
    ended_with(code, command.args(["--marks", "marks.csv", "--id", "manifold"]).args(more))
}

/// One mark a point gives the model to a millimetre, whatever the order of the marks and the number of threads.
#[test]
fn one_mark_of_each_point_gives_the_model() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = dive().join("dive");
    let lines = marks();
    assert!(lines.len() >= 5, "{lines:?}");
    let message = model(here, &source, &table(&lines), &["--out", "a.toml", "--half", "--threads", "2"], 0).out;
    assert!(message.contains("of 6 pairs") && message.contains("models of every second pair differ"), "{message}");
    ended_with(0, program().arg("check").arg(here.join("a.toml")));
    let reversed: Vec<String> = lines.iter().rev().cloned().collect();
    let json = model(here, &source, &table(&reversed), &["--out", "b.toml", "--threads", "1", "--json"], 0).out;
    assert_eq!(fs::read(here.join("a.toml")).unwrap(), fs::read(here.join("b.toml")).unwrap());
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let base = &json["base"][0];
    let points = json["points"].as_array().unwrap();
    let first = points.iter().find(|point| point["id"] == *base).unwrap();
    assert_eq!(first["covariance"], serde_json::json!([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]));
    assert!(points.iter().all(|point| point["observations"].as_array().unwrap().len() >= 2));

    let mut eval = program();
    let text = ended_with(0, eval.arg("eval").arg(source.join("site.toml")).arg(here.join("a.toml")).arg("--json")).out;
    let compared: serde_json::Value = serde_json::from_str(&text).unwrap();
    let object = &compared["objects"][0];
    assert_eq!(object["object"], "manifold");
    let (rms, scale) = (object["rms"].as_f64().unwrap(), object["scale"].as_f64().unwrap());
    assert!(rms < 1.5e-3 && (scale - 1.0).abs() < 4e-3, "{text}");
    let people = ended_with(0, program().arg("eval").arg(source.join("site.toml")).arg(here.join("a.toml"))).out;
    assert!(people.contains("mm a coordinate, worst") && people.contains("χ²"), "{people}");
}

/// Marks in one pair, and no odometry: the other pairs are found by their own corners.
#[test]
fn pairs_are_found_without_an_odometry() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = dive().join("dive");
    let dataset = Dataset::open(&source).unwrap();
    let object = dataset.site.as_ref().unwrap().object("manifold").unwrap();
    let frame = &dataset.frames[2];
    let mark = |point: &seafix_referencing::ModelPoint| {
        frame.visible.iter().find(|(object, id)| object == "manifold" && *id == point.id)?;
        let here = frame.truth?.inverse() * (object.world_from_object? * point.at);
        let left = dataset.rig.project(&here)?.left;
        Some(format!("{},{},{:.1},{:.1},,", frame.stamp_ns, point.id, left.u, left.v))
    };
    let lines: Vec<String> = object.points.iter().filter_map(mark).collect();
    let text = model(here, &source, &table(&lines), &["--odometry", "none", "--out", "a.toml"], 0).out;
    assert!(text.contains("from 6 of 6 pairs") || text.contains("from 5 of 6 pairs"), "{text}");
    let text = ended_with(0, program().arg("eval").arg(source.join("site.toml")).arg(here.join("a.toml"))).out;
    let rms: f64 = text.split("RMS ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(rms < 1.0, "{text}");
}

/// A feature without a match in the pair of its mark is found by the corners of other pairs on its line of sight.
#[test]
fn a_mark_without_a_match_is_found_in_other_pairs() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = here.join("dive");
    fs::create_dir(&source).unwrap();
    for file in fs::read_dir(dive().join("dive")).unwrap() {
        let file = file.unwrap().path();
        fs::copy(&file, source.join(file.file_name().unwrap())).unwrap();
    }
    let lines = marks();
    let (dataset, cells) = (Dataset::open(&source).unwrap(), lines[0].split(',').collect::<Vec<_>>());
    let index = dataset.frames.iter().position(|frame| frame.stamp_ns.to_string() == cells[0]).unwrap();
    let row: usize = cells[3].parse::<f64>().unwrap() as usize;
    // The right image has lost the rows about the mark.
    let (_, mut right) = dataset.pair(&dataset.frames[index]).unwrap();
    let width = right.width();
    right.pixels_mut()[(row - 12) * width..(row + 12) * width].fill(60.0);
    let name = fs::read_to_string(source.join("frames.csv")).unwrap();
    let name = name.lines().nth(index + 1).unwrap().split(',').nth(2).unwrap();
    write_png(&source.join(name), &right, 8).unwrap();
    let json = model(here, &source, &table(&lines), &["--out", "a.toml", "--json"], 0).out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let point = json["points"].as_array().unwrap().iter().find(|point| point["id"] == cells[1]).expect("the feature");
    assert_eq!(point["corner"], true);
    assert!(point["observations"].as_array().unwrap().len() >= 3, "{point}");
}

/// A dive of one pair gives the bytes of the command for one pair.
#[test]
fn the_model_of_one_pair_is_that_of_its_images() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let one = here.join("one");
    fs::create_dir(&one).unwrap();
    let source = dive().join("dive");
    let frames = fs::read_to_string(source.join("frames.csv")).unwrap();
    let lines = marks();
    // The pair with the largest number of marks.
    let count = |stamp: &str| lines.iter().filter(|line| line.starts_with(stamp)).count();
    let row = frames.lines().skip(1).max_by_key(|row| count(row.split(',').next().unwrap())).unwrap();
    let [stamp, left, right] = row.split(',').collect::<Vec<_>>()[..] else { panic!("{row}") };
    for file in ["dataset.toml", "doppler.csv", "gyro.csv", left, right] {
        fs::copy(source.join(file), one.join(file)).unwrap();
    }
    fs::write(one.join("frames.csv"), format!("stamp_ns,left,right\n{row}\n")).unwrap();
    let mut own: Vec<String> = lines.iter().filter(|line| line.starts_with(stamp)).cloned().collect();
    if own.len() < 3 {
        // Other places with texture serve as well: both commands receive the same.
        own.extend((0..3).map(|k| format!("{stamp},X{k},{},{},,", 400 + 60 * k, 300 + 30 * k * k)));
    }
    model(here, &one, &table(&own), &["--out", "dive.toml"], 0);
    let pair: Vec<&str> = own.iter().map(|line| line.split_once(',').unwrap().1).collect();
    fs::write(here.join("clicks.csv"), format!("id,left_u,left_v,right_u,right_v\n{}\n", pair.join("\n"))).unwrap();
    let mut command = program();
    command.current_dir(here).arg("model").args([one.join(left), one.join(right)]).arg("--rig");
    command.arg(one.join("dataset.toml")).args(["--points", "clicks.csv", "--id", "manifold", "--out", "pair.toml"]);
    ended_with(0, &mut command);
    assert_eq!(fs::read(here.join("dive.toml")).unwrap(), fs::read(here.join("pair.toml")).unwrap());
}

#[test]
fn what_is_wrong_with_marks_is_reported_with_its_lines() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = dive().join("dive");
    let lines = marks();
    let with = |more: &str| table(&[lines.clone(), vec![more.to_owned()]].concat());
    let renamed = lines[0].replacen(&format!(",{},", lines[0].split(',').nth(1).unwrap()), ",copy,", 1);
    let stamp = lines[0].split(',').next().unwrap();
    let number = lines.len() + 2;
    let cases: [(String, &[&str], i32, String); 6] = [
        (with("17,Z,9,9,,"), &[], 3, format!("a mark at the stamp of no pair in marks.csv:{number}: 17")),
        (with(&renamed), &[], 3, "two names of one place".to_owned()),
        (with(&lines[0]), &[], 3, "a point marked twice in one pair".to_owned()),
        (with(&format!("{stamp},Z,5000,9,,")), &[], 3, "a mark outside the left image".to_owned()),
        (table(&lines), &["--base", "A,B"], 2, "separate three ids by commas".to_owned()),
        (table(&lines), &["--baseline-sigma", "2"], 2, "invalid --baseline-sigma 2".to_owned()),
    ];
    for (marks, more, code, part) in cases {
        let text = model(here, &source, &marks, &[more, &["--out", "site.toml"]].concat(), code).error;
        assert!(text.contains(&part), "{text}");
        assert_eq!(fs::read_dir(here).unwrap().count(), 1, "only the marks");
    }
    let no_site = ended_with(2, program().arg("eval").arg(source.join("site.toml"))).error;
    assert!(no_site.contains("no second site"), "{no_site}");
}

#[test]
#[ignore = "long: renders 24 pairs"]
fn proposals_are_marks_and_a_page() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let out: PathBuf = here.join("marks.csv");
    let mut command = program();
    let orbit =
        DIVE.replace("frames = 6\nrate = 0.8", "frames = 24\nrate = 0.0").replace("altitude = 2.5", "altitude = 3.0");
    fs::write(here.join("orbit.toml"), orbit).unwrap();
    ended_with(0, program().current_dir(here).args(["dive", "orbit.toml", "--out", "orbit"]));
    command.current_dir(here).args(["model", "orbit", "--propose", "24", "--page", "page.html"]);
    ended_with(0, command.arg("--out").arg(&out));
    let marks = fs::read_to_string(&out).unwrap();
    assert!(marks.starts_with(HEADER) && marks.lines().count() == 25, "{marks}");
    assert!(fs::read_to_string(here.join("page.html")).unwrap().contains("data:image/png;base64,"));
    // Most of the eight points of the object are among them: 8 when this was written.
    let found = proposed_points(&here.join("orbit"), &marks);
    assert!(found.len() >= 7, "{found:?} of {marks}");
}

/// The points of the object within 2 px of a mark in its pair.
fn proposed_points(dive: &Path, marks: &str) -> Vec<String> {
    let dataset = Dataset::open(dive).unwrap();
    let object = dataset.site.as_ref().unwrap().object("manifold").unwrap();
    let world_from_object = object.world_from_object.unwrap();
    let near = |point: &&seafix_referencing::ModelPoint| {
        marks.lines().skip(1).any(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let frame = dataset.frames.iter().find(|frame| frame.stamp_ns.to_string() == cells[0]).unwrap();
            let at = frame.truth.unwrap().inverse() * (world_from_object * point.at);
            let mark = Pixel { u: cells[2].parse().unwrap(), v: cells[3].parse().unwrap() };
            dataset.rig.project(&at).is_some_and(|pixels| pixels.left.distance(&mark) <= 2.0)
        })
    };
    object.points.iter().filter(near).map(|point| point.id.clone()).collect()
}

/// Without an odometry one pair stands alone: what it shows best is proposed.
#[test]
fn one_pair_alone_has_proposals() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("marks.csv");
    let mut command = program();
    command.arg("model").arg(dive().join("dive")).args(["--propose", "9", "--odometry", "none", "--out"]);
    ended_with(0, command.arg(&out));
    let marks = fs::read_to_string(out).unwrap();
    let pairs: std::collections::BTreeSet<&str> = marks.lines().skip(1).map(|line| &line[..19]).collect();
    assert!(marks.lines().count() == 10 && pairs.len() == 1, "{marks}");
}

/// A recording and the log of a run give the model of their images.
#[test]
fn a_recording_and_a_log_are_dives() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = dive().join("dive");
    let dataset = Dataset::open(&source).unwrap();
    let lines = marks();
    model(here, &source, &table(&lines), &["--out", "a.toml"], 0);

    let experiment = format!(
        "question = 'Where?'\n[source]\nname = 'dataset'\npath = '{}'\n[log]\nimages = 'all'\n",
        source.display()
    );
    fs::write(here.join("e.toml"), experiment).unwrap();
    ended_with(0, program().current_dir(here).args(["run", "e.toml", "--out", "out"]));
    let entries = fs::read_dir(here.join("out")).unwrap().map(|entry| entry.unwrap().path());
    let log = entries.into_iter().find(|path| path.extension().is_some_and(|end| end == "mcap")).unwrap();
    model(here, &log, &table(&lines), &["--out", "b.toml"], 0);
    assert_eq!(fs::read(here.join("a.toml")).unwrap(), fs::read(here.join("b.toml")).unwrap());

    let images = dataset.frames.iter().map(|frame| [&frame.left, &frame.right].map(|file| fs::read(file).unwrap()));
    let left = dataset.rig.left();
    recording_of(images.collect(), left.size(), left.focal()[0], dataset.rig.baseline(), &here.join("dive.mcap"));
    // A pair has another time there.
    let place = |stamp: &str| dataset.frames.iter().position(|frame| frame.stamp_ns.to_string() == stamp).unwrap();
    let recorded = StereoPairs::open(&here.join("dive.mcap"), &Mcap::default()).unwrap();
    let renamed = |line: &String| {
        let (stamp, rest) = line.split_once(',').unwrap();
        format!("{},{rest}", recorded.stamps()[place(stamp)])
    };
    let lines: Vec<String> = lines.iter().map(renamed).collect();
    model(here, &here.join("dive.mcap"), &table(&lines), &["--out", "c.toml"], 0);
    let mut eval = program();
    let text = ended_with(0, eval.arg("eval").args(["a.toml", "c.toml"].map(|name| here.join(name)))).out;
    let rms: f64 = text.split("RMS ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(rms < 0.05, "{text}");
}

/// Edges of the true model, and no others: half an orbit shows outlines of pipes and shadows as well.
///
/// Fails where an outline counts as an edge (no limit of its scatter), or where poses are used in the wrong direction.
#[test]
fn edges_of_a_dive_are_those_of_the_object() {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    let source = dive().join("dive");
    let json = model(here, &source, &table(&marks()), &["--edges", "--json", "--out", "a.toml"], 0).out;
    ended_with(0, program().arg("check").arg(here.join("a.toml")));
    // A built site that is read and written again has the same bytes.
    let text = fs::read_to_string(here.join("a.toml")).unwrap();
    assert_eq!(Site::parse(&text, Path::new("a.toml")).unwrap().to_toml(), text);
    let read = |file: &Path| {
        Site::from_file(file).unwrap().objects.into_iter().find(|object| object.id == "manifold").unwrap()
    };
    let (truth, built) = (read(&source.join("site.toml")), read(&here.join("a.toml")));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let count = json["edges"].as_array().unwrap().len();
    assert!(count == built.edges.len() && count >= 15, "{count} edges");

    // The built frame is that of its base points.
    let base = built.base.map(|index| built.points[index].id.as_str());
    let [p1, p2, p3] = base.map(|id| truth.points.iter().find(|point| point.id == id).unwrap().at);
    let truth_from_built: Transform<Object, Object> = triad(&p1, &p2, &p3).unwrap();
    for edge in &built.edges {
        let ends = edge.places(&built.points).map(|end| truth_from_built * end);
        let offset = |other: &ModelEdge| {
            let [a, b] = other.places(&truth.points);
            let direction = (b - a).normalize();
            ends.map(|end| (end - a).cross(&direction).norm()).into_iter().fold(0.0, f64::max)
        };
        let nearest = truth.edges.iter().map(offset).fold(f64::INFINITY, f64::min);
        assert!(nearest < 5e-3, "{} is {:.1} mm from every edge", edge.id, nearest * 1e3);
    }
}
