//! Shading of a band of rows, each step over complete rows.

use nalgebra::Vector3;

use super::{
    camera::RenderCamera,
    facet::{Facet, Spots},
    light::{Beam, irradiance, through},
    outline::Outline,
    parts::{Parts, Row},
    shadow::cast,
    view::Lit,
    visibility::{NONE, Strip},
};
use crate::scene::{Skin, Texture};

/// Albedo of growth.
const GROWTH: f32 = 0.16;

/// Light sources and water of a row.
pub(super) struct Light<'a> {
    lit: &'a Lit<'a>,
    camera_model: &'a RenderCamera,
    beams: Vec<Beam>,
    c: f32,
    /// The upward direction in the camera's frame.
    up: [f32; 3],
}

impl<'a> Light<'a> {
    pub(super) fn new(lit: &'a Lit<'a>, camera_model: &'a RenderCamera, up: &Vector3<f64>) -> Self {
        let beams = camera_model.lamps.iter().map(Beam::of).collect();
        Self { lit, camera_model, beams, c: lit.water.c() as f32, up: [up.x as f32, up.y as f32, up.z as f32] }
    }
}

/// Buffers of one band of rows.
#[derive(Debug, Default)]
pub(super) struct Band {
    pub(super) strip: Strip,
    parts: Parts,
    spots: Spots,
    albedo: Vec<f32>,
    sample: TextureSample,
    through: Vec<f32>,
    light: Vec<f32>,
    lamp: Vec<f32>,
    /// The backscatter table along the row.
    row: Vec<f32>,
    /// The backscatter of each part.
    backscatter: Vec<f32>,
}

/// Places in a texture, and the texture's values there.
#[derive(Debug, Default)]
struct TextureSample {
    u: Vec<f32>,
    v: Vec<f32>,
    own: Vec<f32>,
    cover: Vec<f32>,
    tufts: Vec<f32>,
}

impl Band {
    /// Shades one row of pixels: light from surfaces, light from the water, Z, range.
    pub(super) fn shade(
        &mut self,
        row: &Row,
        outlines: &[Outline],
        facets: &[Facet],
        skins: &[Skin],
        light: &Light<'_>,
        pixels: &mut [[f32; 4]],
    ) {
        let Lit { water, .. } = light.lit;
        self.parts.find(row, &self.strip, outlines, facets, light.camera_model);
        self.parts.spots(facets, light.camera_model.lens.camera().focal()[0] as f32, &mut self.spots);
        self.paint(facets, skins, light);
        self.shine(light);
        let ambient = water.ambient as f32;
        if ambient > 0.0 {
            let s = &self.spots;
            for (i, sum) in self.light.iter_mut().enumerate() {
                let climb = light.up[0] * s.nx[i] + light.up[1] * s.ny[i] + light.up[2] * s.nz[i];
                *sum += ambient * (0.5 + 0.5 * climb);
            }
        }
        through(&self.spots.range, light.c, &mut self.through);
        let table = light.camera_model.backscatter();
        table.along_row(row.number as f32, &mut self.row);
        table.at(&self.row, &self.parts.u, &self.spots.range, &self.through, &mut self.backscatter);
        self.compose(pixels);
    }

    /// The irradiance of each part by the lamps.
    fn shine(&mut self, light: &Light<'_>) {
        self.light.clear();
        self.light.resize(self.spots.x.len(), 0.0);
        for (k, beam) in light.beams.iter().enumerate() {
            irradiance(&self.spots, beam, light.c, &mut self.lamp);
            if let (Some(map), Some(view)) = (light.lit.maps.get(k), light.lit.views.get(k)) {
                cast(map, view, &self.spots, &mut self.lamp);
            }
            self.light.iter_mut().zip(&self.lamp).for_each(|(sum, e)| *sum += e);
        }
    }

    /// The albedo of each part.
    fn paint(&mut self, facets: &[Facet], skins: &[Skin], light: &Light<'_>) {
        self.albedo.clear();
        let skin = |facet: u32| if facet == NONE { NONE } else { facets[facet as usize].skin };
        for runs in self.parts.runs.chunk_by(|a, b| skin(a.facet) == skin(b.facet)) {
            let span = runs[0].from..runs[runs.len() - 1].to;
            match skin(runs[0].facet) {
                NONE => self.albedo.resize(span.end, 0.0),
                skin => self.sample.albedo(&skins[skin as usize], span, &self.spots, light, &mut self.albedo),
            }
        }
    }

    /// Sums the parts of each pixel.
    fn compose(&self, pixels: &mut [[f32; 4]]) {
        let Self { parts, spots, albedo, light, through, backscatter, .. } = self;
        let n = parts.columns.len();
        let (fractions, z, range) = (&parts.fractions[..n], &spots.z[..n], &spots.range[..n]);
        let (albedo, light, through, backscatter) = (&albedo[..n], &light[..n], &through[..n], &backscatter[..n]);
        for (i, &column) in parts.columns.iter().enumerate() {
            let pixel = &mut pixels[column as usize];
            let surface = albedo[i] * std::f32::consts::FRAC_1_PI * light[i] * through[i];
            *pixel = [pixel[0] + fractions[i] * surface, pixel[1] + fractions[i] * backscatter[i], z[i], range[i]];
        }
        for &(column, z, range) in &parts.centres {
            pixels[column as usize][2..].copy_from_slice(&[z, range]);
        }
    }
}

impl TextureSample {
    /// Adds the albedo of the parts with one skin.
    fn albedo(
        &mut self,
        skin: &Skin,
        span: std::ops::Range<usize>,
        spots: &Spots,
        light: &Light<'_>,
        out: &mut Vec<f32>,
    ) {
        let textures = light.lit.textures;
        let footprint = &spots.footprint[span.clone()];
        // Each body has an offset of its own in the texture.
        let (du, dv) = ((skin.seed & 0xFFF) as f32 * 0.01, (skin.seed >> 20) as f32 * 0.01);
        let shift = |list: &mut Vec<f32>, from: &[f32], step: f32| {
            list.clear();
            list.extend(from.iter().map(|x| x + step));
        };
        shift(&mut self.u, &spots.u[span.clone()], du);
        shift(&mut self.v, &spots.v[span], dv);
        textures.at(skin.texture, &self.u, &self.v, footprint, &mut self.own);
        if skin.growth <= 0.0 {
            // The albedo of a bright grain on a bright surface is limited to 1.
            out.extend(self.own.iter().map(|own| (skin.albedo * own).min(1.0)));
            return;
        }
        textures.at(Texture::Growth, &self.u, &self.v, footprint, &mut self.tufts);
        textures.grown(skin.growth, &mut self.u, &mut self.v, footprint, &mut self.cover);
        for ((own, cover), tufts) in self.own.iter().zip(&self.cover).zip(&self.tufts) {
            let own = (skin.albedo * own).min(1.0);
            out.push(own + cover * (GROWTH * tufts - own));
        }
    }
}
