//! The radiance of one camera's view: visibility, then shading.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Frame, Pixel, Transform, World};
use seafix_vision::Threads;

use super::{
    band::{Band, Light},
    camera::{RenderCamera, Rolling, RowPose},
    facet::Facet,
    outline::{Origin, Outline, outline},
    parts::Row,
    shadow::{ShadowMap, ShadowView},
    texture::SurfaceTextures,
};
use crate::{
    optics::Water,
    scene::{Scene, Triangle},
};

/// Number of rows rasterised together.
const STRIP: usize = 8;
/// Number of rows in one unit of work.
const BAND: usize = 64;

/// A camera in the scene.
pub(super) struct View<'a> {
    pub(super) scene: &'a Scene,
    pub(super) camera_model: &'a RenderCamera,
    pub(super) rolling: Option<&'a Rolling>,
    pub(super) far: f64,
}

/// Water, textures and shadow maps for shading.
pub(super) struct Lit<'a> {
    pub(super) water: &'a Water,
    pub(super) textures: &'a SurfaceTextures,
    pub(super) maps: &'a [ShadowMap],
    pub(super) views: &'a [ShadowView],
}

/// Buffers of a view. A pixel is (light from surfaces, light from the water, Z, range).
#[derive(Debug, Default)]
pub(super) struct ViewScratch {
    pub(super) pixels: Vec<[f32; 4]>,
    seabed: Vec<Triangle>,
    facets: Vec<Facet>,
    outlines: Vec<Outline>,
    bins: Vec<Vec<u32>>,
    bands: Vec<Band>,
}

impl View<'_> {
    /// Renders into `scratch.pixels`.
    pub(super) fn draw<F: Frame>(
        &self,
        world_from_view: &Transform<World, F>,
        lit: &Lit<'_>,
        threads: Threads,
        scratch: &mut ViewScratch,
    ) {
        let [width, height] = self.camera_model.lens.camera().size().map(|n| n as usize);
        self.collect(world_from_view, scratch);
        let ViewScratch { pixels, facets, outlines, bins, bands, .. } = scratch;
        let strips = height.div_ceil(STRIP);
        bins.resize_with(strips.max(bins.len()), Vec::new);
        bins.iter_mut().for_each(Vec::clear);
        for (index, outline) in (0..).zip(outlines.iter()) {
            let rows = outline.touched(height);
            if !rows.is_empty() {
                bins[rows.start / STRIP..=(rows.end - 1) / STRIP].iter_mut().for_each(|bin| bin.push(index));
            }
        }
        pixels.clear();
        pixels.resize(width * height, [0.0; 4]);
        let up = world_from_view.rotation().inverse() * -Vector3::z();
        let light = Light::new(lit, self.camera_model, &up);
        let (facets, outlines, bins) = (&facets[..], &outlines[..], &bins[..]);
        threads.pieces(pixels, BAND * width, bands, |piece, pixels, band| {
            for (k, pixels) in pixels.chunks_mut(STRIP * width).enumerate() {
                let first = piece * BAND + k * STRIP;
                let rows = first..first + pixels.len() / width;
                band.strip.draw(outlines, &bins[first / STRIP], rows, width);
                for (k, pixels) in pixels.chunks_exact_mut(width).enumerate() {
                    let pose = self.rolling.map(|r| RowPose::new(&r.at((first + k) as f64)));
                    let row = Row { number: first + k, in_strip: k, pose };
                    band.shade(&row, outlines, facets, &self.scene.mesh.skins, &light, pixels);
                }
            }
        });
    }

    /// The skin at the centre of every pixel.
    #[cfg(test)]
    pub(super) fn skins<F: Frame>(&self, world_from_view: &Transform<World, F>) -> Vec<Option<u32>> {
        use super::visibility::{NONE, Strip};
        let [width, height] = self.camera_model.lens.camera().size().map(|n| n as usize);
        let (mut scratch, mut strip) = (ViewScratch::default(), Strip::default());
        self.collect(world_from_view, &mut scratch);
        let ViewScratch { facets, outlines, .. } = &scratch;
        let order: Vec<u32> = (0..outlines.len() as u32).collect();
        strip.draw(outlines, &order, 0..height, width);
        let skin = |&seen: &u32| (seen != NONE).then(|| facets[outlines[seen as usize].facet as usize].skin);
        (0..height).flat_map(|row| strip.row(row).0.iter().map(skin).collect::<Vec<_>>()).collect()
    }

    /// Collects the triangles in view, in front of the camera.
    fn collect<F: Frame>(&self, world_from_view: &Transform<World, F>, scratch: &mut ViewScratch) {
        let into = world_from_view.inverse();
        let (turn, step) = (into.rotation_matrix(), into.translation());
        scratch.seabed.clear();
        let (low, high) = self.footprint(world_from_view);
        self.scene.seabed.sheet(low, high, self.scene.seabed_skin, &mut scratch.seabed);
        scratch.facets.clear();
        scratch.outlines.clear();
        let ViewScratch { seabed, facets, outlines, .. } = scratch;
        let from = world_from_view.translation();
        for triangle in self.scene.mesh.triangles.iter().chain(seabed.iter()) {
            self.add(triangle, &from, &turn, &step, facets, outlines);
        }
    }

    fn add(
        &self,
        triangle: &Triangle,
        from: &Vector3<f64>,
        turn: &Matrix3<f64>,
        step: &Vector3<f64>,
        facets: &mut Vec<Facet>,
        outlines: &mut Vec<Outline>,
    ) {
        if (triangle.at[0] - from).norm_squared() > self.far * self.far {
            return;
        }
        let at = triangle.at.map(|p| turn * p + step);
        let before = outlines.len();
        let origin = Origin { facet: facets.len() as u32, body: triangle.skin, layer: triangle.layer };
        outline(at, triangle.edges, origin, self.camera_model, self.rolling, outlines);
        if outlines.len() > before {
            facets.push(Facet::new(triangle, &at, turn));
        }
    }

    /// The rectangle (north, east) of the seabed that the camera can see.
    fn footprint<F: Frame>(&self, world_from_view: &Transform<World, F>) -> ([f64; 2], [f64; 2]) {
        let seabed = &self.scene.seabed;
        let lens = &self.camera_model.lens;
        let [width, height] = lens.camera().size().map(f64::from);
        let lowest = seabed.depth() + seabed.crest();
        let from = world_from_view.translation();
        let (mut low, mut high) = ([from.x, from.y], [from.x, from.y]);
        const SIDE: i32 = 8;
        for i in 0..=SIDE {
            for j in 0..=SIDE {
                let border = i % SIDE == 0 || j % SIDE == 0;
                let pixel = Pixel {
                    u: f64::from(i) / f64::from(SIDE) * (width - 1.0),
                    v: f64::from(j) / f64::from(SIDE) * (height - 1.0),
                };
                let Some(ray) = lens.ray(&pixel).filter(|_| border) else { continue };
                let along = world_from_view.rotation() * ray.along;
                let level = along.xy().norm();
                // A ray upwards or to far away ends at the limit.
                let far = self.far / level.max(1e-9);
                let t = if along.z > 0.0 { ((lowest - from.z) / along.z).clamp(0.0, far) } else { far };
                for (k, x) in [from.x + along.x * t, from.y + along.y * t].into_iter().enumerate() {
                    low[k] = f64::min(low[k], x - 0.5);
                    high[k] = f64::max(high[k], x + 0.5);
                }
            }
        }
        (low, high)
    }
}
