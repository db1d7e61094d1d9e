use std::path::Path;

use super::*;

fn scene(plan: &SitePlan, changes: &Changes) -> Scene {
    Scene::new(plan, changes, SurveyErrors { model: 0.0, survey: 0.0 }, 3)
}

/// The distance from each feature point to the nearest vertex of a body.
fn gaps(scene: &Scene) -> Vec<f64> {
    let corners: Vec<_> = scene.mesh.triangles.iter().flat_map(|t| t.at).collect();
    let gap = |p: &ScenePoint| corners.iter().map(|c| (c - p.at).norm()).fold(f64::INFINITY, f64::min);
    scene.objects.iter().flat_map(|o| &o.points).map(gap).collect()
}

#[test]
fn built_in_sites_match_their_descriptions() {
    let paper = built_in("drill-centre").unwrap();
    assert_eq!(paper.site.objects.len(), 7);
    assert_eq!(paper.site.objects.iter().map(|o| o.points.len()).sum::<usize>(), 50);
    let laboratory = built_in("karmin2").unwrap();
    assert_eq!(laboratory.site.objects[0].points.len(), 48);
    assert_eq!(laboratory.geometry.objects[0].boxes.len(), 6);
    assert!(built_in("atlantis").is_none());
    for (name, _) in BUILT_IN {
        let plan = built_in(name).unwrap();
        assert!(plan.site.warnings.is_empty(), "{:?}", plan.site.warnings);
        for gap in gaps(&scene(&plan, &Changes::default())) {
            assert!(gap < 3e-6, "{name}: a feature point {gap} m beside its body");
        }
    }
}

#[test]
fn the_papers_site_is_the_blueprint_dressed() {
    let plan = built_in("drill-centre").unwrap();
    let scene = scene(&plan, &Changes::default());
    let virtual_site = crate::virtual_scene::VirtualScene::new(&crate::blueprint::Blueprint::drill_centre(), 3);
    for (object, body) in scene.objects.iter().zip(&virtual_site.bodies) {
        for (point, corner) in object.points.iter().zip(&body.points) {
            assert!((point.at - corner.at).norm() < 3e-6);
        }
    }
    // Heights stay below 1.5 m, so that a vehicle 2 m above the seabed passes.
    assert!(scene.mesh.triangles.iter().flat_map(|t| t.at).all(|p| p.z > 38.5));
}

#[test]
fn feature_points_are_seen_from_above() {
    for plan in [built_in("drill-centre").unwrap(), RandomSite::default().plan()] {
        let scene = scene(&plan, &Changes::default());
        for (object, described) in scene.objects.iter().zip(&plan.site.objects) {
            let seen = |p: &&ScenePoint| scene.sees(&(p.at - Vector3::new(0.0, 0.0, 3.0)), p);
            assert_eq!(object.points.iter().filter(seen).count(), object.points.len(), "{}", described.id);
        }
    }
}

#[test]
fn random_sites_are_sites() {
    for number in 0..6 {
        let plan = RandomSite { number, objects: 4, ..RandomSite::default() }.plan();
        assert_eq!(plan.faults(), []);
        let (site, geometry) = (plan.site.to_toml(), plan.geometry.to_toml());
        let read = SitePlan::parse((&site, Path::new("s")), (&geometry, Path::new("g"))).unwrap();
        assert_eq!(read.site.objects.len(), 4);
        assert!(plan.site.objects.iter().all(|o| o.points.len() == 7));
        assert!(gaps(&scene(&plan, &Changes::default())).iter().all(|gap| *gap < 1e-9));
        let other = RandomSite { number: number + 100, objects: 4, ..RandomSite::default() }.plan();
        assert_ne!(plan.site, other.site);
    }
}

#[test]
fn changes_of_nothing_change_nothing_and_survey_keeps_what_was() {
    let plan = built_in("drill-centre").unwrap();
    let as_built = scene(&plan, &Changes::default());
    let moved = scene(&plan, &Changes { shift: 0.4, objects: vec!["plet".into()], ..Changes::default() });
    assert_eq!(moved.nominal, as_built.nominal);
    for (k, object) in plan.site.objects.iter().enumerate() {
        let step = (moved.world_from_object[k].translation() - as_built.world_from_object[k].translation()).norm();
        let expected = if object.id == "plet" { 0.4 } else { 0.0 };
        assert!((step - expected).abs() < 1e-9);
        // The true pose carries the nominal points onto the displaced bodies.
        for (nominal, point) in moved.nominal.objects[k].points.iter().zip(&moved.objects[k].points) {
            assert!(((moved.world_from_object[k] * nominal.at).coords - point.at).norm() < 5e-6);
        }
    }
}

#[test]
fn silt_lies_on_the_seabed_and_hides_what_is_low() {
    let plan = built_in("drill-centre").unwrap();
    let silted = scene(&plan, &Changes { silt: 0.15, ..Changes::default() });
    let clean = scene(&plan, &Changes::default());
    let at = clean.objects[2].centroid();
    assert!((clean.seabed.down(at.x, at.y) - silted.seabed.down(at.x, at.y) - 0.15).abs() < 1e-9);
    assert!((clean.seabed.down(at.x + 40.0, at.y + 40.0) - silted.seabed.down(at.x + 40.0, at.y + 40.0)).abs() < 1e-12);
    let (from, along) = (at - Vector3::new(1.0, 0.5, 3.0), Vector3::new(0.1, 0.05, 1.0));
    let t = silted.seabed.hit(&from, &along).unwrap();
    let place = from + along * t;
    assert!((silted.seabed.down(place.x, place.y) - place.z).abs() < 1e-9);
}

#[test]
fn what_is_wrong_with_a_geometry_is_stated_in_one_line_each() {
    let plan = built_in("drill-centre").unwrap();
    let text = |change: &dyn Fn(&mut Geometry)| {
        let mut geometry = plan.geometry.clone();
        change(&mut geometry);
        let text = geometry.to_toml();
        let faults = SitePlan::parse((&plan.site.to_toml(), Path::new("s.toml")), (&text, Path::new("g.toml")));
        faults.unwrap_err().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let mesh = |vertices: Vec<[f64; 3]>, triangles| MeshBody { vertices, triangles, material: "grey".into() };
    let triangle = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let one = |lines: Vec<String>, part: &str| {
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(lines[0].contains(part) && lines[0].contains("g.toml:"), "{} lacks {part}", lines[0]);
        assert!(!lines[0].contains('\n'));
    };
    one(text(&|g| g.objects[0].meshes.push(mesh(vec![[0.0; 3]; 3], vec![[0, 1, 2]]))), "a triangle without area");
    one(text(&|g| g.objects[0].meshes.push(mesh(triangle.clone(), vec![[0, 1, 7]]))), "unknown vertex");
    one(text(&|g| g.objects[0].meshes.push(mesh(vec![[f64::NAN; 3]; 3], vec![[0, 1, 2]]))), "not finite");
    one(text(&|g| g.objects[0].boxes[1].size[2] = 0.0), "has no volume");
    one(text(&|g| g.objects[0].boxes[1].material = "yelow".into()), "unknown material");
    one(text(&|g| g.objects[0].panels[0].outline[0][2] += 0.1), "not flat");
    one(text(&|g| g.objects[0].id = "tree-x".into()), "did you mean `tree-");
    one(text(&|g| g.seabed.albedo = 1.5), "albedo of the seabed");
    one(text(&|g| g.objects[1].cylinders[0].radius = -0.1), "has no volume");
}
