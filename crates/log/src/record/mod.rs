//! Plain records: what a trial hands to its log and gets back from it.

mod frame;
mod header;
mod inputs;
mod inspection;
mod mirror;
mod navigation;
mod region;
mod target;
mod totals;

pub use frame::{
    CloudPoint, FrameRecord, FrameTimes, GreyImage, PixelPair, PriorRecord, SharedStages, TruthRecord, VisiblePoint,
};
pub use header::{Axis, CameraRecord, Component, ModelPoint, RigRecord, TargetModel, TrialHeader};
pub use inputs::{AnswerRecord, ExactPose, Inputs, ProblemRecord, SensorReading, SitePoint, TrueState};
pub use inspection::PointOfInterest;
pub use navigation::{ELSEWHERE, NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep};
pub use region::Region;
pub use target::{Alternative, Evaluation, Integrity, Outcome, Pair, TargetRecord, TargetTimes};
pub use totals::Totals;

/// Three rows of three numbers.
pub type Matrix3 = [[f64; 3]; 3];

/// Four rows of four numbers; a rigid motion `a_from_b` for column vectors.
pub type Matrix4 = [[f64; 4]; 4];

/// Six rows of six numbers; a covariance of ξ = (φ, ρ), rotation first.
pub type Matrix6 = [[f64; 6]; 6];
