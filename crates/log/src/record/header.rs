//! What is the same for every frame of a trial.

use super::{
    line::ModelEdge,
    matrix::{Matrix3, Matrix4},
};

/// What a trial is: its question, its configuration, its cameras and what it looks for.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialHeader {
    /// The run this trial belongs to.
    pub run: String,
    /// The trial's name: the name of its file without `.mcap`.
    pub trial: String,
    /// The experiment's title; the report's headline.
    pub title: String,
    /// The English question the experiment asks.
    pub question: String,
    /// The command that reproduces the run.
    pub command: String,
    /// The values that this trial takes on the axes along which the experiment varies, in the
    /// experiment's order.
    pub axes: Vec<Axis>,
    /// The pipeline, stage by stage, in the order of the method.
    pub components: Vec<Component>,
    /// The resolved configuration, TOML.
    pub configuration: String,
    /// The site, `seafix-site/1`; empty if there is none.
    pub site: String,
    /// Where the frames come from, in words: rendered, points, a data set.
    pub source: String,
    /// The two cameras.
    pub rig: RigRecord,
    /// The left camera's pose in the vehicle's body: `p_body = body_from_camera · p_camera`.
    pub body_from_camera: Matrix4,
    /// The surveyed place of the site's frame in the world, if a world is known.
    pub world_from_site: Option<Matrix4>,
    /// What is searched for.
    pub targets: Vec<TargetModel>,
    /// Standard deviation of the prior's position, per world axis (m), if there is a prior.
    pub prior_position_sigma: Option<f64>,
    /// Standard deviation of the prior's attitude, per axis of the camera (rad), if there is a prior.
    pub prior_attitude_sigma: Option<f64>,
    /// Assumed standard deviation of a detected corner, per axis and image (px).
    pub pixel_sigma: Option<f64>,
    /// Named seeds.
    pub seeds: Vec<(String, u64)>,
    /// Versions of what made the run: the package, the commit, the compiler.
    pub versions: Vec<(String, String)>,
}

/// The value of this trial on one axis of the experiment.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Axis {
    /// The key that varies, as the experiment file writes it: `pipeline.solver`, `source.distance`.
    pub key: String,
    /// Its value here, as the experiment file writes it, without quotes: `kabsch`, `3.5`.
    pub value: String,
}

/// One stage of the pipeline and the component that does its work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Component {
    /// The stage: `detector`, `search`, `solver`, ….
    pub stage: String,
    /// The component's name.
    pub name: String,
    /// What it does, in a line.
    pub summary: String,
    /// Where it comes from, in the literature.
    pub source: String,
    /// Its settings, as `(key, value)` in TOML spelling.
    pub settings: Vec<(String, String)>,
}

/// Two calibrated cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct RigRecord {
    /// The left camera; its frame is the rig's.
    pub left: CameraRecord,
    /// The right camera.
    pub right: CameraRecord,
    /// The left camera's pose in the right one: `p_right = right_from_left · p_left`.
    pub right_from_left: Matrix4,
    /// Its rotation without rounding, as a quaternion (x, y, z, w); `None` in logs that are older than it.
    pub right_from_left_rotation: Option<[f64; 4]>,
    /// Whether rows of the two images correspond.
    pub rectified: bool,
}

/// One calibrated camera, with `plumb_bob` distortion or an equidistant lens.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraRecord {
    /// Width and height of its images (px).
    pub size: [u32; 2],
    /// The camera matrix K: fx 0 cx, 0 fy cy, 0 0 1.
    pub matrix: Matrix3,
    /// Distortion coefficients k1 k2 p1 p2 \[k3 \[k4 k5 k6 \[s1 s2 s3 s4\]\]\], or k1 k2 k3 k4 of an equidistant lens.
    pub distortion: Vec<f64>,
    /// Whether the lens is equidistant (Kannala–Brandt).
    pub equidistant: bool,
}

/// One thing searched for: an object, or the whole site.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetModel {
    /// The object's id; the site's name for the whole site.
    pub id: String,
    /// Its place in the site's frame: `p_site = site_from_object · p_object`; `None` where no survey tells,
    /// of any object but the one whose frame is the site's.
    pub site_from_object: Option<Matrix4>,
    /// Its feature points.
    pub points: Vec<ModelPoint>,
    /// A pose with a target registration error (TRE) beyond this (m) is wrong.
    pub alert_limit: f64,
    /// Its straight edges.
    pub edges: Vec<ModelEdge>,
}

/// One feature point of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelPoint {
    /// Its id.
    pub id: String,
    /// Where it is, object frame (m).
    pub at: [f64; 3],
    /// Standard deviation of each coordinate (m).
    pub sigma: f64,
}
