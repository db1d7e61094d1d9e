//! Rendering of the virtual scene.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Frame, Pinhole, Transform, World};

use crate::{
    noise::hash,
    paint,
    raster::{Facet, NONE, Part, Visibility},
    sand::{finishes, seabeds},
    seabed::Patch,
    virtual_scene::{Finish, VirtualScene},
};

/// Radiance of pixels that see nothing.
const VOID: f32 = 0.05;
/// Maximum distance at which the seabed is drawn (m).
const SEABED_REACH: f64 = 40.0;
/// The `id` of the seabed's facets; those of bodies follow.
const SEABED: u32 = 0;

/// A surface in one camera's frame.
struct Seen {
    origin: Vector3<f64>,
    x: Vector3<f64>,
    y: Vector3<f64>,
    normal: Vector3<f64>,
    finish: Finish,
    brightness: f32,
    seed: u32,
}

/// Uniform pixels of a row, which see the seabed only or one surface only.
///
/// Their columns and 1/Z, their surface coordinates (north and east, or x and y of the surface's plane), and their
/// footprints (m).
#[derive(Debug, Default)]
struct Integer {
    columns: Vec<u32>,
    inverse_depths: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    footprint: Vec<f64>,
}

impl Integer {
    fn clear(&mut self) {
        self.columns.clear();
        self.inverse_depths.clear();
    }

    fn push(&mut self, column: usize, inverse_depth: f64) {
        self.columns.push(column as u32);
        self.inverse_depths.push(inverse_depth);
    }

    /// Computes the surface coordinates by the formulas of [`Rendering::ground`] or [`Rendering::upon`].
    fn place(&mut self, row: usize, sensor_frame: &SensorFrame<'_>) {
        let n = self.columns.len();
        for list in [&mut self.x, &mut self.y, &mut self.footprint] {
            list.resize(n, 0.0);
        }
        let Self { columns, inverse_depths, x, y, footprint } = self;
        match sensor_frame.surface {
            None => on_seabed(sensor_frame, row as f64, columns, inverse_depths, x, y, footprint),
            Some(surface) => on_surface(sensor_frame, surface, row as f64, columns, inverse_depths, x, y, footprint),
        }
    }
}

/// A camera and a surface in its view, or the seabed.
struct SensorFrame<'a> {
    focal: [f64; 2],
    principal: [f64; 2],
    turn: &'a Matrix3<f64>,
    from: &'a Vector3<f64>,
    surface: Option<&'a Seen>,
}

/// [`Rendering::ground`] for many pixels of row `v`, with the same bits.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn on_seabed(
    sensor_frame: &SensorFrame<'_>,
    v: f64,
    columns: &[u32],
    inverse_depths: &[f64],
    north: &mut [f64],
    east: &mut [f64],
    footprint: &mut [f64],
) {
    let n = columns.len();
    let (inverse_depths, north, east) = (&inverse_depths[..n], &mut north[..n], &mut east[..n]);
    let footprint = &mut footprint[..n];
    let ([fx, fy], [cx, cy], t, from) =
        (sensor_frame.focal, sensor_frame.principal, sensor_frame.turn, sensor_frame.from);
    let y = (v - cy) / fy;
    for i in 0..n {
        let x = (f64::from(columns[i] as i32) - cx) / fx;
        let along_x = t.m11 * x + t.m12 * y + t.m13;
        let along_y = t.m21 * x + t.m22 * y + t.m23;
        let slope = t.m31 * x + t.m32 * y + t.m33;
        north[i] = from.x + along_x / inverse_depths[i];
        east[i] = from.y + along_y / inverse_depths[i];
        let pixel = 1.0 / (inverse_depths[i] * fx);
        footprint[i] = pixel / (slope.abs() / (x * x + y * y + 1.0).sqrt()).max(0.25);
    }
}

/// [`Rendering::upon`] for many pixels of row `v`, with the same bits.
#[expect(clippy::too_many_arguments, reason = "separate slices, which the compiler knows not to overlap")]
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn on_surface(
    sensor_frame: &SensorFrame<'_>,
    surface: &Seen,
    v: f64,
    columns: &[u32],
    inverse_depths: &[f64],
    along: &mut [f64],
    across: &mut [f64],
    footprint: &mut [f64],
) {
    let n = columns.len();
    let (inverse_depths, along, across) = (&inverse_depths[..n], &mut along[..n], &mut across[..n]);
    let footprint = &mut footprint[..n];
    let ([fx, fy], [cx, cy]) = (sensor_frame.focal, sensor_frame.principal);
    let Seen { origin, x: p, y: q, normal, .. } = surface;
    let y = (v - cy) / fy;
    for i in 0..n {
        let x = (f64::from(columns[i] as i32) - cx) / fx;
        let inverse = inverse_depths[i];
        let (a, b, c) = (x / inverse - origin.x, y / inverse - origin.y, 1.0 / inverse - origin.z);
        along[i] = p.x * a + p.y * b + p.z * c;
        across[i] = q.x * a + q.y * b + q.z * c;
        let slope = normal.x * x + normal.y * y + normal.z;
        let pixel = 1.0 / (inverse * fx);
        footprint[i] = pixel / (slope.abs() / (x * x + y * y + 1.0).sqrt()).max(0.25);
    }
}

/// A scene before one camera.
pub(crate) struct Rendering<'a> {
    scene: &'a VirtualScene,
    camera: &'a Pinhole,
    /// The camera's rotation and position in the world.
    turn: Matrix3<f64>,
    from: Vector3<f64>,
    patch: Patch,
    surfaces: Vec<Seen>,
    visibility: Visibility,
}

impl<'a> Rendering<'a> {
    /// The rendering of the scene by `camera` at `world_from_camera`.
    pub(crate) fn new<F: Frame>(
        scene: &'a VirtualScene,
        camera: &'a Pinhole,
        world_from_camera: &Transform<World, F>,
    ) -> Self {
        let camera_from_world = world_from_camera.inverse();
        let into = camera_from_world.rotation_matrix();
        let place = |p: &Vector3<f64>| into * p + camera_from_world.translation();
        let (low, high) = footprint(scene, camera, world_from_camera);
        let patch = scene.seabed.patch(low, high, |[north, east], normal| {
            paint::light(normal) * paint::patches(north, east, scene.texture)
        });
        let mut facets: Vec<Facet> = patch
            .triangles()
            .map(|corners| Facet { corners: corners.iter().map(place).collect(), id: SEABED, layer: 0, seamless: true })
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
        let (mut seabed, mut run) = (Integer::default(), Integer::default());
        let (mut albedo, mut brightness) = (Vec::new(), Vec::new());
        for (row, out) in image.chunks_exact_mut(width).enumerate() {
            seabed.clear();
            let mut column = 0;
            while column < width {
                let first = column;
                column += 1;
                match self.visibility.full(first, row) {
                    None => self
                        .visibility
                        .parts(first, row, |part| out[first] += part.fraction * self.shade(first, row, &part)),
                    Some((NONE, _)) => out[first] = VOID,
                    Some((SEABED, inverse_depth)) => seabed.push(first, inverse_depth),
                    Some((id, inverse_depth)) => {
                        run.clear();
                        run.push(first, inverse_depth);
                        while let Some((_, next)) =
                            (column < width).then(|| self.visibility.full(column, row)).flatten().filter(|w| w.0 == id)
                        {
                            run.push(column, next);
                            column += 1;
                        }
                        let surface = &self.surfaces[id as usize - 1];
                        run.place(row, &self.sensor_frame(Some(surface)));
                        finishes(surface.finish, &run.x, &run.y, &run.footprint, surface.seed, &mut albedo);
                        let albedos = out[first..column].iter_mut().zip(&albedo);
                        albedos.for_each(|(out, albedo)| *out = surface.brightness * albedo);
                    }
                }
            }
            seabed.place(row, &self.sensor_frame(None));
            seabeds(&seabed.x, &seabed.y, &seabed.footprint, self.scene.texture, &mut albedo);
            self.patch.brightnesses(&seabed.x, &seabed.y, &mut brightness);
            for ((&column, albedo), brightness) in seabed.columns.iter().zip(&albedo).zip(&brightness) {
                out[column as usize] = albedo * brightness;
            }
        }
        image
    }

    /// The radiance of a single pixel.
    #[cfg(test)]
    pub(crate) fn pixel(&self, column: usize, row: usize) -> f32 {
        let mut value = 0.0;
        self.visibility.parts(column, row, |part| value += part.fraction * self.shade(column, row, &part));
        value
    }

    fn sensor_frame<'b>(&'b self, surface: Option<&'b Seen>) -> SensorFrame<'b> {
        let (focal, principal) = (self.camera.focal(), self.camera.principal());
        SensorFrame { focal, principal, turn: &self.turn, from: &self.from, surface }
    }

    /// The ray through (u, v).
    fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        let ([fx, fy], [cx, cy]) = (self.camera.focal(), self.camera.principal());
        Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0)
    }

    /// The footprint of a pixel (m) on a surface; `slope` is the ray's component along the normal.
    fn footprint(&self, ray: &Vector3<f64>, inverse_depth: f64, slope: f64) -> f64 {
        let pixel = 1.0 / (inverse_depth * self.camera.focal()[0]);
        pixel / (slope.abs() / ray.norm()).max(0.25)
    }

    /// The intersection of a ray with the seabed: north, east, and the pixel's footprint (m).
    fn ground(&self, ray: &Vector3<f64>, inverse_depth: f64) -> [f64; 3] {
        let along = self.turn * ray;
        let place = self.from + along / inverse_depth;
        [place.x, place.y, self.footprint(ray, inverse_depth, along.z)]
    }

    /// The depth Z (m) at a pixel's centre; `None` for the void.
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
        if part.id == SEABED {
            let [north, east, footprint] = self.ground(&ray, part.inverse_depth);
            let albedo = paint::seabed(north, east, footprint, self.scene.texture);
            return albedo * self.patch.brightness(north, east);
        }
        let surface = &self.surfaces[part.id as usize - 1];
        let [x, y, footprint] = self.upon(surface, &ray, part.inverse_depth);
        surface.brightness * paint::finish(surface.finish, x, y, footprint, surface.seed)
    }

    /// The intersection of a ray with a surface: x and y of its plane, and the pixel's footprint (m).
    fn upon(&self, surface: &Seen, ray: &Vector3<f64>, inverse_depth: f64) -> [f64; 3] {
        let from = ray / inverse_depth - surface.origin;
        let footprint = self.footprint(ray, inverse_depth, surface.normal.dot(ray));
        [surface.x.dot(&from), surface.y.dot(&from), footprint]
    }
}

/// The visible rectangle of the seabed (north, east).
fn footprint<F: Frame>(
    scene: &VirtualScene,
    camera: &Pinhole,
    world_from_camera: &Transform<World, F>,
) -> ([f64; 2], [f64; 2]) {
    let from = world_from_camera.translation();
    let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
    let [width, height] = camera.size().map(f64::from);
    let lowest = scene.seabed.depth() + scene.seabed.crest();
    let (mut low, mut high) = ([from.x, from.y], [from.x, from.y]);
    for (u, v) in [(-1.0, -1.0), (width, -1.0), (-1.0, height), (width, height)] {
        let ray = world_from_camera.rotation() * Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0);
        let level = (ray.x * ray.x + ray.y * ray.y).sqrt();
        // A ray upwards or to far away ends at the limit.
        let far = SEABED_REACH / level.max(1e-9);
        let t = if ray.z > 0.0 { ((lowest - from.z) / ray.z).clamp(0.0, far) } else { far };
        for (k, x) in [from.x + ray.x * t, from.y + ray.y * t].into_iter().enumerate() {
            low[k] = f64::min(low[k], x - 0.5);
            high[k] = f64::max(high[k], x + 0.5);
        }
    }
    (low, high)
}
