//! Point layouts in front of two cameras: the Monte Carlo of METHOD §3.

use std::path::Path;

use nalgebra::{Matrix4, UnitQuaternion, Vector3};
use seafix::{FrameData, Hints, PosePrior, SensorFrame};
use seafix_component::{Component, Fault, Settings, in_range};
use seafix_evaluation::{Seen, cramer_rao};
use seafix_geometry::{Body, Camera, Covariance6, MeasuredPoint, Object, Point, StereoRig, Transform, World, triad};
use seafix_referencing::{ModelPoint, Site, SiteObject};
use seafix_simulation::{Layout, Placed, Purpose, Shape, Stream, VirtualRig};
use serde::{Deserialize, Serialize};

use crate::sequence::{Sequence, Source, Truth};

/// A Monte Carlo of point layouts, as clouds of noisy points. Every layout is one object of a site, or several objects
/// that share its points; layouts are 1 km apart. Frame k is draw k / `layouts` of layout k mod `layouts`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct VirtualLayouts {
    /// The shape of the layouts: `spread` or `compact`.
    pub shape: Shape,
    /// The number of points of a layout.
    pub points: usize,
    /// The number of layouts.
    pub layouts: usize,
    /// The number of draws over all layouts.
    pub frames: usize,
    /// The mean depth (m), up to 100.
    pub distance: f64,
    /// The standard deviation of each pixel coordinate in each image (px).
    pub sigma_px: f64,
    /// The standard deviation of each coordinate of a model point (m), drawn again for each draw.
    pub model_sigma: f64,
    /// The fraction of draws with one wrong match: a random point is replaced by one uniform in its gate.
    pub wrong_match_rate: f64,
    /// The half-size (m) of the gate in which a wrong match lies.
    pub gate: f64,
    /// The stereo rig.
    pub rig: VirtualRig,
    /// The number of objects that share the points of a layout in turn.
    pub objects: usize,
    /// The standard deviation of each surveyed world coordinate of the objects' base points (m), drawn once.
    pub survey_sigma: f64,
    /// Whether all points are labelled, so that no search runs.
    pub labelled: bool,
}

impl Default for VirtualLayouts {
    fn default() -> Self {
        let Layout { shape, points, distance, sigma_px, model_sigma, rig, .. } = Layout::default();
        Self {
            shape,
            points,
            layouts: 20,
            frames: 10_000,
            distance,
            sigma_px,
            model_sigma,
            wrong_match_rate: 0.0,
            gate: 0.25,
            rig,
            objects: 1,
            survey_sigma: 0.0,
            labelled: true,
        }
    }
}

/// The prior of every draw: position (m) and attitude (rad) per axis. It serves to separate the layouts.
const PRIOR: (f64, f64) = (0.05, 0.01);
/// The distance between neighbouring layouts (m).
const APART: f64 = 1000.0;

impl Component for VirtualLayouts {
    const NAME: &'static str = "virtual-layouts";
    const SUMMARY: &'static str = "Monte Carlo of points before two cameras: many draws of many layouts";
    const SOURCE: &'static str = "ours";

    fn check(&self) -> Result<(), String> {
        in_range((3..=1000).contains(&self.points), "points", self.points, "3 to 1000")?;
        in_range((1..=1000).contains(&self.layouts), "layouts", self.layouts, "1 to 1000")?;
        in_range(self.frames >= 1, "frames", self.frames, "1 or more")?;
        // The comparison rejects NaN too.
        let far = self.distance > 0.0 && self.distance <= 100.0;
        in_range(far, "distance", self.distance, "a positive number of metres, at most 100")?;
        let noise = |value: f64, max: f64| value >= 0.0 && value <= max;
        in_range(noise(self.sigma_px, 100.0), "sigma-px", self.sigma_px, "0 to 100")?;
        in_range(noise(self.model_sigma, 1.0), "model-sigma", self.model_sigma, "0 to 1")?;
        in_range(noise(self.survey_sigma, 1.0), "survey-sigma", self.survey_sigma, "0 to 1")?;
        in_range(
            noise(self.wrong_match_rate, 1.0),
            "wrong-match-rate",
            self.wrong_match_rate,
            "a fraction from 0 to 1",
        )?;
        let gate = self.gate > 0.0 && self.gate <= 10.0;
        in_range(gate, "gate", self.gate, "a positive number of metres, at most 10")?;
        let enough = self.objects >= 1 && self.objects <= self.points / 3;
        in_range(enough, "objects", self.objects, "1 or more, with three points each")?;
        let focal = self.rig.focal > 0.0 && self.rig.focal.is_finite();
        in_range(focal, "rig.focal", self.rig.focal, "a positive number of pixels")?;
        let baseline = (1e-3..=5.0).contains(&self.rig.baseline);
        in_range(baseline, "rig.baseline", self.rig.baseline, "metres, from 0.001 to 5")?;
        self.rig.build().map(|_| ()).map_err(|error| error.to_string())
    }
}

impl Source for VirtualLayouts {
    fn open(&self, seed: u64, _folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let place = |number: usize| {
            let Self { shape, points, distance, sigma_px, model_sigma, rig, .. } = self.clone();
            let layout = Layout { shape, points, number: number as u64, distance, sigma_px, model_sigma, rig };
            layout.place(seed)
        };
        let rejected =
            |error: seafix_simulation::BadDive| vec![Fault::new(error.to_string(), Path::new("the source's settings"))];
        let placed: Vec<Placed> = (0..self.layouts).map(place).collect::<Result<_, _>>().map_err(rejected)?;
        let bounds = placed.iter().map(|placed| self.bound(placed)).collect();
        let all = placed.iter().enumerate();
        let (objects, stand): (Vec<SiteObject>, Vec<Transform<World, Object>>) =
            all.flat_map(|(k, placed)| (0..self.objects).map(move |part| self.object(seed, k, part, placed))).unzip();
        let name = format!("layouts, seed {seed}, {} m, {} px", self.distance, self.sigma_px);
        let site = Site { name: "layouts".to_owned(), frame: 0, objects, warnings: Vec::new() };
        Ok(Box::new(Layouts { settings: self.clone(), seed, name, site, placed, stand, bounds }))
    }
}

impl VirtualLayouts {
    /// The Cramér–Rao bound of a layout of one object.
    fn bound(&self, placed: &Placed) -> Option<Covariance6<Object, Camera>> {
        if self.objects > 1 {
            return None;
        }
        let pixels = Matrix4::identity() * self.sigma_px.powi(2);
        let seen = |&at: &Point<Object>| Seen { at, model_sigma: self.model_sigma, pixels };
        cramer_rao(&placed.rig, &placed.object_from_camera, &placed.model.iter().map(seen).collect::<Vec<_>>())
    }
}

/// The pose of a layout in the world.
fn world_from_layout(k: usize) -> Transform<World, Object> {
    Transform::new(UnitQuaternion::identity(), Vector3::new(APART * k as f64, 0.0, 0.0))
}

impl VirtualLayouts {
    /// Part `part` of layout k as an object by survey, and its true pose. Its frame follows the rule of Fig. 2 on its
    /// largest triangle.
    fn object(&self, seed: u64, k: usize, part: usize, placed: &Placed) -> (SiteObject, Transform<World, Object>) {
        let points: Vec<Point<World>> =
            placed.model.iter().skip(part).step_by(self.objects).map(|&at| world_from_layout(k) * at).collect();
        let n = points.len();
        let square = |[a, b, c]: [usize; 3]| (points[b] - points[a]).cross(&(points[c] - points[a])).norm_squared();
        let all = (0..n).flat_map(|a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c])));
        let base = all.max_by(|a, b| square(*a).total_cmp(&square(*b))).expect("at least three points");
        let stands = |base: &[Point<World>; 3]| triad(&base[0], &base[1], &base[2]).expect("a layout is not collinear");
        let truly = stands(&base.map(|i| points[i]));
        let mut stream = Stream::new(seed, k as u64, part as u64, Purpose::Survey);
        let base_in_world = base.map(|i| points[i] + stream.normal3(self.survey_sigma));
        let own = |(i, at): (usize, &Point<World>)| ModelPoint {
            sigma: self.model_sigma,
            ..ModelPoint::exact(format!("P{i}"), truly.inverse() * *at)
        };
        let object = SiteObject {
            id: if self.objects == 1 { format!("layout{k:02}") } else { format!("layout{k:02}-{part}") },
            base,
            base_in_world: Some(base_in_world),
            survey_sigma: self.survey_sigma,
            world_from_object: Some(stands(&base_in_world)),
            points: points.iter().enumerate().map(own).collect(),
            edges: Vec::new(),
            interest: Vec::new(),
        };
        (object, truly)
    }
}

struct Layouts {
    settings: VirtualLayouts,
    seed: u64,
    name: String,
    site: Site,
    placed: Vec<Placed>,
    /// The true pose of each object.
    stand: Vec<Transform<World, Object>>,
    bounds: Vec<Option<Covariance6<Object, Camera>>>,
}

impl Layouts {
    /// The layout and the draw of a frame.
    fn of(&self, index: usize) -> (usize, u64) {
        (index % self.placed.len(), (index / self.placed.len()) as u64)
    }

    /// The label of a layout's point: object and point index.
    fn name_of(&self, layout: usize, point: usize) -> (usize, usize) {
        let objects = self.settings.objects;
        (layout * objects + point % objects, point / objects)
    }

    /// The wrong match of a draw, if it has one: the index of the point and its replacement.
    fn mismatch(&self, layout: usize, draw: u64) -> Option<(usize, MeasuredPoint)> {
        let mut stream = Stream::new(self.seed, layout as u64, draw, Purpose::Mismatches);
        (stream.unit() < self.settings.wrong_match_rate).then(|| {
            let (placed, wrong) = (&self.placed[layout], stream.below(self.settings.points));
            (wrong, placed.elsewhere(&placed.model[wrong], self.settings.gate, &mut stream))
        })
    }

    fn world_from_camera(&self, layout: usize) -> Transform<World, Camera> {
        world_from_layout(layout) * self.placed[layout].object_from_camera
    }
}

impl Sequence for Layouts {
    fn name(&self) -> &str {
        &self.name
    }

    fn site(&self) -> &Site {
        &self.site
    }

    fn rig(&self) -> &StereoRig {
        &self.placed[0].rig
    }

    fn body_from_camera(&self) -> Transform<Body, Camera> {
        Transform::identity()
    }

    fn images(&self) -> bool {
        false
    }

    fn labelled(&self) -> bool {
        self.settings.labelled
    }

    fn frames(&self) -> usize {
        self.settings.frames
    }

    fn prior_sigma(&self) -> Option<(f64, f64)> {
        Some(PRIOR)
    }

    fn pixel_sigma(&self) -> Option<f64> {
        Some(self.settings.sigma_px)
    }

    fn sensor_frame(&self, index: usize) -> Result<SensorFrame, Fault> {
        let (layout, draw) = self.of(index);
        let (position, attitude) = PRIOR;
        let mut stream = Stream::new(self.seed, layout as u64, draw, Purpose::Prior);
        let (turn, step) = (stream.normal3(attitude), stream.normal3(position));
        let xi = [turn.x, turn.y, turn.z, step.x, step.y, step.z].into();
        let prior = PosePrior {
            world_from_camera: self.world_from_camera(layout).perturbed(&xi),
            covariance: Covariance6::isotropic(attitude, position),
        };
        // A draw that noise makes impossible to triangulate counts as a frame without points.
        let mut cloud = self.placed[layout].draw(draw).unwrap_or_default();
        if let Some((wrong, other)) = self.mismatch(layout, draw)
            && !cloud.is_empty()
        {
            cloud[wrong] = other;
        }
        let hints = match self.settings.labelled {
            true => Hints::Labels((0..cloud.len()).map(|point| self.name_of(layout, point)).collect()),
            false => Hints::Nothing,
        };
        let frame_data = FrameData::Points(cloud);
        let stamp_ns = index as u64 * 100_000_000;
        Ok(SensorFrame { stamp_ns, frame_data, prior: Some(prior), hints, readings: Vec::new() })
    }

    fn truth(&self, index: usize) -> Option<Truth> {
        let (layout, _) = self.of(index);
        Some(Truth {
            world_from_camera: self.world_from_camera(layout),
            world_from_object: self.stand.iter().copied().map(Some).collect(),
            visible: Some((0..self.settings.points).map(|point| self.name_of(layout, point)).collect()),
            bound: self.bounds[layout].map(|bound| (layout, bound)),
            answer: None,
        })
    }

    fn inputs(&self) -> Result<Vec<(String, String)>, Fault> {
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_a_draw_of_a_layout_seen_from_its_true_pose() {
        let settings = VirtualLayouts { layouts: 3, frames: 7, sigma_px: 0.0, ..VirtualLayouts::default() };
        let sequence = settings.open(1, Path::new(".")).unwrap();
        assert_eq!((sequence.frames(), sequence.site().objects.len()), (7, 3));
        for index in 0..7 {
            let (sensor_frame, truth) = (sequence.sensor_frame(index).unwrap(), sequence.truth(index).unwrap());
            let FrameData::Points(cloud) = sensor_frame.frame_data else { panic!("points") };
            let object = &sequence.site().objects[index % 3];
            let camera_from_object = truth.world_from_camera.inverse() * truth.world_from_object[index % 3].unwrap();
            for (seen, known) in cloud.iter().zip(&object.points) {
                assert!((camera_from_object * known.at).distance(&seen.position.at) < 1e-9);
            }
        }
    }

    #[test]
    fn wrong_matches_come_at_their_rate_and_lie_in_their_gate() {
        let right = VirtualLayouts { layouts: 5, frames: 2000, ..VirtualLayouts::default() };
        let some = VirtualLayouts { wrong_match_rate: 0.1, ..right.clone() };
        let [right, some] = [right, some].map(|settings| settings.open(1, Path::new(".")).unwrap());
        let cloud = |sequence: &dyn Sequence, index| match sequence.sensor_frame(index).unwrap().frame_data {
            FrameData::Points(cloud) => cloud,
            _ => panic!("points"),
        };
        let mut draws = 0;
        for index in 0..2000 {
            let (a, b) = (cloud(&*right, index), cloud(&*some, index));
            let moved: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a.position.at - b.position.at).amax()).collect();
            let wrong: Vec<&f64> = moved.iter().filter(|off| **off > 0.0).collect();
            assert!(wrong.len() <= 1 && wrong.iter().all(|off| **off < 0.4), "{wrong:?}");
            draws += wrong.len();
        }
        // The expected number is 200 ± 13.4.
        assert!((150..250).contains(&draws), "{draws}");
    }

    /// Layouts stand in a row, and a camera may look along it. A layout 1 km away without points in the cloud is not
    /// attempted. When every target in the view of the prior was attempted, 40 frames had 124 rejections besides their
    /// 40 fixes.
    #[test]
    fn of_all_layouts_that_is_attempted_whose_points_are_there() {
        let settings = VirtualLayouts { layouts: 20, frames: 20, ..VirtualLayouts::default() };
        let sequence = settings.open(1, Path::new(".")).unwrap();
        let pipeline = seafix::PipelineSettings {
            solver: seafix_component::Choice::named("kabsch"),
            ..seafix::PipelineSettings::default()
        };
        let (stages, targets) = (pipeline.build().unwrap(), sequence.site().targets(pipeline.target).unwrap());
        let mut rng = Stream::new(1, 0, 0, Purpose::Search);
        for index in 0..20 {
            let found = stages.run(&sequence.sensor_frame(index).unwrap(), &targets, sequence.rig(), rng.rng());
            let attempted: Vec<usize> = found.attempts.iter().map(|attempt| attempt.target).collect();
            assert_eq!(attempted, [index % 20]);
        }
    }

    #[test]
    fn a_layout_may_be_several_objects_that_a_survey_misplaces() {
        let settings = VirtualLayouts {
            layouts: 2,
            objects: 3,
            survey_sigma: 0.01,
            sigma_px: 0.0,
            frames: 4,
            ..VirtualLayouts::default()
        };
        let sequence = settings.open(1, Path::new(".")).unwrap();
        assert_eq!(sequence.site().objects.iter().map(|o| o.points.len()).collect::<Vec<_>>(), [5, 4, 4, 5, 4, 4]);
        for index in 0..4 {
            let (sensor_frame, truth) = (sequence.sensor_frame(index).unwrap(), sequence.truth(index).unwrap());
            let FrameData::Points(cloud) = sensor_frame.frame_data else { panic!("points") };
            let Hints::Labels(names) = sensor_frame.hints else { panic!("named") };
            for (seen, (object, point)) in cloud.iter().zip(names) {
                let known = &sequence.site().objects[object];
                let camera_from_object = truth.world_from_camera.inverse() * truth.world_from_object[object].unwrap();
                assert!((camera_from_object * known.points[point].at).distance(&seen.position.at) < 1e-9);
                let off = known.world_from_object.unwrap().error_to(&truth.world_from_object[object].unwrap());
                assert!(off.norm() > 1e-4 && off.norm() < 0.5, "{off}");
            }
        }
    }
}
