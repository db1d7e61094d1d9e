//! From the scene and a camera to an image.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Frame, Pinhole, Transform, World};

use crate::{
    bed::Patch,
    noise::hash,
    paint,
    raster::{Facet, NONE, Part, Visibility},
    scene::{Finish, Scene},
};

/// Share of the light that comes from where nothing is.
const VOID: f32 = 0.05;
/// The bed is drawn up to this far from the camera (m).
const BED_REACH: f64 = 40.0;
/// The `id` of the bed's facets; those of bodies follow.
const BED: u32 = 0;

/// A surface as one camera sees it.
struct Seen {
    origin: Vector3<f64>,
    x: Vector3<f64>,
    y: Vector3<f64>,
    normal: Vector3<f64>,
    finish: Finish,
    brightness: f32,
    seed: u32,
}

/// A scene before one camera.
pub(crate) struct Rendering<'a> {
    scene: &'a Scene,
    camera: &'a Pinhole,
    /// The camera's axes and place in the world.
    turn: Matrix3<f64>,
    from: Vector3<f64>,
    patch: Patch,
    surfaces: Vec<Seen>,
    visibility: Visibility,
}

impl<'a> Rendering<'a> {
    /// What `camera`, placed by `world_from_camera`, sees of the scene.
    pub(crate) fn new<F: Frame>(
        scene: &'a Scene,
        camera: &'a Pinhole,
        world_from_camera: &Transform<World, F>,
    ) -> Self {
        let camera_from_world = world_from_camera.inverse();
        let into = camera_from_world.rotation_matrix();
        let place = |p: &Vector3<f64>| into * p + camera_from_world.translation();
        let (low, high) = footprint(scene, camera, world_from_camera);
        let patch = scene.bed.patch(low, high, |[north, east], normal| {
            paint::light(normal) * paint::patches(north, east, scene.texture)
        });
        let mut facets: Vec<Facet> = patch
            .triangles()
            .map(|corners| Facet { corners: corners.iter().map(place).collect(), id: BED, layer: 0, seamless: true })
            .collect();
        let mut surfaces = Vec::new();
        for (number, surface) in scene.bodies.iter().flat_map(|b| &b.surfaces).enumerate() {
            let corners: Vec<_> = surface.corners.iter().map(place).collect();
            let x = (corners[1] - corners[0]).normalize();
            let normal = into * surface.normal;
            surfaces.push(Seen {
                origin: corners[0],
                x,
                y: normal.cross(&x),
                normal,
                finish: surface.finish,
                brightness: surface.albedo * paint::light(&surface.normal),
                seed: hash(number as i32, 0, scene.texture),
            });
            facets.push(Facet { corners, id: number as u32 + 1, layer: surface.layer, seamless: false });
        }
        let visibility = Visibility::new(&facets, camera);
        let (turn, from) = (world_from_camera.rotation_matrix(), world_from_camera.translation());
        Self { scene, camera, turn, from, patch, surfaces, visibility }
    }

    /// The radiance of every pixel, row by row: 1 is white facing the light.
    pub(crate) fn radiance(&self) -> Vec<f32> {
        let [width, height] = self.camera.size().map(|n| n as usize);
        let mut image = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let mut sum = 0.0;
                self.visibility.parts(column, row, |part| sum += part.share * self.shade(column, row, &part));
                image.push(sum);
            }
        }
        image
    }

    /// The depth Z (m) at the centre of a pixel, where there is anything.
    #[cfg(test)]
    pub(crate) fn depth(&self, column: usize, row: usize) -> Option<f64> {
        let (id, inverse) = self.visibility.centre(column, row);
        (id != NONE).then(|| 1.0 / inverse)
    }

    /// The radiance of a part of a pixel.
    fn shade(&self, column: usize, row: usize, part: &Part) -> f32 {
        if part.id == NONE {
            return VOID;
        }
        let ([fx, fy], [cx, cy]) = (self.camera.focal(), self.camera.principal());
        let (u, v) = (column as f64 + part.offset[0], row as f64 + part.offset[1]);
        let ray = Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0);
        let at = ray / part.inverse_depth;
        let pixel = 1.0 / (part.inverse_depth * fx);
        let footprint = |slope: f64| pixel / (slope.abs() / ray.norm()).max(0.25);
        if part.id == BED {
            let along = self.turn * ray;
            let place = self.from + along / part.inverse_depth;
            let albedo = paint::bed(place.x, place.y, footprint(along.z), self.scene.texture);
            return albedo * self.patch.brightness(place.x, place.y);
        }
        let surface = &self.surfaces[part.id as usize - 1];
        let from = at - surface.origin;
        let (x, y) = (surface.x.dot(&from), surface.y.dot(&from));
        surface.brightness * paint::finish(surface.finish, x, y, footprint(surface.normal.dot(&ray)), surface.seed)
    }
}

/// The rectangle (north, east) of the bed that the camera can see.
fn footprint<F: Frame>(
    scene: &Scene,
    camera: &Pinhole,
    world_from_camera: &Transform<World, F>,
) -> ([f64; 2], [f64; 2]) {
    let from = world_from_camera.translation();
    let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
    let [width, height] = camera.size().map(f64::from);
    let lowest = scene.bed.depth() + scene.bed.crest();
    let (mut low, mut high) = ([from.x, from.y], [from.x, from.y]);
    for (u, v) in [(-1.0, -1.0), (width, -1.0), (-1.0, height), (width, height)] {
        let ray = world_from_camera.rotation() * Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0);
        let level = (ray.x * ray.x + ray.y * ray.y).sqrt();
        // A ray that goes up, or far away, is followed to the limit.
        let far = BED_REACH / level.max(1e-9);
        let t = if ray.z > 0.0 { ((lowest - from.z) / ray.z).clamp(0.0, far) } else { far };
        for (k, x) in [from.x + ray.x * t, from.y + ray.y * t].into_iter().enumerate() {
            low[k] = f64::min(low[k], x - 0.5);
            high[k] = f64::max(high[k], x + 0.5);
        }
    }
    (low, high)
}
