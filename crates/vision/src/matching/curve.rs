//! The epipolar curve of a pixel.

use nalgebra::Vector2;
use seafix_geometry::{Pixel, Point, StereoRig};

/// Replaces `curve` by the epipolar curve of left pixel `place` in the right image, between two depths (m).
///
/// It has points about `step` px apart, at most `max`, including those outside the image and excluding those outside
/// the range of the lens model. They are evenly spaced in inverse depth, hence in the image if the cameras are side by
/// side.
pub(super) fn epipolar_curve(
    rig: &StereoRig,
    place: &Pixel,
    [nearest, furthest]: [f64; 2],
    step: f64,
    max: f64,
    curve: &mut Vec<Vector2<f64>>,
) {
    curve.clear();
    let Some(ray) = rig.left().normalize(place) else { return };
    let seen = |inverse: f64| {
        let right = rig.right().project(&(*rig.right_from_left() * Point::from(ray.push(1.0) / inverse)))?;
        Some(Vector2::new(right.u, right.v))
    };
    let (far, mut near) = (1.0 / furthest, 1.0 / nearest);
    let Some(end) = seen(far) else { return };
    // The right camera does not see a point this near, so start at half the inverse depth.
    let mut begin = seen(near);
    while begin.is_none() && near > 2.0 * far {
        near *= 0.5;
        begin = seen(near);
    }
    let Some(begin) = begin else { return };
    let count = ((begin - end).norm() / step).ceil().min(max);
    let places = (0..=count as usize).map(|i| far + (near - far) * i as f64 / count.max(1.0));
    curve.extend(places.filter_map(seen));
}
