//! Inspections over the built-in sites.

use std::path::Path;

use nalgebra::Vector3;
use seafix_geometry::{Point, World};
use seafix_referencing::Shell;

use super::*;
use crate::{
    field::BUILT_IN,
    vehicle::{Route, RouteKind, Vehicle, VehicleKind},
};

fn mission(site: &str, route: Route) -> Mission {
    let vehicle = Vehicle { kind: VehicleKind::Rail, ..Vehicle::default() };
    let route = Route { kind: RouteKind::Inspection, ..route };
    let rig = RigPlan { size: [256, 192], focal: 125.0, ..RigPlan::default() };
    Mission {
        site: site.to_owned(),
        rate: 0.0,
        survey_sigma: 0.0,
        model_sigma: 0.0,
        rig,
        route,
        vehicle,
        ..Mission::default()
    }
}

fn planned(mission: &Mission) -> PlannedMission {
    mission.plan(3, 0, Path::new("")).unwrap()
}

/// Every point of interest of every built-in site is looked at, at rest, from the stand-off, in both images and with nothing
/// between; on the whole way every camera keeps clear of the shells.
///
/// Seen to fail when views out of the images count, and when a corner of a leg is not rested at.
#[test]
fn every_point_is_looked_at_and_no_shell_is_touched() {
    for (site, _) in BUILT_IN {
        let route = Route { altitude: if site == "karmin2" { 2.5 } else { 3.5 }, ..Route::default() };
        let plan = planned(&mission(site, route.clone()));
        let last = plan.times[plan.times.len() - 1];
        let shells: Vec<_> = plan
            .field
            .objects
            .iter()
            .map(|object| Shell::<World>::around(object.points.iter().map(|point| Point::from(point.at))).unwrap())
            .collect();
        // The planner looks every 0.1 m: between two such places a straight way comes nearer by the sagitta at most.
        let clearance = route.clearance - 0.1 * 0.1 / 8.0 / route.clearance;
        let right = plan.rig().right_from_left().inverse().translation();
        let mut cameras = Vec::new();
        for k in 0..=(last / 0.05) as usize {
            let time = k as f64 * 0.05;
            let camera = plan.camera(time);
            for eye in [Vector3::zeros(), right] {
                let at = Point::from(camera.rotation() * eye + camera.translation());
                assert!(!shells.iter().any(|s| s.grown_contains(&at, clearance)), "{site} {time}: {at:?}");
            }
            cameras.push(camera);
        }
        let mut points = 0;
        for (object, pose) in plan.site().objects.iter().zip(plan.world_from_object()) {
            for interest in &object.interest {
                points += 1;
                let at = *pose * interest.at;
                let seen = cameras.iter().filter(|camera| {
                    let seen = camera.inverse() * at;
                    let to = at.coords + (camera.translation() - at.coords).normalize() * 0.02;
                    (seen.coords.norm() - route.stand_off).abs() < 1e-9
                        && plan.rig().sees(&seen, 0.0).is_some()
                        && plan.field.clear(&camera.translation(), &to)
                });
                // Looks are 0.05 s apart: one at either end may be missing.
                let seen = seen.count() as f64 * 0.05;
                assert!(seen >= route.hold - 0.1, "{site}: {}/{} for {seen} s", object.id, interest.id);
            }
        }
        assert!(points >= 8, "{site}: {points}");
    }
}

/// What cannot be looked at is refused with its place and a remedy; so is a site or an object without points of interest.
#[test]
fn what_cannot_be_looked_at_is_refused() {
    let said = |mission: &Mission| mission.plan(3, 0, Path::new("")).unwrap_err()[0].to_string();
    let far = said(&mission("drill-centre", Route { clearance: 3.0, ..Route::default() }));
    assert!(far.contains("no clear view of `tree-a/valve-1` at north "), "{far}");
    assert!(
        far.contains("change route.stand-off, route.clearance or rig.ahead-deg") && far.lines().count() == 1,
        "{far}"
    );
    let none = said(&mission("random", Route::default()));
    assert!(none.contains("the site has no point to inspect"), "{none}");
    let unknown = said(&mission("drill-centre", Route { object: "tree-z".into(), ..Route::default() }));
    assert!(unknown.contains("route.object = `tree-z`; give one of "), "{unknown}");
    // One object alone is a shorter way.
    let whole = planned(&mission("drill-centre", Route::default()));
    let one = planned(&mission("drill-centre", Route { object: "plet".into(), ..Route::default() }));
    assert!(one.times.last() < whole.times.last());
}
