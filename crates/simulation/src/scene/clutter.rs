//! Bodies beside the objects: rocks, hoses, weed.

use nalgebra::Vector3;

use super::{
    mesh::{Mesh, Skin, Triangle},
    plan::Texture,
};
use crate::{seabed::Seabed, stream::Stream};

/// Inner and outer radius of the ring of rocks around an object's centre (m).
const RING: [f64; 2] = [1.9, 4.2];

/// Adds `count` rocks around a place, sunk into the seabed.
pub(super) fn rocks(mesh: &mut Mesh, seabed: &Seabed, centre: &Vector3<f64>, count: usize, stream: &mut Stream) {
    for _ in 0..count {
        let away = stream.between(RING[0], RING[1]);
        let (sine, cosine) = libm::sincos(stream.between(0.0, std::f64::consts::TAU));
        let (north, east) = (centre.x + away * cosine, centre.y + away * sine);
        let size = stream.between(0.05, 0.2) * stream.between(0.6, 1.2);
        let foot = Vector3::new(north, east, seabed.down(north, east) - 0.25 * size);
        let albedo = stream.between(0.18, 0.38) as f32;
        let axes = Vector3::new(stream.between(0.8, 1.3), stream.between(0.7, 1.1), stream.between(0.5, 0.8)) * size;
        ball(
            mesh,
            &foot,
            &axes,
            0.22,
            Skin { albedo, texture: Texture::Rock, seed: stream.bits() as u32, growth: 0.0 },
            stream,
        );
    }
}

/// Adds `count` occluders around a place: hoses that rise from the seabed, and floating weed.
pub(super) fn occluders(mesh: &mut Mesh, seabed: &Seabed, centre: &Vector3<f64>, count: usize, stream: &mut Stream) {
    for _ in 0..count {
        let away = 1.6 * stream.unit().sqrt();
        let (sine, cosine) = libm::sincos(stream.between(0.0, std::f64::consts::TAU));
        let (north, east) = (centre.x + away * cosine, centre.y + away * sine);
        let floor = seabed.down(north, east).min(centre.z);
        let height = stream.between(0.15, 0.6);
        let albedo = stream.between(0.08, 0.3) as f32;
        let skin = Skin { albedo, texture: Texture::Growth, seed: stream.bits() as u32, growth: 0.0 };
        let place = Vector3::new(north, east, floor - height);
        let size = if stream.unit() < 0.5 {
            Vector3::new(0.02, 0.02, 0.5 * height)
        } else {
            Vector3::new(stream.between(0.03, 0.12), stream.between(0.03, 0.12), stream.between(0.02, 0.06))
        };
        ball(mesh, &place, &size, 0.15, skin, stream);
    }
}

/// Adds a lumpy ellipsoid of 80 triangles with these semi-axes.
fn ball(mesh: &mut Mesh, centre: &Vector3<f64>, axes: &Vector3<f64>, lumps: f64, skin: Skin, stream: &mut Stream) {
    let number = mesh.skins.len() as u32;
    mesh.skins.push(skin);
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut vertices: Vec<Vector3<f64>> = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        vertices.push(Vector3::new(a, b, 0.0).normalize());
    }
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        vertices.push(Vector3::new(0.0, a, b).normalize());
    }
    for (a, b) in [(golden, -1.0), (golden, 1.0), (-golden, -1.0), (-golden, 1.0)] {
        vertices.push(Vector3::new(a, 0.0, b).normalize());
    }
    const FACES: [[usize; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut faces = Vec::new();
    for [a, b, c] in FACES {
        let mut middle = |i: usize, j: usize| {
            let at = (vertices[i] + vertices[j]).normalize();
            vertices.iter().position(|v| (v - at).norm() < 1e-9).unwrap_or_else(|| {
                vertices.push(at);
                vertices.len() - 1
            })
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        faces.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    let radii: Vec<f64> = vertices.iter().map(|_| 1.0 + lumps * stream.between(-1.0, 1.0)).collect();
    let normal = |i: usize| vertices[i].component_div(axes).normalize();
    for face in faces {
        let at = face.map(|i| centre + vertices[i].component_mul(axes) * radii[i]);
        let flat = (at[1] - at[0]).cross(&(at[2] - at[0])).normalize();
        // Normals between those of facets and of a smooth ball: worn edges.
        let normals = face.map(|i| (normal(i) + flat).normalize());
        let uv = face.map(|i| [vertices[i].x * axes.x + vertices[i].z * 0.3 * axes.z, vertices[i].y * axes.y]);
        mesh.triangles.push(Triangle { at, normals, uv, skin: number, edges: [true; 3], layer: 0 });
    }
}
