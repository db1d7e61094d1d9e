//! Hand-made sites: a valid one, and its invalid variants.

use std::path::Path;

use seafix_geometry::Point;

use super::*;
use nalgebra::Vector3;

/// Two objects: a plate at (10, 20, 30) with the world's axes, and a frame 5 m north of it.
const GOOD: &str = r#"
format = "seafix-site/1"
name = "yard"
axes = "p1p3-x/p1p2xp1p3-z/zx-y"
site_frame = "plate"
[[object]]
id = "plate"
base = ["A", "B", "C"]
base_in_world = [[10.0, 20.0, 30.0], [10.0, 19.0, 30.0], [12.0, 20.0, 30.0]]
survey_sigma = 0.01
[[object.point]]
id = "A"
at = [0.0, 0.0, 0.0]
sigma = 0.001
normal = [0.0, 0.0, 2.0]
[[object.point]]
id = "B"
at = [0.0, -1.0, 0.0]
[[object.point]]
id = "C"
at = [2.0, 0.0, 0.0]
[[object.interest]]
id = "valve"
at = [1.0, 0.5, 0.25]
normal = [0.0, 0.5, 0.0]
[[object]]
id = "frame"
base = ["A", "B", "C"]
base_in_world = [[15.0, 20.0, 30.0], [15.0, 19.0, 30.0], [16.0, 20.0, 30.0]]
survey_sigma = 0.02
[[object.point]]
id = "A"
at = [0.0, 0.0, 0.0]
[[object.point]]
id = "B"
at = [0.0, -1.0, 0.0]
[[object.point]]
id = "C"
at = [1.0, 0.0, 0.0]
[[object.point]]
id = "D"
at = [0.5, 0.5, -1.0]
"#;

fn parse(text: &str) -> Result<Site, Vec<Fault>> {
    Site::parse(text, Path::new("site.toml"))
}

/// The messages of the valid site's faults after one replacement.
fn faults(from: &str, to: &str) -> Vec<String> {
    assert!(GOOD.contains(from), "the good site has no `{from}`");
    parse(&GOOD.replacen(from, to, 1)).expect_err("the site is broken").iter().map(ToString::to_string).collect()
}

#[test]
fn a_good_site_stands_where_it_was_surveyed() {
    let site = parse(GOOD).unwrap();
    assert!(site.warnings.is_empty(), "{:?}", site.warnings);
    let plate = site.frame_object();
    assert_eq!((plate.id.as_str(), plate.base, plate.distance(1, 2)), ("plate", [0, 1, 2], 5f64.sqrt()));
    let at = plate.world_from_object.unwrap() * Point::new(1.0, 1.0, 1.0);
    assert!(at.distance(&Point::new(11.0, 21.0, 31.0)) < 1e-12, "{at:?}");
    assert_eq!(plate.points[0].normal, Some(Vector3::z()), "normals become unit vectors");
    let bounding_box = site.bounding_box_in_world().unwrap();
    assert!(bounding_box.min.distance(&Point::new(10.0, 19.0, 29.0)) < 1e-12, "{bounding_box:?}");
    assert!(bounding_box.max.distance(&Point::new(16.0, 20.5, 30.0)) < 1e-12, "{bounding_box:?}");
}

#[test]
fn a_site_written_and_read_is_the_same() {
    let site = parse(GOOD).unwrap();
    assert_eq!(parse(&site.to_toml()).unwrap(), site);
}

#[test]
fn the_complete_site_is_one_target_in_its_frame() {
    let site = parse(GOOD).unwrap();
    let [target] = &site.targets(TargetKind::Site).unwrap()[..] else { panic!("one target") };
    let ids: Vec<&str> = target.points.iter().map(|point| point.id.as_str()).collect();
    assert_eq!(ids, ["plate/A", "plate/B", "plate/C", "frame/A", "frame/B", "frame/C", "frame/D"]);
    assert_eq!(target.points[2].at, Point::new(2.0, 0.0, 0.0), "the points of the frame object stay unchanged");
    assert!(target.points[6].at.distance(&Point::new(5.5, 0.5, -1.0)) < 1e-12);
    assert_eq!(target.points[0].sigma, 0.001);
    // Between objects both surveys contribute, more for points farther from the surveyed bases.
    assert!((0.01f64.hypot(0.02)..0.1).contains(&target.points[6].sigma), "{}", target.points[6].sigma);
    assert!((target.diameter() - (6f64 * 6.0 + 1.0).sqrt()).abs() < 1e-12, "plate/B to frame/C");
    let targets = site.targets(TargetKind::Object).unwrap();
    assert_eq!(targets.iter().map(|target| target.points.len()).collect::<Vec<_>>(), [3, 4]);
}

#[test]
fn a_site_without_a_world_has_objects_only() {
    let text = GOOD.replace("base_in_world = [[15.0, 20.0, 30.0], [15.0, 19.0, 30.0], [16.0, 20.0, 30.0]]\n", "");
    let site = parse(&text).unwrap();
    assert_eq!(site.targets(TargetKind::Site), Err(NoWorld { object: "frame".to_owned() }));
    assert_eq!(site.targets(TargetKind::Object).unwrap().len(), 2);
    assert_eq!(site.bounding_box_in_world(), None);
}

#[test]
fn not_a_number_names_its_point() {
    let found = faults("at = [0.0, -1.0, 0.0]", "at = [0.0, nan, 0.0]");
    let expected = "object `plate`, point `B`: `at` is not finite in site.toml:18: [0.0, NaN, 0.0]; \
                    give finite numbers, in metres";
    assert_eq!(found, [expected]);
}

#[test]
fn two_points_are_too_few() {
    let found = faults("[[object.point]]\nid = \"C\"\nat = [2.0, 0.0, 0.0]\n", "");
    assert!(found[0].starts_with("object `plate` has too few points in site.toml:6: 2 points"), "{found:?}");
    assert!(found[1].contains("unknown point in `base` in site.toml:8: `C`"), "{found:?}");
}

#[test]
fn a_collinear_base_is_rejected_with_its_sine() {
    let found = faults("at = [0.0, -1.0, 0.0]", "at = [1.0, -0.0005, 0.0]");
    assert!(found[0].starts_with("object `plate`: collinear base in site.toml:8: sine 5.00e-4 at P1"), "{found:?}");
}

#[test]
fn a_nearly_collinear_base_is_a_warning() {
    let text = GOOD.replacen("at = [0.0, -1.0, 0.0]", "at = [1.0, -0.05, 0.0]", 1);
    let site = parse(&text.replacen("[10.0, 19.0, 30.0]", "[11.0, 19.95, 30.0]", 1)).unwrap();
    assert!(site.warnings[0].to_string().contains("nearly collinear base"), "{:?}", site.warnings);
}

#[test]
fn points_in_one_place_are_rejected_by_both_names() {
    let found = faults("at = [0.5, 0.5, -1.0]", "at = [1.0, 0.0, 1e-7]");
    assert_eq!(found, ["object `frame`: coincident points in site.toml:40: `C` and `D`; remove one"]);
}

#[test]
fn an_id_used_twice_names_both_lines() {
    let found = faults("id = \"D\"", "id = \"B\"");
    let expected =
        "object `frame`: point id is used twice in site.toml:41: `B`; it is already used on line 35; choose another id";
    assert_eq!(found, [expected]);
    let found = faults("id = \"frame\"", "id = \"plate\"");
    assert!(
        found[0].starts_with("object id is used twice in site.toml:27: `plate`; it is already used on line 7"),
        "{found:?}"
    );
}

#[test]
fn an_unknown_name_is_answered_with_the_nearest() {
    assert!(
        faults("site_frame = \"plate\"", "site_frame = \"plat\"")[0].ends_with(":5: `plat`; did you mean `plate`?")
    );
    let found = faults("site_frame", "site_farme");
    assert_eq!(found, ["unknown key in site.toml:5:1: `site_farme`; did you mean `site_frame`?"]);
    assert!(faults("seafix-site/1", "seafix-site/2")[0].contains("unknown format in site.toml:2: `seafix-site/2`"));
}

#[test]
fn millimetres_are_suspected() {
    let text = r#"
format = "seafix-site/1"
name = "mm"
axes = "p1p3-x/p1p2xp1p3-z/zx-y"
site_frame = "o"
[[object]]
id = "o"
base = ["A", "B", "C"]
point = [{ id = "A", at = [0, 0, 0] }, { id = "B", at = [0, -1500.0, 0] }, { id = "C", at = [2000.0, 0, 0] }]
"#;
    let text = text
        .replace("[0, 0, 0]", "[0.0, 0.0, 0.0]")
        .replace("-1500.0, 0]", "-1500.0, 0.0]")
        .replace("[0, -", "[0.0, -");
    let text = text.replace("[2000.0, 0, 0]", "[2000.0, 0.0, 0.0]");
    let site = parse(&text).unwrap();
    assert!(
        site.warnings[0].to_string().starts_with("object `o`: implausible units in site.toml:6"),
        "{:?}",
        site.warnings
    );
    let far = text.replace("2000.0", "2000000.0");
    assert!(parse(&far).unwrap_err()[0].to_string().starts_with("object `o`: implausible units"));
}

#[test]
fn the_base_obeys_the_rule_of_axes() {
    // P2 on the other side: the sign that does not cancel in Eq. (1).
    let found = faults("at = [0.0, -1.0, 0.0]", "at = [0.0, 1.0, 0.0]");
    assert!(found[0].starts_with("object `plate`: the base violates the axes rule in site.toml:8"), "{found:?}");
    assert!(found[0].contains("P2 = [0, -1, 0], P3 = [2, 0, 0]"), "{found:?}");
}

#[test]
fn survey_and_model_must_agree() {
    let found = faults("[12.0, 20.0, 30.0]", "[12.2, 20.0, 30.0]");
    assert_eq!(found.len(), 2, "P1 P3 and P2 P3: {found:?}");
    assert!(
        found[0].contains("disagree on the distance P1 P3 in site.toml:9: 2.2000 m surveyed, 2.0000 m in the model"),
        "{found:?}"
    );
    // A difference within four standard deviations is valid.
    assert!(parse(&GOOD.replacen("[12.0, 20.0, 30.0]", "[12.03, 20.0, 30.0]", 1)).is_ok());
}

#[test]
fn all_faults_come_at_once() {
    let text = GOOD
        .replace("survey_sigma = 0.02", "survey_sigma = -1.0")
        .replace("at = [2.0, 0.0, 0.0]", "at = [inf, 0.0, 0.0]");
    let found = parse(&text.replace("site_frame = \"plate\"", "site_frame = \"x\"")).unwrap_err();
    assert_eq!(found.len(), 3, "{found:?}");
}

/// The valid site with an edge between two points and another to a place of its own.
fn with_edges() -> String {
    let edges = r#"
[[object.edge]]
id = "front"
from = "A"
to = "B"
faces = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]
[[object.edge]]
id = "post"
from = [0.0, 0.0, 1.0]
to = "A"
sigma = 0.002
[[object.interest]]"#;
    GOOD.replace("seafix-site/1", "seafix-site/1.1").replacen("[[object.interest]]", edges.trim_start(), 1)
}

/// Fails if a site without edges is written in the newer format, and if an end loses its point.
#[test]
fn edges_are_read_and_written_in_a_format_of_their_own() {
    let site = parse(&with_edges()).unwrap();
    let edges = &site.objects[0].edges;
    assert_eq!(edges[0].ends, [End::Point(0), End::Point(1)]);
    assert_eq!(edges[1].ends, [End::At([0.0, 0.0, 1.0].into()), End::Point(0)]);
    assert_eq!(edges[0].sigmas(&site.objects[0].points), [0.001, 0.0]);
    assert_eq!(edges[1].sigmas(&site.objects[0].points), [0.002, 0.001]);
    let text = site.to_toml();
    assert!(text.contains("\"seafix-site/1.1\""));
    assert_eq!(parse(&text).unwrap(), site);
    assert!(parse(GOOD).unwrap().to_toml().contains("\"seafix-site/1\""));
    let target = &site.targets(TargetKind::Site).unwrap()[0];
    assert_eq!(target.edges.len(), 2);
    assert_eq!(site.targets(TargetKind::Object).unwrap()[0].edges, *edges);
}

#[test]
fn an_invalid_edge_is_rejected_in_one_line() {
    let good = with_edges();
    for (from, to, parts) in [
        ("seafix-site/1.1", "seafix-site/1", ["format", "format = \"seafix-site/1.1\""]),
        ("to = \"B\"", "to = \"Z\"", ["edge `front`: unknown point in `to`", "there are A, B, C"]),
        ("to = \"B\"", "to = \"A\"", ["edge `front` is too short", "0 m"]),
        ("to = \"B\"", "to = [0.0, 0.0, 0.019]", ["edge `front` is too short", "0.019 m"]),
        ("to = \"B\"", "to = [0.0, nan, 0.0]", ["edge `front`: `to` is not finite", "finite numbers"]),
        ("[-1.0, 0.0, 0.0]", "[-2.0, 0.0, 0.0]", ["a face normal is not a unit vector", "of length 2"]),
        ("[-1.0, 0.0, 0.0]", "[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]", ["edge `front` has too many faces", "3"]),
        ("from = [0.0, 0.0, 1.0]", "from = \"B\"", ["the same edge twice", "`front` and `post`"]),
        ("sigma = 0.002", "sigma = -1.0", ["edge `post`: `sigma`", "zero or more"]),
        ("sigma = 0.002", "sigma = 1.2", ["edge `post`: `sigma` is out of range", "at most half of the diameter"]),
        ("from = [0.0, 0.0, 1.0]", "from = [0.0, 0.0, 300.0]", ["edge `post`: implausible units", "300 m long"]),
        ("from = [0.0, 0.0, 1.0]", "from = [0.0, 0.0, 1e300]", ["edge `post`: `from` is out of range", "1e300"]),
        ("[-1.0, 0.0, 0.0]", "[0.0, 1.0, 0.0]", ["a face normal is not at right angles to the edge", "at 0° to it"]),
        ("[-1.0, 0.0, 0.0]", "[0.0, 0.0, 1.0]", ["the two face normals are equal", "of the other face"]),
        ("[-1.0, 0.0, 0.0]", "[0.0, 0.0, -1.0]", ["the two face normals are opposite", "of a thin plate"]),
        ("id = \"post\"", "id = \"front\"", ["edge id is used twice", "choose another id"]),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let faults = parse(&text).unwrap_err();
        assert_eq!(faults.len(), 1, "{faults:?}");
        let line = faults[0].to_string();
        assert!(line.contains(" in site.toml:") && parts.iter().all(|part| line.contains(part)), "{line}");
        assert!(!line.contains('\n'), "{line}");
    }
}

#[test]
fn suspicious_edges_are_warned_of() {
    let warned = |from: &str, to: &str| parse(&with_edges().replacen(from, to, 1)).unwrap().warnings;
    assert!(warned("x", "x").is_empty());
    let long = warned("from = [0.0, 0.0, 1.0]", "from = [0.0, 0.0, 6.0]");
    assert!(long[0].to_string().contains("edge `post` is long"));
    let open = warned("sigma = 0.002", "sigma = 0.6");
    assert!(open[0].to_string().contains("edge `post`: `sigma` leaves its direction open"), "{open:?}");
    let unused = warned("to = \"B\"", "to = \"B\"\nsigma = 0.5");
    let expected =
        "object `plate`: `sigma` of edges between points has no effect in site.toml:26: 1 edge, e.g. `front`";
    assert!(unused[0].to_string().starts_with(expected), "{unused:?}");
    let parallel = warned("from = [0.0, 0.0, 1.0]", "from = [0.0, 0.5, 0.0]");
    assert!(parallel[0].to_string().contains("all edges are parallel"));
}

/// A face contains its edge. A normal may be as far from the right angle to it as visibility tolerates, and farther by
/// four standard deviations of the edge's direction.
#[test]
fn a_face_normal_is_at_right_angles_to_its_edge_within_its_tolerance() {
    let accepts = |cosine: f64, sigma: f64| {
        let normal = format!("[{}, {cosine}, 0.0]", -(1.0 - cosine * cosine).sqrt());
        let text = with_edges().replacen("[-1.0, 0.0, 0.0]", &normal, 1).replacen(
            "sigma = 0.001",
            &format!("sigma = {sigma}"),
            1,
        );
        parse(&text).is_ok()
    };
    for (cosine, sigma, expected) in
        [(0.099, 0.0, true), (0.101, 0.0, false), (-0.101, 0.0, false), (0.17, 0.02, true), (0.19, 0.02, false)]
    {
        assert_eq!(accepts(cosine, sigma), expected, "{cosine}, {sigma} m");
    }
}

/// Fails if each object with edges repeats the fault of the file's format.
#[test]
fn a_wrong_format_is_one_fault_whatever_the_number_of_objects() {
    let edge = "[[object.edge]]\nid = \"e\"\nfrom = \"A\"\nto = \"D\"\n";
    let text = format!("{}{edge}", with_edges().replace("/1.1", "/1"));
    let faults = parse(&text).unwrap_err();
    let line = faults[0].to_string();
    assert!(line.starts_with("object `plate`: edge `front` in a file of another format in site.toml:2: "), "{line}");
    assert_eq!(faults.len(), 1, "{faults:?}");
}
