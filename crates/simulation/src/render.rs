//! From the scene and a camera to an image.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Frame, Pinhole, Transform, World};

use crate::{
    bed::Patch,
    noise::hash,
    paint,
    raster::{Facet, NONE, Part, Visibility},
    sand::beds,
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

/// The pixels of a row that see nothing but the bed: their columns, where they see it, and how wide they are there (m).
#[derive(Default)]
struct Ground {
    columns: Vec<usize>,
    north: Vec<f64>,
    east: Vec<f64>,
    footprint: Vec<f64>,
}

impl Ground {
    fn clear(&mut self) {
        self.columns.clear();
        [&mut self.north, &mut self.east, &mut self.footprint].into_iter().for_each(Vec::clear);
    }

    fn push(&mut self, column: usize, [north, east, footprint]: [f64; 3]) {
        self.columns.push(column);
        self.north.push(north);
        self.east.push(east);
        self.footprint.push(footprint);
    }
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
        let mut image = vec![0.0; width * height];
        let (mut bed, mut albedo) = (Ground::default(), Vec::new());
        for (row, out) in image.chunks_exact_mut(width).enumerate() {
            bed.clear();
            for (column, value) in out.iter_mut().enumerate() {
                match self.visibility.whole(column, row) {
                    Some((BED, inverse_depth)) => {
                        bed.push(column, self.ground(&self.ray(column as f64, row as f64), inverse_depth));
                    }
                    _ => {
                        self.visibility.parts(column, row, |part| *value += part.share * self.shade(column, row, &part))
                    }
                }
            }
            beds(&bed.north, &bed.east, &bed.footprint, self.scene.texture, &mut albedo);
            for (k, column) in bed.columns.iter().enumerate() {
                out[*column] = albedo[k] * self.patch.brightness(bed.north[k], bed.east[k]);
            }
        }
        image
    }

    /// The ray through (u, v).
    fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        let ([fx, fy], [cx, cy]) = (self.camera.focal(), self.camera.principal());
        Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0)
    }

    /// How wide a pixel is (m) on a surface that its ray meets there, `slope` being the ray's part along the normal.
    fn footprint(&self, ray: &Vector3<f64>, inverse_depth: f64, slope: f64) -> f64 {
        let pixel = 1.0 / (inverse_depth * self.camera.focal()[0]);
        pixel / (slope.abs() / ray.norm()).max(0.25)
    }

    /// Where a ray meets the bed: north, east, and how wide a pixel is there (m).
    fn ground(&self, ray: &Vector3<f64>, inverse_depth: f64) -> [f64; 3] {
        let along = self.turn * ray;
        let place = self.from + along / inverse_depth;
        [place.x, place.y, self.footprint(ray, inverse_depth, along.z)]
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
        let ray = self.ray(column as f64 + part.offset[0], row as f64 + part.offset[1]);
        if part.id == BED {
            let [north, east, footprint] = self.ground(&ray, part.inverse_depth);
            let albedo = paint::bed(north, east, footprint, self.scene.texture);
            return albedo * self.patch.brightness(north, east);
        }
        let at = ray / part.inverse_depth;
        let surface = &self.surfaces[part.id as usize - 1];
        let from = at - surface.origin;
        let (x, y) = (surface.x.dot(&from), surface.y.dot(&from));
        let footprint = self.footprint(&ray, part.inverse_depth, surface.normal.dot(&ray));
        surface.brightness * paint::finish(surface.finish, x, y, footprint, surface.seed)
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
