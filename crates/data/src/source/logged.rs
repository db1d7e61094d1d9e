//! Frames from the log of another run.

use std::path::Path;

use nalgebra::Matrix4;
use seafix::{FrameData, PosePrior, SensorFrame};
use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Covariance6, Pinhole, RightCamera, StereoRig, Transform, World};
use seafix_log::{CameraRecord, ExactPose, FrameRecord, Frames, GreyImage, Inputs, LogError, RigRecord, unchanged};
use seafix_navigation::{Device, Reading};
use seafix_referencing::Site;
use seafix_vision::Image;

use super::{mcap::LoggedInput, problem_sequence::no_site};
use crate::{
    dataset::sha256,
    log_conversion,
    sequence::{Sequence, Truth},
};

/// The log of a trial as a sequence: inputs and ground truth, without the trial's results.
pub(crate) struct Logged {
    frames: Frames,
    name: String,
    site: Site,
    rig: StereoRig,
    body_from_camera: Transform<Body, Camera>,
    images: bool,
    labelled: bool,
    posed: bool,
    has_readings: bool,
    numbers: Vec<u64>,
    warnings: Vec<Fault>,
    path: String,
}

impl Logged {
    /// Opens the log at `path`; `reading` selects its images or its clouds.
    pub(crate) fn open(path: &Path, reading: LoggedInput) -> Result<Self, Vec<Fault>> {
        let one = |fault| vec![fault];
        let frames = unchanged(path).and_then(|()| Frames::open(path));
        let frames = frames.map_err(|error| one(fault(path, &error)))?;
        let header = frames.header();
        if frames.is_empty() {
            return Err(one(
                Fault::new("a log without frames", path).remedy("there is nothing to replay; give a complete log")
            ));
        }
        let images = match (reading, frames.has_images(0)) {
            (LoggedInput::Clouds, _) | (LoggedInput::Any, false) => false,
            (_, true) => true,
            (LoggedInput::Images, false) => {
                let fault = Fault::new("a log without images", path);
                return Err(one(fault.remedy("replay its clouds, with the front end unchanged")));
            }
        };
        let rig = rig(&header.rig).map_err(|what| one(Fault::new(what, path)))?;
        let body_from_camera = Transform::from_rows(&header.body_from_camera)
            .map_err(|error| one(Fault::new(format!("body_from_camera: {error}"), path)))?;
        let mut warnings = Vec::new();
        let (mut numbers, mut exact) = (Vec::with_capacity(frames.len()), true);
        let (mut posed, mut labelled) = (false, true);
        let mut devices = std::collections::BTreeSet::new();
        for place in 0..frames.len() {
            let frame = frames.frame(place, false).map_err(|error| one(fault(path, &error)))?;
            numbers.push(frame.frame);
            exact &= frame.inputs.as_ref().is_some_and(|inputs| !images || inputs.exact_images);
            posed |= frame.inputs.as_ref().is_some_and(|inputs| inputs.problem.is_some());
            labelled &= frame.inputs.as_ref().is_some_and(|inputs| inputs.names.is_some());
            let hints = frame.inputs.iter().flat_map(|inputs| &inputs.readings);
            devices.extend(hints.map(|reading| reading.device.clone()));
        }
        if !exact {
            let what = if images { "images logged with fewer bits" } else { "inputs logged in rounded form" };
            warnings.push(Fault::new(what, path).remedy("results may differ from the logged ones in the last digits"));
        }
        if let Some(lost) = frames.recovered() {
            let fault = Fault::new("a log recovered from an incomplete one", path).value(lost);
            warnings.push(fault.remedy("some frames of its trial are missing"));
        }
        let site = if posed { no_site() } else { Site::parse(&header.site, path)? };
        Ok(Self {
            name: format!("log {} of {}", header.trial, header.source),
            site,
            rig,
            body_from_camera,
            images,
            labelled,
            posed,
            has_readings: Device::ALL.iter().all(|device| devices.contains(device.name())),
            numbers,
            warnings,
            path: path.display().to_string(),
            frames,
        })
    }

    /// The times of all frames (ns).
    ///
    /// # Errors
    /// A log that has changed since it was opened.
    pub(crate) fn stamps(&self) -> Result<Vec<u64>, Fault> {
        (0..self.numbers.len()).map(|index| Ok(self.frame(index, false)?.stamp_ns)).collect()
    }

    /// The two images of the frame at `index`.
    ///
    /// # Errors
    /// A frame without images or with thumbnails.
    pub(crate) fn pair(&self, index: usize) -> Result<(Image, Image), Fault> {
        let frame = self.frame(index, true)?;
        let Some(images) = &frame.images else {
            let fault = Fault::new("a frame without images", Path::new(&self.path));
            return Err(fault.value(format!("frame {}", frame.frame)).remedy("run again with images in the log"));
        };
        self.decoded(images, frame.frame)
    }

    /// The two images of frame `number` at full size.
    fn decoded(&self, [left, right]: &[GreyImage; 2], number: u64) -> Result<(Image, Image), Fault> {
        let broken = |what: String| Fault::new(what, Path::new(&self.path)).value(format!("frame {number}"));
        if left.width != self.rig.left().size()[0] {
            let fault = broken("an image logged as a thumbnail".to_owned());
            return Err(fault.remedy("replay the clouds, or run again with full images in the log"));
        }
        Ok((image(left).map_err(broken)?, image(right).map_err(broken)?))
    }

    /// The readings that the frame at `index` brought.
    ///
    /// # Errors
    /// A reading of an unknown device.
    pub(crate) fn readings(&self, index: usize) -> Result<Vec<Reading>, Fault> {
        let Some(inputs) = self.frame(index, false)?.inputs else { return Ok(Vec::new()) };
        log_conversion::readings(&inputs).map_err(|what| Fault::new(what, Path::new(&self.path)))
    }

    fn frame(&self, index: usize, images: bool) -> Result<FrameRecord, Fault> {
        self.frames.frame(index, images).map_err(|error| fault(Path::new(&self.path), &error))
    }
}

/// The fault of a log.
pub(super) fn fault(path: &Path, error: &LogError) -> Fault {
    let text = error.to_string();
    let (what, remedy) = text.split_once("; ").unwrap_or((&text, ""));
    let shown = path.display().to_string();
    let what = what.strip_prefix(&shown).map_or(what, str::trim_start);
    Fault::new(what, path).remedy(remedy)
}

fn rig(record: &RigRecord) -> Result<StereoRig, String> {
    let camera = |side: &str, record: &CameraRecord| {
        let CameraRecord { size, matrix: [[fx, _, cx], [_, fy, cy], _], distortion, equidistant } = record;
        let new = if *equidistant { Pinhole::equidistant } else { Pinhole::new };
        new(*size, [*fx, *fy], [*cx, *cy], distortion).map_err(|error| format!("{side} camera: {error}"))
    };
    let right_from_left: Transform<RightCamera, Camera> = match record.right_from_left_rotation {
        Some(rotation) => {
            let translation = std::array::from_fn(|row| record.right_from_left[row][3]);
            log_conversion::transform(&ExactPose { rotation, translation })
        }
        None => Transform::from_rows(&record.right_from_left).map_err(|error| format!("right_from_left: {error}"))?,
    };
    StereoRig::new(camera("left", &record.left)?, camera("right", &record.right)?, right_from_left)
        .map_err(|error| error.to_string())
}

fn image(grey: &GreyImage) -> Result<Image, String> {
    let pixels = grey.pixels.iter().map(|&level| f32::from(level)).collect();
    Image::new(grey.width as usize, grey.height as usize, pixels).map_err(|error| error.to_string())
}

impl Sequence for Logged {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        &self.site
    }

    fn rig(&self) -> &StereoRig {
        &self.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        self.body_from_camera
    }

    fn images(&self) -> bool {
        self.images
    }

    fn labelled(&self) -> bool {
        self.labelled
    }

    fn posed(&self) -> bool {
        self.posed
    }

    fn has_readings(&self) -> bool {
        self.has_readings
    }

    fn frames(&self) -> usize {
        self.numbers.len()
    }

    fn number(&self, index: usize) -> u64 {
        self.numbers[index]
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let header = self.frames.header();
        header.prior_position_sigma.zip(header.prior_attitude_sigma)
    }

    fn pixel_sigma(&self) -> Option<f64> {
        self.frames.header().pixel_sigma.filter(|_| !self.images)
    }

    fn warnings(&self) -> &[Fault] {
        &self.warnings
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let frame = self.frame(index, self.images)?;
        let broken = |what: String| Fault::new(what, Path::new(&self.path)).value(format!("frame {}", frame.frame));
        let rounded = Inputs::default();
        let inputs = frame.inputs.as_deref().unwrap_or(&rounded);
        let cloud = match frame.inputs {
            Some(_) => log_conversion::cloud(&frame.cloud, inputs)
                .ok_or_else(|| broken("a point without covariance of its pixels".to_owned()))?,
            None => self.old_cloud(&frame),
        };
        let lines: Vec<_> = frame.lines.iter().map(log_conversion::line).collect();
        let hints = log_conversion::hints(inputs, &cloud, &lines);
        let readings = log_conversion::readings(inputs).map_err(broken)?;
        let prior = match frame.inputs {
            Some(_) => log_conversion::prior(inputs),
            None => self.old_prior(&frame).map_err(broken)?,
        };
        let frame_data = match &frame.images {
            Some(images) => self.decoded(images, frame.frame).map(|(left, right)| FrameData::Stereo(left, right))?,
            None if lines.is_empty() => FrameData::Points(cloud),
            None => FrameData::Features(cloud, lines),
        };
        Ok(SensorFrame { stamp_ns: frame.stamp_ns, frame_data, prior, hints, readings })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let inputs = self.frame(index, false).ok()?.inputs?;
        let surveyed = match &inputs.problem {
            Some(_) => vec![None],
            None => self.site.objects.iter().map(|object| object.world_from_object).collect(),
        };
        Some(log_conversion::truth_of(inputs.truth.as_ref()?, surveyed))
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        let path = Path::new(&self.path);
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(vec![(name, sha256(path)?)])
    }
}

impl Logged {
    /// The cloud of a log from before inputs were logged; its pixel errors are independent.
    fn old_cloud(&self, frame: &FrameRecord) -> Vec<seafix_geometry::MeasuredPoint> {
        let sigma = self.frames.header().pixel_sigma.unwrap_or(0.3);
        let pairs = frame.cloud.iter().filter(|point| point.pixels.is_some());
        let isotropic = Matrix4::<f64>::identity() * (sigma * sigma);
        let rows = std::array::from_fn(|r| std::array::from_fn(|c| isotropic[(r, c)]));
        let inputs = Inputs { pixel_covariances: pairs.map(|_| rows).collect(), ..Inputs::default() };
        log_conversion::cloud(&frame.cloud, &inputs).expect("every pair of pixels was given a covariance")
    }

    /// The prior pose of such a log, with the typical standard deviations in its header.
    fn old_prior(&self, frame: &FrameRecord) -> Result<Option<PosePrior>, String> {
        let (Some(prior), Some((position, attitude))) = (&frame.prior, self.prior_sigma()) else { return Ok(None) };
        let world_from_camera: Transform<World, Camera> =
            Transform::from_rows(&prior.world_from_camera).map_err(|error| format!("prior: {error}"))?;
        Ok(Some(PosePrior { world_from_camera, covariance: Covariance6::isotropic(attitude, position) }))
    }
}
