//! The true camera: a pinhole with distortion behind a port.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use seafix_geometry::{BadCamera, Camera, Pinhole, Pixel, Point};

use super::port::{Port, PortKind, Ray};

/// A camera behind its port. Its frame is that of the camera in air, with the origin in the pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    camera: Pinhole,
    port: Port,
}

impl Lens {
    /// Places a camera behind a port.
    pub fn new(camera: Pinhole, port: Port) -> Self {
        Self { camera, port }
    }

    /// The camera in air.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// The port.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Whether it is an ideal pinhole, which maps lines to lines.
    pub fn is_straight(&self) -> bool {
        self.port.kind == PortKind::None && self.camera.distortion().is_none()
    }

    /// The ray in the water of a pixel.
    pub fn ray(&self, pixel: &Pixel) -> Option<Ray> {
        self.port.refract(&self.camera.normalize(pixel)?)
    }

    /// The projection of a point of the camera's frame, inside the image or not.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Pixel> {
        let n = self.port.trace(point)?;
        self.camera.project(&Point::<Camera>::from(n.push(1.0)))
    }

    /// The pinhole camera that a calibration in water at the distance `range` (m) gives.
    ///
    /// Its Brown distortion (k1 k2 p1 p2 k3) fits best over the image; its origin is the pupil. Linear least squares
    /// over a grid of pixels solves for (cx, cy, f, f k1, f k2, f k3, f p1, f p2). Without a port the result is the
    /// camera itself.
    ///
    /// # Errors
    /// The fit is no camera, because no pinhole describes the port.
    pub fn calibrated(&self, range: f64) -> Result<Pinhole, BadCamera> {
        if self.port.kind == PortKind::None {
            return Ok(self.camera);
        }
        const GRID: u32 = 25;
        let size = self.camera.size();
        let (mut rows, mut seen) = (Vec::new(), Vec::new());
        for i in 0..GRID {
            for j in 0..GRID {
                let [u, v] =
                    [(i, size[0]), (j, size[1])].map(|(k, n)| f64::from(k) / f64::from(GRID - 1) * f64::from(n - 1));
                let Some(ray) = self.ray(&Pixel { u, v }) else { continue };
                let at = ray.from + ray.along * (range - ray.from.z);
                let n = Vector2::new(at.x / at.z, at.y / at.z);
                let r2 = n.norm_squared();
                let bent = [2.0 * n.x * n.y, r2 + 2.0 * n.x * n.x, r2 + 2.0 * n.y * n.y];
                let radial = |x: f64| [x, x * r2, x * r2 * r2, x * r2 * r2 * r2];
                let ([a, b, c, d], [e, f, g, h]) = (radial(n.x), radial(n.y));
                rows.extend([1.0, 0.0, a, b, c, d, bent[0], bent[1]]);
                rows.extend([0.0, 1.0, e, f, g, h, bent[2], bent[0]]);
                seen.extend([u, v]);
            }
        }
        let design = DMatrix::from_row_slice(seen.len(), 8, &rows);
        let target = DVector::from_vec(seen);
        let normal = design.transpose() * &design;
        let fit =
            normal.cholesky().map(|c| c.solve(&(design.transpose() * target))).unwrap_or_else(|| DVector::zeros(8));
        let f = fit[2];
        let distortion = [fit[3] / f, fit[4] / f, fit[6] / f, fit[7] / f, fit[5] / f];
        Pinhole::new(size, [f, f], [fit[0], fit[1]], &distortion)
    }

    /// The middle of an image side without a ray, if there is one. Corners may be dark, as with real lenses.
    pub(crate) fn blind(&self) -> Option<Pixel> {
        let [w, h] = self.camera.size().map(|n| f64::from(n - 1));
        let middles = [[0.0, 0.5 * h], [w, 0.5 * h], [0.5 * w, 0.0], [0.5 * w, h]];
        middles.map(|[u, v]| Pixel { u, v }).into_iter().find(|pixel| self.ray(pixel).is_none())
    }

    /// The angle between optical axis and farthest image corner (rad): in air, and in water behind a flat port.
    pub(crate) fn half_diagonal(&self) -> f64 {
        let [w, h] = self.camera.size().map(|n| f64::from(n - 1));
        [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]]
            .into_iter()
            .filter_map(|[u, v]| self.camera.normalize(&Pixel { u, v }))
            .map(|n| libm::atan(n.norm()))
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(focal: f64, distortion: &[f64]) -> Pinhole {
        Pinhole::new([1024, 768], [focal; 2], [511.5, 383.5], distortion).unwrap()
    }

    fn pixels() -> impl Iterator<Item = Pixel> {
        (0..9).flat_map(|i| (0..7).map(move |j| Pixel { u: 127.0 * f64::from(i) + 0.3, v: 127.0 * f64::from(j) + 0.7 }))
    }

    #[test]
    fn pixel_to_ray_and_back() {
        let flat = Port { kind: PortKind::Flat, ..Port::default() };
        let dome = Port { kind: PortKind::Dome, offset: [0.002, 0.0, 0.003], ..Port::default() };
        for port in [Port::default(), flat, dome] {
            let lens = Lens::new(camera(500.0, &[-0.1, 0.02, 1e-3, -5e-4, 0.0]), port);
            for pixel in pixels() {
                let ray = lens.ray(&pixel).unwrap();
                let seen = lens.project(&(ray.from + ray.along * 3.0)).unwrap();
                assert!(seen.distance(&pixel) < 1e-6, "{pixel:?} {seen:?}");
            }
        }
    }

    #[test]
    fn an_image_whose_side_sees_nothing_is_reported() {
        let blind = |distortion: &[f64], port: Port| Lens::new(camera(500.0, distortion), port).blind();
        assert_eq!(blind(&[-0.1, 0.02, 1e-3, -5e-4], Port::default()), None);
        assert_eq!(blind(&[], Port { kind: PortKind::Flat, ..Port::default() }), None);
        assert_eq!(blind(&[-5.0, 0.0, 0.0, 0.0], Port::default()), Some(Pixel { u: 0.0, v: 383.5 }));
    }

    /// The errors (px) of the calibrated camera for points at this distance.
    fn errors(lens: &Lens, depth: f64) -> Vec<f64> {
        let nominal = lens.calibrated(3.0).unwrap();
        pixels()
            .filter_map(|pixel| {
                let ray = lens.ray(&pixel)?;
                let at = ray.from + ray.along * (depth - ray.from.z);
                Some(nominal.project(&Point::<Camera>::from(at))?.distance(&pixel))
            })
            .collect()
    }

    #[test]
    fn a_flat_port_is_good_at_its_calibration_distance_and_bad_near() {
        let lens = Lens::new(camera(500.0, &[]), Port { kind: PortKind::Flat, ..Port::default() });
        let nominal = lens.calibrated(3.0).unwrap();
        // The effective focal length in water is about n times that in air.
        assert!((nominal.focal()[0] - 668.0).abs() < 4.0, "{:?}", nominal.focal());
        let max = |depth| errors(&lens, depth).into_iter().fold(0.0, f64::max);
        assert!(max(3.0) < 0.2, "{}", max(3.0));
        assert!(max(1.0) > 5.0, "{}", max(1.0));
    }

    #[test]
    fn a_decentred_dome_is_absorbed_by_the_calibration() {
        let port = Port { kind: PortKind::Dome, thickness: 0.005, offset: [0.0, 0.0, 0.005], ..Port::default() };
        let lens = Lens::new(camera(500.0, &[]), port);
        let max = |depth| errors(&lens, depth).into_iter().fold(0.0, f64::max);
        assert!(max(3.0) < 0.05 && max(2.0) < 0.3 && max(1.0) > max(2.0), "{} {}", max(3.0), max(1.0));
        let centred = Lens::new(camera(500.0, &[]), Port { kind: PortKind::Dome, ..Port::default() });
        let nominal = centred.calibrated(3.0).unwrap();
        assert!((nominal.focal()[0] - 500.0).abs() < 1e-6);
    }
}
