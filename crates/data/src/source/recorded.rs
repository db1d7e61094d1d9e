//! ROS 2 recordings with a site.

use std::path::{Path, PathBuf};

use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_component::{Fault, read_text};
use seafix_geometry::{Body, Camera, Covariance6, StereoRig, Transform, World};
use seafix_io::ImageLimits;
use seafix_referencing::Site;

use super::{bag::Bag, mcap::Mcap};
use crate::{
    contradictions::{MeasuredPair, View, poses_faults, scale_fault},
    dataset::{
        clock_offset, sha256,
        tum::{Stamped, between},
    },
    sequence::{Sequence, Truth},
};

/// The stereo pairs, calibration and poses of a ROS 2 recording.
pub(super) struct Recorded {
    path: PathBuf,
    bag: Bag,
    gap_ns: u64,
    site: Site,
    prior: Vec<Stamped<World, Camera>>,
    /// The prior's covariances: one for each pose, or one for all.
    covariances: Vec<Covariance6<World, Camera>>,
    truth: Vec<Stamped<World, Camera>>,
    warnings: Vec<Fault>,
}

/// The faults, the warnings and a one-line summary of the recording at `path`. Rig and images are found by the names of
/// their topics, and every image is decoded.
pub fn check_recording(path: &Path, limits: ImageLimits) -> (Vec<Fault>, Vec<Fault>, String) {
    let settings = Mcap { max_pixels: limits.pixels, max_bytes: limits.bytes, ..Mcap::default() };
    match Bag::open(path, &settings) {
        Ok(bag) => (bag.doubts.clone(), bag.warnings.clone(), bag.notes()),
        Err(fault) => (vec![fault], Vec::new(), String::new()),
    }
}

impl Recorded {
    /// Opens the recording at `path` and its site file.
    pub(super) fn open(path: &Path, settings: &Mcap, folder: &Path) -> Result<Self, Vec<Fault>> {
        let one = |fault| vec![fault];
        let file = folder.join(&settings.site);
        let site = Site::parse(&read_text(&file).map_err(one)?, &file)?;
        let bag = Bag::open(path, settings).map_err(one)?;
        let (prior, covariances) = bag.poses(&settings.prior).map_err(one)?;
        let covariances = match (covariances, prior.is_empty(), settings.prior_sigma()) {
            (_, true, _) => Vec::new(),
            (_, false, Some((position, attitude))) => vec![Covariance6::isotropic(attitude, position)],
            (Some(covariances), false, None) => covariances,
            (None, false, None) => {
                return Err(one(Fault::new("a prior without its uncertainty", path)
                    .value(&settings.prior)
                    .remedy("set `prior-position` (m) and `prior-attitude-deg`")));
            }
        };
        let (truth, _) = bag.poses(&settings.truth).map_err(one)?;
        let mut warnings = bag.warnings.clone();
        warnings.extend(bag.doubts.clone());
        for (name, given, poses) in [("prior", &settings.prior, &prior), ("truth", &settings.truth, &truth)] {
            let lacks = |stamp: u64| between(poses, stamp, settings.gap_ns()).is_none();
            let without = bag.pairs.iter().filter(|(stamp, _)| lacks(*stamp)).count();
            let all = bag.pairs.len();
            let stamps = || bag.pairs.iter().map(|(stamp, _)| *stamp);
            if !given.is_empty()
                && without == all
                && let Some(offset) = clock_offset(stamps(), poses.iter().map(|pose| pose.0))
            {
                let fault = Fault::new(format!("clocks of pairs and {name} that differ"), path);
                let value = format!("{given}: {offset}, in the median of {all} pairs");
                warnings.push(
                    fault.value(value).remedy("no pair has a pose: stamp both by one clock, or enlarge `max-gap`"),
                );
            } else if !given.is_empty() && without > 0 {
                let fault = Fault::new(format!("stereo pairs without a {name}"), path);
                let value = format!("{without} of {}, {given}", bag.pairs.len());
                warnings.push(fault.value(value).remedy("poses farther apart than `max-gap` are not interpolated"));
            }
        }
        warnings.extend(site.warnings.clone());
        let view = View::new(&site, &[], &bag.rig, Transform::identity());
        let of = |poses: &[Stamped<World, Camera>]| -> Vec<_> {
            bag.pairs.iter().map(|(stamp, _)| between(poses, *stamp, settings.gap_ns())).collect()
        };
        let sigma = covariances
            .first()
            .map(|covariance: &Covariance6<World, Camera>| (covariance.position_sigma(), covariance.attitude_sigma()));
        let inspected = &bag.inspected;
        let measured: Vec<_> = inspected.iter().map(|(index, seen)| MeasuredPair::new(&view, *index, seen)).collect();
        let (priors, truths) = (of(&prior), of(&truth));
        let faults = poses_faults([&view; 2], &priors, &truths, sigma, &measured, path);
        if faults.is_empty() {
            let posed = inspected.iter().filter_map(|(index, seen)| Some((truths[*index]?, seen.clone())));
            warnings.extend(scale_fault(&view, &posed.collect::<Vec<_>>(), path));
        }
        warnings.extend(faults);
        let (path, gap_ns) = (path.to_owned(), settings.gap_ns());
        Ok(Self { path, bag, gap_ns, site, prior, covariances, truth, warnings })
    }
}

impl Sequence for Recorded {
    fn name(&self) -> &str {
        self.path.file_name().and_then(|name| name.to_str()).unwrap_or("recording")
    }

    fn site(&self) -> &Site {
        &self.site
    }

    fn rig(&self) -> &StereoRig {
        &self.bag.rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        Transform::identity()
    }

    fn images(&self) -> bool {
        true
    }

    fn frames(&self) -> usize {
        self.bag.pairs.len()
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        let covariance = self.covariances.first()?;
        Some((covariance.position_sigma(), covariance.attitude_sigma()))
    }

    fn warnings(&self) -> &[Fault] {
        &self.warnings
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let stamp_ns = &self.bag.pairs[index].0;
        let (left, right) = self.bag.pair(index)?;
        let frame_data = FrameData::Stereo(left, right);
        let prior = between(&self.prior, *stamp_ns, self.gap_ns).map(|world_from_camera| {
            let nearest = self.prior.partition_point(|(time, _)| time < stamp_ns).min(self.covariances.len() - 1);
            PosePrior { world_from_camera, covariance: self.covariances[nearest] }
        });
        Ok(SensorFrame { stamp_ns: *stamp_ns, frame_data, prior, hints: Hints::Nothing, readings: Vec::new() })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let world_from_camera = between(&self.truth, self.bag.pairs[index].0, self.gap_ns)?;
        Some(Truth {
            world_from_camera,
            world_from_object: self.site.objects.iter().map(|object| object.world_from_object).collect(),
            visible: None,
            bound: None,
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        let name = |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        self.bag.files().map(|path| Ok((name(path), sha256(path)?))).collect()
    }
}
