//! A complete check of a data set, images included.

use std::{
    io::Read,
    ops::Add,
    path::{Path, PathBuf},
};

use hmac_sha256::Hash as Sha256;
use rayon::prelude::*;
use seafix::{PosePrior, Rig, StereoImages};
use seafix_component::Fault;
use seafix_geometry::{StereoPixels, StereoRig};
use seafix_navigation::{Odometry as _, Stereo, StereoPair};
use seafix_vision::{Image, RightCameraRotation, Sides, Threads, matches_by_appearance};

use seafix_io::{
    ImageLimits,
    image::{Orientation, orientation, regular},
};

use super::{
    contents::{Dataset, DatasetFrame},
    folder::inside,
    pairing::SAME_INSTANT_NS,
};
use crate::contradictions::{
    MeasuredPair, View, dim_fault, fixes_fault, images_fault, mosaic_fault, motion_fault, poses_faults, scale_fault,
};

/// Reads the data set in `folder` and every file that it names: decodes the images, compares their sizes with the
/// calibration, and compares every file with its hash if there is one.
///
/// Returns the faults and the warnings.
pub fn check(folder: &Path, limits: ImageLimits) -> (Vec<Fault>, Vec<Fault>) {
    let dataset = match Dataset::open(folder) {
        Ok(dataset) => Dataset { limits, ..dataset },
        Err(faults) => return (faults, Vec::new()),
    };
    let (mut faults, identical) = inspect_images(&dataset);
    faults.extend(identical.fault(&dataset));
    faults.extend(hash_faults(&dataset));
    let mut warnings = dataset.warnings.clone();
    warnings.extend(dataset.odd_times());
    warnings.extend(dataset.turned_images());
    if faults.is_empty() {
        let (sides, table) = (sides(&dataset), dataset.folder.join(&dataset.table));
        faults.extend(swap_fault(sides, &table));
        warnings.extend(strangers(sides, &table));
        warnings.extend(dim_images(&dataset));
        faults.extend(contradictions(&dataset));
    }
    if faults.is_empty() {
        faults.extend(prior_without_fixes(&dataset));
        faults.extend(motion_without_site(&dataset));
    }
    (faults, warnings)
}

impl Dataset {
    /// A warning about images that EXIF turns: the rig must belong to the upright ones.
    fn turned_images(&self) -> Option<Fault> {
        let all = || self.frames.iter().flat_map(|frame| [&frame.left, &frame.right]);
        let turned: Vec<(&PathBuf, Orientation)> = all()
            .map(|file| (file, orientation(file)))
            .filter(|(_, orientation)| *orientation != Orientation::UPRIGHT)
            .collect();
        let (file, first) = turned.first()?;
        let fault = Fault::new("images turned as their EXIF orientation states", file);
        let fault =
            fault.value(format!("{} in {} of {} images", first.describe(), turned.len(), 2 * self.frames.len()));
        Some(fault.remedy("the rig must be that of the upright images, as OpenCV reads them"))
    }

    /// Warnings about the stamps of the pairs: gaps of more than a year, and pairs closer than a camera can take them.
    pub fn odd_times(&self) -> Vec<Fault> {
        let stamps: Vec<u64> = self.frames.iter().map(|frame| frame.stamp_ns).collect();
        odd_times(&stamps, &self.folder.join(&self.table))
    }
}

/// Warnings about the stamps (ns) of the pairs in `file`: gaps of more than a year, and pairs closer than a camera can
/// take them.
pub(crate) fn odd_times(stamps: &[u64], file: &Path) -> Vec<Fault> {
    const YEAR_NS: u64 = 31_557_600_000_000_000;
    let steps = || stamps.windows(2).map(|two| [two[0], two[1]]);
    let reported = |what: &str, odd: &dyn Fn(u64) -> bool, remedy: &str| {
        let all: Vec<[u64; 2]> = steps().filter(|[before, after]| odd(after.abs_diff(*before))).collect();
        let [before, after] = all.first()?;
        let value = format!("from {before} to {after} ns, one of {}", all.len());
        Some(Fault::new(what, file).value(value).remedy(remedy))
    };
    let leap =
        reported("stamps with a gap of more than a year", &|ns| ns > YEAR_NS, "are seconds and nanoseconds mixed?");
    let remedy = "two pairs within a millisecond; check that stamps are nanoseconds";
    leap.into_iter().chain(reported("pairs too close in time", &|ns| ns <= SAME_INSTANT_NS, remedy)).collect()
}

/// The contradictions between the poses, the images, the rig and the site of a data set.
pub fn contradictions(dataset: &Dataset) -> Vec<Fault> {
    let file = dataset.folder.join("dataset.toml");
    // More pairs than for a swap: feature points are few among matches.
    let step = dataset.frames.len().div_ceil(ASKED).max(1);
    let (mut seen, mut mosaics, mut inspected) = (Vec::new(), Vec::new(), Vec::new());
    for (index, frame) in dataset.frames.iter().enumerate().step_by(step) {
        let Ok((left, right)) = dataset.pair(frame) else { continue };
        mosaics.extend(mosaic_fault(&left, &frame.left));
        let matches = matches_by_appearance(&left, &right, &dataset.rig);
        inspected.push((index, matches.clone()));
        seen.extend(matches);
    }
    let mut faults = Vec::new();
    if let Some(site) = &dataset.site {
        let view = View::new(site, &dataset.objects, &dataset.rig, dataset.body_from_camera);
        let priors: Vec<_> = dataset.frames.iter().map(|frame| frame.prior.map(|(pose, _)| pose)).collect();
        let truths: Vec<_> = dataset.frames.iter().map(|frame| frame.truth).collect();
        let sigma = dataset
            .frames
            .iter()
            .find_map(|frame| frame.prior)
            .map(|(_, covariance)| (covariance.position_sigma(), covariance.attitude_sigma()));
        let measured: Vec<_> = inspected.iter().map(|(index, seen)| MeasuredPair::new(&view, *index, seen)).collect();
        let survey = View::new(site, &[], &dataset.rig, dataset.body_from_camera);
        faults.extend(poses_faults([&survey, &view], &priors, &truths, sigma, &measured, &file));
    }
    if let Some(site) = dataset.site.as_ref().filter(|_| faults.is_empty()) {
        let view = View::new(site, &dataset.objects, &dataset.rig, dataset.body_from_camera);
        let posed = inspected.into_iter().filter_map(|(index, seen)| Some((dataset.frames[index].truth?, seen)));
        faults.extend(scale_fault(&view, &posed.collect::<Vec<_>>(), &file));
    }
    faults.extend(mosaics.into_iter().next());
    faults.extend(images_fault(&seen, &dataset.rig, &file));
    faults
}

/// The pairs whose two images are identical, pixel by pixel.
#[derive(Debug, Default)]
pub struct IdenticalImages {
    count: usize,
    first: Option<(PathBuf, PathBuf)>,
}

/// Decodes all images of the data set. The result is their faults and the pairs with identical images.
pub fn inspect_images(dataset: &Dataset) -> (Vec<Fault>, IdenticalImages) {
    let seen: Vec<(Option<Fault>, bool)> = dataset
        .frames
        .par_iter()
        .map(|frame| match dataset.pair(frame) {
            Err(fault) => (Some(fault), false),
            Ok((left, right)) => (None, are_identical(&left, &right)),
        })
        .collect();
    let mut identical =
        IdenticalImages { count: seen.iter().filter(|(_, identical_pair)| *identical_pair).count(), first: None };
    let first = seen.iter().position(|(_, identical_pair)| *identical_pair).map(|first| &dataset.frames[first]);
    identical.first = first.map(|frame| (frame.left.clone(), frame.right.clone()));
    let mut faults: Vec<Fault> = seen.into_iter().filter_map(|(fault, _)| fault).collect();
    faults.dedup();
    (faults, identical)
}

/// Whether two images are identical and not uniform. Two cameras never see the same unless there is nothing to see.
pub fn are_identical(left: &Image, right: &Image) -> bool {
    let flat = || left.pixels().iter().all(|pixel| *pixel == left.pixels()[0]);
    left == right && !flat()
}

/// The fault of a pair of files with identical images.
pub fn identical_images_fault(left: &Path, right: &Path) -> Fault {
    Fault::new("identical left and right images", left)
        .value(format!("the pixels of {}", right.display()))
        .remedy("give the image of the other camera; one image twice has no depth")
}

impl IdenticalImages {
    pub fn fault(&self, dataset: &Dataset) -> Option<Fault> {
        let (left, right) = self.first.as_ref()?;
        let fault = identical_images_fault(left, right);
        let value = format!("{}, and so {} of {} pairs", fault.value, self.count, dataset.frames.len());
        Some(fault.value(value))
    }
}

/// The number of frames for the swap check.
pub const INSPECTED_PAIRS: usize = 3;
/// The number of pairs for the estimate of the right camera's rotation, and for comparisons with poses.
const ASKED: usize = 8;

/// The fault of exchanged left and right images, by a swap check on three frames over the complete data set.
pub fn swapped(dataset: &Dataset) -> Option<Fault> {
    swap_fault(sides(dataset), &dataset.folder.join(&dataset.table))
}

/// The fault of a prior that gives no fix, as [`fixes_fault`] of some pairs.
fn prior_without_fixes(dataset: &Dataset) -> Option<Fault> {
    let site = dataset.site.as_ref()?;
    let rig = Rig { body_from_camera: dataset.body_from_camera, bits: dataset.bits, ..Rig::from(dataset.rig) };
    let with_prior: Vec<_> = dataset.frames.iter().filter(|frame| frame.prior.is_some()).collect();
    let step = with_prior.len().div_ceil(INSPECTED_PAIRS).max(1);
    let pairs = with_prior.iter().step_by(step).filter_map(|frame| {
        let (left, right) = dataset.pair(frame).ok()?;
        let (world_from_camera, covariance) = frame.prior?;
        Some((StereoImages { left, right }, PosePrior { world_from_camera, covariance }))
    });
    fixes_fault(site, &rig, &pairs.collect::<Vec<_>>(), &dataset.folder.join("dataset.toml"))
}

/// The fault of a truth without a site that contradicts odometry, as [`motion_fault`] of the pairs that move farthest.
fn motion_without_site(dataset: &Dataset) -> Option<Fault> {
    const PAIRS: usize = 40;
    let path = |frames: &[DatasetFrame]| -> Option<f64> {
        let truth: Option<Vec<_>> = frames.iter().map(|frame| frame.truth).collect();
        Some(truth?.windows(2).map(|two| (two[1].translation() - two[0].translation()).norm()).sum())
    };
    let parts = dataset.frames.chunks(PAIRS).filter(|_| dataset.site.is_none());
    let (_, frames) = parts.filter_map(|part| Some((path(part)?, part))).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let images: Vec<(Image, Image)> = frames.iter().map(|frame| dataset.pair(frame)).collect::<Result<_, _>>().ok()?;
    let odometry = |rig: &StereoRig| {
        let stereo = Stereo::default();
        let mut session = stereo.begin(rig, dataset.body_from_camera, Threads::One);
        for (frame, (left, right)) in frames.iter().zip(&images) {
            session.advance(&StereoPair { stamp_ns: frame.stamp_ns, left, right }).ok()?;
        }
        let segments = session.trajectory().segments;
        let [segment] = segments.as_slice() else { return None };
        let poses: Vec<_> = segment.poses.iter().map(|waypoint| waypoint.world_from_camera).collect();
        (poses.len() == frames.len()).then_some(poses)
    };
    let truth: Vec<_> = frames.iter().filter_map(|frame| frame.truth).collect();
    motion_fault(&truth, &dataset.rig, &dataset.body_from_camera, &odometry, &dataset.folder.join("dataset.toml"))
}

/// A warning about images of 16 bits that hold numbers of fewer bits, as [`dim_fault`] of the first pairs.
fn dim_images(dataset: &Dataset) -> Option<Fault> {
    let step = dataset.frames.len().div_ceil(INSPECTED_PAIRS).max(1);
    let frames = dataset.frames.iter().step_by(step);
    let images: Vec<Image> =
        frames.clone().filter_map(|frame| dataset.pair(frame).ok()).flat_map(<[Image; 2]>::from).collect();
    dim_fault(&images, dataset.bits, &frames.clone().next()?.left)
}

/// The result of the swap check on three frames over the complete data set.
fn sides(dataset: &Dataset) -> Sides {
    let step = dataset.frames.len().div_ceil(INSPECTED_PAIRS).max(1);
    let pairs = dataset.frames.iter().step_by(step).filter_map(|frame| dataset.pair(frame).ok());
    let sides = pairs.map(|(left, right)| Sides::of_images(&left, &right, &dataset.rig));
    sides.fold(Sides::default(), Sides::add)
}

/// The swap check on the first conclusive pairs, for a data set with some bad images. One pair in favour of the order
/// ends it; three pairs against it decide.
pub fn swapped_at_first(dataset: &Dataset) -> Option<Fault> {
    let pairs = dataset.frames.iter().filter_map(|frame| dataset.pair(frame).ok());
    swap_of_first(pairs, &dataset.rig, &dataset.folder.join(&dataset.table))
}

/// The check of [`swapped_at_first`] on any pairs of `file`.
pub(crate) fn swap_of_first(
    pairs: impl Iterator<Item = (Image, Image)>,
    rig: &StereoRig,
    file: &Path,
) -> Option<Fault> {
    let (mut sides, mut reported) = (Sides::default(), 0);
    for (left, right) in pairs {
        sides = sides + Sides::of_images(&left, &right, rig);
        reported += usize::from(sides.is_decisive());
        if reported == INSPECTED_PAIRS || sides.is_decisive() && !sides.are_swapped() {
            break;
        }
    }
    swap_fault(sides, file)
}

/// The rig of `dataset` with an estimated rotation of the right camera. The estimate uses a sample of pairs, evenly
/// over the data set; `None` if the images agree with the rig. Unreadable images are ignored.
pub fn right_camera_rotation(dataset: &Dataset) -> Option<RightCameraRotation> {
    rotation_of_sample(dataset.frames.len(), |index| dataset.pair(&dataset.frames[index]).ok(), &dataset.rig)
}

/// The estimate of [`right_camera_rotation`] from a sample of any `count` pairs; `pair` is `None` if one cannot be read.
pub(crate) fn rotation_of_sample(
    count: usize,
    pair: impl Fn(usize) -> Option<(Image, Image)>,
    rig: &StereoRig,
) -> Option<RightCameraRotation> {
    let apart = count.div_ceil(ASKED).max(1);
    let some = (0..count).step_by(apart).filter_map(pair);
    let seen: Vec<StereoPixels> = some.flat_map(|(left, right)| matches_by_appearance(&left, &right, rig)).collect();
    RightCameraRotation::of(&seen, rig)
}

/// The fault of `file` if its left and right images are exchanged.
pub fn swap_fault(sides: Sides, file: &Path) -> Option<Fault> {
    sides.are_swapped().then(|| {
        Fault::new("exchanged left and right images", file)
            .value(format!("{} of {} matches lie behind the cameras", sides.behind(), sides.all()))
            .remedy("exchange the images, or the cameras of the rig; if they are in order, the images are mirrored: flip them")
    })
}

/// A warning about many key points with few matches, with the number of matches after exchange.
pub fn strangers(sides: Sides, file: &Path) -> Option<Fault> {
    sides.are_strangers().then(|| {
        let Sides { given, exchanged, keypoints, .. } = sides;
        Fault::new("images with key points but hardly any match", file)
            .value(format!("{keypoints} key points, {given} matches; {exchanged} with left and right exchanged"))
            .remedy(partners_remedy(exchanged, exchanged > 3 * given))
    })
}

/// The remedy for images whose key points do not match: exchange them if that gives more than a few matches.
pub fn partners_remedy(exchanged: usize, clearly: bool) -> &'static str {
    const HANDFUL: usize = 10;
    if exchanged >= HANDFUL && clearly {
        "exchange the left and right images if they are in the wrong order"
    } else {
        "check that both images show one scene and belong to this rig"
    }
}

/// The files whose hash differs from the description.
pub fn hash_faults(dataset: &Dataset) -> Vec<Fault> {
    let file = dataset.folder.join("dataset.toml");
    let mut faults = Vec::new();
    for (name, expected) in &dataset.hashes {
        match inside(&dataset.folder, name, &file).and_then(|path| sha256(&path)) {
            Err(fault) => faults.push(fault),
            Ok(found) if !found.eq_ignore_ascii_case(expected) => faults.push(
                Fault::new("a file whose hash differs from the description", &dataset.folder.join(name))
                    .value(format!("sha256 {found}"))
                    .remedy(format!("[hashes] has {expected}: restore the file or correct the hash")),
            ),
            Ok(_) => {}
        }
    }
    faults
}

/// The SHA-256 of a file in hexadecimal.
pub fn sha256(path: &Path) -> Result<String, Fault> {
    let unreadable = |error: std::io::Error| Fault::new(format!("cannot read ({error})"), path);
    let mut file = regular(path)?;
    let (mut hasher, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer).map_err(unreadable)? {
            0 => return Ok(hex(&hasher.finalize())),
            read => hasher.update(&buffer[..read]),
        }
    }
}

/// The bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// All files below a data set's folder with their SHA-256. They are in order of name, with relative paths joined by
/// `/`.
pub fn input_hashes(folder: &Path) -> Result<Vec<(String, String)>, Fault> {
    let mut files = Vec::new();
    gather(folder, PathBuf::new(), &mut files)?;
    files.sort();
    files.into_iter().map(|name| sha256(&folder.join(&name)).map(|hash| (name, hash))).collect()
}

fn gather(folder: &Path, below: PathBuf, files: &mut Vec<String>) -> Result<(), Fault> {
    let here = folder.join(&below);
    let unreadable = |error: std::io::Error| Fault::new(format!("cannot read ({error})"), &here);
    for entry in std::fs::read_dir(&here).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let path = below.join(entry.file_name());
        // Links are not followed, because they may leave the folder or form a cycle.
        let kind = entry.file_type().map_err(unreadable)?;
        if kind.is_dir() {
            gather(folder, path, files)?;
        } else if kind.is_file() {
            files.push(path.to_string_lossy().replace('\\', "/"));
        }
    }
    Ok(())
}
