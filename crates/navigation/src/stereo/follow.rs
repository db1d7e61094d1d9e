//! Tracking of landmarks in a new pair of images.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use seafix_geometry::{Camera, Pixel, StereoRig, Transform, World};
use seafix_vision::{Direct, Expected, Image, Track, Workspace};

use super::{
    landmark::{Landmark, MIN, project},
    pose::Found,
};

/// A key frame of the window: its pose, and the image of its landmarks' patches.
#[derive(Debug)]
pub(super) struct WindowKeyFrame {
    pub(super) world_from_camera: Transform<World, Camera>,
    /// The left image, while the key frame is in the window.
    pub(super) image: Option<Image>,
}

/// The result of the tracking.
#[derive(Debug, Default)]
pub(super) struct Followed {
    /// The landmarks that should be visible.
    pub(super) sought: Vec<usize>,
    /// Index, pixel coordinates and covariance of each landmark that was found.
    pub(super) found: Vec<(usize, Vector4<f64>, Matrix4<f64>)>,
}

/// Number of consecutive misses after which a landmark counts as hidden or wrong.
const GIVEN_UP: u32 = 2;
/// Maximum change of a patch's scale and area; beyond it the patch shows other detail.
const MAX_SCALE_ERROR: f64 = 3.0;

/// Tracks the landmarks near their positions predicted from `world_from_camera`.
#[expect(clippy::too_many_arguments, reason = "one call site; each argument has a meaning of its own")]
pub(super) fn follow(
    refine: &Direct,
    rig: &StereoRig,
    frames: &[WindowKeyFrame],
    landmarks: &[Landmark],
    images: [&Image; 2],
    world_from_camera: &Transform<World, Camera>,
    (max, calibration): (usize, f64),
    work: &mut Workspace,
) -> Followed {
    let camera_from_world = world_from_camera.inverse();
    let margin = (refine.window / 2 + 2) as f64;
    // Landmarks of the latest key frames come first: their patches have changed least.
    let mut expected: Vec<(usize, [Expected; 2])> = Vec::new();
    for (index, landmark) in landmarks.iter().enumerate().rev() {
        if expected.len() == max {
            break;
        }
        let frame = &frames[landmark.anchor];
        if frame.image.is_none() || landmark.misses >= GIVEN_UP {
            continue;
        }
        let here_from_anchor = camera_from_world * frame.world_from_camera;
        if let Some(both) = expect(rig, landmark, &here_from_anchor, margin) {
            expected.push((index, both));
        }
    }
    let mut followed = Followed { sought: expected.iter().map(|(index, _)| *index).collect(), found: Vec::new() };
    let mut tracks: Vec<Option<Track>> = Vec::new();
    // Landmarks are grouped by key frame, because their patches come from the same image.
    expected.sort_by_key(|(index, _)| (landmarks[*index].anchor, *index));
    for same in expected.chunk_by(|a, b| landmarks[a.0].anchor == landmarks[b.0].anchor) {
        let Some(image) = &frames[landmarks[same[0].0].anchor].image else { continue };
        let left: Vec<Expected> = same.iter().map(|(_, both)| both[0]).collect();
        refine.follow_into(image, images[0], &left, work, &mut tracks);
        // The correction in the left image improves the start in the right one.
        let begun: Vec<(usize, Track, Expected)> = same
            .iter()
            .zip(&tracks)
            .filter_map(|((index, both), track)| {
                let track = (*track)?;
                let (off_u, off_v) = (track.at.u - both[0].start.u, track.at.v - both[0].start.v);
                let start = Pixel { u: both[1].start.u + off_u, v: both[1].start.v + off_v };
                Some((*index, track, Expected { start, ..both[1] }))
            })
            .collect();
        let right: Vec<Expected> = begun.iter().map(|(_, _, right)| *right).collect();
        refine.follow_into(image, images[1], &right, work, &mut tracks);
        followed.found.extend(begun.iter().zip(&tracks).filter_map(|((index, left, _), right)| {
            let right = (*right)?;
            let pixels = Vector4::new(left.at.u, left.at.v, right.at.u, right.at.v);
            let mut noise = Matrix4::identity() * (calibration * calibration).max(MIN * MIN);
            for (k, track) in [(0, left), (2, &right)] {
                let mut block = noise.fixed_view_mut::<2, 2>(k, k);
                block += track.covariance;
            }
            Some((*index, pixels, noise))
        }));
    }
    followed.found.sort_by_key(|(index, ..)| *index);
    followed
}

impl Followed {
    /// The found landmarks as observations for the pose estimate.
    pub(super) fn for_pose(&self, frames: &[WindowKeyFrame], landmarks: &[Landmark]) -> Vec<Found> {
        let found = self.found.iter().map(|(index, pixels, noise)| {
            let landmark = &landmarks[*index];
            Found {
                world_from_anchor: frames[landmark.anchor].world_from_camera,
                at: landmark.at,
                covariance: landmark.covariance,
                pixels: *pixels,
                noise: *noise,
            }
        });
        found.collect()
    }
}

/// The predicted positions and deformations of a landmark's patch in both images; `None` if it is not visible.
fn expect(
    rig: &StereoRig,
    landmark: &Landmark,
    here_from_anchor: &Transform<Camera, Camera>,
    margin: f64,
) -> Option<[Expected; 2]> {
    let seen = project(rig, here_from_anchor, &landmark.at)?;
    let places = [Pixel { u: seen.pixels[0], v: seen.pixels[1] }, Pixel { u: seen.pixels[2], v: seen.pixels[3] }];
    if !(rig.left().contains(&places[0], margin) && rig.right().contains(&places[1], margin)) {
        return None;
    }
    let shapes = seen.shapes(here_from_anchor, &landmark.slant, &landmark.by_pixel(rig)?);
    let by_depth = seen.by_landmark(here_from_anchor).column(2).into_owned();
    let deeper = [Vector2::new(by_depth[0], by_depth[1]), Vector2::new(by_depth[2], by_depth[3])];
    let one = |side: usize| {
        let shape = shapes[side];
        let magnification = shape.norm();
        let area = shape.determinant();
        let likely = magnification < MAX_SCALE_ERROR && area > 1.0 / MAX_SCALE_ERROR && area < MAX_SCALE_ERROR;
        let along = likely.then(|| shape.try_inverse()).flatten()? * deeper[side];
        let along = along.try_normalize(1e-12).unwrap_or_else(Vector2::x);
        let shape = if nearly_still(&shape) { Matrix2::identity() } else { shape };
        Some(Expected { place: landmark.place, start: places[side], shape, along })
    };
    Some([one(0)?, one(1)?])
}

/// Whether the border of a patch moves by less than 0.02 px; no deformation is needed then.
fn nearly_still(shape: &Matrix2<f64>) -> bool {
    (shape - Matrix2::identity()).abs().max() * 8.0 < 0.02
}
