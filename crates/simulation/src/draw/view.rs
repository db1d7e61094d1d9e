//! The radiance that one camera sees: what is where, then how bright it is.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Frame, Pixel, Transform, World};
use seafix_vision::Threads;

use super::{
    eye::{Eye, Line, Rolling, RowPose},
    facet::Facet,
    light::{Beam, Spots, irradiance, through},
    outline::{Origin, Outline, outline},
    shadow::{MapPlaces, ShadowMap, ShadowView, map_places},
    texture::Looks,
    visibility::{NONE, SAMPLES, Strip, places},
};
use crate::{
    field::{Field, Skin, Texture, Triangle},
    optics::Water,
};

/// Rows that are drawn at once, and rows that one piece of work has.
const STRIP: usize = 8;
const BAND: usize = 64;
/// The range that a pixel has which sees nothing (m).
const NOWHERE: f32 = 1e3;
/// Share of the light that growth returns.
const GROWTH: f32 = 0.16;

/// A camera before the field.
pub(super) struct View<'a> {
    pub(super) field: &'a Field,
    pub(super) eye: &'a Eye,
    pub(super) rolling: Option<&'a Rolling>,
    pub(super) far: f64,
}

/// What lights it.
pub(super) struct Lit<'a> {
    pub(super) water: &'a Water,
    pub(super) looks: &'a Looks,
    pub(super) maps: &'a [ShadowMap],
    pub(super) views: &'a [ShadowView],
}

/// The memory of a view. A pixel is (light from surfaces, light from the water, Z, range).
#[derive(Debug, Default)]
pub(super) struct ViewScratch {
    pub(super) pixels: Vec<[f32; 4]>,
    bed: Vec<Triangle>,
    facets: Vec<Facet>,
    outlines: Vec<Outline>,
    bins: Vec<Vec<u32>>,
    bands: Vec<Band>,
}

/// The memory of one band of rows.
#[derive(Debug, Default)]
struct Band {
    strip: Strip,
    parts: Vec<Part>,
    spots: Spots,
    albedo: Vec<f32>,
    range: Vec<f32>,
    through: Vec<f32>,
    light: Vec<f32>,
    lamp: Vec<f32>,
    haze: Vec<f32>,
    places: MapPlaces,
    groups: Vec<(u32, f32, [f32; 2])>,
}

/// A part of a pixel: one triangle's.
#[derive(Debug, Clone, Copy)]
struct Part {
    column: u32,
    share: f32,
    u: f32,
}

impl View<'_> {
    /// Fills `scratch.pixels`.
    pub(super) fn draw<F: Frame>(
        &self,
        world_from_eye: &Transform<World, F>,
        lit: &Lit<'_>,
        threads: Threads,
        scratch: &mut ViewScratch,
    ) {
        let [width, height] = self.eye.lens.camera().size().map(|n| n as usize);
        self.collect(world_from_eye, scratch);
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
        let up = world_from_eye.rotation().inverse() * -Vector3::z();
        let light = Light {
            lit,
            eye: self.eye,
            beams: self.eye.lamps.iter().map(Beam::of).collect(),
            c: lit.water.c() as f32,
            up: [up.x as f32, up.y as f32, up.z as f32],
        };
        let (facets, outlines, bins) = (&facets[..], &outlines[..], &bins[..]);
        threads.pieces(pixels, BAND * width, bands, |piece, pixels, band| {
            for (k, pixels) in pixels.chunks_mut(STRIP * width).enumerate() {
                let first = piece * BAND + k * STRIP;
                let rows = first..first + pixels.len() / width;
                band.strip.draw(outlines, &bins[first / STRIP], rows, width);
                for (k, pixels) in pixels.chunks_exact_mut(width).enumerate() {
                    let pose = self.rolling.map(|r| RowPose::new(&r.at((first + k) as f64)));
                    let row = Row { number: first + k, in_strip: k, pose };
                    band.shade(&row, outlines, facets, &self.field.mesh.skins, &light, pixels);
                }
            }
        });
    }

    /// The triangles within sight, before the camera.
    fn collect<F: Frame>(&self, world_from_eye: &Transform<World, F>, scratch: &mut ViewScratch) {
        let into = world_from_eye.inverse();
        let (turn, step) = (into.rotation_matrix(), into.translation());
        scratch.bed.clear();
        let (low, high) = self.footprint(world_from_eye);
        self.field.bed.sheet(low, high, self.field.bed_skin, &mut scratch.bed);
        scratch.facets.clear();
        scratch.outlines.clear();
        let ViewScratch { bed, facets, outlines, .. } = scratch;
        let from = world_from_eye.translation();
        for triangle in self.field.mesh.triangles.iter().chain(bed.iter()) {
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
        outline(at, triangle.edges, origin, self.eye, self.rolling, outlines);
        if outlines.len() > before {
            facets.push(Facet::new(triangle, &at, turn));
        }
    }

    /// The rectangle (north, east) of the bed that the camera can see.
    fn footprint<F: Frame>(&self, world_from_eye: &Transform<World, F>) -> ([f64; 2], [f64; 2]) {
        let bed = &self.field.bed;
        let lens = &self.eye.lens;
        let [width, height] = lens.camera().size().map(f64::from);
        let lowest = bed.depth() + bed.crest();
        let from = world_from_eye.translation();
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
                let along = world_from_eye.rotation() * ray.along;
                let level = along.xy().norm();
                // A ray that goes up, or far away, is followed to the limit.
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

/// What lights a row.
struct Light<'a> {
    lit: &'a Lit<'a>,
    eye: &'a Eye,
    beams: Vec<Beam>,
    c: f32,
    /// Away from the centre of the earth, in the camera's frame.
    up: [f32; 3],
}

/// One row of the image.
struct Row {
    number: usize,
    in_strip: usize,
    pose: Option<RowPose>,
}

impl Band {
    /// One row: all parts of its pixels, then their light, each step over the whole row.
    fn shade(
        &mut self,
        row: &Row,
        outlines: &[Outline],
        facets: &[Facet],
        skins: &[Skin],
        light: &Light<'_>,
        pixels: &mut [[f32; 4]],
    ) {
        self.find_parts(row, outlines, facets, skins, light, pixels);
        let n = self.parts.len();
        self.light.clear();
        self.light.resize(n, 0.0);
        for (k, beam) in light.beams.iter().enumerate() {
            irradiance(&self.spots, beam, light.c, &mut self.lamp);
            if let (Some(map), Some(view)) = (light.lit.maps.get(k), light.lit.views.get(k)) {
                map_places(&self.spots, view, &mut self.places);
                for (i, e) in self.lamp.iter_mut().enumerate().filter(|(_, e)| **e > 0.0) {
                    *e *= map.reaches(&self.places, i);
                }
            }
            self.light.iter_mut().zip(&self.lamp).for_each(|(sum, e)| *sum += e);
        }
        let ambient = light.lit.water.ambient as f32;
        if ambient > 0.0 {
            let s = &self.spots;
            for (i, sum) in self.light.iter_mut().enumerate() {
                let climb = light.up[0] * s.nx[i] + light.up[1] * s.ny[i] + light.up[2] * s.nz[i];
                *sum += ambient * (0.5 + 0.5 * climb);
            }
        }
        through(&self.range, light.c, &mut self.through);
        let mut haze = std::mem::take(&mut self.haze);
        let table = light.eye.haze();
        table.along_row(row.number as f32, &mut haze);
        for (i, part) in self.parts.iter().enumerate() {
            let pixel = &mut pixels[part.column as usize];
            let surface = self.albedo[i] * std::f32::consts::FRAC_1_PI * self.light[i] * self.through[i];
            pixel[0] += part.share * surface;
            pixel[1] += part.share * table.at(&haze, part.u, self.range[i], self.through[i]);
        }
        self.haze = haze;
    }

    /// The parts of a row's pixels and where they lie.
    fn find_parts(
        &mut self,
        row: &Row,
        outlines: &[Outline],
        facets: &[Facet],
        skins: &[Skin],
        light: &Light<'_>,
        pixels: &mut [[f32; 4]],
    ) {
        self.parts.clear();
        self.spots.clear();
        self.albedo.clear();
        self.range.clear();
        let width = pixels.len();
        let offsets = places();
        let strip = std::mem::take(&mut self.strip);
        let seen = &strip.seen[row.in_strip * width..][..width];
        let slots = strip.starts[row.in_strip]..strip.starts[row.in_strip + 1];
        let mut crossed = strip.columns[slots.clone()].iter().zip(&strip.samples[slots]).peekable();
        for (column, (&index, pixel)) in seen.iter().zip(pixels.iter_mut()).enumerate() {
            let line = self.line(light.eye, row, column, [0.0; 2]);
            let centre = (index != NONE).then(|| facets[outlines[index as usize].facet as usize].spot(&line));
            (pixel[2], pixel[3]) = centre.map_or((NOWHERE, NOWHERE), |spot| (spot.at[2], spot.range));
            match crossed.next_if(|(c, _)| **c as usize == column) {
                None => self.add(column, index, 1.0, [0.0; 2], &line, outlines, facets, skins, light),
                Some((_, samples)) => {
                    let mut groups = std::mem::take(&mut self.groups);
                    group(samples, outlines, &offsets, &mut groups);
                    for &(index, count, [du, dv]) in &groups {
                        let offset = [du / count, dv / count];
                        let line = self.line(light.eye, row, column, offset);
                        let share = count * (1.0 / SAMPLES as f32);
                        self.add(column, index, share, offset, &line, outlines, facets, skins, light);
                    }
                    self.groups = groups;
                }
            }
        }
        self.strip = strip;
    }

    fn line(&self, eye: &Eye, row: &Row, column: usize, [du, dv]: [f32; 2]) -> Line {
        let line = eye.line(column, row.number, du, dv);
        row.pose.as_ref().map_or(line, |pose| pose.apply(&line))
    }

    /// One part of a pixel.
    #[expect(clippy::too_many_arguments, reason = "the innermost step, called in one place")]
    #[inline]
    fn add(
        &mut self,
        column: usize,
        index: u32,
        share: f32,
        [du, _]: [f32; 2],
        line: &Line,
        outlines: &[Outline],
        facets: &[Facet],
        skins: &[Skin],
        light: &Light<'_>,
    ) {
        self.parts.push(Part { column: column as u32, share, u: column as f32 + du });
        if index == NONE {
            self.spots.push(&[0.0, 0.0, NOWHERE], &[0.0, 0.0, -1.0]);
            self.albedo.push(0.0);
            self.range.push(NOWHERE);
            return;
        }
        let facet = &facets[outlines[index as usize].facet as usize];
        let spot = facet.spot(line);
        let skin = &skins[facet.skin as usize];
        let focal = light.eye.lens.camera().focal()[0] as f32;
        let footprint = spot.range / focal / spot.slope.max(0.2);
        self.spots.push(&spot.at, &spot.normal);
        self.albedo.push(albedo(light.lit.looks, skin, spot.uv, footprint));
        self.range.push(spot.range);
    }
}

/// The samples of a pixel by what they see: (outline, count, sum of offsets). Triangles of one smooth
/// surface stay apart: each has its own plane.
fn group(
    samples: &[u32; SAMPLES],
    outlines: &[Outline],
    offsets: &[[f32; SAMPLES]; 2],
    groups: &mut Vec<(u32, f32, [f32; 2])>,
) {
    groups.clear();
    for (k, &index) in samples.iter().enumerate() {
        let facet = |index: u32| if index == NONE { NONE } else { outlines[index as usize].facet };
        let found = groups.iter_mut().find(|(other, ..)| *other == index || facet(*other) == facet(index));
        let (du, dv) = (offsets[0][k], offsets[1][k]);
        match found {
            Some((_, count, sum)) => {
                *count += 1.0;
                *sum = [sum[0] + du, sum[1] + dv];
            }
            None => groups.push((index, 1.0, [du, dv])),
        }
    }
}

/// Share of the light that a place returns.
#[inline]
fn albedo(looks: &Looks, skin: &Skin, [u, v]: [f32; 2], footprint: f32) -> f32 {
    // Each body lies elsewhere in the texture.
    let (du, dv) = ((skin.seed & 0xFFF) as f32 * 0.01, (skin.seed >> 20) as f32 * 0.01);
    let (u, v) = (u + du, v + dv);
    let own = skin.albedo * looks.at(skin.texture, u, v, footprint);
    if skin.growth <= 0.0 {
        return own;
    }
    // Growth begins where a slow pattern is low, and ends in tufts.
    let slow = looks.at(Texture::Steel, 0.37 * u + 5.0, 0.37 * v, footprint) - 1.0;
    let level = 0.34 * (skin.growth * 2.0 - 1.0);
    let cover = if skin.growth >= 1.0 { 1.0 } else { ((level - slow) * 12.0 + 0.5).clamp(0.0, 1.0) };
    let soft = GROWTH * looks.at(Texture::Growth, u, v, footprint);
    own + cover * (soft - own)
}
