//! Edges, gates and covariances drawn as dots: viewers that read no scenes read clouds.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, SymmetricEigen, UnitQuaternion, Vector3};
use seafix_geometry::{Camera, Frame, Object, Point, Transform, World};

use crate::{
    proto::foxglove::PointCloud,
    record::{ExactPose, FrameRecord, Line, TargetRecord, TrialHeader},
    topic,
};

use super::{
    clouds::{Dot, cloud},
    names::{CAMERAS, SPS, WORLD},
    rigid::Places,
    values::colour,
};

/// The 0.99 quantile of χ² with three degrees of freedom, the size of the default gate.
const GATE: f64 = 11.344_866_730_144_373;
/// The semi-axes of the ellipsoid of a fix, in standard deviations.
const SIGMAS: f64 = 3.0;
/// The distance of the dots of a line (m), smaller than the balls that mark points.
const SPACING: f64 = 0.02;
/// The maximum number of dots of a line; those of a longer line are farther apart.
const MAX_DOTS: usize = 100;
/// The number of dots of each of the three ellipses of an ellipsoid.
const ELLIPSE: usize = 32;
/// Cosine and sine of the angle between two dots, π/16.
const STEP: [f64; 2] = [0.980_785_280_403_230_4, 0.195_090_322_016_128_27];
const WHITE: [u8; 3] = [255; 3];
/// The colour of truth in all viewers.
const TRUTH: [u8; 3] = [0, 158, 115];

/// The straight edges of the placed targets in the site's frame.
pub(crate) fn model_edges(header: &TrialHeader, places: &Places, stamp_ns: u64) -> PointCloud {
    let placed = header.targets.iter().enumerate();
    let placed = placed.filter_map(|(index, target)| Some((index, target, places.of_target(&target.id)?)));
    let dots = placed.flat_map(|(index, target, place)| {
        target.edges.iter().zip(0..).flat_map(move |(edge, number)| {
            let ends = edge.ends.map(|end| (*place * Point::<Object>::from(end)).coords);
            along(ends).map(move |at| Dot { at: at.into(), number, colour: colour(index) })
        })
    });
    cloud(SPS, "edge_index", dots, stamp_ns)
}

/// The measured lines of known depth, white, and the identified ones in the colours of their targets.
pub(crate) fn measured_lines(header: &TrialHeader, frame: &FrameRecord) -> PointCloud {
    let own = |number: u32| {
        let target = frame.targets.iter().find(|target| target.edges.iter().any(|pair| pair.line == number))?;
        header.targets.iter().position(|model| model.id == target.object)
    };
    let known = |(line, _): &(&Line, u32)| line.depth;
    let dots = frame.lines.iter().zip(0..).filter(known).flat_map(|(line, number)| {
        let colour = own(number).map_or(WHITE, colour);
        along(line.ends.map(Vector3::from)).map(move |at| Dot { at: at.into(), number, colour })
    });
    cloud(CAMERAS[0], "line_index", dots, frame.stamp_ns)
}

/// The gates of the attempted targets: the points as the prior predicts them, in the frame of the left camera, with the
/// ellipsoids of the prior's covariance. The noise of a measured point, which a gate adds, is not included.
///
/// A navigator searches about its own pose, hence its frames have none; points behind the camera have none.
pub(crate) fn gates(header: &TrialHeader, places: &Places, frame: &FrameRecord) -> PointCloud {
    cloud(CAMERAS[0], "model_index", gate_dots(header, places, frame).unwrap_or_default(), frame.stamp_ns)
}

fn gate_dots(header: &TrialHeader, places: &Places, frame: &FrameRecord) -> Option<Vec<Dot>> {
    let (pose, rows) = frame.inputs.as_ref().filter(|_| frame.navigation.is_none())?.prior.as_ref()?;
    let camera_from_site = exact::<World, Camera>(pose).inverse() * places.world_from_site?;
    let covariance = Matrix6::from_fn(|r, c| rows[r][c]);
    let of_target = |target: &TargetRecord| {
        let index = header.targets.iter().position(|model| model.id == target.object)?;
        let camera_from_object = camera_from_site * *places.of_target(&target.object)?;
        let points = header.targets[index].points.iter();
        let predicted = points.map(move |point| (camera_from_object * Point::<Object>::from(point.at)).coords);
        let dots = predicted.zip(0..).filter(|(at, _)| at.z > 0.0).flat_map(move |(at, number)| {
            let gate = ellipsoid(&at, &predicted_covariance(&at, &covariance), GATE.sqrt());
            gate.into_iter().map(move |at| Dot { at: at.into(), number, colour: colour(index) })
        });
        Some(dots.collect::<Vec<_>>())
    };
    Some(frame.targets.iter().filter_map(of_target).flatten().collect())
}

/// The covariance of a predicted point `at`: with T_true = T·Exp(φ, ρ) its error is at × φ − ρ to first order.
fn predicted_covariance(at: &Vector3<f64>, covariance: &Matrix6<f64>) -> Matrix3<f64> {
    let mut derivative = Matrix3x6::zeros();
    derivative.fixed_columns_mut::<3>(0).copy_from(&at.cross_matrix());
    derivative.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
    derivative * covariance * derivative.transpose()
}

/// The ellipsoid of the position of the fix that places the vehicle, about the left camera; no dots without a fix.
pub(crate) fn position_covariance(places: &Places, frame: &FrameRecord) -> PointCloud {
    let placed =
        |target: &&TargetRecord| target.object_from_camera.is_some() && places.of_target(&target.object).is_some();
    let rows = frame.targets.iter().find(placed).and_then(|target| target.covariance);
    let dots = rows
        .into_iter()
        .flat_map(|rows| ellipsoid(&Vector3::zeros(), &Matrix3::from_fn(|r, c| rows[r + 3][c + 3]), SIGMAS));
    cloud(
        CAMERAS[0],
        "number",
        dots.zip(0..).map(|(at, number)| Dot { at: at.into(), number, colour: WHITE }),
        frame.stamp_ns,
    )
}

/// The vehicle as a dot where it is estimated, white, and where it is, green. A viewer that keeps the dots of earlier
/// frames shows the path.
pub(crate) fn path(places: &Places, frame: &FrameRecord) -> Result<Vec<(&'static str, PointCloud)>, String> {
    let poses = places.poses(frame)?;
    let number = u32::try_from(frame.frame).unwrap_or(u32::MAX);
    let dot = |frame_id: &str, at: Vector3<f64>, colour| {
        cloud(frame_id, "frame", [Dot { at: at.into(), number, colour }], frame.stamp_ns)
    };
    let [of_estimate, of_truth] = topic::POSE_PATHS;
    let estimate = poses.estimate.map(|place| (of_estimate, dot(SPS, place.translation(), WHITE)));
    let truth = poses.truth.map(|place| (of_truth, dot(WORLD, place.translation(), TRUTH)));
    Ok(estimate.into_iter().chain(truth).collect())
}

/// Places along a line from end to end, both included.
fn along([from, to]: [Vector3<f64>; 2]) -> impl Iterator<Item = Vector3<f64>> {
    let steps = ((to - from).norm() / SPACING).ceil().clamp(1.0, (MAX_DOTS - 1) as f64) as u32;
    (0..=steps).map(move |step| from + (to - from) * (f64::from(step) / f64::from(steps)))
}

/// The three principal ellipses of a covariance about `at`, with semi-axes of this many standard deviations.
fn ellipsoid(at: &Vector3<f64>, covariance: &Matrix3<f64>, sigmas: f64) -> Vec<Vector3<f64>> {
    let SymmetricEigen { eigenvectors, eigenvalues } = covariance.symmetric_eigen();
    let axis = |k: usize| eigenvectors.column(k) * (sigmas * eigenvalues[k].max(0.0).sqrt());
    let ellipse = |[a, b]: [usize; 2]| {
        let (a, b) = (axis(a), axis(b));
        // By rotation in equal steps: the same bits on every platform.
        let turned = |[cos, sin]: [f64; 2]| [cos * STEP[0] - sin * STEP[1], sin * STEP[0] + cos * STEP[1]];
        let turns = std::iter::successors(Some([1.0, 0.0]), move |turn| Some(turned(*turn))).take(ELLIPSE);
        turns.map(move |[cos, sin]| a * cos + b * sin)
    };
    [[0, 1], [1, 2], [2, 0]].into_iter().flat_map(ellipse).map(|offset| at + offset).collect()
}

fn exact<A: Frame, B: Frame>(pose: &ExactPose) -> Transform<A, B> {
    let [x, y, z, w] = pose.rotation;
    let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    Transform::new(rotation, pose.translation.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every dot is on the contour of its covariance.
    #[test]
    fn an_ellipsoid_is_a_contour_of_its_covariance() {
        let root = Matrix3::new(0.3, 0.1, 0.0, 0.0, 0.2, 0.05, 0.1, 0.0, 0.1);
        let covariance = root * root.transpose();
        let inverse = covariance.try_inverse().unwrap();
        let centre = Vector3::new(1.0, 2.0, 3.0);
        for dot in ellipsoid(&centre, &covariance, 2.0) {
            let offset = dot - centre;
            let distance = offset.dot(&(inverse * offset)).sqrt();
            assert!((distance - 2.0).abs() < 1e-9, "{distance}");
        }
    }

    /// A rotation about the vertical axis moves a point sideways, by its distance, and hardly in depth.
    #[test]
    fn a_gate_holds_the_error_of_a_prediction() {
        let mut covariance = Matrix6::zeros();
        covariance[(1, 1)] = 1e-4;
        let predicted = predicted_covariance(&Vector3::new(0.0, -0.2, 4.0), &covariance);
        let sigmas = predicted.diagonal().map(f64::sqrt);
        assert!((sigmas - Vector3::new(0.04, 0.0, 0.0)).norm() < 1e-12, "{sigmas}");
    }

    /// Long lines have few dots, short ones both ends.
    #[test]
    fn a_line_has_both_ends_and_not_too_many_dots() {
        let of = |x: f64| along([Vector3::zeros(), Vector3::new(x, 0.0, 0.0)]).collect::<Vec<_>>();
        assert_eq!(of(0.001).len(), 2);
        let long = of(50.0);
        assert_eq!((long.len(), long[0].x, long[MAX_DOTS - 1].x), (MAX_DOTS, 0.0, 50.0));
        assert_eq!(of(0.1).len(), 6);
    }
}
