//! The validation of a site, with all faults at once.

use std::{collections::HashMap, path::Path};

use nalgebra::Vector3;
use seafix_component::{Fault, Places, counted, nearest};
use seafix_geometry::{Object, Point, World, triad};

use super::{
    check_edges,
    file::{AXES, ObjectFile, SiteFile},
    model::{Interest, ModelPoint, Site, SiteObject},
    target::diameter,
};

/// The distance (m) below which two feature points coincide.
pub(crate) const COINCIDENT: f64 = 1e-6;
/// The sine of the angle at P1 below which the base defines no frame.
const COLLINEAR: f64 = 1e-3;
/// The sine of the angle at P1 below which the base defines its frame poorly.
const NEARLY_COLLINEAR: f64 = 0.1;
/// The tolerance (m) of base coordinates in the Fig. 2 rule.
const RULE: f64 = 1e-6;
/// The range of plausible diameters (m), and the range of possible ones.
///
/// Millimetres or kilometres are suspected outside of the first.
pub(crate) const SUSPICIOUS: [f64; 2] = [0.01, 1e3];
pub(super) const IMPOSSIBLE: [f64; 2] = [1e-4, 1e5];
/// The allowed difference of two statements on the same quantity, such as surveyed and model distances, in standard
/// deviations.
pub(super) const SIGMAS: f64 = 4.0;

/// The collected faults and warnings, with the places of the text for their line numbers.
pub(super) struct Checker<'a> {
    places: Places<'a>,
    file: &'a Path,
    pub(super) faults: Vec<Fault>,
    pub(super) warnings: Vec<Fault>,
}

impl Checker<'_> {
    pub(super) fn at(&self, what: impl Into<String>, path: &[&str]) -> Fault {
        Fault::new(what, self.file).on_line(self.places.line(path))
    }

    pub(super) fn fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    /// Adds a fault unless the coordinates are finite.
    pub(super) fn finite(&mut self, what: &str, values: &[f64], path: &[&str]) {
        if !values.iter().all(|value| value.is_finite()) {
            let fault = self.at(format!("{what} is not finite"), path).value(format!("{values:?}"));
            self.fault(fault.remedy("give finite numbers, in metres"));
        }
    }

    /// Adds a fault unless the direction is finite and nonzero.
    fn direction(&mut self, what: &str, normal: &[f64; 3], path: &[&str]) {
        self.finite(what, normal, path);
        if Vector3::from(*normal).norm() < 1e-9 {
            let fault = self.at(format!("{what} is a zero vector"), path).value(format!("{normal:?}"));
            self.fault(fault.remedy("give the direction from which the point is visible, or omit the key"));
        }
    }

    pub(super) fn sigma(&mut self, what: &str, value: f64, path: &[&str]) {
        if !(value >= 0.0 && value.is_finite()) {
            let fault = self.at(format!("{what} is not a standard deviation"), path).value(value);
            self.fault(fault.remedy("give a finite number of metres, zero or more"));
        }
    }

    /// Adds a fault for every empty or repeated identifier.
    pub(super) fn unique<'i>(
        &mut self,
        kind: &str,
        ids: impl Iterator<Item = &'i str>,
        path: impl Fn(&str) -> Vec<String>,
    ) {
        let mut seen: HashMap<&str, usize> = HashMap::new();
        for (index, id) in ids.enumerate() {
            let line = |index: usize| {
                let path = path(&index.to_string());
                self.places.line(&path.iter().map(String::as_str).collect::<Vec<_>>())
            };
            let fault = |what: &str| {
                Fault::new(format!("{kind} id {what}"), self.file).on_line(line(index)).value(format!("`{id}`"))
            };
            if id.is_empty() {
                self.faults.push(fault("is empty").remedy("give a name"));
            } else if let Some(first) = seen.insert(id, index) {
                let first = line(first).map_or(String::new(), |line| format!(" on line {line}"));
                let remedy = format!("it is already used{first}; choose another id");
                self.faults.push(fault("is used twice").remedy(remedy));
            }
        }
    }
}

/// The site of the file, or all its faults.
pub(super) fn site(raw: &SiteFile, text: &str, file: &Path) -> Result<Site, Vec<Fault>> {
    let mut check = Checker { places: Places::of(text), file, faults: Vec::new(), warnings: Vec::new() };
    if raw.axes != AXES {
        let fault = check.at("unknown axes rule", &["axes"]).value(format!("`{}`", raw.axes));
        check.fault(fault.remedy(format!("this reader supports `{AXES}`")));
    }
    if raw.objects.is_empty() {
        let fault = check.at("site without objects", &[]).value("0 objects");
        check.fault(fault.remedy("add an [[object]]"));
    }
    check.unique("object", raw.objects.iter().map(|object| object.id.as_str()), |index| {
        ["object", index, "id"].map(str::to_owned).to_vec()
    });
    let ids = || raw.objects.iter().map(|object| object.id.as_str());
    let frame = ids().position(|id| id == raw.site_frame);
    if frame.is_none() && !raw.objects.is_empty() {
        let fault = check.at("unknown object in `site_frame`", &["site_frame"]).value(format!("`{}`", raw.site_frame));
        check.fault(fault.remedy(suggestion(&raw.site_frame, ids())));
    }
    check_edges::format(&mut check, raw);
    let objects: Vec<_> =
        raw.objects.iter().enumerate().map(|(index, object)| check_object(&mut check, object, index)).collect();
    match (objects.into_iter().collect::<Option<Vec<_>>>(), frame) {
        (Some(objects), Some(frame)) if check.faults.is_empty() => {
            Ok(Site { name: raw.name.clone(), frame, objects, warnings: check.warnings })
        }
        _ => Err(check.faults),
    }
}

pub(super) fn suggestion<'a>(word: &str, options: impl Iterator<Item = &'a str> + Clone) -> String {
    match nearest(word, options.clone()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("there are {}", options.collect::<Vec<_>>().join(", ")),
    }
}

/// The object, or `None` after a fault that makes it unusable.
fn check_object(check: &mut Checker<'_>, raw: &ObjectFile, index: usize) -> Option<SiteObject> {
    let before = check.faults.len();
    let number = index.to_string();
    let of = format!("object `{}`", raw.id);
    numbers(check, raw, &of, &number);
    let key = |last: &'static str| vec!["object".to_owned(), number.clone(), last.to_owned()];
    let item = |list: &'static str| {
        let key = key(list);
        move |item: &str| [&key[..], &[item.to_owned(), "id".to_owned()]].concat()
    };
    check.unique(&format!("{of}: point"), raw.points.iter().map(|point| point.id.as_str()), item("point"));
    check.unique(&format!("{of}: interest"), raw.interest.iter().map(|point| point.id.as_str()), item("interest"));
    if raw.points.len() < 3 {
        let fault = check.at(format!("{of} has too few points"), &["object", &number]);
        check.fault(fault.value(counted(raw.points.len(), "point")).remedy("a pose needs at least three"));
    }
    let mut base = Vec::new();
    for name in &raw.base {
        let found = raw.points.iter().position(|point| point.id == *name);
        if found.is_none() {
            let fault = check.at(format!("{of}: unknown point in `base`"), &["object", &number, "base"]);
            let ids = raw.points.iter().map(|point| point.id.as_str());
            check.fault(fault.value(format!("`{name}`")).remedy(suggestion(name, ids)));
        }
        base.extend(found);
    }
    if check.faults.len() > before {
        return None; // geometry tests of invalid numbers or names would only repeat the faults
    }
    let base: [usize; 3] = base.try_into().expect("each of the three names was found");
    let points: Vec<ModelPoint> = raw
        .points
        .iter()
        .map(|point| ModelPoint {
            id: point.id.clone(),
            at: Point::from(point.at),
            sigma: point.sigma,
            normal: point.normal.map(|normal| unit(Vector3::from(normal))),
        })
        .collect();
    spread(check, &points, &of, &number);
    frame_rule(check, &base.map(|i| points[i].at), &of, &number);
    let edges = check_edges::edges(check, raw, &points, &of, &number);
    let base_in_world = raw.base_in_world.map(|base| base.map(Point::<World>::from));
    if let Some(world) = &base_in_world {
        survey(check, world, &base.map(|i| &points[i]), raw.survey_sigma, &of, &number);
    }
    let world_from_object = base_in_world.and_then(|[p1, p2, p3]| triad(&p1, &p2, &p3).ok());
    (check.faults.len() == before).then(|| SiteObject {
        id: raw.id.clone(),
        base,
        base_in_world,
        survey_sigma: raw.survey_sigma,
        world_from_object,
        points,
        edges,
        interest: raw
            .interest
            .iter()
            .map(|interest| Interest {
                id: interest.id.clone(),
                at: Point::from(interest.at),
                normal: interest.normal.map(|normal| unit(Vector3::from(normal))),
            })
            .collect(),
    })
}

/// The unit vector; a vector that is already one stays unchanged to the last bit, so that a file read and written stays
/// the same.
fn unit(v: Vector3<f64>) -> Vector3<f64> {
    if (v.norm() - 1.0).abs() <= 1e-12 { v } else { v.normalize() }
}

/// B1: finite numbers and valid standard deviations.
fn numbers(check: &mut Checker<'_>, raw: &ObjectFile, of: &str, number: &str) {
    check.sigma(&format!("{of}: `survey_sigma`"), raw.survey_sigma, &["object", number, "survey_sigma"]);
    for row in raw.base_in_world.iter().flatten() {
        check.finite(&format!("{of}: `base_in_world`"), row, &["object", number, "base_in_world"]);
    }
    for (i, point) in raw.points.iter().enumerate() {
        let (i, name) = (i.to_string(), format!("{of}, point `{}`", point.id));
        check.finite(&format!("{name}: `at`"), &point.at, &["object", number, "point", &i, "at"]);
        check.sigma(&format!("{name}: `sigma`"), point.sigma, &["object", number, "point", &i, "sigma"]);
        if let Some(normal) = point.normal {
            check.direction(&format!("{name}: `normal`"), &normal, &["object", number, "point", &i, "normal"]);
        }
    }
    for (i, interest) in raw.interest.iter().enumerate() {
        let (i, name) = (i.to_string(), format!("{of}, interest `{}`", interest.id));
        check.finite(&format!("{name}: `at`"), &interest.at, &["object", number, "interest", &i, "at"]);
        if let Some(normal) = interest.normal {
            check.direction(&format!("{name}: `normal`"), &normal, &["object", number, "interest", &i, "normal"]);
        }
    }
}

/// B4 and B7: distinct points, and coordinates in metres.
fn spread(check: &mut Checker<'_>, points: &[ModelPoint], of: &str, number: &str) {
    for (i, a) in points.iter().enumerate() {
        for b in points[..i].iter().filter(|b| a.at.distance(&b.at) < COINCIDENT) {
            let fault = check.at(format!("{of}: coincident points"), &["object", number, "point", &i.to_string()]);
            check.fault(fault.value(format!("`{}` and `{}`", b.id, a.id)).remedy("remove one"));
        }
    }
    let extent = diameter(points);
    if (SUSPICIOUS[0]..=SUSPICIOUS[1]).contains(&extent) {
        return;
    }
    let fault = check
        .at(format!("{of}: implausible units"), &["object", number])
        .value(format!("the diameter of its points is {} m", seafix_component::number(extent)))
        .remedy("give coordinates in metres");
    if (IMPOSSIBLE[0]..=IMPOSSIBLE[1]).contains(&extent) {
        check.warnings.push(fault);
    } else {
        check.fault(fault);
    }
}

/// B3: a base that is not collinear and obeys the rule of axes.
fn frame_rule(check: &mut Checker<'_>, base: &[Point<Object>; 3], of: &str, number: &str) {
    let [p1, p2, p3] = base.map(|p| p.coords);
    let (a, b) = (p2 - p1, p3 - p1);
    let sine = a.cross(&b).norm() / (a.norm() * b.norm());
    let path = ["object", number, "base"];
    if !(sine >= COLLINEAR) {
        let fault = check.at(format!("{of}: collinear base"), &path);
        check.fault(fault.value(format!("sine {sine:.2e} at P1")).remedy("choose three points that span a plane"));
        return;
    }
    if sine < NEARLY_COLLINEAR {
        let fault = check.at(format!("{of}: nearly collinear base"), &path);
        check
            .warnings
            .push(fault.value(format!("sine {sine:.3} at P1")).remedy("choose points that span a wider angle"));
    }
    let obeys = p1.norm() <= RULE && p3.y.abs() <= RULE && p3.z.abs() <= RULE && p3.x > 0.0 && p2.z.abs() <= RULE;
    if !(obeys && p2.y < 0.0) {
        // The remedy states the coordinates of P2 and P3 in the frame of the rule.
        let d = b.norm();
        let (along, across) = (a.dot(&b) / d, a.cross(&b).norm() / d);
        let fault = check.at(format!("{of}: the base violates the axes rule"), &path);
        check.fault(
            fault.value(format!("P1 {:?}, P2 {:?}, P3 {:?}", p1.as_slice(), p2.as_slice(), p3.as_slice())).remedy(format!(
                "transform all points of the object into the frame with P1 = [0, 0, 0], P2 = [{along}, {}, 0], P3 = \
                 [{d}, 0, 0]",
                -across
            )),
        );
    }
}

/// Adds a fault if surveyed and model distances of the base disagree.
fn survey(
    check: &mut Checker<'_>,
    world: &[Point<World>; 3],
    model: &[&ModelPoint; 3],
    sigma: f64,
    of: &str,
    number: &str,
) {
    for (i, k) in [(0, 1), (0, 2), (1, 2)] {
        let (surveyed, known) = (world[i].distance(&world[k]), model[i].at.distance(&model[k].at));
        let variance = 2.0 * sigma * sigma + model[i].sigma.powi(2) + model[k].sigma.powi(2);
        let allowed = SIGMAS * variance.sqrt() + RULE;
        if !((surveyed - known).abs() <= allowed) {
            let what = format!("{of}: survey and model disagree on the distance P{} P{}", i + 1, k + 1);
            let fault = check.at(what, &["object", number, "base_in_world"]);
            check.fault(
                fault
                    .value(format!("{surveyed:.4} m surveyed, {known:.4} m in the model"))
                    .remedy(format!("the tolerance is {allowed:.2e} m; correct one of them, or `survey_sigma`")),
            );
        }
    }
    if let Err(collinear) = triad::<World, Object>(&world[0], &world[1], &world[2]) {
        let fault = check.at(format!("{of}: {collinear}"), &["object", number, "base_in_world"]);
        check.fault(fault.remedy("survey three points that span a plane"));
    }
}
