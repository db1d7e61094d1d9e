//! Key frames on the way: laid, found again, kept for another run.

use seafix_component::{Part, each_unfit};
use seafix_geometry::StereoRig;
use seafix_navigation::{
    Displacement, Here, Local, Navigated, Navigator, Network, NetworkSettings, Recognition, StereoPair, Traverse,
};
use seafix_referencing::{SOLVERS, Target};
use seafix_vision::{DESCRIPTORS, DETECTORS, FILTERS, LOCATORS, MATCHERS, REFINEMENTS, TRIANGULATORS, Threads};
use serde::{Deserialize, Serialize};

use crate::{
    PipelineError, Sight,
    event::NavigationEvent,
    pipeline::{faults, misfit, resolve},
    session::places,
};

/// The key frames of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Keyframes {
    /// Whether the network is kept, as `<trial>.network` in the folder of the run.
    pub lay: bool,
    /// The network of an earlier run, relative to the experiment file; none where it is empty.
    pub read: String,
    /// SHA-256 of that file, where it must be a certain one; a log says which it was.
    pub sha256: String,
    /// When key frames are laid, and how they are found again.
    pub settings: NetworkSettings,
}

impl Keyframes {
    /// The same with every setting of its components written out.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        let r = &self.settings.recognition;
        let recognition = Recognition {
            filters: r.filters.iter().map(|filter| resolve(&FILTERS, filter)).collect::<Result<_, _>>()?,
            detector: resolve(&DETECTORS, &r.detector)?,
            locator: resolve(&LOCATORS, &r.locator)?,
            descriptor: resolve(&DESCRIPTORS, &r.descriptor)?,
            matcher: resolve(&MATCHERS, &r.matcher)?,
            refine: resolve(&REFINEMENTS, &r.refine)?,
            triangulation: resolve(&TRIANGULATORS, &r.triangulation)?,
            between: resolve(&MATCHERS, &r.between)?,
            minimal: resolve(&SOLVERS, &r.minimal)?,
            solver: resolve(&SOLVERS, &r.solver)?,
            ..r.clone()
        };
        Ok(Self { settings: NetworkSettings { recognition, ..self.settings.clone() }, ..self.clone() })
    }

    /// Everything that it cannot be worked with for.
    pub fn unfit(&self) -> Vec<PipelineError> {
        let r = &self.settings.recognition;
        let filters =
            r.filters.iter().enumerate().map(|(k, filter)| (format!("filters.{k}"), faults(&FILTERS, filter)));
        let stages = [
            ("detector", faults(&DETECTORS, &r.detector)),
            ("locator", faults(&LOCATORS, &r.locator)),
            ("descriptor", faults(&DESCRIPTORS, &r.descriptor)),
            ("matcher", faults(&MATCHERS, &r.matcher)),
            ("refine", faults(&REFINEMENTS, &r.refine)),
            ("triangulation", faults(&TRIANGULATORS, &r.triangulation)),
            ("between", faults(&MATCHERS, &r.between)),
            ("minimal", faults(&SOLVERS, &r.minimal)),
            ("solver", faults(&SOLVERS, &r.solver)),
        ];
        let stages = filters.chain(stages.map(|(stage, errors)| (stage.to_owned(), errors)));
        let below = |(stage, errors): (String, Vec<PipelineError>)| {
            errors.into_iter().map(move |error| {
                let key =
                    error.key.iter().fold(format!("settings.recognition.{stage}"), |all, key| format!("{all}.{key}"));
                PipelineError { setting: "network", key: Some(key), ..error }
            })
        };
        let mut all: Vec<PipelineError> = stages.flat_map(below).collect();
        let mut rest = self.settings.clone();
        if !all.is_empty() {
            let Recognition {
                points,
                consensus_px,
                draws,
                least_points,
                budget,
                confidence,
                most_sigma,
                candidates,
                ..
            } = *r;
            let own =
                Recognition { points, consensus_px, draws, least_points, budget, confidence, ..Recognition::default() };
            rest.recognition = Recognition { most_sigma, candidates, ..own };
        }
        let own = each_unfit(&rest, NetworkSettings::check);
        all.extend(own.into_iter().map(|said| misfit("network", format!("settings.{said}"))));
        if self.read.is_empty() && !self.sha256.is_empty() {
            let message = "sha256 says which file is read; name it by `read`".to_owned();
            let (setting, key) = ("network", Some("sha256".to_owned()));
            all.push(PipelineError { setting, key, part: Part::Key, near: None, message });
        }
        all
    }
}

/// A run that lays key frames and finds them again.
#[derive(Debug)]
pub struct Explorer<'a> {
    keyframes: &'a Keyframes,
    traverse: Traverse<'a>,
    /// Of each target, its place among the network's objects, and the other way round.
    objects: Vec<usize>,
    targets: Vec<Option<usize>>,
}

impl<'a> Explorer<'a> {
    /// Begins a map of key frames, from the `earlier` map of another session where there is one.
    pub fn begin(keyframes: &'a Keyframes, targets: &[Target], rig: &'a StereoRig, earlier: Option<&Network>) -> Self {
        let mut network = earlier.cloned().unwrap_or_default();
        let mut objects = Vec::with_capacity(targets.len());
        for (target, place) in targets.iter().zip(places(targets)) {
            let known = network.objects.iter().position(|(name, _)| *name == target.name);
            objects.push(known.unwrap_or_else(|| {
                network.objects.push((target.name.clone(), place));
                network.objects.len() - 1
            }));
        }
        let of = |object: usize| objects.iter().position(|other| *other == object);
        let back = (0..network.objects.len()).map(of).collect();
        let traverse = Traverse::begin(&keyframes.settings, network, rig, Threads::One);
        Self { keyframes, traverse, objects, targets: back }
    }

    /// Moves the map's pose by the odometry; `None` where no motion is known.
    pub fn advance(&mut self, seconds: f64, motion: Option<&Local>) {
        self.traverse.advance(seconds, motion);
    }

    /// An object stands elsewhere than was believed.
    pub fn displaced(&mut self, found: &Displacement) {
        self.traverse.displaced(self.objects[found.object], found.place);
    }

    /// A frame: what it adds to the network, and what the network says of the pose.
    pub fn visit(
        &mut self,
        sight: &Sight,
        pair: &StereoPair<'_>,
        navigator: &mut Navigator<'_>,
        taken: &[Navigated],
        events: &mut Vec<NavigationEvent>,
    ) {
        let ours = |navigated: &Navigated| Navigated {
            object: self.objects[navigated.object],
            standing: navigated.standing.clone(),
        };
        let here = Here {
            stamp_ns: sight.stamp_ns,
            navigated: navigator.pose().map(ours),
            rough: sight.prior.as_ref().map(|prior| (prior.world_from_camera, prior.covariance)),
        };
        let fixes: Vec<Navigated> = taken.iter().map(ours).collect();
        let closure = self.traverse.visit(pair, &here, &fixes);
        match closure.sought {
            Some(Ok(found)) => {
                let (station, seen) = (found.station, &found.recognised);
                events.push(NavigationEvent::KeyframeFound {
                    keyframe: station,
                    found: seen.found,
                    matches: seen.matches,
                    sigma: seen.motion.covariance.position_sigma(),
                    given_up: found.given_up,
                });
                let theirs = |pose: Navigated| Some(Navigated { object: self.targets[pose.object]?, ..pose });
                if let Some(pose) = found.navigated.and_then(theirs) {
                    navigator.settle(&pose, format!("key frame {station} found again"));
                }
            }
            Some(Err(why)) => events.push(NavigationEvent::NoKeyframe { why: why.to_string() }),
            None => {}
        }
        if let Some(station) = closure.laid {
            events.push(NavigationEvent::KeyframeAdded { keyframe: station });
        }
    }

    /// The network as a file, where it is to be kept.
    pub fn finish(self) -> Option<String> {
        let network = self.traverse.finish();
        self.keyframes.lay.then(|| network.text(&self.keyframes.settings.recognition))
    }
}
