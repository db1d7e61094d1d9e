//! Conversion of bodies to triangles in the world.

use nalgebra::{Rotation3, Vector3};
use seafix_geometry::{Object, Transform, World, so3};

use super::plan::{BoxBody, ChequerBody, CylinderBody, Geometry, MaterialPlan, ObjectGeometry, Texture};
use super::rounded::rounded_box;

/// The appearance of a body's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Skin {
    pub(crate) albedo: f32,
    pub(crate) texture: Texture,
    /// Offset of the body in its texture.
    pub(crate) seed: u32,
    /// Fraction of its area that growth covers.
    pub(crate) growth: f32,
}

/// A triangle in the world, with its corners anticlockwise seen from outside.
#[derive(Debug, Clone)]
pub(crate) struct Triangle {
    pub(crate) at: [Vector3<f64>; 3],
    /// Shading normals at the corners.
    pub(crate) normals: [Vector3<f64>; 3],
    /// Texture coordinates at the corners (m).
    pub(crate) uv: [[f64; 2]; 3],
    /// Index of the skin.
    pub(crate) skin: u32,
    /// Whether side k to k + 1 is an edge of the body; otherwise it is a seam within a face.
    pub(crate) edges: [bool; 3],
    /// Layer: 1 for paint, which lies in the plane of its plate; 0 otherwise.
    pub(crate) layer: u8,
}

#[cfg(test)]
impl Triangle {
    /// The outward unit normal of the plane.
    pub(crate) fn normal(&self) -> Vector3<f64> {
        let [a, b, c] = self.at;
        (b - a).cross(&(c - a)).normalize()
    }
}

/// The triangles of all bodies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) skins: Vec<Skin>,
}

/// The wear of an object's surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Wear {
    /// Radius of the rounded edges of boxes (m).
    pub(crate) rounding: f64,
    /// Fraction of the area that growth covers.
    pub(crate) growth: f64,
}

/// Number of sides of a cylinder's cross-section.
const SIDES: usize = 20;

impl Mesh {
    /// Adds the bodies of one object.
    pub(crate) fn add(
        &mut self,
        geometry: &Geometry,
        object: &ObjectGeometry,
        pose: &Transform<World, Object>,
        wear: Wear,
        seed: u32,
    ) {
        let mut builder = Builder { mesh: self, geometry, pose, wear, seed };
        for body in &object.boxes {
            builder.a_box(body);
        }
        for body in &object.cylinders {
            builder.cylinder(body);
        }
        for body in &object.panels {
            let skin = builder.skin(&body.material);
            builder.polygon(&body.outline.iter().map(|p| Vector3::from(*p)).collect::<Vec<_>>(), skin, 1);
        }
        for body in &object.chequers {
            builder.chequer(body);
        }
        for body in &object.meshes {
            let skin = builder.skin(&body.material);
            for triangle in &body.triangles {
                let at: Vec<_> = triangle.iter().map(|&i| Vector3::from(body.vertices[i])).collect();
                builder.polygon(&at, skin, 0);
            }
        }
    }
}

struct Builder<'a> {
    mesh: &'a mut Mesh,
    geometry: &'a Geometry,
    pose: &'a Transform<World, Object>,
    wear: Wear,
    seed: u32,
}

impl Builder<'_> {
    /// Adds a skin of this material, with an offset of its own in the texture.
    fn skin(&mut self, material: &str) -> u32 {
        let plain = MaterialPlan { name: String::new(), albedo: 0.5, texture: Texture::Plain };
        let found = self.geometry.materials.iter().find(|m| m.name == material).unwrap_or(&plain);
        let number = self.mesh.skins.len() as u32;
        self.mesh.skins.push(Skin {
            albedo: found.albedo as f32,
            texture: found.texture,
            seed: crate::noise::hash(number as i32, 77, self.seed),
            growth: self.wear.growth as f32,
        });
        number
    }

    /// The world position of a point of the object's frame.
    fn world(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation() * p + self.pose.translation()
    }

    /// Adds a flat, convex face as a triangle fan; its corners are anticlockwise seen from outside.
    fn polygon(&mut self, corners: &[Vector3<f64>], skin: u32, layer: u8) {
        let at: Vec<Vector3<f64>> = corners.iter().map(|p| self.world(p)).collect();
        let n = at.len();
        let area: Vector3<f64> = (0..n).map(|k| (at[k] - at[0]).cross(&(at[(k + 1) % n] - at[0]))).sum();
        let normal = area.normalize();
        let x = (at[1] - at[0]).normalize();
        let y = normal.cross(&x);
        let uv = |p: &Vector3<f64>| [x.dot(&(p - at[0])), y.dot(&(p - at[0]))];
        for k in 1..n - 1 {
            self.mesh.triangles.push(Triangle {
                at: [at[0], at[k], at[k + 1]],
                normals: [normal; 3],
                uv: [uv(&at[0]), uv(&at[k]), uv(&at[k + 1])],
                skin,
                edges: [k == 1, true, k == n - 2],
                layer,
            });
        }
    }

    fn a_box(&mut self, body: &BoxBody) {
        let skin = self.skin(&body.material);
        let turn = turn(body.turn_deg);
        let (centre, half) = (Vector3::from(body.centre), Vector3::from(body.size) * 0.5);
        let radius = self.wear.rounding.min(0.45 * 2.0 * half.min());
        if radius > 0.0 {
            for (at, normals, edges) in rounded_box(half, radius) {
                self.smooth(at.map(|p| centre + turn * p), normals.map(|n| turn * n), edges, skin);
            }
            return;
        }
        let corner = |x: f64, y: f64, z: f64| centre + turn * Vector3::new(x * half.x, y * half.y, z * half.z);
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let ring = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]: [f64; 2]| {
                    // (axis, axis + 1, axis + 2) is right-handed: the ring is anticlockwise about +axis.
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, side * a, b);
                    corner(p[0], p[1], p[2])
                });
                self.polygon(&ring, skin, 0);
            }
        }
    }

    /// Adds a triangle of a curved surface, given in the object's frame.
    fn smooth(&mut self, at: [Vector3<f64>; 3], normals: [Vector3<f64>; 3], edges: [bool; 3], skin: u32) {
        let normals = normals.map(|n| self.pose.rotation() * n);
        let at = at.map(|p| self.world(&p));
        // Planar texture mapping onto the plane that the mean normal faces most, which leaves no seam in a triangle.
        let mean = normals[0] + normals[1] + normals[2];
        let axis = mean.iamax();
        let uv = at.map(|p| [p[(axis + 1) % 3], p[(axis + 2) % 3]]);
        self.mesh.triangles.push(Triangle { at, normals, uv, skin, edges, layer: 0 });
    }

    fn cylinder(&mut self, body: &CylinderBody) {
        let skin = self.skin(&body.material);
        let (from, to) = (self.world(&Vector3::from(body.from)), self.world(&Vector3::from(body.to)));
        let length = (to - from).norm();
        let axis = (to - from) / length;
        let across = axis.cross(&if axis.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
        let along = axis.cross(&across);
        let at = |k: usize| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * (k % SIDES) as f64 / SIDES as f64);
            across * cosine + along * sine
        };
        let arc = std::f64::consts::TAU * body.radius / SIDES as f64;
        for k in 0..SIDES {
            let (a, b) = (at(k), at(k + 1));
            let (ra, rb) = (a * body.radius, b * body.radius);
            let (ua, ub) = (k as f64 * arc, (k + 1) as f64 * arc);
            let mut push = |corners: [(Vector3<f64>, Vector3<f64>, [f64; 2]); 3], edges| {
                self.mesh.triangles.push(Triangle {
                    at: corners.map(|c| c.0),
                    normals: corners.map(|c| c.1),
                    uv: corners.map(|c| c.2),
                    skin,
                    edges,
                    layer: 0,
                });
            };
            push(
                [(from + ra, a, [ua, 0.0]), (from + rb, b, [ub, 0.0]), (to + rb, b, [ub, length])],
                [true, true, false],
            );
            push(
                [(from + ra, a, [ua, 0.0]), (to + rb, b, [ub, length]), (to + ra, a, [ua, length])],
                [false, true, true],
            );
            for (end, normal, turn) in [(from, -axis, [rb, ra]), (to, axis, [ra, rb])] {
                let corners = [Vector3::zeros(), turn[0], turn[1]];
                push(corners.map(|r| (end + r, normal, [across.dot(&r), along.dot(&r)])), [false, true, false]);
            }
        }
    }

    fn chequer(&mut self, body: &ChequerBody) {
        let skin = self.skin(&body.material);
        let [across, along] = [body.across, body.along].map(Vector3::from);
        let at = |i: u32, j: u32| {
            Vector3::from(body.corner)
                + along * (f64::from(i) / f64::from(body.cells[0]))
                + across * (f64::from(j) / f64::from(body.cells[1]))
        };
        for i in 0..body.cells[0] {
            for j in 0..body.cells[1] {
                if (i + j) % 2 == 0 {
                    self.polygon(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], skin, 1);
                }
            }
        }
    }
}

/// R = Rz(yaw) Ry(pitch) Rx(roll) from angles in degrees.
pub(crate) fn turn(deg: [f64; 3]) -> Rotation3<f64> {
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    let [roll, pitch, yaw] = deg.map(f64::to_radians);
    (so3::exp(&(z * yaw)) * so3::exp(&(y * pitch)) * so3::exp(&(x * roll))).to_rotation_matrix()
}

/// Roll, pitch and yaw in degrees, the inverse of [`turn`].
pub(super) fn angles(r: &Rotation3<f64>) -> [f64; 3] {
    let pitch = libm::asin((-r[(2, 0)]).clamp(-1.0, 1.0));
    [libm::atan2(r[(2, 1)], r[(2, 2)]), pitch, libm::atan2(r[(1, 0)], r[(0, 0)])].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::plan::{GEOMETRY_FORMAT, SeabedPlan};

    fn volume(mesh: &Mesh) -> f64 {
        // Gauss: the flux of p/3 through a closed surface is its volume, positive when normals point out.
        mesh.triangles.iter().map(|t| t.at[0].dot(&t.at[1].cross(&t.at[2])) / 6.0).sum()
    }

    fn mesh(object: ObjectGeometry, wear: Wear) -> Mesh {
        let geometry = Geometry {
            format: GEOMETRY_FORMAT.into(),
            name: String::new(),
            seabed: SeabedPlan::default(),
            materials: Vec::new(),
            objects: Vec::new(),
        };
        let pose = Transform::exp(&[0.3, -0.2, 0.5, 1.0, 2.0, 3.0].into());
        let mut mesh = Mesh::default();
        mesh.add(&geometry, &object, &pose, wear, 1);
        for t in &mesh.triangles {
            assert!(t.normals.iter().all(|n| n.dot(&t.normal()) > 0.7), "shading faces away");
        }
        mesh
    }

    #[test]
    fn bodies_are_closed_and_turned_outwards() {
        let a_box = BoxBody {
            centre: [0.3, 0.1, -0.2],
            size: [1.0, 2.0, 0.5],
            turn_deg: [10.0, 20.0, 30.0],
            material: "".into(),
        };
        let object = ObjectGeometry { boxes: vec![a_box.clone()], ..ObjectGeometry::default() };
        assert!((volume(&mesh(object.clone(), Wear::default())) - 1.0).abs() < 1e-12);
        let pipe = CylinderBody { from: [0.0; 3], to: [0.0, 0.3, 0.4], radius: 0.1, material: "".into() };
        let pipes = ObjectGeometry { cylinders: vec![pipe], ..ObjectGeometry::default() };
        let polygon = 0.5 * SIDES as f64 * libm::sin(std::f64::consts::TAU / SIDES as f64) * 0.01;
        assert!((volume(&mesh(pipes, Wear::default())) - 0.5 * polygon).abs() < 1e-12);
        // A rounded box: the inner box, its six slabs, twelve quarter cylinders, one ball.
        let r: f64 = 0.05;
        let (x, y, z) = (1.0 - 2.0 * r, 2.0 - 2.0 * r, 0.5 - 2.0 * r);
        let exact = x * y * z
            + 2.0 * r * (x * y + y * z + z * x)
            + std::f64::consts::PI * r * r * (x + y + z)
            + 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let rounded = volume(&mesh(object, Wear { rounding: r, growth: 0.0 }));
        assert!((rounded / exact - 1.0).abs() < 2e-3, "{rounded} for {exact}");
    }

    #[test]
    fn a_polygon_knows_its_edges_from_its_seams() {
        let panel = super::super::plan::PanelBody {
            outline: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            material: String::new(),
        };
        let mesh = mesh(ObjectGeometry { panels: vec![panel], ..ObjectGeometry::default() }, Wear::default());
        assert_eq!(mesh.triangles[0].edges, [true, true, false]);
        assert_eq!(mesh.triangles[1].edges, [false, true, true]);
        assert_eq!(mesh.triangles[0].layer, 1);
    }
}
