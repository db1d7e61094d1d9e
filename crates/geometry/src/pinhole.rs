//! The pinhole camera with lens distortion.

use nalgebra::{Matrix2, Matrix2x3, Vector2};

use crate::{
    distortion::Distortion,
    frame::{Frame, Point},
};

/// A position in an image (px); the centre of the first pixel is (0, 0), u to the right, v down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// The column.
    pub u: f64,
    /// The row.
    pub v: f64,
}

impl Pixel {
    /// The distance to another pixel position (px).
    pub fn distance(&self, other: &Self) -> f64 {
        ((self.u - other.u).powi(2) + (self.v - other.v).powi(2)).sqrt()
    }
}

/// A camera: image size, focal lengths and principal point (px), lens distortion.
///
/// Its field of view is less than 180°, also with an equidistant lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    size: [u32; 2],
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: Distortion,
    monotone_radius: f64,
}

/// The reason why numbers do not describe a camera.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadCamera {
    /// Zero width or height.
    #[error("size = [{0}, {1}]; an image needs a width and a height")]
    Size(u32, u32),
    /// A focal length that is zero, negative or not finite.
    #[error("{name} = {value}; a focal length is a positive number of pixels")]
    FocalLength {
        /// The parameter: `fx` or `fy`.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A principal point outside the image or not finite.
    #[error("{name} = {value}; the principal point must lie in the image, 0 to {limit}")]
    PrincipalPoint {
        /// The parameter: `cx` or `cy`.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The width or height of the image.
        limit: u32,
    },
    /// A number of distortion coefficients that fits no known model.
    #[error(
        "distortion has {0} numbers; plumb_bob has 0, 4 (k1 k2 p1 p2), 5 (+ k3), 8 (+ k4 k5 k6) or 12 (+ s1 s2 s3 s4)"
    )]
    DistortionLength(usize),
    /// A number of coefficients that an equidistant lens does not have.
    #[error("distortion has {0} numbers; an equidistant lens has 4, k1 k2 k3 k4")]
    EquidistantLength(usize),
    /// A tilted sensor, the last two of fourteen coefficients.
    #[error("distortion has a tilted sensor, τx = {0}, τy = {1}; calibrate without CALIB_TILTED_MODEL")]
    Tilted(f64, f64),
    /// A distortion coefficient that is not finite.
    #[error("distortion[{index}] = {value}; give finite numbers")]
    DistortionValue {
        /// Its index in the list, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
}

impl Pinhole {
    /// A camera with this image size, fx, fy, cx, cy (px) and lens distortion.
    ///
    /// The distortion has 0, 4, 5, 8 or 12 coefficients, or 14 whose last two are zero.
    ///
    /// # Errors
    /// A [`BadCamera`] that names the invalid number.
    pub fn new(size: [u32; 2], focal: [f64; 2], principal: [f64; 2], distortion: &[f64]) -> Result<Self, BadCamera> {
        let distortion = match distortion {
            [rest @ .., tx, ty] if rest.len() == 12 && tx.is_finite() && ty.is_finite() => {
                if [*tx, *ty] != [0.0; 2] {
                    return Err(BadCamera::Tilted(*tx, *ty));
                }
                rest
            }
            all => all,
        };
        if ![0, 4, 5, 8, 12].contains(&distortion.len()) {
            return Err(BadCamera::DistortionLength(distortion.len()));
        }
        let coefficients = finite(distortion)?;
        Self::build(size, focal, principal, Distortion::pinhole(coefficients))
    }

    /// A camera with an equidistant lens, k1 k2 k3 k4; without coefficients they are zero.
    ///
    /// # Errors
    /// A [`BadCamera`] that names the invalid number.
    pub fn equidistant(
        size: [u32; 2],
        focal: [f64; 2],
        principal: [f64; 2],
        distortion: &[f64],
    ) -> Result<Self, BadCamera> {
        if ![0, 4].contains(&distortion.len()) {
            return Err(BadCamera::EquidistantLength(distortion.len()));
        }
        let [k1, k2, k3, k4, ..] = finite(distortion)?;
        Self::build(size, focal, principal, Distortion::equidistant([k1, k2, k3, k4]))
    }

    fn build(size: [u32; 2], focal: [f64; 2], principal: [f64; 2], distortion: Distortion) -> Result<Self, BadCamera> {
        if size[0] == 0 || size[1] == 0 {
            return Err(BadCamera::Size(size[0], size[1]));
        }
        for (name, value) in ["fx", "fy"].into_iter().zip(focal) {
            if !(value.is_finite() && value > 0.0) {
                return Err(BadCamera::FocalLength { name, value });
            }
        }
        for ((name, value), limit) in ["cx", "cy"].into_iter().zip(principal).zip(size) {
            if !(value.is_finite() && value >= 0.0 && value <= f64::from(limit)) {
                return Err(BadCamera::PrincipalPoint { name, value, limit });
            }
        }
        let monotone_radius = distortion.monotone_radius();
        Ok(Self { size, fx: focal[0], fy: focal[1], cx: principal[0], cy: principal[1], distortion, monotone_radius })
    }

    /// The camera with its principal point moved by `offset` (px).
    pub(crate) fn with_principal_moved(&self, offset: &Vector2<f64>) -> Self {
        Self { cx: self.cx + offset.x, cy: self.cy + offset.y, ..*self }
    }

    /// Width and height of the image.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The focal lengths fx, fy (px).
    pub fn focal(&self) -> [f64; 2] {
        [self.fx, self.fy]
    }

    /// The principal point cx, cy (px).
    pub fn principal(&self) -> [f64; 2] {
        [self.cx, self.cy]
    }

    /// The lens distortion.
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// The projection of a point of the camera's frame.
    ///
    /// `None` if the point is behind the camera or beyond the angle at which the lens model folds back. The pixel may
    /// lie outside the image: see [`contains`](Self::contains).
    pub fn project<F: Frame>(&self, point: &Point<F>) -> Option<Pixel> {
        self.project_with_jacobian(point).map(|(pixel, _)| pixel)
    }

    /// The projection as in [`project`](Self::project), with the derivative of the pixel by the point (px/m).
    pub fn project_with_jacobian<F: Frame>(&self, point: &Point<F>) -> Option<(Pixel, Matrix2x3<f64>)> {
        let [x, y, z] = point.coords.into();
        if !(z > 0.0) {
            return None;
        }
        let n = Vector2::new(x / z, y / z);
        if !(n.norm() < self.monotone_radius) {
            return None;
        }
        let (d, by_n) = self.distortion.distort(&n);
        let n_by_point = Matrix2x3::new(1.0 / z, 0.0, -n.x / z, 0.0, 1.0 / z, -n.y / z);
        let focal = Matrix2::new(self.fx, 0.0, 0.0, self.fy);
        let pixel = Pixel { u: self.fx * d.x + self.cx, v: self.fy * d.y + self.cy };
        Some((pixel, focal * by_n * n_by_point))
    }

    /// The undistorted direction (X/Z, Y/Z) of `pixel`, or `None` if the lens model has no inverse there.
    ///
    /// Newton's iteration on the distortion; it ends when the step falls below 1e-15.
    pub fn normalize(&self, pixel: &Pixel) -> Option<Vector2<f64>> {
        let target = Vector2::new((pixel.u - self.cx) / self.fx, (pixel.v - self.cy) / self.fy);
        let mut n = self.distortion.start(&target);
        for _ in 0..50 {
            let (place, jacobian) = self.distortion.distort(&n);
            let step = jacobian.try_inverse()? * (target - place);
            // A full step far from the axis can cross the fold of the lens model.
            let limit = 0.2 * (1.0 + n.norm());
            n += if step.norm() > limit { step * (limit / step.norm()) } else { step };
            if step.norm() < 1e-15 {
                break;
            }
        }
        let (place, _) = self.distortion.distort(&n);
        let missed = (place - target).norm() > 1e-12;
        (!missed && n.norm() < self.monotone_radius).then_some(n)
    }

    /// Whether `pixel` lies in the image, at least `margin` pixels from the centres of its border pixels.
    pub fn contains(&self, pixel: &Pixel, margin: f64) -> bool {
        let inside = |x: f64, n: u32| x >= margin && x <= f64::from(n - 1) - margin;
        inside(pixel.u, self.size[0]) && inside(pixel.v, self.size[1])
    }
}

/// The coefficients, filled up with zeros.
fn finite(distortion: &[f64]) -> Result<[f64; 12], BadCamera> {
    let mut coefficients = [0.0; 12];
    for (index, &value) in distortion.iter().enumerate() {
        if !value.is_finite() {
            return Err(BadCamera::DistortionValue { index, value });
        }
        coefficients[index] = value;
    }
    Ok(coefficients)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Camera;

    fn camera(distortion: &[f64]) -> Pinhole {
        Pinhole::new([640, 480], [533.4, 533.5], [342.5, 234.7], distortion).unwrap()
    }

    #[test]
    fn a_point_on_the_axis_is_seen_at_the_principal_point() {
        let pixel = camera(&[-0.28, 0.04, 0.001, -0.0001, 0.12]).project(&Point::<Camera>::new(0.0, 0.0, 2.0));
        assert_eq!(pixel, Some(Pixel { u: 342.5, v: 234.7 }));
    }

    #[test]
    fn undistorting_undoes_distortion_over_the_full_image() {
        for coefficients in [
            &[-0.28, 0.04, 0.001, -0.0001, 0.12][..],
            &[-0.3, 0.1, 1e-3, 2e-3],
            &[0.4, 0.2, 0.0, 0.0, 0.1, 0.5, 0.1, 0.02],
        ] {
            let camera = camera(coefficients);
            for (u, v) in [(0.0, 0.0), (639.0, 479.0), (320.0, 0.0), (600.0, 240.0), (342.5, 234.7)] {
                let n = camera.normalize(&Pixel { u, v }).unwrap();
                let back = camera.project(&Point::<Camera>::new(n.x, n.y, 1.0)).unwrap();
                assert!(back.distance(&Pixel { u, v }) < 1e-9, "{coefficients:?} at {u}, {v}: {back:?}");
            }
        }
    }

    #[test]
    fn beyond_the_fold_of_the_lens_nothing_is_seen() {
        assert_eq!(camera(&[-0.28, 0.0, 0.0, 0.0]).project(&Point::<Camera>::new(5.0, 0.0, 1.0)), None);
        assert_eq!(camera(&[]).project(&Point::<Camera>::new(0.0, 0.0, -1.0)), None);
    }

    #[test]
    fn numbers_that_are_no_camera_are_rejected() {
        assert!(matches!(Pinhole::new([640, 480], [0.0, 1.0], [1.0, 1.0], &[]), Err(BadCamera::FocalLength { .. })));
        assert!(matches!(
            Pinhole::new([640, 480], [1.0, f64::NAN], [1.0, 1.0], &[]),
            Err(BadCamera::FocalLength { .. })
        ));
        assert!(matches!(
            Pinhole::new([640, 480], [1.0, 1.0], [700.0, 1.0], &[]),
            Err(BadCamera::PrincipalPoint { .. })
        ));
        assert!(matches!(
            Pinhole::new([640, 480], [1.0, 1.0], [1.0, 1.0], &[0.1]),
            Err(BadCamera::DistortionLength(1))
        ));
    }
}
