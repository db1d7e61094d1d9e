//! Images that contradict the rig.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Fault;
use seafix_geometry::{Pinhole, StereoPixels, StereoRig, Transform};
use seafix_vision::Image;

/// The minimum number of matches for a statement.
const FEW: usize = 30;
/// The distance (px) to the epipolar lines that a sound calibration stays below.
const FAR: f64 = 2.0;

/// The median distance (px) to the epipolar lines of `rig` of the nearer half of the matches.
///
/// Wrong matches are far from the lines of every rig and belong to the other half.
pub(crate) fn residual(seen: &[StereoPixels], rig: &StereoRig) -> f64 {
    let mut distances: Vec<f64> =
        seen.iter().map(|seen| rig.epipolar_distance(seen).unwrap_or(f64::INFINITY)).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 4).copied().unwrap_or(f64::INFINITY)
}

/// The fault of matches that lie off the epipolar lines, with the mistake that explains them if one does.
pub(crate) fn images_fault(seen: &[StereoPixels], rig: &StereoRig, file: &Path) -> Option<Fault> {
    let given = residual(seen, rig);
    if seen.len() < FEW || given <= FAR {
        return None;
    }
    let fault = Fault::new("images that contradict the rig", file);
    let value = format!("matches are {given:.1} px from their epipolar lines");
    let explains = |other: &StereoRig| {
        let other = residual(seen, other);
        (other <= 0.5 * FAR && other * 4.0 < given).then_some(other)
    };
    let flat = rectified(rig);
    if let Some(off) = flat.as_ref().and_then(explains) {
        let value = format!("{value}, and {off:.1} px without distortion and rotation");
        let remedy = "the images are rectified and the calibration is of raw ones: give the rectified camera matrix (P), \
                      `distortion = []` and a right_from_left without rotation";
        return Some(fault.value(value).remedy(remedy));
    }
    if let Some(off) = explains(&upside_down(rig)) {
        let value = format!("{value}, and {off:.1} px if both images are turned by 180°");
        return Some(fault.value(value).remedy("turn the images as the calibration's were"));
    }
    let remedy = match rig.is_rectified() {
        true => "raw images with a rectified calibration? give K, the distortion and the pose of the right camera",
        false => "check that the calibration is of these cameras and of images of this size",
    };
    Some(fault.value(value).remedy(remedy))
}

/// The rig of rectified images with the focal length of this one.
fn rectified(rig: &StereoRig) -> Option<StereoRig> {
    let camera = |camera: &Pinhole| Pinhole::new(camera.size(), camera.focal(), camera.principal(), &[]).ok();
    let axis = if rig.right_from_left().translation().x < 0.0 { -1.0 } else { 1.0 };
    let step = Vector3::new(axis * rig.baseline(), 0.0, 0.0);
    let left = camera(rig.left())?;
    StereoRig::new(left, left, Transform::new(UnitQuaternion::identity(), step)).ok()
}

/// The rig of images that are turned by 180°: both cameras are rolled about their axes.
fn upside_down(rig: &StereoRig) -> StereoRig {
    let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let pose = rig.right_from_left();
    let turned = Transform::new(half * pose.rotation() * half.inverse(), half * pose.translation());
    let camera = |camera: &Pinhole| {
        let ([width, height], [cx, cy]) = (camera.size(), camera.principal());
        let principal = [f64::from(width - 1) - cx, f64::from(height - 1) - cy];
        Pinhole::new(camera.size(), camera.focal(), principal, &[]).unwrap_or(*camera)
    };
    StereoRig::new(camera(rig.left()), camera(rig.right()), turned).unwrap_or(*rig)
}

/// The largest difference of the means of the four pixels of an image's cells, and the smaller one of those of its
/// diagonals, as parts of the mean; zeros for a black image.
pub(super) fn cell_difference(image: &Image) -> (f64, f64) {
    let (width, height) = (image.width() / 2 * 2, image.height() / 2 * 2);
    let mut sums = [0.0_f64; 4];
    for v in 0..height {
        for u in 0..width {
            sums[2 * (v % 2) + u % 2] += f64::from(image.pixels()[v * image.width() + u]);
        }
    }
    let mean = sums.iter().sum::<f64>() / 4.0;
    if mean <= 0.0 {
        return (0.0, 0.0);
    }
    let spread = (sums.iter().copied().fold(0.0, f64::max) - sums.iter().copied().fold(f64::INFINITY, f64::min)) / mean;
    // Two cells of the mosaic are green: the diagonal ones have one mean.
    let diagonal = ((sums[0] - sums[3]).abs().min((sums[1] - sums[2]).abs())) / mean;
    (spread, diagonal)
}

/// The fault of a Bayer mosaic that was stored as a grey image: the means of the four pixels of its cells differ.
pub(crate) fn mosaic_fault(image: &Image, file: &Path) -> Option<Fault> {
    /// Grey images stay below a hundredth, mosaics of grey scenes with the response of a usual sensor above a tenth.
    const DIFFERENT: f64 = 0.04;
    let (spread, diagonal) = cell_difference(image);
    (spread > DIFFERENT && diagonal < 0.5 * spread).then(|| {
        let fault = Fault::new("a Bayer mosaic stored as a grey image", file);
        let fault = fault.value(format!("the four pixels of its cells differ by {:.0} % in the mean", 100.0 * spread));
        fault.remedy("convert it to grey or colour first, for example with OpenCV's COLOR_BayerBG2GRAY")
    })
}

/// The warning of images of 16 bits whose numbers have fewer: all are below a sixteenth of white, and finer than the
/// numbers of 8 bits.
pub(crate) fn dim_fault(images: &[Image], bits: u8, file: &Path) -> Option<Fault> {
    /// The usual depths of sensors (bits) whose numbers are stored in 16.
    const DEPTHS: [u8; 3] = [8, 10, 12];
    let pixels = || images.iter().flat_map(|image| image.pixels());
    let greatest = pixels().copied().fold(0.0, f32::max);
    if bits != 16 || greatest <= 0.0 || pixels().all(|pixel| pixel.fract() == 0.0) {
        return None;
    }
    // Pixels are parts of white, 65535, times 255.
    let greatest = (f64::from(greatest) * 257.0).round();
    let depth = DEPTHS.into_iter().find(|depth| greatest < f64::from(1_u32 << depth))?;
    let fault = Fault::new("images that use little of their 16 bits", file);
    let fault = fault.value(format!("the largest number is {greatest}, as of a sensor of {depth} bits"));
    Some(fault.remedy(match depth {
        10 => "set `bits = 12` in dataset.toml, or scale the images to their full depth",
        8 => "set `bits = 8` in dataset.toml",
        _ => "set `bits = 12` in dataset.toml",
    }))
}

#[cfg(test)]
mod tests {
    use seafix_geometry::{Camera, Point};

    use super::*;

    fn seen(rig: &StereoRig) -> Vec<StereoPixels> {
        let place = |k: u32| {
            let [a, b, c] = [0.37, 0.71, 0.13].map(|step| (f64::from(k) * step).fract() - 0.5);
            Point::<Camera>::new(3.0 * a, 2.0 * b, 3.0 + 2.0 * c)
        };
        (0..60).filter_map(|k| rig.sees(&place(k), 0.0)).collect()
    }

    #[test]
    fn rectified_images_with_a_raw_calibration_are_named() {
        let camera = |d: &[f64]| Pinhole::new([1024, 768], [500.0; 2], [511.5, 383.5], d).unwrap();
        let step = Vector3::new(-0.25, 0.0, 0.0);
        let (distorted, turn) = (camera(&[-0.25, 0.08, 0.0, 0.0]), UnitQuaternion::from_euler_angles(0.01, 0.02, 0.0));
        let raw = StereoRig::new(distorted, distorted, Transform::new(turn, step)).unwrap();
        let flat = StereoRig::new(camera(&[]), camera(&[]), Transform::new(UnitQuaternion::identity(), step)).unwrap();
        let file = Path::new("dataset.toml");
        assert_eq!(images_fault(&seen(&raw), &raw, file), None);
        let said = images_fault(&seen(&flat), &raw, file).unwrap().to_string();
        assert!(said.contains("the images are rectified and the calibration is of raw ones"), "{said}");
        let said = images_fault(&seen(&raw), &flat, file).unwrap().to_string();
        assert!(said.contains("raw images with a rectified calibration?"), "{said}");
    }

    /// Fails if dark images of 8 bits, or bright ones of 16, are doubted.
    #[test]
    fn numbers_of_twelve_bits_in_sixteen_are_named() {
        let image = |of: &dyn Fn(usize) -> f32| Image::new(8, 6, (0..48).map(of).collect()).unwrap();
        let said = |image: Image, bits: u8| dim_fault(&[image], bits, Path::new("a")).map(|fault| fault.to_string());
        let twelve = image(&|k| (k * 85) as f32 * 255.0 / 65535.0);
        let text = said(twelve.clone(), 16).unwrap();
        assert!(text.contains("3995, as of a sensor of 12 bits; set `bits = 12`"), "{text}");
        assert_eq!(said(twelve, 12), None);
        assert_eq!(said(image(&|k| (k % 9) as f32), 16), None);
        assert_eq!(said(image(&|k| (k * 1000) as f32 * 255.0 / 65535.0), 16), None);
    }

    #[test]
    fn a_mosaic_is_distinguished_from_a_grey_image() {
        let scene = |u: usize, v: usize| 100.0 + 30.0 * ((u as f32) * 0.21).sin() + 20.0 * ((v as f32) * 0.13).cos();
        let image = |gain: [f32; 4]| {
            let pixels = (0..64 * 48).map(|k| scene(k % 64, k / 64) * gain[2 * (k / 64 % 2) + k % 64 % 2]).collect();
            Image::new(64, 48, pixels).unwrap()
        };
        let file = Path::new("left.png");
        assert_eq!(mosaic_fault(&image([1.0; 4]), file), None);
        assert!(mosaic_fault(&image([0.5, 1.0, 1.0, 0.7]), file).is_some());
        // Rows that are read by two amplifiers are no mosaic.
        assert_eq!(mosaic_fault(&image([1.0, 1.0, 0.9, 0.9]), file), None);
    }
}
