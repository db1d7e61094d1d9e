//! The port between camera and water: none, a dome, or a flat plate.

use nalgebra::{Vector2, Vector3};
use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

/// Tangent of the angle beyond which a flat port transmits nearly nothing.
const GRAZING: f64 = 12.0;

/// A ray in the water, in the camera's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Point of entry into the water; the pupil without a port.
    pub from: Vector3<f64>,
    /// Direction, with z = 1.
    pub along: Vector3<f64>,
}

/// The kinds of port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum PortKind {
    /// No port: the ideal camera of the paper.
    #[default]
    None,
    /// A spherical dome.
    Dome,
    /// A plane-parallel plate perpendicular to the optical axis.
    Flat,
}

/// A port with exact refraction at both surfaces (Snell's law).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Port {
    /// Kind of the port.
    pub kind: PortKind,
    /// Distance from the pupil to a flat port (m), from 0 to 1.
    pub distance: f64,
    /// Thickness of the glass (m), from 0 to 0.2.
    pub thickness: f64,
    /// Inner radius of a dome (m), from 0.01 to 1.
    pub radius: f64,
    /// Centre of a dome in the camera's frame (m); zero is centred. It lies within 0.9 of the radius from the pupil.
    pub offset: [f64; 3],
    /// Refractive index of the glass, from 1 to 3. The default is crown glass.
    pub glass: f64,
    /// Refractive index of the water, from 1 to 2. The default is sea water.
    pub water: f64,
}

impl Default for Port {
    fn default() -> Self {
        Self {
            kind: PortKind::None,
            distance: 0.03,
            thickness: 0.01,
            radius: 0.05,
            offset: [0.0; 3],
            glass: 1.52,
            water: 1.34,
        }
    }
}

impl Port {
    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// The first number outside its range: `name = value; give range`.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, x: f64, low: f64, high: f64| {
            in_range(x >= low && x <= high, &format!("port.{name}"), x, &format!("a number from {low} to {high}"))
        };
        within("distance", self.distance, 0.0, 1.0)?;
        within("thickness", self.thickness, 0.0, 0.2)?;
        within("radius", self.radius, 0.01, 1.0)?;
        within("glass", self.glass, 1.0, 3.0)?;
        within("water", self.water, 1.0, 2.0)?;
        let off = Vector3::from(self.offset).norm();
        let range = format!("a centre within 0.9 of the radius of {} m from the pupil", self.radius);
        in_range(off < 0.9 * self.radius, "port.offset", format!("{:?}", self.offset), &range)
    }

    /// The ray in the water for the direction (x, y, 1) in air; `None` under total reflection.
    pub fn refract(&self, direction: &Vector2<f64>) -> Option<Ray> {
        let air = direction.push(1.0);
        match self.kind {
            PortKind::None => Some(Ray { from: Vector3::zeros(), along: air }),
            PortKind::Flat if direction.norm() > GRAZING => None,
            PortKind::Flat => {
                let unit = air.normalize();
                let (glass, water) = (bent(&unit, self.glass), bent(&unit, self.water));
                let from = air * self.distance + glass * (self.thickness / glass.z);
                Some(Ray { from, along: water / water.z })
            }
            PortKind::Dome => {
                let centre = Vector3::from(self.offset);
                let unit = air.normalize();
                let inner = leave(&Vector3::zeros(), &unit, &centre, self.radius)?;
                let glass = snell(&unit, &((inner - centre) / self.radius), 1.0 / self.glass)?;
                let radius = self.radius + self.thickness;
                let outer = leave(&inner, &glass, &centre, radius)?;
                let water = snell(&glass, &((outer - centre) / radius), self.glass / self.water)?;
                (water.z > 1e-6).then(|| Ray { from: outer, along: water / water.z })
            }
        }
    }

    /// The direction (x, y, 1) in air of a point in the water, the inverse of [`refract`](Self::refract).
    ///
    /// Newton's iteration with a damped step, to 1e-14.
    pub fn trace(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        if !(point.z > 0.0) {
            return None;
        }
        let straight = point.xy() / point.z;
        if self.kind == PortKind::None {
            return Some(straight);
        }
        // Offset of the ray from the point, in the plane of the point.
        let miss = |n: &Vector2<f64>| {
            let ray = self.refract(n)?;
            let depth = point.z - ray.from.z;
            (depth > 0.0).then(|| (ray.from + ray.along * depth - point).xy() / point.z)
        };
        let mut n = straight;
        let mut error = miss(&n)?;
        for _ in 0..60 {
            const H: f64 = 1e-6;
            let column = |step: Vector2<f64>| Some((miss(&(n + step))? - miss(&(n - step))?) / (2.0 * H));
            let jacobian =
                nalgebra::Matrix2::from_columns(&[column(Vector2::new(H, 0.0))?, column(Vector2::new(0.0, H))?]);
            let mut step = jacobian.try_inverse()? * -error;
            // The step is halved until it helps: near the critical angle a full step overshoots.
            let mut better = None;
            for _ in 0..30 {
                if let Some(there) = miss(&(n + step)).filter(|there| there.norm() < error.norm()) {
                    better = Some(there);
                    break;
                }
                step *= 0.5;
            }
            let Some(there) = better else { break };
            (n, error) = (n + step, there);
            if error.norm() < 1e-15 {
                break;
            }
        }
        (error.norm() < 1e-12).then_some(n)
    }
}

/// The refracted direction in a medium of index `n` behind planes across z.
fn bent(unit: &Vector3<f64>, n: f64) -> Vector3<f64> {
    let (x, y) = (unit.x / n, unit.y / n);
    Vector3::new(x, y, (1.0 - x * x - y * y).sqrt())
}

/// The exit point of a ray from inside a ball.
fn leave(from: &Vector3<f64>, unit: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
    let to = from - centre;
    let half = to.dot(unit);
    let rest = half * half - to.norm_squared() + radius * radius;
    (rest >= 0.0).then(|| from + unit * (rest.sqrt() - half))
}

/// Snell's law for a unit direction and the unit normal on its far side; `ratio` is n before / n behind.
fn snell(unit: &Vector3<f64>, normal: &Vector3<f64>, ratio: f64) -> Option<Vector3<f64>> {
    let cosine = unit.dot(normal);
    let rest = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    (rest >= 0.0).then(|| unit * ratio + normal * (rest.sqrt() - ratio * cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> impl Iterator<Item = Vector2<f64>> {
        (0..11).flat_map(|i| (0..9).map(move |j| Vector2::new(0.2 * f64::from(i) - 1.0, 0.18 * f64::from(j) - 0.75)))
    }

    fn flat() -> Port {
        Port { kind: PortKind::Flat, ..Port::default() }
    }

    fn dome(offset: [f64; 3]) -> Port {
        Port { kind: PortKind::Dome, thickness: 0.005, offset, ..Port::default() }
    }

    #[test]
    fn a_centred_dome_and_a_flat_port_of_water_are_no_port() {
        for n in directions() {
            let ray = dome([0.0; 3]).refract(&n).unwrap();
            assert!((ray.along.xy() - n).norm() < 1e-14 && (ray.from / ray.from.z - n.push(1.0)).norm() < 1e-13);
            let clear = Port { glass: 1.0, water: 1.0, ..flat() }.refract(&n).unwrap();
            assert!((clear.along.xy() - n).norm() < 1e-14);
        }
    }

    #[test]
    fn refraction_keeps_n_sine() {
        // Regression: indices off by 1e-9 fail this test.
        for n in directions() {
            let sine = |d: Vector3<f64>| d.xy().norm() / d.norm();
            let ray = flat().refract(&n).unwrap();
            assert!((1.34 * sine(ray.along) - sine(n.push(1.0))).abs() < 1e-15);
            // A sphere conserves n times the distance of the ray from the centre.
            let port = dome([0.004, -0.002, 0.005]);
            let ray = port.refract(&n).unwrap();
            let centre = Vector3::from(port.offset);
            let lever = |from: Vector3<f64>, d: Vector3<f64>| (from - centre).cross(&d).norm() / d.norm();
            let air = lever(Vector3::zeros(), n.push(1.0));
            assert!((1.34 * lever(ray.from, ray.along) - air).abs() < 1e-12);
        }
    }

    #[test]
    fn a_thin_near_port_is_the_tangent_of_the_refracted_angle() {
        let port = Port { distance: 0.0, thickness: 0.0, ..flat() };
        for n in directions() {
            let ray = port.refract(&n).unwrap();
            let angle = libm::asin(libm::sin(libm::atan(n.norm())) / 1.34);
            assert!((ray.along.xy().norm() - libm::tan(angle)).abs() < 1e-14 && ray.from.norm() < 1e-15);
        }
    }

    #[test]
    fn points_are_traced_to_the_rays_that_meet_them() {
        for port in [flat(), dome([0.0; 3]), dome([0.003, 0.002, -0.005]), Port::default()] {
            for n in directions() {
                for depth in [0.5, 2.0, 9.0] {
                    let ray = port.refract(&n).unwrap();
                    let point = ray.from + ray.along * (depth - ray.from.z);
                    let found = port.trace(&point).unwrap();
                    assert!((found - n).norm() < 1e-9, "{:?} {n:?} {depth}: {found:?}", port.kind);
                }
            }
        }
        // No ray beyond the critical angle passes a flat port.
        assert_eq!(flat().trace(&Vector3::new(3.0, 0.0, 1.0)), None);
    }
}
