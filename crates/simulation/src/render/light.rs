//! Irradiance from the lamps: Lambert's cosine, the beam, 1/r², and attenuation.

use super::{
    facet::Spots,
    math::{exp, exp2, log2},
};
use crate::optics::Lamp;

/// A lamp in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    pub(super) at: [f32; 3],
    axis: [f32; 3],
    power: f32,
    exponent: f32,
}

impl Beam {
    pub(super) fn of(lamp: &Lamp) -> Self {
        let axis = lamp.axis();
        Self {
            at: lamp.at.map(|x| x as f32),
            axis: [axis.x as f32, axis.y as f32, axis.z as f32],
            power: lamp.power as f32,
            exponent: lamp.exponent() as f32,
        }
    }

    /// The irradiance at a place without a surface, after the attenuation exp(−c r).
    #[inline(always)]
    pub(super) fn flux(&self, x: f32, y: f32, z: f32, c: f32) -> f32 {
        let (dx, dy, dz) = (x - self.at[0], y - self.at[1], z - self.at[2]);
        let r2 = (dx * dx + dy * dy + dz * dz).max(1e-6);
        let r = r2.sqrt();
        let cosine = (dx * self.axis[0] + dy * self.axis[1] + dz * self.axis[2]) / r;
        let beam = exp2(self.exponent * log2(cosine.max(1e-12)));
        let beam = if cosine > 0.0 { beam } else { 0.0 };
        self.power * beam / r2 * exp(-c * r)
    }
}

/// The irradiance E (W/m² for an intensity in W/sr) at each place.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn irradiance(spots: &Spots, beam: &Beam, c: f32, out: &mut Vec<f32>) {
    let n = spots.x.len();
    out.clear();
    out.resize(n, 0.0);
    let (x, y, z) = (&spots.x[..n], &spots.y[..n], &spots.z[..n]);
    let (nx, ny, nz) = (&spots.nx[..n], &spots.ny[..n], &spots.nz[..n]);
    let out = &mut out[..n];
    for i in 0..n {
        let (dx, dy, dz) = (x[i] - beam.at[0], y[i] - beam.at[1], z[i] - beam.at[2]);
        let r2 = (dx * dx + dy * dy + dz * dz).max(1e-6);
        let r = r2.sqrt();
        let cosine = (dx * beam.axis[0] + dy * beam.axis[1] + dz * beam.axis[2]) / r;
        let onto = -(dx * nx[i] + dy * ny[i] + dz * nz[i]) / r;
        let width = exp2(beam.exponent * log2(cosine.max(1e-12)));
        let width = if cosine > 0.0 { width } else { 0.0 };
        out[i] = beam.power * width * onto.max(0.0) / r2 * exp(-c * r);
    }
}

/// exp(−c r) for each range.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn through(ranges: &[f32], c: f32, out: &mut Vec<f32>) {
    out.clear();
    out.extend(ranges.iter().map(|r| exp(-c * r)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_beam_is_the_lamps() {
        let lamp = Lamp { at: [0.3, -0.2, 0.1], aim: [0.0, 0.1, 2.0], power: 1.7, beam_deg: 90.0 };
        let beam = Beam::of(&lamp);
        let mut spots = Spots::default();
        let places = [[0.0, 0.0, 2.0], [1.0, -0.5, 3.0], [-2.0, 0.3, 1.0], [0.3, 0.0, -1.0]];
        for [x, y, z] in places {
            [&mut spots.x, &mut spots.y, &mut spots.z].into_iter().zip([x, y, z]).for_each(|(list, x)| list.push(x));
            [&mut spots.nx, &mut spots.ny, &mut spots.nz]
                .into_iter()
                .zip([0.0, 0.0, -1.0])
                .for_each(|(l, x)| l.push(x));
        }
        let mut found = Vec::new();
        irradiance(&spots, &beam, 0.4, &mut found);
        for (at, found) in places.iter().zip(&found) {
            let offset = nalgebra::Vector3::from(at.map(f64::from)) - nalgebra::Vector3::from(lamp.at);
            let r = offset.norm();
            let exact =
                lamp.intensity(offset.dot(&lamp.axis()) / r) * (offset.z / r).max(0.0) / (r * r) * libm::exp(-0.4 * r);
            assert!((f64::from(*found) - exact).abs() <= 2e-6 * exact + 1e-12, "{found} for {exact}");
        }
    }
}
