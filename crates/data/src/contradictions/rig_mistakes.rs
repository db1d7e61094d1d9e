//! Known mistakes of a calibration that no epipolar line shows, since both cameras have them.

use seafix_geometry::{LensModel, Pinhole, StereoRig};

/// A mistake of a calibration, the rig without it, and the remedy.
pub(super) struct RigMistake {
    pub(super) name: &'static str,
    pub(super) remedy: &'static str,
    pub(super) rig: StereoRig,
}

/// The rigs of which `rig` may be a mistaken reading, the usual mistakes first.
pub(super) fn rig_mistakes(rig: &StereoRig) -> Vec<RigMistake> {
    const RESIZED: &str =
        "the calibration is of images of another size: scale fx, fy, cx and cy by the ratio of the widths";
    const ORDER: &str =
        "OpenCV's order is k1 k2 p1 p2 k3: Metashape, Kalibr's pinhole of five and MATLAB list k1 k2 k3 first";
    let focal = |factor: f64| {
        move |camera: &Pinhole| {
            Pinhole::new(camera.size(), camera.focal().map(|f| f * factor), camera.principal(), own(camera)).ok()
        }
    };
    let exchanged = |camera: &Pinhole| {
        let [cx, cy] = camera.principal();
        Pinhole::new(camera.size(), camera.focal(), [cy, cx], own(camera)).ok()
    };
    let middle = |camera: &Pinhole| {
        let middle = camera.size().map(|side| 0.5 * (f64::from(side) - 1.0));
        Pinhole::new(camera.size(), camera.focal(), middle, own(camera)).ok()
    };
    let flat = |camera: &Pinhole| Pinhole::new(camera.size(), camera.focal(), camera.principal(), &[]).ok();
    let reordered = |camera: &Pinhole| {
        let five = camera.distortion().coefficients();
        let [k1, k2, k3, p1, p2] = five.get(..5)?.try_into().ok()?;
        let is_brown = own(camera).len() <= 5;
        let read = is_brown.then_some([k1, k2, p1, p2, k3])?;
        Pinhole::new(camera.size(), camera.focal(), camera.principal(), &read).ok()
    };
    type Other<'a> = &'a dyn Fn(&Pinhole) -> Option<Pinhole>;
    let all: [(&'static str, &'static str, Other<'_>); 6] = [
        ("if the focal length is twice as large", RESIZED, &focal(2.0)),
        ("if the focal length is half as large", RESIZED, &focal(0.5)),
        (
            "if cx and cy are exchanged",
            "give cx, the column, before cy, the row, in pixels from the first pixel's centre",
            &exchanged,
        ),
        (
            "if the principal point is in the middle of the images",
            "give cx and cy in pixels from the centre of the first pixel, for images of this size",
            &middle,
        ),
        ("without distortion", "the images are undistorted: give `distortion = []`", &flat),
        ("if the coefficients are k1 k2 k3 p1 p2", ORDER, &reordered),
    ];
    let build = |other: Other<'_>| StereoRig::new(other(rig.left())?, other(rig.right())?, *rig.right_from_left()).ok();
    let usable = |camera: &Pinhole| camera.distortion().model() == LensModel::Pinhole;
    all.into_iter()
        .filter(|_| usable(rig.left()) && usable(rig.right()))
        .filter_map(|(name, remedy, other)| Some(RigMistake { name, remedy, rig: build(other)? }))
        .filter(|mistake| mistake.rig.left() != rig.left() || mistake.rig.right() != rig.right())
        .collect()
}

/// The coefficients of a camera, as few as state its distortion.
fn own(camera: &Pinhole) -> &[f64] {
    camera.distortion().shortest()
}
