//! The common view of two cameras, which a wrong rotation between them takes away.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Fault;
use seafix_geometry::{Pinhole, Pixel, Point, StereoRig};

/// The minimum part of the left image that the right camera sees at the best distance.
const MIN_PART: f64 = 0.1;
/// The maximum rotation (rad) of the images against each other of which nothing is said: half a quarter turn.
const MAX_ROLL: f64 = std::f64::consts::FRAC_PI_4;

const REMEDY: &str = "check the rotation of the right camera: the order of its quaternion (w first or last), its unit \
                      (radians or degrees) and its direction";

/// The warning of cameras whose images are rotated against each other.
///
/// # Errors
/// Cameras whose views meet at no distance.
pub(super) fn check(rig: &StereoRig, file: &Path) -> Result<Option<Fault>, Fault> {
    let right_from_left = rig.right_from_left().rotation();
    let part = common_part(rig);
    if part < MIN_PART {
        let apart = (right_from_left * Vector3::z()).angle(&Vector3::z()).to_degrees();
        let value = format!(
            "their optical axes are {apart:.1}° apart, and at the best distance the right camera sees {:.0} % of the \
             left image",
            100.0 * part
        );
        return Err(Fault::new("cameras without a common view", file).value(value).remedy(REMEDY));
    }
    let roll = roll(&right_from_left);
    Ok((roll > MAX_ROLL).then(|| {
        let value = format!("{:.1}° about the optical axis", roll.to_degrees());
        let remedy = format!("{REMEDY}, unless the cameras are mounted so");
        Fault::new("cameras rolled against each other", file).value(value).remedy(remedy)
    }))
}

/// The part of a rotation (rad) about the z axis, by its swing and twist.
fn roll(rotation: &UnitQuaternion<f64>) -> f64 {
    2.0 * rotation.k.abs().atan2(rotation.w.abs())
}

/// The largest part of the left image, over all distances, that the right camera sees.
fn common_part(rig: &StereoRig) -> f64 {
    /// Distances, in baselines: from cameras that look at each other to parallel views.
    const DISTANCES: [f64; 13] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1e3, 1e4, 1e5];
    let directions: Vec<Vector3<f64>> =
        grid(rig.left()).filter_map(|pixel| Some(rig.left().normalize(&pixel)?.push(1.0))).collect();
    let part = |distance: f64| {
        let seen =
            |direction: &&Vector3<f64>| rig.sees(&Point::from(*direction * (distance * rig.baseline())), 0.0).is_some();
        directions.iter().filter(seen).count() as f64 / directions.len().max(1) as f64
    };
    DISTANCES.into_iter().map(part).fold(0.0, f64::max)
}

/// Pixels evenly over an image.
fn grid(camera: &Pinhole) -> impl Iterator<Item = Pixel> {
    const SIDE: u32 = 20;
    let [width, height] = camera.size().map(|side| f64::from(side - 1));
    let at = |k: u32| (f64::from(k) + 0.5) / f64::from(SIDE);
    (0..SIDE * SIDE).map(move |k| Pixel { u: width * at(k % SIDE), v: height * at(k / SIDE) })
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Transform;

    use super::*;

    /// What is said of cameras a baseline of 0.2 m apart, the right one turned in the frame of the left one.
    fn said(turn: [f64; 3]) -> Result<Option<String>, String> {
        let camera = Pinhole::new([1024, 768], [820.0; 2], [511.5, 383.5], &[]).unwrap();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn.map(f64::to_radians)));
        let left_from_right = Transform::new(turn, Vector3::new(0.2, 0.0, 0.0));
        let rig = StereoRig::new(camera, camera, left_from_right.inverse()).unwrap();
        check(&rig, Path::new("c.yml")).map(|fault| fault.map(|f| f.to_string())).map_err(|fault| fault.to_string())
    }

    /// Cameras that look at one point, even at 100° from each other, and a bracket of 10° are sound.
    #[test]
    fn converging_cameras_have_a_common_view() {
        for turn in [[0.0, 0.0, 0.0], [0.0, -100.0, 0.0], [0.0, -60.0, 0.0], [3.0, 10.0, -20.0]] {
            assert_eq!(said(turn), Ok(None), "{turn:?}");
        }
    }

    #[test]
    fn cameras_without_a_common_view_are_rejected() {
        let apart = said([0.0, 66.0, 0.0]).unwrap_err();
        assert!(
            apart.starts_with("cameras without a common view in c.yml: their optical axes are 66.0° apart"),
            "{apart}"
        );
        assert!(apart.contains("(radians or degrees)"), "{apart}");
        assert!(said([0.0, 180.0, 0.0]).is_err());
    }

    #[test]
    fn rolled_cameras_are_named() {
        let rolled = said([0.5, -1.0, 179.0]).unwrap().unwrap();
        assert!(rolled.starts_with("cameras rolled against each other in c.yml: 179.0°"), "{rolled}");
        assert!(rolled.contains("(w first or last)"), "{rolled}");
    }
}
