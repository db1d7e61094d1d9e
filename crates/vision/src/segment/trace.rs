//! The image of a straight edge, and the steps across it.

use nalgebra::{Matrix2, Vector2};
use seafix_geometry::{Camera, Pinhole, Pixel, Point};

use super::step::{Fitted, Normal, Step};
use crate::image::Image;

/// A straight line between two directions, as an image shows it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trace<'a> {
    image: &'a Image,
    camera: &'a Pinhole,
    pub(super) ends: [Vector2<f64>; 2],
    bent: bool,
}

/// A place of the trace.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) at: Pixel,
    /// The unit normal in the image, on the brighter side.
    pub(super) normal: Vector2<f64>,
    /// The displacement along the normal (px) for a displacement of the direction across the line.
    pub(super) gain: f64,
}

impl Place {
    fn moved(self, u: f64, v: f64) -> Self {
        Self { at: Pixel { u: self.at.u + u, v: self.at.v + v }, ..self }
    }
}

/// A step across the trace.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// The position along the line, 0 at the first end and 1 at the second.
    pub(super) along: f64,
    pub(super) gain: f64,
    pub(super) fitted: Option<Fitted>,
}

impl<'a> Trace<'a> {
    pub(super) fn new(image: &'a Image, camera: &'a Pinhole, ends: [Vector2<f64>; 2]) -> Self {
        Self { image, camera, ends, bent: !camera.distortion().shortest().is_empty() }
    }

    /// The same image and camera with another line.
    pub(super) fn moved(&self, ends: [Vector2<f64>; 2]) -> Self {
        Self { ends, ..*self }
    }

    fn step(&self) -> Vector2<f64> {
        self.ends[1] - self.ends[0]
    }

    /// The unit vector across the directions, towards the brighter side.
    pub(super) fn across(&self) -> Vector2<f64> {
        let d = self.step().normalize();
        Vector2::new(-d.y, d.x)
    }

    /// The pixel at the position `along`, with the derivative by the direction.
    fn seen(&self, along: f64) -> Option<(Pixel, Matrix2<f64>)> {
        let direction = self.ends[0] + self.step() * along;
        let (pixel, j) = self.camera.project_with_jacobian(&Point::<Camera>::new(direction.x, direction.y, 1.0))?;
        Some((pixel, j.fixed_columns::<2>(0).into_owned()))
    }

    /// The place at the position `along`.
    pub(super) fn place(&self, along: f64) -> Option<Place> {
        let (at, j) = self.seen(along)?;
        let t = (j * self.step()).normalize();
        let normal = Vector2::new(-t.y, t.x);
        Some(Place { at, normal, gain: normal.dot(&(j * self.across())) })
    }

    /// The length in the image (px), as a chord.
    pub(super) fn length(&self) -> Option<f64> {
        Some(self.seen(0.0)?.0.distance(&self.seen(1.0)?.0))
    }

    /// Replaces `crossings` by the steps at each column, or each row of a steep line, from `extra` px before the first
    /// end to as much after the second, within `window` px of the line.
    ///
    /// Whole pixels of a column enter with their distances from the line; interpolation would blur one side more.
    pub(super) fn crossings(
        &self,
        blur: f64,
        window: f64,
        extra: f64,
        crossings: &mut Vec<Crossing>,
        mut levels: impl FnMut(usize, f64, f64),
    ) -> Option<()> {
        crossings.clear();
        let (from, to) = (self.seen(0.0)?.0, self.seen(1.0)?.0);
        let flat = (to.u - from.u).abs() >= (to.v - from.v).abs();
        let pick = |pixel: &Pixel| if flat { (pixel.u, pixel.v) } else { (pixel.v, pixel.u) };
        let ((begin, _), (end, _)) = (pick(&from), pick(&to));
        let sign = (end - begin).signum();
        let steps = ((end - begin).abs() + 2.0 * extra) as i64;
        let (width, height) = (self.image.width() as i64, self.image.height() as i64);
        let (major, minor) = if flat { (width, height) } else { (height, width) };
        let pixels = self.image.pixels();
        let (normal, inverse) = (Normal::table(), 1.0 / blur);
        let even = if self.bent { None } else { Some(self.place(0.0)?) };
        let first = (begin - sign * extra).round() as i64;
        for k in 0..=steps {
            let x = first + k * sign as i64;
            if x < 0 || x >= major {
                continue;
            }
            let mut along = (x as f64 - begin) / (end - begin);
            if self.bent {
                for _ in 0..2 {
                    let (at, j) = self.seen(along)?;
                    let tangent = j * self.step();
                    along += (x as f64 - pick(&at).0) / if flat { tangent.x } else { tangent.y };
                }
            }
            // Without distortion the image of the line is straight and evenly spaced.
            let place = match even {
                Some(place) => place.moved((to.u - from.u) * along, (to.v - from.v) * along),
                None => self.place(along)?,
            };
            let (_, centre) = pick(&place.at);
            let slope = if flat { place.normal.y } else { place.normal.x };
            let half = window / slope.abs();
            let (low, high) = ((centre - half).ceil() as i64, (centre + half).floor() as i64);
            let mut fitted = None;
            if low >= 0 && high < minor {
                let mut step = Step::default();
                for y in low..=high {
                    let index = if flat { y * width + x } else { x * width + y };
                    let (t, level) = (slope * (y as f64 - centre), f64::from(pixels[index as usize]));
                    step.add(normal, t, inverse, level);
                    levels(crossings.len(), t, level);
                }
                fitted = step.solve();
            }
            crossings.push(Crossing { along, gain: place.gain, fitted });
        }
        Some(())
    }
}
