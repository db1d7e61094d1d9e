//! Validation of a geometry, which reports all faults at once.

use std::path::Path;

use nalgebra::Vector3;
use seafix_component::{Fault, Places, nearest};
use seafix_referencing::Site;

use super::plan::{Geometry, ObjectGeometry};

/// Minimum area of a face (m²).
const MIN_AREA: f64 = 1e-10;
/// Maximum distance of a panel's corners from its plane (m).
const FLAT: f64 = 1e-4;
/// Maximum number of triangles of a mesh.
const MAX_TRIANGLES: usize = 2_000_000;

struct Checker<'a> {
    places: Places<'a>,
    file: &'a Path,
    faults: Vec<Fault>,
}

impl Checker<'_> {
    fn fault(&mut self, what: String, path: &[&str], value: String, remedy: &str) {
        let line = self.places.line(path);
        self.faults.push(Fault::new(what, self.file).on_line(line).value(value).remedy(remedy));
    }

    /// Whether all numbers are finite; reports a fault otherwise.
    fn finite(&mut self, of: &str, values: &[f64], path: &[&str]) -> bool {
        let fine = values.iter().all(|x| x.is_finite());
        if !fine {
            self.fault(format!("{of}: a number that is not finite"), path, format!("{values:?}"), "give metres");
        }
        fine
    }

    fn within(&mut self, of: &str, value: f64, range: [f64; 2], path: &[&str], remedy: &str) {
        if !(value >= range[0] && value <= range[1]) {
            self.fault(of.to_owned(), path, value.to_string(), remedy);
        }
    }
}

/// All faults of `geometry`, whose text is `text`, against `site`.
pub(super) fn faults(geometry: &Geometry, site: &Site, text: &str, file: &Path) -> Vec<Fault> {
    let mut check = Checker { places: Places::of(text), file, faults: Vec::new() };
    check.within("depth of the seabed", geometry.seabed.depth, [-1e5, 1e5], &["bed", "depth"], "give metres");
    check.within(
        "relief of the seabed",
        geometry.seabed.relief,
        [0.0, 3.0],
        &["bed", "relief"],
        "give a scale from 0 to 3",
    );
    check.within(
        "albedo of the seabed",
        geometry.seabed.albedo,
        [0.0, 1.0],
        &["bed", "albedo"],
        "give a fraction from 0 to 1",
    );
    check.within(
        "rocks",
        geometry.seabed.rocks as f64,
        [0.0, 1000.0],
        &["bed", "rocks"],
        "give at most 1000 rocks for an object",
    );
    for (i, material) in geometry.materials.iter().enumerate() {
        let path = ["material", &i.to_string(), "albedo"];
        check.within("albedo of a material", material.albedo, [0.0, 1.0], &path, "give a fraction from 0 to 1");
    }
    for (i, object) in geometry.objects.iter().enumerate() {
        if site.object(&object.id).is_none() {
            let ids: Vec<&str> = site.objects.iter().map(|o| o.id.as_str()).collect();
            let remedy = nearest(&object.id, ids.iter().copied())
                .map_or_else(|| format!("give one of {}", ids.join(", ")), |near| format!("did you mean `{near}`?"));
            let what = "bodies of an object that the site does not have".to_owned();
            check.fault(what, &["object", &i.to_string(), "id"], format!("`{}`", object.id), &remedy);
        }
        check_object(&mut check, geometry, object, &i.to_string());
    }
    for object in site.objects.iter().filter(|o| o.world_from_object.is_none()) {
        let what = format!("no pose of object `{}`", object.id);
        check.faults.push(Fault::new(what, file).remedy("give `base_in_world` in the site file"));
    }
    check.faults
}

fn check_object(check: &mut Checker<'_>, geometry: &Geometry, object: &ObjectGeometry, number: &str) {
    let place = |list: &'static str, k: usize, key: &'static str| {
        ["object".to_owned(), number.to_owned(), list.to_owned(), k.to_string(), key.to_owned()]
    };
    macro_rules! path {
        ($list:expr, $k:expr, $key:expr) => {
            &place($list, $k, $key).each_ref().map(String::as_str)
        };
    }
    let named = |check: &mut Checker<'_>, material: &str, list, k| {
        if geometry.materials.iter().all(|m| m.name != material) {
            let names: Vec<&str> = geometry.materials.iter().map(|m| m.name.as_str()).collect();
            let remedy = format!("give one of {}", names.join(", "));
            check.fault("an unknown material".to_owned(), path!(list, k, "material"), format!("`{material}`"), &remedy);
        }
    };
    for (k, body) in object.boxes.iter().enumerate() {
        named(check, &body.material, "box", k);
        let of = format!("box {k} of `{}`", object.id);
        let all = [body.centre, body.size, body.turn_deg].concat();
        if check.finite(&of, &all, path!("box", k, "centre")) && !body.size.iter().all(|s| *s > 1e-4 && *s < 1e4) {
            check.fault(
                format!("{of} has no volume"),
                path!("box", k, "size"),
                format!("{:?}", body.size),
                "give metres",
            );
        }
    }
    for (k, body) in object.cylinders.iter().enumerate() {
        named(check, &body.material, "cylinder", k);
        let of = format!("cylinder {k} of `{}`", object.id);
        if check.finite(&of, &[&body.from[..], &body.to, &[body.radius]].concat(), path!("cylinder", k, "from")) {
            let length = (Vector3::from(body.to) - Vector3::from(body.from)).norm();
            if !(length > 1e-4 && body.radius > 1e-4) {
                let value = format!("length {length}, radius {}", body.radius);
                check.fault(format!("{of} has no volume"), path!("cylinder", k, "radius"), value, "give metres");
            }
        }
    }
    for (k, body) in object.panels.iter().enumerate() {
        named(check, &body.material, "panel", k);
        let of = format!("panel {k} of `{}`", object.id);
        if check.finite(&of, &body.outline.concat(), path!("panel", k, "outline")) {
            outline(check, &of, &body.outline, path!("panel", k, "outline"));
        }
    }
    for (k, body) in object.chequers.iter().enumerate() {
        named(check, &body.material, "chequer", k);
        let of = format!("chequer {k} of `{}`", object.id);
        if check.finite(&of, &[body.corner, body.along, body.across].concat(), path!("chequer", k, "corner")) {
            let area = Vector3::from(body.along).cross(&Vector3::from(body.across)).norm();
            if !(area > MIN_AREA) || !body.cells.iter().all(|n| (1..=1000).contains(n)) {
                let value = format!("{area} m², {:?} squares", body.cells);
                check.fault(
                    format!("{of} has no area"),
                    path!("chequer", k, "cells"),
                    value,
                    "give 1 to 1000 squares a side",
                );
            }
        }
    }
    for (k, body) in object.meshes.iter().enumerate() {
        named(check, &body.material, "mesh", k);
        let of = format!("mesh {k} of `{}`", object.id);
        if body.triangles.len() > MAX_TRIANGLES {
            let value = format!("{} triangles", body.triangles.len());
            check.fault(format!("{of} is too large"), path!("mesh", k, "triangles"), value, "give at most 2000000");
            continue;
        }
        if let Some(bad) = body.vertices.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
            let value = format!("vertex {bad} is {:?}", body.vertices[bad]);
            check.fault(
                format!("{of}: a number that is not finite"),
                path!("mesh", k, "vertices"),
                value,
                "give metres",
            );
            continue;
        }
        for (t, triangle) in body.triangles.iter().enumerate() {
            let at = triangle.map(|i| body.vertices.get(i).map(|v| Vector3::from(*v)));
            let fault = match at {
                [Some(a), Some(b), Some(c)] if (b - a).cross(&(c - a)).norm() * 0.5 > MIN_AREA => continue,
                [Some(_), Some(_), Some(_)] => "a triangle without area",
                _ => "a triangle with an unknown vertex",
            };
            let value = format!("triangle {t} is {triangle:?}");
            check.fault(format!("{of}: {fault}"), path!("mesh", k, "triangles"), value, "remove or correct it");
            break; // one fault for each mesh: a broken export has thousands
        }
    }
}

/// Checks that a polygon is flat, convex and has an area.
fn outline(check: &mut Checker<'_>, of: &str, outline: &[[f64; 3]], path: &[&str]) {
    let at: Vec<Vector3<f64>> = outline.iter().map(|p| Vector3::from(*p)).collect();
    let n = at.len();
    let normal: Vector3<f64> = (0..n).map(|k| at[k].cross(&at[(k + 1) % n])).sum();
    if n < 3 || !(normal.norm() * 0.5 > MIN_AREA) {
        return check.fault(format!("{of} has no area"), path, format!("{n} corners"), "give three corners or more");
    }
    let normal = normal.normalize();
    let off = at.iter().map(|p| (p - at[0]).dot(&normal).abs()).fold(0.0, f64::max);
    let turns = |k: usize| (at[(k + 1) % n] - at[k]).cross(&(at[(k + 2) % n] - at[(k + 1) % n])).dot(&normal);
    if off > FLAT {
        check.fault(
            format!("{of} is not flat"),
            path,
            format!("{off:.2e} m off its plane"),
            "give corners of one plane",
        );
    } else if !(0..n).all(|k| turns(k) > -1e-12) {
        check.fault(format!("{of} is not convex"), path, format!("{n} corners"), "divide it into convex ones");
    }
}
