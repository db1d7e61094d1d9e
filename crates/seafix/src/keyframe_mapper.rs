//! Key frames of a run: added, recognised and stored for another run.

use seafix_component::{Part, Settings, each_invalid};
use seafix_geometry::StereoRig;
use seafix_navigation::{
    Displacement, Navigated, Navigator, PoseEstimate, PoseGraph, PoseGraphSettings, Recognition, RelativeMotion,
    StereoPair, Traverse,
};
use seafix_referencing::Target;
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use crate::{
    choices,
    event::NavigationEvent,
    pipeline_error::{PipelineError, invalid_setting},
    places::places,
    sensor_frame::SensorFrame,
};

/// The settings of the key frames of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct KeyframeSettings {
    /// Whether the session returns its pose graph at the end; a run writes it as `<trial>.pose-graph` into its folder.
    pub write_file: bool,
    /// The pose graph of an earlier run, relative to the experiment file; none if empty. A session of the library takes it
    /// as the argument `map` instead.
    pub read: String,
    /// The SHA-256 of the file `read`; any file is accepted if empty. The log holds the hash of the file that was read.
    pub sha256: String,
    /// The settings for adding and recognising key frames.
    pub settings: PoseGraphSettings,
}

impl KeyframeSettings {
    /// The same settings with the defaults of all components written out.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        let recognition = choices::resolved(&self.settings.recognition)?;
        Ok(Self { settings: PoseGraphSettings { recognition, ..self.settings.clone() }, ..self.clone() })
    }

    /// All invalid settings.
    pub fn invalid(&self) -> Vec<PipelineError> {
        let r = &self.settings.recognition;
        let below = |error: PipelineError| {
            let place = ["settings.recognition", error.setting].into_iter().chain(error.key.as_deref());
            let key = Some(place.collect::<Vec<_>>().join("."));
            PipelineError { setting: "pose-graph", key, ..error }
        };
        let mut all: Vec<PipelineError> = choices::faults(r).into_iter().map(below).collect();
        let mut rest = self.settings.clone();
        if !all.is_empty() {
            let Recognition {
                points, consensus_px, draws, min_points, budget, confidence, max_sigma, candidates, ..
            } = *r;
            let own =
                Recognition { points, consensus_px, draws, min_points, budget, confidence, ..Recognition::default() };
            rest.recognition = Recognition { max_sigma, candidates, ..own };
        }
        let own = each_invalid(&rest, PoseGraphSettings::check);
        all.extend(own.into_iter().map(|said| invalid_setting("pose-graph", format!("settings.{said}"))));
        if self.read.is_empty() && !self.sha256.is_empty() {
            let message = "sha256 belongs to the file `read`, which is not given; add `read`".to_owned();
            let (setting, key) = ("pose-graph", Some("sha256".to_owned()));
            all.push(PipelineError { setting, key, part: Part::Key, near: None, message });
        }
        all
    }
}

/// A pose graph that a run extends by key frames and in which it recognises them.
#[derive(Debug)]
pub struct KeyframeMapper<'a> {
    keyframes: &'a KeyframeSettings,
    traverse: Traverse<'a>,
    /// The object of the pose graph for each target, and the target for each object.
    objects: Vec<usize>,
    targets: Vec<Option<usize>>,
}

impl<'a> KeyframeMapper<'a> {
    /// Begins a map of key frames, from the `earlier` map of another session if there is one.
    pub fn begin(
        keyframes: &'a KeyframeSettings,
        targets: &[Target],
        rig: &'a StereoRig,
        earlier: Option<&PoseGraph>,
    ) -> Self {
        let mut pose_graph = earlier.cloned().unwrap_or_default();
        let mut objects = Vec::with_capacity(targets.len());
        for (target, place) in targets.iter().zip(places(targets)) {
            let known = pose_graph.objects.iter().position(|(name, _)| *name == target.name);
            objects.push(known.unwrap_or_else(|| {
                pose_graph.objects.push((target.name.clone(), place));
                pose_graph.objects.len() - 1
            }));
        }
        let of = |object: usize| objects.iter().position(|other| *other == object);
        let back = (0..pose_graph.objects.len()).map(of).collect();
        let traverse = Traverse::begin(&keyframes.settings, pose_graph, rig, Threads::One);
        Self { keyframes, traverse, objects, targets: back }
    }

    /// Moves the pose of the map by the odometry; `None` marks a gap.
    pub fn advance(&mut self, seconds: f64, motion: Option<&RelativeMotion>) {
        self.traverse.advance(seconds, motion);
    }

    /// Moves an object that is displaced since the survey.
    pub fn displaced(&mut self, found: &Displacement) {
        self.traverse.displaced(self.objects[found.object], found.place);
    }

    /// Processes a frame: adds a key frame or recognises one, and corrects the navigator's pose if that makes it more
    /// accurate.
    pub fn visit(
        &mut self,
        sensor_frame: &SensorFrame,
        pair: &StereoPair<'_>,
        navigator: &mut Navigator<'_>,
        taken: &[Navigated],
        events: &mut Vec<NavigationEvent>,
    ) {
        let ours = |navigated: &Navigated| Navigated {
            object: self.objects[navigated.object],
            object_pose: navigated.object_pose.clone(),
        };
        let estimate = PoseEstimate {
            stamp_ns: sensor_frame.stamp_ns,
            navigated: navigator.pose().map(ours),
            prior_pose: sensor_frame.prior.as_ref().map(|prior| (prior.world_from_camera, prior.covariance)),
        };
        let fixes: Vec<Navigated> = taken.iter().map(ours).collect();
        let closure = self.traverse.visit(pair, &estimate, &fixes);
        match closure.sought {
            Some(Ok(found)) => {
                let (pose_node, seen) = (found.pose_node, &found.recognized);
                events.push(NavigationEvent::KeyframeFound {
                    keyframe: pose_node,
                    inliers: seen.found,
                    matches: seen.matches,
                    sigma: seen.motion.covariance.position_sigma(),
                    loop_rejected: found.given_up,
                });
                let theirs = |pose: Navigated| Some(Navigated { object: self.targets[pose.object]?, ..pose });
                if let Some(pose) = found.navigated.and_then(theirs) {
                    navigator.settle(&pose, format!("key frame {pose_node} recognised"));
                }
            }
            Some(Err(why)) => events.push(NavigationEvent::NoKeyframe { why: why.to_string() }),
            None => {}
        }
        if let Some(pose_node) = closure.added {
            events.push(NavigationEvent::KeyframeAdded { keyframe: pose_node });
        }
    }

    /// The pose graph in its file format; `None` unless `write-file` is set.
    pub fn finish(self) -> Option<String> {
        let pose_graph = self.traverse.finish();
        self.keyframes.write_file.then(|| pose_graph.text(&self.keyframes.settings.recognition))
    }
}
