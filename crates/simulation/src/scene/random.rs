//! Randomly generated sites, for studies that must not depend on one site.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use seafix_geometry::{Object, Point, Transform, World, so3, triad};
use seafix_referencing::{ModelPoint, Site, SiteObject};
use serde::{Deserialize, Serialize};

use super::{
    mesh::angles,
    plan::{
        BoxBody, CylinderBody, GEOMETRY_FORMAT, Geometry, MaterialPlan, ObjectGeometry, PanelBody, SeabedPlan, Texture,
    },
    site_plan::SitePlan,
};
use crate::stream::{Purpose, Stream};

/// Minimum distance between corners of boxes that share sides (m).
const MIN_GAP: f64 = 0.12;
/// Number of layouts of an object of which the best is taken.
const TRIALS: usize = 60;

/// A random site of slabs with boxes and painted marks.
///
/// The feature points are the corners of the boxes' upper faces and of the marks. All objects are at most 1.5 m high.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RandomSite {
    /// Number of objects, from 1 to 50.
    pub objects: usize,
    /// Number of feature points of each object, from 3 to 16.
    pub points: usize,
    /// Side of the square that holds the objects (m), up to 1000. The minimum grows with the number of objects.
    pub extent: f64,
    /// Seed of the site: equal numbers give equal sites.
    pub number: u64,
}

impl Default for RandomSite {
    fn default() -> Self {
        Self { objects: 7, points: 7, extent: 50.0, number: 0 }
    }
}

impl RandomSite {
    pub(crate) fn check(&self) -> Result<(), String> {
        in_range((1..=50).contains(&self.objects), "random.objects", self.objects, "1 to 50 objects")?;
        in_range((3..=16).contains(&self.points), "random.points", self.points, "3 to 16 points for each object")?;
        let min = 6.0 * (self.objects as f64).sqrt();
        let range = format!("{min:.0} to 1000 m for {} objects", self.objects);
        in_range(self.extent >= min && self.extent <= 1000.0, "random.extent", self.extent, &range)
    }

    /// Generates the site.
    pub fn plan(&self) -> SitePlan {
        let depth = SeabedPlan::default().depth;
        let mut stream = Stream::new(self.number, 0, 0, Purpose::Site);
        // One object at a random place in each cell of a square grid, so that objects keep apart.
        let cells = (self.objects as f64).sqrt().ceil() as usize;
        let cell = self.extent / cells as f64;
        let (mut objects, mut shapes) = (Vec::new(), Vec::new());
        for index in 0..self.objects {
            let (i, j) = (index / cells, index % cells);
            let room = cell - 5.5;
            let mut place =
                |k: usize| (k as f64 + 0.5) * cell - 0.5 * self.extent + stream.between(-0.5, 0.5) * room.max(0.0);
            let at = Vector3::new(place(i), place(j), depth);
            let lean = Vector3::new(stream.normal(), stream.normal(), 0.0) * 0.01;
            let turn = so3::exp(&lean) * so3::exp(&(Vector3::z() * stream.between(0.0, TAU)));
            let (object, shape) = self.object(index, Transform::new(turn, at), &mut stream);
            objects.push(object);
            shapes.push(shape);
        }
        let material = |name: &str, albedo, texture| MaterialPlan { name: name.to_owned(), albedo, texture };
        let name = format!("random-{}", self.number);
        SitePlan {
            given: Vec::new(),
            site: Site { name: name.clone(), frame: 0, objects, warnings: Vec::new() },
            geometry: Geometry {
                format: GEOMETRY_FORMAT.to_owned(),
                name,
                seabed: SeabedPlan::default(),
                materials: vec![
                    material("slab", 0.27, Texture::Steel),
                    material("yellow", 0.58, Texture::Paint),
                    material("black", 0.07, Texture::Paint),
                    material("orange", 0.42, Texture::Paint),
                ],
                objects: shapes,
            },
        }
    }

    /// One object, whose design frame is placed by `world_from_design`.
    ///
    /// The design frame is x forward, y starboard, z down, with its origin on the seabed.
    fn object(
        &self,
        index: usize,
        world_from_design: Transform<World, Object>,
        stream: &mut Stream,
    ) -> (SiteObject, ObjectGeometry) {
        let mut best: Option<(f64, Draft)> = None;
        for _ in 0..TRIALS {
            let draft = Draft::draw(self.points, stream);
            let worth = draft.worth();
            if best.as_ref().is_none_or(|(max, _)| worth > *max) {
                best = Some((worth, draft));
            }
        }
        let draft = best.expect("there is a first trial").1;
        let in_world: Vec<Point<World>> = draft.points.iter().map(|p| world_from_design * Point::from(*p)).collect();
        let base = widest(&in_world);
        let [p1, p2, p3] = base.map(|k| in_world[k]);
        let world_from_object = triad::<World, Object>(&p1, &p2, &p3).expect("the base is the widest of all");
        let local = world_from_object.inverse() * world_from_design.relabel::<World, Object>();
        let into = |p: Vector3<f64>| -> [f64; 3] { (local.relabel::<Object, Object>() * Point::from(p)).coords.into() };
        let id = format!("object-{}", index + 1);
        let up = local.rotation() * -Vector3::z();
        let points = (0..).zip(&in_world).map(|(k, p)| ModelPoint {
            id: format!("{}{}", char::from(b'A' + (index % 26) as u8), k + 1),
            at: if k == base[0] { Point::origin() } else { world_from_object.inverse() * *p },
            sigma: 0.0,
            normal: Some(up),
        });
        let site = SiteObject {
            id: id.clone(),
            base,
            base_in_world: Some([p1, p2, p3]),
            survey_sigma: 0.01,
            world_from_object: Some(world_from_object),
            points: points.collect(),
            edges: Vec::new(),
            interest: Vec::new(),
        };
        let turned = |yaw: f64| angles(&(local.rotation() * so3::exp(&(Vector3::z() * yaw))).to_rotation_matrix());
        let shape = ObjectGeometry {
            id,
            boxes: draft
                .boxes
                .iter()
                .enumerate()
                .map(|(k, b)| BoxBody {
                    centre: into(b.centre),
                    size: b.size.into(),
                    turn_deg: turned(b.yaw),
                    material: if k == 0 { "slab" } else { "yellow" }.to_owned(),
                })
                .collect(),
            panels: draft
                .marks
                .iter()
                .map(|mark| PanelBody { outline: mark.map(into).to_vec(), material: "black".to_owned() })
                .collect(),
            cylinders: draft.boxes[1..]
                .iter()
                .map(|b| {
                    let foot = b.centre + Vector3::new(0.0, 0.0, -0.5 * b.size.z);
                    let axis = Vector3::new(0.0, 0.0, 0.08);
                    CylinderBody {
                        from: into(foot + axis * 0.3),
                        to: into(foot - axis),
                        radius: 0.05,
                        material: "orange".to_owned(),
                    }
                })
                .collect(),
            ..ObjectGeometry::default()
        };
        (site, shape)
    }
}

/// A box of a draft, upright in the design frame.
struct DraftBox {
    centre: Vector3<f64>,
    size: Vector3<f64>,
    yaw: f64,
}

/// The boxes, marks and points of one object in its design frame, z down.
struct Draft {
    boxes: Vec<DraftBox>,
    marks: Vec<[Vector3<f64>; 3]>,
    points: Vec<Vector3<f64>>,
}

impl Draft {
    fn draw(count: usize, stream: &mut Stream) -> Self {
        let (length, width, top) = (stream.between(2.2, 3.0), stream.between(1.8, 2.4), stream.between(0.2, 0.35));
        let slab = DraftBox {
            centre: Vector3::new(0.0, 0.0, 0.1 - 0.5 * top),
            size: Vector3::new(length, width, top + 0.2),
            yaw: 0.0,
        };
        let (mut boxes, mut marks, mut corners) = (vec![slab], Vec::new(), Vec::new());
        let quarters = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let skipped = stream.below(4);
        for (k, [x, y]) in quarters.into_iter().enumerate() {
            if k == skipped {
                continue;
            }
            let size = [stream.between(0.26, 0.36) * length, stream.between(0.26, 0.36) * width];
            let height = stream.between(0.15, 0.75);
            let yaw = stream.between(-0.15, 0.15);
            let centre = Vector3::new(0.25 * x * length, 0.25 * y * width, -top - 0.5 * height + 0.02);
            let (sine, cosine) = libm::sincos(yaw);
            let on_top = |a: f64, b: f64| {
                centre + Vector3::new(cosine * a - sine * b, sine * a + cosine * b, -0.5 * height - 0.02)
            };
            boxes.push(DraftBox { centre, size: Vector3::new(size[0], size[1], height + 0.04), yaw });
            for [a, b] in quarters {
                corners.push(on_top(0.5 * a * size[0], 0.5 * b * size[1]));
            }
            // A dark triangle with three distinct corners, anticlockwise seen from above.
            let about = stream.between(0.0, TAU);
            let reach = 0.38 * size[0].min(size[1]);
            let place = |k: f64, r: f64| {
                let (s, c) = libm::sincos(about - k * TAU / 3.0);
                on_top(r * c, r * s)
            };
            let mark = [place(0.0, reach), place(1.0, reach * 0.9), place(2.0, reach * 0.75)];
            corners.extend(mark);
            marks.push(mark);
        }
        // Random corners with a minimum distance from each other.
        let mut points: Vec<Vector3<f64>> = Vec::new();
        for _ in 0..400 {
            let corner = corners[stream.below(corners.len())];
            if points.len() < count && points.iter().all(|p| (p - corner).norm() > MIN_GAP) {
                points.push(corner);
            }
        }
        Self { boxes, marks, points }
    }

    /// The discriminability of the points: the smallest difference between two of their distances.
    fn worth(&self) -> f64 {
        let n = self.points.len();
        let mut all: Vec<f64> = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| (self.points[i] - self.points[j]).norm())
            .collect();
        all.sort_by(f64::total_cmp);
        n as f64 + all.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min).min(0.9)
    }
}

/// The three points that span the largest triangle.
fn widest(points: &[Point<World>]) -> [usize; 3] {
    let mut best = (0.0, [0, 1, 2]);
    for i in 0..points.len() {
        for j in 0..i {
            for k in 0..j {
                let area = (points[j] - points[i]).cross(&(points[k] - points[i])).norm();
                if area > best.0 {
                    best = (area, [i, j, k]);
                }
            }
        }
    }
    best.1
}
