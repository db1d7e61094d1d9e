//! Straight edges: a segment in one image, and a line measured by the stereo rig.

use nalgebra::{Matrix4, Vector2, Vector3};

use crate::{
    frame::{Camera, Point},
    pinhole::Pixel,
};

/// A measured offset of a straight image edge: one scalar, across the edge.
///
/// The projection q of any point of the edge has the residual nᵀ(q − `at`) (px); a displacement along the edge costs
/// nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalOffset {
    /// The place on the fitted edge (px).
    pub at: Pixel,
    /// The unit normal of the edge in the image.
    pub normal: Vector2<f64>,
    /// The standard deviation of the offset along the normal (px), all causes together.
    pub sigma: f64,
    /// The standard deviation of what the scene adds at this place, such as texture across the edge (px).
    ///
    /// Both images see it: the offsets at the same half of the other segment have the same error.
    pub texture: f64,
    /// The standard deviation of what the scene adds along the whole edge, such as an uneven step (px).
    ///
    /// All four offsets of a line have it in common.
    pub common: f64,
}

/// A straight segment in one image as two normal offsets.
///
/// A line fitted to n samples of noise s has the information of two independent offsets of variance 2s²/n at the
/// samples' centre ± their RMS distance from it. What the scene adds to them is described by
/// [`StereoSegments::covariance`].
pub type UncertainSegment = [NormalOffset; 2];

/// The segments of a line in both images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoSegments {
    /// The segment in the left image.
    pub left: UncertainSegment,
    /// The segment in the right image.
    pub right: UncertainSegment,
}

impl StereoSegments {
    /// The covariance (px²) of the four offsets, left before right.
    ///
    /// With σ, t and c the deviations of [`NormalOffset`], images a and b, and halves k and l:
    /// Σ(ak, bl) = δ_ab δ_kl (σ² − t² − c²) + δ_kl t_a t_b + c_a c_b. The normals of both segments point to the same side.
    pub fn covariance(&self) -> Matrix4<f64> {
        let all = [&self.left[0], &self.left[1], &self.right[0], &self.right[1]];
        Matrix4::from_fn(|i, k| {
            let (a, b) = (all[i], all[k]);
            let texture = if i % 2 == k % 2 { a.texture * b.texture } else { 0.0 };
            if i == k { a.sigma * a.sigma } else { texture + a.common * b.common }
        })
    }
}

/// A straight edge measured by the stereo rig, not yet identified.
///
/// Only its offsets are measured: the ends say where the edge was seen, not where it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredLine {
    /// Two places on the line, as far apart as the edge was seen in both images.
    pub ends: [Point<Camera>; 2],
    /// The covariance (m²) of the offsets of the first end along the two [`across`](Self::across) and of the second end.
    pub offsets: Matrix4<f64>,
    /// The segments in both images; `None` for a line that does not come from images.
    pub segments: Option<StereoSegments>,
    /// Whether the stereo rig measures the line's depth; `false` close to the epipolar planes. Such a line supports a
    /// pose and does not propose one.
    pub depth: bool,
}

impl MeasuredLine {
    /// The unit direction from the first end to the second.
    pub fn direction(&self) -> Vector3<f64> {
        (self.ends[1] - self.ends[0]).normalize()
    }

    /// Two unit vectors across the line, along which [`offsets`](Self::offsets) are measured.
    pub fn across(&self) -> [Vector3<f64>; 2] {
        across(&self.direction())
    }
}

/// Two unit vectors that complete a unit direction d to a right-handed basis (n₁, n₂, d).
///
/// n₁ is e − d(dᵀe), normalised, with e the coordinate axis of the smallest |dᵀe|, the first of equals; n₂ = d × n₁.
pub fn across(direction: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let mut axis = Vector3::zeros();
    axis[direction.iamin()] = 1.0;
    let first = (axis - direction * direction.dot(&axis)).normalize();
    [first, direction.cross(&first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent noise, texture at each half, and a common part, drawn apart: the sums of the deviations' products.
    #[test]
    fn offsets_have_the_texture_in_common() {
        let offset = |noise: f64, texture: f64, common: f64| NormalOffset {
            at: Pixel { u: 0.0, v: 0.0 },
            normal: Vector2::x(),
            sigma: (noise * noise + texture * texture + common * common).sqrt(),
            texture,
            common,
        };
        let parts = [[0.1, 0.2, 0.3], [0.2, 0.1, 0.4], [0.3, 0.3, 0.2], [0.1, 0.4, 0.1]];
        let [a, b, c, d] = parts.map(|[noise, texture, common]| offset(noise, texture, common));
        // One column for each source of error: four of noise, two of texture, the common one.
        let causes = nalgebra::SMatrix::<f64, 4, 7>::from_fn(|i, cause| match cause {
            0..4 => f64::from(u8::from(cause == i)) * parts[i][0],
            4 | 5 => f64::from(u8::from(cause - 4 == i % 2)) * parts[i][1],
            _ => parts[i][2],
        });
        let covariance = StereoSegments { left: [a, b], right: [c, d] }.covariance();
        assert!((covariance - causes * causes.transpose()).norm() < 1e-15, "{covariance}");
    }

    #[test]
    fn across_completes_a_right_handed_basis() {
        for d in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [1.0, 2.0, -3.0]] {
            let d = Vector3::from(d).normalize();
            let [first, second] = across(&d);
            assert!((first.cross(&second) - d).norm() < 1e-15);
            assert!(first.dot(&d).abs() < 1e-15);
        }
    }
}
