//! Point clouds in the format PLY, for MeshLab, CloudCompare and Open3D.

use seafix_geometry::MeasuredPoint;
use seafix_vision::Image;

/// `cloud` as binary PLY: position (m, in the left camera), grey value of the left image,
/// and standard deviation of the position (m, √ of the covariance's trace).
pub(crate) fn ply(cloud: &[MeasuredPoint], left: &Image) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment left camera: x right, y down, z forward; metres\n\
         element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float sigma\nend_header\n",
        cloud.len()
    )
    .into_bytes();
    for point in cloud {
        let at = point.position.at.coords;
        at.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        let grey = point.pixels.map_or(255, |pixels| grey(left, pixels.at.left.u, pixels.at.left.v));
        bytes.extend([grey; 3]);
        bytes.extend((point.position.covariance.trace().sqrt() as f32).to_le_bytes());
    }
    bytes
}

/// The grey value of the pixel nearest to (u, v).
fn grey(image: &Image, u: f64, v: f64) -> u8 {
    let nearest = |x: f64, size: usize| (x.round().max(0.0) as usize).min(size - 1);
    image.row(nearest(v, image.height()))[nearest(u, image.width())].round().clamp(0.0, 255.0) as u8
}
